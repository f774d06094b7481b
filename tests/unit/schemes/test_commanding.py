"""Plans through valves: what is commanded, flown by an integrator that knows nothing but the level of the thrust."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from support import reference
from support.builders import aimed, channel, cross, spinner
from support.cases import spread

from nutdamp import planning
from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.flown import RealWidths
from nutdamp.dispersion.kernel import ClosedForm
from nutdamp.flight import by_impulses, flown
from nutdamp.limits import breaches, effective_on_times
from nutdamp.physics.feed import Cold, Tank
from nutdamp.physics.valve import Measured, Trapezoid, Valve
from nutdamp.remarks import infeasibility
from nutdamp.schedule import Schedule, channel_pulse, on_command
from nutdamp.schemes.options import FourPulseOptions, RhumbLineOptions
from nutdamp.schemes.registry import RHUMB_LINE
from nutdamp.schemes.tools import commanding
from nutdamp.schemes.tools.least_squares import TAIL, Correction
from nutdamp.spacecraft import Channel, Limits, Spacecraft
from nutdamp.verification import verify

MICRODEGREE = math.radians(1e-6)

LATE = Trapezoid(0.015, 0.015)
SLOW = Trapezoid(0.015, 0.012, 0.005, 0.010)
EFFECTIVE = replace(SLOW, effective=True)
MEASURED = Measured(((0.005, 0.003, 0.009), (0.02, 0.017, 0.02), (0.05, 0.049, 0.037), (0.9, 0.902, 0.465)))
VALVES = {"late": LATE, "slow": SLOW, "effective": EFFECTIVE, "measured": MEASURED}


def through(valve: Valve | None, body: Spacecraft) -> Spacecraft:
    """The body with this valve on all its thrusters."""

    def with_valve(one: Channel) -> Channel:
        return replace(one, thrusters=tuple(replace(thruster, valve=valve) for thruster in one.thrusters))

    return replace(body, channels=tuple(map(with_valve, body.channels)))


def short_pulses(degrees: float = 0.4, *, axial: float = 0.0, longest: float = 0.05) -> Spacecraft:
    """Pulses of about 50 ms across a body at 30 rpm."""
    torques = ((8.0, 0.0), (-8.0, 0.0), (0.0, 8.0), (0.0, -8.0))
    channels = tuple(
        channel(f"C{number}", *torque, axial, min_on_time=0.005, max_on_time=longest, isp=220.0, thrust=10.0)
        for number, torque in enumerate(torques)
    )
    return spinner(spin=math.pi, degrees=degrees, channels=channels, limits=Limits(horizon=200.0))


CASES = {
    "one-pulse": short_pulses(),
    "one-pulse, axial torque": short_pulses(axial=0.3),
    "two-pulse": spinner(degrees=2.0, channels=cross(8.0, max_on_time=0.9), limits=Limits(horizon=200.0)),
    "four-pulse": short_pulses(),
    "rhumb-line": aimed(short_pulses(0.0), 1.0, 40.0),
    "half-cone": aimed(short_pulses(0.0), 0.5, 40.0),
    "optimal": short_pulses(),
}
"""The scheme up to the comma, and a body in which it leaves no nutation."""


def levels(made: Schedule, body: Spacecraft) -> Iterable[reference.Swell]:
    """The thrust of commands through the valves of `Trapezoid`, from start and on-time as loaded alone."""
    channels = {one.name: one for one in body.channels}
    for pulse in made:
        valve = channels[pulse.channel].valve
        assert isinstance(valve, Trapezoid)
        assert pulse.torque is not None
        start, on_time = pulse.loaded
        yield from reference.through_valve(
            start,
            on_time,
            pulse.torque,
            opening=valve.open_delay,
            closing=valve.close_delay,
            rise=valve.rise_time,
            fall=valve.fall_time,
        )


def left(made: Schedule, body: Spacecraft) -> float:
    """What commands leave, rad, by the reference: nutation, or with a target the way to it, whichever is more."""
    moments = body.inertia.moments
    motion = reference.fly(moments, body.omega0, levels(made, body), made.end + 0.01)
    nutation = reference.nutation(moments, motion.rates, 1.0)
    if body.goal.axis is None:
        return nutation
    return max(nutation, reference.angle(reference.momentum(moments, motion), body.goal.axis))


def made_by(scheme: str, body: Spacecraft) -> Schedule:
    found = planning.plan(body, scheme.partition(",")[0])
    assert found.feasible, infeasibility(found)
    assert found.flown is not None
    assert found.flown.nutation < MICRODEGREE
    assert list(breaches(body, found.pulses)) == []
    return found.pulses


@spread("valve", [LATE, SLOW], quick=1, ids=["late", "slow"])
@spread("scheme", CASES, quick=1)
def test_planned_with_valves_nothing_is_left_and_without_them_much(scheme: str, valve: Trapezoid) -> None:
    body = CASES[scheme]
    late = through(valve, body)
    made = made_by(scheme, late)
    assert left(made, late) < MICRODEGREE
    channels = {one.name: one for one in late.channels}
    unaware = made_by(scheme, body)
    fired = Schedule(tuple(on_command(channels[one.channel], *one.loaded) for one in unaware))
    assert left(fired, late) > 1000.0 * MICRODEGREE


@spread("valve", VALVES.values(), quick=1, ids=VALVES)
@spread("scheme", CASES, quick=1)
def test_the_flight_the_impulse_sum_and_the_cases_agree(scheme: str, valve: Valve) -> None:
    body = through(valve, CASES[scheme])
    made = made_by(scheme, body)
    assert by_impulses(body, made).residual.nutation < MICRODEGREE
    some = Schedule(made.pulses[:-1])  # so that much is left to compare
    nominal = flown(body, some).residual.nutation
    assert nominal > 100.0 * MICRODEGREE
    assert by_impulses(body, some).residual.nutation == pytest.approx(nominal, abs=1e-13)
    model = Model(body, some)
    for fly in (RealWidths(model), ClosedForm(model)):
        ends = fly(model.cases({"timing pulse 1": np.zeros(3)}))
        across = np.hypot(ends.momentum[0], ends.momentum[1])
        allowed = 1e-13 if isinstance(fly, RealWidths) else 1e-8
        assert np.arctan2(across, ends.momentum[2]) == pytest.approx(nominal, abs=allowed)


@pytest.mark.deep
def test_commands_are_those_of_the_valve_and_effective_ones_of_the_impulse() -> None:
    for valve in (SLOW, EFFECTIVE):
        made = made_by("optimal", through(valve, short_pulses()))
        for pulse in made:
            start, on_time = pulse.loaded
            acts = valve.thrust(on_time)
            assert pulse.on_time == pytest.approx(acts.on_time, rel=1e-12)
            assert pulse.t == pytest.approx(start + acts.centroid, rel=1e-12)
            assert 0.005 <= on_time <= 0.05
            assert pulse.torque is not None
            assert pulse.impulse == pytest.approx(pulse.torque * pulse.on_time)


@spread("scheme", ["one-pulse", "four-pulse", "optimal"], quick=1)
def test_ticks_are_those_of_the_command(scheme: str) -> None:
    body = through(SLOW, short_pulses())
    body = replace(body, limits=replace(body.limits, tick=0.001))
    made = planning.plan(body, scheme)
    assert made.feasible, infeasibility(made)
    for pulse in made.pulses:
        for time in pulse.loaded:
            assert time / 0.001 == pytest.approx(round(time / 0.001), abs=1e-6)
    assert left(made.pulses, body) < math.radians(0.02)


def test_limits_hold_for_the_command_and_until_the_thrust_is_over() -> None:
    body = through(Trapezoid(0.1, 0.2, 0.05, 0.3), short_pulses(2.0))
    limits = Limits(horizon=60.0, earliest=1.0, gap=0.4, blackout=((4.0, 6.0), (9.0, 9.5)))
    body = replace(body, limits=limits)
    for scheme in ("one-pulse", "four-pulse"):
        made = planning.plan(body, scheme)
        assert made.feasible, infeasibility(made)
        over = -math.inf
        for pulse in made.pulses:
            start, ends = pulse.loaded[0], pulse.thrust[1]
            assert start >= max(1.0, over + 0.4) - 1e-9
            assert ends <= 60.0
            assert all(ends <= begin + 1e-9 or start >= end - 1e-9 for begin, end in limits.blackout)
            over = ends


@pytest.mark.deep
def test_a_requested_on_time_is_a_command() -> None:
    body = through(SLOW, short_pulses())
    found = planning.plan(body, "four-pulse", FourPulseOptions(on_time=0.03))
    assert [pulse.loaded[1] for pulse in found.pulses][:-1] == pytest.approx([0.03] * (len(found.pulses) - 1))
    train = planning.plan(
        aimed(through(SLOW, short_pulses(0.0)), 1.0, 40.0), "rhumb-line", RhumbLineOptions(on_time=0.03)
    )
    assert train.feasible, infeasibility(train)
    on_times = [pulse.loaded[1] for pulse in train.pulses]
    assert on_times[:9] == pytest.approx([0.03] * 9, rel=1e-9)
    assert all(0.027 - 0.0005 <= on_time <= 0.033 + 1e-9 for on_time in on_times)  # what closes the train differs


@pytest.mark.deep
@spread("valve", [None, SLOW], quick=1, ids=["cold alone", "through valves"])
@spread("scheme", CASES, quick=2)
def test_cold_pulses_are_planned_for(scheme: str, valve: Valve | None) -> None:
    cold = Cold(0.9, 4.0)
    body = replace(through(valve, CASES[scheme]), cold=cold)
    made = made_by(scheme, body)
    fired: dict[str, int] = {}
    channels = {one.name: one for one in body.channels}
    for pulse in made:
        before = fired.setdefault(pulse.channel, 0)
        assert pulse.torque == pytest.approx(cold.factor(before) * channels[pulse.channel].torque, rel=1e-12)
        fired[pulse.channel] += 1
    if valve is not None:
        assert left(made, body) < MICRODEGREE
    model = Model(body, made)
    ends = RealWidths(model)(model.cases({"timing pulse 1": np.zeros(2)}))
    assert np.hypot(ends.momentum[0], ends.momentum[1]) / ends.momentum[2] == pytest.approx(0.0, abs=MICRODEGREE)


@pytest.mark.weekly
def test_the_budget_says_what_valves_and_cold_pulses_cost() -> None:
    body = replace(through(SLOW, short_pulses()), cold=Cold(0.9, 4.0))
    made = made_by("optimal", body)
    found = verify(body, made)
    budget = {row.name: row.nutation for row in found.budget}
    assert found.agree
    assert budget["all: as flown"] < MICRODEGREE
    assert budget["without valves"] > 1000.0 * MICRODEGREE
    assert budget["without cold pulses"] > 1000.0 * MICRODEGREE


@pytest.mark.weekly
def test_the_shortest_command_of_a_valve_that_closes_late_is_what_plans_reckon_with() -> None:
    late = Trapezoid(open_delay=0.005, close_delay=0.105)
    assert effective_on_times(channel("C", 8.0, 0.0, 0.0))[0] == 0.0
    body = through(late, spinner(spin=3.0, degrees=0.1, channels=(channel("C", 8.0, 0.0, 0.0),)))
    assert effective_on_times(body.channels[0])[0] == pytest.approx(0.1, abs=1e-8)
    for scheme in ("one-pulse", "four-pulse", "optimal"):
        made = planning.plan(body, scheme)
        assert all(pulse.loaded[1] > 0.0 and pulse.on_time >= 0.1 for pulse in made.pulses)


@pytest.mark.weekly
def test_no_pulse_of_a_plan_is_without_thrust() -> None:
    """Oblate, strong thrusters, and a valve that closes so late that a tick already gives 141 ms of thrust."""
    M, tick = 1072.4242912066034, 0.05652980755265212
    torques = {"+M1": (M, 0.0), "-M1": (-M, 0.0), "+M2": (0.0, M), "-M2": (0.0, -M)}
    channels = tuple(channel(name, *one, 0.1 * M, isp=172.0, thrust=1580.0) for name, one in torques.items())
    limits = Limits(earliest=0.80377, tick=tick, blackout=((2.766427, 16.756058), (56.5298, 62.182788)))
    body = spinner(A=696.2014640787293, C=1290.5142511514878, channels=channels, limits=limits)
    body = replace(body, omega0=np.array([0.02924650877807938, 0.3621071224872865, -1.1114818144971392]))
    late = Trapezoid(0.012435118149339648, 0.09611290163212675, 0.010065350950248513, 0.01181259076686132)
    made = planning.plan(through(late, body), "optimal")
    assert made.pulses
    assert all(pulse.magnitude > 0.0 for pulse in made.pulses)


@spread("moments", [(123.0, 117.0, 80.0), (130.0, 110.0, 80.0), (95.0, 105.0, 150.0)], quick=1)
@spread(("degrees", "on_time"), [(0.0, 0.03), (0.0, 0.04), (0.05, 0.03)], quick=1)
def test_a_train_of_requested_length_closes_on_a_body_of_three_moments(
    moments: tuple[float, float, float], degrees: float, on_time: float
) -> None:
    channels = short_pulses().channels
    body = aimed(spinner(spin=math.pi, degrees=degrees, moments=moments, channels=channels), 1.0, 40.0)
    body = replace(body, limits=Limits(horizon=200.0))
    found = planning.plan(body, "rhumb-line", RhumbLineOptions(on_time=on_time))
    assert found.feasible, infeasibility(found)
    assert found.flown is not None
    allowed = MICRODEGREE if degrees == 0.0 else math.radians(0.005)  # of 1 degree to turn, where nutation is left
    assert max(found.flown.nutation, found.flown.axis_error) < allowed
    assert [pulse.on_time for pulse in found.pulses.pulses[-15:]] == pytest.approx([on_time] * 15)  # the train


@pytest.mark.parametrize("feed", [{"cold": Cold(0.8, 4.0)}, {"tank": Tank(0.02, 22e5, 8e5, 1.0)}], ids=["cold", "tank"])
def test_a_train_says_where_equal_impulses_are_not_equal_commands(feed: dict[str, Any]) -> None:
    body = aimed(short_pulses(0.0), 1.0, 40.0)
    found = planning.plan(replace(body, **feed), "rhumb-line")
    lengths = [pulse.loaded[1] for pulse in found.pulses]
    (note,) = (one for one in found.pulses.notes if one.startswith("equal in impulse"))
    said = [float(one) for one in re.findall(r"([0-9.]+) s", note)]
    assert said == pytest.approx([min(lengths), max(lengths)], rel=0.01)
    assert max(lengths) > 1.1 * min(lengths)
    assert not any("equal in impulse" in one for one in planning.plan(body, "rhumb-line").pulses.notes)


@dataclass(frozen=True)
class Silencing(Correction):
    """A correction of a train that leaves the pulse of this number without thrust."""

    silenced: int

    def __call__(self, spacecraft: Spacecraft, made: Schedule, free: int = TAIL) -> Schedule:  # noqa: ARG002
        pulses = list(made.pulses)
        pulses[self.silenced] = replace(pulses[self.silenced], impulse=np.zeros(3), on_time=0.0)
        return replace(made, pulses=tuple(pulses))


@pytest.mark.parametrize("silenced", [2, 5])
def test_of_a_train_that_lost_a_pulse_the_rest_is_compared(silenced: int) -> None:
    """Two pulses of other lengths come before the train of four; they are no part of what is equal."""
    body = replace(short_pulses(), cold=Cold(0.8, 4.0))
    one = body.channels[0]
    planned = Schedule(tuple(channel_pulse(one, 2.0 * n, on_time) for n, on_time in enumerate([0.4, 0.3] + 4 * [0.03])))
    found = commanding.as_commands(body, planned, Silencing(RHUMB_LINE, RhumbLineOptions(), silenced))
    assert len(found) == 5
    (note,) = (one for one in found.notes if one.startswith("equal in impulse"))
    train = [pulse.loaded[1] for pulse in found.pulses[2:]]
    assert f"commands of {min(train):.4g} s to {max(train):.4g} s" in note
    assert max(train) < 0.05
