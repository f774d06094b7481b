"""Body rates under pulses, in closed form: ω = ω1 + iω2 turns in the body at -a ω3, and torques add to it.

Equation of motion in time, Magnus 1970 (1) and (4)-(6) without the division by ω3:
dω/dt = -i a ω3(t) ω + M(t)/A,  dω3/dt = M3/C.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.physics import energy_sink

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

SERIES_REACH = 2.0
"""Largest half-phase in rad that one power series of `width_factor` spans; beyond it digits cancel."""

MANY_PANELS = 12
"""Panels from which on all are summed at once."""

SERIES_ORDERS = 60
"""Orders of that power series: it has converged long before."""

OUTWARDS = 2000
"""Steps of a tenth outwards, at most, in which an on-time is sought: over more decades than there are in a number."""

MOST_PANELS = 20_000
"""A pulse over more phase than these span keeps less than 1e-4 of its impulse; it counts as keeping none."""


def impulse_sum(
    times: Array,
    omega0: complex,
    spin0: float,
    A: float,
    C: float,
    pulse_times: Array,
    transverse: ComplexArray,
    axial: Array,
) -> tuple[ComplexArray, Array]:
    """Rates after a sum of impulses, Magnus 1970 (17), exact at any angle for symmetric bodies.

    ω(t) = e^{-iaα(t)} [ω0 + (1/A) Σ J_v e^{iaα(t_v)}] over the pulses with t_v <= t, where α = ∫ω3 dt (Magnus (2)):
    an axial impulse J3 changes the spin by J3/C, and the arcs between stay exact, through spin reversal too. With
    energy dissipation ω3 changes along the arcs, and the sum has to be taken arc by arc (`flight.by_impulses`).

    ``times`` (n,) s; ``pulse_times`` (k,) s ascending; ``transverse`` (k,) J1 + iJ2 and ``axial`` (k,) J3 in N m s.
    Returns ω (n,) and ω3 (n,) in rad/s; at t = t_v the pulse has been given.
    """
    a = (A - C) / A
    spins = spin0 + np.concatenate([[0.0], np.cumsum(axial)]) / C
    knots = np.concatenate([[0.0], pulse_times])
    turned = np.concatenate([[0.0], np.cumsum(spins[:-1] * np.diff(knots))])
    before = np.exp(1j * a * turned[1:])
    sums = omega0 + np.concatenate([[0.0], np.cumsum(transverse * before)]) / A
    given = np.searchsorted(pulse_times, times, side="right")
    alpha = turned[given] + spins[given] * (times - knots[given])
    return sums[given] * np.exp(-1j * a * alpha), spins[given]


def width_factor(
    a: float, spin: float, spin_rate: float, on_time: float, growth: float = 0.0, drift: float = 0.0
) -> complex:
    """What a rectangular pulse loses on ω by its width, as a factor on its impulse at the centre.

    For a constant body torque with axial part, ω3 = spin + spin_rate·(time since start) with spin_rate = M3/C, the
    pulse acts on ω exactly as an impulse M τ F at its centre, when ω3 jumps there by spin_rate·τ:
    F = (1/τ) ∫ exp(i a (spin s + spin_rate (s + τ/2)²/2)) ds over |s| <= τ/2. Without axial part this is
    sinc(a ω3 τ/2), sinc x = sin x / x. Energy dissipation (``growth`` κ in 1/s, see `energy_sink`) turns a ω3 into
    a ω3 + iκ, by its small-angle part: during the pulse alone, where what is neglected is of order κτ a ω3 τ θ²/12.
    ``drift`` (rad/s²) is a spin acceleration that goes on after the pulse.
    """
    half = 0.5 * on_time
    growth = math.copysign(min(abs(growth), energy_sink.FOR_EVER / half), growth) if half > 0.0 else 0.0
    if spin_rate == 0.0 and drift == 0.0:
        angle = (a * spin + 1j * growth) * half
        return cmath.sin(angle) / angle if angle != 0.0 else 1.0 + 0.0j
    offset = 0.5 * a * spin_rate * half * half
    slope, bend = a * (spin + (spin_rate + drift) * half) + 1j * growth, 0.5 * a * (spin_rate + drift)
    turned = (abs(slope) + abs(bend) * half) * half
    if not turned <= MOST_PANELS * SERIES_REACH:
        return 0.0 + 0.0j
    panels = math.ceil(turned / SERIES_REACH) or 1
    width = half / panels
    if panels >= MANY_PANELS:
        middles = (2 * np.arange(panels) + 1 - panels) * width
        turns = np.exp(1j * (offset + (slope + bend * middles) * middles))
        return complex(np.mean(turns * _mean_of_phase(slope + 2 * bend * middles, bend, width)))
    total = 0.0 + 0.0j
    for panel in range(panels):
        middle = (2 * panel + 1 - panels) * width
        phase = offset + (slope + bend * middle) * middle
        total += cmath.exp(1j * phase) * _mean_of_phase(slope + 2 * bend * middle, bend, width)
    return total / panels


def _mean_of_phase(slope: Any, bend: float, half: float) -> Any:
    """Mean of exp(i(slope s + bend s²)) over |s| <= half, for one ``slope`` or many, by its power series."""
    before, term = 0.0 * slope, 1.0 + 0.0 * slope  # terms c_k half^k of the series of the integrand
    total = term
    for order in range(SERIES_ORDERS):
        if order >= 4 and _largest(abs(term) + abs(before)) <= 1e-18:
            break
        after = 1j * half * (slope * term + 2 * bend * half * before) / (order + 1)
        before, term = term, after
        if order % 2 == 1:
            total = total + term / (order + 2)
    return total


def _largest(sizes: float | Array) -> float:
    return sizes if isinstance(sizes, float) else float(sizes.max())


def on_time_for(impulse: float, torque: float, a: float, spin: float, spin_rate: float, longest: float) -> float | None:
    """On-time in s of the rectangular pulse that acts on ω like ``impulse`` N m s; None if none up to ``longest``.

    ``torque`` is |M1 + iM2| > 0 in N m. Without axial torque τ = (2/(aω3)) asin(aω3 J/(2M)), with the limit J/M
    for a -> 0 (US patent 4504032 fires by the same formula); a torque that holds longer than half a nutation
    period works against itself, so 2M/|aω3| is the most that one pulse can do.
    """
    rate = abs(a * spin)
    sine = 0.5 * rate * impulse / torque
    if sine > 1.0 and spin_rate == 0.0:
        return None
    plain = impulse / torque * (math.asin(min(sine, 1.0)) / sine if sine > 0.0 else 1.0)
    if spin_rate == 0.0:
        return plain if plain <= longest else None

    def excess(on_time: float) -> float:
        return torque * on_time * abs(width_factor(a, spin, spin_rate, on_time)) - impulse

    # From the pulse without axial torque outwards: the first on-time that does enough lies in the last step.
    low, high = 0.0, min(plain, longest)
    for _ in range(OUTWARDS):
        if excess(high) >= 0.0:
            return _crossing(excess, low, high)
        if high >= longest or abs(a) * (abs(spin) + 0.5 * abs(spin_rate) * high) * high > 2.0 * math.pi:
            return None
        low, high = high, min(1.1 * high, longest)
    return None


def _crossing(excess: Callable[[float], float], low: float, high: float) -> float:
    """Where ``excess`` rises through zero between ``low`` and ``high``: false position that halves a stale end."""
    below, above = excess(low), excess(high)
    for _ in range(100):
        if above == 0.0 or high - low <= 2e-16 * high:
            break
        middle = high - above * (high - low) / (above - below)
        if not low < middle < high:
            middle = 0.5 * (low + high)
        value = excess(middle)
        if value < 0.0:
            low, below, above = middle, value, 0.5 * above
        else:
            high, above, below = middle, value, 0.5 * below
    return high
