"""Nutation rates that samples at equal intervals cannot tell apart.

Seen every T s, a rate looks like any other that differs by a multiple of 2π/T: C/A is known but for multiples of
2π/(|ω3| T), and one transverse signal alone does not show the sense of the rate either.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from nutdamp.errors import Infeasible
from nutdamp.estimation.model import Model, Vector
from nutdamp.estimation.parameters import RATIO
from nutdamp.estimation.record import ACCELERATION, GYROS

if TYPE_CHECKING:
    from nutdamp.estimation.fit import Fit

WITHIN = 3.0
"""Sigmas of the file within which another C/A is considered."""

ALIKE = 25.0
"""Difference of -2 ln(likelihood) below which two fits count as equally good."""

MOST = 6
"""Other values of C/A that are fitted at most, the nearest to the file first."""

POSSIBLE = (0.01, 1.999)
"""Range of C/A of a symmetric body."""


def neighbours(model: Model, values: Vector) -> list[Vector]:
    """Values of the parameters with the other C/A that equal sampling allows within the tolerances of the file.

    Where the file gives no tolerance, all that are possible, if the nutation found is itself sampled too slowly.
    """
    at, low, high = _range(model)
    if math.isinf(model.parameters[at].prior) and not too_slow(model, values):
        return []
    step = 2.0 * math.pi / (abs(_spin(model, values)) * interval(model))
    # a -> a + k step; of one transverse signal also a -> -a + k step.
    one_sided = len(_transverse(model)) == 1 and "axis" not in model.signals
    ratios = []
    for begin, itself in ((values[at], True), *[(2.0 - values[at], False)] * one_sided):
        nearest = round((model.parameters[at].file - begin) / step)
        ratios += [begin + k * step for k in range(nearest - MOST, nearest + MOST + 1) if k != 0 or not itself]
    ratios = sorted((one for one in ratios if low < one < high), key=lambda one: abs(one - model.parameters[at].file))
    made = []
    for ratio in ratios[:MOST]:
        made.append(values.copy())
        made[-1][at] = ratio
    return made


def likeliest(fits: Sequence[Fit]) -> Fit:
    """The one of some fits of one record that the data and the tolerances of the file leave.

    Raises Infeasible where these leave several.
    """
    model = fits[0].model
    at, low, high = _range(model)
    counts = np.bincount(model.signal)
    costs = [2.0 * float(counts @ np.log(one.noise)) for one in fits]
    alike = [one for one, cost in zip(fits, costs, strict=True) if cost < min(costs) + ALIKE]
    left = [one for one in alike if low < one.values[at] < high]
    if not left and too_slow(model, alike[0].values):
        raise Infeasible(
            f"with a sample every {interval(model):.4g} s several nutation rates fit equally well, and none of their "
            "C/A is as near to the file as its tolerances allow; check A and C in the file (are the times in seconds?)"
        )
    left = left or alike[:1]
    if len(left) == 1:
        return left[0]
    ratios = sorted(float(one.values[at]) for one in left)
    fastest = max(abs(nutation_rate(model, one.values)) for one in left)
    raise Infeasible(
        f"with a sample every {interval(model):.4g} s several nutation rates fit equally well: C/A may be "
        f"{', '.join(f'{one:.4f}' for one in ratios)}; samples less than {math.pi / fastest:.3g} s apart or at uneven "
        "intervals, or smaller tolerances of A and C in the file, help (are the times in seconds?)"
    )


def too_slow(model: Model, values: Vector) -> bool:
    """Whether fewer than two samples fall in a nutation period."""
    return abs(nutation_rate(model, values)) * interval(model) > math.pi


def nutation_rate(model: Model, values: Vector) -> float:
    """Rate at which the signals show the nutation, rad/s: in the body, or in space where only the axis is seen."""
    ratio = float(values[_range(model)[0]])
    return (1.0 - ratio if _transverse(model) else ratio) * _spin(model, values)


def interval(model: Model) -> float:
    """Usual time between the samples of the signal that is sampled fastest of those that show the nutation, s."""
    shown = [name in _transverse(model) or name == "axis" for name in model.signals]
    steps = [np.diff(model.times[model.signal == index]) for index in np.flatnonzero(shown)]
    return min((float(np.median(one)) for one in steps if len(one)), default=model.record.interval)


def _transverse(model: Model) -> list[str]:
    return [name for name in model.signals if name in (*GYROS[:2], ACCELERATION)]


def _spin(model: Model, values: Vector) -> float:
    names = [one.name for one in model.parameters]
    return float(values[names.index("omega_3")]) if "omega_3" in names else model.spacecraft.spin


def _range(model: Model) -> tuple[int, float, float]:
    """Position of C/A among the parameters, and the range that the file leaves it."""
    at = next(index for index, one in enumerate(model.parameters) if one.name == RATIO)
    one = model.parameters[at]
    return at, max(one.file - WITHIN * one.prior, POSSIBLE[0]), min(one.file + WITHIN * one.prior, POSSIBLE[1])
