"""What Python users hand over, looked at before it is used: each refusal says what was expected, and what came."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from os import PathLike, fspath
from typing import Any, TypeVar

from nutdamp import schemes
from nutdamp.errors import BadRequest
from nutdamp.schemes import Choice, Options, SchemeOptions
from nutdamp.schemes.options import is_count, is_number, shown

Kind = TypeVar("Kind")


def instance(name: str, value: object, kind: type[Kind], expected: str) -> Kind:
    """``value``, where it is of the ``kind``; raises BadRequest."""
    if isinstance(value, kind):
        return value
    raise BadRequest(f"{name}: expected {expected}, got {shown(value)}")


def path(name: str, value: str | PathLike[str], expected: str = "the name of a file") -> str:
    """The name of a file; raises BadRequest."""
    try:
        return instance(name, fspath(value), str, expected)
    except TypeError:
        raise BadRequest(f"{name}: expected {expected}, got {shown(value)}") from None


def changes(value: Any) -> Mapping[str, object]:
    """Keys and what to set them to; raises BadRequest."""
    if value is None:
        return {}
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return value
    raise BadRequest(f"set: expected a mapping such as {{'limits.horizon': '300 s'}}, got {shown(value)}")


def scheme_names(values: Iterable[str]) -> tuple[str, ...]:
    """Names of schemes that there are; raises BadRequest."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise BadRequest(f"names: expected a list of schemes, such as ['two-pulse'], got {shown(values)}")
    names = tuple(values)
    for name in names:
        if not isinstance(name, str) or name not in schemes.NAMES:
            raise BadRequest(f"there is no scheme {shown(name)}; there are {', '.join(schemes.NAMES)}")
    return names


def options(value: Choice) -> Choice:
    """The options of one scheme or several; raises BadRequest for what is none."""
    if value is None or isinstance(value, Options | SchemeOptions):
        return value
    raise BadRequest(f"options: expected nutdamp.Options(…), got {shown(value)}")


def end_of_flight(value: Any) -> float:
    """A time in s after t = 0; raises BadRequest."""
    if is_number(value) and value > 0.0:
        return float(value)
    raise BadRequest(f"until = {shown(value)}: expected a time after t = 0, in s")


def rows(value: Any) -> int:
    """A number of samples; raises BadRequest."""
    if is_count(value) and value >= 2:
        return int(value)
    raise BadRequest(f"samples = {shown(value)}: expected a whole number of at least 2")


def count(name: str, value: Any) -> int:
    """A whole number of at least 1; raises BadRequest."""
    if is_count(value) and value >= 1:
        return int(value)
    raise BadRequest(f"{name} = {shown(value)}: expected a whole number of at least 1")


def shifts(value: Any) -> tuple[float, ...]:
    """Angles in rad, infinite where any will do; raises BadRequest."""
    angles = tuple(value) if isinstance(value, Iterable) and not isinstance(value, str) else ()
    if angles and all((is_number(one) or one == math.inf) and one >= 0.0 for one in angles):
        return tuple(map(float, angles))
    raise BadRequest(f"allow = {shown(value)}: expected angles of at least 0, in rad, such as (0.0, math.inf)")


def one_of(name: str, value: Any, names: tuple[str, ...]) -> str:
    """One of the ``names``; raises BadRequest."""
    if isinstance(value, str) and value in names:
        return value
    raise BadRequest(f"{name} = {shown(value)}: expected one of {', '.join(names)}")
