"""The picture of ``plan --certificate``: the primer curve of each channel, and where the program fires."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nutdamp.certificate import Certificate
from nutdamp.presentation.figures import style
from nutdamp.presentation.figures.legends import legend
from nutdamp.presentation.figures.style import GREY, INK, MOMENTUM, MOTION, PULSE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINES = tuple((colour, line) for line in ("-", "--", ":") for colour in (MOTION, PULSE, MOMENTUM, GREY))
"""Colour and style of the channels in turn."""

MOST = len(LINES)
"""Channels that are drawn, those that come highest."""


@style.styled
def certificate_figure(found: Certificate) -> Figure:
    """q over time in the windows in which pulses may be on; marks show where program and plan fire."""
    figure = style.sheet(7.4, 4.2)
    axes = figure.subplots()
    spans = found.moments()
    curves = [found.primer(times) for times in spans]
    channels = found.program.channels
    highest = np.max([curve.max(axis=0) for curve in curves], axis=0)
    drawn = sorted(np.argsort(-highest, kind="stable")[:MOST].tolist())
    for (colour, line), index in zip(LINES, drawn, strict=False):
        name: str | None = channels[index].name
        for times, curve in zip(spans, curves, strict=True):
            axes.plot(times, curve[:, index], color=colour, linestyle=line, linewidth=1.1, label=name)
            name = None
    for label, fired, look in _firings(found):
        places = [(t, found.primer(np.array([t]))[0, index]) for t, index in fired]
        axes.plot(*np.array(places).reshape(-1, 2).T, look, color=INK, markersize=4.5, label=label, fillstyle="none")
    axes.axhline(1.0, color=INK, linewidth=0.9, linestyle="-", label="what it costs")
    some = f" ({len(drawn)} of {len(channels)} channels)" if len(drawn) < len(channels) else ""
    axes.set(xlabel="time, s", ylabel="q: worth of a second over what it costs")
    figure.suptitle(
        f"{found.spacecraft.name}: primer curve{some}; no less than {found.proof.bound:.6g} {found.problem.unit}"
    )
    axes.set_ylim(min(-1.1, float(min(curve.min() for curve in curves)) - 0.1), max(1.25, float(highest.max()) + 0.2))
    axes.grid()
    legend(figure, [axes])
    return figure


def _firings(found: Certificate) -> list[tuple[str, list[tuple[float, int]], str]]:
    """Moments, s, and channels at which the program and the plan fire, with name and mark."""
    names = [channel.name for channel in found.program.channels]
    program = [(burn.t, names.index(burn.channel.name)) for burn in found.burns]
    plan = [(pulse.t, names.index(pulse.channel)) for pulse in found.plan.pulses]
    return [("the program fires", program, "o"), ("the plan fires", plan, "x")]
