"""Command blocks: their closed form and their Sun pulses against the flight and against an independent integrator."""

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from support import reference
from support.builders import aimed, channel, cross, present, spinner
from support.cases import spread
from support.golden import refused
from support.spinners import FILE, commanded, flown_by_reference, some_body

import nutdamp
from nutdamp.errors import Infeasible
from nutdamp.files.reader import read_spacecraft
from nutdamp.flight import propagation
from nutdamp.flight.dynamics import Supply
from nutdamp.flight.end_state import left_by
from nutdamp.physics import attitude, precession
from nutdamp.physics.thruster import Cold, Tank, Trapezoid, Valve
from nutdamp.planning import plan as planning
from nutdamp.schemes.block_model import BlockModel, BlockState, Trial, fired, sun_clock, sun_pulses
from nutdamp.spacecraft.constraints import commandable_widths
from nutdamp.spacecraft.equipment import Block, Channel, SunSensor
from nutdamp.spacecraft.schedule import Schedule

SLOW = Trapezoid(open_delay=0.015, close_delay=0.015)
UNEVEN = Trapezoid(open_delay=0.015, close_delay=0.006, rise_time=0.01, fall_time=0.03)
SUN = np.array([1.0, 0.3, -0.4])
TURN = math.pi
"""s of a body at 2 rad/s."""


def through(body: nutdamp.Spacecraft, valve: Valve) -> nutdamp.Spacecraft:
    """The body with that valve at every thruster."""
    return replace(body, channels=tuple(one.of(valve=valve) for one in body.channels))


def at_rest(name: str = "lunar-prospector") -> nutdamp.Spacecraft:
    """An example without nutation, whose thrusters may fire from 50 ms on."""
    body = nutdamp.example(name)
    return replace(body, omega0=np.array([0.0, 0.0, body.spin]), keep=())


def named(body: nutdamp.Spacecraft, name: str) -> Channel:
    return next(one for one in body.channels if one.name == name)


def in_form(body: nutdamp.Spacecraft, *blocks: Block) -> tuple[BlockModel, BlockState]:
    model = BlockModel(body)
    state, number = model.start, 1
    for block in blocks:
        trial = Trial(block.first - number, block.delay, block.width, block.count, block.every)
        state, number = model.after(state, named(body, block.channel), trial), block.sun_pulses[-1] + 1
    return model, state


def turns(body: nutdamp.Spacecraft, *blocks: Block) -> np.ndarray:
    """By how much blocks turn H, rad: in closed form, and flown."""
    model, state = in_form(body, *blocks)
    return np.array([float(model.left(state).aim), left_by(propagation.flown(body, fired(body, blocks))).aim])


def blocks_of(turn: float, late: float = 0.96) -> tuple[Block, Block]:
    """The first is still on when the next Sun pulse comes."""
    return Block("+1", 2, late * turn, 0.07 * turn, 4, 1), Block("-2", 9, 0.3 * turn, 0.02 * turn, 3, 2)


TRIAXIAL = spinner(moments=(110.0, 95.0, 150.0), spin=-2.0, degrees=1.0, channels=(channel("T", 8.0, 3.0, 2.0),))


@spread("seed", [0, 1, 3, 5, None], quick=2, deep=3)
def test_blocks_fire_from_the_sun_pulses_of_the_nutating_body(seed: int | None) -> None:
    """Of three moments and with an axial torque too."""
    body = commanded(TRIAXIAL, SUN) if seed is None else some_body(seed)
    blocks = (Block("T", 1, 0.5, 0.2, 6, 1),) if seed is None else blocks_of(2.0 * math.pi / abs(body.spin))
    made, (motion, starts) = fired(body, blocks), flown_by_reference(body, blocks)
    assert [one.start for one in made] == pytest.approx(starts, abs=1e-8)
    settled = propagation.flown(body, made).settled
    assert settled.rates == pytest.approx(motion.rates, abs=1e-7 * abs(body.spin))
    assert reference.turned(attitude.matrix(settled.quaternion), motion.rotation) < 1e-7


def test_without_nutation_a_sun_pulse_comes_every_turn_and_in_no_view_none() -> None:
    """A Sun within the nutation cone does not go round in the body; one out of view, or no sensor, gives none."""
    clock = sun_clock(commanded(spinner(degrees=0.0, spin=-2.0), SUN, azimuth=2.0))
    moments = [float(clock.sun_pulse(number).since[0]) for number in (1, 2, 3, 7, 40)]
    assert 0.0 <= moments[0] < TURN
    assert np.diff(moments) == pytest.approx([TURN, TURN, 4.0 * TURN, 33.0 * TURN], rel=1e-12)
    inside = commanded(spinner(degrees=8.0, channels=cross(8.0)), np.array([0.02, 0.0, 1.0]))
    still = commanded(spinner(degrees=0.0, channels=cross(8.0)), np.array([1.0, 0.0, 0.2]))
    blind = replace(still, sun_sensor=SunSensor(0.0, elevation=1.2, half_width=0.3))
    beyond = replace(still, sun_sensor=SunSensor(0.0, elevation=-1.5))  # half the sky is seen, not this half
    without = replace(inside, sun_sensor=None)
    cases = (("cone", inside, 30), ("sensor", without, 1), ("view", blind, 2), ("view", beyond, 2))
    for key, body, count in cases:
        with refused(Infeasible, f"blocks.no-sun-pulse-{key}"):
            fired(body, (Block("+1", 1, 0.1, 0.1, count),))


@pytest.mark.parametrize("heading", [0.4, math.pi / 2, math.pi / 2 + 1e-7, 3.0, -2.0, 0.0])
def test_a_rhumb_line_is_the_solution_of_its_equations(heading: float) -> None:
    """dγ/ds = cos χ, dλ/ds = sin χ/sin γ, and its meridian turns by cos γ dλ; past the Sun it ends nowhere."""

    def slope(_: float, y: NDArray[np.float64]) -> list[float]:
        return [math.cos(heading), math.sin(heading) / math.sin(y[0]), math.sin(heading) / math.tan(y[0])]

    expected = solve_ivp(slope, (0.0, 0.7), [1.2, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    assert [float(one) for one in precession.rhumb_end(1.2, heading, 0.7)] == pytest.approx(expected, abs=1e-10)
    assert math.isnan(float(precession.rhumb_end(0.3, math.pi, 0.4)[0]))


def test_phasors_of_a_train_add_up() -> None:
    steps = (0.3, 0.0, 2 * math.pi, 4 * math.pi, -2 * math.pi, math.pi, 7.1)
    for step, count in itertools.product(steps, (1, 2, 5, 8)):
        assert abs(precession.phasor_sum(count, step) - np.exp(1j * step * np.arange(count)).sum()) < 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_the_closed_form_is_the_flight_but_for_small_terms(seed: int) -> None:
    """And what it is off by, added to it, makes it the flight: H in both directions, the nutation and the spin."""
    rng = np.random.default_rng(seed)
    body, blocks, number = some_body(seed), list[Block](), 1
    turn = 2.0 * math.pi / abs(body.spin)
    width = 0.02 * turn
    width *= math.radians(0.3) / float(BlockModel(body).turned_by(body.channels[0], width, body.spin))
    for _ in range(2):
        name, wait, delay = body.channels[rng.integers(4)].name, int(rng.integers(3)), rng.uniform(0, 0.8) * turn
        blocks.append(Block(name, number + wait, delay, width, int(rng.integers(1, 12)), 1))
        number = blocks[-1].sun_pulses[-1] + 1
    model, state = in_form(body, *blocks)
    flown = propagation.flown(body, fired(body, blocks))
    form, off, left = model.left(state), model.apart(state, flown), left_by(flown)
    # Pulses turn H by 0.3 deg or less: what is left out is of second order in that.
    assert (float(form.nutation), float(form.aim)) == pytest.approx((left.nutation, left.aim), abs=math.radians(0.03))
    assert abs(off.longitude) < math.radians(0.1)
    corrected = model.left(state.shifted(off))
    assert float(corrected.aim) == pytest.approx(left.aim, abs=1e-9)
    assert float(corrected.nutation) == pytest.approx(left.nutation, rel=1e-9)
    assert float(corrected.spin) == pytest.approx(flown.settled.spin, rel=1e-12)


@spread("valve", [SLOW, UNEVEN, Trapezoid(0.015, 0.005, 0.004, 0.02)], quick=1)
@spread("width", [0.05, 0.1, 0.2], quick=1)
@spread(("name", "thruster"), [("lunar-prospector", "+M2"), ("ace", "N1")], quick=1)
def test_the_closed_form_of_slow_valves_is_the_flight(name: str, thruster: str, width: float, valve: Valve) -> None:
    """As near as without them, and by the share of impulse that the valve gives more or less."""
    body, block = at_rest(name), Block(thruster, 1, 1.0, width, 20)
    (form, flown), share = turns(through(body, valve), block), turns(through(body, valve), block) / turns(body, block)
    assert form == pytest.approx(flown, rel=1e-3)
    assert share[0] == pytest.approx(share[1], rel=1e-5)
    assert share[1] == pytest.approx(valve.thrust(width).on_time / width, rel=2e-3)


@pytest.mark.parametrize("valve", [SLOW, UNEVEN])
def test_a_late_centroid_turns_the_heading(valve: Valve) -> None:
    """The block of a slow valve ends where one of a fast valve does that is commanded later by as much."""
    body, given = at_rest(), valve.thrust(0.15)
    late = 1.0 + given.centroid - 0.5 * given.on_time
    flights = [
        propagation.flown(each, fired(each, (Block("+M2", 1, delay, width, 20),))).final.momentum
        for each, delay, width in (
            (through(body, valve), 1.0, 0.15),
            (body, late, given.on_time),
            (body, 1.0, given.on_time),
        )
    ]
    slow, fast, early = (momentum / np.linalg.norm(momentum) for momentum in flights)
    assert np.linalg.norm(slow - fast) < 2e-6
    assert np.linalg.norm(slow - early) > 1e-4


def test_commands_begin_at_the_delay_after_the_sun_pulses_of_the_motion_that_they_make() -> None:
    """Of a nutating body, through ramps that are on as the next Sun pulse comes."""
    valve = Trapezoid(0.02 * TURN, 0.03 * TURN, 0.01 * TURN, 0.02 * TURN)
    body = through(commanded(spinner(degrees=2.0, spin=-2.0, channels=cross(8.0)), SUN), valve)
    body, blocks = replace(body, cold=Cold(0.7, 3.0)), blocks_of(TURN, 0.93)
    made = fired(body, blocks)
    moments = sun_pulses(propagation.flown(body, made, made.end + TURN), made.end)
    due = [moments[number - 1] + block.delay for block in blocks for number in block.sun_pulses]
    assert [pulse.loaded[0] for pulse in made] == pytest.approx(due, abs=1e-8)
    assert any(begins < one < ends for one in moments for begins, ends in (pulse.thrust for pulse in made))


def one_block(body: nutdamp.Spacecraft) -> planning.Plan:
    plan = planning.plan(body, "command-block", nutdamp.Options(max_blocks=1))
    assert len(plan.pulses.blocks) == 1
    return plan


@pytest.mark.weekly
def test_a_valve_without_delays_changes_no_block_and_a_late_one_the_delay_alone() -> None:
    """Thrust as long as the command, 15 ms late: the delay is that much less, on its steps of 5 ms."""
    body = aimed(at_rest(), 8.5, 40.0)
    plain, valved, slow = map(one_block, (body, through(body, Trapezoid()), through(body, SLOW)))
    assert plain.pulses.blocks == valved.pulses.blocks
    assert [pulse.t for pulse in plain.pulses] == pytest.approx([pulse.t for pulse in valved.pulses], abs=1e-10)
    (block,), (before,) = slow.pulses.blocks, plain.pulses.blocks
    assert (block.count, block.width) == (before.count, before.width)
    assert block.delay == pytest.approx(before.delay - 0.015, abs=1e-9)
    assert slow.flight.residual.nutation == pytest.approx(plain.flight.residual.nutation, abs=1e-6)


def missed(body: nutdamp.Spacecraft, made: Schedule) -> float:
    """H off the target, rad, by the reference from start and on-time as loaded alone."""
    swells = list[reference.Swell]()
    for pulse in made:
        jet = named(body, pulse.channel)
        assert isinstance(jet.valve, Trapezoid)
        times: dict[str, Any] = {"opening": jet.valve.open_delay, "closing": jet.valve.close_delay}
        ramps: dict[str, Any] = {"rise": jet.valve.rise_time, "fall": jet.valve.fall_time}
        swells += reference.through_valve(pulse.loaded[0], pulse.loaded[1], jet.torque, **times, **ramps)
    moments, start = body.inertia.moments, attitude.matrix(body.initial.quaternion)
    motion = reference.fly(moments, body.omega0, swells, made.end + 0.1, start)
    return reference.angle(reference.momentum(moments, motion), body.target_axis)


@pytest.mark.weekly
@pytest.mark.parametrize("valve", [SLOW, UNEVEN])
def test_planned_with_valves_blocks_leave_what_the_grid_allows_and_without_them_much(valve: Valve) -> None:
    """Pulses of about 50 ms, valves 15 ms late. No train of equal pulses on a grid ends on the target to 1e-6 deg.

    Half a step of the delay (5 ms) turns the heading by half a step of the spin, and half a pulse may be missing or too
    much: within these the end of H lies, and blocks planned without the valves miss it by the delay and by what their
    thrust lacks.
    """
    body, way = aimed(at_rest(), 3.0, 40.0), math.radians(3.0)
    body = replace(body, commands=replace(present(body.commands), widths=np.arange(0.046, 0.0541, 0.001)))
    slow, spin = through(body, valve), abs(body.spin)
    aware, unaware = one_block(slow), one_block(body)
    (block,), step = aware.pulses.blocks, way / aware.pulses.blocks[0].count
    assert 0.045 < block.width < 0.055
    assert aware.flown is not None
    assert missed(slow, aware.pulses) == pytest.approx(aware.flown.axis_error, abs=1e-8)
    assert aware.flown.axis_error < 0.5 * spin * 0.005 * way + 0.5 * step
    assert aware.flown.nutation < 2.0 * step
    off = missed(slow, fired(slow, unaware.pulses.blocks))
    assert off > max(0.9 * abs(way * spin * 0.015), 1.9 * aware.flown.axis_error)  # the heading, by 15 ms of the spin


TANK = Tank(propellant=0.3, pressure=22e5, final_pressure=8e5, exponent=1.0)


def levels(count: int, *, each: float = 0.0, cold: Cold | None = None) -> list[float]:
    """Levels of pulses, added up here: 1 - (1 - first) exp(-k/n), p = p0/(1 + (p0/p1 - 1) used/propellant).

    The pressure is that of the middle of a pulse.
    """
    used, found = 0.0, []
    for number in range(count):
        warmth = 1.0 if cold is None else 1.0 - (1.0 - cold.first) * math.exp(-number / cold.pulses)
        half = 0.5 * each * warmth / (1.0 + (22.0 / 8.0 - 1.0) * used / 0.3)
        found.append(warmth / (1.0 + (22.0 / 8.0 - 1.0) * (used + half) / 0.3))
        used += each * found[-1]
    return found


@pytest.mark.parametrize(
    ("name", "thruster", "feed", "counts", "near"),
    [
        ("lunar-prospector", "+M2", {"cold": Cold(0.6, 4.0)}, (6, 9), 1e-3),
        ("ace", "N1", {"cold": Cold(0.6, 4.0)}, (6, 9), 1e-3),
        ("lunar-prospector", "+M2", {"tank": TANK}, (40,), 2e-3),
    ],
    ids=["cold", "cold ace", "tank"],
)
def test_cold_pulses_and_falling_pressure_turn_less_pulse_by_pulse(
    name: str, thruster: str, feed: dict[str, Any], counts: tuple[int, ...], near: float
) -> None:
    """The next block of the channel goes on where the nozzle was."""
    body, first, blocks = at_rest(name), 1, list[Block]()
    each = 0.0 if "cold" in feed else (named(body, thruster).mass_flow or 0.0) * 0.2
    for count in counts:
        blocks, first = [*blocks, Block(thruster, first, 1.0, 0.2, count)], first + count
        mean = np.mean(levels(first - 1, each=each, cold=feed.get("cold")))
        share = turns(replace(body, **feed), *blocks) / turns(body, *blocks)
        assert share == pytest.approx([mean, mean], rel=near)
        assert mean < 0.9


def test_what_cannot_give_thrust_is_neither_fired_nor_planned() -> None:
    """A tank that runs dry; widths that are over before the valve opens."""
    dry = replace(at_rest(), tank=replace(TANK, propellant=0.05))
    with refused(Infeasible, "blocks.tank-dry"):
        fired(dry, (Block("+M2", 1, 1.0, 0.2, 40),))
    body = commanded(spinner(channels=cross(8.0)), SUN)
    widths = present(body.commands).widths
    slow = through(body, Trapezoid(open_delay=float(0.5 * (widths[3] + widths[4])))).channels[0]
    assert commandable_widths(present(body.commands), slow).tolist() == widths[4:].tolist()


def test_cold_pulses_leave_the_nutation_of_the_closed_form() -> None:
    """It is not the mean that counts: the first kicks are missing, and fewer after pulses fired before."""
    name = at_rest().channels[0].name
    for count, before in ((2, 0), (3, 0), (4, 0), (6, 0), (11, 0), (4, 2), (8, 5)):
        body = replace(at_rest(), cold=Cold(0.3, 3.0, {name: before}))
        block = Block(name, 1, 1.0, 0.2, count)
        model, state = in_form(body, block)
        flown = left_by(propagation.flown(body, fired(body, (block,))))
        assert float(model.left(state).nutation) == pytest.approx(flown.nutation, abs=math.radians(2e-3))


@pytest.mark.parametrize("phase", [0.3, 1.8, 3.4, 5.0])
def test_the_damping_delay_is_the_one_of_a_nutation_period_that_leaves_least(phase: float) -> None:
    body = commanded(spinner(degrees=3.0, phase=phase, channels=cross(8.0)), SUN)
    model, jet, period = BlockModel(body), body.channels[0], body.body_period
    trial = Trial(0, 0.0, 0.05, 1, 1)
    delay = float(model.damping_delay(model.start, jet, trial))
    assert 0.0 <= delay < period
    delays = delay + period * np.linspace(-0.5, 0.5, 21)
    left = [float(model.left(model.after(model.start, jet, trial._replace(delay=one))).nutation) for one in delays]
    assert int(np.argmin(left)) == 10


FED = replace(
    read_spacecraft(FILE + "goal: {right_ascension: 20 deg, declination: 82 deg}\n", "f.yaml"),
    cold=Cold(0.7, 4.0),
    tank=replace(TANK, propellant=1.0),
)


def test_what_was_fired_before_counts_in_the_search_and_in_the_flight() -> None:
    """Blocks fired in two parts, the second by a body that carries on, are as strong as in one."""
    second = Block("T1", 14, 1.0, 0.3, 10)
    whole = fired(FED, (Block("T1", 1, 1.0, 0.3, 12), second)).pulses
    supply = Supply(FED)
    supply.count(Schedule())
    assert (sum(supply.fired.values()), supply.used) == (0, 0.0)
    supply.count(whole[:12])
    later = supply.behind(FED)
    alone, rest = fired(later, (replace(second, first=1),)).pulses, [one.magnitude for one in whole[12:]]
    assert [one.magnitude for one in alone] == pytest.approx(rest, rel=1e-12)
    assert rest[0] != pytest.approx(whole[0].magnitude, rel=0.01)
    jet, model, widths = FED.channels[0], BlockModel(later), np.array([0.3])
    full, used = model.full_pulses(model.start, jet, widths, np.array([10]))
    assert float(full[0]) == pytest.approx(sum(rest) / (float(np.linalg.norm(jet.torque)) * 0.3), rel=1e-9)
    assert float(used[0]) == pytest.approx(sum(one.propellant or 0.0 for one in whole), rel=1e-9)
    # 12 pulses of a body whose pressure has fallen to half: without that the form would be off by half the way.
    block, worn = Block("T1", 1, 1.0, 0.3, 12), replace(FED, cold=Cold(0.7, 4.0, {"T1": 40}))
    worn = replace(worn, tank=replace(present(FED.tank), used=0.6))
    form, flown = turns(worn, block)
    assert form == pytest.approx(flown, abs=2e-3 * FED.to_turn)
    assert abs(turns(FED, block)[0] - flown) > 0.02 * FED.to_turn
