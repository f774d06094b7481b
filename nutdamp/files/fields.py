"""What the models of a spacecraft file are made of: quantities with units and bounds, mappings with known keys."""

from __future__ import annotations

import math
import operator
from typing import Any, get_args

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

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


class Quantity:
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
        """A hint for an angle without unit that would be in range in degrees."""
        if self.kind != "angle" or isinstance(value, str) or not self._allows(parse(f"{value} deg", "angle")):
            return ""
        return f" (read as radians; write {value} deg)"

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

    def __get_pydantic_core_schema__(self, source: object, handler: object) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.check)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: object) -> dict[str, Any]:
        number = {"type": "number", **self.bounds}
        if not KINDS[self.kind].factors:
            return number
        return {"anyOf": [number, {"type": "string", "pattern": pattern(self.kind)}]}


class AxialShorthand:
    """Annotation of a torque vector that may be written as a single torque, its part about axis 3."""

    single = Quantity("torque")

    def check(self, value: object, vector: core_schema.ValidatorFunctionWrapHandler) -> object:
        """Three components; raises ValueError, which says what would be right."""
        return vector(value) if isinstance(value, list) else [0.0, 0.0, self.single.check(value)]

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_wrap_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        single = self.single.__get_pydantic_json_schema__(schema, handler)
        return {"anyOf": [handler(schema), *single["anyOf"]]}


TAGS = ("[list]", "{mapping}")
"""What pydantic adds to the path of a fault in a value that is either a list or a mapping."""


def list_or_mapping(value: object) -> str:
    """Which of `TAGS` is meant by a value."""
    return TAGS[isinstance(value, dict)]


class OrWord:
    """Annotation of a direction, two angles in a list, that may be written as one ``word`` instead."""

    def __init__(self, word: str) -> None:
        self.word = word

    def check(self, value: object, direction: core_schema.ValidatorFunctionWrapHandler) -> object:
        """The angles or the word; raises ValueError, which says what would be right."""
        if value == self.word:
            return value
        if not isinstance(value, list):
            raise ValueError(f"expected {self.word} or [right ascension, declination], got {shown(value)}")
        return direction(value)

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_wrap_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"anyOf": [handler(schema), {"const": self.word}]}


class Section(BaseModel):
    """A mapping of the file: no key that is not named here."""

    # Built once, with the root, when the first file is read.
    model_config = ConfigDict(extra="forbid", defer_build=True)


def section_of(annotation: Any) -> type[BaseModel] | None:
    """The model within the type of a field, such as that of a list's entries."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(section_of, get_args(annotation))), None)
