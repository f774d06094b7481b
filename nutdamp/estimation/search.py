"""Least squares of a record by the parameters of a model: residuals, derivatives, the search, the noise.

With noise of one sigma s on each sample, residuals r = measured - predicted, and the tolerances of the file as priors,

    minimise  Σ (r/s)² + Σ ((x - x_file)/prior)²,      P = (Jᵀ S⁻² J + prior⁻²)⁻¹,

J the derivatives of the prediction at the minimum: P is then the Cramér-Rao bound, which least squares attains for
normal noise as far as the motion is linear over the errors.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.estimation.model import Matrix, Model, Vector
from nutdamp.estimation.parameters import SUN_PULSE, quantisation

NORMAL_MAD = 1.4826
"""Standard deviation of normal numbers over their median magnitude."""

ROUNDING = 1e-7
"""Noise that a signal has at least, as a share of its largest value: no telemetry has more digits."""

EVALUATIONS, TRIAL = 60, 40
"""Jacobians of one least-squares search, at most: of the last ones, and of one from a start, which may lead nowhere."""


def least(model: Model) -> Vector:
    """Noise that each signal has at least: that of its steps, and rounding."""
    sigmas = []
    for index, name in enumerate(model.signals):
        values = model.measured[model.signal == index]
        step = model.record.sun_step if name == SUN_PULSE else 0.0 if name == "axis" else quantisation(values)
        size = {"axis": 1.0, SUN_PULSE: 1.0 / abs(model.spacecraft.spin)}.get(name, float(np.abs(values).max()))
        sigmas.append(max(step / math.sqrt(12.0), ROUNDING * size))
    return np.array(sigmas)


def robust(model: Model, left: Vector) -> Vector:
    """One sigma of each signal by its median magnitude, which outliers hardly change."""
    return np.array(
        [NORMAL_MAD * float(np.median(np.abs(left[model.signal == index]))) for index in range(len(model.signals))]
    )


def plain(model: Model, left: Vector, used: NDArray[np.bool_], leverage: Vector | None = None) -> Vector:
    """One sigma of each signal by its samples that are no outliers; ``leverage`` is what the fit takes of each.

    Of n samples with leverages that add up to p the mean of the variance is Σr²/(n - p - 2): that of its posterior,
    so that regions made with it hold as often as they should.
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
        scales.append(0.1 * spread or {"axis": 1e-3, SUN_PULSE: 0.01 / abs(model.spacecraft.spin)}.get(name, 1e-4))
    return np.array(scales)


def share_left(model: Model, values: Vector) -> float:
    """Least share of a signal's own variation that the residuals still have."""
    left = residuals(model, values)
    shares = []
    for index, name in enumerate(model.signals):
        rows = model.signal == index
        shown = model.measured[rows, None] if name != "axis" else model.axes
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
    spin = abs(model.spacecraft.spin)
    usual = {"rad/s": 1e-2 * spin, "1/s": 0.1 / max(model.record.length, 1e-9)}
    return np.array(
        [
            parameter.prior if math.isfinite(parameter.prior) else usual.get(parameter.unit, 1e-2)
            for parameter in model.parameters
        ]
    )


def search(
    model: Model, values: Vector, noise: Vector, rows: NDArray[np.bool_], *, robust: bool, near: bool = True
) -> tuple[Vector, float]:
    """Values of the least cost over some of the samples, and that cost; ``noise`` of each signal.

    Those reached so far where the budget of work is spent.
    """
    from scipy.optimize import least_squares

    units, weights = units_of(model), 1.0 / noise[model.signal[rows]]
    bound, nominal = model.prior[0] * units, model.prior[1]

    def errors(scaled: Vector) -> Vector:
        try:
            left = residuals(model, scaled * units)[rows] * weights
        except Infeasible:  # a trial too far to be flown: the search comes nearer
            return np.full(int(rows.sum()) + len(nominal), math.inf)
        return np.concatenate([left, bound @ scaled - nominal])

    reached = values / units

    def derivatives(scaled: Vector) -> Matrix:
        nonlocal reached
        reached = scaled.copy()
        if work.exhausted():
            raise _SpentError
        slopes = jacobian(model, scaled * units, range(len(units)), one_sided=True)[rows] * units
        return np.concatenate([-slopes * weights[:, None], bound])

    # Steps as long as the derivatives allow lead astray far from the minimum.
    loss: Literal["soft_l1", "linear"] = "soft_l1" if robust else "linear"
    try:
        least_cost = least_squares(
            errors,
            values / units,
            derivatives,
            loss=loss,
            max_nfev=EVALUATIONS if near else TRIAL,
            x_scale="jac" if near else 1.0,
            xtol=1e-10,
            ftol=1e-10,
        )
    except _SpentError:
        squares = errors(reached) ** 2
        return reached * units, float(np.sum(np.sqrt(1.0 + squares) - 1.0 if robust else 0.5 * squares))
    return least_cost.x * units, float(least_cost.cost)


class _SpentError(Exception):
    """The budget of work is spent amid a search."""


def covariance_of(model: Model, scaled: Matrix) -> Matrix:
    """P of the derivatives over the noise; what neither data nor priors tell is infinite, here very large."""
    units = units_of(model)
    stacked = np.concatenate([scaled, model.prior[0]]) * units
    _, sizes, turned = np.linalg.svd(stacked, full_matrices=False)
    inverse = turned.T / np.maximum(sizes, 1e-13 * sizes[0])
    covariance = inverse @ inverse.T
    return np.asarray(covariance * np.outer(units, units))
