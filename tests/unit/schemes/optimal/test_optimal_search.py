"""What optimal tries beside its linear program: other horizons, ends and schemes, H kept, pulses side by side."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from support import places
from support.builders import aimed, cross, pulse, spinner
from support.cases import deep, weekly
from support.checker import violations
from support.golden import check_text
from support.optimal import as_found, flies, random_layout
from support.places import case

import nutdamp
from nutdamp import work
from nutdamp.compliance import DAMPED_ANGLE, SAME_COST
from nutdamp.files.spacecraft_file import load_spacecraft, read_spacecraft
from nutdamp.planning import plan
from nutdamp.remarks import infeasibility
from nutdamp.schedule import Schedule
from nutdamp.schemes import SCHEMES, Options, two_pulse
from nutdamp.schemes.optimal import candidates, repair
from nutdamp.schemes.optimal.columns import Burn
from nutdamp.schemes.optimal.problem import DEARER, Problem
from nutdamp.schemes.optimal.search import HALVINGS, _Search
from nutdamp.schemes.options import OptimalOptions, SchemeOptions, TwoPulseOptions
from nutdamp.schemes.tools import least_squares
from nutdamp.schemes.tools.reasons import bounded_by, no_channels
from nutdamp.spacecraft import Goal, Limits

BODY = spinner(channels=cross(8.0), limits=Limits(horizon=400.0))
"""400 s are 128 inertial nutation periods, so that the horizon can be halved six times."""

NOTHING_DAMPS = case("nothing-damps.yaml").read_text(encoding="utf-8")
PLAIN = OptimalOptions()


def settle(monkeypatch: pytest.MonkeyPatch, schedules: dict[float, Schedule]) -> list[float]:
    """Let the program lead to ``schedules`` within each horizon, else to nothing; the horizons that were looked at."""
    tried: list[float] = []

    def settled(self: _Search, _: float) -> Schedule | None:
        tried.append(self.spacecraft.horizon)
        return schedules.get(self.spacecraft.horizon)

    monkeypatch.setattr(_Search, "settled", settled)
    return tried


def dearer(made: Schedule, share: float) -> Schedule:
    return Schedule(tuple(replace(one, on_time=one.on_time * share, impulse=one.impulse * share) for one in made))


@pytest.mark.deep
def test_other_horizons_and_schemes_are_tried_where_the_program_leads_nowhere_or_is_dear(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Halved down to a period; where what is found is dear, three times or until one is not."""
    search, pair = _Search(BODY, PLAIN), two_pulse.schedule(BODY, TwoPulseOptions())
    first = search.program().solve()
    for known in ({400.0: dearer(pair, 2.0)}, {}):
        tried = settle(monkeypatch, known)
        made = search.programmed(first)
        assert made is not None
        assert search.price(made) <= search.price(pair) * (1.0 + 1e-9)  # another scheme was the start
    halves = int(math.log2(400.0 / BODY.inertial_period))
    assert tried == [400.0 * 0.5**turn for turn in range(halves + 1)]
    assert halves > HALVINGS
    monkeypatch.setattr(_Search, "others", lambda *_: None)
    dear = {400.0 * 0.5**turn: dearer(pair, 3.0 - 0.1 * turn) for turn in range(7)}
    tried = settle(monkeypatch, dear)
    assert search.programmed(first) is dear[50.0]
    assert tried == [400.0, 200.0, 100.0, 50.0]
    cheap = dearer(pair, (1.0 + 0.5 * DEARER) * first.cost / search.price(pair))
    tried = settle(monkeypatch, {400.0: dearer(cheap, 2.0), 200.0: cheap})
    assert search.programmed(first) is cheap
    assert tried == [400.0, 200.0]


@pytest.mark.parametrize(("tick", "named"), [(None, False), (0.01, True)])
def test_ticks_are_among_the_limits_named_where_the_file_sets_them(tick: float | None, named: bool) -> None:
    body = replace(BODY, limits=replace(BODY.limits, tick=tick))
    brief = replace(body, channels=cross(8.0, min_on_time=500.0))
    for said in (bounded_by(body), Problem(body, PLAIN).not_found(), no_channels(brief)):
        assert ("tick" in said) is named


@pytest.mark.parametrize(
    ("name", "latest"),
    [deep("lunar-prospector", 19.0), weekly("magnus-a09", 12.0), weekly("single-thruster", 68.0), deep("", math.inf)],
)
def test_an_earlier_end_costs_and_leaves_as_much_and_takes_no_more_pulses(name: str, latest: float) -> None:
    """80 % of the end of what the whole horizon gives; the example takes one more linear program and no flights."""
    body = nutdamp.load(places.CONFIGS / f"{name}.yaml") if name else nutdamp.example()
    with work.budget("with", 1e9) as spent:
        made = plan(body, "optimal")
    with as_found(), work.budget("without", 1e9) as without:
        before = plan(body, "optimal")
    assert made.flown is not None
    assert before.flown is not None
    assert made.end <= min(latest, 0.8 * before.end) if name else made.end == before.end
    assert name or spent.done - without.done < 6.0
    assert len(made) <= len(before)
    assert made.pulses.cost <= before.pulses.cost * (1.0 + SAME_COST)
    assert made.flown.nutation <= before.flown.nutation + DAMPED_ANGLE


@pytest.mark.weekly
def test_a_far_target_costs_no_more_than_a_train_that_the_user_finds() -> None:
    """19.1 N m s, where rhumb-line --per-turn 2 --on-time 7ms takes 18.0; C|ω3|β is 17.92."""
    body = aimed(load_spacecraft(case("optimal-far-target.yaml")), 120.0, 87.29)
    train = plan(body, "rhumb-line", Options(per_turn=2, on_time=7e-3))
    assert flies(body).pulses.total_impulse <= 1.002 * train.pulses.total_impulse


@pytest.mark.weekly
def test_trains_are_tried_without_the_sun_and_within_on_times() -> None:
    body = aimed(spinner(channels=cross(20.0, min_on_time=0.05, max_on_time=0.4), limits=Limits(horizon=150.0)), 60, 10)
    sunny = replace(body, goal=replace(body.goal, sun=np.array([1.0, 0.0, 0.0])))
    for one, other in zip(*(candidates.by_other_schemes(each, shift=True) for each in (body, sunny)), strict=True):
        assert [pulse.t for pulse in one] == [pulse.t for pulse in other]
        assert violations(body, one) == []


@pytest.mark.deep
@pytest.mark.parametrize(
    ("degrees", "changed", "most"),
    [
        (6, "", 1.03),
        weekly(8, "", 1.03),
        weekly(8, "limits: {gap: 100 ms}\n", 1.09),
        weekly(8, "limits: {tick: 1 ms}\n", 1.03),
    ],
)
def test_several_short_pulses_in_each_half_turn_damp(degrees: int, changed: str, most: float) -> None:
    """Pulses of 0.2 s, where 0.4 s are needed in each half turn of 8 deg: one at a time leaves 4 of them."""
    body = read_spacecraft(NOTHING_DAMPS.replace("8 deg", f"{degrees} deg") + changed, "nothing-damps.yaml")
    made = flies(body, left=1e-4 if body.limits.tick else 1e-8, dearest=most).pulses
    each = ([one for one in made if one.channel == name] for name in {one.channel for one in made})
    pauses = [after.start - before.end for pulses in each for before, after in itertools.pairwise(pulses)]
    assert min(pauses) > max(0.9 * max(one.min_on_time for one in body.channels), body.limits.gap - 1e-9)
    assert plan(body, "four-pulse").severity > math.radians(degrees - 4.2)


@pytest.mark.parametrize(("longest", "gap", "shortest"), [(0.3, 0.0, 0.0), (0.21, 0.1, 0.0), (0.5, 0.02, 0.13)])
def test_no_slots_are_left_that_join_to_more_than_a_pulse_may_last(longest: float, gap: float, shortest: float) -> None:
    body = spinner(channels=cross(8.0, min_on_time=shortest, max_on_time=longest), limits=Limits(horizon=30.0, gap=gap))
    program = Problem(body, PLAIN).program()
    long = tuple(Burn(body.channels[1], t, on) for t, on in ((2.0, 1.1), (5.3, 0.7), (17.0, 2.0)))
    assert repair._divide(program, (*long, Burn(body.channels[0], 9.0, 0.9 * longest)))
    assert not program.forbidden[[0, 2, 3]].any()  # nothing is too long there
    runs = [(key, len(list(group))) for key, group in itertools.groupby(program.forbidden[1].tolist())]
    assert max(count for key, count in runs if not key) * program.width <= longest + 1e-12
    assert min(count for key, count in runs[1:-1] if key) * program.width >= max(gap, shortest) - 1e-12
    for burn in long:  # time is left for it from its begin to its end, and a half of it beside it
        near = np.abs(program.centres - burn.t) <= 0.75 * burn.on_time
        assert np.count_nonzero(~program.forbidden[1] & near) * program.width >= 0.6 * burn.on_time


@pytest.mark.deep
def test_a_schedule_is_taken_down_on_the_true_motion_and_leaves_nothing() -> None:
    body = random_layout(153)
    search = _Search(body, PLAIN)
    before = search.programmed(search.program().solve())
    assert before is not None
    after = search.cheapened(before)
    assert after is not None
    assert search.price(after) < search.price(before) * (1.0 - 1e-4)
    assert [one.channel for one in after] == [one.channel for one in before]
    assert math.degrees(search.left(search.flown(after))) < 1e-9
    ticked = _Search(replace(body, limits=replace(body.limits, tick=1e-3)), PLAIN)
    assert ticked.cheapened(before) is before  # ticks decide what a schedule leaves


@pytest.mark.parametrize(
    ("scheme", "spin", "free", "corrected"),
    [
        ("optimal", None, 4, (-4, -3, -2, -1)),
        ("optimal", 3.1, 4, (-4, -3, -2, -1, 1)),
        ("optimal", 3.1, 2, (-2, -1)),
        ("two-pulse", 3.1, 4, (-4, -3, -2, -1)),
        ("one-pulse", 3.1, 4, (-1,)),
    ],
)
def test_the_last_pulses_are_corrected_and_for_a_spin_the_one_that_gives_most_to_it(
    scheme: str, spin: float | None, free: int, corrected: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen: list[tuple[int, ...]] = []
    monkeypatch.setattr(least_squares, "correct", lambda *_, **options: chosen.append(options["chosen"]))
    axial = (0.0, 0.7, 0.1, 0.0, 0.0, 0.2)
    made = tuple(pulse(5.0 * at, 0.1, np.array([1.0, 0.0, one])) for at, one in enumerate(axial))
    body = replace(BODY, goal=Goal(None, spin))
    least_squares.Correction(SCHEMES[scheme], SchemeOptions())(body, Schedule(made), free)
    assert chosen == [corrected]


@pytest.mark.deep
def test_what_is_not_to_be_had_is_said() -> None:
    """What the gap forbids is not told as rounding: two pulses that left 4.47° of 5°, where four-pulse leaves 2.16°.

    At 25 deg channels cannot do it at all: divided pulses are no way round the program. And one of 1 µs at most is left
    out beside one without a limit; alone, its limit is named.
    """
    made = plan(load_spacecraft(case("optimal-tick.yaml")), "optimal")
    assert made.schedule is None
    check_text("plan.gap-forbids", infeasibility(made))
    far = read_spacecraft(NOTHING_DAMPS.replace("8 deg", "25 deg"), "nothing-damps.yaml")
    check_text("plan.no-pulses-can", infeasibility(plan(replace(far, limits=Limits(max_pulses=20)), "optimal")))
    body = load_spacecraft(case("optimal-longer-than-inf.yaml"))
    made = plan(body, "optimal")
    assert {pulse.channel for pulse in made.pulses} == {"T1"}
    assert made.pulses.bounds is not None
    check_text("optimal.too-short", infeasibility(plan(replace(body, channels=body.channels[1:]), "optimal")))
