"""What is said of blocks that miss their target by a little, and what blocks of several legs carry on."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from support.spinners import FILE, some_body

from nutdamp import flight, planning
from nutdamp.commands import Block
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.outcome import left_by
from nutdamp.physics.feed import Cold, Tank
from nutdamp.schedule import Schedule
from nutdamp.schemes import Options
from nutdamp.schemes.command_block import Flown, Search
from nutdamp.schemes.tools.block_model import BlockModel, Trial
from nutdamp.schemes.tools.block_search import FLOWN, Found
from nutdamp.schemes.tools.sun_pulses import fired
from nutdamp.spacecraft import Limits, Requirement, Spacecraft
from nutdamp.supply import Supply

TEXT = (
    FILE.replace("delay_step: 2 ms", "delay_step: 200 ms").replace(
        "width: {step: 10 ms, min: 100 ms, max: 500 ms}", "width: [100 ms, 300 ms]"
    )
    + "goal: {right_ascension: 20 deg, declination: 82 deg}\n"
)
BODY = read_spacecraft(TEXT, "f.yaml")
TIGHT = replace(BODY, requirement=Requirement(math.radians(0.03), math.radians(0.01)))


def cures(body: Spacecraft, **options: int) -> str:
    plan = planning.plan(body, "command-block", Options(**options))
    assert plan.feasible
    assert not plan.meets_requirement
    (said,) = [note for note in plan.pulses.notes if note.startswith("to leave less: ")]
    return said


@pytest.mark.deep
def test_blocks_that_miss_say_which_steps_are_too_coarse() -> None:
    """A step of the delay is 0.2 s × 12 rpm = 14.4° of heading, on a way of 8° a move of 2°."""
    said = cures(TIGHT, max_blocks=1)
    assert "--max-blocks 3" in said
    assert "a finer commands.delay_step (0.2 s changes the end of H by 2°)" in said
    assert "finer widths in commands.width (one step of one pulse turns H by 0.13°)" in said
    assert "limits.horizon" not in said


def test_blocks_that_miss_for_want_of_time_say_so() -> None:
    said = cures(replace(TIGHT, limits=Limits(horizon=110.0)), max_blocks=1)
    assert "a longer limits.horizon (the blocks end at 106" in said


def test_blocks_that_comply_name_no_cure() -> None:
    plan = planning.plan(replace(BODY, requirement=Requirement(math.radians(1.0), math.radians(2.0))), "command-block")
    assert plan.meets_requirement
    assert not any("to leave less" in note for note in plan.pulses.notes)


TANK = Tank(1.0, 22e5, 8e5, 1.0)
FED = replace(BODY, cold=Cold(0.7, 4.0), tank=TANK)


def test_what_was_fired_before_counts_in_the_search_and_in_the_flight() -> None:
    """Blocks fired in two parts, the second by a body that carries on, are as strong as in one."""
    first, second = Block("T1", 1, 1.0, 0.3, 12), Block("T1", 14, 1.0, 0.3, 10)
    whole = fired(FED, (first, second)).pulses
    supply = Supply(FED)
    supply.count(whole[:12])
    later = supply.behind(FED)
    alone = fired(later, (replace(second, first=1),)).pulses
    assert [one.magnitude for one in alone] == pytest.approx([one.magnitude for one in whole[12:]], rel=1e-12)
    assert whole[12].magnitude != pytest.approx(whole[0].magnitude, rel=0.01)
    channel = FED.channels[0]
    model = BlockModel(later)
    full, used = model.full_pulses(model.start, channel, np.array([0.3]), np.array([10]))
    strength = float(np.linalg.norm(channel.torque)) * 0.3
    assert float(full[0]) == pytest.approx(sum(one.magnitude for one in whole[12:]) / strength, rel=1e-9)
    assert float(used[0]) == pytest.approx(sum(one.propellant or 0.0 for one in whole), rel=1e-9)


def test_the_closed_form_of_a_later_leg_is_its_flight() -> None:
    """12 pulses of a body whose pressure has fallen to half: without that the form would be off by half the way."""
    later = replace(FED, cold=Cold(0.7, 4.0, {"T1": 40}), tank=replace(TANK, used=0.6))
    model = BlockModel(later)
    state = model.after(model.start, later.channels[0], Trial(0, 1.0, 0.3, 12, 1))
    found = left_by(flight.flown(later, fired(later, (Block("T1", 1, 1.0, 0.3, 12),))))
    assert float(model.left(state).aim) == pytest.approx(found.aim, abs=2e-3 * FED.to_turn)
    fresh = BlockModel(FED)
    off = fresh.left(fresh.after(fresh.start, FED.channels[0], Trial(0, 1.0, 0.3, 12, 1))).aim
    assert abs(float(off) - found.aim) > 0.02 * FED.to_turn


def test_a_supply_counts_what_was_fired() -> None:
    supply = Supply(FED)
    supply.count(Schedule())
    assert (supply.fired, supply.used) == (Counter(), 0.0)


@pytest.mark.weekly
def test_where_the_first_dozen_miss_sequences_of_smaller_pulses_are_flown_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """A body of which the best in closed form fly badly: 4.5 times the bound without those more, now less than half."""
    body = replace(some_body(2), requirement=Requirement(math.radians(0.1), math.radians(0.1)))
    fired_: list[float] = []
    flown = Search.flown

    def counted(self: Search, found: Found) -> Flown:
        made = flown(self, found)
        fired_.append(made.rank[1])
        return made

    monkeypatch.setattr(Search, "flown", counted)
    plan = planning.plan(body, "command-block")
    assert len(fired_) > FLOWN
    assert plan.severity == pytest.approx(min(fired_))
    assert plan.severity < 2.0
