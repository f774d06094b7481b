"""One mission in several frames: plans alike, directions of the file, exports in EME2000."""

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.builders import present

import nutdamp
from nutdamp.common.time import Epoch
from nutdamp.files.ccsds.read import read_message
from nutdamp.files.ccsds.write import merge
from nutdamp.files.editing import as_before
from nutdamp.files.reader import Source, source_of
from nutdamp.files.telemetry import record_of
from nutdamp.files.yaml import read_tree
from nutdamp.physics import attitude
from nutdamp.spacecraft.model import SpinState
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.views.decisions import plan_json
from nutdamp.views.simulation import simulation_json

EPOCH = "2026-03-01T12:00:00Z"
DAYS = Epoch.parse(EPOCH).days_of_j2000
OTHER = ("ECLIPJ2000", "ECLIPDATE", "MOD", "GCRF")
SOLID = 1e-9  # rad and shares: rounding, grown by the search for a plan


def mission(frame: str) -> dict[str, Any]:
    """The keys of a file in a ``frame``, whose directions are the same in space."""

    def turned(vector: list[float]) -> list[float]:
        return list(map(float, attitude.frame_axes(frame, DAYS).T @ np.array(vector)))

    def angles(right_ascension: float, declination: float) -> list[float]:
        direction = attitude.on_sphere(*np.radians([right_ascension, declination]))
        x, y, z = turned(direction.tolist())
        return [math.atan2(y, x), math.atan2(z, math.hypot(x, y))]

    right_ascension, declination = angles(45.0, 33.0)
    return {
        "name": "Framed",
        "mass": 250,
        "inertia": {"A": 120, "C": 150},
        "state": {"spin": "15 rpm", "nutation": "3 deg"},
        "attitude": {
            "spin_axis": angles(40.0, 30.0),
            "sun_phase": "20 deg",
            "epoch": EPOCH,
            "frame": frame,
        },
        "sun": "epoch",
        "keep": [{"name": "star", "direction": angles(80.0, -10.0), "min": "20 deg"}],
        "goal": {"right_ascension": right_ascension, "declination": declination},
        "orbit": {"position": turned([7e6, 1e6, -2e6]), "velocity": turned([-1e3, 7e3, 5e2])},
        "thrusters": [
            {
                "name": "T1",
                "position": [0, 0.5, 0.8],
                "direction": [1, 0, 0],
                "force": 2,
                "isp": 220,
            },
            {
                "name": "T2",
                "position": [0, -0.5, 0.8],
                "direction": [1, 0, 0],
                "force": 2,
                "isp": 220,
            },
        ],
    }


def planned(frame: str) -> nutdamp.Plan:
    return nutdamp.plan(nutdamp.load(mission(frame)), "half-cone")


@pytest.fixture(scope="module")
def plain() -> nutdamp.Plan:
    return planned("J2000")


@pytest.mark.parametrize("frame", OTHER)
def test_the_frame_of_a_file_moves_nothing(plain: nutdamp.Plan, frame: str) -> None:
    plan = planned(frame)
    assert len(plan.pulses) == len(plain.pulses) > 2
    for pulse, other in zip(plan.pulses, plain.pulses, strict=True):
        assert pulse.channel == other.channel
        times = (other.t, other.on_time)
        assert (pulse.t, pulse.on_time) == pytest.approx(times, abs=SOLID)
    assert plan.propellant == pytest.approx(plain.propellant, rel=SOLID)
    for aspect, same in zip(plan._aspects, plain._aspects, strict=True):
        assert (aspect.least, aspect.largest) == pytest.approx((same.least, same.largest))


@pytest.mark.parametrize("frame", OTHER)
def test_directions_are_shown_in_the_frame_of_the_file(frame: str) -> None:
    plan = planned(frame)
    names = ("right_ascension_deg", "declination_deg")
    if frame.startswith("ECLIP"):
        names = ("longitude_deg", "latitude_deg")
    goal = [math.degrees(angle) for angle in mission(frame)["goal"].values()]
    end = plan_json(plan)["final"]["axis"]
    assert [end[name] for name in names] == pytest.approx(goal, abs=1e-6)
    track = simulation_json(nutdamp.simulate(plan))["axis_track"]
    assert (track["frame"], [*names]) == (frame, [*track][-2:])


WRITTEN = re.compile(r"(?m)^(CREATION_DATE|MESSAGE_ID|COMMENT).*\n")
NUMBER = re.compile(r"(?<![\w.:-])[-+]?\d+\.\d+(?:[eE][-+]?\d+)?(?![\w:-])")


@pytest.mark.parametrize("form", ["apm", "aem", "aem-spin", "opm", "stk"])
@pytest.mark.parametrize("frame", ["ECLIPJ2000", "ECLIPDATE", "MOD"])
def test_exports_are_those_of_eme2000(
    plain: nutdamp.Plan, tmp_path: Path, frame: str, form: str
) -> None:
    texts = []
    for name, plan in (("one", planned(frame)), ("two", plain)):
        nutdamp.export(plan, form, tmp_path / name)
        text = WRITTEN.sub("", (tmp_path / name).read_text())
        texts.append(text.replace("= J2000", "= EME2000"))
    one, two = ([*map(float, NUMBER.findall(text))] for text in texts)
    assert len(two) > 10
    # on-times and starts are written to nanoseconds, and rows follow them
    assert one == pytest.approx(two, rel=1e-7, abs=1e-7)
    assert NUMBER.sub("", texts[0]) == NUMBER.sub("", texts[1])


def test_what_is_merged_stays_in_the_frame(tmp_path: Path) -> None:
    plan = planned("ECLIPDATE")
    nutdamp.export(planned("J2000"), "apm", tmp_path / "a.apm")
    source = source_of(mission("ECLIPDATE"))
    merged, _, _ = merge(source, read_message(str(tmp_path / "a.apm")), inertia=False)
    after = Source(merged, "f.yaml").read()
    assert present(after.attitude).frame == "ECLIPDATE"
    assert turn(after) == pytest.approx(turn(plan.spacecraft), abs=SOLID)


@pytest.mark.parametrize("frame", OTHER)
def test_a_file_carried_on_is_in_the_frame_of_its_date(frame: str) -> None:
    """The axes of date turn by 0.96 arcsec in a week."""
    plan = nutdamp.plan(nutdamp.load(mission(frame)), "none")
    time = 7.0 * 86400.0
    after = plan.carried(time)
    assert present(after.attitude).frame == frame
    state = SpinState.of(*(part[0] for part in plan._reaching(time).motion(np.array([time]))))
    end = replace(present(plan.spacecraft.attitude), quaternion=state.quaternion)
    expected = end.axes @ attitude.matrix(end.quaternion)
    seen = present(after.attitude).axes @ attitude.matrix(after.initial.quaternion)
    assert seen == pytest.approx(expected, abs=1e-10)  # numbers of the file have 12 digits


def turn(spacecraft: nutdamp.Spacecraft) -> np.ndarray:
    return attitude.matrix(spacecraft.initial.quaternion)


def test_a_history_of_eme2000_is_telemetry_in_the_frame_of_the_file(tmp_path: Path) -> None:
    plan = planned("ECLIPDATE")
    nutdamp.export(plan, "aem", tmp_path / "a.aem", until=20.0)
    record = record_of(read_message(str(tmp_path / "a.aem")), plan.spacecraft, Schedule())
    axis = np.array([record.signals[f"axis_{name}"][0] for name in "xyz"])
    assert attitude.angle_between(axis, plan.spacecraft.axis) < SOLID


def test_right_ascension_in_hours() -> None:
    keys = mission("J2000")
    plain = nutdamp.load(keys)
    keys["goal"]["right_ascension"] = "3h 0m 0.0s"
    keys["keep"][0]["direction"][0] = "5.3333333333333333 h"
    spoken = nutdamp.load(keys)
    assert present(spoken.goal.axis) == pytest.approx(present(plain.goal.axis), abs=1e-15)
    assert present(spoken.keep[0].direction) == pytest.approx(present(plain.keep[0].direction))


@pytest.mark.parametrize(
    ("text", "expected"),
    [("18h 12m 33s", "30 deg"), ("2 h", "30 deg"), ("60 arcmin", "1800 arcmin"), ("1 rad", None)],
)
def test_an_angle_is_written_in_the_unit_of_the_file(text: str, expected: str | None) -> None:
    (node,) = (child for _, child in read_tree(f"phase: {text}", "f.yaml")[0].children())
    value = math.radians(30.0)
    assert as_before(node, value, "angle") == (expected or f"{value:.12g} rad")
