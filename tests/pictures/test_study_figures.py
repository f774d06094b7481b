"""Figures of studies: distributions, final H, tornado."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, StepPatch
from support.builders import aimed, spinner
from support.cases import spread
from support.colours import check_colours
from support.compared_body import BODY, REQUIRED, TOLERANCES, line
from support.layout import check_layout, texts

from nutdamp import dispersion, planning
from nutdamp.dispersion.outputs import OUTPUTS
from nutdamp.dispersion.statistics import Exact
from nutdamp.dispersion.study import Results, run
from nutdamp.presentation import figures
from nutdamp.presentation.figures import dispersion as drawing
from nutdamp.presentation.tolerance_tables import budget_rows, in_words
from nutdamp.spacecraft import Steerable
from nutdamp.tolerances import Dispersions, Tolerance

pytestmark = pytest.mark.usefixtures("plans_shared")

POINTED = replace(
    aimed(spinner(steerable=Steerable(50.0), requirement=REQUIRED), 10.0, 30.0),
    dispersions=replace(TOLERANCES, thrust={}),
)
NAMES = ("overview", "cases", "momentum", "budget")


@cache
def study(which: str = "shift", count: int = 3000) -> Results:
    body = BODY if which == "shift" else POINTED
    plan = planning.plan(body, "two-pulse")
    assert plan.feasible, plan.why
    return run(Results(dispersion.study_of(body, plan.pulses), count))


@cache
def drawn(name: str, which: str = "shift") -> Figure:
    return figures.dispersion_figure(name, study(which), scheme="two-pulse")


# --- dispersed cases -------------------------------------------------------------------------------------------------


@spread("which", ["shift", "target"], quick=1)
@spread("name", NAMES, quick=1)
def test_studies_are_drawn_whole_and_say_what_is_met(name: str, which: str) -> None:
    figure = drawn(name, which)
    check_layout(figure)
    heading = " ".join(figure.get_suptitle().split())
    assert heading.startswith("test: two-pulse by real pulse widths, 3,000 dispersed cases requirement ")
    assert re.search(r"(NOT met|met): [\d.]+ % of cases comply \(99\.7 % required\)", heading)


def test_histograms_reach_the_largest_value() -> None:
    results = study()
    for axes, output in zip(drawn("cases").axes[::2], ("nutation", "momentum_shift"), strict=True):
        found = results.distribution(output)
        assert found is not None
        (stairs,) = (patch for patch in axes.patches if isinstance(patch, StepPatch))
        values, edges, _ = stairs.get_data()
        assert edges[-1] == pytest.approx(math.degrees(found.maximum))
        assert float(np.sum(values)) == pytest.approx(100.0)
        assert axes.get_xlim()[1] >= edges[-1]


def test_a_histogram_with_a_long_tail_reaches_its_end_on_a_log_axis() -> None:
    values = np.append(np.random.default_rng(1).random(99_990), np.full(10, 50.0)) * math.radians(1.0)
    axes = Figure().subplots()
    drawing._histogram(axes, Exact(values), "nutation left", None)
    assert axes.get_xscale() == "log"
    assert "log axis" in axes.get_title()
    (stairs,) = (patch for patch in axes.patches if isinstance(patch, StepPatch))
    shares, edges, _ = stairs.get_data()
    assert edges[-1] == pytest.approx(50.0)
    assert float(np.sum(shares)) == pytest.approx(100.0)
    assert shares[-1] == pytest.approx(0.01)


@spread("which", ["shift", "target"], quick=1)
def test_cases_beyond_go_down_by_steps_to_the_last_case(which: str) -> None:
    """One of 3,000 lies beyond the last but one, as far as the maximum; the scale is that of the histogram beside."""
    results = study(which)
    assert results.values is not None
    axes = drawn("cases", which).axes
    outputs = ("nutation", "momentum_shift" if which == "shift" else "axis_error")
    for histogram, function, output in zip(axes[::2], axes[1::2], outputs, strict=True):
        values = np.sort(np.degrees(results.values[OUTPUTS.index(output)]))
        drawn_values, shares = line(function, "cases").T
        assert function.get_xlim() == histogram.get_xlim()
        assert drawn_values[-3:] == pytest.approx([values[-2], values[-1], values[-1]], rel=1e-3)
        assert shares[-3:-1] == pytest.approx([100.0 / len(values)] * 2)
        assert shares[-1] < function.get_ylim()[0] < shares[-2]
        for place, beyond in zip(drawn_values[:-1:7], shares[:-1:7], strict=True):
            assert 100.0 * np.mean(values > place * (1.0 + 1e-9)) == pytest.approx(beyond, abs=100.5 / len(values))


STILL = replace(BODY, dispersions=Dispersions(timing=Tolerance("uniform", 1e-15)))


@spread("bias", [0.0, 0.01], quick=1)
def test_cases_that_are_all_alike_are_told_in_words(bias: float) -> None:
    """A histogram of rounding is an empty panel with ticks of 1e-13 degrees."""
    dispersions = replace(STILL.dispersions or Dispersions(), timing_offset=Tolerance("bias", bias) if bias else None)
    body = replace(STILL, dispersions=dispersions)
    made = dispersion.study_of(body, planning.plan(body, "two-pulse").pulses)
    results = run(Results(made, 50))
    figure = figures.dispersion_figure("cases", results, scheme="two-pulse")
    check_layout(figure)
    most = results.distribution("nutation")
    assert most is not None
    left = math.degrees(most.maximum)
    expected = f"{left:.4g}°" if left >= 1e-6 else "below 1e-6°"
    for axes in figure.axes[:2]:
        assert [text.get_text() for text in axes.texts] == [f"all 50 cases:\n{expected}, required 0.5°"]
        assert not len(axes.get_xticks())
        assert not axes.lines
    assert (left >= 1e-6) == bool(bias)


@pytest.mark.deep
def test_the_tornado_says_what_its_bars_are_of() -> None:
    for name in ("budget", "overview"):
        nutation, shift = (" ".join(axes.get_title().split()) for axes in drawn(name).axes[-2:])
        assert nutation == "nutation: one sigma of each input alone required 0.5°, outside the view"
        assert shift == "shift of H: one sigma of each input alone required 0.2°, outside the view"
        legends = [one for part in (drawn(name), *drawn(name).subfigs) for one in part.legends]
        assert "bias, not one sigma" in {text.get_text() for one in legends for text in one.get_texts()}
        for axes in drawn(name).axes[-2:]:  # each can stand alone
            assert len([text for text in axes.get_yticklabels() if text.get_text()]) == len(axes.patches)


def test_the_cloud_says_how_many_of_how_many_cases_it_shows() -> None:
    for count, words in ((3000, "2,000 of the 3,000 cases"), (500, "the 500 cases")):
        figure = figures.dispersion_figure("momentum", study("shift", count), scheme="two-pulse")
        assert words in {text.get_text() for text in figure.legends[0].get_texts()}


@pytest.mark.parametrize("size", [0.0005, 0.001])
def test_the_ticks_of_small_shifts_keep_apart(size: float) -> None:
    thrust = dict.fromkeys(TOLERANCES.thrust, Tolerance("normal", size, relative=True))
    body = replace(BODY, dispersions=Dispersions(thrust=thrust, timing=Tolerance("uniform", 0.05 * size)))
    found = run(Results(dispersion.study_of(body, planning.plan(body, "two-pulse").pulses), 500))
    figure = figures.dispersion_figure("momentum", found, scheme="two-pulse")
    check_layout(figure)
    ticks = figure.axes[0].get_xticklabels()
    boxes = sorted((box for text, box in texts(figure) if text in ticks), key=lambda box: float(box[0]))
    assert len(boxes) >= 3
    gaps = [float(right[0] - left[2]) * 72.0 / figure.dpi for left, right in pairwise(boxes)]
    assert min(gaps) > 4.0


@pytest.mark.parametrize(("which", "output"), [("shift", "momentum_shift"), ("target", "axis_error")])
def test_final_h_lies_as_far_out_as_the_table_says(which: str, output: str) -> None:
    results = study(which)
    assert results.values is not None
    points = drawing.momentum_cases(results)
    away = np.degrees(results.values[OUTPUTS.index(output)])
    assert np.hypot(*points.T) == pytest.approx(away, rel=1e-6, abs=1e-9)
    axes = drawn("momentum", which).axes[0]
    (dots,) = (patch for patch in axes.patches if isinstance(patch, PathPatch))
    assert np.asarray(dots.get_path().vertices)[::2] == pytest.approx(points[: drawing.DOTS])
    required = line(axes, "required")
    assert np.hypot(*required.T) == pytest.approx(np.full(len(required), 0.2))
    assert axes.get_aspect() == 1.0
    left, right = axes.get_xlim()
    assert left < points[:, 0].min()
    assert right > points[:, 0].max()


def test_the_ellipse_holds_its_share_and_is_that_of_the_covariance() -> None:
    points = np.random.default_rng(2).multivariate_normal([1.0, -2.0], [[4.0, 1.5], [1.5, 1.0]], 100_000)
    for share in (0.5, 0.9, 0.997):
        rim = drawing.ellipse(points, share)
        axes = np.linalg.inv(np.cov(points.T))
        off = rim - points.mean(axis=0)
        sizes = np.sqrt(np.einsum("ij,jk,ik->i", off, axes, off))
        assert np.ptp(sizes) < 1e-6 * sizes[0]
        # Rayleigh: of normal cases this share lies within.
        assert sizes[0] == pytest.approx(math.sqrt(-2.0 * math.log(1.0 - share)), rel=0.02)
        inside = points - points.mean(axis=0)
        within = np.einsum("ij,jk,ik->i", inside, axes, inside) <= sizes[0] ** 2
        assert within.mean() == pytest.approx(share, abs=1e-4)
    still = drawing.ellipse(np.zeros((5, 2)), 0.997)
    assert (still == 0.0).all()


def test_the_tornado_has_the_rows_and_effects_of_the_table() -> None:
    results = study()
    rows = budget_rows(results.study)
    first, figure = results.study.first_order, drawn("budget")
    names = [entry.name for entry in first.inputs]
    for axes, output in zip(figure.axes, ("nutation", "momentum_shift"), strict=True):
        effects = np.degrees(first.effects(output))
        assert len(axes.patches) == len(rows)
        lengths = []
        for bar, label in zip(axes.patches, axes.get_yticklabels(), strict=True):
            (row,) = (one for one in rows if label.get_text() == (f"{one.name}, {one.size}" if one.size else one.name))
            lengths.append(float(bar.get_extents().transformed(axes.transData.inverted()).x1))
            expected = math.sqrt(sum(float(effects[index]) ** 2 for index in row.inputs))
            assert lengths[-1] == pytest.approx(expected)
            if len(row.inputs) == 1:
                assert row.name == in_words(names[row.inputs[0]])
            assert (bar.get_hatch() == "////") == row.bias
            assert (bar.get_label() == "bias, not one sigma") == row.bias
        labels = [text.get_text() for text in axes.get_yticklabels()]
        assert any(label.startswith("A, ") for label in labels)
        # On each side the largest is on top; what has no name of its own comes last.
        named = lengths[:-1] if labels[-1].endswith(" others") else lengths
        assert named == sorted(named, reverse=True)
        assert axes.get_yticks()[0] == max(axes.get_yticks())
    assert sorted(index for row in rows for index in row.inputs) == list(range(len(names)))


def test_nothing_that_varies_is_an_empty_tornado() -> None:
    body = replace(BODY, dispersions=Dispersions(timing_offset=Tolerance("bias", 0.01)))
    results = run(Results(dispersion.study_of(body, planning.plan(body, "two-pulse").pulses), 50))
    for name in NAMES:
        check_layout(figures.dispersion_figure(name, results, scheme="two-pulse"))


# --- colours ---------------------------------------------------------------------------------------------------------


@pytest.mark.deep
def test_studies_can_be_seen_on_white_and_in_the_dark() -> None:
    for name in NAMES:
        check_colours(drawn(name))
