"""Nutation-damping planner for spinning spacecraft.

One stream runs through the package: spacecraft file -> Spacecraft -> scheme -> Schedule -> flight -> report.
As a library it is these few names, of which `nutdamp.api` tells more; each is loaded on first use.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nutdamp import errors
    from nutdamp.api import (
        budget,
        check,
        compare,
        disperse,
        disperse_loop,
        example,
        export,
        fit,
        load,
        load_schedule,
        loop,
        plan,
        read,
        report,
        robust,
        simulate,
        trade,
        verify,
        verify_loop,
    )
    from nutdamp.control_loop.budget import Budget
    from nutdamp.control_loop.dispersion import LoopDispersion
    from nutdamp.control_loop.evaluation import LoopPlan, LoopVerification
    from nutdamp.errors import NutdampError
    from nutdamp.estimation.forecast import Fitted
    from nutdamp.flight.propagation import Flight, Residual, Track
    from nutdamp.montecarlo.study import Dispersion
    from nutdamp.page.html import Report
    from nutdamp.planning.decision import Comparison, Simulation
    from nutdamp.planning.plan import Plan, Verified
    from nutdamp.planning.robust import RobustComparison
    from nutdamp.planning.tradeoff import Trade
    from nutdamp.schemes.catalogue import (
        FourPulseOptions,
        HalfConeOptions,
        OptimalOptions,
        Options,
        RhumbLineOptions,
        TwoPulseOptions,
    )
    from nutdamp.spacecraft.model import Spacecraft
    from nutdamp.views.check import CheckedFile


__all__ = [
    "Budget",
    "CheckedFile",
    "Comparison",
    "Dispersion",
    "Fitted",
    "Flight",
    "FourPulseOptions",
    "HalfConeOptions",
    "LoopDispersion",
    "LoopPlan",
    "LoopVerification",
    "NutdampError",
    "OptimalOptions",
    "Options",
    "Plan",
    "Report",
    "Residual",
    "RhumbLineOptions",
    "RobustComparison",
    "Simulation",
    "Spacecraft",
    "Track",
    "Trade",
    "TwoPulseOptions",
    "Verified",
    "__version__",
    "budget",
    "check",
    "compare",
    "disperse",
    "disperse_loop",
    "errors",
    "example",
    "export",
    "fit",
    "load",
    "load_schedule",
    "loop",
    "plan",
    "read",
    "report",
    "robust",
    "simulate",
    "trade",
    "verify",
    "verify_loop",
]

__version__ = "0.3.0.dev0"

_HOMES = {
    "nutdamp.control_loop.budget": ("Budget",),
    "nutdamp.control_loop.dispersion": ("LoopDispersion",),
    "nutdamp.control_loop.evaluation": ("LoopPlan", "LoopVerification"),
    "nutdamp.errors": ("NutdampError",),
    "nutdamp.estimation.forecast": ("Fitted",),
    "nutdamp.flight.propagation": ("Flight", "Residual", "Track"),
    "nutdamp.montecarlo.study": ("Dispersion",),
    "nutdamp.page.html": ("Report",),
    "nutdamp.planning.decision": ("Comparison", "Simulation"),
    "nutdamp.planning.plan": ("Plan", "Verified"),
    "nutdamp.planning.robust": ("RobustComparison",),
    "nutdamp.planning.tradeoff": ("Trade",),
    "nutdamp.spacecraft.model": ("Spacecraft",),
    "nutdamp.views.check": ("CheckedFile",),
}
"""Modules of the public classes; options of schemes are those of the catalogue, functions those of `nutdamp.api`."""


if not TYPE_CHECKING:  # or else a type checker would believe in any name

    def __getattr__(name: str) -> Any:
        """Load a public name when it is first requested: the command line, too, begins here, and must begin fast."""
        if name not in __all__:
            raise AttributeError(f"module 'nutdamp' has no attribute {name!r}")
        from importlib import import_module

        if name == "errors":
            return import_module("nutdamp.errors")
        import_module("nutdamp.api")  # results show themselves by what it names
        usual = "nutdamp.schemes.catalogue" if name.endswith("Options") else "nutdamp.api"
        home = next((module for module, names in _HOMES.items() if name in names), usual)
        value = getattr(import_module(home), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted(__all__)
