"""Symmetric bodies under constant and turning torques: body rates in closed form, Magnus 1970
(8)-(14), (23)-(27), and Taylor series of the motion, many steps at once.

Without dissipation the rates of a symmetric body are linear in their drive whatever its attitude:
ω' = -iaω3 ω + M/A with ω3 linear in time, Magnus 1970 (1). The rates at the ends of all steps
follow from sums, and the steps of the attitude are independent of each other: arrays carry the
steps and the cases, and the turns of the steps are multiplied at the end. A quaternion (w, x, y, z)
is a pair of complex numbers there, p = w + iz and r = x + iy: dq/dt = q (0, ω)/2 becomes p' = (iω3
p - ω̄ r)/2 and r' = (ω p - iω3 r)/2, and the product of two is (p p* - r r̄*, p r* + r p̄*).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.numerics import gauss_legendre

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

DRIVEN_ORDER = 22  # largest order of the series; a step that needs more is halved
DRIVEN_STRIDE = 1.7  # largest step, rad of the fastest rotation: 1.7^22/22! is rounding
DRIVEN_REMAINDER = 2.0**-53  # size of the last two terms, relative to that of rates and quaternion
TOGETHER = 1024  # steps times cases summed together: few enough that their series stay in the cache
DRIVEN_HALVINGS = 12  # largest number of halvings of the steps where the series does not converge


class NotConverged(ArithmeticError):
    """The motion changes too fast for steps of any reasonable length."""


@dataclass(frozen=True, slots=True)
class Drive:
    """Drive of n symmetric bodies, (n,) each."""

    a: Array  # (A - C)/A
    transverse: ComplexArray  # M/A, rad/s²
    axial: Array  # M3/C, rad/s²
    turning: tuple[
        tuple[ComplexArray | complex, float], ...
    ] = ()  # (M/A, r) of torques M e^{irt}, r in rad/s
    wheel: Array | float = (
        0.0  # h/A, rad/s, of a constant momentum h along axis 3: ω turns at aω3 - h/A
    )

    def pace(self, omega: ComplexArray, spin: Array, duration: Array) -> Array:
        """Upper bound (n,) in rad/s on all rates during the ``duration`` (n,) s."""
        fastest = np.maximum(np.abs(spin), np.abs(spin + self.axial * duration))
        strength = np.hypot(np.abs(self.transverse), self.axial)
        strength = strength + sum(np.abs(size) for size, _ in self.turning)
        rate = max((abs(rate) for _, rate in self.turning), default=0.0)
        turning = np.maximum(1.0, np.abs(self.a)) * fastest + rate + np.abs(self.wheel)
        # Across axis 3 a torque drives ω for as long as it keeps its direction to it: about a turn.
        return np.asarray(np.abs(omega) + turning + np.sqrt(strength))


class Steps(NamedTuple):
    """Series of s steps of n bodies in x from 0 to 1 within each."""

    starts: Array  # (s, n) s
    duration: Array  # (n,) s
    omega: ComplexArray  # (k, s, n) rad/s
    spin: Array  # (2, s, n) rad/s
    turn: ComplexArray  # (k, 2, s, n), p and r of the turn since the start of the step


def steps(
    drive: Drive, omega: ComplexArray, spin: Array, start: Array, duration: Array, count: int
) -> Iterator[Steps]:
    """Motion over ``duration`` (n,) s from ``start`` (n,) s in ``count`` equal steps or a multiple,
    in groups.

    ``omega`` and ``spin`` (n,) rad/s at the start. Raises NotConverged.
    """
    step = duration / count
    done = 0
    halvings = 0
    while done < count:
        some = min(max(TOGETHER // len(spin), 1), count - done)
        series = _driven_series(drive, omega, spin, start + done * step, step, some)
        if series is None:
            if halvings == DRIVEN_HALVINGS:
                raise NotConverged
            halvings = halvings + 1
            step = 0.5 * step
            done = 2 * done
            count = 2 * count
            continue
        yield series
        done += some
        omega, spin = series.omega[:, -1].sum(axis=0), series.spin[:, -1].sum(axis=0)


def end(
    drive: Drive,
    omega: ComplexArray,
    spin: Array,
    turned: ComplexArray,
    start: Array,
    duration: Array,
) -> tuple[ComplexArray, Array, ComplexArray]:
    """ω (n,), ω3 (n,), turn (2, n) after ``duration`` (n,) s, from those at ``start`` (n,) s;
    raises NotConverged.
    """
    for series in steps(
        drive, omega, spin, start, duration, count_for(drive, omega, spin, duration)
    ):
        turned = product(turned, whole(series.turn.sum(axis=0)))
        omega, spin = series.omega[:, -1].sum(axis=0), series.spin[:, -1].sum(axis=0)
    return omega, spin, turned / np.sqrt(np.sum(turned.real**2 + turned.imag**2, axis=0))


def count_for(drive: Drive, omega: ComplexArray, spin: Array, duration: Array) -> int:
    """Steps of the slowest of the bodies, if the series converges as its pace promises."""
    return max(
        1, math.ceil(float(np.max(drive.pace(omega, spin, duration) * duration)) / DRIVEN_STRIDE)
    )


def _driven_series(
    drive: Drive, omega: ComplexArray, spin: Array, now: Array, step: Array, count: int
) -> Steps | None:
    """Next ``count`` steps of ``step`` (n,) s from ``now`` (n,) s; None where `DRIVEN_ORDER` terms
    are too few.
    """
    number = np.arange(count)[:, None]
    starts = now + number * step
    gained = drive.axial * step
    spins = np.stack([spin + gained * number, np.broadcast_to(gained, starts.shape)])
    parts = [
        (size * np.exp(1j * rate * starts) * step, 1j * rate * step) for size, rate in drive.turning
    ]
    forces = _powers(np.broadcast_to(drive.transverse * step, starts.shape), parts)
    turning, wheel = -1j * drive.a * step, 1j * drive.wheel * step
    pace = float(np.max(drive.pace(omega, spin, step * count) * step))
    order = _order(pace)
    if count > 1:
        # All steps from rest; then ω at the start of each, by the phases that it has turned through
        # until then.
        driven = _rates(np.zeros_like(forces[0]), turning, spins, wheel, forces, DRIVEN_ORDER).sum(
            axis=0
        )
        turned = np.cumsum(drive.a * step * (spins[0] + 0.5 * gained) - drive.wheel * step, axis=0)
        sums = omega + np.cumsum(np.exp(1j * turned) * driven, axis=0)
        omega_starts = np.concatenate([omega[None], sums[:-1] * np.exp(-1j * turned[:-1])])
    else:
        omega_starts = np.broadcast_to(omega, starts.shape)
    while True:
        rates = _rates(omega_starts, turning, spins, wheel, forces, order)
        turns = _turns(rates, spins, step, order)
        last = max(float(np.abs(rates[-2:] * step).max()), float(np.abs(turns[-2:]).max()))
        if last <= DRIVEN_REMAINDER:
            return Steps(starts, step, rates, spins, turns)
        if not math.isfinite(last) or order == DRIVEN_ORDER:
            return None
        order = min(order + 4, DRIVEN_ORDER)


def _order(pace: float) -> int:
    """Order at which the terms of an exponential over ``pace`` rad are rounding."""
    term = 1.0
    for order in range(1, DRIVEN_ORDER + 1):
        term *= pace / order
        if term <= DRIVEN_REMAINDER:
            return min(max(order + 1, 4), DRIVEN_ORDER)
    return DRIVEN_ORDER


def _powers(constant: ComplexArray, turning: list[tuple[Any, Any]]) -> list[Any]:
    """Terms of the drive of ω in a step, times the step: the ``constant`` in the first only."""
    if not turning:
        return [constant]
    terms = list[Any]()
    sizes = [size for size, _ in turning]
    for order in range(DRIVEN_ORDER):
        terms.append(sum(sizes))
        sizes = [size * turn / (order + 1) for size, (_, turn) in zip(sizes, turning, strict=True)]
    terms[0] = terms[0] + constant
    return terms


def _rates(
    omega: ComplexArray, turning: Any, spins: Array, wheel: Any, forces: list[Any], order: int
) -> ComplexArray:
    """Series of ω (order+1, s, n) from its start (s, n)."""
    series = np.empty((order + 1, *omega.shape), dtype=complex)
    series[0] = omega
    level = turning * spins[0] + wheel
    slope = turning * spins[1]
    slanted = bool(slope.any())
    for k in range(order):
        following = level * series[k]
        if slanted and k > 0:
            following += slope * series[k - 1]
        if k < len(forces):
            following += forces[k]
        series[k + 1] = following / (k + 1)
    return series


def _turns(rates: ComplexArray, spins: Array, step: Array, order: int) -> ComplexArray:
    """Series of the turn (order+1, 2, s, n) since the start of each step."""
    series = np.empty((order + 1, 2, *rates.shape[1:]), dtype=complex)
    series[0, 0], series[0, 1] = 1.0, 0.0
    half = 0.5 * step
    across = np.stack([-rates.conj(), rates], axis=1) * half
    axial = np.stack([1j * half * spins, -1j * half * spins], axis=1)
    slanted = bool(spins[1].any())
    for k in range(order):
        following = np.einsum("kcsn,kcsn->csn", across[: k + 1], series[k::-1, ::-1])
        following += axial[0] * series[k]
        if slanted and k > 0:
            following += axial[1] * series[k - 1]
        series[k + 1] = following / (k + 1)
    return series


def product(left: ComplexArray, right: ComplexArray) -> ComplexArray:
    """Product of turns, (2, ...) each: the turn ``right``, then the turn ``left``."""
    p, r = left
    v, w = right
    return np.stack([p * v - r * w.conj(), p * w + r * v.conj()])


def in_turn(turns: ComplexArray) -> ComplexArray:
    """Turns (2, s, n) from the start to the end of each step, (2, s, n), from those of the steps
    alone.
    """
    done = turns
    reach = 1
    while reach < done.shape[1]:
        done = np.concatenate([done[:, :reach], product(done[:, :-reach], done[:, reach:])], axis=1)
        reach *= 2
    return done


def whole(turns: ComplexArray) -> ComplexArray:
    """Product (2, n) of the turns of all steps (2, s, n), one after the other."""
    while turns.shape[1] > 1:
        even = turns.shape[1] // 2 * 2
        pairs = product(turns[:, 0:even:2], turns[:, 1:even:2])
        turns = np.concatenate([pairs, turns[:, even:]], axis=1)
    return turns[:, 0]


# --- body rates in closed form

PANEL = 2.0  # phase in rad of one Gauss-Legendre panel; ten nodes then err by less than a rounding


def phase_integral(slope: Array, bend: Array, length: Array) -> ComplexArray:
    """∫ exp(i(slope s + bend s²)) ds from 0 to ``length``, (n,) each, to rounding, by
    Gauss-Legendre panels.

    Bödewadt writes it with Fresnel's integrals, which cancel as bend -> 0.
    """
    slope, bend, length = (
        np.asarray(part, dtype=float) for part in np.broadcast_arrays(slope, bend, length)
    )
    # The phase may turn back where slope + 2 bend s = 0; this bounds its total variation.
    variation = np.abs(slope) * np.abs(length) + np.abs(bend) * np.square(length)
    counts = np.maximum(np.ceil(variation / PANEL), 1.0).astype(int)
    owner = np.repeat(np.arange(len(counts)), counts)
    firsts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    number = np.arange(len(owner)) - firsts[owner]
    width = length[owner] / counts[owner]
    nodes, weights = gauss_legendre(10)
    s = (number + 0.5)[:, None] * width[:, None] + 0.5 * width[:, None] * nodes
    phase = (slope[owner][:, None] + bend[owner][:, None] * s) * s
    panels = 0.5 * width * (np.exp(1j * phase) @ weights)
    return np.asarray(np.add.reduceat(panels, firsts))


def stepwise_torque(
    times: Array, omega0: complex, spin0: float, A: float, C: float, edges: Array, torques: Array
) -> tuple[ComplexArray, Array]:
    """General solution, Magnus 1970 (8)-(10), for a torque that is constant between edges; exact at
    any angle.

    ``times`` (n,) s within ``edges`` (k+1,) s ascending; ``omega0``, ``spin0`` in rad/s are those
    at edges[0]; ``torques`` (k, 3) N m. Returns ω (n,) and ω3 (n,) in rad/s.
    """
    edges, torques = np.asarray(edges, dtype=float), np.asarray(torques, dtype=float)
    times = np.asarray(times, dtype=float)
    a = (A - C) / A
    spin_rates = torques[:, 2] / C
    lengths = np.diff(edges)
    spins = spin0 + np.concatenate([[0.0], np.cumsum(spin_rates * lengths)])
    alphas = np.concatenate([[0.0], np.cumsum((spins[:-1] + 0.5 * spin_rates * lengths) * lengths)])
    transverse = (torques[:, 0] + 1j * torques[:, 1]) / A

    def gained(step: NDArray[np.intp], since: Array) -> ComplexArray:
        turned = phase_integral(a * spins[step], 0.5 * a * spin_rates[step], since)
        return np.asarray(transverse[step] * np.exp(1j * a * alphas[step]) * turned)

    sums = omega0 + np.concatenate([[0.0], np.cumsum(gained(np.arange(len(lengths)), lengths))])
    step = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, len(lengths) - 1)
    since = times - edges[step]
    spin = spins[step] + spin_rates[step] * since
    alpha = alphas[step] + 0.5 * (spins[step] + spin) * since
    return (sums[step] + gained(step, since)) * np.exp(-1j * a * alpha), spin


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
