"""Torque-free motion of a body with three different principal moments, in closed form, and its cone
angles.

Euler's equations I1 dω1/dt = (I2 - I3) ω2 ω3 and round ("Kreiseltheorie" 24.2) are solved by
Jacobi's functions. Here c is the axis, of largest or least moment, that the motion goes about; b
that of the middle moment, a the other extreme: ω_a ~ cn, ω_b ~ sn, ω_c ~ dn of p t + const. With
d_xy = |I_x - I_y|:

    D² = ω_c² + I_b d_ba/(I_c d_ca) ω_b²         the largest ω_c
    p² = D² d_ca d_cb/(I_a I_b)                  pace
    Q  = I_c d_cb ω_c² - I_a d_ba ω_a² >= 0      |H² - 2T I_b|, zero on the separatrix
    P  = I_a d_ca ω_a² + I_b d_cb ω_b²           |H² - 2T I_c|, zero without nutation
    1 - m = Q/(I_c d_cb D²)                      complementary parameter

The addition theorems give the motion from the rates at t = 0 by sn, cn, dn of p t alone: no limit
divides by a vanishing quantity.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nutdamp.physics import attitude
from nutdamp.physics import body as rigid_body

Array = NDArray[np.float64]

NEGLIGIBLE = 1e-140
"""Fraction of the largest rate below which a rate counts as zero, as does a sine: its square would
underflow.
"""

# largest number of steps to an arithmetic-geometric mean; from the smallest number it takes twelve
MEANS = 40
MODES_REACH = (
    40.0  # exponent to which Fourier coefficients are kept: exp(-40) is less than a rounding
)


def free_rates(moments: ArrayLike, rates0: ArrayLike, times: ArrayLike) -> Array:
    """Body rates (n, 3) in rad/s at ``times`` (n,) s from ``rates0`` (3,) at t = 0, exact for any
    motion.

    ``moments`` (I1, I2, I3) in kg m², in any order, equal ones included. Errors stay below 1e-12 of
    |ω| over 100 periods, up to the separatrix and on it, with the given numbers taken as exact;
    their uncertainty moves the phase by about 1/(1 - m) times as much each period, as it does for
    the spacecraft itself.
    """
    polhode = _polhode(moments, rates0)
    return polhode.rate_unit * _rates(polhode, polhode.rate_unit * np.asarray(times, dtype=float))


def free_attitude(
    moments: ArrayLike, rates0: ArrayLike, quaternion0: ArrayLike, times: ArrayLike
) -> Array:
    """Attitude (n, 4), body -> inertial, of torque-free motion from ``quaternion0`` (4,) at t = 0.

    With e the unit vector of axis c on the side of H, and S the shortest turn of H's direction in
    the body to e, R(t) = R(0) S(0)⁻¹ Rot_e(χ) S(t), because H is fixed in space. What is left is
    the turn χ about it, at dχ/dt = (2T + |H| ω_e)/(|H| + I_c ω_e): nowhere singular, since I_c ω_e
    >= 0. Its integral is summed as a Fourier series over a period of ω_e. Errors: a few roundings
    of the angle turned, below 1e-11 rad over 100 periods.
    """
    polhode = _polhode(moments, rates0)
    start = np.asarray(quaternion0, dtype=float)
    scaled = polhode.rate_unit * np.asarray(times, dtype=float)
    if polhode.pace == 0.0:
        return attitude.multiply(start, _turn(polhode.rates, scaled))
    c = polhode.axes[2]
    e = np.zeros(3)
    e[c] = math.copysign(1.0, polhode.rates[c])
    momentum = polhode.moments * polhode.rates
    size = float(np.linalg.norm(momentum))
    twice_energy = float(momentum @ polhode.rates)
    # Of χ the part that swings about 2T t/|H| is split off: its factor H² - 2T I_c vanishes with
    # the nutation.
    swing = math.copysign(
        polhode.about_c / size, polhode.moments[polhode.axes[0]] - polhode.moments[c]
    )
    chi = twice_energy / size * scaled + swing * _swing(polhode, size, scaled)
    back = attitude.conjugate(_shortest(momentum, e))
    there = _shortest(polhode.moments * _rates(polhode, scaled), e)
    result = attitude.multiply(
        attitude.multiply(attitude.multiply(start, back), _turn(e, chi)), there
    )
    return np.asarray(result / np.linalg.norm(result, axis=-1, keepdims=True), dtype=np.float64)


def body_nutation_rate(moments: ArrayLike, spin: float, wheel: float = 0.0) -> float:
    """Rate of a small nutation about axis 3 seen in the body, rad/s, signed: ω3 sqrt((I1 - I3)(I2 -
    I3)/(I1 I2)).

    Positive like aω3 for spin about the axis of least moment and ω3 > 0, and aω3 itself for I1 =
    I2, Magnus 1970 (12). The mean of I1 and I2 instead misses it: 0.818 for 0.775 rad/s with 120,
    100, 80 kg m² and 3 rad/s. Zero where I3 equals another moment, even if rounding has put it on
    the wrong side. With a ``wheel`` of h N m s the root is of (I1ω3 - H3)(I2ω3 - H3)/(I1 I2), H3 =
    I3ω3 + h. Raises ValueError where there is no nutation but growth, as for spin about the
    intermediate axis without wheel.
    """
    first, second, third = (float(moment) for moment in np.asarray(moments, dtype=float))
    leading = ((first - third) * spin - wheel) / first
    square = leading * (((second - third) * spin - wheel) / second)
    if square < 0.0 and (wheel != 0.0 or rigid_body.axis_class(moments) == "intermediate"):
        raise ValueError("spin about the axis of the middle moment has no nutation rate")
    return math.copysign(math.sqrt(max(square, 0.0)), leading)


def nutation_period(moments: ArrayLike, rates0: ArrayLike) -> float:
    """Period 4K/p of the body rates, s, at any amplitude; about 2π/|`body_nutation_rate`| for small
    ones.

    Infinite on the separatrix and where the rates are constant for want of a restoring couple.
    """
    polhode = _polhode(moments, rates0)
    if polhode.pace == 0.0 or polhode.complement == 0.0:
        return math.inf
    quarter = 0.5 * math.pi / _means(polhode.complement)[1]
    return 4.0 * quarter / (polhode.pace * polhode.rate_unit)


def widest_cones(
    moments: Array, rates: Array, sense: float, wheel: ArrayLike = 0.0
) -> tuple[Array, Array]:
    """Nutation and body cone (...), rad, at the instant of largest nutation on the torque-free
    motion of bodies with ``moments`` through ``rates`` (3, ...).

    The spin axis is ``sense``·e3. Constant with I1 = I2; else θ swings between two values while H
    is fixed in space.

    Where H3 has fallen by δ, |H| and the energy leave H2² = H2(0)² + [2(ω3 - H3/I1)δ + (1/I1 -
    1/I3)δ²]/(1/I2 - 1/I1), H3 and ω3 at t = 0, and H1² likewise: H3 turns back at the first δ at
    which either vanishes.
    """
    third = moments[2]
    spin = sense * rates[2]
    axial = sense * (moments[2] * rates[2] + wheel)
    across = moments[:2] * rates[:2]
    falls = []
    with np.errstate(divide="ignore", invalid="ignore"):
        for kept in (0, 1):  # the component that is left where the other vanishes
            apart = 1.0 / moments[1 - kept] - 1.0 / moments[kept]
            bend = (1.0 / moments[kept] - 1.0 / third) / apart
            slope = 2.0 * (spin - axial / moments[kept]) / apart
            falls.append(_first_zero(across[1 - kept] ** 2, slope, bend))
    fall = np.where(moments[0] == moments[1], 0.0, np.minimum(*falls))
    left = np.sqrt(np.maximum(across[0] ** 2 + across[1] ** 2 + fall * (2.0 * axial - fall), 0.0))
    transverse = left / np.where(falls[0] <= falls[1], moments[0], moments[1])
    after = axial - fall
    return np.arctan2(left, after), np.arctan2(
        transverse, (after - sense * np.asarray(wheel)) / third
    )


def _first_zero(value: Array, slope: Array, bend: Array) -> Array:
    """First x >= 0 at which ``value`` + ``slope`` x + ``bend`` x², ``value`` >= 0, turns negative;
    infinite: never.
    """
    square = slope * slope - 4.0 * bend * value
    root = np.sqrt(np.maximum(square, 0.0))
    rising = np.where(bend < 0.0, -0.5 * (slope + root) / bend, np.inf)
    zero = np.where(
        square < 0.0, np.inf, np.where(slope < 0.0, 2.0 * value / (root - slope), rising)
    )
    return np.where(
        (value == 0.0) & (slope == 0.0), 0.0, zero
    )  # at rest there, even if not for long


class _ScaledPolhode(NamedTuple):
    """Path of ω in the body; moments and rates scaled by powers of two
    against under- and overflow.
    """

    axes: tuple[int, int, int]  # a, b, c
    moments: Array
    rates: Array
    rate_unit: float
    largest: float  # D
    pace: float  # p; zero where the rates are constant
    complement: float  # 1 - m
    about_c: float  # P


def _polhode(moments: ArrayLike, rates0: ArrayLike) -> _ScaledPolhode:
    inertia, rates = np.array(moments, dtype=float), np.array(rates0, dtype=float)
    inertia /= _unit(inertia)
    rate_unit = _unit(rates)
    rates /= rate_unit
    rates[np.abs(rates) < NEGLIGIBLE] = 0.0
    least, b, most = (int(axis) for axis in np.argsort(inertia, kind="stable"))
    # H² - 2T I_b, positive about the axis of the largest moment, zero on the separatrix: rational,
    # to keep all digits.
    i_least, i_middle, i_most = (Fraction(float(inertia[axis])) for axis in (least, b, most))
    w_least, w_most = Fraction(float(rates[least])), Fraction(float(rates[most]))
    balance = float(
        i_most * (i_most - i_middle) * w_most**2 - i_least * (i_middle - i_least) * w_least**2
    )
    a, c = (least, most) if balance >= 0.0 else (most, least)
    d_ca, d_cb, d_ba = (abs(float(inertia[x] - inertia[y])) for x, y in ((c, a), (c, b), (b, a)))
    about_c = float(inertia[a] * d_ca * rates[a] ** 2 + inertia[b] * d_cb * rates[b] ** 2)
    largest, pace, complement = 0.0, 0.0, 1.0
    # Otherwise every product ω_x ω_y (I_x - I_y) is zero.
    if d_cb > 0.0 and rates[c] != 0.0:
        largest = math.sqrt(rates[c] ** 2 + inertia[b] * d_ba / (inertia[c] * d_ca) * rates[b] ** 2)
        pace = largest * math.sqrt(d_ca / inertia[a] * (d_cb / inertia[b]))
        complement = min(abs(balance) / (inertia[c] * d_cb * largest**2), 1.0)
    return _ScaledPolhode((a, b, c), inertia, rates, rate_unit, largest, pace, complement, about_c)


def _unit(values: Array) -> float:
    """Power of two near the largest value: dividing by it rounds nothing."""
    largest = float(np.max(np.abs(values)))
    return math.ldexp(1.0, math.frexp(largest)[1] - 1) if largest > 0.0 else 1.0


def _rates(polhode: _ScaledPolhode, times: Array) -> Array:
    """Scaled rates at scaled times: addition theorems, with the amplitudes written as dω/dt at t =
    0.

    ω_a(t) = (ω_a cn + ω_a' sn dn/p)/N, ω_b(t) = (ω_b cn dn + ω_b' sn/p)/N, ω_c(t) = (ω_c dn + ω_c'
    sn cn/p)/N with N = cn² + sn² (ω_c/D)², all of them of p t.
    """
    rates, inertia, (a, b, c) = polhode.rates, polhode.moments, polhode.axes
    if polhode.pace == 0.0:
        return np.broadcast_to(rates, (*times.shape, 3)).copy()
    slope = (
        (np.roll(inertia, -1) - np.roll(inertia, -2))
        / inertia
        * np.roll(rates, -1)
        * np.roll(rates, -2)
    )
    sn, cn, dn = _jacobi(polhode.pace * times, polhode.complement)
    gone = sn / polhode.pace
    norm = np.square(cn) + np.square(sn * (rates[c] / polhode.largest))
    result = np.empty((*times.shape, 3))
    result[..., a] = (rates[a] * cn + slope[a] * gone * dn) / norm
    result[..., b] = (rates[b] * cn * dn + slope[b] * gone) / norm
    result[..., c] = (rates[c] * dn + slope[c] * gone * cn) / norm
    return result


def _swing(polhode: _ScaledPolhode, size: float, times: Array) -> Array:
    """∫ |ω_c|/(|H| + I_c |ω_c|) dt from 0 to scaled ``times``."""
    if polhode.complement == 0.0:
        return _swing_on_separatrix(polhode, size, times)
    c = polhode.axes[2]
    mean = _means(polhode.complement)[1]
    period = 2.0 * (0.5 * math.pi / mean) / polhode.pace
    # The integrand is regular within K' of the real axis, so that its coefficients fall like exp(-π
    # k K'/K).
    parameter_agm = _means(1.0 - polhode.complement)[1] if polhode.complement < 1.0 else 0.0
    modes = 2 + math.ceil(MODES_REACH / math.pi * parameter_agm / mean)
    count = 2 * modes + 1
    rate = np.abs(_rates(polhode, np.linspace(0.0, period, count, endpoint=False))[:, c])
    coefficients = np.fft.rfft(rate / (size + polhode.moments[c] * rate)) / count
    total = coefficients[0].real * times
    for k, coefficient in enumerate(coefficients[1:], 1):
        half = math.pi * k / period * times
        total += (
            2.0 * period / (math.pi * k) * np.sin(half) * (coefficient * np.exp(1j * half)).real
        )
    return np.asarray(total)


def _swing_on_separatrix(polhode: _ScaledPolhode, size: float, times: Array) -> Array:
    """`_swing` without a period: ω_c = D sech u, so that the integrand is D/(|H|(cosh u + ε)), ε =
    I_c D/|H|.

    sqrt(1 - ε²) is I_a |ω_a|/|H| at ω_b = 0, free of cancellation.
    """
    a, b, c = polhode.axes
    inertia, rates = polhode.moments, polhode.rates
    d_ca, d_ba = abs(inertia[c] - inertia[a]), abs(inertia[b] - inertia[a])
    epsilon = inertia[c] * polhode.largest / size
    root = math.sqrt(inertia[a] * polhode.about_c / d_ca) / size
    # At the start |sinh u| is |ω_b/ω_c| times the ratio of their largest values; u > 0 where |ω_c|
    # falls.
    following, last = (c + 1) % 3, (c + 2) % 3
    rising = (inertia[following] - inertia[last]) * rates[following] * rates[last] * rates[c]
    sinh = math.sqrt(inertia[b] * d_ba / (inertia[c] * d_ca)) * abs(rates[b] / rates[c])
    u0 = math.copysign(math.asinh(sinh), -rising)
    shape = root / (1.0 + epsilon)
    angles = np.arctan(shape * np.tanh(0.5 * (u0 + polhode.pace * times))) - math.atan(
        shape * math.tanh(0.5 * u0)
    )
    return np.asarray(2.0 * polhode.largest / (polhode.pace * size * root) * angles)


def _shortest(momentum: Array, e: Array) -> Array:
    """Quaternion of the shortest turn that takes the direction of ``momentum`` (..., 3) to the unit
    vector ``e``.
    """
    size = np.linalg.norm(momentum, axis=-1, keepdims=True)
    quaternion = np.concatenate([size + momentum @ e[:, None], np.cross(momentum, e)], axis=-1)
    return np.asarray(
        quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True), dtype=np.float64
    )


def _turn(rates: Array, times: Array) -> Array:
    """Quaternions (n, 4) of turns at constant ``rates`` (3,)."""
    rate = float(np.linalg.norm(rates))
    half = 0.5 * rate * times
    direction = rates / rate if rate > 0.0 else rates
    return np.concatenate([np.cos(half)[..., None], np.sin(half)[..., None] * direction], axis=-1)


def _means(complement: float) -> tuple[list[tuple[float, float]], float]:
    """Arithmetic and geometric means from 1 and sqrt(1 - m) on, and their limit, π/2 over the
    quarter period K.
    """
    arithmetic = 1.0
    geometric = math.sqrt(complement)
    pairs = [(arithmetic, geometric)]
    for _ in range(MEANS):
        if (
            not arithmetic - geometric > 1e-8 * arithmetic
        ):  # the next difference is the square of this one
            break
        arithmetic, geometric = 0.5 * (arithmetic + geometric), math.sqrt(arithmetic * geometric)
        pairs.append((arithmetic, geometric))
    return pairs, 0.5 * (arithmetic + geometric)


def _jacobi(u: Array, complement: float) -> tuple[Array, Array, Array]:
    """sn, cn, dn of u (n,) by descending Landen transformations (Bulirsch 1965), from 1 - m in [0,
    1].

    Taking 1 - m keeps the relative accuracy of cn and dn near m = 1, where scipy.special.ellipj
    leaves its period.
    """
    if complement == 0.0:
        decay = np.exp(-np.abs(u))
        sech = 2.0 * decay / (1.0 + np.square(decay))
        return np.tanh(u), sech, sech
    pairs, mean = _means(complement)
    sine = np.sin(mean * u)
    cosine = np.cos(mean * u)
    still = np.abs(sine) < NEGLIGIBLE
    cot = cosine / np.where(still, 1.0, sine)
    ratio = mean * cot
    dn = np.ones_like(u)
    for arithmetic, geometric in reversed(pairs):
        cot = cot * ratio
        ratio = ratio * dn
        dn = (geometric + cot) / (arithmetic + cot)
        cot = ratio / arithmetic
    sn = np.copysign(1.0 / np.sqrt(np.square(ratio) + 1.0), sine)
    return (
        np.where(still, sine / mean, sn),
        np.where(still, np.copysign(1.0, cosine), ratio * sn),
        np.where(still, 1.0, dn),
    )
