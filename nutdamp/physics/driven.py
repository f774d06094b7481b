"""Body rates of symmetric bodies under constant and turning torques in closed form, Magnus 1970
(11)-(14), (23)-(27).

Without dissipation they are linear in their drive whatever the attitude: ω' = -iaω3 ω + M/A with ω3
constant, Magnus 1970 (1). Torques in steps, with an axial part, are those of `motion.polynomials`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def rotating_torques(
    times: Array, omega0: complex, nutation: float, A: float, torques: ComplexArray, rates: Array
) -> ComplexArray:
    """Transverse rate ω under torques that turn uniformly in the body, M(t) = Σ M_p exp(i r_p t),
    with ω3 constant.

    Magnus 1970 (23), (24) with r_p = b_p ω3, where ω0 of the print is an integration constant: with
    ω(0) given it is ω(0) + i Σ m_p/(a + b_p). Both are one here, without cancellation near
    resonance r_p = -aω3, which is (25): ω(t) = e^{-iaω3t} [ω(0) + (1/A) Σ M_p t e^{iδ_p t/2}
    sinc(δ_p t/2)], δ_p = aω3 + r_p. r_p = aω3 is (26), r_p = -ω3 the nearly space-fixed torque of
    (27), r_p = 0 the constant one of (11).

    ``times`` (n,) s, ``nutation`` aω3 rad/s, with a wheel ω3 - H3/A; ``torques`` (p,) N m,
    ``rates`` (p,) rad/s. Returns (n,) rad/s.
    """
    times = np.asarray(times, dtype=float)[:, None]
    half = 0.5 * (nutation + np.asarray(rates, dtype=float)) * times
    # numpy.sinc(x) is sin(πx)/(πx)
    forced = np.asarray(torques) * times * np.exp(1j * half) * np.sinc(half / math.pi) / A
    return np.asarray((omega0 + forced.sum(axis=1)) * np.exp(-1j * nutation * times[:, 0]))


def steady_response(A: float, nutation: float, torque: complex, rate: float = 0.0) -> complex:
    """Part of ω that follows a torque M e^{irt} for ever, at t = 0: -i M/(A(aω3 + r)) in rad/s.

    For r = 0 the permanent rotation Magnus 1970 (13), which is the centre of the pole cone of (11)
    and K(14), (M2 - iM1)/((A - C)ω3); for r = -ω3 the forced term of (27), which in the axes of the
    despun frame is K(15), iM/(Cω3). K(14) and K(15) hold without axial torque: the third component
    of K(15) is 0, and the last line of K(14) must read M = ω_P × ω_z (J_z - J_xy). Infinite at
    resonance, r = -aω3, and for r = 0 on a sphere. ``nutation`` is aω3.
    """
    detuning = nutation + rate
    if detuning == 0.0:
        return complex(math.inf)
    return -1j * torque / (A * detuning)


def permanent_rotation(
    A: float, C: float, spin: float, torque: complex
) -> tuple[complex, float, float, float]:
    """The permanent rotation that a constant body torque allows, Magnus 1970 (13), constant in body
    and space.

    Returns ω (rad/s), its rate ψ̇0 = |ω_i| and the Euler angles ϑ0, φ0 (rad), (14).

    tan ϑ0 = |M|/(|A - C| ω3²), tan φ0 = ω1/ω2 by arctan2; ψ̇0 is |ω|, where the source prints |ω̇|.
    With ω1 = ψ̇0 sin ϑ0 sin φ0, ω2 = ψ̇0 sin ϑ0 cos φ0, ω3 = ψ̇0 cos ϑ0. Infinite for a sphere.
    """
    omega = steady_response(A, (A - C) / A * spin, torque)
    rate = math.hypot(abs(omega), spin)
    return omega, rate, math.atan2(abs(omega), spin), math.atan2(omega.real, omega.imag)


def beat(A: float, nutation: float, torque: complex, rate: float) -> tuple[float, float]:
    """Largest |ω| (rad/s) that a turning torque adds to rest, and the period (s) of the swelling,
    Magnus 1970 (27).

    ω(t) from rest swells to 2|M|/(A|δ|) and back within 2π/|δ|, δ = aω3 + r; both infinite at
    resonance.
    """
    detuning = abs(nutation + rate)
    if detuning == 0.0:
        return math.inf, math.inf
    return 2.0 * abs(torque) / (A * detuning), 2.0 * math.pi / detuning


def resonant_time(
    A: float, axial: float, omega0: complex, torque: complex, nutation: float
) -> float:
    """Time in s for a resonant torque (r = -aω3) to drive the nutation angle to ``nutation`` rad;
    Magnus 1970 (25).

    |ω0 + M t/A| = |H3| tan θ/A with H3 = ``axial``, Cω3: the later root, since the pole curve may
    first run inwards; 0 if it is there already.
    """
    needed = abs(axial) * math.tan(nutation) / A
    speed = torque / A
    if abs(omega0) >= needed:
        return 0.0
    along = (omega0 * speed.conjugate()).real / abs(speed)
    across = abs((omega0 * speed.conjugate()).imag) / abs(speed)
    return (math.sqrt(needed * needed - across * across) - along) / abs(speed)
