"""Spacecraft files that flights and fits of telemetry lead to: the same file, with a later state as its t = 0.

Attitude, rates, epoch, moments, mass and the propellant and pressure of the tank are as they are then; a fit adds its
estimates and how well they are known. What no key of the file follows is noted.
"""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from nutdamp.common.results import Note, note
from nutdamp.errors import BadRequest
from nutdamp.estimation.parameters import ACCELERATION
from nutdamp.estimation.results import DIGITS, LATE, LEAST_THRUST, WHEEL, Carried, correlations, replaced
from nutdamp.estimation.search import Fit
from nutdamp.files.editing import (
    Edits,
    Later,
    Setting,
    as_before,
    carry_text,
    epoch_after,
    flow_list,
    motion_edits,
    overlay,
)
from nutdamp.files.fields import KeyPath
from nutdamp.files.reader import Source
from nutdamp.files.yaml import Node, Place, read_tree
from nutdamp.flight.propagation import Flight
from nutdamp.physics.thruster import Trapezoid
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.model import Spacecraft, SpinState
from nutdamp.spacecraft.schedule import touching
from nutdamp.units import parse


def later(flight: Flight, time: float) -> Later:
    """The spacecraft of a ``flight`` at ``time`` s; BadRequest while a pulse is on, or where no propellant is left."""
    before = flight.spacecraft
    for count, (begins, ends) in enumerate(flight.spans, start=1):
        if begins + touching(time) < time < ends - touching(time):
            raise BadRequest(f"pulse {count} is on at {time:.6g} s: expected a time before {begins:.6g} s or after")
    moment = np.array([time])
    rates, quaternions = flight.motion(moment)
    moments = np.broadcast_to(flight.moments_at(moment), (1, 3))[0].tolist()
    state, inertia = SpinState.of(rates[0], quaternions[0]), before.inertia
    used, tank = float(flight.schedule.used_by(moment)[0]), before.tank
    if tank is not None:
        left = tank.propellant - tank.used - used
        if left <= 0.0:
            raise BadRequest(f"no propellant is left in the tank at {time:.6g} s: no file can hold that")
        tank = replace(tank, propellant=left, pressure=tank.pressure_after(tank.used + used), used=0.0)
    changed = before.attitude
    if changed is not None and changed.epoch is not None:
        changed = replace(changed, epoch=epoch_after(changed.epoch, time))
    center, per_kg = before.center_of_mass, before.center_of_mass_per_kg
    if per_kg is not None and used != 0.0:
        center = np.asarray((np.zeros(3) if center is None else center) + used * (inertia.axes @ per_kg))
    after = replace(
        before,
        inertia=replace(inertia, moments=tuple(moments)),
        omega0=rates[0],
        attitude=changed,
        center_of_mass=center,
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
    sun = overlay(read_tree(source.text, source.name)[0], source.settings)[0].get("sun")
    if sun is not None and sun.value != "epoch":
        yield note("sun-as-before", at_s=time)


def _edits(tree: Node, moved_on: Later) -> Edits:
    before, after = moved_on.before, moved_on.after
    same = after.inertia.moments == before.inertia.moments
    yield from (edit for edit in motion_edits(tree, moved_on) if not (same and edit[0][0] == "inertia"))
    if after.mass is not None and after.mass != before.mass:
        yield ("mass",), as_before(tree.get("mass"), after.mass, "mass", "kg")
    if after.center_of_mass is not None and before.center_of_mass is not None:
        for axis in np.flatnonzero(after.center_of_mass != before.center_of_mass).tolist():
            value = float(after.center_of_mass[axis])
            yield ("center_of_mass", axis), as_before(tree.get("center_of_mass", axis), value, "length", "m")
    elif after.center_of_mass is not None:
        yield ("center_of_mass",), flow_list(after.center_of_mass)
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


SEEN = 3.0  # standard deviations from which on a growth of the nutation, or a delay, counts as seen

UNWRITTEN = {
    "bias": ("bias of {}", "deg/s"),
    "misalignment": ("tilt of the gyros about {}", "deg"),
    "wobble": ("tilt of the axis about {}", "deg"),
}
"""Estimates of sensors that have no key in the file: the bias of a loop is one for both of its gyros."""


def fitted_text(text: str, name: str, settings: Sequence[Setting], fit: Fit, carried: Carried) -> str:
    """The text of a spacecraft file ``name`` with ``settings`` and the estimates; raises BadRequest for aliases."""
    return carry_text(text, name, settings, lambda tree: _fitted_edits(tree, fit, carried))


def fitted_file(fit: Fit, carried: Carried) -> str:
    """`fitted_text` of the file that the fitted spacecraft was read from; raises BadRequest where there is none."""
    source = fit.model.spacecraft.source
    if not isinstance(source, Source):
        raise BadRequest("fit: expected a spacecraft from nutdamp.load, read or example, with no field replaced")
    return fitted_text(*source, fit, carried)


def fitted_spacecraft(_: object, text: str) -> Spacecraft:
    """Spacecraft of a file with estimates."""
    return Source(text, "fitted").read()


def notes(fit: Fit, carried: Carried) -> Iterator[Note]:
    """Estimates that the file cannot hold, and entries that still count from the old t = 0."""
    body = fit.model.spacecraft
    growth = fit.index("growth")
    value = 0.0 if growth is None else float(fit.values[growth])
    seen_to_grow = growth is not None and abs(value) > SEEN * fit.sigmas[growth]
    if seen_to_grow and not (carried.body.inertia.wheel or _grows_so(carried, value)):
        yield note("fit-growth", growth=f"{value:+.3g} 1/s")
    fitted = dict(zip((parameter.name for parameter in fit.model.parameters), fit.values.tolist(), strict=True))
    large = np.abs(fit.values) > SEEN * fit.sigmas
    written, seen = dict(_delays(fit)), []
    for name, value in (pair for pair, counts in zip(fitted.items(), large, strict=True) if counts):
        kind, _, channel = name.partition(" ")
        if kind == "delay" and channel not in written:
            yield note("fit-delay-not-written", channel=channel, delay_s=value)
        kind, _, which = name.partition("_")
        if kind in UNWRITTEN and which != ACCELERATION:
            what, unit = UNWRITTEN[kind]
            seen.append(f"{what.format(which)} {math.degrees(value):.3g} {unit}")
    if seen:
        yield note("fit-not-written", estimates=", ".join(seen))
    for name, factor in fitted.items():
        kind, _, channel = name.partition(" ")
        if kind == "thrust" and factor <= LEAST_THRUST:
            silent, given = factor > -LEAST_THRUST, 100.0 * factor
            yield note("fit-no-thrust" if silent else "fit-thrust-reversed", channel=channel, thrust_percent=given)
    limits = body.limits
    if carried.time != 0.0 and (limits.blackout or limits.earliest > 0.0 or limits.horizon is not None):
        yield note("limits-count-anew", at_s=carried.time)
    if body.tank is not None and len(fit.model.record.schedule):
        yield note("fit-tank")


def _fitted_edits(tree: Node, fit: Fit, carried: Carried) -> Edits:
    before = fit.model.spacecraft
    after, given = replaced(before, carried), before.attitude
    if given is not None and given.epoch is not None and after.attitude is not None and carried.time != 0.0:
        after = replace(after, attitude=replace(after.attitude, epoch=epoch_after(given.epoch, carried.time)))
    yield from motion_edits(tree, Later(before, after, carried.state))
    yield from _dissipation(tree, fit, carried)
    yield from _thrusts(tree, carried)
    for channel, late in _delays(fit):
        yield from _valve(tree, channel, late)
    at, path = fit.index("bias_acceleration"), ("loop", "sensor", "bias")
    if at is not None and abs(fit.values[at]) > SEEN * fit.sigmas[at]:
        yield path, as_before(tree.get(*path), float(fit.values[at]), "acceleration", "m/s^2")
    yield from _dispersions(fit, carried)


def _grows_so(carried: Carried, growth: float) -> bool:
    """True where dissipation lets the nutation of such a body grow (or decay) at this rate; with a wheel not known."""
    first, second, third = carried.body.inertia.moments
    return not carried.body.inertia.wheel and (0.5 * (first + second) - third) * growth > 0.0


def _dissipation(tree: Node, fit: Fit, carried: Carried) -> Edits:
    index = fit.index("growth")
    if index is None or abs(value := float(fit.values[index])) <= SEEN * fit.sigmas[index]:
        return
    given = tree.get("dissipation", "time_constant")
    yield ("dissipation", "time_constant"), as_before(given, 1.0 / abs(value), "time", "s")
    if tree.get("dissipation", "nutation") is not None or not _grows_so(carried, value):
        yield ("dissipation", "nutation"), "grows" if value > 0.0 else "decays"


def _thrusts(tree: Node, carried: Carried) -> Edits:
    factors = carried.factors
    for name, path in _thrusters(tree).items():
        parts = [((*path, "force"), "force", "N")]
        parts += [((*path, "torque", axis), "torque", "N m") for axis in range(3)]
        for place, kind, unit in parts if name in factors else ():
            part = tree.get(*place)
            if part is not None:
                yield place, as_before(part, parse(part.value, kind) * factors[name][0], kind, unit)


def _thrusters(tree: Node) -> dict[str, KeyPath]:
    entries = tree.get("thrusters") or Node(None, Place())
    nodes = {index: entry.get("name") for index, entry in entries.children()}
    return {str(name.value): ("thrusters", index) for index, name in nodes.items() if name is not None}


def _dispersions(fit: Fit, carried: Carried) -> Edits:
    sigmas = dict(zip(carried.names, carried.sigmas.tolist(), strict=True))
    values = dict(zip(carried.names, carried.values.tolist(), strict=True))
    for key in ("A", "C"):
        if sigmas[key] > 0.0:
            yield ("dispersions", key), f"{{normal: {100.0 * sigmas[key] / values[key]:.6g} %}}"
    rates = ", ".join(f"{{normal: {math.degrees(sigmas[f'omega0_{axis}']):.6g} deg/s}}" for axis in (1, 2, 3))
    yield ("dispersions", "omega0"), f"[{rates}]"
    if WHEEL in sigmas:
        yield ("dispersions", "wheel_momentum"), f"{{normal: {sigmas[WHEEL]:.6g} N m s}}"
    factors, given = carried.factors, fit.model.spacecraft.dispersions
    if factors:
        before = {} if given is None else given.thrust
        parts = [(name, size.kind, size.size) for name, size in before.items() if name not in factors]
        parts += [(name, "normal", sigma / factor) for name, (factor, sigma) in factors.items()]
        sizes = (f"{_quoted(name)}: {{{kind}: {100.0 * size:.6g} %}}" for name, kind, size in parts)
        yield ("dispersions", "thrust"), "{" + ", ".join(sizes) + "}"
    if carried.tilt is not None:
        yield ("dispersions", "attitude"), f"{{normal: {math.degrees(carried.tilt):.6g} deg}}"
    pairs = correlations(carried, given)
    if pairs:
        rows = ", ".join(f"[{_quoted(first)}, {_quoted(second)}, {value:.{DIGITS}f}]" for first, second, value in pairs)
        yield ("dispersions", "correlation"), f"[{rows}]"


def _delays(fit: Fit) -> Iterator[tuple[str, float]]:
    """Channels whose thrust is later than by the file, s, as far as a valve of their own can have such delays."""
    for channel in fit.model.spacecraft.channels:
        at, known = fit.index(f"delay {channel.name}"), channel.thrusters[0].valve or Trapezoid()
        if at is None or len(channel.thrusters) > 1 or not isinstance(known, Trapezoid):
            continue
        late = float(fit.values[at])
        possible = abs(late) <= LATE and min(known.open_delay, known.close_delay) + late >= 0.0
        if possible and abs(late) > SEEN * fit.sigmas[at]:
            yield channel.thrusters[0].name, late


def _valve(tree: Node, name: str, late: float) -> Edits:
    """The delays of the valve of a thruster, ``late`` s longer; one with the valve of the whole file gets its own."""
    path = (*_thrusters(tree)[name], "valve")
    own = tree.get(*path)
    known = own or tree.get("valve") or Node(None, Place())
    values = {str(key): str(node.value) for key, node in known.children()}
    for key in ("open_delay", "close_delay"):
        before = known.get(key)
        time = late if before is None else parse(before.value, "time") + late
        values[key] = as_before(before, time, "time", "s")
        if own is not None:
            yield (*path, key), values[key]
    if own is None:
        yield path, "{" + ", ".join(f"{key}: {value}" for key, value in values.items()) + "}"


def _quoted(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z_+-][\w +-]*", name) else "'" + name.replace("'", "''") + "'"
