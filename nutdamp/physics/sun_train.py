"""Trains of pulses that the Sun pulse triggers, in closed form: where H goes, and what nutation they leave.

All fire at one phase of the spin against the Sun, so that H keeps its heading to the direction of the Sun: a rhumb line
on the sphere about the Sun. Angles are in rad, impulses in N m s; arrays of any shape broadcast.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np


class RhumbEnd(NamedTuple):
    """Where a rhumb line ends: angle from the Sun, growth of the longitude about it, and ``turn``.

    ``turn`` is by how much the meridian of the Sun has turned about the axis against a direction that is carried
    along without turning: ∫ cos γ dλ.
    """

    sun_angle: Any
    longitude: Any
    turn: Any


def rhumb_end(sun_angle: Any, heading: Any, length: Any) -> RhumbEnd:
    """A rhumb line from ``sun_angle`` γ at a ``heading`` from the direction away from the Sun, right-handed about H.

    γ2 = γ + s cos χ, Δλ = tan χ ln[tan(γ2/2)/tan(γ/2)] and ∫ cos γ dλ = tan χ ln[sin γ2 / sin γ], written without
    the division by cos χ. Not a number where it passes the Sun or the point opposite to it.
    """
    change = length * np.cos(heading)
    end = sun_angle + change
    aside = length * np.sin(heading)
    with np.errstate(invalid="ignore", divide="ignore"):
        end = np.where((end > 0.0) & (end < np.pi), end, np.nan)
        short = np.abs(change) < 1e-5
        safe = np.where(short, 1.0, change)
        middle = sun_angle + 0.5 * change
        per_longitude = np.where(
            short, 1.0 / np.sin(middle), np.log(np.tan(0.5 * end) / np.tan(0.5 * sun_angle)) / safe
        )
        per_turn = np.where(short, 1.0 / np.tan(middle), np.log(np.sin(end) / np.sin(sun_angle)) / safe)
    return RhumbEnd(end, aside * per_longitude, aside * per_turn)


def rhumb_course(sun_angle: Any, goal_angle: Any, ahead: Any) -> tuple[Any, Any]:
    """The rhumb line to ``goal_angle`` from the Sun, ``ahead`` in longitude: heading χ as in `rhumb_end`, and length.

    tan χ = Δλ/Δψ with ψ = ln tan(γ/2); the length is Δγ/cos χ, and sin γ |Δλ| along a parallel.
    """
    rise = np.log(np.tan(0.5 * goal_angle)) - np.log(np.tan(0.5 * sun_angle))
    heading = np.arctan2(ahead, rise)
    parallel = np.abs(np.cos(heading)) < 1e-6
    along = (goal_angle - sun_angle) / np.where(parallel, 1.0, np.cos(heading))
    return heading, np.abs(np.where(parallel, np.sin(sun_angle) * ahead, along))


def turned_by(momentum: Any, torque: float, width: Any, spin: Any, spread: Any = None) -> Any:
    """By how much a pulse of a ``torque`` (N m) fixed in the body turns H of size ``momentum``, rad: its mean over the
    ``width`` s, in which the body turns at ``spin`` rad/s; ``spread`` s: over that time, where it is another.
    """
    return torque * width * np.sinc(0.5 * spin * (width if spread is None else spread) / np.pi) / momentum


def phasor_sum(count: Any, step: Any) -> Any:
    """Σ e^{i k ``step``} over k = 0 … ``count`` - 1: e^{i(N-1)ψ/2} sin(Nψ/2)/sin(ψ/2); N where ψ is a whole turn."""
    half = 0.5 * step
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.sin(count * half) / np.sin(half)
    whole = np.abs(np.sin(half)) < 1e-9
    # Near a whole turn, ψ = 2πm, both sines vanish: their ratio is N (-1)^{m(N-1)}.
    sign = np.where(np.rint(half / np.pi) * (count - 1) % 2 == 0, 1.0, -1.0)
    return np.exp(1j * (count - 1) * half) * np.where(whole, sign * count, ratio)
