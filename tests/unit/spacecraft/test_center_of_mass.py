"""Center of mass: arms of the thrusters, its travel with the propellant, and how far it may be off."""

from __future__ import annotations

import numpy as np
import pytest

import nutdamp
from nutdamp.files.carried import later
from nutdamp.flight.dynamics import Supply
from nutdamp.flight.propagation import flown
from nutdamp.montecarlo.cases import DispersedModel
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

TEXT = """
name: b
mass: 250 kg
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg, phase: 20 deg}
thrusters:
  - {name: P, position: [0.1, 0.5, 1.2], direction: [0, -1, 0], force: 10 N, isp: 220 s, max_on_time: 2 s}
  - {name: N, position: [0.1, -0.5, 1.2], direction: [0, 1, 0], force: 10 N, isp: 220 s, max_on_time: 2 s}
center_of_mass: [0.1 m, 0, 40 cm]
"""
MOVING = f"{TEXT}center_of_mass_per_kg: [0, 0, -50 mm/kg]\n"
TENSOR = "{tensor: [[120, 2, 1], [2, 110, 0.5], [1, 0.5, 80]]}"


def test_arms_count_from_the_center_of_mass() -> None:
    body = nutdamp.read(TEXT)
    assert body.channels[0].torque == pytest.approx(np.cross([0.0, 0.5, 0.8], [0.0, -10.0, 0.0]))
    assert body.channels[1].torque == pytest.approx(np.cross([0.0, -0.5, 0.8], [0.0, 10.0, 0.0]))


def test_a_force_through_the_center_of_mass_turns_nothing() -> None:
    through = TEXT.replace("direction: [0, -1, 0]", "direction: [0, 0.5, 0.8]")
    with pytest.raises(nutdamp.errors.FaultyFile, match="centre of mass"):
        nutdamp.read(through)


def test_an_accelerometer_counts_from_it_too() -> None:
    loop = "loop: {sensor: {kind: accelerometer, rate: 10 Hz, position: [0.9, 0, 0.4]}, start: 1 deg, stop: 0.1 deg}\n"
    body = nutdamp.read(TEXT + loop)
    assert body.loop is not None
    assert body.loop.sensor.position == pytest.approx([0.8, 0.0, 0.0])


@pytest.mark.parametrize("inertia", ["{A: 120, C: 80}", TENSOR])
def test_it_moves_with_the_propellant_used(inertia: str) -> None:
    """By the moment of force about where it is in the middle of the pulse."""
    body = nutdamp.read(MOVING.replace("{A: 120, C: 80}", inertia))
    supply, channel = Supply(body), body.channels[0]
    supply.draw(3.0)
    fired = supply.fire(channel_pulse(channel, 10.0, 1.0), channel)
    used = 3.0 + 0.5 * (channel.mass_flow or 0.0)
    center = np.array([0.1, 0.0, 0.4 - 0.05 * used])
    expected = np.cross(np.array([0.1, 0.5, 1.2]) - center, [0.0, -10.0, 0.0])
    assert fired.torque is not None
    assert body.inertia.axes @ fired.torque == pytest.approx(expected, abs=1e-12)


def test_plans_are_corrected_for_its_travel() -> None:
    """Propellant of a thousandth of the isp: the arm changes by a tenth within a plan."""
    body = nutdamp.read(MOVING.replace("isp: 220 s", "isp: 0.5 s"))
    plan = nutdamp.plan(body, "four-pulse")
    assert plan.flown is not None
    assert plan.flown.nutation < 1e-6
    sizes = {round(float(np.linalg.norm(pulse.torque)), 6) for pulse in plan.pulses if pulse.torque is not None}
    assert len(sizes) == len(plan.pulses)
    fixed = flown(body, Schedule(tuple(channel_pulse(body.channels[int(pulse.channel == "N")], pulse.t, pulse.on_time)
                                       for pulse in plan.pulses)))  # fmt: skip
    assert fixed.residual.nutation > 1e-4


def test_a_file_carried_on_has_it_where_it_is_then() -> None:
    plan = nutdamp.plan(nutdamp.read(MOVING), "four-pulse")
    used, carried = plan.propellant or 0.0, plan.carried()
    assert used > 0.0
    assert carried.center_of_mass == pytest.approx([0.1, 0.0, 0.4 - 0.05 * used], abs=1e-12)
    assert later(plan.flight, plan.end).after.center_of_mass == pytest.approx([0.1, 0.0, 0.4 - 0.05 * used])


def test_dispersed_it_moves_all_arms_alike() -> None:
    body = nutdamp.read(TEXT + "dispersions: {center_of_mass: {normal: 2 mm}}\n")
    plan = nutdamp.plan(body, "four-pulse")
    model = DispersedModel(body, plan.pulses)
    assert [entry.name for entry in model.inputs.drawn] == [f"center of mass {axis}" for axis in "xyz"]
    off = np.array([0.01, -0.02, 0.03])
    draws = {f"center of mass {axis}": np.array([value]) for axis, value in zip("xyz", off, strict=True)}
    cases = model.cases(draws)
    for pulse, impulse in zip(plan.pulses, cases.impulses, strict=True):
        shifted = nutdamp.read(TEXT.replace("[0.1 m, 0, 40 cm]", f"[{0.1 + off[0]}, {off[1]}, {0.4 + off[2]}]"))
        channel = next(each for each in shifted.channels if each.name == pulse.channel)
        assert np.concatenate([np.atleast_1d(part) for part in impulse]) == pytest.approx(
            channel.torque * pulse.on_time
        )
