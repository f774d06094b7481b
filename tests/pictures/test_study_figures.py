"""Figures of studies and of loops: distributions, final H, firings."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from support.builders import aimed, spinner
from support.cases import deep, weekly
from support.colours import check_colours
from support.compared_body import BODY, REQUIRED, TOLERANCES, line
from support.dispersed import jet, normal
from support.layout import check_layout, texts
from support.shown import heading, legend_words, studied

from nutdamp.control_loop.dispersion import LoopDispersion, LoopResults, loop_study
from nutdamp.control_loop.dispersion import run as run_loops
from nutdamp.control_loop.evaluation import loop_of
from nutdamp.figures import studies
from nutdamp.figures.overview import BAR
from nutdamp.figures.signals import first_seconds, loop_figure
from nutdamp.montecarlo.statistics import OUTPUTS, Exact
from nutdamp.page.report import dispersion_pictures
from nutdamp.planning.screening import Dispersion
from nutdamp.planning.verdict import Status
from nutdamp.spacecraft.equipment import Channel, Loop, Sensor, Steerable
from nutdamp.spacecraft.model import Requirement, Spacecraft
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance
from nutdamp.views.verdict import lead, statement

pytestmark = pytest.mark.usefixtures("plans_shared")

POINTED = replace(
    aimed(spinner(steerable=Steerable(50.0), requirement=REQUIRED), 10.0, 30.0),
    dispersions=replace(TOLERANCES, thrust={}),
)
NAMES = ("overview", "cases", "momentum")
OFFSET = Tolerance("bias", 0.01)


@cache
def study(which: str = "shift") -> Dispersion:
    return studied(BODY if which == "shift" else POINTED, 3000)


@cache
def drawn(name: str, which: str = "shift") -> Figure:
    return studies.dispersion_figure(study(which), name)


@pytest.mark.deep
@pytest.mark.parametrize(
    ("name", "which"), [*((name, "shift") for name in NAMES), *(weekly(name, "target") for name in NAMES)]
)
def test_studies_are_drawn_whole_seen_on_any_page_and_say_what_is_met(name: str, which: str) -> None:
    check_layout(drawn(name, which))
    check_colours(drawn(name, which))
    verdict = study(which).verdict
    assert verdict.status is Status.NOT_ENOUGH
    assert heading(drawn(name, which)).endswith(f" {lead(verdict)}: {statement(verdict)}")


@pytest.mark.deep
@pytest.mark.parametrize("which", ["shift", weekly("target")])
def test_curves_hold_all_cases(which: str) -> None:
    """The curve is the share of cases within a value; a point on it is that of the requirement."""
    results = study(which).core
    assert results.values is not None
    outputs = ("nutation", "momentum_shift" if which == "shift" else "axis_error")
    for axes, output in zip(drawn("cases", which).axes, outputs, strict=True):
        values = np.sort(np.degrees(results.values[OUTPUTS.index(output)]))
        assert not axes.patches
        places, shares = line(axes, "cases within").T
        assert (places[-1], shares[-1]) == (pytest.approx(values[-1]), 100.0)
        for place, share in zip(places[::37], shares[::37], strict=True):
            assert 100.0 * np.mean(values <= place * (1.0 + 1e-9)) == pytest.approx(share, abs=200.0 / len(values))
        (dot,) = (one for one in axes.lines if one.get_marker() == "o")
        assert np.asarray(dot.get_xydata())[0] == pytest.approx([np.quantile(values, 0.997), 99.7], rel=0.02)


def test_a_curve_with_a_long_tail_reaches_its_end_on_a_log_axis() -> None:
    """Which begins at the least value, or six decades before the largest."""
    values = np.append(np.random.default_rng(1).random(99_990), np.full(10, 50.0)) * math.radians(1.0)
    axes = Figure().subplots()
    studies.draw_distribution(axes, Exact(values), "nutation left, °", None)
    assert axes.get_xscale() == "log"
    assert axes.get_xlabel() == "nutation left, ° (log)"
    left, right = axes.get_xlim()
    assert left == pytest.approx(max(math.degrees(values.min()), 50e-6))
    assert line(axes, "cases within")[-1] == pytest.approx([50.0, 100.0])
    assert right > 50.0


@pytest.mark.deep
@pytest.mark.parametrize("bias", [0.0, 0.01])
def test_cases_that_are_all_alike_are_told_in_words(bias: float) -> None:
    """A curve of rounding is an empty panel with ticks of 1e-13 degrees."""
    still = Dispersions(timing=Tolerance("uniform", 1e-15), timing_offset=OFFSET if bias else None)
    results = studied(replace(BODY, dispersions=still), 50)
    figure = studies.dispersion_figure(results, "cases")
    check_layout(figure)
    for axes, output, required in zip(figure.axes, ("nutation", "momentum_shift"), (0.5, 0.2), strict=True):
        most = results.core.distribution(output)
        assert most is not None
        left = math.degrees(most.maximum)
        assert (left >= 1e-6) == bool(bias)
        said = f"all 50 cases:\n{f'{left:#.3g}°' if bias else 'below 1e-6°'}, required {required:.3f}°"
        assert [text.get_text() for text in axes.texts] == [said]
        assert not len(axes.get_xticks())
        assert not axes.lines


@pytest.mark.deep
@pytest.mark.parametrize("size", [0.0005, 0.001])
def test_the_ticks_of_small_shifts_keep_apart(size: float) -> None:
    thrust = dict.fromkeys(TOLERANCES.thrust, Tolerance("normal", size, relative=True))
    body = replace(BODY, dispersions=Dispersions(thrust=thrust, timing=Tolerance("uniform", 0.05 * size)))
    figure = studies.dispersion_figure(studied(body, 500), "momentum")
    check_layout(figure)
    assert "the 500 cases" in legend_words(figure)
    ticks = figure.axes[0].get_xticklabels()
    boxes = sorted((box for text, box in texts(figure) if text in ticks), key=lambda box: float(box[0]))
    assert len(boxes) >= 3
    assert min(float(right[0] - left[2]) * 72.0 / figure.dpi for left, right in pairwise(boxes)) > 4.0


@pytest.mark.deep
@pytest.mark.parametrize(("which", "output"), [("shift", "momentum_shift"), ("target", "axis_error")])
def test_final_h_lies_as_far_out_as_the_table_says(which: str, output: str) -> None:
    results = study(which).core
    assert results.values is not None
    cases = studies.momentum_cases(results)
    away = np.degrees(results.values[OUTPUTS.index(output)])
    assert np.hypot(*cases.T) == pytest.approx(away, rel=1e-6, abs=1e-9)
    axes = drawn("momentum", which).axes[0]
    (dots,) = (patch for patch in axes.patches if isinstance(patch, PathPatch))
    assert np.asarray(dots.get_path().vertices)[::2] == pytest.approx(cases[: studies.DOTS])
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
        rim, inside = (rows - points.mean(axis=0) for rows in (studies.ellipse(points, share), points))
        sizes = np.sqrt(np.einsum("ij,jk,ik->i", rim, inverse, rim))
        assert np.ptp(sizes) < 1e-6 * sizes[0]
        # Rayleigh: of normal cases this share lies within.
        assert sizes[0] == pytest.approx(math.sqrt(-2.0 * math.log(1.0 - share)), rel=0.02)
        within = np.einsum("ij,jk,ik->i", inside, inverse, inside) <= sizes[0] ** 2
        assert within.mean() == pytest.approx(share, abs=1e-4)
    assert (studies.ellipse(np.zeros((5, 2)), 0.997) == 0.0).all()


@pytest.mark.deep
@pytest.mark.parametrize("name", ["overview", *map(weekly, NAMES[1:])])
def test_nothing_that_varies_is_drawn(name: str) -> None:
    results = studied(replace(BODY, dispersions=Dispersions(timing_offset=OFFSET)), 50)
    check_layout(studies.dispersion_figure(results, name))


@pytest.mark.deep
@pytest.mark.parametrize("required", [None, Requirement(nutation=0.01), Requirement(0.01, momentum_shift=0.01)])
def test_captions_name_no_bound_that_is_not_drawn(required: Requirement | None) -> None:
    varied = Dispersions(A=Tolerance("normal", 0.02, relative=True))
    results = studied(replace(BODY, requirement=required, dispersions=varied), 50)
    _, momentum = dispersion_pictures(results)
    assert "required" not in momentum.caption  # the circle of a requirement may lie outside the picture


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
    fired = next(axes for axes in figure.axes if not axes.get_ylabel())
    assert len(fired.get_yticks()) == 4
    assert all(re.fullmatch(r"[\d–: .s]*", text.get_text()) for text in fired.texts)
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
    figure = studies.loop_cases_figure(LoopDispersion(results))
    check_layout(figure)
    nutation, shift = figure.axes
    assert line(nutation, "cases within")[-1] == pytest.approx([np.degrees(results.of("nutation").max()), 100.0])
    levels = [float(np.asarray(one.get_xdata())[0]) for one in shift.lines if one.get_label() == "required"]
    assert levels == ([pytest.approx(most)] if beside else [])
    assert f"required {most:#.3g}".rstrip(".") in shift.get_title()


@pytest.mark.deep
def test_the_first_seconds_of_a_long_run_are_enlarged() -> None:
    plan = loop_of(looping(), 400.0)
    figure = loop_figure(plan)
    check_layout(figure)
    whole, first = figure.axes[:2]
    assert whole.get_xlim()[1] == pytest.approx(400.0)
    assert first.get_xlim()[1] == pytest.approx(first_seconds(plan))
    assert figure.axes[1].get_title() == f"The first {first_seconds(plan):#.3g} s"
