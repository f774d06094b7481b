"""Sections of a file, declared as classes: what may be at their keys, read and checked, and as JSON Schema.

A key is an annotated attribute, ``mass: Mass | None = Field("Mass, kg.", "250 kg")``. Types are those of what YAML and
JSON hold, lists, tuples and mappings of them, sections, and any of them `Annotated` with `Rule`\\ s.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Literal, Self, Union, get_args, get_origin, get_type_hints

from nutdamp.units import shown
from nutdamp.words import listed

KeyPath = tuple[str | int, ...]
"""Keys and list positions that lead from the root to a value."""

Problems = list[tuple[KeyPath, str]]
"""What is wrong, and where."""

REQUIRED: Any = ...
"""Default of a key that cannot be left out."""


@dataclass(frozen=True, slots=True)
class Key:
    """A key of a section: the ``type`` of what it holds, what it means, and what holds where it is left out."""

    type: Any
    default: Any
    description: str
    examples: list[Any]


def Field(description: str, *examples: Any, default: Any = REQUIRED) -> Any:
    """A key of a `Section`; its type is the annotation, and one that may be None is so by default."""
    return Key(None, default, description, list(examples))


class Rule:
    """What an annotation adds to a type."""

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        """What the file means by ``value``, which ``inner`` reads by the type. Raises ValueError that says what is."""
        return inner(value)

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """JSON Schema, where ``inner`` gives that of the type."""
        return inner()


class Length(Rule):
    """How many entries (characters of a text) there are, both ends included."""

    def __init__(self, least: int, most: int | None = None) -> None:
        self.least, self.most = least, most

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        """As the type does; raises ValueError for another length."""
        long = isinstance(value, list) and self.most is not None and len(value) > self.most
        found = value if long else inner(value)  # entries too many are one fault, whatever they are
        if found is None:  # not of the type
            return None
        if len(found) < self.least == 1:
            raise ValueError("empty; expected an entry")
        if long or len(found) < self.least:
            count = f"{self.least} to {self.most}" if self.most != self.least else f"{self.least}"
            count = f"at least {self.least}" if self.most is None else count
            raise ValueError(f"expected {count} entries, got {len(found)}")
        return found

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """With the keywords of the type."""
        found = inner()
        of = {"array": "Items", "object": "Properties", "string": "Length"}[found["type"]]
        return {**found, f"min{of}": self.least, **({} if self.most is None else {f"max{of}": self.most})}


class Within(Rule):
    """The range of a whole number, both ends included."""

    def __init__(self, least: int, most: int) -> None:
        self.least, self.most = least, most

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        """The number; raises ValueError where it is out of range."""
        found = inner(value)
        if found is not None and not self.least <= found <= self.most:
            expected = f"at least {self.least}" if found < self.least else f"at most {self.most}"
            raise ValueError(_mismatch(value, expected))
        return found

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """With the range."""
        return {**inner(), "minimum": self.least, "maximum": self.most}


class Section:
    """A mapping of the file: no key that is not named here."""

    written: ClassVar[str] = "a mapping {key: value, …}"
    """How it is written, for messages."""

    schema_extra: ClassVar[dict[str, Any]] = {}
    """What its JSON Schema has besides."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        vars(self).update(values)

    @classmethod
    @cache
    def fields(cls) -> dict[str, Key]:
        """Its keys, by name."""
        types = get_type_hints(cls, include_extras=True)
        found = {}
        for name, key in vars(cls).items():
            if isinstance(key, Key):
                optional = key.default is REQUIRED and NoneType in get_args(types[name])
                found[name] = replace(key, type=types[name], default=None if optional else key.default)
        return found

    @classmethod
    def read(cls, value: Any, problems: Problems, path: KeyPath = ()) -> Self | None:
        """The section in ``value``, as YAML gives it; what is wrong is added to ``problems``.

        Unknown keys and empty values are not looked for here.
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
                    what = key.description
                    problems.append(((*path, name), f"missing; {what[:1].lower()}{what[1:].rstrip('.')}"))
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
    """What a value of this type means; what is wrong is added to ``problems``."""
    if value is None or annotation is Any:
        return value
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _ruled(parts[0], parts[1:], value, problems, path)
    if origin in (Union, UnionType):
        if (expected := _either(parts)) and not isinstance(value, list | dict):
            problems.append((path, _mismatch(value, expected)))
            return None
        return _read(_meant(parts, value), value, problems, path)
    if origin is Literal:
        return _chosen(parts, value, problems, path)
    section = section_of(annotation)
    if section is annotation:
        return section.read(value, problems, path)
    plain: Any = origin or annotation
    if not isinstance(value, list if plain is tuple else plain) or (plain is int and isinstance(value, bool)):
        quoted = "; put it in quotes" if plain is str and not isinstance(value, dict | list) else ""
        problems.append((path, _mismatch(value, _WORDS[plain]) + quoted))
        return None
    if isinstance(value, dict):
        return {key: _read(parts[1], entry, problems, (*path, key)) for key, entry in value.items()}
    if plain is list:
        return [_read(parts[0], entry, problems, (*path, index)) for index, entry in enumerate(value)]
    if plain is tuple:
        if len(parts) != len(value):
            problems.append((path, f"expected {len(parts)} entries, got {len(value)}"))
            return None
        return [_read(parts[index], entry, problems, (*path, index)) for index, entry in enumerate(value)]
    return value


def _ruled(annotation: Any, rules: tuple[Rule, ...], value: Any, problems: Problems, path: KeyPath) -> Any:
    """What a value means by the rules about its type, the last of which is the outermost."""
    if not rules:
        return _read(annotation, value, problems, path)
    try:
        return rules[-1].read(value, lambda inner: _ruled(annotation, rules[:-1], inner, problems, path))
    except ValueError as wrong:
        problems.append((path, str(wrong)))
        return None


def _meant(parts: tuple[Any, ...], value: Any) -> Any:
    """The type of a union that a value is of: a section for a mapping, else the other; None is for what is left out."""
    types = [part for part in parts if part is not NoneType]
    return next((one for one in types if isinstance(value, dict) == (section_of(one) is one)), types[0])


def _either(parts: tuple[Any, ...]) -> str:
    """What a union of a list and a mapping expects; empty where it is another."""
    kinds = [get_args(part)[0] if get_origin(part) is Annotated else part for part in parts if part is not NoneType]
    if {"dict" if section_of(kind) is kind else get_origin(kind) for kind in kinds} == {"dict", list}:
        return f"{_WORDS[list]} or {_WORDS[dict]}"
    return ""


def _chosen(choices: tuple[str, ...], value: Any, problems: Problems, path: KeyPath) -> Any:
    from nutdamp.errors import nearest  # for what is wrong only

    if value in choices:
        return value
    meant = nearest(value, choices) if isinstance(value, str) else None
    expected = _mismatch(value, listed([f"'{choice}'" for choice in choices], "or"))
    problems.append((path, expected + (f"; did you mean {shown(meant)}?" if meant else "")))
    return None
