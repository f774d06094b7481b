"""Valves and tanks: impulse and centroid against the thrust itself, commands there and back, and
what they do to ω.
"""

import cmath
import math
import random
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from support import reference
from support.spinning import Triple

from nutdamp.physics import response
from nutdamp.physics.thruster import (
    Cold,
    Measured,
    Ramp,
    Tank,
    Trapezoid,
    Valve,
    action,
    shape_factor,
)

TABLE = Measured(((0.02, 0.015, 0.016), (0.05, 0.046, 0.033), (0.1, 0.095, 0.058)))
PLAIN = Trapezoid(0.008, 0.012, 0.005, 0.010)


def random_valves(count: int) -> list[Trapezoid]:
    """Some with no rise, some with no fall."""
    chosen = random.Random(14)
    valves = []
    for number in range(count):
        opening, closing, rise, fall = (chosen.uniform(0.0, 0.03) for _ in range(4))
        valves.append(
            Trapezoid(
                opening, closing, 0.0 if number % 4 == 1 else rise, 0.0 if number % 4 == 2 else fall
            )
        )
    return valves


def thrust_of(
    valve: Trapezoid, start: float, on_time: float, torque: reference.Array
) -> list[reference.Swell]:
    """As the reference has it."""
    delays = {"opening": valve.open_delay, "closing": valve.close_delay}
    return reference.through_valve(
        start, on_time, torque, **delays, rise=valve.rise_time, fall=valve.fall_time
    )


def integral(swells: list[reference.Swell], power: int, about: float = 0.0) -> float:
    return math.fsum(
        quad(
            lambda t, one=one: (t - about) ** power * float(one.at(t)[0]),
            one.start,
            one.end,
            epsabs=0.0,
        )[0]
        for one in swells
    )


@pytest.mark.parametrize("valve", random_valves(12), ids=repr)
def test_impulse_and_centroid_are_those_of_the_thrust(valve: Trapezoid) -> None:
    """∫ f dt, ∫ t f dt / ∫ f dt and ∫ (t - centroid)² f dt / ∫ f dt by quadrature; triangles, and
    none, among them.
    """
    for on_time in (0.004, 0.031, 0.4):
        swells = thrust_of(valve, 0.0, on_time, reference.vector(1, 0, 0))
        thrust = valve.thrust(on_time)
        assert len(thrust.ramps) == len(swells)
        if swells:
            total = integral(swells, 0)
            centroid = integral(swells, 1) / total
            assert (thrust.on_time, thrust.centroid) == pytest.approx((total, centroid), rel=1e-12)
            width = math.sqrt(12.0 * integral(swells, 2, centroid) / total)
            assert action(thrust.ramps)[2] == pytest.approx(width, rel=1e-9)
            assert np.array(thrust.ramps)[:, :2] == pytest.approx(
                np.array([one[:2] for one in swells]), abs=1e-15
            )


@pytest.mark.parametrize("valve", [*random_valves(8), TABLE], ids=repr)
def test_commands_there_and_back_and_reaches_bound_every_lead_and_lag(valve: Valve) -> None:
    for on_time in np.linspace(0.02, 0.1, 50).tolist():
        acts = valve.thrust(on_time).on_time
        if acts > 0.0:
            assert valve.on_time_for(acts) == pytest.approx(on_time, rel=1e-10, abs=1e-15)
    lead, lag = valve.reaches(valve.thrust(0.03).on_time, valve.thrust(0.1).on_time)
    leads, lags = [], []
    for on_time in np.linspace(0.03, 0.1, 4001).tolist():
        acts, centroid, ramps = valve.thrust(on_time)
        if ramps:
            leads.append(centroid - 0.5 * acts)
            lags.append(max(ramps[-1].end, on_time) - centroid - 0.5 * acts)
    assert -1e-15 <= lead - max(leads) < 1e-6
    assert -1e-15 <= lag - max(lags) < 1e-6


def test_a_command_without_valve_and_effective_ones() -> None:
    """An effective on-time is the impulse."""
    acts, centroid, ramps = Trapezoid().thrust(0.05)
    assert (acts, centroid) == pytest.approx((0.05, 0.025), rel=1e-15)
    assert ramps == (Ramp(0.0, 0.05, 1.0, 1.0),)
    effective = replace(PLAIN, effective=True)
    assert effective.thrust(0.05).on_time == pytest.approx(0.05, rel=1e-14)
    assert effective.thrust(0.05) == PLAIN.thrust(PLAIN.on_time_for(0.05))
    assert effective.on_time_for(0.05) == Trapezoid().on_time_for(0.05) == 0.05


def test_a_table_gives_its_rows_and_what_lies_between() -> None:
    for on_time, effective, centroid in (*TABLE.rows, (0.035, 0.0305, 0.0245)):
        assert TABLE.thrust(on_time)[:2] == pytest.approx((effective, centroid), rel=1e-14)
    assert TABLE.thrust(0.035).ramps[0].begin == pytest.approx(0.0245 - 0.5 * 0.0305)


@pytest.mark.parametrize("a", [0.333, -0.5, 0.0])
@pytest.mark.parametrize("axial", [0.0, 4.0])
def test_the_shape_acts_on_omega_as_dop853_says(a: float, axial: float) -> None:
    """One impulse at the centroid, with the factor, leaves the ω that the trapezoid leaves."""
    A = 120.0
    C = 120.0 * (1.0 - a)
    spin = 3.0
    valve = Trapezoid(0.1, 0.2, 0.3, 0.7)
    swells = thrust_of(valve, 0.5, 0.9, reference.vector(8.0, 3.0, axial))
    end = swells[-1].end
    flown = reference.fly((A, A, C), reference.vector(0.05, 0.02, spin), swells, end).rates
    acts, centroid, ramps = valve.thrust(0.9)
    factor = shape_factor(a * spin, a * axial / C, ramps, centroid)
    jump = axial * acts / C
    omega = (0.05 + 0.02j) * cmath.exp(-1j * a * spin * (0.5 + centroid)) + (
        8.0 + 3.0j
    ) * acts / A * factor
    omega *= cmath.exp(-1j * a * (spin + jump) * (end - 0.5 - centroid))
    assert flown[2] == pytest.approx(spin + jump, rel=1e-12)
    assert complex(flown[0], flown[1]) == pytest.approx(omega, abs=1e-12)


@pytest.mark.parametrize("turns", [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.1, 0.05, -0.02)])
def test_the_shape_factor_of_a_rectangle_is_the_width_factor(turns: Triple) -> None:
    """By spin rate, growth and drift."""
    for on_time in (1e-4, 0.3, 9.0):
        _, centroid, ramps = Trapezoid().thrust(on_time)
        factor = shape_factor(1.2, 0.4 * turns[0], ramps, centroid, turns[1], 0.4 * turns[2])
        assert factor == pytest.approx(
            response.width_factor(1.2, 0.4 * turns[0], on_time, turns[1], 0.4 * turns[2]), abs=1e-13
        )


def test_cold_pulses_warm_up_and_blowdown_keeps_pressure_times_volume() -> None:
    """Boyle: with gas of V0 beside the propellant, p V is the same full and empty,
    and in between.
    """
    cold = Cold(0.9, 4.0)
    assert [cold.factor(k) for k in (0, 4, 400)] == pytest.approx([0.9, 1.0 - 0.1 / math.e, 1.0])
    tank = Tank(30.0, 22e5, 8e5, 1.0)
    gas = 30.0 / 1000.0 / (22.0 / 8.0 - 1.0)  # of a density of 1000 kg/m³
    for used in (0.0, 7.0, 30.0):
        assert tank.pressure_after(used) * (gas + used / 1000.0) == pytest.approx(
            22e5 * gas, rel=1e-14
        )
    assert tank.thrust_factor(30.0) == pytest.approx(8.0 / 22.0)
    assert Tank(30.0, 22e5, 8e5, 0.0).thrust_factor(12.0) == 1.0
