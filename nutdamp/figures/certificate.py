"""The picture of ``plan --certificate``: the primer curve of each channel, and the moments of the pulses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nutdamp.figures import style
from nutdamp.figures.legends import heading, legend
from nutdamp.figures.style import GREY, INK, MOMENTUM, MOTION, PULSE
from nutdamp.planning.tradeoff import Certificate
from nutdamp.spacecraft.model import Vector
from nutdamp.views.text import cost

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


LINES = tuple((colour, line) for line in ("-", "--", ":") for colour in (MOTION, PULSE, MOMENTUM, GREY))
"""Colour and style of the channels in turn."""

MOST = len(LINES)
"""Largest number of channels drawn: those with the highest curves."""

MANY = 25.0
"""Periods of the nutation beyond which curves would fill a panel: only their peaks are drawn."""

CLOSER = 0.5
"""Share of the horizon before which a plan ends that is drawn a second time, until its end."""


@style.styled
def certificate_figure(proof: Certificate) -> Figure:
    """q over time in the windows in which pulses may be on; marks show the burns of program and plan.

    Where the plan ends early in the horizon, the time until then is drawn again below.
    """
    end, last = proof.plan.pulses.end, float(proof.moments()[-1][-1])
    closer = 0.0 < end < CLOSER * last
    figure = style.sheet(7.4, 6.4 if closer else 4.2)
    panels = figure.subplots(2 if closer else 1, 1, squeeze=False)[:, 0]
    periods = last / proof.spacecraft.body_period
    for axes in panels:
        _draw(axes, proof, 1.0 if axes is panels[-1] and closer else periods)
    until = "until the horizon"
    if periods > MANY:
        panels[0].set_title(f"{until}: the highest of each period")
    elif closer:
        panels[0].set_title(until)
    if closer:
        panels[1].set(title="until the last pulse of the plan", xlim=(-0.03 * end, 1.06 * end))
    panels[-1].set_xlabel("time, s")
    figure.supylabel("q: worth of a second over what it costs", fontsize=style.TICK_SIZE)
    some = f" ({MOST} of {len(proof.program.channels)} channels)" if len(proof.program.channels) > MOST else ""
    least = f"first-order least (small angles): {cost(proof.bound, proof.problem.unit)}"
    heading(figure, proof.spacecraft, f"primer curve{some}\n{least}")
    legend(figure, [panels[-1]])
    return figure


def _draw(axes: Axes, proof: Certificate, turns: float) -> None:
    """Curves and marks; lines are thin where so many ``turns`` lie side by side, and follow the peaks of too many."""
    spans = proof.moments()
    curves = [proof.primer(times) for times in spans]
    channels = proof.program.channels
    highest = np.max([curve.max(axis=0) for curve in curves], axis=0)
    drawn = sorted(np.argsort(-highest, kind="stable")[:MOST].tolist())
    width = min(style.thickness(curves[0], turns), 1.1)
    for (colour, line), index in zip(LINES, drawn, strict=False):
        name: str | None = channels[index].name
        for times, curve in zip(spans, curves, strict=True):
            rows = peaks(curve[:, index]) if turns > MANY else slice(None)
            axes.plot(times[rows], curve[rows, index], color=colour, linestyle=line, linewidth=width, label=name)
            name = None
    for label, fired, look in _firings(proof):
        places = [(t, proof.primer(np.array([t]))[0, index]) for t, index in fired]
        axes.plot(*np.array(places).reshape(-1, 2).T, look, color=INK, markersize=4.5, label=label, fillstyle="none")
    axes.axhline(1.0, color=INK, linewidth=0.9, linestyle="-", label="what it costs")
    lowest = 0.0 if turns > MANY else min(-1.0, float(min(curve.min() for curve in curves)))
    axes.set_ylim(lowest - 0.1, max(1.25, float(highest.max()) + 0.2))
    axes.grid()


def peaks(values: Vector) -> NDArray[np.intp]:
    """Rows of (n,) ``values`` that are higher than those beside them; where there are none, the row of the highest."""
    inner = np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] >= values[2:])) + 1
    return inner if len(inner) else np.array([np.argmax(values)], dtype=np.intp)


def _firings(proof: Certificate) -> list[tuple[str, list[tuple[float, int]], str]]:
    """Burns of the linear program and pulses of the plan: moments, s, and channels, with name and mark."""
    names = [channel.name for channel in proof.program.channels]
    program = [(burn.t, names.index(burn.channel.name)) for burn in proof.burns]
    plan = [(pulse.t, names.index(pulse.channel)) for pulse in proof.plan.pulses]
    return [("burns of the linear program", program, "o"), ("pulses of the plan", plan, "x")]
