"""The equivalent symmetric body on which schemes plan, and the correction of their schedules by
least squares on the flown motion.

Three different moments turn in the body at another rate than their mean, on an ellipse instead of a
circle; lasting disturbances move the point about which ω turns. Both are taken out here, so that
every scheme plans free motion of a symmetric body, and put back in: the schedule is translated to
the true actuators and corrected on the true motion. Moments, on-times and directions are adjusted
by a damped Gauss-Newton iteration with bounds for a handful of unknowns. scipy.optimize would do it
too, but loading it takes longer than a whole plan.
"""

from __future__ import annotations

import cmath
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from nutdamp.common import work
from nutdamp.flight import propagation
from nutdamp.flight.dynamics import make_dynamics, supplied
from nutdamp.physics import attitude
from nutdamp.schemes.catalogue import OptimalOptions, Scheme, SchemeOptions
from nutdamp.spacecraft.constraints import (
    Windows,
    channel_of,
    commandable,
    effective_on_times,
    keeps_limits,
    longest_on_time,
)
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Attitude, Disturbance, Inertia, Spacecraft, Vector
from nutdamp.spacecraft.schedule import STEERABLE, Pulse, Schedule, channel_pulse, steerable_pulse

CONVERGED = 1e-14  # rad; a few roundings of the integration
ALIKE = 1e-9  # difference in size, relative, up to which pulses are equal
STEPS = 30
INTEGRATED = 50_000  # steps of integration after which a correction stops: some seconds
# least relative gain of a step; near a solution each step gains many digits, so less means a bound
# in the way
PROGRESS = 0.01
# pulses up to which a schedule is corrected on the true motion: a correction flies all of them some
# twenty times
MOST_CORRECTED = 1_000
LEFT_OVER = (
    0.05  # largest residual, over nutation and turn together, of a schedule that reaches the target
)
LEFT_OVER_BY_TICKS = 0.5  # largest residual where the resolution of commands may be to blame

# last pulses that are corrected, and rounded to ticks one after the other: as many as there are
# equations
TAIL = 4

# angle in rad below which a standing ω counts as opposed to a torque (a sphere, where nothing
# turns)
ALIGNED = 1e-9

# Pulses corrected at the end of a schedule of equal ones, each of which has one variable less; of
# given length so many before the equal ones, which damp the nutation, and at the end.
MOVED, BEFORE, AFTER = 8, 12, 24


@dataclass(frozen=True, eq=False)
class SymmetricModel:
    """``symmetric`` is planned on for ``spacecraft``; ``stretch`` (2,) leads from the ellipse of
    (ω1, ω2) to the circle.
    """

    spacecraft: Spacecraft
    symmetric: Spacecraft
    stretch: Vector

    @property
    def exact(self) -> bool:
        """True if the model moves as the spacecraft does, so that nothing has to be corrected."""
        spacecraft = self.spacecraft
        alike = self.symmetric.inertia.moments == spacecraft.inertia.moments
        return alike and not spacecraft.disturbances and spacecraft.growth == 0.0

    def translate(self, schedule: Schedule) -> Schedule:
        """Schedule with the true actuators."""
        if self.symmetric.inertia.moments == self.spacecraft.inertia.moments:
            return schedule
        torquer = self.spacecraft.torquer
        windows = Windows(self.spacecraft)
        ready = self.spacecraft.limits.earliest
        pulses = list[Pulse]()
        for pulse in schedule:
            channel = channel_of(self.spacecraft, pulse)
            if channel is not None:
                true = channel_pulse(channel, pulse.t, pulse.on_time)
            else:  # longer or shorter, and so moved where the limits require it
                assert torquer is not None
                first, second = pulse.impulse[:2] / self.stretch
                impulse = math.hypot(first, second)
                t = pulse.t
                on_time = 0.0
                if torquer.torque is not None:
                    on_time = windows.on_time(impulse / torquer.torque, 0.0, math.inf)
                    start = windows.earliest_start(on_time, max(pulse.start, ready))
                    t = t if start is None else start + 0.5 * on_time
                true = steerable_pulse(
                    torquer, t, math.atan2(second, first), impulse=impulse, on_time=on_time
                )
            pulses.append(true)
            ready = true.end + self.spacecraft.limits.gap
        return Schedule(tuple(pulses), schedule.notes, schedule.bounds)


def model_of(
    spacecraft: Spacecraft, *, turning: bool = False, three_moments: bool = False
) -> SymmetricModel:
    """Model of a spacecraft, whose torques change ω as the true ones do.

    ``turning``: they turn H so, and ω at t = 0 is as much larger or smaller on average: the circle
    may be of any size. ``three_moments``: the model has those of the spacecraft.
    """
    undisturbed = spacecraft
    if spacecraft.disturbances:  # ω counts from the steady response to those that last
        steady = steady_omega(spacecraft, 0.0)
        beaten = (
            replace(each, transverse=0j) if settles(spacecraft, each) else each
            for each in spacecraft.disturbances
        )
        undisturbed = replace(
            spacecraft,
            omega0=spacecraft.omega0 - np.array([steady.real, steady.imag, 0.0]),
            disturbances=tuple(each for each in beaten if each.axial or each.transverse),
        )
    inertia = spacecraft.inertia
    if inertia.symmetric or three_moments:
        return SymmetricModel(spacecraft, _aimed(undisturbed, spacecraft), np.ones(2))
    # Its nutation has the true rate, and (s1 ω1, s2 ω2) moves on a circle (linearised Euler
    # equations).
    A = inertia.nutating(spacecraft.spin)
    C = inertia.C
    across = np.array(inertia.moments[:2])
    scale = inertia.circle(spacecraft.spin) * across
    scale /= math.sqrt(scale[0] * scale[1])
    stretch = scale * A / across  # for torques and impulses
    mean = float(np.mean(stretch))
    torquer = undisturbed.steerable
    if (
        torquer is not None and torquer.torque is not None
    ):  # the stretch differs by direction: near enough for a plan
        torquer = replace(torquer, torque=torquer.torque * mean)
    factors = np.ones(3) if turning else np.array([*stretch, 1.0])
    channels = []
    for channel in undisturbed.channels:
        thrusters = tuple(
            replace(thruster, torque=thruster.torque * factors) for thruster in channel.thrusters
        )
        channels.append(replace(channel, thrusters=thrusters, spends=channel.strength))
    symmetric = replace(
        undisturbed,
        inertia=Inertia((A, A, C), inertia.axes, inertia.wheel),
        omega0=np.array(
            [*(scale * undisturbed.omega0[:2] / (mean if turning else 1.0)), undisturbed.omega0[2]]
        ),
        channels=tuple(channels),
        steerable=torquer,
        limits=replace(spacecraft.limits, horizon=spacecraft.horizon),
    )
    return SymmetricModel(spacecraft, _aimed(symmetric, spacecraft), stretch)


def _aimed(symmetric: Spacecraft, spacecraft: Spacecraft) -> Spacecraft:
    """Copy of the ``symmetric``, which has another H, with the target axis at its distance from H
    of the ``spacecraft``.
    """
    if spacecraft.goal.axis is None or symmetric is spacecraft:
        return symmetric
    quaternion = spacecraft.initial.quaternion
    given = spacecraft.attitude or Attitude(quaternion)
    in_file_axes = attitude.multiply(quaternion, attitude.from_matrix(spacecraft.inertia.axes.T))
    held = replace(symmetric, attitude=replace(given, quaternion=in_file_axes))
    before, after = (
        momentum / float(np.linalg.norm(momentum))
        for momentum in (spacecraft.momentum, held.momentum)
    )
    # The shortest turn from the one H to the other: two reflections, at the middle between both and
    # at the second.
    middle = (before + after) / float(np.linalg.norm(before + after))
    axis = spacecraft.goal.axis - 2.0 * (middle @ spacecraft.goal.axis) * middle
    return replace(held, goal=replace(spacecraft.goal, axis=axis - 2.0 * (after @ axis) * after))


def settles(spacecraft: Spacecraft, disturbance: Disturbance) -> bool:
    """True if the disturbance lasts, and ω beats against it at least once within the horizon; else
    it counts as resonant.
    """
    lasts = disturbance.begin <= 0.0 and disturbance.end >= spacecraft.horizon
    return (
        lasts
        and abs(spacecraft.nutation_rate + disturbance.rate) * spacecraft.horizon > 2.0 * math.pi
    )


def steady_omega(spacecraft: Spacecraft, time: float) -> complex:
    """Steady-state ω of the settling disturbances at ``time`` s, which needs no damping."""
    if not spacecraft.disturbances:
        return 0.0 + 0.0j
    from nutdamp.physics import driven  # disturbances

    A = spacecraft.inertia.A
    nutation_rate = spacecraft.nutation_rate
    steady = 0.0 + 0.0j
    for disturbance in spacecraft.disturbances:
        if disturbance.transverse and settles(spacecraft, disturbance):
            turned = cmath.rect(1.0, disturbance.rate * time)
            steady += (
                driven.steady_response(A, nutation_rate, disturbance.transverse, disturbance.rate)
                * turned
            )
    return steady


def left(spacecraft: Spacecraft, schedule: Schedule, *, momentum: bool = True) -> float:
    """Size of the residual of a flown schedule, rad; without ``momentum`` of the nutation alone."""
    missed = _missed(propagation.flown(spacecraft, schedule))
    return float(np.linalg.norm(missed if momentum else missed[:2]))


def _missed(flight_: propagation.Flight, *, spin: bool = False) -> Vector:
    """Residual of a flight, (4,) rad: tilt of H from the spin axis in body axes 1, 2; H off target
    in two.

    The four are zero exactly when no nutation is left and H lies along the target axis, without one
    where it was. Under disturbances the tilt counts from the steady response to them, about which
    nothing is to be damped. ``spin`` adds a fifth, the relative error of the final spin.
    """
    spacecraft, schedule = flight_.spacecraft, flight_.schedule
    inertia = replace(spacecraft.inertia, moments=flight_.last_moments)
    body = inertia.momentum(flight_.settled.rates)
    after = flight_.last_momentum
    steady = steady_omega(spacecraft, schedule.end)
    body[:2] -= np.array(inertia.moments[:2]) * (steady.real, steady.imag)
    aside = attitude.square_to(spacecraft.target_axis)
    across = np.array([aside @ after, np.cross(spacecraft.target_axis, aside) @ after])
    left = np.concatenate([body[:2], across]) / float(np.linalg.norm(body))
    final = spacecraft.goal.spin
    return (
        left if not spin or final is None else np.append(left, flight_.settled.spin / final - 1.0)
    )


def correct(
    spacecraft: Spacecraft,
    schedule: Schedule,
    *,
    chosen: Sequence[int],
    momentum: bool,
    spin: bool = False,
    equal: bool = False,
    resizable: bool = True,
) -> Schedule:
    """``schedule`` with the ``chosen`` pulses corrected on the flown motion of ``spacecraft``, if
    that leaves less.

    Starts, on-times within their bounds, and directions of steerable pulses are free. Of ``equal``
    pulses, those as large as the last one, the sizes stay as they are, or all change alike where
    they are ``resizable`` and commands have no ticks. ``momentum``: H too is to be brought to the
    target axis (without one, back), not only the nutation taken out; ``spin``: and the spin to the
    rate requested. A schedule without pulses stays as it is.
    """
    if not schedule.pulses:
        return schedule
    size = _size(schedule.pulses[-1])
    same = np.array([equal and alike(schedule, pulse) for pulse in schedule])
    together = equal and resizable and spacecraft.limits.tick is None and size > 0.0
    moves = np.zeros(len(schedule), dtype=bool)
    moves[list(chosen)] = True
    # Start s, angle rad of a steerable pulse, and size of each, its natural size, and bounds.
    channels = [channel_of(spacecraft, pulse) for pulse in schedule]
    settings, lower, upper = np.zeros((3, len(schedule), 3))
    for index, (pulse, channel) in enumerate(zip(schedule, channels, strict=True)):
        angle = math.atan2(pulse.impulse[1], pulse.impulse[0])
        shortest, longest = 0.0, math.inf
        if channel is not None:
            shortest = effective_on_times(channel)[0]
            longest = max(longest_on_time(spacecraft, channel), pulse.on_time)
        earliest = spacecraft.limits.earliest + pulse.start - pulse.loaded[0]
        latest = spacecraft.horizon - pulse.on_time - (pulse.over - pulse.end)
        settings[index] = pulse.start, angle, _size(pulse)
        lower[index] = earliest, -math.inf, shortest
        upper[index] = max(latest, pulse.start), math.inf, longest
    scale = np.ones_like(settings)
    scale[:, 0], scale[:, 2] = 1.0 / spacecraft.fastest, settings[:, 2]
    steerable = np.array([channel is None for channel in channels])
    mask = np.column_stack([moves, moves & steerable, moves & ~same])
    free = np.column_stack([each[mask] for each in (settings, scale, lower, upper)])
    if together:  # and the common factor of the equal ones
        bounds = lower[same, 2].max() / size, upper[same, 2].min() / size
        free = np.concatenate([free, [(1.0, 1.0, *bounds)]])
    count = int(mask.sum())
    steps = 0
    dynamics = make_dynamics(spacecraft).remembering()

    def build(x: Vector) -> Schedule:
        moved = settings.copy()
        moved[mask] = x[:count]
        if together:
            moved[same, 2] *= x[-1]
        moved[~moves, 0] += 0.5 * (settings - moved)[~moves, 2]  # about their centres
        pulses = [
            _pulse(spacecraft, channel, *setting) if changed else pulse
            for pulse, channel, setting, changed in zip(
                schedule, channels, moved.tolist(), moves | (same & together), strict=True
            )
        ]
        return Schedule(supplied(spacecraft, pulses), schedule.notes, schedule.bounds)

    def left(schedule: Schedule) -> Vector:
        nonlocal steps
        flown = propagation.flown(spacecraft, schedule, dynamics=dynamics)
        steps += flown.steps
        missed = _missed(flown, spin=spin)
        return missed if momentum else np.delete(missed, [2, 3])

    x = solve(lambda x: left(build(x)), free, lambda: steps > INTEGRATED or work.exhausted())
    rounded = supplied(spacecraft, (commandable(spacecraft, pulse) for pulse in build(x)))
    corrected = Schedule(rounded, schedule.notes, schedule.bounds)
    better = np.linalg.norm(left(corrected)) < np.linalg.norm(left(schedule))
    return corrected if better and keeps_limits(spacecraft, corrected.pulses) else schedule


@dataclass(frozen=True, slots=True)
class Correction:
    """Corrects schedules of a ``scheme`` on the motion of a true spacecraft."""

    scheme: Scheme
    options: SchemeOptions

    @property
    def momentum(self) -> bool:
        """True if H too has an end condition."""
        return self.scheme.points and not (
            isinstance(self.options, OptimalOptions) and self.options.free_axis
        )

    def __call__(self, spacecraft: Spacecraft, schedule: Schedule, free: int = TAIL) -> Schedule:
        """``schedule`` with its last pulse corrected; with up to the last ``free`` ones where H
        counts.
        """
        if self.options.uncorrected or not 0 < len(schedule) <= MOST_CORRECTED or work.exhausted():
            return schedule
        # The last pulses, which know what the others did on the model, undo what the true motion
        # made of them.
        whole = free == TAIL
        given = self.options.equal and not self.options.resizable
        last = free if not (whole and self.options.equal) else AFTER if given else MOVED
        chosen = tuple(range(-min(len(schedule), last), 0)) if self.momentum else (-1,)
        if (
            self.momentum and whole and given
        ):  # moments alone hardly turn H further; what damped before them does
            damping = [index for index, pulse in enumerate(schedule) if not alike(schedule, pulse)]
            chosen = (*damping[:BEFORE], *chosen)
        spin = self.scheme.sets_spin and spacecraft.goal.spin is not None
        if spin and whole:  # and the pulse that gives most to the spin
            axial = [abs(float(pulse.impulse[2])) for pulse in schedule]
            chosen = (*chosen, axial.index(max(axial)))
        sizes = {"equal": self.options.equal, "resizable": self.options.resizable}
        return correct(
            spacecraft, schedule, chosen=chosen, momentum=self.momentum, spin=spin, **sizes
        )


def alike(schedule: Schedule, pulse: Pulse) -> bool:
    """True if a pulse is as large as the last one of a schedule."""
    last = schedule.pulses[-1]
    size, other = (
        each.magnitude if last.on_time == 0.0 else each.on_time for each in (pulse, last)
    )
    return abs(size - other) <= ALIKE * other


def _pulse(
    spacecraft: Spacecraft, channel: Channel | None, start: float, angle: float, size: float
) -> Pulse:
    """Pulse with these settings, as in `correct`."""
    if channel is not None:
        return channel_pulse(channel, start + 0.5 * size, size)
    torquer = spacecraft.torquer
    assert torquer is not None
    on_time = 0.0 if torquer.torque is None else size / torquer.torque
    return steerable_pulse(torquer, start + 0.5 * on_time, angle, impulse=size)


def _size(pulse: Pulse) -> float:
    """Size of a pulse: on-time of a channel, s, impulse of a steerable torquer, N m s."""
    return pulse.magnitude if pulse.channel == STEERABLE else pulse.on_time


def solve(
    residual: Callable[[Vector], Vector],
    free: Vector,
    enough: Callable[[], bool],
    slopes: Callable[[Vector, Vector], Vector] | None = None,
) -> Vector:
    """Unknowns (n,) that make ``residual`` (m,) least in norm.

    ``free`` (n, 4): start, natural size and bounds of each. With more unknowns than equations the
    nearest solution. It is left as it is once there was ``enough`` work. ``slopes`` of unknowns and
    their residual, (m, n) in natural sizes, are asked for once, and corrected at each step (Broyden
    1965); without them they are differences of residuals at every step.
    """
    start, scale, lower, upper = free.T
    difference = 1e-6  # in scaled unknowns: the error of the slopes, far below their size
    x = np.clip(start, lower, upper)
    value = residual(x)
    norm = float(np.linalg.norm(value))
    jacobian = None if slopes is None or norm <= CONVERGED else slopes(x, value)
    for _ in range(STEPS):
        if norm <= CONVERGED or enough():
            break
        if slopes is None:
            moved = x + np.diag(difference * scale)
            jacobian = np.column_stack([(residual(each) - value) / difference for each in moved])
        assert jacobian is not None
        step = bounded_step(jacobian, value, x, scale, lower, upper)
        before, last, last_value = norm, x, value
        for shrink in range(8):
            trial = np.clip(last + step * 0.5**shrink, lower, upper)
            trial_value = residual(trial)
            trial_norm = float(np.linalg.norm(trial_value))
            if trial_norm < before:
                x, value, norm = trial, trial_value, trial_norm
                break
        if norm > before * (1.0 - PROGRESS):
            break
        if slopes is not None:
            change = (x - last) / scale
            wrong = value - last_value - jacobian @ change
            jacobian = jacobian + np.outer(wrong, change) / (change @ change)
    return np.asarray(x)


def bounded_step(
    jacobian: Vector, value: Vector, x: Vector, scale: Vector, lower: Vector, upper: Vector
) -> Vector:
    """Least-squares step (n,) for a ``jacobian`` (m, n) by scaled unknowns; one that would leave
    its bounds stays.
    """
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


ROUNDING = 1e-12  # rad; where the spin axis is that near the target already, no pulses are needed


def tolerable(spacecraft: Spacecraft) -> float:
    """Largest residual, rad, at which the target counts as reached:
    more where commands have ticks.
    """
    share = LEFT_OVER if spacecraft.limits.tick is None else LEFT_OVER_BY_TICKS
    return max(share * (spacecraft.nutation + spacecraft.to_turn), ROUNDING)


def components(channels: list[Channel], target: complex) -> list[tuple[Channel, float]]:
    """Impulses >= 0 (N m s) along channel directions that sum to ``target`` with least total; else
    the nearest.
    """
    best: list[tuple[Channel, float]] = []
    least = math.inf
    for left, right in itertools.combinations(channels, 2):
        d1, d2 = (channel.transverse / abs(channel.transverse) for channel in (left, right))
        area = (d1.conjugate() * d2).imag
        if abs(area) < 1e-9:
            continue
        first, second = (target.conjugate() * d2).imag / area, (d1.conjugate() * target).imag / area
        if min(first, second) >= -1e-12 * abs(target) and first + second < least:
            least = first + second
            best = [(left, first), (right, second)]
    if not best:
        along = [
            (target * channel.transverse.conjugate()).real / abs(channel.transverse)
            for channel in channels
        ]
        best = [max(zip(channels, along, strict=True), key=lambda share: share[1])]
    return [(channel, impulse) for channel, impulse in best if impulse > 1e-12 * abs(target)]
