"""Energy sink: dissipation inside the body, in closed form for coasting symmetric bodies.

Flexible parts and liquids drain energy while H stays as it is in space. For the angle θ of axis 3 from H the sink is

    dθ/dt = κ sin θ cos θ,   that is   tan θ = tan θ0 e^{κt},   κ = +1/τ prolate, -1/τ oblate,

a linear damper, of which e^{κt} is the small-angle form. As a torque in body axes, beside the free motion, with
h = H/|H| (exact for any moments; then κ is a given rate, and the energy falls as long as axis 3 is that of least
moment for κ > 0 or of largest for κ < 0; a sphere has no energy to give, and κ = 0):

    dH1/dt = κ H1 cos²θ,   dH2/dt = κ H2 cos²θ,   dH3/dt = -κ H3 sin²θ,

which is H × s with s = κ h3 (h × e3) = κ h3 (h2, -h1, 0): the body slips against H at s, beside ω = H/I.
The slip is perpendicular to both H and axis 3, so it changes θ alone. The Euler angles φ about H and ψ about axis 3 of
a symmetric body are unaffected: dφ/dt = |H|/A and dψ/dt = |H|(1/C - 1/A) cos θ. With s = sin θ0, c = cos θ0, E =
e^{κt} and N = sqrt(c² + s²E²): sin θ = sE/N, cos θ = c/N, and

    ∫ cos θ dt = asinh(2c sinh(κt)/(1 + N))/κ,

which is -asinh(e^{-κt}/tan θ0)/κ less its value at t = 0, in a form that cancels nowhere: t cos θ0 for κ -> 0, t
for θ0 -> 0, and zero for θ0 = 90°. Either sense of spin: θ runs from 0 to 180°, and h3 carries the sign.

With a wheel of momentum h, H3 = Cω3 + h takes the place of Cω3: dψ/dt = |H|(1/C - 1/A) cos θ - h/C, so that the forms
above hold for the spin H3/C, and the body turns by -h t/C besides.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.physics import attitude

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FOR_EVER = 300.0  # time constants after which the sink has finished: θ is then 0 or 90° to far beyond rounding
TINY = 1e-200  # offset that keeps quotients like asinh x / x defined at zero and changes nothing elsewhere
SMALLEST = 1e-150  # least cosine of a nutation angle that is distinguished from zero: its square is still a number


class SinkEffect(NamedTuple):
    """Effect of the sink on an arc, beside the free arc of the same body."""

    transverse: Any  # factor on |ω|
    axial: Any  # factor on ω3
    turned: Any  # s, in which the spin at the start turns the body as far as it has turned, ∫ω3 dt / ω3(0)
    cosine: Any  # of half the angle by which θ has grown
    sine: Any  # of that, as a multiple of sin θ0


def course(growth: float, cosine: float, sine_squared: float, time: float) -> SinkEffect:
    """Effect of a sink of ``growth`` κ (1/s) after ``time`` s, from θ0 by its ``cosine`` and ``sine_squared``."""
    exponent = growth * time
    clipped = max(-FOR_EVER, min(exponent, FOR_EVER))
    return _course(math, math.asinh, cosine, sine_squared, time, exponent, clipped)


def courses(growth: float, cosine: Any, sine_squared: Any, times: Any) -> SinkEffect:
    """`course` for arrays that broadcast, real or complex (a complex step gives derivatives)."""
    exponent = growth * np.asarray(times)
    clipped = np.clip(exponent, -FOR_EVER, FOR_EVER)
    return _course(np, np.arcsinh, cosine, sine_squared, times, exponent, clipped)


def _course(module: Any, asinh: Any, cosine: Any, sine_squared: Any, time: Any, exponent: Any, x: Any) -> SinkEffect:
    """`course` by the functions of a ``module``; ``x`` is ``exponent`` κt clipped to ±`FOR_EVER`."""
    growing, squared = module.exp(x), cosine * cosine
    size = module.sqrt(squared + sine_squared * growing * growing)
    grown = module.sqrt(0.5 + 0.5 * (squared + sine_squared * growing) / size)
    moving = time * ((x + TINY) / (exponent + TINY))
    stretched = moving * (module.sinh(x) + TINY) / (x + TINY) * 2.0 / (1.0 + size)  # asinh(c κ stretched)/(c κ)
    swing = cosine * 2.0 * module.sinh(x) / (1.0 + size) + TINY
    return SinkEffect(
        transverse=growing / size,
        axial=1.0 / size,
        turned=stretched * asinh(swing) / swing + (time - moving) / size,
        cosine=grown,
        sine=0.5 * cosine * module.expm1(x) / (size * grown),
    )


def time_to_turn(growth: float, cosine: float, sine_squared: float, turned: float) -> float:
    """Time in s after which `SinkEffect.turned` is ``turned`` s: its inverse; infinite where it is never reached.

    With z = κ c ``turned`` and c = |cos θ0| > 0 it is κt = z - ln(1 - (e^{2z} - 1) sin²θ0/(2c(1 + c))); flat spin turns
    no further.
    """
    c = max(abs(cosine), SMALLEST)
    z = growth * c * turned
    slowed = math.expm1(min(2.0 * z, FOR_EVER)) * sine_squared / (2.0 * c * (1.0 + c))
    if slowed >= 1.0:
        return math.inf
    return (z - math.log1p(-slowed)) / growth if growth != 0.0 else turned


def coast(
    A: float, C: float, growth: float, omega: complex, spin: float, time: float, wheel: float = 0.0
) -> SinkEffect:
    """`course` of a symmetric body from its rates ``omega`` = ω1 + iω2 and ``spin`` at the start, rad/s."""
    first, second, third = _direction(A, C, omega, spin, wheel)
    return course(growth, third, first * first + second * second, time)


def slip(effect: SinkEffect, first: Any, second: Any, behind: Any, cos_sin: Callable[[Any], tuple[Any, Any]]) -> Any:
    """Quaternion (w, x, y, z) by which the body has slipped from its free arc; it multiplies that from the right.

    ``first`` and ``second``: components of h in the body at the end of the free arc; ``behind`` = aH3/C(turned - t),
    rad, the excess turn about axis 3.
    """
    x, y = effect.sine * second, -effect.sine * first
    cosine, sine = cos_sin(0.5 * behind)
    return effect.cosine * cosine, x * cosine + y * sine, y * cosine - x * sine, effect.cosine * sine


def arc(
    A: float, C: float, growth: float, quaternion: Array, omega: complex, spin: float, times: Any, wheel: float = 0.0
) -> tuple[Any, Any, Array]:
    """Coast of a symmetric body, exact: ω (n,), ω3 (n,) rad/s and attitude (n, 4) at ``times`` (n,) s from its start.

    ``quaternion`` (4,) body -> inertial, ``omega`` = ω1 + iω2 and ``spin`` hold at its start; ``growth`` is κ in 1/s.
    At one time that is a number, by plain numbers: a tenth of the cost of arrays.
    """
    many = isinstance(times, np.ndarray)
    module, exp, effect_of = (np, np.exp, courses) if many else (math, cmath.exp, course)
    first, second, third = _direction(A, C, omega, spin, wheel)
    effect = effect_of(growth, third, first * first + second * second, times)
    offset = wheel / C
    rate = (A - C) / A * (spin + offset)
    free, behind = exp(-1j * (rate - offset) * times), rate * (effect.turned - times)
    there = complex(first, second) * free
    slipped = slip(effect, there.real, there.imag, behind, lambda angle: (module.cos(angle), module.sin(angle)))
    motion = A, C, quaternion, omega, spin, times, wheel
    if many:
        turned = attitude.multiply(attitude.arc(*motion), np.stack(slipped, axis=-1))
    else:
        turned = np.array(attitude.product(attitude.arc_end(*motion).tolist(), slipped))
    spins = (spin + offset) * effect.axial - offset
    return omega * free * effect.transverse * exp(-1j * behind), spins, turned


def rates_on_arc(
    A: Any, C: Any, growth: float, omega: Any, spin: Any, times: Array, wheel: Any = 0.0
) -> tuple[ComplexArray, Array]:
    """ω and ω3 of `arc` alone, for many bodies: ``times`` (cases, n) s from the starts of their arcs, else (cases, 1).

    ``omega`` and ``spin`` at the starts, rad/s, and moments, kg m², are by case; ``growth`` may be zero.
    """
    offset = wheel / C
    rate = (A - C) / A * (spin + offset)
    if growth == 0.0:
        return np.asarray(omega * np.exp(-1j * ((rate - offset) * times))), np.broadcast_to(spin, times.shape)
    across, along = A * A * (omega.real**2 + omega.imag**2), C * (spin + offset)
    size = np.sqrt(across + along * along) + TINY
    effect = courses(growth, along / size, across / (size * size), times)
    turned = rate * effect.turned - offset * times
    return np.asarray(omega * np.exp(-1j * turned) * effect.transverse), (spin + offset) * effect.axial - offset


def _direction(A: float, C: float, omega: complex, spin: float, wheel: float) -> tuple[float, float, float]:
    """Unit vector h of H in body axes; axis 3 for a body at rest."""
    h1, h2, h3 = attitude.angular_momentum(A, C, omega, spin, wheel).tolist()
    size = math.hypot(h1, h2, h3)
    return (h1 / size, h2 / size, h3 / size) if size > 0.0 else (0.0, 0.0, 1.0)
