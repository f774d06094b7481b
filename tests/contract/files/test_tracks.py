"""Histories of the attitude for others: fine enough for whoever interpolates, and the motion of the integrator."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.integrate import simpson
from support import messages, reference, spinners
from support.builders import aimed, channel, cross, events, spinner
from support.cases import spread
from support.contract import CASES, known, motions

from nutdamp.common.time import Epoch
from nutdamp.files.export import TURN, interpolated
from nutdamp.files.reader import read_spacecraft
from nutdamp.flight import propagation
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.model import Limits, Spacecraft, Vector
from nutdamp.spacecraft.schedule import Schedule, channel_pulse, on_command
from nutdamp.views.exchange import export_notes, export_text
from nutdamp.views.simulation import SPINS, spin_table

HEADER = [column.key for column in SPINS]

pytestmark = pytest.mark.usefixtures("plans_shared")


def flown_on(plan: Plan) -> propagation.Flight:
    """The flight to the end of a track."""
    return propagation.flown(plan.spacecraft, plan.pulses, plan.pulses.end + plan.spacecraft.inertial_period)


@CASES
def test_records_are_close_and_continuous(case: str) -> None:
    flown = flown_on(messages.planned(case))
    track = list(interpolated(flown, flown.legs[-1].end))
    assert track[0].t[0] == 0.0
    assert track[-1].t[-1] == pytest.approx(flown.legs[-1].end, abs=0.51e-9)
    for one, two in pairwise(track):
        assert two.t[0] == pytest.approx(one.t[-1], abs=4e-9)
    quaternion = np.concatenate([stretch.quaternion for stretch in track])
    assert np.all(np.sum(quaternion[1:] * quaternion[:-1], axis=1) > 0.9)  # no jumps of sign
    ends, worst = [pulse.end for pulse in flown.schedule], 0.0
    for stretch in track:
        assert stretch.completed == sum(end <= stretch.t[0] + 1e-9 for end in ends)
        assert len(stretch.t) >= 4
        assert np.all(np.diff(stretch.t) > 0.0)
        assert stretch.t.tolist() == (np.rint(stretch.t * 1e9) / 1e9).tolist()
        turns = np.linalg.norm(stretch.rates, axis=1)[1:] * np.diff(stretch.t)
        assert turns.max() <= 1.02 * TURN < math.radians(18.0)
        # Readers that look at quaternions only take one turn about a fixed axis from record to record.
        middle = stretch.quaternion[1:] + stretch.quaternion[:-1]  # half of the turn
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        leg = next(leg for leg in flown.legs if leg.start - 1e-9 <= stretch.t[0] and stretch.t[-1] <= leg.end + 1e-9)
        _, truth = leg.path.motion(0.5 * (stretch.t[1:] + stretch.t[:-1]))
        for one, two in zip(middle, truth, strict=True):
            worst = max(worst, messages.turned(attitude.matrix(one), messages.columns(flown.spacecraft, two)))
    assert worst <= 0.01


def stk(plan: Plan) -> tuple[dict[str, str], np.ndarray]:
    """Keywords of a file for STK with their values, and its rows: time, quaternion scalar last, rates in deg/s.

    The motion must be that of the flight.
    """
    lines = export_text(plan, "stk").splitlines()
    assert [lines[0], lines[2], lines[-1]] == ["stk.v.11.0", "BEGIN Attitude", "END Attitude"]
    begins = lines.index("AttitudeTimeQuatAngVels")
    keywords = dict(line.split(maxsplit=1) for line in lines[3:begins])
    rows = np.array([[float(part) for part in line.split()] for line in lines[begins + 1 : -1]])
    assert int(keywords["NumberOfAttitudePoints"]) == len(rows)
    assert keywords["CentralBody"] == "Earth"
    assert np.all(np.diff(rows[:, 0]) > 0.0)
    body, flown = plan.spacecraft, flown_on(plan)
    for t, *values in rows.tolist():
        # A row at the time of a jump shows the motion before it; the one a nanosecond later the motion after it.
        leg = next(leg for leg in flown.legs if leg.start <= t <= leg.end + 0.6e-9 and leg.end > leg.start)
        rates, quaternion = leg.path.motion(np.array([t]))
        turn = np.array([values[3], *values[:3]])
        assert messages.turned(attitude.matrix(turn), messages.columns(body, quaternion[0])) <= 1e-6
        assert np.radians(values[4:]) == pytest.approx(messages.in_file_axes(body, rates[0]), abs=1e-8)
    return keywords, rows


@CASES
def test_files_for_stk_have_the_motion_of_the_flight(case: str) -> None:
    """The edges of pulses are among the rows."""
    plan = messages.planned(case)
    keywords, rows = stk(plan)
    edges = np.array([edge for pulse in plan.pulses for edge in (pulse.start, pulse.end)])
    assert np.abs(rows[:, :1] - edges).min(axis=0).max() <= 0.51e-9
    if case == "steerable-stage":
        assert keywords["ScenarioEpoch"] == "1 Mar 2026 12:00:00.250000000"
    assert keywords["CoordinateAxes"] == ("ICRF" if known(plan.spacecraft.attitude).frame == "GCRF" else "J2000")


def test_ideal_impulses_let_the_rates_jump_within_a_nanosecond() -> None:
    plan = planning.plan(replace(messages.spacecraft("prolate"), steerable=None), "two-pulse")
    assert all(pulse.torque is None for pulse in plan.pulses)
    steps = np.diff(stk(plan)[1][:, 0])
    assert np.count_nonzero(steps < 1e-8) == sum(pulse.t > 0.0 for pulse in plan.pulses)


def unit(right_ascension: float, declination: float) -> Vector:
    """The direction of two angles in deg."""
    alpha, delta = math.radians(right_ascension), math.radians(declination)
    return np.array([math.cos(delta) * math.cos(alpha), math.cos(delta) * math.sin(alpha), math.sin(delta)])


def first_axis(alpha: float, delta: float, angle: float) -> Vector:
    """Body axis 1 by the turns Z-X-Z of annex F5, deg: about z by 90 + alpha, about x by 90 - delta, then angle."""
    node = np.array([-math.sin(math.radians(alpha)), math.cos(math.radians(alpha)), 0.0])
    turned = math.radians(angle)
    return np.asarray(math.cos(turned) * node + math.sin(turned) * np.cross(unit(alpha, delta), node))


@spread("case", [name for name in messages.BODIES if "tensor" not in name], quick=2)
def test_spin_nutation_and_momentum_are_those_of_the_motion(case: str) -> None:
    plan = messages.planned(case)
    body = plan.spacecraft
    text = export_text(plan, "aem-spin")
    assert "ANGVEL_FRAME" not in text
    assert re.search("^ATTITUDE_TYPE += SPIN/NUTATION_MOM$", text, re.MULTILINE)
    start = Epoch.parse(known(body.attitude).epoch or "")
    rows = re.findall(r"^([0-9]{4}-\S+) (.*)$", text, re.MULTILINE)[::6]
    times = [Epoch.parse(moment).since(start) for moment, _ in rows]
    assert sum(any(pulse.start < time < pulse.end for pulse in plan.pulses) for time in times) > 3
    moved = motions(body, plan.pulses, times, messages.columns(body, body.initial.quaternion))
    for (_, numbers), motion in zip(rows, moved, strict=True):
        alpha, delta, angle, own, momentum_alpha, momentum_delta, about = map(float, numbers.split())
        momentum = reference.momentum(body.inertia.moments, motion)
        assert unit(alpha, delta) == pytest.approx(motion.rotation[:, 2], abs=1e-8)
        assert first_axis(alpha, delta, angle) == pytest.approx(motion.rotation[:, 0], abs=1e-8)
        assert unit(momentum_alpha, momentum_delta) == pytest.approx(momentum / np.linalg.norm(momentum), abs=1e-10)
        turned = math.radians(about) * unit(momentum_alpha, momentum_delta) + math.radians(own) * unit(alpha, delta)
        assert turned == pytest.approx(motion.rotation @ motion.rates, abs=2e-8)


def leaning() -> Spacecraft:
    """A symmetric body whose axis leans by 1 deg from the third axis of its file."""
    lean = math.radians(1.0)
    turn = np.array([[1, 0, 0], [0, math.cos(lean), -math.sin(lean)], [0, math.sin(lean), math.cos(lean)]])
    tensor = (turn @ np.diag([120.0, 120.0, 80.0]) @ turn.T).tolist()
    return read_spacecraft(messages.BODIES["prolate"].replace("{A: 120, C: 80}", f"{{tensor: {tensor}}}"), "leaning")


@spread("case", ["leaning", *(name for name in messages.BODIES if "tensor" in name)], quick=2)
@pytest.mark.parametrize("xml", [False, True])
def test_bodies_without_steady_nutation_have_the_spin_of_each_moment(case: str, xml: bool) -> None:
    """The attitude by annex F5, and the rate about the third axis of the file; as keywords and values, and as XML."""
    plan = Plan(leaning(), "none", Schedule()) if case == "leaning" else messages.planned(case)
    body = plan.spacecraft
    assert (case == "leaning") == body.inertia.symmetric
    text = export_text(plan, "aem-spin", xml=xml)
    if xml:
        root = ElementTree.fromstring(text.split("\n", 1)[1])
        leaves = [
            [leaf.text or "" for leaf in spin] for state in root.iter("attitudeState") for spin in state.iter("spin")
        ]
        kinds = {entry.text for entry in root.iter("ATTITUDE_TYPE")}
    else:
        leaves = [line.split() for line in re.findall(r"^[0-9]{4}-\S+ .*$", text, re.MULTILINE)]
        kinds = set(re.findall(r"^ATTITUDE_TYPE += (\S+)$", text, re.MULTILINE))
    assert kinds == {"SPIN"}
    start, rows = Epoch.parse(known(body.attitude).epoch or ""), leaves[::6]
    assert len(rows) > 10
    times = [Epoch.parse(moment).since(start) for moment, *_ in rows]
    moved = motions(body, plan.pulses, times, messages.columns(body, body.initial.quaternion) @ body.inertia.axes)
    for (_, *numbers), motion in zip(rows, moved, strict=True):
        alpha, delta, angle, rate = map(float, numbers)
        columns = motion.rotation @ body.inertia.axes.T
        assert unit(alpha, delta) == pytest.approx(columns[:, 2], abs=1e-8)
        assert first_axis(alpha, delta, angle) == pytest.approx(columns[:, 0], abs=1e-8)
        assert math.radians(rate) == pytest.approx(messages.in_file_axes(body, motion.rates)[2], abs=2e-8)


def test_only_a_message_without_nutation_is_remarked_upon() -> None:
    plans = [messages.planned("prolate"), messages.planned("tilted tensor, backwards")]
    assert [[note.code for note in export_notes(plan, "aem-spin")] for plan in plans] == [[], ["spin-alone"]]
    assert export_notes(plans[1], "aem") == []


# --- a schedule spin by spin -----------------------------------------------------------------------------------------

SUNLIT = spinners.FILE.replace("C: 180", "C: 150")


def table(text: str) -> list[dict[str, str]]:
    assert text.splitlines()[0] == ",".join(HEADER)
    return list(csv.DictReader(io.StringIO(text)))


def turned(body: Spacecraft, pulses: Schedule, ends: list[float]) -> Iterable[float]:
    """∫ω3 dt from 0 to each of ``ends`` s by Simpson on the reference integrator, rad."""
    inner = (edge for pulse in pulses for edge in (pulse.start, pulse.end) if edge < ends[-1])
    grids = [np.linspace(a, b, 2 * math.ceil(60 * (b - a)) + 41) for a, b in pairwise(sorted({0.0, *ends, *inner}))]
    moved = iter(motions(body, pulses, np.concatenate(grids).tolist(), np.eye(3)))
    total = 0.0
    for grid in grids:
        total += float(simpson([next(moved).rates[2] for _ in grid], x=grid))
        if grid[-1] in ends:
            yield total


@pytest.mark.parametrize("spin", [3.0, -3.0])
@pytest.mark.parametrize("moments", [(120.0, 120.0, 80.0), (100.0, 116.0, 140.0)])
def test_a_spin_is_a_turn_about_axis_3(moments: tuple[float, float, float], spin: float) -> None:
    """With thrusters that change the spin, and for a body on whose arcs ω3 waves."""
    screw = channel("screw", 6.0, 0.0, math.copysign(9.0, spin))
    body = spinner(spin=spin, moments=moments, degrees=8.0, channels=(screw,))
    pulses = Schedule(tuple(channel_pulse(screw, t, 0.8) for t in (1.1, 3.6, 3.9 + 2.7)))
    rows = table(spin_table(body, pulses, 9.0))
    starts, periods = ([float(row[name]) for row in rows] for name in ("start_s", "period_s"))
    assert len(rows) > 4
    assert starts[-1] <= 9.0 < starts[-1] + periods[-1]
    assert [(row["spin"], row["start_utc"]) for row in rows] == [(str(number + 1), "") for number in range(len(rows))]
    angles = turned(body, pulses, [start + period for start, period in zip(starts, periods, strict=True)])
    for number, angle in enumerate(angles, start=1):
        assert abs(angle) == pytest.approx(2.0 * math.pi * number, abs=2e-8)
    assert sum(int(row["pulses"]) for row in rows) == 3
    assert abs(periods[-1] / periods[0] - 1.0) > 0.01


def test_every_pulse_is_in_its_spin_with_its_phase() -> None:
    body = aimed(spinner(degrees=0.0, channels=cross(60.0), limits=Limits(earliest=7.0)), 12.0, 45.0)
    plan = planning.plan(body, "rhumb-line")
    rows = table(export_text(plan, "spin-table"))
    fired: list[tuple[float, str, float]] = []
    for row in rows:
        cells = [row[name].split("; ") for name in HEADER[-3:]] if row["pulses"] != "0" else [[], [], []]
        assert [len(cell) for cell in cells] == 3 * [int(row["pulses"])]
        for name, phase, on_time in zip(*cells, strict=True):
            assert 0.0 <= float(phase) < 360.0
            start = float(row["start_s"]) + float(row["period_s"]) * float(phase) / 360.0
            fired.append((start, name, float(on_time)))
    starts = [pulse.start for pulse in plan.pulses]
    assert [name for _, name, _ in fired] == [pulse.channel for pulse in plan.pulses]
    assert [start for start, _, _ in fired] == pytest.approx(starts, abs=1e-8)
    assert [on for _, _, on in fired] == pytest.approx([pulse.on_time for pulse in plan.pulses], abs=1e-9)
    assert [rows[0][name] for name in HEADER[-4:]] == ["0", "", "", ""]
    assert float(rows[-1]["start_s"]) < starts[-1]


def test_with_a_sensor_spins_are_counted_by_sun_pulses() -> None:
    """At each the Sun is at the azimuth of the sensor, and blocks are numbered and delayed alike."""
    body = read_spacecraft(SUNLIT, "sunlit.yaml")
    goal = replace(body.goal, axis=np.array([0.0, math.sin(0.03), math.cos(0.03)]))
    plan = planning.plan(replace(body, goal=goal), "command-block")
    assert plan.feasible
    rows = table(export_text(plan, "spin-table"))
    assert [rows[0][name] for name in HEADER[:3]] == ["0", "1998-01-07T12:00:00.000000000Z", "0.0"]
    for row in rows[1::3]:
        moved = reference.fly(body.inertia.moments, body.omega0, events(plan.pulses), float(row["start_s"]), np.eye(3))
        seen = moved.rotation.T @ known(body.sun)
        assert math.degrees(math.atan2(seen[1], seen[0])) == pytest.approx(35.0, abs=1e-6)
    fired = {int(row["spin"]): row for row in rows if row["pulses"] != "0"}
    blocks = plan.pulses.blocks
    assert sorted(fired) == [block.first + index * block.every for block in blocks for index in range(block.count)]
    row = fired[blocks[0].first]
    assert float(row["phase_deg"]) / 360.0 * float(row["period_s"]) == pytest.approx(blocks[0].delay, abs=1e-8)
    assert float(row["on_time_s"]) == pytest.approx(blocks[0].width, rel=1e-12)


def test_a_pulse_before_the_first_sun_pulse_is_in_spin_0_and_commands_are_those_of_valves() -> None:
    body = read_spacecraft(SUNLIT, "sunlit.yaml")
    (row,) = table(spin_table(body, Schedule((channel_pulse(body.channels[0], 0.3, 0.2),)), 1.0))
    period = float(row["period_s"])
    assert row["spin"] == "0"
    assert period == pytest.approx(5.0, rel=1e-3)
    first = float(table(spin_table(body, Schedule(), 1.0 + period))[1]["start_s"])
    assert float(row["phase_deg"]) == pytest.approx(360.0 * (1.0 - (first - 0.2) / period), abs=1.0)
    # Through valves on-times and phases are those commanded.
    valve = "valve: {open_delay: 15 ms, close_delay: 5 ms, rise_time: 10 ms, fall_time: 2 ms}\n"
    body = read_spacecraft(SUNLIT + valve, "sunlit.yaml")
    pulse = on_command(body.channels[0], 6.0, 0.2)
    assert pulse.on_time == pytest.approx(0.186, rel=1e-12)
    (row,) = [row for row in table(spin_table(body, Schedule((pulse,)), 10.0)) if row["pulses"] == "1"]
    assert float(row["on_time_s"]) == 0.2
    phase = 360.0 * (6.0 - float(row["start_s"])) / float(row["period_s"])
    assert float(row["phase_deg"]) == pytest.approx(phase, abs=1e-6)
