"""Plans through valves: what is commanded, flown by an integrator that knows nothing but the level
of the thrust.
"""

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from support import reference
from support.builders import aimed, channel, codes, cross, documented, one_of, present, spinner
from support.cases import deep, spread, weekly
from support.golden import refused
from support.spinners import swells, through

from nutdamp.common.results import Value
from nutdamp.errors import Infeasible
from nutdamp.flight.propagation import by_impulses, flown
from nutdamp.flight.verification import verify
from nutdamp.montecarlo.cases import DispersedModel
from nutdamp.montecarlo.propagated import RealWidths
from nutdamp.physics.thruster import Cold, Measured, Tank, Trapezoid, Valve
from nutdamp.planning import plan as planning
from nutdamp.planning.causes import infeasibility
from nutdamp.schemes import valve_commands
from nutdamp.schemes.catalogue import RHUMB_LINE, Options, RhumbLineOptions
from nutdamp.schemes.correction import TAIL, Correction
from nutdamp.spacecraft.constraints import breaches, effective_on_times
from nutdamp.spacecraft.model import Limits, Spacecraft
from nutdamp.spacecraft.schedule import Schedule, channel_pulse, on_command

MICRODEGREE = math.radians(1e-6)

LATE = Trapezoid(0.015, 0.015)
SLOW = Trapezoid(0.015, 0.012, 0.005, 0.010)
EFFECTIVE = replace(SLOW, effective=True)
MEASURED = Measured(
    ((0.005, 0.003, 0.009), (0.02, 0.017, 0.02), (0.05, 0.049, 0.037), (0.9, 0.902, 0.465))
)
VALVES = {"late": LATE, "slow": SLOW, "effective": EFFECTIVE, "measured": MEASURED}


def short_pulses(degrees: float = 0.4, *, axial: float = 0.0) -> Spacecraft:
    """Pulses of about 50 ms across a body at 30 rpm."""
    torques = ((8.0, 0.0), (-8.0, 0.0), (0.0, 8.0), (0.0, -8.0))
    jet: dict[str, Any] = {"min_on_time": 0.005, "max_on_time": 0.05, "isp": 220.0, "thrust": 10.0}
    channels = tuple(
        channel(f"C{number}", *torque, axial, **jet) for number, torque in enumerate(torques)
    )
    return spinner(spin=math.pi, degrees=degrees, channels=channels, limits=Limits(horizon=200.0))


SHORT = short_pulses()
TO_TURN = aimed(short_pulses(0.0), 1.0, 40.0)
CASES = {
    "one-pulse": SHORT,
    "one-pulse, axial torque": short_pulses(axial=0.3),
    "two-pulse": spinner(
        degrees=2.0, channels=cross(8.0, max_on_time=0.9), limits=Limits(horizon=200.0)
    ),
    "four-pulse": SHORT,
    "rhumb-line": TO_TURN,
    "half-cone": aimed(short_pulses(0.0), 0.5, 40.0),
    "optimal": SHORT,
}
"""The scheme up to the comma, and a body in which it leaves no nutation."""


def left(made: Schedule, body: Spacecraft) -> float:
    """What commands leave, rad, by the reference: nutation, or with a target the way to it,
    whichever is more.
    """
    moments = body.inertia.moments
    motion = reference.fly(moments, body.omega0, swells(body, made), made.end + 0.01)
    nutation = reference.nutation(moments, motion.rates, 1.0)
    to_go = body.goal.axis is not None and reference.angle(
        reference.momentum(moments, motion), body.target_axis
    )
    return max(nutation, float(to_go))


def made_by(scheme: str, body: Spacecraft, *, most: float = MICRODEGREE) -> Schedule:
    plan = planning.plan(body, scheme.partition(",")[0])
    assert present(plan.flown, infeasibility(plan)).nutation < most
    assert list(breaches(body, plan.pulses)) == []
    return plan.pulses


def cases(*quick: str) -> list[Any]:
    """The cases of which these run always, ``optimal`` by hand, and the others in CI."""
    return [one if one in quick else (weekly if one == "optimal" else deep)(one) for one in CASES]


@spread("valve", [LATE, SLOW], quick=1, ids=["late", "slow"])
@pytest.mark.parametrize("scheme", cases("one-pulse"))
def test_planned_with_valves_nothing_is_left_and_without_them_much(
    scheme: str, valve: Trapezoid
) -> None:
    late = through(valve, CASES[scheme])
    assert left(made_by(scheme, late), late) < MICRODEGREE
    channels = {one.name: one for one in late.channels}
    unaware = Schedule(
        tuple(on_command(channels[p.channel], *p.loaded) for p in made_by(scheme, CASES[scheme]))
    )
    assert left(unaware, late) > 1000.0 * MICRODEGREE


@spread("valve", VALVES.values(), quick=1, ids=VALVES)
@spread("scheme", CASES, quick=1)
def test_the_flight_the_impulse_sum_and_the_cases_agree(scheme: str, valve: Valve) -> None:
    body = through(valve, CASES[scheme])
    made = made_by(scheme, body)
    assert by_impulses(body, made).residual.nutation < MICRODEGREE
    some = Schedule(made.pulses[:-1])  # so that much is left to compare
    nominal = flown(body, some).residual.nutation
    model = DispersedModel(body, some)
    assert nominal > 100.0 * MICRODEGREE
    assert by_impulses(body, some).residual.nutation == pytest.approx(nominal, abs=1e-13)
    ends = RealWidths(model)(model.cases({"timing pulse 1": np.zeros(3)})).momentum
    assert np.arctan2(np.hypot(ends[0], ends[1]), ends[2]) == pytest.approx(nominal, abs=1e-13)


@pytest.mark.deep
@pytest.mark.parametrize("valve", [SLOW, EFFECTIVE])
def test_commands_are_those_of_the_valve_and_effective_ones_of_the_impulse(valve: Valve) -> None:
    for pulse in made_by("optimal", through(valve, SHORT)):
        (start, on_time), given = pulse.loaded, valve.thrust(pulse.loaded[1])
        assert (pulse.on_time, pulse.t) == pytest.approx(
            (given.on_time, start + given.centroid), rel=1e-12
        )
        assert 0.005 <= on_time <= 0.05
        assert pulse.impulse == pytest.approx(present(pulse.torque) * pulse.on_time)


@spread("scheme", ["one-pulse", "four-pulse", "optimal"], quick=1)
def test_ticks_are_those_of_the_command(scheme: str) -> None:
    body = through(SLOW, replace(SHORT, limits=replace(SHORT.limits, tick=0.001)))
    made = made_by(scheme, body, most=math.radians(0.02))
    ticks = np.array([pulse.loaded for pulse in made]) / 0.001
    assert ticks == pytest.approx(np.rint(ticks), abs=1e-6)
    assert left(made, body) < math.radians(0.02)


@pytest.mark.parametrize("scheme", ["one-pulse", "four-pulse"])
def test_limits_hold_for_the_command_and_until_the_thrust_is_over(scheme: str) -> None:
    limits = Limits(horizon=60.0, earliest=1.0, gap=0.4, blackout=((4.0, 6.0), (9.0, 9.5)))
    body = through(Trapezoid(0.1, 0.2, 0.05, 0.3), replace(short_pulses(2.0), limits=limits))
    over = 0.6
    for pulse in made_by(scheme, body, most=body.nutation):
        start, ends = pulse.loaded[0], pulse.thrust[1]
        assert over + 0.4 - 1e-9 <= start < ends <= 60.0
        assert all(ends <= begin + 1e-9 or start >= end - 1e-9 for begin, end in limits.blackout)
        over = ends


@pytest.mark.deep
def test_a_requested_on_time_is_a_command() -> None:
    for scheme, body, equal in (("four-pulse", SHORT, None), ("rhumb-line", TO_TURN, 9)):
        plan = planning.plan(through(SLOW, body), scheme, Options(on_time=0.03))
        assert plan.feasible, infeasibility(plan)
        on_times = [pulse.loaded[1] for pulse in plan.pulses][: equal or -1]
        assert on_times == pytest.approx([0.03] * len(on_times), rel=1e-9)
        # What closes the train differs.
        assert all(0.0265 <= pulse.loaded[1] <= 0.033 + 1e-9 for pulse in plan.pulses if equal)


@spread("valve", [None, SLOW], quick=1, ids=["cold alone", "through valves"])
@pytest.mark.parametrize("scheme", [deep("one-pulse"), *cases()[1:]])
def test_cold_pulses_are_planned_for(scheme: str, valve: Valve | None) -> None:
    cold = Cold(0.9, 4.0)
    body = replace(through(valve, CASES[scheme]), cold=cold)
    made = made_by(scheme, body)
    fired = Counter[str]()
    channels = {one.name: one for one in body.channels}
    for pulse in made:
        full = channels[pulse.channel].torque
        assert pulse.torque == pytest.approx(cold.factor(fired[pulse.channel]) * full, rel=1e-12)
        fired[pulse.channel] += 1
    assert valve is None or left(made, body) < MICRODEGREE
    model = DispersedModel(body, made)
    ends = RealWidths(model)(model.cases({"timing pulse 1": np.zeros(2)})).momentum
    assert np.hypot(ends[0], ends[1]) / ends[2] == pytest.approx(0.0, abs=MICRODEGREE)


@pytest.mark.weekly
def test_the_budget_says_what_valves_and_cold_pulses_cost() -> None:
    body = replace(through(SLOW, SHORT), cold=Cold(0.9, 4.0))
    found = verify(documented(body), made_by("optimal", body))
    budget = {row.name: row.nutation for row in found.budget}
    assert found.agree
    assert budget["all: as flown"] < MICRODEGREE
    assert min(budget["without valves"], budget["without cold pulses"]) > 1000.0 * MICRODEGREE


@pytest.mark.parametrize("scheme", ["one-pulse", "four-pulse", weekly("optimal")])
def test_the_shortest_command_of_a_valve_that_closes_late_is_what_plans_reckon_with(
    scheme: str,
) -> None:
    jet = channel("C", 8.0, 0.0, 0.0)
    body = through(
        Trapezoid(open_delay=0.005, close_delay=0.105), spinner(degrees=0.1, channels=(jet,))
    )
    assert effective_on_times(jet)[0] == 0.0
    assert effective_on_times(body.channels[0])[0] == pytest.approx(0.1, abs=1e-8)
    made = planning.plan(body, scheme)
    assert all(pulse.loaded[1] > 0.0 and pulse.on_time >= 0.1 for pulse in made.pulses)


@pytest.mark.weekly
def test_no_pulse_of_a_plan_is_without_thrust() -> None:
    """Oblate, strong thrusters, and a valve that closes so late that a tick already gives 141 ms of
    thrust.
    """
    M, tick = 1072.4242912066034, 0.05652980755265212
    torques = {"+M1": (M, 0.0), "-M1": (-M, 0.0), "+M2": (0.0, M), "-M2": (0.0, -M)}
    channels = tuple(
        channel(name, *one, 0.1 * M, isp=172.0, thrust=1580.0) for name, one in torques.items()
    )
    limits = Limits(
        earliest=0.80377, tick=tick, blackout=((2.766427, 16.756058), (56.5298, 62.182788))
    )
    body = spinner(A=696.2014640787293, C=1290.5142511514878, channels=channels, limits=limits)
    body = replace(
        body, omega0=np.array([0.02924650877807938, 0.3621071224872865, -1.1114818144971392])
    )
    late = Trapezoid(
        0.012435118149339648, 0.09611290163212675, 0.010065350950248513, 0.01181259076686132
    )
    made = planning.plan(through(late, body), "optimal")
    assert made.pulses
    assert all(pulse.magnitude > 0.0 for pulse in made.pulses)


@pytest.mark.deep
@spread("moments", [(123.0, 117.0, 80.0), (130.0, 110.0, 80.0), (95.0, 105.0, 150.0)], quick=1)
@spread(("degrees", "on_time"), [(0.0, 0.03), (0.0, 0.04), (0.05, 0.03)], quick=1)
def test_a_train_of_requested_length_closes_on_a_body_of_three_moments(
    moments: tuple[float, float, float], degrees: float, on_time: float
) -> None:
    limits = Limits(horizon=200.0)
    body = spinner(
        spin=math.pi, degrees=degrees, moments=moments, channels=SHORT.channels, limits=limits
    )
    plan = planning.plan(aimed(body, 1.0, 40.0), "rhumb-line", RhumbLineOptions(on_time=on_time))
    allowed = (
        MICRODEGREE if degrees == 0.0 else math.radians(0.005)
    )  # of 1 degree to turn, where nutation is left
    assert (
        max(present(plan.flown, infeasibility(plan)).nutation, present(plan.flown).axis_error)
        < allowed
    )
    assert [pulse.on_time for pulse in plan.pulses.pulses[-15:]] == pytest.approx(
        [on_time] * 15
    )  # the train


def unequal(made: Schedule) -> list[Value]:
    """The shortest and the longest of commands that are not equal, s, as a note has them."""
    values = one_of(made.notes, "unequal-commands")
    return [values["shortest_s"], values["longest_s"]]


@spread(
    "feed",
    [{"cold": Cold(0.8, 4.0)}, {"tank": Tank(0.02, 22e5, 8e5, 1.0)}],
    deep=1,
    ids=["cold", "tank"],
)
def test_a_train_says_where_equal_impulses_are_not_equal_commands(feed: dict[str, Any]) -> None:
    made = planning.plan(replace(TO_TURN, **feed), "rhumb-line").pulses
    lengths = [pulse.loaded[1] for pulse in made]
    assert unequal(made) == pytest.approx([min(lengths), max(lengths)], rel=0.01)
    assert max(lengths) > 1.1 * min(lengths)
    assert "unequal-commands" not in codes(planning.plan(TO_TURN, "rhumb-line").pulses.notes)


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
    """Two pulses of other lengths come before the train of four;
    they are no part of what is equal.
    """
    body = replace(SHORT, cold=Cold(0.8, 4.0))
    on_times = [0.4, 0.3, 0.03, 0.03, 0.03, 0.03]
    pulses = (
        channel_pulse(body.channels[0], 2.0 * n, on_time) for n, on_time in enumerate(on_times)
    )
    silencing = Silencing(RHUMB_LINE, RhumbLineOptions(), silenced)
    made = valve_commands.as_commands(body, Schedule(tuple(pulses)), silencing)
    train = [pulse.loaded[1] for pulse in made.pulses[2:]]
    assert len(train) == 3
    assert unequal(made) == pytest.approx([min(train), max(train)], rel=1e-3)
    assert max(train) < 0.05


def test_a_pulse_so_weak_that_it_would_outlast_the_horizon_is_refused() -> None:
    body = replace(SHORT, cold=Cold(0.01, 1e6), limits=replace(SHORT.limits, horizon=5.0))
    made = Schedule((channel_pulse(body.channels[0], 2.0, 0.1),))
    with refused(Infeasible, "commanding.weak"):
        valve_commands.as_commands(body, made, Correction(RHUMB_LINE, RhumbLineOptions()))
