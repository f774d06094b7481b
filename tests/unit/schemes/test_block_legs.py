"""Spin and turn in one row of blocks: flown by the reference, in the cheaper order, and refused with a reason."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support import reference
from support.builders import channel, codes, present
from support.cases import spread
from support.golden import check_text
from support.spinners import flown_by_reference, some_body

from nutdamp.planning import plan as planning
from nutdamp.planning.notes import infeasibility
from nutdamp.schemes.block_search import BLOCKS
from nutdamp.schemes.catalogue import Options
from nutdamp.schemes.command_block import LEGS
from nutdamp.spacecraft.model import Goal, Limits, Requirement, Spacecraft
from nutdamp.spacecraft.requirements import spin_tolerance

NUTATION, SHIFT = math.radians(1.0), math.radians(0.5)


def body_of(seed: int, change: float | None = None) -> Spacecraft:
    """A spinner that is to turn, and to spin at 0.7 to 1.4 times its rate.

    Of three kinds: channels of pure torques; turning ones with up to 5 % about axis 3; spinning ones with some across.
    """
    body, rng = some_body(seed), np.random.default_rng(1000 + seed)
    change = rng.uniform(0.7, 1.4) if change is None else change
    axial = abs(body.axial) * 0.3 / (40.0 * float(present(body.commands).widths[-1]))
    turning, across = list(body.channels), (0.0, 0.0)
    if seed % 3 == 1:
        turning = [channel(each.name, *each.torque[:2], rng.uniform(-0.05, 0.05) * each.strength) for each in turning]
    if seed % 3 == 2:
        across = rng.uniform(-0.1, 0.1, 2).tolist()
    spinning = [
        channel(name, *(axial * each for each in across), sense * axial) for name, sense in (("U", 1), ("D", -1))
    ]
    goal = replace(body.goal, spin=body.spin * change)
    return replace(body, channels=(*turning, *spinning), goal=goal, requirement=Requirement(NUTATION, SHIFT))


def planned(body: Spacecraft, options: Options | None = None) -> planning.Plan:
    plan = planning.plan(body, "command-block", options)
    assert plan.feasible, infeasibility(plan)
    return plan


@spread("seed", range(24), quick=3, deep=4)
def test_spin_and_turn_end_as_required_when_flown_by_the_reference(seed: int) -> None:
    """Euler's equations by DOP853, Sun pulses as their roots: nutation, axis and spin, and the moment of each pulse."""
    plan = planned(body_of(seed))
    body, moments = plan.spacecraft, plan.spacecraft.inertia.moments
    assert plan.meets_requirement
    assert "blocks-in-legs" in codes(plan.pulses.notes)
    assert 2 <= len(plan.pulses.blocks) <= LEGS * BLOCKS
    motion, starts = flown_by_reference(body, plan.pulses.blocks)
    assert [pulse.start for pulse in plan.pulses] == pytest.approx(starts, abs=1e-7)
    assert reference.nutation(moments, motion.rates, math.copysign(1.0, body.spin)) <= NUTATION + 1e-7
    assert reference.angle(reference.momentum(moments, motion), body.target_axis) <= SHIFT + 1e-7
    assert abs(motion.rates[2] - present(body.goal.spin)) <= spin_tolerance(body, present(body.goal.spin)) + 1e-9


@spread("seed", [0, 3, 6, 12, 15, 18], quick=1, deep=2)
def test_h_is_turned_while_it_is_small(seed: int) -> None:
    """Before the spin is raised, after it is lowered; pure torques add nothing else, so the first order does."""
    for change, last in ((1.3, True), (0.77, False)):
        body = body_of(seed, change)
        blocks = planned(body).pulses.blocks
        spinning = {"U", "D"}
        assert (blocks[-1].channel in spinning) is last
        assert (blocks[0].channel in spinning) is not last


def test_nutation_is_damped_and_the_spin_set_without_a_target() -> None:
    body = replace(body_of(12), requirement=Requirement(math.radians(0.1)))
    body = replace(body, goal=Goal(spin=body.goal.spin))
    assert body.nutation > math.radians(0.1)
    plan = planned(body)
    assert plan.meets_requirement
    motion, _ = flown_by_reference(body, plan.pulses.blocks)
    left = reference.nutation(body.inertia.moments, motion.rates, math.copysign(1.0, body.spin))
    assert left <= math.radians(0.1) + 1e-7


def test_the_spin_that_a_turn_spoils_is_mended_by_a_last_leg() -> None:
    """The goal is the spin of today; the turning channel takes it off by more than is allowed."""
    body = body_of(0)
    skew = [channel(each.name, *each.torque[:2], 0.05 * each.strength) for each in body.channels[:4]]
    body = replace(body, channels=(*skew, *body.channels[4:]), goal=replace(body.goal, spin=body.spin))
    plan = planned(body)
    assert plan.meets_requirement
    assert plan.pulses.blocks[-1].channel in {"U", "D"}
    turn = math.fsum(pulse.impulse[2] for pulse in plan.pulses if pulse.channel not in {"U", "D"})
    assert abs(turn / body.inertia.C) > spin_tolerance(body, body.spin)


def test_a_number_of_blocks_is_kept() -> None:
    body = body_of(12)
    assert len(planned(body, Options(max_blocks=2)).pulses.blocks) == 2


def test_where_the_spin_cannot_be_set_the_reason_is_said() -> None:
    body = body_of(0, 1.2)
    only_down = [each for each in body.channels if each.name != "U"]
    flat = [channel(each.name, *each.torque[:2], 0.2 * each.strength) for each in body.channels[:4]]
    cases = {
        "reversed": replace(body, goal=replace(body.goal, spin=-body.spin)),
        "no torque about axis 3": replace(body, channels=body.channels[:4]),
        "the other sense": replace(body, channels=tuple(only_down)),
        "mostly across": replace(body, channels=tuple(flat)),
        "no time": replace(body, limits=Limits(horizon=2.0 * math.pi / abs(body.spin))),
    }
    plans = {name: planning.plan(each, "command-block") for name, each in cases.items()}
    assert all(plan.failure is None and not plan.feasible for plan in plans.values())
    check_text("blocks.no-spin", "\n".join(f"{name}: {infeasibility(plan)}" for name, plan in plans.items()))
