"""Symmetric bodies under torque: the Taylor series of many steps at once.

Without dissipation the rates of a symmetric body do not depend on its attitude and are linear in what drives them:
ω' = -iaω3 ω + M/A with ω3 even in time, Magnus 1970 (1). So the rates at the ends of all steps follow from sums, and
with them the steps of the attitude are independent of each other: arrays carry the steps and the cases, and the
turns of the steps are multiplied at the end.

A quaternion (w, x, y, z) is a pair of complex numbers here, p = w + iz and r = x + iy: dq/dt = q (0, ω)/2 becomes
p' = (iω3 p - ω̄ r)/2 and r' = (ω p - iω3 r)/2, and the product of two is (p p* - r r̄*, p r* + r p̄*).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

ORDER = 22
"""Of the series, at most; a step that needs more is halved."""

STRIDE = 1.7
"""Radians of one step, at most, of all that turns: 1.7^22/22! is rounding."""

REMAINDER = 2.0**-53
"""Size of the last two terms kept, relative to the scale of rates and quaternion."""

TOGETHER = 1024
"""Steps times cases that are summed together: few enough that their series stay in the cache."""

HALVINGS = 12
"""Times that the steps are halved, at most, where the series does not converge."""


class NotConverged(ArithmeticError):
    """The motion changes too fast for steps of any reasonable length."""


@dataclass(frozen=True, slots=True)
class Drive:
    """What acts on n symmetric bodies, (n,) each: ``a`` = (A - C)/A, M/A = ``transverse`` in rad/s² and M3/C.

    ``turning``: (M/A, r) of torques M e^{irt} about axis 3, with M/A (n,) at t = 0 and r in rad/s.
    """

    a: Array
    transverse: ComplexArray
    axial: Array
    turning: tuple[tuple[ComplexArray, float], ...] = ()

    def pace(self, omega: ComplexArray, spin: Array, duration: Array) -> Array:
        """Rate in rad/s (n,) that bounds all that turns during the ``duration`` (n,) s."""
        fastest = np.maximum(np.abs(spin), np.abs(spin + self.axial * duration))
        strength = np.hypot(np.abs(self.transverse), self.axial)
        strength = strength + sum(np.abs(size) for size, _ in self.turning)
        rate = max((abs(rate) for _, rate in self.turning), default=0.0)
        turning = np.maximum(1.0, np.abs(self.a)) * fastest + rate
        # Across axis 3 a torque drives ω for as long as it keeps its direction to it: about a turn.
        return np.asarray(np.abs(omega) + turning + np.sqrt(strength))


class Steps(NamedTuple):
    """Series of s steps of n bodies in x from 0 to 1 within each: ``starts`` (s, n) s and ``duration`` (n,) s.

    ``omega`` (k, s, n) and ``spin`` (2, s, n) in rad/s; ``turn`` (k, 2, s, n): p and r of the turn since the start of
    the step.
    """

    starts: Array
    duration: Array
    omega: ComplexArray
    spin: Array
    turn: ComplexArray


def steps(drive: Drive, omega: ComplexArray, spin: Array, start: Array, duration: Array, count: int) -> Iterator[Steps]:
    """The motion over ``duration`` (n,) s from ``start`` (n,) s in ``count`` even steps or a multiple, some at a time.

    ``omega`` and ``spin`` (n,) rad/s at the start. Raises NotConverged.
    """
    step, done = duration / count, 0
    together = max(TOGETHER // len(spin), 1)
    halvings = 0
    while done < count:
        some = min(together, count - done)
        found = _series(drive, omega, spin, start + done * step, step, some)
        if found is None:
            if halvings == HALVINGS:
                raise NotConverged
            halvings, step, done, count = halvings + 1, 0.5 * step, 2 * done, 2 * count
            continue
        yield found
        done += some
        omega, spin = found.omega[:, -1].sum(axis=0), found.spin[:, -1].sum(axis=0)


def end(
    drive: Drive, omega: ComplexArray, spin: Array, turned: ComplexArray, start: Array, duration: Array
) -> tuple[ComplexArray, Array, ComplexArray]:
    """ω (n,), ω3 (n,) and the turn (2, n) after ``duration`` (n,) s, from those at ``start`` (n,) s.

    Raises NotConverged.
    """
    for found in steps(drive, omega, spin, start, duration, count_for(drive, omega, spin, duration)):
        turned = product(turned, whole(found.turn.sum(axis=0)))
        omega, spin = found.omega[:, -1].sum(axis=0), found.spin[:, -1].sum(axis=0)
    return omega, spin, turned / np.sqrt(np.sum(turned.real**2 + turned.imag**2, axis=0))


def count_for(drive: Drive, omega: ComplexArray, spin: Array, duration: Array) -> int:
    """Steps that the slowest of the bodies takes, if the series converges as its pace promises."""
    return max(1, math.ceil(float(np.max(drive.pace(omega, spin, duration) * duration)) / STRIDE))


def _series(drive: Drive, omega: ComplexArray, spin: Array, now: Array, step: Array, count: int) -> Steps | None:
    """The next ``count`` steps of ``step`` (n,) s from ``now`` (n,) s; None where `ORDER` terms are too few."""
    number = np.arange(count)[:, None]
    starts = now + number * step
    gained = drive.axial * step
    spins = np.stack([spin + gained * number, np.broadcast_to(gained, starts.shape)])
    parts = [(size * np.exp(1j * rate * starts) * step, 1j * rate * step) for size, rate in drive.turning]
    forces = _powers(np.broadcast_to(drive.transverse * step, starts.shape), parts)
    turning = -1j * drive.a * step
    pace = float(np.max(drive.pace(omega, spin, step * count) * step))
    order = _order(pace)
    if count > 1:
        # All steps from rest; then ω at the start of each, by the phases that it has turned through until then.
        driven = _rates(np.zeros_like(forces[0]), turning, spins, forces, ORDER).sum(axis=0)
        turned = np.cumsum(drive.a * step * (spins[0] + 0.5 * gained), axis=0)
        sums = omega + np.cumsum(np.exp(1j * turned) * driven, axis=0)
        later = sums[:-1] * np.exp(-1j * turned[:-1])
        omega_starts = np.concatenate([omega[None], later])
    else:
        omega_starts = np.broadcast_to(omega, starts.shape)
    while True:
        rates = _rates(omega_starts, turning, spins, forces, order)
        turns = _turns(rates, spins, step, order)
        last = max(float(np.abs(rates[-2:] * step).max()), float(np.abs(turns[-2:]).max()))
        if last <= REMAINDER:
            return Steps(starts, step, rates, spins, turns)
        if not math.isfinite(last) or order == ORDER:
            return None
        order = min(order + 4, ORDER)


def _order(pace: float) -> int:
    """Order at which the terms of an exponential over ``pace`` rad are rounding."""
    term = 1.0
    for order in range(1, ORDER + 1):
        term *= pace / order
        if term <= REMAINDER:
            return min(max(order + 1, 4), ORDER)
    return ORDER


def _powers(constant: ComplexArray, turning: list[tuple[Any, Any]]) -> list[Any]:
    """Terms of what drives ω in a step, times the step: the ``constant`` in the first only."""
    if not turning:
        return [constant]
    terms: list[Any] = []
    sizes = [size for size, _ in turning]
    for order in range(ORDER):
        terms.append(sum(sizes))
        sizes = [size * turn / (order + 1) for size, (_, turn) in zip(sizes, turning, strict=True)]
    terms[0] = terms[0] + constant
    return terms


def _rates(omega: ComplexArray, turning: Any, spins: Array, forces: list[Any], order: int) -> ComplexArray:
    """Series of ω (order+1, s, n) from its start (s, n)."""
    series = np.empty((order + 1, *omega.shape), dtype=complex)
    series[0] = omega
    level, slope = turning * spins[0], turning * spins[1]
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
    shape = rates.shape[1:]
    series = np.empty((order + 1, 2, *shape), dtype=complex)
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
    one, two = right
    return np.stack([p * one - r * two.conj(), p * two + r * one.conj()])


def in_turn(turns: ComplexArray) -> ComplexArray:
    """The turns (2, s, n) from the start to the end of each step, (2, s, n), from those of the steps alone."""
    done, reach = turns, 1
    while reach < done.shape[1]:
        done = np.concatenate([done[:, :reach], product(done[:, :-reach], done[:, reach:])], axis=1)
        reach *= 2
    return done


def whole(turns: ComplexArray) -> ComplexArray:
    """The turn (2, n) of all steps (2, s, n), one after the other."""
    while turns.shape[1] > 1:
        even = turns.shape[1] // 2 * 2
        pairs = product(turns[:, 0:even:2], turns[:, 1:even:2])
        turns = np.concatenate([pairs, turns[:, even:]], axis=1)
    return turns[:, 0]
