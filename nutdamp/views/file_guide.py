"""The keys of a spacecraft file as a topic of the guide, from the models that read it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, NamedTuple, get_args, get_origin

from nutdamp.errors import BadRequest
from nutdamp.files import fields
from nutdamp.files.fields import Quantity, Section, section_of
from nutdamp.files.keys import SpacecraftFile
from nutdamp.files.study_keys import QUANTITIES, ToleranceSection, unit_kinds
from nutdamp.units import KINDS
from nutdamp.views.guide import FILE, Topic, TopicPart, TopicRows, meant


class KeyGuide(NamedTuple):
    """A key of the file: its ``path`` as `explain` takes it, such as ``thrusters.force``, and its declaration.

    ``section`` is the model of its value, where that is a mapping or a list of mappings.
    """

    path: str
    field: fields.Key
    section: type[Section] | None

    @property
    def parent(self) -> str:
        """Path of the mapping it is in; empty at the root."""
        return self.path.rpartition(".")[0]

    @property
    def name(self) -> str:
        """Last step of the path."""
        return self.path.rpartition(".")[2]

    @property
    def row(self) -> tuple[str, str]:
        """The key, and its description, unit, default and example."""
        example = next(iter(self.field.examples), None)
        facts = [self._unit(), self._default(), "" if example is None else f"example: {flow(example)}"]
        return self.name, "\n".join([self.field.description, "; ".join(fact for fact in facts if fact)])

    def _unit(self) -> str:
        if self.section is ToleranceSection:
            names = [unit for kind in unit_kinds(QUANTITIES[self.name]) for unit in KINDS[kind].factors]
            return f"unit {_either(dict.fromkeys(names))}"
        return "" if self.section is not None else _what(self.field)

    def _default(self) -> str:
        if self.field.default is fields.REQUIRED:
            return "required"
        if "default" in self.field.description.casefold():
            return ""
        value = self.field.default
        return "default none" if value is None or value == [] else f"default {value:g}"


def keys(model: type[Section] = SpacecraftFile, prefix: str = "") -> Iterator[KeyGuide]:
    """All keys of the file, each before those below it."""
    for name, field in model.fields().items():
        section = section_of(field.type)
        yield KeyGuide(f"{prefix}{name}", field, section)
        if section is not None:
            yield from keys(section, f"{prefix}{name}.")


def file_topic(below: str = "") -> Topic:
    """The keys of the file, or the one called ``below``, such as ``thrusters.force``, and those in it.

    Raises BadRequest, which names a near one, where there is none.
    """
    every = list(keys())
    if not below:
        roots = [key for key in every if not key.parent]
        parts = [TopicPart("", (INTRODUCTION, TopicRows(tuple(key.row for key in roots))))]
        for key in roots:
            parts += _sections(key, every)
        return Topic(FILE, SpacecraftFile.__doc__ or "", (*parts, _SEE))
    requested = next((key for key in every if key.path == below), None)
    if requested is None:
        raise BadRequest(f"the spacecraft file has no key {below!r}; {_near(below, every)}")
    return Topic(
        f"{FILE}.{below}",
        "a key of the spacecraft file",
        (TopicPart("", (TopicRows((requested.row,)),)), *_sections(requested, every), _SEE),
    )


INTRODUCTION = (
    "A value is a number in SI or a text with a unit. Any key can also be given as --set KEY=VALUE, entries of a list "
    "by name or position: --set thrusters.T1.force=12N, --set omega0[2]=3."
)
_SEE = TopicPart("See also", ("explain units, nutdamp init, nutdamp schema",))


def _sections(key: KeyGuide, every: list[KeyGuide]) -> Iterator[TopicPart]:
    """The keys below ``key``, section by section; those of tolerances, which are all alike, once."""
    if key.section is None:
        return
    listed = get_origin(_plain(key.field.type)) is list
    title = f"{key.path}, each entry" if listed and key.section is not ToleranceSection else key.path
    children = [entry for entry in every if entry.parent == key.path]
    about = " ".join((key.section.__doc__ or "").split())
    yield TopicPart(title, (about, TopicRows(tuple(child.row for child in children))))
    below = [child for child in children if child.section is not None]
    if below and all(child.section is ToleranceSection for child in below):
        alike = [entry for entry in every if entry.parent == below[0].path]
        names = ", ".join(child.name for child in below)
        yield TopicPart(f"{key.path}: each of {names}", (TopicRows(tuple(entry.row for entry in alike)),))
        return
    for child in below:
        yield from _sections(child, every)


def _near(below: str, every: list[KeyGuide]) -> str:
    """A key of the same name elsewhere, or one that is spelt alike."""
    paths = tuple(
        key.path for key in every if key.parent.partition(".")[0] != "dispersions" or not key.parent.count(".")
    )
    last = below.rpartition(".")[2]
    same = next((path for path in paths if path.rpartition(".")[2] == last), None)
    return (
        f"did you mean '{FILE}.{same}'?"
        if same
        else meant(f"{FILE}.{below}", tuple(f"{FILE}.{path}" for path in paths), "nutdamp explain file")
    )


def _what(field: fields.Key) -> str:
    """The units of a quantity, the words of a choice, or the form of another value."""
    quantity = _first(Quantity, (field.type,))
    if quantity is not None:
        factors = KINDS[quantity.kind].factors
        return f"unit {_either(factors)}" if factors else "plain numbers, without unit"
    choices = _choices(field.type)
    if choices:
        return _either(choices)
    plain = _plain(field.type)
    return {int: "a whole number", str: "a text"}.get(plain, "")


def _first(kind: type[Quantity], parts: tuple[Any, ...]) -> Quantity | None:
    """The first ``kind`` within types and their annotations."""
    for part in parts:
        match = part if isinstance(part, kind) else _first(kind, get_args(part))
        if match is not None:
            return match
    return None


def _choices(annotation: Any) -> tuple[str, ...]:
    if get_origin(annotation) is Literal:
        return tuple(str(choice) for choice in get_args(annotation))
    return next(filter(None, map(_choices, get_args(annotation))), ())


def _plain(annotation: Any) -> Any:
    """A type without None and without annotations."""
    if get_origin(annotation) in (list, dict) or isinstance(annotation, type):
        return annotation
    return next((_plain(part) for part in get_args(annotation) if part is not type(None)), None)


def _either(names: Any) -> str:
    *others, last = names
    return f"{', '.join(others)} or {last}" if others else str(last)


def flow(value: object) -> str:
    """A value as YAML on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {flow(held)}" for key, held in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(flow, value)) + "]"
    return str(value)
