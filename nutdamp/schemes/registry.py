"""The schemes there are, and what each can do. Loads none of them: the command line needs the names alone."""

from __future__ import annotations

from dataclasses import dataclass

from nutdamp.schemes.options import (
    CommandBlockOptions,
    FourPulseOptions,
    HalfConeOptions,
    OptimalOptions,
    RhumbLineOptions,
    SchemeOptions,
    TwoPulseOptions,
)


@dataclass(frozen=True)
class Scheme:
    """A scheme: its ``name``, the ``module`` with its function ``schedule``, and the class of its ``options``.

    ``classic``: of Magnus 1970. ``points``: can turn the spin axis to a target, and is planned when there is one and
    none is named; ``only_points``: does nothing else, and needs one. ``reads_sun``: keeps its pulses at a fixed phase
    to the Sun. ``sets_spin``: can change the spin rate. ``weighs_alternatives``: has a
    function ``alternatives`` too, of schedules about as good. ``body_fixed``: fires channels of
    the file only, no steerable torquer. ``reads_commands``: makes blocks of the ``commands``
    of the file, and is planned where there are some. ``on_true_body``: needs no symmetric model. ``slow``: may take
    seconds.
    """

    name: str
    module: str
    options: type[SchemeOptions] = SchemeOptions
    fires: bool = True
    classic: bool = False
    points: bool = False
    only_points: bool = False
    reads_sun: bool = False
    sets_spin: bool = False
    weighs_alternatives: bool = False
    body_fixed: bool = False
    reads_commands: bool = False
    on_true_body: bool = False
    slow: bool = False


ONE_PULSE = Scheme("one-pulse", "nutdamp.schemes.one_pulse", classic=True)
TWO_PULSE = Scheme(
    "two-pulse", "nutdamp.schemes.two_pulse", TwoPulseOptions, classic=True, points=True, weighs_alternatives=True
)
FOUR_PULSE = Scheme("four-pulse", "nutdamp.schemes.four_pulse", FourPulseOptions, classic=True, body_fixed=True)
OPTIMAL = Scheme(
    "optimal",
    "nutdamp.schemes.optimal.search",
    OptimalOptions,
    points=True,
    sets_spin=True,
    body_fixed=True,
    slow=True,
)
HALF_CONE = Scheme(
    "half-cone", "nutdamp.schemes.half_cone", HalfConeOptions, points=True, only_points=True, body_fixed=True
)
RHUMB_LINE = Scheme(
    "rhumb-line",
    "nutdamp.schemes.rhumb_line",
    RhumbLineOptions,
    points=True,
    only_points=True,
    reads_sun=True,
    body_fixed=True,
)
COMMAND_BLOCK = Scheme(
    "command-block",
    "nutdamp.schemes.command_block",
    CommandBlockOptions,
    reads_commands=True,
    sets_spin=True,
    on_true_body=True,
    body_fixed=True,
    slow=True,
)
NONE = Scheme("none", "nutdamp.schemes.none", fires=False)
"""Free motion, for comparison."""

SCHEMES = {
    scheme.name: scheme
    for scheme in (ONE_PULSE, TWO_PULSE, FOUR_PULSE, OPTIMAL, HALF_CONE, RHUMB_LINE, COMMAND_BLOCK, NONE)
}
NAMES = tuple(SCHEMES)
PLANNED = tuple(name for name, scheme in SCHEMES.items() if scheme.fires)
CLASSIC = tuple(name for name, scheme in SCHEMES.items() if scheme.classic)
COMPARED = (*CLASSIC, OPTIMAL.name)
"""What is planned where none is named and there is no target."""
POINTING = tuple(scheme.name for scheme in sorted(SCHEMES.values(), key=lambda one: one.slow) if scheme.points)
"""In the order in which they are shown: those that take seconds last."""
SPINNING = tuple(name for name, scheme in SCHEMES.items() if scheme.sets_spin)
SUNLIT = tuple(name for name, scheme in SCHEMES.items() if scheme.reads_sun)
COMMANDED = tuple(name for name, scheme in SCHEMES.items() if scheme.reads_commands)
