"""What the sections of a spacecraft file are made of: quantities with units and bounds, directions."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

from nutdamp.files.sections import Rule
from nutdamp.units import KINDS, parse, pattern, shown

SMALLEST = 1e-15
"""Values that must be above zero and are smaller count as zero, in SI: what is divided by them could overflow."""

_BOUNDS = {
    "minimum": (operator.ge, "of at least"),
    "exclusiveMinimum": (operator.gt, "above"),
    "maximum": (operator.le, "of at most"),
    "exclusiveMaximum": (operator.lt, "below"),
}
RIGHT_ANGLE = parse("90 deg", "angle")


class Quantity(Rule):
    """Annotation of a field that holds a quantity of ``kind``; the bounds are keywords of JSON Schema, in SI."""

    def __init__(self, kind: str, **bounds: float) -> None:
        self.kind, self.bounds = kind, bounds

    def check(self, value: object) -> float:
        """SI value; raises ValueError, which says what would be right."""
        result = parse(value, self.kind)
        if not self._allows(result):
            raise ValueError(f"{shown(value)} is out of range; expected {self.range}{self._degrees(value)}")
        if result < self.bounds.get("exclusiveMinimum", -math.inf) + SMALLEST:
            raise ValueError(
                f"{shown(value)} is too small to be real; expected {self.range}, in SI at least {SMALLEST:g}"
            )
        return result

    def _degrees(self, value: object) -> str:
        """A hint for an angle without unit that would be in range in degrees, and for a share that would be in %."""
        meant = {"angle": "deg", "ratio": "%"}.get(self.kind)
        if meant is None or isinstance(value, str) or not self._allows(parse(f"{value} {meant}", self.kind)):
            return ""
        return f" (read as radians; write {value} deg)" if meant == "deg" else f"; write {value} % if that is meant"

    def _allows(self, result: float) -> bool:
        return all(_BOUNDS[name][0](result, limit) for name, limit in self.bounds.items())

    @property
    def range(self) -> str:
        """``an angle of at least 0 and below 90 deg``."""
        angle = self.kind == "angle"
        bounds = (
            f"{_BOUNDS[name][1]} " + (f"{limit / RIGHT_ANGLE * 90:g} deg" if angle and limit else f"{limit:g}")
            for name, limit in self.bounds.items()
        )
        return f"{KINDS[self.kind].noun} {' and '.join(bounds)}"

    def read(self, value: Any, inner: Callable[[Any], Any]) -> float:  # noqa: ARG002
        """See `check`."""
        return self.check(value)

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:  # noqa: ARG002
        """A number in the bounds, or one with a unit."""
        number = {"type": "number", **self.bounds}
        if not KINDS[self.kind].factors:
            return number
        return {"anyOf": [number, {"type": "string", "pattern": pattern(self.kind)}]}


class AxialShorthand(Rule):
    """Annotation of a torque vector that may be written as a single torque, its part about axis 3."""

    single = Quantity("torque")

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        """Three components; raises ValueError, which says what would be right."""
        return inner(value) if isinstance(value, list) else [0.0, 0.0, self.single.check(value)]

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """The vector or the torque."""
        return {"anyOf": [inner(), *self.single.schema(inner)["anyOf"]]}


class ListOf(Rule):
    """Annotation of a list of lists, each ``written`` so, that says how a single one is put into a list."""

    def __init__(self, written: str) -> None:
        self.written = written

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        """The list; raises ValueError where its first entry is none."""
        if isinstance(value, list) and value and not isinstance(value[0], list):
            one = ", ".join(str(entry) for entry in value)
            raise ValueError(f"expected a list of {self.written}, such as [[{one}]], got [{one}]")
        return inner(value)

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """As of the list."""
        return inner()


class OrWord(Rule):
    """Annotation of a direction, two angles in a list, that may be written as one ``word`` instead."""

    def __init__(self, word: str) -> None:
        self.word = word

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        """The angles or the word; raises ValueError, which says what would be right."""
        if value == self.word:
            return value
        if not isinstance(value, list):
            raise ValueError(f"expected {self.word} or [right ascension, declination], got {shown(value)}")
        return inner(value)

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """The angles or the word."""
        return {"anyOf": [inner(), {"const": self.word}]}
