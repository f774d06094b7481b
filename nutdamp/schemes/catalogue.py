"""Catalogue of the schemes: names, properties, options.

Options are one frozen class a scheme, checked on creation; the command line makes its options,
their help and their headings from the fields. No scheme is loaded: the command line needs the names
alone.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self, TypeVar

from nutdamp.errors import BadRequest, SenselessOption, cure_of
from nutdamp.units import as_given, expect, is_count, is_number

# quantities that the scheme optimal can minimise
LEAST = ("propellant", "impulse", "time", "pulses")


@dataclass(frozen=True)
class OptionKind:
    """Kind of the values of an option: ``expected`` in words, and ``unit`` (a dimension of `units`)
    of a quantity.
    """

    expected: str
    unit: str | None = None
    names: tuple[str, ...] = ()
    least: float = 0.0
    none: bool = True

    def takes(self, value: Any) -> bool:
        """True if a value is valid."""
        if value is None:
            return self.none
        if self.names:
            return isinstance(value, str) and value in self.names
        if self.unit is not None:
            return is_number(value) and (
                value > 0.0 if self.unit == "time" else value >= self.least
            )
        return is_count(value) if self.least else isinstance(value, bool)

    @property
    def flag(self) -> bool:
        """True for an on/off option."""
        return not (self.names or self.unit or self.least)


FLAG = OptionKind("True or False", none=False)
COUNT = OptionKind("a whole number of at least 1", least=1)
TIME = OptionKind("a time above zero, in s", "time")
SAVED = OptionKind(f"one of {', '.join(LEAST)}", names=LEAST, none=False)
ANGLE = OptionKind("an angle of at least 0, in rad", "angle")


def _option(default: Any, kind: OptionKind, text: str, *, as_is: bool = False) -> Any:
    """Field of an option; ``as_is``: where it is on, the schedule is not corrected."""
    return dataclasses.field(default=default, metadata={"kind": kind, "help": text, "as_is": as_is})


@dataclass(frozen=True, kw_only=True)
class SchemeOptions:
    """Options of every scheme: ``with_disturbances``, ``equal``. Raises SenselessOption."""

    equal: ClassVar[bool] = False  # whether the pulses are of one size, which corrections keep
    with_disturbances: bool = _option(
        False, FLAG, "Plan on the motion with the disturbances of the file."
    )

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            kind = field.metadata["kind"]
            if not kind.takes(value):
                raise SenselessOption(field.name, as_given(value), f"expected {kind.expected}")

    def settled(self, *, keeps_axis: bool) -> Self:  # noqa: ARG002 - what some schemes go by
        """Copy with the defaults of the spacecraft: ``keeps_axis``, whether something is asked of
        where H ends.
        """
        return self

    @property
    def uncorrected(self) -> bool:
        """True if the schedule is to stay as the scheme gives it, whatever nutation the true motion
        leaves.
        """
        return any(
            field.metadata["as_is"] and getattr(self, field.name)
            for field in dataclasses.fields(self)
        )

    @property
    def resizable(self) -> bool:
        """True if corrections may change the length of pulses: none was requested."""
        return getattr(self, "on_time", None) is None


@dataclass(frozen=True, kw_only=True)
class TwoPulseOptions(SchemeOptions):
    """Options of two-pulse; ``literal``: as printed by Magnus."""

    literal: bool = _option(
        False, FLAG, "As printed by Magnus: equal halves, small-angle wait.", as_is=True
    )


# default on-time of four-pulse as a share of T_ω: 2.6 % of the impulse is lost to the width
DEFAULT_SHARE = 0.125


@dataclass(frozen=True, kw_only=True)
class FourPulseOptions(SchemeOptions):
    """Of four-pulse: ``on_time`` s, None: min(max_on_time, T_ω/8); ``least``; ``coarse``."""

    on_time: float | None = _option(None, TIME, "Pulse length, such as 200ms.")
    least: str = _option(LEAST[0], SAVED, "What to save.")
    coarse: bool = _option(False, FLAG, "Full pulses only, no shorter one at the end.", as_is=True)


@dataclass(frozen=True, kw_only=True)
class HalfConeOptions(SchemeOptions):
    """Options of half-cone; ``cones`` None: the fewest that are nearly cheapest."""

    cones: int | None = _option(
        None, COUNT, "Half cones; default: until one more saves less than 1 %."
    )


PER_TURN: int = _option(1, dataclasses.replace(COUNT, none=False), "Pulses in each spin turn.")


@dataclass(frozen=True, kw_only=True)
class CommandBlockOptions(SchemeOptions):
    """Options of command-block; ``max_blocks`` None: three, of which as few are used as suffice.

    ``per_turn``: 1, or 2 as by ``commands.per_turn`` of the file.
    """

    max_blocks: int | None = _option(None, COUNT, "Largest number of command blocks; default 3.")
    per_turn: int = PER_TURN

    @property
    def uncorrected(self) -> bool:
        """Always True: commands are not corrected."""
        return True


@dataclass(frozen=True, kw_only=True)
class RhumbLineOptions(SchemeOptions):
    """Options of rhumb-line: ``on_time`` s (None: an eighth of a spin turn), ``per_turn``."""

    equal: ClassVar[bool] = True  # the width is one command
    on_time: float | None = _option(None, TIME, "Length of every pulse, such as 200ms.")
    per_turn: int = PER_TURN


@dataclass(frozen=True, kw_only=True)
class OptimalOptions(SchemeOptions):
    """Options of optimal; ``least``: what to save, of `LEAST`; ``shift`` rad, how far from its
    target H may end.

    ``free_axis`` None: H may end anywhere unless the spacecraft or ``shift`` asks for something
    else.
    """

    least: str = _option(LEAST[0], SAVED, "What to save.")
    free_axis: bool | None = _option(
        None, dataclasses.replace(FLAG, none=True), "Let H end anywhere."
    )
    shift: float | None = _option(None, ANGLE, "How far from its target H may end: 0.2deg.")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.shift is not None and self.free_axis:
            problem = "expected none beside a free axis, where H may end anywhere"
            raise SenselessOption("shift", as_given(self.shift), problem)

    @property
    def saves_cost(self) -> bool:
        """True if the cost is to be least, not the time or the number of pulses."""
        return self.least in LEAST[:2]

    def settled(self, *, keeps_axis: bool) -> Self:
        """Copy with the default freedom of H; a ``shift`` of 0 becomes None."""
        if self.shift is not None:
            return dataclasses.replace(self, free_axis=False, shift=self.shift or None)
        if self.free_axis is not None:
            return self
        return dataclasses.replace(self, free_axis=not keeps_axis)


KINDS = (
    SchemeOptions,
    FourPulseOptions,
    TwoPulseOptions,
    HalfConeOptions,
    RhumbLineOptions,
    CommandBlockOptions,
    OptimalOptions,
)

Chosen = TypeVar("Chosen", bound=SchemeOptions)


class Options:
    """Options of several schemes at once, by keyword: each scheme takes those that it has.

    Raises BadRequest for one that no scheme has, or a value that makes no sense.
    """

    def __init__(self, **chosen: Any) -> None:
        self.chosen: Mapping[str, Any] = chosen
        known = dict.fromkeys(name for kind in KINDS for name in names_of(kind))
        if unknown := [name for name in chosen if name not in known]:
            raise BadRequest(f"options: no scheme has {unknown[0]!r}; there are {', '.join(known)}")
        for kind in KINDS:
            self.of(kind)

    def of(self, kind: type[Chosen]) -> Chosen:
        """Options of one scheme."""
        return kind(
            **{name: value for name, value in self.chosen.items() if name in names_of(kind)}
        )

    @property
    def with_disturbances(self) -> bool:
        """True if all of them plan with the disturbances of the file."""
        return self.of(SchemeOptions).with_disturbances

    def without_effect(self, kinds: list[type[SchemeOptions]]) -> Iterator[str]:
        """Names of options that were changed, and that none of the ``kinds`` has."""
        read = {name for kind in kinds for name in names_of(kind)}
        defaults = {
            field.name: field.default for kind in KINDS for field in dataclasses.fields(kind)
        }
        for name, default in defaults.items():
            if self.chosen.get(name, default) != default and name not in read:
                yield name

    def __repr__(self) -> str:
        return f"Options({', '.join(f'{name}={value!r}' for name, value in self.chosen.items())})"


def names_of(kind: type[SchemeOptions]) -> tuple[str, ...]:
    """Names of the options of a scheme."""
    return tuple(field.name for field in dataclasses.fields(kind))


@dataclass(frozen=True)
class Scheme:
    """A scheme, and what it can do."""

    name: str
    options: type[SchemeOptions] = SchemeOptions
    fires: bool = True
    classic: bool = False  # of Magnus 1970
    points: bool = False  # can turn the spin axis to a target, and is planned where there is one
    only_points: bool = False  # needs a target
    reads_sun: bool = False  # keeps its pulses at a fixed phase to the Sun
    sets_spin: bool = False  # can change the spin rate
    body_fixed: bool = False  # fires channels of the file only, no steerable torquer
    reads_commands: bool = False  # makes blocks of ``commands``; planned where there are some
    on_true_body: bool = False  # needs no symmetric model
    three_moments: bool = False  # needs a model for lasting torques alone
    slow: bool = False  # may take seconds
    by_turns: bool = False  # fires at one phase of each spin turn, so that the body has to spin
    home: str = ""  # its module, where that has another name

    @property
    def module(self) -> str:
        """Module with its function ``schedule``, where it fires."""
        return f"nutdamp.schemes.{self.home or self.name.replace('-', '_')}"


ONE_PULSE = Scheme("one-pulse", classic=True)
TWO_PULSE = Scheme("two-pulse", TwoPulseOptions, classic=True, points=True)
FOUR_PULSE = Scheme("four-pulse", FourPulseOptions, classic=True, body_fixed=True)
OPTIMAL = Scheme(
    "optimal",
    OptimalOptions,
    points=True,
    sets_spin=True,
    body_fixed=True,
    three_moments=True,
    slow=True,
    home="optimal.search",
)
HALF_CONE = Scheme("half-cone", HalfConeOptions, points=True, only_points=True, body_fixed=True)
RHUMB_LINE = Scheme(
    "rhumb-line",
    RhumbLineOptions,
    points=True,
    only_points=True,
    reads_sun=True,
    body_fixed=True,
    by_turns=True,
)
COMMAND_BLOCK = Scheme(
    "command-block",
    CommandBlockOptions,
    reads_commands=True,
    sets_spin=True,
    on_true_body=True,
    body_fixed=True,
    slow=True,
    by_turns=True,
)
NONE = Scheme("none", fires=False)  # free motion, for comparison

ALL = (ONE_PULSE, TWO_PULSE, FOUR_PULSE, OPTIMAL, HALF_CONE, RHUMB_LINE, COMMAND_BLOCK, NONE)
SCHEMES = {scheme.name: scheme for scheme in ALL}
NAMES = tuple(SCHEMES)
PLANNED = tuple(name for name, scheme in SCHEMES.items() if scheme.fires)
CLASSIC = tuple(name for name, scheme in SCHEMES.items() if scheme.classic)
COMPARED = (*CLASSIC, OPTIMAL.name)  # default schemes without a target
# in the order in which they are shown: those that take seconds last
POINTING = tuple(
    scheme.name
    for scheme in sorted(SCHEMES.values(), key=lambda scheme: scheme.slow)
    if scheme.points
)
SPINNING = tuple(name for name, scheme in SCHEMES.items() if scheme.sets_spin)
SUNLIT = tuple(name for name, scheme in SCHEMES.items() if scheme.reads_sun)
COMMANDED = tuple(name for name, scheme in SCHEMES.items() if scheme.reads_commands)


def expect_names(values: Iterable[str]) -> tuple[str, ...]:
    """Names of schemes that there are, each once; raises BadRequest."""
    several = isinstance(values, Iterable) and not isinstance(values, str)
    expect(several, "names", values, "a list of schemes, such as ['two-pulse']")
    names = tuple(values)
    for name in names:
        if not isinstance(name, str) or name not in NAMES:
            raise BadRequest(f"there is no scheme {as_given(name)}; {cure_of(name, NAMES)}")
    return tuple(dict.fromkeys(names))


def expect_options(
    value: Options | SchemeOptions | None, chosen: Mapping[str, Any], scheme: str | None = None
) -> Options | SchemeOptions | None:
    """Options of schemes, or those ``chosen`` by keyword, which the ``scheme`` must have; raises
    BadRequest.
    """
    fits = value is None or (isinstance(value, Options | SchemeOptions) and not chosen)
    expect(fits, "options", value, "nutdamp.Options(…) or keywords")
    if not chosen:
        return value
    options = Options(**chosen)
    if scheme is not None:
        own = SCHEMES[scheme].options
        for unread in options.without_effect([own]):
            raise BadRequest(
                f"options: {scheme} has no {unread!r}; there are {', '.join(names_of(own))}"
            )
    return options
