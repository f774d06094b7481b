"""Propagation of schedules, by impulse sum or real pulse widths, and the track: motion over time as
arrays.

`by_impulses` is the plan's own model, the impulse sum (17) with effective impulses. `flown` is the
judge: real widths, true moments. Both give legs that evaluate the motion at any time.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.results import Tabled
from nutdamp.flight.dynamics import (
    Dynamics,
    Lightening,
    Path,
    joined,
    lightened,
    make_dynamics,
    shed,
)
from nutdamp.physics import attitude, response
from nutdamp.physics.motion import MOST_STEPS
from nutdamp.spacecraft.model import Inertia, Spacecraft, SpinState, Vector
from nutdamp.spacecraft.schedule import Pulse, Schedule

Array = NDArray[np.float64]

PIECE = 20_000  # rows of a track that are held at a time where many are written


@dataclass(frozen=True, slots=True)
class Track:
    """Motion over n rows, in principal axes: times ``t`` (n,) s; ``rates`` (n, 3) rad/s;
    ``quaternion`` (n, 4), body -> inertial, scalar first; spin ``axis`` (n, 3) and ``momentum``
    (n, 3) N m s, inertial; ``nutation``, ``body_cone`` and ``space_cone`` (n,) rad; ``pulse`` (n,),
    pulses completed.
    """

    t: Array
    rates: Array
    quaternion: Array
    axis: Array
    momentum: Array
    nutation: Array
    body_cone: Array
    space_cone: Array
    pulse: NDArray[np.int64]


def widest(track: Track, moments: Array, sense: float, wheel: float) -> Track:
    """Track with the cone angles at the largest nutation of the free motion through each row.

    ``moments`` (kg m²) are (3,), or (n, 3) where they change; ``wheel`` is h in N m s. The spin
    axis is ``sense``·e3.
    """
    if np.array_equal(moments[..., 0], moments[..., 1]):
        return track
    from nutdamp.physics.triaxial import widest_cones  # three different moments

    nutation, body_cone = widest_cones(
        np.broadcast_to(moments, track.rates.shape).T, track.rates.T, sense, wheel
    )
    return replace(track, nutation=nutation, body_cone=body_cone, space_cone=nutation - body_cone)


def in_file_axes(track: Track, inertia: Inertia) -> Track:
    """Track with rates and quaternion in the axes of the file."""
    rates, quaternion = inertia.in_file_axes(track.rates, track.quaternion)
    return replace(track, rates=rates, quaternion=quaternion)


def even_times(
    samples: int, until: float, start: float, end: float
) -> Iterator[tuple[Array, bool, bool]]:
    """Parts of np.linspace(0, ``until``, ``samples``) within ``start`` to ``end``, with marks of
    the first and last.
    """
    step = until / max(samples - 1, 1)
    low, high = (
        min(max(int(time / step) + more, 0), samples) for time, more in ((start, -1), (end, 2))
    )
    for begin in range(low, max(high, low + 1), PIECE):
        index = np.arange(begin, min(begin + PIECE, high))
        times: Array = np.asarray(index * step, dtype=np.float64)
        if samples > 1:
            times[index == samples - 1] = until
        yield times[(times > start) & (times < end)], begin == low, begin + PIECE >= high


IMPULSE_SUM = "impulse sum (17)"
REAL_WIDTHS = "real pulse widths"  # models of the flight of a schedule
IDEAL_IMPULSES = (
    "exact motion, ideal impulses"  # name of the second model for people where no pulse has a width
)
PLANNED_STEPS = (
    30_000  # steps of integration to fly a planned schedule, at most: some 60,000 radians
)


def model_name(schedules: Iterable[Schedule], model: str = REAL_WIDTHS) -> str:
    """Name of the model of ``schedules`` for people; widths are named where a pulse has one."""
    wide = model != REAL_WIDTHS or any(
        pulse.on_time for schedule in schedules for pulse in schedule
    )
    return model if wide else IDEAL_IMPULSES


@dataclass(frozen=True, slots=True)
class Residual:
    """Residual after the last pulse by a ``model``, rad: largest ``nutation`` on the following arc,
    ``body_cone`` and signed ``space_cone`` at that instant; ``momentum_shift`` of H from where it
    was at t = 0, its ``axis_error`` from the target axis.
    """

    nutation: float
    body_cone: float
    space_cone: float
    momentum_shift: float
    axis_error: float
    model: str = field(default=REAL_WIDTHS, compare=False)


@dataclass(frozen=True, slots=True)
class Final:
    """Final pointing, just after the last pulse."""

    axis: Vector  # spin axis, inertial unit vector (3,)
    momentum: Vector  # direction of H, the same
    spin: float  # ω3, rad/s
    nutation: float  # as in `Residual`, rad: half-angle at which the axis goes round H from then on


@dataclass(frozen=True, slots=True)
class Leg:
    """Leg of the flight from ``start`` to ``end`` s."""

    start: float
    end: float
    path: Path
    completed: int  # pulses that are over along it
    jump: bool  # of the rates at its start
    completed_at_end: int  # pulses that are over at its very end


Motion = tuple[Vector, Vector, Vector, NDArray[np.int64]]
"""Times (n,) s, rates (n, 3) rad/s, quaternions (n, 4) and pulses completed (n,)."""


@dataclass(frozen=True, eq=False, repr=False)
class Flight(Tabled):
    """Flight of the ``schedule`` of a ``spacecraft`` by one ``model``.

    ``legs`` in order; ``settled``: rates, rad/s, and quaternion just after the end of the last
    pulse; ``moments``, kg m², at t = 0; ``spans``: times, s, between which each pulse acts, its
    centre twice for impulses. ``until``: end of the rows it is shown by, s, None: that of its last
    leg; ``samples``: even times among these, besides rows just before and after each pulse;
    ``scheme``: by which it was planned.
    """

    spacecraft: Spacecraft
    schedule: Schedule
    legs: tuple[Leg, ...]
    settled: SpinState
    moments: tuple[float, float, float]
    spans: tuple[tuple[float, float], ...]
    model: str = REAL_WIDTHS
    until: float | None = None
    samples: int = 1000
    scheme: str = ""

    @property
    def steps(self) -> int:
        """Steps of integration."""
        return sum(leg.path.steps for leg in self.legs)

    @property
    def residual(self) -> Residual:
        """Cone angles after the last pulse, and where H went."""
        spacecraft, target = self.spacecraft, self.spacecraft.goal.axis
        after = self.last_momentum
        shift = float(attitude.angle_between(spacecraft.momentum, after))
        inertia = replace(spacecraft.inertia, moments=self.last_moments)
        left = inertia.cones(self.settled.rates, spacecraft.sense)
        error = shift if target is None else float(attitude.angle_between(target, after))
        return Residual(left.nutation, left.body, left.space, shift, error, self.model)

    @property
    def final(self) -> Final:
        """Final direction of spin axis and angular momentum."""
        state, momentum = self.settled, self.last_momentum
        axis = attitude.rotate(state.quaternion, np.array([0.0, 0.0, self.spacecraft.sense]))
        return Final(
            axis,
            np.asarray(momentum / np.linalg.norm(momentum)),
            state.spin,
            self.residual.nutation,
        )

    @property
    def last_momentum(self) -> Vector:
        """Angular momentum after the last pulse, inertial, (3,) N m s."""
        inertia = replace(self.spacecraft.inertia, moments=self.last_moments)
        return attitude.rotate(self.settled.quaternion, inertia.momentum(self.settled.rates))

    def moments_at(self, times: Vector) -> Vector:
        """Principal moments (kg m²) at ``times`` (n,) s: (3,), or (n, 3) where they fall with the
        propellant used.
        """
        per_kg = shed(self.spacecraft)
        if per_kg is None:
            return np.asarray(self.moments)
        used = self.schedule.used_by(
            np.asarray(times, dtype=float), at_once=self.model == IMPULSE_SUM
        )
        return self.moments - used[:, None] * per_kg

    @property
    def last_moments(self) -> tuple[float, float, float]:
        """Principal moments after the last pulse, kg m²."""
        if shed(self.spacecraft) is None:
            return self.moments
        first, second, third = self.moments_at(np.array([math.inf]))[0].tolist()
        return first, second, third

    def motion(self, times: Vector) -> tuple[Vector, Vector]:
        """Rates (n, 3) in rad/s and quaternions (n, 4) at ``times`` (n,) s; just after a jump."""
        return joined([(leg.start, leg.path.motion) for leg in self.legs], times)

    def axis(self, times: Vector) -> Vector:
        """Spin axis, inertial unit vectors (n, 3), at ``times`` (n,) s."""
        return attitude.rotate(self.motion(times)[1], np.array([0.0, 0.0, self.spacecraft.sense]))

    @property
    def shown_to(self) -> float:
        """End of the rows, s."""
        return self.legs[-1].end if self.until is None else self.until

    @property
    def track(self) -> Track:
        """Rows as arrays: SI and rad, body rates and quaternion in the axes of the file."""
        return in_file_axes(self.sampled(self.samples, self.shown_to), self.spacecraft.inertia)

    def sampled(self, samples: int, until: float) -> Track:
        """Motion at ``samples`` even times from 0 to ``until`` s, which it reaches, and before and
        after each pulse.
        """
        return self._track(self._motions(samples, until))

    def pieces(self, samples: int, until: float) -> Iterator[Track]:
        """Rows of `sampled` in order, about `PIECE` at a time, to bound memory."""
        motions = list[Motion]()
        count = 0
        for motion in self._motions(samples, until):
            motions.append(motion)
            count += len(motion[0])
            if count >= PIECE:
                yield self._track(motions)
                motions = []
                count = 0
        if motions:
            yield self._track(motions)

    def _track(self, motions: Iterable[Motion]) -> Track:
        """All that follows from the motion. Cone angles are of each moment; with I1 ≠ I2 they
        swing: see `widest`.
        """
        t, rates, quaternion, pulse = (
            np.concatenate(column) for column in zip(*motions, strict=True)
        )
        sense = self.spacecraft.sense
        momentum = rates * self.moments_at(t) + np.array([0.0, 0.0, self.spacecraft.inertia.wheel])
        nutation = np.arctan2(np.hypot(momentum[:, 0], momentum[:, 1]), sense * momentum[:, 2])
        body_cone = np.arctan2(np.hypot(rates[:, 0], rates[:, 1]), sense * rates[:, 2])
        axis = attitude.rotate(quaternion, np.array([0.0, 0.0, sense]))
        in_space = attitude.rotate(quaternion, momentum)
        return Track(
            t, rates, quaternion, axis, in_space, nutation, body_cone, nutation - body_cone, pulse
        )

    def _motions(self, samples: int, until: float) -> Iterator[Motion]:
        """Rows of a track by leg, and each leg in stretches of `PIECE` even times."""
        for leg in self.legs:
            if leg.start > until:
                break
            end = min(leg.end, until)
            for times, first, last in even_times(samples, until, leg.start, end):
                times = np.concatenate([[leg.start], times]) if leg.jump and first else times
                times = np.append(times, end) if last and end > leg.start else times
                body, quaternion = leg.path.motion(times)
                completed = np.full(len(times), leg.completed)
                completed[times == leg.end] = leg.completed_at_end
                yield times, body, quaternion, completed

    def around_pulses(self) -> tuple[Track, Track]:
        """Motion just before and after each pulse, a row per pulse;
        cone angles as in `Residual`.
        """
        nothing = np.empty(0), np.empty((0, 3)), np.empty((0, 4)), np.empty(0, dtype=np.int64)
        before, after = [nothing], [nothing]
        starts, overs = [leg.start for leg in self.legs], [leg.end for leg in self.legs]
        for completed, span in enumerate(self.spans):
            first, last = (
                self.legs[bisect_left(overs, span[0])],
                self.legs[bisect_right(starts, span[1]) - 1],
            )
            begins, ends = np.array([span[0]]), np.array([span[1]])
            before.append((begins, *first.path.motion(begins), np.array([completed])))
            after.append((ends, *last.path.motion(ends), np.array([completed + 1])))
        return self._widest(before), self._widest(after)

    def _widest(self, motions: Iterable[Motion]) -> Track:
        track = self._track(motions)
        spacecraft = self.spacecraft
        return widest(track, self.moments_at(track.t), spacecraft.sense, spacecraft.inertia.wheel)


def by_impulses(spacecraft: Spacecraft, schedule: Schedule, until: float = 0.0) -> Flight:
    """Impulse-sum solution, Magnus 1970 (17), pulse by pulse.

    Each pulse acts at its centre with its effective impulse (`effective_impulses`); between them
    the motion is that of `flown`. The last leg reaches at least to ``until`` s. Raises Infeasible
    as `flown` does.
    """
    dynamics = make_dynamics(spacecraft)
    state = spacecraft.initial
    allowed = _allowed(schedule, until)
    legs: list[Leg] = []
    now, used = 0.0, 0.0
    for index, pulse in enumerate(schedule):
        path, state = dynamics.path(state, now, pulse.t, most=allowed)
        allowed -= path.steps
        legs.append(Leg(now, pulse.t, path, index, jump=True, completed_at_end=index))
        taken = pulse.propellant or 0.0
        inertia = lightened(spacecraft, used + 0.5 * taken)
        kick = _effective_impulse(spacecraft, inertia, pulse, state.spin)
        impulse = np.array([kick.real, kick.imag, pulse.impulse[2]])
        state = replace(dynamics, moments=inertia.moments).kicked(state, impulse)
        now = pulse.t
        used = used + taken
        dynamics = replace(dynamics, moments=lightened(spacecraft, used).moments)
    last = max(until, schedule.end)
    path, _ = dynamics.path(state, now, last, most=allowed)
    legs.append(Leg(now, last, path, len(schedule), jump=True, completed_at_end=len(schedule)))
    spans = tuple((pulse.t, pulse.t) for pulse in schedule)
    return Flight(
        spacecraft, schedule, tuple(legs), state, spacecraft.inertia.moments, spans, IMPULSE_SUM
    )


def effective_impulses(spacecraft: Spacecraft, schedule: Schedule) -> NDArray[np.complex128]:
    """J1 + iJ2 with which each pulse acts on ω at its centre, (k,) N m s: its impulse times
    `rates.width_factor`.

    With I1 ≠ I2 by the rate of a small nutation, which turns on an ellipse: exact for small angles.
    """
    arcs = by_impulses(spacecraft, schedule).legs[:-1]  # each up to its pulse
    spins = [float(leg.path.motion(np.array([leg.end]))[0][0, 2]) for leg in arcs]
    impulses = []
    used = 0.0
    for pulse, spin in zip(schedule, spins, strict=True):
        taken = pulse.propellant or 0.0
        impulses.append(
            _effective_impulse(spacecraft, lightened(spacecraft, used + 0.5 * taken), pulse, spin)
        )
        used += taken
    return np.array(impulses, dtype=complex)


def _effective_impulse(
    spacecraft: Spacecraft, inertia: Inertia, pulse: Pulse, spin: float
) -> complex:
    """Effect of ``pulse`` on ω at its centre, N m s, with the ``inertia`` and ω3 (rad/s)
    before it.
    """
    drift = spacecraft.spin_drift(*pulse.thrust)
    impulse = complex(pulse.impulse[0], pulse.impulse[1])
    axial_torque = 0.0 if pulse.torque is None else float(pulse.torque[2])
    slope = inertia.nutation_slope(spin)
    change = slope * axial_torque / inertia.C
    turn = slope * drift
    growth = spacecraft.growth
    if pulse.command is not None and pulse.command.ramps:
        from nutdamp.physics import thruster  # few spacecraft have any

        rate = inertia.nutation_rate(spin - drift * (pulse.t - pulse.thrust[0]))
        return impulse * thruster.shape_factor(
            rate, change, pulse.command.ramps, pulse.t, growth, turn
        )
    rate = inertia.nutation_rate(spin - 0.5 * drift * pulse.on_time)
    return impulse * response.width_factor(rate, change, pulse.on_time, growth, turn)


def flown(
    spacecraft: Spacecraft,
    schedule: Schedule,
    until: float = 0.0,
    *,
    dynamics: Dynamics | None = None,
) -> Flight:
    """Euler's equations through the real pulse widths, with the true principal moments.

    Coasts of symmetric bodies without disturbances are exact arcs, with dissipation too; everything
    else is Taylor series at rounding accuracy. The last leg reaches at least to ``until`` s.
    ``dynamics``: those of the spacecraft, where known. Raises Infeasible beyond `PLANNED_STEPS`, or
    `motion.MOST_STEPS` where a later end is requested.
    """
    dynamics = dynamics or make_dynamics(spacecraft)
    state = spacecraft.initial
    allowed = _allowed(schedule, until)
    pulses, over = schedule.pulses, schedule.end
    spans = tuple(pulse.thrust for pulse in pulses)
    starts, ends = np.array(spans).reshape(-1, 2).T
    last = max(until, over)
    edges = sorted({0.0, over, last, *(time for pulse in pulses for time in pulse.edges)})
    light = Lightening(dynamics, spacecraft, schedule, edges)
    legs: list[Leg] = []
    settled = state
    for now, end in zip(edges, [*edges[1:], last], strict=True):
        dynamics, falling = light.between(dynamics, now, end)
        # So late, start and end of a very short pulse may be the same number: then it too acts at
        # once.
        kicks = [pulses[index].impulse for index in np.flatnonzero((starts == now) & (ends == now))]
        if kicks and now == 0.0:  # so that the motion just before the kick is there too
            path, _ = dynamics.path(state, now, now, most=allowed)
            legs.append(Leg(now, now, path, 0, jump=True, completed_at_end=0))
        for kick in kicks:
            state = light.halfway(dynamics, now).kicked(state, kick)
        if now == over:
            settled = state
        on = [pulses[index] for index in np.flatnonzero((starts <= now) & (end <= ends))]
        path, following = dynamics.path(
            state, now, end, *_torques(on, now, end), most=allowed, falling=falling
        )
        allowed -= path.steps
        completed, at_end = (
            int(
                np.count_nonzero(
                    (ends < time) | ((ends == time) & ((starts < time) | (time == now)))
                )
            )
            for time in (now, end)
        )
        legs.append(
            Leg(now, end, path, completed, jump=bool(kicks) or now == 0.0, completed_at_end=at_end)
        )
        state = following
    return Flight(spacecraft, schedule, tuple(legs), settled, light.first, spans)


def _torques(
    pulses: Iterable[Pulse], start: float, end: float
) -> tuple[list[Vector], Vector | None]:
    """Torques (3,) N m at ``start`` of the ``pulses`` that fire until ``end`` s, and their slope, N
    m/s, or None.
    """
    pushes = [push for push in (pulse.push(start, end) for pulse in pulses) if push is not None]
    slopes = [slope for _, slope in pushes if slope is not None]
    return [torque for torque, _ in pushes], np.sum(slopes, axis=0) if slopes else None


def _allowed(schedule: Schedule, until: float) -> int:
    """Steps of integration that a flight may take: a plan is flown again and again,
    a track once.
    """
    return MOST_STEPS if until > schedule.end else PLANNED_STEPS


def to_sun_pulse(flown: Flight, times: Vector) -> Vector:
    """Angle (n,) in [0, 2π) by which the body has to turn until the Sun passes the sensor."""
    from nutdamp.physics.sky import ahead  # a Sun sensor

    sensor, sun = flown.spacecraft.sun_sensor, flown.spacecraft.sun
    assert sensor is not None
    assert sun is not None
    rates, quaternions = flown.motion(times)
    sense = math.copysign(1.0, flown.spacecraft.spin)
    return ahead(rates.T, quaternions.T, sun[:, None], sensor.azimuth, sense)[0]
