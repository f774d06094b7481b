"""Spacecraft file carried on: it flies as the flight that it was taken from does, and keeps its comments."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.process import Run

import nutdamp
from nutdamp.errors import BadRequest
from nutdamp.files.carried import later
from nutdamp.files.reader import Source
from nutdamp.flight.dynamics import supplied
from nutdamp.physics import attitude
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

BASE = """
name: Sounder  # flown twice
inertia: {A: 120 kg m^2, C: 80 kg m^2}
state: {spin: 30 rpm, nutation: 5 deg, phase: 20 deg}   # as released
thrusters:
  - {name: P, torque: [8, 0, 0], isp: 220 s, lever_arm: 0.8 m, max_on_time: 1 s}
  - {name: N, torque: [-8, 0, 0], isp: 220 s, lever_arm: 0.8 m, max_on_time: 1 s}
"""
ATTITUDE = "attitude: {quaternion: [0.9, 0.1, -0.2, 0.3], epoch: 2026-03-01T12:00:00Z, frame: EME2000}\n"
TENSOR = "{tensor: [[120, 2, 1], [2, 110, 0.5], [1, 0.5, 80]]}"
TANK = (
    "tank: {propellant: 0.5 kg, pressure: 22 bar, final_pressure: 8 bar, inertia_per_kg: {A: 3, C: 5}}\nmass: 250 kg\n"
)
LEAK = "disturbances: [{name: leak, torque: [5 mN m, 2 mN m, 0], rate: -1.3 rad/s}]\n"

TEXTS = {
    "symmetric": BASE + ATTITUDE,
    "tensor": BASE.replace("{A: 120 kg m^2, C: 80 kg m^2}", TENSOR) + ATTITUDE,
    "rates": BASE.replace("state: {spin: 30 rpm, nutation: 5 deg, phase: 20 deg}", "omega0: [0.2, 5 deg/s, 3]")
    + ATTITUDE,
    "tank": BASE + ATTITUDE + TANK,
    "turning torque": BASE + ATTITUDE + LEAK,
}


def planned(text: str) -> nutdamp.Plan:
    return nutdamp.plan(nutdamp.read(text), "two-pulse")


def turned(first: np.ndarray, second: np.ndarray) -> float:
    """Angle between two attitudes, rad."""
    return float(2.0 * np.linalg.norm(attitude.multiply(attitude.conjugate(first), second)[1:]))


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_the_file_carried_on_flies_as_the_plan_does(text: str) -> None:
    plan = planned(text)
    carried = plan.carried(40.0)
    expected, flight = plan.fly(70.0).track, nutdamp.plan(carried, "none").fly(30.0).track
    assert np.allclose(flight.rates[-1], expected.rates[-1], rtol=0.0, atol=1e-10)
    assert turned(flight.quaternion[-1], expected.quaternion[-1]) < 1e-9
    assert carried.attitude is not None
    assert carried.attitude.epoch == "2026-03-01T12:00:40Z"


def test_tank_and_mass_are_those_left() -> None:
    plan = planned(TEXTS["tank"])
    used, carried = plan.propellant or 0.0, plan.carried()
    before, after = plan.spacecraft.tank, carried.tank
    assert before is not None
    assert after is not None
    assert (after.propellant, carried.mass) == pytest.approx((0.5 - used, 250.0 - used))
    assert after.pressure == pytest.approx(before.pressure_after(used))
    # What is left acts as the rest of the same tank.
    assert after.thrust_factor(0.1) * after.pressure == pytest.approx(before.pressure_after(used + 0.1))
    assert carried.inertia.moments == pytest.approx((120.0 - 3.0 * used, 120.0 - 3.0 * used, 80.0 - 5.0 * used))


def test_a_target_stays_where_it_is_in_space() -> None:
    """Without an attitude a file knows space by the motion at t = 0, which is another one in the file carried on."""
    plan = nutdamp.plan(nutdamp.read(BASE + "goal: {tilt: 10 deg, azimuth: 45 deg}\n"), "none")
    moved_on = later(plan.reaching(33.0), 33.0)
    carried = plan.carried(33.0)
    seen = [
        attitude.rotate(attitude.conjugate(moved_on.quaternion), plan.spacecraft.target_axis),
        attitude.rotate(attitude.conjugate(carried.initial.quaternion), carried.target_axis),
    ]
    assert np.allclose(seen[0], seen[1], rtol=0.0, atol=1e-10)


def test_comments_and_units_are_kept() -> None:
    carried = planned(BASE).carried(40.0)
    assert isinstance(carried.source, Source)
    lines = carried.source.text.splitlines()
    assert "name: Sounder  # flown twice" in lines
    assert lines[3].startswith("state: {spin: 30 rpm, nutation: ")
    assert lines[3].endswith(" deg}   # as released")
    assert lines[4:] == BASE.splitlines()[4:]


def test_a_chain_of_files_is_one_flight() -> None:
    body = nutdamp.read(TEXTS["symmetric"])
    once, many = nutdamp.plan(body, "none").carried(60.0), body
    for _ in range(6):
        many = nutdamp.plan(many, "none").carried(10.0)
    assert many.omega0 == pytest.approx(once.omega0, abs=1e-10)
    assert turned(many.initial.quaternion, once.initial.quaternion) < 1e-9


def test_what_no_file_can_hold_is_refused() -> None:
    plan = planned(BASE)
    first = plan.pulses[0]
    with pytest.raises(BadRequest, match="is on at"):
        plan.carried(first.t)
    body = nutdamp.read(BASE + TANK.replace("0.5 kg", "1 g"))
    empty = Plan(body, "by hand", Schedule(supplied(body, [channel_pulse(body.channels[0], 3.0, 5.0)])))
    with pytest.raises(BadRequest, match="no propellant"):
        empty.carried()
    for time in (-3.0, float("nan"), float("inf")):
        with pytest.raises(BadRequest, match="after t = 0"):
            plan.carried(time)
    replaced: Spacecraft = plan.spacecraft.replace(mass=3.0)
    with pytest.raises(BadRequest, match="no field replaced"):
        nutdamp.plan(replaced, "two-pulse").carried()


@pytest.mark.parametrize(("command", "lasts"), [
    (("plan", "--nominal", "--scheme", "two-pulse"), 3.0),
    (("simulate", "--scheme", "two-pulse", "--until", "20s"), 20.0),
])  # fmt: skip
def test_commands_write_it(run: Run, tmp_path: Path, command: tuple[str, ...], lasts: float) -> None:
    (tmp_path / "now.yaml").write_text(TEXTS["symmetric"])
    result = run(*command, "now.yaml", "-o", "next.yaml")
    assert result.returncode == 0
    carried = nutdamp.load(tmp_path / "next.yaml")
    assert carried.attitude is not None
    assert carried.attitude.epoch is not None
    assert float(carried.attitude.epoch[17:19]) >= lasts


def test_its_moment_needs_its_name(run: Run, tmp_path: Path) -> None:
    (tmp_path / "now.yaml").write_text(TEXTS["symmetric"])
    result = run("simulate", "now.yaml", "--scheme", "none", "--at", "5s")
    assert result.returncode == 2
    assert "-o" in result.stderr
