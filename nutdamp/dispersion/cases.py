"""The dispersed cases: what body flies, how it moves at t = 0, and which impulses it really gets.

The schedule is fixed: which channel, commanded start, on-time. A case differs from the estimate in its moments, its
rates, and in what each pulse does. Everything here is elementwise over cases (structure of arrays); a quantity that
nothing disperses stays one number for all of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.dispersion.correlation import Group, groups_of
from nutdamp.dispersion.draws import Draws
from nutdamp.dispersion.elementwise import (
    Cases,
    Triple,
    added,
    cross,
    nothing,
    parts_of,
    plus,
    scaled,
    tilt_axes,
    tilted,
    times,
    turned,
)
from nutdamp.dispersion.fed import supplied, tank_of
from nutdamp.dispersion.inputs import BY_VALVE, Inputs, list_inputs
from nutdamp.lightening import shed
from nutdamp.physics import attitude, feed
from nutdamp.physics.rigid_cases import cos_sin
from nutdamp.schedule import STEERABLE, Pulse, Schedule
from nutdamp.spacecraft import Spacecraft, Thruster, Vector

if TYPE_CHECKING:  # few spacecraft have valves
    from nutdamp.physics.valve import Opened

DISC = 1e-12
"""Rounding allowed, relatively, where moments touch the triangle inequality (flat disc, C = 2A)."""

NOT_NEGATIVE = ("thrust", *BY_VALVE, "cold", "cold_pulses", "inertia_per_kg")
"""Tolerances of what is never below zero: draws that make it so are drawn again."""

ROUNDING = 1e-9
"""A pulse whose impulse differs by less, relatively, from its channel's torque times on-time is that channel's."""


class Thrusting(NamedTuple):
    """What one thruster gives through a valve that is not as the file has it: times from the start of the command."""

    opened: Opened
    torque: Triple


@dataclass(frozen=True, slots=True)
class DispersedCases:
    """Dispersed cases, in principal axes and SI.

    ``moments`` (I1, I2, I3) kg m² and ``omega0`` rad/s at t = 0. Of each pulse: its ``starts`` s and ``widths`` s, of
    the rectangle that it counts as, which begins ``leads`` s after the command, its ``impulses`` N m s, and its
    ``thrust`` where a valve is not as the file has it. ``tilt`` is the rotation vector (rad, about body axes 1 and 2)
    by which the attitude at t = 0 is off; ``spent`` the propellant of each pulse, kg, None where that of one is not
    known; ``drained`` as in `fed.Fed`; ``per_kg`` what each kg takes off the moments, m², None where they stay.
    """

    moments: Triple
    omega0: Triple
    starts: tuple[Cases, ...]
    widths: tuple[Cases, ...]
    leads: tuple[Cases, ...]
    impulses: tuple[Triple, ...]
    thrust: tuple[tuple[Thrusting, ...], ...]
    tilt: tuple[Cases, Cases]
    spent: tuple[Cases, ...] | None
    drained: Cases = 0.0
    per_kg: Triple | None = None

    @property
    def propellant(self) -> Cases | None:
        """All of it, kg; None where it is not known."""
        return None if self.spent is None else sum(self.spent, 0.0)

    @property
    def sheds(self) -> list[tuple[Cases, Cases]] | None:
        """What each pulse takes off A and C, kg m²; None where they stay."""
        if self.per_kg is None or self.spent is None:
            return None
        across, axial = 0.5 * (self.per_kg[0] + self.per_kg[1]), self.per_kg[2]
        return [(kg * across, kg * axial) for kg in self.spent]

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


class _Fired(NamedTuple):
    """What one pulse gives in each case at the thrust of the file, and its ``flow``; see `DispersedCases`."""

    start: Cases
    width: Cases
    lead: Cases
    impulse: Triple
    thrust: tuple[Thrusting, ...]
    flow: Cases


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
    def groups(self) -> tuple[Group, ...]:
        """Inputs that are correlated; raises BadRequest where that cannot be."""
        requested = self.spacecraft.dispersions
        return () if requested is None else groups_of(requested.correlation)

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
            axis = attitude.rotate(attitude.conjugate(body.initial.quaternion), np.asarray(axis))
        return np.asarray(axis / np.linalg.norm(axis), dtype=np.float64)

    def physical(self, draws: Draws) -> NDArray[np.bool_] | bool:
        """Which cases can be: moments of a rigid body, thrust that pushes."""
        moments = self._moments(draws)
        good: Any = _possible(*moments) if "A" in draws or "C" in draws else True
        for entry in self.inputs.drawn:
            if entry.tolerance in NOT_NEGATIVE and entry.name in draws:
                good = good & (entry.nominal + draws[entry.name] >= 0.0)
        tank = tank_of(self.spacecraft, draws)
        if tank is not None and any(name.startswith("tank ") for name in draws):
            good = good & feed.possible(tank)
        per_kg = self._per_kg(draws)
        if tank is not None and per_kg is not None:  # with all of it used there must be a body left
            shed = scaled(per_kg, -1.0 * tank.propellant)
            good = good & _possible(*added(moments, shed))
        return good  # type: ignore[no-any-return]

    def _per_kg(self, draws: Draws) -> Triple | None:
        """What each kg of propellant takes off the moments, m²; None where they stay."""
        per_kg = shed(self.spacecraft)
        return None if per_kg is None else scaled(parts_of(per_kg), plus(1.0, draws.get("inertia_per_kg", 0.0)))

    def cases(self, draws: Draws) -> DispersedCases:
        """The cases of the ``draws`` (deviations by input name)."""
        turn = self.spacecraft.inertia.axes
        omega0 = parts_of(self.spacecraft.omega0)
        off = [draws.get(f"omega0_{axis}", 0.0) for axis in (1, 2, 3)]
        torques = {source: self._torque(source, draws) for source in {one.source for one in self._actuations}}
        fired = [self._fired(n, one, torques[one.source], draws) for n, one in enumerate(self._actuations)]
        levels, spent, drained = supplied(self.spacecraft, self.schedule, draws, [one.flow for one in fired])
        return DispersedCases(
            moments=self._moments(draws),
            omega0=added(omega0, turned(turn.T, off)),
            starts=tuple(one.start for one in fired),
            widths=tuple(one.width for one in fired),
            leads=tuple(one.lead for one in fired),
            impulses=tuple(
                one.impulse if isinstance(level, float) and level == 1.0 else scaled(one.impulse, level)
                for one, level in zip(fired, levels, strict=True)
            ),
            thrust=tuple(
                tuple(Thrusting(each.opened, scaled(each.torque, level)) for each in one.thrust)
                for one, level in zip(fired, levels, strict=True)
            ),
            tilt=(draws.get("attitude x", 0.0), draws.get("attitude y", 0.0)),
            spent=spent,
            drained=drained,
            per_kg=self._per_kg(draws),
        )

    def _fired(self, index: int, one: _Actuation, nominal: tuple[Triple, Cases, Cases], draws: Draws) -> _Fired:
        """What the pulse ``index`` gives; ``nominal`` is the `_torque` of what fires it."""
        opened, width, number = self._opened(one, draws), self.on_times[index], index + 1
        late = plus(draws.get("timing offset", 0.0), draws.get(f"Sun pulse {number}", 0.0))
        shift = plus(late, draws.get(f"timing pulse {number}", 0.0))
        start, lead = one.pulse.start, 0.0
        if one.pulse.command is not None:
            start = one.pulse.command.start
            lead = one.pulse.t - 0.5 * width - start
        longer: dict[str, Cases] = {}
        if opened:
            parts = {name: each.acts for name, each in opened.items()}
            longer = {name: acts / one.pulse.on_time for name, (acts, _, _) in parts.items()}
            centroid, width = (sum(part[at] for part in parts.values()) / len(parts) for at in (1, 2))
            lead = centroid - 0.5 * width
        factor = plus(1.0, draws.get(f"thrust pulse {number}", 0.0))
        torque, mean, flow = nominal if not opened else self._torque(one.source, draws, longer)
        if one.source == STEERABLE and not self._members[STEERABLE]:
            impulse = self._steered(one.pulse.impulse, mean, draws)
        else:
            impulse = added(scaled(torque, one.duration), scaled(one.remainder, mean))
        strength = factor * (one.duration / one.pulse.on_time) if opened else 0.0
        return _Fired(
            start=plus(start if nothing(shift) else _not_before(start + shift), lead),
            width=width,
            lead=lead,
            impulse=impulse if isinstance(factor, float) and factor == 1.0 else scaled(impulse, factor),
            thrust=tuple(self._thrusting(one, name, each, strength, draws) for name, each in opened.items()),
            flow=flow * factor,
        )

    def _moments(self, draws: Draws) -> Triple:
        """A scales both transverse moments, C is the axial one."""
        inertia = self.spacecraft.inertia
        first, second, third = inertia.moments
        transverse = plus(1.0, times(draws.get("A", 0.0), 1.0 / inertia.A))
        wider = first * transverse
        return wider, wider if first == second else second * transverse, plus(third, draws.get("C", 0.0))

    def _actuation(self, pulse: Pulse) -> _Actuation:
        thrusters = self._members.get(pulse.channel)
        source = None if thrusters is None else pulse.channel
        if not thrusters:
            return _Actuation(pulse, source, pulse.on_time, parts_of(pulse.impulse))
        torque = np.sum([thruster.torque for thruster in thrusters], axis=0)
        duration = pulse.on_time or float(np.linalg.norm(pulse.impulse) / np.linalg.norm(torque))
        if pulse.torque is not None and self.spacecraft.thrust_laws:  # weaker where it is cold or the pressure falls
            duration *= float(torque @ pulse.torque) / float(torque @ torque)
        remainder = pulse.impulse - duration * torque
        if np.linalg.norm(remainder) <= ROUNDING * np.linalg.norm(pulse.impulse):
            # What is left is rounding; a single thruster takes it, so that its direction is exactly the schedule's.
            remainder = np.zeros(3)
        return _Actuation(pulse, source, duration, parts_of(remainder))

    def _opened(self, one: _Actuation, draws: Draws) -> dict[str, Opened]:
        """What the valves of a pulse give, by thruster, where any of them is not as the file has it."""
        if one.pulse.command is None or one.source is None or not one.pulse.command.ramps:
            return {}
        from nutdamp.physics.valve import Measured, Trapezoid  # few spacecraft have any

        members, on_time = self._members[one.source], one.pulse.command.on_time
        if not any(f"{key} {thruster.name}" in draws for thruster in members for key in BY_VALVE):
            return {}
        found = {}
        for thruster in members:
            off = [draws.get(f"{key} {thruster.name}", 0.0) for key in BY_VALVE]
            if isinstance(thruster.valve, Trapezoid):
                found[thruster.name] = thruster.valve.opened(on_time, *off[:-1])
            elif isinstance(thruster.valve, Measured):
                found[thruster.name] = thruster.valve.opened(on_time, plus(1.0, off[-1]))
        return found

    def _thrusting(self, one: _Actuation, name: str, opened: Opened, strength: Cases, draws: Draws) -> Thrusting:
        """What a thruster gives whose torque is ``strength`` times that of the file."""
        (thruster,) = (each for each in self._members[one.source or ""] if each.name == name)
        strength = strength * plus(1.0, draws.get(f"thrust {name}", 0.0))
        return Thrusting(opened, scaled(self.thruster_torque(thruster, draws), strength))

    def _torque(
        self, source: str | None, draws: Draws, longer: Mapping[str, Cases] | None = None
    ) -> tuple[Triple, Cases, Cases]:
        """Torque of a channel (N m), the mean thrust factor of its thrusters, and that of their propellant flow."""
        thrusters = self._members.get(source, ()) if source is not None else ()
        if not thrusters:
            factor = 1.0 if source is None else plus(1.0, draws.get(f"thrust {STEERABLE}", 0.0))
            return (0.0, 0.0, 0.0), factor, factor
        torque: Triple = (0.0, 0.0, 0.0)
        factors = [plus(1.0, draws.get(f"thrust {thruster.name}", 0.0)) for thruster in thrusters]
        if longer is not None:
            factors = [one * longer.get(thruster.name, 1.0) for one, thruster in zip(factors, thrusters, strict=True)]
        for thruster, factor in zip(thrusters, factors, strict=True):
            turned = self.thruster_torque(thruster, draws)
            torque = added(torque, turned if isinstance(factor, float) and factor == 1.0 else scaled(turned, factor))
        flows = [thruster.mass_flow or 1.0 for thruster in thrusters]
        flow = sum(weight * factor for weight, factor in zip(flows, factors, strict=True)) / math.fsum(flows)
        return torque, sum(factors) / len(factors), flow

    def thruster_torque(self, thruster: Thruster, draws: Draws) -> Triple:
        """Torque at nominal thrust, with the force tilted and its point of attack moved, N m."""
        tilts = [draws.get(f"direction {thruster.name} {axis}", 0.0) for axis in "ab"]
        moves = [draws.get(f"position {thruster.name} {axis}", 0.0) for axis in "xyz"]
        leans, moved = not all(map(nothing, tilts)), not all(map(nothing, moves))
        torque = parts_of(thruster.torque)
        if thruster.force is None or not (leans or moved):
            return torque
        force = parts_of(thruster.force)
        if leans and thruster.position is not None:
            cosine, sine_ratio = tilted(*tilts)
            leant = [times(tilt, sine_ratio) for tilt in tilts]
            arm = parts_of(thruster.position)
            torque, nominal = scaled(torque, cosine), thruster.force
            force = scaled(force, cosine)
            for axis, lean in zip(tilt_axes(nominal), leant, strict=True):
                more = parts_of(np.cross(axis, nominal))
                torque = added(torque, scaled(cross(arm, more), lean))
                force = added(force, scaled(more, lean))
        if moved:
            torque = added(torque, cross(turned(self.spacecraft.inertia.axes.T, moves), force))
        return torque

    def _steered(self, impulse: Vector, factor: Cases, draws: Draws) -> Triple:
        """Impulse of the steerable torquer, its axis turned in the 1-2 plane."""
        x, y, z = scaled(parts_of(impulse), factor) if not isinstance(factor, float) else parts_of(impulse * factor)
        angle = draws.get(f"direction {STEERABLE}", 0.0)
        if nothing(angle):
            return x, y, z
        cosine, sine = cos_sin(angle)
        return x * cosine - y * sine, x * sine + y * cosine, z


def _possible(first: Cases, second: Cases, third: Cases) -> Any:
    """Which moments a rigid body can have."""
    slack = 1.0 + DISC
    good = (first > 0.0) & (second > 0.0) & (third > 0.0) & (third <= (first + second) * slack)
    return good & (first <= (second + third) * slack) & (second <= (first + third) * slack)


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
