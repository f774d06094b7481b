"""nutdamp as a library: load a spacecraft, plan a scheme, fly it, and take the numbers along.

    import nutdamp

    spacecraft = nutdamp.load("spacecraft.yaml")
    plan = nutdamp.plan(spacecraft, "two-pulse")
    flight = plan.fly()
    flight.to_csv("track.csv")

It stands beside the command line, on top of everything else: thin objects that hold the results of the floors below
(``core``) and add what knows files and screens. Attributes are SI and radians, vectors in the axes of the spacecraft
file; arrays with named fields carry the names and units of the CSV files.
"""

from nutdamp.flight import Residual
from nutdamp.library.calls import compare, load_schedule, plan
from nutdamp.library.craft import Spacecraft, example, load, read
from nutdamp.library.results import Comparison, Flight, Plan
from nutdamp.library.studies import Dispersion, Trade, Verified, disperse, export, trade, verify
from nutdamp.schemes import Options
from nutdamp.schemes.options import FourPulseOptions, HalfConeOptions, OptimalOptions, RhumbLineOptions, TwoPulseOptions
from nutdamp.track import Track

__all__ = [
    "Comparison",
    "Dispersion",
    "Flight",
    "FourPulseOptions",
    "HalfConeOptions",
    "OptimalOptions",
    "Options",
    "Plan",
    "Residual",
    "RhumbLineOptions",
    "Spacecraft",
    "Track",
    "Trade",
    "TwoPulseOptions",
    "Verified",
    "compare",
    "disperse",
    "example",
    "export",
    "load",
    "load_schedule",
    "plan",
    "read",
    "trade",
    "verify",
]
