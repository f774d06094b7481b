"""``check``: what actuators can do, and what disturbances do in the long run, against flights."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import reference
from support.places import CASES
from support.process import Run

from nutdamp import flight, survey
from nutdamp.files.examples import example_text
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.physics import attitude, forced
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.schemes import one_pulse
from nutdamp.schemes.options import SchemeOptions
from nutdamp.schemes.tools import sun_pulses
from nutdamp.spacecraft import Disturbance

EXAMPLE = read_spacecraft(example_text(), "example.yaml")
CALM = replace(EXAMPLE, omega0=np.array([0.0, 0.0, 3.0]))


def test_the_smallest_step_is_what_one_shortest_pulse_does_to_a_pure_spin() -> None:
    for steps in survey.channel_steps(CALM):
        shortest = channel_pulse(steps.channel, 1.0, steps.channel.min_on_time)
        flown = flight.flown(CALM, Schedule((shortest,))).residual
        assert steps.smallest == pytest.approx(flown.nutation, rel=1e-12)


@pytest.mark.parametrize(("least", "tick", "shortest"), [(0.025, 0.01, 0.03), (0.02, 0.01, 0.02), (0.0, 0.01, 0.01)])
def test_the_smallest_step_is_that_of_an_on_time_that_can_be_commanded(
    least: float, tick: float, shortest: float
) -> None:
    thrusters = tuple(replace(one, min_on_time=least) for one in CALM.channels[0].thrusters)
    channel = replace(CALM.channels[0], thrusters=thrusters)
    body = replace(CALM, channels=(channel,), limits=replace(CALM.limits, tick=tick))
    (steps,) = survey.channel_steps(body)
    flown = flight.flown(body, Schedule((channel_pulse(channel, 1.0, shortest),))).residual
    assert steps.smallest == pytest.approx(flown.nutation, rel=1e-9)


@pytest.mark.parametrize(("periods", "resonant"), [(2.9, False), (3.1, True)])
def test_a_beat_over_three_horizons_is_a_resonance(periods: float, resonant: bool) -> None:
    """The beat has the period 2π/|aω3 + r|."""
    detuning = 2.0 * math.pi / (periods * EXAMPLE.horizon)
    disturbance = Disturbance(1e-3 + 0j, rate=detuning - EXAMPLE.inertia.a * EXAMPLE.spin)
    (found,) = survey.consequences(replace(EXAMPLE, disturbances=(disturbance,)))
    assert found.beat_period == pytest.approx(periods * EXAMPLE.horizon, rel=1e-9)
    assert (found.tilt is None) is resonant
    assert bool(found.resonant) is resonant


def test_the_largest_step_is_what_half_a_nutation_period_does_to_a_pure_spin() -> None:
    """A longer pulse takes back what it has done; where max_on_time is shorter that bounds the step."""
    for longest, on_time in ((math.inf, 0.5 * CALM.body_period), (0.2, 0.2)):
        thrusters = tuple(replace(one, max_on_time=longest) for one in CALM.channels[0].thrusters)
        channel = replace(CALM.channels[0], thrusters=thrusters)
        (steps,) = survey.channel_steps(replace(CALM, channels=(channel,)))
        flown = flight.flown(CALM, Schedule((channel_pulse(channel, 5.0, on_time),))).residual
        assert steps.largest == pytest.approx(flown.nutation, rel=1e-9)


def test_the_forced_tilt_stays_and_the_beat_swells_from_rest() -> None:
    """Flown for a beat period: from the steady rate the nutation keeps the tilt, from rest it swells to the beat."""
    for disturbance in (Disturbance(0.4 - 0.3j), Disturbance(0.2 + 0.1j, rate=-3.0), Disturbance(0.3j, rate=0.7)):
        body = replace(CALM, disturbances=(disturbance,))
        (found,) = survey.consequences(body)
        assert found.tilt is not None
        assert found.beat is not None
        swollen = flight.flown(body, Schedule(), found.beat_period).sampled(401, found.beat_period).nutation
        assert swollen.max() == pytest.approx(found.beat, rel=1e-4)
        assert swollen[-1] < 1e-12
        inertia = body.inertia
        steady = forced.steady_response(inertia.A, inertia.C, 3.0, disturbance.transverse, disturbance.rate)
        assert found.precession == pytest.approx(abs(steady), rel=1e-12)
        kept = replace(body, omega0=np.array([steady.real, steady.imag, 3.0]))
        angles = flight.flown(kept, Schedule(), 10.0).sampled(50, 10.0).nutation
        assert np.abs(angles - found.tilt).max() < 1e-12


def test_precession_is_that_of_k14_and_k15() -> None:
    inertia = CALM.inertia
    fixed, space = Disturbance(0.4 + 0j), Disturbance(0.4 + 0j, rate=-3.0)
    first, second = survey.consequences(replace(CALM, disturbances=(fixed, space)))
    assert first.precession == pytest.approx(0.4 / (abs(inertia.A - inertia.C) * 3.0), rel=1e-12)
    assert second.precession == pytest.approx(0.4 / (inertia.C * 3.0), rel=1e-12)


def test_a_resonant_torque_drives_the_nutation_to_the_marks_when_reported() -> None:
    rate = -EXAMPLE.inertia.a * EXAMPLE.spin
    body = replace(EXAMPLE, disturbances=(Disturbance(0.4 + 0j, rate=rate),))
    (found,) = survey.consequences(body)
    assert found.tilt is None
    mark, time = found.resonant[0]
    assert mark == pytest.approx(math.radians(10.0))
    assert flight.flown(body, Schedule(), time).sampled(2, time).nutation[-1] == pytest.approx(mark, rel=1e-9)


def test_the_nearest_pair_is_the_least_off_the_turn_between_halves() -> None:
    pair = survey.nearest_pair(EXAMPLE)
    assert pair is not None
    assert (pair.first.name, pair.second.name) == ("+M1", "-M2")
    assert abs(math.degrees(pair.miss)) == pytest.approx(0.086, abs=1e-3)  # 90° · (1 - cos 2.5°)
    assert math.degrees(survey.mounting_angle(EXAMPLE)) == pytest.approx(90.0, abs=0.1)


def test_check_shows_disturbances(run: Run, tmp_path: Path) -> None:
    text = (
        "name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n"
        "disturbances: [{name: leak, torque: [20 mN m, 0, 0]}, {kind: axial, torque: 1 mN m},"
        " {name: tune, kind: rotating, torque: [1 mN m, 0, 0], rate: -1}]\n"
    )
    (tmp_path / "d.yaml").write_text(text)
    done = run("check", "d.yaml", "--json", "d.json")
    for said in ("leak", "forces a tilt", "precession", "tune", "resonant", "changes the spin"):
        assert said in done.stdout
    found = json.loads((tmp_path / "d.json").read_text())["files"][0]["disturbances"]
    assert found[0]["precession_rad_s"] > 0.0
    assert found[2]["reaches"][0]["nutation_deg"] == pytest.approx(10.0)


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


def test_sun_pulses_are_those_of_the_motion() -> None:
    """The first is a root of the Sun's azimuth in the body by the reference integrator; on average they are a turn."""
    body = read_spacecraft(SUNNY, "sunny.yaml")
    clock = survey.sun_clock(body)
    assert clock is not None
    assert clock.first is not None
    assert body.sun is not None
    start = reference.Motion(body.omega0, attitude.matrix(body.initial.quaternion))
    (then,) = reference.coast(body.inertia.moments, start, np.zeros(3), np.array([clock.first]))
    seen = then.rotation.T @ body.sun
    assert math.degrees(math.atan2(seen[1], seen[0])) == pytest.approx(35.0, abs=1e-5)
    times = sun_pulses.sun_pulses(flight.flown(body, Schedule(), 900.0), 900.0)
    assert (times[-1] - times[0]) / (len(times) - 1) == pytest.approx(clock.turn, rel=1e-3)
    assert survey.sun_clock(EXAMPLE) is None


def test_the_turn_by_one_pulse_is_what_a_flight_from_rest_does() -> None:
    body = replace(read_spacecraft(SUNNY, "sunny.yaml"), omega0=np.array([0.0, 0.0, -math.pi]))
    (turn,) = survey.turns(body)
    assert [turn.smallest_width, turn.largest_width] == pytest.approx([0.02, 0.9])
    for width, angle in ((turn.smallest_width, turn.smallest), (turn.largest_width, turn.largest)):
        flown = flight.flown(body, Schedule((channel_pulse(body.channels[0], 1.0, width),))).residual
        assert angle == pytest.approx(flown.momentum_shift, rel=2e-2)
    assert survey.turns(EXAMPLE) == ()


def test_check_shows_sun_cones_and_commands(run: Run) -> None:
    shown = " ".join(run("check", "-", stdin=SUNNY, columns=200).stdout.split())
    assert "axis from pole 176 deg at t = 0 (at least 2 deg)" in shown
    assert "axis from Sun 110 deg at t = 0" in shown
    assert "Sun pulses one every" in shown
    assert "delay in steps of 2 ms = 0.36 deg of spin, up to 1.9 s = 342 deg" in shown
    assert "up to 255 pulses, one every 1 or 2 spins" in shown
    (file,) = json.loads(run("check", "-", "--json", "-", stdin=SUNNY).stdout)["files"]
    assert file["sun_pulses"]["delay_step_deg"] == pytest.approx(0.36)
    assert [one["name"] for one in file["aspects"]] == ["pole", "Sun"]
    blind = SUNNY.replace("azimuth: 35 deg", "azimuth: 35 deg, elevation: -25 deg, half_width: 7 deg")
    shown = " ".join(run("check", "-", stdin=blind, columns=200).stdout.split())
    assert "the Sun sensor does not see the Sun at" in shown


def test_the_largest_step_of_a_channel_that_spins_up_is_that_of_a_shorter_pulse() -> None:
    """Over half a nutation period the spin rises by so much that such a pulse does nothing across the axis."""
    body = read_spacecraft((CASES / "slow-89-deg.yaml").read_text(encoding="utf-8"), "slow-89-deg.yaml")
    for steps in survey.channel_steps(body):
        assert steps.largest > math.radians(80.0)


def test_one_pulse_is_not_cut_to_what_the_longest_pulse_of_a_channel_that_spins_up_does() -> None:
    """Impulse approximation: 5.42 s of T1 oppose all of ω, and no reason names a horizon that is far off."""
    body = read_spacecraft((CASES / "slow-89-deg.yaml").read_text(encoding="utf-8"), "slow-89-deg.yaml")
    made = one_pulse.schedule(body, SchemeOptions())
    assert made.pulses[0].channel == "T1"
    assert made.pulses[0].on_time == pytest.approx(5.4214, rel=1e-4)
    assert made.end < 1e-2 * body.horizon
