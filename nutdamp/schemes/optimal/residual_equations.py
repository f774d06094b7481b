"""What a short firing at one moment does to what is left at the end: the equations of the linear program.

Five equations at most, all in N m s: nutation (two: the transverse momentum A ω, turned back to t = 0), shift of H
(two, square to the target axis) and spin (one). Before anything is planned they are those of small angles; after that
those along a flight, at its true angles.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from nutdamp.flight import Flight
from nutdamp.physics import attitude
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Spacecraft, Vector

MOST_GROWN = 14.0
"""Exponent of growth or decay beyond which nothing is left of the nutation, or all is lost.

A millionth is left then, which takes pulses that a clock still resolves.
"""

KNOTS = 400
"""Even moments, besides the edges of pulses, at which ω3 is read from a flight with dissipation."""


@dataclass(frozen=True, slots=True)
class Equations:
    """Which of the five are requested; the nutation always is."""

    shift: bool = True
    spin: bool = False

    @property
    def chosen(self) -> list[int]:
        """Rows of the five that count."""
        return [0, 1, *([2, 3] if self.shift else []), *([4] if self.spin else [])]

    def beside(self, off: Vector) -> Vector:
        """What is left (equations,) N m s where H ends ``off`` (2,) N m s beside its target, and nothing else is."""
        return np.array([0.0, 0.0, *off, 0.0])[self.chosen]


@dataclass(frozen=True, eq=False)
class Influence:
    """``rows`` gives for times (n,) s what one N m s about each body axis adds to the equations, (n, equations, 3).

    ``goal`` (equations,) N m s is what all pulses together are to add. ``turning`` (equations,) rad/s are the rates at
    which the effects turn, for what is lost to a width.
    """

    rows: Callable[[Vector], Vector]
    goal: Vector
    turning: Vector

    def widths(self, width: Vector) -> Vector:
        """Share of the effect that is left of impulses spread over ``width`` (n,) s, (n, equations)."""
        return np.sinc(np.outer(width, self.turning) / (2 * np.pi))

    def of(self, schedule: Schedule, step: float) -> Vector:
        """What all pulses add, (equations,) N m s, each taken in parts of at most ``step`` s."""
        if not len(schedule):
            return np.zeros(len(self.turning))
        counts = [int(np.ceil(pulse.on_time / step)) or 1 for pulse in schedule]
        widths = np.repeat([pulse.on_time for pulse in schedule], counts) / np.repeat(counts, counts)
        parts = np.concatenate([np.arange(count) + 0.5 for count in counts])
        times = np.repeat([pulse.start for pulse in schedule], counts) + widths * parts
        impulses = np.repeat([pulse.impulse / count for pulse, count in zip(schedule, counts, strict=True)], counts, 0)
        return np.asarray(np.einsum("nek,nk,ne->e", self.rows(times), impulses, self.widths(widths)))


def growth_from(spacecraft: Spacecraft) -> float:
    """s from which nutation counts: the end of the horizon where it is damped (or all is lost), else 0."""
    growth = spacecraft.growth
    return min(spacecraft.horizon, MOST_GROWN / -growth) if growth < 0.0 else 0.0


def small_angles(spacecraft: Spacecraft, equations: Equations) -> Influence:
    """Σ J d e^{iaω3t} = -A ω0 and Σ J d e^{iω3t} = Δh: exact for the nutation, of first order for H.

    What dissipation damps counts from the end of the horizon, what it lets grow from t = 0: no row exceeds one.
    """
    inertia, spin, goal, growth = spacecraft.inertia, spacecraft.spin, spacecraft.goal, spacecraft.growth
    last = growth_from(spacecraft)
    shift = -square_to_target(spacecraft) @ spacecraft.momentum
    if np.any(shift):  # as long as the way there is on the sphere
        shift *= spacecraft.turning_impulse / np.linalg.norm(shift)
    final = spin if goal.spin is None else goal.spin
    there = -inertia.A * spacecraft.omega0[:2] * math.exp(growth * last)
    every = np.array([*there, *shift, inertia.C * (final - spin)])

    def rows(times: Vector) -> Vector:
        turned = np.exp(1j * np.outer(times, [inertia.a * spin, spin]))
        turned[:, 0] *= np.exp(np.minimum(-growth * (times - last), 0.0))
        shifts = np.zeros((len(times), 2, 3))
        shifts[:, :, :2] = _complex_product(turned[:, 1])
        return _all_rows(turned[:, 0], shifts)[:, equations.chosen]

    return Influence(rows, every[equations.chosen], _turning(spacecraft)[equations.chosen])


def along(flight: Flight, equations: Equations, step: float) -> Influence:
    """The equations about a flight, at its true angles: what its pulses add, less what it leaves, is the goal.

    That a firing also turns the body under the pulses that follow is neglected; ``step`` s is for `Influence.of`.
    """
    across = square_to_target(flight.spacecraft)

    def rows(times: Vector) -> Vector:
        _, quaternions = flight.motion(times)
        columns = [attitude.rotate(quaternions, axis) @ across.T for axis in np.eye(3)]
        back = _turned_back(flight, times)
        return _all_rows(back, np.stack(columns, axis=-1))[:, equations.chosen]

    here = Influence(rows, np.zeros(0), _turning(flight.spacecraft)[equations.chosen])
    return Influence(rows, here.of(flight.schedule, step) - misses(flight, equations), here.turning)


def misses(flight: Flight, equations: Equations) -> Vector:
    """What a flight leaves of the equations, (equations,) N m s; zero where it ends as requested."""
    body, end = flight.spacecraft, flight.settled
    back = _turned_back(flight, np.array([flight.schedule.end]))[0]
    nutation = body.inertia.A * end.omega * back
    momentum = attitude.rotate(end.quaternion, end.rates * np.asarray(flight.last_moments))
    final = end.spin if body.goal.spin is None else body.goal.spin
    shift = square_to_target(body) @ momentum
    return np.array([nutation.real, nutation.imag, *shift, body.inertia.C * (end.spin - final)])[equations.chosen]


def _turning(spacecraft: Spacecraft) -> Vector:
    return np.repeat([spacecraft.inertia.a * spacecraft.spin, spacecraft.spin, 0.0], [2, 2, 1])


def square_to_target(spacecraft: Spacecraft) -> Vector:
    """Two inertial unit vectors (2, 3) square to the target axis: body axes 1 and 2 at t = 0 as seen along it."""
    axis, body = spacecraft.target_axis, attitude.matrix(spacecraft.initial.quaternion)
    sense = np.sign(axis @ body[:, 2]) or 1.0
    first = body[:, 0] - axis * (axis @ body[:, 0])
    if np.linalg.norm(first) < 0.5:  # the target lies near body axis 1
        first = np.cross(sense * body[:, 1], axis)
    first /= np.linalg.norm(first)
    return np.array([first, sense * np.cross(axis, first)])


def _turned_back(flight: Flight, times: Vector) -> Vector:
    """e^{ia∫ω3dt}, and what dissipation adds until the end: turns ω at ``times`` (n,) s back to t = 0."""
    spacecraft, schedule = flight.spacecraft, flight.schedule
    inertia, drift = spacecraft.inertia, spacecraft.spin_drift
    if spacecraft.growth != 0.0:
        return _turned_back_by_flight(flight, times)
    turned = (spacecraft.spin + 0.5 * drift * times) * times
    for pulse in schedule:
        if pulse.impulse[2] and pulse.on_time > 0.0:
            since, after = np.maximum(times - pulse.start, 0.0), np.maximum(times - pulse.end, 0.0)
            turned = turned + 0.5 * pulse.impulse[2] / (inertia.C * pulse.on_time) * (since**2 - after**2)
    return np.asarray(np.exp(1j * inertia.a * turned))


def _turned_back_by_flight(flight: Flight, times: Vector) -> Vector:
    """`_turned_back` where dissipation changes ω3: on coasts it is ω/ω3, or tan θ, that grows by e^{κt} exactly."""
    body = flight.spacecraft
    knots, spins, turned = _spins(flight, max(float(np.max(times)), flight.legs[-1].start))
    grown = np.minimum(-body.growth * (times - flight.schedule.end), MOST_GROWN)
    least = math.exp(-MOST_GROWN) * abs(body.spin)
    now, then = (np.maximum(np.abs(np.interp(at, knots, spins)), least) for at in (times, flight.schedule.end))
    phase = body.inertia.a * np.interp(times, knots, turned)
    return np.asarray(np.exp(1j * phase + grown) * then / now)


@lru_cache(maxsize=2)
def _spins(flight: Flight, last: float) -> tuple[Vector, Vector, Vector]:
    """Moments up to ``last`` s, ω3 there in rad/s, and by how much it has turned the body since t = 0, (n,) each."""
    knots = np.unique(np.concatenate([[leg.start for leg in flight.legs], np.linspace(0.0, last, KNOTS)]))
    spins = flight.motion(knots)[0][:, 2]
    return knots, spins, np.concatenate([[0.0], np.cumsum(0.5 * (spins[1:] + spins[:-1]) * np.diff(knots))])


def _complex_product(factors: Vector) -> Vector:
    """Multiplication by complex ``factors`` (n,) as real matrices (n, 2, 2)."""
    return np.stack([np.stack([factors.real, -factors.imag], -1), np.stack([factors.imag, factors.real], -1)], 1)


def _all_rows(nutation: Vector, shifts: Vector) -> Vector:
    """All five equations, (n, 5, 3), from the turn of ω (n,) and the effect on H (n, 2, 3)."""
    rows = np.zeros((len(nutation), 5, 3))
    rows[:, :2, :2] = _complex_product(nutation)
    rows[:, 2:4] = shifts
    rows[:, 4, 2] = 1.0
    return rows
