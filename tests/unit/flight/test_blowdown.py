"""A tank in blowdown: thrust that falls during a pulse, against DOP853 with the propellant used as a state."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from support.builders import cross, present, spinner
from support.cases import deep, spread
from support.dispersed import normal

from nutdamp.flight.dynamics import Supply, supplied
from nutdamp.flight.propagation import flown
from nutdamp.montecarlo.study import study_of
from nutdamp.physics.thruster import Cold, Tank, Trapezoid
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule, on_command
from nutdamp.spacecraft.tolerances import Dispersions
from nutdamp.units import STANDARD_GRAVITY

Array = NDArray[np.float64]

SMALL = Tank(0.1, 22e5, 8e5, 1.0)
TANKS = {
    "small": SMALL,
    "large": Tank(30.0, 22e5, 8e5, 1.0),
    "soft": replace(SMALL, exponent=0.7),
    "half used": replace(SMALL, used=0.05),
    "isp by pressure": replace(SMALL, isp=((8e5, 190.0), (22e5, 228.0))),
}
ISP = 220.0


def carrier(tank: Tank, spin: float = 3.0, moments: tuple[float, float, float] = (120.0, 120.0, 80.0)) -> Spacecraft:
    """A spinner whose jets take 10 N each from the tank."""
    jets = tuple(one.of(thrust=10.0, isp=ISP) for one in cross(8.0))
    return replace(spinner(moments=moments, spin=spin, degrees=5.0, channels=jets), tank=tank)


def by_reference(body: Spacecraft, starts: list[tuple[str, float, float]], until: float) -> tuple[Array, Array, float]:
    """Rates, the matrix body -> inertial and the propellant used, kg, after rectangles of commands."""
    tank, moments = present(body.tank), np.array(body.inertia.moments)
    channels = {one.name: one for one in body.channels}

    def slope(t: float, y: Array, firing: list[str]) -> Array:
        omega, turned, used = y[:3], y[3:12].reshape(3, 3), y[12]
        pressure = tank.pressure / (1.0 + (tank.pressure / tank.final_pressure - 1.0) * used / tank.propellant)
        factor = (pressure / tank.pressure) ** tank.exponent
        isp = ISP if tank.isp is None else float(np.interp(pressure, *np.array(tank.isp).T))
        torque = sum((channels[name].torque * factor for name in firing), np.zeros(3))
        flow = sum(10.0 * factor / (isp * STANDARD_GRAVITY) for _ in firing)
        across = np.array([[0, -omega[2], omega[1]], [omega[2], 0, -omega[0]], [-omega[1], omega[0], 0]])
        rates = (torque - np.cross(omega, moments * omega)) / moments
        return np.concatenate([rates, (turned @ across).ravel(), [flow]])

    edges = sorted({0.0, until, *(t for _, start, lasts in starts for t in (start, start + lasts))})
    y = np.concatenate([body.omega0, np.eye(3).ravel(), [tank.used]])
    for begin, end in pairwise(edges):
        firing = [name for name, start, lasts in starts if start <= begin and end <= start + lasts]
        solved = solve_ivp(slope, (begin, end), y, "DOP853", rtol=1e-12, atol=1e-13, args=(firing,))
        y = solved.y[:, -1]
    return y[:3], y[3:12].reshape(3, 3), float(y[12] - tank.used)


COMMANDS = [("+1", 0.4, 1.5), ("-2", 2.6, 0.9), ("-1", 4.0, 1.2)]


@spread("name", TANKS, quick=2, deep=3)
def test_pulses_are_flown_as_the_pressure_falls(name: str) -> None:
    for spin, moments in ((3.0, (120.0, 120.0, 80.0)), (-2.0, (90.0, 90.0, 140.0)), (2.0, (110.0, 98.0, 150.0))):
        body = carrier(TANKS[name], spin, moments)
        channels = {one.name: one for one in body.channels}
        made = Schedule(supplied(body, [on_command(channels[one], start, lasts) for one, start, lasts in COMMANDS]))
        rates, _, used = by_reference(body, COMMANDS, made.end)
        assert flown(body, made).settled.rates == pytest.approx(rates, abs=1e-8)
        assert made.propellant == pytest.approx(used, rel=1e-9)


@pytest.mark.parametrize("exponent", [1.0, 0.7, deep(0.0), deep(2.0)])
def test_limits_of_the_closed_form(exponent: float) -> None:
    """Nothing falls at one pressure, with an exponent of 0 only the flow lasts, and short pulses see one thrust."""
    tank = replace(SMALL, exponent=exponent)
    gone, mean = tank.burn(0.02, 0.01, 1e-9)
    assert gone == pytest.approx(1e-11 * tank.thrust_factor(0.02), rel=1e-7)
    assert mean == pytest.approx(tank.thrust_factor(0.02), rel=1e-7)
    even = replace(tank, final_pressure=tank.pressure)
    assert even.burn(0.02, 0.01, 3.0) == pytest.approx((0.03, 1.0))
    gone, mean = tank.burn(0.02, 0.01, np.array([0.0, 3.0]))
    assert gone[0] == 0.0
    assert mean[0] == pytest.approx(tank.thrust_factor(0.02))
    assert gone[1] == pytest.approx(mean[1] * 0.03)  # with one specific impulse the flow goes as the thrust
    if exponent == 0.0:
        assert mean[1] == pytest.approx(1.0)


@pytest.mark.parametrize(("time", "within"), [(0.0, 1e-15), (0.3, 1e-12), (60.0, 1e-12), (900.0, 1e-4)])
def test_a_burn_with_a_table_is_that_of_its_differential_equation(time: float, within: float) -> None:
    """Up to a row of the table to rounding; across some of them nearly."""
    tank = Tank(3.0, 22e5, 5.5e5, 0.8, ((5e5, 180.0), (1e6, 205.0), (22e5, 220.0)))
    flow, used = 0.8, 0.3

    def slope(_: float, y: Array) -> Array:
        thrust = tank.thrust_factor(used + y[0])
        return np.array([flow * thrust / tank.isp_after(used + y[0]), thrust])

    gone, mean = tank.burn(used, flow, time)
    solved = solve_ivp(slope, (0.0, time), np.zeros(2), "DOP853", rtol=1e-13, atol=1e-16, max_step=max(time, 1.0) / 100)
    assert gone == pytest.approx(solved.y[0, -1], rel=within)
    assert mean == pytest.approx(solved.y[1, -1] / time if time else tank.thrust_factor(used), rel=within)
    each = tank.burn(np.array([used, 1.0]), flow, np.array([[time], [1.0]]))
    for many, one in zip(each, (gone, mean), strict=True):
        assert many.shape == (2, 2)
        assert many[0, 0] == pytest.approx(one, rel=1e-14)


@spread("name", TANKS, quick=2, deep=3)
@pytest.mark.parametrize("cold", [None, Cold(0.8, 3.0, {"+1": 2})])
def test_a_train_is_its_pulses(name: str, cold: Cold | None) -> None:
    """One after another, up to the last of the propellant."""
    body, on_times = replace(carrier(TANKS[name]), cold=cold), np.array([0.4, 2.0])
    jet, count = body.channels[0], 30 if name == "small" else 9
    levels, used = Supply(body).train(jet, on_times, count)
    for row, on_time in enumerate(on_times.tolist()):
        supply, total = Supply(body), 0.0
        for number in range(count):
            total += supply.take(jet, on_time)[0]
            assert levels[row, number] == pytest.approx(total, rel=1e-12)
            if supply.shortage:
                break
            assert used[row, number] == pytest.approx(supply.used, rel=1e-12)
        assert (supply.shortage is not None) is (name == "small" and row == 1)


def test_an_on_time_is_found_for_each_impulse() -> None:
    body = replace(carrier(SMALL), cold=Cold(0.8, 3.0))
    for effective in (0.05, 0.5, 2.0):
        supply = Supply(body, used=0.03)
        on_time = supply.on_time_for(body.channels[0], effective)
        assert supply.take(body.channels[0], on_time)[0] * on_time == pytest.approx(effective, rel=1e-12)


@spread("scheme", ["two-pulse", "one-pulse", "four-pulse", "optimal"], quick=2, deep=2)
def test_a_plan_takes_out_the_nutation_as_the_pressure_falls(scheme: str) -> None:
    """Held through a pulse the pressure would leave 0.27 deg of two-pulse."""
    body = carrier(SMALL)
    made = planning.plan(body, scheme)
    assert made.feasible
    commands = [(pulse.channel, *pulse.loaded) for pulse in made.pulses]
    rates, _, used = by_reference(body, commands, made.pulses.end)
    assert abs(complex(rates[0], rates[1])) * 120.0 < 1e-7 * 80.0 * 3.0
    assert made.propellant == pytest.approx(used, rel=1e-9)


def test_valves_open_and_close_while_the_pressure_falls() -> None:
    """Commands there and back: the impulse that a plan asks for is what the thrust gives, with its centroid."""
    valve = Trapezoid(open_delay=0.02, close_delay=0.05, rise_time=0.04, fall_time=0.06)
    body = carrier(SMALL)
    body = replace(body, channels=tuple(one.of(valve=valve) for one in body.channels))
    (pulse,) = supplied(body, [on_command(body.channels[0], 1.0, 2.0)])
    assert present(pulse.command).valve
    given = moment = 0.0
    for ramp in present(pulse.command).ramps:
        length, even, lean = ramp.end - ramp.begin, 0.5 * (ramp.first + ramp.last), 0.5 * (ramp.last - ramp.first)
        given += even * length
        moment += 0.5 * (ramp.begin + ramp.end) * even * length + lean * length**2 / 6.0
    assert given == pytest.approx(pulse.on_time, rel=1e-9)
    assert moment / given == pytest.approx(pulse.t, rel=1e-9)
    plain = on_command(body.channels[0], 1.0, 2.0)
    assert pulse.t < plain.t
    assert pulse.on_time == plain.on_time
    left = present(present(planning.plan(body, "two-pulse").flown))
    assert math.degrees(left.nutation) < 1e-6


def test_cases_without_deviations_are_the_flight_itself() -> None:
    body = replace(carrier(SMALL), dispersions=Dispersions(A=normal(0.01, relative=True)))
    made = planning.plan(body, "two-pulse")
    study = study_of(body, made.pulses)
    alone = flown(body, made.pulses)
    assert study.outputs_of({})[0] == pytest.approx(alone.residual.nutation, abs=1e-9)
    assert study.outputs_of({})[-1] == pytest.approx(made.propellant)


def test_cases_of_another_valve_fall_as_well() -> None:
    """A valve that is a little off leaves little more than the nominal one; without the fall it would be a degree."""
    valve = Trapezoid(open_delay=0.02, close_delay=0.03, rise_time=0.02, fall_time=0.02)
    body = carrier(SMALL)
    names = [one.name for one in body.channels]
    body = replace(
        body,
        channels=tuple(one.of(valve=valve) for one in body.channels),
        dispersions=Dispersions(open_delay={name: normal(1e-3) for name in names}),
    )
    made = planning.plan(body, "two-pulse")
    study = study_of(body, made.pulses)
    name = f"open_delay {made.pulses.pulses[0].channel}"
    assert name in {entry.name for entry in study.model.inputs.drawn}
    assert study.outputs_of({name: 0.0})[0] == pytest.approx(0.0, abs=math.radians(0.01))
