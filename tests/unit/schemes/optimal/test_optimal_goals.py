"""The scheme optimal with goals: target axes, final spin, allowed shift, least time and least pulses."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.builders import Outcome, channel, cross, spinner
from support.cases import deep, spread
from support.checker import violations

from nutdamp.planning import plan
from nutdamp.remarks import infeasibility
from nutdamp.schemes import Options
from nutdamp.spacecraft import Channel, Goal, Limits, Spacecraft

MICRODEGREE = math.radians(1e-6)


def with_goal(
    body: Spacecraft, tilt: float | None = None, azimuth: float = 0.0, spin: float | None = None
) -> Spacecraft:
    from dataclasses import replace

    axis = None if tilt is None else body.direction_in_n(math.radians(tilt), math.radians(azimuth))
    return replace(body, goal=Goal(axis, spin))


def thrusters() -> tuple[Channel, ...]:
    return cross(8.0, min_on_time=0.02, max_on_time=2.0)


@pytest.mark.deep
@spread(("A", "C", "spin"), [(120.0, 80.0, 3.0), (120.0, 80.0, -3.0), (90.0, 120.0, 2.0)], quick=1)
@spread(("tilt", "azimuth", "degrees"), [deep(2.0, 0.0, 5.0), (10.0, 200.0, 5.0), deep(15.0, 60.0, 0.0)], quick=1)
def test_the_axis_ends_on_its_target(
    A: float, C: float, spin: float, tilt: float, azimuth: float, degrees: float
) -> None:
    body = spinner(A, C, spin, degrees, channels=thrusters(), limits=Limits(horizon=80.0))
    body = with_goal(body, tilt, azimuth)
    made = plan(body, "optimal")
    assert made.flown is not None, infeasibility(made)
    assert max(made.flown.nutation, made.flown.axis_error) < MICRODEGREE
    assert made.flown.momentum_shift == pytest.approx(math.radians(tilt), abs=1e-7)
    assert violations(body, made.pulses) == []
    # by an integrator that knows nothing of it: the spin axis itself points there
    flown = Outcome(body, made.pulses)
    axis = flown.motion.rotation @ np.array([0.0, 0.0, math.copysign(1.0, spin)])
    assert math.atan2(float(np.linalg.norm(np.cross(axis, body.target_axis))), float(axis @ body.target_axis)) < 1e-8
    # |dH/dt| <= |M|: no schedule turns H with less
    assert made.pulses.total_impulse >= max(body.least_impulse, body.turning_impulse) * (1 - 1e-9)
    assert made.pulses.bounds is not None
    assert made.pulses.bounds.first_order is not None
    assert made.pulses.cost <= 1.03 * made.pulses.bounds.first_order


def spin_thrusters() -> tuple[Channel, ...]:
    pair = (channel("spin up", 0.0, 0.0, 6.0, min_on_time=0.02), channel("spin down", 0.0, 0.0, -6.0, min_on_time=0.02))
    return (*thrusters(), *pair)


@pytest.mark.deep
@pytest.mark.parametrize("spin", [3.0, -3.0])
@spread("factor", [0.7, 1.0, 1.02, 1.4], quick=2)
def test_the_spin_ends_as_asked(spin: float, factor: float) -> None:
    body = spinner(spin=spin, channels=spin_thrusters(), limits=Limits(horizon=90.0))
    body = with_goal(body, spin=spin * factor)
    made = plan(body, "optimal")
    assert made.flown is not None, infeasibility(made)
    assert max(made.flown.nutation, made.flown.momentum_shift) < MICRODEGREE
    flown = Outcome(body, made.pulses)
    assert flown.spin == pytest.approx(spin * factor, abs=1e-7)
    assert flown.nutation < 1e-8
    assert flown.shift < 1e-8


def test_three_moments_end_at_the_spin_asked_for_too() -> None:
    """The model that is planned on is symmetric; the last trim on the true body knows of the spin."""
    skew = tuple(
        channel(f"T{k}", 8 * math.cos(0.4 + k), 8 * math.sin(0.4 + k), 0.8 * (-1) ** k, min_on_time=0.02)
        for k in range(6)
    )
    body = spinner(moments=(120, 110, 80), channels=(*skew, *spin_thrusters()[-2:]), limits=Limits(horizon=90.0))
    made = plan(with_goal(body, spin=3.1), "optimal")
    assert made.flown is not None, infeasibility(made)
    assert max(made.flown.nutation, made.flown.momentum_shift) < MICRODEGREE
    assert Outcome(body, made.pulses).spin == pytest.approx(3.1, abs=1e-8)


def test_skew_thrusters_can_keep_the_spin() -> None:
    """Each pushes the spin a little; left to themselves they change it."""
    skew = tuple(
        channel(f"T{k}", 8 * math.cos(0.4 + k), 8 * math.sin(0.4 + k), 0.8 * (-1) ** k, min_on_time=0.02)
        for k in range(6)
    )
    body = spinner(channels=skew, limits=Limits(horizon=60.0))
    kept = plan(with_goal(body, spin=3.0), "optimal")
    assert kept.spin_change == pytest.approx(0.0, abs=1e-8)
    assert kept.flown is not None
    assert max(kept.flown.nutation, kept.flown.momentum_shift) < MICRODEGREE


def test_without_axial_torque_a_spin_is_refused_with_its_reason() -> None:
    made = plan(with_goal(spinner(channels=thrusters()), spin=3.5), "optimal")
    assert "axis 3" in infeasibility(made)


@pytest.mark.parametrize("shift", [0.1, 0.5])
def test_h_may_end_off_its_target_and_that_saves(shift: float) -> None:
    body = spinner(channels=thrusters(), limits=Limits(horizon=5.0))
    kept = plan(body, "optimal")
    loose = plan(body, "optimal", Options(shift=math.radians(shift)))
    assert loose.flown is not None
    assert kept.flown is not None
    assert loose.flown.nutation < MICRODEGREE
    assert loose.flown.momentum_shift <= math.radians(shift) + MICRODEGREE
    assert loose.pulses.total_impulse <= kept.pulses.total_impulse * 1.001


@pytest.mark.deep
def test_least_time_ends_sooner_and_nothing_ends_much_sooner() -> None:
    body = spinner(channels=thrusters(), limits=Limits(horizon=60.0))
    soon, cheap = (plan(body, "optimal", Options(least=what)) for what in ("time", "propellant"))
    assert soon.flown is not None
    assert max(soon.flown.nutation, soon.flown.momentum_shift) < MICRODEGREE
    assert soon.pulses.end < cheap.pulses.end
    assert soon.pulses.total_impulse >= cheap.pulses.total_impulse * (1 - 1e-9)
    sooner = replace(body, limits=Limits(horizon=0.9 * soon.pulses.end))
    assert plan(sooner, "optimal").schedule is None


@pytest.mark.parametrize("free", [False, True])
def test_least_pulses_fires_as_seldom_as_the_equations_allow(free: bool) -> None:
    body = spinner(channels=cross(40.0), limits=Limits(horizon=60.0))
    made = plan(body, "optimal", Options(least="pulses", free_axis=free))
    assert len(made.pulses) == (1 if free else 2)
    assert made.flown is not None
    assert made.flown.nutation < MICRODEGREE


@pytest.mark.deep
def test_ticks_together_leave_no_more_than_half_a_tick_of_one_pulse() -> None:
    """At their best moments all pulses change the nutation by the same steps, so that half a step may stay."""
    body = spinner(channels=thrusters(), limits=Limits(horizon=60.0, tick=0.01))
    made = plan(body, "optimal")
    assert len(made.pulses) > 4
    assert violations(body, made.pulses) == []
    assert made.flown is not None
    half_a_step = 0.5 * 0.01 * 8.0 / (80.0 * 3.0)
    assert max(made.flown.nutation, made.flown.momentum_shift) < 1.1 * half_a_step
