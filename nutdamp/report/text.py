"""Numbers as people read them: four digits, units, degrees."""

from __future__ import annotations

import math
from collections.abc import Iterable

MISSING = "–"
"""Stands where a number is not known."""


def quantity(value: float | None, unit: str, digits: int = 4) -> str:
    """A number with its unit; what is not known or infinite says so."""
    if value is None or math.isnan(value):
        return MISSING
    if math.isinf(value):
        return "infinite" if value > 0 else "-infinite"
    return f"{value:.{digits}g} {unit}"


def degrees(angle: float | None) -> str:
    """An angle given in rad, in degrees; what is below 1e-9 deg is rounding and shown as such."""
    if angle is None or math.isnan(angle):
        return MISSING
    shown = math.degrees(angle)
    if abs(shown) < 1e-9:
        return "< 1e-9 deg" if shown != 0.0 else "0 deg"
    return f"{shown:.4g} deg"


def mass(value: float | None) -> str:
    """Propellant given in kg, in g below a kilogram."""
    if value is None:
        return MISSING
    return quantity(1e3 * value, "g") if value < 1.0 else quantity(value, "kg")


def duration(value: float | None) -> str:
    """A time given in s, in ms below a tenth of a second."""
    if value is None or not math.isfinite(value) or value == 0.0 or value >= 0.1:
        return quantity(value, "s")
    return quantity(1e3 * value, "ms")


def moment(value: float) -> str:
    """A point in time given in s, to the millisecond."""
    return f"{value:.3f} s"


def vector(components: Iterable[float]) -> str:
    """Components in brackets."""
    return "(" + ", ".join(f"{float(part) + 0.0:.4g}" for part in components) + ")"
