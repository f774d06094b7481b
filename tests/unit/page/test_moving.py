"""The rows of the moving view, without a browser: they are those of ``simulate``, and lie where the scales say."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import shlex
from dataclasses import replace
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import places
from support.markup import parsed
from support.pages import plain_page
from support.places import case
from support.process import Run

from nutdamp.comparison import compare
from nutdamp.files.examples import example_text
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.presentation.page import moving
from nutdamp.presentation.page.document import Section
from nutdamp.presentation.page.html import page_html
from nutdamp.presentation.page.moving import MOST_ROWS, NONE, SPHERE, Circle, Moving, Named, moving_of
from nutdamp.presentation.page.scales import EDGES
from nutdamp.schemes import CLASSIC

pytestmark = pytest.mark.usefixtures("plans_shared")

PAGE = Path(moving.__file__).parent
CONFIGS = places.CONFIGS

TARGET = case("far-target.yaml").read_text(encoding="utf-8")
THREE = """name: Three moments
inertia: {tensor: [[120, 3, 0], [3, 100, 0], [0, 0, 60]]}
state: {spin: 6 rpm, nutation: 20 deg}
steerable: {torque: 20 N m}
"""
SINGLE = """name: One thruster, spin reversed
inertia: {A: 80, C: 120}
state: {spin: -30 rpm, nutation: 3 deg}
thrusters: [{name: T1, torque: [0, 12, 0]}]
limits: {max_pulses: 1}
"""
CALM = "name: Calm\ninertia: {A: 120, C: 80}\nomega0: [0, 0, 3]\n"
SMALL = "name: Small\ninertia: {A: 120, C: 80}\nstate: {spin: 30 rpm, nutation: 0.0004 deg}\n"
STEEP = (CONFIGS / "sounding-rocket-payload.yaml").read_text(encoding="utf-8")
LEAP = (CONFIGS / "single-thruster.yaml").read_text(encoding="utf-8")
TEXTS = {
    "example": example_text(),
    "target": TARGET,
    "three": THREE,
    "single": SINGLE,
    "calm": CALM,
    "small": SMALL,
    "steep": STEEP,
    "leap": LEAP,
}


def view(text: str) -> Moving:
    chosen = compare(read_spacecraft(text, "craft.yaml"), CLASSIC).recommended
    assert chosen is not None
    return moving_of(chosen)


def rows_of(made: Moving) -> tuple[dict[str, Any], dict[str, list[int]]]:
    """The data, and its columns as the script adds them up."""
    data = json.loads(made.data)
    return data, {name: list(accumulate(steps)) for name, steps in data["columns"].items()}


def simulated(run: Run, text: str, made: Moving) -> list[dict[str, str]]:
    """What the command in the caption writes."""
    command = " ".join(made.command).replace("SPACECRAFT", "-").removesuffix("FILE")
    done = run(*shlex.split(command)[1:], "-", "-q", stdin=text)
    assert done.returncode in (0, 4), done.stderr
    return list(csv.DictReader(io.StringIO(done.stdout)))


@pytest.mark.parametrize("name", TEXTS)
def test_each_row_is_that_of_simulate(run: Run, name: str) -> None:
    made = view(TEXTS[name])
    data, rows = rows_of(made)
    track = simulated(run, TEXTS[name], made)
    assert {len(column) for column in rows.values()} == {len(track)}
    digits = data["digits"]
    for column, key, points in (
        ("t", "t_s", digits["t"]),
        ("theta", "nutation_deg", digits["cone"]),
        ("mu", "body_cone_deg", digits["cone"]),
        ("lambda", "space_cone_deg", digits["cone"]),
    ):
        shown = [f"{value / 10**points:.{points}f}" for value in rows[column]]
        assert shown == [f"{float(row[key]):z.{points}f}" for row in track]
    axis = np.array([[float(row[f"axis_{part}"]) for part in "xyz"] for row in track])
    momentum = np.array([[float(row[f"momentum_{part}_Nms"]) for part in "xyz"] for row in track])
    momentum /= np.linalg.norm(momentum, axis=1, keepdims=True)
    for prefix, expected in (("axis", axis), ("H", momentum)):
        found = np.array([rows[f"{prefix}{number}"] for number in (1, 2, 3)]).T / SPHERE
        assert found == pytest.approx(expected, abs=0.51 / SPHERE)
    framed = read_spacecraft(TEXTS[name], "craft.yaml").attitude is not None
    longitude, latitude = (rows["angle1"], rows["angle2"]) if framed else (rows["angle2"], rows["angle1"])
    for one, along, above in zip(axis.tolist(), longitude, latitude, strict=True):
        across = math.hypot(one[0], one[1])
        height = math.atan2(one[2], across) if framed else math.atan2(across, one[2])
        assert above / 1e4 == pytest.approx(math.degrees(height), abs=6e-5)
        if along == NONE:
            assert across < 1e-10
        else:
            assert math.cos(math.radians(along / 1e4)) == pytest.approx(one[0] / across, abs=2e-6)
            assert math.sin(math.radians(along / 1e4)) == pytest.approx(one[1] / across, abs=2e-6)
            assert 0 <= along < 360 * 10**4


@pytest.mark.parametrize("name", ["example", "three", "target", "small"])
def test_the_pole_curve_lies_where_its_scale_says(run: Run, name: str) -> None:
    made = view(TEXTS[name])
    _, rows = rows_of(made)
    panel = made.panels[0]
    track = simulated(run, TEXTS[name], made)
    body = read_spacecraft(TEXTS[name], "craft.yaml")
    rates = np.array([[float(row[f"omega_{number}_rad_s"]) for number in (1, 2, 3)] for row in track])
    rates = np.degrees(rates @ body.inertia.axes)  # to principal axes, which the panel names
    unit = {"deg/s": 1.0, "mdeg/s": 1e3}[panel.y.name.removeprefix("ω2, ")]
    for scale, points, values in ((panel.x, rows["pole1"], rates[:, 0]), (panel.y, rows["pole2"], rates[:, 1])):
        where = np.array([place for place, _ in scale.marks])
        number = np.array([float(text.replace("−", "-")) for _, text in scale.marks]) / unit
        slope, start = np.polyfit(where, number, 1)
        assert slope * np.array(points) + start == pytest.approx(values, abs=1.6 * abs(slope))


def test_square_panels_have_one_scale_for_both_axes() -> None:
    left, top, right, bottom = EDGES
    assert right - left == bottom - top
    for panel in view(TEXTS["target"]).panels:
        spans = []
        for scale in (panel.x, panel.y):
            numbers = [float(text.replace("−", "-")) for _, text in scale.marks]
            spans.append((scale.marks[-1][0] - scale.marks[0][0]) / (numbers[-1] - numbers[0]))
        assert abs(spans[0]) == pytest.approx(abs(spans[1]), rel=5e-3)


@pytest.mark.parametrize("name", ["example", "single", "small", "leap"])
def test_a_row_says_what_fires(name: str) -> None:
    chosen = compare(read_spacecraft(TEXTS[name], "craft.yaml"), CLASSIC).recommended
    assert chosen is not None
    data, rows = rows_of(moving_of(chosen))
    scale = 10 ** data["digits"]["t"]
    half = 0.51 / scale
    fired = set()
    for time, which in zip(rows["t"], rows["firing"], strict=True):
        text = data["firings"][which]
        named = {int(number) for number in re.findall(r"(\d+): ", text)}
        inside = {n for n, one in enumerate(chosen.pulses, 1) if one.start + half < time / scale < one.end - half}
        around = {n for n, one in enumerate(chosen.pulses, 1) if one.start - half <= time / scale <= one.end + half}
        assert inside <= named <= around
        assert (text == "none") == (not named)
        fired |= named
    assert fired == set(range(1, len(chosen.pulses) + 1))


def test_dates_are_exact_through_a_leap_second() -> None:
    data, rows = rows_of(view(LEAP))  # its epoch is ten seconds before the end of 2016, which has a 61st
    digits = data["digits"]["t"]
    dates = [data["utc"]["head"] + tail for tail in data["utc"]["tails"]]
    assert dates[0] == "2016-12-31T23:59:50." + digits * "0" + "Z"
    scale = 10**digits
    for time, date in zip(rows["t"], dates, strict=True):
        seconds, part = divmod(time, scale)
        clock = f"2016-12-31T23:59:{50 + seconds}" if seconds <= 10 else f"2017-01-01T00:00:{seconds - 11:02d}"
        expected = f"{clock}.{part:0{digits}d}Z"
        assert date == expected or abs(int(date[-1 - digits : -1]) - part) in (1, scale - 1)
    assert any(":60." in date for date in dates)


def test_without_an_epoch_there_is_no_date() -> None:
    made = view(SINGLE)
    assert not made.dated
    assert json.loads(made.data)["utc"] is None
    assert "UTC" not in parsed_view(SINGLE)


def parsed_view(text: str) -> str:
    compared = compare(read_spacecraft(text, "a.yaml"), CLASSIC)
    assert compared.recommended is not None
    section = Section("pictures", "Pictures", (moving_of(compared.recommended),))
    made = replace(plain_page(compared), sections=(section,))
    tree = parsed(page_html(made).removeprefix("<!DOCTYPE html>"))
    (found,) = (node for node in tree if "moving" in node.attributes.get("class", "").split())
    return found.text


def test_a_steep_track_has_rows_enough_and_the_data_stay_small() -> None:
    made = view(STEEP)
    data, rows = rows_of(made)
    body = read_spacecraft(STEEP, "a.yaml")
    assert len(rows["t"]) >= 24 * data["until"] / body.body_period
    assert not data["dots"]
    assert len(made.data) < 160_000
    # From row to row the pole curve turns by no more than a corner that the eye takes for round.
    way = np.unwrap(np.arctan2(np.array(rows["pole2"]) - 955, np.array(rows["pole1"]) - 1155))
    big = np.hypot(np.array(rows["pole2"]) - 955, np.array(rows["pole1"]) - 1155) > 400
    assert np.abs(np.diff(way))[big[1:] & big[:-1]].max() < math.radians(16)


def test_a_track_of_too_many_turns_is_drawn_as_dots() -> None:
    text = CALM.replace("[0, 0, 3]", "[0.1, 0, 3]") + "limits: {earliest: 3000 s, horizon: 3600 s}\n"
    made = view(text)
    data, rows = rows_of(made)
    assert data["dots"]
    assert len(rows["t"]) < MOST_ROWS + 20
    assert len(made.data) < 160_000


def test_without_nutation_everything_stands_still() -> None:
    made = view(CALM)
    data, rows = rows_of(made)
    assert made.strip.bars == ()
    assert data["firings"] == ["none"]
    for name in ("theta", "mu", "lambda", "firing"):
        assert set(rows[name]) == {0}
    assert {len(set(rows[name])) for name in ("pole1", "pole2", "sky1", "sky2", "H1", "H2", "H3")} == {1}


def test_the_target_is_a_mark_and_a_circle() -> None:
    data, _ = rows_of(view(TARGET))
    (named,) = data["named"]
    assert (named["name"], named["kind"]) == ("target", "target")
    assert named["circles"] == [{"radius": pytest.approx(math.radians(4)), "kind": "target"}]
    x, y, z = named["axis"]
    assert math.degrees(math.atan2(y, x)) == pytest.approx(-90, abs=1e-3)
    assert math.degrees(math.asin(z)) == pytest.approx(-30, abs=1e-3)
    assert data["target"] is not None


def test_sun_and_cones_of_the_file_are_on_the_globe(run: Run) -> None:
    text = (
        TARGET
        + """sun: [100 deg, 10 deg]
keep:
  - {name: Sun </script>, direction: sun, min: 4 deg, max: 170 deg}
  - {name: pole, direction: [0 deg, 90 deg], min: 2 deg}
"""
    )
    made = view(text)
    assert "</script" not in made.data
    data, rows = rows_of(made)
    _, sun, pole = data["named"]
    assert (sun["name"], pole["name"]) == ("Sun </script>", "pole")
    assert [(one["kind"], round(math.degrees(one["radius"]), 6)) for one in sun["circles"]] == [
        ("keep-out", 4.0),
        ("keep-in", 170.0),
    ]
    assert pole["axis"] == [0.0, 0.0, 1.0]
    track = simulated(run, text, made)
    for name, direction in (("aspect1", sun["axis"]), ("aspect2", pole["axis"])):
        for row, shown in zip(track, rows[name], strict=True):
            cosine = sum(float(row[f"axis_{part}"]) * along for part, along in zip("xyz", direction, strict=True))
            assert math.cos(math.radians(shown / 1e4)) == pytest.approx(cosine, abs=4e-6)
    only = TARGET + "sun: [100 deg, 10 deg]\n"
    assert [one["name"] for one in json.loads(view(only).data)["named"]] == ["target", "Sun"]


def test_further_circles_are_taken_as_data() -> None:
    chosen = compare(read_spacecraft(TARGET, "a.yaml"), CLASSIC).recommended
    assert chosen is not None
    star = Named("star", np.array([0.0, 0.6, 0.8]), "watched", (Circle("near it", 0.2, "keep-out"),))
    made = moving.moving(chosen.flight, 60.0, chosen.scheme, [star])
    assert json.loads(made.data)["named"] == [
        {"name": "star", "kind": "watched", "axis": [0.0, 0.6, 0.8], "circles": [{"radius": 0.2, "kind": "keep-out"}]}
    ]


@pytest.mark.parametrize("until", [1e-3, 2.0, 89.3, 4321.0, 1e7])
def test_playing_takes_seconds_to_minutes(until: float) -> None:
    speeds, first = moving._speeds(until)
    assert first in dict(speeds)
    assert dict(speeds)[1.0] == "real time"
    for speed in (one for one, _ in speeds if one != 1.0):
        assert 4.0 <= until / speed <= 120.0 * (1 + 1e-9)
    assert 10.0 <= until / first <= 25.0


def test_the_script_is_small() -> None:
    assert (PAGE / "view.js").stat().st_size <= 25_000


def test_a_page_without_pictures_has_neither_view_nor_its_script() -> None:
    made = plain_page(compare(read_spacecraft(SINGLE, "a.yaml"), CLASSIC))
    assert "requestAnimationFrame" not in page_html(made)
