"""Figures of loops: firings apart from the numbers of others, and what a verdict rests on."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from support.builders import spinner
from support.cases import spread
from support.dispersed import jet, normal
from support.layout import check_layout

from nutdamp.loop.plan import loop_of
from nutdamp.loop.study import LoopResults, loop_study, run
from nutdamp.loop_settings import Loop, Sensor
from nutdamp.presentation.figures.history import BAR
from nutdamp.presentation.figures.loop import loop_figure
from nutdamp.presentation.figures.loop_cases import loop_cases_figure
from nutdamp.spacecraft import Channel, Requirement, Spacecraft
from nutdamp.tolerances import Dispersions

pytestmark = pytest.mark.usefixtures("plans_shared")

JETS = {
    "+M1": ((0.0, 0.0, 0.8), (0.0, -9.0, 0.0)),
    "-M1": ((0.0, 0.0, 0.8), (0.0, 9.0, 0.0)),
    "+M2": ((0.0, 0.0, 0.8), (9.0, 0.0, 0.0)),
    "-M2": ((0.0, 0.0, 0.8), (-9.0, 0.0, 0.0)),
}


def craft(requirement: Requirement | None = None) -> Spacecraft:
    channels = tuple(
        Channel(name, (replace(jet(name, *one), min_on_time=0.02, max_on_time=0.3),)) for name, one in JETS.items()
    )
    loop = Loop(Sensor(rate=20.0), start=math.radians(0.5), stop=math.radians(0.05))
    dispersions = Dispersions(omega0=(normal(0.004),) * 3)
    return replace(spinner(channels=channels), loop=loop, dispersions=dispersions, requirement=requirement)


def test_numbers_of_firings_do_not_touch_the_bars_of_the_row_above() -> None:
    figure = loop_figure(loop_of(craft(), 60.0))
    check_layout(figure)
    fired = figure.axes[2]
    assert len(fired.get_yticks()) == 4
    numbers = [text.get_window_extent() for text in fired.texts if text.get_text()]
    assert numbers
    points = 72.0 / figure.dpi
    for number in numbers:
        (_, row), (_, above) = fired.transData.inverted().transform([(0.0, number.y0), (0.0, number.y1)])
        bottom = fired.transData.transform((0.0, math.ceil(row) - 0.5 * BAR))[1]
        assert math.ceil(above) == math.ceil(row)
        assert points * (bottom - number.y1) > 3.0


@spread(("most", "beside"), [(1e-3, True), (80.0, False)], quick=1)
def test_dispersed_loops_show_the_shift_that_is_required(most: float, beside: bool) -> None:
    body = craft(Requirement(momentum_shift=math.radians(most)))
    results = run(LoopResults(loop_study(body, 60.0), 20))
    figure = loop_cases_figure(results)
    check_layout(figure)
    (shift,) = (axes for axes in figure.axes if axes.get_xlabel() == "shift of H, deg")
    drawn = [float(line.get_xdata()[0]) for line in shift.lines if line.get_label() == "required"]  # type: ignore[index,arg-type]
    assert drawn == ([pytest.approx(most)] if beside else [])
    assert ("outside the view" in shift.get_title()) is not beside
