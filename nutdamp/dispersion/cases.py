"""The dispersed cases: what body flies, how it moves at t = 0, and which impulses it really gets.

The schedule is fixed: which channel, commanded start, on-time. A case differs from the estimate in its moments, its
rates, and in what each pulse does. Everything here is elementwise over cases (structure of arrays); a quantity that
nothing disperses stays one number for all of them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.dispersion.draws import Draws
from nutdamp.dispersion.inputs import Inputs, list_inputs
from nutdamp.physics import attitude
from nutdamp.physics.rigid_cases import cos_sin
from nutdamp.schedule import STEERABLE, Pulse, Schedule
from nutdamp.spacecraft import Spacecraft, Thruster, Vector

Cases = Any
"""One number for all cases, or an array (n,): real, or complex where a derivative is taken by a complex step."""

Triple = tuple[Cases, Cases, Cases]

TINY = 1e-200
"""Keeps quotients like sin x / x defined at zero, and changes nothing elsewhere."""

DISC = 1e-12
"""Rounding allowed, relatively, where moments touch the triangle inequality (flat disc, C = 2A)."""

ROUNDING = 1e-9
"""A pulse whose impulse differs by less, relatively, from its channel's torque times on-time is that channel's."""


def plus(first: Cases, second: Cases) -> Cases:
    """A sum that costs nothing where one side is exactly zero for all cases."""
    if _nothing(first):
        return second
    return first if _nothing(second) else first + second


def times(first: Cases, second: Cases) -> Cases:
    """A product that costs nothing where one side is exactly zero for all cases."""
    return 0.0 if _nothing(first) or _nothing(second) else first * second


def _nothing(value: Cases) -> bool:
    return isinstance(value, float) and value == 0.0


def cross(first: Sequence[Cases], second: Sequence[Cases]) -> Triple:
    """Vector product by components."""
    (a, b, c), (x, y, z) = first, second
    return (
        plus(times(b, z), times(-1.0, times(c, y))),
        plus(times(c, x), times(-1.0, times(a, z))),
        plus(times(a, y), times(-1.0, times(b, x))),
    )


def _sum(first: Sequence[Cases], second: Sequence[Cases]) -> Triple:
    x, y, z = map(plus, first, second)
    return x, y, z


def _scaled(vector: Sequence[Cases], factor: Cases) -> Triple:
    x, y, z = (times(part, factor) for part in vector)
    return x, y, z


def _parts(vector: Vector) -> Triple:
    x, y, z = vector.tolist()
    return x, y, z


@dataclass(frozen=True, slots=True)
class DispersedCases:
    """Dispersed cases, in principal axes and SI.

    ``moments`` (I1, I2, I3) kg m²; ``omega0`` rad/s at t = 0; of each pulse its ``starts`` s and ``impulses`` N m s;
    ``tilt`` the rotation vector (rad, about body axes 1 and 2) by which the attitude at t = 0 is off; ``propellant``
    kg, or None where it is not known.
    """

    moments: Triple
    omega0: Triple
    starts: tuple[Cases, ...]
    impulses: tuple[Triple, ...]
    tilt: tuple[Cases, Cases]
    propellant: Cases | None

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
    """How one pulse follows from what fires: nominal ``impulse``, and the part of it no thruster accounts for."""

    pulse: Pulse
    source: str | None
    duration: float
    remainder: Triple


@dataclass(frozen=True, slots=True)
class _Opened:
    """A pulse through valves that are not as the file has them: ``longer``, factors by thruster, and ``late``, s.

    As what they change is small beside the pulse, it keeps its shape, with another impulse and another centroid.
    """

    longer: Mapping[str, Cases]
    late: Cases


AS_PLANNED = _Opened({}, 0.0)


@dataclass(frozen=True, eq=False)
class Model:
    """A spacecraft and the schedule it flies, ready to be dispersed."""

    spacecraft: Spacecraft
    schedule: Schedule
    inputs: Inputs = field(init=False)
    _members: dict[str, tuple[Thruster, ...]] = field(init=False)
    _actuations: tuple[_Actuation, ...] = field(init=False)

    def __post_init__(self) -> None:
        body = self.spacecraft
        members = {channel.name: channel.thrusters for channel in body.channels}
        if STEERABLE not in members and body.torquer is not None:
            members[STEERABLE] = ()
        object.__setattr__(self, "inputs", list_inputs(body, self.schedule))
        object.__setattr__(self, "_members", members)
        object.__setattr__(self, "_actuations", tuple(map(self._actuation, self.schedule)))

    @cached_property
    def on_times(self) -> tuple[float, ...]:
        """On-time of each pulse, s: commanded, so the same in every case.

        Through a valve that of the rectangle which has the impulse, the centroid and the spread of the thrust.
        """
        return tuple(map(_width, self.schedule))

    @property
    def target(self) -> Vector:
        """Where H shall point, as a unit vector (3,) in the estimated body axes at t = 0.

        The goal of the spacecraft where it has one (an inertial axis), else H at t = 0 as the estimate has it.
        """
        body = self.spacecraft
        axis = body.goal.axis
        if axis is None:
            axis = np.asarray(body.inertia.moments) * body.omega0
        else:
            axis = attitude.rotate(body.initial.quaternion * np.array([1.0, -1.0, -1.0, -1.0]), np.asarray(axis))
        return np.asarray(axis / np.linalg.norm(axis), dtype=np.float64)

    def physical(self, draws: Draws) -> NDArray[np.bool_] | bool:
        """Which cases can be: moments of a rigid body, thrust that pushes."""
        first, second, third = self._moments(draws)
        slack = 1.0 + DISC
        good: Any = True
        if "A" in draws or "C" in draws:
            good = (first > 0.0) & (third > 0.0) & (third <= (first + second) * slack)
            if first is not second:
                good = good & (first <= (second + third) * slack) & (second <= (first + third) * slack)
        for name, draw in draws.items():
            if name.startswith("thrust "):
                good = good & (draw >= -1.0)
        return good  # type: ignore[no-any-return]

    def cases(self, draws: Draws) -> DispersedCases:
        """The cases of the ``draws`` (deviations by input name)."""
        turn = self.spacecraft.inertia.axes
        omega0 = _parts(self.spacecraft.omega0)
        off = [draws.get(f"omega0_{axis}", 0.0) for axis in (1, 2, 3)]
        torques = {source: self._torque(source, draws) for source in {one.source for one in self._actuations}}
        offset = draws.get("timing offset", 0.0)
        starts, impulses = [], []
        propellant: Cases | None = 0.0
        for number, one in enumerate(self._actuations, start=1):
            opened = self._opened(one, draws)
            late = plus(offset, draws.get(f"Sun pulse {number}", 0.0))
            shift = plus(late, draws.get(f"timing pulse {number}", 0.0))
            lead: Cases = 0.0
            start = one.pulse.start
            if one.pulse.command is not None:
                start = one.pulse.command.start
                lead = plus(one.pulse.t - 0.5 * self.on_times[number - 1] - start, opened.late)
            starts.append(plus(start if _nothing(shift) else _not_before(start + shift), lead))
            factor = plus(1.0, draws.get(f"thrust pulse {number}", 0.0))
            if not _nothing(warmer := times(draws.get("cold", 0.0), self._coldness[number - 1])):
                factor = factor * (1.0 + warmer)
            torque, mean, flow = torques[one.source] if not opened.longer else self._torque(one.source, draws, opened)
            if one.source == STEERABLE and not self._members[STEERABLE]:
                impulse = self._steered(one.pulse.impulse, mean, draws)
            else:
                impulse = _sum(_scaled(torque, one.duration), _scaled(one.remainder, mean))
            impulses.append(impulse if isinstance(factor, float) and factor == 1.0 else _scaled(impulse, factor))
            used = one.pulse.propellant
            propellant = None if propellant is None or used is None else propellant + used * flow * factor
        return DispersedCases(
            moments=self._moments(draws),
            omega0=_sum(omega0, _turned(turn.T, off)),
            starts=tuple(starts),
            impulses=tuple(impulses),
            tilt=(draws.get("attitude x", 0.0), draws.get("attitude y", 0.0)),
            propellant=propellant,
        )

    def _moments(self, draws: Draws) -> Triple:
        """A scales both transverse moments, C is the axial one."""
        inertia = self.spacecraft.inertia
        first, second, third = inertia.moments
        transverse = plus(1.0, times(draws.get("A", 0.0), 1.0 / inertia.A))
        scaled = first * transverse
        return scaled, scaled if first == second else second * transverse, plus(third, draws.get("C", 0.0))

    def _actuation(self, pulse: Pulse) -> _Actuation:
        thrusters = self._members.get(pulse.channel)
        source = None if thrusters is None else pulse.channel
        if not thrusters:
            return _Actuation(pulse, source, pulse.on_time, _parts(pulse.impulse))
        torque = np.sum([thruster.torque for thruster in thrusters], axis=0)
        duration = pulse.on_time or float(np.linalg.norm(pulse.impulse) / np.linalg.norm(torque))
        if pulse.torque is not None and self.spacecraft.thrust_laws:  # weaker where it is cold or the pressure falls
            duration *= float(torque @ pulse.torque) / float(torque @ torque)
        remainder = pulse.impulse - duration * torque
        if np.linalg.norm(remainder) <= ROUNDING * np.linalg.norm(pulse.impulse):
            # What is left is rounding; a single thruster takes it, so that its direction is exactly the schedule's.
            remainder = np.zeros(3)
        return _Actuation(pulse, source, duration, _parts(remainder))

    def _opened(self, one: _Actuation, draws: Draws) -> _Opened:
        """What delays and impulse bits other than those of the file do to a pulse."""
        if one.pulse.command is None or one.source is None or not one.pulse.command.ramps:
            return AS_PLANNED
        from nutdamp.physics.valve import Trapezoid  # few spacecraft have any

        longer: dict[str, Cases] = {}
        late: Cases = 0.0
        members = self._members[one.source]
        for thruster in members:
            opens, closes = (draws.get(f"{key} {thruster.name}", 0.0) for key in ("open_delay", "close_delay"))
            bit = draws.get(f"impulse_bit {thruster.name}", 0.0)
            if not _nothing(bit):
                longer[thruster.name] = plus(1.0, bit)
            if not (_nothing(opens) and _nothing(closes)) and isinstance(thruster.valve, Trapezoid):
                given, later = thruster.valve.delayed(one.pulse.command.on_time, opens, closes)
                longer[thruster.name] = given / one.pulse.on_time
                late = plus(late, times(later, 1.0 / len(members)))
        return _Opened(longer, late)

    @cached_property
    def _coldness(self) -> tuple[float, ...]:
        """By how much each pulse grows with the factor of the first, over what it is."""
        cold, fired, found = self.spacecraft.cold, Counter[str](), []
        for one in self._actuations:
            before = fired[one.pulse.channel]
            fired[one.pulse.channel] += 1
            through = cold is not None and one.source not in (None, STEERABLE)
            found.append(cold.decay(before) / cold.factor(before) if cold is not None and through else 0.0)
        return tuple(found)

    def _torque(self, source: str | None, draws: Draws, opened: _Opened | None = None) -> tuple[Triple, Cases, Cases]:
        """Torque of a channel (N m), the mean thrust factor of its thrusters, and that of their propellant flow."""
        thrusters = self._members.get(source, ()) if source is not None else ()
        if not thrusters:
            factor = 1.0 if source is None else plus(1.0, draws.get(f"thrust {STEERABLE}", 0.0))
            return (0.0, 0.0, 0.0), factor, factor
        torque: Triple = (0.0, 0.0, 0.0)
        factors = [plus(1.0, draws.get(f"thrust {thruster.name}", 0.0)) for thruster in thrusters]
        if opened is not None:
            lasts = [opened.longer.get(thruster.name, 1.0) for thruster in thrusters]
            factors = [factor * longer for factor, longer in zip(factors, lasts, strict=True)]
        for thruster, factor in zip(thrusters, factors, strict=True):
            turned = self.thruster_torque(thruster, draws)
            torque = _sum(torque, turned if isinstance(factor, float) and factor == 1.0 else _scaled(turned, factor))
        flows = [thruster.mass_flow or 1.0 for thruster in thrusters]
        flow = sum(weight * factor for weight, factor in zip(flows, factors, strict=True)) / math.fsum(flows)
        return torque, sum(factors) / len(factors), flow

    def thruster_torque(self, thruster: Thruster, draws: Draws) -> Triple:
        """Torque at nominal thrust, with the force tilted and its point of attack moved, N m."""
        tilts = [draws.get(f"direction {thruster.name} {axis}", 0.0) for axis in "ab"]
        moves = [draws.get(f"position {thruster.name} {axis}", 0.0) for axis in "xyz"]
        tilted, moved = not all(map(_nothing, tilts)), not all(map(_nothing, moves))
        torque = _parts(thruster.torque)
        if thruster.force is None or not (tilted or moved):
            return torque
        force = _parts(thruster.force)
        if tilted and thruster.position is not None:
            cosine, sine_ratio = _tilt(*tilts)
            leant = [times(tilt, sine_ratio) for tilt in tilts]
            arm = _parts(thruster.position)
            torque, nominal = _scaled(torque, cosine), thruster.force
            force = _scaled(force, cosine)
            for axis, lean in zip(tilt_axes(nominal), leant, strict=True):
                more = _parts(np.cross(axis, nominal))
                torque = _sum(torque, _scaled(cross(arm, more), lean))
                force = _sum(force, _scaled(more, lean))
        if moved:
            torque = _sum(torque, cross(_turned(self.spacecraft.inertia.axes.T, moves), force))
        return torque

    def _steered(self, impulse: Vector, factor: Cases, draws: Draws) -> Triple:
        """Impulse of the steerable torquer, its axis turned in the 1-2 plane."""
        x, y, z = _scaled(_parts(impulse), factor) if not isinstance(factor, float) else _parts(impulse * factor)
        angle = draws.get(f"direction {STEERABLE}", 0.0)
        if _nothing(angle):
            return x, y, z
        cosine, sine = cos_sin(angle)
        return x * cosine - y * sine, x * sine + y * cosine, z


def _width(pulse: Pulse) -> float:
    """Length (s) of the rectangle that a pulse counts as."""
    if pulse.command is None or not pulse.command.ramps:
        return pulse.on_time
    from nutdamp.physics import valve  # few spacecraft have any

    return valve.spread(pulse.command.ramps, pulse.t)


def _not_before(start: Cases) -> Cases:
    """A pulse shifted before t = 0 fires at 0; there its derivative is the mean of both sides, one half."""
    if not np.iscomplexobj(start):
        return np.maximum(start, 0.0)
    return np.where(start.real > 0.0, start, np.where(start.real == 0.0, 0.5j * start.imag, 0.0))


def tilt_axes(force: Vector) -> tuple[Vector, Vector]:
    """The two unit axes across a force about which it is tilted: ``a`` square to axis 3 (or 1) too, ``b`` to both."""
    along = force / np.linalg.norm(force)
    reference = np.array([0.0, 0.0, 1.0]) if abs(along[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    first = np.cross(along, reference)
    first /= np.linalg.norm(first)
    return first, np.cross(along, first)


def _tilt(first: Cases, second: Cases) -> tuple[Cases, Cases]:
    """cos φ and sin φ / φ of the rotation vector with these two components."""
    angle = np.sqrt(first * first + second * second) + TINY
    cosine, sine = cos_sin(angle)
    return cosine, sine / angle


def rotated(vector: Sequence[Cases], tilt: tuple[Cases, Cases]) -> Triple:
    """``vector`` turned by the rotation vector (``tilt``, 0)."""
    if all(map(_nothing, tilt)):
        x, y, z = vector
        return x, y, z
    first, second = tilt
    cosine, ratio = _tilt(first, second)
    # Rodrigues: v cos φ + (u × v) sin φ + u (u·v)(1 - cos φ), with u = tilt/φ and (1 - cos φ)/φ² = ratio²/(1 + cos φ)
    along = (first * vector[0] + second * vector[1]) * ratio * ratio / (1.0 + cosine)
    turned = _sum(_scaled(vector, cosine), _scaled(cross((first, second, 0.0), vector), ratio))
    return _sum(turned, (first * along, second * along, 0.0))


def _turned(matrix: Vector, vector: Sequence[Cases]) -> Triple:
    """Matrix times vector, elementwise over cases."""
    rows = []
    for row in matrix.tolist():
        total: Cases = 0.0
        for entry, part in zip(row, vector, strict=True):
            total = plus(total, part if entry == 1.0 else times(entry, part))
        rows.append(total)
    return rows[0], rows[1], rows[2]
