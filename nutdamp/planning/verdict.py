"""The verdict on a schedule: the one judgement that every screen, page, figure and file shows.

`requirements` says what a bound is and whether a value keeps it; here its nominal values and
dispersed cases become a `Status`, and nothing else makes one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.numerics import RPM
from nutdamp.common.results import Note, note
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft, required_share
from nutdamp.spacecraft.requirements import Bound, Held, Part
from nutdamp.spacecraft.schedule import Schedule

if TYPE_CHECKING:
    from nutdamp.flight.cones import Aspect
    from nutdamp.flight.propagation import Flight

LOOP = "loop"  # name in place of a scheme

CAUSES, MAIN = 3, 0.1
"""Main causes that are named, at most, and the least share of the variance of one that is not the
first.
"""


class Status(Enum):
    """Status of a plan; the value is its name in files."""

    FLY = "fly"
    NOT_SHOWN = "not-shown"
    NOT_ENOUGH = "not-enough"
    NO_PULSE = "no-pulse"
    NO_PLAN = "no-plan"
    NOT_COMMANDABLE = "not-commandable"

    @property
    def exit_status(self) -> int:
        """Exit status of a command that shows it."""
        if self is Status.NO_PLAN:
            return 3
        return 0 if self in (Status.FLY, Status.NO_PULSE) else 4

    @property
    def barred(self) -> bool:
        """True for a schedule that the spacecraft cannot be sent."""
        return self is Status.NOT_COMMANDABLE


class Light(Enum):
    """Colour of a verdict: shown in dispersed cases, by nominal values alone,
    or not to be flown.
    """

    GREEN = "met"
    AMBER = "caution"
    RED = "missed"


@dataclass(frozen=True, slots=True)
class Cases:
    """Share of dispersed cases that complies: ``complying`` of ``samples``, None where nothing is
    required.

    ``probability`` of all must; the share of all lies from ``low`` to ``high``: within 95 %, but
    while more cases are to fly within all but a millionth. ``levels``: what the share required
    keeps of each bound; ``shares``: of the cases those that keep it.
    """

    samples: int
    seed: int
    probability: float
    complying: float | None
    low: float = 0.0
    high: float = 1.0
    final: bool = True
    levels: Mapping[Bound, float | None] = field(default_factory=dict)
    shares: Mapping[Bound, float] = field(default_factory=dict)

    @property
    def enough(self) -> bool | None:
        """True where enough of all cases comply or nothing is required, False for too few, None if
        not known.
        """
        return (
            True
            if self.complying is None
            else requirements.enough(self.low, self.high, self.probability)
        )


class JudgedCases(Protocol):
    """Dispersed cases that have flown, as far as they are judged; see `montecarlo.study`, which
    lies below.
    """

    study: Any
    done: int
    bounds: tuple[Bound, ...]
    kept: NDArray[np.int64]

    @property
    def probability(self) -> float:
        """Share of the cases that is required."""

    @property
    def met_fraction(self) -> float | None:
        """Share of the cases that comply."""

    def interval(self, *, certain: bool = False) -> tuple[float, float]:
        """Interval of that share."""

    def level(self, bound: Bound) -> float | None:
        """Value that the required share of cases keeps."""

    def spread(self, bound: Bound) -> Any:
        """Distribution of the value of a bound's part."""

    def contributions(self, bound: Bound) -> dict[str, float]:
        """Share of the variance by input."""


def cases_of(results: JudgedCases, *, final: bool = True) -> Cases:
    """Summary of dispersed cases; ``final``: no more of them are to fly."""
    low, high = results.interval(certain=not final)
    counts = zip(results.bounds, results.kept.tolist(), strict=True)
    shares = {bound: count / max(results.done, 1) for bound, count in counts}
    levels = {bound: results.level(bound) for bound in results.bounds}
    return Cases(
        results.done,
        results.study.seed,
        results.probability,
        results.met_fraction,
        low,
        high,
        final,
        levels,
        shares,
    )


WHY = {
    Part.NUTATION: "why-nutation",
    Part.SHIFT: "why-momentum-shift",
    Part.DISTANCE: "why-axis-error",
    Part.SPIN: "why-spin",
    Part.DURING: "why-nutation-during",
    Part.CONE: "why-cone",
}
"""Codes of the notes on a bound that the nominal value of a plan breaks."""


class Line(NamedTuple):
    """A bound beside its value with ``nominal`` values and what the share of cases required keeps,
    rad or rad/s.

    ``share``: of the cases those that keep this bound alone. Both are None without cases. ``met``:
    in both.
    """

    bound: Bound
    nominal: float
    dispersed: float | None
    share: float | None
    met: bool

    @property
    def value(self) -> float:
        """Value that is judged."""
        return self.nominal if self.dispersed is None else self.dispersed

    @property
    def margin(self) -> float:
        """Distance of that value to the bound."""
        return float(self.bound.margin(self.value))

    @property
    def room(self) -> tuple[float, float]:
        """Share of the cases that keep the bound, then its free fraction: the least is tightest."""
        free = 1.0 - float(self.bound.used(self.value))
        return 1.0 if self.share is None else self.share, free

    @property
    def note(self) -> Note:
        """Note on a bound that the nominal value breaks."""
        code = WHY[self.bound.part]
        if self.bound.part is Part.SPIN:
            return note(code, off_rpm=RPM * self.nominal)
        angle = math.degrees(self.nominal)
        if self.bound.part is Part.CONE and self.bound.keep is not None:
            return note(code, angle_deg=angle, direction=self.bound.keep.name)
        return note(code, angle_deg=angle)


class Cause(NamedTuple):
    """Dispersed input, and its share of the variance of the bound that fails most often."""

    input: str
    share: float


class Cheaper(NamedTuple):
    """Compared plan of a ``scheme`` that costs less than the recommended one, and the note on why
    it is not that.
    """

    scheme: str
    schedule: Schedule
    why: Note


@dataclass(frozen=True, eq=False)
class Verdict:
    """Judgement of the ``schedule`` of a ``scheme`` for a ``spacecraft``, or of a closed loop: its
    ``status``, and the ``lines`` of all bounds.

    ``flight``: the judged one, with nominal values, and the ``aspects`` of its axis; ``why`` there
    is no schedule. ``results``: all dispersed cases, None where they were not flown; ``nominal``:
    by nominal values alone, as requested; ``cheaper``: plans compared that cost less.
    """

    status: Status
    spacecraft: Spacecraft
    scheme: str = ""
    schedule: Schedule = field(default_factory=Schedule)
    lines: tuple[Line, ...] = ()
    cases: Cases | None = None
    results: JudgedCases | None = None
    flight: Flight | None = None
    aspects: tuple[Aspect, ...] = ()
    why: str = ""
    nominal: bool = False
    cheaper: tuple[Cheaper, ...] = ()

    @property
    def required(self) -> tuple[Line, ...]:
        """Lines of what is required."""
        return tuple(line for line in self.lines if line.bound.required)

    @property
    def met(self) -> bool | None:
        """True where all that is required is met and shown; None where nothing is required, and
        without a plan.
        """
        if self.status is Status.NO_PLAN or not self.required:
            return None
        return self.status not in (Status.NOT_ENOUGH, Status.NOT_SHOWN)

    @property
    def flies(self) -> bool:
        """True for a schedule that may be flown."""
        return self.status is Status.FLY

    @property
    def idle(self) -> bool:
        """True where no pulse is needed."""
        return self.status is Status.NO_PULSE

    @property
    def unshown(self) -> bool:
        """True where cases neither show that enough comply, nor that too few do."""
        return self.status is Status.NOT_SHOWN

    @property
    def light(self) -> Light:
        """Colour of the verdict."""
        if self.status.exit_status:
            return Light.RED
        return (
            Light.GREEN if self.cases is not None and self.required and self.good else Light.AMBER
        )

    @property
    def good(self) -> bool:
        """True where nothing is missed, whether required or not."""
        return not self.status.exit_status and all(line.met for line in self.lines)

    @property
    def nominally_met(self) -> bool:
        """True where nominal values keep all that is required."""
        return all(bool(line.bound.met(line.nominal)) for line in self.required)

    @property
    def tightest(self) -> Line | None:
        """Line of the required bound that the fewest cases keep, or that is kept most narrowly;
        None without any.
        """
        return min(self.required, key=attrgetter("room"), default=None)

    @property
    def empties(self) -> bool:
        """True where cases fail though all bounds are kept in each: the tank runs empty."""
        kept = self.tightest is not None and self.tightest.share == 1.0
        return self.met is False and self.nominally_met and kept

    @cached_property
    def causes(self) -> tuple[Cause, ...]:
        """Inputs that decide the failing cases, by the bound that is `tightest`; none where nominal
        values fail.
        """
        line = self.tightest
        if self.results is None or line is None or not self.nominally_met:
            return ()
        if self.empties:
            return ()
        shares = self.results.contributions(line.bound)
        ranked = sorted(shares.items(), key=lambda item: -item[1])[:CAUSES]
        return tuple(
            Cause(name, share)
            for at, (name, share) in enumerate(ranked)
            if at == 0 or share >= MAIN
        )


def lines_of(held: Sequence[Held], cases: Cases | None, probability: float) -> tuple[Line, ...]:
    """Lines of all bounds, by the cases where they were flown."""
    lines = []
    for bound, value in held:
        share = None if cases is None else cases.shares.get(bound)
        level = None if cases is None else cases.levels.get(bound)
        met = bool(bound.met(value)) and (
            share is None or not bound.required or share >= probability
        )
        lines.append(Line(bound, value, level, share, met))
    return tuple(lines)


def judge_schedule(
    flight: Flight,
    observed: tuple[Aspect, ...],
    held: Sequence[Held],
    cases: Cases | None,
    results: JudgedCases | None,
    *,
    scheme: str,
    schedule: Schedule,
    sendable: bool,
    nominal: bool,
) -> Verdict:
    """Judgement of a ``schedule`` by one flight, and by dispersed ``cases``; ``sendable``: it can
    be commanded.
    """
    spacecraft = flight.spacecraft
    status, lines = judged_bounds(spacecraft, held, cases, nominal=nominal)
    if status in (Status.FLY, Status.NOT_SHOWN) and not sendable:
        status = Status.NOT_COMMANDABLE
    elif status is Status.FLY and not schedule.pulses:
        status = Status.NO_PULSE
    return Verdict(
        status,
        spacecraft,
        scheme,
        schedule,
        lines,
        cases,
        results,
        flight,
        observed,
        nominal=nominal,
    )


def no_plan(spacecraft: Spacecraft, scheme: str = "", why: str = "") -> Verdict:
    """Verdict where there is no schedule."""
    return Verdict(Status.NO_PLAN, spacecraft, scheme, why=why)


def judge_loop(
    spacecraft: Spacecraft,
    held: Sequence[Held],
    cases: Cases | None = None,
    results: JudgedCases | None = None,
    *,
    flight: Flight | None = None,
    observed: tuple[Aspect, ...] = (),
    feasible: bool = True,
    lost: bool = False,
) -> Verdict:
    """Judgement of a closed loop by its bounds, in ``cases`` or in one ``flight``; ``lost``: it
    never falls quiet.
    """
    status, lines = judged_bounds(
        spacecraft, held, cases, nominal=spacecraft.dispersions is not None
    )
    if not feasible or lost:
        status = status_of(met=False, feasible=feasible)
    schedule = Schedule() if flight is None else flight.schedule
    return Verdict(
        status,
        spacecraft,
        LOOP,
        schedule,
        lines,
        cases,
        results,
        flight,
        observed,
        nominal=cases is None,
    )


def status_of(*, met: bool | None, feasible: bool) -> Status:
    """Status of what has no bounds to show, as a budget; ``met``:
    None where nothing is required.
    """
    if not feasible:
        return Status.NO_PLAN
    return Status.NOT_ENOUGH if met is False else Status.FLY


def judged_bounds(
    spacecraft: Spacecraft, held: Sequence[Held], cases: Cases | None, *, nominal: bool = False
) -> tuple[Status, tuple[Line, ...]]:
    """Status by the bounds of ``requirements`` alone: nominal values, and cases where they decide;
    and their lines.
    """
    lines = lines_of(held, cases, required_share(spacecraft.requirement))
    met = all(bool(line.bound.met(line.nominal)) for line in lines if line.bound.required)
    probable = spacecraft.requirement is not None and spacecraft.requirement.probability is not None
    untold = probable if spacecraft.dispersions is None else not nominal
    unknown = requirements.judged(spacecraft) and cases is None and untold
    enough = True if cases is None else cases.enough
    if not met or enough is False:
        return Status.NOT_ENOUGH, lines
    return (Status.NOT_SHOWN if enough is None or unknown else Status.FLY), lines
