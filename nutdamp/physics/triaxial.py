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
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nutdamp.common.numerics import TINY
from nutdamp.physics import attitude
from nutdamp.physics import inertia as principal_moments

Array = NDArray[np.float64]

NEGLIGIBLE = 1e-140
"""rad/s below which a rate counts as zero, as does a sine: its square would underflow."""

# largest number of steps to an arithmetic-geometric mean; from the smallest number it takes twelve
MEANS = 40
MODES_REACH = (
    40.0  # exponent to which Fourier coefficients are kept: exp(-40) is less than a rounding
)


def free_rates(moments: ArrayLike, rates0: ArrayLike, times: ArrayLike) -> Array:
    """Body rates (n, 3) in rad/s at ``times`` (n,) s from ``rates0`` (3,) at t = 0, exact for any
    motion.

    ``moments`` (I1, I2, I3) in kg m², in any order, equal ones included. Errors stay below 1e-12 of
    |ω| over 100 periods; near the separatrix a rounding of the numbers moves the phase by about
    1/(1 - m) times as much each period, as it does for the spacecraft itself.
    """
    polhodes = _polhodes(_column(moments), _column(rates0))
    return polhodes.in_body(_rates(polhodes, np.asarray(times, dtype=float))).T


def free_attitude(
    moments: ArrayLike, rates0: ArrayLike, quaternion0: ArrayLike, times: ArrayLike
) -> Array:
    """Attitude (n, 4), body -> inertial, of torque-free motion from ``quaternion0`` (4,) at t = 0:
    see `coasts`.
    """
    start = _column(moments), _column(rates0), _column(quaternion0)
    return coasts(*start, np.asarray(times, dtype=float))[1].T


def _column(values: ArrayLike) -> Array:
    """One body as an array of bodies."""
    return np.asarray(values, dtype=float)[:, None]


def coasts(moments: Array, rates0: Array, quaternion0: Array, times: Array) -> tuple[Array, Array]:
    """Rates (3, n) rad/s and unit quaternions (4, n) of bodies of ``moments`` (3, n) kg m² after
    ``times`` (n,) s, from ``rates0`` (3, n) and ``quaternion0`` (4, n); one body, (3, 1), at n
    times, too.

    With e the unit vector of axis c on the side of H, and S the shortest turn of H's direction in
    the body to e, R(t) = R(0) S(0)⁻¹ Rot_e(χ) S(t), because H is fixed in space. What is left is
    the turn χ about it, at dχ/dt = (2T + |H| ω_e)/(|H| + I_c ω_e): nowhere singular, since I_c ω_e
    >= 0. Its integral is summed as a Fourier series over a period of ω_e. Errors: a few roundings
    of the angle turned, below 1e-11 rad over 100 periods.
    """
    polhodes = _polhodes(moments, rates0)
    start = polhodes.moments * polhodes.rates
    size = np.sqrt(np.sum(start * start, axis=0)) + TINY
    e = np.zeros_like(start)
    e[2] = np.copysign(1.0, polhodes.rates[2])
    twice_energy = np.sum(start * polhodes.rates, axis=0)
    # Of χ the part that swings about 2T t/|H| is split off: its factor H² - 2T I_c vanishes with
    # the nutation.
    swing = np.copysign(polhodes.about_c / size, polhodes.moments[0] - polhodes.moments[2])
    chi = twice_energy / size * times + swing * _swing(polhodes, size, times)
    rates = _rates(polhodes, times)
    end = polhodes.moments * rates
    toward = polhodes.in_body(e)
    cosine, sine = np.cos(0.5 * chi), np.sin(0.5 * chi)
    w, x, y, z = _shortest(polhodes.in_body(start), toward)
    back = attitude.product((w, -x, -y, -z), (cosine, *(sine * toward)))
    turns = np.array(attitude.product(back, _shortest(polhodes.in_body(end), toward)))
    still = polhodes.pace == 0.0
    if np.any(still):
        speed = np.sqrt(np.sum(rates0 * rates0, axis=0)) + TINY
        half = 0.5 * speed * times
        constant = np.array([np.cos(half), *(np.sin(half) / speed * rates0)])
        turns = np.where(still, constant, turns)
    result: Array = np.array(attitude.product(quaternion0, turns))
    return polhodes.in_body(rates), result / np.sqrt(np.sum(result * result, axis=0))


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
    if square < 0.0 and (wheel != 0.0 or principal_moments.axis_class(moments) == "intermediate"):
        raise ValueError("spin about the axis of the middle moment has no nutation rate")
    return math.copysign(math.sqrt(max(square, 0.0)), leading)


def nutation_period(moments: ArrayLike, rates0: ArrayLike) -> float:
    """Period 4K/p of the body rates, s, at any amplitude; about 2π/|`body_nutation_rate`| for small
    ones.

    Infinite on the separatrix and where the rates are constant for want of a restoring couple.
    """
    polhodes = _polhodes(_column(moments), _column(rates0))
    if polhodes.pace[0] == 0.0 or polhodes.complement[0] == 0.0:
        return math.inf
    quarter = 0.5 * math.pi / _means(polhodes.complement)[1]
    return float((4.0 * quarter / polhodes.pace)[0])


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


class _Polhodes(NamedTuple):
    """Paths of ω in n bodies, in their axes a, b and c."""

    axes: NDArray[np.intp]  # (3, n)
    moments: Array  # (3, n)
    rates: Array  # (3, n)
    slopes: Array  # (3, n), dω/dt
    largest: Array  # D, (n,) as all below
    pace: Array  # p; zero where the rates are constant
    complement: Array  # 1 - m
    about_c: Array  # P

    def in_body(self, vectors: Array) -> Array:
        """Vectors (3, n) with their components in the order of the body's axes 1, 2, 3."""
        return np.take_along_axis(vectors, np.argsort(self.axes, axis=0), axis=0)


def _polhodes(moments: Array, rates0: Array) -> _Polhodes:
    """Paths of bodies of ``moments`` (3, n) through ``rates0`` (3, n)."""
    rates = np.where(np.abs(rates0) < NEGLIGIBLE, 0.0, rates0)
    order = np.argsort(moments, axis=0, kind="stable")
    inertia, sorted_rates = (np.take_along_axis(each, order, axis=0) for each in (moments, rates))
    # H² - 2T I_b, positive about the axis of the largest moment, zero on the separatrix
    least, middle, largest = inertia
    ups = largest * (largest - middle) * sorted_rates[2] ** 2
    downs = least * (middle - least) * sorted_rates[0] ** 2
    balance = ups - downs
    reverse = balance < 0.0
    axes, inertia, rates = (
        np.where(reverse, each[::-1], each) for each in (order, inertia, sorted_rates)
    )
    # a, b, c follow one another round, or b, a, c do
    round_about = np.where((axes[1] - axes[0]) % 3 == 1, 1.0, -1.0)
    after, last = [1, 2, 0], [2, 0, 1]
    slopes = round_about * (inertia[after] - inertia[last]) / inertia * rates[after] * rates[last]
    a, b, c = inertia
    d_ca, d_cb, d_ba = np.abs(c - a), np.abs(c - b), np.abs(b - a)
    about_c = a * d_ca * rates[0] ** 2 + b * d_cb * rates[1] ** 2
    # Otherwise every product ω_x ω_y (I_x - I_y) is zero.
    moves = (d_cb > 0.0) & (rates[2] != 0.0)
    apart = np.where(moves, d_ca, 1.0)
    top = np.sqrt(rates[2] ** 2 + b * d_ba / (c * apart) * rates[1] ** 2)
    pace = np.where(moves, top * np.sqrt(d_ca / a * (d_cb / b)), 0.0)
    whole = np.where(moves, c * d_cb * top**2, 1.0)
    complement = np.where(moves, np.minimum(np.abs(balance) / whole, 1.0), 1.0)
    return _Polhodes(axes, inertia, rates, slopes, top, pace, complement, about_c)


def _rates(polhodes: _Polhodes, times: Array) -> Array:
    """Rates (3, ...) about a, b, c at ``times``: addition theorems, with the amplitudes
    written as dω/dt at t = 0.

    ω_a(t) = (ω_a cn + ω_a' sn dn/p)/N, ω_b(t) = (ω_b cn dn + ω_b' sn/p)/N, ω_c(t) = (ω_c dn + ω_c'
    sn cn/p)/N with N = cn² + sn² (ω_c/D)², all of them of p t.
    """
    moves = polhodes.pace > 0.0
    pace = np.where(moves, polhodes.pace, 1.0)
    largest = np.where(moves, polhodes.largest, 1.0)
    sn, cn, dn = _jacobi(pace * times, polhodes.complement)
    passed = sn / pace
    norm = np.square(cn) + np.square(sn * (polhodes.rates[2] / largest))
    norm = np.where(moves, norm, 1.0)
    (a, b, c), (a_slope, b_slope, c_slope) = polhodes.rates, polhodes.slopes
    result = np.array(
        [
            (a * cn + a_slope * passed * dn) / norm,
            (b * cn * dn + b_slope * passed) / norm,
            (c * dn + c_slope * passed * cn) / norm,
        ]
    )
    if np.all(moves):
        return result
    shape = (3, *[1] * (result.ndim - polhodes.rates.ndim), polhodes.rates.shape[1])
    return np.where(moves, result, polhodes.rates.reshape(shape))


def _swing(polhodes: _Polhodes, size: Array, times: Array) -> Array:
    """∫ |ω_c|/(|H| + I_c |ω_c|) dt from 0 to ``times``."""
    split = polhodes.complement == 0.0
    if np.all(split):
        return _swing_on_separatrix(polhodes, size, times)
    complement = np.where(split, 1.0, polhodes.complement)
    mean = _means(complement)[1]
    period = math.pi / mean / np.where(polhodes.pace > 0.0, polhodes.pace, 1.0)
    # The integrand is regular within K' of the real axis, so that its coefficients fall like exp(-π
    # k K'/K).
    swings = complement < 1.0
    parameter_agm = _means(np.where(swings, 1.0 - complement, 1.0))[1]
    widest = float(np.max(np.where(swings, parameter_agm / mean, 0.0)))
    modes = 2 + math.ceil(MODES_REACH / math.pi * widest)
    count = 2 * modes + 1
    shares = np.arange(count)[:, None] / count
    periodic = polhodes._replace(complement=complement)
    rate = np.abs(_rates(periodic, shares * period)[2])
    coefficients = np.fft.rfft(rate / (size + polhodes.moments[2] * rate), axis=0) / count
    total = coefficients[0].real * times
    # twice sin(x/2) times the real part of the coefficient turned by x/2, x = 2π k t/period
    phase = np.exp(1j * math.pi / period * times)
    turned = np.ones_like(phase)
    for k, coefficient in enumerate(coefficients[1:], 1):
        turned = turned * phase
        size_of_mode = 2.0 * period / (math.pi * k)
        total += size_of_mode * turned.imag * (coefficient * turned).real
    if np.any(split):
        total = np.where(split, _swing_on_separatrix(polhodes, size, times), total)
    return np.asarray(total)


def _swing_on_separatrix(polhodes: _Polhodes, size: Array, times: Array) -> Array:
    """`_swing` without a period: ω_c = D sech u, so that the integrand is D/(|H|(cosh u + ε)), ε =
    I_c D/|H|.

    sqrt(1 - ε²) is I_a |ω_a|/|H| at ω_b = 0, free of cancellation. Only where 1 - m is zero.
    """
    on_it = polhodes.complement == 0.0
    (a, b, c), rates = polhodes.moments, polhodes.rates
    d_ca, d_ba = (np.where(on_it, np.abs(each - a), 1.0) for each in (c, b))
    third, pace = (np.where(on_it, each, 1.0) for each in (rates[2], polhodes.pace))
    epsilon = c * polhodes.largest / size
    root = np.where(on_it, np.sqrt(a * polhodes.about_c / d_ca) / size, 1.0)
    # At the start |sinh u| is |ω_b/ω_c| times the ratio of their largest values; u > 0 where |ω_c|
    # falls.
    sinh = np.sqrt(b * d_ba / (c * d_ca)) * np.abs(rates[1] / third)
    u0 = np.copysign(np.arcsinh(sinh), -polhodes.slopes[2] * rates[2])
    shape = root / (1.0 + epsilon)
    angles = np.arctan(shape * np.tanh(0.5 * (u0 + pace * times)))
    angles = angles - np.arctan(shape * np.tanh(0.5 * u0))
    return np.asarray(2.0 * polhodes.largest / (pace * size * root) * angles)


def _shortest(momentum: Array, e: Array) -> tuple[Array, Array, Array, Array]:
    """Quaternions (4, ...) of the shortest turns that take the directions of ``momentum`` (3, ...)
    to the unit vectors ``e`` (3, n).
    """
    (x, y, z), (i, j, k) = momentum, e
    size = np.sqrt(x * x + y * y + z * z)
    turn = size + x * i + y * j + z * k, y * k - z * j, z * i - x * k, x * j - y * i
    length = np.sqrt(sum(part * part for part in turn)) + TINY
    w, x, y, z = (part / length for part in turn)
    return w, x, y, z


def _means(complement: Array) -> tuple[list[tuple[Array, Array]], Array]:
    """Arithmetic and geometric means from 1 and sqrt(1 - m) on, and their limit, π/2 over the
    quarter period K, (n,) each.
    """
    arithmetic = np.ones_like(complement)
    geometric = np.sqrt(complement)
    pairs = [(arithmetic, geometric)]
    for _ in range(MEANS):
        # the next difference is the square of this one
        if np.all(arithmetic - geometric <= 1e-8 * arithmetic):
            break
        arithmetic, geometric = 0.5 * (arithmetic + geometric), np.sqrt(arithmetic * geometric)
        pairs.append((arithmetic, geometric))
    return pairs, 0.5 * (arithmetic + geometric)


def _jacobi(u: Array, complement: Array) -> tuple[Array, Array, Array]:
    """sn, cn, dn of u (..., n) by descending Landen transformations (Bulirsch 1965), from 1 - m
    (n,) in [0, 1].

    Taking 1 - m keeps the relative accuracy of cn and dn near m = 1, where scipy.special.ellipj
    leaves its period.
    """
    split = complement == 0.0
    pairs, mean = _means(np.where(split, 1.0, complement))
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
    sn, cn = (
        np.where(still, sine / mean, sn),
        np.where(still, np.copysign(1.0, cosine), ratio * sn),
    )
    dn = np.where(still, 1.0, dn)
    if np.any(split):
        decay = np.exp(-np.abs(u))
        sech = 2.0 * decay / (1.0 + np.square(decay))
        sn, cn, dn = (
            np.where(split, limit, each)
            for limit, each in ((np.tanh(u), sn), (sech, cn), (sech, dn))
        )
    return sn, cn, dn
