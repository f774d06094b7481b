"""Sections of a file as classes: every type that a key may have, read and in the schema."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from jsonschema import Draft202012Validator
from support.golden import check_text

from nutdamp.files.fields import Field, Length, Problems, Quantity, Section, Within
from nutdamp.files.reader import section_schema

Time = Annotated[float, Quantity("time", minimum=0)]


def key(default: Any = None) -> Any:
    return Field("What it is.", default=default)


class Inner(Section):
    """Below."""

    t: Time = Field("Time of it, s.", "1 s")


class Outer(Section):
    """Every type."""

    text: Annotated[str, Length(1)] | None = key()
    whole: Annotated[int, Within(1, 9)] | None = key()
    flag: bool = key(False)
    choice: Literal["one", "two"] | None = key()
    times: Annotated[list[Time], Length(2, 3)] | None = key()
    pair: tuple[Time, int] | None = key()
    named: Annotated[dict[str, Inner], Length(1)] | None = key()
    either: Annotated[list[Time], Length(1)] | Inner | None = key()
    inner: Inner | None = key()
    inners: list[Inner] = key([])


GOOD: dict[str, tuple[Any, object]] = {
    "text": ("a", "a"),
    "whole": (9, 9),
    "flag": (True, True),
    "choice": ("two", "two"),
    "times": (["20 ms", 1], [0.02, 1.0]),
    "pair": (["20 ms", 3], [0.02, 3]),
    "either": (["1 min"], [60.0]),
}
SECTIONS = {"named": {"a": {"t": 1}}, "either": {"t": 2}, "inner": {"t": 3}, "inners": [{"t": 4}, {"t": "5 s"}]}
BAD: dict[str, tuple[Any, ...]] = {
    "text": ("", 3, [3]),
    "whole": (10, 0, True, 2.0),
    "flag": ("on",),
    "choice": ("tow",),
    "times": ("1 s", [1], [1, 2, 3, 4], [1, -2], [1, 2, 3, "x"]),
    "pair": ({"a": 1}, [1], [1, "x"]),
    "named": ({}, {"a": {}}),
    "either": ({"t": "x"}, "x"),
    "inner": (3,),
    "inners": ([{"t": 1}, {"t": [1]}],),
}


def test_what_is_right_is_read_also_within_lists_and_mappings() -> None:
    problems: Problems = []
    for name, (value, expected) in GOOD.items():
        assert getattr(Outer.read({name: value}, problems), name) == expected
    read = Outer.read(SECTIONS, problems)
    assert read is not None
    assert read.flag is False  # by default
    assert read.named is not None
    assert isinstance(read.either, Inner)
    assert read.inner is not None
    assert [read.named["a"].t, read.either.t, read.inner.t, *(one.t for one in read.inners)] == [1, 2, 3, 4, 5]
    assert problems == []


def test_what_is_wrong_is_said_where_it_is_and_all_of_it_at_once() -> None:
    """Each is one fault: also a list too long with a wrong entry."""
    lines = []
    for name, value in ((name, value) for name, values in BAD.items() for value in values):
        problems: Problems = []
        Outer.read({name: value}, problems)
        ((where, problem),) = problems
        lines.append(f"{name}: {value!r} -> {where}: {problem}")
    check_text("files.sections", "\n".join(lines))
    problems = []
    Outer.read({"whole": 0, "times": [-1, "x"], "inner": {}}, problems)
    assert [where for where, _ in problems] == [("whole",), ("times", 0), ("times", 1), ("inner", "t")]


def test_the_schema_allows_what_is_read_and_nothing_else() -> None:
    parts: dict[str, Any] = {}
    schema = {**section_schema(Outer, parts), "$defs": parts}
    Draft202012Validator.check_schema(schema)
    judge = Draft202012Validator(schema)
    assert all(judge.is_valid(right) for right in ({}, SECTIONS, *({name: given} for name, (given, _) in GOOD.items())))
    allowed = [(name, value) for name, values in BAD.items() for value in values if judge.is_valid({name: value})]
    assert allowed == [("whole", 2.0)]  # JSON knows no other 2
