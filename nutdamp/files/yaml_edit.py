"""Values of a YAML text replaced in place, so that its comments and the order of its keys stay.

Works on a text that `yaml_tree.read_tree` has read, and so is neither a bomb nor of other than core values.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import yaml

from nutdamp.errors import BadRequest
from nutdamp.files.sections import KeyPath
from nutdamp.files.yaml_tree import dotted


class Change(NamedTuple):
    """What is written over ``start`` to ``end`` of a text."""

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
            text = _applied(text, [Change(key.start_mark.index, key.end_mark.index, new)])
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
            return _applied(text, [Change(node.start_mark.index, _end(node), value)])
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
        return _applied(text, [Change(at, at, comma + entry)])
    end = _end(parent)
    line_end = text.find("\n", end)
    at = len(text) if line_end < 0 else line_end
    indent = " " * parent.value[0][0].start_mark.column
    return _applied(text, [Change(at, at, f"\n{indent}{entry}")])


def _root(text: str) -> yaml.MappingNode:
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    assert isinstance(root, yaml.MappingNode)
    return root


def _find(root: yaml.Node, path: KeyPath) -> tuple[yaml.Node | None, yaml.Node | None]:
    """The key and the value at a path; None where there is none."""
    key: yaml.Node | None = None
    node: yaml.Node | None = root
    for step in path:
        found = None
        if isinstance(node, yaml.MappingNode):
            found = next(((one, other) for one, other in node.value if one.value == step), None)
        elif isinstance(node, yaml.SequenceNode) and isinstance(step, int) and step < len(node.value):
            found = None, node.value[step]
        key, node = found or (None, None)
    return key, node


def _end(node: yaml.Node) -> int:
    """Where the text of a value ends: of a block, that of its last entry."""
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        return _end(last[1] if isinstance(node, yaml.MappingNode) else last)
    if isinstance(node, yaml.ScalarNode) and node.style in ("|", ">"):
        return node.end_mark.index - 1
    return int(node.end_mark.index)


def _key(step: str | int) -> str:
    word = str(step)
    return word if re.fullmatch(r"[A-Za-z_][\w+-]*|[+-][A-Za-z]\w*", word) else "'" + word.replace("'", "''") + "'"


def _applied(text: str, changes: Iterable[Change]) -> str:
    for change in sorted(changes, reverse=True):
        text = text[: change.start] + change.text + text[change.end :]
    return text
