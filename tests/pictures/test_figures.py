"""Figures: what their lines hold, that nothing overlaps or is cut, files and inline SVG."""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import cache
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from support import places
from support.builders import cross, fan, spinner
from support.cases import deep, spread
from support.layout import check_layout

from nutdamp import flight, planning
from nutdamp.comparison import compare
from nutdamp.errors import BadRequest, MissingExtra
from nutdamp.files.spacecraft_file import load_spacecraft
from nutdamp.flight import Flight
from nutdamp.physics.attitude import angle_between
from nutdamp.presentation import figures, geometry
from nutdamp.presentation.figures import sphere
from nutdamp.presentation.figures.export import _brief
from nutdamp.schedule import Schedule
from nutdamp.schemes import CLASSIC
from nutdamp.spacecraft import Goal, Limits, Requirement, Spacecraft, Steerable, Vector
from nutdamp.track import Track

pytestmark = pytest.mark.usefixtures("plans_shared")

NAMES = ("overview", "motion", "sphere", "history", "timeline")

CASES: dict[str, tuple[Spacecraft, str]] = {
    "wide pulses": (spinner(channels=cross(20.0), requirement=Requirement(0.01)), "two-pulse"),
    "34 pulses": (spinner(degrees=8.0, channels=cross(20.0, max_on_time=0.05)), "four-pulse"),
    "nine channels": (spinner(degrees=8.0, channels=fan(9, 20.0)), "four-pulse"),
    "oblate, reversed": (spinner(80, 120, -3.0, 10.0, channels=cross(20.0)), "four-pulse"),
    "needle at 60°": (spinner(239, 6.01, 4.2, 60.0, channels=cross(40.0)), "four-pulse"),
    "ideal impulses": (spinner(80, 120, 3.0, 75.0, steerable=Steerable()), "two-pulse"),
    "0.01°": (spinner(degrees=0.01, channels=cross(1.0)), "two-pulse"),
    "three moments": (spinner(moments=(120, 100, 80), degrees=25.0, channels=cross(40.0)), "two-pulse"),
    "sphere": (spinner(100, 100, 3.0, 10.0, steerable=Steerable(50.0)), "two-pulse"),
    "blackouts": (
        spinner(channels=cross(20.0), limits=Limits(earliest=1.0, blackout=((3.0, 4.5), (20.0, 25.0)))),
        "four-pulse",
    ),
    "pointed": (
        replace(pointing := spinner(channels=cross(20.0)), goal=Goal(pointing.direction_in_n(0.14, 1.0))),
        "optimal",
    ),
    "no pulses": (spinner(channels=cross(20.0)), "none"),
    "no nutation": (spinner(degrees=0.0, channels=cross(20.0)), "none"),
    "long name": (replace(spinner(channels=cross(20.0)), name="$x$ of a\nprogramme_with 測 " * 5), "one-pulse"),
}


LAID_OUT = [
    *(("overview", case) for case in CASES),
    *((name, case) for name in NAMES[1:] for case in ("34 pulses", "oblate, reversed", "ideal impulses", "long name")),
]
"""Figures whose layout is looked at; the overview holds all panels."""


@cache
def flown(case: str) -> tuple[Flight, Track]:
    body, scheme = CASES[case]
    return fly(body, planning.plan(body, scheme).pulses)


def fly(body: Spacecraft, pulses: Schedule, until: float | None = None) -> tuple[Flight, Track]:
    end = pulses.end + body.inertial_period if until is None else until
    made = flight.flown(body, pulses, end)
    return made, made.sampled(1000, end)


@cache
def drawn(name: str, case: str) -> Figure:
    return figures.flight_figure(name, *flown(case))


def panel(figure: Figure, title: str) -> Axes:
    (found,) = (axes for axes in figure.axes if axes.get_title().startswith(title))
    return found


def line(axes: Axes, name: str) -> Vector:
    (found,) = (one for one in axes.lines if one.get_label() == name)
    data = np.asarray(found.get_xydata())
    return np.asarray(data[np.isfinite(data).all(axis=1)], dtype=np.float64)


def numbers(axes: Axes) -> list[int]:
    """Numbers of pulses that are to be seen in a panel."""
    notes = (note for note in axes.texts if note.get_visible())
    return sorted(int(note.get_text()) for note in notes if note.get_text().isdigit())


# --- what is drawn ---------------------------------------------------------------------------------------------------


@spread("case", ["wide pulses", "oblate, reversed", "ideal impulses", "three moments"], quick=1)
def test_path_and_pulses_together_are_the_track_in_degrees(case: str) -> None:
    made, track = flown(case)
    body, space, *_ = drawn("motion", case).axes
    rates = np.degrees(track.rates[:, :2])
    for axes, rows in ((body, rates), (space, geometry.sky_paths(made, track)[0])):
        points = {tuple(point) for name in ("path", "pulse") for point in line(axes, name).round(9)}
        assert points == {tuple(point) for point in rows.round(9)}
    firing = np.zeros(len(track.t), dtype=bool)
    for begins, ends in made.spans:
        firing |= (track.t >= begins) & (track.t <= ends)
    pulses = {tuple(point) for point in line(body, "pulse").round(9)}
    assert pulses == {tuple(point) for point in rates[firing].round(9)}


def test_the_axis_track_ends_where_h_and_the_spin_axis_end() -> None:
    made, track = flown("wide pulses")
    space = panel(drawn("motion", "wide pulses"), "Axis track")
    away = np.degrees(angle_between(track.axis, track.momentum[0]))
    assert np.hypot(*line(space, "path")[0]) == pytest.approx(away[0])
    assert line(space, "H at t = 0 and after each pulse")[0] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert len(line(space, "H at t = 0 and after each pulse")) == len(made.schedule) + 1
    shift = np.degrees(made.residual.momentum_shift)
    assert np.hypot(*line(space, "H at t = 0 and after each pulse")[-1]) == pytest.approx(shift, abs=1e-9)


@pytest.mark.weekly
def test_the_target_is_marked_where_h_ends() -> None:
    space = panel(drawn("motion", "pointed"), "Axis track")
    (target,) = line(space, "target")
    assert np.degrees(0.14) * np.array([np.cos(1.0), np.sin(1.0)]) == pytest.approx(target)
    assert line(space, "H at t = 0 and after each pulse")[-1] == pytest.approx(target, abs=1e-6)


@spread(
    ("name", "case"),
    [deep(*one) if number % 8 else one for number, one in enumerate(LAID_OUT) if one[0] != "timeline"],
    quick=1,
    deep=2,
)
def test_planes_have_equal_scales_and_all_axes_their_units(name: str, case: str) -> None:
    for axes in drawn(name, case).axes:
        if axes.get_title().startswith(("Pole", "Axis", "The same", "Cones")):
            assert axes.get_aspect() == 1.0
            width, height = axes.get_window_extent().size
            (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
            assert width / (right - left) == pytest.approx(height / (high - low), rel=1e-3)
        if axes.axison:
            shared = [one for one in axes.get_shared_x_axes().get_siblings(axes) if one.get_xlabel()]
            assert any(re.search(r", deg|, deg/s|time, s", one.get_xlabel()) for one in shared)
            assert re.search(r", deg", axes.get_ylabel()) or axes.get_title().startswith("Firings")


@pytest.mark.weekly
def test_the_pole_curve_shows_where_the_channels_push() -> None:
    """+M2 up, -M1 left, by the file's names; only those that fire."""
    axes = panel(drawn("motion", "34 pulses"), "Pole curve")
    notes = [note for note in axes.texts if isinstance(note, Annotation)]
    places = {note.get_text(): np.array(note.xy) for note in notes if note.get_text() in ("+1", "-1", "+2", "-2")}
    assert len(places) == 4
    for name, way in (("+1", (1, 0)), ("-1", (-1, 0)), ("+2", (0, 1)), ("-2", (0, -1))):
        assert places[name] / np.linalg.norm(places[name]) == pytest.approx(way, abs=1e-9)
    few = panel(drawn("motion", "nine channels"), "Pole curve")
    used = {pulse.channel for pulse in flown("nine channels")[0].schedule}
    assert {note.get_text() for note in few.texts if note.get_text().startswith("T")} == used


@spread("case", ["wide pulses", "oblate, reversed", "blackouts"], quick=1)
def test_few_pulses_are_all_numbered(case: str) -> None:
    every = list(range(1, len(flown(case)[0].schedule) + 1))
    rates = drawn("history", case).axes[0]
    assert numbers(rates) == every
    (firings,) = drawn("timeline", case).axes
    told = [note.get_text() for note in firings.texts if note.get_visible()]
    assert sorted(int(text.partition(":")[0]) for text in told) == every


def test_of_many_pulses_those_are_numbered_that_can_be_read() -> None:
    made, _ = flown("34 pulses")
    assert len(made.schedule) == 34
    body, space, *_ = drawn("motion", "34 pulses").axes
    assert 1 <= len(numbers(body)) <= 16
    assert 1 <= len(numbers(space)) <= 16
    assert len(drawn("timeline", "34 pulses").axes[0].collections) == 34


def test_bars_stand_where_the_thrusters_are_on() -> None:
    made, _ = flown("blackouts")
    (axes,) = drawn("timeline", "blackouts").axes
    names = [label.get_text() for label in axes.get_yticklabels()]
    rows = dict(zip(names, axes.get_yticks(), strict=True))
    bars = [one for one in axes.collections if not one.get_hatch()]
    for bar, pulse in zip(bars, made.schedule, strict=True):
        box = bar.get_paths()[0].get_extents()
        assert (box.x0, box.x1) == pytest.approx((pulse.start, pulse.end))
        assert box.y0 < rows[pulse.channel] < box.y1
    hatched = {
        (float(box.x0), float(box.x1))
        for one in axes.collections
        if one.get_hatch()
        for box in [one.get_paths()[0].get_extents()]
    }
    assert {(0.0, 1.0), (3.0, 4.5)} <= hatched


def test_histories_hold_the_track() -> None:
    _, track = flown("three moments")
    rates, spin, cones, decay = drawn("history", "three moments").axes
    for axes, name, values in (
        (rates, "ω1", track.rates[:, 0]),
        (rates, "ω2", track.rates[:, 1]),
        (spin, "ω3", track.rates[:, 2]),
        (cones, "nutation θ = μ + λ", track.nutation),
        (cones, "body cone μ", track.body_cone),
        (cones, "space cone λ", track.space_cone),
    ):
        assert line(axes, name) == pytest.approx(np.column_stack([track.t, np.degrees(values)]))
    (logged,) = (one for one in decay.lines if len(np.asarray(one.get_xdata())) == len(track.t))
    seen = np.asarray(logged.get_ydata()) >= decay.get_ylim()[0]
    assert decay.get_yscale() == "log"
    assert np.asarray(logged.get_ydata())[seen] == pytest.approx(np.degrees(track.nutation[seen]))
    assert (np.degrees(track.nutation[~seen]) <= decay.get_ylim()[0]).all()


def test_a_constant_spin_is_drawn_as_a_straight_line() -> None:
    """Not as its rounding, blown up to the height of the panel."""
    spin = drawn("history", "wide pulses").axes[1]
    low, high = spin.get_ylim()
    assert high - low > 0.01 * np.degrees(3.0)


@pytest.mark.deep
def test_of_a_very_long_time_the_axis_says_how_much_is_drawn() -> None:
    body, _ = CASES["no pulses"]
    made, track = fly(body, Schedule(), 1e6)
    figure = figures.flight_figure("history", made, track)
    until = re.search(r"the first ([\d.]+) of 1e\+06", figure.axes[-1].get_xlabel())
    assert until is not None
    assert float(until[1]) == pytest.approx(figure.axes[-1].get_xlim()[1], rel=1e-3)
    # The pictures without a time axis say so too: what they end with is not what is left.
    heading = figures.flight_figure("motion", made, track).get_suptitle()
    assert heading.endswith(f"drawn: the first {until[1]} s of 1e+06 s")
    assert "drawn" not in drawn("motion", "wide pulses").get_suptitle()


# --- the spherical view ----------------------------------------------------------------------------------------------


@spread("case", [deep(case) if number % 4 else case for number, case in enumerate(CASES)], quick=1)
def test_what_is_magnified_says_so(case: str) -> None:
    made, track = flown(case)
    looked = sphere.view(made, track)
    (title,) = (axes.get_title() for axes in drawn("overview", case).axes if axes.get_title().startswith("Cones"))
    told = re.search(r"angles × (\S+)\)", title)
    assert (float(told[1]) if told else 1.0) == looked.magnified


@pytest.mark.parametrize("widest", np.radians([1e-7, 1e-3, 0.01, 0.3, 1.0, 5.0, 13.9, 14.1, 80.0]))
def test_the_magnification_fills_the_view_and_not_more(widest: float) -> None:
    much = sphere.magnification(float(widest))
    if widest >= sphere.WIDE:
        assert much == 1.0
    else:
        assert 0.4 * np.tan(sphere.DRAWN) < much * np.tan(widest) <= np.tan(sphere.DRAWN) * (1 + 1e-9)


def test_seen_from_outside_the_three_axes_lie_in_one_plane_and_the_cones_touch() -> None:
    """Whatever the magnification: on paper the rims have one tangent where ω ends."""
    for case in ("0.01°", "wide pulses", "needle at 60°"):
        made, track = flown(case)
        looked, found = sphere.view(made, track), geometry.cones(made, track.rates[0], track.quaternion[0])
        tip = looked.seen(found.rotation)[0][0]
        tangents = []
        for axis in (found.axis, found.momentum):
            step = 1e-5 * np.cross(axis, found.rotation)
            tangents.append(looked.seen(found.rotation + step)[0][0] - looked.seen(found.rotation - step)[0][0])
        cross_product = tangents[0][0] * tangents[1][1] - tangents[0][1] * tangents[1][0]
        assert abs(cross_product) < 1e-6 * np.linalg.norm(tangents[0]) * np.linalg.norm(tangents[1])
        assert np.isfinite(tip).all()


# --- nothing overlaps, nothing is cut --------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:Glyph .* missing")  # of the name in another script
@spread(("name", "case"), [deep(*one) if number % 4 else one for number, one in enumerate(LAID_OUT)], quick=1, deep=2)
def test_no_text_is_cut_or_covers_another(name: str, case: str) -> None:
    check_layout(drawn(name, case))


@pytest.mark.weekly
@pytest.mark.parametrize("path", sorted((places.CONFIGS).glob("*.yaml")), ids=lambda path: path.stem)
def test_no_text_is_cut_in_the_pictures_of_the_configs(path: Path) -> None:
    body = load_spacecraft(str(path))
    for plan in compare(body, CLASSIC).plans:
        if plan.feasible:
            made, track = fly(body, plan.pulses)
            for name in NAMES:
                check_layout(figures.flight_figure(name, made, track))


# --- files -----------------------------------------------------------------------------------------------------------


def test_a_path_that_goes_straight_back_is_drawn_once() -> None:
    """Out, back, and aside: dashes both ways would look like a solid line."""
    out = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
    gap = [np.nan, np.nan]
    np.testing.assert_array_equal(geometry.once(out), [[0, 0], [0, 0], [1, 0], gap, [0, 0], [0, 1]])
    turn = np.linspace(0.0, 2 * np.pi, 50)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    np.testing.assert_array_equal(geometry.once(circle), circle)


@pytest.mark.parametrize(
    ("path", "magic"), [("a.png", b"\x89PNG"), ("b.SVG", b"<?xml"), ("c.d.pdf", b"%PDF"), ("-", b"\x89PNG")]
)
def test_the_ending_says_the_format(path: str, magic: bytes) -> None:
    figure = drawn("timeline", "no pulses")
    assert figures.rendered(figure, path).startswith(magic)


@pytest.mark.parametrize("path", ["a.bmp", "a", "png", "a.png.gz", ".png"])
def test_other_endings_are_refused_with_those_that_work(path: str) -> None:
    with pytest.raises(BadRequest, match=r"\.png, \.svg, \.pdf"):
        figures.rendered(drawn("timeline", "no pulses"), path)


@pytest.mark.parametrize("path", ["a.png", "a.svg", "a.pdf"])
def test_the_same_flight_gives_the_same_file(path: str) -> None:
    first, second = (figures.rendered(drawn("timeline", "blackouts"), path) for _ in range(2))
    assert first == second


def test_without_matplotlib_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for call in (
        lambda: figures.rendered(drawn("motion", "no pulses"), "a.png"),
        lambda: figures.flight_figure("motion", *flown("no pulses")),
        lambda: figures.ending("a.png"),
    ):
        with pytest.raises(MissingExtra, match=re.escape("pip install 'nutdamp[plot]'")):
            call()


def test_settings_of_the_user_change_nothing() -> None:
    plain = figures.rendered(drawn("timeline", "blackouts"), "a.png")
    with mpl.rc_context({"axes.facecolor": "red", "font.size": 20, "text.usetex": True, "savefig.dpi": 10}):
        assert figures.rendered(drawn("timeline", "blackouts"), "a.png") == plain
        assert mpl.rcParams["font.size"] == 20


def test_long_lines_are_short_in_a_page_and_stay_in_place() -> None:
    generator = np.random.default_rng(3)
    places = np.cumsum(generator.normal(scale=4.0, size=(900, 2)), axis=0)
    commands = ["M" if row in (0, 300) else "L" for row in range(len(places))]
    path = " \n".join(f"{name} {x:.6f} {y:.6f}" for name, (x, y) in zip(commands, places, strict=True))
    brief = _brief(path)
    assert len(brief) < 0.45 * len(path)
    here, found = np.zeros(2), []
    for name, numbers in re.findall(r"([A-Za-z])([^A-Za-z]*)", brief):
        for pair in np.reshape([float(one) for one in re.findall(r"-?[\d.]+", numbers)], (-1, 2)):
            here = pair if name == "M" else here + pair
            found.append(here)
    assert np.abs(np.array(found) - places).max() <= 0.0501
    assert [name for name in brief if name.isalpha()] == ["M", "l", "M", "l"]
    assert _brief("M 0 0 \nL 1.23456 3.5 \nz") == "M 0 0L 1.23 3.5z"


def test_inline_svg_stands_in_any_page() -> None:
    """As wide as what holds it, in the colour of the text around, and no rule or id of it meets another's."""
    shown = [figures.svg(drawn("motion", "wide pulses")), figures.svg(drawn("timeline", "blackouts"))]
    ids: list[set[str]] = []
    for text in shown:
        assert text.startswith("<svg ")
        root = ET.fromstring(text)
        assert root.get("width") == "100%"
        assert root.get("height") is None
        assert root.get("viewBox")
        assert "<style" not in text
        assert "<metadata" not in text
        assert "currentColor" in text
        assert "#1a1a1a" not in text
        own = [element.get("id", "") for element in root.iter() if element.get("id")]
        assert len(own) == len(set(own))
        used = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', text))
        assert used <= set(own)
        ids.append(set(own))
    assert not ids[0] & ids[1]
