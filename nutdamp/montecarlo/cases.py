"""Dispersed cases: body, initial motion and impulses of each case.

Arrays carry the case last; what nothing disperses is the same in all of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nutdamp.common.numerics import TINY, cos_sin
from nutdamp.flight.dynamics import Supply, shed
from nutdamp.montecarlo.inputs import BY_VALVE, TANK, TENSOR, Draws, Group, groups_of, list_inputs
from nutdamp.physics import attitude
from nutdamp.physics.sky import AxisWatch
from nutdamp.physics.thruster import Cold, Measured, Opened, Tank, Trapezoid, action, possible
from nutdamp.spacecraft.equipment import Thruster
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import STEERABLE, Pulse, Schedule

Array = NDArray[np.float64]


def triple(parts: Iterable[Any]) -> tuple[Any, Any, Any]:
    """Three components, numbers or arrays."""
    x, y, z = parts
    return x, y, z


def vector_of(draws: Draws, names: Iterable[str]) -> Array:
    """Draws of the components ``names`` of a vector, (3, n), or (3, 1) where none is drawn."""
    parts = (np.atleast_1d(draws.get(name, 0.0)) for name in names)
    return np.array(np.broadcast_arrays(*parts), dtype=np.float64)


def tilt_axes(force: Vector) -> tuple[Vector, Vector]:
    """Unit axes of tilt of a force: ``a`` perpendicular to it and to axis 3 (or 1),
    ``b`` to both.
    """
    along = force / np.linalg.norm(force)
    reference = np.array([0.0, 0.0, 1.0]) if abs(along[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    first = np.cross(along, reference)
    first /= np.linalg.norm(first)
    return first, np.cross(along, first)


def tilt_quaternion(first: Any, second: Any) -> tuple[Any, Any, Any, Any]:
    """Quaternion of the rotation vector (``first``, ``second``, 0), rad, by components."""
    half = 0.5 * np.hypot(first, second)
    size = 0.5 * np.sinc(half / math.pi)
    return np.cos(half), size * first, size * second, 0.0 * half


def rotated(vector: ArrayLike, tilt: Any) -> Array:
    """``vector`` (3, n) turned by the rotation vector (``tilt``, 0), rad."""
    return np.array(attitude.turned(tilt_quaternion(*tilt), np.asarray(vector)))


def in_axes(matrix: Array, vector: Array) -> Array:
    """Matrix (3, 3), or (3, 3, n), times vectors (3, n)."""
    return np.asarray(np.einsum("ij...,j...->i...", matrix, vector))


def tank_of(spacecraft: Spacecraft, draws: Draws) -> Tank | None:
    """Tank of the cases."""
    if spacecraft.tank is None:
        return None
    changed = {
        name: getattr(spacecraft.tank, name) + draws.get(f"tank {name}", 0.0) for name in TANK
    }
    return replace(spacecraft.tank, **changed)


def cold_of(spacecraft: Spacecraft, draws: Draws) -> Cold | None:
    """Cold nozzles of the cases."""
    cold = spacecraft.cold
    if cold is None:
        return None
    first, pulses = draws.get("cold", 0.0), draws.get("cold_pulses", 0.0)
    return replace(cold, first=cold.first + first, pulses=cold.pulses + pulses)


# rounding allowed, relatively, where moments touch the triangle inequality (flat disc, C = 2A)
DISC = 1e-12

NOT_NEGATIVE = ("thrust", *BY_VALVE, "cold", "cold_pulses", "inertia_per_kg", "sensor_delay")
"""Tolerances of quantities that are never negative: draws that make them so are repeated."""

POSITIVE = ("sensor_scale", "sensor_noise")  # tolerances of quantities that are not zero either


class Thrusting(NamedTuple):
    """Thrust of one thruster through a dispersed valve: times from the start of the command."""

    opened: Opened
    torque: Array  # (3, n) N m


@dataclass(frozen=True, slots=True)
class DispersedCases:
    """Dispersed cases, in principal axes and SI."""

    moments: Array  # at t = 0, (3, n) kg m²
    omega0: Array  # (3, n) rad/s
    starts: Array  # of the commands, (k, n) s
    impulses: Array  # (k, 3, n) N m s
    thrust: tuple[tuple[Thrusting, ...], ...]  # of each pulse where a valve is not as in the file
    # rotation vector about body axes 1 and 2 by which the attitude at t = 0 is off, (2, n) rad
    tilt: Array
    spent: Array | None  # propellant of each pulse, (k, n) kg; None where that of one is not known
    # share of the tank that all would take, (n,), above 1 where it does not last; 0 without a tank,
    # or where it is not known what they take
    drained: Any = 0.0
    per_kg: Array | None = None  # decrease of the moments by each kg, (3, n) m²; None: they stay
    wheel: Any = 0.0  # h, N m s
    turn: Any = None  # (3, 3, n): columns are their principal axes, by those of the estimate

    @property
    def count(self) -> int:
        """Number of cases."""
        return int(self.moments.shape[1])

    def of_estimate(self, vector: Array) -> Array:
        """A vector in the principal axes of the estimate from the cases' own."""
        return vector if self.turn is None else in_axes(self.turn, vector)

    def untwisted(self, vector: Array) -> Array:
        """A vector in the cases' own axes, turned about the third to where the first is nearest to
        that of the estimate: small changes of equal moments turn axes by any angle.
        """
        if self.turn is None:
            return vector
        x, y, z = vector
        cosine, sine = self.turn[:2, 0] / np.hypot(*self.turn[:2, 0])
        return np.array([x * cosine - y * sine, x * sine + y * cosine, z])

    @property
    def propellant(self) -> Array | None:
        """Total propellant, (n,) kg; None where unknown."""
        return None if self.spent is None else self.spent.sum(axis=0)


class DispersedModel:
    """Spacecraft and schedule, ready to be dispersed."""

    def __init__(self, spacecraft: Spacecraft, schedule: Schedule) -> None:
        self.spacecraft, self.schedule = spacecraft, schedule
        self.inputs = list_inputs(spacecraft, schedule)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Inputs that are correlated; raises BadRequest where that cannot be."""
        requested = self.spacecraft.dispersions
        return () if requested is None else groups_of(requested.correlation)

    @cached_property
    def on_times(self) -> tuple[float, ...]:
        """On-time of each pulse, s, the same in every case: through a valve that of a rectangle of
        the same spread.
        """
        return tuple(
            action(pulse.command.ramps)[2]
            if pulse.command and pulse.command.ramps
            else pulse.on_time
            for pulse in self.schedule
        )

    @property
    def target(self) -> Vector:
        """Goal of H, or H at t = 0 of the estimate, as a unit vector (3,) in the estimated body
        axes at t = 0.
        """
        spacecraft = self.spacecraft
        axis = spacecraft.inertia.momentum(spacecraft.omega0)
        if spacecraft.goal.axis is not None:
            axis = attitude.rotate(
                attitude.conjugate(spacecraft.initial.quaternion), np.asarray(spacecraft.goal.axis)
            )
        return np.asarray(axis / np.linalg.norm(axis), dtype=np.float64)

    def physical(self, draws: Draws) -> NDArray[np.bool_] | bool:
        """True where a case is possible: moments of a rigid body, positive thrust, a sensor that
        sees something.
        """
        moments, turn = self._body(draws)
        dispersed = "A" in draws or "C" in draws or turn is not None
        good: Any = _rigid(*moments) if dispersed else True
        for entry in self.inputs.drawn:
            if entry.tolerance in NOT_NEGATIVE + POSITIVE and entry.name in draws:
                value = entry.nominal + draws[entry.name]
                good = good & (value > 0.0 if entry.tolerance in POSITIVE else value >= 0.0)
        tank = tank_of(self.spacecraft, draws)
        if tank is not None and any(name.startswith("tank ") for name in draws):
            good = good & possible(tank)
        per_kg = self._per_kg(draws)
        if tank is not None and per_kg is not None:  # with all of it used there must be a body left
            good = good & _rigid(*(moments - per_kg * tank.propellant))
        return good  # type: ignore[no-any-return]

    def _per_kg(self, draws: Draws) -> Array | None:
        """Decrease of the moments per kg of propellant, (3, n) m²; None where they stay."""
        per_kg = shed(self.spacecraft)
        factor = np.atleast_1d(1.0 + draws.get("inertia_per_kg", 0.0))
        return None if per_kg is None else per_kg[:, None] * factor

    def _body(self, draws: Draws) -> tuple[Array, Any]:
        """Principal moments (3, n), and their axes where a tensor is drawn, else None; the draw of
        A scales both transverse moments, C is the axial one.
        """
        inertia = self.spacecraft.inertia
        if entries := [name for name in TENSOR if name in draws]:
            change = np.zeros((3, 3, max(np.size(draws[name]) for name in entries)))
            for name in entries:
                row, column = TENSOR[name]
                change[row, column] = change[column, row] = draws[name]
            turned_back = np.einsum("ki,kln,lj->nij", inertia.axes, change, inertia.axes)
            values, turn = principal(np.diag(inertia.moments), turned_back)
            return values.T, np.moveaxis(turn, 0, -1)
        transverse = 1.0 + draws.get("A", 0.0) / inertia.A
        first, second, third = inertia.moments
        parts = (first * transverse, second * transverse, third + draws.get("C", 0.0))
        return np.array(np.broadcast_arrays(*map(np.atleast_1d, parts))), None

    def cases(self, draws: Draws) -> DispersedCases:
        """Cases of the ``draws`` (deviations by input name)."""
        spacecraft, pulses = self.spacecraft, self.schedule.pulses
        count = max(map(np.size, draws.values()), default=1)
        moments, turn = self._body(draws)
        per_kg = self._per_kg(draws)

        def own(vector: Array) -> Array:
            """In the principal axes of the cases."""
            return vector if turn is None else in_axes(np.swapaxes(turn, 0, 1), vector)

        def whole(values: Any) -> Array:
            """Values (..., n) of all cases, by those (..., 1) or (..., n)."""
            return np.array(np.broadcast_to(values, (*np.shape(values)[:-1], count)))

        off = vector_of(draws, [f"omega0_{axis}" for axis in (1, 2, 3)])
        rates = spacecraft.omega0[:, None] + in_axes(spacecraft.inertia.axes.T, off)
        fired = [self._fired(number, draws) for number in range(len(pulses))]
        levels, spent, drained = self._supplied(draws, [flow for _, _, flow in fired])
        impulses, starts = np.empty((len(pulses), 3, count)), np.empty((len(pulses), count))
        thrust = []
        late = draws.get("timing offset", 0.0)
        for number, ((impulse, through, _), level) in enumerate(zip(fired, levels, strict=True)):
            impulses[number] = own(whole(impulse * level))
            thrust.append(tuple(each._replace(torque=own(each.torque * level)) for each in through))
            jitter = draws.get(f"Sun pulse {self.schedule.fired_with[number]}", 0.0)
            shift = late + jitter + draws.get(f"timing pulse {number + 1}", 0.0)
            starts[number] = np.maximum(pulses[number].loaded[0] + shift, 0.0)
        return DispersedCases(
            moments=whole(moments),
            omega0=own(whole(rates)),
            starts=starts,
            impulses=impulses,
            thrust=tuple(thrust),
            tilt=whole(vector_of(draws, ("attitude x", "attitude y"))),
            spent=None if spent is None else np.array([whole(each) for each in spent]),
            drained=drained,
            per_kg=None if per_kg is None else whole(per_kg),
            wheel=spacecraft.inertia.wheel + draws.get("wheel momentum", 0.0),
            turn=turn,
        )

    def _fired(self, number: int, draws: Draws) -> tuple[Any, tuple[Thrusting, ...], Any]:
        """Response to a pulse at the thrust of the file: its impulse (3, n), the thrust of each
        thruster where a valve is dispersed, and its propellant over the planned one.
        """
        pulse = self.schedule.pulses[number]
        factor = 1.0 + draws.get(f"thrust pulse {number + 1}", 0.0)
        thrusters = next(
            (each.thrusters for each in self.spacecraft.channels if each.name == pulse.channel), ()
        )
        if not thrusters:
            impulse = np.array(pulse.impulse[:, None])
            if pulse.channel == STEERABLE and self.spacecraft.torquer is not None:
                cosine, sine = cos_sin(np.atleast_1d(draws.get(f"direction {STEERABLE}", 0.0)))
                x, y, z = impulse
                impulse = np.array([x * cosine - y * sine, x * sine + y * cosine, z + 0.0 * cosine])
                factor = factor * (1.0 + draws.get(f"thrust {STEERABLE}", 0.0))
            return impulse * factor, (), factor
        nominal = np.sum([thruster.torque for thruster in thrusters], axis=0)
        duration = pulse.on_time or float(np.linalg.norm(pulse.impulse) / np.linalg.norm(nominal))
        if pulse.torque is not None and self.spacecraft.thrust_laws:
            # weaker where it is cold or the pressure falls
            duration *= float(nominal @ pulse.torque) / float(nominal @ nominal)
        opened = self._opened(pulse, thrusters, draws)
        torque, factors, through = np.zeros((3, 1)), list[Any](), list[Thrusting]()
        for thruster in thrusters:
            strength = 1.0 + draws.get(f"thrust {thruster.name}", 0.0)
            own = self.thruster_torque(thruster, draws)
            if thruster.name in opened:
                valve = opened[thruster.name]
                part = own * (factor * strength * (duration / pulse.on_time))
                through.append(Thrusting(valve, part))
                strength = strength * valve.acts[0] / pulse.on_time
            factors.append(strength)
            torque = torque + own * strength
        flows = [thruster.mass_flow or 1.0 for thruster in thrusters]
        flow = sum(weight * each for weight, each in zip(flows, factors, strict=True))
        # what its thrusters do not explain is as much stronger as these are on average
        remainder = (pulse.impulse - duration * nominal)[:, None] * (sum(factors) / len(factors))
        impulse = (torque * duration + remainder) * factor
        return impulse, tuple(through), flow / math.fsum(flows) * factor

    def _supplied(
        self, draws: Draws, flows: Sequence[Any]
    ) -> tuple[list[Any], list[Any] | None, Any]:
        """Strength of each pulse over the planned one, zero once the tank is empty; its propellant,
        kg, or None; and `DispersedCases.drained`.

        ``flows``: propellant of each over that planned, at the same pressure and as warm.
        """
        spacecraft, pulses = self.spacecraft, self.schedule.pulses
        tank = tank_of(spacecraft, draws)
        priced = all(pulse.propellant is not None for pulse in pulses)
        taken = [
            (pulse.propellant or 0.0) * flow for pulse, flow in zip(pulses, flows, strict=True)
        ]
        levels: list[Any] = [1.0] * len(flows)
        if tank is None and not ("cold" in draws or "cold_pulses" in draws):
            return levels, taken if priced else None, 0.0
        nominal = Supply(spacecraft)
        case = Supply(replace(spacecraft, cold=cold_of(spacecraft, draws), tank=tank))
        channels = {channel.name: channel for channel in spacecraft.channels}
        higher: Any = 1.0  # the file gives the thrust at its own pressure
        if tank is not None and spacecraft.tank is not None:
            higher = (tank.pressure / spacecraft.tank.pressure) ** tank.exponent
        for number in sorted(range(len(flows)), key=lambda at: pulses[at].loaded[0]):
            pulse = pulses[number]
            channel = channels.get(pulse.channel)
            if channel is None or pulse.torque is None:
                nominal.draw(pulse.propellant or 0.0)
                levels[number] = case.draw(taken[number])
                taken[number] = taken[number] * levels[number]
                continue
            before, _ = nominal.take(channel, pulse.on_time)
            level, used = case.take(channel, pulse.on_time * flows[number] * higher)
            levels[number] = level * higher / (before or 1.0)
            taken[number] = 0.0 if used is None else used
        drained = 0.0 if tank is None or not priced else case.used / tank.propellant
        return levels, taken if priced else None, drained

    def _opened(
        self, pulse: Pulse, thrusters: Sequence[Thruster], draws: Draws
    ) -> Mapping[str, Opened]:
        """Response of the valves of a pulse by thruster, where any of them is dispersed."""
        dispersed = any(f"{key} {each.name}" in draws for each in thrusters for key in BY_VALVE)
        if pulse.command is None or not pulse.command.ramps or not dispersed:
            return {}
        responses = {}
        for thruster in thrusters:
            off = [draws.get(f"{key} {thruster.name}", 0.0) for key in BY_VALVE]
            if isinstance(thruster.valve, Trapezoid):
                opened = thruster.valve.opened(pulse.command.on_time, *off[:-1])
            elif isinstance(thruster.valve, Measured):
                opened = thruster.valve.opened(pulse.command.on_time, 1.0 + off[-1])
            responses[thruster.name] = opened
        return responses

    def thruster_torque(self, thruster: Thruster, draws: Draws) -> Array:
        """Torque at nominal thrust, with the force tilted and its point of attack moved, (3, n)
        N m, or (3, 1) where neither is drawn.
        """
        tilts = [f"direction {thruster.name} {axis}" for axis in "ab"]
        positions = [f"position {thruster.name} {axis}" for axis in "xyz"]
        centers = [f"center of mass {axis}" for axis in "xyz"]
        torque = np.array(thruster.torque[:, None])
        if thruster.force is None or not {*tilts, *positions, *centers} & {*draws}:
            return torque
        force = np.array(thruster.force[:, None])
        if thruster.position is not None:
            first, second = vector_of(draws, tilts)
            angle = np.hypot(first, second) + TINY
            cosine, sine = cos_sin(angle)
            torque, force = torque * cosine, force * cosine
            for axis, tilt in zip(tilt_axes(thruster.force), (first, second), strict=True):
                more, lean = np.cross(axis, thruster.force), tilt * sine / angle
                torque = torque + np.cross(thruster.position, more)[:, None] * lean
                force = force + more[:, None] * lean
        moves = vector_of(draws, positions) - vector_of(draws, centers)
        arm = in_axes(self.spacecraft.inertia.axes.T, moves)
        arm, force = np.broadcast_arrays(arm, force)
        return np.asarray(torque + np.cross(arm, force, axis=0))


def _rigid(first: Array, second: Array, third: Array) -> Any:
    """True where a rigid body has these moments."""
    slack = 1.0 + DISC
    good = (first > 0.0) & (second > 0.0) & (third > 0.0) & (third <= (first + second) * slack)
    return good & (first <= (second + third) * slack) & (second <= (first + third) * slack)


def principal(tensor: Vector, change: Array) -> tuple[Array, Array]:
    """Moments (n, 3) of a ``tensor`` (3, 3) with changes (n, 3, 3), and the turns (n, 3, 3) whose
    columns are the axes: right-handed, the third the nearest to the third, then the first.
    """
    values, vectors = np.linalg.eigh(tensor + change)
    nearness = np.abs(vectors)
    third = np.argmax(nearness[:, 2], axis=1)
    nearness[np.arange(len(values)), 0, third] = -1.0
    first = np.argmax(nearness[:, 0], axis=1)
    order = np.stack([first, 3 - first - third, third], axis=1)
    values = np.take_along_axis(values, order, axis=1)
    turn = np.take_along_axis(vectors, order[:, None, :], axis=2)
    turn *= np.where(np.diagonal(turn, axis1=1, axis2=2) < 0.0, -1.0, 1.0)[:, None, :]
    turn[:, :, 1] = np.cross(turn[:, :, 2], turn[:, :, 0])
    return values, turn


def watch_over(spacecraft: Spacecraft, tilt: Any, count: int, turn: Any = None) -> AxisWatch:
    """Observer of ``count`` cases with axes off by a ``tilt``, rad, about 1 and 2, and by the
    ``turn`` of `DispersedCases`.
    """
    inertial = [
        np.zeros(3) if cone.direction is None else cone.direction for cone in spacecraft.keep
    ]
    directions = np.array(
        [in_body(spacecraft, tilt, count, direction, turn) for direction in inertial]
    )
    momentum = next(
        (number for number, cone in enumerate(spacecraft.keep) if cone.direction is None), None
    )
    return AxisWatch.of(directions.reshape(-1, 3, count), spacecraft.sense, momentum)


def in_body(
    spacecraft: Spacecraft, tilt: Any, count: int, direction: Vector, turn: Any = None
) -> Array:
    """An inertial ``direction`` (3,) in the true axes of t = 0 of bodies off by a ``tilt`` and a
    ``turn``, (3, n).
    """
    known = attitude.rotate(attitude.conjugate(spacecraft.initial.quaternion), direction)
    seen = rotated(known, (-tilt[0], -tilt[1])).reshape(3, -1)
    own = seen if turn is None else in_axes(np.swapaxes(turn, 0, 1), seen)
    return np.array(np.broadcast_to(own, (3, count)))
