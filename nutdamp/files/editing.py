"""Values replaced in the YAML text of a spacecraft file, and the file that a fit of telemetry leads to.

Comments, the order of the keys and units stay as they were. The text must have been read by `yaml.read_tree`, and so is
neither a bomb nor of other than core values. A fitted file holds the estimates, their standard deviations, and the
motion at an epoch.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import yaml

from nutdamp.common.time import Epoch
from nutdamp.errors import BadRequest
from nutdamp.estimation.fit import Fit
from nutdamp.estimation.parameters import ACCELERATION
from nutdamp.estimation.results import DIGITS, LATE, LEAST_THRUST, Carried, correlations, replaced
from nutdamp.files.fields import KeyPath
from nutdamp.files.overrides import Setting
from nutdamp.files.reader import Source
from nutdamp.files.yaml import Node, dotted, read_tree
from nutdamp.physics import attitude
from nutdamp.physics import body as rigid_body
from nutdamp.physics.thruster import Trapezoid
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.tolerances import Tolerance
from nutdamp.units import parse


class TextChange(NamedTuple):
    """Text to be written over ``start`` to ``end`` of another."""

    start: int
    end: int
    text: str


def edited(text: str, values: Mapping[KeyPath, str], renamed: Mapping[str, str] | None = None) -> str:
    """The text with ``values``, each a flow value by its path, and keys of the first level ``renamed``.

    A key that is not there is added, at the end of the mapping it belongs to, which must be there but for the first
    level. Raises BadRequest for an alias, and for what has one: a change would show in the other place too.
    """
    for path, value in values.items():
        text = _with(text, path, value)
    for old, new in (renamed or {}).items():
        key, _ = _find(_root(text), (old,))
        if key is not None:
            text = _applied(text, [TextChange(key.start_mark.index, key.end_mark.index, new)])
    return text


def _with(text: str, path: KeyPath, value: str) -> str:
    root = _root(text)
    for length in range(1, len(path) + 1):
        key, node = _find(root, path[:length])
        if key is not None and node is not None and node.start_mark.index < key.end_mark.index:
            raise BadRequest(f"{dotted(path[:length])} is an alias: write its value out, for it to be changed")
        anchor = None if node is None or not length else re.match(r"&(\S+)", text[node.start_mark.index :])
        if anchor and f"*{anchor[1]}" in text:
            raise BadRequest(
                f"{dotted(path[:length])} has the alias *{anchor[1]}: write that out, for it to be changed"
            )
    for length in range(len(path), 0, -1):
        _, node = _find(root, path[:length])
        if node is None:
            continue
        if length == len(path):
            return _applied(text, [TextChange(node.start_mark.index, _end(node), value)])
        return _added(text, node, path[length:], value)
    return _added(text, root, path, value)


def _added(text: str, parent: yaml.Node, path: KeyPath, value: str) -> str:
    """The text with a new key in a mapping; further steps of the path become flow mappings."""
    for step in reversed(path[1:]):
        value = f"{{{_key(step)}: {value}}}"
    entry = f"{_key(path[0])}: {value}"
    if not isinstance(parent, yaml.MappingNode):
        raise BadRequest(f"{dotted(path)}: its parent holds no keys")
    if parent.flow_style:
        last = _end(parent) - 1
        comma = "" if not parent.value or text[:last].rstrip().endswith(",") else ", "
        at = len(text[:last].rstrip()) if comma else last
        return _applied(text, [TextChange(at, at, comma + entry)])
    end = _end(parent)
    line_end = text.find("\n", end)
    at = len(text) if line_end < 0 else line_end
    indent = " " * parent.value[0][0].start_mark.column
    return _applied(text, [TextChange(at, at, f"\n{indent}{entry}")])


def _root(text: str) -> yaml.MappingNode:
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    assert isinstance(root, yaml.MappingNode)
    return root


def _find(root: yaml.Node, path: KeyPath) -> tuple[yaml.Node | None, yaml.Node | None]:
    """The key and the value at a path; None where there is none."""
    key: yaml.Node | None = None
    node: yaml.Node | None = root
    for step in path:
        entry = None
        if isinstance(node, yaml.MappingNode):
            entry = next(((name, value) for name, value in node.value if name.value == step), None)
        elif isinstance(node, yaml.SequenceNode) and isinstance(step, int) and step < len(node.value):
            entry = None, node.value[step]
        key, node = entry or (None, None)
    return key, node


def _end(node: yaml.Node) -> int:
    """End of the text of a value; of a block, that of its last entry."""
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        return _end(last[1] if isinstance(node, yaml.MappingNode) else last)
    if isinstance(node, yaml.ScalarNode) and node.style in ("|", ">"):
        return node.end_mark.index - 1
    return int(node.end_mark.index)


def _key(step: str | int) -> str:
    word = str(step)
    return word if re.fullmatch(r"[A-Za-z_][\w+-]*|[+-][A-Za-z]\w*", word) else "'" + word.replace("'", "''") + "'"


def _applied(text: str, changes: Iterable[TextChange]) -> str:
    for change in sorted(changes, reverse=True):
        text = text[: change.start] + change.text + text[change.end :]
    return text


SEEN = 3.0
"""Standard deviations from which on a growth of the nutation, or a delay, counts as seen."""

UNWRITTEN = {
    "bias": ("bias of {}", "deg/s"),
    "misalignment": ("tilt of the gyros about {}", "deg"),
    "wobble": ("tilt of the axis about {}", "deg"),
}
"""Estimates of sensors that have no key in the file: the bias of a loop is one for both of its gyros."""

Edits = Iterator[tuple[KeyPath, str]]


def fitted_text(text: str, name: str, settings: Sequence[Setting], fit: Fit, carried: Carried) -> str:
    """The text of a spacecraft file, called ``name``, with the estimates; ``settings`` become part of it.

    Raises BadRequest for values that an alias stands for.
    """
    text = text.removeprefix("\ufeff")
    for setting in settings:
        tree = read_tree(text, name)[0]
        value = setting.value if isinstance(setting.value, str) else _flow(setting.node()[0].plain())
        text = edited(text, {_positions(tree, setting.path): value or "null"})
    tree = read_tree(text, name)[0]
    fitted = replaced(fit.model.spacecraft, carried)
    values = dict(_edits(tree, fit, carried, fitted))
    rename = {"state": "omega0"} if ("state",) in values else {}
    return edited(text, values, rename)


def fitted_file(fit: Fit, carried: Carried) -> str:
    """`fitted_text` of the file that the fitted spacecraft was read from; raises BadRequest where there is none."""
    source = fit.model.spacecraft.source
    if not isinstance(source, Source):
        raise BadRequest("fit: expected a spacecraft from nutdamp.load, read or example, with no field replaced")
    return fitted_text(*source, fit, carried)


def fitted_spacecraft(_: object, text: str) -> Spacecraft:
    """Spacecraft of a file with estimates."""
    return Source(text, "fitted").read()


def notes(fit: Fit, carried: Carried) -> Iterator[str]:
    """Sentences on estimates that the file cannot hold, and on entries that still count from the old t = 0."""
    body = fit.model.spacecraft
    growth = fit.index("growth")
    if growth is not None:
        value, sigma = float(fit.values[growth]), float(fit.sigmas[growth])
        if abs(value) > SEEN * sigma and not _grows_so(carried, value):
            way = "grows" if value > 0.0 else "decays"
            yield f"the nutation {way} at {abs(value):.3g} 1/s, which dissipation within a rigid body would not let it"
    for name in (parameter.name for parameter in fit.model.parameters if parameter.name.startswith("delay ")):
        at = fit.index(name)
        assert at is not None
        if abs(fit.values[at]) > SEEN * fit.sigmas[at]:
            channel = name.removeprefix("delay ")
            if channel not in dict(_delays(fit)):
                yield f"the delay of {channel}, {1e3 * fit.values[at]:.4g} ms, is not written: see the key valve"
    yield from _off(fit)
    for name in (parameter.name for parameter in fit.model.parameters if parameter.name.startswith("thrust ")):
        if fit.named[name] <= LEAST_THRUST:
            channel = name.removeprefix("thrust ")
            factor = fit.named[name]
            share = f"{channel} gave {100.0 * factor:.3g} % of its thrust"
            doubt = (
                "did it fire?" if factor > -LEAST_THRUST else "it pushes the other way: another channel, or reversed?"
            )
            yield f"{share}: {doubt} Its force stays as it was"
    limits = body.limits
    if carried.time != 0.0 and (limits.blackout or limits.earliest > 0.0 or limits.horizon is not None):
        yield f"limits (horizon, earliest, blackout) count from the new t = 0, {carried.time:g} s after the old one"
    if body.tank is not None and len(fit.model.record.schedule):
        yield "tank.propellant is that before the pulses of the schedule"


def _edits(tree: Node, fit: Fit, carried: Carried, fitted: Spacecraft) -> Edits:
    yield from _inertia(tree, carried)
    yield from _motion(tree, carried, fitted)
    yield from _attitude(tree, fit, carried)
    yield from _dissipation(tree, fit, carried)
    yield from _goal(tree, fit, carried, fitted)
    yield from _thrusts(tree, carried)
    for channel, late in _delays(fit):
        yield from _valve(tree, channel, late)
    yield from _sensor(tree, fit)
    yield from _dispersions(fit, carried)


def _inertia(tree: Node, carried: Carried) -> Edits:
    moments, axes = carried.body.moments, carried.body.axes
    if tree.get("inertia", "tensor") is None and carried.body.symmetric:
        for key, value in (("A", moments[0]), ("C", moments[2])):
            yield ("inertia", key), _as_before(tree.get("inertia", key), value, "inertia", "kg m^2")
        return
    tensor = axes @ np.diag(moments) @ axes.T
    rows = ", ".join("[" + ", ".join(_number(part) for part in row) + "]" for row in 0.5 * (tensor + tensor.T))
    if tree.get("inertia", "tensor") is None:
        yield ("inertia",), f"{{tensor: [{rows}]}}"
    else:
        yield ("inertia", "tensor"), f"[{rows}]"


def _motion(tree: Node, carried: Carried, fitted: Spacecraft) -> Edits:
    rates = carried.values[2:5]
    if tree.get("state") is not None and fitted.inertia.symmetric and fitted.inertia.aligned:
        omega = complex(rates[0], rates[1])
        inertia = fitted.inertia
        angle = rigid_body.nutation_angle(inertia.A, inertia.C, abs(omega), float(rates[2]))
        phase = math.atan2(omega.imag, omega.real)
        for key, value, kind, unit in (
            ("spin", float(rates[2]), "rate", "rad/s"),
            ("nutation", angle, "angle", "deg"),
            ("phase", phase, "angle", "deg"),
        ):
            yield ("state", key), _as_before(tree.get("state", key), value, kind, unit)
        return
    if tree.get("state") is not None:
        yield ("state",), "[" + ", ".join(_number(rate) for rate in rates) + "]"
        return
    for index, rate in enumerate(rates):
        yield ("omega0", index), _as_before(tree.get("omega0", index), float(rate), "rate", "rad/s")


def _attitude(tree: Node, fit: Fit, carried: Carried) -> Edits:
    if tree.get("attitude") is None:
        return
    yield ("attitude", "quaternion"), "[" + ", ".join(_number(part) for part in carried.quaternion) + "]"
    given = fit.model.spacecraft.attitude
    if given is not None and given.epoch is not None and carried.time != 0.0:
        zone = "Z" if tree.get("attitude", "epoch") is not None else ""
        yield ("attitude", "epoch"), f"{Epoch.parse(given.epoch).plus(carried.time).text}{zone}"


def _grows_so(carried: Carried, growth: float) -> bool:
    """True where dissipation lets the nutation of such a body grow (or decay) at this rate."""
    first, second, third = carried.body.moments
    return (0.5 * (first + second) - third) * growth > 0.0


def _dissipation(tree: Node, fit: Fit, carried: Carried) -> Edits:
    index = fit.index("growth")
    if index is None:
        return
    value, sigma = float(fit.values[index]), float(fit.sigmas[index])
    given = tree.get("dissipation", "time_constant")
    if abs(value) > SEEN * sigma:
        yield ("dissipation", "time_constant"), _as_before(given, 1.0 / abs(value), "time", "s")
        if tree.get("dissipation", "nutation") is not None or not _grows_so(carried, value):
            yield ("dissipation", "nutation"), "grows" if value > 0.0 else "decays"


def _goal(tree: Node, fit: Fit, carried: Carried, fitted: Spacecraft) -> Edits:
    """Tilt and azimuth count from the motion at t = 0, which is another one now."""
    target = fit.model.spacecraft.goal.axis
    if target is None or tree.get("goal", "tilt") is None:
        return
    in_body = attitude.rotate(attitude.conjugate(carried.state.quaternion), target)
    to_n = replace(fitted, attitude=None).initial.quaternion
    x, y, z = attitude.rotate(to_n, in_body).tolist()
    tilt, azimuth = math.atan2(math.hypot(x, y), z), math.atan2(y, x)
    yield ("goal", "tilt"), _as_before(tree.get("goal", "tilt"), tilt, "angle", "deg")
    yield ("goal", "azimuth"), _as_before(tree.get("goal", "azimuth"), azimuth, "angle", "deg")


def _thrusts(tree: Node, carried: Carried) -> Edits:
    """Force or torque of the thrusters times their factors."""
    factors = carried.factors
    entries = tree.get("thrusters")
    for index, _ in entries.children() if entries is not None else ():
        name = tree.get("thrusters", index, "name")
        if name is None or name.value not in factors:
            continue
        factor = factors[str(name.value)][0]
        force = tree.get("thrusters", index, "force")
        if force is not None:
            value = parse(force.value, "force") * factor
            yield ("thrusters", index, "force"), _as_before(force, value, "force", "N")
            continue
        for axis in range(3):
            part = tree.get("thrusters", index, "torque", axis)
            if part is not None:
                value = parse(part.value, "torque") * factor
                yield ("thrusters", index, "torque", axis), _as_before(part, value, "torque", "N m")


def _dispersions(fit: Fit, carried: Carried) -> Edits:
    sigmas = dict(zip(carried.names, carried.sigmas.tolist(), strict=True))
    values = dict(zip(carried.names, carried.values.tolist(), strict=True))
    for key in ("A", "C"):
        if sigmas[key] > 0.0:
            yield ("dispersions", key), f"{{normal: {100.0 * sigmas[key] / values[key]:.6g} %}}"
    rates = ", ".join(f"{{normal: {math.degrees(sigmas[f'omega0_{axis}']):.6g} deg/s}}" for axis in (1, 2, 3))
    yield ("dispersions", "omega0"), f"[{rates}]"
    factors, given = carried.factors, fit.model.spacecraft.dispersions
    if factors:
        before = {} if given is None else given.thrust
        parts = [f"{_quoted(name)}: {_tolerance(size)}" for name, size in before.items() if name not in factors]
        parts += [
            f"{_quoted(name)}: {{normal: {100.0 * sigma / factor:.6g} %}}" for name, (factor, sigma) in factors.items()
        ]
        yield ("dispersions", "thrust"), "{" + ", ".join(parts) + "}"
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
    entries = tree.get("thrusters")
    for index, entry in entries.children() if entries is not None else ():
        named = entry.get("name")
        if named is None or named.value != name:
            continue
        own = entry.get("valve")
        known = own or tree.get("valve")
        values = {} if known is None else {str(key): str(node.value) for key, node in known.children()}
        for key in ("open_delay", "close_delay"):
            before = None if known is None else known.get(key)
            values[key] = _as_before(
                before, (0.0 if before is None else parse(before.value, "time")) + late, "time", "s"
            )
        if own is None:
            yield (
                ("thrusters", index, "valve"),
                "{" + ", ".join(f"{key}: {value}" for key, value in values.items()) + "}",
            )
        else:
            yield from ((("thrusters", index, "valve", key), values[key]) for key in ("open_delay", "close_delay"))


def _sensor(tree: Node, fit: Fit) -> Edits:
    """The bias of the accelerometer of the loop."""
    at = fit.index("bias_acceleration")
    if at is not None and abs(fit.values[at]) > SEEN * fit.sigmas[at]:
        given = tree.get("loop", "sensor", "bias")
        yield ("loop", "sensor", "bias"), _as_before(given, float(fit.values[at]), "acceleration", "m/s^2")


def _off(fit: Fit) -> Iterator[str]:
    """Sentence on sensor errors that no key of the file holds."""
    seen = []
    for parameter, value, sigma in zip(fit.model.parameters, fit.values, fit.sigmas, strict=True):
        kind, _, which = parameter.name.partition("_")
        if kind in UNWRITTEN and which != ACCELERATION and abs(value) > SEEN * sigma:
            what, unit = UNWRITTEN[kind]
            seen.append(f"{what.format(which)} {math.degrees(value):.3g} {unit}")
    if seen:
        yield f"not written, as the file has no key for it: {', '.join(seen)}"


def _tolerance(tolerance: Tolerance) -> str:
    return f"{{{tolerance.kind}: {100.0 * tolerance.size:.6g} %}}"


def _quoted(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z_+-][\w +-]*", name) else "'" + name.replace("'", "''") + "'"


def _positions(tree: Node, path: KeyPath) -> KeyPath:
    """A path with the entries of lists by their positions instead of their names."""
    positions: list[str | int] = []
    for step in path:
        node = tree.get(*positions)
        if node is not None and isinstance(node.value, list) and isinstance(step, str):
            names = [entry.get("name") for entry in node.value]
            step = next(index for index, name in enumerate(names) if name is not None and name.value == step)
        positions.append(step)
    return tuple(positions)


def _flow(value: object) -> str:
    import json

    return json.dumps(value, ensure_ascii=False)


def _as_before(node: Node | None, value: float, kind: str, unit: str) -> str:
    """A value as text in the unit that the file has for it; of a new key in ``unit``."""
    before = None if node is None else node.value
    if before is not None and not isinstance(before, str):
        return _number(value)
    if isinstance(before, str):
        suffix = re.search(r"[^\d.eE+\s-].*$", before.strip())
        unit = suffix.group() if suffix else unit
    return f"{_number(value / parse(f'1 {unit}', kind))} {unit}"


def _number(value: float) -> str:
    text = f"{value + 0.0:.12g}"
    # Without a point YAML 1.1 readers take 1e-05 for a text.
    return text if "e" not in text or "." in text else text.replace("e", ".0e")
