"""Figures of flights: what their lines hold, titles, labels, cones; that nothing overlaps or is cut."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.text import Annotation
from support.builders import cross, spinner
from support.cases import deep, spread, weekly
from support.colours import contrast
from support.dispersed import normal
from support.golden import check_text
from support.shown import (
    BODY,
    H_MARKS,
    NAMES,
    SIXTEEN,
    WIDE,
    drawn,
    flight_picture,
    flown,
    heading,
    kicks,
    legend_words,
    notes,
    points,
)

import nutdamp.api  # noqa: F401 - figures of flights are declared there
from nutdamp.figures import geometry, overview, sphere, style
from nutdamp.flight import propagation
from nutdamp.physics.attitude import angle_between
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.model import Inertia, Requirement
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.spacecraft.tolerances import Dispersions

pytestmark = pytest.mark.usefixtures("plans_shared")


def panel(figure: Figure, title: str) -> Axes:
    (axes,) = (axes for axes in figure.axes if axes.get_title().startswith(title))
    return axes


# --- what is drawn ---------------------------------------------------------------------------------------------------


@pytest.mark.deep
@spread("case", ["wide pulses", "oblate, reversed", "ideal impulses", "three moments"], quick=1)
def test_path_and_pulses_together_are_the_track_in_degrees(case: str) -> None:
    made, track = flown(case)
    body, space, *_ = drawn("motion", case).axes
    rates = np.degrees(track.rates[:, :2])
    for axes, rows in ((body, rates), (space, geometry.sky_paths(made, track)[0])):
        shown = {tuple(point) for name in ("path", "firing") for point in points(axes, name).round(9)}
        assert shown == {tuple(point) for point in rows.round(9)}
    firing = np.any([(track.t >= begins) & (track.t <= ends) for begins, ends in made.spans], axis=0)
    assert {tuple(point) for point in points(body, "firing").round(9)} == {tuple(row) for row in rates[firing].round(9)}
    away = np.degrees(angle_between(track.axis, track.momentum[0]))
    assert np.hypot(*points(space, "path")[0]) == pytest.approx(away[0])
    marks = points(space, H_MARKS)
    assert len(marks) == len(made.schedule) + 1
    assert marks[0] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert np.hypot(*marks[-1]) == pytest.approx(np.degrees(made.residual.momentum_shift), abs=1e-9)


@pytest.mark.deep
def test_a_turn_says_how_far_to_which_target_and_marks_it_where_h_ends() -> None:
    """It is 110 degrees: nutation alone would be a word about the least of it."""
    _, space = drawn("motion", "far target").axes
    (target,) = points(space, "target")
    assert target == pytest.approx(110.0 * np.array([math.cos(math.radians(20.0)), math.sin(math.radians(20.0))]))
    assert points(space, H_MARKS)[-1] == pytest.approx(target, abs=1e-6)
    check_text("pictures.title-turn", drawn("motion", "far target").get_suptitle())
    for name, places_ in (("overview", (1,)), ("motion", (1,)), ("sphere", (0,))):
        for place in places_:
            axes = drawn(name, "far target").axes[place]
            (mark,) = (one for one in axes.lines if one.get_marker() == "*")
            assert mark.get_marker() == "*"
            (x, y) = np.asarray(mark.get_xydata())[0]
            assert axes.get_xlim()[0] < x < axes.get_xlim()[1]
            assert axes.get_ylim()[0] < y < axes.get_ylim()[1]


@pytest.mark.deep
@pytest.mark.parametrize("case", ["wide pulses", weekly("34 pulses"), weekly("ideal impulses"), weekly("long name")])
@pytest.mark.parametrize("name", NAMES)
def test_planes_have_equal_scales_and_all_axes_their_units(name: str, case: str) -> None:
    for axes in drawn(name, case).axes:
        if axes.get_title().startswith(("Pole", "Axis", "Cones")):
            assert axes.get_aspect() == 1.0
            width, height = axes.get_window_extent().size
            (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
            assert width / (right - left) == pytest.approx(height / (high - low), rel=1e-3)
        if axes.axison:
            assert any(line.get_visible() for line in axes.get_xgridlines())
            shared = [one.get_xlabel() for one in axes.get_shared_x_axes().get_siblings(axes)]
            assert any(re.search(r", °|, °/s|time, s", label) for label in shared)
            rows = [text.get_text() for text in axes.get_yticklabels()]
            assert re.search(r", °", axes.get_ylabel()) or {*rows} <= {
                pulse.channel for pulse in flown(case)[0].schedule
            }


@pytest.mark.deep
def test_the_pole_curve_shows_where_the_channels_push() -> None:
    """+2 up, -1 left, by the file's names; only those that fire."""
    axes = panel(drawn("motion", "34 pulses"), "Pole curve")
    ways = {note.get_text(): np.array(note.xy) for note in axes.texts if isinstance(note, Annotation)}
    for name, way in (("+1", (1, 0)), ("-1", (-1, 0)), ("+2", (0, 1)), ("-2", (0, -1))):
        assert ways[name] / np.linalg.norm(ways[name]) == pytest.approx(way, abs=1e-9)
    few = flight_picture("motion", SIXTEEN, kicks(SIXTEEN, 3, 0.45, 0.05)).axes[0]
    assert {note.get_text() for note in few.texts if note.get_text().startswith("T")} == {"T0", "T1", "T2"}


def test_bars_stand_where_the_thrusters_are_on_and_are_all_numbered() -> None:
    made, _ = flown("blackouts")
    axes = drawn("history", "blackouts").axes[1]
    rows = dict(zip([label.get_text() for label in axes.get_yticklabels()], axes.get_yticks(), strict=True))
    bars = [one.get_paths()[0].get_extents() for one in axes.collections if not one.get_hatch()]
    for box, pulse in zip(bars, made.schedule, strict=True):
        assert (box.x0, box.x1) == pytest.approx((pulse.start, pulse.end))
        assert np.mean(box.intervaly) == pytest.approx(rows[pulse.channel])
    numbers = [int(note.get_text().partition(":")[0]) for note in notes(axes)]
    assert sorted(numbers) == list(range(1, len(made.schedule) + 1))
    hatched = [one for one in axes.collections if one.get_hatch()]
    closed = {tuple(one.get_paths()[0].get_extents().intervalx.tolist()) for one in hatched}
    assert {(0.0, 1.0), (3.0, 4.5)} <= closed
    for one in hatched:
        (colour,) = np.asarray(one.get_edgecolor()).tolist()
        assert colour[3] == 1.0
        assert contrast(to_hex(colour), "#ffffff") >= 3.0


@pytest.mark.deep
def test_of_many_firings_those_that_can_be_read_are_numbered() -> None:
    def numbered(axes: Axes) -> list[int]:
        return sorted(int(note.get_text()) for note in notes(axes) if note.get_text().isdigit())

    assert numbered(drawn("motion", "celestial").axes[0])[:1] == [2]
    assert len(flown("34 pulses")[0].schedule) == len(drawn("history", "34 pulses").axes[1].collections) == 34
    assert all(1 <= len(numbered(axes)) <= 16 for axes in drawn("motion", "34 pulses").axes[:2])


@pytest.mark.deep
def test_histories_hold_the_track() -> None:
    _, track = flown("three moments")
    decay, _, rates, spin = drawn("history", "three moments").axes
    values = np.degrees(track.rates)
    for axes, name, row in ((rates, "ω1", 0), (rates, "ω2", 1), (spin, "_ω3", 2)):
        assert points(axes, name) == pytest.approx(np.column_stack([track.t, values[:, row]]))
    logged = points(decay, "nutation θ")[:, 1]
    seen = logged >= decay.get_ylim()[0]
    assert decay.get_yscale() == "log"
    assert logged[seen] == pytest.approx(np.degrees(track.nutation[seen]))
    assert (np.degrees(track.nutation[~seen]) <= decay.get_ylim()[0]).all()


@pytest.mark.parametrize(("case", "panels"), [("no pulses", 2), ("wide pulses", 3), deep("three moments", 4)])
def test_no_panel_is_empty(case: str, panels: int) -> None:
    """Rows of firings where there are some, the spin where it changes."""
    assert len(drawn("history", case).axes) == panels


@pytest.mark.deep
def test_the_log_axis_reaches_the_requirement_and_what_is_left() -> None:
    """Whichever is less, four decades down at most; the last value is written above the panel."""
    for degrees, bound in ((5.0, 0.01), (5.0, 1e-6), (5.0, None), (0.0, 0.01), (5.0, 0.12)):
        body = spinner(degrees=degrees, requirement=Requirement(bound) if bound else None)
        axes = flight_picture("history", body, Schedule()).axes[0]
        low, high = axes.get_ylim()
        assert high >= 10.0 * low
        levels = [float(np.asarray(one.get_ydata())[0]) for one in axes.lines if one.get_label() == "required"]
        assert levels == ([] if bound is None else [pytest.approx(math.degrees(bound))])
        assert all(low < level < high for level in levels)
        assert low < degrees < high or degrees == 0.0
        assert f" s: {'5.00' if degrees else '0'}°" in axes.get_title("right")


@pytest.mark.parametrize(
    ("limits", "tolerances", "colour"),
    [
        (Requirement(0.02), None, style.MISSED),
        (Requirement(0.12), None, style.UNCHECKED),
        (Requirement(0.12), Dispersions(A=normal(0.01, relative=True)), style.INK),
        (None, None, style.INK),
    ],
)
def test_the_verdict_is_red_where_it_is_not_met_and_amber_where_no_tolerance_is_known(
    limits: Requirement | None, tolerances: Dispersions | None, colour: str
) -> None:
    body = replace(WIDE, requirement=limits, dispersions=tolerances)  # 5° of nutation, 0.087 rad
    axes = flight_picture("history", body, Schedule()).axes[0]
    assert to_hex(axes._right_title.get_color()) == colour  # type: ignore[attr-defined]  # there is no other way to it
    assert ("NOT met" in axes.get_title("right")) is (colour == style.MISSED)


# --- how far they reach, and titles ----------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ["reversed", "no pulses", "three moments", "120 pulses"])
def test_time_axes_end_soon_after_the_last_pulse(case: str) -> None:
    made, _ = flown(case)
    body, pulses = made.spacecraft, made.schedule
    inertial = 2.0 * math.pi * body.inertia.A / float(np.linalg.norm(np.asarray(body.inertia.moments) * body.omega0))
    if body.inertia.symmetric:
        assert body.inertial_period == pytest.approx(inertial)
    end = max((pulse.start + pulse.on_time for pulse in pulses), default=0.0)
    after = min(body.inertial_period, max(0.25 * end, 0.25 * body.body_period)) if len(pulses) else body.inertial_period
    assert geometry.shown_until(body, pulses) == pytest.approx(end + after)


@pytest.mark.deep
def test_the_axes_of_time_reach_as_far_as_is_drawn() -> None:
    for name in ("overview", "history"):
        timed = [axes for axes in drawn(name, "wide pulses").axes if axes.get_xlabel().startswith("time, s")]
        assert timed
        assert [axes.get_xlim()[1] for axes in timed] == pytest.approx([flown("wide pulses")[1].t[-1]] * len(timed))


def test_a_slow_nutation_leaves_no_sheet_blank() -> None:
    """A needle turns once in 60 s inertially: half a minute of nothing once followed its last pulse."""
    body = spinner(239, 6.01, 4.2, 8.0, channels=cross(20.0))
    pulses = kicks(body, 9, 4.0, 0.05)
    assert body.inertial_period > 40.0
    assert geometry.shown_until(body, pulses) < 1.3 * pulses.end


def test_flights_from_python_end_alike_unless_they_name_an_end() -> None:
    plan = planning.plan(BODY, "two-pulse")
    for made, end in ((plan.fly(), geometry.shown_until(BODY, plan.pulses)), (plan.fly(30.0), 30.0)):
        assert made.figure("history").axes[0].get_xlim()[1] == pytest.approx(end)


@pytest.mark.deep
def test_of_a_very_long_time_all_pictures_say_how_much_is_drawn() -> None:
    made = propagation.flown(WIDE, Schedule(), 1e6)
    track = made.sampled(1000, 1e6)
    axes = overview.flight_figure("history", made, track).axes[-1]
    until = re.search(r"the first ([\d.]+) s of 1e\+06 s", heading(overview.flight_figure("history", made, track)))
    assert until is not None
    assert float(until[1]) == pytest.approx(axes.get_xlim()[1], rel=1e-3)
    assert heading(overview.flight_figure("motion", made, track)).endswith(f"drawn: the first {until[1]} s of 1e+06 s")
    assert "drawn" not in heading(drawn("history", "wide pulses"))


def test_titles_name_scheme_model_and_result_in_lines_that_fit() -> None:
    for by_impulses in (False, True):
        figure = planning.plan(BODY, "two-pulse").fly(by_impulses=by_impulses).figure("motion")
        check_text(f"pictures.title-{'impulses' if by_impulses else 'widths'}", heading(figure))
    made, track = overview.shown(planning.Plan(spinner(), "schedules/of/the/second/attempt/" * 4, Schedule()))
    figure = overview.flight_figure("motion", made, track)
    assert 1 < max(map(len, figure.get_suptitle().split("\n"))) <= 11 * figure.get_figwidth()


@pytest.mark.deep
@pytest.mark.parametrize("case", ["celestial", "three moments"])
def test_views_of_the_sky_say_how_they_lie(case: str) -> None:
    titles = [axes.get_title() for name in ("motion", "sphere") for axes in drawn(name, case).axes]
    right = "east" if case == "celestial" else "inertial x"
    assert sum(f"H towards you, {right} to the right" in title for title in titles) == 1


# --- the spherical view ----------------------------------------------------------------------------------------------


@pytest.mark.deep
def test_what_is_magnified_says_so() -> None:
    for case in ("0.01°", "wide pulses", "needle at 60°"):
        told = re.search(r"angles × (\S+)\)", panel(drawn("sphere", case), "Cones").get_title())
        assert (float(told[1]) if told else 1.0) == sphere.view(*flown(case)).magnified
    for widest in np.radians([1e-7, 1e-3, 0.01, 0.3, 1.0, 5.0, 13.9, 14.1, 80.0]).tolist():
        much = sphere.magnification(widest)
        if widest >= sphere.WIDE:
            assert much == 1.0
        else:
            assert 0.4 * np.tan(sphere.DRAWN) < much * np.tan(widest) <= np.tan(sphere.DRAWN) * (1 + 1e-9)


def test_seen_from_outside_the_three_axes_lie_in_one_plane_and_the_cones_touch() -> None:
    """Whatever the magnification: on paper the rims have one tangent where ω ends."""
    for case in ("0.01°", "wide pulses", "needle at 60°"):
        made, track = flown(case)
        looked, cones = sphere.view(made, track), geometry.cones(made, track.rates[0], track.quaternion[0])
        assert np.isfinite(looked.seen(cones.rotation)[0][0]).all()
        steps = [1e-5 * np.cross(axis, cones.rotation) for axis in (cones.axis, cones.momentum)]
        one, other = (
            looked.seen(cones.rotation + step)[0][0] - looked.seen(cones.rotation - step)[0][0] for step in steps
        )
        assert abs(one[0] * other[1] - one[1] * other[0]) < 1e-6 * np.linalg.norm(one) * np.linalg.norm(other)


@pytest.mark.deep
@pytest.mark.parametrize("case", ["three moments", "three moments, oblate", "oblate", "reversed"])
def test_cones_are_filled_from_their_apex_to_all_of_their_rim(case: str) -> None:
    made, track = flown(case)
    looked, cones = sphere.view(made, track), geometry.cones(made, track.rates[0], track.quaternion[0])
    figure = drawn("sphere", case)
    filled = [patch for patch in figure.axes[0].patches if isinstance(patch, Polygon) and len(patch.get_xy()) > 3]
    assert len(filled) == 2
    for patch, rim, within in zip(filled, (cones.space, cones.body), (cones.swept, cones.body), strict=True):
        seen = np.vstack([looked.seen(rim)[0], looked.seen(within)[0], [[0.0, 0.0]]])
        edges = np.diff(patch.get_xy(), axis=0)
        to_points = seen[:, None, :] - patch.get_xy()[None, :-1, :]
        cross_product = edges[:, 0] * to_points[..., 1] - edges[:, 1] * to_points[..., 0]
        assert (cross_product >= -1e-12).all()  # convex, and nothing of the cone outside
        assert {tuple(point) for point in patch.get_xy().round(12)} <= {tuple(point) for point in seen.round(12)}
    named = {"space cone", "body cone", "path of the spin axis", "path of H"}
    assert named <= legend_words(figure)


@pytest.mark.deep
def test_the_legend_of_the_sphere_names_what_is_seen() -> None:
    """Pulses where they move the axis; a body cone, of about C/A of the nutation, that lies under the marks."""
    plan = planning.plan(BODY, "two-pulse")
    for made, named in ((propagation.by_impulses(BODY, plan.pulses), False), (plan.flight, True)):
        assert ("firing" in legend_words(overview.flight_figure("sphere", made, made.sampled(400, 20.0)))) is named
    for moment, hidden in ((80.0, False), (1.5, True)):
        body = replace(spinner(), inertia=Inertia((120.0, 120.0, moment)), omega0=np.array([0.003, 0.0, 3.0]))
        (name,) = (word for word in legend_words(flight_picture("sphere", body, Schedule())) if "body cone" in word)
        assert ("under the marks" in name) is hidden
