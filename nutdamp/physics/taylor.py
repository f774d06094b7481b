"""Taylor integration of Euler's equations and the attitude of one body under piecewise constant
torques.

The equations are polynomials in rates and quaternion, so the Taylor coefficients of a solution
follow from one another by products of series. One step spans about two radians at rounding
accuracy, for any principal moments.

Without dissipation the rates of a symmetric body are linear in their drive whatever its attitude:
ω' = -iaω3 ω + M/A with ω3 linear in time, Magnus 1970 (1). The rates at the ends of all steps
follow from sums, and the steps of the attitude are independent of each other: arrays carry the
steps and the cases, and the turns of the steps are multiplied at the end. A quaternion (w, x, y, z)
is a pair of complex numbers there, p = w + iz and r = x + iy: dq/dt = q (0, ω)/2 becomes p' = (iω3
p - ω̄ r)/2 and r' = (ω p - iω3 r)/2, and the product of two is (p p* - r r̄*, p r* + r p̄*).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible
from nutdamp.physics import attitude

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

DRIVEN_ORDER = (
    22  # largest order of the series of symmetric bodies; a step that needs more is halved
)
STRIDE = 1.7  # largest step, rad of the fastest rotation: 1.7^22/22! is rounding
REMAINDER = (
    2.0**-53
)  # size of the last two terms kept, relative to the scale of rates and quaternion
TOGETHER = 1024  # steps times cases summed together: few enough that their series stay in the cache
HALVINGS = 12  # largest number of halvings of the steps where the series does not converge


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

    @classmethod
    def of(cls, a: Array, acceleration: Array, forcing: Forcing, A: Any) -> Drive:
        """Drive by an angular ``acceleration`` (3, n) rad/s² besides the ``forcing``."""
        turning = tuple((size / A, rate) for size, rate in forcing.turning)
        return cls(
            a, acceleration[0] + 1j * acceleration[1], acceleration[2], turning, forcing.wheel / A
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
            if halvings == HALVINGS:
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
    return max(1, math.ceil(float(np.max(drive.pace(omega, spin, duration) * duration)) / STRIDE))


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
        if last <= REMAINDER:
            return Steps(starts, step, rates, spins, turns)
        if not math.isfinite(last) or order == DRIVEN_ORDER:
            return None
        order = min(order + 4, DRIVEN_ORDER)


def _order(pace: float) -> int:
    """Order at which the terms of an exponential over ``pace`` rad are rounding."""
    term = 1.0
    for order in range(1, DRIVEN_ORDER + 1):
        term *= pace / order
        if term <= REMAINDER:
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


ORDER = (
    22  # order of the series; near -ln(eps)/2 the work per radian is least for rounding accuracy
)
# share of the largest |H| of a motion below which H counts as at rest for energy dissipation
AT_REST = 1e-9
LONGEST = 3e5  # largest angle of one integration, rad: some two hundred thousand steps
SHORT = 8.0  # angle up to which sequential steps are quicker than all at once, rad
# largest number of steps of one integration: enough for `LONGEST` whatever the rates on the way
MOST_STEPS = 400_000


class Falling(NamedTuple):
    """Changing principal moments: ``rate`` (3,) kg m²/s at the start of an integration, ``growth``
    (3,) kg m²/s² of it.

    Expelled mass takes along the angular momentum that it has there: I dω/dt = M - ω × (I ω), I as
    it falls.
    """

    rate: Array
    growth: Array

    def after(
        self, moments: Array, gone: float
    ) -> tuple[tuple[float, float, float], Array, Falling]:
        """Moments (3,) after ``gone`` s, the ratio of ``moments`` (3,) to them, and their further
        fall.
        """
        light = moments + gone * (self.rate + 0.5 * gone * self.growth)
        further = Falling(self.rate + gone * self.growth, self.growth)
        return (light[0], light[1], light[2]), moments / light, further


class Forcing(NamedTuple):
    """Forcing of a body besides a constant torque."""

    turning: tuple[
        tuple[complex, float], ...
    ] = ()  # torques M e^{irt} about axis 3: M1 + iM2 in N m at t = 0, r rad/s
    growth: float = 0.0  # κ of `energy_sink`, 1/s, at which a small nutation grows; negative: decay
    wheel: Any = (
        0.0  # constant momentum h along axis 3 besides I3 ω3, N m s; (n,) by case in `batch`
    )
    sense: float = 1.0  # σ of the spin axis σ·e3, where κ holds


NOTHING = Forcing()


@dataclass(frozen=True, slots=True)
class TaylorPiece:
    """Solution from ``start`` over ``duration`` s as polynomials in x = (t - start)/duration."""

    start: float
    duration: float
    rates: Array  # (orders, 3) rad/s
    attitude: Array  # (orders, 4)

    def at(self, times: Array) -> tuple[Array, Array]:
        """Rates (n, 3) and unit quaternions (n, 4) at ``times`` (n,) s within the piece."""
        powers = ((np.asarray(times, dtype=float) - self.start) / self.duration)[
            :, None
        ] ** np.arange(len(self.rates))
        quaternion = powers @ self.attitude
        return powers @ self.rates, quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)

    @property
    def final(self) -> tuple[Array, Array]:
        """Rates (3,) and unit quaternion (4,) at the end."""
        quaternion = self.attitude.sum(axis=0)
        return self.rates.sum(axis=0), quaternion / np.linalg.norm(quaternion)


def integrate(
    moments: tuple[float, float, float],
    torque: Array,
    rates: Array,
    quaternion: Array,
    start: float,
    end: float,
    forcing: Forcing = NOTHING,
    most: int = MOST_STEPS,
    slope: Array | None = None,
    falling: Falling | None = None,
) -> list[TaylorPiece]:
    """Motion of a rigid body under a constant body torque and ``forcing``, from ``start`` to
    ``end`` s (> start).

    ``moments`` (I1, I2, I3) kg m², ``torque`` (3,) N m with its ``slope`` (3,) N m/s, ``rates``
    (3,) rad/s, ``quaternion`` (4,) body -> inertial; all, ``falling`` moments too, as at ``start``.
    Raises Infeasible beyond `LONGEST` rad or ``most`` steps.
    """
    # In one piece: a part of the loop would take torque, slope, moments and forcing, each as it is
    # at a step.
    pieces: list[TaylorPiece] = []
    inertia = np.asarray(moments)
    acceleration = np.asarray(torque) / inertia
    jerk = None if slope is None else slope / inertia
    strength = float(np.linalg.norm(acceleration)) + sum(
        abs(size) for size, _ in forcing.turning
    ) / min(moments)
    if jerk is not None:
        strength = max(strength, float(np.linalg.norm(acceleration + jerk * (end - start))))
    fastest = max((abs(rate) for _, rate in forcing.turning), default=0.0) + abs(
        forcing.wheel
    ) / min(moments)
    turned = (float(np.linalg.norm(rates)) + math.sqrt(strength) + fastest) * (end - start)
    even = jerk is None and falling is None
    if moments[0] == moments[1] and forcing.growth == 0.0 and even and not turned <= SHORT:
        return _symmetric(moments, acceleration, rates, quaternion, start, end, forcing, most)
    size = (
        float(np.linalg.norm(inertia * rates))
        + abs(forcing.wheel)
        + strength * max(moments) * (end - start)
    )
    floor = (AT_REST * size) ** 2
    # counted from the start: a late clock cannot tell so short a step
    gone = 0.0
    duration = end - start
    for _ in range(most + 1):
        now = start + gone
        left = duration - gone
        if left <= 0.0:
            return pieces
        # Unit of time for the coefficients: about one radian, so that none over- or underflows.
        pace = float(np.linalg.norm(rates)) + math.sqrt(strength) + fastest + abs(forcing.growth)
        if not pace * left <= LONGEST:
            raise _refused(now, end, pace * left)
        unit = 1.0 / pace if pace > 0.0 else left
        state = np.concatenate([rates, quaternion])
        here = acceleration if jerk is None else acceleration + jerk * gone
        bent = jerk
        body, further = moments, falling
        if falling is not None:
            body, changed, further = falling.after(inertia, gone)
            here = here * changed
            bent = None if bent is None else bent * changed
        series = _series(body, here, forcing, floor, now, state, unit, bent, further)
        step = min(_reach(series, unit) * unit, left)
        if left - step < 1e-3 * step:  # no sliver of a step at the end
            step = left
        scaled = series * ((step / unit) ** np.arange(ORDER + 1))[:, None]
        pieces.append(TaylorPiece(now, step, scaled[:, :3], scaled[:, 3:]))
        rates, quaternion = pieces[-1].final
        gone = duration if step == left else gone + step
    raise _refused(start, end)


def _refused(start: float, end: float, angle: float | None = None) -> Infeasible:
    """Error of a motion over too large an ``angle`` rad, or None of too many steps."""
    why = "takes too many steps" if angle is None else f"runs over {angle:.2g} rad, too many"
    return Infeasible(
        f"the motion from {start:.4g} s to {end:.4g} s {why} to be integrated; shorten the time, "
        "or look for a torque "
        "or rate that is too large"
    )


def _symmetric(
    moments: tuple[float, float, float],
    acceleration: Array,
    rates: Array,
    quaternion: Array,
    start: float,
    end: float,
    forcing: Forcing,
    most: int,
) -> list[TaylorPiece]:
    """`integrate` for I1 = I2 without dissipation: many steps at once, see `steps`."""
    A, _, C = moments
    drive = Drive.of(np.array([(A - C) / A]), acceleration[:, None], forcing, A)
    omega = np.array([complex(rates[0], rates[1])])
    spin = rates[2:]
    duration = np.array([end - start])
    angle = float(drive.pace(omega, spin, duration)[0]) * (end - start)
    if angle > most * STRIDE and most < MOST_STEPS:
        raise _refused(start, end)
    if not angle <= LONGEST:
        raise _refused(start, end, angle)
    count = count_for(drive, omega, spin, duration)
    pieces = list[TaylorPiece]()
    try:
        for series in steps(drive, omega, spin, np.array([start]), duration, count):
            pieces += _pieces(series, quaternion)
            quaternion = pieces[-1].final[1]
            if len(pieces) > most:
                raise _refused(start, end)
    except NotConverged:
        raise _refused(start, end) from None
    pieces[-1] = replace(pieces[-1], duration=end - pieces[-1].start)  # the same but for rounding
    return pieces


def _pieces(series: Steps, quaternion: Array) -> list[TaylorPiece]:
    """Steps of one body as pieces, from its ``quaternion`` (4,) at their start."""
    terms, count = len(series.omega), len(series.starts)
    rates = np.zeros((count, terms, 3))
    rates[..., 0], rates[..., 1] = series.omega[..., 0].real.T, series.omega[..., 0].imag.T
    rates[:, :2, 2] = series.spin[..., 0].T
    turn = series.turn[..., 0]
    if count > 1:
        before = in_turn(turn.sum(axis=0)[:, :-1, None])[..., 0]
        turn[:, :, 1:] = np.moveaxis(
            product(before[:, None], np.moveaxis(turn, 1, 0)[:, :, 1:]), 0, 1
        )
    parts = np.stack([turn[:, 0].real, turn[:, 1].real, turn[:, 1].imag, turn[:, 0].imag], axis=-1)
    quaternions = attitude.multiply(quaternion, np.swapaxes(parts, 0, 1))
    starts = series.starts[:, 0].tolist()
    duration = float(series.duration[0])
    return [
        TaylorPiece(*parts)
        for parts in zip(starts, [duration] * count, rates, quaternions, strict=True)
    ]


def _series(
    moments: tuple[float, float, float],
    acceleration: Array,
    forcing: Forcing,
    floor: float,
    now: float,
    state: Array,
    unit: float,
    jerk: Array | None,
    falling: Falling | None,
) -> Array:
    """Taylor coefficients (ORDER+1, 7) of rates and quaternion in units of time ``unit``.

    dω1/dt = (I2 - I3)/I1 ω2 ω3 - h/I1 ω2 + M1/I1 and round, Magnus 1970 (1) for three different
    moments and a wheel; dq/dt = q (0, ω)/2, and the terms of `_Sink` where energy is dissipated, of
    `_Light` where moments are ``falling``.
    """
    first, second, third = moments
    coupling = ((second - third) / first, (third - first) / second, (first - second) / third)
    series = np.zeros((ORDER + 1, 7))
    series[0] = state
    turning = [
        (size * cmath.exp(1j * rate * now), 1j * rate * unit) for size, rate in forcing.turning
    ]
    light = None if falling is None else _Light(np.asarray(moments), falling, unit)
    sink = None if forcing.growth == 0.0 else _Sink(np.asarray(moments), forcing, floor, light)
    for k in range(ORDER):
        # (series of the product of any two components)_k, by rows and columns, in one matrix
        # product
        w = series[: k + 1].T @ series[k::-1, :3]
        step = unit / (k + 1)
        following = series[k + 1]
        following[0] = step * coupling[0] * w[1, 2]
        following[1] = step * coupling[1] * w[2, 0]
        following[2] = step * coupling[2] * w[0, 1]
        if forcing.wheel:
            following[0] -= step * forcing.wheel / first * series[k, 1]
            following[1] += step * forcing.wheel / second * series[k, 0]
        if k == 0:
            following[:3] += unit * acceleration
        elif k == 1 and jerk is not None:
            following[:3] += step * unit * jerk
        for index, (size, turn) in enumerate(turning):
            following[0] += step * size.real / first
            following[1] += step * size.imag / second
            turning[index] = (size * turn / (k + 1), turn)
        if light is not None:
            following[:3] += light.change(series, np.array([w[1, 2], w[2, 0], w[0, 1]]), k)
        if sink is not None:
            more = None if light is None else light.momentum(series, k)
            following[:3] += step * sink.acceleration(series[k, :3], k, more)
            w = series[: k + 1].T @ (series[k::-1, :3] + sink.slip[k::-1])
        following[3] = -0.5 * step * (w[4, 0] + w[5, 1] + w[6, 2])
        following[4] = 0.5 * step * (w[3, 0] + w[5, 2] - w[6, 1])
        following[5] = 0.5 * step * (w[3, 1] + w[6, 0] - w[4, 2])
        following[6] = 0.5 * step * (w[3, 2] + w[4, 1] - w[5, 0])
    return series


class _Light:
    """Falling moments as series: I(x) = I0 + I1 x + I2 x², x the time in the ``unit`` of the
    series.
    """

    def __init__(self, moments: Array, falling: Falling, unit: float) -> None:
        self.parts = moments, unit * falling.rate, 0.5 * unit**2 * falling.growth
        self.couplings = [unit * (part[[1, 2, 0]] - part[[2, 0, 1]]) for part in self.parts]
        self.products = list[Array]()

    def change(self, series: Array, product: Array, k: int) -> Array:
        """Terms of I1 and I2 in coefficient k + 1 of ω, (3,); ``product``: coefficient k of (ω2 ω3,
        ω3 ω1, ω1 ω2).

        By (k + 1) I0 ω_(k+1) + k I1 ω_k + (k - 1) I2 ω_(k-1) = unit Σ (ΔI_j) (ω ω)_(k-j), ΔI = (I2
        - I3, …) of each.
        """
        self.products.append(product)
        total = np.zeros(3)
        for order in range(1, min(k, 2) + 1):
            total += self.couplings[order] * self.products[k - order]
            total -= (k + 1 - order) * self.parts[order] * series[k + 1 - order, :3]
        return np.asarray(total / ((k + 1) * self.parts[0]))

    def momentum(self, series: Array, k: int) -> Array:
        """Terms of I1 and I2 in coefficient k of H, (3,)."""
        orders = range(1, min(k, 2) + 1)
        return np.asarray(
            sum((self.parts[order] * series[k - order, :3] for order in orders), np.zeros(3))
        )


class _Sink:
    """`energy_sink` as series: torque of dissipation on H in body axes, and slip of the body.

    With q = H3/|H|² the slip is s = κq (H2, -H1, 0), and H × s is added to dH/dt in the body.
    ``floor`` keeps q regular where external torques bring H to rest: there is nothing to dissipate
    there. With a wheel q is ((C - A)H3 + Ah)/((C - A)|H|² + σAh|H|), of moments that may fall.
    """

    def __init__(
        self, moments: Array, forcing: Forcing, floor: float, light: _Light | None
    ) -> None:
        self.moments = moments
        self.growth = forcing.growth
        self.floor = floor
        self.wheel = forcing.wheel
        parts = np.array([moments] if light is None else light.parts)  # series of the moments
        self.by_wheel = 0.5 * (parts[:, 0] + parts[:, 1])
        self.by_body = parts[:, 2] - self.by_wheel
        self.sense = forcing.sense
        self.size, self.below = np.zeros((2, ORDER))  # |H| and the denominator of q
        self.momentum, self.slip = np.zeros((2, ORDER, 3))  # H and s
        self.squares, self.quotient = np.zeros((2, ORDER))  # |H|² and q

    def acceleration(self, rates: Array, k: int, more: Array | None) -> Array:
        """Coefficient k of (H × s)/I, (3,), from that of ω and ``more`` of H (3,); stores that of
        ``slip``.
        """
        momentum, slip = self.momentum, self.slip
        momentum[k] = self.moments * rates if more is None else self.moments * rates + more
        momentum[k, 2] += self.wheel if k == 0 else 0.0
        self.squares[k] = momentum[: k + 1].ravel() @ momentum[k::-1].ravel()
        if k == 0:
            self.squares[0] += self.floor
            self.size[0] = math.sqrt(self.squares[0])
        elif self.wheel and self.size[0] > 0.0:
            between = self.size[1:k] @ self.size[k - 1 : 0 : -1]
            self.size[k] = 0.5 * (self.squares[k] - between) / self.size[0]
        self.below[k], above = self.squares[k], momentum[k, 2]
        if self.wheel:
            by_body = self.by_body[: k + 1]
            by_wheel = self.wheel * self.by_wheel[: k + 1]
            back = slice(k, k - len(by_body) if k >= len(by_body) else None, -1)
            self.below[k] = by_body @ self.squares[back] + self.sense * (by_wheel @ self.size[back])
            above = by_body @ momentum[back, 2] + (by_wheel[k] if k < len(by_wheel) else 0.0)
        if self.below[0] != 0.0:
            before = self.below[1 : k + 1] @ self.quotient[:k][::-1]
            self.quotient[k] = (above - before) / self.below[0]
        first, second = self.growth * (self.quotient[k::-1] @ momentum[: k + 1, :2])
        slip[k] = (second, -first, 0.0)
        products = momentum[: k + 1].T @ slip[k::-1]
        drive = np.array([-products[2, 1], products[2, 0], products[0, 1] - products[1, 0]])
        return np.asarray(drive / self.moments)


def _reach(series: Array, unit: float) -> float:
    """Reach of the series at accuracy `REMAINDER`, in its unit of time,
    from its last two orders.
    """
    sizes = np.max(np.abs(series[-2:]) * np.array([unit] * 3 + [1.0] * 4), axis=1).tolist()
    reaches = [
        (REMAINDER / last) ** (1.0 / order)
        for order, last in enumerate(sizes, ORDER - 1)
        if last > 0.0
    ]
    return min(reaches, default=math.inf)
