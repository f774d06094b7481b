"""Values replaced in the YAML text of a spacecraft file: comments, the order of the keys and units stay as they were.

The text must have been read by `yaml.read_tree`, and so is neither a bomb nor of other than core values. `motion_edits`
are the values of a later moment, by which a file is carried on.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import yaml

from nutdamp.common.time import Epoch
from nutdamp.errors import BadRequest
from nutdamp.files.fields import KeyPath
from nutdamp.files.overrides import Setting
from nutdamp.files.yaml import Node, dotted, read_tree
from nutdamp.physics import attitude
from nutdamp.physics import body as rigid_body
from nutdamp.spacecraft.model import Spacecraft, SpinState
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


NOISE = 1e-13
"""Nutation, rad, that is rounding."""

Edits = Iterator[tuple[KeyPath, str]]
"""Values by their paths."""


class Later(NamedTuple):
    """The spacecraft ``before`` of a file, and ``after``: as it is to be at t = 0 from now on.

    ``state`` is the motion of ``after`` in its principal axes and in the frame of ``before``.
    """

    before: Spacecraft
    after: Spacecraft
    state: SpinState

    @property
    def quaternion(self) -> np.ndarray:
        """Attitude of the axes of the file, (4,), scalar first."""
        return attitude.multiply(self.state.quaternion, attitude.from_matrix(self.after.inertia.axes.T))


def motion_edits(tree: Node, later: Later) -> Edits:
    """Moments, motion, attitude, epoch, and the target where it counts from the motion."""
    yield from inertia_edits(tree, later)
    yield from rate_edits(tree, later)
    yield from attitude_edits(tree, later)
    yield from _goal(tree, later)


def inertia_edits(tree: Node, later: Later) -> Edits:
    """Moments of inertia, and the momentum of a wheel."""
    inertia = later.after.inertia
    if inertia.wheel != later.before.inertia.wheel:
        given = tree.get("wheel", "momentum")
        yield ("wheel", "momentum"), as_before(given, inertia.wheel, "momentum", "N m s")
    if tree.get("inertia", "tensor") is None and inertia.symmetric:
        for key, value in (("A", inertia.A), ("C", inertia.C)):
            yield ("inertia", key), as_before(tree.get("inertia", key), value, "inertia", "kg m^2")
        return
    tensor = inertia.axes @ np.diag(inertia.moments) @ inertia.axes.T
    rows = ", ".join("[" + ", ".join(number(part) for part in row) + "]" for row in 0.5 * (tensor + tensor.T))
    if tree.get("inertia", "tensor") is None:
        yield ("inertia",), f"{{tensor: [{rows}]}}"
    else:
        yield ("inertia", "tensor"), f"[{rows}]"


def rate_edits(tree: Node, later: Later) -> Edits:
    """Rates at t = 0, as the file gives them."""
    inertia, state, rates = later.after.inertia, later.state, later.after.rates
    if tree.get("state") is not None and inertia.symmetric and inertia.aligned:
        angle = rigid_body.nutation_angle(inertia.A, inertia.C, abs(state.omega), inertia.equivalent(state.spin))
        phase = math.atan2(state.omega.imag, state.omega.real)
        if angle < NOISE:
            angle = phase = 0.0
        for key, value, kind, unit in (
            ("spin", state.spin, "rate", "rad/s"),
            ("nutation", angle, "angle", "deg"),
            ("phase", phase, "angle", "deg"),
        ):
            yield ("state", key), as_before(tree.get("state", key), value, kind, unit)
        return
    if tree.get("state") is not None:
        yield ("state",), "[" + ", ".join(number(rate) for rate in rates) + "]"
        return
    for index, rate in enumerate(rates):
        yield ("omega0", index), as_before(tree.get("omega0", index), float(rate), "rate", "rad/s")


def epoch_after(epoch: str, time: float) -> str:
    """Epoch in UTC ``time`` s after another."""
    whole, _, part = Epoch.parse(epoch).plus(time).text.partition(".")
    return f"{whole}.{part}".rstrip("0").rstrip(".") + "Z"


def attitude_edits(tree: Node, later: Later) -> Edits:
    """Attitude, epoch and frame; nothing for a body without attitude."""
    given, old = later.after.attitude, later.before.attitude
    if given is None:
        return
    parts = "[" + ", ".join(number(part) for part in later.quaternion) + "]"
    keys = {"quaternion": parts, "epoch": given.epoch, "frame": given.frame}
    if tree.get("attitude", "quaternion") is None:  # none, or another form, which holds a direction alone
        yield ("attitude",), "{" + ", ".join(f"{key}: {value}" for key, value in keys.items() if value) + "}"
        return
    yield ("attitude", "quaternion"), parts
    for key in ("epoch", "frame"):
        value = keys[key]
        if value is not None and (old is None or value != getattr(old, key)):
            yield ("attitude", key), value


def _goal(tree: Node, later: Later) -> Edits:
    """Tilt and azimuth count from the motion at t = 0, which is another one now."""
    target = later.before.goal.axis
    if target is None or tree.get("goal", "tilt") is None:
        return
    in_body = attitude.rotate(attitude.conjugate(later.state.quaternion), target)
    to_n = replace(later.after, attitude=None).initial.quaternion
    x, y, z = attitude.rotate(to_n, in_body).tolist()
    tilt, azimuth = math.atan2(math.hypot(x, y), z), math.atan2(y, x)
    yield ("goal", "tilt"), as_before(tree.get("goal", "tilt"), tilt, "angle", "deg")
    yield ("goal", "azimuth"), as_before(tree.get("goal", "azimuth"), azimuth, "angle", "deg")


def carry_text(text: str, name: str, settings: Sequence[Setting], edits: Callable[[Node], Edits]) -> str:
    """The text of a file called ``name`` with the values of ``edits`` of its tree; ``settings`` become part of it.

    Raises BadRequest for values that an alias stands for.
    """
    text = text.removeprefix("\ufeff")
    for setting in settings:
        tree = read_tree(text, name)[0]
        value = setting.value if isinstance(setting.value, str) else _flow(setting.node()[0].plain())
        text = edited(text, {_positions(tree, setting.path): value or "null"})
    values = dict(edits(read_tree(text, name)[0]))
    rename = {"state": "omega0"} if ("state",) in values else {}
    return edited(text, values, rename)


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


def as_before(node: Node | None, value: float, kind: str, unit: str) -> str:
    """A value as text in the unit that the file has for it; of a new key in ``unit``."""
    before = None if node is None else node.value
    if before is not None and not isinstance(before, str):
        return number(value)
    if isinstance(before, str):
        suffix = re.search(r"[^\d.eE+\s-].*$", before.strip())
        unit = suffix.group() if suffix else unit
    return f"{number(value / parse(f'1 {unit}', kind))} {unit}"


def number(value: float) -> str:
    """A number as text, to 12 digits."""
    text = f"{value + 0.0:.12g}"
    # Without a point YAML 1.1 readers take 1e-05 for a text.
    return text if "e" not in text or "." in text else text.replace("e", ".0e")
