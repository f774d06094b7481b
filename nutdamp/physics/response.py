"""Body rates under pulses, in closed form: Magnus 1970 (15)-(17).

Equation of motion in time, Magnus 1970 (1) and (4)-(6) without the division by ω3, ω = ω1 + iω2:
dω/dt = -i a ω3(t) ω + M(t)/A,  dω3/dt = M3/C. Nothing is divided by ω3 (Magnus' m = M/(Aω3) breaks
where the spin passes zero) or by a (a sphere is no exception). M = M1 + iM2 in N m, body-fixed
unless stated.
"""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.numerics import rising_zero

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# largest half-phase in rad that one power series of `width_factor` spans; beyond it digits cancel
SERIES_REACH = 2.0
MANY_PANELS = 12  # panels from which on all are summed at once
SERIES_ORDERS = 60  # orders of that power series: it has converged long before

OUTWARDS = 2000
"""Largest number of steps outwards by a tenth in the search for an on-time: more decades than
numbers have.
"""

# panels beyond which a pulse keeps less than 1e-4 of its impulse; it counts as keeping none
MOST_PANELS = 20_000


def impulse_sum(
    times: Array,
    omega0: complex,
    spin0: float,
    A: float,
    C: float,
    pulse_times: Array,
    transverse: ComplexArray,
    axial: Array,
    wheel: float = 0.0,
) -> tuple[ComplexArray, Array]:
    """Rates after a sum of impulses, Magnus 1970 (17), exact at any angle for symmetric bodies.

    ω(t) = e^{-iaα(t)} [ω0 + (1/A) Σ J_v e^{iaα(t_v)}] over the pulses with t_v <= t, where α = ∫ω3
    dt (Magnus (2)): an axial impulse J3 changes the spin by J3/C, and the arcs between stay exact,
    through spin reversal too. With energy dissipation ω3 changes along the arcs, and the sum has to
    be taken arc by arc (`propagation.by_impulses`). A ``wheel`` of momentum h N m s turns ω by h
    t/A besides.

    ``times`` (n,) s; ``pulse_times`` (k,) s ascending; ``transverse`` (k,) J1 + iJ2 and ``axial``
    (k,) J3 in N m s. Returns ω (n,) and ω3 (n,) in rad/s; at t = t_v the pulse has been given.
    """
    a = (A - C) / A
    spins = spin0 + np.concatenate([[0.0], np.cumsum(axial)]) / C
    knots = np.concatenate([[0.0], pulse_times])
    turned = np.concatenate([[0.0], np.cumsum(spins[:-1] * np.diff(knots))])
    before = np.exp(1j * (a * turned[1:] - wheel / A * knots[1:]))
    sums = omega0 + np.concatenate([[0.0], np.cumsum(transverse * before)]) / A
    given = np.searchsorted(pulse_times, times, side="right")
    alpha = turned[given] + spins[given] * (times - knots[given])
    return sums[given] * np.exp(-1j * (a * alpha - wheel / A * times)), spins[given]


def width_factor(
    rate: float, slope: float, on_time: float, growth: float = 0.0, drift: float = 0.0
) -> complex:
    """Factor on the impulse of a rectangular pulse at its centre, for its effect on ω.

    The nutation turns in the body at ν = ``rate`` + ``slope``·(time since start), rad/s: aω3 + a
    M3/C t for a constant body torque with axial part, aω3 - h/A with a wheel. The pulse acts on ω
    exactly as an impulse M τ F at its centre, when ν jumps there by slope·τ: F = (1/τ) ∫ exp(i
    (rate s + slope (s + τ/2)²/2)) ds over |s| <= τ/2. Without axial part this is sinc(ντ/2), sinc x
    = sin x / x. Energy dissipation (``growth`` κ in 1/s, see `energy_sink`) turns ν into ν + iκ, by
    its small-angle part: during the pulse alone, where what is neglected is of order κτ ντ θ²/12.
    ``drift`` (rad/s²) is a change of ν that goes on after the pulse.
    """
    half = 0.5 * on_time
    if growth != 0.0:
        from nutdamp.physics.energy_sink import FOR_EVER  # dissipation

        most = FOR_EVER / half if half > 0.0 else 0.0
        growth = math.copysign(min(abs(growth), most), growth)
    if slope == 0.0 and drift == 0.0:
        angle = (rate + 1j * growth) * half
        return cmath.sin(angle) / angle if angle != 0.0 else 1.0 + 0.0j
    offset = 0.5 * slope * half * half
    pace = rate + (slope + drift) * half + 1j * growth
    bend = 0.5 * (slope + drift)
    turned = (abs(pace) + abs(bend) * half) * half
    if not turned <= MOST_PANELS * SERIES_REACH:
        return 0.0 + 0.0j
    panels = math.ceil(turned / SERIES_REACH) or 1
    width = half / panels
    if panels >= MANY_PANELS:
        middles = (2 * np.arange(panels) + 1 - panels) * width
        turns = np.exp(1j * (offset + (pace + bend * middles) * middles))
        return complex(np.mean(turns * _mean_of_phase(pace + 2 * bend * middles, bend, width)))
    total = 0.0 + 0.0j
    for panel in range(panels):
        middle = (2 * panel + 1 - panels) * width
        phase = offset + (pace + bend * middle) * middle
        total += cmath.exp(1j * phase) * _mean_of_phase(pace + 2 * bend * middle, bend, width)
    return total / panels


def _mean_of_phase(slope: Any, bend: float, half: float) -> Any:
    """Mean of exp(i(slope s + bend s²)) over |s| <= half, by its power series; ``slope`` is a
    number or an array.
    """
    # terms c_k half^k of the series of the integrand
    before = 0.0 * slope
    term = 1.0 + 0.0 * slope
    total = term
    for order in range(SERIES_ORDERS):
        sizes = abs(term) + abs(before)
        if order >= 4 and (sizes if isinstance(sizes, float) else sizes.max()) <= 1e-18:
            break
        after = 1j * half * (slope * term + 2 * bend * half * before) / (order + 1)
        before, term = term, after
        if order % 2 == 1:
            total = total + term / (order + 2)
    return total


def on_time_for(
    impulse: float, torque: float, rate: float, slope: float, longest: float
) -> float | None:
    """On-time in s of the rectangular pulse that acts on ω like ``impulse`` N m s; None if none up
    to ``longest``.

    ``torque`` is |M1 + iM2| > 0 in N m, ``rate`` ν and ``slope`` as in `width_factor`. Without
    axial torque τ = (2/ν) asin(νJ/(2M)), with the limit J/M for ν -> 0 (US patent 4504032 fires by
    the same formula); a torque that holds longer than half a nutation period works against itself,
    so 2M/|ν| is the most that one pulse can do.
    """
    sine = 0.5 * abs(rate) * impulse / torque
    if sine > 1.0 and slope == 0.0:
        return None
    plain = impulse / torque * (math.asin(min(sine, 1.0)) / sine if sine > 0.0 else 1.0)
    if slope == 0.0:
        return plain if plain <= longest else None

    def excess(on_time: float) -> float:
        return torque * on_time * abs(width_factor(rate, slope, on_time)) - impulse

    # From the pulse without axial torque outwards: the first on-time that does enough lies in the
    # last step.
    low = 0.0
    high = min(plain, longest)
    for _ in range(OUTWARDS):
        if excess(high) >= 0.0:
            return rising_zero(excess, low, high)
        if high >= longest or (abs(rate) + 0.5 * abs(slope) * high) * high > 2.0 * math.pi:
            return None
        low = high
        high = min(1.1 * high, longest)
    return None
