"""Least squares of a record by the parameters of a model: residuals, derivatives, the search, the noise.

With noise of one sigma s on each sample, residuals r = measured - predicted, and the tolerances of the file as priors,

    minimise  Σ (r/s)² + Σ ((x - x_file)/prior)²,      P = (Jᵀ S⁻² J + prior⁻²)⁻¹,

J the derivatives of the prediction at the minimum: P is then the Cramér-Rao bound, which least squares attains for
normal noise as far as the motion is linear over the errors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.common.numerics import chi_square_tail
from nutdamp.errors import Infeasible
from nutdamp.estimation.model import Model
from nutdamp.estimation.parameters import KIND, SUN_PULSE, Matrix, Vector, quantisation

NORMAL_MAD = 1.4826  # standard deviation of normal numbers over their median magnitude
ROUNDING = 1e-7  # noise that a signal has at least, as a share of its largest value: no telemetry has more digits
EVALUATIONS = 60  # trials of one of the last least-squares searches, at most
TRIAL = 40  # trials of one from a start, at most, which may lead nowhere
GRADIENT = 1e-8  # slope of a cost that is least
STEP = 1e-10  # relative change of it, and of the values, from which on a search is over
DAMPINGS = 10  # steps, at most, in which the length of a step is found


def least(model: Model) -> Vector:
    """Noise that each signal has at least: that of its steps, and rounding."""
    sigmas = []
    for index, name in enumerate(model.signals):
        values = model.measured[model.signal == index]
        step = model.record.sun_step if name == SUN_PULSE else 0.0 if KIND[name].off else quantisation(values)
        size = _spin_periods(model, name) if KIND[name].off else float(np.abs(values).max())
        sigmas.append(max(step / math.sqrt(12.0), ROUNDING * size))
    return np.array(sigmas)


def robust(model: Model, left: Vector) -> Vector:
    """One sigma of each signal by its median magnitude, which outliers hardly change."""
    sizes = [np.median(np.abs(left[model.signal == index])) for index in range(len(model.signals))]
    return NORMAL_MAD * np.array(sizes)


def plain(model: Model, left: Vector, used: NDArray[np.bool_], leverage: Vector | None = None) -> Vector:
    """One sigma of each signal by its samples that are no outliers; ``leverage`` is what the fit takes of each.

    Of n samples with leverages that add up to p the variance is Σr²/(n - p - 2), the mean of its posterior.
    """
    sigmas, signal = [], model.signal[used]
    for index in range(len(model.signals)):
        rows = signal == index
        spent = 0.0 if leverage is None else float(leverage[rows].sum()) + 2.0
        total = float(left[used][rows] @ left[used][rows])
        sigmas.append(math.sqrt(total / max(float(rows.sum()) - spent, 1.0)))
    return np.array(sigmas)


def named_of(model: Model, values: Iterable[float]) -> dict[str, float]:
    """The values (p,) by the names of their parameters."""
    return {parameter.name: float(value) for parameter, value in zip(model.parameters, values, strict=True)}


def residuals(model: Model, values: Vector) -> Vector:
    """Measured less predicted, (m,)."""
    return model.measured - model.predicted(named_of(model, values))


def scales_of(model: Model) -> Vector:
    """Sizes that residuals of each signal are compared with before its noise is known: a tenth of what varies."""
    scales = []
    for index, name in enumerate(model.signals):
        values = model.measured[model.signal == index]
        spread = NORMAL_MAD * float(np.median(np.abs(values - np.median(values))))
        scales.append(0.1 * spread or KIND[name].spread * _spin_periods(model, name))
    return np.array(scales)


def _spin_periods(model: Model, name: str) -> float:
    """One radian of the spin, s, of times; else 1."""
    return 1.0 / abs(model.spacecraft.spin) if KIND[name].unit == "s" else 1.0


def share_left(model: Model, values: Vector) -> float:
    """Least share of a signal's own variation that the residuals still have."""
    left = residuals(model, values)
    shares = []
    for index, shown in enumerate(model.samples):
        rows = model.signal == index
        varied = float(np.median(np.linalg.norm(shown - np.median(shown, axis=0), axis=1)))
        if varied > 0.0:
            shares.append(float(np.median(np.abs(left[rows]))) / varied)
    return min(shares, default=0.0)


def jacobian(model: Model, values: Vector, which: Iterable[int], *, one_sided: bool = False) -> Matrix:
    """Derivatives (m, k) of the prediction by the parameters at some positions, by central differences.

    ``one_sided`` ones take half as long, and err by a part of about the step, 1e-7: good enough for a search.
    """
    columns = []
    here = model.predicted(named_of(model, values)) if one_sided else None
    for index in which:
        ends = np.stack([values, values])
        ends[:, index] += np.array([1.0, 0.0 if one_sided else -1.0]) * model.parameters[index].step
        above = model.predicted(named_of(model, ends[0]))
        below = model.predicted(named_of(model, ends[1])) if here is None else here
        columns.append((above - below) / (ends[0, index] - ends[1, index]))
    return np.column_stack(columns)


def units_of(model: Model) -> Vector:
    """Sizes in which the parameters are searched: their priors, or what is usual."""
    usual = {"rad/s": 1e-2 * model.spacecraft.fastest, "1/s": 0.1 / max(model.record.length, 1e-9)}
    sizes = (each.prior if math.isfinite(each.prior) else usual.get(each.unit, 1e-2) for each in model.parameters)
    return np.array(list(sizes))


def search(
    model: Model, values: Vector, noise: Vector, rows: NDArray[np.bool_], *, robust: bool, near: bool = True
) -> tuple[Vector, float]:
    """Values of the least cost over some of the samples, or reached with the budget of work, and that cost."""
    units, weights = units_of(model), 1.0 / noise[model.signal[rows]]
    bound, nominal = model.prior[0] * units, model.prior[1]

    def errors(scaled: Vector) -> Vector:
        try:
            left = residuals(model, scaled * units)[rows] * weights
        except Infeasible:  # a trial too far to be flown: the search comes nearer
            return np.full(int(rows.sum()) + len(nominal), math.inf)
        return np.concatenate([left, bound @ scaled - nominal])

    def derivatives(scaled: Vector) -> Matrix | None:
        if work.exhausted():
            return None
        slopes = jacobian(model, scaled * units, range(len(units)), one_sided=True)[rows] * units
        return np.concatenate([-slopes * weights[:, None], bound])

    scaled, cost = _minimum(errors, derivatives, values / units, robust=robust, near=near)
    return scaled * units, cost


def _minimum(
    errors: Callable[[Vector], Vector],
    derivatives: Callable[[Vector], Matrix | None],
    x: Vector,
    *,
    robust: bool,
    near: bool,
) -> tuple[Vector, float]:
    """Least Σ r²/2, or Σ (√(1 + r²) - 1) where ``robust``, of ``errors`` r from ``x`` on, and its place.

    Steps of Gauss and Newton within a trust region (Moré 1978), an ellipsoid along the ``derivatives``; not so far
    from the minimum, where steps as long as these allow lead astray. It ends where there are no derivatives.
    """
    left = errors(x)
    cost, damping, spans = _cost(left, robust), 0.0, np.zeros(len(x))
    radius, trials = 0.0, 1
    while trials < (EVALUATIONS if near else TRIAL) and math.isfinite(cost):
        slopes = derivatives(x)
        if slopes is None:
            break
        root = np.sqrt(1.0 + left * left) if robust else np.ones(len(left))
        curved = np.sqrt(np.maximum(root**-3.0, np.finfo(float).eps))  # of the loss; root**-1 is its slope
        slopes *= curved[:, None]
        both = np.column_stack([slopes, left / root / curved])
        triangle = np.asarray(np.linalg.qr(both, mode="r"), dtype=np.float64)
        spans = np.maximum(spans, np.linalg.norm(slopes, axis=0)) if near else np.ones(len(x))
        spans[spans == 0.0] = 1.0
        if np.abs(triangle[:, :-1].T @ triangle[:, -1]).max() < GRADIENT:
            break
        radius = radius or float(np.linalg.norm(x * spans)) or 1.0
        turned, sizes, axes = np.linalg.svd(triangle[:, :-1] / spans, full_matrices=False)
        along = turned.T @ triangle[:, -1]
        gain = -1.0
        while gain <= 0.0 and trials < (EVALUATIONS if near else TRIAL):
            damping = _damping(sizes, along, radius, damping)
            share = _share(sizes, along, damping)
            step, length = -(axes.T @ share) / spans, float(np.linalg.norm(share))
            trial = errors(x + step)
            trials += 1
            expected = float(along @ (sizes * share) - 0.5 * np.sum((sizes * share) ** 2))
            gain = cost - _cost(trial, robust)
            if not math.isfinite(gain):
                radius, gain = 0.25 * length, -1.0
                continue
            ratio = gain / expected if expected > 0.0 else 0.0
            before = radius
            if ratio < 0.25:
                radius = 0.25 * length
            elif ratio > 0.75 and length > 0.95 * radius:
                radius *= 2.0
            damping *= before / radius if radius > 0.0 else 0.0
            tiny = float(np.linalg.norm(step)) < STEP * (STEP + float(np.linalg.norm(x)))
            if tiny or (gain < STEP * cost and ratio > 0.25):
                return (x + step, cost - gain) if gain > 0.0 else (x, cost)
        if gain > 0.0:
            x, left, cost = x + step, trial, cost - gain
    return x, cost


def _cost(left: Vector, robust: bool) -> float:
    squares = left * left
    return float(np.sum(np.sqrt(1.0 + squares) - 1.0 if robust else 0.5 * squares))


def _share(sizes: Vector, along: Vector, damping: float) -> Vector:
    """Step against a gradient, along the singular vectors of sizes ``sizes``; none where these are nothing."""
    least = np.finfo(float).eps * sizes[0] * len(sizes)
    return np.where(sizes > least, sizes, 0.0) * along / np.where(sizes > least, sizes * sizes + damping, 1.0)


def _damping(sizes: Vector, along: Vector, radius: float, damping: float) -> float:
    """Damping by which a step is as long as the ``radius``, to a hundredth; 0 where it is shorter. By Newton."""
    length = float(np.linalg.norm(_share(sizes, along, 0.0)))
    if length <= radius:
        return 0.0
    low, high = 0.0, float(np.linalg.norm(sizes * along)) / radius
    for _ in range(DAMPINGS):
        if not low < damping < high:
            damping = max(1e-3 * high, math.sqrt(low * high))
        share = _share(sizes, along, damping)
        length = float(np.linalg.norm(share))
        excess = length - radius
        slope = -float(np.sum(share * share / (sizes * sizes + damping))) / length
        low, high = (low, damping) if excess < 0.0 else (damping, high)
        if abs(excess) < 0.01 * radius:
            break
        damping -= length / radius * excess / slope
    return damping


def covariance_of(model: Model, scaled: Matrix) -> Matrix:
    """P of the derivatives over the noise; what neither data nor priors tell is infinite, here very large."""
    units = units_of(model)
    stacked = np.concatenate([scaled, model.prior[0]]) * units
    _, sizes, turned = np.linalg.svd(stacked, full_matrices=False)
    inverse = turned.T / np.maximum(sizes, 1e-13 * sizes[0])
    covariance = inverse @ inverse.T
    return np.asarray(covariance * np.outer(units, units))


# By which the square of a shift across a curved region counts: (t², s t²) is then in the ellipsoid in 95 % of cases,
# for 2 to 10 parameters, whether s is small or large.
CURVED = 7.0

GROWS = 3.0  # standard deviations of κ from which on it shows
KEPT = 0.9  # share of its prior above which a parameter's sigma is where the data do not tell it


@dataclass(frozen=True, eq=False)
class Fit:
    """Estimate of a spacecraft from a record."""

    model: Model
    values: Vector  # (p,) of the model's parameters, SI
    covariance: Matrix  # (p, p) of these
    noise: Vector  # one sigma of each signal: rad of directions, s of Sun pulses
    used: NDArray[np.bool_]  # (m,) samples that are no outliers
    residuals: Vector  # (m,) measured less predicted
    jacobian: Matrix  # (m, p)
    finished: bool = True  # unless the search ended with its budget of work

    @property
    def named(self) -> dict[str, float]:
        """The values by name."""
        return named_of(self.model, self.values)

    @property
    def sigmas(self) -> Vector:
        """Standard deviations of the values, (p,)."""
        return np.sqrt(np.diag(self.covariance))

    def index(self, name: str) -> int | None:
        """Position of a parameter; None where it is not estimated."""
        return next((at for at, parameter in enumerate(self.model.parameters) if parameter.name == name), None)

    @property
    def grows(self) -> bool:
        """True where κ is estimated and shows: then a body of three moments is taken to dissipate."""
        at = self.index("growth")
        return at is not None and bool(abs(self.values[at]) > GROWS * self.sigmas[at])

    @cached_property
    def region(self) -> Matrix:
        """The covariance (p, p) whose ellipsoids hold the true values as often as they say, though regions are curved.

        A direction of the covariance, followed for one sigma both ways, leaves residuals that do not cancel: least
        squares by J turns them into the shift s across it that the curve takes there. It is off by s t² at t sigmas:
        of P + `CURVED` Σ s sᵀ the 95 % ellipsoid holds 95 % of a normal t, for any length of s.
        """
        scale = self.sigmas
        sizes, turned = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        noise = self.noise[self.model.signal[self.used]]
        slopes = self.jacobian[self.used] / noise[:, None]
        here, shifts = self.model.predicted(self.named), []
        for direction in (scale[:, None] * turned * np.sqrt(np.maximum(sizes, 0.0))).T:
            both_ways = (self.values + direction, self.values - direction)
            try:
                with np.errstate(all="ignore"):
                    ends = [self.model.predicted(named_of(self.model, values)) for values in both_ways]
            except Infeasible:  # of what nothing is known one sigma may be no body at all
                continue
            bent = (0.5 * (ends[0] + ends[1]) - here)[self.used] / noise
            shifts.append(self.covariance @ (slopes.T @ bent))
        across = np.array([shift for shift in shifts if np.isfinite(shift).all()]).reshape(-1, len(scale))
        return np.asarray(self.covariance + CURVED * across.T @ across)

    @cached_property
    def kept(self) -> tuple[str, ...]:
        """Parameters that the data do not tell: they stay as the file has them."""
        pairs = zip(self.model.parameters, self.sigmas, strict=True)
        return tuple(parameter.name for parameter, sigma in pairs if sigma > KEPT * parameter.prior)

    @cached_property
    def information(self) -> Vector:
        """Singular values of J/s in units of the priors, the rest being fitted, falling; below 1 priors say more."""
        priors = np.array([parameter.prior for parameter in self.model.parameters])
        with_prior = np.isfinite(priors)
        scaled = self.jacobian[self.used] / self.noise[self.model.signal[self.used], None]
        free, held = scaled[:, ~with_prior], scaled[:, with_prior] * priors[with_prior]
        if free.shape[1]:
            basis, _ = np.linalg.qr(free / np.maximum(np.linalg.norm(free, axis=0), 1e-300))
            held = held - basis @ (basis.T @ held)
        return np.asarray(np.linalg.svd(held, compute_uv=False))

    @cached_property
    def resolved(self) -> NDArray[np.bool_]:
        """Of each signal, whether its noise is more than its digits or its steps make anyway."""
        return np.asarray(self.noise > least(self.model) * (1.0 + 1e-9))

    def whiteness(self, signal: int, lags: int = 40) -> Vector:
        """Autocorrelations of the residuals of a signal, from lag 1 on; of white ones 95 % are below 1.96/√n."""
        rows = self.used & (self.model.signal == signal)
        left = self.residuals[rows] - self.residuals[rows].mean()
        total = float(left @ left) or 1.0
        return np.array([float(left[lag:] @ left[:-lag]) / total for lag in range(1, min(lags, len(left) - 1) + 1)])

    def white(self, signal: int) -> bool:
        """True where the autocorrelations are as small as those of white noise (Ljung-Box, 1 in 1000)."""
        count = int((self.used & (self.model.signal == signal)).sum())
        correlations = self.whiteness(signal, 20)
        lags = np.arange(1, len(correlations) + 1)
        return chi_square_tail(len(lags), float(count * (count + 2) * np.sum(correlations**2 / (count - lags)))) > 0.001
