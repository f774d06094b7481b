"""Estimates of a spacecraft from telemetry: robust least squares, outliers left out, the model as
wide as shown.

Outliers are found under a loss that grows linearly beyond a few sigma and left out of the last
fits. Residuals far larger than the noise that their second differences show are motion that the
model does not have, such as a pulse: their sigmas would mean nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtrc

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.estimation import initial_guess
from nutdamp.estimation.initial_guess import once_a_turn, starts
from nutdamp.estimation.model import (
    BROKEN,
    NORMAL_MAD,
    ROUNDING,
    Fit,
    Model,
    absurd,
    covariance_of,
    jacobian,
    named_of,
    noise_floor,
    plain,
    residuals,
    robust,
    scales_of,
    search,
    share_left,
    units_of,
    usual,
)
from nutdamp.estimation.parameters import (
    BODY,
    CROSSING,
    GYROS,
    KIND,
    SPACE,
    SUN_PULSE,
    TURN,
    Matrix,
    Record,
    Vector,
    in_moments,
    quantisation,
)
from nutdamp.physics import body as rigid_body
from nutdamp.spacecraft.model import Spacecraft

# budget of work over that of a coast: a flight of ten pulses takes as much more, and a search of
# optimal's in noise of 2e-4 rad/s ended before its last fits
PULSED = 3.0
ROUNDED = 1e-6  # range of a direction that does not change, written to six digits at least
QUIET = 2  # samples after the last pulse within which a damped motion falls still, at most
FEWEST = 20  # number of samples that are alike in a row where a sensor is stuck, at least
COARSE = 10  # a record that has so few different values is one of coarse steps
NOTHING = 1e-12  # times the usual size of a signal below which it shows 0
SATURATED = 0.15
"""Share of samples at the largest, or at the least, value of a signal that has more than `LEVELS`
values: of a sinusoid rounded to 20 steps a tenth is there, of one clipped at 0.88 of its amplitude
0.16, of the right ascension of clipped-21, whose estimate was 8 sigmas off, 0.26.
"""
LEVELS = 20
OFTEN = 1.5  # radians of spin between two samples up to which a direction is seen to go round


def expect_alive(model: Model) -> tuple[str, ...]:
    """The signals of a body that spins steadily, and do not change; none where a signal shows a
    nutation.

    Raises Infeasible for sensors that are dead or stuck, all along or for long, and for samples
    that are no motion.
    """
    held = model.spacecraft.inertia.wheel != 0.0  # by a wheel a body may stand still
    shown = {name: (times, values) for name, times, values in _sensors(model)}
    constant = {name for name, (_, values) in shown.items() if (values == values[0]).all()}
    moves = {name for name, (_, values) in shown.items() if values.any()}
    spins = {GYROS[2]} if held else {GYROS[2]} & moves
    # Gyros without noise show a spin so; everything else that does not change is a sensor that is
    # off.
    steady = {*GYROS} == constant == {*shown} and moves <= spins and bool(spins)
    # Nor does anything but its turn, of a body that has no nutation by its file.
    calm = model.spacecraft.transverse_rate == 0.0 and not moves & {*GYROS[:2]}
    moving = (np.ptp(shown[name][1], axis=0) > ROUNDED for name in {*shown} - constant - {TURN})
    still = calm and not any(map(np.any, moving))
    last_pulse = max((pulse.over for pulse in model.record.schedule), default=-math.inf)
    faults = []
    for name, (times, values) in shown.items():
        edges = np.concatenate(
            [[0], np.flatnonzero(np.diff(values, axis=0).any(axis=1)) + 1, [len(values)]]
        )
        at, alike = int(np.argmax(np.diff(edges))), int(np.diff(edges).max())
        begins, ends = times[edges[at]], times[edges[at + 1] - 1]
        early = times <= last_pulse
        at_an_end = _at_an_end(values[early] if np.count_nonzero(early) >= FEWEST else values)
        # What pulses have damped is as still without noise.
        damped = begins - QUIET * float(np.median(np.diff(times))) <= last_pulse <= begins
        # That gyro 3 does not change all along is as it should be.
        off = (
            not steady and not still and name not in spins
            if name in constant
            else len(np.unique(values, axis=0)) > COARSE and not damped
        )
        if name in KIND and np.mean(absurd(model.spacecraft, name, values)) > BROKEN:
            faults.append(
                f"{name} shows {np.abs(values).max():.3g} {KIND[name].unit}, which no motion "
                "can give"
            )
        elif off and alike >= max(min(FEWEST, len(values)), BROKEN * len(values)):
            faults.append(
                f"{name} does not change from {begins:.4g} s to {ends:.4g} s ({alike} samples)"
            )
        elif at_an_end > SATURATED and name not in spins and not damped:
            share = 100.0 * at_an_end
            faults.append(f"{name} is at its largest or smallest value in {share:.3g} % of samples")
    if faults:
        shows = {name for name in model.signals if KIND[name].nutation}
        others = " while others show a nutation" if constant & shows and shows - constant else ""
        cure = (
            "the sensor is dead, stuck or saturated; leave out its column, or end the record before"
        )
        raise Infeasible(f"{'; '.join(faults)}{others}: {cure}")
    return GYROS if steady else ()


def _at_an_end(values: Vector) -> float:
    """Share of the samples (n, k) at their largest or least value, the larger one; of directions
    (n, 3) those of the azimuth and of the third part. 0 for few levels and for attitudes (n, 4).
    """
    signals = list(values.T) if values.shape[1] == 1 else []
    if values.shape[1] == 3:
        azimuth = np.arctan2(values[:, 1], values[:, 0])
        signals = [azimuth.round(12), values[:, 2].round(12)]
    return max(
        (
            float(np.mean(signal == end))
            for signal in signals
            if len(np.unique(signal)) > LEVELS
            for end in (signal.min(), signal.max())
        ),
        default=0.0,
    )


def _sensors(model: Model) -> Iterator[tuple[str, Vector, Vector]]:
    """Names of what changes while a body moves, times (n,) s and values (n, k) of each; of
    directions the angles.
    """
    for index, name in enumerate(model.signals):
        values = model.samples[index]
        times = model.times[model.signal == index][: len(values)]
        # A slit sees a direction at one azimuth, once a turn; what sees it more often sees it go
        # round.
        often = (
            len(times) > 1 and float(np.median(np.diff(times))) * abs(model.spacecraft.spin) < OFTEN
        )
        if name == CROSSING and often:
            yield (
                f"the azimuth of {name}",
                times,
                np.arctan2(values[:, 1], values[:, 0]).round(12)[:, None],
            )
        if name == CROSSING:
            yield f"the elevation of {name}", times, values[:, 2:3].round(12)
        elif name != SUN_PULSE:
            floor = NOTHING * usual(model.spacecraft, KIND[name].unit)
            yield name, times, np.where(np.abs(values) > floor, values, 0.0)


def expect_enough(model: Model) -> None:
    """Raise Infeasible for a record that cannot tell as much as is estimated."""
    if not any(KIND[name].nutation for name in model.signals):
        raise Infeasible(
            f"{' and '.join(model.signals)} alone cannot show "
            f"nutation{once_a_turn(model.record)}; add omega_1 or omega_2, the axis, an "
            "acceleration, Sun aspect angles or crossings"
        )
    rows = len(np.unique(model.times))
    free = sum(math.isinf(parameter.prior) for parameter in model.parameters)
    if len(model.measured) <= free + 2:
        raise Infeasible(
            f"the samples (rows: {rows}, values: {len(model.measured)}) are too few for "
            f"{free} unknowns; use a longer record, or more samples"
        )
    spacecraft, length = model.spacecraft, model.record.length
    period = rigid_body.body_period(
        spacecraft.inertia.A, spacecraft.inertia.C, spacecraft.spin, spacecraft.inertia.wheel
    )
    if not any(KIND[name].nutation == BODY for name in model.signals):
        period = spacecraft.inertial_period
    if length < 0.5 * period:
        raise Infeasible(
            f"the record is too short: it has {length:.3g} s, {length / period:.2g} of a "
            f"nutation period ({period:.3g} s); at least one period, {period:.3g} s, is "
            "needed"
        )


FAR = 2.0  # times the noise of neighbouring samples from which on residuals are no noise
# part of what varies in a signal that they have then at least: records without noise show smaller
# ones
PART = 1e-3
WINDOWS = (4, 8, 16, 32, 64)  # samples in a row among which those left out are counted
CHANCE = 1e-6  # probability by which they may be scattered so unevenly
FEWEST_JUDGED = 20  # samples of a signal that are judged at least
SPLITS = 120  # times at which a step is looked for
SAMPLES = 2000  # samples of a signal used for that, at most
STEP = 0.7  # part of residuals that are no noise which a step leaves, at most, to count as shown
# decrease of the sum of squares, in units of the noise, by which it shows in those that are nearly
# noise
SHOWN = 50.0


def expect_explained(fitted: Fit) -> None:
    """Raise Infeasible where a fit leaves more than noise, with the time of a step in the motion if
    there is one.

    So it does where samples are left out that follow each other: outliers come one by one, motion
    does not.
    """
    model = fitted.model
    for index, signal in enumerate(model.signals):
        out = float(np.mean(~fitted.used[model.signal == index]))
        if out > BROKEN:
            raise Infeasible(
                f"the fitted motion does not explain {signal}: {100.0 * out:.0f} % of its "
                "samples would be left out"
            )
    burst = left_out_together(fitted)
    if burst is not None:
        signal, begins, ends, count = burst
        raise Infeasible(
            f"from {begins:.4g} s to {ends:.4g} s the fitted motion does not explain "
            f"{signal}: {count} samples in a row differ, so they are motion and not "
            f"outliers; {_cure(fitted)}"
        )
    unexplained = [index for index in range(len(model.signals)) if _more_than_noise(fitted, index)]
    if not unexplained:
        return
    signals = ", ".join(model.signals[index] for index in unexplained)
    more = max(fitted.noise[index] / _noise(fitted, index) for index in unexplained)
    says = (
        f"the fitted motion does not explain {signals}: residuals are {more:.2g} times "
        "the noise between samples"
    )
    time = step(fitted, unexplained)
    where = "" if time is None else f", with a step at about {time:.4g} s"
    raise Infeasible(f"{says}{where}; {_cure(fitted)}")


def _cure(fitted: Fit) -> str:
    fired = fitted.model.record.fired
    what = (
        "check the channels and times of the schedule"
        if fired
        else "give the pulses fired in it with --schedule"
    )
    return f"{what}; or use a record of the coast before or after it"


def left_out_together(fitted: Fit) -> tuple[str, float, float, int] | None:
    """Signal, first and last time (s), and number of samples that were left out though they follow
    each other.

    None where those left out lie as scattered as chance has it: of any `WINDOWS` samples in a row
    no more than by the share left out elsewhere (binomial tail, `CHANCE` for all windows).
    """
    model = fitted.model
    unlikeliest = CHANCE
    burst = None
    for index, signal in enumerate(model.signals):
        rows = np.flatnonzero(model.signal == index)
        rows = rows[np.argsort(model.times[rows], kind="stable")]
        out = ~fitted.used[rows]
        sums = np.concatenate([[0], np.cumsum(out)])
        for width in (samples for samples in WINDOWS if samples < len(rows)):
            counts = sums[width:] - sums[:-width]
            # The more, the less likely: elsewhere are fewer then.
            at = int(np.argmax(counts))
            elsewhere = max(float(sums[-1] - counts[at]), 1.0) / (len(rows) - width)
            share = min(elsewhere, 1.0)
            chance = len(rows) * float(bdtrc(int(counts[at]) - 1, width, share))
            if counts[at] > 0 and chance < unlikeliest:
                unlikeliest = chance
                those = model.times[rows][at : at + width][out[at : at + width]]
                burst = signal, float(those[0]), float(those[-1]), int(counts[at])
    return burst


def _noise(fitted: Fit, signal: int) -> float:
    """Noise s of a signal by its second differences, whose standard deviation is √6 s; at least
    that of its steps.
    """
    second = np.diff(fitted.residuals[fitted.model.signal == signal], 2)
    noise = NORMAL_MAD * float(np.median(np.abs(second))) / math.sqrt(6.0)
    return max(noise, float(noise_floor(fitted.model)[signal]))


def _more_than_noise(fitted: Fit, signal: int) -> bool:
    model = fitted.model
    values = model.measured[model.signal == signal]
    judged = model.signals[signal] != SUN_PULSE and len(values) >= FEWEST_JUDGED
    if not judged or fitted.noise[signal] < FAR * _noise(fitted, signal):
        return False
    varied = NORMAL_MAD * float(np.median(np.abs(values - np.median(values))))
    return bool(fitted.noise[signal] > PART * varied) and not fitted.white(signal)


def step(fitted: Fit, signals: Sequence[int], *, small: bool = False) -> float | None:
    """Time at which the nutation steps, s: where a jump of its sine and cosine leaves the least of
    the residuals.

    None where no step shows; ``small``: one that may hide in noise.
    """
    model = fitted.model
    chosen = [
        index
        for index in signals
        if model.signals[index] == GYROS[2] or KIND[model.signals[index]].nutation
    ]
    splits = np.linspace(model.record.start, model.record.end, SPLITS + 2)[1:-1]
    total = 0.0
    remaining = np.zeros(len(splits))
    for index in chosen:
        rows = np.flatnonzero(model.signal == index)
        rate = _rate(fitted, index)
        # Of directions what is off in two ways across them.
        for part in np.array_split(rows, KIND[model.signals[index]].parts):
            without, with_step = _with_step(
                fitted, part[fitted.used[part] | (not small)], rate, splits
            )
            total, remaining = total + without, remaining + with_step
    best = int(np.argmin(remaining))
    shows = total - remaining[best] > SHOWN if small else remaining[best] < STEP**2 * total
    return float(splits[best]) if chosen and shows else None


def _rate(fitted: Fit, signal: int) -> float:
    """Rate at which a signal shows the nutation, rad/s: in the body, or of the axis about H."""
    model, named = fitted.model, fitted.named
    if KIND[model.signals[signal]].nutation != SPACE:
        return initial_guess.nutation_rate(model, fitted.values)
    A, C = in_moments(model.spacecraft, named)
    axial = initial_guess.axial_rate(model, C / A, named.get("omega_3", model.spacecraft.spin))
    return math.hypot(axial, named["omega_1"], named["omega_2"])


def _with_step(
    fitted: Fit, rows: NDArray[np.intp], rate: float, splits: Vector
) -> tuple[float, Vector]:
    """Sums of squares that waves of one rate leave of residuals: without a step, and with one at
    each of some times.
    """
    model = fitted.model
    rows = rows[:: max(-(-len(rows) // SAMPLES), 1)]
    times = model.times[rows]
    values = fitted.residuals[rows] / fitted.noise[model.signal[rows]]
    turn = rate * (times - model.record.start)
    wave = np.column_stack([np.cos(turn), np.sin(turn), np.ones(len(rows))])
    # Waves that grow linearly stand for what a rate that is off does, with or without a step.
    smooth = np.column_stack([wave, wave * (times - times.mean())[:, None] / model.record.length])
    with_step = [
        _remains(np.column_stack([smooth, wave * (times > split)[:, None]]), values)
        for split in splits
    ]
    return _remains(smooth, values), np.array(with_step)


def _remains(columns: Vector, values: Vector) -> float:
    """Sum of squares that least squares leaves."""
    solved = np.linalg.lstsq(columns, values, rcond=1e-10)[0]
    return float(np.sum((values - columns @ solved) ** 2))


# standard deviations beyond which a sample is left out: of 60,000 normal ones not one, on average
# 0.03
OUTLIER = 5.0
ROUNDS = 8  # fits in which noise and outliers are found anew, at most
STILL = 1e-3  # relative change of the noise from which on they are
ADJUSTED = 3  # rounds in which the noise is corrected for what the fit takes of it
# share of a signal's own size that residuals may have before a fit begins again with a part of the
# record
POOR = 0.3
STARTS = 3  # starts that are searched from at most
# sigmas of the file by which a parameter may be off before the starts are searched in shorter steps
UNLIKELY = 4.0
PARTS = (0.5, 0.25, 0.1, 0.04)  # parts of the record that it then begins with
SEEN = 4.5  # standard deviations of |ω| from which on there is a nutation
# sigmas from which on the transverse moments count as different, or such a body as dissipating
UNEQUAL = 5.0
LARGE = (
    0.42  # noise of a signal, in its steps, below which these are large: they make 0.29 of it alone
)
LOST = 1e-7  # least singular value of derivatives of length 1 from which on they are independent
UNEQUAL_BY = ("unequal_1", "unequal_2")  # the parameters of unequal transverse moments


def fit(spacecraft: Spacecraft, record: Record) -> Fit:
    """Estimate what a record tells of a spacecraft.

    Raises Infeasible where that is nothing, BadRequest where the file does not describe what a
    signal needs.
    """
    most = work.FIT * max(1.0, len(record.times) / work.FITTED)
    with work.budget("fit", PULSED * most if record.fired else most) as spent:
        best = _with_steps(_fitted(spacecraft, record))
    try:
        expect_explained(best)
        expect_told(best)
    except Infeasible as error:
        if not spent.exhausted:
            raise
        raise Infeasible(
            f"{error}; or the search used up its budget of work before it found the motion: "
            "try fewer samples"
        ) from None
    return replace(best, finished=not spent.exhausted)


def _fitted(spacecraft: Spacecraft, record: Record) -> Fit:
    # Three moments and dissipation together take an integration: only where both are seen.
    model = Model(spacecraft, record, growing=spacecraft.inertia.symmetric)
    expect_enough(model)
    if constant := expect_alive(model):
        return _steady(Model(spacecraft, record, steady=True), constant)
    fitted = _settled(model, _best(model))
    if not _sees_nutation(fitted):
        return _without_nutation(fitted)
    fitted = initial_guess.likeliest(
        [
            fitted,
            *(_settled(model, values) for values in initial_guess.neighbours(model, fitted.values)),
        ]
    )
    begin, unequal = None, fitted
    if not model.unequal:
        three = Model(spacecraft, record, unequal=True, growing=fitted.grows)
        begin = _begun(fitted, three)
        if not _step(fitted, three, begin, UNEQUAL_BY)[0]:
            return fitted
        # What unequal moments do may look like growth of equal ones, which then is none.
        narrow = Model(spacecraft, record, unequal=True, growing=False)
        unequal = _widened(fitted, narrow, UNEQUAL_BY)
    grown = Model(spacecraft, record, unequal=True)
    if grown.parameter("growth") is None:
        return unequal
    shown, values, slopes = _step(unequal, grown, _begun(unequal, grown), ("growth",))
    if not shown or (begin is not None and not fitted.grows):
        # Left out growth would be taken as exactly known, and what is known together with it off by
        # more than its sigma; it is linear where it does not show.
        return _as_noisy(grown, values, unequal.noise, unequal.used, slopes)
    if begin is None:
        return _widened(fitted, grown, ("growth",))
    of_moments = _places(three, UNEQUAL_BY)
    begin[of_moments] = _begun(unequal, three)[of_moments]
    return _settled(three, begin)


def _steady(model: Model, constant: tuple[str, ...]) -> Fit:
    """The fit of gyros that show the spin alone, without noise: what no motion tells is exactly as
    the file has it.
    """
    shown = {name: float(model.samples[model.signals.index(name)][0, 0]) for name in GYROS}
    values = np.array([shown.get(each.name, each.file) for each in model.parameters])
    noise = np.maximum(noise_floor(model), ROUNDING * usual(model.spacecraft, "rad/s"))
    slopes = jacobian(model, values, range(len(values)))
    used = np.ones(len(model.measured), dtype=bool)
    return Fit(
        model,
        values,
        covariance_of(model, slopes / noise[model.signal, None]),
        noise,
        used,
        residuals(model, values),
        slopes,
        steady=True,
        constant=constant,
    )


def _with_steps(fitted: Fit) -> Fit:
    """The fit with what steps that are large beside the noise do to it in its covariance, and their
    signals named.

    Between such steps errors are no noise, which averages out, but follow from the motion: least
    squares of what steps make of the prediction is off by δ, and δ δᵀ adds to P. The motion that
    they were made of is that without δ.
    """
    model = fitted.model
    used = fitted.used
    off = np.zeros(len(fitted.values))
    loud = [at for at, name in enumerate(model.signals) if not KIND[name].off]
    quantised = (
        (at, model.signal == at, quantisation(model.measured[model.signal == at])) for at in loud
    )
    steps = [(at, rows, step) for at, rows, step in quantised if fitted.noise[at] < LARGE * step]
    weights = fitted.jacobian[used] / fitted.noise[model.signal[used], None] ** 2
    for _ in range(3 if steps else 0):  # of a motion that is less off each time
        shown = model.predicted(named_of(model, fitted.values - off))
        errors = np.zeros(len(used))
        for _, rows, step in steps:
            away = (shown[rows] - model.measured[rows][0]) / step
            errors[rows] = step * (np.rint(away) - away)
        off = fitted.covariance @ (weights.T @ errors[used])
    covariance = fitted.covariance + np.outer(off, off)
    coarse = tuple(model.signals[at] for at, _, _ in steps)
    return replace(fitted, covariance=covariance, coarse=coarse)


def expect_told(fitted: Fit) -> None:
    """Raise Infeasible where neither the data nor the file tell a parameter, or several only
    together.
    """
    free = [at for at, each in enumerate(fitted.model.parameters) if math.isinf(each.prior)]
    told = (
        fitted.jacobian[fitted.used][:, free] / fitted.noise[fitted.model.signal[fitted.used], None]
    )
    sizes = np.linalg.norm(told, axis=0)
    if not fitted.constant and (
        not sizes.all() or np.linalg.svd(told / sizes, compute_uv=False)[-1] < LOST
    ):
        names = ", ".join(fitted.model.parameters[at].name for at in free)
        raise Infeasible(
            f"the record does not determine all of {names}: a sensor is dead, or more "
            "signals are needed"
        )


def _begun(narrow: Fit, wider: Model) -> Vector:
    """The values of a fit for another model, (p,):
    of parameters that it lacks those of the file.
    """
    begin = {each.name: each.file for each in wider.parameters} | narrow.named
    return np.array([begin[each.name] for each in wider.parameters])


def _places(model: Model, names: Sequence[str]) -> list[int]:
    return [index for index, each in enumerate(model.parameters) if each.name in names]


def _widened(narrow: Fit, wider: Model, more: Sequence[str]) -> Fit:
    """The fit of a model with ``more`` parameters, from where a narrower one ended."""
    values = _begun(narrow, wider)
    units = units_of(wider)
    for index in _places(wider, more):
        # Away from nothing, where the principal axes are any.
        values[index] = max(abs(values[index]), 1e-3 * units[index])
    return _settled(wider, values)


def _sees_nutation(fitted: Fit) -> bool:
    """True where there is a nutation in the record.

    Raises Infeasible where there is none, and the file has one that would be seen.
    """
    at = _places(fitted.model, ("omega_1", "omega_2"))
    omega, across = fitted.values[at], fitted.covariance[np.ix_(at, at)]
    # Its size counts: where the phase is hardly known, the rate across it is not either.
    size = float(np.linalg.norm(omega))
    way = omega / size if size > 0.0 else np.array([1.0, 0.0])
    sigma = 1.0 / math.sqrt(float(way @ np.linalg.pinv(across, hermitian=True) @ way))
    seen = size >= SEEN * sigma
    if not seen:
        expect_explained(fitted)
        if fitted.model.spacecraft.transverse_rate >= SEEN * sigma:
            raise Infeasible(
                f"no nutation is seen: the transverse rate is {math.degrees(size):.3g} deg/s, "
                "within the noise, and the file has more; if the body spins steadily, set "
                "state.nutation to 0; else check the sensors, or fire a probe pulse"
            )
    return seen


def _without_nutation(fitted: Fit) -> Fit:
    """The fit of a steady spin: spin and axis; moments and dissipation, which it does not show,
    are those of the file.
    """
    model = Model(fitted.model.spacecraft, fitted.model.record, steady=True)
    return replace(_settled(model, _begun(fitted, model)), steady=True)


def _best(model: Model) -> Vector:
    """Values of the least robust cost, from the starts that the record gives."""
    best, cost = _try(model, list(starts(model)))
    for share in PARTS if share_left(model, best) > POOR else ():
        values, other = _try(model, list(starts(model, share)))
        # The fit of that part of the record, then of twice as much, to the whole.
        part = share
        while share < PARTS[0] and part < 2.0:
            rows = model.times <= model.start + min(part, 1.0) * model.record.length
            values, other = search(model, values, scales_of(model), rows, robust=True, near=False)
            part *= 2.0
        if other < cost:
            best, cost = values, other
        if share_left(model, best) < POOR:
            break
    return best


def _try(model: Model, begins: Sequence[dict[str, float]]) -> tuple[Vector, float]:
    """Values from the start of least cost; where these are poor, the best from the three starts of
    least cost.
    """
    scales = scales_of(model)
    every = np.ones(len(model.measured), dtype=bool)
    vectors = [np.array([begin[each.name] for each in model.parameters]) for begin in begins]
    if len(vectors) > 1:
        costs = [
            float(np.abs(residuals(model, begin) / scales[model.signal]).sum()) for begin in vectors
        ]
        vectors = [vectors[index] for index in np.argsort(costs)[:STARTS]]
    ends = []
    for begin in vectors:
        ends.append(search(model, begin, scales, every, robust=True, near=False))
        if share_left(model, ends[-1][0]) < POOR:
            break
    values, cost = min(ends, key=lambda end: end[1])
    rows, nominal = model.prior
    # Where the file hardly allows for the values, the search may have left the valley in which it
    # began.
    if np.any(np.abs(rows @ values - nominal) > UNLIKELY):
        ends = [
            (values, cost),
            *(search(model, begin, scales, every, robust=True) for begin in vectors[:STARTS]),
        ]
    return min(ends, key=lambda end: end[1])


def _settled(model: Model, values: Vector) -> Fit:
    """The last fits: noise and outliers found, then plain least squares over what is no outlier."""
    floor = noise_floor(model)
    noise = np.maximum(robust(model, residuals(model, values)), floor)
    every = np.ones(len(model.measured), dtype=bool)
    values, _ = search(model, values, noise, every, robust=True)
    used = every
    for _ in range(ROUNDS):
        before = (noise, used)
        misfits = residuals(model, values)
        noise = np.maximum(robust(model, misfits), floor)
        used = np.abs(misfits) < OUTLIER * noise[model.signal]
        noise = np.maximum(plain(model, misfits, used), floor)
        if (used == before[1]).all() and (np.abs(noise - before[0]) < STILL * noise).all():
            break
        values, _ = search(model, values, noise, used, robust=False)
    slopes = jacobian(model, values, range(len(values)), one_sided=work.exhausted())
    return _as_noisy(model, values, noise, used, slopes)


def _as_noisy(
    model: Model, values: Vector, noise: Vector, used: NDArray[np.bool_], slopes: Matrix
) -> Fit:
    """The fit at some values, its noise corrected for what the fit takes of it."""
    misfits = residuals(model, values)
    floor = noise_floor(model)
    for _ in range(ADJUSTED):
        scaled = slopes[used] / noise[model.signal[used], None]
        covariance = covariance_of(model, scaled)
        noise = np.maximum(
            plain(model, misfits, used, np.sum((scaled @ covariance) * scaled, axis=1)), floor
        )
    return Fit(model, values, covariance, noise, used, misfits, slopes)


def _step(
    narrow: Fit, wider: Model, at: Vector, names: Sequence[str]
) -> tuple[bool, Vector, Matrix]:
    """One step of least squares from a narrow fit with the parameters ``names`` of a ``wider``
    model besides, ``at`` its values: whether the residuals show them (score test), its values after
    the step, and the derivatives by them.
    """
    model, used = narrow.model, narrow.used
    which = _places(wider, names)
    order = [each.name for each in model.parameters] + [wider.parameters[at].name for at in which]
    slopes = np.concatenate([narrow.jacobian, jacobian(wider, at, which)], axis=1)
    units = np.concatenate([units_of(model), units_of(wider)[which]])
    weights = 1.0 / narrow.noise[model.signal[used]]
    rows, nominal = model.prior
    held = np.concatenate([rows, np.zeros((len(rows), len(which)))], axis=1)
    stacked = np.concatenate([slopes[used] * weights[:, None], held]) * units
    target = np.concatenate([narrow.residuals[used] * weights, nominal - rows @ narrow.values])
    solved = np.linalg.lstsq(stacked, target, rcond=1e-13)[0]
    covariance = np.linalg.pinv(stacked.T @ stacked, rcond=1e-14)
    count = len(which)
    size = solved[-count:] @ np.linalg.solve(covariance[-count:, -count:], solved[-count:])
    columns = [order.index(each.name) for each in wider.parameters]
    return size > UNEQUAL**2, at + (units * solved)[columns], slopes[:, columns]
