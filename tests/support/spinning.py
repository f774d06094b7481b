"""Bodies and spins for tables and for hypothesis, and motion under changing torques."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.builders import pulse, spinner
from support.reference import RTOL, Array, Motion, rotation_rates

from nutdamp.physics.motion import (
    MOST_STEPS,
    NOTHING,
    Bodies,
    Forcing,
    MotionStretch,
    Piece,
    polynomials,
)
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule

# --- bodies and spins that tables of unit/physics run over, and motion under changing torques

Triple = tuple[float, float, float]
EPS = float(np.finfo(float).eps)

BODIES = [(120.0, 80.0), (80.0, 120.0), (100.0, 100.0), (100.0, 200.0), (100.0, 5.0)]
"""A, C of a prolate and an oblate body, a sphere, a flat disc and a needle."""

spinners = pytest.mark.parametrize(
    ("A", "C", "spin"), [(*body, spin) for body in BODIES for spin in (3.0, -3.0)]
)
plain_spinners = pytest.mark.parametrize(
    ("A", "C", "spin"), [(*b, spin) for b in BODIES[:2] for spin in (3.0, -3.0)]
)


def series(
    moments: Triple,
    torque: Array,
    rates: Array,
    quaternion: Array,
    begin: float,
    end: float,
    forcing: Forcing = NOTHING,
    most: int = MOST_STEPS,
) -> list[Piece]:
    """Motion of one body from ``begin`` to ``end`` s."""
    body = Bodies(np.array(moments), np.asarray(torque, dtype=float), forcing)
    start = MotionStretch(body, begin, rates, quaternion)
    return list(polynomials(start, end - begin, most))


def arc(
    A: float,
    C: float,
    growth: float,
    quaternion: Array,
    omega: complex,
    spin: float,
    times: Array | float,
    wheel: float = 0.0,
    sense: float = 1.0,
) -> tuple[Any, Any, Array]:
    """ω, ω3 and attitude on a coast at ``times`` (n,) s; at one time by plain numbers."""
    body = Bodies(np.array([A, A, C]), np.zeros(3), Forcing((), growth, wheel, sense))
    start = MotionStretch(body, 0.0, np.array([omega.real, omega.imag, spin]), quaternion)
    if isinstance(times, float):
        rates, turned = Piece(start, times).end()
        return complex(*rates[:2]), float(rates[2]), turned
    rates, turned = Piece(start, math.inf).motion(times)
    return rates[:, 0] + 1j * rates[:, 1], rates[:, 2], turned


def about(axis: Array | Sequence[float], angle: float) -> Array:
    """Rotation matrix by Rodrigues' formula."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K)


def turning(*torques: tuple[complex, float]) -> Callable[[float], tuple[float, float, float]]:
    """Torque at each moment of transverse torques (N m) that turn in the body at so many rad/s."""

    def torque(t: float) -> tuple[float, float, float]:
        total = sum(
            (size * complex(math.cos(rate * t), math.sin(rate * t)) for size, rate in torques), 0j
        )
        return total.real, total.imag, 0.0

    return torque


def driven(
    moments: Sequence[float],
    motion: Motion,
    torque: Callable[[float], Sequence[float] | Array],
    times: Sequence[float] | Array,
    growth: float = 0.0,
) -> list[Motion]:
    """The motion at ``times[1:]`` under a body torque, from ``motion`` at ``times[0]``, by DOP853.

    With a ``growth`` κ dissipation adds κ H1 cos²θ, κ H2 cos²θ, -κ H3 sin²θ, and the attitude slips
    as |H| stays.
    """
    A, B, C = (float(one) for one in moments)

    def slope(t: float, y: Array) -> list[float]:
        p, q, r, *rotation = y.tolist()
        m1, m2, m3 = torque(t)
        slip = 0.0
        if growth:
            h1, h2, h3 = A * p, B * q, C * r
            size = h1 * h1 + h2 * h2 + h3 * h3
            m1, m2 = m1 + growth * h1 * h3 * h3 / size, m2 + growth * h2 * h3 * h3 / size
            m3 -= growth * h3 * (h1 * h1 + h2 * h2) / size
            slip = growth * h3 / size
        rates = [(m1 - (C - B) * q * r) / A, (m2 - (A - C) * r * p) / B, (m3 - (B - A) * p * q) / C]
        return [*rates, *rotation_rates(rotation, p + slip * B * q, q - slip * A * p, r)]

    start = np.concatenate([motion.rates, motion.rotation.ravel()])
    flown = solve_ivp(
        slope, (times[0], times[-1]), start, "DOP853", times[1:], rtol=RTOL, atol=0.1 * RTOL
    )
    assert flown.success
    return [Motion(y[:3], y[3:].reshape(3, 3)) for y in flown.y.T]


# --- strategies of hypothesis: spinning bodies and schedules

UNTIL = 12.0
"""End, s, of the flights of `schedules`."""

angles = st.floats(-math.pi, math.pi)
spins = st.floats(0.5, 3.0) | st.floats(-3.0, -0.5)


@st.composite
def symmetric_spinners(draw: st.DrawFn) -> Spacecraft:
    a = draw(st.floats(-1.0, 0.9) | st.sampled_from([0.0, 1e-6, -1e-6, -1.0]))
    degrees = draw(st.floats(0.1, 80.0))
    return spinner(100.0, 100.0 * (1 - a), draw(spins), degrees, draw(angles))


@st.composite
def triaxial_spinners(draw: st.DrawFn) -> Spacecraft:
    """Triangle inequality kept: I1 = y² + z² and round of a mass distribution."""
    x, y, z = (draw(st.floats(30.0, 80.0)) for _ in range(3))
    return spinner(
        spin=draw(spins),
        degrees=draw(st.floats(0.1, 60.0)),
        phase=draw(angles),
        moments=(y + z, z + x, x + y),
    )


@st.composite
def schedules(draw: st.DrawFn, *, ideal: bool = False, axial: bool = True) -> Schedule:
    """Up to five pulses of different channels, which may overlap and be of any width."""
    pulses = []
    for index in range(draw(st.integers(0, 5))):
        on_time = 0.0 if ideal else draw(st.sampled_from([0.0, 0.01]) | st.floats(0.05, 3.0))
        t = draw(st.floats(0.5 * on_time, UNTIL - 0.5 * on_time))
        impulse = [draw(st.floats(-40.0, 40.0)) for _ in range(2)] + [
            draw(st.floats(-60.0, 60.0)) if axial else 0.0
        ]
        pulses.append(pulse(t, on_time, np.array(impulse), f"T{index}"))
    return Schedule(tuple(pulses))
