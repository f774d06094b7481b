"""What Python users hand over, looked at before it is used: each refusal says what was expected, and what came."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real
from os import PathLike, fspath
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from nutdamp.errors import BadRequest
from nutdamp.units import LARGEST

Kind = TypeVar("Kind")
Record = TypeVar("Record", bound=Any)


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


def thresholds(value: Any) -> tuple[tuple[float, float], ...]:
    """Pairs of angles (start, stop) in rad, stop the smaller; raises BadRequest."""
    pairs = tuple(value) if isinstance(value, Iterable) else (value,)
    for pair in pairs:
        angles = tuple(pair) if isinstance(pair, Sequence) and not isinstance(pair, str) else ()
        if not (len(angles) == 2 and all(map(is_number, angles)) and 0.0 <= angles[1] < angles[0] < 0.5 * math.pi):
            what = "pairs of angles in rad below a right angle, the second smaller, such as [(0.01, 0.002)]"
            raise BadRequest(f"thresholds: expected {what}, got {shown(pair)}")
    return tuple((float(one), float(other)) for one, other in pairs)


def one_of(name: str, value: Any, names: tuple[str, ...]) -> str:
    """One of the ``names``; raises BadRequest."""
    if isinstance(value, str) and value in names:
        return value
    raise BadRequest(f"{name} = {shown(value)}: expected one of {', '.join(names)}")


def is_number(value: Any) -> bool:
    """Whether Python or numpy would call it a real number, of sensible size."""
    return issubclass(type(value), Real) and type(value) is not bool and abs(value) <= LARGEST


def is_count(value: Any) -> bool:
    """Whether it is a whole number of at least 1."""
    return issubclass(type(value), Integral) and type(value) is not bool and value >= 1


def shown(value: object) -> str:
    """A value as a message names it: what is short as it is, anything else by its type."""
    text = repr(value) if isinstance(value, str | Real | None) else ""
    kind = type(value)
    return text if 0 < len(text) <= 60 else f"a {kind.__module__}.{kind.__qualname__}".replace("builtins.", "")


def replaced(value: Record, fields: Mapping[str, object]) -> Record:
    """A dataclass with some of its fields replaced, looked at by their types; raises BadRequest."""
    import numpy as np  # here, because the command line knows options without it

    kinds = get_type_hints(type(value))
    known = [field.name for field in dataclasses.fields(value) if field.init]
    made: dict[str, Any] = {}
    for name, one in fields.items():
        if name not in known:
            raise BadRequest(f"replace: there is no {name!r}; there are {', '.join(known)}")
        kind = kinds[name]
        if not _fits(one, kind):
            raise BadRequest(f"{name}: expected {_described(kind)}, got {shown(one)}")
        made[name] = np.array(one, dtype=float) if _array(kind) else one
    return dataclasses.replace(value, **made)


def _array(kind: Any) -> bool:
    """True for the type hint of three numbers; what it is made of differs between versions of numpy."""
    import numpy as np  # here, because the command line knows options without it
    from numpy.typing import NDArray

    return bool(kind == NDArray[np.float64])


def _fits(value: object, kind: Any) -> bool:
    """Whether a value is of a kind that a type hint names; an array is three numbers."""
    parts = get_args(kind)
    if get_origin(kind) is UnionType:
        return any(_fits(value, part) for part in parts)
    if _array(kind):
        numbers: Any = value
        sized = isinstance(value, Sequence) or getattr(value, "ndim", 0) == 1
        return sized and len(numbers) == 3 and all(map(is_number, numbers))
    if get_origin(kind) is tuple:
        return isinstance(value, tuple) and all(_fits(one, parts[0]) for one in value)
    return is_number(value) if kind is float else isinstance(value, kind)


def _described(kind: Any) -> str:
    """A kind that a type hint names, in words."""
    parts = get_args(kind)
    if get_origin(kind) is UnionType:
        return " or ".join(_described(part) for part in parts)
    if _array(kind):
        return "three numbers"
    if get_origin(kind) is tuple:
        return f"a tuple of {parts[0].__name__}"
    return {float: "a number", str: "a text", type(None): "None"}.get(kind) or f"a {kind.__name__}"
