"""Figures of flights: labels, many pulses, that nothing overlaps or is cut and all can be seen."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from support import places
from support.builders import aimed, spinner
from support.cases import deep, weekly
from support.colours import check_colours, contrast, pages
from support.layout import check_layout, texts
from support.shown import BODY, CASES, NAMES, STEERED, WIDE, check_star, drawn, flight_picture, flown, kicks, notes

from nutdamp.figures import geometry, overview, style
from nutdamp.figures.overview import together
from nutdamp.figures.style import GREY, INK, PULSE
from nutdamp.files.reader import load_spacecraft
from nutdamp.flight import propagation
from nutdamp.planning.decision import compare
from nutdamp.schemes.catalogue import CLASSIC
from nutdamp.spacecraft.schedule import Schedule

pytestmark = [
    pytest.mark.usefixtures("plans_shared"),
    pytest.mark.filterwarnings("ignore:Glyph .* missing"),  # of a name in another script
]


# --- labels ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("role", "complete"), [("vital", True), ("label", False)])
def test_vital_labels_are_never_left_out_and_others_where_there_is_no_room(role: str, complete: bool) -> None:
    figure = Figure((3.0, 2.0), layout="constrained")
    axes = figure.subplots()
    for number in range(30):
        style.add(axes, f"label {number}", np.full(2, 0.5), INK, role=role)
    style.settle(figure)
    assert all(one.get_visible() for one in axes.texts) == complete


@pytest.mark.parametrize(
    ("name", "case"),
    [
        *(("history", "blackouts"), deep("history", "120 pulses"), deep("overview", "blackouts")),
        *(weekly("overview", case) for case in ("16 channels", "steered", "one pulse", "reversed")),
        *(weekly("history", case) for case in ("16 channels", "steered", "one pulse", "reversed")),
        weekly("overview", "120 pulses"),
    ],
)
def test_labels_of_firings_have_room(name: str, case: str) -> None:
    """Inside the panel, on no other label, no bar and no hatching; every pulse has one where there is room."""
    figure = drawn(name, case)
    texts(figure)
    axes = next(axes for axes in figure.axes if axes.collections and not axes.get_ylabel())
    window, found = axes.get_window_extent(), notes(axes)
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
        assert numbers == list(range(1, len(pulses) + 1))
    for number in {*range(1, len(pulses) + 1)} - {*numbers}:  # no room: the label before it in its row is near
        pulse = pulses[number - 1]
        before = [pulses[n - 1] for n in numbers if pulses[n - 1].channel == pulse.channel and n < number][-1]
        gap = np.diff(axes.transData.transform([(0.0, 0.0), (pulse.t - before.t, 0.0)])[:, 0])[0]
        assert gap < 30.0 * figure.dpi / 72.0


def test_steering_angles_are_those_of_the_table_and_say_from_where() -> None:
    pulses = flown("steered")[0].schedule.pulses[::2]
    axes = flight_picture("history", STEERED, Schedule(pulses)).axes[1]
    assert "from body axis +1" in axes.get_title("right")
    angles = [float(said[1]) for note in axes.texts if (said := re.search(r"at ([\d.]+)°", note.get_text()))]
    impulses = [pulse.impulse for pulse in pulses]
    assert angles == [round(math.degrees(math.atan2(one[1], one[0])) % 360.0, 2) for one in impulses]


def number_of(note: Annotation) -> int:
    """The number of a firing; the first says what it is."""
    return int(note.get_text().removeprefix("firing "))


@pytest.mark.deep
@pytest.mark.parametrize("case", ["celestial", "oblate", "reversed", "wide pulses"])
def test_each_number_belongs_to_its_own_stretch_of_the_path(case: str) -> None:
    made, track = flown(case)
    figure = drawn("motion", case)
    texts(figure)
    firings = {part.pulse + 1: part for part in geometry.stretches(made, track) if part.pulse is not None}
    paths = (geometry.pole_path(track), geometry.sky_paths(made, track)[0])
    for axes, path in zip(figure.axes[:2], paths, strict=True):
        numbered = [note for note in notes(axes) if note.get_text().removeprefix("firing ").isdigit()]
        if len(firings) <= 10:
            assert sorted(number_of(note) for note in numbered) == list(range(1, len(firings) + 1))
        for note in numbered:
            box, away = note.get_window_extent(), {}
            place = 0.5 * (box.p0 + box.p1)
            for number, part in firings.items():
                ends = path[part.first : part.last + 1]
                fine = [np.interp(np.linspace(0.0, len(ends) - 1.0, 200), range(len(ends)), way) for way in ends.T]
                away[number] = np.hypot(*(axes.transData.transform(np.transpose(fine)) - place).T).min()
            assert away[number_of(note)] <= min(away.values()) + 3.0, (case, note.get_text())


@pytest.mark.deep
@pytest.mark.parametrize("azimuth", [0.0, weekly(5.0), weekly(355.0), weekly(8.0)])
def test_no_label_lies_under_the_star_of_the_target(azimuth: float) -> None:
    body = aimed(WIDE, 6.0, azimuth)  # 5° of nutation: it is beside the spin axis at t = 0
    axes = flight_picture("motion", body, kicks(body, 5, 0.9, 0.2)).axes[1]
    (star,) = (one for one in axes.lines if one.get_label() == "target")
    check_star(axes, np.asarray(star.get_xydata())[0], 0.45 * star.get_markersize())


# --- many pulses, many turns -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("count", "most"), [(1, 17), (10, 17), (34, 17), (120, 17), (457, 24), (2, 3), (1000, 3)])
def test_of_many_the_first_the_last_and_round_numbers_are_shown(count: int, most: int) -> None:
    shown = [number + 1 for number in style.thinned(count, most)]
    assert (shown[0], shown[-1]) == (1, count)
    assert len(shown) <= most
    assert shown == sorted(set(shown))
    assert len(set(np.diff(shown[1:-1]).tolist())) <= 1
    assert count > most - 1 or shown == list(range(1, count + 1))


def test_pulses_in_one_place_of_a_path_have_one_number() -> None:
    """Three in a row at least, each beside the one before; with more than can be numbered, none are gathered."""
    near, far = np.zeros(2), np.array([1.0, 0.0])
    assert together([far, near, near, near, far], 2.0) == [[0], [1, 2, 3], [4]]
    assert together([near, near, far, far], 2.0) == [[0], [1], [2], [3]]
    assert together([far * 0.09 * step for step in range(4)], 2.0) == [[0, 1, 2, 3]]
    assert all(len(group) == 1 for group in together([near] * 40, 2.0))


@pytest.mark.deep
def test_firings_that_cannot_be_told_apart_are_drawn_as_one() -> None:
    """120 firings of 10 ms, 0.4 s apart, over a minute: bars thinner than a pixel would alias. Nothing is lost."""
    made, track = flown("120 pulses")
    every = geometry.blocks(made, float(track.t[-1]))
    assert [(block.first, block.last, block.many) for block in every] == [(1, 120, 120)]
    assert every[0].on == pytest.approx(1.2)
    assert (every[0].begins, every[0].ends) == pytest.approx((made.schedule.pulses[0].start, made.schedule.end))
    patches = drawn("history", "120 pulses").axes[2].patches
    assert len([patch for patch in patches if to_hex(patch.get_facecolor()) == PULSE.lower()]) == 1
    apart, track = flown("16 channels")
    assert [block.many for block in geometry.blocks(apart, float(track.t[-1]))] == [1] * 32
    pair = replace(made, schedule=Schedule(kicks(BODY, 2, 0.01, 0.005).pulses))  # close together, yet two bars
    assert [block.many for block in geometry.blocks(pair, 100.0)] == [1, 1]


@pytest.mark.deep
def test_many_turns_are_drawn_thin() -> None:
    widths = []
    for until in (5.0, 60.0, 600.0):
        made = propagation.flown(spinner(), Schedule(), until)
        space = overview.flight_figure("motion", made, made.sampled(1000, until)).axes[1]
        widths.append(next(line.get_linewidth() for line in space.lines if line.get_label() == "path"))
    assert widths[0] > widths[1] > widths[2]


@pytest.mark.deep
def test_where_h_moves_little_it_is_shown_enlarged() -> None:
    body, space = drawn("motion", "120 pulses").axes
    inset: Any = space.child_axes[0]
    _, momentum = geometry.sky_paths(*flown("120 pulses"))
    (left, right), (low, high) = inset.get_xlim(), inset.get_ylim()
    assert ((momentum >= [left, low]) & (momentum <= [right, high])).all()
    much = re.search(r"× ([\d.]+)", inset.get_title())
    assert much is not None
    widths = [panel.get_window_extent().width / np.ptp(panel.get_xlim()) for panel in (inset, space)]
    ratio = widths[0] / widths[1]
    assert ratio > 5.0
    assert float(much[1]) == pytest.approx(ratio, rel=0.06)
    assert body.get_aspect() == inset.get_aspect() == 1.0


# --- nothing overlaps, nothing is cut, all is seen -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "case"),
    [
        ("history", "blackouts"),
        *(deep("overview", case) for case in ("three moments", "far target", "long name")),
        *(deep(name, "34 pulses") for name in NAMES[1:]),
        *(weekly(name, case) for case in CASES for name in NAMES),
    ],
)
def test_no_text_is_cut_or_covers_another_and_no_number_is_minus_zero(name: str, case: str) -> None:
    check_layout(drawn(name, case))
    assert not [text for text, _ in texts(drawn(name, case)) if re.fullmatch(r"[-−]0(\.0*)?", text.get_text())]


@pytest.mark.weekly
@pytest.mark.parametrize("path", sorted(places.CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_no_text_is_cut_in_the_pictures_of_the_configs(path: Path) -> None:
    body = load_spacecraft(str(path))
    for plan in (plan for plan in compare(body, CLASSIC).plans if plan.feasible):
        for name in NAMES:
            check_layout(flight_picture(name, body, plan.pulses))


@pytest.mark.parametrize("case", [weekly("reversed"), "far target", weekly("120 pulses")])
@pytest.mark.parametrize("name", [*map(deep, NAMES[:2]), "history"])
def test_words_and_swatches_can_be_seen_on_white_and_in_the_dark(name: str, case: str) -> None:
    check_colours(drawn(name, case))
    assert all(contrast(GREY, paper) > 3.0 for paper, _ in pages())
