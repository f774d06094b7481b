"""Dot plots of the schemes beside each other."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from support.builders import spinner
from support.cases import spread
from support.colours import check_colours
from support.compared_body import BODY, compared, line
from support.layout import check_layout

from nutdamp import dispersion, planning
from nutdamp.comparison import Comparison, compare
from nutdamp.decision import cases_of, decide
from nutdamp.demands import Keep
from nutdamp.dispersion.study import Results, run
from nutdamp.fronts import Point
from nutdamp.planning import Plan
from nutdamp.presentation import figures
from nutdamp.presentation.figures import schemes
from nutdamp.presentation.figures.style import PULSE
from nutdamp.presentation.trade_tables import fails
from nutdamp.recommendation import Standing
from nutdamp.schedule import Schedule

pytestmark = pytest.mark.usefixtures("plans_shared")


def column(figure: Figure, name: str) -> Axes:
    (found,) = (axes for axes in figure.axes if axes.get_xlabel().startswith(name))
    return found


def dots(axes: Axes) -> dict[str, tuple[float, str, bool]]:
    """By scheme: where the dot stands, its mark, whether it is filled."""
    rows = dict(zip(axes.get_yticks(), (text.get_text() for text in axes.get_yticklabels()), strict=True))
    found = {}
    for one in axes.lines:
        if str(one.get_marker()) in "o<xX" and len(np.asarray(one.get_xdata())) == 1:
            x, y = np.asarray(one.get_xydata())[0]
            scheme = rows[y].partition("\n")[0]
            found[scheme] = float(x), str(one.get_marker()), one.get_markerfacecolor() == one.get_color()
    return found


@pytest.mark.deep
def test_dots_stand_at_the_numbers_of_the_comparison() -> None:
    figure = figures.schemes_figure(compared())
    check_layout(figure)
    plans = compared().plans
    ends, impulses = dots(column(figure, "end")), dots(column(figure, "impulse"))
    for plan in plans:
        assert ends[plan.scheme][0] == pytest.approx(plan.end)
        assert impulses[plan.scheme][0] == pytest.approx(plan.total_impulse)
        if plan.meets_requirement:
            assert ends[plan.scheme][1] == "o"
            assert ends[plan.scheme][2] == (plan is compared().recommended)
    for name, part in (("nutation", "nutation"), ("shift of H", "momentum_shift")):
        axes = column(figure, name)
        assert axes.get_xscale() == "log"
        for plan in plans:
            left = math.degrees(getattr(plan.flown, part))
            place, mark, _ = dots(axes)[plan.scheme]
            if place == pytest.approx(axes.get_xlim()[0]):
                assert left < place
                assert mark in "<xX"
            else:
                assert place == pytest.approx(left)
            shown = [note.get_text() for note in axes.texts]
            assert (f"{left:#.4g}" if left >= 1e-9 else "< 1e-9") in shown


@spread("required", [True, False], quick=1)
def test_schemes_that_fall_short_are_not_taken_for_the_cheapest(required: bool) -> None:
    """They stand at the foot under another mark, and say so: half of a schedule takes half of the impulse."""
    body = BODY if required else replace(BODY, requirement=None)
    whole = planning.plan(body, "two-pulse")
    found = Comparison(
        body, (Plan(body, "half", Schedule(whole.pulses.pulses[:1])), whole, planning.plan(body, "optimal"))
    )
    short = {plan.scheme for plan in found.plans if plan.feasible and plan.standing is Standing.MISSES}
    assert short == {"half"}
    figure = figures.schemes_figure(found)
    check_layout(figure)
    words = "NOT met: nutation and shift of H" if required else "does not damp"
    left = min(axes.get_position().x0 for axes in figure.axes)
    for axes in figure.axes:
        named = [text.get_text() for text in axes.get_yticklabels()]
        outermost = axes.get_position().x0 == pytest.approx(left, abs=0.01)
        assert named[-1] == (f"half\n{words}" if outermost else "half")
        assert [name for name in named if words in name] == (named[-1:] if outermost else [])
        assert {scheme for scheme, (_, mark, _) in dots(axes).items() if mark in "xX"} == short
    marked = "requirement NOT met" if required else "does not damp"
    assert marked in {text.get_text() for text in figure.legends[0].get_texts()}


def test_costs_that_are_equal_but_for_rounding_look_equal() -> None:
    axes = Figure().subplots()
    for costs in ([2.564, 2.5642, 2.56423], [200.0, 200.0 * (1 + 1e-15)]):
        schemes._scale(axes, costs, schemes.Quantity("impulse", lambda plan: plan.pulses.total_impulse, str))
        low, high = axes.get_xlim()
        assert np.ptp(costs) / (high - low) < 0.01
        assert 0.0 < low < min(costs) <= max(costs) < high


def test_complying_cases_end_at_all_of_them() -> None:
    axes = Figure().subplots()
    schemes._scale(axes, [64.0, 99.9, 99.7], schemes._complying({}, 0.997))
    assert 100.0 < axes.get_xlim()[1] < 105.0


@spread(("kilograms", "unit", "shown"), [((1.593, 0.654), "kg", "0.6540"), ((0.0128,), "g", "12.80")], quick=1)
def test_propellant_has_the_unit_of_the_tables(kilograms: tuple[float, ...], unit: str, shown: str) -> None:
    plans = [
        Plan(
            BODY,
            f"trial {number}",
            Schedule((replace(compared().plans[0].pulses.pulses[0], propellant=spent),)),
        )
        for number, spent in enumerate(kilograms)
    ]
    figure = figures.schemes_figure(Comparison(BODY, tuple(plans)))
    axes = column(figure, "propellant")
    assert axes.get_xlabel() == f"propellant, {unit}"
    assert shown in {note.get_text() for note in axes.texts}


def test_floor_and_requirement_are_lines() -> None:
    figure = figures.schemes_figure(compared())
    bounds = compared()["optimal"].pulses.bounds
    assert bounds is not None
    assert bounds.rigorous is not None
    assert line(column(figure, "impulse"), "lower bound of cost, for optimal")[0, 0] == pytest.approx(bounds.rigorous)
    assert line(column(figure, "nutation"), "required")[0, 0] == pytest.approx(0.5)
    assert line(column(figure, "shift of H"), "required")[0, 0] == pytest.approx(0.2)
    assert not [axes for axes in figure.axes if "complying" in axes.get_xlabel()]


def test_the_floor_is_that_of_what_optimal_leaves() -> None:
    """A scheme that leaves more may take less: the line does not say that nothing does. No scale begins below zero."""
    figure = figures.schemes_figure(compared())
    words = {text.get_text() for text in figure.legends[0].get_texts()}
    assert "lower bound of cost, for optimal" in words
    assert "no schedule that leaves as little takes less" not in words
    assert all(axes.get_xlim()[0] >= 0.0 for axes in figure.axes)


def test_where_cases_were_flown_a_column_says_how_many_comply() -> None:
    pulses = planning.plan(BODY, "two-pulse").pulses
    cases = {"two-pulse": cases_of(run(Results(dispersion.study_of(BODY, pulses), 3000)))}
    chosen = compared().recommended
    assert chosen is not None
    cases[chosen.scheme] = cases["two-pulse"]
    figure = figures.schemes_figure(compared(), decide(compared(), cases))
    check_layout(figure)
    axes = column(figure, "complying cases")
    share = cases["two-pulse"].complying
    assert share is not None
    assert dots(axes)["two-pulse"][0] == pytest.approx(100.0 * share)
    assert set(dots(axes)) == {"two-pulse", chosen.scheme}
    assert share < 0.997
    assert all(mark in "xX" for _, mark, _ in dots(axes).values())
    rows = [text.get_text() for text in column(figure, "nutation").get_yticklabels()]
    assert {row.partition("\n")[0] for row in rows if "too few cases comply" in row} == {"two-pulse", chosen.scheme}
    assert axes.get_xlim()[1] < 105.0
    assert line(axes, "required")[0, 0] == pytest.approx(99.7)


def test_an_infeasible_scheme_has_a_row_without_dots() -> None:
    ideal = compare(spinner(), ("one-pulse", "four-pulse"))
    assert not ideal["four-pulse"].feasible
    figure = figures.schemes_figure(ideal)
    check_layout(figure)
    assert all(set(dots(axes)) == {"one-pulse"} for axes in figure.axes)
    rows = [tick.get_text() for axes in figure.axes for tick in axes.get_yticklabels()]
    assert rows.count("four-pulse\nno plan") == len(figure.axes)
    none = compare(spinner(), ("four-pulse",))
    check_layout(figures.schemes_figure(none))


def test_a_scheme_that_breaks_a_cone_is_marked_as_not_met() -> None:
    body = replace(BODY, keep=(Keep("Star", np.array([1.0, 0.0, 0.0]), least=math.radians(179.0)),))
    found = compare(body, ("two-pulse", "four-pulse"))
    assert all(plan.kept is False for plan in found.plans)
    assert any(plan.ends_well for plan in found.plans)
    assert not any(plan.meets_requirement for plan in found.plans)
    figure = figures.schemes_figure(found)
    check_layout(figure)
    # Below the scale a mark points there, in the colour of the others that fail.
    assert all(mark in "xX<" for axes in figure.axes for _, mark, _ in dots(axes).values())
    marks = [one for axes in figure.axes for one in axes.lines if str(one.get_marker()) in "oxX<"]
    assert {one.get_color() for one in marks if len(np.asarray(one.get_xdata()))} == {PULSE}
    assert all(fails(Point(plan, 100.0, "N m s")) for plan in found.plans)


@pytest.mark.deep
def test_schemes_can_be_seen_on_white_and_in_the_dark() -> None:
    check_colours(figures.schemes_figure(compared()))
