"""Spacecraft files, YAML or JSON -> `Spacecraft`, in principal axes, SI and radians; all faults at
once.

Faults are those of the spelling of keys, of types and ranges, and the findings of `rules`. The JSON
Schema follows from the same sections. Files to start from ship with the package: the built-in
example, and those of ``configs/``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from functools import cache
from os import PathLike
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from nutdamp import units
from nutdamp.errors import Fault, FaultyFile, in_order, warn
from nutdamp.files.fields import Finding, definition, definitions
from nutdamp.files.keys import SPACECRAFT, dispersions, thrust_behind
from nutdamp.files.rules import (
    CANCELLED,
    Facts,
    Vector,
    correlation_findings,
    doubts,
    findings,
    force_vector,
)
from nutdamp.files.yaml import Node, dotted, read_text, read_tree
from nutdamp.spacecraft.equipment import (
    Channel,
    Commands,
    Loop,
    Sensor,
    Steerable,
    SunSensor,
    Thruster,
)
from nutdamp.spacecraft.model import (
    Attitude,
    Disturbance,
    Goal,
    Inertia,
    Keep,
    Limits,
    Orbit,
    Requirement,
    Spacecraft,
)

if TYPE_CHECKING:
    from nutdamp.files.editing import Setting
    from nutdamp.physics.thruster import Cold, Tank, Valve


Part = TypeVar("Part")

Warn = Callable[[Fault], None]
"""Receiver of each number that is hardly meant."""

BUILT_IN = (
    "example"  # name of the built-in example, planned where no file is named, and written by `init`
)


@cache
def _places() -> dict[str, Path]:
    """Paths of the shipped files by name: an installed package holds ``configs``, a checkout has it
    beside.
    """
    package = Path(__file__).parents[1]
    folders = (package / "data" / "configs", package.parent / "configs")
    shipped = next((sorted(folder.glob("*.yaml")) for folder in folders if folder.is_dir()), [])
    return {path.stem: path for path in (package / "data" / f"{BUILT_IN}.yaml", *shipped)}


def example_names() -> tuple[str, ...]:
    """Names of all files, the built-in example first."""
    return tuple(_places())


def example_text(name: str = BUILT_IN) -> str:
    """The text of the file of that ``name``; KeyError for any other."""
    return _places()[name].read_text(encoding="utf-8")


def example_subject(name: str) -> str:
    """Subject of the file of that ``name``: the comment at its beginning, up to the line that ends
    a sentence.
    """
    sentence = re.split(r"\.$", example_text(name), maxsplit=1, flags=re.MULTILINE)[0]
    return " ".join(line.removeprefix("#").strip() for line in sentence.splitlines())


def _contents(
    text: str,
    name: str,
    settings: Sequence[Setting],
    warn: Warn,
    aimed: bool,
) -> Facts:
    """The values of a file without faults."""
    root, faults = read_tree(text, name)
    if settings:
        from nutdamp.files.editing import overlay  # keys set beside the file

        root, unplaced = overlay(root, settings)
        faults += unplaced
    facts = Facts(root)
    misspelt = [finding for finding in facts.findings if finding.at_key]
    senseless = [finding for finding in facts.findings if not finding.at_key]
    unreadable = {finding.path for finding in senseless}
    broken = (
        finding
        for finding in findings(facts, aimed=aimed)
        if finding.at_key or finding.path not in unreadable
    )
    # this is the order of faults at one place
    ordered = (*misspelt, *broken, *senseless)
    faults += [_placed(finding, root, name) for finding in ordered]
    for doubt in in_order(_placed(finding, root, name) for finding in doubts(facts)):
        warn(doubt)
    if faults:
        raise FaultyFile(faults)
    return facts


def _placed(finding: Finding, root: Node, name: str) -> Fault:
    """The finding with its place; a missing key is reported at the key of its parent."""
    path = finding.path
    missing = not finding.at_key and root.get(*path) is None
    place = root.place_of(path[:-1] if missing else path, key=finding.at_key or missing)
    return place.fault(name, dotted(path), finding.problem)


ALONG = 1e-3  # rad (0.06 deg) from the Sun, up to which the side of the Sun is not told


def load_spacecraft(
    path: str | Path, settings: Sequence[Setting] = (), warn: Warn = lambda _: None
) -> Spacecraft:
    """The spacecraft in a file; raises `CannotRead`, or `FaultyFile` with everything that is wrong
    in it.
    """
    return read_spacecraft(read_text(Path(path)), str(path), settings, warn)


def read_spacecraft(
    text: str,
    name: str,
    settings: Sequence[Setting] = (),
    warn: Warn = lambda _: None,
    *,
    aimed: bool = False,
) -> Spacecraft:
    """The spacecraft in the text of a file ``name``, with ``settings``; ``aimed``: its target is
    given beside them. Raises `FaultyFile` with all faults.
    """
    facts = _contents(text, name, settings, warn, aimed)
    contents, inertia = facts.contents, facts.inertia
    assert inertia is not None
    axes = inertia.axes
    omega0 = _rates(contents, inertia)
    center = np.array(contents.center_of_mass or (0.0, 0.0, 0.0))
    thrusters = {
        entry.name: _thruster(entry, axes, contents.valve, center) for entry in contents.thrusters
    }
    channels = contents.channels or {thruster: [thruster] for thruster in thrusters}
    steerable = _part(Steerable, contents.steerable)
    sunward = _sun(contents)
    if contents.attitude is not None and contents.attitude.sun_phase is not None:
        from nutdamp.physics import frames  # directions in space

        axis = frames.on_sphere(*(contents.attitude.spin_axis or ()))
        if sunward is None or np.linalg.norm(np.cross(axis, sunward)) < ALONG:
            finding = Finding(
                ("attitude", "sun_phase"),
                "the Sun lies along spin_axis, which has no side of the Sun then; give phase",
                True,
            )
            raise FaultyFile([_placed(finding, facts.root, name)])
    cold, tank = _feed(contents)
    torquer = steerable if thrusters else steerable or Steerable()
    required = contents.requirement
    bounds = ("nutation", "momentum_shift", "pointing", "spin")
    asks = any(getattr(required, bound, None) is not None for bound in bounds)
    loss, limits, orbit = contents.dissipation, contents.limits, contents.orbit
    per_kg = contents.center_of_mass_per_kg
    spacecraft = Spacecraft(
        name=contents.name,
        inertia=inertia,
        omega0=omega0,
        mass=contents.mass,
        center_of_mass=None if contents.center_of_mass is None else center,
        center_of_mass_per_kg=axes.T @ np.array(per_kg) if per_kg and any(per_kg) else None,
        attitude=contents.attitude and _attitude(contents.attitude, inertia, omega0, sunward),
        channels=tuple(
            Channel(name, tuple(map(thrusters.__getitem__, members)))
            for name, members in channels.items()
        ),
        steerable=steerable,
        requirement=_part(Requirement, required) if asks else None,
        limits=_part(Limits, limits, blackout=tuple(map(tuple, limits.blackout) if limits else ()))
        or Limits(),
        disturbances=tuple(
            _disturbance(entry, inertia, float(omega0[2])) for entry in contents.disturbances
        ),
        dissipation=None if loss is None else loss.time_constant,
        nutation_grows=None if loss is None or loss.nutation is None else loss.nutation == "grows",
        dispersions=dispersions(contents.dispersions, thrusters.values(), torquer),
        object_id=contents.object_id,
        orbit=orbit
        and Orbit(np.array(orbit.position), np.array(orbit.velocity), orbit.center.upper()),
        cold=cold,
        tank=tank,
        sun=sunward,
        keep=tuple(_cones(contents, sunward)),
        sun_sensor=contents.sun_sensor and _sun_sensor(contents.sun_sensor, axes),
        commands=contents.commands and _commands(contents.commands),
        loop=contents.loop and _loop(contents.loop, axes, center),
        document=contents,
    )
    faults = [_placed(finding, facts.root, name) for finding in correlation_findings(spacecraft)]
    if faults:
        raise FaultyFile(faults)
    return replace(spacecraft, goal=_goal(contents.goal, spacecraft))


class Source(NamedTuple):
    """Origin of a spacecraft: the text of the file, its name in messages, and the keys set beside
    it.

    ``built_in``: the built-in example, since no file was named; ``aimed``: a target is given
    beside it.
    """

    text: str
    name: str
    settings: tuple[Setting, ...] = ()
    built_in: bool = False
    aimed: bool = False

    def read(
        self, doubt: Callable[[Fault], object] = lambda doubt: warn(doubt.as_warning)
    ) -> Spacecraft:
        """The spacecraft; ``doubt`` is called with numbers that are hardly meant. Raises
        FaultyFile.
        """
        doubts: list[Fault] = []
        spacecraft = read_spacecraft(
            self.text, self.name, self.settings, doubts.append, aimed=self.aimed
        )
        object.__setattr__(spacecraft, "built_in", self.built_in)
        for each in doubts:
            doubt(each)
        object.__setattr__(
            spacecraft, "source", self
        )  # not a field, so that `dataclasses.replace` drops it
        return spacecraft

    def changed(self, keys: Mapping[str, object]) -> Spacecraft:
        """See `Spacecraft.with_`."""
        from nutdamp.files.editing import settings_within  # keys set beside the file

        return self._replace(settings=(*self.settings, *settings_within(keys))).read()


def source_of(
    path: str | PathLike[str] | Mapping[str, object], changes: Mapping[str, object] | None = None
) -> Source:
    """Source of a spacecraft in a file, or a dict of its keys, with ``changes``; raises CannotRead
    or BadRequest.
    """
    from nutdamp.files.editing import settings_of, text_of  # keys set beside the file

    if isinstance(path, Mapping):
        return Source(text_of(path, "dict"), "dict", settings_of(units.changes(changes)))
    name = units.path("path", path, "the name of a file or a dict of its keys")
    settings = settings_of(units.changes(changes))
    return Source(read_text(Path(name)), name, settings)


def _part(kind: type[Part], section: Any, **others: object) -> Part | None:
    """The object that a section describes, where given: keys have the names of fields, but for
    ``others``.
    """
    if section is None:
        return None
    named: tuple[Any, ...] = fields(kind)  # type: ignore[arg-type]
    values = {
        field.name: getattr(section, field.name) for field in named if hasattr(section, field.name)
    }
    return kind(**{**values, **others})


def _rates(contents: Any, inertia: Inertia) -> Vector:
    """Body rates at t = 0 in principal axes, rad/s; from a state by tan θ = |(I1ω1, I2ω2)|/|H3|,
    Magnus 1970 (19).

    So θ is the angle between H and the spin axis at t = 0, for any I1 and I2.
    """
    if contents.omega0 is not None:
        return np.asarray(inertia.axes.T @ np.array(contents.omega0))
    state = contents.state
    first, second, _ = inertia.moments
    way = np.array([math.cos(state.phase), math.sin(state.phase)])
    moment = first if first == second else math.hypot(first * way[0], second * way[1])
    size = abs(inertia.axial(state.spin)) / moment * math.tan(state.nutation)
    return np.array([*(size * way), state.spin])


def _thruster(entry: Any, axes: Vector, every: Any, center: Vector) -> Thruster:
    """A thruster in principal axes, about the ``center`` of mass; ``every``: valve of those without
    their own.
    """
    force = position = None
    if entry.torque is not None:
        torque = axes.T @ np.array(entry.torque)
        thrust = thrust_behind(math.hypot(*entry.torque), entry.lever_arm)
    else:
        thrust = entry.force
        arm = np.array(entry.position) - center
        push = force_vector(entry.direction, entry.force)
        torque, force, position = axes.T @ np.cross(arm, push), axes.T @ push, axes.T @ arm
    shortest = entry.min_on_time
    longest = math.inf if entry.max_on_time is None else entry.max_on_time
    if entry.impulse_bit is not None:  # outside its rows nothing is known
        shortest = max(shortest, entry.impulse_bit[0][0])
        longest = min(longest, entry.impulse_bit[-1][0])
    valve = _valve(entry, every, thrust)
    return Thruster(
        entry.name, torque, force, thrust, entry.isp, shortest, longest, position, valve
    )


def _feed(contents: Any) -> tuple[Cold | None, Tank | None]:
    """Cold nozzles, and a tank in blowdown."""
    tank = contents.tank
    if contents.cold is None and tank is None:
        return None, None
    from nutdamp.physics.thruster import Cold, Tank

    cold = _part(Cold, contents.cold)
    if tank is None:
        return cold, None
    rows = tank.inertia_per_kg or ()
    if isinstance(rows, SimpleNamespace):
        rows = (rows.A, rows.A, rows.C)
    isp = tank.isp and tuple(map(tuple, tank.isp))
    return cold, _part(Tank, tank, isp=isp, inertia_per_kg=tuple(rows) if any(rows) else None)


def _valve(entry: Any, every: Any, thrust: float | None) -> Valve | None:
    """The valve of a thruster of ``thrust`` N; None where each command gives full thrust from start
    to end.
    """
    if entry.impulse_bit is None and entry.valve is None and every is None:
        return None
    from nutdamp.physics import thruster  # valves

    if entry.impulse_bit is not None:
        assert thrust is not None
        return thruster.Measured(
            tuple((time, impulse / thrust, mean) for time, impulse, mean in entry.impulse_bit)
        )
    section = entry.valve or every
    times = (section.open_delay, section.close_delay, section.rise_time, section.fall_time)
    return thruster.Trapezoid(*times, section.on_time_is == "effective") if any(times) else None


def _disturbance(entry: Any, inertia: Inertia, spin: float) -> Disturbance:
    """A disturbance in principal axes; one fixed in space turns at minus the ``spin``, rad/s,
    Magnus 1970 (27).
    """
    torque = np.array(entry.torque)
    if not inertia.aligned:
        torque = inertia.axes.T @ torque
        torque[np.abs(torque) <= CANCELLED * math.hypot(*torque)] = 0.0
    rate = 0.0
    if entry.rate is not None:
        rate = entry.rate
    elif entry.kind == "rotating" or entry.fixed_in is not None:
        rate = -spin
    times = getattr(entry, "from") or 0.0, entry.until or math.inf
    across, name = complex(torque[0], torque[1]), entry.name or ""
    return Disturbance(across, float(torque[2]), rate, name, *times)


def _attitude(section: Any, inertia: Inertia, omega0: Vector, sunward: Vector | None) -> Attitude:
    """Attitude of the axes of the file; ``omega0`` (3,) rad/s in principal axes tells spin axis and
    H in the body.
    """
    if section.quaternion is not None:
        turn = np.array(section.quaternion) / math.hypot(*section.quaternion)
        return Attitude(turn, section.epoch, section.frame)
    from nutdamp.physics import frames  # directions in space

    along = np.array([0.0, 0.0, math.copysign(1.0, inertia.axial(float(omega0[2])))])
    if section.of == "momentum":
        along = inertia.momentum(omega0)
    body_axis = inertia.axes @ (along / np.linalg.norm(along))
    axis = frames.on_sphere(*section.spin_axis)
    side = frames.ascending_node(axis)
    phase = section.phase or 0.0
    if section.sun_phase is not None:
        assert sunward is not None
        side = sunward
        phase = section.sun_phase
    quaternion = frames.about_axis(body_axis, np.array([1.0, 0.0, 0.0]), axis, side, phase)
    return Attitude(quaternion, section.epoch, section.frame)


def _goal(section: Any, spacecraft: Spacecraft) -> Goal:
    """The goal of a file; its tilt and azimuth count from the motion at t = 0."""
    if section is None:
        return Goal()
    from nutdamp.physics import frames  # directions in space
    from nutdamp.spacecraft import directions

    axis = None
    if section.tilt is not None:
        axis = directions.direction_in_n(spacecraft, section.tilt, section.azimuth or 0.0)
    elif section.right_ascension is not None:
        axis = frames.on_sphere(section.right_ascension, section.declination)
    elif section.sun_angle is not None:
        axis = directions.at_sun_angle(spacecraft, section.sun_angle)
    return Goal(axis, section.spin, sun_angle=section.sun_angle)


def _sun(contents: Any) -> Vector | None:
    sun: tuple[float, float] | str | None = contents.sun
    if sun is None:
        return None
    from nutdamp.common.time import Epoch  # a Sun
    from nutdamp.physics import frames
    from nutdamp.physics.sky import sun_direction

    if not isinstance(sun, str):
        return frames.on_sphere(*sun)
    days = Epoch.parse(contents.attitude.epoch).days_of_j2000
    return frames.frame_axes(contents.attitude.frame, days).T @ sun_direction(days)


def _cones(contents: Any, sunward: Vector | None) -> Iterator[Keep]:
    """The cones of the file, and that about the angular momentum which bounds the nutation on the
    way.
    """
    for entry in contents.keep:
        from nutdamp.physics import frames  # directions in space

        place: tuple[float, float] | str = entry.direction
        direction = sunward if isinstance(place, str) else frames.on_sphere(*place)
        assert direction is not None
        yield Keep(
            entry.name, direction, entry.min or 0.0, math.pi if entry.max is None else entry.max
        )
    if contents.requirement is not None and contents.requirement.nutation_during is not None:
        yield Keep("H", None, 0.0, contents.requirement.nutation_during)


def _sun_sensor(section: Any, axes: Vector) -> SunSensor | None:
    azimuth = section.azimuth
    if not np.array_equal(axes, np.eye(3)):
        first, second, _ = axes.T @ np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
        azimuth = math.atan2(second, first)
    return _part(SunSensor, section, azimuth=azimuth)


def _commands(section: Any) -> Commands:
    width = section.width
    step = None
    if isinstance(width, list):
        widths = np.unique(width)
    else:
        step = width.step
        widths = width.min + step * np.array(
            [0, math.floor((width.max - width.min) / step * (1.0 + 1e-12))]
        )
    every = tuple(sorted(set(section.every)))
    repeated = section.max_count, every, step, section.per_turn
    return Commands(section.delay_step, section.delay_max, widths, *repeated, section.delay_is)


def _loop(section: Any, axes: Vector, center: Vector) -> Loop | None:
    wanted = section.sensor
    along = np.array([0.0, 0.0, 1.0] if wanted.axis is None else wanted.axis)
    position = axes.T @ (np.array(wanted.position or center) - center)
    about = (np.eye(3) if wanted.axes == "principal" else axes)[:2]
    sensor = _part(
        Sensor, wanted, position=position, axis=axes.T @ (along / math.hypot(*along)), axes=about
    )
    turned = () if section.faults is None else tuple(section.faults.reversed)
    return _part(Loop, section, sensor=sensor, reversed=turned)


def json_schema() -> dict[str, Any]:
    """JSON Schema (2020-12) of the spacecraft file, for editors."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **definition(SPACECRAFT),
        "title": "nutdamp spacecraft file",
        "$defs": definitions(SPACECRAFT),
    }
