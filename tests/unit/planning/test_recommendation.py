"""The rule of the recommendation, on plans whose figures are given, and the words for it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest
from support.builders import (
    BOTH,
    COUNTS,
    HALF_A_DEGREE,
    INFEASIBLE,
    POINTING,
    Judged,
    cross,
    judged,
    said,
    spinner,
    warned,
)
from support.cases import deep, weekly
from support.golden import check_text
from support.places import case

import nutdamp
from nutdamp import planning, schemes
from nutdamp.commands import Block
from nutdamp.comparison import Comparison, compare, usual
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.planning import Plan
from nutdamp.presentation import verdicts
from nutdamp.recommendation import Gain, Ground, Standing, cheapest, recommend
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Goal, Requirement

KEEP = Requirement(momentum_shift=math.radians(0.2))
TINY = Requirement(nutation=math.radians(1e-13))
SMALL = Requirement(nutation=math.radians(1e-6))
SHIFTING = Requirement(nutation=math.radians(1e-13), momentum_shift=math.radians(0.1))
SPIN = Goal(spin=3.0)


def made(
    name: str, nutation: float, cost: float | None = None, shift: float = 0.0, end: float = 1.0, **more: object
) -> Plan:
    return judged(name, nutation, propellant=cost, shift=shift, end=end, **more)  # type: ignore[arg-type]


def small(name: str, nutation: float, cost: float) -> Plan:
    """For a body of 0.02° of nutation."""
    return replace(made(name, nutation, cost), spacecraft=spinner(degrees=0.02))


class Straying(Judged):
    """A plan with which the spin axis breaks a cone."""

    @property
    def kept(self) -> bool | None:
        return False


def straying(name: str, nutation: float, cost: float) -> Plan:
    one = made(name, nutation, cost)
    assert isinstance(one, Judged)
    return Straying(one.spacecraft, name, one.schedule, ended=one.ended)


CLEAN = made("clean", 1e-12, 0.2)
LATE, EARLY = made("late", 0.0, 12.6312, 1.0, 28.0), made("early", 0.0, 12.6323, 1.0, 15.0)
"""12.6312 g against 12.6323 g: both print as 12.63 g, and one ends in half the time."""
STILL = made("still", 0.0, 12.6330, 0.5, 90.0)
THERE = made("there", 1e-12, 0.2, 0.11, goal=POINTING)
"""Of a target 11.46° off; 1 % of the turn is 0.1146°."""
NEAR = {required: made("near", 5e-6, 0.2, 0.25, required=required) for required in (BOTH, SMALL)}

BEST: dict[str, tuple[str, Ground, Sequence[Plan]]] = {
    "infeasible plans are passed over": ("a", Ground.ONLY, [INFEASIBLE, made("a", 3.0)]),
    "one per cent of the 5° is as good as nothing": (
        "thrifty", Ground.COST, [made("thrifty", 0.99 * COUNTS, 0.1), CLEAN]
    ),
    "more is not": ("clean", Ground.ONLY, [made("thrifty", 1.01 * COUNTS, 0.1), CLEAN]),
    "however cheap": ("clean", Ground.ONLY, [made("thrifty", 4.9, 0.001), CLEAN]),
    "below a thousandth of a degree it counts as damped": (
        "thrifty", Ground.COST, [small("thrifty", 0.99e-3, 0.1), small("clean", 0.0, 0.2)]
    ),
    "above it does not": ("clean", Ground.ONLY, [small("thrifty", 1.01e-3, 0.1), small("clean", 0.0, 0.2)]),
    "what keeps the cones": ("damps", Ground.ONLY, [straying("thrifty", 0.0, 0.1), made("damps", 0.0, 0.2)]),
    "but not what damps less": ("thrifty", Ground.ONLY, [straying("thrifty", 0.0, 0.1), made("keeps", 3.0, 0.2)]),
    "of those that all break them": ("thrifty", Ground.COST, [straying("thrifty", 0.0, 0.1), straying("b", 0.0, 0.2)]),
    "the target must be reached too": (
        "there", Ground.ONLY, [made("beside", 1e-12, 0.1, 0.12, goal=POINTING), THERE]
    ),
    "within 1 % of the turn": ("near", Ground.COST, [made("near", 1e-12, 0.1, 0.114, goal=POINTING), THERE]),
    "where nothing damps, least nutation": (
        "four", Ground.LEFT, [made("two", 4.9, 4.0), made("four", 2.5, 81.0), made("one", 3.7, 4.0)]
    ),
    "where nothing reaches the target, least of both": (
        "near",
        Ground.LEFT,
        [made(name, left, None, off, goal=POINTING) for name, left, off in (("a", 0, 9), ("near", 4, 3), ("b", 6, 1))],
    ),
    "what meets the requirement": (
        "meeting",
        Ground.ONLY,
        [made("drifting", 0.01, 0.1, 0.3, required=BOTH), made("meeting", 0.4, 0.5, 0.1, required=BOTH)],
    ),
    "which says what is enough": (
        "thrifty", Ground.COST, [made(*one, required=HALF_A_DEGREE) for one in (("thrifty", 0.4, 0.1), ("b", 0.0, 0.2))]
    ),
    "what it does not bound must be damped": (
        "damping",
        Ground.ONLY,
        [made("idle", 4.9, 0.0, required=KEEP), made("damping", 0.01, 0.5, 0.1, required=KEEP)],
    ),
    "or at least be less": (
        "worse", Ground.LEFT, [made("idle", 4.9, 0.0, required=KEEP), made("worse", 3.0, 0.5, 0.1, required=KEEP)]
    ),
    "where none meets it, least nutation": (
        "two", Ground.LEFT, [made(*one, required=HALF_A_DEGREE) for one in (("one", 0.7, 0.1), ("two", 0.6, 9.0))]
    ),
    "where all damp, nearest to it": (  # rounding does not decide, and least nutation is not claimed
        "near",
        Ground.NEAREST,
        [made("far", 1e-12, 0.1, 3.5, required=BOTH), made("near", 5e-12, 0.2, 0.25, required=BOTH)],
    ),
    "within a thousandth of it": (
        "cheap", Ground.COST, [NEAR[BOTH], made("cheap", 5e-6, 0.1, 0.2501, required=BOTH)]
    ),
    "not beyond": ("near", Ground.NEAREST, [NEAR[BOTH], made("cheap", 5e-6, 0.1, 0.251, required=BOTH)]),
    "so with nutation": ("cheap", Ground.COST, [NEAR[SMALL], made("cheap", 5.0005e-6, 0.1, 0.25, required=SMALL)]),
    "1e-7° are no rounding": ("near", Ground.NEAREST, [NEAR[SMALL], made("cheap", 5.1e-6, 0.1, 0.25, required=SMALL)]),
    "of what leaves but rounding the cheapest": (
        "noisy", Ground.COST, [made("quiet", 3e-13, 0.2, required=TINY), made("noisy", 2e-12, 0.1, required=TINY)]
    ),
    "also where another part is missed": (
        "cheap",
        Ground.COST,
        [made("dear", 1e-13, 0.2, 0.3, required=SHIFTING), made("cheap", 0.0, 0.1, 0.3, required=SHIFTING)],
    ),
    "equal costs: the earlier end": ("early", Ground.END, [LATE, EARLY]),
    "less shift first": ("still", Ground.SHIFT, [LATE, EARLY, STILL]),
    "then the end": ("sooner", Ground.SHIFT_END, [LATE, EARLY, STILL, made("sooner", 0.0, 12.633, 0.5, 80.0)]),
    "not for a thousandth more": ("late", Ground.COST, [LATE, made("dearer", 0.0, 12.6312 * 1.0011)]),
    "half a thousandth is equal": ("b", Ground.END, [made("a", 0.0, 1.0, end=9.0), made("b", 0.0, 1.0005)]),
    "two are not": ("a", Ground.COST, [made("a", 0.0, 1.0, end=9.0), made("b", 0.0, 1.002)]),
    "shifts within a nanoradian": (
        "b", Ground.END, [made("a", 0.0, end=9.0), made("b", 0.0, shift=math.degrees(0.5e-9))]
    ),
    "no further": ("a", Ground.SHIFT, [made("a", 0.0, end=9.0), made("b", 0.0, shift=math.degrees(2e-9))]),
    "where a propellant is not known the impulse": (
        "b", Ground.COST, [judged("a", 0.0, impulse=3.0, propellant=0.1), judged("b", 0.0, impulse=2.0)]
    ),
    "the spin is part of the requirement": (
        "right", Ground.ONLY, [made("cheap", 0.0, 0.1, goal=SPIN, spin=3.01), made("right", 0.0, 0.2, goal=SPIN)]
    ),
    "a missed spin": ("cheap", Ground.ONLY, [made("cheap", 0.0, 0.1, goal=SPIN, spin=3.01)]),
}  # fmt: skip


@pytest.mark.parametrize("name", BEST)
def test_the_plan_to_fly_and_what_decided(name: str) -> None:
    best, ground, plans = BEST[name]
    found = recommend(plans)
    assert found.plan is not None
    assert (found.plan.scheme, found.ground) == (best, ground)
    assert found.standing is found.plan.standing
    assert found.count == sum(
        one.standing is found.standing and one.kept == found.plan.kept for one in plans if one.feasible
    )


def test_nothing_feasible_recommends_nothing() -> None:
    for plans in ([INFEASIBLE], []):
        found = recommend(plans)
        assert (found.plan, found.standing, found.ground) == (None, None, None)


def test_the_words_for_what_decided_and_for_what_is_missed() -> None:
    """One of each ground and standing; what is missed names the part, what is left, and what may be."""
    names = [
        "above it does not",
        "where nothing damps, least nutation",
        "where nothing reaches the target, least of both",
        "or at least be less",
        "where none meets it, least nutation",
        "where all damp, nearest to it",
        "of what leaves but rounding the cheapest",
        "less shift first",
        "then the end",
        "where a propellant is not known the impulse",
        "a missed spin",
    ]
    lines = [f"{said(*BEST[name][2])}. {warned(*BEST[name][2])}" for name in names]
    check_text("plan.reasons", "\n".join((said(INFEASIBLE) + warned(INFEASIBLE), *lines)))


@pytest.mark.parametrize(
    ("share", "ground", "best"),
    [(1.0, Ground.NOMINAL, "late"), (1.0005, Ground.NOMINAL, "late"), (1.002, Ground.COST, "early")],
)
def test_of_equal_costs_the_plan_for_nominal_values_stays(share: float, ground: Ground, best: str) -> None:
    late, early = made("late", 0.0, share, end=9.0), made("early", 0.0, 1.0)
    plan, why = cheapest([early, late], late)
    assert (plan.scheme, why) == (best, ground)


@pytest.mark.parametrize("degrees", [8, 60])
def test_where_thrusters_are_too_weak_the_plan_that_leaves_least(degrees: int) -> None:
    text = case("nothing-damps.yaml").read_text(encoding="utf-8").replace("8 deg", f"{degrees} deg")
    compared = compare(read_spacecraft(text, "nothing-damps.yaml"), schemes.CLASSIC)
    left = {one.scheme: one.flown.nutation for one in compared.plans if one.flown is not None}
    assert compared.recommended is not None
    assert compared.recommended.scheme == min(left, key=lambda name: left[name]) == "four-pulse"
    check_text(f"plan.weak-{degrees}", "\n".join((verdicts.reason(compared), *verdicts.warnings(compared))))


@pytest.mark.parametrize(("spin", "meets"), [(3.0, True), (3.0029, True), (3.0031, False), (2.9969, False)])
@pytest.mark.parametrize("required", [None, HALF_A_DEGREE])
def test_a_spin_is_met_within_a_thousandth(required: Requirement | None, spin: float, meets: bool) -> None:
    one = judged("a", 0.0, required=required, goal=SPIN, spin=spin)
    assert one.meets_requirement is meets
    assert (one.standing is Standing.COMPLIES) == meets


def test_a_scheme_that_cannot_set_the_spin_says_so_and_one_that_is_kept_by_itself_takes_no_channel() -> None:
    body = replace(spinner(channels=cross(20.0)), goal=Goal(spin=3.3))
    compared = compare(body, (*schemes.CLASSIC, "half-cone"))
    assert {one.feasible for one in compared.plans} == {False}
    check_text("plan.spin-not-set", "\n".join(sorted({one.refusal or "" for one in compared.plans})))
    assert "optimal" in usual(body)
    assert planning.plan(body, "none").meets_requirement is False
    assert not planning.plan(replace(body, omega0=body.omega0 * [0, 0, 1]), "four-pulse").feasible  # without nutation
    kept = replace(body, goal=SPIN)
    assert planning.plan(kept, "two-pulse").meets_requirement is True
    assert usual(kept) == (*schemes.CLASSIC, "optimal")


@pytest.mark.deep
def test_optimal_keeps_a_spin_without_a_channel_for_it() -> None:
    assert planning.plan(replace(spinner(channels=cross(20.0)), goal=SPIN), "optimal").meets_requirement is True


PERIOD = spinner().inertial_period
MANY = made("many", 0.0, 0.1, pulses=10)
SHIFTED, SLOW = made("cheap", 0.0, 12.0, 1.8), made("late", 0.0, 0.1, end=100.0)
ALONE = made("cheap", 0.0, 12.0, 0.11, goal=POINTING)
BOUND = made("ideal", 0.0, 0.1, required=BOTH)


def fired(cost: float, *blocks: Block) -> Plan:
    """Real pulse widths, perhaps sent as command blocks."""
    one = made("real", 0.1, cost, 0.15, end=4.0, required=BOTH)
    wide = tuple(replace(each, on_time=0.1, torque=10.0 * each.impulse) for each in one.pulses)
    return replace(one, schedule=Schedule(wide, blocks=blocks))


BLOCK = Block("T", 1, 0.1, 0.1, 1)

GAINS: list[tuple[Plan, tuple[Plan, ...], Gain, str | None]] = [
    (SHIFTED, (made("still", 0.0, 13.1, 0.35),), Gain.STEADIER, "still"),
    (SHIFTED, (made("still", 0.0, 13.1, 0.37),), Gain.STEADIER, None),
    (SHIFTED, (made("still", 0.0, 13.3, 0.35),), Gain.STEADIER, None),
    (SHIFTED, (made("idle", 4.0, 12.5),), Gain.STEADIER, None),
    (SHIFTED, (made("dear", 0.0, 13.0, 0.1), made("fair", 0.0, 12.5, 0.1)), Gain.STEADIER, "fair"),
    (ALONE, (made("still", 0.0, 12.5, goal=POINTING),), Gain.STEADIER, None),  # with a target H shall not stay
    (MANY, (made("few", 0.0, 0.1049, pulses=5),), Gain.SIMPLER, "few"),
    (MANY, (made("few", 0.0, 0.1049, pulses=6),), Gain.SIMPLER, None),
    (MANY, (made("few", 0.0, 0.1051, pulses=5),), Gain.SIMPLER, None),
    (MANY, (made("few", 0.0, 0.1049, pulses=5), made("one", 0.0, 0.101)), Gain.SIMPLER, "one"),
    (made("a", 0.0, pulses=0), (made("b", 0.0, pulses=0),), Gain.SIMPLER, None),
    (SLOW, (made("soon", 0.0, 0.1045, 0.2, 50.0),), Gain.SOONER, "soon"),  # half the time, and a period at least
    (SLOW, (made("soon", 0.0, 0.1045, end=51.0),), Gain.SOONER, None),
    (SLOW, (made("soon", 0.0, 0.1055, end=50.0),), Gain.SOONER, None),
    (BOUND, (fired(0.109),), Gain.REAL, "real"),
    (BOUND, (fired(0.111),), Gain.REAL, None),
    (fired(0.1), (fired(0.11),), Gain.REAL, None),
    (BOUND, (fired(9.0, BLOCK),), Gain.COMMANDED, "real"),  # whatever it costs: it may be all that can be sent
    (BOUND, (fired(0.2),), Gain.COMMANDED, None),
    (fired(0.1, BLOCK), (fired(0.2, BLOCK),), Gain.COMMANDED, None),
    (made("early", 0.0, 0.1, end=PERIOD), (made("soon", 0.0, 0.1045, end=0.4 * PERIOD),), Gain.SOONER, None),
]


@pytest.mark.parametrize(("best", "others", "gain", "named"), GAINS)
def test_the_cheapest_plan_that_gains_much_for_little_more_is_an_alternative(
    best: Plan, others: tuple[Plan, ...], gain: Gain, named: str | None
) -> None:
    for plans in ((best, *others), (*reversed(others), best)):
        found = recommend(plans)
        other = found.alternatives.get(gain)
        assert (None if other is None else other.scheme) == named
        assert found.plan is best or len(best.pulses) == 0


def test_the_words_for_what_a_plan_gains_and_for_what_it_is_worse_in() -> None:
    few = made("few", 0.0, 0.1049, pulses=5)
    lines = [
        (SHIFTED, made("still", 0.0, 12.8, 0.01), None),
        (MANY, few, None),
        (MANY, few, {"many": 0.352, "few": 0.67}),
        (MANY, few, {"many": 1.0, "few": 1.0}),  # what is equal is no reason
        (made("many", 0.0, 0.1, 1.0, pulses=2), made("both", 0.0, 0.104, 0.01, pulses=1), None),
        (MANY, made("few", 0.0, 0.104, 0.65, pulses=2), None),
        (MANY, made("few", 0.0, 0.104, 0.65, 1.0 + 1.01 * PERIOD, pulses=2), None),
        (SLOW, made("soon", 0.0, 0.1045, 0.2, 50.0), None),
        (BOUND, fired(0.109), None),
        (BOUND, fired(9.0, BLOCK), None),
    ]
    hints = [verdicts.hints(Comparison(best.spacecraft, (best, other)), shares) for best, other, shares in lines]
    check_text("plan.hints", "\n".join(" ".join(each) for each in hints))


@pytest.mark.parametrize(("name", "gain"), [deep("magnus-a03", Gain.REAL), weekly("lunar-prospector", Gain.COMMANDED)])
def test_examples_have_such_alternatives(name: str, gain: Gain) -> None:
    body = nutdamp.example(name)
    found = compare(body, usual(body))
    assert found.recommended is not None
    assert (found.recommended.pulses.idealised, bool(found.recommended.pulses.blocks)) == (gain is Gain.REAL, False)
    assert bool(found.recommendation.alternatives[gain].pulses.blocks) is (gain is Gain.COMMANDED)
