"""Figures of studies and of loops: distributions, final H, tornado, firings."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Rectangle, StepPatch
from support.builders import aimed, spinner
from support.cases import deep, weekly
from support.colours import check_colours
from support.compared_body import BODY, REQUIRED, TOLERANCES, line
from support.dispersed import jet, normal
from support.golden import check_text
from support.layout import check_layout, texts
from support.shown import heading, legend_words, studied

from nutdamp.control_loop.dispersion import LoopResults, loop_study
from nutdamp.control_loop.dispersion import run as run_loops
from nutdamp.control_loop.evaluation import loop_of
from nutdamp.figures import dispersion
from nutdamp.figures.history import BAR
from nutdamp.figures.loop import loop_figure
from nutdamp.figures.loop_cases import loop_cases_figure
from nutdamp.montecarlo.statistics import OUTPUTS, Exact
from nutdamp.montecarlo.study import Results
from nutdamp.page.pictures import dispersion_pictures_of
from nutdamp.spacecraft.equipment import Channel, Loop, Sensor, Steerable
from nutdamp.spacecraft.model import Requirement, Spacecraft
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance
from nutdamp.views.tolerances import budget_rows, in_words

pytestmark = pytest.mark.usefixtures("plans_shared")

POINTED = replace(
    aimed(spinner(steerable=Steerable(50.0), requirement=REQUIRED), 10.0, 30.0),
    dispersions=replace(TOLERANCES, thrust={}),
)
NAMES = ("overview", "cases", "momentum", "budget")
OFFSET = Tolerance("bias", 0.01)


@cache
def study(which: str = "shift") -> Results:
    return studied(BODY if which == "shift" else POINTED, 3000)


@cache
def drawn(name: str, which: str = "shift") -> Figure:
    return dispersion.dispersion_figure(name, study(which), scheme="two-pulse")


@pytest.mark.deep
@pytest.mark.parametrize(
    ("name", "which"), [*((name, "shift") for name in NAMES), *(weekly(name, "target") for name in NAMES)]
)
def test_studies_are_drawn_whole_seen_on_any_page_and_say_what_is_met(name: str, which: str) -> None:
    check_layout(drawn(name, which))
    check_colours(drawn(name, which))
    check_text(f"pictures.study-{which}", heading(drawn(name, which)))


@pytest.mark.deep
@pytest.mark.parametrize("which", ["shift", weekly("target")])
def test_histograms_and_cases_beyond_reach_the_last_case(which: str) -> None:
    """One of 3,000 lies beyond the last but one, as far as the maximum; the scale is that of the histogram beside."""
    results = study(which)
    assert results.values is not None
    axes = drawn("cases", which).axes
    outputs = ("nutation", "momentum_shift" if which == "shift" else "axis_error")
    for histogram, function, output in zip(axes[::2], axes[1::2], outputs, strict=True):
        values = np.sort(np.degrees(results.values[OUTPUTS.index(output)]))
        (stairs,) = (patch for patch in histogram.patches if isinstance(patch, StepPatch))
        heights, edges, _ = stairs.get_data()
        assert edges[-1] == pytest.approx(values[-1])
        assert float(np.sum(heights)) == pytest.approx(100.0)
        assert histogram.get_xlim()[1] >= edges[-1]
        assert function.get_xlim() == histogram.get_xlim()
        places, shares = line(function, "cases").T
        assert places[-3:] == pytest.approx([values[-2], values[-1], values[-1]], rel=1e-3)
        assert shares[-3:-1] == pytest.approx([100.0 / len(values)] * 2)
        assert shares[-1] < function.get_ylim()[0] < shares[-2]
        for place, beyond in zip(places[:-1:7], shares[:-1:7], strict=True):
            assert 100.0 * np.mean(values > place * (1.0 + 1e-9)) == pytest.approx(beyond, abs=100.5 / len(values))


def test_a_histogram_with_a_long_tail_reaches_its_end_on_a_log_axis() -> None:
    values = np.append(np.random.default_rng(1).random(99_990), np.full(10, 50.0)) * math.radians(1.0)
    axes = Figure().subplots()
    dispersion._histogram(axes, Exact(values), "nutation left", None)
    assert axes.get_xscale() == "log"
    assert "log axis" in axes.get_title()
    (stairs,) = (patch for patch in axes.patches if isinstance(patch, StepPatch))
    shares, edges, _ = stairs.get_data()
    assert edges[-1] == pytest.approx(50.0)
    assert float(np.sum(shares)) == pytest.approx(100.0)
    assert shares[-1] == pytest.approx(0.01)


@pytest.mark.deep
@pytest.mark.parametrize("bias", [0.0, 0.01])
def test_cases_that_are_all_alike_are_told_in_words(bias: float) -> None:
    """A histogram of rounding is an empty panel with ticks of 1e-13 degrees."""
    still = Dispersions(timing=Tolerance("uniform", 1e-15), timing_offset=OFFSET if bias else None)
    results = studied(replace(BODY, dispersions=still), 50)
    figure = dispersion.dispersion_figure("cases", results, scheme="two-pulse")
    check_layout(figure)
    most = results.distribution("nutation")
    assert most is not None
    left = math.degrees(most.maximum)
    assert (left >= 1e-6) == bool(bias)
    said = f"all 50 cases:\n{f'{left:.4g}°' if bias else 'below 1e-6°'}, required 0.5°"
    for axes in figure.axes[:2]:
        assert [text.get_text() for text in axes.texts] == [said]
        assert not len(axes.get_xticks())
        assert not axes.lines


@pytest.mark.deep
@pytest.mark.parametrize("size", [0.0005, 0.001])
def test_the_ticks_of_small_shifts_keep_apart(size: float) -> None:
    thrust = dict.fromkeys(TOLERANCES.thrust, Tolerance("normal", size, relative=True))
    body = replace(BODY, dispersions=Dispersions(thrust=thrust, timing=Tolerance("uniform", 0.05 * size)))
    figure = dispersion.dispersion_figure("momentum", studied(body, 500), scheme="two-pulse")
    check_layout(figure)
    assert "the 500 cases" in legend_words(figure)
    ticks = figure.axes[0].get_xticklabels()
    boxes = sorted((box for text, box in texts(figure) if text in ticks), key=lambda box: float(box[0]))
    assert len(boxes) >= 3
    assert min(float(right[0] - left[2]) * 72.0 / figure.dpi for left, right in pairwise(boxes)) > 4.0


@pytest.mark.deep
@pytest.mark.parametrize(("which", "output"), [("shift", "momentum_shift"), ("target", "axis_error")])
def test_final_h_lies_as_far_out_as_the_table_says(which: str, output: str) -> None:
    results = study(which)
    assert results.values is not None
    cases = dispersion.momentum_cases(results)
    away = np.degrees(results.values[OUTPUTS.index(output)])
    assert np.hypot(*cases.T) == pytest.approx(away, rel=1e-6, abs=1e-9)
    axes = drawn("momentum", which).axes[0]
    (dots,) = (patch for patch in axes.patches if isinstance(patch, PathPatch))
    assert np.asarray(dots.get_path().vertices)[::2] == pytest.approx(cases[: dispersion.DOTS])
    required = line(axes, "required")
    assert np.hypot(*required.T) == pytest.approx(np.full(len(required), 0.2))
    assert axes.get_aspect() == 1.0
    left, right = axes.get_xlim()
    assert left < cases[:, 0].min() <= cases[:, 0].max() < right
    assert "2,000 of the 3,000 cases" in legend_words(drawn("momentum", which))


def test_the_ellipse_holds_its_share_and_is_that_of_the_covariance() -> None:
    points = np.random.default_rng(2).multivariate_normal([1.0, -2.0], [[4.0, 1.5], [1.5, 1.0]], 100_000)
    inverse = np.linalg.inv(np.cov(points.T))
    for share in (0.5, 0.9, 0.997):
        rim, inside = (rows - points.mean(axis=0) for rows in (dispersion.ellipse(points, share), points))
        sizes = np.sqrt(np.einsum("ij,jk,ik->i", rim, inverse, rim))
        assert np.ptp(sizes) < 1e-6 * sizes[0]
        # Rayleigh: of normal cases this share lies within.
        assert sizes[0] == pytest.approx(math.sqrt(-2.0 * math.log(1.0 - share)), rel=0.02)
        within = np.einsum("ij,jk,ik->i", inside, inverse, inside) <= sizes[0] ** 2
        assert within.mean() == pytest.approx(share, abs=1e-4)
    assert (dispersion.ellipse(np.zeros((5, 2)), 0.997) == 0.0).all()


@pytest.mark.deep
def test_the_tornado_has_the_rows_and_effects_of_the_table_and_says_what_they_are() -> None:
    results = study()
    rows = budget_rows(results.study)
    first, figure = results.study.first_order, drawn("budget")
    names = [entry.name for entry in first.inputs]
    titles = []
    for axes, output in zip(figure.axes, ("nutation", "momentum_shift"), strict=True):
        effects = np.degrees(first.effects(output))
        assert len(axes.patches) == len(rows)
        lengths = []
        labels = [text.get_text() for text in axes.get_yticklabels()]
        for bar, label in zip(axes.patches, labels, strict=True):
            (row,) = (one for one in rows if label == (f"{one.name}, {one.size}" if one.size else one.name))
            lengths.append(float(bar.get_extents().transformed(axes.transData.inverted()).x1))
            assert lengths[-1] == pytest.approx(math.sqrt(sum(float(effects[index]) ** 2 for index in row.inputs)))
            if len(row.inputs) == 1:
                assert row.name == in_words(names[row.inputs[0]])
            assert (bar.get_hatch() == "////") == (bar.get_label() == "bias, not one sigma") == row.bias
        assert any(label.startswith("A, ") for label in labels)
        # On each side the largest is on top; what has no name of its own comes last.
        named = lengths[:-1] if labels[-1].endswith(" others") else lengths
        assert named == sorted(named, reverse=True)
        assert axes.get_yticks()[0] == max(axes.get_yticks())
        titles.append(" ".join(axes.get_title().split()))
    assert sorted(index for row in rows for index in row.inputs) == list(range(len(names)))
    check_text("pictures.tornado", "\n".join(titles))
    assert "bias, not one sigma" in legend_words(figure)


@pytest.mark.deep
@pytest.mark.parametrize("name", ["budget", *map(weekly, NAMES[:3])])
def test_nothing_that_varies_is_an_empty_tornado(name: str) -> None:
    results = studied(replace(BODY, dispersions=Dispersions(timing_offset=OFFSET)), 50)
    check_layout(dispersion.dispersion_figure(name, results, scheme="two-pulse"))


@pytest.mark.deep
@pytest.mark.parametrize(
    ("required", "biased"),
    [(None, False), (Requirement(nutation=0.01), True), (Requirement(nutation=0.01, momentum_shift=0.01), False)],
)
def test_captions_name_no_bias_and_no_bound_that_is_not_drawn(required: Requirement | None, biased: bool) -> None:
    varied = Dispersions(A=Tolerance("normal", 0.02, relative=True), timing_offset=OFFSET if biased else None)
    results = studied(replace(BODY, requirement=required, dispersions=varied), 50)
    _, momentum, budget = dispersion_pictures_of(results, "two-pulse")
    assert ("required" in momentum.caption) == (required is not None and required.momentum_shift is not None)
    assert ("bias" in budget.caption) == biased


# --- loops -----------------------------------------------------------------------------------------------------------


def looping(requirement: Requirement | None = None) -> Spacecraft:
    forces = {"+M1": (0.0, -9.0, 0.0), "-M1": (0.0, 9.0, 0.0), "+M2": (9.0, 0.0, 0.0), "-M2": (-9.0, 0.0, 0.0)}
    channels = tuple(
        Channel(name, (replace(jet(name, (0.0, 0.0, 0.8), force), min_on_time=0.02, max_on_time=0.3),))
        for name, force in forces.items()
    )
    loop = Loop(Sensor(rate=20.0), start=math.radians(0.5), stop=math.radians(0.05))
    dispersions = Dispersions(omega0=(normal(0.004),) * 3)
    return replace(spinner(channels=channels), loop=loop, dispersions=dispersions, requirement=requirement)


@pytest.mark.deep
def test_numbers_of_firings_do_not_touch_the_bars_of_the_row_above() -> None:
    figure = loop_figure(loop_of(looping(), 60.0))
    check_layout(figure)
    fired = figure.axes[2]
    assert len(fired.get_yticks()) == 4
    assert all(re.fullmatch(r"[\d–-]*", text.get_text()) for text in fired.texts)
    numbers = [text.get_window_extent() for text in fired.texts if text.get_text()]
    assert numbers
    for number in numbers:
        (_, row), (_, above) = fired.transData.inverted().transform([(0.0, number.y0), (0.0, number.y1)])
        bottom = fired.transData.transform((0.0, math.ceil(row) - 0.5 * BAR))[1]
        assert math.ceil(above) == math.ceil(row)
        assert 72.0 / figure.dpi * (bottom - number.y1) > 3.0


@pytest.mark.parametrize(("most", "beside"), [deep(1e-3, True), deep(80.0, False)])
def test_dispersed_loops_show_the_shift_that_is_required(most: float, beside: bool) -> None:
    body = looping(Requirement(momentum_shift=math.radians(most)))
    results = run_loops(LoopResults(loop_study(body, 60.0), 20))
    figure = loop_cases_figure(results)
    check_layout(figure)
    panels = {axes.get_xlabel(): axes for axes in figure.axes}
    for name, output, scale in (
        ("first quiet, s", "settled", 1.0),
        ("left then, deg", "quiet", 180.0 / math.pi),
        ("propellant, g", "propellant", 1e3),
    ):
        bars, values = [one for one in panels[name].patches if isinstance(one, Rectangle)], scale * results.of(output)
        assert sum(one.get_height() for one in bars) == len(values)
        ends = [bars[0].get_x(), bars[-1].get_x() + bars[-1].get_width()]
        assert ends == pytest.approx([values.min(), values.max()]) or values.min() == values.max()
    shift = panels["shift of H, deg"]
    levels = [float(np.asarray(one.get_xdata())[0]) for one in shift.lines if one.get_label() == "required"]
    assert levels == ([pytest.approx(most)] if beside else [])
    assert ("outside the view" in shift.get_title()) is not beside
