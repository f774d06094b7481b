"""What Python users hand over, looked at before it is used: each refusal says what was expected, and what came."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from numbers import Real
from os import PathLike, fspath
from typing import Any, TypeVar

from nutdamp import schemes
from nutdamp.errors import BadRequest
from nutdamp.schemes import Options

Kind = TypeVar("Kind")


def instance(name: str, value: object, kind: type[Kind], expected: str) -> Kind:
    """``value``, where it is of the ``kind``; raises BadRequest."""
    if isinstance(value, kind):
        return value
    raise BadRequest(f"{name}: expected {expected}, got {_shown(value)}")


def path(name: str, value: str | PathLike[str]) -> str:
    """The name of a file; raises BadRequest."""
    try:
        return instance(name, fspath(value), str, "the name of a file")
    except TypeError:
        raise BadRequest(f"{name}: expected the name of a file, got {_shown(value)}") from None


def changes(value: Any) -> Mapping[str, object]:
    """Keys and what to set them to; raises BadRequest."""
    if value is None:
        return {}
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return value
    raise BadRequest(f"set: expected a mapping such as {{'limits.horizon': '300 s'}}, got {_shown(value)}")


def scheme_names(values: Iterable[str]) -> tuple[str, ...]:
    """Names of schemes that there are; raises BadRequest."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise BadRequest(f"names: expected a list of schemes, such as ['two-pulse'], got {_shown(values)}")
    names = tuple(values)
    for name in names:
        if not isinstance(name, str) or name not in schemes.NAMES:
            raise BadRequest(f"there is no scheme {_shown(name)}; there are {', '.join(schemes.NAMES)}")
    return names


def options(value: Options | None) -> Options:
    """The options, those left out at their defaults; raises BadRequest for one that makes no sense."""
    chosen = Options() if value is None else instance("options", value, Options, "nutdamp.Options(…)")
    for name, problem in chosen.faults():
        raise BadRequest(f"{name} = {_shown(getattr(chosen, name))}: {problem}")
    return chosen


def end_of_flight(value: Any) -> float:
    """A time in s after t = 0; raises BadRequest."""
    if schemes.is_number(value) and value > 0.0:
        return float(value)
    raise BadRequest(f"until = {_shown(value)}: expected a time after t = 0, in s")


def rows(value: Any) -> int:
    """A number of samples; raises BadRequest."""
    if schemes.is_count(value) and value >= 2:
        return int(value)
    raise BadRequest(f"samples = {_shown(value)}: expected a whole number of at least 2")


def _shown(value: object) -> str:
    """A value as a message names it: what is short as it stands, anything else by its type."""
    text = repr(value) if isinstance(value, str | Real | None) else ""
    kind = type(value)
    return text if 0 < len(text) <= 60 else f"a {kind.__module__}.{kind.__qualname__}".replace("builtins.", "")
