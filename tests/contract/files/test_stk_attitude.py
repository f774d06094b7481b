"""Attitude files for STK: the form of the format, and the motion in it against the flight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support import messages

from nutdamp import flight, planning
from nutdamp.files.exchange import export_text
from nutdamp.physics import attitude
from nutdamp.planning import Plan

pytestmark = pytest.mark.usefixtures("plans_shared")

CASES = pytest.mark.parametrize("case", messages.CASES)


def read(text: str) -> tuple[dict[str, str], np.ndarray]:
    """Keywords with their values, and the rows: time, quaternion scalar last, rates in deg/s."""
    lines = text.splitlines()
    assert lines[0] == "stk.v.11.0"
    assert [lines[2], lines[-1]] == ["BEGIN Attitude", "END Attitude"]
    begins = lines.index("AttitudeTimeQuatAngVels")
    keywords = dict(line.split(maxsplit=1) for line in lines[3:begins])
    rows = np.array([[float(part) for part in line.split()] for line in lines[begins + 1 : -1]])
    return keywords, rows


def check(plan: Plan, keywords: dict[str, str], rows: np.ndarray) -> None:
    body = plan.spacecraft
    assert int(keywords["NumberOfAttitudePoints"]) == len(rows)
    assert keywords["CentralBody"] == "Earth"
    assert np.all(np.diff(rows[:, 0]) > 0.0)
    until = plan.pulses.end + body.inertial_period
    flown = flight.flown(body, plan.pulses, until)
    for t, *values in rows.tolist():
        # A row at the time of a jump shows the motion before it; the one a nanosecond later the motion after it.
        leg = next(leg for leg in flown.legs if leg.start <= t <= leg.end + 0.6e-9 and leg.end > leg.start)
        rates, quaternion = leg.path.motion(np.array([t]))
        turn = np.array([values[3], *values[:3]])
        assert messages.turned(attitude.matrix(turn), messages.columns(body, quaternion[0])) <= 1e-6
        assert np.radians(values[4:]) == pytest.approx(messages.in_file_axes(body, rates[0]), abs=1e-8)


@pytest.mark.deep
@CASES
def test_the_motion_is_that_of_the_flight(case: str) -> None:
    plan = messages.planned(case)
    keywords, rows = read(export_text(plan, "stk"))
    check(plan, keywords, rows)
    # The edges of pulses are among the rows.
    for pulse in plan.pulses:
        assert np.abs(rows[:, 0] - pulse.start).min() <= 0.51e-9
        assert np.abs(rows[:, 0] - pulse.end).min() <= 0.51e-9


def test_epoch_and_axes() -> None:
    keywords, _ = read(export_text(messages.planned("steerable-stage"), "stk"))
    assert keywords["ScenarioEpoch"] == "1 Mar 2026 12:00:00.250000000"
    assert keywords["CoordinateAxes"] == "ICRF"
    keywords, _ = read(export_text(messages.planned("prolate"), "stk"))
    assert keywords["CoordinateAxes"] == "J2000"


def test_ideal_impulses_let_the_rates_jump_within_a_nanosecond() -> None:
    plan = planning.plan(replace(messages.spacecraft("prolate"), steerable=None), "two-pulse")
    assert all(pulse.torque is None for pulse in plan.pulses)
    keywords, rows = read(export_text(plan, "stk"))
    check(plan, keywords, rows)
    steps = np.diff(rows[:, 0])
    assert np.count_nonzero(steps < 1e-8) == sum(pulse.t > 0.0 for pulse in plan.pulses)
