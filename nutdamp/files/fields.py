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
from dataclasses import dataclass, field, replace
from itertools import chain, pairwise, repeat
from types import SimpleNamespace
from typing import Any, NamedTuple

from nutdamp.errors import listed, nearest
from nutdamp.files.yaml import KeyPath, Node, read_value
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

    A section has ``keys`` and a ``title``, by which schemas refer to it; ``extra`` are further
    keywords of its own schema.
    """

    read: Read
    schema: Mapping[str, Any]
    parts: tuple[ValueKind, ...] = ()
    form: str = ""
    keys: Mapping[str, Key] = field(default_factory=dict)
    title: str = ""
    about: str = ""
    extra: Mapping[str, Any] = field(default_factory=dict)

    def within(self) -> Iterator[ValueKind]:
        """This kind and all below it, but for those of the keys of a section."""
        yield self
        for part in self.parts:
            yield from part.within()


class Key(NamedTuple):
    """A key of a section: the kind of its value, its description, examples as a file has them, and
    default.
    """

    kind: ValueKind
    description: str
    examples: tuple[str, ...] = ()
    default: Any = None


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
    counts = {"minItems": len(parts), "maxItems": len(parts)}
    schema = {"type": "array", "prefixItems": [part.schema for part in parts], **counts}
    return _list(parts, schema)


def rows(part: ValueKind, minimum: int = 0, largest: int | None = None) -> ValueKind:
    """A list of entries of one kind, ``minimum`` to ``largest`` of them."""
    counts = {"minItems": minimum, "maxItems": largest}
    bounds = {name: count for name, count in counts.items() if count}
    return _list((part,), {"type": "array", "items": part.schema, **bounds})


def _list(parts: tuple[ValueKind, ...], schema: dict[str, Any]) -> ValueKind:
    """A list of entries of the kinds ``parts``, the last of which repeats, as many as the schema
    says.
    """
    minimum, largest = schema.get("minItems", 0), schema.get("maxItems")

    def read(node: Node, path: KeyPath, values: Values) -> list[Any]:
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
        kinds = chain(parts, repeat(parts[-1]))
        return [
            values.read(kind, entry, (*path, place))
            for place, (kind, entry) in enumerate(zip(kinds, entries, strict=False))
        ]

    return ValueKind(read, schema, parts)


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


def chosen(
    choose: Callable[[Node], ValueKind | None],
    expected: str,
    schema: Mapping[str, Any],
    *parts: ValueKind,
) -> ValueKind:
    """A value of one of several kinds, as its form tells; of None what is ``expected`` is told."""

    def read(node: Node, path: KeyPath, values: Values) -> Any:
        kind = choose(node)
        if kind is None:
            raise mismatch(node, expected)
        return kind.read(node, path, values)

    return ValueKind(read, schema, parts)


def turned(kind: ValueKind, turn: Callable[[Any], Any]) -> ValueKind:
    """A kind that means what ``turn`` makes of the meaning of another."""
    return replace(kind, read=lambda *place: turn(kind.read(*place)))


def either(several: ValueKind, section: ValueKind) -> ValueKind:
    """A list in one form, or a mapping in another."""
    forms: Mapping[type, ValueKind] = {list: several, dict: section}
    schema = {"oneOf": [several.schema, section.schema]}
    expected = f"{A_LIST} or {A_MAPPING}"
    return chosen(lambda node: forms.get(type(node.value)), expected, schema, several, section)


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

    reference = {"$ref": f"#/$defs/{title}"}
    return ValueKind(read, reference, keys=keys, title=title, about=about, extra=extra or {})


def definition(section: ValueKind) -> dict[str, Any]:
    """JSON Schema of a section, to which other schemas refer by its title."""
    properties = {}
    for name, key in section.keys.items():
        examples = [read_value(text, name)[0].plain() for text in key.examples]
        default = {} if key.default in (None, REQUIRED) else {"default": key.default}
        texts = {"description": key.description, "examples": examples}
        properties[name] = {**key.kind.schema, **texts, **default}
    needed = [name for name, key in section.keys.items() if key.default is REQUIRED]
    return {
        **{"type": "object", "title": section.title, "description": section.about},
        **{"properties": properties, "additionalProperties": False, **section.extra},
        **({"required": needed} if needed else {}),
    }


def definitions(kind: ValueKind) -> dict[str, Any]:
    """Definitions of the sections below one, by their titles; those that others refer to first."""
    below: dict[str, Any] = {}
    for key in kind.keys.values():
        for part in key.kind.within():
            if "$ref" in part.schema:
                below |= {**definitions(part), part.title: definition(part)}
    return below


_KEY = re.compile(r"(\w+)(!?)(?: = (.+?))?: (.+), e\.g\. (.+)\n((?: {4}.+\n)+)")
_SIGNS = {">=": "minimum", ">": "exclusiveMinimum", "<=": "maximum", "<": "exclusiveMaximum"}


def sections(
    table: str, others: Mapping[str, ValueKind], extra: Mapping[str, Mapping[str, Any]]
) -> dict[str, ValueKind]:
    """The sections that a table of keys declares, by their names, and the ``others``.

    They are apart by blank lines, each behind those that it refers to: its title, what it is, and
    its keys, as ``key = default: kind, e.g. example or example``; ``key!`` is one that must be
    there. The description of a key stands indented below it. ``extra``: see `section`.
    """
    kinds = dict(others)
    for paragraph in re.sub(r"\n {8}", " ", table).split("\n\n"):
        title, rest = f"{paragraph.strip()}\n".split("\n", maxsplit=1)
        keys = {}
        for key, needed, default, words, examples, description in _KEY.findall(rest):
            kind = named_kind(words, kinds)
            meaning = REQUIRED if needed else None
            if default:
                node = read_value(default, key)[0]
                meaning = kind.read(node, (), Values(node))
            text = " ".join(description.split())
            keys[key] = Key(kind, text, tuple(examples.split(" or ")), meaning)
        about = " ".join(_KEY.split(rest, maxsplit=1)[0].split())
        kinds[title.removesuffix("Section")] = section(title, about, keys, extra.get(title))
    return kinds


def named_kind(words: str, others: Mapping[str, ValueKind]) -> ValueKind:
    """The kind of value that ``words`` in a table of keys name.

    They are a kind of quantity with its bounds (``time > 0``), so many of a kind (``3 of rate``,
    ``list of name``), a list or a section (``times or Width``), words to choose from (``gyro |
    accelerometer``), or one of the ``others``.
    """
    if words in others:
        return others[words]
    if " | " in words:
        return choice(*words.split(" | "))
    if " or " in words:
        return either(*(named_kind(form, others) for form in words.split(" or ")))
    count, _, part = words.partition(" of ")
    if part:
        size = None if count == "list" else int(count)
        return rows(named_kind(part, others), size or 0, size)
    what, *bounds = re.split(" (>=|>|<=|<) ", words)
    limits = (int(limit) if limit.isdigit() else parse(limit, what) for limit in bounds[1::2])
    return quantity(what, **dict(zip(map(_SIGNS.__getitem__, bounds[::2]), limits, strict=True)))


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
