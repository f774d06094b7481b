r"""Sections of a file declared as classes: units, ranges, defaults; read with all faults at once,
and as JSON Schema.

A key is an annotated attribute, ``mass: Mass | None = Field("Mass, kg.", "250 kg")``. Types are
those of YAML and JSON values, lists, tuples and mappings of them, sections, and any of them
`Annotated` with `Rule`\ s. Kinds of values in a spacecraft file follow: quantities with units and
bounds, directions, lists, names, dates, counts.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    ClassVar,
    Literal,
    Self,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from nutdamp.errors import listed, nearest
from nutdamp.units import KINDS, parse, pattern, shown

KeyPath = tuple[str | int, ...]
"""Keys and list positions that lead from the root to a value."""

Problems = list[tuple[KeyPath, str]]
"""Problems and the paths to their values."""

REQUIRED: Any = ...
"""Default of a key that cannot be left out."""


@dataclass(frozen=True, slots=True)
class Key:
    """A key of a section: the ``type`` of its value, its description, and its default."""

    type: Any
    default: Any
    description: str
    examples: list[Any]


def Field(description: str, *examples: Any, default: Any = REQUIRED) -> Any:
    """A key of a `Section`; its type is the annotation,
    and one that may be None is so by default.
    """
    return Key(None, default, description, list(examples))


class Rule:
    """Rule that an annotation adds to a type."""

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        """The meaning of ``value``, which ``inner`` reads by the type. Raises ValueError with the
        problem.
        """
        return inner(value)

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """JSON Schema, where ``inner`` gives that of the type."""
        return inner()


class Length(Rule):
    """Number of entries (characters of a text), both ends included."""

    def __init__(self, least: int, most: int | None = None) -> None:
        self.least, self.most = least, most

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        """The value as the type reads it; raises ValueError for another length."""
        long = isinstance(value, list) and self.most is not None and len(value) > self.most
        entries = (
            value if long else inner(value)
        )  # entries too many are one fault, whatever they are
        if entries is None:  # not of the type
            return None
        if len(entries) < self.least == 1:
            raise ValueError("empty; expected an entry")
        if isinstance(entries, str) and self.most is not None and len(entries) > self.most:
            raise ValueError(f"{len(entries)} characters long; expected at most {self.most}")
        if long or len(entries) < self.least:
            count = f"{self.least} to {self.most}" if self.most != self.least else f"{self.least}"
            count = f"at least {self.least}" if self.most is None else count
            comma = decimal_comma(value) if long else ""
            raise ValueError(f"expected {count} entries, got {len(entries)}{comma}")
        return entries

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Schema with the keywords of the length."""
        keywords = inner()
        of = {"array": "Items", "object": "Properties", "string": "Length"}[keywords["type"]]
        return {
            **keywords,
            f"min{of}": self.least,
            **({} if self.most is None else {f"max{of}": self.most}),
        }


def decimal_comma(entries: list[Any]) -> str:
    """Words for a list with too many entries, a number of which is parted by a decimal comma:
    [0,5 deg, 1 deg].
    """
    for whole, rest in pairwise(entries):
        if type(whole) is int and isinstance(rest, str) and rest[:1].isdigit():
            return f"; '{whole},{rest}' has a decimal comma; write {whole}.{rest}"
    return ""


class Within(Rule):
    """The range of a whole number, both ends included."""

    def __init__(self, least: int, most: int) -> None:
        self.least, self.most = least, most

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        """The number; raises ValueError where it is out of range."""
        number = inner(value)
        if number is not None and not self.least <= number <= self.most:
            expected = f"at least {self.least}" if number < self.least else f"at most {self.most}"
            raise ValueError(_mismatch(value, expected))
        return number

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Schema with the range."""
        return {**inner(), "minimum": self.least, "maximum": self.most}


class Section:
    """A mapping of the file: no key that is not named here."""

    written: ClassVar[str] = "a mapping {key: value, …}"
    """Form of the section, for messages."""

    schema_extra: ClassVar[dict[str, Any]] = {}
    """Further keywords of its JSON Schema."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        vars(self).update(values)

    @classmethod
    @cache
    def fields(cls) -> dict[str, Key]:
        """Its keys, by name; a word of Python has a line behind it in the class."""
        types = get_type_hints(cls, include_extras=True)
        keys = {}
        for name in types:
            key = getattr(cls, name, None)
            if isinstance(key, Key):
                optional = key.default is REQUIRED and NoneType in get_args(types[name])
                keys[name.removesuffix("_")] = replace(
                    key, type=types[name], default=None if optional else key.default
                )
        return keys

    @classmethod
    def read(cls, value: Any, problems: Problems, path: KeyPath = ()) -> Self | None:
        """The section in ``value``; ``problems`` get its own, but for unknown keys and empty
        values.
        """
        if not isinstance(value, dict):
            problems.append((path, _mismatch(value, cls.written)))
            return None
        values = {}
        for name, key in cls.fields().items():
            if value.get(name) is not None:
                values[name] = _read(key.type, value[name], problems, (*path, name))
            else:
                values[name] = key.default
                if key.default is REQUIRED and name not in value:
                    what = key.description.partition(". ")[0].rstrip(".")
                    problems.append(((*path, name), f"missing; {what[:1].lower()}{what[1:]}"))
        return cls(values)


def section_of(annotation: Any) -> type[Section] | None:
    """The section within a type, such as that of a list's entries."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return annotation
    return next(filter(None, map(section_of, get_args(annotation))), None)


_WORDS = {str: "a text", int: "a whole number", bool: "true or false", list: "a list [value, …]"}
_WORDS |= {tuple: _WORDS[list], dict: "a mapping {key: value, …}"}


def _mismatch(value: Any, expected: str) -> str:
    return f"expected {expected}, got {shown(value)}"


def _read(annotation: Any, value: Any, problems: Problems, path: KeyPath) -> Any:
    """The meaning of a value of this type; problems are added to ``problems``."""
    if value is None or annotation is Any:
        return value
    origin = get_origin(annotation)
    parts = get_args(annotation)
    if origin is Annotated:
        return _ruled(parts[0], parts[1:], value, problems, path)
    if origin in (Union, UnionType):
        kinds = [part for part in parts if part is not NoneType]
        expected = _either(kinds)
        if expected and not isinstance(value, list | dict):
            problems.append((path, _mismatch(value, expected)))
            return None
        # A section is meant by a mapping, the other type by all else.
        meant = next(
            (kind for kind in kinds if isinstance(value, dict) == (section_of(kind) is kind)),
            kinds[0],
        )
        return _read(meant, value, problems, path)
    if origin is Literal:
        if value in parts:
            return value
        close = nearest(value, parts) if isinstance(value, str) else None
        expected = _mismatch(value, listed([f"'{choice}'" for choice in parts], "or"))
        problems.append((path, expected + (f"; did you mean {shown(close)}?" if close else "")))
        return None
    section = section_of(annotation)
    if section is annotation:
        return section.read(value, problems, path)
    plain: Any = origin or annotation
    if not isinstance(value, list if plain is tuple else plain) or (
        plain is int and isinstance(value, bool)
    ):
        quoted = "; put it in quotes" if plain is str and not isinstance(value, dict | list) else ""
        problems.append((path, _mismatch(value, _WORDS[plain]) + quoted))
        return None
    if isinstance(value, dict):
        key_type, entry_type = parts
        entries = {}
        for key, entry in value.items():
            place = (*path, key) if key else path  # an empty name is not in the file
            name = _read(key_type, key, problems, place)
            entries[name] = _read(entry_type, entry, problems, place)
        return entries
    if plain is list:
        return [
            _read(parts[0], entry, problems, (*path, index)) for index, entry in enumerate(value)
        ]
    if plain is tuple:
        if len(parts) != len(value):
            comma = decimal_comma(value) if len(value) > len(parts) else ""
            problems.append((path, f"expected {len(parts)} entries, got {len(value)}{comma}"))
            return None
        return [
            _read(parts[index], entry, problems, (*path, index))
            for index, entry in enumerate(value)
        ]
    return value


def _ruled(
    annotation: Any, rules: tuple[Rule, ...], value: Any, problems: Problems, path: KeyPath
) -> Any:
    """The meaning of a value by the rules about its type, the last of which is the outermost."""
    if not rules:
        return _read(annotation, value, problems, path)
    try:
        return rules[-1].read(
            value, lambda inner: _ruled(annotation, rules[:-1], inner, problems, path)
        )
    except ValueError as wrong:
        problems.append((path, str(wrong)))
        return None


def _either(parts: list[Any]) -> str:
    """Words for what a union of a list and a mapping expects; empty for another union."""
    kinds = [get_args(part)[0] if get_origin(part) is Annotated else part for part in parts]
    if {"dict" if section_of(kind) is kind else get_origin(kind) for kind in kinds} == {
        "dict",
        list,
    }:
        return f"{_WORDS[list]} or {_WORDS[dict]}"
    return ""


# smaller values that must be above zero count as zero, in SI: a division by them could overflow
SMALLEST = 1e-15

_BOUNDS = {
    "minimum": (operator.ge, "of at least"),
    "exclusiveMinimum": (operator.gt, "above"),
    "maximum": (operator.le, "of at most"),
    "exclusiveMaximum": (operator.lt, "below"),
}
RIGHT_ANGLE = parse("90 deg", "angle")


class Quantity(Rule):
    """Annotation of a field that holds a quantity of ``kind``; the bounds are keywords of JSON
    Schema, in SI.
    """

    def __init__(self, kind: str, **bounds: float) -> None:
        self.kind, self.bounds = kind, bounds

    def read(self, value: Any, inner: Callable[[Any], Any]) -> float:  # noqa: ARG002
        """SI value; raises ValueError with the values allowed."""
        result = parse(value, self.kind)
        if not self._allows(result):
            # An angle without unit that would be in range in degrees, or a share that would be in
            # %.
            hints = {
                "angle": f" (read as radians; write {value} deg)",
                "ratio": f"; write {value} % if that is meant",
            }
            unit = "deg" if self.kind == "angle" else "%"
            hint = hints.get(self.kind, "")
            if hint and (
                isinstance(value, str) or not self._allows(parse(f"{value} {unit}", self.kind))
            ):
                hint = ""
            raise ValueError(f"{shown(value)} is out of range; expected {self.range}{hint}")
        if result < self.bounds.get("exclusiveMinimum", -math.inf) + SMALLEST:
            smallest = f"in SI at least {SMALLEST:g}"
            raise ValueError(
                f"{shown(value)} is too small to be real; expected {self.range}, {smallest}"
            )
        return result

    def _allows(self, result: float) -> bool:
        return all(_BOUNDS[name][0](result, limit) for name, limit in self.bounds.items())

    @property
    def range(self) -> str:
        """``an angle of at least 0 and below 90 deg``."""
        angle = self.kind == "angle"
        bounds = (
            f"{_BOUNDS[name][1]} "
            + (f"{limit / RIGHT_ANGLE * 90:g} deg" if angle and limit else f"{limit:g}")
            for name, limit in self.bounds.items()
        )
        return f"{KINDS[self.kind].noun} {' and '.join(bounds)}"

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:  # noqa: ARG002
        """A number in the bounds, or one with a unit."""
        number = {"type": "number", **self.bounds}
        if not KINDS[self.kind].factors:
            return number
        return {"anyOf": [number, {"type": "string", "pattern": pattern(self.kind)}]}


Nutation = Annotated[float, Quantity("angle", minimum=0, exclusiveMaximum=RIGHT_ANGLE)]
AcuteAngle = Annotated[float, Quantity("angle", exclusiveMinimum=0, exclusiveMaximum=RIGHT_ANGLE)]
Time = Annotated[float, Quantity("time", minimum=0)]
PositiveTime = Annotated[float, Quantity("time", exclusiveMinimum=0)]
THREE = Length(3, 3)
Position = Annotated[list[Annotated[float, Quantity("length")]], THREE]
Direction = Annotated[list[Annotated[float, Quantity("number")]], THREE]
LONGEST_NAME = 80  # characters: a line of a screen


class Printable(Rule):
    """Annotation of a text of printable characters, at least one of them not a blank."""

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        """The text; raises ValueError for another."""
        text = inner(value)
        if text is not None and not (text.strip() and text.isprintable()):
            raise ValueError(f"{shown(text)} is no name; expected printable characters")
        return text


Name = Annotated[str, Length(1, LONGEST_NAME), Printable()]
