"""A tank in blowdown, thrust that falls during a pulse; moments of inertia that fall with the
propellant: by DOP853.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from support import reference
from support.builders import channel, cross, documented, noted, present, spinner
from support.cases import deep, spread, weekly
from support.golden import check_text
from support.spinners import FILE as SPINNER

from nutdamp.control_loop import simulation
from nutdamp.errors import FaultyFile, Unsuitable
from nutdamp.files.reader import read_spacecraft
from nutdamp.flight.dynamics import Supply, lightened, supplied
from nutdamp.flight.propagation import by_impulses, flown
from nutdamp.flight.verification import verify
from nutdamp.montecarlo.study import study_of
from nutdamp.physics.thruster import Cold, Tank, Trapezoid, action
from nutdamp.planning import plan as planning
from nutdamp.schemes import command_block
from nutdamp.schemes.catalogue import CommandBlockOptions
from nutdamp.schemes.legs import Legs
from nutdamp.spacecraft.model import Requirement, Spacecraft
from nutdamp.spacecraft.schedule import Schedule, on_command
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance
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


def carrier(
    tank: Tank, spin: float = 3.0, moments: tuple[float, float, float] = (120.0, 120.0, 80.0)
) -> Spacecraft:
    """A spinner whose jets take 10 N each from the tank."""
    jets = tuple(one.of(thrust=10.0, isp=ISP) for one in cross(8.0))
    return replace(spinner(moments=moments, spin=spin, degrees=5.0, channels=jets), tank=tank)


def by_reference(
    body: Spacecraft, made: Schedule, until: float = math.inf
) -> tuple[Array, Array, Array, float]:
    """Rates, the matrix body -> inertial, moments of inertia and propellant used, kg, at ``until``
    s or the last pulse's end: Euler's equations with I(t), from commands, valves and pressure.
    """
    tank = present(body.tank)
    start = np.asarray(body.inertia.moments)
    per_kg = np.asarray(tank.inertia_per_kg or (0.0, 0.0, 0.0))
    channels = {one.name: one for one in body.channels}
    full = float(np.linalg.norm(body.channels[0].torque))  # N m that 10 N give, of all alike
    swells = list[reference.Swell]()
    for pulse in made:
        one = channels[pulse.channel]
        valve = one.valve if isinstance(one.valve, Trapezoid) else Trapezoid()
        swells += reference.through_valve(
            *pulse.loaded,
            one.torque,
            opening=valve.open_delay,
            closing=valve.close_delay,
            rise=valve.rise_time,
            fall=valve.fall_time,
        )

    def slope(t: float, y: Array, firing: list[reference.Swell]) -> Array:
        rates, rotation, used = y[:3], y[3:12].reshape(3, 3), y[12]
        moments = start - (used - tank.used) * per_kg
        pressure = tank.pressure / (
            1.0 + (tank.pressure / tank.final_pressure - 1.0) * used / tank.propellant
        )
        level = (pressure / tank.pressure) ** tank.exponent
        isp = ISP if tank.isp is None else float(np.interp(pressure, *np.array(tank.isp).T))
        pushes = [level * one.at(t) for one in firing]
        thrust = 10.0 * sum(float(np.linalg.norm(push)) for push in pushes) / full
        torque = sum(pushes, np.zeros(3))
        across = np.cross(np.eye(3), rates)
        turning = (torque - np.cross(rates, moments * rates)) / moments
        flow = thrust / (isp * STANDARD_GRAVITY)
        return np.concatenate([turning, (rotation @ across).ravel(), [flow]])

    rotation = reference.frame_n(body.inertia.moments, body.omega0)
    y = np.concatenate([body.omega0, rotation.ravel(), [tank.used]])
    until = min(until, made.end)
    edges = sorted({0.0, until, *(edge for one in swells for edge in one[:2] if edge < until)})
    for begin, end in pairwise(edges):
        firing = [one for one in swells if one.start <= 0.5 * (begin + end) <= one.end]
        solved = solve_ivp(slope, (begin, end), y, "DOP853", rtol=1e-13, atol=1e-15, args=(firing,))
        y = solved.y[:, -1]
    used = float(y[12] - tank.used)
    return y[:3], y[3:12].reshape(3, 3), start - used * per_kg, used


COMMANDS = [("+1", 0.4, 1.5), ("-2", 2.6, 0.9), ("-1", 4.0, 1.2)]


@spread("name", TANKS, quick=2, deep=3)
def test_pulses_are_flown_as_the_pressure_falls(name: str) -> None:
    for spin, moments in (
        (3.0, (120.0, 120.0, 80.0)),
        (-2.0, (90.0, 90.0, 140.0)),
        (2.0, (110.0, 98.0, 150.0)),
    ):
        body = carrier(TANKS[name], spin, moments)
        channels = {one.name: one for one in body.channels}
        made = Schedule(
            supplied(
                body, [on_command(channels[one], start, lasts) for one, start, lasts in COMMANDS]
            )
        )
        rates, *_, used = by_reference(body, made)
        assert flown(body, made).settled.rates == pytest.approx(rates, abs=1e-8)
        assert made.propellant == pytest.approx(used, rel=1e-9)


@pytest.mark.parametrize("exponent", [1.0, 0.7, deep(0.0), deep(2.0)])
def test_limits_of_the_closed_form(exponent: float) -> None:
    """Nothing falls at one pressure, with an exponent of 0 only the flow lasts, and short pulses
    see one thrust.
    """
    tank = replace(SMALL, exponent=exponent)
    gone, mean = tank.burn(0.02, 0.01, 1e-9)
    assert gone == pytest.approx(1e-11 * tank.thrust_factor(0.02), rel=1e-7)
    assert mean == pytest.approx(tank.thrust_factor(0.02), rel=1e-7)
    even = replace(tank, final_pressure=tank.pressure)
    assert even.burn(0.02, 0.01, 3.0) == pytest.approx((0.03, 1.0))
    gone, mean = tank.burn(0.02, 0.01, np.array([0.0, 3.0]))
    assert gone[0] == 0.0
    assert mean[0] == pytest.approx(tank.thrust_factor(0.02))
    assert gone[1] == pytest.approx(
        mean[1] * 0.03
    )  # with one specific impulse the flow goes as the thrust
    if exponent == 0.0:
        assert mean[1] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("time", "within"), [(0.0, 1e-15), (0.3, 1e-12), (60.0, 1e-12), (900.0, 1e-4)]
)
def test_a_burn_with_a_table_is_that_of_its_differential_equation(
    time: float, within: float
) -> None:
    """Up to a row of the table to rounding; across some of them nearly."""
    tank = Tank(3.0, 22e5, 5.5e5, 0.8, ((5e5, 180.0), (1e6, 205.0), (22e5, 220.0)))
    flow, used = 0.8, 0.3

    def slope(_: float, y: Array) -> Array:
        thrust = tank.thrust_factor(used + y[0])
        return np.array([flow * thrust / tank.isp_after(used + y[0]), thrust])

    gone, mean = tank.burn(used, flow, time)
    solved = solve_ivp(
        slope,
        (0.0, time),
        np.zeros(2),
        "DOP853",
        rtol=1e-13,
        atol=1e-16,
        max_step=max(time, 1.0) / 100,
    )
    assert gone == pytest.approx(solved.y[0, -1], rel=within)
    assert mean == pytest.approx(
        solved.y[1, -1] / time if time else tank.thrust_factor(used), rel=within
    )
    each = tank.burn(np.array([used, 1.0]), flow, np.array([[time], [1.0]]))
    for many, one in zip(each, (gone, mean), strict=True):
        assert many.shape == (2, 2)
        assert many[0, 0] == pytest.approx(one, rel=1e-14)


@spread("name", TANKS, quick=2, deep=3)
@pytest.mark.parametrize("cold", [None, Cold(0.8, 3.0, {"+1": 2})])
def test_a_train_is_its_pulses(name: str, cold: Cold | None) -> None:
    """One after another, up to the last of the propellant."""
    body = replace(carrier(TANKS[name]), cold=cold)
    on_times = np.array([0.4, 2.0])
    jet = body.channels[0]
    count = 30 if name == "small" else 9
    levels, used = Supply(body).train(jet, on_times, count)
    for row, on_time in enumerate(on_times.tolist()):
        supply = Supply(body)
        total = 0.0
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
        assert supply.take(body.channels[0], on_time)[0] * on_time == pytest.approx(
            effective, rel=1e-12
        )
    assert Supply(body, used=0.03).on_time_for(body.channels[0], 0.0) == 0.0


def test_valves_open_and_close_while_the_pressure_falls() -> None:
    """Commands there and back: the impulse that a plan asks for is what the thrust gives, with its
    centroid.
    """
    valve = Trapezoid(open_delay=0.02, close_delay=0.05, rise_time=0.04, fall_time=0.06)
    body = carrier(SMALL)
    body = replace(body, channels=tuple(one.of(valve=valve) for one in body.channels))
    (pulse,) = supplied(body, [on_command(body.channels[0], 1.0, 2.0)])
    assert present(pulse.command).valve
    acts, centroid, _ = action(present(pulse.command).ramps)
    assert (acts, centroid) == pytest.approx((pulse.on_time, pulse.t), rel=1e-9)
    plain = on_command(body.channels[0], 1.0, 2.0)
    assert pulse.t < plain.t
    assert pulse.on_time == plain.on_time
    assert math.degrees(present(present(planning.plan(body, "two-pulse").flown)).nutation) < 1e-6


# --- moments of inertia that fall with the propellant used: against Euler's equations with I(t)
# written out

Shed = tuple[float, float, float]

SLOW = Trapezoid(0.015, 0.012, 0.005, 0.010)
TANK = Tank(0.002, 22e5, 16e5, 1.0)
"""Small enough that a few pulses use half of it."""

AXIAL, THREE = (6000.0, 6000.0, 3500.0), (6000.0, 5000.0, 3500.0)
"""m²; with a gram used the moments fall by some 5 %, far more than of any spacecraft."""


def craft(shed: Shed | None, valve: Trapezoid | None = SLOW, axial: float = 0.3) -> Spacecraft:
    channels = [
        channel(
            f"C{at}",
            *one.torque[:2],
            axial,
            min_on_time=0.005,
            max_on_time=0.06,
            isp=220.0,
            thrust=10.0,
        )
        for at, one in enumerate(cross(8.0))
    ]
    body = spinner(
        spin=math.pi, degrees=0.4, channels=tuple(one.of(valve=valve) for one in channels)
    )
    return replace(
        body, tank=replace(TANK, inertia_per_kg=shed), limits=replace(body.limits, horizon=200.0)
    )


def fires(body: Spacecraft, *numbers: int, on_time: float = 0.05) -> Schedule:
    """Commands of the channels with these numbers, one every 1.3 s."""
    commands = (
        on_command(body.channels[one], 0.7 + 1.3 * at, on_time) for at, one in enumerate(numbers)
    )
    return Schedule(supplied(body, list(commands)))


@pytest.mark.parametrize(
    ("shed", "valve"), [(AXIAL, None), (THREE, SLOW), deep(AXIAL, SLOW), deep(THREE, None)]
)
def test_the_flight_is_that_of_eulers_equations_with_falling_moments(
    shed: Shed, valve: Trapezoid | None
) -> None:
    body = craft(shed, valve)
    made = fires(body, 0, 2, 1, 3, 0)
    rates, rotation, moments, _ = by_reference(body, made)
    by_flight = flown(body, made)
    momentum = rotation @ (moments * rates)
    assert moments[0] < 0.98 * 120.0
    assert by_flight.last_moments == pytest.approx(moments, rel=1e-12)
    assert by_flight.settled.rates == pytest.approx(rates, abs=1e-12)
    # Straight pieces of falling thrust err by a little more than the integration.
    assert by_flight.final.momentum == pytest.approx(momentum / np.linalg.norm(momentum), abs=1e-11)
    assert by_flight.sampled(50, made.end).momentum[-1] == pytest.approx(momentum, abs=1e-9)
    # The impulse sum takes each pulse at its centre: what it leaves out is of second order.
    summed = by_impulses(body, made)
    amid = made.pulses[2].t
    assert summed.motion(np.array([made.end]))[0][0] == pytest.approx(rates, abs=2e-6)
    assert by_flight.moments_at(np.array([amid]))[0] == pytest.approx(
        by_reference(body, made, amid)[2], rel=1e-6
    )
    before, after = (by_reference(body, made, one)[2] for one in (amid - 0.3, amid + 0.3))
    assert summed.moments_at(np.array([amid - 1e-6, amid])) == pytest.approx(
        np.array([before, after]), rel=1e-9
    )


@pytest.mark.parametrize(("growth", "numbers"), [(None, (0, 2)), deep(40.0, (0, 1, 2, 3))])
def test_verify_confirms_it_with_and_without_dissipation(
    growth: float | None, numbers: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nutdamp.flight.verification.SAMPLES", 21)
    body = replace(craft(AXIAL), dissipation=growth)
    made = fires(body, *numbers)
    verified = verify(documented(body), made)
    assert verified.agree, verified.methods
    kept = flown(replace(body, tank=TANK), made).residual.nutation
    assert abs(kept - flown(body, made).residual.nutation) > math.radians(1e-4)
    assert {"without blowdown", "without falling moments"} <= {row.name for row in verified.budget}


def test_what_the_impulse_sum_leaves_out_is_of_second_order() -> None:
    """A pulse of half the length errs by a quarter of what the whole one does, or less."""
    body = craft(AXIAL, None, axial=0.0)
    tank = present(body.tank)
    body = replace(body, tank=replace(tank, final_pressure=tank.pressure))  # rectangles
    missed = []
    for on_time in (0.05, 0.025):
        made = fires(body, 0, on_time=on_time)
        ends = (fly(body, made).motion(np.array([made.end]))[0] for fly in (by_impulses, flown))
        missed.append(float(np.abs(np.subtract(*ends)).max()))
    assert missed[0] > 1e-9
    assert missed[1] < 0.3 * missed[0]


LIGHTER = craft((3000.0, 3000.0, 1500.0))


@pytest.mark.parametrize(
    ("body", "scheme"),
    [
        (carrier(SMALL), "two-pulse"),
        *(deep(carrier(SMALL), scheme) for scheme in ("one-pulse", "four-pulse", "optimal")),
        (LIGHTER, "one-pulse"),
        deep(LIGHTER, "four-pulse"),
        weekly(LIGHTER, "optimal"),
    ],
)
def test_a_plan_takes_out_the_nutation_as_pressure_and_moments_fall(
    body: Spacecraft, scheme: str
) -> None:
    """Held through a pulse the pressure would leave 0.27 deg of two-pulse."""
    made = planning.plan(body, scheme)
    assert made.feasible
    rates, _, moments, used = by_reference(body, made.pulses)
    assert reference.nutation(moments.tolist(), rates, 1.0) < math.radians(1e-6)
    assert made.propellant == pytest.approx(used, rel=1e-9)


@pytest.mark.parametrize("shed", [AXIAL, deep(THREE)])
def test_a_further_leg_begins_where_the_one_before_ends(shed: Shed) -> None:
    body = craft(shed)
    legs = Legs(craft(shed))
    made = fires(body, 0, 2, 1, 3, 0)
    legs.fire(made)
    flight = flown(body, made)
    assert legs.at_leg.inertia.moments == pytest.approx(flight.last_moments, rel=1e-12)
    assert legs.at_leg.omega0 == pytest.approx(flight.settled.rates, abs=1e-12)
    assert legs.at_leg.momentum == pytest.approx(flight.last_momentum, rel=1e-12, abs=1e-9)


FILE = """\
name: Sat
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 0.4 deg}
thrusters:
  - {name: a, torque: [8, 0, 0], lever_arm: 0.8, isp: 220, max_on_time: 50 ms}
  - {name: b, torque: [-8, 0, 0], lever_arm: 0.8, isp: 220, max_on_time: 50 ms}
tank: {propellant: 2 kg, pressure: 22 bar, final_pressure: 16 bar"""


def of_file(shed: str, more: str = "") -> Spacecraft:
    return read_spacecraft(f"{FILE}{shed and ', inertia_per_kg: '}{shed}}}\n{more}", "sat.yaml")


def test_what_a_file_says_of_it() -> None:
    three = of_file("[0.4 kg m^2/kg, 0.3 m^2, 0.2]")
    assert present(three.tank).inertia_per_kg == (0.4, 0.3, 0.2)
    assert lightened(three, 0.5).moments == pytest.approx((119.8, 119.85, 79.9))
    # Without it, or with nothing shed, all is the same to the last bit.
    without, zero = of_file(""), of_file("{A: 0, C: 0}")
    plans = [
        [repr(one) for one in planning.plan(body, "four-pulse").pulses] for body in (without, zero)
    ]
    assert plans[0] == plans[1]
    assert lightened(without, 0.001) is without.inertia
    faults = []
    for shed in (
        "{A: 60, C: 10}",
        "{A: 50 kg m^2/kg, C: 1}",
        "[10, 0, 70 m^2]",
        "{A: -1, C: 1}",
        "[1, 1]",
        "{A: 1}",
        "3",
    ):
        with pytest.raises(FaultyFile) as caught:
            of_file(shed)
        (fault,) = caught.value.faults
        faults.append(f"{fault.where}: {fault.problem}")
    check_text("flight.impossible-shedding", "\n".join(faults))


def test_what_cannot_have_falling_moments_says_so() -> None:
    loop = (
        "loop: {sensor: {kind: gyro, rate: 100 Hz}, law: four-pulse, start: 0.3 deg, stop: "
        "0.1 deg}\n"
    )
    body = of_file("{A: 1, C: 1}", loop)
    with pytest.raises(Unsuitable, match="inertia_per_kg"):
        simulation.fly(body, present(body.loop))
    blocks = read_spacecraft(SPINNER, "f.yaml")
    lighter = replace(blocks, tank=Tank(10.0, 22e5, 16e5, 1.0, inertia_per_kg=(0.3, 0.3, 0.2)))
    within = Requirement(nutation=1e-9)
    nutating = np.array([0.01, 0.0, blocks.spin])
    bodies = [replace(body, omega0=nutating, requirement=within) for body in (blocks, lighter)]
    cures = [
        command_block.schedule(body, CommandBlockOptions(max_blocks=1)).notes[1:] for body in bodies
    ]
    check_text("flight.cures-of-blocks", "\n".join(map(noted, cures)))


def test_how_far_cases_of_falling_moments_err_is_said() -> None:
    """A study says nothing where they err by less than what is shown."""
    for shed, said in ((None, False), ((1.0, 1.0, 0.5), False), (AXIAL, True)):
        body = replace(
            craft(shed), dispersions=Dispersions(A=Tolerance("normal", 0.01, relative=True))
        )
        jets = tuple(one.of(valve=None, max_on_time=2.0) for one in body.channels)
        body = replace(
            body, channels=jets, tank=replace(TANK, inertia_per_kg=shed, propellant=0.02)
        )
        made = Schedule(
            supplied(body, [on_command(one, 0.7 + 3.0 * at, 1.2) for at, one in enumerate(jets)])
        )
        error = study_of(body, made).lightening_error
        assert ("in the nominal one that errs by " in error) == said
        assert said == bool(error)
