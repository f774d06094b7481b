"""Keys of a spacecraft file that are set beside it, such as ``limits.horizon=300s``: an overlay on its tree.

The tree is changed before anything in it is checked, so that settings are checked exactly as the file is.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from numbers import Integral, Real
from typing import NamedTuple

from nutdamp.errors import BadRequest, Fault, FaultyFile, nearest
from nutdamp.files.fields import KeyPath
from nutdamp.files.yaml import MAX_DEPTH, Node, Place, dotted, read_value
from nutdamp.units import shown

_QUOTED = r"""'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*\""""
_STEP = re.compile(rf"\.?(?P<word>[^.\[\]='\"]+|{_QUOTED})|\[(?P<entry>[0-9]{{1,6}}|[^.\[\]='\"]+|{_QUOTED})\]")
_EXAMPLE = "limits.horizon=300s or thrusters.T1.force=12N"


class Setting(NamedTuple):
    """A key and its new value; ``label`` is its name in messages.

    Entries of a list are named by position or, where they have one, by ``name``. A text as ``value`` is YAML.
    """

    path: KeyPath
    value: object
    label: str

    def node(self) -> tuple[Node, list[Fault]]:
        """The value as part of a tree, and its faults; raises `FaultyFile` for a text that is not YAML."""
        place = Place(setting=self.label)
        if not isinstance(self.value, str):
            return _of_python(self.value, place), []
        if not self.value.strip():
            return Node(None, place), []
        node, faults = read_value(self.value, self.label)
        return _moved(node, place), faults


def parse_setting(text: str) -> Setting:
    """The setting in ``KEY=VALUE``, as command lines give it; raises ValueError with the form expected."""
    path, end = _parse_path(text)
    if not path or text[end : end + 1] != "=":
        raise ValueError(f"{shown(text)} is not KEY=VALUE, such as {_EXAMPLE}")
    value = text[end + 1 :]
    return Setting(path, value, f"--set {dotted(path)}={_brief(value)}")


def settings_of(values: Mapping[str, object]) -> tuple[Setting, ...]:
    """The settings in a mapping of keys, such as ``limits.horizon``, to values; raises BadRequest."""
    settings = []
    for key, value in values.items():
        path, end = _parse_path(key)
        if not path or end < len(key):
            raise BadRequest(f"{shown(key)} is not a key of a spacecraft file, such as limits.horizon")
        settings.append(_labelled("set", path, value))
    return tuple(settings)


def settings_within(values: Mapping[str, object]) -> tuple[Setting, ...]:
    """The settings in nested mappings, such as ``{"limits": {"horizon": "300 s"}}``; raises BadRequest.

    A mapping is replaced key by key, so that those beside them in the file keep their values.
    """
    return tuple(_within(values, ()))


def text_of(values: Mapping[str, object], name: str) -> str:
    """The text of a spacecraft file with these keys and values, one a line; raises BadRequest.

    It is JSON, which unlike other YAML needs no rule for texts that look like numbers.
    """
    plain = _of_python(values, Place(setting=name)).plain()
    return json.dumps(plain, indent=2, ensure_ascii=False) + "\n"


def _within(values: Mapping[str, object], behind: KeyPath) -> Iterator[Setting]:
    if len(behind) >= MAX_DEPTH:
        raise BadRequest(f"with_: nested more than {MAX_DEPTH} levels deep")
    for key, value in values.items():
        if not isinstance(key, str):
            raise BadRequest(f"with_ {dotted(behind)}: expected the name of a key, got {shown(key)}")
        path = (*behind, key)
        if isinstance(value, Mapping):
            yield from _within(value, path)
        else:
            yield _labelled("with_", path, value)


def _labelled(call: str, path: KeyPath, value: object) -> Setting:
    text = value if isinstance(value, str) else shown(value)
    return Setting(path, value, f"{call} {dotted(path)}={_brief(text)}")


def overlay(root: Node, settings: Iterable[Setting]) -> tuple[Node, list[Fault]]:
    """The tree with the settings in it, one after the other, and the faults of impossible settings."""
    faults: list[Fault] = []
    for setting in settings:
        place = Place(setting=setting.label)
        try:
            if len(setting.path) > MAX_DEPTH:
                raise _NoPlaceError(f"nested more than {MAX_DEPTH} levels deep")
            node, problems = setting.node()
            root = _put(root, setting.path, (), node, place)
        except FaultyFile as wrong:
            problems = wrong.faults
        except _NoPlaceError as wrong:
            problems = [place.fault("", "", str(wrong))]
        # Lines and columns within a setting would be taken for those of the file.
        faults += [Fault(setting.label, 0, 0, dotted(setting.path), fault.problem) for fault in problems]
    return root, faults


class _NoPlaceError(Exception):
    """The tree has no place for a setting; the text is the reason."""


def _parse_path(text: str) -> tuple[KeyPath, int]:
    """The steps at the beginning of a text, as `dotted` writes them, and where they end."""
    path: list[str | int] = []
    end = 0
    while match := _STEP.match(text, end):
        if match["word"] and bool(path) != (match[0][0] == "."):
            break
        step = match["word"] or match["entry"]
        if match["entry"] and step.isdecimal():
            path.append(int(step))
        else:
            try:
                path.append(ast.literal_eval(step) if step[0] in "'\"" else step.strip())
            except (SyntaxError, ValueError):  # such as a broken escape
                break
        end = match.end()
    return tuple(path), end


def _brief(text: str) -> str:
    """A value as a message shows it: one short line of printable characters."""
    return text if len(text) <= 40 and text.isprintable() else shown(text)


def _put(node: Node, path: KeyPath, behind: KeyPath, value: Node, place: Place) -> Node:
    """``node``, which is at ``behind``, with ``value`` at ``path`` below it.

    What changes is copied: through aliases a node may be in several places of the tree.
    """
    if not path:
        return value
    step, rest = path[0], path[1:]
    held = {} if node.value is None else node.value
    if isinstance(held, dict):
        if isinstance(step, int):
            raise _NoPlaceError(f"there is no list {_at(behind)}; give all of it, as [value, …]")
        child = _put(held.get(step) or Node(None, place), rest, (*behind, step), value, place)
        keys = node.keys if rest and step in node.keys else {**node.keys, step: place}
        return replace(node, value={**held, step: child}, keys=keys)
    if isinstance(held, list):
        index = _entry(held, step, behind)
        child = _put(held[index], rest, (*behind, index), value, place)
        return replace(node, value=[*held[:index], child, *held[index + 1 :]])
    raise _NoPlaceError(f"there are no keys {_at(behind)}, which holds {shown(node.plain())}")


def _entry(entries: list[Node], step: str | int, behind: KeyPath) -> int:
    """The position in a list that ``step`` means, itself a position or the name of an entry."""
    if isinstance(step, int):
        if step < len(entries):
            return step
        last = len(entries) - 1
        raise _NoPlaceError(f"{dotted(behind)} has " + (f"entries 0 to {last} only" if entries else "no entries"))
    nodes = [entry.get("name") for entry in entries]
    names = [node.value if node is not None else None for node in nodes]
    if step in names:
        return names.index(step)
    known = [name for name in names if isinstance(name, str)]
    if not known:
        raise _NoPlaceError(f"expected a position, such as {dotted((*behind, 0))}: the entries have no names")
    close = nearest(step, known) if isinstance(step, str) else None
    cure = f"did you mean {shown(close)}?" if close else f"there are {', '.join(map(shown, known[:8]))}"
    raise _NoPlaceError(f"no entry of {dotted(behind)} has the name {shown(step)}; {cure}")


def _at(path: KeyPath) -> str:
    return f"at {dotted(path)}" if path else "at the root"


def _moved(node: Node, place: Place) -> Node:
    """``node`` and all below it at ``place``."""
    if isinstance(node.value, dict):
        below = {key: _moved(child, place) for key, child in node.value.items()}
        return Node(below, place, dict.fromkeys(below, place))
    if isinstance(node.value, list):
        return Node([_moved(child, place) for child in node.value], place)
    return Node(node.value, place)


def _of_python(value: object, place: Place, depth: int = 0) -> Node:
    """A Python value as part of a tree; raises BadRequest for a value that a file cannot hold."""
    if depth > MAX_DEPTH:
        raise BadRequest(f"{place}: nested more than {MAX_DEPTH} levels deep")
    if value is None or isinstance(value, str | bool | int | float):
        return Node(value, place)
    if isinstance(value, Integral):
        return Node(int(value), place)
    if isinstance(value, Real):
        return Node(float(value), place)
    if isinstance(value, Mapping):
        below = {str(key): _of_python(child, place, depth + 1) for key, child in value.items()}
        return Node(below, place, dict.fromkeys(below, place))
    if isinstance(value, Iterable):
        return Node([_of_python(child, place, depth + 1) for child in value], place)
    raise BadRequest(f"{place}: expected a number, a text, a list or a mapping, got {type(value).__name__}")
