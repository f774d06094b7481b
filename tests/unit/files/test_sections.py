"""Sections of a file as classes: every type that a key may have, read and in the schema."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import pytest
from jsonschema import Draft202012Validator

from nutdamp.files.fields import Quantity
from nutdamp.files.schema import section_schema
from nutdamp.files.sections import Field, Length, Problems, Section, Within

pytestmark = pytest.mark.usefixtures("plans_shared")

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


GOOD: list[tuple[dict[str, Any], str, object]] = [
    ({}, "flag", False),
    ({"text": "a"}, "text", "a"),
    ({"whole": 9}, "whole", 9),
    ({"flag": True}, "flag", True),
    ({"choice": "two"}, "choice", "two"),
    ({"times": ["20 ms", 1]}, "times", [0.02, 1.0]),
    ({"pair": ["20 ms", 3]}, "pair", [0.02, 3]),
    ({"either": ["1 min"]}, "either", [60.0]),
]

BAD: list[tuple[dict[str, Any], tuple[str | int, ...], str]] = [
    ({"text": ""}, ("text",), "empty; expected an entry"),
    ({"text": 3}, ("text",), "expected a text, got 3; put it in quotes"),
    ({"text": [3]}, ("text",), "expected a text, got a list"),
    ({"whole": 10}, ("whole",), "expected at most 9, got 10"),
    ({"whole": 0}, ("whole",), "expected at least 1, got 0"),
    ({"whole": True}, ("whole",), "expected a whole number, got true"),
    ({"whole": 2.0}, ("whole",), "expected a whole number, got 2.0"),
    ({"flag": "on"}, ("flag",), "expected true or false, got 'on'"),
    ({"choice": "tow"}, ("choice",), "expected 'one' or 'two', got 'tow'; did you mean 'two'?"),
    ({"times": "1 s"}, ("times",), "expected a list [value, …], got '1 s'"),
    ({"times": [1]}, ("times",), "expected 2 to 3 entries, got 1"),
    ({"times": [1, 2, 3, 4]}, ("times",), "expected 2 to 3 entries, got 4"),
    ({"times": [1, -2]}, ("times", 1), "-2 is out of range; expected a time of at least 0"),
    ({"pair": {"a": 1}}, ("pair",), "expected a list [value, …], got a mapping"),
    ({"pair": [1]}, ("pair",), "expected 2 entries, got 1"),
    ({"pair": [1, "x"]}, ("pair", 1), "expected a whole number, got 'x'"),
    ({"named": {}}, ("named",), "empty; expected an entry"),
    ({"named": {"a": {}}}, ("named", "a", "t"), "missing; time of it, s"),
    ({"either": {"t": "x"}}, ("either", "t"), "'x' is not a time"),
    ({"either": "x"}, ("either",), "expected a list [value, …] or a mapping {key: value, …}, got 'x'"),
    ({"inner": 3}, ("inner",), "expected a mapping {key: value, …}, got 3"),
    ({"inners": [{"t": 1}, {"t": [1]}]}, ("inners", 1, "t"), "expected a time (a number in s"),
]


@pytest.mark.parametrize(("given", "name", "expected"), GOOD)
def test_what_is_right_is_read(given: dict[str, Any], name: str, expected: object) -> None:
    problems: Problems = []
    assert getattr(Outer.read(given, problems), name) == expected
    assert problems == []


def test_sections_are_read_within_lists_and_mappings() -> None:
    problems: Problems = []
    given = {"named": {"a": {"t": 1}}, "either": {"t": 2}, "inner": {"t": 3}, "inners": [{"t": 4}, {"t": "5 s"}]}
    read = Outer.read(given, problems)
    assert read is not None
    assert read.named is not None
    assert isinstance(read.either, Inner)
    assert read.inner is not None
    assert [read.named["a"].t, read.either.t, read.inner.t, *(one.t for one in read.inners)] == [1, 2, 3, 4, 5]
    assert problems == []


@pytest.mark.parametrize(("given", "path", "expected"), BAD)
def test_what_is_wrong_is_said_where_it_is(given: dict[str, Any], path: tuple[str | int, ...], expected: str) -> None:
    problems: Problems = []
    Outer.read(given, problems)
    ((where, problem),) = problems
    assert where == path
    assert problem.startswith(expected)


def test_all_that_is_wrong_is_found_at_once() -> None:
    problems: Problems = []
    Outer.read({"whole": 0, "times": [-1, "x"], "inner": {}}, problems)
    assert [where for where, _ in problems] == [("whole",), ("times", 0), ("times", 1), ("inner", "t")]


def test_the_schema_allows_what_is_read_and_nothing_else() -> None:
    parts: dict[str, Any] = {}
    schema = {**section_schema(Outer, parts), "$defs": parts}
    Draft202012Validator.check_schema(schema)
    judge = Draft202012Validator(schema)
    for right, *_ in GOOD:
        assert judge.is_valid(right), right
    for wrong, *_ in BAD:
        if wrong == {"whole": 2.0}:  # JSON knows no other 2
            continue
        assert not judge.is_valid(wrong), wrong


def test_entries_too_many_are_one_fault() -> None:
    problems: Problems = []
    Outer.read({"times": [1, 2, 3, "x"]}, problems)
    assert problems == [(("times",), "expected 2 to 3 entries, got 4")]
