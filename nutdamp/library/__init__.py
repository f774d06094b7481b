"""nutdamp as a library: load a spacecraft, plan a scheme, fly it, and take the numbers along.

    import nutdamp

    spacecraft = nutdamp.load("spacecraft.yaml")
    plan = nutdamp.plan(spacecraft, "two-pulse")
    flight = plan.fly()
    flight.to_csv("track.csv")

It is what the command line calls. The types are those of the modules below; how they show and write themselves is in
`views`. Attributes are SI and radians, vectors in principal axes unless they say that they are in the axes of the
spacecraft file; arrays with named fields carry the names and units of the CSV files.
"""

from nutdamp.comparison import Comparison as Comparison
from nutdamp.flight import Flight as Flight
from nutdamp.flight import Residual as Residual
from nutdamp.library.calls import compare as compare
from nutdamp.library.calls import load_schedule as load_schedule
from nutdamp.library.calls import plan as plan
from nutdamp.library.craft import example as example
from nutdamp.library.craft import load as load
from nutdamp.library.craft import read as read
from nutdamp.library.fits import Fitted as Fitted
from nutdamp.library.fits import fit as fit
from nutdamp.library.reports import Report as Report
from nutdamp.library.reports import report as report
from nutdamp.library.studies import Budget as Budget
from nutdamp.library.studies import Dispersion as Dispersion
from nutdamp.library.studies import LoopDispersion as LoopDispersion
from nutdamp.library.studies import Trade as Trade
from nutdamp.library.studies import Verified as Verified
from nutdamp.library.studies import budget as budget
from nutdamp.library.studies import disperse as disperse
from nutdamp.library.studies import disperse_loop as disperse_loop
from nutdamp.library.studies import export as export
from nutdamp.library.studies import trade as trade
from nutdamp.library.studies import verify as verify
from nutdamp.planning import Plan as Plan
from nutdamp.schemes import Options as Options
from nutdamp.schemes.options import FourPulseOptions as FourPulseOptions
from nutdamp.schemes.options import HalfConeOptions as HalfConeOptions
from nutdamp.schemes.options import OptimalOptions as OptimalOptions
from nutdamp.schemes.options import RhumbLineOptions as RhumbLineOptions
from nutdamp.schemes.options import TwoPulseOptions as TwoPulseOptions
from nutdamp.spacecraft import Spacecraft as Spacecraft
from nutdamp.track import Track as Track
