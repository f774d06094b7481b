"""The scheme optimal: optima of small angles, and schedules that fly at that cost, whatever the goal and the limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog
from support import reference
from support.builders import Outcome, channel, cross, spinner
from support.cases import deep, spread, weekly
from support.golden import check_text
from support.optimal import flies, random_layout

from nutdamp.planning import plan
from nutdamp.remarks import infeasibility, remarks
from nutdamp.schemes.optimal.linear_program import Program, Solution
from nutdamp.schemes.optimal.residual_equations import Equations, small_angles
from nutdamp.schemes.options import OptimalOptions
from nutdamp.spacecraft import Channel, Goal, Limits, Spacecraft

STRONG = 1e7
"""N m that make practically ideal impulses: they need a microsecond."""


def body(A: float, C: float, spin: float, horizon: float, names: str = "+1 -1 +2 -2") -> Spacecraft:
    """Some of four channels that make practically ideal impulses."""
    channels = tuple(one for one in cross(STRONG) if one.name in names.split())
    return spinner(A, C, spin, channels=channels, limits=Limits(horizon=horizon))


def real() -> tuple[Channel, ...]:
    return cross(8.0, min_on_time=0.02, max_on_time=2.0)


def skew() -> tuple[Channel, ...]:
    """Six channels that push the spin a little each, up or down by turns."""
    turns = [0.4 + k for k in range(6)]
    return tuple(
        channel(f"T{k}", 8 * math.cos(turn), 8 * math.sin(turn), 0.8 * (-1) ** k, min_on_time=0.02)
        for k, turn in enumerate(turns)
    )


SPIN_JETS = tuple(channel(f"spin {sign}", 0.0, 0.0, 6.0 * sign, min_on_time=0.02) for sign in (1, -1))


def optimum(spacecraft: Spacecraft, per_impulse: np.ndarray | float = 1.0) -> Solution:
    """The program of small angles, at these costs of one N m s in each channel."""
    costs = np.array([np.linalg.norm(one.torque) for one in spacecraft.channels]) * per_impulse
    return Program(spacecraft, spacecraft.channels, costs, small_angles(spacecraft, Equations())).solve()


PUBLISHED = [
    (120.0, 80.0, 3.0, 3.2, "+1 -1 +2 -2", 1.000),
    (120.0, 80.0, 3.0, 2.0, "+1 -1 +2 -2", 1.118),
    (120.0, 80.0, 3.0, 1.0, "+1 -1 +2 -2", 1.397),
    (120.0, 80.0, -3.0, 2.0, "+1 -1 +2 -2", 1.151),
    (80.0, 120.0, 3.0, 2.0, "+1 -1 +2 -2", 1.082),
    (120.0, 80.0, 3.0, 8.0, "+1", 1.155),
    (100.0, 80.0, 3.0, 200.0, "+1 -1 +2 -2", 1.051),
    (90.0, 120.0, 3.0, 200.0, "+1 -1 +2 -2", 1.155),
]


@pytest.mark.parametrize(("A", "C", "spin", "horizon", "names", "cost"), PUBLISHED)
def test_small_angle_optima(A: float, C: float, spin: float, horizon: float, names: str, cost: float) -> None:
    spacecraft = body(A, C, spin, horizon, names)
    found = optimum(spacecraft)
    assert found.unmet < 1e-9
    assert found.cost / spacecraft.least_impulse == pytest.approx(cost, abs=6e-4)
    assert len(found.burns) <= 4


@spread(("A", "C", "spin", "horizon", "names", "cost"), PUBLISHED, quick=1, deep=2)
def test_flown_schedules_leave_nothing_at_that_cost(
    A: float, C: float, spin: float, horizon: float, names: str, cost: float
) -> None:
    spacecraft = body(A, C, spin, horizon, names)
    made = flies(spacecraft)
    assert made.pulses.total_impulse / spacecraft.least_impulse == pytest.approx(cost, rel=0.01)
    bounds = made.pulses.bounds
    assert bounds is not None
    assert (bounds.rigorous or math.inf) <= (bounds.first_order or 0.0) * (1 + 1e-6)


def dense(spacecraft: Spacecraft, costs: np.ndarray, points: int) -> float:
    """The same optimum from one large grid of impulses, without any of the program's code."""
    inertia, omega = spacecraft.inertia, complex(spacecraft.omega0[0], spacecraft.omega0[1])
    times, rows = np.linspace(0.0, spacecraft.horizon, points), list[np.ndarray]()
    for rate in (inertia.a * spacecraft.spin, spacecraft.spin):
        turned = np.exp(1j * rate * times)
        acts = np.concatenate([one.transverse / abs(one.transverse) * turned for one in spacecraft.channels])
        rows += [acts.real, acts.imag]
    goal = -inertia.A * np.array([omega.real, omega.imag, 0.0, 0.0])
    found = linprog(np.repeat(costs, points), A_eq=np.array(rows), b_eq=goal, method="highs")
    return math.inf if found.fun is None else float(found.fun)


@spread("seed", range(12), quick=1, deep=2)
def test_the_optimum_is_that_of_a_dense_grid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angles = rng.uniform(0, 2 * math.pi, 5)
    five = tuple(channel(f"c{i}", STRONG * math.cos(x), STRONG * math.sin(x), 0.0) for i, x in enumerate(angles))
    C, spin = rng.choice([50.0, 90.0, 150.0, 220.0]), rng.choice([-2.0, 3.0])
    spacecraft = spinner(120.0, C, spin, 2.0, channels=five, limits=Limits(horizon=8.0))
    costs = rng.uniform(1.0, 3.0, 5)
    found, expected = optimum(spacecraft, costs), dense(spacecraft, costs, 3000)
    assert (found.unmet > 1e-9) == math.isinf(expected)
    assert found.unmet > 1e-9 or found.cost == pytest.approx(expected, rel=1e-4)


WINDOWS = Limits(blackout=((3.0, 9.0),), earliest=1.0)


@pytest.mark.parametrize(
    ("A", "C", "spin", "degrees"),
    [
        (120.0, 80.0, 3.0, 5.0),
        deep(120.0, 80.0, -3.0, 1.0),
        deep(90.0, 120.0, 2.0, 15.0),
        weekly(120.0, 80.0, 3.0, 15.0),
        weekly(120.0, 80.0, -3.0, 5.0),
    ],
)
def test_real_thrusters_keep_their_limits_and_leave_nothing(A: float, C: float, spin: float, degrees: float) -> None:
    flies(spinner(A, C, spin, degrees, channels=real(), limits=WINDOWS), dearest=1.02)


def test_few_pulses_are_preferred_to_the_last_tenth_of_a_percent_and_the_plan_carries_its_proof() -> None:
    made = flies(spinner(channels=real()))
    assert len(made.pulses) <= 12
    check_text("plan.proof", "\n".join(remarks(made)))


@pytest.mark.deep
def test_a_free_axis_is_no_dearer() -> None:
    spacecraft = body(120.0, 80.0, 3.0, 1.0)
    kept, free = (flies(spacecraft, free_axis=flag) for flag in (False, True))
    assert free.pulses.total_impulse < kept.pulses.total_impulse


@pytest.mark.deep
@pytest.mark.parametrize(("horizon", "names", "key"), [(0.4, "+1 +2", "deadline-h"), (0.05, "+1", "deadline")])
def test_an_impossible_deadline_says_what_to_relax(horizon: float, names: str, key: str) -> None:
    check_text(f"plan.{key}", infeasibility(plan(body(120.0, 80.0, 3.0, horizon, names), "optimal")))


@spread("seed", range(200), quick=1, deep=2)
def test_random_layouts_are_planned(seed: int) -> None:
    flies(random_layout(seed), left=1e-5, dearest=1.03 if seed < 16 else 1.25)


def with_goal(
    one: Spacecraft, tilt: float | None = None, azimuth: float = 0.0, spin: float | None = None
) -> Spacecraft:
    axis = None if tilt is None else one.direction_in_n(math.radians(tilt), math.radians(azimuth))
    return replace(one, goal=Goal(axis, spin))


@pytest.mark.deep
@pytest.mark.parametrize(
    ("A", "C", "spin", "tilt", "azimuth", "degrees"),
    [
        (120.0, 80.0, 3.0, 10.0, 200.0, 5.0),
        weekly(120.0, 80.0, -3.0, 2.0, 0.0, 5.0),
        weekly(90.0, 120.0, 2.0, 15.0, 60.0, 0.0),
        weekly(90.0, 120.0, 2.0, 10.0, 200.0, 5.0),
        weekly(120.0, 80.0, -3.0, 15.0, 60.0, 0.0),
    ],
)
def test_the_axis_ends_on_its_target(
    A: float, C: float, spin: float, tilt: float, azimuth: float, degrees: float
) -> None:
    one = with_goal(spinner(A, C, spin, degrees, channels=real(), limits=Limits(horizon=80.0)), tilt, azimuth)
    made = flies(one, dearest=1.03)
    axis = Outcome(one, made.pulses).motion.rotation @ np.array([0.0, 0.0, math.copysign(1.0, spin)])
    assert reference.angle(axis, one.target_axis) < 1e-8  # the spin axis itself points there, not H alone
    # |dH/dt| <= |M|: no schedule turns H with less
    assert made.pulses.total_impulse >= max(one.least_impulse, one.turning_impulse) * (1 - 1e-9)


@pytest.mark.parametrize(
    ("spin", "factor"), [weekly(3.0, 0.7), (-3.0, 1.0), weekly(3.0, 1.02), weekly(-3.0, 1.4), weekly(3.0, 1.4)]
)
def test_the_spin_ends_as_asked(spin: float, factor: float) -> None:
    one = spinner(spin=spin, channels=(*real(), *SPIN_JETS), limits=Limits(horizon=90.0))
    flies(with_goal(one, spin=spin * factor))


@pytest.mark.deep
def test_three_moments_end_at_the_spin_asked_for_too() -> None:
    """The model that is planned on is symmetric; the last trim on the true body knows of the spin."""
    one = spinner(moments=(120, 110, 80), channels=(*skew(), *SPIN_JETS), limits=Limits(horizon=90.0))
    flies(with_goal(one, spin=3.1))


def test_skew_thrusters_can_keep_the_spin() -> None:
    """Left to themselves they change it."""
    flies(with_goal(spinner(channels=skew(), limits=Limits(horizon=60.0)), spin=3.0))


def test_without_axial_torque_a_spin_is_refused_with_its_reason() -> None:
    check_text("plan.no-axial-torque", infeasibility(plan(with_goal(spinner(channels=real()), spin=3.5), "optimal")))


@pytest.mark.parametrize(
    ("channels", "horizon", "least"), [weekly(cross(2e4), 1.0, 1.01), deep(real(), 5.0, 0.999)], ids=["strong", "real"]
)
def test_h_may_end_off_its_target_and_that_saves(channels: tuple[Channel, ...], horizon: float, least: float) -> None:
    one = spinner(channels=channels, limits=Limits(horizon=horizon))
    kept, free = (plan(one, "optimal", OptimalOptions(free_axis=flag)) for flag in (False, True))
    loose = flies(one, shift=math.radians(0.5))
    assert free.pulses.cost * (1.0 - 1e-6) <= loose.pulses.cost < kept.pulses.cost / least


@pytest.mark.deep
def test_least_time_ends_sooner_and_nothing_ends_much_sooner() -> None:
    one = spinner(channels=real(), limits=Limits(horizon=30.0))
    soon, cheap = (flies(one, least=what) for what in ("time", "propellant"))
    assert soon.pulses.end < cheap.pulses.end
    assert soon.pulses.total_impulse >= cheap.pulses.total_impulse * (1 - 1e-9)
    assert plan(replace(one, limits=Limits(horizon=0.9 * soon.pulses.end)), "optimal").schedule is None


@pytest.mark.parametrize(("free", "pulses"), [(False, 2), (True, 1)])
def test_least_pulses_fires_as_seldom_as_the_equations_allow(free: bool, pulses: int) -> None:
    made = flies(spinner(channels=cross(40.0), limits=Limits(horizon=60.0)), least="pulses", free_axis=free)
    assert len(made.pulses) == pulses


@pytest.mark.deep
def test_ticks_together_leave_no_more_than_half_a_tick_of_one_pulse() -> None:
    """At their best moments all pulses change the nutation by the same steps, so that half a step may stay."""
    one = spinner(channels=real(), limits=Limits(horizon=60.0, tick=0.01))
    half_a_step = 0.5 * 0.01 * 8.0 / (80.0 * 3.0)
    assert len(flies(one, left=1.1 * math.degrees(half_a_step)).pulses) > 4


def ticked(seed: int) -> Spacecraft:
    one, rng = random_layout(seed), np.random.default_rng(seed)
    tick, gap = float(rng.choice([1e-3, 5e-3])), float(rng.choice([0.0, 0.3]))
    return replace(one, limits=replace(one.limits, tick=tick, gap=gap))


@pytest.mark.weekly
@pytest.mark.parametrize("seed", range(8))
def test_on_ticks_only_rounding_stays(seed: int) -> None:
    """Half a tick of every start and on-time, as independent errors, by the reference integrator."""
    one = ticked(seed)
    made, tick = plan(one, "optimal"), one.limits.tick
    assert tick is not None
    if made.schedule is None:
        assert f"ticks of {tick:.4g} s" in infeasibility(made)
        return
    rate = max(abs(one.spin), abs(one.inertia.a * one.spin))
    errors = [0.5 * tick * p for pulse in made.pulses for p in pulse.magnitude * np.array([rate, 1.0 / pulse.on_time])]
    flies(one, left=math.degrees(math.hypot(*errors) / (one.inertia.C * abs(one.spin))))


@pytest.mark.deep
def test_with_three_moments_impulse_is_that_of_the_true_thrusters() -> None:
    """The model that is planned on has torques stretched by some per cent; its costs are not."""
    one = spinner(moments=(120.0, 110.0, 80.0), channels=cross(8.0, max_on_time=2.0), limits=Limits(horizon=60.0))
    priced = [
        Channel(each.name, tuple(replace(part, isp=220.0, thrust=8.0) for part in each.thrusters))
        for each in one.channels
    ]
    by_impulse, by_propellant = (flies(each).pulses for each in (one, replace(one, channels=tuple(priced))))
    assert by_impulse.bounds is not None
    assert by_propellant.bounds is not None
    ratio = by_impulse.total_impulse / (by_impulse.bounds.first_order or 0.0)
    assert ratio == pytest.approx(by_propellant.cost / (by_propellant.bounds.first_order or 0.0), rel=1e-9)
