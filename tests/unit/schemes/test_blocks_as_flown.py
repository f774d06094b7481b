"""Command blocks through valves, with cold nozzles and from tanks in blowdown."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support import reference
from support.builders import aimed, cross, spinner
from support.cases import spread
from support.spinners import commanded

import nutdamp
from nutdamp import flight, planning
from nutdamp.commands import Block
from nutdamp.errors import Infeasible
from nutdamp.limits import commandable_widths
from nutdamp.outcome import left_by
from nutdamp.physics import attitude
from nutdamp.physics.feed import Cold, Tank
from nutdamp.physics.valve import Trapezoid, Valve
from nutdamp.schedule import Schedule
from nutdamp.schemes import Options
from nutdamp.schemes.tools.block_model import BlockModel, Trial
from nutdamp.schemes.tools.sun_pulses import fired, sun_pulses
from nutdamp.spacecraft import Spacecraft

SLOW = Trapezoid(open_delay=0.015, close_delay=0.015)
UNEVEN = Trapezoid(open_delay=0.015, close_delay=0.006, rise_time=0.01, fall_time=0.03)


def through(body: Spacecraft, valve: Valve) -> Spacecraft:
    """The body with that valve at every thruster."""
    return replace(body, channels=tuple(one.of(valve=valve) for one in body.channels))


def at_rest(name: str) -> Spacecraft:
    """An example without nutation, whose thrusters may fire from 50 ms on."""
    body = nutdamp.example(name)
    return replace(body, omega0=np.array([0.0, 0.0, body.spin]), keep=())


def turns(body: Spacecraft, *blocks: Block) -> tuple[float, float]:
    """By how much blocks turn H, rad: in closed form, and flown."""
    model = BlockModel(body)
    state, number = model.start, 1
    for block in blocks:
        channel = next(one for one in body.channels if one.name == block.channel)
        trial = Trial(block.first - number, block.delay, block.width, block.count, block.every)
        state = model.after(state, channel, trial)
        number = block.first + (block.count - 1) * block.every + 1
    return float(model.left(state).aim), left_by(flight.flown(body, fired(body, blocks))).aim


@spread("valve", [SLOW, UNEVEN, Trapezoid(0.015, 0.005, 0.004, 0.02)], quick=1)
@spread("width", [0.05, 0.1, 0.2], quick=1)
@spread(("name", "channel"), [("lunar-prospector", "+M2"), ("ace", "N1")], quick=5)
def test_the_closed_form_of_slow_valves_is_the_flight(name: str, channel: str, width: float, valve: Valve) -> None:
    """As near as without them, and by the share of impulse that the valve gives more or less."""
    body, block = at_rest(name), Block(channel, 1, 1.0, width, 20)
    plain_form, plain = turns(body, block)
    form, flown = turns(through(body, valve), block)
    assert form == pytest.approx(flown, rel=1e-3)
    assert form / plain_form == pytest.approx(flown / plain, rel=1e-5)
    effective = valve.thrust(width).on_time
    assert flown / plain == pytest.approx(effective / width, rel=2e-3)


@pytest.mark.parametrize("valve", [SLOW, UNEVEN])
def test_a_late_centroid_turns_the_heading(valve: Valve) -> None:
    """The block of a slow valve ends where one of a fast valve does that is commanded later by as much."""
    body = at_rest("lunar-prospector")
    width, given = 0.15, valve.thrust(0.15)
    late = 1.0 + given.centroid - 0.5 * given.on_time
    slow = flight.flown(through(body, valve), fired(through(body, valve), (Block("+M2", 1, 1.0, width, 20),)))
    fast = flight.flown(body, fired(body, (Block("+M2", 1, late, given.on_time, 20),)))
    early = flight.flown(body, fired(body, (Block("+M2", 1, 1.0, given.on_time, 20),)))
    momenta = [one.final.momentum / np.linalg.norm(one.final.momentum) for one in (slow, fast, early)]
    assert np.linalg.norm(momenta[0] - momenta[1]) < 2e-6
    assert np.linalg.norm(momenta[0] - momenta[2]) > 1e-4


def test_commands_begin_at_the_delay_after_the_sun_pulses_of_the_motion_that_they_make() -> None:
    """Of a nutating body, through ramps that are on as the next Sun pulse comes."""
    body = spinner(degrees=2.0, spin=-2.0, channels=cross(8.0))
    turn = 2.0 * math.pi / 2.0
    valve = Trapezoid(0.02 * turn, 0.03 * turn, 0.01 * turn, 0.02 * turn)
    body = replace(through(commanded(body, np.array([1.0, 0.3, -0.4])), valve), cold=Cold(0.7, 3.0))
    blocks = (Block("+1", 2, 0.93 * turn, 0.05 * turn, 4, 1), Block("-2", 9, 0.3 * turn, 0.02 * turn, 3, 2))
    made = fired(body, blocks)
    found = sun_pulses(flight.flown(body, made, made.end + turn), made.end)
    due = [found[number - 1] + block.delay for block in blocks for number in block.sun_pulses]
    assert [pulse.loaded[0] for pulse in made] == pytest.approx(due, abs=1e-8)
    assert any(begins < one < ends for one in found for begins, ends in (pulse.thrust for pulse in made))


def flown_through(body: Spacecraft, made: Schedule) -> tuple[float, float]:
    """H off the target, and nutation, rad, by the reference from start and on-time as loaded alone."""
    named, swells = {one.name: one for one in body.channels}, []
    for pulse in made:
        valve, torque = named[pulse.channel].valve, named[pulse.channel].torque
        assert isinstance(valve, Trapezoid)
        swells += reference.through_valve(
            *pulse.loaded,
            torque,
            opening=valve.open_delay,
            closing=valve.close_delay,
            rise=valve.rise_time,
            fall=valve.fall_time,
        )
    rotation = attitude.matrix(body.initial.quaternion)
    motion = reference.fly(body.inertia.moments, body.omega0, swells, made.end + 0.1, rotation)
    momentum = reference.momentum(body.inertia.moments, motion)
    assert body.goal.axis is not None
    nutation = reference.nutation(body.inertia.moments, motion.rates, math.copysign(1.0, body.spin))
    return reference.angle(momentum, body.goal.axis), nutation


@pytest.mark.weekly
def test_a_valve_without_delays_changes_no_block() -> None:
    body = aimed(at_rest("lunar-prospector"), 8.5, 40.0)
    plain, valved = (
        planning.plan(one, "command-block", Options(max_blocks=1)) for one in (body, through(body, Trapezoid()))
    )
    assert plain is not None
    assert valved is not None
    assert plain.pulses.blocks == valved.pulses.blocks
    assert [pulse.t for pulse in plain.pulses] == pytest.approx([pulse.t for pulse in valved.pulses], abs=1e-10)
    slow = planning.plan(through(body, SLOW), "command-block", Options(max_blocks=1))
    assert slow is not None
    (block,), (before,) = slow.pulses.blocks, plain.pulses.blocks
    # Thrust as long as the command, 15 ms late: the delay is that much less, on its steps of 5 ms.
    assert (block.count, block.width) == (before.count, before.width)
    assert block.delay == pytest.approx(before.delay - 0.015, abs=1e-9)
    assert slow.flight.residual.nutation == pytest.approx(plain.flight.residual.nutation, abs=1e-6)


@pytest.mark.weekly
@spread("valve", [SLOW, UNEVEN], quick=1, deep=0)
def test_planned_with_valves_blocks_leave_what_the_grid_allows_and_without_them_much(valve: Valve) -> None:
    """Pulses of about 50 ms, valves 15 ms late. No train of equal pulses on a grid ends on the target to 1e-6 deg.

    Half a step of the delay (5 ms) turns the heading by half a step of the spin, and half a pulse may be missing or too
    much: within these the end of H lies, and blocks planned without the valves miss it by the delay and by what their
    thrust lacks.
    """
    body = aimed(at_rest("lunar-prospector"), 3.0, 40.0)
    commands = body.commands
    assert commands is not None
    body = replace(body, commands=replace(commands, widths=np.arange(0.046, 0.0541, 0.001)))
    aware, unaware = (
        planning.plan(one, "command-block", Options(max_blocks=1)) for one in (through(body, valve), body)
    )
    (block,) = aware.pulses.blocks
    assert 0.045 < block.width < 0.055
    assert aware.flown is not None
    way, spin = math.radians(3.0), abs(body.spin)
    step = way / block.count
    grid = 0.5 * spin * commands.delay_step * way + 0.5 * step
    motion, _ = flown_through(through(body, valve), aware.pulses)
    assert motion == pytest.approx(aware.flown.axis_error, abs=1e-8)
    assert aware.flown.axis_error < grid
    assert aware.flown.nutation < 2.0 * step
    missed, _ = flown_through(through(body, valve), fired(through(body, valve), unaware.pulses.blocks))
    assert missed > 0.9 * abs(way * spin * 0.015)  # the heading, by 15 ms of the spin
    assert missed > 1.9 * aware.flown.axis_error


@pytest.mark.parametrize("name", ["lunar-prospector", "ace"])
def test_cold_pulses_of_a_block_turn_less(name: str) -> None:
    """By the sum of their factors; the next block of the channel goes on where the nozzle was."""
    channel, width = ("+M2", 0.2) if name == "lunar-prospector" else ("N1", 0.2)
    body, cold = at_rest(name), Cold(0.6, 4.0)
    blocks = Block(channel, 1, 1.0, width, 6), Block(channel, 7, 1.0, width, 9)
    for count in (1, 2):
        form, flown = turns(replace(body, cold=cold), *blocks[:count])
        warm_form, warm = turns(body, *blocks[:count])
        pulses = sum(block.count for block in blocks[:count])
        factors = [1.0 - 0.4 * math.exp(-number / 4.0) for number in range(pulses)]
        assert flown / warm == pytest.approx(sum(factors) / pulses, rel=1e-3)
        assert form / warm_form == pytest.approx(sum(factors) / pulses, rel=1e-3)


def test_cold_pulses_leave_the_nutation_of_the_closed_form() -> None:
    """It is not the mean that counts: the first kicks are missing."""
    body = replace(at_rest("lunar-prospector"), cold=Cold(0.3, 3.0))
    model, channel = BlockModel(body), body.channels[0]
    for count in range(2, 12):
        form = model.left(model.after(model.start, channel, Trial(0, 1.0, 0.2, count, 1)))
        flown = left_by(flight.flown(body, fired(body, (Block(channel.name, 1, 1.0, 0.2, count),))))
        assert float(form.nutation) == pytest.approx(flown.nutation, abs=math.radians(2e-3))


def test_falling_pressure_turns_less_pulse_by_pulse() -> None:
    """As p = p0/(1 + (p0/p1 - 1) used/propellant) has it, added up here; a tank that runs dry is refused."""
    body, block = at_rest("lunar-prospector"), Block("+M2", 1, 1.0, 0.2, 40)
    tank = Tank(propellant=0.3, pressure=22e5, final_pressure=8e5, exponent=1.0)
    form, flown = turns(replace(body, tank=tank), block)
    warm_form, warm = turns(body, block)
    used, levels, each = 0.0, [], (body.channels[0].mass_flow or 0.0) * 0.2
    for _ in range(block.count):
        levels.append(1.0 / (1.0 + (22.0 / 8.0 - 1.0) * used / 0.3))
        used += each * levels[-1]
    assert 0.5 < levels[-1] < 0.8
    assert flown / warm == pytest.approx(sum(levels) / block.count, rel=2e-3)
    assert form / warm_form == pytest.approx(sum(levels) / block.count, rel=2e-3)
    with pytest.raises(Infeasible, match="of propellant, and the tank has"):
        fired(replace(body, tank=replace(tank, propellant=0.05)), (block,))


def test_widths_that_give_no_thrust_are_not_planned() -> None:
    body = commanded(spinner(channels=cross(8.0)), np.array([1.0, 0.0, 0.3]))
    assert body.commands is not None
    widths = body.commands.widths
    lost = float(0.5 * (widths[3] + widths[4]))
    channel = through(body, Trapezoid(open_delay=lost)).channels[0]
    assert commandable_widths(body.commands, channel).tolist() == widths[4:].tolist()
