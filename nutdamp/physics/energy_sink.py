"""Energy sink: dissipation inside the body, in closed form for coasting symmetric bodies.

Flexible parts and liquids drain energy while H stays as it is in space. For the angle θ of axis 3
from H the sink is

    dθ/dt = κ sin θ cos θ,   that is   tan θ = tan θ0 e^{κt},   κ = +1/τ prolate, -1/τ oblate,

a linear damper, of which e^{κt} is the small-angle form. As a torque in body axes, beside the free
motion, with h = H/|H| (exact for any moments; then κ is a given rate, and the energy falls as long
as axis 3 is that of least moment for κ > 0 or of largest for κ < 0; a sphere has no energy to give,
and κ = 0):

    dH1/dt = κ H1 cos²θ,   dH2/dt = κ H2 cos²θ,   dH3/dt = -κ H3 sin²θ,

which is H × s with s = κ h3 (h × e3) = κ h3 (h2, -h1, 0): the body slips against H at s, beside ω =
H/I. The slip is perpendicular to both H and axis 3, so it changes θ alone. The Euler angles φ about
H and ψ about axis 3 of a symmetric body are unaffected: dφ/dt = |H|/A and dψ/dt = |H|(1/C - 1/A)
cos θ. With s = sin θ0, c = cos θ0, E = e^{κt} and N = sqrt(c² + s²E²): sin θ = sE/N, cos θ = c/N,
and

    ∫ cos θ dt = asinh(2c sinh(κt)/(1 + N))/κ,

which is -asinh(e^{-κt}/tan θ0)/κ less its value at t = 0, in a form that cancels nowhere: t cos θ0
for κ -> 0, t for θ0 -> 0, and zero for θ0 = 90°. Either sense of spin: θ runs from 0 to 180°, and
h3 carries the sign.

With a wheel of momentum h, H3 = Cω3 + h takes the place of Cω3. |H| and h are kept, so that the
energy changes by dE/dθ = |H| sin θ D, D(θ) = |H| cos θ (1/A - 1/C) + h/C: the rate at which ω turns
in the body. A linear damper in the body takes D² sin²θ, and

    dθ/dt = κ sin θ D(θ)/D(0) = κ sin θ (u cos θ + v)

with D(0) at the end of axis 3 that is the spin axis, and κ the rate of small angles there. The slip
is κ (u h3 + v) (h × e3), and dψ/dt = |H|(1/C - 1/A) cos θ - h/C. Where |u| > |v| there is an angle
at which D = 0: ω stands still in the body, and growth ends. Losses within the wheel follow another
law.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.numerics import TINY

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

STEPS, CLOSE = (
    60,
    1e-9,
)  # most Newton steps to θ at a time (usual are three), and the error that the last one squares
STILL = 1e-12  # distance in ln tan(θ/2) from the angle with D = 0 within which it is reached
MOST_TURNED = (
    10.0  # largest exponent of one of these steps: by e^10 a step that is too far can be taken back
)
# time constants after which the sink has finished: θ is then 0 or 90° to far beyond rounding
FOR_EVER = 300.0
# least cosine of a nutation angle that is distinguished from zero: its square is still a number
SMALLEST = 1e-150


class SinkEffect(NamedTuple):
    """Effect of the sink on an arc, beside the free arc of the same body."""

    transverse: Any  # factor on |ω|
    along: Any  # cos θ
    travel: Any  # ∫cos θ dt, s
    cosine: Any  # of half the angle by which θ has grown
    sine: Any  # of that, as a multiple of sin θ0


def damper(A: Any, C: Any, wheel: Any, size: Any, sense: float) -> tuple[Any, Any]:
    """Shares u and v of the law by |H| = ``size`` and the end ``sense`` of axis 3: (1, 0) without a
    wheel.
    """
    if not np.any(wheel):
        return 1.0, 0.0
    by_body, by_wheel = (C - A) / A * size, sense * wheel
    small = by_body + by_wheel + TINY
    return by_body / small, sense * by_wheel / small


def course(
    growth: float, cosine: Any, sine_squared: Any, time: Any, shares: tuple[Any, Any] = (1.0, 0.0)
) -> SinkEffect:
    """Effect of a sink of ``growth`` κ (1/s) after ``time`` s, from θ0 by its ``cosine`` and
    ``sine_squared``.

    Numbers, or arrays that broadcast.
    """
    if np.any(shares[1]):
        return _gyrostat_course(growth * shares[0], growth * shares[1], cosine, sine_squared, time)
    exponent = growth * time
    x = np.maximum(-FOR_EVER, np.minimum(exponent, FOR_EVER))
    growing = np.exp(x)
    squared = cosine * cosine
    size = np.sqrt(squared + sine_squared * growing * growing)
    grown = np.sqrt(0.5 + 0.5 * (squared + sine_squared * growing) / size)
    moving = time * ((x + TINY) / (exponent + TINY))
    stretched = (
        moving * (np.sinh(x) + TINY) / (x + TINY) * 2.0 / (1.0 + size)
    )  # asinh(c κ stretched)/(c κ)
    swing = cosine * 2.0 * np.sinh(x) / (1.0 + size) + TINY
    return SinkEffect(
        transverse=growing / size,
        along=cosine / size,
        travel=cosine * (stretched * np.arcsinh(swing) / swing + (time - moving) / size),
        cosine=grown,
        sine=0.5 * cosine * np.expm1(x) / (size * grown),
    )


def _gyrostat_course(
    slope: Any, level: Any, cosine: Any, sine_squared: Any, time: Any
) -> SinkEffect:
    """Effect of θ' = sin θ (p cos θ + r), ``slope`` p and ``level`` r in 1/s, not both zero.

    For z = ln tan(θ/2) - ln tan(θ0/2) it is z' = p cos θ + r, with which t = (z + p∫(1 - cos
    θ)dt)/(r + p) is closed in z. Its inverse is by Newton steps in the logarithm of the distance
    from the angle at rest, if there is one.
    """
    # Seen from the end of axis 3 at which the rate is the larger, so that nothing cancels.
    end = np.where(slope * level < 0.0, -1.0, 1.0)
    cosine, level = end * cosine, end * level
    small = 0.5 * sine_squared / (1.0 + np.abs(cosine))
    above = cosine > 0.0
    near, far = np.where(above, 1.0 - small, small), np.where(above, small, 1.0 - small)
    # z' at θ = 0 and at θ = 180°
    first = level + slope
    last = level - slope
    begin = first * near + last * far

    def clock(way: Any) -> tuple[Any, Any, Any, Any]:
        """Time until z = ``way`` z'(0), z' there over z'(0), e^{2z} and ∫(1 - cos θ)dt."""
        double = 2.0 * begin * way + TINY
        squared = np.exp(double)
        gained = 2.0 * way * np.expm1(double) / double
        change = last * far * gained + TINY
        falls = change < -0.5
        ratio = np.where(falls, (first * near + last * far * squared) / begin, 1.0 + change)
        lag = far * gained * np.where(falls, np.log(ratio), np.log1p(change)) / change
        return (begin * way + slope * lag) / first, ratio / (near + far * squared), squared, lag

    with np.errstate(
        all="ignore"
    ):  # where a logarithm is of nothing there is no such angle, or it is reached
        rest = 0.5 * np.log(-first * near / (last * far))
        rest = np.where(np.isfinite(rest) & (first * last < 0.0), rest, 1.0 / STILL)
        most = np.sign(time) * FOR_EVER / (np.abs(begin) + 1e-20 * np.abs(first))
        over, moves, _, _ = clock(most)
        until = np.where((moves > 0.0) & (np.abs(over) < np.abs(time)), over, time)
        way = 0.0 * (begin * until)
        for _ in range(STEPS):
            passed, moves, _, _ = clock(way)
            gap = rest - begin * way
            going = (moves > 0.0) & (np.abs(gap) > STILL)
            late = np.where(going, until - passed, 0.0)
            turned = begin * moves * late / np.where(going, gap, 1.0) + TINY
            shorter = np.clip(turned, -MOST_TURNED, MOST_TURNED)
            step = -moves * late * np.expm1(-shorter) / turned
            farthest = 1.01 * np.abs(first * late / (begin + TINY))
            step = np.clip(step, -farthest, farthest)
            before = way
            way = np.clip(way + step, -np.abs(most), np.abs(most))
            if np.all(np.abs(way - before) <= CLOSE * np.abs(way)):
                break
        way = np.where(np.abs(rest - begin * way) <= STILL, rest / begin, way)
        _, _, squared, lag = clock(way)
        z = begin * way
        travel = np.where(np.abs(slope * until) < 1.0, until - lag, (z - level * until) / slope)
    grown = np.exp(z)
    size = near + far * squared
    along = (near - far * squared) / size
    root = np.sqrt(size)
    return SinkEffect(
        transverse=grown / size,
        along=end * along,
        travel=end * (travel + along * (time - until)),
        cosine=(near + far * grown) / root,
        sine=0.5 * end * np.expm1(z) / root,
    )


def time_to_turn(growth: float, cosine: float, sine_squared: float, turned: float) -> float:
    """Time in s after which ∫cos θ dt is cos θ0 times ``turned`` s, without a wheel; infinite if
    never.

    With z = κ c ``turned`` and c = |cos θ0| > 0 it is κt = z - ln(1 - (e^{2z} - 1) sin²θ0/(2c(1 +
    c))); flat spin turns no further.
    """
    c = max(abs(cosine), SMALLEST)
    z = growth * c * turned
    slowed = math.expm1(min(2.0 * z, FOR_EVER)) * sine_squared / (2.0 * c * (1.0 + c))
    if slowed >= 1.0:
        return math.inf
    return (z - math.log1p(-slowed)) / growth if growth != 0.0 else turned


def time_to_angle(growth: float, begin: float, end: float, shares: tuple[float, float]) -> float:
    """Time in s from θ = ``begin`` to ``end``, rad, both above zero, with growth κ not zero;
    infinite if never.
    """
    by_body, by_wheel = shares
    far = math.sin(0.5 * begin) ** 2
    rate = by_body * math.cos(begin) + by_wheel
    ratio = math.tan(0.5 * end) / math.tan(0.5 * begin)
    gained = far * (ratio * ratio - 1.0) / (rate + TINY)
    change = (by_wheel - by_body) * gained + TINY
    if change <= -1.0:
        return math.inf
    time = (math.log(ratio) + by_body * gained * math.log1p(change) / change) / (
        growth * (by_body + by_wheel)
    )
    return time if time >= 0.0 else math.inf


def coast(
    A: Any,
    C: Any,
    growth: float,
    omega: Any,
    spin: Any,
    time: Any,
    wheel: Any = 0.0,
    sense: float = 1.0,
) -> SinkEffect:
    """`course` of symmetric bodies from their rates ``omega`` = ω1 + iω2 and ``spin`` at the start,
    rad/s.
    """
    across, along = A * np.abs(omega), C * spin + wheel
    size = np.hypot(across, along) + TINY  # at rest, as of pure spin
    shares = damper(A, C, wheel, size, sense)
    return course(growth, (along + TINY) / size, np.square(across / size), time, shares)


def rates_on_arc(
    A: Any,
    C: Any,
    growth: float,
    omega: Any,
    spin: Any,
    times: Array,
    wheel: Any = 0.0,
    sense: float = 1.0,
) -> tuple[ComplexArray, Array]:
    """ω and ω3 of `motion.arc` alone, for many bodies: ``times`` (cases, n) s from the starts of
    their arcs, else (cases, 1).

    ``omega`` and ``spin`` at the starts, rad/s, and moments, kg m², are by case; ``growth`` may be
    zero.
    """
    offset = wheel / C
    if growth == 0.0:
        rate = (A - C) / A * (spin + offset) - offset
        return np.asarray(omega * np.exp(-1j * (rate * times))), np.broadcast_to(spin, times.shape)
    effect = coast(A, C, growth, omega, spin, times, wheel, sense)
    size = np.hypot(A * np.abs(omega), C * (spin + offset))
    turned = (A - C) / A * size / C * effect.travel - offset * times
    decayed = omega * np.exp(-1j * turned) * effect.transverse
    return np.asarray(decayed), size * effect.along / C - offset


# --- the sink as Taylor series


def _product(left: Array, right: Array) -> Any:
    """Coefficient of the product of two series (k, n)."""
    return left @ right[::-1] if left.ndim == 1 else np.einsum("kn,kn->n", left, right[::-1])


class SinkSeries:
    """`energy_sink` as series: torque of dissipation on H in body axes, and slip of the body.

    With q = H3/|H|² the slip is s = κq (H2, -H1, 0), and H × s is added to dH/dt in the body.
    ``floor`` keeps q regular where external torques bring H to rest: there is nothing to dissipate
    there. With a wheel q is ((C - A)H3 + Ah)/((C - A)|H|² + σAh|H|). The moments may fall:
    ``parts`` are their series, of at most so many ``orders``.
    """

    def __init__(
        self,
        parts: list[Array],
        growth: float,
        wheel: Any,
        sense: float,
        floor: Any,
        orders: int,
    ) -> None:
        self.growth, self.wheel, self.sense = growth, wheel, sense
        self.parts, self.floor = parts, floor
        self.by_body, self.by_wheel = [1.0], [0.0]  # of H3 and of h in q
        if np.any(wheel):
            self.by_wheel = [0.5 * (part[0] + part[1]) for part in parts]
            self.by_body = [part[2] - A for part, A in zip(parts, self.by_wheel, strict=True)]
        shape = parts[0].shape
        self.momentum, self.slip = np.zeros((2, orders, *shape))  # H and s
        # |H|², |H|, the denominator of q, and q
        tables = np.zeros((4, orders, *shape[1:]))
        self.squares, self.size, self.below, self.quotient = tables

    def torque(self, k: int, rates: Array) -> tuple[Any, Any, Any]:
        """Coefficient k of H × s, (3, n), from those of ω up to it, (k+1, 3, n); stores that of
        ``slip``.
        """
        momentum, slip = self.momentum[: k + 1], self.slip[: k + 1]
        momentum[k] = self.parts[0] * rates[k]
        for order, part in enumerate(self.parts[1 : k + 1], 1):
            momentum[k] += part * rates[k - order]
        if k == 0:
            momentum[0, 2] += self.wheel
        if rates.ndim == 2:
            self.squares[k] = momentum.ravel() @ momentum[::-1].ravel()
        else:
            self.squares[k] = np.einsum("kcn,kcn->n", momentum, momentum[::-1])
        if k == 0:
            self.squares[0] += self.floor
        if k == 0:
            self.size[0] = np.sqrt(self.squares[0])
        else:
            between = _product(self.size[1:k], self.size[1:k])
            self.size[k] = 0.5 * (self.squares[k] - between) / self.size[0]
        above = self.by_wheel[k] * self.wheel if k < len(self.by_wheel) else 0.0
        for order, apart in enumerate(self.by_body[: k + 1]):
            above = above + apart * momentum[k - order, 2]
            by_wheel = self.sense * self.wheel * self.by_wheel[order]
            self.below[k] += apart * self.squares[k - order] + by_wheel * self.size[k - order]
        before = _product(self.below[1 : k + 1], self.quotient[:k])
        quotient = self.quotient[: k + 1]
        quotient[k] = (above - before) / self.below[0]
        slip[k, 0] = self.growth * _product(quotient, momentum[:, 1])
        slip[k, 1] = -self.growth * _product(quotient, momentum[:, 0])
        first, second, third = self.products(momentum, slip[:, :2])
        return -third[1], third[0], first[1] - second[0]

    @staticmethod
    def products(left: Array, right: Array) -> Any:
        """Coefficients of the products of series (k, a, n) and (k, b, n), (a, b, n)."""
        if left.ndim == 2:
            return (left.T @ right[::-1]).tolist()
        return np.einsum("kan,kbn->abn", left, right[::-1])
