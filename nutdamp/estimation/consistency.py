"""Tests of records and fits: that a record can be fitted, and that what its fit leaves is noise.

Second differences of the residuals, r[k-1] - 2 r[k] + r[k+1], have the standard deviation √6 s of noise s, and next to
nothing of what changes slowly. Residuals far larger than that s are no noise but motion that the model does not have,
such as a pulse: their sigmas would mean nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible
from nutdamp.estimation import initial_guess
from nutdamp.estimation.initial_guess import once_a_turn
from nutdamp.estimation.model import Model
from nutdamp.estimation.parameters import BODY, GYROS, KIND, RATIO, SPACE, SUN_PULSE, Vector
from nutdamp.estimation.search import NORMAL_MAD, least
from nutdamp.physics import body as rigid_body

if TYPE_CHECKING:
    from nutdamp.estimation.search import Fit

STUCK, FEWEST, COARSE = 0.2, 20, 10
"""Part of the samples of a sensor, and number of them, that are alike in a row where it is stuck; a record that has
so few different values is one of coarse steps."""


def expect_alive(model: Model) -> None:
    """Raise Infeasible for a sensor that does not change, all along while another one shows a nutation, or for long.

    That gyro 3 does not change all along is as it should be.
    """
    shows = [index for index, name in enumerate(model.signals) if KIND[name].nutation]
    varying = [index for index in shows if _run(model, index)[3] > 1]
    for index, signal in enumerate(model.signals):
        if signal == SUN_PULSE:
            continue
        begins, ends, alike, different = _run(model, index)
        if alike < max(FEWEST, STUCK * len(model.samples[index])):
            continue
        dead = different == 1 and signal != GYROS[2] and bool(set(varying) - {index})
        if dead or different > COARSE:
            while_others = " while others show a nutation" if dead else ""
            raise Infeasible(
                f"{signal} does not change from {begins:.4g} s to {ends:.4g} s ({alike} samples){while_others}: "
                "the sensor is dead or stuck; leave its column out, or end the record before"
            )


def _run(model: Model, index: int) -> tuple[float, float, int, int]:
    """First and last time (s) and number of the most samples of a signal in a row that are alike; how many differ."""
    values, times = model.samples[index], model.times[model.signal == index]
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values, axis=0).any(axis=1)) + 1, [len(values)]])
    at = int(np.argmax(np.diff(edges)))
    first, last = edges[at], edges[at + 1] - 1
    return float(times[first]), float(times[last]), int(last - first + 1), len(np.unique(values, axis=0))


def expect_enough(model: Model) -> None:
    """Raise Infeasible for a record that cannot tell as much as is estimated."""
    if not any(KIND[name].nutation for name in model.signals):
        raise Infeasible(
            f"no nutation is seen in {' and '.join(model.signals)} alone{once_a_turn(model.record)}; omega_1 or "
            "omega_2, the axis, an acceleration, Sun aspect angles or crossings beside them would show it"
        )
    rows, free = len(np.unique(model.times)), sum(math.isinf(parameter.prior) for parameter in model.parameters)
    if len(model.measured) <= free + 2:
        raise Infeasible(
            f"{rows} row{'s' * (rows != 1)} of samples, with {len(model.measured)} values in all, cannot tell {free} "
            "unknowns; a longer record, or more samples, helps"
        )
    body, length = model.spacecraft, model.record.length
    period = rigid_body.body_period(body.inertia.A, body.inertia.C, body.spin, body.inertia.wheel)
    if not any(KIND[name].nutation == BODY for name in model.signals):
        period = body.inertial_period
    if length < 0.5 * period:
        raise Infeasible(
            f"the record is too short: {length:.3g} s are {length / period:.2g} of a nutation period ({period:.3g} s); "
            f"at least one period, {period:.3g} s, is needed"
        )


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


def expect_explained(fitted: Fit) -> None:
    """Raise Infeasible where a fit leaves more than noise, with the time of a step in the motion if there is one.

    So it does where samples are left out that follow each other: outliers come one by one, motion does not.
    """
    model = fitted.model
    burst = left_out_together(fitted)
    if burst is not None:
        signal, begins, ends, count = burst
        raise Infeasible(
            f"from {begins:.4g} s to {ends:.4g} s the motion fitted does not explain {signal}: {count} samples would "
            f"have to be left out, which is motion and no outlier; {_cure(fitted)}"
        )
    left = [index for index in range(len(model.signals)) if _more_than_noise(fitted, index)]
    if not left:
        return
    signals = ", ".join(model.signals[index] for index in left)
    more = max(fitted.noise[index] / _noise(fitted, index) for index in left)
    says = f"the motion fitted does not explain {signals}: residuals are {more:.2g} times the noise between samples"
    time = step(fitted, left)
    where = "" if time is None else f", with a step at about {time:.4g} s"
    raise Infeasible(f"{says}{where}; {_cure(fitted)}")


def _cure(fitted: Fit) -> str:
    fired = fitted.model.record.fired
    what = "check the channels and times of the schedule" if fired else "give the pulses fired in it with --schedule"
    return f"{what}; a record of the coast before or after needs none"


def left_out_together(fitted: Fit) -> tuple[str, float, float, int] | None:
    """Signal, first and last time (s), and number of samples that were left out though they follow each other.

    None where those left out lie as scattered as chance has it: of any `WINDOWS` samples in a row no more than by the
    share left out elsewhere (binomial tail, `CHANCE` for all windows).
    """
    model, least, burst = fitted.model, CHANCE, None
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
            chance = len(rows) * _tail(int(counts[at]), width, min(elsewhere, 1.0))
            if counts[at] > 0 and chance < least:
                least = chance
                those = model.times[rows][at : at + width][out[at : at + width]]
                burst = signal, float(those[0]), float(those[-1]), int(counts[at])
    return burst


def _tail(count: int, width: int, share: float) -> float:
    """Probability that ``count`` or more of ``width`` samples are outliers, each by a ``share``."""
    return math.fsum(
        math.comb(width, number) * share**number * (1.0 - share) ** (width - number)
        for number in range(count, width + 1)
    )


def _rows(fitted: Fit, signal: int) -> Vector:
    return np.asarray(fitted.residuals[fitted.model.signal == signal])


def _noise(fitted: Fit, signal: int) -> float:
    """Noise of a signal by its second differences; at least that of its steps."""
    second = np.diff(_rows(fitted, signal), 2)
    noise = NORMAL_MAD * float(np.median(np.abs(second))) / math.sqrt(6.0)
    return max(noise, float(least(fitted.model)[signal]))


def _more_than_noise(fitted: Fit, signal: int) -> bool:
    model = fitted.model
    values = model.measured[model.signal == signal]
    if (
        model.signals[signal] == SUN_PULSE
        or len(values) < FEWEST_JUDGED
        or fitted.noise[signal] < FAR * _noise(fitted, signal)
    ):
        return False
    varied = NORMAL_MAD * float(np.median(np.abs(values - np.median(values))))
    return bool(fitted.noise[signal] > PART * varied) and not fitted.white(signal)


def step(fitted: Fit, signals: Sequence[int], *, small: bool = False) -> float | None:
    """Time at which the nutation steps, s: where a jump of its sine and cosine leaves the least of the residuals.

    None where no step shows; ``small``: one that may hide in noise.
    """
    model = fitted.model
    chosen = [index for index in signals if model.signals[index] == GYROS[2] or KIND[model.signals[index]].nutation]
    splits = np.linspace(model.record.start, model.record.end, SPLITS + 2)[1:-1]
    total, left = 0.0, np.zeros(len(splits))
    for index in chosen:
        rows, rate = np.flatnonzero(model.signal == index), _rate(fitted, index)
        # Of directions what is off in two ways across them.
        for part in np.array_split(rows, KIND[model.signals[index]].parts):
            without, with_step = _with_step(fitted, part[fitted.used[part] | (not small)], rate, splits)
            total, left = total + without, left + with_step
    best = int(np.argmin(left))
    shows = total - left[best] > SHOWN if small else left[best] < STEP**2 * total
    return float(splits[best]) if chosen and shows else None


def _rate(fitted: Fit, signal: int) -> float:
    """Rate at which a signal shows the nutation, rad/s: in the body, or of the axis about H."""
    rate = initial_guess.nutation_rate(fitted.model, fitted.values)
    if KIND[fitted.model.signals[signal]].nutation != SPACE:
        return rate
    named = fitted.named
    spin = named.get("omega_3", fitted.model.spacecraft.spin)
    axial = initial_guess.axial_rate(fitted.model, named[RATIO], spin)
    return math.hypot(axial, named["omega_1"], named["omega_2"])


def _with_step(fitted: Fit, rows: NDArray[np.intp], rate: float, splits: Vector) -> tuple[float, Vector]:
    """Sums of squares that waves of one rate leave of residuals: without a step, and with one at each of some times."""
    model = fitted.model
    rows = rows[:: max(-(-len(rows) // SAMPLES), 1)]
    times, values = model.times[rows], fitted.residuals[rows] / fitted.noise[model.signal[rows]]
    turn = rate * (times - model.record.start)
    wave = np.column_stack([np.cos(turn), np.sin(turn), np.ones(len(rows))])
    # Waves that grow linearly stand for what a rate that is off does, with or without a step.
    smooth = np.column_stack([wave, wave * (times - times.mean())[:, None] / model.record.length])
    with_step = [_remains(np.column_stack([smooth, wave * (times > split)[:, None]]), values) for split in splits]
    return _remains(smooth, values), np.array(with_step)


def _remains(columns: Vector, values: Vector) -> float:
    """Sum of squares that least squares leaves."""
    solved = np.linalg.lstsq(columns, values, rcond=1e-10)[0]
    return float(np.sum((values - columns @ solved) ** 2))
