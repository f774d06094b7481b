"""Valves: impulse and centroid against the thrust itself, commands there and back, and what the shape does to ω."""

from __future__ import annotations

import cmath
import math
import random

import numpy as np
import pytest
from scipy.integrate import quad
from support import reference

from nutdamp.physics import rates
from nutdamp.physics.feed import Cold, Tank
from nutdamp.physics.valve import Measured, Ramp, Trapezoid, Valve, shape_factor, spread

UNIT = reference.vector(1.0, 0.0, 0.0)

TABLE = Measured(((0.02, 0.015, 0.016), (0.05, 0.046, 0.033), (0.1, 0.095, 0.058)))


def thrust_of(valve: Trapezoid, on_time: float) -> list[reference.Swell]:
    """The thrust as the reference has it, over full thrust."""
    return reference.through_valve(
        0.0,
        on_time,
        UNIT,
        opening=valve.open_delay,
        closing=valve.close_delay,
        rise=valve.rise_time,
        fall=valve.fall_time,
    )


def moments_of(swells: list[reference.Swell]) -> tuple[float, float, float]:
    """∫ f dt, ∫ t f dt / ∫ f dt and ∫ (t - centroid)² f dt / ∫ f dt by quadrature."""

    def integral(power: int, about: float = 0.0) -> float:
        return math.fsum(
            quad(lambda t, one=one: (t - about) ** power * float(one.at(t)[0]), one.start, one.end, epsabs=0.0)[0]
            for one in swells
        )

    total = integral(0)
    centroid = integral(1) / total
    return total, centroid, integral(2, centroid) / total


def random_valves(count: int) -> list[Trapezoid]:
    chosen = random.Random(14)
    found = []
    for number in range(count):
        times = [chosen.uniform(0.0, 0.03) for _ in range(4)]
        if number % 4 == 1:
            times[2] = 0.0
        if number % 4 == 2:
            times[3] = 0.0
        found.append(Trapezoid(times[0], times[1], times[2], times[3]))
    return found


@pytest.mark.parametrize("valve", random_valves(24), ids=repr)
@pytest.mark.parametrize("on_time", [0.031, 0.05, 0.4], ids=["triangle or not", "short", "long"])
def test_impulse_and_centroid_are_those_of_the_thrust(valve: Trapezoid, on_time: float) -> None:
    swells = thrust_of(valve, on_time)
    found = valve.thrust(on_time)
    if not swells:
        assert found.ramps == ()
        return
    total, centroid, variance = moments_of(swells)
    assert found.on_time == pytest.approx(total, rel=1e-12)
    assert found.centroid == pytest.approx(centroid, rel=1e-12)
    assert spread(found.ramps, found.centroid) == pytest.approx(math.sqrt(12.0 * variance), rel=1e-9)
    assert np.array(found.ramps)[:, :2] == pytest.approx(np.array([one[:2] for one in swells]), abs=1e-15)


@pytest.mark.parametrize("valve", [*random_valves(24), TABLE], ids=repr)
def test_commands_there_and_back(valve: Valve) -> None:
    chosen = random.Random(7)
    for _ in range(50):
        on_time = chosen.uniform(0.02, 0.1)
        acts = valve.thrust(on_time).on_time
        if acts > 0.0:
            assert valve.on_time_for(acts) == pytest.approx(on_time, rel=1e-10, abs=1e-15)


def test_full_thrust_by_the_formula() -> None:
    """F(τ + close - open + (fall - rise)/2), and a triangle that grows with the square of the time open."""
    valve = Trapezoid(0.008, 0.012, 0.005, 0.010)
    assert valve.thrust(0.05).on_time == pytest.approx(0.05 + 0.012 - 0.008 + 0.0025, rel=1e-14)
    slow = Trapezoid(0.0, 0.0, 0.1, 0.3)
    assert slow.thrust(0.05).on_time == pytest.approx(0.25 * slow.thrust(0.1).on_time, rel=1e-14)


def test_a_valve_of_no_times_is_the_command() -> None:
    found = Trapezoid().thrust(0.05)
    assert found[:2] == pytest.approx((0.05, 0.025), rel=1e-15)
    assert found.ramps == (Ramp(0.0, 0.05, 1.0, 1.0),)
    assert Trapezoid().on_time_for(0.05) == 0.05


def test_an_effective_on_time_is_the_impulse() -> None:
    valve = Trapezoid(0.008, 0.012, 0.005, 0.010, effective=True)
    command = Trapezoid(0.008, 0.012, 0.005, 0.010).on_time_for(0.05)
    assert valve.thrust(0.05).on_time == pytest.approx(0.05, rel=1e-14)
    assert valve.thrust(0.05) == Trapezoid(0.008, 0.012, 0.005, 0.010).thrust(command)
    assert valve.on_time_for(0.05) == 0.05


def test_a_table_gives_its_rows_and_what_lies_between() -> None:
    for on_time, effective, centroid in TABLE.rows:
        found = TABLE.thrust(on_time)
        assert (found.on_time, found.centroid) == pytest.approx((effective, centroid), rel=1e-14)
    between = TABLE.thrust(0.035)
    assert (between.on_time, between.centroid) == pytest.approx((0.0305, 0.0245), rel=1e-14)
    assert between.ramps[0].begin == pytest.approx(0.0245 - 0.5 * 0.0305)


@pytest.mark.parametrize("valve", [*random_valves(12), TABLE], ids=repr)
def test_reaches_bound_every_lead_and_lag(valve: Valve) -> None:
    low, high = valve.thrust(0.03).on_time, valve.thrust(0.1).on_time
    lead, lag = valve.reaches(low, high)
    leads, lags = [], []
    for on_time in np.linspace(0.03, 0.1, 4001).tolist():
        found = valve.thrust(on_time)
        if not found.ramps:
            continue
        leads.append(found.centroid - 0.5 * found.on_time)
        lags.append(max(found.ramps[-1].end, on_time) - found.centroid - 0.5 * found.on_time)
    assert -1e-15 <= lead - max(leads) < 1e-6
    assert -1e-15 <= lag - max(lags) < 1e-6


@pytest.mark.parametrize("a", [0.333, -0.5, 0.0])
@pytest.mark.parametrize("axial", [0.0, 4.0])
def test_the_shape_acts_on_omega_as_dop853_says(a: float, axial: float) -> None:
    """One impulse at the centroid, with the factor, leaves the ω that the trapezoid leaves."""
    A, spin, valve = 120.0, 3.0, Trapezoid(0.1, 0.2, 0.3, 0.7)
    C = A * (1.0 - a)
    moments, torque = (A, A, C), reference.vector(8.0, 3.0, axial)
    swells = reference.through_valve(0.5, 0.9, torque, opening=0.1, closing=0.2, rise=0.3, fall=0.7)
    end = swells[-1].end
    flown = reference.fly(moments, reference.vector(0.05, 0.02, spin), swells, end).rates
    found = valve.thrust(0.9)
    factor = shape_factor(a, spin, axial / C, found.ramps, found.centroid)
    centroid, jump = 0.5 + found.centroid, axial * found.on_time / C
    turned = cmath.exp(-1j * a * (spin * centroid))
    omega = (0.05 + 0.02j) * turned + complex(8.0, 3.0) * found.on_time / A * factor
    omega *= cmath.exp(-1j * a * (spin + jump) * (end - centroid))
    assert flown[2] == pytest.approx(spin + jump, rel=1e-12)
    assert complex(flown[0], flown[1]) == pytest.approx(omega, abs=1e-12)


@pytest.mark.parametrize(("spin_rate", "growth", "drift"), [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.1, 0.05, -0.02)])
def test_the_shape_factor_of_a_rectangle_is_the_width_factor(spin_rate: float, growth: float, drift: float) -> None:
    for on_time in (1e-4, 0.3, 9.0):
        found = Trapezoid().thrust(on_time)
        shape = shape_factor(0.4, 3.0, spin_rate, found.ramps, found.centroid, growth, drift)
        assert shape == pytest.approx(rates.width_factor(0.4, 3.0, spin_rate, on_time, growth, drift), abs=1e-13)


def test_cold_pulses_warm_up() -> None:
    cold = Cold(0.9, 4.0)
    assert cold.factor(0) == pytest.approx(0.9)
    assert 1.0 - cold.factor(4) == pytest.approx(0.1 / math.e)
    assert cold.factor(400) == 1.0


def test_blowdown_keeps_pressure_times_volume() -> None:
    """Boyle: with gas of V0 beside the propellant, p V is the same full and empty, and in between."""
    tank = Tank(30.0, 22e5, 8e5, 1.0)
    density = 1000.0
    gas = 30.0 / density / (22.0 / 8.0 - 1.0)
    for used in (0.0, 7.0, 30.0):
        assert tank.pressure_after(used) * (gas + used / density) == pytest.approx(22e5 * gas, rel=1e-14)
    assert tank.thrust_factor(30.0) == pytest.approx(8.0 / 22.0)
    assert Tank(30.0, 22e5, 8e5, 0.0).thrust_factor(12.0) == 1.0
