"""Spacecraft files from messages: there and back keeps state, inertia and manoeuvres, and plans the same schedule."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import messages
from support.cases import deep
from support.contract import CASES, Write, check_faults, known
from support.golden import check_text
from support.places import case as earlier

from nutdamp.files.ccsds.read import ApmContents, contradictions, imported, read_apm
from nutdamp.files.reader import read_spacecraft
from nutdamp.files.schedules import read_pulses
from nutdamp.flight import propagation
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.model import Limits, Spacecraft
from nutdamp.spacecraft.schedule import Pulse, Schedule
from nutdamp.views.exchange import export_text
from nutdamp.views.parts import pulse_table

pytestmark = pytest.mark.usefixtures("plans_shared")

PLANNED_ALIKE = 1e-6
"""Relative difference of two schedules that were trimmed from states that differ in the last digit."""

Taken = tuple[ApmContents, str, Spacecraft, Schedule]
Take = Callable[[str | Plan], Taken]


@pytest.fixture
def take(write: Write) -> Take:
    """``take(message)``, or that of a plan: what is read, the file it becomes, its spacecraft and schedule."""

    def take(message: str | Plan) -> Taken:
        contents = read_apm(str(write(message if isinstance(message, str) else export_text(message, "apm"), "a.apm")))
        return contents, *imported(contents, "a.apm")

    return take


@CASES
def test_state_inertia_and_manoeuvres_come_back(case: str, take: Take) -> None:
    plan = messages.planned(case)
    body = plan.spacecraft
    apm, text, back, schedule = take(plan)
    assert apm.remarks == ()
    assert apm.rates == pytest.approx(messages.in_file_axes(body, body.initial.rates), rel=1e-13, abs=1e-15)
    axes = attitude.matrix(known(apm.quaternion))
    assert axes == pytest.approx(messages.columns(body, body.initial.quaternion), abs=1e-14)
    assert apm.tensor == pytest.approx(body.inertia.tensor, rel=1e-15)
    assert back.omega0 == pytest.approx(body.omega0, rel=1e-12, abs=1e-15)
    assert back.inertia.tensor == pytest.approx(body.inertia.tensor, rel=1e-15)
    assert back.inertia.moments == pytest.approx(body.inertia.moments, rel=1e-14)
    mine, theirs = (attitude.matrix(spacecraft.initial.quaternion) for spacecraft in (body, back))
    assert theirs == pytest.approx(mine, abs=1e-13)
    assert back.nutation == pytest.approx(body.nutation, rel=1e-12)
    assert (back.object_id, back.name) == (body.object_id, body.name.upper())
    assert known(back.attitude).frame == known(body.attitude).frame
    assert "no thruster layout" in text
    for manoeuvre, one, two in zip(apm.manoeuvres, plan.pulses, schedule, strict=True):
        assert manoeuvre.torque == pytest.approx(messages.in_file_axes(body, known(one.torque)), rel=1e-14, abs=1e-15)
        assert [manoeuvre.start, two.start] == pytest.approx([one.start] * 2, abs=0.51e-9)
        assert [manoeuvre.duration, two.on_time] == pytest.approx([one.on_time] * 2, rel=1e-15)
        assert two.impulse == pytest.approx(one.impulse, rel=1e-12, abs=1e-12)
        assert two.propellant == (one.propellant and pytest.approx(one.propellant, rel=1e-15))
    # The schedule, flown from what came back, leaves what the plan leaves, and is read as a file without warnings.
    flown, expected = propagation.flown(back, schedule), plan.flown
    assert flown.residual.nutation == pytest.approx(known(expected).nutation, abs=1e-9)
    assert flown.residual.momentum_shift == pytest.approx(known(expected).momentum_shift, abs=1e-9)
    Path("back.csv").write_text(pulse_table(flown).csv(), encoding="utf-8")
    again, warnings = read_pulses(Path("back.csv"), back)
    assert warnings == []
    assert [pulse.start for pulse in again] == pytest.approx([pulse.start for pulse in schedule], abs=1e-14)


@pytest.mark.parametrize("scheme", ["one-pulse", "two-pulse"])
@pytest.mark.parametrize(
    "case", ["steerable-stage", "prolate, backwards", "oblate, backwards", deep("oblate"), deep("sphere")]
)
def test_a_steerable_torquer_plans_the_same_again(case: str, scheme: str, take: Take) -> None:
    body = replace(messages.spacecraft(case), limits=Limits(earliest=1.5))
    plan = planning.plan(body, scheme)
    assert plan.feasible
    _, text, back, _ = take(plan)
    assert known(back.steerable).torque == pytest.approx(known(known(body.steerable).torque), rel=1e-14)
    again = planning.plan(read_spacecraft(text, "back.yaml"), scheme)
    for one, two in zip(plan.pulses, again.pulses, strict=True):
        assert two.t == pytest.approx(one.t, rel=PLANNED_ALIKE)
        assert two.on_time == pytest.approx(one.on_time, rel=PLANNED_ALIKE)
        assert two.impulse == pytest.approx(one.impulse, abs=PLANNED_ALIKE * one.magnitude)


def test_torques_of_several_kinds_are_suggested_as_thrusters(take: Take) -> None:
    plan = planning.plan(messages.spacecraft("tilted tensor, backwards"), "four-pulse")
    _, text, back, _ = take(plan)
    assert back.steerable is None
    assert "    - [120.0 kg m^2, 3.0 kg m^2, 6.0 kg m^2]\n" in text
    taken = read_spacecraft(text.replace("# thrusters:", "thrusters:").replace("#   - {", "  - {"), "taken.yaml")
    torques = {tuple(np.round(taken.inertia.axes @ channel.torque, 12)) for channel in taken.channels}
    fired = [messages.in_file_axes(plan.spacecraft, pulse.torque) for pulse in plan.pulses if pulse.torque is not None]
    assert torques == {tuple(np.round(torque, 12)) for torque in fired}


def test_overlapping_manoeuvres_keep_apart_and_stand_in_the_order_of_their_starts(take: Take) -> None:
    """A long pulse that begins first may have its centre after a short one."""
    text = export_text(messages.planned("prolate"), "apm")
    first, second = text.index("MAN_START"), text.rindex("MAN_START")
    _, _, back, schedule = take(text[:second] + text[first:second] + text[second:])
    assert [pulse.channel for pulse in schedule] == ["steerable", "MAN2", "steerable"]
    assert propagation.flown(back, schedule).settled.spin == pytest.approx(math.pi)
    torque = np.array([1.0, 0.0, 0.0])
    pulses = Schedule(
        (Pulse(2.0, 2.0, "long", 2.0 * torque, torque), Pulse(1.5, 0.2, "short", 0.4 * torque, 2 * torque))
    )
    assert [pulse.channel for pulse in pulses] == ["short", "long"]
    _, _, back, schedule = take(Plan(messages.spacecraft("prolate"), "by hand", pulses))
    assert back.steerable is None  # of two torques there is none
    assert sorted(pulse.start for pulse in schedule) == pytest.approx([1.0, 1.4])


def test_names_are_quoted_and_epochs_written_plainly(take: Take) -> None:
    plan = messages.planned("prolate")
    _, text, back, _ = take(replace(plan, spacecraft=replace(plan.spacecraft, name='No: "1" #x')))
    assert back.name == 'NO: "1" #X'
    assert "  epoch: 2026-03-01T12:00:00Z\n" in text
    assert "epoch: 2026-03-01T12:00:00.25Z" in take(messages.planned("steerable-stage"))[1]


def test_what_no_spacecraft_can_be_points_at_the_block(take: Take) -> None:
    text = export_text(messages.planned("prolate"), "apm")
    edits = (
        ("IZZ               = 80.0", "IZZ               = 800.0"),
        ("IZZ               = 80.0", "IZZ               = -80.0"),
        ("ANGVEL_Z     = 180.0", "ANGVEL_Z     = 0.0"),
    )
    assert all(old in text for old, _ in edits)
    check_faults("files.apm-no-spacecraft", lambda edit: take(text.replace(*edit)), edits)


def test_times_of_another_system_become_utc_and_a_nutation_that_contradicts_is_said(take: Take) -> None:
    """A period of 720 s is none of this inertia, so that 0.1 deg cannot be."""
    text = earlier("mms1.apm.txt").read_text(encoding="utf-8")
    moments = []
    for system in ("UTC", "TAI", "TT"):
        apm, _, body, pulses = take(text.replace("= UTC", f"= {system}"))
        moments.append(apm.epoch)
        assert [pulse.start for pulse in pulses] == [3600.0]
        (said,) = contradictions(apm, body)
        check_text("files.nutation-contradicts", said)
        assert contradictions(apm._replace(nutation=body.widest.nutation), body) == []
    assert [moments[0].since(moment) for moment in moments[1:]] == [37.0, 37.0 + 32.184]
