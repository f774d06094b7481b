"""A schedule spin by spin: when each begins is held against the reference integrator, what fires against the plan."""

from __future__ import annotations

import csv
import io
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from support import reference, spinners
from support.builders import aimed, channel, cross, events, spinner

from nutdamp import planning
from nutdamp.errors import BadRequest
from nutdamp.files.exchange import export_text
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.files.spin_table import HEADER, spin_table
from nutdamp.schedule import Schedule, channel_pulse, on_command
from nutdamp.spacecraft import Limits, Spacecraft

pytestmark = pytest.mark.usefixtures("plans_shared")

SUNLIT = spinners.FILE.replace("C: 180", "C: 150")


def table(text: str) -> list[dict[str, str]]:
    assert text.splitlines()[0] == ",".join(HEADER)
    return list(csv.DictReader(io.StringIO(text)))


def turned(body: Spacecraft, schedule: Schedule, until: float) -> float:
    """∫ω3 dt from 0 to ``until`` s by Simpson on the reference integrator, rad."""
    edges = sorted({0.0, until, *(one for pulse in schedule for one in (pulse.start, pulse.end) if 0 < one < until)})
    total = 0.0
    rotation, rates = np.eye(3), body.omega0
    for begin, end in itertools.pairwise(edges):
        middle = 0.5 * (begin + end)
        torques = [one.torque for one in schedule if one.torque is not None and one.start < middle < one.end]
        steps = 2 * math.ceil(60 * (end - begin)) + 40
        times = np.linspace(0.0, end - begin, steps + 1)
        moved = reference.coast(
            body.inertia.moments, reference.Motion(rates, rotation), np.sum([np.zeros(3), *torques], axis=0), times[1:]
        )
        spins = np.array([rates[2], *(one.rates[2] for one in moved)])
        total += (times[1] / 3.0) * (spins[0] + spins[-1] + 4 * spins[1:-1:2].sum() + 2 * spins[2:-1:2].sum())
        rates, rotation = moved[-1].rates, moved[-1].rotation
    return total


@pytest.mark.parametrize("spin", [3.0, -3.0])
@pytest.mark.parametrize("moments", [(120.0, 120.0, 80.0), (100.0, 116.0, 140.0)])
def test_a_spin_is_a_turn_about_axis_3(moments: tuple[float, float, float], spin: float) -> None:
    """With thrusters that change the spin, and for a body on whose arcs ω3 waves."""
    screw = channel("screw", 6.0, 0.0, math.copysign(9.0, spin))
    body = spinner(spin=spin, moments=moments, degrees=8.0, channels=(screw,))
    made = Schedule(tuple(channel_pulse(screw, t, 0.8) for t in (1.1, 3.6, 3.9 + 2.7)))
    rows = table(spin_table(body, made, 9.0))
    assert len(rows) > 4
    assert float(rows[-1]["start_s"]) <= 9.0 < float(rows[-1]["start_s"]) + float(rows[-1]["period_s"])
    for number, row in enumerate(rows):
        assert int(row["spin"]) == number + 1
        assert row["start_utc"] == ""
        end = float(row["start_s"]) + float(row["period_s"])
        assert abs(turned(body, made, end)) == pytest.approx(2.0 * math.pi * (number + 1), abs=2e-8)
    assert sum(int(row["pulses"]) for row in rows) == 3
    assert abs(float(rows[-1]["period_s"]) / float(rows[0]["period_s"]) - 1.0) > 0.01


def test_every_pulse_is_in_its_spin_with_its_phase() -> None:
    body = aimed(spinner(degrees=0.0, channels=cross(60.0), limits=Limits(earliest=7.0)), 12.0, 45.0)
    plan = planning.plan(body, "rhumb-line")
    rows = table(export_text(plan, "spin-table"))
    found: list[tuple[float, str, float]] = []
    for row in rows:
        if row["pulses"] == "0":
            assert [row[name] for name in HEADER[-3:]] == ["", "", ""]
            continue
        cells = [row[name].split("; ") for name in HEADER[-3:]]
        assert [len(cell) for cell in cells] == 3 * [int(row["pulses"])]
        for name, phase, on_time in zip(*cells, strict=True):
            assert 0.0 <= float(phase) < 360.0
            start = float(row["start_s"]) + float(row["period_s"]) * float(phase) / 360.0
            found.append((start, name, float(on_time)))
    assert [name for _, name, _ in found] == [pulse.channel for pulse in plan.pulses]
    starts = [pulse.start for pulse in plan.pulses]
    assert [start for start, _, _ in found] == pytest.approx(starts, abs=1e-8)
    assert [on for _, _, on in found] == pytest.approx([pulse.on_time for pulse in plan.pulses], abs=1e-9)
    assert int(rows[0]["pulses"]) == 0
    assert float(rows[-1]["start_s"]) < starts[-1]


@pytest.mark.deep
def test_with_a_sensor_spins_are_counted_by_sun_pulses() -> None:
    """At each the Sun is at the azimuth of the sensor, and blocks are numbered and delayed alike."""
    body = read_spacecraft(SUNLIT, "sunlit.yaml")
    goal = replace(body.goal, axis=np.array([0.0, math.sin(0.15), math.cos(0.15)]))
    plan = planning.plan(replace(body, goal=goal), "command-block")
    assert plan.feasible
    rows = table(export_text(plan, "spin-table"))
    assert rows[0]["spin"] == "0"
    assert rows[0]["start_s"] == "0.0"
    assert rows[0]["start_utc"] == "1998-01-07T12:00:00.000000000Z"
    axes = np.eye(3)
    for row in rows[1::7]:
        moved = reference.fly(body.inertia.moments, body.omega0, events(plan.pulses), float(row["start_s"]), axes)
        assert body.sun is not None
        seen = moved.rotation.T @ body.sun
        assert math.degrees(math.atan2(seen[1], seen[0])) == pytest.approx(35.0, abs=1e-6)
    (block, *_) = plan.pulses.blocks
    fired = {int(row["spin"]): row for row in rows if row["pulses"] != "0"}
    expected = [b.first + index * b.every for b in plan.pulses.blocks for index in range(b.count)]
    assert sorted(fired) == expected
    row = fired[block.first]
    assert float(row["phase_deg"]) / 360.0 * float(row["period_s"]) == pytest.approx(block.delay, abs=1e-8)
    assert float(row["on_time_s"]) == pytest.approx(block.width, rel=1e-12)


def test_a_pulse_before_the_first_sun_pulse_is_in_spin_0() -> None:
    body = read_spacecraft(SUNLIT, "sunlit.yaml")
    (one,) = body.channels
    rows = table(spin_table(body, Schedule((channel_pulse(one, 0.3, 0.2),)), 1.0))
    assert [row["spin"] for row in rows] == ["0"]
    period = float(rows[0]["period_s"])
    assert period == pytest.approx(5.0, rel=1e-3)
    whole = table(spin_table(body, Schedule(), 1.0 + period))
    ends = float(whole[1]["start_s"])
    assert float(rows[0]["phase_deg"]) == pytest.approx(360.0 * (1.0 - (ends - 0.2) / period), abs=1.0)


def test_through_valves_on_times_and_phases_are_those_commanded() -> None:
    valve = "valve: {open_delay: 15 ms, close_delay: 5 ms, rise_time: 10 ms, fall_time: 2 ms}\n"
    body = read_spacecraft(SUNLIT + valve, "sunlit.yaml")
    (one,) = body.channels
    fired = on_command(one, 6.0, 0.2)
    assert fired.on_time == pytest.approx(0.186, rel=1e-12)
    (row,) = [row for row in table(spin_table(body, Schedule((fired,)), 10.0)) if row["pulses"] == "1"]
    assert float(row["on_time_s"]) == 0.2
    begins, period = float(row["start_s"]), float(row["period_s"])
    assert float(row["phase_deg"]) == pytest.approx(360.0 * (6.0 - begins) / period, abs=1e-6)


def test_what_makes_no_table() -> None:
    body = spinner()
    with pytest.raises(BadRequest, match="more than 100000 spins"):
        spin_table(body, Schedule(), 1e6)
    with pytest.raises(BadRequest, match="no XML"):
        export_text(planning.plan(body, "one-pulse"), "spin-table", xml=True)
    brake = channel("brake", 0.0, 0.0, -400.0)
    halted = Schedule((channel_pulse(brake, 0.4, 0.6),))  # 80 kg m² × 3 rad/s = 400 N m × 0.6 s
    with pytest.raises(BadRequest, match="comes to a halt"):
        spin_table(spinner(degrees=0.0, channels=(brake,)), halted, 1.0)
