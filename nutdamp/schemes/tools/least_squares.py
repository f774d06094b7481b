"""Correct a schedule on the flown motion: adjust moments, on-times and directions until nothing is left.

A damped Gauss-Newton iteration with bounds for a handful of unknowns. scipy.optimize would do it too, but loading it
takes longer than a whole plan.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from nutdamp import flight, work
from nutdamp.dynamics import make_dynamics
from nutdamp.limits import channel_of, commandable, effective_on_times, keeps_limits, longest_on_time
from nutdamp.physics import attitude
from nutdamp.schedule import STEERABLE, Pulse, Schedule, channel_pulse, steerable_pulse
from nutdamp.schemes.options import SchemeOptions
from nutdamp.schemes.registry import Scheme
from nutdamp.schemes.tools.symmetric_model import steady_omega
from nutdamp.spacecraft import Channel, Spacecraft, Vector
from nutdamp.supply import supplied

CONVERGED = 1e-14
"""rad; a few roundings of the integration."""

DIFFERENCE = 1e-6
"""Step of the difference quotients, in scaled unknowns: the error of the slopes, far below their size."""

ALIKE = 1e-9
"""Difference in size, relative, up to which pulses are equal."""

STEPS = 30

INTEGRATED = 50_000
"""Steps of integration after which a correction is left as it is: some seconds."""

PROGRESS = 0.01
"""Least relative gain of a step; near a solution each step gains many digits, so less means a bound in the way."""


TAIL = 4
"""Last pulses that are corrected, and rounded to ticks one after the other: as many as there are equations."""

MOVED = 8
"""Pulses corrected at the end of a schedule of equal ones, each of which has one variable less."""

BEFORE, AFTER = 12, 24
"""Where their length is given: pulses corrected before the equal ones, which damp the nutation, and at the end."""

CLEARLY = 0.5
"""A later or dearer candidate is taken only if it leaves less than this share of what an earlier one leaves."""

EXACT = 1e-11
"""rad of flown residual below which a corrected candidate is as good as exact (6e-10 deg)."""


def fired(spacecraft: Spacecraft, channels: Sequence[Channel], timing: Sequence[tuple[float, float]]) -> Schedule:
    """One pulse of each channel, commandable: ``timing`` has the centre and the on-time of each, s."""
    return Schedule(
        tuple(
            commandable(spacecraft, channel_pulse(channel, t, on_time))
            for channel, (t, on_time) in zip(channels, timing, strict=True)
        )
    )


def best_of(spacecraft: Spacecraft, tried: Iterable[tuple[Schedule, float]]) -> tuple[Schedule | None, Schedule | None]:
    """Of schedules with what they leave (rad), the preferred first, the one to take; and the first that breaks a limit.

    The first that is exact is taken, else the first that none behind it beats clearly.
    """
    best: tuple[float, Schedule] | None = None
    broken: Schedule | None = None
    for made, left in tried:
        if not keeps_limits(spacecraft, made.pulses):
            broken = broken or made
        elif best is None or left < CLEARLY * best[0]:
            best = left, made
            if left <= EXACT:
                break
    return None if best is None else best[1], broken


def misses(spacecraft: Spacecraft, schedule: Schedule) -> Vector:
    """What the flown schedule leaves, (4,) rad: tilt of H from the spin axis in body axes 1, 2; H off target in two.

    The four are zero exactly when no nutation is left and H lies along the target axis, without one where it was.
    Under disturbances the tilt counts from the steady response to them, about which nothing is to be damped.
    """
    return _missed(flight.flown(spacecraft, schedule))


def _missed(flight_: flight.Flight, *, spin: bool = False) -> Vector:
    """`misses` of a flight; ``spin`` adds a fifth, by how much of itself the final spin of the goal is missed."""
    spacecraft, schedule = flight_.spacecraft, flight_.schedule
    moments = np.asarray(flight_.last_moments)
    body = flight_.settled.rates * moments
    after = attitude.rotate(flight_.settled.quaternion, body)
    steady = steady_omega(spacecraft, schedule.end)
    body[:2] -= moments[:2] * (steady.real, steady.imag)
    left = np.concatenate([body[:2], _across(spacecraft.target_axis, after)]) / float(np.linalg.norm(body))
    final = spacecraft.goal.spin
    return left if not spin or final is None else np.append(left, flight_.settled.spin / final - 1.0)


def _across(axis: Vector, vector: Vector) -> Vector:
    """The two components of ``vector`` square to the unit vector ``axis``."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = np.cross(axis, other)
    first /= float(np.linalg.norm(first))
    return np.array([first @ vector, np.cross(axis, first) @ vector])


def correct(
    spacecraft: Spacecraft,
    made: Schedule,
    *,
    chosen: Sequence[int],
    momentum: bool,
    spin: bool = False,
    equal: bool = False,
    resizable: bool = True,
) -> Schedule:
    """``made`` with the ``chosen`` pulses corrected on the flown motion of ``spacecraft``, if that leaves less.

    Starts, on-times within their bounds, and directions of steerable pulses are free. Of ``equal`` pulses, those
    as large as the last one, the sizes stay as they are, or all change alike where they are ``resizable`` and commands
    have no ticks. ``momentum``: H too is to be brought to the target axis (without one, back), not only the nutation
    taken out; ``spin``: and the spin to the rate requested. A schedule without pulses stays as it is.
    """
    if not made.pulses:
        return made
    chosen = sorted({index % len(made) for index in chosen})
    kept = tuple(pulse for index, pulse in enumerate(made) if index not in chosen)
    moving = [made.pulses[index] for index in chosen]
    pulses = [_Movable(spacecraft, pulse, sized=not (equal and alike(made, pulse))) for pulse in moving]
    ends = np.cumsum([len(one.start) for one in pulses])
    together = equal and resizable and spacecraft.limits.tick is None and _size(made.pulses[-1]) > 0.0
    common = [_Common(spacecraft, made)] if together else []

    def build(x: Vector) -> Schedule:
        parts = np.split(x, ends)
        factor = float(parts[-1][0]) if common else 1.0
        others = common[0].resized(kept, factor) if common else kept
        moved = (one.turn(part, factor) for one, part in zip(pulses, parts[:-1], strict=True))
        return Schedule(supplied(spacecraft, (*others, *moved)), made.notes, made.bounds)

    steps, dynamics = 0, make_dynamics(spacecraft).remembering()

    def left(made: Schedule) -> Vector:
        nonlocal steps
        flown = flight.flown(spacecraft, made, dynamics=dynamics)
        steps += flown.steps
        missed = _missed(flown, spin=spin)
        return missed if momentum else np.delete(missed, [2, 3])

    freedom = _stacked(*pulses, *common)
    x, _ = solve(lambda x: left(build(x)), *freedom, lambda: steps > INTEGRATED or work.exhausted())
    rounded = supplied(spacecraft, (commandable(spacecraft, pulse) for pulse in build(x)))
    corrected = Schedule(rounded, made.notes, made.bounds)
    better = np.linalg.norm(left(corrected)) < np.linalg.norm(left(made))
    return corrected if better and keeps_limits(spacecraft, corrected.pulses) else made


@dataclass(frozen=True, slots=True)
class Correction:
    """Corrects schedules of a ``scheme`` on the motion of a true spacecraft."""

    scheme: Scheme
    options: SchemeOptions

    @property
    def momentum(self) -> bool:
        """Whether H too is to end where it should."""
        return self.scheme.points and not self.options.frees_axis

    @property
    def equal(self) -> bool:
        """Whether the pulses are planned to be equal."""
        return self.options.equal

    def __call__(self, spacecraft: Spacecraft, made: Schedule, free: int = TAIL) -> Schedule:
        """``made`` with its last pulse corrected; with up to the last ``free`` ones where H counts."""
        if self.options.uncorrected or not made.pulses:
            return made
        # The last pulses, which know what the others did on the model, undo what the true motion made of them.
        whole, given = free == TAIL, self.options.equal and not self.options.resizable
        last = free if not (whole and self.options.equal) else AFTER if given else MOVED
        chosen = tuple(range(-min(len(made), last), 0)) if self.momentum else (-1,)
        if self.momentum and whole and given:  # moments alone hardly turn H further; what damped before them does
            damping = [index for index, pulse in enumerate(made) if not alike(made, pulse)]
            chosen = (*damping[:BEFORE], *chosen)
        spin = self.scheme.sets_spin and spacecraft.goal.spin is not None
        if spin and whole:  # and the pulse that gives most to the spin
            chosen = (*chosen, max(range(len(made)), key=lambda number: abs(float(made.pulses[number].impulse[2]))))
        sizes = {"equal": self.options.equal, "resizable": self.options.resizable}
        return correct(spacecraft, made, chosen=chosen, momentum=self.momentum, spin=spin, **sizes)


def _stacked(*parts: _Movable | _Common) -> tuple[Vector, Vector, Vector, Vector]:
    """Start, scale, lower and upper bound of all that is free."""
    start, scale, lower, upper = (
        np.concatenate([getattr(one, name) for one in parts]) for name in ("start", "scale", "lower", "upper")
    )
    return start, scale, lower, upper


def alike(made: Schedule, pulse: Pulse) -> bool:
    """Whether a pulse is as large as the last one of a schedule."""
    last = made.pulses[-1]
    one, other = (each.magnitude if last.on_time == 0.0 else each.on_time for each in (pulse, last))
    return abs(one - other) <= ALIKE * other


class _Movable:
    """What can be turned of a pulse: (start, on-time) of a channel, (start, angle, impulse) of a steerable torquer.

    Without the last of them where it is not ``sized`` for itself.
    """

    def __init__(self, spacecraft: Spacecraft, pulse: Pulse, *, sized: bool) -> None:
        pace, earliest = 1.0 / abs(spacecraft.spin), spacecraft.limits.earliest + (pulse.start - pulse.loaded[0])
        latest = max(spacecraft.horizon - pulse.on_time - (pulse.over - pulse.end), pulse.start)
        self.channel = channel_of(spacecraft, pulse)
        self.torquer = spacecraft.torquer
        self.size = _size(pulse)
        start, scale, lower, upper = [pulse.start], [pace], [earliest], [latest]
        if self.channel is None:
            start.append(math.atan2(pulse.impulse[1], pulse.impulse[0]))
            scale, lower, upper = [*scale, 1.0], [*lower, -math.inf], [*upper, math.inf]
        if sized:
            start, scale = [*start, self.size], [*scale, self.size]
            least, most = _bounds(spacecraft, pulse)
            lower, upper = [*lower, least], [*upper, most]
        self.sized = sized
        self.start, self.scale, self.lower, self.upper = map(np.array, (start, scale, lower, upper))

    def turn(self, x: Vector, factor: float) -> Pulse:
        """The pulse with these settings; ``factor`` times as large where it is not sized for itself."""
        size = float(x[-1]) if self.sized else factor * self.size
        if self.channel is not None:
            return channel_pulse(self.channel, x[0] + 0.5 * size, size)
        assert self.torquer is not None
        torque = self.torquer.torque
        on_time = 0.0 if torque is None else size / torque
        return steerable_pulse(self.torquer, x[0] + 0.5 * on_time, float(x[1]), impulse=size)


class _Common:
    """What equal pulses change alike: one factor on the size of all that are as large as the last one."""

    start = scale = np.ones(1)

    def __init__(self, spacecraft: Spacecraft, made: Schedule) -> None:
        self.spacecraft, self.made, last = spacecraft, made, made.pulses[-1]
        bounds = np.array([_bounds(spacecraft, pulse) for pulse in made if alike(made, pulse)]) / _size(last)
        self.lower, self.upper = bounds[:, :1].max(axis=0), bounds[:, 1:].min(axis=0)

    def resized(self, pulses: Iterable[Pulse], factor: float) -> list[Pulse]:
        """The ``pulses`` about their centres, those alike ``factor`` times as large."""
        return [self._resized(one, factor) if alike(self.made, one) else one for one in pulses]

    def _resized(self, pulse: Pulse, factor: float) -> Pulse:
        moved = _Movable(self.spacecraft, pulse, sized=False)
        return replace(moved.turn(moved.start, factor), t=pulse.t)


def _size(pulse: Pulse) -> float:
    """What a pulse is measured by: on-time of a channel, s, impulse of a steerable torquer, N m s."""
    return pulse.magnitude if pulse.channel == STEERABLE else pulse.on_time


def _bounds(spacecraft: Spacecraft, pulse: Pulse) -> tuple[float, float]:
    """The least and the largest size of a pulse."""
    channel = channel_of(spacecraft, pulse)
    if channel is None:
        return 0.0, math.inf
    return effective_on_times(channel)[0], max(longest_on_time(spacecraft, channel), pulse.on_time)


def solve(
    residual: Callable[[Vector], Vector],
    start: Vector,
    scale: Vector,
    lower: Vector,
    upper: Vector,
    enough: Callable[[], bool] = lambda: False,
) -> tuple[Vector, float]:
    """Unknowns (n,) within bounds that make ``residual`` (m,) least in norm, and that norm.

    ``scale`` (n,) is a natural size of each unknown. With more unknowns than equations the nearest solution. It is
    left as it is once there was ``enough`` work.
    """
    x = np.clip(start, lower, upper)
    value = residual(x)
    norm = float(np.linalg.norm(value))
    for _ in range(STEPS):
        if norm <= CONVERGED or enough():
            break
        jacobian = _slopes(residual, x, value, scale)
        step = bounded_step(jacobian, value, x, scale, lower, upper)
        best, best_value, best_norm = x, value, norm
        for shrink in range(8):
            trial = np.clip(x + step * 0.5**shrink, lower, upper)
            trial_value = residual(trial)
            trial_norm = float(np.linalg.norm(trial_value))
            if trial_norm < best_norm:
                best, best_value, best_norm = trial, trial_value, trial_norm
                break
        stalled = best_norm > norm * (1.0 - PROGRESS)
        x, value, norm = best, best_value, best_norm
        if stalled:
            break
    return x, norm


def _slopes(residual: Callable[[Vector], Vector], x: Vector, value: Vector, scale: Vector) -> Vector:
    """Jacobian by the scaled unknowns, (m, n)."""
    columns = []
    for index, size in enumerate(scale):
        moved = x.copy()
        moved[index] += DIFFERENCE * size
        columns.append((residual(moved) - value) / DIFFERENCE)
    return np.column_stack(columns)


def bounded_step(jacobian: Vector, value: Vector, x: Vector, scale: Vector, lower: Vector, upper: Vector) -> Vector:
    """Least-squares step (n,) for a ``jacobian`` (m, n) by scaled unknowns; one that would leave its bounds stays."""
    free = np.ones(len(x), dtype=bool)
    step = np.zeros(len(x))
    for _ in range(len(x)):
        step[:] = 0.0
        step[free] = -np.linalg.lstsq(jacobian[:, free], value, rcond=1e-10)[0] * scale[free]
        outward = free & (((x <= lower) & (step < 0.0)) | ((x >= upper) & (step > 0.0)))
        if not outward.any():
            break
        free &= ~outward
    return step
