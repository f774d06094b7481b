"""The rows of the moving view, without a browser: they are those of ``simulate``, and lie where the scales say."""

import csv
import io
import json
import math
import re
import shlex
from dataclasses import replace
from functools import cache
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import places
from support.builders import present
from support.cases import deep
from support.pages import plain_page
from support.process import Run
from support.shown import WIDE, compared_text, tree

from nutdamp.files.reader import example_text, read_spacecraft
from nutdamp.files.schedules import read_blocks, read_plan
from nutdamp.flight import propagation
from nutdamp.page import moving
from nutdamp.page.document import EDGES, Moving, PageSection
from nutdamp.page.report import page_html
from nutdamp.planning import plan as planning
from nutdamp.schemes.block_model import fired
from nutdamp.schemes.catalogue import Options
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.model import Goal, Keep, Limits, Requirement
from nutdamp.spacecraft.schedule import Schedule

pytestmark = pytest.mark.usefixtures("plans_shared")

CALM = "name: Calm\ninertia: {A: 120, C: 80}\nomega0: [0, 0, 3]\n"
TEXTS = {
    "example": example_text(),
    "target": places.case("far-target.yaml").read_text(encoding="utf-8"),
    "three": """name: Three moments
inertia: {tensor: [[120, 3, 0], [3, 100, 0], [0, 0, 60]]}
state: {spin: 6 rpm, nutation: 20 deg}
steerable: {torque: 20 N m}
""",
    "single": """name: One thruster, spin reversed
inertia: {A: 80, C: 120}
state: {spin: -30 rpm, nutation: 3 deg}
thrusters: [{name: T1, torque: [0, 12, 0]}]
limits: {max_pulses: 1}
""",
    "calm": CALM,
    "small": "name: Small\ninertia: {A: 120, C: 80}\nstate: {spin: 30 rpm, nutation: 0.0004 deg}\n",
    "steep": (places.CONFIGS / "sounding-rocket-payload.yaml").read_text(encoding="utf-8"),
    "leap": (places.CONFIGS / "single-thruster.yaml").read_text(encoding="utf-8"),
}


def chosen(text: str) -> planning.Plan:
    return present(compared_text(text).recommended)


@cache
def view(text: str) -> tuple[Moving, dict[str, Any], dict[str, list[int]]]:
    """The view, its data, and their columns as the script adds them up."""
    made = moving.moving_of(chosen(text))
    data = json.loads(made.data)
    return made, data, {name: list(accumulate(steps)) for name, steps in data["columns"].items()}


def simulated(run: Run, text: str) -> list[dict[str, str]]:
    """What the command in the caption writes."""
    command = " ".join(view(text)[0].command).replace("SPACECRAFT", "-").removesuffix("FILE")
    screen = run(*shlex.split(command)[1:], "-", "-q", stdin=text, status=(0, 4))
    return list(csv.DictReader(io.StringIO(screen.stdout)))


@pytest.mark.parametrize("name", ["schedule", "blocks", "disturbances", deep("scheme")])
def test_the_command_in_the_caption_gives_the_rows_of_the_view(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """It names the file that the plan came from, whatever its name."""
    monkeypatch.chdir(tmp_path)
    text = places.case("cb1015.yaml").read_text(encoding="utf-8") if name == "blocks" else TEXTS["example"]
    text += "disturbances: [{torque: [20 mN m, 0, 0]}]\n" * (name == "disturbances")
    Path("my craft.yaml").write_text(text, encoding="utf-8")
    body = read_spacecraft(text, "my craft.yaml")
    if name == "blocks":
        header = "block,channel,first_sun_pulse,count,every,delay_s,width_s"
        Path("b 2.csv").write_text(f"{header}\n1,J2,6,1,1,0.972287825122,0.487394\n", encoding="utf-8")
        plan = planning.Plan(body, "b 2.csv", fired(body, read_blocks("b 2.csv", body)[0]), from_file=True)
    elif name == "schedule":
        planning.plan(body, "two-pulse").to_csv("p 2.csv")
        plan, _ = read_plan("p 2.csv", body)
    else:
        plan = planning.plan(body, "two-pulse", Options(with_disturbances=name == "disturbances"))
    made = moving.moving_of(plan, "'my craft.yaml'")
    assert made.scheme == plan.scheme
    *words, file = shlex.split(" ".join(made.command))
    assert file == "FILE"
    done = run(*words[1:], "-", "-q", status=(0, 4))
    rows, data = list(csv.DictReader(io.StringIO(done.stdout))), json.loads(made.data)
    digits = data["digits"]["cone"]
    shown = [f"{value / 10**digits:.{digits}f}" for value in accumulate(data["columns"]["theta"])]
    assert shown == [f"{float(row['nutation_deg']):z.{digits}f}" for row in rows]


def test_no_command_is_named_that_would_fly_other_pulses() -> None:
    plan = chosen(TEXTS["example"])
    sunlit = replace(plan.spacecraft, goal=Goal(sun=np.array([1.0, 0.0, 0.0])))
    for other in (replace(plan, scheme="robust"), replace(plan, spacecraft=sunlit)):
        assert moving.moving_of(other).command == ()


def column(track: list[dict[str, str]], *keys: str) -> np.ndarray:
    return np.array([[float(row[key]) for key in keys] for row in track])


@pytest.mark.parametrize(
    "name", ["target", "three", "calm", *map(deep, ("example", "single", "small", "steep", "leap"))]
)
def test_each_row_is_that_of_simulate(run: Run, name: str) -> None:
    _, data, rows = view(TEXTS[name])
    track = simulated(run, TEXTS[name])
    assert {len(numbers) for numbers in rows.values()} == {len(track)}
    for what, key in (("t", "t_s"), ("theta", "nutation_deg"), ("mu", "body_cone_deg"), ("lambda", "space_cone_deg")):
        digits = data["digits"]["t" if what == "t" else "cone"]
        shown = [f"{value / 10**digits:.{digits}f}" for value in rows[what]]
        assert shown == [f"{float(row[key]):z.{digits}f}" for row in track]
    axis = column(track, "axis_x", "axis_y", "axis_z")
    momentum = column(track, "momentum_x_Nms", "momentum_y_Nms", "momentum_z_Nms")
    globe = (("axis", axis), ("H", momentum / np.linalg.norm(momentum, axis=1, keepdims=True)))
    assert ("axis1" in rows) == ("H3" in rows) == (name == "target")  # the globe
    for prefix, expected in globe if name == "target" else ():
        on_sphere = np.array([rows[f"{prefix}{number}"] for number in (1, 2, 3)]).T / moving.SPHERE
        assert on_sphere == pytest.approx(expected, abs=0.51 / moving.SPHERE)
    framed = read_spacecraft(TEXTS[name], "craft.yaml").attitude is not None
    longitude, latitude = (rows["angle1"], rows["angle2"]) if framed else (rows["angle2"], rows["angle1"])
    for (x, y, z), along, above in zip(axis.tolist(), longitude, latitude, strict=True):
        across = math.hypot(x, y)
        height = math.atan2(z, across) if framed else math.atan2(across, z)
        assert above / 1e4 == pytest.approx(math.degrees(height), abs=6e-5)
        if along == moving.NONE:
            assert across < 1e-10
        else:
            way = math.radians(along / 1e4)
            assert (math.cos(way), math.sin(way)) == pytest.approx((x / across, y / across), abs=2e-6)
            assert 0 <= along < 360 * 10**4


@pytest.mark.parametrize("name", ["example", "three", "small"])
def test_the_pole_curve_lies_where_its_scale_says(run: Run, name: str) -> None:
    made, _, rows = view(TEXTS[name])
    panel = made.panels[0]
    rates = column(simulated(run, TEXTS[name]), "omega_1_rad_s", "omega_2_rad_s", "omega_3_rad_s")
    axes = read_spacecraft(TEXTS[name], "craft.yaml").inertia.axes  # principal axes, which the panel names
    unit = {"deg/s": 1.0, "mdeg/s": 1e3}[panel.y.name.removeprefix("ω2, ")]
    for place, scale in enumerate((panel.x, panel.y)):
        numbers = [float(text.replace("−", "-")) / unit for _, text in scale.marks]
        slope, start = np.polyfit([where for where, _ in scale.marks], numbers, 1)
        shown = slope * np.array(rows[f"pole{place + 1}"]) + start
        assert shown == pytest.approx(np.degrees(rates @ axes)[:, place], abs=1.6 * abs(slope))


def test_square_panels_have_one_scale_for_both_axes() -> None:
    left, top, right, bottom = EDGES
    assert right - left == bottom - top
    for panel in view(TEXTS["target"])[0].panels:
        spans = []
        for scale in (panel.x, panel.y):
            (first, low), *_, (last, high) = ((at, float(text.replace("−", "-"))) for at, text in scale.marks)
            spans.append(abs((last - first) / (high - low)))
        assert spans[0] == pytest.approx(spans[1], rel=5e-3)


@pytest.mark.parametrize("name", ["example", "single", "small", "leap"])
def test_a_row_says_what_fires(name: str) -> None:
    _, data, rows = view(TEXTS[name])
    pulses = list(enumerate(chosen(TEXTS[name]).pulses, 1))
    scale = 10 ** data["digits"]["t"]
    half, fired = 0.51 / scale, set()
    for time, which in zip(rows["t"], rows["firing"], strict=True):
        text = data["firings"][which]
        named = {int(number) for number in re.findall(r"(\d+): ", text)}
        inside = {n for n, one in pulses if one.start + half < time / scale < one.end - half}
        around = {n for n, one in pulses if one.start - half <= time / scale <= one.end + half}
        assert inside <= named <= around
        assert (text == "none") == (not named)
        fired |= named
    assert fired == {n for n, _ in pulses}


def test_dates_are_exact_through_a_leap_second_and_without_an_epoch_there_are_none() -> None:
    _, data, rows = view(TEXTS["leap"])  # its epoch is ten seconds before the end of 2016, which has a 61st
    digits = data["digits"]["t"]
    dates = [data["utc"]["head"] + tail for tail in data["utc"]["tails"]]
    assert dates[0] == "2016-12-31T23:59:50." + digits * "0" + "Z"
    for time, date in zip(rows["t"], dates, strict=True):
        seconds, part = divmod(time, 10**digits)
        clock = f"2016-12-31T23:59:{50 + seconds}" if seconds <= 10 else f"2017-01-01T00:00:{seconds - 11:02d}"
        off = abs(int(date[-1 - digits : -1]) - part)
        assert date == f"{clock}.{part:0{digits}d}Z" or off in (1, 10**digits - 1)
    assert any(":60." in date for date in dates)
    made, data, _ = view(TEXTS["single"])
    assert (made.dated, data["utc"]) == (False, None)


@pytest.mark.deep
def test_a_page_has_the_view_and_its_script_where_it_has_pictures() -> None:
    plain = plain_page(compared_text(TEXTS["single"]))
    assert "requestAnimationFrame" not in page_html(plain)
    page = tree(replace(plain, sections=(PageSection("pictures", "Pictures", (view(TEXTS["single"])[0],)),)))
    (shown,) = (node for node in page if "moving" in node.attributes.get("class", "").split())
    assert "UTC" not in shown.text


def test_a_steep_track_has_rows_enough_and_the_data_stay_small() -> None:
    made, data, rows = view(TEXTS["steep"])
    assert len(rows["t"]) >= 24 * data["until"] / read_spacecraft(TEXTS["steep"], "a.yaml").body_period
    assert not data["dots"]
    assert len(made.data) < 160_000
    # From row to row the pole curve turns by no more than a corner that the eye takes for round.
    up, right = np.array(rows["pole2"]) - 955, np.array(rows["pole1"]) - 1155
    way, big = np.unwrap(np.arctan2(up, right)), np.hypot(up, right) > 400
    assert np.abs(np.diff(way))[big[1:] & big[:-1]].max() < math.radians(16)


def test_a_track_of_too_many_turns_is_drawn_as_dots() -> None:
    text = CALM.replace("[0, 0, 3]", "[0.1, 0, 3]") + "limits: {earliest: 3000 s, horizon: 3600 s}\n"
    made, data, rows = view(text)
    assert data["dots"]
    assert len(rows["t"]) < moving.MOST_ROWS + 20
    assert len(made.data) < 160_000


def test_without_nutation_everything_stands_still() -> None:
    made, data, rows = view(CALM)
    assert made.strip.bars == ()
    assert data["firings"] == ["none"]
    assert {number for name in ("theta", "mu", "lambda", "firing") for number in rows[name]} == {0}
    assert {len(set(rows[name])) for name in ("pole1", "pole2", "sky1", "sky2", "momentum1", "momentum2")} == {1}


def test_the_target_is_a_mark_and_a_circle_and_further_circles_are_taken_as_data() -> None:
    _, data, _ = view(TEXTS["target"])
    (named,) = data["named"]
    assert (named["name"], named["kind"]) == ("target", "target")
    assert named["circles"] == [{"radius": pytest.approx(math.radians(4)), "kind": "target"}]
    x, y, z = named["axis"]
    assert (math.degrees(math.atan2(y, x)), math.degrees(math.asin(z))) == pytest.approx((-90, -30), abs=1e-3)
    assert data["target"] is not None
    plan = chosen(TEXTS["target"])
    star = replace(plan.spacecraft, keep=(Keep("star", np.array([0.0, 0.6, 0.8]), 0.2),))
    assert json.loads(moving.moving_of(replace(plan, spacecraft=star)).data)["named"] == [
        named,
        {"name": "star", "kind": "watched", "axis": [0.0, 0.6, 0.8], "circles": [{"radius": 0.2, "kind": "keep-out"}]},
    ]


def test_sun_and_cones_of_the_file_are_on_the_globe(run: Run) -> None:
    only = TEXTS["target"] + "sun: [100 deg, 10 deg]\n"
    assert [one["name"] for one in view(only)[1]["named"]] == ["target", "Sun"]
    cones = """keep:
  - {name: Sun </script>, direction: sun, min: 4 deg, max: 170 deg}
  - {name: pole, direction: [0 deg, 90 deg], min: 2 deg}
"""
    made, data, rows = view(only + cones)
    assert "</script" not in made.data
    _, sun, pole = data["named"]
    assert (sun["name"], pole["name"]) == ("Sun </script>", "pole")
    circles = [(one["kind"], round(math.degrees(one["radius"]), 6)) for one in sun["circles"]]
    assert circles == [("keep-out", 4.0), ("keep-in", 170.0)]
    assert pole["axis"] == [0.0, 0.0, 1.0]
    axis = column(simulated(run, only + cones), "axis_x", "axis_y", "axis_z")
    for name, direction in (("aspect1", sun["axis"]), ("aspect2", pole["axis"])):
        assert np.cos(np.radians(np.array(rows[name]) / 1e4)) == pytest.approx(axis @ direction, abs=4e-6)


@pytest.mark.parametrize("degrees", [0.5, 50.0])
def test_the_strip_says_where_the_required_nutation_is(degrees: float) -> None:
    body = replace(WIDE, requirement=Requirement(nutation=math.radians(degrees)))
    made = propagation.flown(body, planning.plan(body, "two-pulse").pulses, 20.0)
    strip, (low, high) = moving.strip_of(made, made.sampled(200, 20.0), 20.0)
    assert (low < degrees < high) == (strip.required is not None) == (degrees < 1.0)
    assert strip.outside == ("" if degrees < 1.0 else "50 deg")


def test_the_strip_has_the_times_without_firings() -> None:
    body = replace(WIDE, limits=Limits(earliest=2.0, blackout=((5.0, 7.0), (19.0, 25.0)), horizon=60.0))
    made = propagation.flown(body, Schedule(), 20.0)
    strip, _ = moving.strip_of(made, made.sampled(200, 20.0), 20.0)
    ends = [2000.0 * (moving.LEAD + (1.0 - moving.LEAD) * time / 20.0) for time in (0.0, 2.0, 5.0, 7.0, 19.0, 20.0)]
    for shown, first, last in zip(strip.closed, ends[::2], ends[1::2], strict=True):
        assert shown == pytest.approx((first, last - first), abs=0.06)


@pytest.mark.parametrize("until", [1e-3, 2.0, 89.3, 4321.0, 1e7])
def test_playing_takes_seconds_to_minutes(until: float) -> None:
    speeds, first = moving._speeds(until)
    assert first in dict(speeds)
    assert dict(speeds)[1.0] == "real time"
    assert all(4.0 <= until / speed <= 120.0 * (1 + 1e-9) for speed, _ in speeds if speed != 1.0)
    assert 10.0 <= until / first <= 25.0


@pytest.mark.parametrize("name", ["view.js", "bench.js", "motion.js"])
def test_the_scripts_are_small(name: str) -> None:
    assert (Path(moving.__file__).parent / name).stat().st_size <= 25_000


# --- workbench: what its script computes is tested in a browser -------------------------------------------------------


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        ("dissipation: {time_constant: 600 s}", "energy dissipation"),
        ("disturbances: [{torque: [20 mN m, 0, 0]}]", "disturbance torques"),
        deep("tank: {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar}", "blowdown"),
        deep("cold: {first: 90 %, pulses: 4}", "cold pulses"),
        deep("valve: {open_delay: 8 ms, close_delay: 12 ms, rise_time: 5 ms, fall_time: 10 ms}", "valves"),
    ],
)
def test_other_bodies_have_none_and_the_view_has_the_reason(more: str, reason: str) -> None:
    made, data, _ = view(f"{TEXTS['example']}\n{more}\n")
    assert (made.workbench, made.absent) == (None, reason)
    assert data["bench"] is None


def test_schedules_without_pulses_command_blocks_and_wheels_have_none() -> None:
    plan = chosen(TEXTS["three"])
    assert moving.absence(plan.spacecraft, plan.pulses) == ""
    assert moving.absence(plan.spacecraft, Schedule()) == "no pulses"
    blocks = replace(plan.pulses, blocks=(Block("T1", 1, 0.1, 0.1, 3),))
    assert moving.absence(plan.spacecraft, blocks) == "command blocks"
    inertia = replace(plan.spacecraft.inertia, wheel=1.0)
    assert moving.absence(replace(plan.spacecraft, inertia=inertia), plan.pulses) == "a wheel"


def test_cones_roll_on_a_symmetric_body_alone() -> None:
    for name in ("example", "three"):
        assert present(view(TEXTS[name])[0].workbench).rolling == (name == "example")


def test_its_data_are_the_plan_and_the_limits_of_the_file() -> None:
    text = (
        TEXTS["example"] + "limits: {horizon: 60 s, earliest: 1 s, gap: 0.2 s, tick: 1 ms, blackout: [[30 s, 31 s]]}\n"
    )
    made, data, _ = view(text)
    bench, pulses = data["bench"], chosen(text).pulses.pulses
    assert [(entry["start"], entry["on"], entry["channel"]) for entry in bench["pulses"]] == [
        (pulse.start, pulse.on_time, pulse.channel) for pulse in pulses
    ]
    assert [entry["impulse"] for entry in bench["pulses"]] == [pulse.impulse.tolist() for pulse in pulses]
    assert {(entry["least"], entry["most"]) for entry in bench["pulses"]} == {(0.02, 2.0)}
    limits = {"earliest": 1.0, "horizon": 60.0, "gap": 0.2, "tick": 1e-3, "blackout": [[30.0, 31.0]], "most": None}
    assert bench["limits"] == limits
    assert [(key, limit) for key, _, limit in present(made.workbench).rows] == [
        ("nutation", "≤ 0.5°"),
        ("momentum_shift", "≤ 0.2°"),
    ]


def test_with_a_target_the_axis_error_is_bounded_and_ideal_impulses_have_no_on_time() -> None:
    made, data, _ = view(TEXTS["target"])
    rows = [(key, limit) for key, _, limit in present(made.workbench).rows]
    assert rows == [("nutation", ""), ("momentum_shift", ""), ("axis_error", "≤ 4°")]
    pulses = data["bench"]["pulses"]
    assert {(entry["on"], entry["torque"], entry["most"]) for entry in pulses} == {(0.0, None, None)}
