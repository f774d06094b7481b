"""Motion between two pulses, and the propellant supply by which moments fall and pulses weaken."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from nutdamp.common import work
from nutdamp.common.numerics import gauss_legendre
from nutdamp.physics import motion
from nutdamp.physics.motion import Bodies, Falling, Forcing, MotionStretch, Piece, Torque, driven_by
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import (
    BLOWDOWN,
    COLD,
    TRAVEL,
    Inertia,
    Spacecraft,
    SpinState,
    Vector,
)
from nutdamp.spacecraft.schedule import Command, Pulse, Schedule, on_command
from nutdamp.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from nutdamp.physics.thruster import Tank

# a pulse has the root of its fall over this of straight pieces, which so err by 1e-10 of it at most
EVEN = 2e-4
NODES = 6  # nodes of the quadrature in each of them
REPEATED = 60  # iterations of the search of the on-time for an impulse, at most
CLOSE = 1e-14  # relative tolerance of that on-time


class Path(Protocol):
    """Motion without jumps."""

    @property
    def steps(self) -> int:
        """Steps of integration."""
        ...

    def motion(self, times: Vector) -> tuple[Vector, Vector]:
        """Rates (n, 3) in rad/s and quaternions (n, 4) at ``times`` (n,) s."""
        ...


def joined(
    pieces: Sequence[tuple[float, Callable[[Vector], tuple[Vector, Vector]]]], times: Vector
) -> tuple[Vector, Vector]:
    """Rates (n, 3) and quaternions (n, 4) at ``times`` (n,) s by ``pieces``: the start (s) of each,
    and its motion.
    """
    times = np.asarray(times, dtype=float)
    owner = np.clip(
        np.searchsorted([start for start, _ in pieces], times, side="right") - 1, 0, len(pieces) - 1
    )
    rates, quaternion = np.empty((len(times), 3)), np.empty((len(times), 4))
    for index in np.flatnonzero(np.bincount(owner)).tolist():  # np.unique would load numpy.ma
        rows = owner == index
        rates[rows], quaternion[rows] = pieces[index][1](times[rows])
    return rates, quaternion


@dataclass(frozen=True, slots=True)
class Joined:
    """Path of ``parts`` one after the other, each from the time (s) beside it on."""

    parts: Sequence[tuple[float, Callable[[Vector], tuple[Vector, Vector]]]]
    steps: int = 0

    def motion(self, times: Vector) -> tuple[Vector, Vector]:
        """Rates (n, 3) in rad/s and quaternions (n, 4) at ``times`` (n,) s."""
        return joined(self.parts, times)


def free_coast(
    inertia: Inertia, state: SpinState, start: float = 0.0, growth: float = 0.0, sense: float = 1.0
) -> Piece:
    """Coast without external torque in closed form, from ``state`` at ``start`` s, for any time.

    ``growth`` κ of `energy_sink`, 1/s, with I1 = I2 alone, as a wheel; ``sense`` of the spin axis.
    """
    forcing = Forcing((), growth, inertia.wheel, sense)
    bodies = Bodies(np.array(inertia.moments), np.zeros(3), forcing)
    return Piece(MotionStretch(bodies, start, state.rates, state.quaternion), math.inf)


LONG = 20.0
"""Turn, rad, from which a free coast of a body with three moments is flown in closed form: Taylor
pieces cost more.
"""

LEG, PULSE = (
    0.03,
    0.4,
)  # units of `work` of a leg of a flight, and additional ones of an integrated leg

STEP, SUNK_STEP = 0.2, 0.7
"""Units of a step of integration, and of one with dissipation."""

REMEMBERED = 1000  # legs that are remembered, before all are forgotten


class Push(NamedTuple):
    """Torque on a leg besides the permanent ones; see `Dynamics.path`."""

    torques: Sequence[Vector]
    slope: Vector | None
    falling: Falling | None


@dataclass(frozen=True)
class Dynamics:
    """Body as flown, with all torques besides the pulses; ``known``: the legs flown before, see
    `remembering`.
    """

    moments: tuple[float, float, float]
    constant: Vector
    forcing: Forcing
    known: dict[bytes, tuple[Path, SpinState]] | None = None

    def remembering(self) -> Dynamics:
        """Copy with a cache for trial schedules:
        each flies anew only from the first changed pulse.
        """
        return replace(self, known={})

    @cached_property
    def bodies(self) -> Bodies:
        """Body as `motion` has it."""
        return Bodies(np.array(self.moments), self.constant, self.forcing)

    @property
    def free(self) -> bool:
        """True if coasts are arcs of a symmetric body without external torque, known in closed
        form.
        """
        return self.bodies.free

    def path(
        self,
        state: SpinState,
        start: float,
        end: float,
        torques: Sequence[Vector] = (),
        slope: Vector | None = None,
        *,
        most: int,
        falling: Falling | None = None,
    ) -> tuple[Path, SpinState]:
        """Motion from ``state`` at ``start`` to ``end`` s under the sum of ``torques``, and its
        final state.

        With a ``slope`` (3,) N m/s the torque runs evenly from there. Raises Infeasible for more
        than ``most`` steps.
        """
        push = Push(torques, slope, falling)
        if self.known is None:
            return self._path(state, start, end, push, most)
        more = (*(() if slope is None else (slope,)), *(falling or ()))
        leg = np.concatenate(
            [self.moments, state.rates, state.quaternion, (start, end), *torques, *more]
        ).tobytes()
        path = self.known.get(leg)
        if path is None or path[0].steps > most:
            if len(self.known) >= REMEMBERED:
                self.known.clear()
            path = self.known[leg] = self._path(state, start, end, push, most)
        return path

    def _path(
        self, state: SpinState, start: float, end: float, push: Push, most: int
    ) -> tuple[Path, SpinState]:
        work.spend(LEG)
        torque = np.sum(push.torques, axis=0) if push.torques else None
        quaternion = state.quaternion.copy()
        here = MotionStretch(
            self.bodies, start, state.rates, quaternion, torque, push.slope, push.falling
        )
        if end == start:
            return Piece(here, 0.0), state
        pieces = list[Piece]()
        steps = 0
        try:
            for piece in motion.pieces(here, end - start, most, LONG):
                pieces.append(piece)
                steps += piece.steps
        finally:  # a motion that is refused took its steps too
            if steps or not self.free:
                step = SUNK_STEP if self.forcing.growth != 0.0 else STEP
                work.spend(PULSE + step * steps)
        path: Path = pieces[0]
        if len(pieces) > 1:
            path = Joined([(float(piece.start), piece.motion) for piece in pieces], steps)
        return path, SpinState.of(*pieces[-1].end())

    def command(self, pulse: Pulse) -> None:
        """Take note of a pulse before it is flown:
        nothing to do where paths are told its torque.
        """

    def with_moments(self, moments: Vector) -> Dynamics:
        """Copy with these principal moments (3,) kg m²."""
        first, second, third = moments.tolist()
        return replace(self, moments=(first, second, third))

    def kicked(self, state: SpinState, impulse: Vector) -> SpinState:
        """State after an ``impulse`` (3,) N m s."""
        return SpinState.of(state.rates + impulse / np.asarray(self.moments), state.quaternion)


def make_dynamics(spacecraft: Spacecraft) -> Dynamics:
    """Dynamics of the true principal moments and disturbances."""
    wheel = spacecraft.inertia.wheel
    sense = spacecraft.sense if wheel else 1.0
    forcing = Forcing((), spacecraft.growth, wheel, sense)
    driven = forced(torques_of(spacecraft), forcing)
    return Dynamics(spacecraft.inertia.moments, *driven)


def torques_of(spacecraft: Spacecraft) -> list[Torque]:
    """Torques of the disturbances in principal axes; one from t = 0 on acts before it too."""
    torques = []
    for each in spacecraft.disturbances:
        vector = np.array([each.transverse.real, each.transverse.imag, each.axial])
        begin = each.begin if each.begin > 0.0 else -math.inf
        torques.append(Torque(vector, each.rate, begin, each.end))
    return torques


def forced(torques: Sequence[Torque], forcing: Forcing) -> tuple[Vector, Forcing]:
    """Constant torque and forcing of bodies under ``torques``, and ``forcing`` without any."""
    lasting = [each for each in torques if math.isinf(each.begin) and math.isinf(each.end)]
    timed = tuple(each for each in torques if math.isfinite(each.begin) or math.isfinite(each.end))
    constant = np.zeros(np.shape(torques[0].vector) if torques else 3)
    return driven_by(lasting, constant, forcing._replace(timed=timed))


def shed(spacecraft: Spacecraft) -> Vector | None:
    """Decrease of the principal moments per kg of propellant used, (3,) m²;
    None where they stay.
    """
    per_kg = None if spacecraft.tank is None else spacecraft.tank.inertia_per_kg
    return None if per_kg is None else np.array(per_kg)


def lightened(spacecraft: Spacecraft, used: float) -> Inertia:
    """Inertia once ``used`` kg of propellant are gone."""
    per_kg = shed(spacecraft)
    inertia = spacecraft.inertia
    if per_kg is None or used == 0.0:
        return inertia
    first, second, third = (np.asarray(inertia.moments) - used * per_kg).tolist()
    return replace(inertia, moments=(first, second, third))


class Lightening:
    """Mass-property change along a flight, as the propellant of the pulses is used."""

    def __init__(
        self, dynamics: Dynamics, spacecraft: Spacecraft, schedule: Schedule, edges: Sequence[float]
    ) -> None:
        self.first, self.per_kg = dynamics.moments, shed(spacecraft)
        times = np.array([*edges, *(0.5 * (start + other) for start, other in pairwise(edges))])
        self.used = (
            {}
            if self.per_kg is None
            else dict(zip(times.tolist(), schedule.used_by(times), strict=True))
        )

    def halfway(self, dynamics: Dynamics, time: float) -> Dynamics:
        """Body with half of the propellant gone that is used at once at ``time`` s."""
        if self.per_kg is None:
            return dynamics
        before = max((used for when, used in self.used.items() if when < time), default=0.0)
        return dynamics.with_moments(self.first - 0.5 * (before + self.used[time]) * self.per_kg)

    def between(
        self, dynamics: Dynamics, start: float, end: float
    ) -> tuple[Dynamics, Falling | None]:
        """Body at ``start`` s, and the fall of its moments, quadratic in time, to ``end`` s before
        the next edge.
        """
        if self.per_kg is None:
            return dynamics, None
        before = self.used[start]
        length = end - start
        body = dynamics.with_moments(self.first - before * self.per_kg)
        if length == 0.0 or self.used[end] == before:
            return body, None
        half, whole = self.used[0.5 * (start + end)] - before, self.used[end] - before
        rate, growth = (4.0 * half - whole) / length, 4.0 * (whole - 2.0 * half) / length**2
        return body, Falling(-rate * self.per_kg, -growth * self.per_kg)


class Supply:
    """Pulses ``fired`` by channel, and propellant ``used`` if the tank lasts, kg: by default, those
    before t = 0.
    """

    def __init__(
        self, spacecraft: Spacecraft, fired: Counter[str] | None = None, used: Any = None
    ) -> None:
        cold, tank = spacecraft.cold, spacecraft.tank
        before: Mapping[str, int] = {} if cold is None else cold.fired
        self.spacecraft = spacecraft
        self.fired = Counter(before) if fired is None else fired
        self.used = (0.0 if tank is None else tank.used) if used is None else used
        self.steady = not {COLD, BLOWDOWN, TRAVEL} & set(spacecraft.thrust_laws)
        """True if every pulse is as strong as the file says."""
        self._begun = self.used

    def behind(self, at_leg: Spacecraft) -> Spacecraft:
        """Spacecraft ``at_leg`` with all firings so far before its t = 0."""
        cold, tank = at_leg.cold, at_leg.tank
        return replace(
            at_leg,
            cold=None if cold is None else replace(cold, fired=dict(self.fired)),
            tank=None if tank is None else replace(tank, used=self.used),
        )

    @property
    def since(self) -> Any:
        """Propellant used since t = 0, kg."""
        tank = self.spacecraft.tank
        return self.used if tank is None else np.minimum(self.used, tank.propellant) - tank.used

    def fire(self, pulse: Pulse, channel: Channel | None) -> Pulse:
        """Fire a pulse; returns it at its real strength."""
        if channel is None or pulse.torque is None or self.steady:
            share = self.draw(pulse.propellant or 0.0)
            return pulse if share == 1.0 else weakened(pulse, share)
        commanded = pulse if pulse.command is None else on_command(channel, *pulse.loaded)
        before = self.used
        flow = self.full_flow(channel)
        level, propellant = self.take(channel, commanded.on_time)
        torque = self.torque(channel, 0.5 * (before + self.used)) * level
        force = channel.force
        if self.spacecraft.tank is not None and flow is not None and propellant:
            cold = (
                1.0
                if self.spacecraft.cold is None
                else self.spacecraft.cold.factor(self.fired[channel.name] - 1)
            )
            commanded = falling(commanded, self.spacecraft.tank, before, flow * cold)
        impulse = torque * commanded.on_time
        force = None if force is None else force * level
        return replace(
            commanded, torque=torque, impulse=impulse, force=force, propellant=propellant
        )

    def torque(self, channel: Channel, used: float) -> Vector:
        """Torque of ``channel`` at the thrust of the file with ``used`` kg gone, (3,) N m: the
        center of mass moves.
        """
        per_kg = self.spacecraft.center_of_mass_per_kg
        forces = [thruster.force for thruster in channel.thrusters if thruster.force is not None]
        if per_kg is None or not forces:
            return channel.torque
        return channel.torque - np.cross((used - self._begun) * per_kg, np.sum(forces, axis=0))

    def on_time_for(self, channel: Channel, effective: float) -> float:
        """On-time (s) of the next pulse of ``channel`` with the impulse of ``effective`` s at the
        file's thrust.
        """
        cold = self.spacecraft.cold
        tank = self.spacecraft.tank
        flow = self.full_flow(channel)
        share = 1.0 if cold is None else cold.factor(self.fired[channel.name])
        warm = effective / share
        if tank is None:
            return warm
        on_time = warm / float(tank.thrust_factor(self.used))
        for _ in range(
            REPEATED if flow is not None else 0
        ):  # each step errs by a small share of the error before
            before = on_time
            on_time = warm / float(tank.burn(self.used, flow * share, on_time)[1])
            if abs(on_time - before) <= CLOSE * on_time:
                break
        return on_time

    def full_flow(self, channel: Channel) -> Any:
        """Propellant of a second of the thrust of the file, kg; times the specific impulse where
        the tank has it.
        """
        tank = self.spacecraft.tank
        if (
            tank is None
            or tank.isp is None
            or any(thruster.thrust is None for thruster in channel.thrusters)
        ):
            return channel.mass_flow
        if channel.mass_flow is None:
            return None
        return sum(thruster.thrust or 0.0 for thruster in channel.thrusters) / STANDARD_GRAVITY

    def draw(self, propellant: Any) -> Any:
        """Consume propellant; return the available fraction."""
        tank, before = self.spacecraft.tank, self.used
        self.used = before + propellant
        return 1.0 if tank is None else tank.share(before, propellant)

    def take(self, channel: Channel, on_time: Any) -> tuple[Any, Any]:
        """Fire a pulse of effective ``on_time`` s; returns its mean level, and its propellant, kg
        or None.
        """
        flow = self.full_flow(channel)
        tank = self.spacecraft.tank
        cold = self.spacecraft.cold
        warmth = 1.0 if cold is None else cold.factor(self.fired[channel.name])
        if flow is None or tank is None:
            level = warmth if tank is None else warmth * tank.thrust_factor(self.used)
            propellant = None if flow is None else flow * on_time * level
        else:
            propellant, level = tank.burn(self.used, flow * warmth, on_time)
            level = warmth * level
        self.fired[channel.name] += 1
        share = self.draw(0.0 if propellant is None else propellant)
        return level * share, None if propellant is None else propellant * share

    def train(self, channel: Channel, on_times: Vector, count: int) -> tuple[Vector, Vector]:
        """Sums of the levels of 1 to ``count`` pulses of effective ``on_times`` (n,) s, and
        propellant used after them.

        In kg; (n, count) each. None is fired.
        """
        flow = self.full_flow(channel)
        tank = self.spacecraft.tank
        cold = self.spacecraft.cold
        numbers = np.arange(count)
        warmth = np.ones(count) if cold is None else cold.factor(self.fired[channel.name] + numbers)
        warm = np.cumsum(warmth)
        used = np.full((len(on_times), count), float(self.used))
        if tank is None or flow is None:
            level = 1.0 if tank is None else tank.thrust_factor(self.used)
            return level * warm + 0.0 * used, used if flow is None else used + flow * on_times[
                :, None
            ] * warm
        gone, mean = tank.burn(
            self.used, flow, on_times[:, None] * warm
        )  # what comes between pulses takes none
        levels, taken = (np.diff(total, axis=1, prepend=0.0) for total in (mean * warm, gone))
        return np.cumsum(levels * tank.share(used + gone - taken, taken), axis=1), used + gone

    def count(self, pulses: Iterable[Pulse]) -> None:
        """Take pulses into account that are as strong as they really are."""
        for pulse in pulses:
            self.fired[pulse.channel] += 1
            self.used += pulse.propellant or 0.0

    @property
    def shortage(self) -> str | None:
        """Message if more has been fired than the tank has; else None."""
        tank = self.spacecraft.tank
        if tank is None or self.used <= tank.propellant:
            return None
        return f"takes {self.used:.4g} kg of propellant, and the tank has {tank.propellant:.4g} kg"


def weakened(pulse: Pulse, factor: float) -> Pulse:
    """Pulse at ``factor`` times the thrust; reversed where that is negative."""
    torque, force = (
        None if vector is None else factor * vector for vector in (pulse.torque, pulse.force)
    )
    used = None if pulse.propellant is None else abs(factor) * pulse.propellant
    return replace(
        pulse, impulse=factor * pulse.impulse, torque=torque, force=force, propellant=used
    )


def falling(pulse: Pulse, tank: Tank, used: float, flow: float) -> Pulse:
    """Pulse whose thrust falls with the pressure of the ``tank``, of which ``used`` kg were gone at
    its start.

    ``flow`` as in `Tank.burn`. Its ramps are straight pieces, each with impulse and centroid of the
    thrust there.
    """
    from nutdamp.physics.thruster import Ramp  # a tank in blowdown

    start, on_time = pulse.loaded
    command = pulse.command or Command(
        start, on_time, (Ramp(pulse.start, pulse.end, 1.0, 1.0),), valve=False
    )
    gone, mean = tank.burn(used, flow, pulse.on_time)
    first, last = (float(tank.thrust_factor(used + spent) / mean) for spent in (0.0, gone))
    pieces = max(1, math.ceil(math.sqrt(max(first - last, 0.0) / EVEN)))
    ramps = list[Ramp]()
    moment = 0.0
    passed = 0.0
    nodes, weights = gauss_legendre(NODES)
    for ramp in command.ramps:
        length = (ramp.end - ramp.begin) / pieces
        for number in range(pieces):
            begin, middle = ramp.begin + number * length, ramp.begin + (number + 0.5) * length
            rise = (ramp.last - ramp.first) / pieces
            ahead = ramp.first + number * rise
            along = 0.5 * length * (1.0 + nodes)
            opened = passed + ahead * along + 0.5 * rise / length * along**2
            factors = tank.thrust_factor(used + tank.burn(used, flow, opened)[0]) / mean
            levels = (ahead + rise * along / length) * factors
            even, lean = 0.5 * float(weights @ levels), 1.5 * float(weights @ (nodes * levels))
            ramps.append(Ramp(begin, begin + length, even - lean, even + lean))
            moment += even * length * (middle - pulse.t) + lean * length**2 / 6.0
            passed += (ahead + 0.5 * rise) * length
    shaped = replace(command, ramps=tuple(ramps), fall=first - last)
    return replace(pulse, t=pulse.t + moment / pulse.on_time, command=shaped)


def supplied(spacecraft: Spacecraft, pulses: Iterable[Pulse]) -> tuple[Pulse, ...]:
    """Pulses at their real strength, in the order of their commands."""
    supply = Supply(spacecraft)
    channels = {channel.name: channel for channel in spacecraft.channels}
    if supply.steady:
        return tuple(pulses)
    ordered = sorted(pulses, key=lambda pulse: pulse.loaded[0])
    return tuple(supply.fire(pulse, channels.get(pulse.channel)) for pulse in ordered)
