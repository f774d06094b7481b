"""Closed-form model of command blocks fired from the Sun pulse, and Sun pulses of a flight.

H follows a rhumb line about the Sun (`precession`), and the nutation is the impulse sum (17) over
pulses at even times, for very many blocks at once. Commands count by the impulse, the centroid and
the spread of their thrust; cold nozzles and falling pressure by the impulse of each pulse, but for
the nutation, which takes the mean pressure along a block. Sun pulses come late by the nutation, on
average over a block; neglected is second order in the turn by one pulse.
"""

from __future__ import annotations

import cmath
import functools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.flight.dynamics import Supply, make_dynamics, shed
from nutdamp.flight.propagation import Flight, to_sun_pulse
from nutdamp.physics import attitude, precession
from nutdamp.physics.motion import Bodies, MotionStretch
from nutdamp.physics.sky import SunPulseClock, TorqueRamp, ahead
from nutdamp.physics.thruster import Valve, action
from nutdamp.spacecraft.equipment import Block, Channel, firings
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import Left
from nutdamp.spacecraft.schedule import Pulse, Schedule, on_command

SAMPLES = 32  # samples of the Sun's azimuth in each spin turn, between which a Sun pulse is found
# steps by which the moment of a Sun pulse is found in a flight, at most; three or four are usual
ITERATIONS = 60
EXACT = 1e-13  # tolerance of the time of a Sun pulse, in spin turns

BLIND = 32  # spin turns in a row without a Sun pulse, after which none is waited for
ALWAYS = 500  # Sun pulses that flights of blocks may take whatever work is spent
NEVER = np.iinfo(np.int64).max  # number of a Sun pulse that is not waited for

# Units of `work` of a pulse that is fired, of the motion of all flights to the next Sun pulse, and
# of a turn of theirs that is integrated (64 flights of 20 pulses take 50 ms, of ACE 190 ms).
FIRED, STEPPED, INTEGRATED = 0.05, 0.7, 6.0

KEPT = 100  # tables of the supply that are kept


def spin_turn(spacecraft: Spacecraft) -> float:
    """Time between two Sun pulses, s: the average one of the free motion.

    The body turns about H at |H|/A, and about its axis at ω3 - H3/A: together, and at small angles,
    at ω3.
    """
    A = spacecraft.inertia.A
    size = float(np.linalg.norm(spacecraft.momentum))
    turning = spacecraft.spin - spacecraft.axial / A
    return 2.0 * math.pi / abs(math.copysign(size / A, spacecraft.axial) + turning)


def sun_pulses(flown: Flight, until: float) -> Vector:
    """Times (n,) s up to ``until`` s of the Sun pulses of a flight; raises Infeasible where the
    sensor sees none.
    """
    spacecraft = flown.spacecraft
    sensor = spacecraft.sun_sensor
    turn = spin_turn(spacecraft) * min(1.0, abs(spacecraft.spin / flown.settled.spin))
    assert sensor is not None
    assert spacecraft.sun is not None
    times = np.linspace(0.0, until, max(int(SAMPLES * until / turn), 2) + 1)
    # The Sun goes round in the body against the spin: what is left to the sensor's azimuth falls to
    # zero.
    ahead = to_sun_pulse(flown, times)
    index = np.flatnonzero((ahead[:-1] < 0.5 * math.pi) & (ahead[1:] > 1.5 * math.pi))
    times_of = times[index] + ahead[index] * turn / (2.0 * math.pi)
    for _ in range(ITERATIONS):
        off = (to_sun_pulse(flown, np.minimum(times_of, until)) + math.pi) % (
            2.0 * math.pi
        ) - math.pi
        times_of += off * turn / (2.0 * math.pi)
        if not len(times_of) or np.abs(off).max() < 2.0 * math.pi * EXACT:
            break
    times_of = times_of[(times_of >= 0.0) & (times_of <= until)]
    angles = attitude.angle_between(flown.axis(times_of), spacecraft.sun)
    seen = np.array([sensor.sees(angle) for angle in angles.tolist()], dtype=bool)
    if len(times_of) and not seen.any():
        raise _blind(float(times_of[0]), float(angles[0]))
    return np.asarray(times_of[seen])


def _blind(time: float, angle: float) -> Infeasible:
    """Reason why there is no Sun pulse: the sensor does not see the Sun at this ``angle`` (rad)
    from the spin axis.
    """
    return Infeasible(
        f"the Sun sensor does not see the Sun at {time:.4g} s, {math.degrees(angle):.4g}° from the "
        "spin axis: "
        "there is no Sun pulse"
    )


class SunPulses:
    """Sun pulses that flights of a spacecraft wait for, as its sensor gives them; the flights go on
    together.

    ``numbers``: those of each flight, 1 the first after t = 0; they must not decrease. Iterating
    gives the motion of all at a passage of the Sun, and the flights that one of their numbers comes
    to then. ``seen``: whether the sensor saw each passage so far, (n,); those that it saw count.
    ``failures``: why a flight ended before its last number, or None. Raises Infeasible where there
    is no Sun or no sensor.
    """

    def __init__(self, spacecraft: Spacecraft, numbers: Sequence[Sequence[int]]) -> None:
        self.clock, self.seen = sun_clock(spacecraft, len(numbers)), list[NDArray[np.bool_]]()
        self.failures: list[Infeasible | None] = [None] * len(numbers)
        assert spacecraft.sun_sensor is not None
        self._sensor = spacecraft.sun_sensor
        self._numbers = [iter(each) for each in numbers]
        self._due = np.array([next(each, NEVER) for each in self._numbers])

    def fail(self, flight: int, reason: Infeasible) -> None:
        """End a flight."""
        self.failures[flight], self._due[flight] = reason, NEVER

    def end(self, reason: Infeasible) -> None:
        """End all flights that wait for a Sun pulse."""
        for flight in np.flatnonzero(self._due < NEVER).tolist():
            self.fail(flight, reason)

    @property
    def ends(self) -> NDArray[np.float64]:
        """Motion of each flight once the last has ended, (11, n): time s, rates rad/s, quaternion,
        and inertial H, N m s.
        """
        motion = self.clock.here
        momentum = attitude.rotate(motion.quaternion.T, motion.bodies.momentum(motion.rates).T)
        return np.concatenate([motion.since[None], motion.rates, motion.quaternion, momentum.T])

    def residual(self, spacecraft: Spacecraft) -> Left:
        """Residual of the flights, exact where a free motion keeps it."""
        bodies, rates = self.clock.here.bodies, self.clock.here.rates
        first, second, third = bodies.momentum(rates)
        nutation = np.arctan2(np.hypot(first, second), np.abs(third))
        aim = attitude.angle_between(self.ends[8:].T, spacecraft.target_axis)
        return Left(nutation, aim, rates[2])

    def __iter__(self) -> Iterator[tuple[MotionStretch, list[int]]]:
        clock = self.clock
        sensor = self._sensor
        count = np.zeros(len(self._due), dtype=np.int64)
        blind, since, off = (
            0 * count,
            0.0 * count,
            0.0 * count,
        )  # passages unseen in a row; time and angle of the first
        while (following := int(self._due.min(initial=NEVER))) < NEVER:
            before = clock.time
            passage = following if sensor.sees_all else len(self.seen) + 1
            motion = clock.sun_pulse(passage)
            for flight in np.flatnonzero(clock.lost & (self._due < NEVER)).tolist():
                text = f"no Sun pulse comes after {max(float(before[flight]), 0.0):.4g} s"
                self.fail(flight, Infeasible(f"{text}: the spin axis is too near to the Sun"))
            angles = np.zeros(len(count)) if sensor.sees_all else clock.angle(motion)
            sees = sensor.sees_all | np.asarray(sensor.sees(angles))
            count = np.full_like(count, passage) if sensor.sees_all else count + sees
            self.seen += [sees] * (passage - len(self.seen))
            blind = np.where(sees, 0, blind + 1)
            since, off = np.where(blind == 1, (motion.since, angles), (since, off))
            for flight in np.flatnonzero((blind > BLIND) & (self._due < NEVER)).tolist():
                self.fail(flight, _blind(float(since[flight]), float(off[flight])))
            flights = np.flatnonzero(sees & (count >= self._due)).tolist()
            for flight in flights:
                self._due[flight] = next(self._numbers[flight], NEVER)
            if flights:
                yield motion, flights


def sun_clock(spacecraft: Spacecraft, flights: int = 1) -> SunPulseClock:
    """Sun pulses of so many flights of a spacecraft from t = 0; raises Infeasible where it has
    none.
    """
    sensor, sun = spacecraft.sun_sensor, spacecraft.sun
    if sensor is None or sun is None:
        raise Infeasible("there is no Sun pulse; the file needs sun and sun_sensor")
    dynamics = make_dynamics(spacecraft)
    start = spacecraft.initial
    moments, rates, quaternion, suns = (
        np.repeat(np.asarray(part, dtype=np.float64)[:, None], flights, axis=1)
        for part in (dynamics.moments, start.rates, start.quaternion, sun)
    )
    bodies = Bodies(moments, dynamics.constant, dynamics.forcing)
    state = MotionStretch(bodies, np.zeros(flights), rates, quaternion)
    return SunPulseClock(state, suns, math.copysign(1.0, spacecraft.spin), sensor.azimuth)


def pushes(pulse: Pulse, torque: Vector) -> list[TorqueRamp]:
    """Torques of a pulse, from the start of its command, with the ``torque`` (3, n)
    N m of cases.
    """
    if pulse.command is None:
        return [TorqueRamp(0.0, pulse.on_time, torque, torque)]
    back, ramps = pulse.command.start, pulse.command.ramps
    return [
        TorqueRamp(ramp.begin - back, ramp.end - back, torque * ramp.first, torque * ramp.last)
        for ramp in ramps
    ]


def first_sun_pulse(spacecraft: Spacecraft) -> float:
    """Time of the first Sun pulse, s; raises Infeasible where there is none."""
    sun_pulses = SunPulses(spacecraft, [(1,)])
    for motion, _ in sun_pulses:
        return float(motion.since[0])
    raise sun_pulses.failures[0] or Infeasible("")


def fired(spacecraft: Spacecraft, blocks: Sequence[Block]) -> Schedule:
    """Pulses fired by ``blocks``; raises what `fire_all` gives as reasons."""
    (schedule,), _ = fire_all(spacecraft, [blocks])
    if isinstance(schedule, Infeasible):
        raise schedule
    return schedule


def fire_all(
    spacecraft: Spacecraft, sequences: Sequence[Sequence[Block]]
) -> tuple[list[Schedule | Infeasible], SunPulses]:
    """Pulses fired by each of the sequences of blocks, with the Sun pulses of its own motion, and
    these.

    Sun pulses come without the jitter of the sensor, which dispersed cases draw. In the place of a
    schedule is the reason where there is no Sun pulse, a channel is not known, a pulse would begin
    before the one before is over, or the tank is empty.
    """
    queues = [firings(blocks) for blocks in sequences]
    sun_pulses = SunPulses(spacecraft, [[each.number for each in queue] for queue in queues])
    supplies, pulses = [Supply(spacecraft) for _ in sequences], [list[Pulse]() for _ in sequences]
    following = [iter(queue) for queue in queues]
    channels = {channel.name: channel for channel in spacecraft.channels}
    clock = sun_pulses.clock
    count = len(sequences)
    arcs = spacecraft.inertia.symmetric and not spacecraft.disturbances
    per_kg = shed(spacecraft)
    over, passed = np.zeros(count), np.zeros(count)
    turn = spin_turn(spacecraft)
    for motion, flights in sun_pulses:
        turns = 1.0 if arcs else float(np.max(motion.since - passed)) / turn
        passed = motion.since
        work.spend((STEPPED if arcs else INTEGRATED * turns) + FIRED * len(flights))
        delays, angles, widths = np.zeros((3, count))
        given = dict[int, Pulse]()
        due = {flight: next(following[flight]) for flight in flights}
        for flight, (_, _, block) in due.items():
            angles[flight], delays[flight] = block.angle, block.delay
        delays += clock.turning(angles)
        for flight, (number, index, block) in due.items():
            channel = channels.get(block.channel)
            if channel is None:
                sun_pulses.fail(
                    flight, Infeasible(f"the spacecraft has no channel {block.channel}")
                )
                continue
            given[flight] = supplies[flight].fire(on_command(channel, 0.0, block.width), channel)
            widths[flight] = block.width
            start = float(motion.since[flight] + delays[flight])
            if start < over[flight] - 1e-9:
                text = (
                    f"block {index + 1}, Sun pulse {number}: a pulse of {block.channel} would "
                    f"begin at {start:.6g} s, before the one before ends at {over[flight]:.6g} s; "
                    "change their delays or Sun pulses"
                )
                sun_pulses.fail(flight, Infeasible(text))
        spent = np.zeros(count)
        spent[list(given)] = [pulse.propellant or 0.0 for pulse in given.values()]
        sheds = None if per_kg is None else per_kg[:, None] * spent
        starts = clock.fire(motion, delays, cast("float", widths), _together(given, count), sheds)
        for flight, pulse in given.items():
            pulses[flight].append(pulse.moved(float(starts[flight])))
        over[list(given)] = clock.over[list(given)]
        if len(sun_pulses.seen) > ALWAYS and work.exhausted():
            sun_pulses.end(Infeasible("the budget of work was used up before its last pulse"))
    for flight, supply in enumerate(supplies):
        if sun_pulses.failures[flight] is None and supply.shortage is not None:
            sun_pulses.fail(flight, Infeasible(supply.shortage))
    schedules = [
        Schedule(tuple(row), blocks=tuple(blocks))
        for row, blocks in zip(pulses, sequences, strict=True)
    ]
    return [
        reason or each for reason, each in zip(sun_pulses.failures, schedules, strict=True)
    ], sun_pulses


def _together(given: Mapping[int, Pulse], count: int) -> list[TorqueRamp]:
    """Torques of ``count`` flights by the pulses of some: of the others, and once a pulse is over,
    there are none.
    """
    zero = np.zeros((3, 1))
    together = list[TorqueRamp]()
    ramps = [
        pushes(pulse, zero if pulse.torque is None else pulse.torque[:, None])
        for pulse in given.values()
    ]
    for index in range(max(map(len, ramps), default=0)):
        ramp = TorqueRamp(
            np.zeros(count), np.zeros(count), np.zeros((3, count)), np.zeros((3, count))
        )
        for flight, each in zip(given, ramps, strict=True):
            over = each[-1].end if each else 0.0
            here = each[index] if index < len(each) else TorqueRamp(over, over, zero, zero)
            ramp.begin[flight], ramp.end[flight] = here.begin, here.end
            ramp.first[:, [flight]], ramp.last[:, [flight]] = here.first, here.last
        together.append(ramp)
    return together


class Trial(NamedTuple):
    """Blocks that are tried, as arrays that broadcast.

    ``wait`` Sun pulses are let pass first; ``delay`` and ``width`` in s, ``count`` pulses, one in
    ``every`` spins.
    """

    wait: Any
    delay: Any
    width: Any
    count: Any
    every: Any


class Acts(NamedTuple):
    """Response to commands, s: effective ``on_time``, ``centroid`` after the start, the ``spread``
    of the thrust (length of the rectangle with its second moment), and when command and thrust are
    ``over``.
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
    rows = np.array([_acts(channel.valve, width) for width in distinct.tolist()]).reshape(-1, 4)
    return Acts(*(row[index].reshape(np.shape(widths)) for row in rows.T))


@functools.lru_cache(maxsize=4096)
def _acts(valve: Valve, width: float) -> Acts:
    on_time, centroid, ramps = valve.thrust(width)
    return Acts(on_time, centroid, action(ramps)[2], max([width, *(ramp.end for ramp in ramps)]))


def evenly(values: Any, most: int) -> Any:
    """At most ``most`` of the ``values``, evenly."""
    index = np.unique(np.linspace(0, len(values) - 1, min(most, len(values))).round().astype(int))
    return np.asarray(values[index])


NUMBERS = ("sun_angle", "longitude", "phasor", "sun_pulse", "spin", "used", "cost")


@dataclass(frozen=True)
class BlockState:
    """Motion between two blocks: one, or many at once.

    ``sun_angle`` and ``longitude`` of H about the Sun, rad; ``sun_pulse``: when the next one comes,
    s; ``phasor``: A ω (N m s) then; ``spin`` rad/s; ``used`` kg, 0 where every pulse is of full
    thrust; ``fired``: pulses by channel.
    """

    sun_angle: Any
    longitude: Any
    phasor: Any
    sun_pulse: Any
    spin: Any
    used: Any = 0.0
    cost: Any = 0.0
    fired: Mapping[str, Any] = field(default_factory=dict)

    def map(self, change: Callable[[Any], Any]) -> BlockState:
        """Copy with each of its numbers changed."""
        fired = {name: change(count) for name, count in self.fired.items()}
        columns = {name: change(getattr(self, name)) for name in NUMBERS}
        return BlockState(**columns, fired=fired)

    def some(self, rows: Any) -> BlockState:
        """Motions of some rows, or of one."""
        return self.map(lambda column: np.atleast_1d(column)[rows])

    def shaped(self, axes: int = 2) -> BlockState:
        """Copy with so many more axes behind that of the motions."""
        return self.map(lambda column: column.reshape(-1, *[1] * axes))

    @classmethod
    def joined(cls, states: Sequence[BlockState]) -> BlockState:
        """Motions of several states in one."""
        names = states[0].fired
        fired = {name: np.concatenate([state.fired[name] for state in states]) for name in names}
        columns = {
            name: np.concatenate([getattr(state, name) for state in states]) for name in NUMBERS
        }
        return cls(**columns, fired=fired)

    def shifted(self, off: BlockState) -> BlockState:
        """Copy with H, the nutation and the spin ``off`` by so much."""
        names = "sun_angle", "longitude", "phasor", "sun_pulse", "spin"
        return replace(self, **{name: getattr(self, name) + getattr(off, name) for name in names})


class BlockModel:
    """Closed form of one spacecraft, with the bounds by which its motion is judged."""

    def __init__(self, spacecraft: Spacecraft) -> None:
        sun, sensor = spacecraft.sun, spacecraft.sun_sensor
        if sun is None or sensor is None:
            raise Infeasible(
                "blocks are fired from the Sun pulse: the file needs sun and sun_sensor"
            )
        self.spacecraft = spacecraft
        self.inertia = spacecraft.inertia
        self.sensor = sensor
        self.sense = math.copysign(1.0, spacecraft.spin)
        start = spacecraft.momentum / float(np.linalg.norm(spacecraft.momentum))
        # About the Sun: longitudes count from the meridian of H at t = 0, right-handed.
        sine = float(np.linalg.norm(np.cross(sun, start)))
        if sine < 1e-6:
            raise Infeasible(
                "the spin axis points to the Sun or away from it, so there is no Sun pulse"
            )
        self._frame = np.array(
            [np.cross(np.cross(sun, start), sun) / sine, np.cross(sun, start) / sine, sun]
        )
        self.goal = self._frame @ spacecraft.target_axis
        supply = Supply(spacecraft)
        rate = spacecraft.nutation_rate
        self._slope, self._offset = self.inertia.linear_rate(spacecraft.spin)
        first = first_sun_pulse(spacecraft)
        self.start = BlockState(
            sun_angle=math.atan2(sine, float(sun @ start)),
            longitude=0.0,
            phasor=self.inertia.A
            * complex(*spacecraft.omega0[:2].tolist())
            * cmath.exp(-1j * rate * first),
            sun_pulse=first,
            spin=spacecraft.spin,
            used=supply.used,
            fired={channel.name: supply.fired[channel.name] for channel in spacecraft.channels},
        )
        self.turn = spin_turn(spacecraft)
        late = self._late(self.start.phasor, self.start.sun_angle, self.start.spin)
        phasor = self.start.phasor * cmath.exp(1j * rate * late)
        self.start = replace(self.start, sun_pulse=first - float(late), phasor=phasor)
        self.steady = supply.steady
        self._tables: dict[tuple[Any, ...], tuple[Any, Any]] = {}

    def rate(self, spin: Any) -> Any:
        """Rate ν of the nutation in the body at a ``spin``, rad/s."""
        return self._slope * spin + self._offset

    def turned_by(self, channel: Channel, width: Any, spin: Any) -> Any:
        """Turn of H by one pulse, rad."""
        given = acts(channel, width)
        momentum = abs(self.inertia.axial(spin))
        return precession.turned_by(
            momentum, abs(channel.transverse), given.on_time, spin, given.spread
        )

    def full_pulses(
        self, state: BlockState, channel: Channel, width: Any, count: Any
    ) -> tuple[Any, Any]:
        """Equivalent number of full pulses of blocks from ``state``, and the propellant used after
        them, kg; all motions have fired as much before.
        """
        if self.steady:
            return count, state.used
        on_times, index = np.unique(acts(channel, width).on_time, return_inverse=True)
        fired = int(np.ravel(state.fired[channel.name])[0])
        used = float(np.ravel(state.used)[0])
        most = int(np.max(count))
        key = (channel.name, fired, used, most, on_times.tobytes())
        if key not in self._tables:
            self._tables = {**dict([*self._tables.items()][-KEPT:])}
            self._tables[key] = Supply(self.spacecraft, Counter({channel.name: fired}), used).train(
                channel, on_times, most
            )
        at = index.reshape(np.shape(width)), np.asarray(count) - 1
        full, spent = self._tables[key]
        return full[at], spent[at]

    def kicks(
        self, state: BlockState, channel: Channel, trial: Trial, step: Any, *, back: bool = False
    ) -> Any:
        """Σ of the effective on-times of blocks from ``state``, s, the k-th turned by e^{ik step};
        ``back``: the last has none, those before it e^{-i step} each.
        """
        full, _ = self.full_pulses(state, channel, trial.width, trial.count)
        total = precession.phasor_sum(trial.count, -step if back else step)
        cold = self._cold(state, channel, trial, step)
        mean = full / (trial.count - np.real(self._cold(state, channel, trial, 0.0)))
        if back and self.spacecraft.cold is not None:
            cold = cold * np.exp(-1j * (trial.count - 1) * step)
        return acts(channel, trial.width).on_time * mean * (total - cold)

    def _cold(self, state: BlockState, channel: Channel, trial: Trial, step: Any) -> Any:
        """Deficit of the sum of e^{ik step} by cold pulses: a geometric series, as the factor of
        the k-th decays.
        """
        cold = self.spacecraft.cold
        if cold is None:
            return 0.0
        ratio = np.exp(-1.0 / cold.pulses + 1j * step)
        lacks = (1.0 - cold.first) * cold.decay(int(np.ravel(state.fired[channel.name])[0]))
        with np.errstate(invalid="ignore"):  # blocks that would take H over the Sun have no step
            return lacks * (1.0 - ratio**trial.count) / (1.0 - ratio)

    def late(self, state: BlockState, trial: Trial) -> Any:
        """Time, s, by which the Sun pulses of blocks come later than those of a body that does not
        nutate, on average.

        With H at Aω/|H| across the body axes the Sun is seen cot γ times that aside of where it is
        about H.
        """
        rate = self.rate(state.spin)
        interval = self.turn * np.abs(self.spacecraft.spin / state.spin)
        phasor = state.phasor * np.exp(-1j * rate * trial.wait * interval)
        mean = precession.phasor_sum(trial.count, -rate * trial.every * interval) / trial.count
        return self._late(phasor * mean, state.sun_angle, state.spin)

    def _late(self, phasor: Any, sun_angle: Any, spin: Any) -> Any:
        """`late` where the nutation is that ``phasor`` as a Sun pulse comes."""
        across = phasor * cmath.exp(-1j * self.sensor.azimuth) / np.abs(self.inertia.axial(spin))
        return np.imag(across) / np.tan(sun_angle) / spin

    def heading(self, channel: Channel, delay: Any, width: Any) -> Any:
        """Heading of H from the direction away from the Sun, right-handed about H, rad: the same
        for all pulses.

        At the centroid of a pulse the Sun has turned in the body by -ω3 (delay + centroid) from the
        sensor.
        """
        turned = self.spacecraft.spin * (delay + acts(channel, width).centroid)
        from_sun = cmath.phase(channel.transverse) - self.sensor.azimuth + turned
        return self.sense * (from_sun - math.pi)

    def delay(self, channel: Channel, heading: Any, width: Any) -> Any:
        """Delay in [0, one spin turn) s that gives a ``heading``: the inverse of `heading`."""
        azimuth = (
            self.sense * heading + math.pi - cmath.phase(channel.transverse) + self.sensor.azimuth
        )
        return (azimuth / self.spacecraft.spin - acts(channel, width).centroid) % (
            2.0 * math.pi / abs(self.spacecraft.spin)
        )

    def damping_delay(self, state: BlockState, channel: Channel, trial: Trial) -> Any:
        """First delay, s, at which blocks take most of the nutation; ``trial.delay`` is not used.

        The kicks of the block, each carried to the first one, add up to a phasor; ω must then point
        against it.
        """
        interval = trial.every * self.turn
        rate = self.rate(self.spacecraft.spin)
        kicks = channel.transverse * self.kicks(state, channel, trial, rate * interval)
        to_go = np.angle(-kicks / (state.phasor * np.exp(-1j * rate * trial.wait * self.turn)))
        if rate == 0.0:
            return 0.0 * to_go
        delay = -to_go / rate - acts(channel, trial.width).centroid - self.late(state, trial)
        return delay % (2.0 * math.pi / abs(rate))

    def course(self, state: BlockState) -> tuple[Any, Any]:
        """Heading to the target axis, and the way along the rhumb line, rad."""
        goal_angle = math.atan2(math.hypot(*self.goal[:2]), self.goal[2])
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
        delay = trial.delay + self.late(state, trial)
        heading = self.heading(channel, delay, trial.width)
        sun_angle, longitude, turned = precession.rhumb_end(state.sun_angle, heading, full * step)
        turn = self.turn * np.abs(self.spacecraft.spin / spin)
        # As H goes round the Sun, its meridian turns about H, and the Sun pulse comes later by as
        # much.
        interval = trial.every * turn + turned / trial.count * turn / (2.0 * math.pi)
        first = state.sun_pulse + trial.wait * self.turn * np.abs(self.spacecraft.spin / state.spin)
        following = first + (trial.count - 1) * interval + turn
        rate = self.rate(spin)
        kick = channel.transverse * np.sinc(0.5 * rate * given.spread / np.pi)
        kick = kick * np.exp(-1j * rate * (turn - delay - given.centroid))
        gathered = kick * self.kicks(state, channel, trial, rate * interval, back=True)
        return BlockState(
            sun_angle=sun_angle,
            longitude=state.longitude + longitude,
            phasor=state.phasor * np.exp(-1j * rate * (following - state.sun_pulse)) + gathered,
            sun_pulse=following,
            spin=state.spin + full * gained,
            used=used,
            cost=state.cost + channel.cost_rate(by_propellant=True) * (full * given.on_time),
            fired={**state.fired, channel.name: state.fired[channel.name] + trial.count},
        )

    def apart(self, state: BlockState, ends: NDArray[np.float64]) -> BlockState:
        """Difference of the motions of flights, `SunPulses.ends` (11, n), from ``state``."""
        since, rates, quaternion = ends[0], ends[1:4], ends[4:8]
        spin = rates[2]
        axis = self._frame @ ends[8:]
        sun_angle = np.arctan2(np.hypot(axis[0], axis[1]), axis[2])
        longitude = np.arctan2(axis[1], axis[0]) - state.longitude
        rate = self.rate(spin)
        phasor = self.inertia.A * (rates[0] + 1j * rates[1])
        assert self.spacecraft.sun is not None
        sun = np.repeat(self.spacecraft.sun[:, None], len(since), axis=1)
        to_sun, _ = ahead(rates, quaternion, sun, self.sensor.azimuth, self.sense)
        # From where the Sun is seen to where it is about H, then to the next Sun pulse.
        seen = self.sensor.azimuth + self.sense * to_sun
        across = phasor * np.exp(-1j * seen) / np.abs(self.inertia.axial(spin))
        to_sun = to_sun - self.sense * np.imag(across) / np.tan(sun_angle)
        turn = self.turn * np.abs(self.spacecraft.spin / spin)
        later = (since + to_sun / (2.0 * math.pi) * turn - state.sun_pulse) / turn
        sun_pulse = state.sun_pulse + (later - np.rint(later)) * turn
        return BlockState(
            sun_angle=sun_angle - state.sun_angle,
            longitude=(longitude + math.pi) % (2.0 * math.pi) - math.pi,
            phasor=phasor * np.exp(-1j * rate * (sun_pulse - since)) - state.phasor,
            sun_pulse=sun_pulse - state.sun_pulse,
            spin=spin - state.spin,
        )

    def left(self, state: BlockState) -> Left:
        """Residual for `requirements`."""
        across, (i, j, k) = np.sin(state.sun_angle), self.goal
        x = across * np.cos(state.longitude)
        y = across * np.sin(state.longitude)
        z = np.cos(state.sun_angle)
        aside = np.sqrt((y * k - z * j) ** 2 + (z * i - x * k) ** 2 + (x * j - y * i) ** 2)
        apart = np.arctan2(aside, x * i + y * j + z * k)
        nutation = np.arctan2(np.abs(state.phasor), np.abs(self.inertia.axial(state.spin)))
        return Left(nutation, apart, state.spin)
