"""What optimal tries beside its linear program: other horizons, ends and schemes, H kept, pulses side by side."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from support import places
from support.builders import aimed, cross, pulse, spinner
from support.cases import deep, spread, weekly
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


@pytest.fixture
def search() -> _Search:
    return _Search(BODY, PLAIN)


def pair() -> Schedule:
    return two_pulse.schedule(BODY, TwoPulseOptions())


def settle(monkeypatch: pytest.MonkeyPatch, made: dict[float, Schedule]) -> list[float]:
    """Let the program lead to ``made`` within each horizon, else to nothing; the horizons that were looked at."""
    tried: list[float] = []

    def settled(self: _Search, _: float) -> Schedule | None:
        tried.append(self.spacecraft.horizon)
        return made.get(self.spacecraft.horizon)

    monkeypatch.setattr(_Search, "settled", settled)
    return tried


def dearer(made: Schedule, share: float) -> Schedule:
    return Schedule(tuple(replace(one, on_time=one.on_time * share, impulse=one.impulse * share) for one in made))


def test_without_a_schedule_the_horizon_is_halved_down_to_a_period(
    search: _Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried = settle(monkeypatch, {})
    search.programmed(search.program().solve())
    halves = int(math.log2(400.0 / BODY.inertial_period))
    assert tried == [400.0 * 0.5**turn for turn in range(halves + 1)]
    assert halves > HALVINGS


def test_a_dear_schedule_has_three_shorter_horizons_looked_at_or_as_many_as_lead_to_one_that_is_not(
    search: _Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = search.program().solve()
    monkeypatch.setattr(_Search, "others", lambda *_: None)
    dear = {400.0 * 0.5**turn: dearer(pair(), 3.0 - 0.1 * turn) for turn in range(7)}
    tried = settle(monkeypatch, dear)
    assert search.programmed(first) is dear[50.0]
    assert tried == [400.0, 200.0, 100.0, 50.0]
    cheap = dearer(pair(), (1.0 + 0.5 * DEARER) * first.cost / search.price(pair()))
    tried = settle(monkeypatch, {400.0: dearer(cheap, 2.0), 200.0: cheap})
    assert search.programmed(first) is cheap
    assert tried == [400.0, 200.0]


@pytest.mark.parametrize("known", [deep(False), True], ids=["none", "dear"])
def test_where_the_program_leads_nowhere_or_is_dear_other_schemes_are_starts(
    search: _Search, monkeypatch: pytest.MonkeyPatch, known: bool
) -> None:
    settle(monkeypatch, {400.0: dearer(pair(), 2.0)} if known else {})
    made = search.programmed(search.program().solve())
    assert made is not None
    assert search.price(made) <= search.price(pair()) * (1.0 + 1e-9)


@pytest.mark.parametrize(("tick", "named"), [(None, False), (0.01, True)])
def test_ticks_are_among_the_limits_named_where_the_file_sets_them(tick: float | None, named: bool) -> None:
    body = replace(BODY, limits=replace(BODY.limits, tick=tick))
    brief = replace(body, channels=cross(8.0, min_on_time=500.0))
    for said in (bounded_by(body), Problem(body, PLAIN).not_found(), no_channels(brief)):
        assert ("tick" in said) is named


# Seconds of end that the schedules of equal cost have to leave: 80 % of the end of what the whole horizon gives.
@spread(
    ("name", "latest"), [("lunar-prospector", 19.0), ("magnus-a09", 12.0), ("single-thruster", 68.0)], quick=0, deep=1
)
def test_an_earlier_end_costs_and_leaves_as_much_and_takes_no_more_pulses(name: str, latest: float) -> None:
    body = nutdamp.load(places.CONFIGS / f"{name}.yaml")
    made = plan(body, "optimal")
    with as_found():
        before = plan(body, "optimal")
    assert made.flown is not None
    assert before.flown is not None
    assert made.end <= min(latest, 0.8 * before.end)
    assert len(made) <= len(before)
    assert made.pulses.cost <= before.pulses.cost * (1.0 + SAME_COST)
    assert made.flown.nutation <= before.flown.nutation + DAMPED_ANGLE


@pytest.mark.deep
def test_the_example_takes_one_more_linear_program_and_no_more_flights() -> None:
    body = nutdamp.example()
    with work.budget("with", 1e9) as spent:
        made = plan(body, "optimal")
    with as_found(), work.budget("without", 1e9) as without:
        before = plan(body, "optimal")
    assert made.end == before.end
    assert spent.done - without.done < 6.0


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
    pairs = zip(*(candidates.by_other_schemes(each, shift=True) for each in (body, sunny)), strict=True)
    for one, other in pairs:
        assert [pulse.t for pulse in one] == [pulse.t for pulse in other]
        assert violations(body, one) == []


@pytest.mark.deep
@pytest.mark.parametrize(
    ("seed", "shift"),
    [(9, math.inf), *(weekly(seed, math.inf) for seed in (1, *range(10, 40))), weekly(14, 1.0), weekly(0, 0.05)],
)
def test_more_freedom_never_costs_more(seed: int, shift: float) -> None:
    """The search alone was up to 0.7 % dearer with it; of what ends earlier that counts as equal which is."""
    body = random_layout(seed)
    freedom = {"free_axis": True} if math.isinf(shift) else {"shift": math.radians(shift)}
    with as_found():
        kept, free = flies(body, left=1e-5), flies(body, left=1e-5, **freedom)
    assert free.pulses.cost <= kept.pulses.cost * (1.0 + 1e-6)
    earlier = plan(body, "optimal", Options(**freedom))
    assert earlier.pulses.cost <= kept.pulses.cost * (1.0 + SAME_COST)


@pytest.mark.deep
def test_what_the_gap_forbids_is_not_told_as_rounding() -> None:
    """Two pulses that left 4.47° of 5° were called feasible, where four-pulse leaves 2.16°."""
    made = plan(load_spacecraft(case("optimal-tick.yaml")), "optimal")
    assert made.schedule is None
    check_text("plan.gap-forbids", infeasibility(made))


def pauses(made: Schedule) -> list[float]:
    """Times in s for which a channel is off between two of its pulses."""
    each = ([pulse for pulse in made if pulse.channel == name] for name in {pulse.channel for pulse in made})
    return [after.start - before.end for pulses in each for before, after in itertools.pairwise(pulses)]


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
    made = flies(body, left=1e-4 if body.limits.tick else 1e-8, dearest=most)
    shortest = max(channel.min_on_time for channel in body.channels)
    assert min(pauses(made.pulses)) > max(0.9 * shortest, body.limits.gap - 1e-9)
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
def test_what_no_pulses_can_do_is_said() -> None:
    """At 25 deg the channels cannot do it at all: divided pulses are no way round the program."""
    far = read_spacecraft(NOTHING_DAMPS.replace("8 deg", "25 deg"), "nothing-damps.yaml")
    made = plan(replace(far, limits=Limits(max_pulses=20)), "optimal")
    check_text("plan.no-pulses-can", infeasibility(made))


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


def test_a_channel_whose_pulses_are_too_short_is_left_out() -> None:
    """One of 1 µs at most beside one without a limit: the search goes on with that; alone, its limit is named."""
    body = load_spacecraft(case("optimal-longer-than-inf.yaml"))
    made = plan(body, "optimal")
    assert made.feasible
    assert {pulse.channel for pulse in made.pulses} == {"T1"}
    assert made.pulses.bounds is not None
    alone = plan(replace(body, channels=body.channels[1:]), "optimal")
    check_text("optimal.too-short", infeasibility(alone))
