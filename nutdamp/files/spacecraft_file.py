"""Spacecraft files: YAML or JSON -> `Spacecraft`, in principal axes, SI and radians."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from nutdamp.epoch import Epoch
from nutdamp.errors import Fault
from nutdamp.files.dispersion_models import dispersions
from nutdamp.files.faults import read_contents
from nutdamp.files.loop_models import LoopSection
from nutdamp.files.models import (
    AttitudeSection,
    DisturbanceSection,
    GoalSection,
    InertiaSection,
    LimitsSection,
    RequirementSection,
    SpacecraftFile,
    ThrusterSection,
)
from nutdamp.files.rules import disturbance_kind, symmetric
from nutdamp.files.sections import Section
from nutdamp.files.settings import Setting
from nutdamp.files.sky_models import CommandsSection, KeepSection, OrbitSection, SunSensorSection
from nutdamp.files.thruster_rules import CANCELLED, force_vector
from nutdamp.files.yaml_tree import read_text
from nutdamp.loop_settings import Loop, Sensor
from nutdamp.physics import attitude, sun
from nutdamp.physics.inertia import principal_axes
from nutdamp.spacecraft import (
    Attitude,
    Channel,
    Cold,
    Commands,
    Disturbance,
    Goal,
    Inertia,
    Keep,
    Limits,
    Orbit,
    Requirement,
    Spacecraft,
    Steerable,
    SunSensor,
    Tank,
    Thruster,
)

if TYPE_CHECKING:
    from nutdamp.files.thrust_models import TankSection, ValveSection
    from nutdamp.physics.valve import Valve

__all__ = ["load_spacecraft", "read_spacecraft"]

Vector = NDArray[np.float64]
Part = TypeVar("Part")

Warn = Callable[[Fault], None]
"""Is given each number that is hardly what was meant."""


GROWS = {"grows": True, "decays": False, None: None}
"""What ``dissipation.nutation`` says."""


def load_spacecraft(path: str | Path, settings: Sequence[Setting] = (), warn: Warn = lambda _: None) -> Spacecraft:
    """The spacecraft in a file; raises `CannotRead`, or `FaultyFile` with everything that is wrong in it."""
    return read_spacecraft(read_text(Path(path)), str(path), settings, warn)


def read_spacecraft(text: str, name: str, settings: Sequence[Setting] = (), warn: Warn = lambda _: None) -> Spacecraft:
    """The spacecraft in the text of a file; ``name`` is that of the file in messages.

    ``settings`` take the place of what the text says. Raises `FaultyFile` with everything that is wrong.
    """
    contents = read_contents(text, name, settings, warn)
    inertia = _inertia(contents.inertia)
    omega0 = _rates(contents, inertia)
    thrusters = {entry.name: _thruster(entry, inertia.axes, contents.valve) for entry in contents.thrusters}
    channels = contents.channels or {thruster: [thruster] for thruster in thrusters}
    steerable = _part(Steerable, contents.steerable)
    torquer = steerable if thrusters else steerable or Steerable()
    spacecraft = Spacecraft(
        name=contents.name,
        inertia=inertia,
        omega0=omega0,
        mass=contents.mass,
        attitude=_attitude(contents.attitude),
        channels=tuple(
            Channel(channel, tuple(thrusters[member] for member in members)) for channel, members in channels.items()
        ),
        steerable=steerable,
        requirement=_requirement(contents.requirement),
        limits=_limits(contents.limits),
        disturbances=tuple(_disturbance(entry, inertia, float(omega0[2])) for entry in contents.disturbances),
        dissipation=None if contents.dissipation is None else contents.dissipation.time_constant,
        nutation_grows=None if contents.dissipation is None else GROWS[contents.dissipation.nutation],
        dispersions=dispersions(contents.dispersions, thrusters.values(), torquer),
        object_id=contents.object_id,
        orbit=_orbit(contents.orbit),
        cold=_part(Cold, contents.cold),
        tank=_tank(contents.tank),
    )
    sunward = _sun(contents)
    return replace(
        spacecraft,
        goal=_goal(contents.goal, spacecraft),
        sun=sunward,
        keep=tuple(_keep(entry, sunward) for entry in contents.keep),
        sun_sensor=_sun_sensor(contents.sun_sensor, inertia.axes),
        commands=_commands(contents.commands),
        loop=_loop(contents.loop, inertia.axes),
    )


def _part(kind: type[Part], section: Section | None, **others: object) -> Part | None:
    """What a section describes, where it is given: keys have the names of fields, but for ``others``."""
    if section is None:
        return None
    named: tuple[Any, ...] = fields(kind)  # type: ignore[arg-type]
    given = {field.name: getattr(section, field.name) for field in named if hasattr(section, field.name)}
    return kind(**{**given, **others})


def _inertia(section: InertiaSection) -> Inertia:
    if section.tensor is not None:
        moments, axes = principal_axes(symmetric(np.array(section.tensor)))
        return Inertia(moments, axes)
    assert section.A is not None
    assert section.C is not None
    return Inertia((section.A, section.A, section.C))


def _rates(contents: SpacecraftFile, inertia: Inertia) -> Vector:
    """Body rates at t = 0 in principal axes, rad/s; from a state by tan θ = |(I1ω1, I2ω2)|/(I3|ω3|), Magnus 1970 (19).

    So θ is the angle between H and the spin axis at t = 0, whatever I1 and I2 are.
    """
    if contents.omega0 is not None:
        rates: Vector = inertia.axes.T @ np.array(contents.omega0)
        return rates
    state = contents.state
    assert state is not None
    first, second, third = inertia.moments
    way = np.array([math.cos(state.phase), math.sin(state.phase)])
    moment = first if first == second else math.hypot(first * way[0], second * way[1])
    return np.array([*(third / moment * abs(state.spin) * math.tan(state.nutation) * way), state.spin])


def _thruster(entry: ThrusterSection, axes: Vector, every: ValveSection | None) -> Thruster:
    """A thruster in principal axes; ``every`` is the valve of those that have none of their own."""
    force: Vector | None = None
    position: Vector | None = None
    if entry.torque is not None:
        torque = np.array(entry.torque)
        thrust = None if entry.lever_arm is None else math.hypot(*entry.torque) / entry.lever_arm
    else:
        assert entry.position is not None
        assert entry.direction is not None
        assert entry.force is not None
        thrust, force = entry.force, force_vector(entry.direction, entry.force)
        position = np.array(entry.position)
        torque = np.cross(position, force)
    valve = _valve(entry, every, thrust)
    least, most = entry.min_on_time, math.inf if entry.max_on_time is None else entry.max_on_time
    if entry.impulse_bit is not None:  # outside its rows nothing is known
        least, most = max(least, entry.impulse_bit[0][0]), min(most, entry.impulse_bit[-1][0])
    return Thruster(
        name=entry.name,
        torque=axes.T @ torque,
        force=None if force is None else axes.T @ force,
        thrust=thrust,
        isp=entry.isp,
        min_on_time=least,
        max_on_time=most,
        position=None if position is None else axes.T @ position,
        valve=valve,
    )


def _tank(section: TankSection | None) -> Tank | None:
    if section is None:
        return None
    isp = None if section.isp is None else tuple((pressure, value) for pressure, value in section.isp)
    shed = section.inertia_per_kg
    per_kg = None
    if shed is not None and any(rows := shed if isinstance(shed, list) else [shed.A, shed.A, shed.C]):
        per_kg = rows[0], rows[1], rows[2]
    return _part(Tank, section, isp=isp, inertia_per_kg=per_kg)


def _valve(entry: ThrusterSection, every: ValveSection | None, thrust: float | None) -> Valve | None:
    """What a thruster of ``thrust`` N makes of commands; None where that is full thrust from start to end."""
    if entry.impulse_bit is None and entry.valve is None and every is None:
        return None
    from nutdamp.physics import valve  # few files have any

    if entry.impulse_bit is not None:
        assert thrust is not None
        return valve.Measured(
            tuple((on_time, impulse / thrust, centroid) for on_time, impulse, centroid in entry.impulse_bit)
        )
    section = entry.valve or every
    assert section is not None
    times = (section.open_delay, section.close_delay, section.rise_time, section.fall_time)
    return valve.Trapezoid(*times, section.on_time_is == "effective") if any(times) else None


def _disturbance(entry: DisturbanceSection, inertia: Inertia, spin: float) -> Disturbance:
    """A disturbance in principal axes; ``spin`` is ω3 at t = 0, rad/s.

    What is fixed in space turns in the body at minus the spin, Magnus 1970 (27). Where the principal axes are
    tilted, a transverse torque has a part about axis 3, which does not turn.
    """
    torque = np.array(entry.torque)
    if not inertia.aligned:
        torque = inertia.axes.T @ torque
        torque[np.abs(torque) <= CANCELLED * math.hypot(*torque)] = 0.0
    rate = 0.0
    if disturbance_kind(entry.kind, entry.rate is not None or entry.fixed_in is not None) == "rotating":
        rate = -spin if entry.rate is None else entry.rate
    return Disturbance(complex(torque[0], torque[1]), float(torque[2]), rate, entry.name or "")


def _attitude(section: AttitudeSection | None) -> Attitude | None:
    if section is None:
        return None
    return _part(Attitude, section, quaternion=np.array(section.quaternion) / math.hypot(*section.quaternion))


def _orbit(section: OrbitSection | None) -> Orbit | None:
    if section is None:
        return None
    return Orbit(np.array(section.position), np.array(section.velocity), section.center.upper())


def _requirement(section: RequirementSection | None) -> Requirement | None:
    """None also for a requirement that names nothing."""
    if section is None or (section.nutation is None and section.momentum_shift is None):
        return None
    return _part(Requirement, section)


def _goal(section: GoalSection | None, spacecraft: Spacecraft) -> Goal:
    """The goal of a file; its tilt and azimuth count from the motion at t = 0."""
    if section is None:
        return Goal()
    if section.tilt is not None:
        return Goal(spacecraft.direction_in_n(section.tilt, section.azimuth or 0.0), section.spin)
    if section.right_ascension is not None and section.declination is not None:
        return Goal(attitude.on_sphere(section.right_ascension, section.declination), section.spin)
    return Goal(spin=section.spin)


def _sun(contents: SpacecraftFile) -> Vector | None:
    """The direction of the Sun: as given, or at t = 0."""
    given: list[float] | str | None = contents.sun
    if not isinstance(given, str):
        return None if given is None else attitude.on_sphere(*given)
    assert contents.attitude is not None
    assert contents.attitude.epoch is not None
    return sun.direction(Epoch.parse(contents.attitude.epoch).days_of_j2000)


def _keep(section: KeepSection, sunward: Vector | None) -> Keep:
    given: list[float] | str = section.direction
    direction = sunward if isinstance(given, str) else attitude.on_sphere(*given)
    assert direction is not None
    return Keep(section.name, direction, section.min or 0.0, math.pi if section.max is None else section.max)


def _sun_sensor(section: SunSensorSection | None, axes: Vector) -> SunSensor | None:
    if section is None:
        return None
    azimuth = section.azimuth
    if not np.array_equal(axes, np.eye(3)):
        first, second, _ = axes.T @ np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
        azimuth = math.atan2(second, first)
    return _part(SunSensor, section, azimuth=azimuth)


def _commands(section: CommandsSection | None) -> Commands | None:
    if section is None:
        return None
    given, step = section.width, None
    if isinstance(given, list):
        widths = np.unique(given)
    else:
        step = given.step
        widths = given.min + step * np.arange(math.floor((given.max - given.min) / step * (1.0 + 1e-12)) + 1)
    every = tuple(sorted(set(section.every)))
    return Commands(section.delay_step, section.delay_max, widths, section.max_count, every, step)


def _loop(section: LoopSection | None, axes: Vector) -> Loop | None:
    if section is None:
        return None
    given = section.sensor
    along = np.array([0.0, 0.0, 1.0] if given.axis is None else given.axis)
    position = axes.T @ np.array(given.position or (0.0, 0.0, 0.0))
    sensor = _part(Sensor, given, position=position, axis=axes.T @ (along / math.hypot(*along)))
    turned = () if section.faults is None else tuple(section.faults.reversed)
    return _part(Loop, section, sensor=sensor, reversed=turned)


def _limits(section: LimitsSection | None) -> Limits:
    windows = () if section is None else tuple((begin, end) for begin, end in section.blackout)
    return _part(Limits, section, blackout=windows) or Limits()
