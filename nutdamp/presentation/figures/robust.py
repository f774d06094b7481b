"""The picture of ``trade --robust``: how many cases comply, against what it costs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nutdamp.presentation.figures import style
from nutdamp.presentation.figures.legends import heading, legend
from nutdamp.presentation.figures.style import GREY, INK, MOTION, PULSE
from nutdamp.presentation.verdicts import exact_percent
from nutdamp.robust import RobustComparison, front
from nutdamp.screening import Candidate

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@style.styled
def front_figure(found: RobustComparison) -> Figure:
    """Propellant (impulse where that is unknown) against the share of cases that comply; grey dots are other plans."""
    figure = style.sheet(7.4, 4.2)
    axes = figure.subplots()
    rows = front(found)
    known = all(one.plan.pulses.propellant is not None for one in found.candidates)

    def cost(one: Candidate) -> float:
        pulses = one.plan.pulses
        return 1e3 * float(pulses.propellant or 0.0) if known else float(pulses.total_impulse)

    others = [one for one in found.candidates if one not in rows and one.met is not None]
    axes.plot(
        [cost(one) for one in others],
        [100.0 * (one.met or 0.0) for one in others],
        "o",
        color=GREY,
        markersize=3.5,
        label="other plans",
    )
    axes.plot(
        [cost(one) for one in rows],
        [100.0 * (one.met or 0.0) for one in rows],
        "o-",
        color=MOTION,
        drawstyle="steps-post",
        linewidth=1.4,
        markersize=4.5,
        label="front",
    )
    for number, one in enumerate(rows, start=1):
        axes.annotate(
            str(number),
            (cost(one), 100.0 * (one.met or 0.0)),
            (3, -9),
            textcoords="offset points",
            fontsize=style.SMALL,
            color=INK,
        )
    level = exact_percent(found.probability)
    axes.axhline(100.0 * found.probability, color=PULSE, linewidth=1.2, label=f"required: {level}")
    axes.set(xlabel="propellant, g" if known else "impulse, N m s", ylabel="cases that comply, %", ylim=(-7.0, 105.0))
    heading(figure, found.comparison.spacecraft, "what it costs that more cases comply")
    axes.grid()
    legend(figure, [axes])
    return figure
