"""Robust least squares, noise estimation, residual tests.

Estimates of a spacecraft from telemetry: robust least squares, and what their covariance means.

With noise of one sigma s on each sample, residuals r = measured - predicted, and the tolerances of the file as priors,

    minimise  Σ (r/s)² + Σ ((x - x_file)/prior)²,      P = (Jᵀ S⁻² J + prior⁻²)⁻¹,

J the derivatives of the prediction at the minimum: P is then the Cramér-Rao bound, which least squares attains for
normal noise as far as the motion is linear over the errors. Outliers are found under a loss that grows linearly beyond
a few sigma (scipy's soft_l1) and left out of the last fits, so that they cost no efficiency. Noise is estimated.

Whether a fit explains its record: what it leaves must be the noise that neighbouring samples show.

Second differences of the residuals, r[k-1] - 2 r[k] + r[k+1], have the standard deviation √6 s of noise s, and next to
nothing of what changes slowly. Residuals far larger than that s are no noise but motion that the model does not have,
such as a pulse: their sigmas would mean nothing.

The noise of each signal, from what a fit leaves of its samples.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtrc

from nutdamp.errors import Infeasible
from nutdamp.estimation import initial_guess
from nutdamp.estimation.initial_guess import once_a_turn, starts
from nutdamp.estimation.model import Matrix, Model, Vector
from nutdamp.estimation.parameters import ACCELERATION, GYROS, SUN_PULSE, Record, quantisation
from nutdamp.physics import body as rigid_body
from nutdamp.spacecraft.model import Spacecraft

NORMAL_MAD = 1.4826
"""Standard deviation of normal numbers over their median magnitude."""

ROUNDING = 1e-7
"""Noise that a signal has at least, as a share of its largest value: no telemetry has more digits."""


def least(model: Model) -> Vector:
    """Noise that each signal has at least: that of its steps, and rounding."""
    found = []
    for index, name in enumerate(model.signals):
        values = model.measured[model.signal == index]
        step = model.record.sun_step if name == SUN_PULSE else 0.0 if name == "axis" else quantisation(values)
        size = {"axis": 1.0, SUN_PULSE: 1.0 / abs(model.spacecraft.spin)}.get(name, float(np.abs(values).max()))
        found.append(max(step / math.sqrt(12.0), ROUNDING * size))
    return np.array(found)


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
    found, signal = [], model.signal[used]
    for index in range(len(model.signals)):
        rows = signal == index
        spent = 0.0 if leverage is None else float(leverage[rows].sum()) + 2.0
        total = float(left[used][rows] @ left[used][rows])
        found.append(math.sqrt(total / max(float(rows.sum()) - spent, 1.0)))
    return np.array(found)


FAR = 2.0
"""Times the noise of neighbouring samples from which on residuals are no noise."""

PART = 1e-3
"""Part of what varies in a signal that such residuals have at least: records without noise show smaller ones."""

WINDOWS = (4, 8, 16, 32, 64)
"""Samples in a row among which those left out are counted."""

CHANCE = 1e-6
"""Probability by which they may be scattered so unevenly."""

FEWEST_JUDGED = 20
"""Samples of a signal that are judged at least."""

SPLITS, SAMPLES = 120, 2000
"""Times at which a step is looked for, and samples of a signal used for that, at most."""

STEP = 0.7
"""Part of the residuals that is left beside a step, at most, for it to count as found where they are no noise."""

SHOWN = 50.0
"""Decrease of the sum of squares, in units of the noise, by which a step shows in residuals that are nearly noise."""


def expect_explained(found: Fit) -> None:
    """Raises Infeasible where a fit leaves more than noise, with the time of a step in the motion if there is one.

    So it does where samples are left out that follow each other: outliers come one by one, motion does not.
    """
    model = found.model
    burst = left_out_together(found)
    if burst is not None:
        signal, begins, ends, count = burst
        raise Infeasible(
            f"from {begins:.4g} s to {ends:.4g} s the motion fitted does not explain {signal}: {count} samples would "
            f"have to be left out, which is motion and no outlier; {_cure(found)}"
        )
    left = [index for index in range(len(model.signals)) if _more_than_noise(found, index)]
    if not left:
        return
    signals = ", ".join(model.signals[index] for index in left)
    more = max(found.noise[index] / _noise(found, index) for index in left)
    says = f"the motion fitted does not explain {signals}: residuals are {more:.2g} times the noise between samples"
    time = step(found, left)
    where = "" if time is None else f", with a step at about {time:.4g} s"
    raise Infeasible(f"{says}{where}; {_cure(found)}")


def _cure(found: Fit) -> str:
    fired = found.model.record.fired
    what = "check the channels and times of the schedule" if fired else "give the pulses fired in it with --schedule"
    return f"{what}; a record of the coast before or after needs none"


def left_out_together(found: Fit) -> tuple[str, float, float, int] | None:
    """Signal, first and last time (s), and number of samples that were left out though they follow each other.

    None where those left out lie as scattered as chance has it: of any `WINDOWS` samples in a row no more than by the
    share left out elsewhere (binomial tail, `CHANCE` for all windows).
    """
    model, least, burst = found.model, CHANCE, None
    for index, signal in enumerate(model.signals):
        rows = np.flatnonzero(model.signal == index)
        rows = rows[np.argsort(model.times[rows], kind="stable")]
        out = ~found.used[rows]
        sums = np.concatenate([[0], np.cumsum(out)])
        for width in (one for one in WINDOWS if one < len(rows)):
            counts = sums[width:] - sums[:-width]
            elsewhere = np.maximum(sums[-1] - counts, 1.0) / (len(rows) - width)
            chances = len(rows) * bdtrc(counts - 1, width, np.minimum(elsewhere, 1.0))
            at = int(np.argmin(np.where(counts > 0, chances, np.inf)))
            if counts[at] > 0 and chances[at] < least:
                least = float(chances[at])
                those = model.times[rows][at : at + width][out[at : at + width]]
                burst = signal, float(those[0]), float(those[-1]), int(counts[at])
    return burst


def _rows(found: Fit, signal: int) -> Vector:
    return np.asarray(found.residuals[found.model.signal == signal])


def _noise(found: Fit, signal: int) -> float:
    """Noise of a signal by its second differences; at least that of its steps."""
    second = np.diff(_rows(found, signal), 2)
    noise = NORMAL_MAD * float(np.median(np.abs(second))) / math.sqrt(6.0)
    return max(noise, float(least(found.model)[signal]))


def _more_than_noise(found: Fit, signal: int) -> bool:
    model = found.model
    values = model.measured[model.signal == signal]
    if (
        model.signals[signal] == SUN_PULSE
        or len(values) < FEWEST_JUDGED
        or found.noise[signal] < FAR * _noise(found, signal)
    ):
        return False
    varied = NORMAL_MAD * float(np.median(np.abs(values - np.median(values))))
    return bool(found.noise[signal] > PART * varied) and not found.white(signal)


def step(found: Fit, signals: Sequence[int], *, small: bool = False) -> float | None:
    """When the nutation steps, s: where a jump of its sine and cosine leaves the least of the residuals.

    None where no step shows; ``small``: one that may hide in noise.
    """
    model = found.model
    chosen = [index for index in signals if model.signals[index] in (*GYROS, ACCELERATION)]
    rate = initial_guess.nutation_rate(model, found.values)
    splits = np.linspace(model.record.start, model.record.end, SPLITS + 2)[1:-1]
    total, left = 0.0, np.zeros(len(splits))
    for index in chosen:
        rows = np.flatnonzero((model.signal == index) & (found.used | (not small)))
        rows = rows[:: -(-len(rows) // SAMPLES)]
        times, values = model.times[rows], found.residuals[rows] / found.noise[index]
        turn = rate * (times - model.record.start)
        wave = np.column_stack([np.cos(turn), np.sin(turn), np.ones(len(rows))])
        # Waves that grow linearly stand for what a rate that is off does, with or without a step.
        smooth = np.column_stack([wave, wave * (times - times.mean())[:, None] / model.record.length])
        total += _remains(smooth, values)
        left += [_remains(np.column_stack([smooth, wave * (times > split)[:, None]]), values) for split in splits]
    best = int(np.argmin(left))
    shows = total - left[best] > SHOWN if small else left[best] < STEP**2 * total
    return float(splits[best]) if chosen and shows else None


def _remains(columns: Vector, values: Vector) -> float:
    """Sum of squares that least squares leaves."""
    solved = np.linalg.lstsq(columns, values, rcond=1e-10)[0]
    return float(np.sum((values - columns @ solved) ** 2))


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
        return np.asarray(self.noise > least(self.model) * (1.0 + 1e-9))

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
    found = initial_guess.likeliest(
        [found, *(_settled(model, one) for one in initial_guess.neighbours(model, found.values))]
    )
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
    period = rigid_body.body_period(body.inertia.A, body.inertia.C, body.spin)
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
        spread = NORMAL_MAD * float(np.median(np.abs(values - np.median(values))))
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
    floor = least(model)
    noise = np.maximum(robust(model, _residuals(model, values)), floor)
    every = np.ones(len(model.measured), dtype=bool)
    values, _ = _search(model, values, noise, every, robust=True)
    used = every
    for _ in range(ROUNDS):
        before, left = (noise, used), _residuals(model, values)
        noise = np.maximum(robust(model, left), floor)
        used = np.abs(left) < OUTLIER * noise[model.signal]
        noise = np.maximum(plain(model, left, used), floor)
        if (used == before[1]).all() and (np.abs(noise - before[0]) < STILL * noise).all():
            break
        values, _ = _search(model, values, noise, used, robust=False)
    left, slopes = _residuals(model, values), _jacobian(model, values, range(len(values)))
    for _ in range(ADJUSTED):
        scaled = slopes[used] / noise[model.signal[used], None]
        covariance = _covariance(model, scaled)
        noise = np.maximum(plain(model, left, used, np.sum((scaled @ covariance) * scaled, axis=1)), floor)
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
