"""Least squares of a record by the parameters of a model: residuals, derivatives, the search, the
noise.

With noise of one sigma s on each sample, residuals r = measured - predicted, and the tolerances of
the file as priors,

    minimise  Σ (r/s)² + Σ ((x - x_file)/prior)²,      P = (Jᵀ S⁻² J + prior⁻²)⁻¹,

J the derivatives of the prediction at the minimum: P is then the Cramér-Rao bound, which least
squares attains for normal noise as far as the motion is linear over the errors.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import chdtrc

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.estimation.model import Model
from nutdamp.estimation.parameters import KIND, SUN_PULSE, Matrix, Vector, quantisation
from nutdamp.spacecraft.model import Spacecraft

NORMAL_MAD = 1.4826  # standard deviation of normal numbers over their median magnitude
BROKEN = (
    0.2  # part of the samples of a sensor that are alike, no motion or left out where it is broken
)
ABSURD = 1e3  # times the usual size of a signal from which on a sample is no motion
# noise that a signal has at least, as a share of its largest value: no telemetry has more digits
ROUNDING = 1e-7
EVALUATIONS = 60  # trials of one of the last least-squares searches, at most
TRIAL = 40  # trials of one from a start, at most, which may lead nowhere
GRADIENT = 1e-8  # slope of a cost that is least
STEP = 1e-10  # relative change of it, and of the values, from which on a search is over


def noise_floor(model: Model) -> Vector:
    """Noise that each signal has at least: that of its steps, and rounding."""
    # A signal of zeros has no digits, but its prediction is rounded, as rates and angles are.
    turned = usual(model.spacecraft, "rad/s") * model.record.length
    rounding = float(np.finfo(float).eps) * (1.0 + turned)
    sigmas = []
    for index, name in enumerate(model.signals):
        kind, values = KIND[name], model.measured[model.signal == index]
        step = 0.0
        size = usual(model.spacecraft, kind.unit)
        largest = size if kind.off else float(np.abs(values).max())
        if name == SUN_PULSE:
            step = model.record.sun_step
        elif not kind.off:
            step = quantisation(values)
        sigmas.append(max(step / math.sqrt(12.0), ROUNDING * largest, rounding * size))
    return np.array(sigmas)


def usual(spacecraft: Spacecraft, unit: str) -> float:
    """Size of the motion in the ``unit`` of a signal: a radian, H3/C, what 1 m off the axis feels.

    Of times that in which the body spins by a radian.
    """
    if unit == "s":
        return 1.0 / abs(spacecraft.spin)
    pace = abs(spacecraft.axial) / spacecraft.inertia.C
    return {"rad": 1.0, "rad/s": pace, "m/s²": pace * pace}[unit]


def absurd(spacecraft: Spacecraft, name: str, values: Vector) -> NDArray[np.bool_]:
    """True for samples of a signal that are no motion, however fast; of directions none."""
    return np.asarray(np.abs(values) > ABSURD * max(usual(spacecraft, KIND[name].unit), 1.0)) & (
        not KIND[name].off
    )


def robust(model: Model, misfits: Vector) -> Vector:
    """One sigma of each signal by its median magnitude, which outliers hardly change."""
    sizes = [
        np.median(np.abs(misfits[model.signal == index])) for index in range(len(model.signals))
    ]
    return NORMAL_MAD * np.array(sizes)


def plain(
    model: Model, misfits: Vector, used: NDArray[np.bool_], leverage: Vector | None = None
) -> Vector:
    """One sigma of each signal by its samples that are no outliers; ``leverage`` is what the fit
    takes of each.

    Of n samples with leverages that add up to p the variance is Σr²/(n - p - 2), the mean of its
    posterior.
    """
    sigmas = []
    signal = model.signal[used]
    for index in range(len(model.signals)):
        rows = signal == index
        spent = 0.0 if leverage is None else float(leverage[rows].sum()) + 2.0
        total = float(misfits[used][rows] @ misfits[used][rows])
        sigmas.append(math.sqrt(total / max(float(rows.sum()) - spent, 1.0)))
    return np.array(sigmas)


def named_of(model: Model, values: Iterable[float]) -> dict[str, float]:
    """The values (p,) by the names of their parameters."""
    return {
        parameter.name: float(value)
        for parameter, value in zip(model.parameters, values, strict=True)
    }


def residuals(model: Model, values: Vector) -> Vector:
    """Measured less predicted, (m,)."""
    return model.measured - model.predicted(named_of(model, values))


def scales_of(model: Model) -> Vector:
    """Sizes that residuals of each signal are compared with before its noise is known: a tenth of
    what varies.
    """
    scales = []
    for index, name in enumerate(model.signals):
        kind, values = KIND[name], model.measured[model.signal == index]
        spread = NORMAL_MAD * float(np.median(np.abs(values - np.median(values))))
        varies = spread > ROUNDING * usual(model.spacecraft, kind.unit)
        before = kind.spread * (usual(model.spacecraft, "s") if kind.unit == "s" else 1.0)
        scales.append(0.1 * spread if varies else before)
    return np.array(scales)


FEW_EARLY = 12  # samples before the last pulse below which the whole record counts


def share_left(model: Model, values: Vector) -> float:
    """Least share of a signal's own variation that the residuals still have.

    Until the last pulse, where there are pulses: the motion that they have damped hardly varies.
    """
    misfits = residuals(model, values)
    until = model.start + model.pulses.end if len(model.pulses) else math.inf
    shares = []
    for index, samples in enumerate(model.samples):
        rows = np.flatnonzero(model.signal == index)
        early = model.times[rows] <= until
        if np.count_nonzero(early) < FEW_EARLY:
            early[:] = True
        shown = samples[early[: len(samples)]]
        varied = float(np.median(np.linalg.norm(shown - np.median(shown, axis=0), axis=1)))
        if varied > 0.0:
            shares.append(float(np.median(np.abs(misfits[rows[early]]))) / varied)
    return min(shares, default=0.0)


def jacobian(
    model: Model, values: Vector, which: Iterable[int], *, one_sided: bool = False
) -> Matrix:
    """Derivatives (m, k) of the prediction by the parameters at some positions, by central
    differences.

    ``one_sided`` ones take half as long, and err by a part of about the step, 1e-7: good enough for
    a search.
    """
    columns = []
    base = model.predicted(named_of(model, values)) if one_sided else None
    for index in which:
        ends = np.stack([values, values])
        ends[:, index] += np.array([1.0, 0.0 if one_sided else -1.0]) * model.parameters[index].step
        above = model.predicted(named_of(model, ends[0]))
        below = model.predicted(named_of(model, ends[1])) if base is None else base
        columns.append((above - below) / (ends[0, index] - ends[1, index]))
    return np.column_stack(columns)


def units_of(model: Model) -> Vector:
    """Sizes in which the parameters are searched: their priors, or what is usual."""
    of_unit = {
        "rad/s": 1e-2 * model.spacecraft.fastest,
        "1/s": 0.1 / max(model.record.length, 1e-9),
    }
    sizes = (
        each.prior if math.isfinite(each.prior) else of_unit.get(each.kind.unit, 1e-2)
        for each in model.parameters
    )
    return np.array(list(sizes))


def search(
    model: Model,
    values: Vector,
    noise: Vector,
    rows: NDArray[np.bool_],
    *,
    robust: bool,
    near: bool = True,
) -> tuple[Vector, float]:
    """Values of the least cost over some of the samples, or reached with the budget of work, and
    that cost.
    """
    units = units_of(model)
    weights = 1.0 / noise[model.signal[rows]]
    bound = model.prior[0] * units
    nominal = model.prior[1]

    best = math.inf
    place = values / units

    def errors(scaled: Vector) -> Vector:
        nonlocal best, place
        try:
            misfits = residuals(model, scaled * units)[rows] * weights
        except Infeasible:  # a trial too far to be flown: the search comes nearer
            return np.full(int(rows.sum()) + len(nominal), math.inf)
        every = np.concatenate([misfits, bound @ scaled - nominal])
        cost = float(np.sum(np.sqrt(1.0 + every * every) - 1.0 if robust else 0.5 * every * every))
        if cost < best:
            best = cost
            place = scaled.copy()
        return every

    def derivatives(scaled: Vector) -> Matrix:
        if work.exhausted():
            raise _SpentError
        slopes = jacobian(model, scaled * units, range(len(units)), one_sided=True)[rows] * units
        return np.concatenate([-slopes * weights[:, None], bound])

    # Not so far from the minimum, where steps as long as the derivatives allow lead astray.
    scale: Literal["jac"] | float = "jac" if near else 1.0
    loss: Literal["soft_l1", "linear"] = "soft_l1" if robust else "linear"
    trials = EVALUATIONS if near else TRIAL
    if np.isfinite(errors(place)).all():
        with suppress(_SpentError):
            least_squares(
                errors,
                place,
                derivatives,
                loss=loss,
                x_scale=scale,
                ftol=STEP,
                xtol=STEP,
                gtol=GRADIENT,
                max_nfev=trials,
            )
    return place * units, best


class _SpentError(Exception):
    """The budget of work is spent: the search ends with the best values so far."""


def covariance_of(model: Model, scaled: Matrix) -> Matrix:
    """P of the derivatives over the noise; what neither data nor priors tell is infinite, here very
    large.
    """
    units = units_of(model)
    stacked = np.concatenate([scaled, model.prior[0]]) * units
    _, sizes, turned = np.linalg.svd(stacked, full_matrices=False)
    inverse = turned.T / np.maximum(sizes, 1e-13 * sizes[0])
    covariance = inverse @ inverse.T
    return np.asarray(covariance * np.outer(units, units))


# By which the square of a shift across a curved region counts: (t², s t²) is then in the ellipsoid
# in 95 % of cases, for 2 to 10 parameters, whether s is small or large.
CURVED = 7.0

GROWS = 3.0  # standard deviations of κ from which on it shows
KEPT = 0.9  # share of its prior above which a parameter's sigma is where the data do not tell it
MOVED = 0.1  # share of its prior from which on a parameter has moved from the file
WHITE = 1e-3  # chance below which residuals are not white: one of a thousand records of noise


def unmoved(change: float, sigma: float, prior: float) -> bool:
    """True where the data do not tell a value, and do not move it."""
    return sigma > KEPT * prior and abs(change) <= MOVED * prior


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
    steady: bool = False  # a spin without nutation
    constant: tuple[str, ...] = ()  # signals of one that do not change at all
    coarse: tuple[str, ...] = ()  # signals with steps that are large beside their noise
    causes: tuple[
        str, ...
    ] = ()  # what would bring an estimate that is far from the file back to it

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
        return next(
            (at for at, parameter in enumerate(self.model.parameters) if parameter.name == name),
            None,
        )

    @property
    def grows(self) -> bool:
        """True where κ is estimated and shows:
        then a body of three moments is taken to dissipate.
        """
        at = self.index("growth")
        return at is not None and bool(abs(self.values[at]) > GROWS * self.sigmas[at])

    @cached_property
    def region(self) -> Matrix:
        """The covariance (p, p) whose ellipsoids hold the true values as often as they say, though
        regions are curved.

        A direction of the covariance, followed for one sigma both ways, leaves residuals that do
        not cancel: least squares by J turns them into the shift s across it that the curve takes
        there. It is off by s t² at t sigmas: of P + `CURVED` Σ s sᵀ the 95 % ellipsoid holds 95 %
        of a normal t, for any length of s.
        """
        scale = np.where(self.sigmas > 0.0, self.sigmas, 1.0)
        sizes, turned = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        noise = self.noise[self.model.signal[self.used]]
        slopes = self.jacobian[self.used] / noise[:, None]
        centre = self.model.predicted(self.named)
        shifts = []
        for direction in (scale[:, None] * turned * np.sqrt(np.maximum(sizes, 0.0))).T:
            both_ways = (self.values + direction, self.values - direction)
            try:
                with np.errstate(all="ignore"):
                    ends = [
                        self.model.predicted(named_of(self.model, values)) for values in both_ways
                    ]
            except Infeasible:  # of what nothing is known one sigma may be no body at all
                continue
            bent = (0.5 * (ends[0] + ends[1]) - centre)[self.used] / noise
            shifts.append(self.covariance @ (slopes.T @ bent))
        across = np.array([shift for shift in shifts if np.isfinite(shift).all()]).reshape(
            -1, len(scale)
        )
        return np.asarray(self.covariance + CURVED * across.T @ across)

    @cached_property
    def kept(self) -> tuple[str, ...]:
        """Parameters that the data do not tell, and that stay as the file has them."""
        rows = zip(self.model.parameters, self.values, self.sigmas, strict=True)
        return tuple(
            each.name
            for each, value, sigma in rows
            if unmoved(value - each.file, sigma, each.prior)
        )

    @cached_property
    def resolved(self) -> NDArray[np.bool_]:
        """Of each signal, whether its noise is more than its digits or its steps make anyway."""
        return np.asarray(self.noise > noise_floor(self.model) * (1.0 + 1e-9))

    def whiteness(self, signal: int, lags: int = 40) -> Vector:
        """Autocorrelations of the residuals of a signal, from lag 1 on; of white ones 95 % are
        below 1.96/√n.
        """
        rows = self.used & (self.model.signal == signal)
        deviations = self.residuals[rows] - self.residuals[rows].mean()
        total = float(deviations @ deviations) or 1.0
        return np.array(
            [
                float(deviations[lag:] @ deviations[:-lag]) / total
                for lag in range(1, min(lags, len(deviations) - 1) + 1)
            ]
        )

    def white(self, signal: int) -> bool:
        """True where the autocorrelations are as small as those of white noise (Ljung-Box)."""
        count = int((self.used & (self.model.signal == signal)).sum())
        correlations = self.whiteness(signal, 20)
        lags = np.arange(1, len(correlations) + 1)
        statistic = count * (count + 2) * np.sum(correlations**2 / (count - lags))
        return bool(chdtrc(len(lags), statistic) > WHITE)
