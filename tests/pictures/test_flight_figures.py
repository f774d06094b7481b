"""Figures of flights: what their lines hold, titles, labels, cones; that nothing overlaps or is
cut.
"""

import math
import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.text import Annotation
from support import places
from support.builders import aimed, channel, present, spinner
from support.cases import deep, spread, weekly
from support.golden import check_text
from support.shown import (
    BODY,
    CASES,
    H_MARKS,
    NAMES,
    SIXTEEN,
    STEERED,
    WIDE,
    check_colours,
    check_layout,
    check_star,
    contrast,
    drawn,
    flight_picture,
    flown,
    heading,
    kicks,
    notes,
    pages,
    points,
    texts,
)

from nutdamp.figures import geometry, overview, style
from nutdamp.figures.image import Scene, Timing, rendered
from nutdamp.files.reader import load_spacecraft
from nutdamp.flight import propagation
from nutdamp.physics.attitude import angle_between
from nutdamp.planning import plan as planning
from nutdamp.planning.decision import compare
from nutdamp.planning.verdict import Cases
from nutdamp.schemes.catalogue import CLASSIC
from nutdamp.spacecraft.model import Goal, Keep, Requirement, Spacecraft, Vector
from nutdamp.spacecraft.schedule import Schedule, channel_pulse
from nutdamp.views.text import duration
from nutdamp.views.verdict import statement

pytestmark = pytest.mark.usefixtures("plans_shared")


def panel(figure: Figure, title: str) -> Axes:
    (axes,) = (axes for axes in figure.axes if axes.get_title().startswith(title))
    return axes


# --- what is drawn
# --------------------------------------------------------------------------------------------------


@pytest.mark.deep
@spread("case", ["wide pulses", "oblate, reversed", "ideal impulses", "three moments"], quick=1)
def test_path_and_pulses_together_are_the_track_in_degrees(case: str) -> None:
    made, track = flown(case)
    body, space, *_ = drawn("motion", case).axes
    rates = np.degrees(track.rates[:, :2])
    for axes, rows in ((body, rates), (space, geometry.sky_paths(made, track)[0])):
        shown = {
            tuple(point) for name in ("path", "firing") for point in points(axes, name).round(9)
        }
        assert shown == {tuple(point) for point in rows.round(9)}
    firing = np.any(
        [(track.t >= begins) & (track.t <= ends) for begins, ends in made.spans], axis=0
    )
    assert {tuple(point) for point in points(body, "firing").round(9)} == {
        tuple(row) for row in rates[firing].round(9)
    }
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
    assert target == pytest.approx(
        110.0 * np.array([math.cos(math.radians(20.0)), math.sin(math.radians(20.0))])
    )
    assert points(space, H_MARKS)[-1] == pytest.approx(target, abs=1e-6)
    check_text("pictures.title-turn", drawn("motion", "far target").get_suptitle())
    for name, places_ in (("overview", (1, 2)), ("motion", (1,))):
        for place in places_:
            axes = drawn(name, "far target").axes[place]
            (mark,) = (one for one in axes.lines if one.get_marker() == "*")
            assert mark.get_marker() == "*"
            (x, y) = np.asarray(mark.get_xydata())[0]
            assert axes.get_xlim()[0] < x < axes.get_xlim()[1]
            assert axes.get_ylim()[0] < y < axes.get_ylim()[1]


@pytest.mark.deep
@pytest.mark.parametrize(
    "case", ["wide pulses", weekly("34 pulses"), weekly("ideal impulses"), weekly("long name")]
)
@pytest.mark.parametrize("name", NAMES)
def test_planes_have_equal_scales_and_all_axes_their_units(name: str, case: str) -> None:
    for axes in drawn(name, case).axes:
        if axes.get_title().startswith(("Pole", "Axis", "Spin")):
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
    ways = {
        note.get_text(): np.array(note.xy) for note in axes.texts if isinstance(note, Annotation)
    }
    for name, way in (("+1", (1, 0)), ("-1", (-1, 0)), ("+2", (0, 1)), ("-2", (0, -1))):
        assert ways[name] / np.linalg.norm(ways[name]) == pytest.approx(way, abs=1e-9)
    few = flight_picture("motion", SIXTEEN, kicks(SIXTEEN, 3, 0.45, 0.05)).axes[0]
    assert {note.get_text() for note in few.texts if note.get_text().startswith("T")} == {
        "T0",
        "T1",
        "T2",
    }


@pytest.mark.parametrize("name", ["overview", "motion"])
@pytest.mark.parametrize(("across", "drawn_too"), [(0.0, False), (1e-16, False), (0.5, True)])
def test_a_torque_along_the_spin_axis_has_no_arrow(
    name: str, across: float, drawn_too: bool
) -> None:
    """Not even one of rounding, where nothing else fires."""
    body = replace(WIDE, channels=(*WIDE.channels, channel("UP", across, 0.0, 2.0)))
    pulses = Schedule((channel_pulse(body.channels[-1], 1.0, 0.5),))
    axes = panel(flight_picture(name, body, pulses), "Pole curve")
    assert ("UP" in {note.get_text() for note in notes(axes)}) is drawn_too
    assert ("arrows" in axes.get_title()) is drawn_too


def test_bars_stand_where_the_thrusters_are_on_and_are_all_numbered() -> None:
    made, _ = flown("blackouts")
    axes = drawn("course", "blackouts").axes[2]
    rows = dict(
        zip([label.get_text() for label in axes.get_yticklabels()], axes.get_yticks(), strict=True)
    )
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
    assert (
        len(flown("34 pulses")[0].schedule)
        == len(drawn("course", "34 pulses").axes[2].collections)
        == 34
    )
    figure = drawn("motion", "34 pulses")
    for axes in figure.axes[:2]:
        assert 1 <= len(numbered(axes)) <= 16
        for note in (note for note in notes(axes) if note.get_text().isdigit()):
            box, place = note.get_window_extent(), axes.transData.transform(note.xy)
            away = np.hypot(*(np.clip(place, box.min, box.max) - place))
            assert away * 72.0 / figure.dpi < 11.0  # beside its own firing


@pytest.mark.deep
def test_histories_hold_the_track() -> None:
    _, track = flown("three moments")
    decay, _, rates, spin = drawn("overview", "three moments").axes[-4:]
    values = np.degrees(track.rates)
    for axes, name, row in ((rates, "ω1", 0), (rates, "ω2", 1), (spin, "_ω3", 2)):
        assert points(axes, name) == pytest.approx(np.column_stack([track.t, values[:, row]]))
    logged = points(decay, "nutation θ")[:, 1]
    seen = logged >= decay.get_ylim()[0]
    assert decay.get_yscale() == "log"
    assert logged[seen] == pytest.approx(np.degrees(track.nutation[seen]))
    assert (np.degrees(track.nutation[~seen]) <= decay.get_ylim()[0]).all()


@pytest.mark.parametrize(
    ("case", "panels"), [("no pulses", 2), ("wide pulses", 3), deep("three moments", 4)]
)
def test_no_panel_is_empty(case: str, panels: int) -> None:
    """Rows of firings where there are some, the spin where it changes."""
    assert len(drawn("course", case).axes) == panels


@pytest.mark.deep
def test_the_log_axis_reaches_the_requirement_and_what_is_left() -> None:
    """Whichever is less, four decades down at most; the last value is written above the panel."""
    for degrees, bound in ((5.0, 0.01), (5.0, 1e-6), (5.0, None), (0.0, 0.01), (5.0, 0.12)):
        body = spinner(degrees=degrees, requirement=Requirement(bound) if bound else None)
        axes = flight_picture("course", body, Schedule()).axes[1]
        low, high = axes.get_ylim()
        assert high >= 10.0 * low
        levels = [
            float(np.asarray(one.get_ydata())[0])
            for one in axes.lines
            if one.get_label() == "required"
        ]
        assert levels == ([] if bound is None else [pytest.approx(math.degrees(bound))])
        assert all(low < level < high for level in levels)
        assert low < degrees < high or degrees == 0.0
        assert f" s: {'5.00' if degrees else '0'}°" in axes.get_title("right")


@pytest.mark.parametrize(
    ("limits", "share", "colour"),
    [
        (0.02, None, style.MISSED),
        (0.12, None, style.UNCHECKED),
        (0.12, 1.0, style.INK),
        (0.12, 0.5, style.MISSED),
    ],
)
def test_the_title_has_the_verdict_in_its_colour(
    limits: float, share: float | None, colour: str
) -> None:
    """Red where it is not met, amber where cases do not show it, of 5° (0.087 rad) of nutation."""
    plan = planning.Plan(replace(WIDE, requirement=Requirement(limits)), "none", Schedule())
    verdict = planning.judge(
        plan, None if share is None else Cases(100, 1, 0.9, share, share, share)
    )
    figure = overview.flight_figure("course", *overview.shown(plan), verdict)
    assert to_hex(present(figure._suptitle).get_color()) == colour  # type: ignore[attr-defined]
    assert heading(figure).endswith(statement(verdict))


# --- how far they reach, and titles
# ----------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ["reversed", "no pulses", "three moments", "120 pulses"])
def test_time_axes_end_soon_after_the_last_pulse(case: str) -> None:
    made, _ = flown(case)
    body, pulses = made.spacecraft, made.schedule
    inertial = (
        2.0
        * math.pi
        * body.inertia.A
        / float(np.linalg.norm(np.asarray(body.inertia.moments) * body.omega0))
    )
    if body.inertia.symmetric:
        assert body.inertial_period == pytest.approx(inertial)
    end = max((pulse.start + pulse.on_time for pulse in pulses), default=0.0)
    after = (
        min(body.inertial_period, max(0.25 * end, 0.25 * body.body_period))
        if len(pulses)
        else body.inertial_period
    )
    assert geometry.shown_until(body, pulses) == pytest.approx(end + after)


def test_flights_from_python_end_alike_unless_they_name_an_end() -> None:
    plan = planning.plan(BODY, "two-pulse")
    for made, end in (
        (plan.fly(), geometry.shown_until(BODY, plan.pulses)),
        (plan.fly(30.0), 30.0),
    ):
        assert made.figure().axes[-1].get_xlim()[1] == pytest.approx(end)


@pytest.mark.deep
def test_of_a_very_long_time_all_pictures_say_how_much_is_drawn() -> None:
    made = propagation.flown(WIDE, Schedule(), 1e6)
    track = made.sampled(1000, 1e6)
    figure = overview.flight_figure("course", made, track)
    axes = figure.axes[-1]
    drawn_part = present(re.search(r"drawn: the first (.+) of 277:46:40$", heading(figure)))
    assert drawn_part[1] == duration(axes.get_xlim()[1])
    assert heading(overview.flight_figure("motion", made, track)).endswith(drawn_part[0])
    assert "drawn" not in heading(drawn("course", "wide pulses"))


def test_titles_name_scheme_model_and_result_in_lines_that_fit() -> None:
    for by_impulses in (False, True):
        figure = planning.plan(BODY, "two-pulse").fly(by_impulses=by_impulses).figure("motion")
        check_text(f"pictures.title-{'impulses' if by_impulses else 'widths'}", heading(figure))
    made, track = overview.shown(
        planning.Plan(spinner(), "schedules/of/the/second/attempt/" * 4, Schedule())
    )
    figure = overview.flight_figure("motion", made, track)
    assert 1 < max(map(len, figure.get_suptitle().split("\n"))) <= 11 * figure.get_figwidth()


# --- the cones of the film
# -------------------------------------------------------------------------------------------


@pytest.mark.deep
def test_what_is_magnified_says_so() -> None:
    made, track = flown("0.01°")
    scene = style.styled()(Scene)(made, Timing(float(track.t[-1]), 2, 10, 1.0), 320)
    told = present(re.search(r"angles × (\S+)\)", scene.space.get_title()))
    assert float(told[1]) == scene.looked.magnified > 1.0
    for widest in np.radians([1e-7, 1e-3, 0.01, 0.3, 1.0, 5.0, 13.9, 14.1, 80.0]).tolist():
        much = geometry.magnification(widest)
        if widest >= geometry.WIDE:
            assert much == 1.0
        else:
            assert (
                0.4 * np.tan(geometry.DRAWN)
                < much * np.tan(widest)
                <= np.tan(geometry.DRAWN) * (1 + 1e-9)
            )


def test_seen_from_outside_the_three_axes_lie_in_one_plane_and_the_cones_touch() -> None:
    """Whatever the magnification: on paper the rims have one tangent where ω ends."""
    for case in ("0.01°", "wide pulses", "needle at 60°"):
        made, track = flown(case)
        looked = geometry.view(made, track)
        cones = geometry.cones(made, track.rates[0], track.quaternion[0])
        assert np.isfinite(looked.seen(cones.rotation)[0][0]).all()
        steps = [1e-5 * np.cross(axis, cones.rotation) for axis in (cones.axis, cones.momentum)]
        one, other = (
            looked.seen(cones.rotation + step)[0][0] - looked.seen(cones.rotation - step)[0][0]
            for step in steps
        )
        assert abs(one[0] * other[1] - one[1] * other[0]) < 1e-6 * np.linalg.norm(
            one
        ) * np.linalg.norm(other)


@pytest.mark.deep
@pytest.mark.parametrize("case", ["three moments", "three moments, oblate", "oblate", "reversed"])
def test_cones_are_filled_from_their_apex_to_all_of_their_rim(case: str) -> None:
    made, track = flown(case)
    looked = geometry.view(made, track)
    cones = geometry.cones(made, track.rates[0], track.quaternion[0])
    axes = Figure().subplots()
    geometry.draw_cones(axes, looked, cones)
    filled = [
        patch for patch in axes.patches if isinstance(patch, Polygon) and len(patch.get_xy()) > 3
    ]
    assert len(filled) == 2
    for patch, rim, within in zip(
        filled, (cones.space, cones.body), (cones.swept, cones.body), strict=True
    ):
        seen = np.vstack([looked.seen(rim)[0], looked.seen(within)[0], [[0.0, 0.0]]])
        edges = np.diff(patch.get_xy(), axis=0)
        to_points = seen[:, None, :] - patch.get_xy()[None, :-1, :]
        cross_product = edges[:, 0] * to_points[..., 1] - edges[:, 1] * to_points[..., 0]
        assert (cross_product >= -1e-12).all()  # convex, and nothing of the cone outside
        assert {tuple(point) for point in patch.get_xy().round(12)} <= {
            tuple(point) for point in seen.round(12)
        }


# --- the globe
# --------------------------------------------------------------------------------------------------

SUN = np.array([0.6, 0.0, 0.8])
TURN = Goal(axis=np.array([0.0, 0.6, 0.8]))


@pytest.mark.parametrize(
    ("body", "drawn_too"),
    [
        (replace(WIDE, goal=TURN), True),
        (replace(WIDE, sun=SUN), True),
        (replace(WIDE, keep=(Keep("Moon", SUN, 0.2),)), True),
        (replace(WIDE, keep=(Keep("H", None, 0.0, 0.2),)), False),
        (WIDE, False),
        (replace(spinner(degrees=0.99), sun=SUN), False),
        (replace(spinner(degrees=1.01), sun=SUN), True),
    ],
)
def test_the_overview_has_a_globe_where_a_direction_is_given_and_the_axis_moves(
    body: Spacecraft, drawn_too: bool
) -> None:
    """By more than 2 degrees: twice the nutation, while H stands still."""
    figure = flight_picture("overview", body, Schedule())
    assert [axes.get_title()[:10] for axes in figure.axes[:3]].count("Spin axis ") == drawn_too
    check_layout(figure)


def test_the_globe_shows_where_the_axis_the_sun_and_the_cones_are() -> None:
    """Angles on the unit sphere, whose front is what is not dotted; what is behind is named so."""
    cones = Keep("Sun", SUN, 0.3, 1.2), Keep("below", np.array([-0.6, 0.0, -0.8]), 0.4)
    body = replace(WIDE, sun=SUN, keep=cones)
    made, track = overview.shown(planning.Plan(body, "trial", Schedule()))
    figure = overview.flight_figure("overview", made, track)
    check_layout(figure)
    axes = panel(figure, "Spin axis")
    places = {note.get_text(): np.asarray(note.xy) for note in notes(axes)}
    assert {"Sun", "below (behind)", "t = 0", "≥ 17.19° from Sun", "≤ 68.75° from Sun"} <= {*places}
    front = on_globe(places["Sun"])
    lines = [np.asarray(line.get_xydata()) for line in axes.lines if line.get_color() == style.GREY]
    circles = [line[np.isfinite(line).all(axis=1)] for line in lines if len(line) == geometry.RIM]
    for circle, angle in zip(circles, (0.3, 1.2), strict=False):
        assert np.degrees(angle_between(on_globe(circle), front)) == pytest.approx(
            np.degrees(angle), abs=1e-6
        )
        assert len(circle) > geometry.RIM / 2
    assert angle_between(on_globe(places["t = 0"]), front) == pytest.approx(
        angle_between(track.axis[0], SUN)
    )


def on_globe(places: Vector) -> Vector:
    """Unit vectors (n, 3) of places (n, 2) in front, towards the viewer."""
    return np.concatenate(
        [places, np.sqrt(1.0 - np.sum(places**2, axis=-1, keepdims=True))], axis=-1
    )


# --- labels
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("role", "step", "count", "shown"),
    [
        ("vital", 0.0, 4, ["label 0\nlabel 1\nlabel 2\nlabel 3"]),
        ("label", 0.0, 4, ["label 0 … label 3"]),
        ("vital", 0.04, 12, [f"label {number}" for number in range(12)]),
        ("label", 0.04, 12, None),  # there is no room for all
    ],
)
def test_labels_of_one_place_are_one_and_vital_ones_are_never_left_out(
    role: str, step: float, count: int, shown: list[str] | None
) -> None:
    figure = Figure((3.0, 1.0), layout="constrained")
    axes = figure.subplots()
    for number in range(count):
        place = np.array([0.5 + step * number, 0.5])
        style.add(axes, f"label {number}", place, style.INK, role=role)
    axes.set_xlim(0.0, 1.0)
    style.settle(figure)
    told = [note.get_text() for note in notes(axes)]
    assert told == shown or (shown is None and 0 < len(told) < count)


@pytest.mark.parametrize(
    ("name", "case"),
    [
        *(("course", "blackouts"), deep("course", "120 pulses"), deep("overview", "blackouts")),
        *(weekly("overview", case) for case in ("16 channels", "steered", "one pulse", "reversed")),
        *(weekly("course", case) for case in ("16 channels", "steered", "one pulse", "reversed")),
        weekly("overview", "120 pulses"),
    ],
)
def test_labels_of_firings_have_room(name: str, case: str) -> None:
    """Inside the panel, on no other label, no bar and no hatching; every pulse has one where there
    is room.
    """
    figure = drawn(name, case)
    texts(figure)
    axes = next(axes for axes in figure.axes if axes.collections and not axes.get_ylabel())
    window = axes.get_window_extent()
    found = notes(axes)
    boxes = [note.get_window_extent() for note in found]
    for box in boxes:
        assert (window.p0 - 1.0 <= box.p0).all()
        assert (box.p1 <= window.p1 + 1.0).all()
    for one, other in combinations(boxes, 2):
        assert not (np.minimum(one.p1, other.p1) - np.maximum(one.p0, other.p0) > 1.0).all()
    low, high = np.array([box.p0 for box in boxes]), np.array([box.p1 for box in boxes])
    for bars in axes.collections:
        area = bars.get_paths()[0].get_extents(bars.get_transform())
        across, along = (np.minimum(high, area.p1) - np.maximum(low, area.p0)).T
        assert ((across < 0.5) | (along < 2.0)).all()
    numbers = [int(note.get_text().partition(":")[0]) for note in found]
    pulses = flown(case)[0].schedule.pulses
    if case != "120 pulses":
        assert sorted(numbers) == list(range(1, len(pulses) + 1))


def test_steering_angles_are_those_of_the_table_and_say_from_where() -> None:
    pulses = flown("steered")[0].schedule.pulses[::2]
    axes = flight_picture("course", STEERED, Schedule(pulses)).axes[2]
    assert "from body axis +1" in axes.get_title("right")
    angles = [
        float(said[1])
        for note in axes.texts
        if (said := re.search(r"at ([\d.]+)°", note.get_text()))
    ]
    impulses = [pulse.impulse for pulse in pulses]
    assert angles == [
        round(math.degrees(math.atan2(one[1], one[0])) % 360.0, 2) for one in impulses
    ]


@pytest.mark.deep
@pytest.mark.parametrize("azimuth", [0.0, weekly(5.0), weekly(355.0), weekly(8.0)])
def test_no_label_lies_under_the_star_of_the_target(azimuth: float) -> None:
    body = aimed(WIDE, 6.0, azimuth)  # 5° of nutation: it is beside the spin axis at t = 0
    axes = flight_picture("motion", body, kicks(body, 5, 0.9, 0.2)).axes[1]
    (star,) = (one for one in axes.lines if one.get_label() == "target")
    check_star(axes, np.asarray(star.get_xydata())[0], 0.45 * star.get_markersize())


# --- many pulses, many turns
# -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("count", "most"), [(1, 17), (10, 17), (34, 17), (120, 17), (457, 24), (2, 3), (1000, 3)]
)
def test_of_many_the_first_the_last_and_round_numbers_are_shown(count: int, most: int) -> None:
    shown = [number + 1 for number in style.thinned(count, most)]
    assert (shown[0], shown[-1]) == (1, count)
    assert len(shown) <= most
    assert shown == sorted(set(shown))
    assert len(set(np.diff(shown[1:-1]).tolist())) <= 1
    assert count > most - 1 or shown == list(range(1, count + 1))


@pytest.mark.deep
def test_firings_that_cannot_be_told_apart_are_drawn_as_one() -> None:
    """120 firings of 10 ms, 0.4 s apart, over a minute: bars thinner than a pixel would alias.
    Nothing is lost.
    """
    made, track = flown("120 pulses")
    (block,) = geometry.blocks(made, float(track.t[-1]))
    assert (block.first, block.name, block.many) == (1, "1–120", 120)
    assert (block.begins, block.ends, block.on) == pytest.approx(
        (made.schedule.pulses[0].start, made.schedule.end, 1.2)
    )
    patches = drawn("overview", "120 pulses").axes[-1].patches
    assert [to_hex(patch.get_facecolor()) for patch in patches].count(style.PULSE.lower()) == 1
    for other, until in ((flown("16 channels")[0], 20.0), (kicks(BODY, 2, 0.01, 0.005), 100.0)):
        apart = other if isinstance(other, propagation.Flight) else replace(made, schedule=other)
        every = geometry.blocks(apart, until)  # close together, yet bars of their own
        assert [each.many for each in every] == [1] * len(apart.schedule)


@pytest.mark.filterwarnings("ignore:Glyph .* missing")  # of a name in another script
@pytest.mark.parametrize(
    ("name", "case"),
    [
        ("course", "blackouts"),
        *(deep("overview", case) for case in ("three moments", "far target", "long name")),
        *(deep(name, "34 pulses") for name in NAMES[1:]),
        *(weekly(name, case) for case in CASES for name in NAMES),
    ],
)
def test_no_text_is_cut_or_covers_another_and_no_number_is_minus_zero(name: str, case: str) -> None:
    check_layout(drawn(name, case))
    assert not [
        text
        for text, _ in texts(drawn(name, case))
        if re.fullmatch(r"[-−]0(\.0*)?", text.get_text())
    ]


@pytest.mark.weekly
@pytest.mark.parametrize("path", sorted(places.CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_no_text_is_cut_in_the_pictures_of_the_configs(path: Path) -> None:
    body = load_spacecraft(str(path))
    for plan in (plan for plan in compare(body, CLASSIC).plans if plan.feasible):
        for name in NAMES:
            check_layout(flight_picture(name, body, plan.pulses))


@pytest.mark.parametrize("case", [weekly("reversed"), "far target", weekly("120 pulses")])
@pytest.mark.parametrize("name", [*map(deep, NAMES[:2]), "course"])
def test_words_and_swatches_can_be_seen_on_white_and_in_the_dark(name: str, case: str) -> None:
    check_colours(drawn(name, case))
    assert all(contrast(style.GREY, paper) > 3.0 for paper, _ in pages())


def test_characters_without_a_glyph_are_question_marks_and_nothing_is_said(
    capfd: pytest.CaptureFixture[str],
) -> None:
    """U+E000 is in no font; the Greek is in the one that comes with matplotlib."""
    figure = style.sheet(2.0, 1.0)
    title = figure.suptitle("ω\ue000 x")
    for kind, text in (("svg", "ω\ue000 x"), ("png", "ω? x")):
        assert rendered(figure, f"a.{kind}")
        assert title.get_text() == text
    assert capfd.readouterr().err == ""
