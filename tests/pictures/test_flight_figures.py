"""Figures of flights: how far they reach in time, their titles, labels of firings, cones, colours, odd flights."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.text import Annotation
from support.builders import aimed, cross, fan, spinner
from support.cases import deep, spread, weekly
from support.colours import check_colours, contrast, pages
from support.layout import check_layout, texts

import nutdamp.library.views  # noqa: F401 - figures of flights are declared there
from nutdamp import flight, planning
from nutdamp.presentation import figures, geometry
from nutdamp.presentation.figures import sphere, style
from nutdamp.presentation.figures.style import GREY, INK, MOTION, PULSE
from nutdamp.schedule import Schedule, channel_pulse, steerable_pulse
from nutdamp.spacecraft import Attitude, Limits, Requirement, Spacecraft, Steerable, Vector

pytestmark = pytest.mark.usefixtures("plans_shared")

NAMES = ("overview", "motion", "sphere", "history", "timeline")

TORQUER = Steerable(50.0)
BODY = spinner(channels=cross(20.0), requirement=Requirement(0.01, 0.005))


def kicks(body: Spacecraft, count: int, step: float, on_time: float) -> Schedule:
    """So many short pulses of all channels in turn, whatever they do."""
    channels = body.channels
    return Schedule(tuple(channel_pulse(channels[n % len(channels)], 0.5 + n * step, on_time) for n in range(count)))


SIXTEEN = spinner(degrees=8.0, channels=fan(16, 20.0))
STEERED = spinner(steerable=TORQUER, requirement=Requirement(0.01))
FAR = aimed(spinner(steerable=Steerable()), 110.0, 20.0)
FORBIDDEN = spinner(channels=cross(20.0), limits=Limits(earliest=1.0, blackout=((2.0, 4.5), (6.0, 7.0), (20.0, 25.0))))

ODD: dict[str, tuple[Spacecraft, Schedule]] = {
    "three moments": (spinner(moments=(120, 100, 80), degrees=25.0), Schedule()),
    "three moments, oblate": (spinner(moments=(80, 90, 120), degrees=10.0, channels=cross(1.0)), Schedule()),
    "no nutation": (spinner(degrees=0.0, channels=cross(20.0)), Schedule()),
    "one pulse at once": (STEERED, Schedule((steerable_pulse(TORQUER, 0.2, 1.0, impulse=20.0),))),
    "one pulse": (BODY, kicks(BODY, 1, 1.0, 0.3)),
    "120 pulses": (BODY, kicks(BODY, 120, 0.4, 0.01)),
    "16 channels": (SIXTEEN, kicks(SIXTEEN, 32, 0.45, 0.05)),
    "far target": (FAR, planning.plan(FAR, "two-pulse").pulses),
    "reversed": (spinner(120, 80, -3.0, 10.0, channels=cross(20.0)), kicks(BODY, 4, 1.1, 0.2)),
    "oblate": (spinner(80, 120, 3.0, 10.0, channels=cross(20.0)), kicks(BODY, 4, 1.1, 0.2)),
    "celestial": (replace(BODY, attitude=Attitude(np.array([0.7, 0.1, 0.7, 0.1]))), kicks(BODY, 5, 0.9, 0.2)),
    "blackouts": (FORBIDDEN, planning.plan(FORBIDDEN, "four-pulse").pulses),
    "steered at the edges": (
        STEERED,
        Schedule(tuple(steerable_pulse(TORQUER, t, t, on_time=0.01) for t in (0.005, 0.9, 1.8, 2.6))),
    ),
}


ALWAYS = ("three moments", "blackouts")


@cache
def drawn(name: str, case: str) -> Figure:
    body, pulses = ODD[case]
    plan = planning.Plan(body, "trial", pulses)
    return figures.flight_figure(name, *figures.shown(plan))


# --- time axes -------------------------------------------------------------------------------------------------------


@pytest.mark.weekly
@spread("case", ODD, quick=1, deep=2)
def test_time_axes_end_soon_after_the_last_pulse(case: str) -> None:
    body, pulses = ODD[case]
    inertial = 2.0 * math.pi * body.inertia.A / float(np.linalg.norm(np.asarray(body.inertia.moments) * body.omega0))
    end = max((pulse.start + pulse.on_time for pulse in pulses), default=0.0)
    after = min(body.inertial_period, max(0.25 * end, 0.25 * body.body_period)) if len(pulses) else body.inertial_period
    if body.inertia.symmetric:
        assert body.inertial_period == pytest.approx(inertial)
    assert geometry.shown_until(body, pulses) == pytest.approx(end + after)
    for name in ("overview", "history", "timeline"):
        timed = [axes for axes in drawn(name, case).axes if axes.get_xlabel().startswith("time, s")]
        assert timed
        assert all(axes.get_xlim()[1] == pytest.approx(end + after) for axes in timed)


def test_a_slow_nutation_leaves_no_sheet_blank() -> None:
    """A needle turns once in 60 s inertially: half a minute of nothing once followed its last pulse."""
    body = spinner(239, 6.01, 4.2, 8.0, channels=cross(20.0))
    pulses = kicks(body, 9, 4.0, 0.05)
    assert body.inertial_period > 40.0
    assert geometry.shown_until(body, pulses) < 1.3 * pulses.end


def test_flights_from_python_end_alike_unless_they_name_an_end() -> None:
    plan = planning.plan(BODY, "two-pulse")
    usual = plan.fly().figure("timeline").axes[0].get_xlim()[1]
    assert usual == pytest.approx(geometry.shown_until(BODY, plan.pulses))
    assert plan.fly(30.0).figure("timeline").axes[0].get_xlim()[1] == pytest.approx(30.0)


# --- titles ----------------------------------------------------------------------------------------------------------


@pytest.mark.deep
@spread(("by_impulses", "model"), [(False, "real pulse widths"), (True, "impulse sum (17)")], quick=1)
def test_titles_name_scheme_model_and_result(by_impulses: bool, model: str) -> None:
    plan = planning.plan(BODY, "two-pulse")
    made = plan.fly(by_impulses=by_impulses)
    for name in ("overview", "timeline"):
        heading = made.figure(name).get_suptitle()
        assert f"test: two-pulse by {model}, 2 pulses until {plan.end:.3f} s" in heading
        assert re.search(r"nutation 5 deg → < 1e-9 deg, shift of H \S+", heading)


@pytest.mark.weekly
def test_titles_of_a_turn_say_how_far_to_which_target_and_the_pictures_mark_it() -> None:
    """It is 110 degrees: nutation alone would be a word about the least of it."""
    for name in NAMES:
        lines = drawn(name, "far target").get_suptitle().splitlines()
        assert lines[1] == "H turned 110 deg to the target, tilt 110.0000 deg, azimuth 20.0000 deg"
        assert re.fullmatch(r"nutation \S+ deg → .* deg, H off the target .* deg", lines[2])
    for name, panels in (("overview", (1, 2)), ("motion", (1,)), ("sphere", (0,))):
        for panel in panels:
            axes = drawn(name, "far target").axes[panel]
            (mark,) = (one for one in axes.lines if one.get_label() == "target")
            assert mark.get_marker() == "*"
            (x, y) = np.asarray(mark.get_xydata())[0]
            assert axes.get_xlim()[0] < x < axes.get_xlim()[1]
            assert axes.get_ylim()[0] < y < axes.get_ylim()[1]


@spread("case", ["celestial", "three moments"], quick=1)
def test_views_of_the_sky_say_how_they_lie(case: str) -> None:
    right = "east" if case == "celestial" else "inertial x"
    titles = [axes.get_title() for name in ("motion", "sphere") for axes in drawn(name, case).axes]
    assert sum(f"H towards you, {right} to the right" in title for title in titles) == 2


@pytest.mark.weekly
@spread("case", ODD, quick=2, deep=4)
def test_no_number_is_minus_zero(case: str) -> None:
    for name in ("overview", "history"):
        for text, _ in texts(drawn(name, case)):
            assert not re.fullmatch(r"[-−]0(\.0*)?", text.get_text())


# --- labels of firings -----------------------------------------------------------------------------------------------


def bar_labels(axes: Axes) -> list[Annotation]:
    return [one for one in axes.texts if isinstance(one, Annotation) and one.get_visible()]


@pytest.mark.parametrize("name", ["overview", "timeline"])
@pytest.mark.parametrize("case", [case if case in ALWAYS else weekly(case) for case in ODD if len(ODD[case][1])])
def test_labels_of_firings_have_room(name: str, case: str) -> None:
    """Inside the panel, on no other label, no bar and no hatching; every pulse has one where there is room."""
    figure = drawn(name, case)
    texts(figure)
    axes = figure.axes[-1]
    window, found = axes.get_window_extent(), bar_labels(axes)
    boxes = [note.get_window_extent() for note in found]
    for box in boxes:
        assert window.x0 - 1.0 <= box.x0
        assert box.x1 <= window.x1 + 1.0
        assert window.y0 - 1.0 <= box.y0
        assert box.y1 <= window.y1 + 1.0
    for one, other in combinations(boxes, 2):
        overlap = np.minimum(one.p1, other.p1) - np.maximum(one.p0, other.p0)
        assert not (overlap > 1.0).all()
    for bars in axes.collections:
        area = bars.get_paths()[0].get_extents(bars.get_transform())
        for box in boxes:
            across = min(box.x1, area.x1) - max(box.x0, area.x0)
            assert across < 0.5 or min(box.y1, area.y1) - max(box.y0, area.y0) < 2.0, case
    numbers = [int(note.get_text().partition(":")[0]) for note in found]
    every = list(range(1, len(ODD[case][1]) + 1))
    if case != "120 pulses":
        assert numbers == every
    for number in set(every) - set(numbers):  # where there is no room: the label before it in its row is near
        pulse = ODD[case][1].pulses[number - 1]
        same = [n for n in numbers if ODD[case][1].pulses[n - 1].channel == pulse.channel and n < number]
        gap = axes.transData.transform((pulse.t - ODD[case][1].pulses[same[-1] - 1].t, 0.0))[0]
        assert gap - axes.transData.transform((0.0, 0.0))[0] < 30.0 * figure.dpi / 72.0


@pytest.mark.parametrize("case", ["blackouts", "16 channels", deep("one pulse")])
def test_rows_are_named_at_the_middle_of_their_bars(case: str) -> None:
    axes = drawn("timeline", case).axes[-1]
    middles = {
        round(float(np.mean(bars.get_paths()[0].get_extents().intervaly)), 9)
        for bars in axes.collections
        if not bars.get_hatch()
    }
    assert middles == {round(float(tick), 9) for tick in axes.get_yticks()}


def test_steering_angles_are_those_of_the_table_and_say_from_where() -> None:
    axes = drawn("timeline", "steered at the edges").axes[-1]
    assert "from body axis +1" in axes.get_title()
    angles = [float(found[1]) for note in axes.texts if (found := re.search(r"at ([\d.]+)°", note.get_text()))]
    pulses = ODD["steered at the edges"][1]
    expected = [round(math.degrees(math.atan2(p.impulse[1], p.impulse[0])) % 360.0, 2) for p in pulses]
    assert angles == expected


def joined_to(axes: Axes, note: Annotation, figure: Figure) -> Vector:
    """Where in its panel a label points: the end of its line, else the middle of the label itself; pixels."""
    box = note.get_window_extent()
    for one in axes.lines:
        if one.get_label() == "_leader":
            ends = np.asarray(axes.transData.transform(one.get_xydata()))
            if np.hypot(*np.maximum(np.maximum(box.p0 - ends[1], ends[1] - box.p1), 0.0)) < 1.0:
                return np.asarray(ends[0])
    return np.array([0.5 * (box.x0 + box.x1), 0.5 * (box.y0 + box.y1)])


@spread("case", ODD, quick=2, deep=4)
def test_each_direction_is_named_at_the_tip_of_its_own_arrow(case: str) -> None:
    """In its colour; by a thin line where the tips lie close together."""
    for name, panels in (("overview", [2]), ("sphere", [0, 1])):
        figure = drawn(name, case)
        texts(figure)
        for panel in panels:
            axes = figure.axes[panel]
            notes = {n.get_text(): n for n in bar_labels(axes) if n.get_text() in ("H", "ω", "spin axis")}
            assert len(notes) == 3, (case, name)
            assert [to_hex(notes[text].get_color()) for text in ("ω", "spin axis")] == [INK, MOTION.lower()]
            tips = {text: np.asarray(axes.transData.transform(note.xy)) for text, note in notes.items()}
            for text, note in notes.items():
                away = {other: np.hypot(*(joined_to(axes, note, figure) - tip)) for other, tip in tips.items()}
                assert away[text] <= min(away.values()) + 1.0, (case, name, text)


@spread(
    "case", [deep("one pulse"), deep("oblate"), "celestial", "blackouts", deep("120 pulses"), "16 channels"], quick=1
)
def test_each_number_belongs_to_its_own_stretch_of_the_path(case: str) -> None:
    body, pulses = ODD[case]
    made, track = figures.shown(planning.Plan(body, "trial", pulses))
    track = geometry.drawn(made, track)
    figure = drawn("motion", case)
    texts(figure)
    paths = (geometry.pole_path(track), geometry.sky_paths(made, track)[0])
    firings = {part.pulse + 1: part for part in geometry.stretches(made, track) if part.pulse is not None}
    for axes, path in zip(figure.axes[:2], paths, strict=True):
        notes = [note for note in bar_labels(axes) if note.get_text().isdigit()]
        if len(pulses) <= 10:
            assert sorted(int(note.get_text()) for note in notes) == list(range(1, len(pulses) + 1))
        for note in notes:
            place = joined_to(axes, note, figure)
            away = {}
            for number, part in firings.items():
                ends = path[part.first : part.last + 1]
                between = np.linspace(0.0, len(ends) - 1.0, 200)
                fine = [np.interp(between, np.arange(len(ends)), column) for column in ends.T]
                rows = axes.transData.transform(np.transpose(fine))
                away[number] = float(np.hypot(*(rows - place).T).min())
            assert away[int(note.get_text())] <= min(away.values()) + 3.0, (case, note.get_text())


# --- many pulses -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("count", "most"), [(1, 17), (10, 17), (34, 17), (120, 17), (457, 24), (2, 3), (1000, 3)])
def test_of_many_the_first_the_last_and_round_numbers_are_shown(count: int, most: int) -> None:
    shown = [number + 1 for number in style.thinned(count, most)]
    assert shown[0] == 1
    assert shown[-1] == count
    assert len(shown) <= most
    assert shown == sorted(set(shown))
    steps = set(np.diff(shown[1:-1]).tolist())
    assert len(steps) <= 1
    if count <= most - 1:
        assert shown == list(range(1, count + 1))


def test_firings_that_cannot_be_told_apart_are_drawn_as_one() -> None:
    """120 firings of 10 ms, 0.4 s apart, over a minute: bars thinner than a pixel would alias. Nothing is lost."""
    body, pulses = ODD["120 pulses"]
    made, track = figures.shown(planning.Plan(body, "trial", pulses))
    until = float(track.t[-1])
    every = geometry.blocks(made, until)
    assert [(block.first, block.last, block.many) for block in every] == [(1, 120, 120)]
    assert every[0].on == pytest.approx(1.2)
    assert (every[0].begins, every[0].ends) == pytest.approx((pulses.pulses[0].start, pulses.end))
    axes = drawn("history", "120 pulses").axes[0]
    assert len([patch for patch in axes.patches if to_hex(patch.get_facecolor()) == PULSE.lower()]) == 1
    apart = ODD["16 channels"]
    made, track = figures.shown(planning.Plan(apart[0], "trial", apart[1]))
    assert [block.many for block in geometry.blocks(made, float(track.t[-1]))] == [1] * 32
    # Two close together are still two bars.
    pair = replace(made, schedule=Schedule(kicks(BODY, 2, 0.01, 0.005).pulses))
    assert [block.many for block in geometry.blocks(pair, 100.0)] == [1, 1]


# --- cones -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ["three moments", deep("three moments, oblate"), deep("oblate"), "reversed"])
def test_cones_are_filled_from_their_apex_to_all_of_their_rim(case: str) -> None:
    body, _ = ODD[case]
    made, track = figures.shown(planning.Plan(body, "trial", ODD[case][1]))
    looked, found = sphere.view(made, track), geometry.cones(made, track.rates[0], track.quaternion[0])
    axes = drawn("sphere", case).axes[0]
    filled = [patch for patch in axes.patches if isinstance(patch, Polygon) and len(patch.get_xy()) > 3]
    assert len(filled) == 2
    for patch, rim, within in zip(filled, (found.space, found.body), (found.swept, found.body), strict=True):
        points = np.vstack([looked.seen(rim)[0], looked.seen(within)[0], [[0.0, 0.0]]])
        edges = np.diff(patch.get_xy(), axis=0)
        to_points = points[:, None, :] - patch.get_xy()[None, :-1, :]
        cross_product = edges[:, 0] * to_points[..., 1] - edges[:, 1] * to_points[..., 0]
        assert (cross_product >= -1e-12).all()  # convex, and nothing of the cone outside
        corners = {tuple(point) for point in points.round(12)}
        assert {tuple(point) for point in patch.get_xy().round(12)} <= corners


def test_the_sphere_names_its_lines() -> None:
    (legend,) = drawn("sphere", "reversed").legends
    named = {text.get_text() for text in legend.get_texts()}
    assert {"space cone", "body cone", "path of the spin axis", "pulse", "path of H"} <= named
    assert "plane of H, ω and spin axis" in named


def test_a_long_title_takes_more_lines() -> None:
    """Such as that of a schedule from a file, which names the file."""
    made, track = figures.shown(planning.Plan(spinner(), "schedules/of/the/second/attempt/" * 4, Schedule()))
    figure = figures.flight_figure("motion", made, track)
    title = figure.get_suptitle()
    assert "\n" in title
    assert max(map(len, title.split("\n"))) <= 11 * figure.get_figwidth()


# --- many turns ------------------------------------------------------------------------------------------------------


@pytest.mark.deep
def test_the_log_axis_reaches_the_requirement_and_what_is_left() -> None:
    """Whichever is less, four decades down at most; what lies below is written above the panel."""
    for degrees, bound, left in ((5.0, 0.01, None), (5.0, 1e-6, None), (5.0, None, None), (0.0, 0.01, 0.0)):
        body = spinner(degrees=degrees, requirement=Requirement(bound) if bound else None)
        figure = figures.flight_figure("history", *figures.shown(planning.Plan(body, "none", Schedule())))
        axes = figure.axes[-1]
        low, high = axes.get_ylim()
        assert high >= 10.0 * low
        assert bound is None or low < math.degrees(bound)
        assert low < degrees < high or left == 0.0
        assert axes.get_title("right").endswith(" s: 0 deg") == (left == 0.0)


@pytest.mark.deep
def test_many_turns_are_drawn_thin() -> None:
    widths = []
    for until in (5.0, 60.0, 600.0):
        made = flight.flown(spinner(), Schedule(), until)
        space = figures.flight_figure("motion", made, made.sampled(1000, until)).axes[1]
        widths.append(next(line.get_linewidth() for line in space.lines if line.get_label() == "path"))
    assert widths[0] > widths[1] > widths[2]


@pytest.mark.weekly
def test_where_h_moves_little_it_is_shown_enlarged() -> None:
    figure = drawn("motion", "120 pulses")
    body, space, inset = figure.axes
    made, track = figures.shown(planning.Plan(*ODD["120 pulses"][:1], "trial", ODD["120 pulses"][1]))
    _, momentum = geometry.sky_paths(made, track)
    (left, right), (low, high) = inset.get_xlim(), inset.get_ylim()
    assert ((momentum >= [left, low]) & (momentum <= [right, high])).all()
    much = re.search(r"× ([\d.]+)", inset.get_title())
    assert much is not None
    ratio = np.ptp(space.get_xlim()) / (right - left)
    assert float(much[1]) == pytest.approx(ratio, rel=0.06)
    assert ratio > 5.0
    frames = [line for line in space.lines if len(np.asarray(line.get_xdata())) == 5]
    assert any(np.asarray(line.get_xdata()).max() == pytest.approx(right) for line in frames)
    assert len(drawn("motion", "far target").axes) == 2
    assert body.get_aspect() == inset.get_aspect() == 1.0


# --- colours ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", [weekly("reversed"), "far target", weekly("120 pulses")])
@pytest.mark.parametrize("name", NAMES)
def test_words_and_swatches_can_be_seen_on_white_and_in_the_dark(name: str, case: str) -> None:
    check_colours(drawn(name, case))
    assert all(contrast(GREY, paper) > 3.0 for paper, _ in pages())


@spread("case", ODD, quick=2, deep=4)
def test_odd_flights_are_drawn_whole(case: str) -> None:
    """All words inside the sheet, and none over another in the same panel."""
    for name in NAMES:
        check_layout(drawn(name, case))


@spread(("required", "beside"), [(0.02, False), (0.12, True)], quick=1)
def test_a_required_nutation_above_the_angles_is_written_there(required: float, beside: bool) -> None:
    body = spinner(channels=cross(20.0), requirement=Requirement(required))  # 5° of nutation, 0.087 rad
    figure = figures.flight_figure("history", *figures.shown(planning.plan(body, "two-pulse")))
    check_layout(figure)
    cones, decay = figure.axes[2:]
    said = f"required θ {math.degrees(required):.4g}°, outside the view"
    assert (cones.get_title(loc="right") == said) is beside
    for axes, drawn in ((cones, not beside), (decay, True)):
        levels = [float(np.asarray(one.get_ydata())[0]) for one in axes.lines if one.get_label() == "required θ"]
        assert levels == pytest.approx([math.degrees(required)] * drawn)
        assert all(axes.get_ylim()[0] < level < 0.99 * axes.get_ylim()[1] for level in levels)
    assert "required θ" in {text.get_text() for text in figure.legends[0].get_texts()}


@spread("azimuth", [0.0, 5.0, 355.0, 8.0], quick=1)
def test_no_label_lies_under_the_star_of_the_target(azimuth: float) -> None:
    body = aimed(spinner(channels=cross(20.0)), 6.0, azimuth)  # 5° of nutation: it is beside the spin axis at t = 0
    axes = figures.flight_figure("motion", *figures.shown(planning.Plan(body, "kicks", kicks(body, 5, 0.9, 0.2)))).axes[
        1
    ]
    (star,) = (one for one in axes.lines if one.get_label() == "target")
    middle = axes.transData.transform(star.get_xydata())[0]
    radius = 0.45 * star.get_markersize() * axes.figure.dpi / 72.0
    for note in axes.texts:
        box = note.get_window_extent()
        nearest = np.clip(middle, [box.x0, box.y0], [box.x1, box.y1])
        assert np.hypot(*(nearest - middle)) > radius, note.get_text()
