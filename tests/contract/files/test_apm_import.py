"""Spacecraft files from messages: there and back keeps state, inertia and manoeuvres, and plans the same schedule."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import messages
from support.golden import check_text
from support.places import case

from nutdamp import flight, planning
from nutdamp.errors import FaultyFile
from nutdamp.files.apm_import import contradictions, imported
from nutdamp.files.ccsds.apm_reader import read_apm
from nutdamp.files.exchange import export_text
from nutdamp.files.pulses_csv import pulses_csv
from nutdamp.files.schedule_file import read_pulses
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.physics import attitude
from nutdamp.planning import Plan
from nutdamp.schedule import Pulse, Schedule
from nutdamp.spacecraft import Limits, Spacecraft

pytestmark = pytest.mark.usefixtures("plans_shared")

CASES = pytest.mark.parametrize("case", messages.CASES)
STEERED = pytest.mark.parametrize(
    "case", ["steerable-stage", *(name for name in messages.BODIES if "tensor" not in name)]
)

PLANNED_ALIKE = 1e-6
"""Relative difference of two schedules that were trimmed from states that differ in the last digit."""


def there_and_back(plan: Plan, folder: Path) -> tuple[str, Spacecraft, Schedule]:
    path = folder / "there.apm"
    path.write_text(export_text(plan, "apm"), encoding="utf-8")
    return imported(read_apm(str(path)), str(path))


@CASES
def test_state_inertia_and_manoeuvres_come_back(case: str, tmp_path: Path) -> None:
    plan = messages.planned(case)
    body = plan.spacecraft
    text, found, schedule = there_and_back(plan, tmp_path)
    assert found.omega0 == pytest.approx(body.omega0, rel=1e-12, abs=1e-15)
    assert found.inertia.tensor == pytest.approx(body.inertia.tensor, rel=1e-15)
    assert found.inertia.moments == pytest.approx(body.inertia.moments, rel=1e-14)
    mine, theirs = (attitude.matrix(one.initial.quaternion) for one in (body, found))
    assert theirs == pytest.approx(mine, abs=1e-13)
    assert found.nutation == pytest.approx(body.nutation, rel=1e-12)
    assert found.object_id == body.object_id
    assert found.name == body.name.upper()
    assert found.attitude is not None
    assert body.attitude is not None
    assert found.attitude.frame == body.attitude.frame
    assert "no thruster layout" in text
    for one, two in zip(plan.pulses, schedule, strict=True):
        assert two.start == pytest.approx(one.start, abs=0.51e-9)
        assert two.on_time == pytest.approx(one.on_time, rel=1e-15)
        assert two.impulse == pytest.approx(one.impulse, rel=1e-12, abs=1e-12)
        assert two.propellant == (one.propellant and pytest.approx(one.propellant, rel=1e-15))
    # The schedule, flown from what came back, leaves what the plan leaves.
    left, expected = flight.flown(found, schedule).residual, plan.flown
    assert expected is not None
    assert left.nutation == pytest.approx(expected.nutation, abs=1e-9)
    assert left.momentum_shift == pytest.approx(expected.momentum_shift, abs=1e-9)


@CASES
def test_the_schedule_is_read_as_a_file_without_warnings(case: str, tmp_path: Path) -> None:
    _, found, schedule = there_and_back(messages.planned(case), tmp_path)
    (tmp_path / "back.csv").write_text(pulses_csv(flight.flown(found, schedule)), encoding="utf-8")
    again, warnings = read_pulses(tmp_path / "back.csv", found)
    assert warnings == []
    assert [one.start for one in again] == pytest.approx([one.start for one in schedule], abs=1e-14)


@STEERED
@pytest.mark.parametrize("scheme", ["one-pulse", "two-pulse"])
def test_a_steerable_torquer_plans_the_same_again(case: str, scheme: str, tmp_path: Path) -> None:
    body = messages.spacecraft(case)
    for limits in (body.limits, Limits(earliest=1.5)):
        plan = planning.plan(replace(body, limits=limits), scheme)
        assert plan.feasible
        text, found, _ = there_and_back(plan, tmp_path)
        assert body.steerable is not None
        assert body.steerable.torque is not None
        assert found.steerable is not None
        assert found.steerable.torque == pytest.approx(body.steerable.torque, rel=1e-14)
        again = planning.plan(read_spacecraft(text, "back.yaml"), scheme)
        for one, two in zip(plan.pulses, again.pulses, strict=True):
            assert two.t == pytest.approx(one.t, rel=PLANNED_ALIKE)
            assert two.on_time == pytest.approx(one.on_time, rel=PLANNED_ALIKE)
            assert two.impulse == pytest.approx(one.impulse, abs=PLANNED_ALIKE * one.magnitude)


def test_torques_of_several_kinds_are_suggested_as_thrusters(tmp_path: Path) -> None:
    plan = planning.plan(messages.spacecraft("tilted tensor, backwards"), "four-pulse")
    text, found, _ = there_and_back(plan, tmp_path)
    assert found.steerable is None
    assert "    - [120.0 kg m^2, 3.0 kg m^2, 6.0 kg m^2]\n" in text
    taken = read_spacecraft(text.replace("# thrusters:", "thrusters:").replace("#   - {", "  - {"), "taken.yaml")
    torques = {tuple(np.round(taken.inertia.axes @ channel.torque, 12)) for channel in taken.channels}
    fired = {
        tuple(np.round(messages.in_file_axes(plan.spacecraft, one.torque), 12))
        for one in plan.pulses
        if one.torque is not None
    }
    assert torques == fired


def test_overlapping_manoeuvres_keep_apart_by_their_channels(tmp_path: Path) -> None:
    text = export_text(messages.planned("prolate"), "apm")
    first, second = (text.index("MAN_START"), text.rindex("MAN_START"))
    doubled = text[:second] + text[first:second] + text[second:]
    (tmp_path / "a.apm").write_text(doubled)
    _, found, schedule = imported(read_apm(str(tmp_path / "a.apm")), "a.apm")
    assert [one.channel for one in schedule] == ["steerable", "MAN2", "steerable"]
    assert flight.flown(found, schedule).settled.spin == pytest.approx(math.pi)


def test_manoeuvres_stand_in_the_order_of_their_starts(tmp_path: Path) -> None:
    """A long pulse that begins first may have its centre after a short one."""
    torque = np.array([1.0, 0.0, 0.0])
    pulses = Schedule((Pulse(2.0, 2.0, "long", 2.0 * torque, torque), Pulse(1.5, 0.2, "short", 0.2 * torque, torque)))
    assert [one.channel for one in pulses] == ["short", "long"]
    _, _, schedule = there_and_back(Plan(messages.spacecraft("prolate"), "by hand", pulses), tmp_path)
    assert sorted(one.start for one in schedule) == pytest.approx([1.0, 1.4])


def test_names_are_quoted_and_epochs_written_plainly(tmp_path: Path) -> None:
    plan = messages.planned("prolate")
    text, found, _ = there_and_back(replace(plan, spacecraft=replace(plan.spacecraft, name='No: "1" #x')), tmp_path)
    assert found.name == 'NO: "1" #X'
    assert "  epoch: 2026-03-01T12:00:00Z\n" in text
    assert "epoch: 2026-03-01T12:00:00.25Z" in there_and_back(messages.planned("steerable-stage"), tmp_path)[0]


@pytest.mark.parametrize(
    ("old", "new", "block", "problem"),
    [
        ("IZZ               = 80.0", "IZZ               = 800.0", "INERTIA", "C"),
        ("IZZ               = 80.0", "IZZ               = -80.0", "INERTIA", ""),
        ("ANGVEL_Z     = 180.0", "ANGVEL_Z     = 0.0", "ANGVEL", "the spin is zero"),
    ],
)
def test_what_no_spacecraft_can_be_points_at_the_block(
    old: str, new: str, block: str, problem: str, tmp_path: Path
) -> None:
    text = export_text(messages.planned("prolate"), "apm")
    assert old in text
    path = tmp_path / "a.apm"
    path.write_text(text.replace(old, new))
    line = text.splitlines().index(f"{block}_START") + 1
    with pytest.raises(FaultyFile, match=rf"a\.apm:{line}:1: {block}: .*{problem}"):
        imported(read_apm(str(path)), str(path))


def test_times_of_another_system_become_utc_and_a_nutation_that_contradicts_is_said(tmp_path: Path) -> None:
    """A period of 720 s is none of this inertia, so that 0.1 deg cannot be."""
    text = case("mms1.apm.txt").read_text(encoding="utf-8")
    moments = []
    for system in ("UTC", "TAI", "TT"):
        path = tmp_path / f"{system}.apm"
        path.write_text(text.replace("= UTC", f"= {system}"), encoding="utf-8")
        contents = read_apm(str(path))
        _, body, pulses = imported(contents, path.name)
        moments.append(contents.epoch)
        assert [pulse.start for pulse in pulses] == [3600.0]
        (said,) = contradictions(contents, body)
        check_text("files.nutation-contradicts", said)
    assert [moments[0].since(one) for one in moments[1:]] == [37.0, 37.0 + 32.184]
    agreeing = replace(contents, nutation=body.widest.nutation)
    assert contradictions(agreeing, body) == []
