"""Nutation-damping planner for spinning spacecraft.

One stream runs through the package: spacecraft file -> Spacecraft -> scheme -> Schedule -> flight
-> report. The public names are below; `nutdamp.api` explains them. Each is loaded on first use.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nutdamp import errors as errors
    from nutdamp.api import (
        budget as budget,
        check as check,
        compare as compare,
        disperse as disperse,
        disperse_loop as disperse_loop,
        example as example,
        export as export,
        fit as fit,
        load as load,
        load_schedule as load_schedule,
        loop as loop,
        plan as plan,
        read as read,
        report as report,
        robust as robust,
        simulate as simulate,
        trade as trade,
        verify as verify,
        verify_loop as verify_loop,
    )
    from nutdamp.control_loop.budget import Budget as Budget
    from nutdamp.control_loop.dispersion import LoopDispersion as LoopDispersion
    from nutdamp.control_loop.evaluation import (
        LoopPlan as LoopPlan,
        LoopVerification as LoopVerification,
    )
    from nutdamp.errors import NutdampError as NutdampError
    from nutdamp.estimation.results import Fitted as Fitted
    from nutdamp.flight.propagation import (
        Flight as Flight,
        Residual as Residual,
        Track as Track,
    )
    from nutdamp.page.report import Report as Report
    from nutdamp.planning.decision import Comparison as Comparison
    from nutdamp.planning.plan import Plan as Plan
    from nutdamp.planning.robust import RobustComparison as RobustComparison
    from nutdamp.planning.screening import Dispersion as Dispersion
    from nutdamp.planning.simulation import (
        Simulation as Simulation,
        Verified as Verified,
    )
    from nutdamp.planning.tradeoff import Trade as Trade
    from nutdamp.planning.verdict import Verdict as Verdict
    from nutdamp.schemes.catalogue import (
        FourPulseOptions as FourPulseOptions,
        HalfConeOptions as HalfConeOptions,
        OptimalOptions as OptimalOptions,
        Options as Options,
        RhumbLineOptions as RhumbLineOptions,
        TwoPulseOptions as TwoPulseOptions,
    )
    from nutdamp.spacecraft.model import Spacecraft as Spacecraft
    from nutdamp.views.check import CheckedFile as CheckedFile

__version__ = "0.4.0"

_HOMES: dict[str, tuple[str, ...]] = {
    "nutdamp.api": (
        "budget",
        "check",
        "compare",
        "disperse",
        "disperse_loop",
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
    ),
    "nutdamp.control_loop.budget": ("Budget",),
    "nutdamp.control_loop.dispersion": ("LoopDispersion",),
    "nutdamp.control_loop.evaluation": ("LoopPlan", "LoopVerification"),
    "nutdamp.errors": ("NutdampError",),
    "nutdamp.estimation.results": ("Fitted",),
    "nutdamp.flight.propagation": ("Flight", "Residual", "Track"),
    "nutdamp.page.report": ("Report",),
    "nutdamp.planning.decision": ("Comparison",),
    "nutdamp.planning.plan": ("Plan",),
    "nutdamp.planning.robust": ("RobustComparison",),
    "nutdamp.planning.screening": ("Dispersion",),
    "nutdamp.planning.simulation": ("Simulation", "Verified"),
    "nutdamp.planning.tradeoff": ("Trade",),
    "nutdamp.planning.verdict": ("Verdict",),
    "nutdamp.schemes.catalogue": (
        "FourPulseOptions",
        "HalfConeOptions",
        "OptimalOptions",
        "Options",
        "RhumbLineOptions",
        "TwoPulseOptions",
    ),
    "nutdamp.spacecraft.model": ("Spacecraft",),
    "nutdamp.views.check": ("CheckedFile",),
}
"""Modules of the public names."""

__all__ = ["__version__", "errors", *(name for names in _HOMES.values() for name in names)]


if not TYPE_CHECKING:  # or else a type checker would believe in any name

    def __getattr__(name: str) -> Any:
        """Load a public name when it is first requested: the command line, too, begins here, and
        must begin fast.
        """
        if name not in __all__:
            raise AttributeError(f"module 'nutdamp' has no attribute {name!r}")
        from importlib import import_module

        if name == "errors":
            return import_module("nutdamp.errors")
        home = next(module for module, names in _HOMES.items() if name in names)
        value = getattr(import_module(home), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted(__all__)
