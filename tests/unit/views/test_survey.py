"""``check``: what actuators can do, and what disturbances do in the long run, against flights."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import reference
from support.golden import check_text
from support.places import CASES
from support.process import Run

from nutdamp import flight, survey
from nutdamp.files.examples import example_text
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.flight import Residual
from nutdamp.physics import attitude, forced
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.schemes import one_pulse
from nutdamp.schemes.options import SchemeOptions
from nutdamp.schemes.tools import sun_pulses
from nutdamp.spacecraft import Disturbance, Spacecraft

EXAMPLE = read_spacecraft(example_text(), "example.yaml")
CALM = replace(EXAMPLE, omega0=np.array([0.0, 0.0, 3.0]))
SUNNY = """
name: Spinner
inertia: {A: 80 kg m^2, C: 120 kg m^2}
state: {spin: -30 rpm, nutation: 2 deg}
attitude: {quaternion: [1, 0, 0, 0]}
thrusters: [{name: T1, torque: [8, 0, 0], max_on_time: 900 ms}]
sun: [40 deg, 20 deg]
sun_sensor: {azimuth: 35 deg}
commands: {delay_step: 2 ms, delay_max: 1.9 s, width: {step: 1 ms, min: 20 ms, max: 1.8 s}, every: [1, 2]}
keep: [{name: pole, direction: [10 deg, 86 deg], min: 2 deg}]
"""
SUN_BODY = read_spacecraft(SUNNY, "sunny.yaml")


def fired(body: Spacecraft, on_time: float) -> Residual:
    """What one pulse of the first channel leaves."""
    return flight.flown(body, Schedule((channel_pulse(body.channels[0], 5.0, on_time),))).residual


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
    channel = replace(channel, thrusters=tuple(replace(each, **given) for each in channel.thrusters))
    body = replace(CALM, channels=(channel,), limits=replace(CALM.limits, tick=tick))
    (steps,) = survey.channel_steps(body)
    assert steps.smallest == pytest.approx(fired(body, shortest).nutation, rel=1e-9)
    assert steps.largest == pytest.approx(fired(body, min(longest, HALF)).nutation, rel=1e-9)


def test_a_channel_that_spins_up_does_most_by_a_shorter_pulse() -> None:
    """Over half a nutation period the spin rises by so much that such a pulse does nothing across the axis.

    By impulses: 5.42 s of T1 oppose all of ω, and no reason names a horizon that is far off.
    """
    body = read_spacecraft((CASES / "slow-89-deg.yaml").read_text(encoding="utf-8"), "slow-89-deg.yaml")
    (steps,) = survey.channel_steps(replace(body, channels=body.channels[:1]))
    assert steps.largest > math.radians(80.0)
    planned = one_pulse.schedule(body, SchemeOptions())
    assert planned.pulses[0].channel == "T1"
    assert planned.pulses[0].on_time == pytest.approx(5.4214, rel=1e-4)
    assert planned.end < 1e-2 * body.horizon


def test_the_nearest_pair_is_the_least_off_the_turn_between_halves() -> None:
    pair = survey.nearest_pair(EXAMPLE)
    assert pair is not None
    assert (pair.first.name, pair.second.name) == ("+M1", "-M2")
    assert abs(math.degrees(pair.miss)) == pytest.approx(0.086, abs=1e-3)  # 90° · (1 - cos 2.5°)
    assert math.degrees(survey.mounting_angle(EXAMPLE)) == pytest.approx(90.0, abs=0.1)


# --- disturbances ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("periods", [2.9, 3.1])
def test_a_beat_over_three_horizons_is_a_resonance(periods: float) -> None:
    """The beat has the period 2π/|aω3 + r|."""
    rate = 2.0 * math.pi / (periods * EXAMPLE.horizon) - EXAMPLE.inertia.a * EXAMPLE.spin
    (effect,) = survey.consequences(replace(EXAMPLE, disturbances=(Disturbance(1e-3 + 0j, rate=rate),)))
    assert effect.beat_period == pytest.approx(periods * EXAMPLE.horizon, rel=1e-9)
    assert (effect.tilt is None) is bool(effect.resonant) is (periods > 3.0)


def test_a_resonant_torque_drives_the_nutation_to_the_marks_when_reported() -> None:
    body = replace(EXAMPLE, disturbances=(Disturbance(0.4 + 0j, rate=-EXAMPLE.inertia.a * EXAMPLE.spin),))
    (effect,) = survey.consequences(body)
    assert effect.tilt is None
    mark, time = effect.resonant[0]
    assert mark == pytest.approx(math.radians(10.0))
    assert flight.flown(body, Schedule(), time).sampled(2, time).nutation[-1] == pytest.approx(mark, rel=1e-9)


def test_the_forced_tilt_stays_and_the_beat_swells_from_rest() -> None:
    """Flown for a beat period: from the steady rate the nutation keeps the tilt, from rest it swells to the beat."""
    A, C = CALM.inertia.A, CALM.inertia.C
    for torque, rate, precession in (  # equations K14, K15
        (0.4 - 0.3j, 0.0, 0.5 / (abs(A - C) * 3.0)),
        (0.24 + 0.1j, -3.0, 0.26 / (C * 3.0)),
        (0.3j, 0.7, None),
    ):
        body = replace(CALM, disturbances=(Disturbance(torque, rate=rate),))
        (effect,) = survey.consequences(body)
        assert effect.tilt is not None
        assert effect.beat is not None
        swollen = flight.flown(body, Schedule(), effect.beat_period).sampled(401, effect.beat_period).nutation
        assert swollen.max() == pytest.approx(effect.beat, rel=1e-4)
        assert swollen[-1] < 1e-12
        steady = forced.steady_response(A, C, 3.0, torque, rate)
        assert effect.precession == pytest.approx(abs(steady), rel=1e-12)
        assert precession is None or effect.precession == pytest.approx(precession, rel=1e-12)
        kept = replace(body, omega0=np.array([steady.real, steady.imag, 3.0]))
        angles = flight.flown(kept, Schedule(), 10.0).sampled(50, 10.0).nutation
        assert np.abs(angles - effect.tilt).max() < 1e-12


# --- Sun pulses and turns -------------------------------------------------------------------------------------------


def test_sun_pulses_are_those_of_the_motion() -> None:
    """The first is a root of the Sun's azimuth in the body by the reference integrator; on average they are a turn."""
    clock = survey.sun_clock(SUN_BODY)
    assert clock is not None
    assert clock.first is not None
    start = reference.Motion(SUN_BODY.omega0, attitude.matrix(SUN_BODY.initial.quaternion))
    (then,) = reference.coast(SUN_BODY.inertia.moments, start, np.zeros(3), np.array([clock.first]))
    seen = then.rotation.T @ SUN_BODY.sun
    assert math.degrees(math.atan2(seen[1], seen[0])) == pytest.approx(35.0, abs=1e-5)
    times = sun_pulses.sun_pulses(flight.flown(SUN_BODY, Schedule(), 900.0), 900.0)
    assert (times[-1] - times[0]) / (len(times) - 1) == pytest.approx(clock.turn, rel=1e-3)
    assert survey.sun_clock(EXAMPLE) is None


def test_the_turn_by_one_pulse_is_what_a_flight_from_rest_does() -> None:
    body = replace(SUN_BODY, omega0=np.array([0.0, 0.0, -math.pi]))
    (turn,) = survey.turns(body)
    assert [turn.smallest_width, turn.largest_width] == pytest.approx([0.02, 0.9])
    for width, angle in ((turn.smallest_width, turn.smallest), (turn.largest_width, turn.largest)):
        assert angle == pytest.approx(fired(body, width).momentum_shift, rel=2e-2)
    assert survey.turns(EXAMPLE) == ()


def test_check_shows_disturbances_sun_cones_and_commands(run: Run, tmp_path: Path) -> None:
    disturbances = (
        "[{name: leak, torque: [20 mN m, 0, 0]}, {kind: axial, torque: 1 mN m},"
        " {name: tune, kind: rotating, torque: [1 mN m, 0, 0], rate: -1}]"
    )
    text = f"name: X\ninertia: {{A: 120, C: 80}}\nomega0: [0.1, 0, 3]\ndisturbances: {disturbances}\n"
    shown = run("check", "-", "--json", "d.json", stdin=text).stdout
    (file,) = json.loads((tmp_path / "d.json").read_text())["files"]
    assert file["disturbances"][0]["precession_rad_s"] > 0.0
    assert file["disturbances"][2]["reaches"][0]["nutation_deg"] == pytest.approx(10.0)
    check_text("survey.disturbances", shown)
    check_text("survey.sun", run("check", "-", "--json", "d.json", stdin=SUNNY, columns=120).stdout)
    (file,) = json.loads((tmp_path / "d.json").read_text())["files"]
    assert file["sun_pulses"]["delay_step_deg"] == pytest.approx(0.36)
    assert [each["name"] for each in file["aspects"]] == ["pole", "Sun"]
    blind = SUNNY.replace("azimuth: 35 deg", "azimuth: 35 deg, elevation: -25 deg, half_width: 7 deg")
    assert "does not see the Sun at" in " ".join(run("check", "-", stdin=blind).stdout.split())
