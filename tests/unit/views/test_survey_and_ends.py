"""``check``: what actuators and disturbances do; where spin axis and H end, when pulses start, what
is shown as 0.
"""

import csv
import io
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import reference
from support.builders import Outcome, aimed, channel, present, spinner
from support.commands import CRAFTS
from support.places import CASES, case
from support.process import Run

from nutdamp.common import numerics
from nutdamp.errors import Infeasible
from nutdamp.figures import overview
from nutdamp.files.reader import example_text, load_spacecraft, read_spacecraft
from nutdamp.flight import propagation
from nutdamp.physics import attitude, driven, frames
from nutdamp.planning import capability
from nutdamp.planning import plan as planning
from nutdamp.planning.notes import spacecraft_notes
from nutdamp.schemes import block_model, one_pulse
from nutdamp.schemes.catalogue import SchemeOptions
from nutdamp.spacecraft import directions
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Attitude, Disturbance, Spacecraft
from nutdamp.spacecraft.schedule import Pulse, Schedule, channel_pulse, steerable_pulse
from nutdamp.views.decisions import final_json, plan_json, target_json
from nutdamp.views.parts import channel_text, pulse_table
from nutdamp.views.text import longitude, steering, vector

pytestmark = pytest.mark.usefixtures("plans_shared")

EXAMPLE = read_spacecraft(example_text(), "example.yaml")
CALM = replace(EXAMPLE, omega0=np.array([0.0, 0.0, 3.0]))
SUNNY = CRAFTS["sunny_yaml"]
SUN_BODY = read_spacecraft(SUNNY, "sunny.yaml")


def test_a_principal_axis_off_the_file_by_more_than_the_nutation_allowed_is_a_warning() -> None:
    """The tilt by the eigenvectors of the tensor; without a requirement damped is the limit."""
    tensor = [[752, 81.1, -25.7], [81.1, 1305, 74.1], [-25.7, 74.1, 1490]]
    state = "{spin: 5 rpm, nutation: 2 deg}"
    tilted = (
        f"name: x\ninertia: {{tensor: {tensor}}}\nstate: {state}\nrequirement: {{nutation: 1 deg}}"
    )
    body = read_spacecraft(tilted, "tilted.yaml")
    _, axes = np.linalg.eigh(tensor)
    tilt = math.acos(abs(axes[2, 2]))
    assert body.requirement is not None
    for share in (0.999, 1.001):
        at_edge = replace(body, requirement=replace(body.requirement, nutation=share * tilt))
        assert [entry.code for entry in spacecraft_notes(at_edge)] == (
            ["principal-axis-off"] if share < 1.0 else []
        )
    (warning,) = spacecraft_notes(replace(body, requirement=None))
    assert warning.values == pytest.approx(
        {"tilt_deg": math.degrees(tilt), "limit_deg": 0.01 * math.degrees(body.nutation)}, rel=1e-9
    )
    assert not [*spacecraft_notes(EXAMPLE)]


def test_opposite_blocks_with_delays_in_time_are_named() -> None:
    """As the spin changes they drift apart."""
    body = read_spacecraft(example_text("isee-3"), "isee-3.yaml")
    commands = present(body.commands)
    codes = [
        [entry.code for entry in spacecraft_notes(replace(body, commands=changed))]
        for changed in (
            replace(commands, per_turn=2),
            replace(commands, per_turn=2, delay_is="angle"),
            commands,
        )
    ]
    assert codes == [["delays-in-time"], [], []]


@pytest.mark.parametrize(("angles", "isps", "codes"), [
    ((0, 22), (220, 220), ["channels-push-alike"]),
    ((0, 23), (220, 220), []),
    ((350, 0, 10), (220, 220, 220), ["channels-push-alike"]),
    ((0, 0, 90), (220, 220, 220), []),
    ((30,), (220,), []),
    ((0, 180), (220, 111), []),
    ((0, 180), (220, 109), ["channels-waste"]),
])  # fmt: skip
def test_actuators_that_do_not_fit_are_notes(
    angles: tuple[float, ...], isps: tuple[float, ...], codes: list[str]
) -> None:
    """Half of a pulse of T_ω/8 is 22.5° of nutation; one channel alone is meant so."""
    body = spinner(
        channels=tuple(
            channel(f"T{at}", math.cos(at), math.sin(at), 0.0, isp=isp, thrust=1.0)
            for at, isp in zip(map(math.radians, angles), isps, strict=True)
        )
    )
    assert [entry.code for entry in spacecraft_notes(body)] == codes
    for entry in spacecraft_notes(body):
        if entry.code == "channels-waste":
            assert entry.values["worth_percent"] == pytest.approx(100.0 * 109 / 220, rel=1e-12)


def fired(body: Spacecraft, on_time: float) -> propagation.Residual:
    """What one pulse of the first channel leaves."""
    return propagation.flown(
        body, Schedule((channel_pulse(body.channels[0], 5.0, on_time),))
    ).residual


HALF = 0.5 * CALM.body_period
"""A longer pulse takes back what it has done."""


@pytest.mark.parametrize(
    ("given", "tick", "shortest", "longest"),
    [
        ({}, None, CALM.channels[0].min_on_time, CALM.channels[0].max_on_time),
        ({"min_on_time": 0.025, "max_on_time": math.inf}, None, 0.025, HALF),
        ({"min_on_time": 0.025, "max_on_time": 0.2}, 0.01, 0.03, 0.2),
        ({"min_on_time": 0.02, "max_on_time": 0.2}, 0.01, 0.02, 0.2),
        ({"min_on_time": 0.0, "max_on_time": 0.2}, 0.01, 0.01, 0.2),
    ],
)
def test_steps_are_what_the_shortest_and_the_longest_pulse_do_to_a_pure_spin(
    given: dict[str, Any], tick: float | None, shortest: float, longest: float
) -> None:
    channel = CALM.channels[0]
    channel = replace(
        channel, thrusters=tuple(replace(each, **given) for each in channel.thrusters)
    )
    body = replace(CALM, channels=(channel,), limits=replace(CALM.limits, tick=tick))
    (steps,) = capability.channel_steps(body)
    assert steps.smallest == pytest.approx(fired(body, shortest).nutation, rel=1e-9)
    assert steps.largest == pytest.approx(fired(body, min(longest, HALF)).nutation, rel=1e-9)


def test_a_channel_that_spins_up_does_most_by_a_shorter_pulse() -> None:
    """Over half a nutation period the spin rises by so much that such a pulse does nothing across
    the axis.

    By impulses: 5.42 s of T1 oppose all of ω, and no reason names a horizon that is far off.
    """
    body = read_spacecraft(
        (CASES / "slow-89-deg.yaml").read_text(encoding="utf-8"), "slow-89-deg.yaml"
    )
    (steps,) = capability.channel_steps(replace(body, channels=body.channels[:1]))
    assert steps.largest > math.radians(80.0)
    planned = one_pulse.schedule(body, SchemeOptions())
    assert planned.pulses[0].channel == "T1"
    assert planned.pulses[0].on_time == pytest.approx(5.4214, rel=1e-4)
    assert planned.end < 1e-2 * body.horizon


def test_the_nearest_pair_is_the_least_off_the_turn_between_halves() -> None:
    pair = present(capability.nearest_pair(EXAMPLE))
    assert (pair.first.name, pair.second.name) == ("+M1", "-M2")
    assert abs(math.degrees(pair.miss)) == pytest.approx(0.086, abs=1e-3)  # 90° · (1 - cos 2.5°)
    assert math.degrees(capability.mounting_angle(EXAMPLE)) == pytest.approx(90.0, abs=0.1)


@pytest.mark.parametrize("periods", [2.9, 3.1])
def test_a_beat_over_three_horizons_is_a_resonance(periods: float) -> None:
    """The beat has the period 2π/|aω3 + r|."""
    rate = 2.0 * math.pi / (periods * EXAMPLE.horizon) - EXAMPLE.inertia.a * EXAMPLE.spin
    (effect,) = capability.consequences(
        replace(EXAMPLE, disturbances=(Disturbance(1e-3 + 0j, rate=rate),))
    )
    assert effect.beat_period == pytest.approx(periods * EXAMPLE.horizon, rel=1e-9)
    assert (effect.tilt is None) is bool(effect.resonant) is (periods > 3.0)


def test_a_resonant_torque_drives_the_nutation_to_the_marks_when_reported() -> None:
    body = replace(
        EXAMPLE, disturbances=(Disturbance(0.4 + 0j, rate=-EXAMPLE.inertia.a * EXAMPLE.spin),)
    )
    (effect,) = capability.consequences(body)
    assert effect.tilt is None
    mark, time = effect.resonant[0]
    assert mark == pytest.approx(math.radians(10.0))
    assert propagation.flown(body, Schedule(), time).sampled(2, time).nutation[-1] == pytest.approx(
        mark, rel=1e-9
    )


def test_the_forced_tilt_stays_and_the_beat_swells_from_rest() -> None:
    """Flown for a beat period: from the steady rate the nutation keeps the tilt, from rest it
    swells to the beat.
    """
    A, C = CALM.inertia.A, CALM.inertia.C
    for torque, rate, forced in (  # equations K14, K15
        (0.4 - 0.3j, 0.0, 0.5 / (abs(A - C) * 3.0)),
        (0.24 + 0.1j, -3.0, 0.26 / (C * 3.0)),
        (0.3j, 0.7, None),
    ):
        body = replace(CALM, disturbances=(Disturbance(torque, rate=rate),))
        (effect,) = capability.consequences(body)
        swollen = (
            propagation.flown(body, Schedule(), effect.beat_period)
            .sampled(401, effect.beat_period)
            .nutation
        )
        assert swollen.max() == pytest.approx(present(effect.beat), rel=1e-4)
        assert swollen[-1] < 1e-12
        steady = driven.steady_response(A, (A - C) / A * 3.0, torque, rate)
        assert effect.forced == pytest.approx(abs(steady), rel=1e-12)
        assert forced is None or effect.forced == pytest.approx(forced, rel=1e-12)
        if rate == -3.0:  # fixed in space: from rest H leaves at M/|H|
            assert effect.precession == pytest.approx(forced, rel=1e-12)
            assert effect.swing is None
        else:
            assert effect.precession is None
            assert effect.swing is not None
        kept = replace(body, omega0=np.array([steady.real, steady.imag, 3.0]))
        angles = propagation.flown(kept, Schedule(), 10.0).sampled(50, 10.0).nutation
        assert np.abs(angles - present(effect.tilt)).max() < 1e-12


def test_a_torque_fixed_in_the_body_is_no_precession() -> None:
    """H never leaves its start by more than 0.0151 deg in 1,800 s, and ω settles about 0.007758
    rad/s: not H.
    """
    body = load_spacecraft(case("body-fixed-torque.yaml"))
    (effect,) = capability.consequences(body)
    assert effect.forced == pytest.approx(0.007758, abs=5e-7)
    assert effect.precession is None
    turns = propagation.flown(body, Schedule(), 1800.0).sampled(20_001, 1800.0).momentum
    aside = np.degrees(
        np.linalg.norm(np.cross(turns, turns[0]), axis=1) / np.linalg.norm(turns[0]) ** 2
    )
    assert math.degrees(present(effect.swing)) == pytest.approx(aside.max(), rel=2e-3)
    assert math.degrees(present(effect.swing)) == pytest.approx(0.0151, abs=5e-5)


def test_sun_pulses_are_those_of_the_motion() -> None:
    """The first is a root of the Sun's azimuth in the body by the reference integrator; on average
    they are a turn.
    """
    clock = present(capability.sun_clock(SUN_BODY))
    start = reference.Motion(SUN_BODY.omega0, attitude.matrix(SUN_BODY.initial.quaternion))
    (then,) = reference.coast(
        SUN_BODY.inertia.moments, start, np.zeros(3), np.array([present(clock.first)])
    )
    seen = then.rotation.T @ present(SUN_BODY.sun)
    assert math.degrees(math.atan2(seen[1], seen[0])) == pytest.approx(35.0, abs=1e-5)
    times = block_model.sun_pulses(propagation.flown(SUN_BODY, Schedule(), 900.0), 900.0)
    assert (times[-1] - times[0]) / (len(times) - 1) == pytest.approx(clock.turn, rel=1e-3)
    assert capability.sun_clock(EXAMPLE) is None


def test_the_turn_by_one_pulse_is_what_a_flight_from_rest_does() -> None:
    body = replace(SUN_BODY, omega0=np.array([0.0, 0.0, -math.pi]))
    (turn,) = capability.turns(body)
    assert [turn.smallest_width, turn.largest_width] == pytest.approx([0.02, 0.9])
    for width, angle in ((turn.smallest_width, turn.smallest), (turn.largest_width, turn.largest)):
        assert angle == pytest.approx(fired(body, width).momentum_shift, rel=2e-2)
    assert capability.turns(EXAMPLE) == ()


POINTED = CRAFTS["pointed_yaml"]
"""Its axis is 2 or 3 deg from right ascension 350 deg, declination 20 deg, and dated a second
before a leap second.
"""

part = st.floats(-1.0, 1.0, allow_subnormal=False)


@given(st.tuples(part, part, part))
def test_angles_of_a_direction_name_it(parts: tuple[float, float, float]) -> None:
    direction = np.array(parts)
    if np.linalg.norm(direction) < 1e-6:
        return
    direction /= np.linalg.norm(direction)
    ascension, declination = attitude.sphere_angles(direction)
    if ascension is None:
        assert abs(declination) > 0.5 * math.pi - 1e-10
    else:
        assert 0.0 <= ascension < 2.0 * math.pi
        assert 0.0 <= math.degrees(ascension) < 360.0
    assert np.linalg.norm(frames.on_sphere(ascension or 0.0, declination) - direction) < 2e-11
    body = spinner(degrees=10.0)
    azimuth, tilt = body.angles_of(direction)
    assert np.linalg.norm(directions.direction_in_n(body, tilt, azimuth or 0.0) - direction) < 2e-11


def test_the_smallest_negative_angle_is_no_full_turn() -> None:
    assert attitude.full_turn(-1e-20) == 0.0
    assert attitude.full_turn(-0.25) == pytest.approx(2 * math.pi - 0.25)
    shown = [longitude(359.99999), longitude(-1.5), steering([1.0, -1e-9])]
    assert shown == ["0", "358.5000", "0°"]


def test_final_is_where_the_reference_integrator_ends() -> None:
    """Without an attitude: tilt and azimuth in the frame N,
    which the integrator builds by itself.
    """
    body = aimed(spinner(degrees=6.0, spin=-3.0, steerable=Steerable(60.0)), 3.0, 200.0)
    plan = planning.plan(body, "two-pulse")
    assert plan.feasible
    outcome = Outcome(body, plan.pulses)
    final = final_json(plan._flight)
    ends = {
        "axis": outcome.motion.rotation @ np.array([0.0, 0.0, -1.0]),
        "momentum": reference.momentum(body.inertia.moments, outcome.motion),
    }
    for name, (x, y, z) in ends.items():
        assert final[name]["tilt_deg"] == pytest.approx(
            math.degrees(math.atan2(math.hypot(x, y), z)), abs=1e-7
        )
        assert final[name]["azimuth_deg"] == pytest.approx(
            math.degrees(math.atan2(y, x)) % 360.0, abs=1e-5
        )
    assert final["spin_rad_s"] == pytest.approx(outcome.spin, rel=1e-10)
    assert final["nutation_deg"] == pytest.approx(math.degrees(outcome.nutation), abs=1e-7)
    target = present(target_json(body))
    assert target["axis"] == {"tilt_deg": pytest.approx(3.0), "azimuth_deg": pytest.approx(200.0)}
    assert final["axis"]["azimuth_deg"] == pytest.approx(200.0, abs=0.1)


def test_a_plan_that_keeps_h_has_no_azimuth_and_one_that_fails_no_end() -> None:
    body = spinner(steerable=Steerable())
    assert final_json(planning.plan(body, "two-pulse")._flight)["momentum"]["azimuth_deg"] is None
    assert target_json(body) is None
    infeasible = plan_json(planning.Plan(body, "two-pulse", None, Infeasible("why")))
    assert (infeasible["final"], infeasible["target"], "aspects" in infeasible) == (
        None,
        None,
        False,
    )


@pytest.mark.parametrize(
    ("epoch", "last"), [(59.6, "2017-01-01T00:00:00"), (58.8, "2016-12-31T23:59:60")]
)
def test_pulses_say_when_they_start_in_utc(
    run: Run, tmp_path: Path, epoch: float, last: str
) -> None:
    """Across a leap second, which a clock that adds seconds to a date would miss."""
    (tmp_path / "leap.yaml").write_text(POINTED.replace("23:59:59Z", f"23:59:{epoch}Z"))
    run(
        "plan",
        "-v",
        "leap.yaml",
        "--scheme",
        "two-pulse",
        "--csv",
        "pulses.csv",
        "--json",
        "plan.json",
        "-q",
        status=0,
    )
    rows = list(csv.DictReader(io.StringIO((tmp_path / "pulses.csv").read_text())))
    pulses = json.loads((tmp_path / "plan.json").read_text())["plans"][0]["pulses"]
    for row, pulse in zip(rows, pulses, strict=True):
        seconds = float(row["start_s"]) + epoch
        minute = "2016-12-31T23:59" if seconds < 61.0 else "2017-01-01T00:00"
        whole = f"{minute}:{seconds if seconds < 61.0 else seconds - 61.0:012.9f}Z"
        assert row["utc"] == pulse["utc"] == whole
    assert rows[-1]["utc"].startswith(last)
    # What was written is read again, and the times of a file without an epoch stay as they are.
    assert run("simulate", "leap.yaml", "--schedule", "pulses.csv").stderr == ""
    assert (
        "utc"
        not in run("plan", "-", "--scheme", "two-pulse", "--csv", "-", stdin=example_text()).stdout
    )


def dated(epoch: str | None) -> Spacecraft:
    return replace(
        spinner(steerable=Steerable(5.0)),
        attitude=Attitude(np.array([1.0, 0.0, 0.0, 0.0]), epoch, "GCRF"),
    )


def steered(start: float, angle: float = 0.0) -> Pulse:
    return steerable_pulse(Steerable(5.0), start + 0.25, angle, on_time=0.5)


def test_a_screen_rounds_a_date_to_the_millisecond() -> None:
    """The start of each pulse is at most half a millisecond from the date shown, and the day is
    that of what is shown.

    The first pulse starts 0.3 ms before midnight: it is shown at midnight, on the next day.
    """
    pulses = Schedule(tuple(map(steered, (1.0, 2.0009, 3.0004))))
    table = pulse_table(
        planning.Plan(dated("2026-03-01T23:59:58.9997Z"), "x", pulses)._flight
    ).screen("full")
    column = next(column for column in table.columns if str(column.header).endswith("UTC"))
    assert list(map(str, column.cells)) == [
        f"03-02 {clock}" for clock in ("00:00:00.000", "00:00:01.001", "00:00:02.000")
    ]


def test_dates_that_no_calendar_has_are_left_out() -> None:
    bodies = [spinner(), *map(dated, (None, "1960-01-01T00:00:00Z", "9999-12-31T23:59:59Z"))]
    assert [body.utc(10.0) for body in bodies] == [None] * 4


def test_a_steering_angle_is_the_same_everywhere() -> None:
    body = spinner(steerable=Steerable(5.0))
    pulse = steered(0.75, math.radians(-70.123))
    assert channel_text(pulse, body) == "steerable 289.88°"
    figure = overview.flight_figure(
        "course", *overview.shown(planning.Plan(body, "x", Schedule((pulse,))))
    )
    assert any("289.88°" in text.get_text() for text in figure.axes[2].texts)


def test_what_is_rounding_beside_its_neighbours_is_zero(run: Run) -> None:
    """Vectors of a track and a check have components of the order of one, or zero."""
    noisy = np.array([[1.0, -4.484e-18, 0.0], [1e-20, 2e-20, -0.0], [5.0, 6e-13, -4.9e-13]])
    cleaned = numerics.cleaned(noisy)
    assert cleaned.tolist() == [[1.0, 0.0, 0.0], [1e-20, 2e-20, 0.0], [5.0, 6e-13, 0.0]]
    assert not np.signbit(cleaned).any()
    assert vector([4.484e-18, -0.0, 8.0]) == "(0, 0, 8)"
    assert [numerics.cleaned([change, 3.0])[0] for change in (4e-16, -4e-12)] == [0.0, -4e-12]
    tilted = str(case("tensor-microsat.yaml"))
    rows = list(
        csv.reader(io.StringIO(run("simulate", tilted, "--scheme", "none", "--csv", "-").stdout))
    )
    file = json.loads(run("check", tilted, "--json", "-").stdout)["files"][0]
    vectors = [channel["torque_Nm"] for channel in file["channels"]] + file["spacecraft"][
        "principal_axes"
    ]
    parts = [float(cell) for row in rows[1:] for cell in row[4:8]] + [
        value for each in vectors for value in each
    ]
    assert not [value for value in parts if 0.0 < abs(value) < 1e-14]
