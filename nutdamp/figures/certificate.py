"""The picture of ``plan --figure primer``: what a firing at any time would cost more than it is worth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nutdamp.figures import style
from nutdamp.figures.style import GREY, INK, MOTION, PULSE
from nutdamp.planning.tradeoff import Certificate
from nutdamp.spacecraft.model import Vector
from nutdamp.views.text import cost

if TYPE_CHECKING:
    from matplotlib.figure import Figure


ROWS = 6000
"""Moments of the envelope, over all windows."""

AFTER = 1.25
"""End of the time shown over the end of the last firing of the plan."""

TURNS = 2.0
"""Periods of the nutation that are shown at least."""

ROUNDING = 1e-3
"""Depth of the envelope below 0 that is the step of the linear program in time."""


@style.styled
def certificate_figure(proof: Certificate) -> Figure:
    """Envelope of 1 − q of all channels, as far as the plan fires, with the firings of program and plan.

    q is the worth of a second of firing over its cost, by the prices of the proof: where 1 − q > 0, to fire costs more
    than it is worth.
    """
    times = moments(proof)
    curves = [1.0 - proof.primer(span).max(axis=1) for span in times]
    figure = style.sheet(7.4, 3.9)
    axes = figure.subplots()
    for span, curve in zip(times, curves, strict=True):
        axes.plot(span, curve, color=MOTION, label="least 1 − q of all channels")
    last, later = float(times[-1][-1]), 0
    for name, fired, mark in _firings(proof):
        places = [(t, 1.0 - proof.primer(np.array([t]))[0, index]) for t, index in fired if t <= last]
        later += len(fired) - len(places)
        look = {"color": PULSE, "markersize": 5, "linestyle": "", "fillstyle": "none", "markeredgewidth": 1.3}
        axes.plot(*np.array(places).reshape(-1, 2).T, marker=mark, label=name, **look)  # type: ignore[arg-type]
    axes.axhline(0.0, color=GREY, linewidth=1.0)
    lowest = min(float(curve.min()) for curve in curves)
    axes.margins(x=0.02, y=0.08)
    axes.set(xlabel="time, s", ylabel="1 − q: cost less worth, over cost")
    text = "below 0 a firing would be worth more than it costs: nowhere here"
    if lowest < -ROUNDING:
        gain = cost(proof.proof.gained, proof.problem.unit)
        text = f"below 0 a channel is on for long: the gain there, {gain}, is taken off the bound"
    text += f"; firings of the program after {style.number(last)} s: {later}" * bool(later)
    axes.set_title(text, loc="left", color=INK, **style.NOTE)
    axes.grid()
    style.legend(figure, [axes])
    bound = cost(proof.bound, proof.problem.unit)
    style.heading(figure, proof.spacecraft, f"primer by the linear program of small angles\nsmall-angle bound {bound}")
    return figure


def moments(proof: Certificate) -> list[Vector]:
    """Moments (n,) s of each window that matters: until soon after the last firing of the plan."""
    shortest = TURNS * proof.spacecraft.body_period
    until = max(AFTER * proof.plan.pulses.end, min(shortest, proof.windows[-1][1]))
    spans = [(begins, min(ends, until)) for begins, ends in proof.windows if begins < until]
    pace = ROWS / max(sum(ends - begins for begins, ends in spans), 1e-9)
    return [np.linspace(begins, ends, int((ends - begins) * pace) + 2) for begins, ends in spans]


def _firings(proof: Certificate) -> list[tuple[str, list[tuple[float, int]], str]]:
    """Firings of the linear program and of the plan: moments, s, and channels, with name and mark."""
    names = [channel.name for channel in proof.program.channels]
    program = [(burn.t, names.index(burn.channel.name)) for burn in proof.burns]
    plan = [(pulse.t, names.index(pulse.channel)) for pulse in proof.plan.pulses]
    return [("firings of the program", program, "o"), ("firings of the plan", plan, "x")]
