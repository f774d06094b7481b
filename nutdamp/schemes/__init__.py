"""The schemes by name. Each lives in one module with ``schedule(spacecraft, options) -> Schedule``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import import_module
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from nutdamp.units import LARGEST

if TYPE_CHECKING:  # so that the command line can know the names without loading numpy
    from nutdamp.schedule import Schedule
    from nutdamp.schemes.tools.symmetric_model import Model
    from nutdamp.spacecraft import Spacecraft

CLASSIC = ("one-pulse", "two-pulse", "four-pulse")
"""The schemes of Magnus 1970, planned when none is named."""

POINTING = ("two-pulse", "half-cone", "rhumb-line", "optimal")
"""The schemes that can turn the spin axis to a target axis, planned when there is one and none is named."""

AIMED = ("half-cone", "rhumb-line")
"""The schemes that do nothing else, and need a target."""

SUNLIT = ("rhumb-line",)
"""The schemes that keep their pulses at a fixed phase to the Sun, where the goal says where it is."""

SPINNING = ("optimal",)
"""The schemes that can set the spin rate."""

PLANNED = (*CLASSIC, "optimal", "half-cone", "rhumb-line")
"""The schemes that plan pulses."""

NAMES = (*PLANNED, "none")


LEAST = ("propellant", "impulse", "time", "pulses")
"""What the scheme optimal can save."""


class Options(NamedTuple):
    """What a user may ask of the schemes; each reads what concerns it.

    ``on_time`` s, pulse length of four-pulse (None: min(max_on_time, T_ω/8)) and of rhumb-line (None: an eighth of a
    spin turn). ``coarse``: four-pulse without a
    last, shorter pulse. ``literal``: two-pulse as printed in Magnus 1970. ``with_disturbances``: plan on the motion
    with the disturbances of the file, which is otherwise only judged with them. ``least``: what optimal saves,
    propellant (impulse where that is unknown), impulse, time or pulses; ``free_axis``: optimal lets H go where it
    likes, ``shift`` up to so many rad from its target. ``cones``: half cones of half-cone (None: the fewest that are
    nearly cheapest). ``per_turn``: pulses of rhumb-line in each spin turn.
    """

    on_time: float | None = None
    coarse: bool = False
    literal: bool = False
    with_disturbances: bool = False
    least: str = "propellant"
    free_axis: bool = False
    shift: float | None = None
    cones: int | None = None
    per_turn: int = 1

    def faults(self) -> Iterator[tuple[str, str]]:
        """Options that make no sense: name, and what is expected of it."""
        for name, (sensible, expected) in _SENSIBLE.items():
            if not sensible(getattr(self, name)):
                yield name, f"expected {expected}"
        if self.shift is not None and self.free_axis:
            yield "shift", "expected none beside a free axis, where H may end anywhere"


def is_number(value: Any) -> bool:
    """Whether Python or numpy would call it a real number, of sensible size."""
    return issubclass(type(value), Real) and type(value) is not bool and abs(value) <= LARGEST


def is_count(value: Any) -> bool:
    """Whether it is a whole number of at least 1."""
    return issubclass(type(value), Integral) and type(value) is not bool and value >= 1


def _flag(value: Any) -> bool:
    return isinstance(value, bool)


_SENSIBLE: dict[str, tuple[Callable[[Any], bool], str]] = {
    "on_time": (lambda value: value is None or (is_number(value) and value > 0.0), "a time above zero, in s"),
    "coarse": (_flag, "True or False"),
    "literal": (_flag, "True or False"),
    "with_disturbances": (_flag, "True or False"),
    "least": (lambda value: isinstance(value, str) and value in LEAST, f"one of {', '.join(LEAST)}"),
    "free_axis": (_flag, "True or False"),
    "shift": (lambda value: value is None or (is_number(value) and value >= 0.0), "an angle of at least 0, in rad"),
    "cones": (lambda value: value is None or is_count(value), "a whole number of at least 1"),
    "per_turn": (is_count, "a whole number of at least 1"),
}
"""For each option whether a value makes sense, and what does."""


def schedule(name: str, spacecraft: Spacecraft, options: Options) -> Schedule:
    """Pulses of the scheme ``name``, disturbances and all.

    The scheme plans on the symmetric, undisturbed `model` of the spacecraft; where that is not exact, the last pulse
    (the last four of schemes that keep or turn H) is trimmed on the true motion. Raises Infeasible with the reason
    where the scheme cannot work within the limits, and KeyError for a name not in `NAMES`.
    """
    if name not in NAMES:
        raise KeyError(name)
    from nutdamp.schemes.tools.symmetric_model import model_of

    model = model_of(spacecraft)
    scheme = import_module(_module(name))
    return _finished(name, model, cast("Schedule", scheme.schedule(model.body, options)), options)


def alternatives(name: str, spacecraft: Spacecraft, options: Options) -> list[Schedule]:
    """Schedules that the scheme ``name`` weighs against the one that `schedule` gives, which may be among them.

    Raises KeyError for a name not in `NAMES`.
    """
    if name not in NAMES:
        raise KeyError(name)
    scheme = import_module(_module(name))
    if not hasattr(scheme, "alternatives"):
        return []
    from nutdamp.schemes.tools.symmetric_model import model_of

    model = model_of(spacecraft)
    return [_finished(name, model, made, options) for made in scheme.alternatives(model.body, options)]


def _module(name: str) -> str:
    return f"nutdamp.schemes.{name.replace('-', '_')}"


def _finished(name: str, model: Model, made: Schedule, options: Options) -> Schedule:
    """A schedule for the ``model`` as one for the true spacecraft, trimmed on its motion where that differs."""
    from nutdamp.schemes.tools import least_squares

    made = model.translate(made)
    if not model.exact:
        made = made.without_proof
    if model.truth.goal.axis is not None and name not in POINTING and made.pulses:
        made = replace(made, notes=(*made.notes, f"does not point: the target is left to {', '.join(POINTING)}"))
    if model.exact or options.coarse or options.literal or not made.pulses:
        return made
    keeps = name in POINTING and not (name == "optimal" and options.free_axis)
    # The last pulses, which know what the others did on the model, undo what the true motion made of them.
    chosen = tuple(range(-min(len(made), 4), 0)) if keeps else (-1,)
    spin = name == "optimal" and model.truth.goal.spin is not None
    if spin:  # and the pulse that gives most to the spin
        chosen = (*chosen, max(range(len(made)), key=lambda number: abs(float(made.pulses[number].impulse[2]))))
    bounds = getattr(import_module(_module(name)), "on_times", lambda _: least_squares.ANY)(options)
    return least_squares.refine(model.truth, made, chosen=chosen, momentum=keeps, spin=spin, on_times=bounds)
