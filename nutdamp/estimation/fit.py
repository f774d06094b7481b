"""Estimates of a spacecraft from telemetry: robust least squares, and what their covariance means.

With noise of one sigma s on each sample, residuals r = measured - predicted, and the tolerances of the file as priors,

    minimise  Σ (r/s)² + Σ ((x - x_file)/prior)²,      P = (Jᵀ S⁻² J + prior⁻²)⁻¹,

J the derivatives of the prediction at the minimum: P is then the Cramér-Rao bound, which least squares attains for
normal noise as far as the motion is linear over the errors. Outliers are found under a loss that grows linearly beyond
a few sigma (scipy's soft_l1) and left out of the last fits, so that they cost no efficiency. Noise is estimated.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible
from nutdamp.estimation import aliases, noises
from nutdamp.estimation.guess import once_a_turn, starts
from nutdamp.estimation.model import Matrix, Model, Vector
from nutdamp.estimation.record import ACCELERATION, GYROS, SUN_PULSE, Record
from nutdamp.estimation.unexplained import expect_explained
from nutdamp.physics import cones
from nutdamp.spacecraft import Spacecraft

OUTLIER = 5.0
"""Standard deviations beyond which a sample is left out: of 60,000 normal ones not one, on average 0.03."""

EVALUATIONS = 60
"""Jacobians of one least-squares search, at most."""

ROUNDS = 8
"""Fits in which noise and outliers are found anew, at most."""

ADJUSTED = 3
"""Rounds in which the noise is corrected for what the fit takes of it."""

STILL = 1e-3
"""Relative change of the noise from which on it is found anew."""

POOR = 0.3
"""Share of a signal's own size that residuals may have before a fit begins again with a part of the record."""

STARTS = 3
"""Starts that are searched from at most."""

PARTS = (0.5, 0.25, 0.1, 0.04)
"""Parts of the record that it then begins with."""

SEEN = 4.5
"""Standard deviations of |ω| from which on there is a nutation."""

UNEQUAL = 5.0
"""Standard deviations from which on the transverse moments count as different, or such a body as dissipating."""

GROWS = 3.0
"""Standard deviations of κ from which on a body that turns out to have three moments is taken to dissipate."""

KEPT = 0.9
"""Share of its prior above which a parameter's sigma is where the data do not tell it."""

SHOW_NUTATION = {*GYROS[:2], "axis", ACCELERATION}
"""Signals one of which there must be."""


@dataclass(frozen=True, eq=False)
class Fit:
    """What a record says of a spacecraft.

    ``values`` (p,) of the model's parameters, SI, with their ``covariance`` (p, p); ``noise`` one sigma of each signal
    (rad of the axis, s of Sun pulses); ``used`` (m,) the samples that are no outliers, ``residuals`` (m,) measured
    less predicted.
    """

    model: Model
    values: Vector
    covariance: Matrix
    noise: Vector
    used: NDArray[np.bool_]
    residuals: Vector
    jacobian: Matrix

    @property
    def named(self) -> dict[str, float]:
        """The values by name."""
        return _named(self.model, self.values)

    @property
    def sigmas(self) -> Vector:
        """Standard deviations of the values, (p,)."""
        return np.sqrt(np.diag(self.covariance))

    def index(self, name: str) -> int | None:
        """Position of a parameter; None where it is not estimated."""
        return next((at for at, one in enumerate(self.model.parameters) if one.name == name), None)

    @cached_property
    def kept(self) -> tuple[str, ...]:
        """Parameters that the data do not tell: they stay as the file has them."""
        pairs = zip(self.model.parameters, self.sigmas, strict=True)
        return tuple(one.name for one, sigma in pairs if sigma > KEPT * one.prior)

    @cached_property
    def information(self) -> Vector:
        """Singular values of the data against the priors, falling; below 1 the priors say more.

        They are those of J/s in units of the priors, for the parameters that have one, the others being fitted.
        """
        priors = np.array([one.prior for one in self.model.parameters])
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
        return np.asarray(self.noise > noises.least(self.model) * (1.0 + 1e-9))

    def whiteness(self, signal: int, lags: int = 40) -> Vector:
        """Autocorrelations of the residuals of a signal, from lag 1 on; of white ones 95 % are below 1.96/√n."""
        rows = self.used & (self.model.signal == signal)
        left = self.residuals[rows] - self.residuals[rows].mean()
        total = float(left @ left) or 1.0
        return np.array([float(left[lag:] @ left[:-lag]) / total for lag in range(1, min(lags, len(left) - 1) + 1)])

    def white(self, signal: int) -> bool:
        """Whether the autocorrelations are as small as those of white noise (Ljung-Box, 1 in 1000)."""
        from scipy.special import chdtri

        count = int((self.used & (self.model.signal == signal)).sum())
        found = self.whiteness(signal, 20)
        lags = np.arange(1, len(found) + 1)
        return bool(count * (count + 2) * np.sum(found**2 / (count - lags)) < chdtri(len(found), 0.001))


def fit(spacecraft: Spacecraft, record: Record) -> Fit:
    """Estimate what a record tells of a spacecraft.

    Raises Infeasible where that is nothing, saying what would help; BadRequest where the file does not describe what
    a signal of the record needs.
    """
    found = _fitted(spacecraft, record)
    expect_explained(found)
    return found


def _fitted(spacecraft: Spacecraft, record: Record) -> Fit:
    # Three moments and dissipation together take an integration: only where both are seen.
    model = Model(spacecraft, record, growing=spacecraft.inertia.symmetric)
    _expect_enough(model)
    _expect_alive(model)
    found = _settled(model, _best(model))
    _expect_seen(found)
    found = aliases.likeliest([found, *(_settled(model, one) for one in aliases.neighbours(model, found.values))])
    if record.fired:
        return found
    if model.unequal:
        return _wider(found, Model(spacecraft, record), ("growth",))
    at = found.index("growth")
    growing = at is not None and abs(found.values[at]) > GROWS * found.sigmas[at]
    return _wider(found, Model(spacecraft, record, unequal=True, growing=growing), ("unequal_1", "unequal_2"))


def _wider(found: Fit, wider: Model, more: tuple[str, ...]) -> Fit:
    """The fit of a model with ``more`` parameters, where the residuals show them; else the one there is."""
    begin = {one.name: one.file for one in wider.parameters} | _named(found.model, found.values)
    at = np.array([begin[one.name] for one in wider.parameters])
    which = [index for index, one in enumerate(wider.parameters) if one.name in more]
    if len(which) < len(more) or not _shown(found, wider, at, which):
        return found
    at[which] = [max(abs(one), 1e-3 * _units(wider)[index]) for index, one in zip(which, at[which], strict=True)]
    return _settled(wider, at)


def _named(model: Model, values: Iterable[float]) -> dict[str, float]:
    return {one.name: float(value) for one, value in zip(model.parameters, values, strict=True)}


STUCK, FEWEST, COARSE = 0.2, 20, 10
"""Part of the samples of a rate gyro, and number of them, that are alike in a row where it is stuck; a record that has
so few different values is one of coarse steps."""


def _expect_alive(model: Model) -> None:
    """Raises Infeasible for a transverse gyro that does not change while another signal shows the nutation."""
    varying = [index for index, one in enumerate(model.signals) if one in SHOW_NUTATION and _run(model, index)[3] > 1]
    for index, signal in enumerate(model.signals):
        begins, ends, alike, different = _run(model, index)
        count = int((model.signal == index).sum())
        if signal not in GYROS[:2] or alike < max(FEWEST, STUCK * count) or not set(varying) - {index}:
            continue
        if different == 1 or different > COARSE:
            raise Infeasible(
                f"{signal} does not change from {begins:.4g} s to {ends:.4g} s ({alike} samples) while others show a "
                "nutation: the sensor is dead or stuck; leave its column out, or end the record before"
            )


def _run(model: Model, index: int) -> tuple[float, float, int, int]:
    """First and last time (s) and number of the most samples of a signal in a row that are alike; how many differ."""
    rows = np.flatnonzero(model.signal == index)
    values, times = model.measured[rows], model.times[rows]
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0.0) + 1, [len(values)]])
    at = int(np.argmax(np.diff(edges)))
    first, last = edges[at], edges[at + 1] - 1
    return float(times[first]), float(times[last]), int(last - first + 1), len(np.unique(values))


def _expect_enough(model: Model) -> None:
    """Raises Infeasible for a record that cannot tell as much as is estimated."""
    if not SHOW_NUTATION & set(model.signals):
        raise Infeasible(
            f"no nutation is seen in {' and '.join(model.signals)} alone{once_a_turn(model.record)}; omega_1 or "
            "omega_2, the axis or an acceleration beside them would show it"
        )
    rows, free = len(np.unique(model.times)), sum(math.isinf(one.prior) for one in model.parameters)
    if len(model.measured) <= free + 2:
        raise Infeasible(
            f"{rows} row{'s' * (rows != 1)} of samples, with {len(model.measured)} values in all, cannot tell {free} "
            "unknowns; a longer record, or more samples, helps"
        )
    body, length = model.spacecraft, model.record.length
    period = cones.body_period(body.inertia.A, body.inertia.C, body.spin)
    if set(model.signals) == {"axis"}:
        period = body.inertial_period
    if length < 0.5 * period:
        raise Infeasible(
            f"the record is too short: {length:.3g} s are {length / period:.2g} of a nutation period ({period:.3g} s); "
            f"at least one period, {period:.3g} s, is needed"
        )


def _expect_seen(found: Fit) -> None:
    """Raises Infeasible where there is no nutation in the record."""
    at = [found.index("omega_1"), found.index("omega_2")]
    omega = np.array([found.values[one] for one in at if one is not None])
    across = found.covariance[np.ix_(at, at)]  # type: ignore[arg-type]
    # Its size counts: where the phase is hardly known, the rate across it is not either.
    size = float(np.linalg.norm(omega))
    sigma = size / math.sqrt(float(omega @ np.linalg.pinv(across, hermitian=True) @ omega))
    if size < SEEN * sigma:
        least = math.degrees(SEEN * sigma)
        raise Infeasible(
            f"no nutation is seen: the transverse rate of {math.degrees(size):.3g} deg/s is below {least:.3g} deg/s, "
            "which the noise allows for; a longer record, less noise or a larger nutation (a probe pulse) helps"
        )


def _best(model: Model) -> Vector:
    """Values of the least robust cost, from the starts that the record gives."""
    best, cost = _try(model, list(starts(model)))
    if _size(model, best) > POOR:
        for share in PARTS:
            values, other = _try(model, list(starts(model, share)))
            values, other = (values, other) if share == PARTS[0] else _grown(model, share, values)
            if other < cost:
                best, cost = values, other
            if _size(model, best) < POOR:
                break
    return best


def _grown(model: Model, share: float, values: Vector) -> tuple[Vector, float]:
    """The fit of the first ``share`` of the record, then of twice as much, to the whole."""
    begin, length = model.start, model.record.length
    cost = math.inf
    while True:
        rows = model.times <= begin + share * length
        values, cost = _search(model, values, _scales(model), rows, robust=True, near=False)
        if share >= 1.0:
            return values, cost
        share = min(2.0 * share, 1.0)


def _try(model: Model, begins: Sequence[dict[str, float]]) -> tuple[Vector, float]:
    """Values from the start of least cost; where these are poor, the best from the three starts of least cost."""
    scales, every = _scales(model), np.ones(len(model.measured), dtype=bool)
    vectors = [np.array([one[each.name] for each in model.parameters]) for one in begins]
    if len(vectors) > 1:
        costs = [float(np.abs(_residuals(model, one) / scales[model.signal]).sum()) for one in vectors]
        vectors = [vectors[index] for index in np.argsort(costs)[:STARTS]]
    found = []
    for one in vectors:
        found.append(_search(model, one, scales, every, robust=True, near=False))
        if _size(model, found[-1][0]) < POOR:
            break
    return min(found, key=lambda one: one[1])


def _residuals(model: Model, values: Vector) -> Vector:
    return model.measured - model.predicted(_named(model, values))


def _scales(model: Model) -> Vector:
    """What a residual of each signal is compared with before its noise is known: a tenth of what varies in it."""
    found = []
    for index, name in enumerate(model.signals):
        values = model.measured[model.signal == index]
        spread = noises.NORMAL_MAD * float(np.median(np.abs(values - np.median(values))))
        found.append(0.1 * spread or {"axis": 1e-3, SUN_PULSE: 0.01 / abs(model.spacecraft.spin)}.get(name, 1e-4))
    return np.array(found)


def _size(model: Model, values: Vector) -> float:
    """Largest share of a signal's own variation that the residuals still have."""
    left = _residuals(model, values)
    shares = []
    for index in range(len(model.signals)):
        rows = model.signal == index
        varied = float(np.median(np.abs(model.measured[rows] - np.median(model.measured[rows]))))
        if varied > 0.0:
            shares.append(float(np.median(np.abs(left[rows]))) / varied)
    return min(shares, default=0.0)


def _jacobian(model: Model, values: Vector, which: Iterable[int]) -> Matrix:
    """Derivatives (m, k) of the prediction by the parameters at some positions, by central differences."""
    columns = []
    for index in which:
        ends = np.stack([values, values])
        ends[:, index] += np.array([1.0, -1.0]) * model.parameters[index].step
        above, below = (model.predicted(_named(model, one)) for one in ends)
        columns.append((above - below) / (ends[0, index] - ends[1, index]))
    return np.column_stack(columns)


def _units(model: Model) -> Vector:
    """Sizes in which the parameters are searched: their priors, or what is usual."""
    spin = abs(model.spacecraft.spin)
    usual = {"rad/s": 1e-2 * spin, "1/s": 0.1 / max(model.record.length, 1e-9)}
    return np.array([one.prior if math.isfinite(one.prior) else usual.get(one.unit, 1e-2) for one in model.parameters])


def _search(
    model: Model, values: Vector, noise: Vector, rows: NDArray[np.bool_], *, robust: bool, near: bool = True
) -> tuple[Vector, float]:
    """Values of the least cost over some of the samples, and that cost; ``noise`` of each signal."""
    from scipy.optimize import least_squares

    units, weights = _units(model), 1.0 / noise[model.signal[rows]]
    bound, nominal = model.prior[0] * units, model.prior[1]

    def errors(scaled: Vector) -> Vector:
        try:
            left = _residuals(model, scaled * units)[rows] * weights
        except Infeasible:  # a trial too far to be flown: the search comes nearer
            return np.full(int(rows.sum()) + len(nominal), math.inf)
        return np.concatenate([left, bound @ scaled - nominal])

    def derivatives(scaled: Vector) -> Matrix:
        slopes = _jacobian(model, scaled * units, range(len(units)))[rows] * units
        return np.concatenate([-slopes * weights[:, None], bound])

    # Steps as long as the derivatives allow lead astray far from the minimum.
    loss: Literal["soft_l1", "linear"] = "soft_l1" if robust else "linear"
    found = least_squares(
        errors,
        values / units,
        derivatives,
        loss=loss,
        max_nfev=EVALUATIONS,
        x_scale="jac" if near else 1.0,
        xtol=1e-10,
        ftol=1e-10,
    )
    return found.x * units, float(found.cost)


def _settled(model: Model, values: Vector) -> Fit:
    """The last fits: noise and outliers found, then plain least squares over what is no outlier."""
    floor = noises.least(model)
    noise = np.maximum(noises.robust(model, _residuals(model, values)), floor)
    every = np.ones(len(model.measured), dtype=bool)
    values, _ = _search(model, values, noise, every, robust=True)
    used = every
    for _ in range(ROUNDS):
        before, left = (noise, used), _residuals(model, values)
        noise = np.maximum(noises.robust(model, left), floor)
        used = np.abs(left) < OUTLIER * noise[model.signal]
        noise = np.maximum(noises.plain(model, left, used), floor)
        if (used == before[1]).all() and (np.abs(noise - before[0]) < STILL * noise).all():
            break
        values, _ = _search(model, values, noise, used, robust=False)
    left, slopes = _residuals(model, values), _jacobian(model, values, range(len(values)))
    for _ in range(ADJUSTED):
        scaled = slopes[used] / noise[model.signal[used], None]
        covariance = _covariance(model, scaled)
        noise = np.maximum(noises.plain(model, left, used, np.sum((scaled @ covariance) * scaled, axis=1)), floor)
    return Fit(model, values, covariance, noise, used, left, slopes)


def estimated(model: Model, values: Vector, noise: Vector) -> Fit:
    """The fit of a record that has no samples yet: ``values`` as they are, with the covariance that they would have."""
    slopes, count = _jacobian(model, values, range(len(values))), len(model.measured)
    covariance = _covariance(model, slopes / noise[model.signal, None])
    return Fit(model, values, covariance, noise, np.ones(count, dtype=bool), np.zeros(count), slopes)


def _covariance(model: Model, scaled: Matrix) -> Matrix:
    """P of the derivatives over the noise; what neither data nor priors tell is infinite, here very large."""
    units = _units(model)
    stacked = np.concatenate([scaled, model.prior[0]]) * units
    _, sizes, turned = np.linalg.svd(stacked, full_matrices=False)
    inverse = turned.T / np.maximum(sizes, 1e-13 * sizes[0])
    covariance = inverse @ inverse.T
    return np.asarray(covariance * np.outer(units, units))


def _shown(found: Fit, wider: Model, at: Vector, which: Sequence[int]) -> bool:
    """Whether the residuals show parameters of a wider model: a score test, one step of least squares by them."""
    model, count = found.model, len(which)
    weights = 1.0 / found.noise[model.signal[found.used]]
    slopes = _jacobian(wider, at, which)[found.used] * weights[:, None] * _units(wider)[list(which)]
    units, rows = _units(model), len(model.prior[0])
    known = found.jacobian[found.used] * weights[:, None] * units
    bound = np.concatenate([model.prior[0] * units, np.zeros((rows, count))], axis=1)
    stacked = np.concatenate([np.concatenate([known, slopes], axis=1), bound])
    target = np.concatenate([found.residuals[found.used] * weights, np.zeros(rows)])
    solved = np.linalg.lstsq(stacked, target, rcond=1e-13)[0][-count:]
    covariance = np.linalg.pinv(stacked.T @ stacked, rcond=1e-14)[-count:, -count:]
    return bool(solved @ np.linalg.solve(covariance, solved) > UNEQUAL**2)
