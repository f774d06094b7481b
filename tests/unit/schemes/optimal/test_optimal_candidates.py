"""What the scheme optimal compares its search with: variants of other schemes, H kept, and what rounding can leave."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.builders import Outcome, aimed, cross, spinner
from support.cases import spread
from support.checker import violations
from support.places import case
from test_optimal import random_layout

from nutdamp.compliance import SAME_COST
from nutdamp.files.spacecraft_file import load_spacecraft
from nutdamp.planning import plan
from nutdamp.remarks import infeasibility
from nutdamp.schemes import Options
from nutdamp.schemes.optimal import candidates, search
from nutdamp.spacecraft import Limits, Spacecraft

MICRODEGREE = math.radians(1e-6)


@pytest.mark.deep
def test_a_far_target_costs_no_more_than_a_train_that_the_user_finds() -> None:
    """19.1 N m s, where rhumb-line --per-turn 2 --on-time 7ms takes 18.0; C|ω3|β is 17.92."""
    body = aimed(load_spacecraft(case("optimal-far-target.yaml")), 120.0, 87.29)
    train = plan(body, "rhumb-line", Options(per_turn=2, on_time=7e-3))
    made = plan(body, "optimal")
    assert made.flown is not None
    assert max(made.flown.nutation, made.flown.axis_error) < MICRODEGREE
    assert made.pulses.total_impulse <= 1.002 * train.pulses.total_impulse
    assert violations(body, made.pulses) == []


@pytest.mark.deep
def test_trains_are_tried_without_the_sun_and_within_on_times() -> None:
    body = aimed(spinner(channels=cross(20.0, min_on_time=0.05, max_on_time=0.4), limits=Limits(horizon=150.0)), 60, 10)
    sunny = replace(body, goal=replace(body.goal, sun=np.array([1.0, 0.0, 0.0])))
    pairs = zip(*(candidates.by_other_schemes(each, shift=True) for each in (body, sunny)), strict=True)
    for one, other in pairs:
        assert [pulse.t for pulse in one] == [pulse.t for pulse in other]
        assert violations(body, one) == []


@pytest.fixture
def as_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the search over the whole horizon finds, not what ends earlier and costs up to 0.1 % more."""
    monkeypatch.setattr(search, "hastened", lambda _problem, best, *_: best)


@pytest.mark.usefixtures("as_found")
@spread("seed", [1, 9, 14, 38], quick=1)
def test_a_free_axis_never_costs_more_than_h_kept(seed: int) -> None:
    """The search alone was up to 0.7 % dearer with more freedom."""
    body = random_layout(seed)
    kept, free = (plan(body, "optimal", Options(free_axis=free)) for free in (False, True))
    assert free.flown is not None
    assert free.flown.nutation < MICRODEGREE
    assert free.pulses.cost <= kept.pulses.cost * (1.0 + 1e-6)


@pytest.mark.deep
@pytest.mark.usefixtures("as_found")
@pytest.mark.parametrize("seed", range(40))
def test_a_free_axis_never_costs_more_than_h_kept_in_many_layouts(seed: int) -> None:
    test_a_free_axis_never_costs_more_than_h_kept(seed)


@spread("seed", [1, 4, 36], quick=1)
def test_a_free_axis_that_ends_earlier_costs_as_much_within_what_counts_as_equal(seed: int) -> None:
    body = random_layout(seed)
    kept, free = (plan(body, "optimal", Options(free_axis=free)) for free in (False, True))
    assert free.pulses.cost <= kept.pulses.cost * (1.0 + SAME_COST)


@pytest.mark.deep
@pytest.mark.usefixtures("as_found")
@spread("shift", [0.05, 1.0], quick=1)
def test_a_shift_allowed_never_costs_more_than_none(shift: float) -> None:
    for seed in (0, 14):
        body = random_layout(seed)
        kept, loose = plan(body, "optimal"), plan(body, "optimal", Options(shift=math.radians(shift)))
        assert loose.flown is not None
        assert loose.flown.momentum_shift <= math.radians(shift) + MICRODEGREE
        assert loose.pulses.cost <= kept.pulses.cost * (1.0 + 1e-6)


@pytest.mark.deep
def test_what_the_gap_forbids_is_not_told_as_rounding() -> None:
    """Two pulses that left 4.47° of 5° were called feasible, where four-pulse leaves 2.16°."""
    made = plan(load_spacecraft(case("optimal-tick.yaml")), "optimal")
    assert made.schedule is None
    assert "gap of 1.4 s" in infeasibility(made)


def ticked(seed: int) -> Spacecraft:
    body, rng = random_layout(seed), np.random.default_rng(seed)
    tick, gap = float(rng.choice([1e-3, 5e-3])), float(rng.choice([0.0, 0.3]))
    return replace(body, limits=replace(body.limits, tick=tick, gap=gap))


@spread("seed", range(8), quick=1)
def test_on_ticks_only_rounding_stays(seed: int) -> None:
    """Half a tick of every start and on-time, as independent errors, by the reference integrator."""
    body = ticked(seed)
    tick = body.limits.tick
    assert tick is not None
    made = plan(body, "optimal")
    if made.schedule is None:
        assert f"ticks of {tick:.4g} s" in infeasibility(made)
        return
    flown = Outcome(body, made.pulses)
    rate = max(abs(body.spin), abs(body.inertia.a * body.spin))
    errors = [
        0.5 * tick * part for pulse in made.pulses for part in (pulse.magnitude * rate, pulse.magnitude / pulse.on_time)
    ]
    assert max(flown.nutation, flown.shift) <= math.hypot(*errors) / (body.inertia.C * abs(body.spin))
    assert violations(body, made.pulses) == []


@pytest.mark.deep
def test_with_three_moments_impulse_is_that_of_the_true_thrusters() -> None:
    """The model that is planned on has torques stretched by some per cent; its costs are not."""
    body = spinner(moments=(120.0, 110.0, 80.0), channels=cross(8.0, max_on_time=2.0), limits=Limits(horizon=60.0))
    priced = replace(
        body,
        channels=tuple(
            replace(one, thrusters=tuple(replace(each, isp=220.0, thrust=8.0) for each in one.thrusters))
            for one in body.channels
        ),
    )
    by_impulse, by_propellant = plan(body, "optimal").pulses, plan(priced, "optimal").pulses
    assert by_impulse.bounds is not None
    assert by_propellant.bounds is not None
    assert by_impulse.bounds.first_order is not None
    assert by_propellant.bounds.first_order is not None
    assert by_impulse.total_impulse / by_impulse.bounds.first_order == pytest.approx(
        by_propellant.cost / by_propellant.bounds.first_order, rel=1e-9
    )
