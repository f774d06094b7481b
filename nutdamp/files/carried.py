"""Spacecraft files that flights and fits of telemetry lead to: the same file, with a later state as
its t = 0.

Attitude, rates, epoch, moments, mass and the propellant and pressure of the tank are as they are
then; a fit adds its estimates and how well they are known. What no key of the file follows is
noted.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from nutdamp.common.results import Note, note
from nutdamp.errors import BadRequest
from nutdamp.estimation.model import Fit
from nutdamp.estimation.parameters import ACCELEROMETER_BIAS, LATENESS, THRUST_FACTOR
from nutdamp.estimation.results import (
    DIGITS,
    LATE,
    LEAST_THRUST,
    WHEEL,
    Carried,
    correlations,
    replaced,
)
from nutdamp.files.editing import (
    Edit,
    Edits,
    Later,
    as_before,
    carry_text,
    epoch_after,
    key_text,
    motion_edits,
    overlay,
)
from nutdamp.files.reader import Source
from nutdamp.files.yaml import KeyPath, Node, Place, read_tree
from nutdamp.flight.propagation import Flight
from nutdamp.physics import attitude
from nutdamp.physics.thruster import Trapezoid
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.model import Spacecraft, disturbing_after
from nutdamp.spacecraft.schedule import touching
from nutdamp.units import parse


def later(flight: Flight, time: float) -> Later:
    """The spacecraft of a ``flight`` at ``time`` s; BadRequest while a pulse is on, or where no
    propellant is left.
    """
    before = flight.spacecraft
    for count, (begins, ends) in enumerate(flight.spans, start=1):
        if begins + touching(time) < time < ends - touching(time):
            raise BadRequest(
                f"pulse {count} is on at {time:.6g} s: expected a time before {begins:.6g} s or "
                "after"
            )
    moment = np.array([time])
    rates, quaternions = flight.motion(moment)
    moments = np.broadcast_to(flight.moments_at(moment), (1, 3))[0].tolist()
    used = float(flight.schedule.used_by(moment)[0])
    inertia, tank, turned = before.inertia, before.tank, before.attitude
    if tank is not None:
        propellant = tank.propellant - tank.used - used
        if propellant <= 0.0:
            raise BadRequest(
                f"no propellant is left in the tank at {time:.6g} s: no file can hold that"
            )
        tank = replace(
            tank, propellant=propellant, pressure=tank.pressure_after(tank.used + used), used=0.0
        )
    if turned is not None:
        of_file = attitude.multiply(quaternions[0], attitude.from_matrix(inertia.axes.T))
        turned = replace(
            turned, quaternion=of_file, epoch=turned.epoch and epoch_after(turned.epoch, time)
        )
    center, per_kg = before.center_of_mass, before.center_of_mass_per_kg
    if per_kg is not None and used != 0.0:
        center = np.asarray(
            (np.zeros(3) if center is None else center) + used * (inertia.axes @ per_kg)
        )
    after = replace(
        before,
        inertia=replace(inertia, moments=tuple(moments)),
        omega0=rates[0],
        attitude=turned,
        center_of_mass=center,
        mass=None if before.mass is None else before.mass - used,
        tank=tank,
        disturbances=disturbing_after(before.disturbances, time),
    )
    return Later(before, after, quaternions[0])


def _expected(source: object, what: str) -> Source:
    if not isinstance(source, Source):
        raise BadRequest(
            f"{what}: expected a spacecraft from nutdamp.load, read or example, "
            "with no field replaced"
        )
    return source


def carried_text(flight: Flight, time: float, source: object) -> str:
    """The text of the file that a ``flight`` was planned from, ``source``, with the state at
    ``time`` s.

    Raises BadRequest as `later` does, for values that an alias stands for, and where no file was
    read.
    """
    origin = _expected(source, "carried")
    of_file = origin.read(lambda _: None)
    moved_on = later(
        replace(flight, spacecraft=replace(flight.spacecraft, goal=of_file.goal)), time
    )
    return carry_text(*origin[:3], lambda tree: _edits(tree, moved_on, time))


def carried_spacecraft(plan: Plan, time: float) -> Spacecraft:
    """Spacecraft of `carried_text` for the flight of a plan; raises as that does."""
    source = _expected(plan.spacecraft.source, "carried")
    text = carried_text(plan._reaching(time), time, source)
    return Source(text, source.name, aimed=source.aimed).read()


def carried_notes(spacecraft: Spacecraft, time: float, source: Source) -> Iterator[Note]:
    """Notes on what in the file still is that of the old t = 0, ``time`` s earlier."""
    if time == 0.0:
        return
    yield from _limits_anew(spacecraft, time)
    if spacecraft.orbit is not None:
        yield note("orbit-as-before", at_s=time)
    sun = overlay(read_tree(source.text, source.name)[0], source.settings)[0].get("sun")
    if sun is not None and sun.value != "epoch":
        yield note("sun-as-before", at_s=time)


def _limits_anew(spacecraft: Spacecraft, time: float) -> Iterator[Note]:
    limits = spacecraft.limits
    if limits.blackout or limits.earliest > 0.0 or limits.horizon is not None:
        yield note("limits-count-anew", at_s=time)


def _edits(tree: Node, moved_on: Later, time: float) -> Edits:
    before, after = moved_on.before, moved_on.after
    same = after.inertia.moments == before.inertia.moments
    yield from (
        edit for edit in motion_edits(tree, moved_on) if not (same and edit.path[0] == "inertia")
    )
    if after.mass is not None and after.mass != before.mass:
        yield Edit(("mass",), after.mass, "mass")
    if after.center_of_mass is not None and before.center_of_mass is not None:
        for axis in np.flatnonzero(after.center_of_mass != before.center_of_mass).tolist():
            yield Edit(("center_of_mass", axis), float(after.center_of_mass[axis]), "length")
    elif after.center_of_mass is not None:
        yield Edit(("center_of_mass",), after.center_of_mass)
    if (
        after.tank is not None
        and before.tank is not None
        and after.tank.propellant != before.tank.propellant
    ):
        yield Edit(("tank", "propellant"), float(after.tank.propellant), "mass")
        yield Edit(("tank", "pressure"), float(after.tank.pressure), "pressure")
    yield from _disturbance_edits(tree, before, time)


def _disturbance_edits(tree: Node, spacecraft: Spacecraft, time: float) -> Edits:
    """Torques turned on by ``time`` s, from and until counted from there, without those that are
    over.
    """
    going = [index for index, each in enumerate(spacecraft.disturbances) if each.end > time]
    if len(going) < len(spacecraft.disturbances):
        nodes = (tree.get("disturbances", index) for index in going)
        entries = [node.plain() for node in nodes if node is not None]
        yield Edit(("disturbances",), json.dumps(entries, ensure_ascii=False))
    shifted = disturbing_after(spacecraft.disturbances, time)
    for place, (index, new) in enumerate(zip(going, shifted, strict=True)):
        edits = list[tuple[KeyPath, float, str]]()
        if new.rate != 0.0:
            torque = np.array([new.transverse.real, new.transverse.imag, new.axial])
            parts = spacecraft.inertia.in_file(torque).tolist()
            count = 2 if spacecraft.inertia.aligned else 3
            edits += [(("torque", axis), parts[axis], "torque") for axis in range(count)]
        edits += [(("from",), new.begin, "time"), (("until",), new.end, "time")]
        for path, value, kind in edits:
            node = tree.get("disturbances", index, *path)
            if node is not None:
                yield Edit(("disturbances", place, *path), as_before(node, value, kind))


SEEN = 3.0  # standard deviations from which on a growth of the nutation, or a delay, counts as seen


def fitted_text(fit: Fit, carried: Carried) -> str:
    """The text of the file that the fitted spacecraft was read from, with the estimates.

    Raises BadRequest for aliases, and where no file was read.
    """
    source = _expected(fit.model.spacecraft.source, "fit")
    return carry_text(*source[:3], lambda tree: _fitted_edits(tree, fit, carried))


def fitted_spacecraft(_: object, text: str) -> Spacecraft:
    """Spacecraft of a file with estimates."""
    return Source(text, "fitted").read()


def notes(fit: Fit, carried: Carried) -> Iterator[Note]:
    """Estimates that the file cannot hold, and entries that still count from the old t = 0."""
    spacecraft = fit.model.spacecraft
    large = _seen(fit)
    growth = large.get("growth")
    if growth is not None and not (carried.body.inertia.wheel or _grows_so(carried, growth)):
        yield note("fit-growth", growth=f"{growth:+.3g} 1/s")
    written = dict(_delays(fit))
    unwritten = []
    for parameter, value in zip(fit.model.parameters, fit.values.tolist(), strict=True):
        kind, which = parameter.kind, parameter.which
        seen = parameter.name in large
        if seen and kind is LATENESS and which not in written:
            yield note("fit-delay-not-written", channel=which, delay_s=value)
        # The bias of a loop is one for both of its gyros.
        if seen and kind.of_sensor and kind is not ACCELEROMETER_BIAS:
            unwritten.append(f"{parameter.label} {kind.factor * value:.3g} {kind.shown}")
        if kind is THRUST_FACTOR and value <= LEAST_THRUST:
            percent = 100.0 * value
            yield note(
                "fit-no-thrust" if value > -LEAST_THRUST else "fit-thrust-reversed",
                channel=which,
                thrust_percent=percent,
            )
    if unwritten:
        yield note("fit-not-written", estimates=", ".join(unwritten))
    if carried.time != 0.0:
        yield from _limits_anew(spacecraft, carried.time)
    if spacecraft.tank is not None and len(fit.model.record.schedule):
        yield note("fit-tank")


def _seen(fit: Fit) -> dict[str, float]:
    """Estimates of more than `SEEN` standard deviations, by the names of parameters."""
    rows = zip(fit.model.parameters, fit.values.tolist(), fit.sigmas.tolist(), strict=True)
    return {parameter.name: value for parameter, value, sigma in rows if abs(value) > SEEN * sigma}


def _fitted_edits(tree: Node, fit: Fit, carried: Carried) -> Edits:
    before = fit.model.spacecraft
    large = _seen(fit)
    after = replaced(before, carried)
    start = before.attitude
    if (
        start is not None
        and start.epoch is not None
        and after.attitude is not None
        and carried.time != 0.0
    ):
        after = replace(
            after, attitude=replace(after.attitude, epoch=epoch_after(start.epoch, carried.time))
        )
    yield from motion_edits(tree, Later(before, after, carried.state.quaternion))
    if (growth := large.get("growth")) is not None:
        yield Edit(("dissipation", "time_constant"), 1.0 / abs(growth), "time")
        if tree.get("dissipation", "nutation") is not None or not _grows_so(carried, growth):
            yield Edit(("dissipation", "nutation"), "grows" if growth > 0.0 else "decays")
    for name, path in _thrusters(tree).items():
        parts = [
            ((*path, "force"), "force"),
            *(((*path, "torque", axis), "torque") for axis in range(3)),
        ]
        for place, kind in parts if name in carried.factors else ():
            part = tree.get(*place)
            if part is not None:
                yield Edit(place, parse(part.value, kind) * carried.factors[name][0], kind)
    for thruster, late in _delays(fit):
        # Delays so much longer; a thruster with the valve of the whole file gets its own.
        path = (*_thrusters(tree)[thruster], "valve")
        own = tree.get(*path)
        valve = own or tree.get("valve") or Node(None, Place())
        values = {str(key): str(node.value) for key, node in valve.children()}
        for key in ("open_delay", "close_delay"):
            old = valve.get(key)
            time = late if old is None else parse(old.value, "time") + late
            values[key] = as_before(old, time, "time")
            if own is not None:
                yield Edit((*path, key), values[key])
        if own is None:
            yield Edit(path, values)
    if (bias := large.get(ACCELEROMETER_BIAS.name)) is not None:
        yield Edit(("loop", "sensor", "bias"), bias, "acceleration")
    yield from _disturbance_edits(tree, before, carried.time)
    sigmas = dict(zip(carried.names, carried.sigmas.tolist(), strict=True))
    estimates = dict(zip(carried.names, carried.values.tolist(), strict=True))
    drawn_alone = tree.get("dispersions", "inertia_tensor") is not None
    for key in () if drawn_alone else ("A", "C"):
        if sigmas.get(key, 0.0) > 0.0:
            percent = 100.0 * sigmas[key] / estimates[key]
            yield Edit(("dispersions", key), {"normal": f"{percent:.6g} %"})
    rates = [math.degrees(sigmas[f"omega0_{axis}"]) for axis in (1, 2, 3)]
    yield Edit(("dispersions", "omega0"), [{"normal": f"{rate:.6g} deg/s"} for rate in rates])
    if WHEEL in sigmas:
        yield Edit(("dispersions", "wheel_momentum"), {"normal": f"{sigmas[WHEEL]:.6g} N m s"})
    factors, tolerances = carried.factors, fit.model.spacecraft.dispersions
    if factors:
        thrust = {} if tolerances is None else tolerances.thrust
        sizes = {
            name: {size.kind: f"{100.0 * size.size:.6g} %"}
            for name, size in thrust.items()
            if name not in factors
        }
        for name, (factor, sigma) in factors.items():
            sizes[name] = {"normal": f"{100.0 * sigma / factor:.6g} %"}
        yield Edit(("dispersions", "thrust"), sizes)
    if carried.tilt is not None:
        tilt = math.degrees(carried.tilt)
        yield Edit(("dispersions", "attitude"), {"normal": f"{tilt:.6g} deg"})
    pairs = [
        [key_text(first), key_text(second), f"{value:.{DIGITS}f}"]
        for first, second, value in correlations(carried, tolerances)
    ]
    if pairs:
        yield Edit(("dispersions", "correlation"), pairs)


def _grows_so(carried: Carried, growth: float) -> bool:
    """True where dissipation lets the nutation of such a body grow (or decay) at this rate; with a
    wheel not known.
    """
    first, second, third = carried.body.inertia.moments
    return not carried.body.inertia.wheel and (0.5 * (first + second) - third) * growth > 0.0


def _thrusters(tree: Node) -> dict[str, KeyPath]:
    entries = tree.get("thrusters") or Node(None, Place())
    nodes = {index: entry.get("name") for index, entry in entries.children()}
    return {
        str(name.value): ("thrusters", index) for index, name in nodes.items() if name is not None
    }


def _delays(fit: Fit) -> Iterator[tuple[str, float]]:
    """Channels whose thrust is later than by the file, s, as far as a valve of their own can have
    such delays.
    """
    large = _seen(fit)
    for channel in fit.model.spacecraft.channels:
        late = large.get(f"delay {channel.name}")
        valve = channel.thrusters[0].valve or Trapezoid()
        if late is None or len(channel.thrusters) > 1 or not isinstance(valve, Trapezoid):
            continue
        if abs(late) <= LATE and min(valve.open_delay, valve.close_delay) + late >= 0.0:
            yield channel.thrusters[0].name, late
