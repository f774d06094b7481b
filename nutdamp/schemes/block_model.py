"""Closed-form model of command blocks fired from the Sun pulse, and Sun pulses of a flight.

H follows a rhumb line about the Sun (`precession`), and the nutation is the impulse sum (17) over pulses at even
times, for very many blocks at once. Commands count by the impulse, the centroid and the spread of their thrust; cold
nozzles and falling pressure by the impulse of each pulse, but for the nutation, which takes the mean pressure along a
block. Neglected are the jitter of the Sun pulses by nutation, and second order in the turn by one pulse.
"""

from __future__ import annotations

import cmath
import functools
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

import numpy as np

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.flight.dynamics import make_dynamics, shed
from nutdamp.flight.propagation import Flight
from nutdamp.flight.propellant import Supply
from nutdamp.physics import attitude, precession
from nutdamp.physics.batch import Bodies, MotionStretch
from nutdamp.physics.sky import SunPulseClock, TorqueRamp
from nutdamp.physics.thruster import Valve, spread
from nutdamp.spacecraft.equipment import Block, Channel, SunSensor
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import Left
from nutdamp.spacecraft.schedule import Pulse, Schedule, on_command

SAMPLES = 32
"""Samples of the Sun's azimuth in each spin turn, between which a Sun pulse is found."""

ITERATIONS = 60
"""Steps by which the moment of a Sun pulse is found in a flight, at most; three or four are usual."""

EXACT = 1e-13
"""Tolerance of the time of a Sun pulse, in spin turns."""

BLIND = 32
"""Spin turns in a row without a Sun pulse, after which none is waited for."""

FIRED, INTEGRATED = 1.0, 40.0
"""Units of `work` of a pulse that is fired, of a symmetric body and of one whose motion is integrated."""


def spin_turn(spacecraft: Spacecraft) -> float:
    """Time between two Sun pulses, s: the average one of the free motion.

    The body turns about H at |H|/A, and about its axis at aω3: together, and at small angles, at ω3.
    """
    inertia = spacecraft.inertia
    size = float(np.linalg.norm(spacecraft.momentum))
    return 2.0 * math.pi / abs(math.copysign(size / inertia.A, spacecraft.spin) + inertia.a * spacecraft.spin)


def sun_pulses(flown: Flight, until: float) -> Vector:
    """Times (n,) s from 0 to ``until`` s of the Sun pulses of the sensor; the flight must reach so far.

    Raises Infeasible where the sensor never sees the Sun.
    """
    body = flown.spacecraft
    sensor, turn = body.sun_sensor, spin_turn(body)
    assert sensor is not None
    assert body.sun is not None
    times = np.linspace(0.0, until, max(int(SAMPLES * until / turn), 2) + 1)
    # The Sun goes round in the body against the spin: what is left to the sensor's azimuth falls to zero.
    ahead = to_sun_pulse(flown, times)
    index = np.flatnonzero((ahead[:-1] < 0.5 * math.pi) & (ahead[1:] > 1.5 * math.pi))
    times_of = times[index] + ahead[index] * turn / (2.0 * math.pi)
    for _ in range(ITERATIONS):
        off = (to_sun_pulse(flown, np.minimum(times_of, until)) + math.pi) % (2.0 * math.pi) - math.pi
        times_of += off * turn / (2.0 * math.pi)
        if not len(times_of) or np.abs(off).max() < 2.0 * math.pi * EXACT:
            break
    times_of = times_of[(times_of >= 0.0) & (times_of <= until)]
    angles = attitude.angle_between(flown.axis(times_of), body.sun)
    seen = np.array([sensor.sees(angle) for angle in angles.tolist()], dtype=bool)
    if len(times_of) and not seen.any():
        _expect_seen(sensor, float(times_of[0]), float(angles[0]))
    return np.asarray(times_of[seen])


def _expect_seen(sensor: SunSensor, time: float, angle: float) -> None:
    """Raise Infeasible where the sensor does not see the Sun at this ``angle`` (rad) from the spin axis."""
    if not sensor.sees(angle):
        raise Infeasible(
            f"the Sun sensor does not see the Sun at {time:.4g} s, {math.degrees(angle):.4g}° from the spin axis: "
            "there is no Sun pulse"
        )


def to_sun_pulse(flown: Flight, times: Vector) -> Vector:
    """Angle (n,) in [0, 2π) by which the body has to turn until the Sun passes the sensor."""
    body = flown.spacecraft
    assert body.sun_sensor is not None
    assert body.sun is not None
    _, quaternions = flown.motion(times)
    seen = attitude.rotate(attitude.conjugate(quaternions), body.sun)
    azimuth = np.arctan2(seen[:, 1], seen[:, 0])
    return np.asarray(math.copysign(1.0, body.spin) * (azimuth - body.sun_sensor.azimuth) % (2.0 * math.pi))


class SunPulses:
    """Sun pulses of a spacecraft as its sensor gives them, one after the other.

    ``seen``: whether the sensor saw each passage of the Sun through its azimuth so far; those that it saw count. Raises
    Infeasible where there is no Sun or no sensor.
    """

    def __init__(self, spacecraft: Spacecraft) -> None:
        self.clock, self.seen, self._count = sun_clock(spacecraft), list[bool](), 0
        assert spacecraft.sun_sensor is not None
        self._sensor = spacecraft.sun_sensor

    def next(self, number: int) -> MotionStretch:
        """Motion at the Sun pulse of this ``number``, 1 the first after t = 0; numbers must not decrease.

        Raises Infeasible where there is none: the axis is too near to the Sun, or the sensor sees it no more.
        """
        motion, sensor = self.clock.here, self._sensor
        if sensor.sees_all:
            before = float(self.clock.time[0])
            self.seen += [True] * (number - len(self.seen))
            motion = self.clock.sun_pulse(number)
            self._expect_found(before)
            return motion
        unseen: list[tuple[float, float]] = []
        while self._count < number:
            before = float(self.clock.time[0])
            motion = self.clock.sun_pulse(len(self.seen) + 1)
            self._expect_found(before)
            angle = float(self.clock.angle(motion)[0])
            self.seen.append(bool(sensor.sees(angle)))
            self._count += self.seen[-1]
            unseen = [] if self.seen[-1] else [*unseen, (float(motion.since[0]), angle)]
            if len(unseen) > BLIND:
                _expect_seen(sensor, *unseen[0])
        return motion

    def _expect_found(self, before: float) -> None:
        if self.clock.lost[0]:
            raise Infeasible(f"no Sun pulse comes after {max(before, 0.0):.4g} s: the spin axis is too near to the Sun")


def sun_clock(spacecraft: Spacecraft) -> SunPulseClock:
    """Sun pulses of a spacecraft from t = 0; raises Infeasible where it has none."""
    sensor, sun = spacecraft.sun_sensor, spacecraft.sun
    if sensor is None or sun is None:
        raise Infeasible("there is no Sun pulse; the file needs sun and sun_sensor")
    dynamics, start = make_dynamics(spacecraft), spacecraft.initial
    bodies = Bodies(np.array(dynamics.moments)[:, None], dynamics.constant, dynamics.forcing)
    state = MotionStretch(bodies, np.zeros(1), start.rates[:, None], start.quaternion[:, None])
    return SunPulseClock(state, sun[:, None], math.copysign(1.0, spacecraft.spin), sensor.azimuth)


def pushes(pulse: Pulse, torque: Vector) -> list[TorqueRamp]:
    """Torques of a pulse, from the start of its command, with the ``torque`` (3, n) N m of cases."""
    if pulse.command is None:
        return [TorqueRamp(0.0, pulse.on_time, torque, torque)]
    back, ramps = pulse.command.start, pulse.command.ramps
    return [TorqueRamp(ramp.begin - back, ramp.end - back, torque * ramp.first, torque * ramp.last) for ramp in ramps]


def first_sun_pulse(spacecraft: Spacecraft) -> float:
    """Time of the first Sun pulse, s; raises Infeasible where there is none."""
    return float(SunPulses(spacecraft).next(1).since[0])


def fired(spacecraft: Spacecraft, blocks: Sequence[Block], seed: int | None = None) -> Schedule:
    """Pulses fired by ``blocks``, see `fire`."""
    return fire(spacecraft, blocks, seed)[0]


def fire(spacecraft: Spacecraft, blocks: Sequence[Block], seed: int | None = None) -> tuple[Schedule, list[bool]]:
    """Pulses fired by ``blocks``, with the Sun pulses of their own motion, and `SunPulses.seen`.

    With a ``seed`` the Sun pulses have the jitter of the sensor, which the nominal motion is without. Raises Infeasible
    where there is no Sun pulse, where a channel is not known, where a pulse would begin before the one before is over,
    and where the propellant does not last.
    """
    channels = {channel.name: channel for channel in spacecraft.channels}
    sun_pulses, sensor, errors = SunPulses(spacecraft), spacecraft.sun_sensor, np.random.default_rng(seed)
    clock = sun_pulses.clock
    jitter = 0.0 if seed is None or sensor is None else sensor.jitter
    supply, pulses, per_kg = Supply(spacecraft), list[Pulse](), shed(spacecraft)
    for block in blocks:
        channel = channels.get(block.channel)
        if channel is None:
            raise Infeasible(f"the spacecraft has no channel {block.channel}")
        for number in block.sun_pulses:
            work.spend(FIRED if spacecraft.inertia.symmetric and not spacecraft.disturbances else INTEGRATED)
            motion, over = sun_pulses.next(number), clock.over[0]
            delay = motion.since * 0.0 + jitter * errors.standard_normal() + block.delay
            due = float(motion.since[0] + delay[0])
            if due < over - 1e-9:
                raise Infeasible(f"a pulse of {channel.name} would begin at {due:.6g} s, before the one before is over")
            given = supply.fire(on_command(channel, 0.0, block.width), channel)
            sheds = None if per_kg is None else (per_kg * (given.propellant or 0.0))[:, None]
            torque = np.zeros(3) if given.torque is None else given.torque
            start = float(clock.fire(motion, delay, block.width, pushes(given, torque[:, None]), sheds)[0])
            pulses.append(given.moved(start))
    supply.expect_to_last()
    return Schedule(tuple(pulses), blocks=tuple(blocks)), sun_pulses.seen


INVERTED = 6
"""Steps by which the number of pulses is found that turns H by so much, cold and at falling pressure."""


class Trial(NamedTuple):
    """Blocks that are tried, as arrays that broadcast.

    ``wait`` Sun pulses are let pass first; ``delay`` and ``width`` in s, ``count`` pulses, one in ``every`` spins.
    """

    wait: Any
    delay: Any
    width: Any
    count: Any
    every: Any


class Acts(NamedTuple):
    """Response to commands, s: effective ``on_time``, ``centroid`` after the start, the ``spread`` of the thrust
    (length of the rectangle with its second moment), and when command and thrust are ``over``.
    """

    on_time: Any
    centroid: Any
    spread: Any
    over: Any


def acts(channel: Channel, widths: Any) -> Acts:
    """Response to commands of ``widths`` s of a channel."""
    if channel.valve is None:
        return Acts(widths, 0.5 * widths, widths, widths)
    distinct, index = np.unique(widths, return_inverse=True)
    rows = np.array([_acts(channel.valve, width) for width in distinct.tolist()])
    return Acts(*(row[index].reshape(np.shape(widths)) for row in rows.T))


@functools.lru_cache(maxsize=4096)
def _acts(valve: Valve, width: float) -> Acts:
    on_time, centroid, ramps = valve.thrust(width)
    return Acts(on_time, centroid, spread(ramps, centroid), max([width, *(ramp.end for ramp in ramps)]))


def evenly(values: Any, most: int) -> Any:
    """At most ``most`` of the ``values``, evenly."""
    index = np.unique(np.linspace(0, len(values) - 1, min(most, len(values))).round().astype(int))
    return np.asarray(values[index])


@dataclass(frozen=True)
class BlockState:
    """Motion between two blocks: one, or many at once.

    ``sun_angle`` and ``longitude`` of H about the Sun, rad; ``sun_pulse``: when the next one comes, s; ``phasor``:
    A ω (N m s) at that moment; ``spin`` rad/s; ``used`` kg of propellant, 0 where every pulse is of full thrust;
    ``cost`` as `Channel.cost_rate` counts it; ``fired``: pulses by channel.
    """

    sun_angle: Any
    longitude: Any
    phasor: Any
    sun_pulse: Any
    spin: Any
    used: Any = 0.0
    cost: Any = 0.0
    fired: Mapping[str, Any] = field(default_factory=Counter)

    def shifted(self, off: BlockState) -> BlockState:
        """Copy with H, the nutation and the spin ``off`` by so much."""
        here = replace(self, sun_angle=self.sun_angle + off.sun_angle, longitude=self.longitude + off.longitude)
        return replace(here, phasor=self.phasor + off.phasor, spin=self.spin + off.spin)

    def at(self, index: tuple[Any, ...], shape: tuple[int, ...]) -> BlockState:
        """State at one index of many, which have a ``shape``."""

        def one(value: Any) -> Any:
            return np.broadcast_to(value, shape)[index]

        parts = {part.name: one(getattr(self, part.name)) for part in fields(self) if part.name != "fired"}
        return BlockState(**parts, fired={name: int(one(count)) for name, count in self.fired.items()})


class BlockModel:
    """Closed form of one spacecraft, with the bounds by which its motion is judged."""

    def __init__(self, spacecraft: Spacecraft) -> None:
        sun, sensor = spacecraft.sun, spacecraft.sun_sensor
        if sun is None or sensor is None:
            raise Infeasible("blocks are fired from the Sun pulse: the file needs sun and sun_sensor")
        self.body, self.inertia, self.sensor = spacecraft, spacecraft.inertia, sensor
        self.sense = math.copysign(1.0, spacecraft.spin)
        start = spacecraft.momentum / float(np.linalg.norm(spacecraft.momentum))
        # About the Sun: longitudes count from the meridian of H at t = 0, right-handed.
        sine = float(np.linalg.norm(np.cross(sun, start)))
        if sine < 1e-6:
            raise Infeasible("the spin axis points to the Sun or away from it: it has no Sun pulse")
        self._frame = np.array([np.cross(np.cross(sun, start), sun) / sine, np.cross(sun, start) / sine, sun])
        self.goal = self._frame @ spacecraft.target_axis
        self.rate, supply = self.inertia.body_rate, Supply(spacecraft)
        first = first_sun_pulse(spacecraft)
        rate = self.rate * spacecraft.spin
        self.start = BlockState(
            sun_angle=math.atan2(sine, float(sun @ start)),
            longitude=0.0,
            phasor=self.inertia.A * complex(*spacecraft.omega0[:2].tolist()) * cmath.exp(-1j * rate * first),
            sun_pulse=first,
            spin=spacecraft.spin,
            used=supply.used,
            fired=supply.fired,
        )
        self.turn = spin_turn(spacecraft)
        self.steady = supply.steady
        self._tables: dict[tuple[Any, ...], tuple[Any, Any]] = {}

    def turned_by(self, channel: Channel, width: Any, spin: Any) -> Any:
        """Turn of H by one pulse, rad."""
        given = acts(channel, width)
        momentum = self.inertia.C * abs(spin)
        return precession.turned_by(momentum, abs(channel.transverse), given.on_time, spin, given.spread)

    def full_pulses(self, state: BlockState, channel: Channel, width: Any, count: Any) -> tuple[Any, Any]:
        """Equivalent number of full pulses of blocks from ``state``, and the propellant used after them, kg."""
        if self.steady:
            return count, state.used
        on_times, index = np.unique(acts(channel, width).on_time, return_inverse=True)
        fired, used, most = int(state.fired.get(channel.name, 0)), float(state.used), int(np.max(count))
        key = (channel.name, fired, used, most, on_times.tobytes())
        if key not in self._tables:
            supply = Supply(self.body, Counter({channel.name: fired}), np.full(len(on_times), used))
            pulses = [(supply.take(channel, on_times)[0] + 0.0 * on_times, supply.used) for _ in range(most)]
            levels, spent = (np.array(rows).T for rows in zip(*pulses, strict=True))
            self._tables[key] = np.cumsum(levels, axis=1), spent
        at = index.reshape(np.shape(width)), np.asarray(count) - 1
        full, spent = self._tables[key]
        return full[at], spent[at]

    def pulses(self, state: BlockState, channel: Channel, widths: Any, full: Any, most: int) -> Any:
        """Numbers of pulses, nearly whole and about ``most`` at most, that are equivalent to ``full`` full ones."""
        needed = full
        for _ in range(0 if self.steady else INVERTED):
            count = np.rint(needed).clip(1, most).astype(int)
            needed = full + count - self.full_pulses(state, channel, widths, count)[0]
        return needed

    def kicks(self, state: BlockState, channel: Channel, trial: Trial, step: Any, *, back: bool = False) -> Any:
        """Σ of the effective on-times of blocks from ``state``, s, the k-th turned by e^{ik step}; ``back``: the last
        has none, those before it e^{-i step} each.
        """
        full, _ = self.full_pulses(state, channel, trial.width, trial.count)
        total, cold = (
            precession.phasor_sum(trial.count, -step if back else step),
            self._cold(state, channel, trial, step),
        )
        mean = full / (trial.count - np.real(self._cold(state, channel, trial, 0.0)))
        if back and self.body.cold is not None:
            cold = cold * np.exp(-1j * (trial.count - 1) * step)
        return acts(channel, trial.width).on_time * mean * (total - cold)

    def _cold(self, state: BlockState, channel: Channel, trial: Trial, step: Any) -> Any:
        """Deficit of the sum of e^{ik step} by cold pulses: a geometric series, as the factor of the k-th decays."""
        cold = self.body.cold
        if cold is None:
            return 0.0
        ratio = np.exp(-1.0 / cold.pulses + 1j * step)
        lacks = (1.0 - cold.first) * cold.decay(int(state.fired.get(channel.name, 0)))
        with np.errstate(invalid="ignore"):  # blocks that would take H over the Sun have no step
            return lacks * (1.0 - ratio**trial.count) / (1.0 - ratio)

    def heading(self, channel: Channel, delay: Any, width: Any) -> Any:
        """Heading of H from the direction away from the Sun, right-handed about H, rad: the same for all pulses.

        At the centroid of a pulse, width/2 without a valve, the Sun has turned in the body by -ω3 (delay + centroid)
        from the sensor.
        """
        turned = self.body.spin * (delay + acts(channel, width).centroid)
        from_sun = cmath.phase(channel.transverse) - self.sensor.azimuth + turned
        return self.sense * (from_sun - math.pi)

    def delay(self, channel: Channel, heading: Any, width: Any) -> Any:
        """Delay in [0, one spin turn) s that gives a ``heading``: the inverse of `heading`."""
        azimuth = self.sense * heading + math.pi - cmath.phase(channel.transverse) + self.sensor.azimuth
        return (azimuth / self.body.spin - acts(channel, width).centroid) % (2.0 * math.pi / abs(self.body.spin))

    def damping_delay(self, state: BlockState, channel: Channel, trial: Trial) -> Any:
        """First delay, s, at which blocks take most of the nutation; ``trial.delay`` is not used.

        The kicks of the block, each carried to the first one, add up to a phasor; ω must then point against it.
        """
        interval, rate = trial.every * self.turn, self.rate * self.body.spin
        kicks = channel.transverse * self.kicks(state, channel, trial, rate * interval)
        to_go = np.angle(-kicks / (state.phasor * np.exp(-1j * rate * trial.wait * self.turn)))
        return (
            (-to_go / rate - acts(channel, trial.width).centroid) % (2.0 * math.pi / abs(rate))
            if rate != 0.0
            else 0.0 * to_go
        )

    def course(self, state: BlockState) -> tuple[Any, Any]:
        """Heading to the target axis, and the way along the rhumb line, rad."""
        goal_angle = math.atan2(math.hypot(self.goal[0], self.goal[1]), self.goal[2])
        return precession.rhumb_course(state.sun_angle, goal_angle, self.ahead(state))

    def ahead(self, state: BlockState) -> Any:
        """Angle of the target axis ahead of H about the Sun the shorter way round, rad, -π to π."""
        goal_longitude = math.atan2(self.goal[1], self.goal[0])
        return (goal_longitude - state.longitude + math.pi) % (2.0 * math.pi) - math.pi

    def after(self, state: BlockState, channel: Channel, trial: Trial) -> BlockState:
        """Motion after blocks of a ``channel`` from ``state``."""
        given = acts(channel, trial.width)
        full, used = self.full_pulses(state, channel, trial.width, trial.count)
        gained = channel.axial * given.on_time / self.inertia.C
        spin = state.spin + 0.5 * full * gained  # on average along the block
        step = self.turned_by(channel, trial.width, spin)
        heading = self.heading(channel, trial.delay, trial.width)
        rhumb = precession.rhumb_end(state.sun_angle, heading, full * step)
        turn = self.turn * np.abs(self.body.spin / spin)
        # As H goes round the Sun, its meridian turns about H, and the Sun pulse comes later by as much.
        interval = trial.every * turn + rhumb.turn / trial.count * turn / (2.0 * math.pi)
        first = state.sun_pulse + trial.wait * self.turn * np.abs(self.body.spin / state.spin)
        following = first + (trial.count - 1) * interval + turn
        rate = self.rate * spin
        kick = channel.transverse * np.sinc(0.5 * rate * given.spread / np.pi)
        since_last = turn - trial.delay - given.centroid
        kicks = self.kicks(state, channel, trial, rate * interval, back=True)
        gathered = kick * np.exp(-1j * rate * since_last) * kicks
        return BlockState(
            sun_angle=rhumb.sun_angle,
            longitude=state.longitude + rhumb.longitude,
            phasor=state.phasor * np.exp(-1j * rate * (following - state.sun_pulse)) + gathered,
            sun_pulse=following,
            spin=state.spin + full * gained,
            used=used,
            cost=state.cost + channel.cost_rate(by_propellant=True) * (full * given.on_time),
            fired={**state.fired, channel.name: state.fired.get(channel.name, 0) + trial.count},
        )

    def apart(self, state: BlockState, flown: Flight) -> BlockState:
        """Difference of the motion as ``flown`` from ``state``, to be added to the states of other blocks."""
        end, rate = flown.settled, self.rate * flown.settled.spin
        axis = self._frame @ flown.final.momentum
        since = float(state.sun_pulse) - flown.schedule.end
        return BlockState(
            sun_angle=math.atan2(math.hypot(axis[0], axis[1]), axis[2]) - state.sun_angle,
            longitude=(math.atan2(axis[1], axis[0]) - state.longitude + math.pi) % (2.0 * math.pi) - math.pi,
            phasor=self.inertia.A * end.omega * cmath.exp(-1j * rate * since) - state.phasor,
            sun_pulse=0.0,
            spin=end.spin - state.spin,
        )

    def left(self, state: BlockState) -> Left:
        """Residual for `requirements`."""
        across = np.sin(state.sun_angle)
        axis = np.stack(
            np.broadcast_arrays(
                across * np.cos(state.longitude), across * np.sin(state.longitude), np.cos(state.sun_angle)
            ),
            axis=-1,
        )
        apart = np.arctan2(np.linalg.norm(np.cross(axis, self.goal), axis=-1), axis @ self.goal)
        nutation = np.arctan2(np.abs(state.phasor), self.inertia.C * np.abs(state.spin))
        return Left(nutation, apart, state.spin)
