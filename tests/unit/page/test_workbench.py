"""Data of the workbench, and the bodies that have none; what its script computes is tested in a browser."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from support.cases import deep
from support.places import case
from support.shown import compared_text

from nutdamp.files.reader import example_text
from nutdamp.page.document import Moving
from nutdamp.page.moving import moving_of
from nutdamp.page.workbench import absence
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.schedule import Schedule

pytestmark = pytest.mark.usefixtures("plans_shared")

EXAMPLE = example_text()
TARGET = case("far-target.yaml").read_text(encoding="utf-8")
VALVE = "valve: {open_delay: 8 ms, close_delay: 12 ms, rise_time: 5 ms, fall_time: 10 ms}"


def chosen(text: str) -> Plan:
    plan = compared_text(text).recommended
    assert plan is not None
    return plan


def view(text: str) -> Moving:
    return moving_of(chosen(text))


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        ("dissipation: {time_constant: 600 s}", "energy dissipation"),
        ("disturbances: [{torque: [20 mN m, 0, 0]}]", "disturbance torques"),
        deep("tank: {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar}", "blowdown"),
        deep("cold: {first: 90 %, pulses: 4}", "cold pulses"),
        deep(VALVE, "valves"),
    ],
)
def test_other_bodies_have_none_and_the_view_has_the_reason(more: str, reason: str) -> None:
    made = view(f"{EXAMPLE}\n{more}\n")
    assert (made.workbench, made.absent) == (None, reason)
    assert json.loads(made.data)["bench"] is None


def test_three_moments_and_schedules_without_pulses_have_none() -> None:
    plan = chosen(EXAMPLE)
    assert absence(plan.spacecraft, plan.pulses) == ""
    assert absence(plan.spacecraft, Schedule()) == "no pulses"
    inertia = replace(plan.spacecraft.inertia, moments=(120.0, 100.0, 60.0))
    assert absence(replace(plan.spacecraft, inertia=inertia), plan.pulses) == "I1 ≠ I2"


def test_its_data_are_the_plan_and_the_limits_of_the_file() -> None:
    text = EXAMPLE + "limits: {horizon: 60 s, earliest: 1 s, gap: 0.2 s, tick: 1 ms, blackout: [[30 s, 31 s]]}\n"
    plan, made = chosen(text), view(text)
    bench = json.loads(made.data)["bench"]
    pulses = plan.pulses.pulses
    assert [(entry["t"], entry["on"], entry["channel"]) for entry in bench["pulses"]] == [
        (pulse.t, pulse.on_time, pulse.channel) for pulse in pulses
    ]
    assert [entry["impulse"] for entry in bench["pulses"]] == [pulse.impulse.tolist() for pulse in pulses]
    assert {(entry["least"], entry["most"]) for entry in bench["pulses"]} == {(0.02, 2.0)}
    limits = {"earliest": 1.0, "horizon": 60.0, "gap": 0.2, "tick": 1e-3, "blackout": [[30.0, 31.0]], "most": None}
    assert bench["limits"] == limits
    assert made.workbench is not None
    assert [(key, limit) for key, _, limit in made.workbench.rows] == [
        ("nutation", "≤ 0.5°"),
        ("momentum_shift", "≤ 0.2°"),
    ]


def test_with_a_target_the_axis_error_is_bounded_and_ideal_impulses_have_no_on_time() -> None:
    made = view(TARGET)
    assert made.workbench is not None
    rows = [(key, limit) for key, _, limit in made.workbench.rows]
    assert rows == [("nutation", ""), ("momentum_shift", ""), ("axis_error", "≤ 4°")]
    pulses = json.loads(made.data)["bench"]["pulses"]
    assert {(entry["on"], entry["torque"], entry["most"]) for entry in pulses} == {(0.0, None, None)}
