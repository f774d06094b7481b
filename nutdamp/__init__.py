"""Nutation-damping planner for spinning spacecraft.

One stream runs through the package: spacecraft file -> Spacecraft -> scheme -> Schedule -> flight -> report.
As a library it is these few names, of which `nutdamp.api` tells more; each is loaded on first use.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nutdamp import errors
    from nutdamp.api import *
    from nutdamp.errors import NutdampError


__all__ = [
    "Budget",
    "Comparison",
    "Dispersion",
    "Fitted",
    "Flight",
    "FourPulseOptions",
    "HalfConeOptions",
    "LoopDispersion",
    "NutdampError",
    "OptimalOptions",
    "Options",
    "Plan",
    "Report",
    "Residual",
    "RhumbLineOptions",
    "Spacecraft",
    "Track",
    "Trade",
    "TwoPulseOptions",
    "Verified",
    "__version__",
    "budget",
    "compare",
    "disperse",
    "disperse_loop",
    "errors",
    "example",
    "export",
    "fit",
    "load",
    "load_schedule",
    "plan",
    "read",
    "report",
    "trade",
    "verify",
]

__version__ = "0.3.0.dev0"


if not TYPE_CHECKING:  # or else a type checker would believe in any name

    def __getattr__(name: str) -> Any:
        """Load a public name when it is first requested: the command line, too, begins here, and must begin fast."""
        if name not in __all__:
            raise AttributeError(f"module 'nutdamp' has no attribute {name!r}")
        from importlib import import_module

        if name == "errors":
            return import_module("nutdamp.errors")
        value = getattr(import_module("nutdamp.errors" if name == "NutdampError" else "nutdamp.api"), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
