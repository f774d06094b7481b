"""Equations of the end errors, refinement of a schedule on its flight, rounding to ticks.

Five equations at most, all in N m s: nutation (two: the transverse momentum in the body, turned
back to t = 0; with I1 ≠ I2 times the factors with which it turns on a circle), momentum shift (two,
square to the target axis) and spin (one); first those of small angles, then those along a flight.
What turns H is the torque in space, whatever I1 and I2.

Refinement moves and lengthens pulses until the flown motion leaves nothing: a quasi-Newton
iteration for the nearest solution, with the slopes of the equations, which cost no flights,
corrected at each step (Broyden 1965). On ticks, starts and on-times are stepped to and fro, two
pulses at a time, by the linear model of the end error.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.flight.propagation import Flight
from nutdamp.physics import attitude
from nutdamp.schemes.correction import solve
from nutdamp.spacecraft.constraints import Windows, longest_on_time, rooms
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import TOUCHING, Schedule, channel_pulse

# Exponent of growth or decay beyond which nothing (a millionth, of pulses that a clock still
# resolves) is left of the nutation, or all is lost; even moments, besides the edges of pulses, at
# which ω3 is read from a flight with it.
MOST_GROWN, KNOTS = 14.0, 400

# Steps in a turn by which small changes of a motion of three moments are followed, terms of each
# one's exponential, the most steps, and units of `work` of each.
STEPS, ORDERS, MOST_VARIED, VARIED = 32, 10, 300_000, 0.004


# Directions (2, n) in which H may end off the target, where it may.
AROUND: Vector = np.array([part(2 * math.pi / 32 * np.arange(32)) for part in (np.cos, np.sin)])


@dataclass(frozen=True, slots=True)
class EndEquations:
    """Requested equations of the five; the nutation always is one."""

    shift: bool = True
    spin: bool = False

    @property
    def chosen(self) -> list[int]:
        """Rows of the five that count."""
        return [0, 1, *([2, 3] if self.shift else []), *([4] if self.spin else [])]


@dataclass(frozen=True, eq=False)
class Influence:
    """Coefficients ``rows`` (n, equations, 3) of one N m s about each body axis at times (n,) s.

    ``goal`` (equations,) N m s is what all pulses together are to add. ``turning`` (equations,)
    rad/s are the rates at which the effects turn, for what is lost to a width.
    """

    rows: Callable[[Vector], Vector]
    goal: Vector
    turning: Vector

    def widths(self, width: Vector) -> Vector:
        """Share of the effect that is left of impulses spread over ``width`` (n,) s, (n,
        equations).
        """
        return np.sinc(np.outer(width, self.turning) / (2 * np.pi))


def growth_from(spacecraft: Spacecraft) -> float:
    """Time, s, from which nutation counts: the end of the horizon where it is damped (or all is
    lost), else 0.
    """
    growth = spacecraft.growth
    return min(spacecraft.horizon, MOST_GROWN / -growth) if growth < 0.0 else 0.0


def small_angles(spacecraft: Spacecraft, equations: EndEquations) -> Influence:
    """Σ J d e^{iaω3t} = -A ω0 and Σ J d e^{iω3t} = Δh: exact for the nutation, of first order for
    H.

    What dissipation damps counts from the end of the horizon, what it lets grow from t = 0: no row
    exceeds one.
    """
    inertia, spin, goal, growth = (
        spacecraft.inertia,
        spacecraft.spin,
        spacecraft.goal,
        spacecraft.growth,
    )
    last = growth_from(spacecraft)
    shift = -square_to_target(spacecraft) @ spacecraft.momentum
    if np.any(shift):  # as long as the way there is on the sphere
        shift *= spacecraft.turning_impulse / np.linalg.norm(shift)
    final = spin if goal.spin is None else goal.spin
    circle = inertia.circle(spin)
    there = -circle * inertia.momentum(spacecraft.omega0)[:2] * math.exp(growth * last)
    every = np.array([*there, *shift, inertia.C * (final - spin)])

    def rows(times: Vector) -> Vector:
        turned = np.exp(1j * np.outer(times, [spacecraft.nutation_rate, spin]))
        turned[:, 0] *= np.exp(np.minimum(-growth * (times - last), 0.0))
        return _all_rows(_complex_product(turned[:, 0]) * circle, _complex_product(turned[:, 1]))[
            :, equations.chosen
        ]

    return Influence(rows, every[equations.chosen], _turning(spacecraft)[equations.chosen])


def along(flight: Flight, equations: EndEquations, step: float) -> Influence:
    """The equations about a flight, at its true angles: what its pulses add, less what it leaves,
    is the goal.

    That a firing also turns the body under the pulses that follow is neglected. Pulses count in
    parts of at most ``step`` s.
    """
    schedule = flight.schedule
    goal = 0.0 - misses(flight, equations)
    here = Influence(
        partial(_rows, flight, equations), goal, _turning(flight.spacecraft)[equations.chosen]
    )
    if not len(schedule):
        return here
    counts = [int(np.ceil(pulse.on_time / step)) or 1 for pulse in schedule]
    parts = np.concatenate([np.arange(count) + 0.5 for count in counts])
    widths = np.repeat([pulse.on_time for pulse in schedule], counts) / np.repeat(counts, counts)
    times = np.repeat([pulse.start for pulse in schedule], counts) + widths * parts
    impulses = np.repeat(
        [pulse.impulse / count for pulse, count in zip(schedule, counts, strict=True)], counts, 0
    )
    return replace(
        here, goal=goal + np.einsum("nek,nk,ne->e", here.rows(times), impulses, here.widths(widths))
    )


def _rows(flight: Flight, equations: EndEquations, times: Vector) -> Vector:
    """Coefficients of `Influence` at the true angles of a flight."""
    across, (_, quaternions) = square_to_target(flight.spacecraft), flight.motion(times)
    columns = [attitude.rotate(quaternions, axis) @ across.T for axis in np.eye(3)]
    return _all_rows(_nutation_rows(flight, times), np.stack(columns, axis=-1))[:, equations.chosen]


def _nutation_rows(flight: Flight, times: Vector) -> Vector:
    """Effect (n, 2, …) on the nutation of one N m s about each body axis at ``times`` (n,) s of a
    flight.
    """
    spacecraft = flight.spacecraft
    circle = spacecraft.inertia.circle(spacecraft.spin)
    if spacecraft.inertia.symmetric or spacecraft.growth != 0.0:
        return _complex_product(_turned_back(flight, times)) * circle
    knots, back, slopes = _variations(flight)
    every = np.append(times, flight.schedule.end)
    index = np.clip(np.searchsorted(knots, every, side="right") - 1, 0, len(knots) - 2)
    step = float(knots[1])
    x = ((every - knots[index]) / step)[:, None, None]
    # By the cubic of its values and slopes at the knots beside.
    rise = back[index + 1] - back[index]
    first, last = step * slopes[index] - rise, rise - step * slopes[index + 1]
    there = back[index] + x * rise + x * (1.0 - x) * ((1.0 - x) * first + x * last)
    end = _complex_product(_turned_back(flight, every[-1:]))[0] * circle
    return np.asarray(end @ np.linalg.inv(there[-1])[:2] @ there[:-1])


@lru_cache(maxsize=2)
def _variations(flight: Flight) -> tuple[Vector, Vector, Vector]:
    """Even knots (n,) s of a flight; what leads small changes of H in the body there back to t = 0,
    and its slopes.
    """
    spacecraft = flight.spacecraft
    last, pace = (
        max(spacecraft.horizon, flight.schedule.end),
        max(spacecraft.fastest, float(np.linalg.norm(spacecraft.omega0))),
    )
    knots = np.linspace(
        0.0, last, min(math.ceil(last * pace / (2 * math.pi) * STEPS), MOST_VARIED) + 2
    )
    step = float(knots[1])
    work.spend(VARIED * len(knots))

    def jacobian(times: Vector) -> Vector:
        rates = flight.motion(times)[0]
        momentum = spacecraft.inertia.momentum(rates)[:, None, :]
        turns = momentum / np.array(spacecraft.inertia.moments)[:, None] - rates[:, None, :]
        return np.swapaxes(np.cross(turns, np.eye(3)), 1, 2)

    # Magnus' series of fourth order: exact where the rates are constant.
    early, late = (
        jacobian(knots[:-1] + (0.5 + side * math.sqrt(3.0) / 6.0) * step) for side in (-1.0, 1.0)
    )
    exponent = -step * (
        0.5 * (early + late) + math.sqrt(3.0) / 12.0 * step * (late @ early - early @ late)
    )
    steps = term = np.tile(np.eye(3), (len(exponent), 1, 1))
    for order in range(1, ORDERS):
        term = term @ exponent / order
        steps = steps + term
    back = np.array(list(itertools.accumulate(steps, np.matmul, initial=np.eye(3))))
    return knots, back, -back @ jacobian(knots)


def misses(flight: Flight, equations: EndEquations) -> Vector:
    """End errors of a flight, (equations,) N m s; zero where it ends as requested."""
    spacecraft, end = flight.spacecraft, flight.settled
    across = spacecraft.inertia.circle(spacecraft.spin) * spacecraft.inertia.momentum(end.rates)[:2]
    nutation = complex(*across) * _turned_back(flight, np.array([flight.schedule.end]))[0]
    final = end.spin if spacecraft.goal.spin is None else spacecraft.goal.spin
    shift = square_to_target(spacecraft) @ flight.last_momentum
    return np.array(
        [nutation.real, nutation.imag, *shift, spacecraft.inertia.C * (end.spin - final)]
    )[equations.chosen]


def _turning(spacecraft: Spacecraft) -> Vector:
    return np.repeat([spacecraft.nutation_rate, spacecraft.spin, 0.0], [2, 2, 1])


def square_to_target(spacecraft: Spacecraft) -> Vector:
    """Two inertial unit vectors (2, 3) square to the target axis: body axes 1 and 2 at t = 0 as
    seen along it.
    """
    axis = spacecraft.target_axis
    body = attitude.matrix(spacecraft.initial.quaternion)
    sense = np.sign(axis @ body[:, 2]) or 1.0
    first = body[:, 0] - axis * (axis @ body[:, 0])
    if np.linalg.norm(first) < 0.5:  # the target lies near body axis 1
        first = np.cross(sense * body[:, 1], axis)
    first /= np.linalg.norm(first)
    return np.array([first, sense * np.cross(axis, first)])


def _turned_back(flight: Flight, times: Vector) -> Vector:
    """e^{i∫ν dt}, and what dissipation adds until the end: turns ω at ``times`` (n,) s back to t =
    0.
    """
    spacecraft, schedule = flight.spacecraft, flight.schedule
    inertia, drift = spacecraft.inertia, spacecraft.spin_drift(0.0, schedule.end)
    slope, offset = inertia.linear_rate(spacecraft.spin)
    if (
        spacecraft.growth != 0.0
    ):  # dissipation changes ω3: on coasts ω/H3, or tan θ, grows by e^{κt} exactly
        knots, spins, turned = _spins(flight, max(float(np.max(times)), flight.legs[-1].start))
        grown = np.minimum(-spacecraft.growth * (times - schedule.end), MOST_GROWN)
        least = math.exp(-MOST_GROWN) * abs(spacecraft.axial)
        axial = inertia.axial(spins)
        now, then = (
            np.maximum(np.abs(np.interp(at, knots, axial)), least) for at in (times, schedule.end)
        )
        phase = slope * np.interp(times, knots, turned) + offset * times
        return np.asarray(np.exp(1j * phase + grown) * then / now)
    turned = (spacecraft.spin + 0.5 * drift * times) * times
    for pulse in (
        schedule if inertia.symmetric else ()
    ):  # changes of three moments are followed, see `_variations`
        if pulse.impulse[2] and pulse.on_time > 0.0:
            since, after = np.maximum(times - pulse.start, 0.0), np.maximum(times - pulse.end, 0.0)
            turned = turned + 0.5 * pulse.impulse[2] / (inertia.C * pulse.on_time) * (
                since**2 - after**2
            )
    return np.asarray(np.exp(1j * (slope * turned + offset * times)))


@lru_cache(maxsize=2)
def _spins(flight: Flight, last: float) -> tuple[Vector, Vector, Vector]:
    """Moments up to ``last`` s, ω3 there in rad/s, and by how much it has turned the body since t =
    0, (n,) each.
    """
    knots = np.unique(
        np.concatenate([[leg.start for leg in flight.legs], np.linspace(0.0, last, KNOTS)])
    )
    spins = flight.motion(knots)[0][:, 2]
    return (
        knots,
        spins,
        np.concatenate([[0.0], np.cumsum(0.5 * (spins[1:] + spins[:-1]) * np.diff(knots))]),
    )


def _complex_product(factors: Vector) -> Vector:
    """Multiplication by complex ``factors`` (n,) as real matrices (n, 2, 2)."""
    return np.stack(
        [np.stack([factors.real, -factors.imag], -1), np.stack([factors.imag, factors.real], -1)], 1
    )


def _all_rows(nutation: Vector, shifts: Vector) -> Vector:
    """All five equations, (n, 5, 3), from the effects of axes on the nutation and on H, (n, 2, …)
    each.
    """
    rows = np.zeros((len(nutation), 5, 3))
    rows[:, :2, : nutation.shape[2]] = nutation
    rows[:, 2:4, : shifts.shape[2]] = shifts
    rows[:, 4, 2] = 1.0
    return rows


# Ticks that a setting may lie from its exact value; steps of a tick, two pulses at a time, by one
# model; models.
REACH, TICK_STEPS, MODELS = 2.0, 300, 4

WAYS = np.array(
    [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]
)  # a step: of the start, of the on-time


def refined(
    flight: Flight, equations: EndEquations, aside: Vector, fly: Callable[[Schedule], Flight]
) -> Schedule:
    """The schedule of a ``flight`` with its pulses moved and lengthened, as little as it takes, to
    leave least of the ``equations``; how little is for the caller to judge.

    ``fly`` flies schedules of its spacecraft; ``aside`` (equations,) N m s is to be left of them.
    """
    spacecraft, schedule = flight.spacecraft, flight.schedule
    size = float(np.linalg.norm(spacecraft.momentum))
    names = {channel.name: channel for channel in spacecraft.channels}
    channels = [names[pulse.channel] for pulse in schedule]
    begun, latest = np.array(rooms(spacecraft, schedule.pulses)).reshape(-1, 2).T
    shortest = np.array([channel.min_on_time for channel in channels])
    longest = np.array([channel.max_on_time for channel in channels])
    useful = np.array([longest_on_time(spacecraft, channel) for channel in channels])
    t = np.array([pulse.t for pulse in schedule])
    on = np.array([pulse.on_time for pulse in schedule])
    edges = np.array([(pulse.start, pulse.end) for pulse in schedule]).reshape(-1, 2).T
    before, after = np.maximum(edges[0] - begun, 0.0), np.maximum(latest - edges[1], 0.0)
    # Settings (2k, 4): centre, then on-time, of each pulse, s, with its scale and its bounds.
    pace = np.full(len(t), 1.0 / spacecraft.fastest)
    centres = np.stack([t, pace, t - 0.5 * before, t + 0.5 * after], axis=-1)
    most = np.maximum(np.minimum(useful, on + np.minimum(before, after)), on)
    lengths = np.stack([on, np.minimum(on, pace), np.minimum(shortest, on), most], axis=-1)
    settings = np.stack([centres, lengths], axis=1).reshape(-1, 4)

    def made(x: Vector) -> Schedule:
        pairs = zip(channels, x.reshape(-1, 2).tolist(), strict=True)
        return replace(
            schedule, pulses=tuple(channel_pulse(channel, t, on) for channel, (t, on) in pairs)
        )

    def left(flight: Flight) -> Vector:
        return (misses(flight, equations) - aside) / size

    def slopes(flight: Flight) -> Vector:
        """Slopes of what is left by the settings, per s, (equations, 2k)."""
        columns = []
        times = np.array([(pulse.start, pulse.end) for pulse in flight.schedule]).T
        sides = (_rows(flight, equations, each) for each in times)
        for begin, end, channel in zip(*sides, channels, strict=True):
            first, last = begin @ channel.torque, end @ channel.torque
            columns += [last - first, 0.5 * (first + last)]
        return np.asarray(np.column_stack(columns) / size)

    scale = settings[:, 1]
    x = solve(
        lambda x: left(fly(made(x))),
        settings,
        lambda: False,
        lambda _x, _value: slopes(flight) * scale,
    )
    windows = Windows(spacecraft)
    tick = windows.limits.tick
    if tick is None:
        return made(x)

    # The schedule of least misses on ticks, by linear models one after the other.
    middles, needed = x.reshape(-1, 2).T
    exact = np.column_stack([middles - 0.5 * needed, needed]) / tick
    on_times = map(windows.on_time, needed, shortest, longest)
    ticks = np.rint(np.column_stack([exact[:, 0], np.array(list(on_times)) / tick]))

    def allowed(ticks: Vector) -> NDArray[np.bool_]:
        start, on_time = tick * ticks.T
        near = np.abs(ticks - exact).max(axis=1) < REACH
        inside = near & (start >= begun - TOUCHING) & (start + on_time <= latest + TOUCHING)
        bounded = (on_time >= shortest - TOUCHING) & (on_time <= longest + TOUCHING)
        return np.asarray(inside & bounded & (on_time > 0.5 * tick))

    best, least = flight, np.inf
    for _ in range(MODELS):
        trial = fly(made(tick * np.ravel(ticks @ [[1.0, 0.0], [0.5, 1.0]])))
        missing = left(trial)
        if np.linalg.norm(missing) >= least:
            break
        best, least = trial, float(np.linalg.norm(missing))
        ticks = _stepped(ticks, missing, tick * slopes(trial), allowed)
    return best.schedule


def _stepped(
    ticks: Vector,
    missing: Vector,
    slopes: Vector,
    allowed: Callable[[Vector], NDArray[np.bool_]],
) -> Vector:
    """Ticks (k, 2) of starts and on-times that leave less, where these leave ``missing``.

    ``slopes`` (equations, 2k) per tick of centres and on-times.
    """
    ticks = ticks.copy()
    for _ in range(TICK_STEPS):
        way, pulse = np.nonzero([allowed(ticks + way) for way in WAYS])
        if not len(pulse):
            break
        start, on_time = WAYS[way].T
        centre = start + 0.5 * on_time
        changes = slopes[:, 2 * pulse] * centre + slopes[:, 2 * pulse + 1] * on_time
        alone = missing[:, None] + changes
        pairs = np.linalg.norm(alone[:, :, None] + changes[:, None, :], axis=0)
        # Two steps of one pulse might leave its room; on the diagonal is the single step.
        pairs[pulse[:, None] == pulse[None, :]] = np.inf
        np.fill_diagonal(pairs, np.linalg.norm(alone, axis=0))
        row, column = divmod(int(np.argmin(pairs)), len(pulse))
        if pairs[row, column] >= float(np.linalg.norm(missing)) * (1.0 - 1e-9):
            break
        for index in {row, column}:
            ticks[pulse[index]] += WAYS[way[index]]
            missing = missing + changes[:, index]
    return ticks
