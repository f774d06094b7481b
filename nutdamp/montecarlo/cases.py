"""Dispersed cases: body, initial motion and impulses of each case.

All is elementwise over cases; what nothing disperses stays one number for all of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.numerics import TINY, cos_sin
from nutdamp.flight.dynamics import Supply, shed
from nutdamp.montecarlo.inputs import BY_VALVE, TENSOR, Draws, Group, groups_of, list_inputs
from nutdamp.physics import attitude
from nutdamp.physics.body import DEGENERATE
from nutdamp.physics.sky import AxisWatch
from nutdamp.physics.thruster import Cold, Measured, Opened, Tank, Trapezoid, possible, spread
from nutdamp.spacecraft.equipment import Thruster
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import STEERABLE, Pulse, Schedule

Cases = (
    Any  # one number for all cases, or an array (n,): real, or complex for complex-step derivatives
)

Triple = tuple[Cases, Cases, Cases]


def plus(first: Cases, second: Cases) -> Cases:
    """Sum that costs nothing where one side is exactly zero for all cases."""
    if nothing(first):
        return second
    return first if nothing(second) else first + second


def times(first: Cases, second: Cases) -> Cases:
    """Product that costs nothing where one side is exactly zero for all cases."""
    return 0.0 if nothing(first) or nothing(second) else first * second


def nothing(value: Cases) -> bool:
    """True if exactly zero for all cases."""
    return isinstance(value, float) and value == 0.0


def cross(first: Sequence[Cases], second: Sequence[Cases]) -> Triple:
    """Vector product by components."""
    (a, b, c), (x, y, z) = first, second
    return (
        plus(times(b, z), times(-1.0, times(c, y))),
        plus(times(c, x), times(-1.0, times(a, z))),
        plus(times(a, y), times(-1.0, times(b, x))),
    )


def added(first: Sequence[Cases], second: Sequence[Cases]) -> Triple:
    """Sum of vectors."""
    return triple(map(plus, first, second))


def scaled(vector: Sequence[Cases], factor: Cases) -> Triple:
    """A vector times a factor."""
    if isinstance(factor, float) and factor == 1.0:
        return triple(vector)
    return triple(times(part, factor) for part in vector)


def triple(parts: Iterable[Cases]) -> Triple:
    """Three components, numbers for all cases or arrays."""
    x, y, z = parts
    return x, y, z


def parts_of(vector: Vector) -> Triple:
    """Components of one vector (3,)."""
    return triple(vector.tolist())


def tilt_axes(force: Vector) -> tuple[Vector, Vector]:
    """Unit axes of tilt of a force: ``a`` perpendicular to it and to axis 3 (or 1),
    ``b`` to both.
    """
    along = force / np.linalg.norm(force)
    reference = np.array([0.0, 0.0, 1.0]) if abs(along[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    first = np.cross(along, reference)
    first /= np.linalg.norm(first)
    return first, np.cross(along, first)


def tilted(first: Cases, second: Cases) -> tuple[Cases, Cases]:
    """cos φ and sin φ / φ of the rotation vector with these two components."""
    angle = np.sqrt(first * first + second * second) + TINY
    cosine, sine = cos_sin(angle)
    return cosine, sine / angle


def rotated(vector: Sequence[Cases], tilt: tuple[Cases, Cases]) -> Triple:
    """``vector`` turned by the rotation vector (``tilt``, 0)."""
    if all(map(nothing, tilt)):
        return triple(vector)
    first, second = tilt
    cosine, ratio = tilted(first, second)
    # Rodrigues: v cos φ + (u × v) sin φ + u (u·v)(1 - cos φ), with u = tilt/φ and (1 - cos φ)/φ² =
    # ratio²/(1 + cos φ)
    along = (first * vector[0] + second * vector[1]) * ratio * ratio / (1.0 + cosine)
    turned = added(scaled(vector, cosine), scaled(cross((first, second, 0.0), vector), ratio))
    return added(turned, (first * along, second * along, 0.0))


def turned(matrix: Any, vector: Sequence[Cases]) -> Triple:
    """Matrix (3, 3), or (3, 3, n), times vector, elementwise over cases."""
    return triple(reduce(plus, map(times, row, vector)) for row in matrix)


def tank_of(spacecraft: Spacecraft, draws: Draws) -> Tank | None:
    """Tank of the cases."""
    if spacecraft.tank is None:
        return None
    names = ("propellant", "pressure", "final_pressure", "exponent")
    changed = {
        name: plus(getattr(spacecraft.tank, name), draws.get(f"tank {name}", 0.0)) for name in names
    }
    return replace(spacecraft.tank, **changed)


def cold_of(spacecraft: Spacecraft, draws: Draws) -> Cold | None:
    """Cold nozzles of the cases."""
    cold = spacecraft.cold
    first = draws.get("cold", 0.0)
    pulses = draws.get("cold_pulses", 0.0)
    return cold and replace(cold, first=plus(cold.first, first), pulses=plus(cold.pulses, pulses))


def supplied(
    spacecraft: Spacecraft, schedule: Schedule, draws: Draws, flows: Sequence[Cases]
) -> tuple[list[Cases], tuple[Cases, ...] | None, Cases]:
    """Strength of each pulse of cases over the planned one, zero once the tank is empty; its
    propellant, kg, or None.

    ``flows``: propellant of each over that planned, at the same pressure and as warm. The last is
    the share of the tank that all would take, above 1 where it does not last; 0 without a tank, or
    where it is not known what they take.
    """
    tank = tank_of(spacecraft, draws)
    priced = all(pulse.propellant is not None for pulse in schedule)
    taken: list[Cases] = [
        (pulse.propellant or 0.0) * flow for pulse, flow in zip(schedule, flows, strict=True)
    ]
    levels: list[Cases] = [1.0] * len(flows)
    if tank is None and not ("cold" in draws or "cold_pulses" in draws):
        return levels, tuple(taken) if priced else None, 0.0
    nominal, case = (
        Supply(spacecraft),
        Supply(replace(spacecraft, cold=cold_of(spacecraft, draws), tank=tank)),
    )
    channels = {channel.name: channel for channel in spacecraft.channels}
    higher: Cases = 1.0  # the file gives the thrust at its own pressure
    if tank is not None and spacecraft.tank is not None:
        higher = (tank.pressure / spacecraft.tank.pressure) ** tank.exponent
    for number in sorted(range(len(flows)), key=lambda at: schedule.pulses[at].loaded[0]):
        pulse = schedule.pulses[number]
        channel = channels.get(pulse.channel)
        if channel is None or pulse.torque is None:
            nominal.draw(pulse.propellant or 0.0)
            levels[number] = case.draw(taken[number])
            taken[number] = taken[number] * levels[number]
            continue
        before, _ = nominal.take(channel, pulse.on_time)
        level, used = case.take(channel, pulse.on_time * flows[number] * higher)
        levels[number], taken[number] = (
            level * higher / (before or 1.0),
            0.0 if used is None else used,
        )
    drained = 0.0 if tank is None or not priced else case.used / tank.propellant
    return levels, tuple(taken) if priced else None, drained


# rounding allowed, relatively, where moments touch the triangle inequality (flat disc, C = 2A)
DISC = 1e-12

NOT_NEGATIVE = ("thrust", *BY_VALVE, "cold", "cold_pulses", "inertia_per_kg", "sensor_delay")
"""Tolerances of quantities that are never negative: draws that make them so are repeated."""

POSITIVE = ("sensor_scale", "sensor_noise")  # tolerances of quantities that are not zero either

ROUNDING = 1e-9
"""A pulse whose impulse differs by less, relatively, from its channel's torque times on-time is
that channel's.
"""


class Thrusting(NamedTuple):
    """Thrust of one thruster through a dispersed valve: times from the start of the command."""

    opened: Opened
    torque: Triple


@dataclass(frozen=True, slots=True)
class DispersedCases:
    """Dispersed cases, in principal axes and SI; each pulse counts as a rectangle."""

    moments: Triple  # at t = 0, kg m²
    omega0: Triple  # rad/s
    starts: tuple[Cases, ...]  # of each rectangle, s
    widths: tuple[Cases, ...]  # s
    leads: tuple[Cases, ...]  # from the command to its start, s
    impulses: tuple[Triple, ...]  # N m s
    thrust: tuple[tuple[Thrusting, ...], ...]  # of each pulse where a valve is not as in the file
    tilt: tuple[
        Cases, Cases
    ]  # rotation vector about body axes 1 and 2 by which the attitude at t = 0 is off, rad
    spent: (
        tuple[Cases, ...] | None
    )  # propellant of each pulse, kg; None where that of one is not known
    drained: Cases = 0.0  # as of `supplied`
    per_kg: Triple | None = None  # decrease of the moments by each kg, m²; None where they stay
    wheel: Cases = 0.0  # h, N m s
    turn: Any = None  # (3, 3, n): columns are their principal axes, by those of the estimate

    def of_estimate(self, vector: Triple) -> Triple:
        """A vector in the principal axes of the estimate from the cases' own."""
        return vector if self.turn is None else turned(self.turn, vector)

    def untwisted(self, vector: Triple) -> Triple:
        """A vector in the cases' own axes, turned about the third to where the first is nearest to
        that of the estimate: small changes of equal moments turn axes by any angle.
        """
        if self.turn is None:
            return vector
        x, y, z = vector
        cosine, sine = self.turn[:2, 0] / np.sqrt(np.sum(self.turn[:2, 0] ** 2, axis=0))
        return x * cosine - y * sine, x * sine + y * cosine, z

    @property
    def propellant(self) -> Cases | None:
        """Total propellant, kg; None where unknown."""
        return None if self.spent is None else sum(self.spent, 0.0)

    @property
    def A(self) -> Cases:
        """Transverse moment of the equivalent symmetric body, kg m²."""
        first, second, _ = self.moments
        return first if first is second else 0.5 * (first + second)

    @property
    def C(self) -> Cases:
        """Moment about the spin axis, kg m²."""
        return self.moments[2]


@dataclass(frozen=True, slots=True)
class _Actuation:
    """Dependence of a pulse on its actuator: on-time at its torque, and the part of the impulse of
    no thruster.
    """

    pulse: Pulse
    source: str | None
    duration: float
    remainder: Triple


# Response to one pulse at the thrust of the file: start, width, lead, impulse and thrust of
# `DispersedCases`, and flow.
_Fired = tuple[Cases, Cases, Cases, Triple, tuple[Thrusting, ...], Cases]


class DispersedModel:
    """Spacecraft and schedule, ready to be dispersed."""

    def __init__(self, spacecraft: Spacecraft, schedule: Schedule) -> None:
        self.spacecraft, self.schedule, self.inputs = (
            spacecraft,
            schedule,
            list_inputs(spacecraft, schedule),
        )
        self._members = {channel.name: channel.thrusters for channel in spacecraft.channels}
        if STEERABLE not in self._members and spacecraft.torquer is not None:
            self._members[STEERABLE] = ()
        self._actuations = tuple(map(self._actuation, schedule))
        self._fired_with = schedule.fired_with

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
            spread(pulse.command.ramps, pulse.t)
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
        good: Any = _possible(*moments) if dispersed else True
        for entry in self.inputs.drawn:
            if entry.tolerance in NOT_NEGATIVE + POSITIVE and entry.name in draws:
                value = entry.nominal + draws[entry.name]
                good = good & (value > 0.0 if entry.tolerance in POSITIVE else value >= 0.0)
        tank = tank_of(self.spacecraft, draws)
        if tank is not None and any(name.startswith("tank ") for name in draws):
            good = good & possible(tank)
        per_kg = self._per_kg(draws)
        if tank is not None and per_kg is not None:  # with all of it used there must be a body left
            good = good & _possible(*added(moments, scaled(per_kg, -1.0 * tank.propellant)))
        return good  # type: ignore[no-any-return]

    def _per_kg(self, draws: Draws) -> Triple | None:
        """Decrease of the moments per kg of propellant, m²; None where they stay."""
        per_kg = shed(self.spacecraft)
        return (
            None
            if per_kg is None
            else scaled(parts_of(per_kg), plus(1.0, draws.get("inertia_per_kg", 0.0)))
        )

    def cases(self, draws: Draws) -> DispersedCases:
        """Cases of the ``draws`` (deviations by input name)."""
        axes = self.spacecraft.inertia.axes
        moments, turn = self._body(draws)

        def own(vector: Triple) -> Triple:
            """In the principal axes of the cases."""
            return vector if turn is None else turned(np.swapaxes(turn, 0, 1), vector)

        off = [draws.get(f"omega0_{axis}", 0.0) for axis in (1, 2, 3)]
        torques = {
            source: self._torque(source, draws)
            for source in {each.source for each in self._actuations}
        }
        fired = [
            self._fired(n, each, torques[each.source], draws)
            for n, each in enumerate(self._actuations)
        ]
        starts, widths, leads, impulses, thrusts, flows = (
            zip(*fired, strict=True) if fired else ((),) * 6
        )
        levels, spent, drained = supplied(self.spacecraft, self.schedule, draws, flows)
        return DispersedCases(
            moments=moments,
            omega0=own(added(parts_of(self.spacecraft.omega0), turned(axes.T, off))),
            starts=starts,
            widths=widths,
            leads=leads,
            impulses=tuple(own(part) for part in map(scaled, impulses, levels)),
            thrust=tuple(
                tuple(Thrusting(each.opened, own(scaled(each.torque, level))) for each in thrust)
                for thrust, level in zip(thrusts, levels, strict=True)
            ),
            tilt=(draws.get("attitude x", 0.0), draws.get("attitude y", 0.0)),
            spent=spent,
            drained=drained,
            per_kg=self._per_kg(draws),
            wheel=plus(self.spacecraft.inertia.wheel, draws.get("wheel momentum", 0.0)),
            turn=turn,
        )

    def _fired(
        self, index: int, actuation: _Actuation, nominal: tuple[Triple, Cases, Cases], draws: Draws
    ) -> _Fired:
        """Response to the pulse ``index``; ``nominal`` is the `_torque` of its actuator."""
        opened = self._opened(actuation, draws)
        width = self.on_times[index]
        number = index + 1
        jitter = draws.get(f"Sun pulse {self._fired_with[index]}", 0.0)
        late = plus(draws.get("timing offset", 0.0), jitter)
        shift = plus(late, draws.get(f"timing pulse {number}", 0.0))
        pulse = actuation.pulse
        start = actuation.pulse.start
        lead = 0.0
        fall = 0.0
        if pulse.command is not None:
            start, fall = pulse.command.start, pulse.command.fall
            lead = pulse.t - 0.5 * width - start
        factor, (torque, mean, flow) = plus(1.0, draws.get(f"thrust pulse {number}", 0.0)), nominal
        if opened:
            acts = {thruster.name: each.acts for thruster, each in opened}
            longer = {name: on_time / pulse.on_time for name, (on_time, _, _) in acts.items()}
            torque, mean, flow = self._torque(actuation.source, draws, longer)
            centroid, width = (sum(part[at] for part in acts.values()) / len(acts) for at in (1, 2))
            lead = centroid - fall * width / 12.0 - 0.5 * width
        if actuation.source == STEERABLE and not self._members[STEERABLE]:
            impulse = self._steered(pulse.impulse, mean, draws)
        else:
            impulse = added(scaled(torque, actuation.duration), scaled(actuation.remainder, mean))
        thrust = []
        for thruster, each in opened:
            strength = factor * (actuation.duration / pulse.on_time)
            strength = strength * plus(1.0, draws.get(f"thrust {thruster.name}", 0.0))
            thrust.append(Thrusting(each, scaled(self.thruster_torque(thruster, draws), strength)))
        begins = plus(start if nothing(shift) else _not_before(start + shift), lead)
        return begins, width, lead, scaled(impulse, factor), tuple(thrust), flow * factor

    def _body(self, draws: Draws) -> tuple[Triple, Any]:
        """Principal moments, and their axes where a tensor is drawn, else None; the draw of A
        scales both transverse moments, C is the axial one.
        """
        inertia = self.spacecraft.inertia
        if entries := [name for name in TENSOR if name in draws]:
            count = max(np.size(draws[name]) for name in entries)
            change = np.zeros((3, 3, count), dtype=np.result_type(*(draws[n] for n in entries)))
            for name in entries:
                row, column = TENSOR[name]
                change[row, column] = change[column, row] = draws[name]
            turned_back = np.einsum("ki,kln,lj->nij", inertia.axes, change, inertia.axes)
            values, turn = principal(np.diag(inertia.moments), turned_back)
            return triple(values.T), np.moveaxis(turn, 0, -1)
        first, second, third = inertia.moments
        transverse = plus(1.0, times(draws.get("A", 0.0), 1.0 / inertia.A))
        wider = first * transverse
        other = wider if first == second else second * transverse
        return (wider, other, plus(third, draws.get("C", 0.0))), None

    def _actuation(self, pulse: Pulse) -> _Actuation:
        thrusters = self._members.get(pulse.channel)
        source = None if thrusters is None else pulse.channel
        if not thrusters:
            return _Actuation(pulse, source, pulse.on_time, parts_of(pulse.impulse))
        torque = np.sum([thruster.torque for thruster in thrusters], axis=0)
        duration = pulse.on_time or float(np.linalg.norm(pulse.impulse) / np.linalg.norm(torque))
        if (
            pulse.torque is not None and self.spacecraft.thrust_laws
        ):  # weaker where it is cold or the pressure falls
            duration *= float(torque @ pulse.torque) / float(torque @ torque)
        remainder = pulse.impulse - duration * torque
        if np.linalg.norm(remainder) <= ROUNDING * np.linalg.norm(pulse.impulse):
            # What is left is rounding; a single thruster takes it, so that its direction is exactly
            # the schedule's.
            remainder = np.zeros(3)
        return _Actuation(pulse, source, duration, parts_of(remainder))

    def _opened(self, actuation: _Actuation, draws: Draws) -> list[tuple[Thruster, Opened]]:
        """Thrusters of a pulse with the response of their valves,
        where any of these is dispersed.
        """
        if (
            actuation.pulse.command is None
            or actuation.source is None
            or not actuation.pulse.command.ramps
        ):
            return []
        members = self._members[actuation.source]
        on_time = actuation.pulse.command.on_time
        if not any(f"{key} {thruster.name}" in draws for thruster in members for key in BY_VALVE):
            return []
        openings = list[tuple[Thruster, Opened]]()
        for thruster in members:
            off = [draws.get(f"{key} {thruster.name}", 0.0) for key in BY_VALVE]
            if isinstance(thruster.valve, Trapezoid):
                openings.append((thruster, thruster.valve.opened(on_time, *off[:-1])))
            elif isinstance(thruster.valve, Measured):
                openings.append((thruster, thruster.valve.opened(on_time, plus(1.0, off[-1]))))
        return openings

    def _torque(
        self, source: str | None, draws: Draws, longer: Mapping[str, Cases] | None = None
    ) -> tuple[Triple, Cases, Cases]:
        """Torque of a channel (N m), the mean thrust factor of its thrusters, and that of their
        propellant flow.
        """
        thrusters = self._members.get(source, ()) if source is not None else ()
        if not thrusters:
            factor = 1.0 if source is None else plus(1.0, draws.get(f"thrust {STEERABLE}", 0.0))
            return (0.0, 0.0, 0.0), factor, factor
        torque: Triple = (0.0, 0.0, 0.0)
        factors = [plus(1.0, draws.get(f"thrust {thruster.name}", 0.0)) for thruster in thrusters]
        if longer:
            factors = [
                factor * longer.get(each.name, 1.0)
                for factor, each in zip(factors, thrusters, strict=True)
            ]
        for thruster, factor in zip(thrusters, factors, strict=True):
            torque = added(torque, scaled(self.thruster_torque(thruster, draws), factor))
        flows = [thruster.mass_flow or 1.0 for thruster in thrusters]
        flow = sum(
            weight * factor for weight, factor in zip(flows, factors, strict=True)
        ) / math.fsum(flows)
        return torque, sum(factors) / len(factors), flow

    def thruster_torque(self, thruster: Thruster, draws: Draws) -> Triple:
        """Torque at nominal thrust, with the force tilted and its point of attack moved, N m."""
        tilts = [draws.get(f"direction {thruster.name} {axis}", 0.0) for axis in "ab"]
        positions = [draws.get(f"position {thruster.name} {axis}", 0.0) for axis in "xyz"]
        centers = [draws.get(f"center of mass {axis}", 0.0) for axis in "xyz"]
        moves = added(positions, scaled(centers, -1.0))
        leans, moved = not all(map(nothing, tilts)), not all(map(nothing, moves))
        torque = parts_of(thruster.torque)
        if thruster.force is None or not (leans or moved):
            return torque
        force = parts_of(thruster.force)
        if leans and thruster.position is not None:
            cosine, ratio = tilted(*tilts)
            torque, force = scaled(torque, cosine), scaled(force, cosine)
            for axis, tilt in zip(tilt_axes(thruster.force), tilts, strict=True):
                more = parts_of(np.cross(axis, thruster.force))
                lean = times(tilt, ratio)
                torque = added(torque, scaled(cross(parts_of(thruster.position), more), lean))
                force = added(force, scaled(more, lean))
        if moved:
            torque = added(torque, cross(turned(self.spacecraft.inertia.axes.T, moves), force))
        return torque

    def _steered(self, impulse: Vector, factor: Cases, draws: Draws) -> Triple:
        """Impulse of the steerable torquer, its axis turned in the 1-2 plane."""
        x, y, z = scaled(parts_of(impulse), factor)
        angle = draws.get(f"direction {STEERABLE}", 0.0)
        if nothing(angle):
            return x, y, z
        cosine, sine = cos_sin(angle)
        return x * cosine - y * sine, x * sine + y * cosine, z


def _possible(first: Cases, second: Cases, third: Cases) -> Any:
    slack = 1.0 + DISC
    good = (first > 0.0) & (second > 0.0) & (third > 0.0) & (third <= (first + second) * slack)
    return good & (first <= (second + third) * slack) & (second <= (first + third) * slack)


def _not_before(start: Cases) -> Cases:
    """Starts not before t = 0; at 0 the derivative is the mean of both sides, one half."""
    if not np.iscomplexobj(start):
        return np.maximum(start, 0.0)
    return np.where(start.real > 0.0, start, np.where(start.real == 0.0, 0.5j * start.imag, 0.0))


def principal(tensor: Vector, change: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Moments (n, 3) of a ``tensor`` (3, 3) with changes (n, 3, 3), and the turns (n, 3, 3) whose
    columns are the axes: right-handed, the third the nearest to the third, then the first.

    An imaginary part is a change to first order; of equal moments it turns no axis.
    """
    values, vectors = np.linalg.eigh(tensor + change.real)
    nearness = np.abs(vectors)
    third = np.argmax(nearness[:, 2], axis=1)
    nearness[np.arange(len(values)), 0, third] = -1.0
    first = np.argmax(nearness[:, 0], axis=1)
    order = np.stack([first, 3 - first - third, third], axis=1)
    values = np.take_along_axis(values, order, axis=1)
    turn = np.take_along_axis(vectors, order[:, None, :], axis=2)
    turn *= np.where(np.diagonal(turn, axis1=1, axis2=2) < 0.0, -1.0, 1.0)[:, None, :]
    turn[:, :, 1] = np.cross(turn[:, :, 2], turn[:, :, 0])
    if not np.iscomplexobj(change):
        return values, turn
    slight = np.swapaxes(turn, 1, 2) @ change.imag @ turn
    apart = values[:, None, :] - values[:, :, None]
    equal = np.abs(apart) <= DEGENERATE * values.max(axis=1)[:, None, None]
    lean = slight / np.where(equal, np.inf, apart)
    return values + 1j * np.diagonal(slight, axis1=1, axis2=2), turn + 1j * turn @ lean


def watch_over(
    spacecraft: Spacecraft, tilt: tuple[Any, Any], count: int, turn: Any = None
) -> AxisWatch:
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
    spacecraft: Spacecraft, tilt: tuple[Any, Any], count: int, direction: Vector, turn: Any = None
) -> NDArray[np.float64]:
    """An inertial ``direction`` (3,) in the true axes of t = 0 of bodies off by a ``tilt`` and a
    ``turn``, (3, n).
    """
    x, y, z = attitude.rotate(attitude.conjugate(spacecraft.initial.quaternion), direction).tolist()
    seen = rotated((x, y, z), (-tilt[0], -tilt[1]))
    own = seen if turn is None else turned(np.swapaxes(turn, 0, 1), seen)
    return np.array([np.broadcast_to(part, count) for part in own])


def number_of(cases: DispersedCases) -> int:
    """Number of cases."""
    parts = (
        *cases.moments,
        *cases.omega0,
        *cases.starts,
        *cases.tilt,
        *(cases.spent or ()),
        *(cases.per_kg or ()),
    )
    return max(
        np.size(part) for part in (*parts, *(part for pulse in cases.impulses for part in pulse))
    )
