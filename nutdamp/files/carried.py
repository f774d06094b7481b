"""Spacecraft file carried on: the same file with the state that a flight has at a later time, which is its new t = 0.

Attitude, rates, epoch, moments, mass and the propellant and pressure of the tank are as they are then. What no key of
the file follows is noted.
"""

from __future__ import annotations

import cmath
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from nutdamp.common.results import Note, note
from nutdamp.errors import BadRequest
from nutdamp.files.editing import Edits, Later, as_before, carry_text, epoch_after, motion_edits, number
from nutdamp.files.overrides import overlay
from nutdamp.files.reader import Source
from nutdamp.files.yaml import Node, read_tree
from nutdamp.flight.propagation import Flight
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.model import Spacecraft, SpinState, Vector
from nutdamp.spacecraft.schedule import touching


def later(flight: Flight, time: float) -> Later:
    """The spacecraft of a ``flight`` at ``time`` s, which it must reach.

    Raises BadRequest while a pulse is on, or where no propellant is left in the tank.
    """
    before = flight.spacecraft
    for count, (begins, ends) in enumerate(flight.spans, start=1):
        if begins + touching(time) < time < ends - touching(time):
            raise BadRequest(f"pulse {count} is on at {time:.6g} s: expected a time before {begins:.6g} s or after")
    rates, quaternions = flight.motion(np.array([time]))
    moments = np.broadcast_to(flight.moments_at(np.array([time])), (1, 3))[0]
    first, second, third = rates[0].tolist()
    state, inertia = SpinState(complex(first, second), third, quaternions[0]), before.inertia
    used = float(flight.schedule.used_by(np.array([time]))[0])
    tank = before.tank
    if tank is not None:
        left = tank.propellant - tank.used - used
        if left <= 0.0:
            raise BadRequest(f"no propellant is left in the tank at {time:.6g} s: no file can hold that")
        tank = replace(tank, propellant=left, pressure=tank.pressure_after(tank.used + used), used=0.0)
    changed = None
    if before.attitude is not None:
        epoch = before.attitude.epoch
        changed = replace(before.attitude, epoch=None if epoch is None else epoch_after(epoch, time))
    after = replace(
        before,
        inertia=replace(inertia, moments=(float(moments[0]), float(moments[1]), float(moments[2]))),
        omega0=rates[0],
        attitude=changed,
        center_of_mass=_center(before, used),
        mass=None if before.mass is None else before.mass - used,
        tank=tank,
        disturbances=tuple(
            replace(each, transverse=each.transverse * cmath.exp(1j * each.rate * time)) for each in before.disturbances
        ),
    )
    moved_on = Later(before, after, state)
    if changed is None:
        return moved_on
    return moved_on._replace(after=replace(after, attitude=replace(changed, quaternion=moved_on.quaternion)))


def _center(body: Spacecraft, used: float) -> Vector | None:
    """Center of mass with ``used`` kg of propellant gone, (3,) m in the axes of the file; None where none is given."""
    per_kg = body.center_of_mass_per_kg
    if per_kg is None or used == 0.0:
        return body.center_of_mass
    given = np.zeros(3) if body.center_of_mass is None else body.center_of_mass
    return np.asarray(given + used * (body.inertia.axes @ per_kg))


def carried_text(flight: Flight, time: float, source: object) -> str:
    """The text of the file that a ``flight`` was planned from, ``source``, with the state at ``time`` s.

    Raises BadRequest as `later` does, for values that an alias stands for, and where no file was read.
    """
    if not isinstance(source, Source):
        raise BadRequest("carried: expected a spacecraft from nutdamp.load, read or example, with no field replaced")
    of_file = source.read(lambda _: None)
    moved_on = later(replace(flight, spacecraft=replace(flight.spacecraft, goal=of_file.goal)), time)
    return carry_text(*source, lambda tree: _edits(tree, moved_on))


def carried_spacecraft(plan: Plan, time: float) -> Spacecraft:
    """Spacecraft of `carried_text` for the flight of a plan; raises as that does."""
    source = plan.spacecraft.source
    text = carried_text(plan.reaching(time), time, source)
    return Source(text, source.name if isinstance(source, Source) else "carried").read()


def carried_notes(spacecraft: Spacecraft, time: float, source: Source) -> Iterator[Note]:
    """Notes on what in the file still is that of the old t = 0, ``time`` s earlier."""
    limits = spacecraft.limits
    if time == 0.0:
        return
    if limits.blackout or limits.earliest > 0.0 or limits.horizon is not None:
        yield note("limits-count-anew", at_s=time)
    if spacecraft.orbit is not None:
        yield note("orbit-as-before", at_s=time)
    if spacecraft.sun is not None and _sun_key(source) != "epoch":
        yield note("sun-as-before", at_s=time)


def _sun_key(source: Source) -> object:
    """Value of the key ``sun``."""
    node = overlay(read_tree(source.text, source.name)[0], source.settings)[0].get("sun")
    return None if node is None else node.plain()


def _edits(tree: Node, moved_on: Later) -> Edits:
    before, after = moved_on.before, moved_on.after
    moved = [*motion_edits(tree, moved_on)]
    same = after.inertia.moments == before.inertia.moments
    yield from ((path, text) for path, text in moved if not (same and path[0] == "inertia"))
    if after.mass is not None and after.mass != before.mass:
        yield ("mass",), as_before(tree.get("mass"), after.mass, "mass", "kg")
    if after.center_of_mass is not None and before.center_of_mass is not None:
        for axis in np.flatnonzero(after.center_of_mass != before.center_of_mass).tolist():
            value = float(after.center_of_mass[axis])
            yield ("center_of_mass", axis), as_before(tree.get("center_of_mass", axis), value, "length", "m")
    elif after.center_of_mass is not None:
        yield ("center_of_mass",), "[" + ", ".join(number(part) for part in after.center_of_mass) + "]"
    if after.tank is not None and before.tank is not None and after.tank.propellant != before.tank.propellant:
        for key, kind, unit in (("propellant", "mass", "kg"), ("pressure", "pressure", "Pa")):
            yield ("tank", key), as_before(tree.get("tank", key), float(getattr(after.tank, key)), kind, unit)
    for index, (old, new) in enumerate(zip(before.disturbances, after.disturbances, strict=True)):
        if old.rate == 0.0:
            continue
        torque = before.inertia.in_file(np.array([new.transverse.real, new.transverse.imag, 0.0]))
        for axis in range(2):
            path = ("disturbances", index, "torque", axis)
            yield path, as_before(tree.get(*path), float(torque[axis]), "torque", "N m")
