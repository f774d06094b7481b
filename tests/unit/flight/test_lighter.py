"""Moments of inertia that fall with the propellant used: against Euler's equations with I(t) written out."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import reference
from support.builders import channel, spinner
from support.cases import spread
from support.spinners import FILE as SPINNER

from nutdamp import planning
from nutdamp.dispersion import study_of
from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.flown import RealWidths
from nutdamp.errors import FaultyFile, Unsuitable
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.flight import by_impulses, flown
from nutdamp.lightening import lightened
from nutdamp.loop.run import fly
from nutdamp.physics.feed import Tank
from nutdamp.physics.valve import Trapezoid
from nutdamp.schedule import Schedule, channel_pulse, on_command
from nutdamp.schemes.tools import block_notes
from nutdamp.schemes.tools.block_model import BlockModel
from nutdamp.spacecraft import Spacecraft
from nutdamp.supply import supplied
from nutdamp.tolerances import Dispersions, Tolerance
from nutdamp.verification import verify

SLOW = Trapezoid(0.015, 0.012, 0.005, 0.010)

TANK = Tank(0.002, 22e5, 16e5, 1.0)
"""Small enough that a few pulses use half of it."""

SHED = {"A and C": (6000.0, 6000.0, 3500.0), "three moments": (6000.0, 5000.0, 3500.0)}
"""m²; with a gram used the moments fall by some 5 %, far more than of any spacecraft."""


FILE = """\
name: Sat
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 0.4 deg}
thrusters:
  - {name: a, torque: [8, 0, 0], lever_arm: 0.8, isp: 220, max_on_time: 50 ms}
  - {name: b, torque: [-8, 0, 0], lever_arm: 0.8, isp: 220, max_on_time: 50 ms}
tank: {propellant: 2 kg, pressure: 22 bar, final_pressure: 16 bar"""


def body(shed: tuple[float, float, float] | None, valve: Trapezoid | None = SLOW, axial: float = 0.3) -> Spacecraft:
    torques = ((8.0, 0.0), (-8.0, 0.0), (0.0, 8.0), (0.0, -8.0))
    channels = tuple(
        channel(f"C{number}", *torque, axial, min_on_time=0.005, max_on_time=0.06, isp=220.0, thrust=10.0).of(
            valve=valve
        )
        for number, torque in enumerate(torques)
    )
    made = spinner(spin=math.pi, degrees=0.4, channels=channels)
    return replace(made, tank=replace(TANK, inertia_per_kg=shed), limits=replace(made.limits, horizon=200.0))


def independent(craft: Spacecraft, made: Schedule) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rates (3,), rotation (3, 3) and moments (3,) after the last pulse, from commands and pressure alone."""
    assert craft.tank is not None
    assert craft.tank.inertia_per_kg is not None
    start, per_kg = np.asarray(craft.inertia.moments), np.asarray(craft.tank.inertia_per_kg)
    channels, used, swells = {one.name: one for one in craft.channels}, 0.0, []
    for pulse in sorted(made, key=lambda one: one.loaded[0]):
        one = channels[pulse.channel]
        pressure = 22e5 / (1.0 + (22.0 / 16.0 - 1.0) * used / 0.002)
        level, valve = pressure / 22e5, one.valve
        times = {"opening": 0.0, "closing": 0.0, "rise": 0.0, "fall": 0.0}
        if isinstance(valve, Trapezoid):
            times = {"opening": 0.015, "closing": 0.012, "rise": 0.005, "fall": 0.010}
        found = reference.through_valve(*pulse.loaded, level * one.torque, **times)
        swells += found
        size = float(np.linalg.norm(one.torque))
        impulse = sum(0.5 * (each.end - each.start) * float(np.linalg.norm(each.first + each.last)) for each in found)
        used += impulse / size * 10.0 / (220.0 * 9.80665)

    def slope(t: float, y: np.ndarray, firing: list[reference.Swell]) -> np.ndarray:
        moments, rotation = start - y[12] * per_kg, y[3:12].reshape(3, 3)
        torque = sum((one.at(t) for one in firing), np.zeros(3))
        flow = sum(float(np.linalg.norm(one.at(t))) for one in firing) / math.hypot(8.0, 0.3) * 10.0 / (220.0 * 9.80665)
        w = y[:3]
        cross = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.concatenate([(torque - cross @ (moments * w)) / moments, (rotation @ cross).ravel(), [flow]])

    y = np.concatenate([craft.omega0, reference.frame_n(craft.inertia.moments, craft.omega0).ravel(), [0.0]])
    edges = sorted({0.0, made.end, *(edge for one in swells for edge in one[:2])})
    for now, end in itertools.pairwise(edges):
        firing = [one for one in swells if one.start <= 0.5 * (now + end) <= one.end]
        y = solve_ivp(slope, (now, end), y, "DOP853", rtol=1e-13, atol=1e-15, args=(firing,)).y[:, -1]
    return y[:3], y[3:12].reshape(3, 3), start - y[12] * per_kg


@pytest.mark.parametrize("valve", [None, SLOW], ids=["rectangles", "through valves"])
@pytest.mark.parametrize("shed", SHED.values(), ids=SHED)
def test_the_flight_is_that_of_eulers_equations_with_falling_moments(
    shed: tuple[float, float, float], valve: Trapezoid | None
) -> None:
    craft = body(shed, valve)
    names = ["C0", "C2", "C1", "C3", "C0"]
    pulses = [
        on_command(one, 0.7 + 1.3 * at, 0.05)
        for at, name in enumerate(names)
        for one in craft.channels
        if one.name == name
    ]
    made = Schedule(supplied(craft, pulses))
    rates, rotation, moments = independent(craft, made)
    found = flown(craft, made)
    assert moments[0] < 0.98 * 120.0
    assert found.last_moments == pytest.approx(moments, rel=1e-12)
    assert found.settled.rates == pytest.approx(rates, abs=1e-12)
    momentum = rotation @ (moments * rates)
    assert found.final.momentum == pytest.approx(momentum / np.linalg.norm(momentum), abs=1e-12)
    track = found.sampled(50, made.end)
    assert track.momentum[-1] == pytest.approx(momentum, abs=1e-9)
    # The impulse sum takes each pulse at its centre: what it leaves out is of second order.
    assert by_impulses(craft, made).motion(np.array([made.end]))[0][0] == pytest.approx(rates, abs=2e-6)


@spread("growth", [None, 40.0], quick=1)
def test_verify_confirms_it_with_and_without_dissipation(growth: float | None) -> None:
    craft = replace(body(SHED["A and C"]), dissipation=growth)
    made = Schedule(supplied(craft, [on_command(one, 0.7 + 1.3 * at, 0.05) for at, one in enumerate(craft.channels)]))
    found = verify(craft, made)
    assert found.agree, found.methods
    kept = flown(replace(craft, tank=TANK), made).residual.nutation
    assert abs(kept - flown(craft, made).residual.nutation) > math.radians(1e-4)
    assert any(row.name == "without falling moments" for row in found.budget)


def test_what_the_impulse_sum_leaves_out_is_of_second_order() -> None:
    """Pulses of half the length: each errs by a quarter of what whole ones do, or less."""

    def missed(on_time: float) -> float:
        craft = body(SHED["A and C"], None, axial=0.0)
        made = Schedule(supplied(craft, [on_command(craft.channels[0], 1.0, on_time)]))
        ends = (one.motion(np.array([made.end]))[0][0] for one in (by_impulses(craft, made), flown(craft, made)))
        return float(np.abs(np.subtract(*ends)).max())

    assert missed(0.05) > 1e-9
    assert missed(0.025) < 0.3 * missed(0.05)


def test_what_cases_leave_out_is_of_second_order() -> None:
    """They take half off as a pulse begins and half as it ends."""

    def missed(on_time: float) -> float:
        craft = body(SHED["A and C"], None, axial=0.0)
        made = Schedule(supplied(craft, [on_command(craft.channels[0], 1.0, on_time)]))
        model = Model(craft, made)
        ends = RealWidths(model)(model.cases({"timing pulse 1": np.zeros(1)}))
        here = flown(craft, made)
        momentum = here.settled.rates * np.asarray(here.last_moments)
        return abs(math.hypot(*np.ravel(ends.momentum[:2])) - math.hypot(momentum[0], momentum[1]))

    assert missed(0.05) > 1e-9
    assert missed(0.025) < 0.3 * missed(0.05)


@spread("scheme", ["one-pulse", "four-pulse", "optimal"], quick=1)
def test_plans_leave_nothing_and_without_falling_moments_they_would(scheme: str) -> None:
    craft = body((3000.0, 3000.0, 1500.0))
    made = planning.plan(craft, scheme)
    assert made.flown is not None
    assert made.flown.nutation < math.radians(1e-6)
    rates, _, moments = independent(craft, made.pulses)
    assert reference.nutation(moments.tolist(), rates, 1.0) < math.radians(1e-6)
    kept = planning.plan(replace(craft, tank=TANK), scheme).pulses
    assert flown(craft, kept).residual.nutation > math.radians(1e-3)


def test_without_it_or_with_nothing_shed_all_is_the_same_to_the_last_bit() -> None:
    nothing, zero = (
        read_spacecraft(FILE + extra + "}\n", "sat.yaml") for extra in ("", ", inertia_per_kg: {A: 0, C: 0}")
    )
    made = planning.plan(nothing, "four-pulse").pulses
    assert [repr(one) for one in made] == [repr(one) for one in planning.plan(zero, "four-pulse").pulses]
    assert lightened(nothing, 0.001) is nothing.inertia


def test_the_loop_refuses_moments_that_fall() -> None:
    loop = "loop: {sensor: {kind: gyro, rate: 100 Hz}, law: four-pulse, start: 0.3 deg, stop: 0.1 deg}\n"
    craft = read_spacecraft(f"{FILE}, inertia_per_kg: {{A: 1, C: 1}}}}\n{loop}", "sat.yaml")
    assert craft.loop is not None
    with pytest.raises(Unsuitable, match="inertia_per_kg"):
        fly(craft, craft.loop)


@pytest.mark.parametrize(
    ("shed", "problem"),
    [
        ("{A: 60, C: 10}", "leaves 0, 0, 60 kg m^2 once 2 kg are used, all must be above 0"),
        ("{A: 50 kg m^2/kg, C: 1}", "leaves 20, 20, 78 kg m^2 once 2 kg are used: the largest exceeds"),
        ("[10, 0, 70 m^2]", "expected less than 40 kg m^2/kg of the moment 80 kg m^2"),
        ("{A: -1, C: 1}", "of at least 0"),
        ("[1, 1]", "expected 3 entries, got 2"),
        ("{A: 1}", "missing; off the moment about axis 3"),
        ("3", "expected a list"),
    ],
)
def test_what_no_body_can_shed_is_refused_where_it_is_written(shed: str, problem: str) -> None:
    with pytest.raises(FaultyFile) as caught:
        read_spacecraft(f"{FILE}, inertia_per_kg: {shed}}}\n", "sat.yaml")
    (fault,) = caught.value.faults
    assert fault.where.startswith("tank.inertia_per_kg")
    assert problem in fault.problem


def test_three_moments_of_a_file() -> None:
    craft = read_spacecraft(f"{FILE}, inertia_per_kg: [0.4 kg m^2/kg, 0.3 m^2, 0.2]}}\n", "sat.yaml")
    assert craft.tank is not None
    assert craft.tank.inertia_per_kg == (0.4, 0.3, 0.2)
    assert lightened(craft, 0.5).moments == pytest.approx((119.8, 119.85, 79.9))


@pytest.mark.weekly
@pytest.mark.parametrize("per_kg", [None, (900.0, 900.0, 600.0)])
def test_without_blowdown_the_tank_is_empty_sooner(per_kg: tuple[float, float, float] | None) -> None:
    """At full pressure the commands take more than there is; what comes after that does not fire."""
    jets = tuple(
        channel(name, *torque, thrust=10.0, isp=220.0)
        for name, torque in {"a": (8.0, 0.0, 0.0), "b": (0.0, 8.0, 0.0)}.items()
    )
    craft = replace(spinner(degrees=2.0, channels=jets), tank=Tank(0.1, 22e5, 8e5, 1.0, inertia_per_kg=per_kg))
    wide = [channel_pulse(jets[at % 2], 5.0 * at + 5.0, 1.0) for at in range(40)]
    full = wide[0].propellant
    assert full is not None
    made = Schedule(supplied(craft, wide[:32]))
    assert 0.085 < (made.propellant or 0.0) < 0.1 < 32 * full
    (row,) = (one for one in verify(craft, made).budget if one.name == "without blowdown")
    steady = replace(craft, tank=Tank(1.0, 22e5, 22e5, 0.0, inertia_per_kg=per_kg))
    whole, part = divmod(0.1, full)
    last = wide[int(whole)]
    assert last.torque is not None
    share = part / full
    fires = [*wide[: int(whole)], replace(last, impulse=share * last.impulse, torque=share * last.torque)]
    expected = flown(steady, Schedule((*fires[:-1], replace(fires[-1], propellant=part)))).residual
    assert row.nutation == pytest.approx(expected.nutation, rel=1e-6)
    assert row.momentum_shift == pytest.approx(expected.momentum_shift, rel=1e-6)


def test_how_far_cases_of_falling_moments_err_is_said() -> None:
    def said(per_kg: tuple[float, float, float] | None) -> str:
        craft = replace(body(per_kg), dispersions=Dispersions(A=Tolerance("normal", 0.01, relative=True)))
        jets = [one.of(valve=None, max_on_time=2.0) for one in craft.channels]
        craft = replace(craft, channels=tuple(jets), tank=replace(craft.tank or TANK, propellant=0.02))
        made = Schedule(supplied(craft, [on_command(one, 0.7 + 3.0 * at, 1.2) for at, one in enumerate(jets)]))
        return study_of(craft, made).lightening_error

    assert said(None) == ""
    assert said((1.0, 1.0, 0.5)) == ""
    assert "in the nominal one that errs by " in said(SHED["A and C"])


def test_no_cure_of_blocks_is_promised_where_moments_fall() -> None:
    craft = read_spacecraft(SPINNER, "f.yaml")
    tank = Tank(10.0, 22e5, 16e5, 1.0, inertia_per_kg=(0.3, 0.3, 0.2))
    said = [
        block_notes.cures(BlockModel(one), one.channels, {}, Schedule(), [])
        for one in (craft, replace(craft, tank=tank))
    ]
    assert [text.partition(":")[0] for text in said] == [
        "to leave less",
        "what limits these blocks, if the moments of inertia did not fall",
    ]
