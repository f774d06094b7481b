"""The picture of ``trade --robust``: how many cases comply, against what it costs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from nutdamp.presentation.figures import labels, style
from nutdamp.presentation.figures.legends import heading, legend
from nutdamp.presentation.figures.style import GREY, INK, MOTION, PULSE
from nutdamp.presentation.verdicts import exact_percent
from nutdamp.robust import RobustComparison, front
from nutdamp.screening import Candidate
from nutdamp.spacecraft import Vector

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@style.styled
def front_figure(found: RobustComparison) -> Figure:
    """Propellant (impulse where that is unknown) against the share of cases that comply.

    Grey dots are other plans, crosses mark those with which too few cases comply.
    """
    figure = style.sheet(7.4, 4.2)
    axes = figure.subplots()
    rows = front(found)
    known = all(one.plan.pulses.propellant is not None for one in found.candidates)

    def place(one: Candidate) -> tuple[float, float]:
        pulses = one.plan.pulses
        cost = 1e3 * float(pulses.propellant or 0.0) if known else float(pulses.total_impulse)
        return cost, 100.0 * (one.met or 0.0)

    others = [one for one in found.candidates if one not in rows and one.met is not None]
    axes.plot(*_places([place(one) for one in others]).T, "o", color=GREY, markersize=3.5, label="other plans")
    places = _places([place(one) for one in rows])
    # Steps by their corners, which labels keep off.
    costs, shares = np.repeat(places[:, 0], 2)[1:], np.repeat(places[:, 1], 2)[:-1]
    axes.plot(costs, shares, color=MOTION, linewidth=1.4)
    axes.plot(*places.T, "o", color=MOTION, markersize=4.5)
    axes.plot([], [], "o-", color=MOTION, linewidth=1.4, markersize=4.5, label="front")
    failing = [one for one in [*others, *rows] if (one.met or 0.0) < found.probability]
    if failing:
        axes.plot(*np.transpose([place(one) for one in failing]), "x", label="too few cases comply", **style.CROSS)
    other_places = _places([place(one) for one in others])
    for row in range(len(rows)):
        meant = labels.Meant(places[[row]], np.vstack([np.delete(places, row, axis=0), other_places]))
        labels.add(axes, str(row + 1), places[row], INK, role="vital", meant=meant)
    level = exact_percent(found.probability)
    axes.axhline(100.0 * found.probability, color=PULSE, linewidth=1.2, zorder=1.5, label=f"required: {level}")
    axes.set(xlabel="propellant, g" if known else "impulse, N m s", ylabel="cases that comply, %", ylim=(-7.0, 105.0))
    heading(figure, found.comparison.spacecraft, "what it costs that more cases comply")
    axes.grid()
    legend(figure, [axes])
    labels.settle(figure)
    return figure


def _places(found: Sequence[tuple[float, float]]) -> Vector:
    return np.array(found, dtype=np.float64).reshape(-1, 2)
