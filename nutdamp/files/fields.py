"""Kinds of values of a file: each reads a value of the tree and has its JSON Schema.

A file is declared as a `section`, a mapping of keys to kinds: quantities with units and bounds,
texts, choices, lists, names, further sections. `Values` walks the tree by that declaration, once,
and keeps what it reads by path with everything that is wrong.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, NamedTuple

from nutdamp.errors import listed, nearest
from nutdamp.files.yaml import KeyPath, Node
from nutdamp.units import KINDS, parse, pattern, shown

REQUIRED: Any = ...
"""Default of a key that cannot be left out."""


class Finding(NamedTuple):
    """Something wrong at ``path``, which need not exist; ``at_key``: the key and not its value."""

    path: KeyPath
    problem: str
    at_key: bool = False


class Values:
    """Values of the tree at ``root`` that can be read, by their paths, and what is wrong."""

    def __init__(self, root: Node) -> None:
        self.root = root
        self.by_path: dict[KeyPath, Any] = {}
        self.findings: list[Finding] = []

    def read(self, kind: ValueKind, node: Node, path: KeyPath = ()) -> Any:
        """The meaning of a node of this kind; None, and a finding, where it has none."""
        if node.value is None:
            named = path and isinstance(path[-1], str)
            cure = "give a value, or leave the key out" if named else "expected a value"
            self.findings.append(Finding(path, f"empty; {cure}"))
            return None
        try:
            self.by_path[path] = value = kind.read(node, path, self)
        except ValueError as wrong:
            self.findings.append(Finding(path, str(wrong)))
            return None
        return value


Read = Callable[[Node, KeyPath, Values], Any]
"""The meaning of a node at a path, in SI; ValueError with the problem where it has none. Entries
below it are read, by their own kinds, by `Values.read`.
"""


@dataclass(frozen=True)
class ValueKind:
    """Kind of a value: how it is ``read``, its JSON ``schema``, the kinds of its ``parts``, and the
    ``form`` in which people write it.

    A section has ``keys`` and the ``definition`` to which its schema refers.
    """

    read: Read
    schema: Mapping[str, Any]
    parts: tuple[ValueKind, ...] = ()
    form: str = ""
    keys: Mapping[str, Key] = field(default_factory=dict)
    definition: Mapping[str, Any] = field(default_factory=dict)

    def within(self) -> Iterator[ValueKind]:
        """This kind and all below it, but for those of the keys of a section."""
        yield self
        for part in self.parts:
            yield from part.within()


class Key(NamedTuple):
    """A key of a section: the kind of its value, its description, examples, and default."""

    kind: ValueKind
    description: str
    examples: tuple[Any, ...]
    default: Any = REQUIRED


def required(kind: ValueKind, description: str, *examples: Any) -> Key:
    """A key that must be there."""
    return Key(kind, description, examples)


def optional(kind: ValueKind, description: str, *examples: Any, default: Any = None) -> Key:
    """A key that may be left out."""
    return Key(kind, description, examples, default)


def mismatch(node: Node, expected: str) -> ValueError:
    """The error for a value of another kind."""
    return ValueError(f"expected {expected}, got {shown(node.plain())}")


A_LIST, A_MAPPING = "a list [value, …]", "a mapping {key: value, …}"


def whole(minimum: int, largest: int) -> ValueKind:
    """A whole number, both ends of its range included."""

    def read(node: Node, _: KeyPath, _values: Values) -> int:
        if not isinstance(node.value, int) or isinstance(node.value, bool):
            raise mismatch(node, "a whole number")
        if node.value < minimum:
            raise mismatch(node, f"at least {minimum}")
        if node.value > largest:
            raise mismatch(node, f"at most {largest}")
        return node.value

    schema = {"type": "integer", "minimum": minimum, "maximum": largest}
    return ValueKind(read, schema, form="a whole number")


def flag() -> ValueKind:
    """true or false."""

    def read(node: Node, _: KeyPath, _values: Values) -> bool:
        if not isinstance(node.value, bool):
            raise mismatch(node, "true or false")
        return node.value

    return ValueKind(read, {"type": "boolean"})


def text(longest: int | None = None) -> ValueKind:
    """A text of at most ``longest`` printable characters, at least one of them not a blank; any
    text without that.
    """

    def read(node: Node, _: KeyPath, _values: Values) -> str:
        value = node.value
        if not isinstance(value, str):
            quotes = "" if isinstance(value, dict | list) else "; put it in quotes"
            raise ValueError(f"{mismatch(node, 'a text')}{quotes}")
        if longest is None:
            return value
        if not value:
            raise ValueError("empty; expected an entry")
        if len(value) > longest:
            raise ValueError(f"{len(value)} characters long; expected at most {longest}")
        if not (value.strip() and value.isprintable()):
            raise ValueError(f"{shown(value)} is no name; expected printable characters")
        return value

    lengths = {} if longest is None else {"minLength": 1, "maxLength": longest}
    return ValueKind(read, {"type": "string", **lengths}, form="a text")


def choice(*words: str) -> ValueKind:
    """One of some words."""

    def read(node: Node, _: KeyPath, _values: Values) -> object:
        if node.value in words:
            return node.value
        problem = mismatch(node, listed([f"'{word}'" for word in words], "or"))
        close = nearest(node.value, words) if isinstance(node.value, str) else None
        raise ValueError(f"{problem}; did you mean {shown(close)}?" if close else str(problem))

    values = {"enum": [*words]} if len(words) > 1 else {"const": words[0]}
    return ValueKind(read, {"type": "string", **values}, form=listed(words, "or"))


def row(*parts: ValueKind) -> ValueKind:
    """A list of as many entries as there are kinds, each of its own."""

    def read(node: Node, path: KeyPath, values: Values) -> list[Any]:
        entries = _entries(node, len(parts), len(parts))
        kinds = enumerate(zip(parts, entries, strict=True))
        return [values.read(kind, entry, (*path, place)) for place, (kind, entry) in kinds]

    counts = {"minItems": len(parts), "maxItems": len(parts)}
    schema = {"type": "array", "prefixItems": [part.schema for part in parts], **counts}
    return ValueKind(read, schema, parts)


def rows(part: ValueKind, minimum: int = 0, largest: int | None = None) -> ValueKind:
    """A list of entries of one kind, ``minimum`` to ``largest`` of them."""

    def read(node: Node, path: KeyPath, values: Values) -> list[Any]:
        entries = enumerate(_entries(node, minimum, largest))
        return [values.read(part, entry, (*path, place)) for place, entry in entries]

    counts = {"minItems": minimum, "maxItems": largest}
    bounds = {name: count for name, count in counts.items() if count}
    return ValueKind(read, {"type": "array", "items": part.schema, **bounds}, (part,))


def _entries(node: Node, minimum: int, largest: int | None) -> list[Node]:
    """The entries of a list of ``minimum`` to ``largest``; raises ValueError for another value."""
    entries = node.value
    if not isinstance(entries, list):
        raise mismatch(node, A_LIST)
    if not entries and minimum == 1:
        raise ValueError("empty; expected an entry")
    if len(entries) < minimum or len(entries) > (largest or math.inf):
        expected = f"{minimum}" if minimum == largest else f"{minimum} to {largest}"
        expected = f"at least {minimum}" if largest is None else expected
        comma = ""
        for one, other in pairwise(entry.value for entry in entries):
            # a decimal comma makes two entries of one: [0,5 deg, 1 deg]
            if type(one) is int and isinstance(other, str) and other[:1].isdigit():
                comma = f"; '{one},{other}' has a decimal comma; write {one}.{other}"
                break
        raise ValueError(f"expected {expected} entries, got {len(entries)}{comma}")
    return entries


def named(part: ValueKind, minimum: int = 0) -> ValueKind:
    """A mapping of names to values of one kind, ``minimum`` of them or more."""

    def read(node: Node, path: KeyPath, values: Values) -> dict[str, Any]:
        if not isinstance(node.value, dict):
            raise mismatch(node, A_MAPPING)
        if len(node.value) < minimum:
            raise ValueError("empty; expected an entry")
        entries = {}
        for name, entry in node.value.items():
            values.read(NAME, Node(name, entry.place), (*path, name))
            entries[name] = values.read(part, entry, (*path, name))
        return entries

    schema = {"type": "object", "additionalProperties": part.schema}
    return ValueKind(read, schema | ({"minProperties": minimum} if minimum else {}), (part,))


def either(several: ValueKind, section: ValueKind) -> ValueKind:
    """A list in one form, or a mapping in another."""

    def read(node: Node, path: KeyPath, values: Values) -> Any:
        if not isinstance(node.value, list | dict):
            raise mismatch(node, f"{A_LIST} or {A_MAPPING}")
        meant = several if isinstance(node.value, list) else section
        return meant.read(node, path, values)

    schema = {"oneOf": [several.schema, section.schema]}
    return ValueKind(read, schema, (several, section))


def section(
    title: str, about: str, keys: Mapping[str, Key], extra: Mapping[str, Any] | None = None
) -> ValueKind:
    """A mapping with the ``keys`` declared and no others, read as a namespace with the defaults of
    those left out; ``extra`` are further keywords of its JSON Schema.
    """

    def read(node: Node, path: KeyPath, values: Values) -> SimpleNamespace:
        if not isinstance(node.value, dict):
            raise mismatch(node, A_MAPPING)
        for unknown in [name for name in node.value if name not in keys]:
            cure = _put_right(node, unknown, keys)
            values.findings.append(Finding((*path, unknown), f"unknown key; {cure}", at_key=True))
        contents = {}
        for name, key in keys.items():
            child = node.value.get(name)
            contents[name] = key.default
            if child is not None:
                value = values.read(key.kind, child, (*path, name))
                contents[name] = key.default if child.value is None else value
            elif key.default is REQUIRED:
                what = key.description.partition(". ")[0].rstrip(".")
                values.findings.append(
                    Finding((*path, name), f"missing; {what[:1].lower()}{what[1:]}")
                )
        return SimpleNamespace(**contents)

    properties = {}
    for name, key in keys.items():
        texts = {"description": key.description, "examples": [*key.examples]}
        default = {} if key.default in (None, REQUIRED) else {"default": key.default}
        properties[name] = {**key.kind.schema, **texts, **default}
    needed = [name for name, key in keys.items() if key.default is REQUIRED]
    definition = {
        **{"type": "object", "title": title, "description": about},
        **{"properties": properties, "additionalProperties": False, **(extra or {})},
        **({"required": needed} if needed else {}),
    }
    reference = {"$ref": f"#/$defs/{title}"}
    return ValueKind(read, reference, keys=keys, definition=definition)


def definitions(kind: ValueKind) -> dict[str, Any]:
    """Definitions of the sections below one, by their titles; those that others refer to first."""
    below: dict[str, Any] = {}
    for key in kind.keys.values():
        for part in key.kind.within():
            if "$ref" in part.schema:
                below |= {**definitions(part), part.definition["title"]: part.definition}
    return below


def _put_right(node: Node, key: str, keys: Mapping[str, Key]) -> str:
    """The cure of an unknown key; the value of a misspelt one gets its place, to be checked too."""
    assert isinstance(node.value, dict)
    dropped = node.value.pop(key)
    beside = bool(node.keys[key].setting)
    meant = nearest(key, [name for name in keys if beside or name not in node.value])
    if meant:
        if meant not in node.value:
            node.value[meant], node.keys[meant] = dropped, node.keys[key]
        return f"did you mean {shown(meant)}?"
    if "tensor" in keys and MOMENT.fullmatch(key):
        return "write tensor: [[Ixx, Ixy, Ixz], [Ixy, Iyy, Iyz], [Ixz, Iyz, Izz]], or A and C"
    if key == "<<":
        return "merge keys are of YAML 1.1; write the keys out"
    if ":" in key:
        return "put a space behind the colon"
    if key[:1].isdigit():
        return "decimals take a point, not a comma"
    return f"known here: {', '.join(keys)}"


# keys for parts of a tensor
MOMENT = re.compile(r"[IJ]_?([xyz]{1,2}|[123]{1,2})", re.IGNORECASE)

# smaller values that must be above zero count as zero, in SI: a division by them could overflow
SMALLEST = 1e-15

_BOUNDS = {
    "minimum": (operator.ge, "of at least"),
    "exclusiveMinimum": (operator.gt, "above"),
    "maximum": (operator.le, "of at most"),
    "exclusiveMaximum": (operator.lt, "below"),
}
RIGHT_ANGLE = parse("90 deg", "angle")


def quantity(kind: str, **bounds: float) -> ValueKind:
    """A quantity of a ``kind`` of `units.KINDS`; the bounds are keywords of JSON Schema, in SI."""
    angle = kind == "angle"
    words = (
        f"{_BOUNDS[name][1]} "
        + (f"{limit / RIGHT_ANGLE * 90:g} deg" if angle and limit else f"{limit:g}")
        for name, limit in bounds.items()
    )
    expected = f"expected {KINDS[kind].noun} {' and '.join(words)}"

    def allows(result: float) -> bool:
        return all(_BOUNDS[name][0](result, limit) for name, limit in bounds.items())

    def read(node: Node, _: KeyPath, _values: Values) -> float:
        value = node.plain()
        result = parse(value, kind)
        if not allows(result):
            # An angle without unit in range in degrees, or a share in %.
            unit = {"angle": "deg", "ratio": "%"}.get(kind, "")
            hint = ""
            if unit and not isinstance(value, str) and allows(parse(f"{value} {unit}", kind)):
                hint = f"; write {value} {unit} if that is meant"
                hint = f" (read as radians; write {value} deg)" if angle else hint
            raise ValueError(f"{shown(value)} is out of range; {expected}{hint}")
        if result < bounds.get("exclusiveMinimum", -math.inf) + SMALLEST:
            raise ValueError(
                f"{shown(value)} is too small to be real; {expected}, in SI at least {SMALLEST:g}"
            )
        return result

    number = {"type": "number", **bounds}
    if not KINDS[kind].factors:
        return ValueKind(read, number, form="plain numbers, without unit")
    return ValueKind(read, {"anyOf": [number, unit_text(kind)]}, form=unit_form(kind))


def unit_text(kind: str) -> dict[str, Any]:
    """JSON Schema of a text with a unit."""
    return {"type": "string", "pattern": pattern(kind)}


def unit_form(*kinds: str) -> str:
    """``unit s, ms or min``."""
    units = dict.fromkeys(unit for kind in kinds for unit in KINDS[kind].factors)
    return f"unit {listed([*units], 'or')}"


LONGEST_NAME = 80  # characters: a line of a screen
NAME = text(LONGEST_NAME)
