"""Schemes with a target under any limits: they keep them all and come nearer, or say why not."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from support.builders import aimed, cross, spinner, within
from support.cases import spread
from support.checker import violations
from test_limits import HARD, PATIENCE, random_spacecraft

from nutdamp import planning
from nutdamp.remarks import infeasibility
from nutdamp.schemes import Options
from nutdamp.spacecraft import Disturbance, Limits, Spacecraft, Steerable

SCHEMES = ["two-pulse", "half-cone", "rhumb-line"]


def random_aim(seed: int) -> tuple[Spacecraft, Options]:
    """Now and then a pure spin; targets from nothing to nearly opposite."""
    rng = np.random.default_rng(seed)
    body = random_spacecraft(rng)
    if rng.random() < 0.25:
        body = replace(body, omega0=body.omega0 * np.array([0.0, 0.0, 1.0]))
    tilt = float(rng.choice([0.0, 1e-3, 5.0, 30.0, rng.uniform(0.0, 179.0)]))
    cones = int(rng.integers(1, 5)) if rng.random() < 0.3 else None
    options = Options(per_turn=int(rng.integers(1, 4)), cones=cones)
    return aimed(body, tilt, float(rng.uniform(-180.0, 180.0))), options


def check(body: Spacecraft, scheme: str, options: Options) -> None:
    with within(PATIENCE):
        plan = planning.plan(body, scheme, options)
        left = plan.flown
    if not plan.feasible:
        assert infeasibility(plan)
        assert len(plan.pulses) == 0
        return
    assert left is not None
    assert violations(body, plan.pulses) == []
    requested = body.nutation + body.to_turn
    assert left.nutation < body.nutation or left.axis_error < body.to_turn or requested < 1e-12
    if body.inertia.symmetric:
        assert max(left.nutation, left.axis_error) <= (0.05 if body.limits.tick is None else 0.5) * requested


@spread("scheme", SCHEMES, quick=1)
@spread("block", range(20), quick=1)
def test_whatever_the_limits(block: int, scheme: str) -> None:
    for seed in range(5 * block, 5 * (block + 1)):
        body, options = random_aim(seed)
        try:
            check(body, scheme, options)
        except BaseException as failure:
            failure.add_note(f"seed {seed}: {options} {body}")
            raise


@spread("scheme", SCHEMES, quick=1, deep=2)
@spread("hard", HARD.values(), quick=1, deep=2, ids=HARD)
def test_awkward_limits(hard: Limits, scheme: str) -> None:
    for requested in ({"channels": cross(60.0)}, {"steerable": Steerable(60.0)}, {}):
        check(aimed(spinner(limits=hard, **requested), 10.0, 45.0), scheme, Options())


@pytest.mark.weekly
@spread("scheme", SCHEMES, quick=1, deep=2)
@spread("spin", [3.0, -3.0], quick=1, deep=2)
def test_most_unlimited_cases_end_on_the_target(scheme: str, spin: float) -> None:
    """Strong channels and time: nothing is in the way."""
    rng = np.random.default_rng(7)
    for _ in range(6):
        C = float(rng.choice([60.0, 80.0, 140.0]))
        body = spinner(120.0, C, spin, float(rng.uniform(0.0, 10.0)), channels=cross(400.0))
        body = aimed(body, float(rng.uniform(1.0, 40.0)), float(rng.uniform(-180.0, 180.0)))
        plan = planning.plan(body, scheme)
        assert plan.feasible, infeasibility(plan)
        assert plan.flown is not None
        assert max(plan.flown.nutation, plan.flown.axis_error) < math.radians(1e-7)


TRUE_BODIES = {
    "I1 ≠ I2": spinner(moments=(120.0, 100.0, 80.0), degrees=4.0),
    "axial disturbance": replace(spinner(degrees=4.0), disturbances=(Disturbance(0.0j, 0.05),)),
    "dissipation": replace(spinner(degrees=4.0), dissipation=300.0),
}


@spread("scheme", SCHEMES, quick=1)
@spread("true_body", TRUE_BODIES.values(), quick=1, ids=TRUE_BODIES)
def test_what_the_model_does_not_know_is_trimmed(true_body: Spacecraft, scheme: str) -> None:
    for body in (replace(true_body, channels=cross(60.0)), replace(true_body, steerable=Steerable(60.0))):
        plan = planning.plan(aimed(body, 12.0, 45.0), scheme, Options(with_disturbances=True))
        assert plan.flown is not None, infeasibility(plan)
        assert max(plan.flown.nutation, plan.flown.axis_error) < 1e-9


@pytest.mark.weekly
@pytest.mark.parametrize("scheme", ["half-cone", "rhumb-line"])
@pytest.mark.parametrize("horizon", [0.6, 1.5, 6.0])
def test_the_horizon_that_is_named_is_long_enough_for_the_whole_plan(scheme: str, horizon: float) -> None:
    """What was named covered the pulses that damp the nutation first, and the way to the target had no room."""
    limits = Limits(horizon=horizon)
    body = aimed(spinner(120.0, 80.0, 3.0, 5.0, channels=cross(20.0, max_on_time=2.0), limits=limits), 20.0, 45.0)
    why = infeasibility(planning.plan(body, scheme))
    found = re.search(r"limits\.horizon = (\S+) s is long enough$", why)
    assert found is not None, why
    longer = replace(body, limits=replace(limits, horizon=float(found[1])))
    assert planning.plan(longer, scheme).feasible
    named = [float(number) for number in re.findall(r"horizon of (\S+) s", why)]
    assert all(one == horizon for one in named), why
