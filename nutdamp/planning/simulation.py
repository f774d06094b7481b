"""Simulation of a plan to a given time, extremes of its axis track, and its verification."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import results
from nutdamp.common.numerics import SAME_ANGLE
from nutdamp.common.results import Note, note
from nutdamp.flight import end_state, propagation
from nutdamp.flight.end_state import seen_at
from nutdamp.flight.propagation import Flight, Track
from nutdamp.physics import attitude
from nutdamp.planning.plan import Plan, judge, plan
from nutdamp.planning.verdict import Verdict
from nutdamp.schemes import catalogue
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.roles import with_limits
from nutdamp.spacecraft.schedule import Schedule

if TYPE_CHECKING:
    from nutdamp.flight.verification import Verification

Array = NDArray[np.float64]

PICTURED = 100_000  # largest number of rows of the track of a picture
# parts of a turn by which a range of right ascension is distinguished from a whole turn: 0.05 deg
BINS = 7200


@dataclass(frozen=True, slots=True)
class Extremes:
    """Excursion of the spin axis over ``rows`` rows from 0 to ``until`` s, in rad."""

    rows: int
    until: float
    farthest: tuple[float, float]  # angle from H at t = 0, and its time, s
    nearest: tuple[float, float]
    x: tuple[float, float]  # range of the angle from the inertial y-z plane
    y: tuple[float, float]  # from the x-z plane
    right_ascension: tuple[float, float]  # shortest range, which may pass 2π
    declination: tuple[float, float]


def extremes(pieces: Iterable[Track]) -> Extremes:
    """Extremes of the axis track over the rows of its pieces, at least one."""
    rows = 0
    until = 0.0
    start = np.zeros(3)
    far = _Record()
    near = _Record()
    ascension = _Circle()
    low, high = np.full(3, math.inf), np.full(3, -math.inf)
    for piece in pieces:
        if not len(piece.t):
            continue
        start = piece.momentum[0] if rows == 0 else start
        rows = rows + len(piece.t)
        until = float(piece.t[-1])
        away = attitude.angle_between(piece.axis, start)
        far.add(away, piece.t)
        near.add(-away, piece.t)
        declination = np.arctan2(piece.axis[:, 2], np.hypot(piece.axis[:, 0], piece.axis[:, 1]))
        angles = np.column_stack([np.arcsin(np.clip(piece.axis[:, :2], -1.0, 1.0)), declination])
        low = np.minimum(low, angles.min(axis=0))
        high = np.maximum(high, angles.max(axis=0))
        ascension.add(np.arctan2(piece.axis[:, 1], piece.axis[:, 0]))
    nearest, when = near.first
    x, y, declinations = zip(low.tolist(), high.tolist(), strict=True)
    return Extremes(
        rows, until, far.first, (-nearest, when), x, y, ascension.shortest, declinations
    )


class _Record:
    """Running maximum, and the first time it was reached, but for rounding."""

    def __init__(self) -> None:
        self.values, self.times = np.empty(0), np.empty(0)

    def add(self, values: Array, times: Array) -> None:
        """Update by the values of further rows."""
        before = self.values[-1] if len(self.values) else -math.inf
        so_far = np.maximum.accumulate(np.concatenate([[before], values]))
        new = values > so_far[:-1]
        self.values, self.times = (
            np.append(self.values, values[new]),
            np.append(self.times, times[new]),
        )
        kept = self.values >= so_far[-1] - SAME_ANGLE
        self.values, self.times = self.values[kept], self.times[kept]

    @property
    def first(self) -> tuple[float, float]:
        return float(self.values[0]), float(self.times[0])


class _Circle:
    """Shortest arc that holds many angles: all but the widest gap between neighbours in different
    `BINS`.
    """

    def __init__(self) -> None:
        self.low, self.high = np.full(BINS, math.inf), np.full(BINS, -math.inf)

    def add(self, angles: Array) -> None:
        turned = angles % (2.0 * math.pi)
        bins = np.minimum((turned * (BINS / (2.0 * math.pi))).astype(int), BINS - 1)
        np.minimum.at(self.low, bins, turned)
        np.maximum.at(self.high, bins, turned)

    @property
    def shortest(self) -> tuple[float, float]:
        used = self.high >= self.low
        low, high = self.low[used], self.high[used]
        gaps = np.append(low[1:], low[0] + 2.0 * math.pi) - high
        widest = int(np.argmax(gaps))
        west = float(low[(widest + 1) % len(low)])
        return west, west + 2.0 * math.pi - float(gaps[widest])


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(results.Data, results.Tabled):
    """Propagation of a ``plan`` to ``until`` s, shown through ``real`` widths or by the impulse sum
    (17).

    Its track has ``samples`` rows; pictures show it to ``drawn_to`` s.
    """

    plan: Plan
    until: float
    real: bool
    samples: int
    drawn_to: float

    @cached_property
    def _both(self) -> tuple[Flight, Flight]:
        spacecraft, pulses = self.plan.spacecraft, self.plan.pulses
        return propagation.by_impulses(spacecraft, pulses, self.until), propagation.flown(
            spacecraft, pulses, self.until
        )

    @cached_property
    def impulses(self) -> Flight:
        """Flight by the impulse sum (17), truncated at ``until``."""
        return seen_at(self._both[0], self.until)

    @cached_property
    def flown(self) -> Flight:
        """Flight through the real widths, truncated at ``until``."""
        return seen_at(self._both[1], self.until)

    @cached_property
    def shown(self) -> Flight:
        """The shown one of them."""
        return replace(self.flown if self.real else self.impulses, scheme=self.plan.scheme)

    @cached_property
    def verdict(self) -> Verdict:
        """Judgement of the plan; of free motion that fails at t = 0, that at the end of the
        simulation.
        """
        judged = self.plan.verdict
        return (
            judged if self.plan.pulses.pulses or judged.met else judge(self.plan, seen=self.flown)
        )

    @cached_property
    def extremes(self) -> Extremes:
        """Extremes of the axis track."""
        return extremes(self.pieces())

    def pieces(self) -> Iterator[Track]:
        """Track of the flight shown, in pieces."""
        return self._both[self.real].pieces(self.samples, self.until)

    @cached_property
    def pictured(self) -> Track:
        """Track of pictures, of at most 100,000 rows."""
        return self._both[self.real].sampled(min(self.samples, PICTURED), self.drawn_to)


@dataclass(frozen=True, eq=False, repr=False)
class Verified(results.Data):
    """A ``plan`` flown by independent methods: ``core`` holds them, conserved quantities and the
    error budget.
    """

    core: Verification
    plan: Plan

    @property
    def agree(self) -> bool:
        """True where an independent integration was flown, and all of them confirm the flown
        motion.
        """
        return self.core.agree

    def __repr__(self) -> str:
        agreeing = ", ".join(self.core.checks) if self.agree else "nothing"
        return f"<Verified {self.plan.scheme}: agrees with {agreeing}>"


def unrounded(planned: Plan) -> Schedule | None:
    """Schedule with commands of any resolution; None without a tick, such a schedule, or a scheme
    that planned it.
    """
    spacecraft = planned.spacecraft
    schemed = planned.scheme in catalogue.SCHEMES and not planned._from_file
    if spacecraft.limits.tick is None or not schemed:
        return None
    return plan(with_limits(spacecraft, tick=None), planned.scheme, planned.options).schedule


def model_warnings(impulses: Flight, flown: Flight) -> Iterator[Note]:
    """Difference between the impulse sum (17) and real widths at the end, where it exceeds the
    tolerance.
    """
    for apart in end_state.deviations(impulses, flown):
        if apart.part is Part.SPIN:
            yield note(
                "models-differ-in-spin", difference_rad_s=apart.error, limit_rad_s=apart.most
            )
            continue
        difference, most = math.degrees(apart.error), math.degrees(apart.most)
        yield note(
            "models-differ", difference_deg=difference, part=apart.part.label, limit_deg=most
        )
