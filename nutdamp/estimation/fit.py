"""Estimates of a spacecraft from telemetry: robust least squares, outliers left out, the model as wide as shown.

Outliers are found under a loss that grows linearly beyond a few sigma and left out of the last fits,
so that they cost no efficiency. Noise is estimated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.estimation import initial_guess
from nutdamp.estimation.consistency import expect_alive, expect_enough, expect_explained
from nutdamp.estimation.initial_guess import starts
from nutdamp.estimation.model import Model
from nutdamp.estimation.parameters import Matrix, Record, Vector
from nutdamp.estimation.search import (
    Fit,
    covariance_of,
    jacobian,
    least,
    plain,
    residuals,
    robust,
    scales_of,
    search,
    share_left,
    units_of,
)
from nutdamp.spacecraft.model import Spacecraft

OUTLIER = 5.0
"""Standard deviations beyond which a sample is left out: of 60,000 normal ones not one, on average 0.03."""

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

UNLIKELY = 4.0
"""Standard deviations of the file by which a parameter may be off before the starts are searched in shorter steps."""

PARTS = (0.5, 0.25, 0.1, 0.04)
"""Parts of the record that it then begins with."""

SEEN = 4.5
"""Standard deviations of |ω| from which on there is a nutation."""

UNEQUAL = 5.0
"""Standard deviations from which on the transverse moments count as different, or such a body as dissipating."""

GROWS = 3.0
"""Standard deviations of κ from which on a body that turns out to have three moments is taken to dissipate."""

UNEQUAL_BY = ("unequal_1", "unequal_2")
"""The parameters of unequal transverse moments."""


def fit(spacecraft: Spacecraft, record: Record) -> Fit:
    """Estimate what a record tells of a spacecraft.

    Raises Infeasible where that is nothing, saying what would help; BadRequest where the file does not describe what
    a signal of the record needs.
    """
    with work.budget("fit", work.FIT * max(1.0, len(record.times) / work.FITTED)) as spent:
        best = _fitted(spacecraft, record)
    try:
        expect_explained(best)
    except Infeasible as error:
        if not spent.exhausted:
            raise
        raise Infeasible(
            f"{error}; or the search, which ended with its budget of work, has not come to it: fewer samples may help"
        ) from None
    return replace(best, finished=not spent.exhausted)


def _fitted(spacecraft: Spacecraft, record: Record) -> Fit:
    # Three moments and dissipation together take an integration: only where both are seen.
    model = Model(spacecraft, record, growing=spacecraft.inertia.symmetric)
    expect_enough(model)
    expect_alive(model)
    fitted = _settled(model, _best(model))
    _expect_seen(fitted)
    fitted = initial_guess.likeliest(
        [fitted, *(_settled(model, values) for values in initial_guess.neighbours(model, fitted.values))]
    )
    grown = fitted.index("growth")
    growing = grown is not None and bool(abs(fitted.values[grown]) > GROWS * fitted.sigmas[grown])
    if model.unequal:
        if _shows_growth(fitted):
            return _widened(fitted, Model(spacecraft, record), ("growth",))
        return _grown_a_little(fitted)
    three = Model(spacecraft, record, unequal=True, growing=growing)
    if not _shown(fitted, three, _begun(fitted, three), _places(three, UNEQUAL_BY)):
        return fitted
    # What unequal moments do may look like growth of equal ones, which then is none.
    unequal = _widened(fitted, Model(spacecraft, record, unequal=True, growing=False), UNEQUAL_BY)
    if not growing or not _shows_growth(unequal):
        return _grown_a_little(unequal)
    begin = _begun(fitted, three)
    of_moments = _places(three, UNEQUAL_BY)
    begin[of_moments] = _begun(unequal, three)[of_moments]
    return _settled(three, begin)


def _shows_growth(narrow: Fit) -> bool:
    """True where the residuals of a fit of three moments show dissipation."""
    wider = Model(narrow.model.spacecraft, narrow.model.record, unequal=True)
    which = _places(wider, ("growth",))
    return bool(which) and _shown(narrow, wider, _begun(narrow, wider), which)


def _grown_a_little(narrow: Fit) -> Fit:
    """A fit of three moments with dissipation that does not show, by one step of least squares.

    So small a growth is linear. Left out it would be taken as exactly known: what is known together with it would then
    be off by more than its sigma.
    """
    wider = Model(narrow.model.spacecraft, narrow.model.record, unequal=True)
    which = _places(wider, ("growth",))
    if not which:
        return narrow
    at, used, units = _begun(narrow, wider), narrow.used, units_of(wider)
    slopes = np.insert(narrow.jacobian, which[0], jacobian(wider, at, which)[:, 0], axis=1)
    weights = 1.0 / narrow.noise[narrow.model.signal[used]]
    rows, nominal = wider.prior
    stacked = np.concatenate([slopes[used] * weights[:, None], rows]) * units
    target = np.concatenate([narrow.residuals[used] * weights, nominal - rows @ at])
    values = at + units * np.linalg.lstsq(stacked, target, rcond=1e-13)[0]
    return _as_noisy(wider, values, narrow.noise, used, slopes)


def _begun(narrow: Fit, wider: Model) -> Vector:
    """The values of a fit for another model, (p,): of parameters that it lacks those of the file."""
    begin = {each.name: each.file for each in wider.parameters} | narrow.named
    return np.array([begin[each.name] for each in wider.parameters])


def _places(model: Model, names: Sequence[str]) -> list[int]:
    """Positions of parameters by their names."""
    return [index for index, each in enumerate(model.parameters) if each.name in names]


def _widened(narrow: Fit, wider: Model, more: Sequence[str]) -> Fit:
    """The fit of a model with ``more`` parameters, from where a narrower one ended."""
    values, units = _begun(narrow, wider), units_of(wider)
    for index in _places(wider, more):
        # Away from nothing, where the principal axes are any.
        values[index] = max(abs(values[index]), 1e-3 * units[index])
    return _settled(wider, values)


def _expect_seen(fitted: Fit) -> None:
    """Raise Infeasible where there is no nutation in the record."""
    at = [fitted.index("omega_1"), fitted.index("omega_2")]
    omega = np.array([fitted.values[place] for place in at if place is not None])
    across = fitted.covariance[np.ix_(at, at)]  # type: ignore[arg-type]
    # Its size counts: where the phase is hardly known, the rate across it is not either.
    size = float(np.linalg.norm(omega))
    sigma = size / math.sqrt(float(omega @ np.linalg.pinv(across, hermitian=True) @ omega))
    if size < SEEN * sigma:
        expect_explained(fitted)
        least = math.degrees(SEEN * sigma)
        raise Infeasible(
            f"no nutation is seen: the transverse rate of {math.degrees(size):.3g} deg/s is below {least:.3g} deg/s, "
            "which the noise allows for; a longer record, less noise or a larger nutation (a probe pulse) helps"
        )


def _best(model: Model) -> Vector:
    """Values of the least robust cost, from the starts that the record gives."""
    best, cost = _try(model, list(starts(model)))
    if share_left(model, best) > POOR:
        for share in PARTS:
            values, other = _try(model, list(starts(model, share)))
            values, other = (values, other) if share == PARTS[0] else _grown(model, share, values)
            if other < cost:
                best, cost = values, other
            if share_left(model, best) < POOR:
                break
    return best


def _grown(model: Model, share: float, values: Vector) -> tuple[Vector, float]:
    """The fit of the first ``share`` of the record, then of twice as much, to the whole."""
    begin, length = model.start, model.record.length
    cost = math.inf
    while True:
        rows = model.times <= begin + share * length
        values, cost = search(model, values, scales_of(model), rows, robust=True, near=False)
        if share >= 1.0:
            return values, cost
        share = min(2.0 * share, 1.0)


def _try(model: Model, begins: Sequence[dict[str, float]]) -> tuple[Vector, float]:
    """Values from the start of least cost; where these are poor, the best from the three starts of least cost."""
    scales, every = scales_of(model), np.ones(len(model.measured), dtype=bool)
    vectors = [np.array([begin[each.name] for each in model.parameters]) for begin in begins]
    if len(vectors) > 1:
        costs = [float(np.abs(residuals(model, begin) / scales[model.signal]).sum()) for begin in vectors]
        vectors = [vectors[index] for index in np.argsort(costs)[:STARTS]]
    ends = []
    for begin in vectors:
        ends.append(search(model, begin, scales, every, robust=True, near=False))
        if share_left(model, ends[-1][0]) < POOR:
            break
    values, cost = min(ends, key=lambda end: end[1])
    if _unlikely(model, values):
        ends = [(values, cost), *(search(model, begin, scales, every, robust=True) for begin in vectors[:STARTS])]
    return min(ends, key=lambda end: end[1])


def _unlikely(model: Model, values: Vector) -> bool:
    """True where the file hardly allows for the values: the search may have left the valley in which it began."""
    rows, nominal = model.prior
    return bool(np.any(np.abs(rows @ values - nominal) > UNLIKELY))


def _settled(model: Model, values: Vector) -> Fit:
    """The last fits: noise and outliers found, then plain least squares over what is no outlier."""
    floor = least(model)
    noise = np.maximum(robust(model, residuals(model, values)), floor)
    every = np.ones(len(model.measured), dtype=bool)
    values, _ = search(model, values, noise, every, robust=True)
    used = every
    for _ in range(ROUNDS):
        before, left = (noise, used), residuals(model, values)
        noise = np.maximum(robust(model, left), floor)
        used = np.abs(left) < OUTLIER * noise[model.signal]
        noise = np.maximum(plain(model, left, used), floor)
        if (used == before[1]).all() and (np.abs(noise - before[0]) < STILL * noise).all():
            break
        values, _ = search(model, values, noise, used, robust=False)
    slopes = jacobian(model, values, range(len(values)), one_sided=work.exhausted())
    return _as_noisy(model, values, noise, used, slopes)


def _as_noisy(model: Model, values: Vector, noise: Vector, used: NDArray[np.bool_], slopes: Matrix) -> Fit:
    """The fit at some values, its noise corrected for what the fit takes of it."""
    left, floor = residuals(model, values), least(model)
    for _ in range(ADJUSTED):
        scaled = slopes[used] / noise[model.signal[used], None]
        covariance = covariance_of(model, scaled)
        noise = np.maximum(plain(model, left, used, np.sum((scaled @ covariance) * scaled, axis=1)), floor)
    return Fit(model, values, covariance, noise, used, left, slopes)


def estimated(model: Model, values: Vector, noise: Vector) -> Fit:
    """The fit of a record that has no samples yet: ``values`` as they are, with the covariance that they would have."""
    slopes, count = jacobian(model, values, range(len(values)), one_sided=True), len(model.measured)
    covariance = covariance_of(model, slopes / noise[model.signal, None])
    return Fit(model, values, covariance, noise, np.ones(count, dtype=bool), np.zeros(count), slopes)


def _shown(fitted: Fit, wider: Model, at: Vector, which: Sequence[int]) -> bool:
    """True where the residuals show parameters of a wider model: a score test, one step of least squares by them."""
    model, count = fitted.model, len(which)
    weights = 1.0 / fitted.noise[model.signal[fitted.used]]
    slopes = jacobian(wider, at, which)[fitted.used] * weights[:, None] * units_of(wider)[list(which)]
    units, rows = units_of(model), len(model.prior[0])
    known = fitted.jacobian[fitted.used] * weights[:, None] * units
    bound = np.concatenate([model.prior[0] * units, np.zeros((rows, count))], axis=1)
    stacked = np.concatenate([np.concatenate([known, slopes], axis=1), bound])
    target = np.concatenate([fitted.residuals[fitted.used] * weights, np.zeros(rows)])
    solved = np.linalg.lstsq(stacked, target, rcond=1e-13)[0][-count:]
    covariance = np.linalg.pinv(stacked.T @ stacked, rcond=1e-14)[-count:, -count:]
    return bool(solved @ np.linalg.solve(covariance, solved) > UNEQUAL**2)
