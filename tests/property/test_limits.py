"""Every scheme under any limits: a feasible plan keeps them all and comes nearer, an infeasible one says why."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from support.builders import aimed, cross, fan, spinner, within
from support.cases import spread
from support.checker import violations
from support.random_bodies import random_spacecraft

from nutdamp import planning
from nutdamp.remarks import infeasibility
from nutdamp.schemes import Options
from nutdamp.spacecraft import Disturbance, Limits, Spacecraft, Steerable

PATIENCE = 10_000_000
"""Calls of functions for one plan, which takes two million at most; so that an endless search fails, not hangs."""

DAMPING = {
    "one-pulse": ("one-pulse", Options()),
    "two-pulse": ("two-pulse", Options()),
    "two-pulse, literal": ("two-pulse", Options(literal=True)),
    "four-pulse": ("four-pulse", Options()),
    "four-pulse, coarse": ("four-pulse", Options(coarse=True)),
}
POINTING = ["two-pulse", "half-cone", "rhumb-line"]
damping = pytest.mark.parametrize("requested", DAMPING.values(), ids=DAMPING)


def check(body: Spacecraft, scheme: str, options: Options) -> None:
    with within(PATIENCE):
        plan = planning.plan(body, scheme, options)
        left, residual = plan.flown, plan.residual
        figures = (left, residual, plan.delta_v, plan.spin_change, plan.meets_requirement)
    assert plan.feasible == (infeasibility(plan) == "")
    if not plan.feasible:
        assert (len(plan.pulses), figures) == (0, (None,) * 5)
        return
    assert violations(body, plan.pulses) == []
    assert left is not None
    assert residual is not None
    for angles in (left, residual):
        assert np.isfinite([angles.nutation, angles.body_cone, angles.space_cone, angles.momentum_shift]).all()
    if body.inertia.symmetric and plan.spin_change is not None:
        # After a long wait the clock tells the width of a pulse to its own rounding only.
        axial = [(one.impulse[2], abs(one.impulse[2]) * 4 * np.spacing(one.end)) for one in plan.pulses]
        ticks = sum(slip / one.on_time for one, (_, slip) in zip(plan.pulses, axial, strict=True) if one.on_time)
        change, rounding = math.fsum(impulse for impulse, _ in axial), 1e-9 * abs(body.spin)
        assert plan.spin_change * body.inertia.C == pytest.approx(change, abs=rounding * body.inertia.C + ticks)
    if body.goal.axis is None:
        assert len(plan.pulses) == 2 if scheme == "two-pulse" else len(plan.pulses) > 0
        assert left.nutation < body.nutation
        assert plan.spin_change is not None
        return
    requested = body.nutation + body.to_turn
    assert left.nutation < body.nutation or left.axis_error < body.to_turn or requested < 1e-12
    if body.inertia.symmetric:
        assert max(left.nutation, left.axis_error) <= (0.05 if body.limits.tick is None else 0.5) * requested


@spread("requested", DAMPING.values(), quick=1, deep=2, ids=DAMPING)
@spread("block", range(20), quick=1, deep=2)
def test_whatever_the_limits(block: int, requested: tuple[str, Options]) -> None:
    """Seeds, not hypothesis: its examples change with every module that happens to be loaded."""
    for seed in range(10 * block, 10 * (block + 1)):
        check(random_spacecraft(np.random.default_rng(seed)), *requested)


@spread("scheme", POINTING, quick=1)
@spread("block", range(20), quick=1)
def test_whatever_the_limits_with_a_target(block: int, scheme: str) -> None:
    """Now and then a pure spin; targets from nothing to nearly opposite."""
    for seed in range(5 * block, 5 * (block + 1)):
        rng = np.random.default_rng(seed)
        body = random_spacecraft(rng)
        if rng.random() < 0.25:
            body = replace(body, omega0=body.omega0 * np.array([0.0, 0.0, 1.0]))
        tilt = float(rng.choice([0.0, 1e-3, 5.0, 30.0, rng.uniform(0.0, 179.0)]))
        cones = int(rng.integers(1, 5)) if rng.random() < 0.3 else None
        options = Options(per_turn=int(rng.integers(1, 4)), cones=cones)
        check(aimed(body, tilt, float(rng.uniform(-180.0, 180.0))), scheme, options)


HARD = {
    "tick as long as the horizon": Limits(tick=10.0, horizon=10.0),
    "tick longer than the horizon": Limits(tick=1e3, horizon=10.0),
    "tick of a nanosecond": Limits(tick=1e-9, earliest=1.0 / 3.0, blackout=((1.0, 2.0 / 3.0 + 1.0),)),
    "horizon too short for anything": Limits(horizon=1e-3),
    "earliest at the end": Limits(earliest=124.0),
    "earliest after the default horizon": Limits(earliest=1e9),
    "gap longer than the horizon": Limits(gap=1e6),
    "all dark": Limits(blackout=((0.0, 1e9),)),
    "hundred dark windows": Limits(blackout=tuple((0.7 * n, 0.7 * n + 0.6) for n in range(100))),
    "dark but for moments": Limits(blackout=tuple((0.7 * n, 0.7 * n + 0.69999) for n in range(1000))),
    "windows of no length": Limits(blackout=tuple((0.1 * n, 0.1 * n) for n in range(200))),
    "one pulse": Limits(max_pulses=1),
    "a year": Limits(horizon=3.2e7, gap=3600.0),
}


@spread("requested", DAMPING.values(), quick=1, ids=DAMPING)
@spread("hard", HARD.values(), quick=1, ids=HARD)
def test_awkward_limits(hard: Limits, requested: tuple[str, Options]) -> None:
    for actuators in (cross(20.0), cross(0.5, min_on_time=0.02, max_on_time=0.3), fan(16, 3.0)):
        check(spinner(channels=actuators, limits=hard), *requested)
    for torque in (None, 50.0, 0.5) if requested[0] != "four-pulse" else ():
        check(spinner(steerable=Steerable(torque), limits=hard), *requested)


@spread("scheme", POINTING, quick=1, deep=1)
@spread("hard", HARD.values(), quick=1, deep=2, ids=HARD)
def test_awkward_limits_with_a_target(hard: Limits, scheme: str) -> None:
    for actuators in ({"channels": cross(60.0)}, {"steerable": Steerable(60.0)}, {}):
        check(aimed(spinner(limits=hard, **actuators), 10.0, 45.0), scheme, Options())


@damping
def test_units_do_not_matter(requested: tuple[str, Options]) -> None:
    """Inertia and torques scaled together: the same pulses. Spin × s, torques × s²: the same pulses s times as fast."""
    plain = planning.plan(spinner(channels=cross(20.0)), *requested)
    for mass, rate in ((1e-12, 1.0), (1e9, 1.0), (1.0, 1e-6), (1.0, 1e3)):
        body = spinner(120.0 * mass, 80.0 * mass, 3.0 * rate, channels=cross(20.0 * mass * rate**2))
        scaled = planning.plan(body, *requested)
        assert scaled.feasible == plain.feasible
        for one, other in zip(plain.pulses, scaled.pulses, strict=True):
            assert other.channel == one.channel
            assert (other.t * rate, other.on_time * rate) == pytest.approx((one.t, one.on_time), rel=1e-8)


@pytest.mark.deep
@damping
@spread("degrees", [1e-9, 1e-6, 1e-3, 70.0, 89.0], quick=2)
def test_nutation_from_next_to_nothing_to_next_to_a_right_angle(degrees: float, requested: tuple[str, Options]) -> None:
    for C, spin in ((40.0, 3.0), (80.0, -3.0), (120.0, 3.0), (240.0, -3.0)):
        torque = spinner(120.0, C, spin, degrees).least_impulse * 3.0
        check(spinner(120.0, C, spin, degrees, channels=cross(torque)), *requested)
        if requested[0] != "four-pulse":
            check(spinner(120.0, C, spin, degrees, steerable=Steerable(torque)), *requested)


@pytest.mark.deep
def test_many_channels() -> None:
    for requested in DAMPING.values():
        check(spinner(channels=fan(24, 4.0)), *requested)


@spread("requested", [DAMPING[name] for name in ("one-pulse", "two-pulse", "two-pulse, literal")], quick=1)
@spread("torque", [30.0, 100.0], quick=1)
@spread("moments", [(120.0, 100.0, 80.0), (80.0, 70.0, 120.0)], quick=1, ids=["prolate", "oblate"])
def test_torquer_on_a_body_of_three_different_moments_keeps_the_limits(
    moments: tuple[float, float, float], torque: float, requested: tuple[str, Options]
) -> None:
    """Going from the symmetric model to the body changes on-times, and must not move starts out of the limits."""
    ticks, late, dark = {"tick": 0.01}, {"earliest": 2.0}, {"blackout": ((0.0, 3.0),)}
    for limits in (Limits(**ticks), Limits(**late), Limits(earliest=2.0, tick=0.1), Limits(**dark)):
        plan = planning.plan(spinner(moments=moments, steerable=Steerable(torque), limits=limits), *requested)
        assert plan.feasible, infeasibility(plan)
        assert violations(plan.spacecraft, plan.pulses) == []


TRUE_BODIES = {
    "I1 ≠ I2": spinner(moments=(120.0, 100.0, 80.0), degrees=4.0),
    "axial disturbance": replace(spinner(degrees=4.0), disturbances=(Disturbance(0.0j, 0.05),)),
    "dissipation": replace(spinner(degrees=4.0), dissipation=300.0),
}


def check_ends_on_the_target(body: Spacecraft, scheme: str, options: Options | None = None) -> None:
    plan = planning.plan(body, scheme, options)
    assert plan.flown is not None, infeasibility(plan)
    assert max(plan.flown.nutation, plan.flown.axis_error) < 1e-9


@spread("scheme", POINTING, quick=1)
@spread("true_body", TRUE_BODIES.values(), quick=1, ids=TRUE_BODIES)
def test_what_the_model_does_not_know_is_trimmed(true_body: Spacecraft, scheme: str) -> None:
    for body in (replace(true_body, channels=cross(60.0)), replace(true_body, steerable=Steerable(60.0))):
        check_ends_on_the_target(aimed(body, 12.0, 45.0), scheme, Options(with_disturbances=True))


@pytest.mark.weekly
@pytest.mark.parametrize("scheme", POINTING)
def test_unlimited_cases_end_on_the_target(scheme: str) -> None:
    """Strong channels and time: nothing is in the way."""
    rng = np.random.default_rng(7)
    for spin in (3.0, -3.0) * 6:
        C, degrees = float(rng.choice([60.0, 80.0, 140.0])), float(rng.uniform(0.0, 10.0))
        body = spinner(120.0, C, spin, degrees, channels=cross(400.0))
        check_ends_on_the_target(aimed(body, float(rng.uniform(1.0, 40.0)), float(rng.uniform(-180, 180))), scheme)


@pytest.mark.weekly
@pytest.mark.parametrize("scheme", ["half-cone", "rhumb-line"])
@pytest.mark.parametrize("horizon", [0.6, 1.5, 6.0])
def test_the_horizon_that_is_named_is_long_enough_for_the_whole_plan(scheme: str, horizon: float) -> None:
    """What was named covered the pulses that damp the nutation first, and the way to the target had no room."""
    body = aimed(spinner(channels=cross(20.0, max_on_time=2.0), limits=Limits(horizon=horizon)), 20.0, 45.0)
    why = infeasibility(planning.plan(body, scheme))
    named = re.search(r"limits\.horizon = (\S+) s is long enough$", why)
    assert named is not None, why
    assert planning.plan(replace(body, limits=Limits(horizon=float(named[1]))), scheme).feasible
    assert all(float(number) == horizon for number in re.findall(r"horizon of (\S+) s", why)), why
