"""Comparisons: the rule of the recommendation on plans whose figures are given, its notes, and why
none is cheaper.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from support.builders import (
    BOTH,
    HALF_A_DEGREE,
    INFEASIBLE,
    POINTING,
    Judged,
    cross,
    judged,
    noted,
    present,
    recommended,
    spinner,
)
from support.cases import deep, weekly
from support.golden import check_text
from support.places import case

import nutdamp
from nutdamp.files.reader import read_spacecraft
from nutdamp.planning import plan as planning
from nutdamp.planning.causes import infeasibility
from nutdamp.planning.decision import Comparison, Ground, cheapest, compare, recommend, usual
from nutdamp.planning.notes import Gain, alternatives, comparison_warnings, gains, reasons
from nutdamp.planning.screening import FlownPlan
from nutdamp.planning.verdict import Cases, Status
from nutdamp.schemes import catalogue
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.model import Goal, Keep, Requirement, Vector
from nutdamp.spacecraft.requirements import Bound, Held, Part
from nutdamp.spacecraft.schedule import Schedule

SPIN = Goal(spin=3.0)
PERIOD = spinner().inertial_period
GIVEN: dict[str, dict[str, Any]] = {
    "": {},
    "0.02°": {"degrees": 0.02},
    "target": {"goal": POINTING},  # 11.46° off: 1 % of the turn is 0.1146°
    "spin": {"goal": SPIN},
    "both": {"required": BOTH},
    "half": {"required": HALF_A_DEGREE},
    "keep": {"required": Requirement(None, math.radians(0.2))},
    "tiny": {"required": Requirement(math.radians(1e-13))},
    "small": {"required": Requirement(math.radians(1e-6))},
    "still": {"required": Requirement(math.radians(1e-13), math.radians(0.1))},
}

# What is tested | what is given: the requirement or goal | the best, what decided | plans: name,
# nutation left in deg, propellant, shift of H in deg, end, spin, pulses, ΔV; ! breaks a cone, ? is
# infeasible.
RULE = """
infeasible: passed over       |        | a ONLY        | ? 0; a 3
1 % of the 5° is like nothing |        | thrifty COST  | thrifty 0.0495 0.1; clean 1e-12 0.2
more is not                   |        | clean ONLY    | thrifty 0.0505 0.1; clean 1e-12 0.2
however cheap                 |        | clean ONLY    | thrifty 4.9 0.001; clean 1e-12 0.2
0.001° counts as damped       | 0.02°  | thrifty COST  | thrifty 0.00099 0.1; clean 0 0.2
above it does not             | 0.02°  | clean ONLY    | thrifty 0.00101 0.1; clean 0 0.2
what keeps the cones          |        | damps ONLY    | !thrifty 0 0.1; damps 0 0.2
but not what damps less       |        | !thrifty ONLY | !thrifty 0 0.1; keeps 3 0.2
of those that all break them  |        | !thrifty COST | !thrifty 0 0.1; !dear 0 0.2
a target must be reached too  | target | there ONLY    | beside 0 0.1 0.12; there 0 0.2 0.11
within 1 % of the turn        | target | near COST     | near 0 0.1 0.114; there 0 0.2 0.11
where none damps, the least   |        | four LEFT     | two 4.9 4; four 2.5 81; one 3.7 4
off the target, least of both | target | near LEFT     | a 0 - 9; near 4 - 3; b 6 - 1
what meets the requirement    | both   | meeting ONLY  | drifting 0.01 0.1 0.3; meeting 0.4 0.5 0.1
which says what is enough     | half   | thrifty COST  | thrifty 0.4 0.1; clean 0 0.2
what it leaves open is damped | keep   | damping ONLY  | idle 4.9 0; damping 0.01 0.5 0.1
or at least be less           | keep   | worse LEFT    | idle 4.9 0; worse 3 0.5 0.1
if none meets it, the least   | half   | two LEFT      | one 0.7 0.1; two 0.6 9
where all damp, nearest to it | both   | near NEAREST  | far 1e-12 0.1 3.5; near 5e-12 0.2 0.25
within a thousandth of it     | both   | cheap COST    | near 5e-6 0.2 0.25; cheap 5e-6 0.1 0.2501
not beyond                    | both   | near NEAREST  | near 5e-6 0.2 0.25; cheap 5e-6 0.1 0.251
so with nutation              | small  | cheap COST    | near 5e-6 0.2 0.25; \
                                                         cheap 5.0005e-6 0.1 0.25
1e-7° are no rounding         | small  | near NEAREST  | near 5e-6 0.2 0.25; cheap 5.1e-6 0.1 0.25
of what rounds to 0, cost     | tiny   | noisy COST    | quiet 3e-13 0.2; noisy 2e-12 0.1
also with another part missed | still  | cheap COST    | dear 1e-13 0.2 0.3; cheap 0 0.1 0.3
equal costs: the earlier end  |        | early END     | late 0 12.6312 1 28; early 0 12.6323 1 15
less shift first              |        | b SHIFT       | late 0 12.6312 1 28; \
                                                         early 0 12.6323 1 15; b 0 12.633 0.5 90
then the end                  |        | c END         | a 0 12.6312 1 28; d 0 12.6323 1 15; \
                                                         b 0 12.633 0.5 90; c 0 12.633 0.5 80
fewer pulses before all these |        | few PULSES    | many 0 1 0 1 - 4 0; few 0 1.0005 1 9 - 3 5
then less ΔV                  |        | slow DELTA_V  | fast 0 1 0 1 - 2 0.3; \
                                                         slow 0 1.0005 1 9 - 2 0.2; \
                                                         many 0 1 0 1 - 3 0
speeds within 0.01 mm/s       |        | still SHIFT   | shifting 0 1 1 1 - 2 0.2; \
                                                         still 0 1 0 9 - 2 0.200009
no further                    |        | slow DELTA_V  | slow 0 1 1 9 - 2 0.2; \
                                                         still 0 1 0 1 - 2 0.200011
if one is unknown, the shift  |        | still SHIFT   | slow 0 1 1 1 - 2 0.2; still 0 1 0 9 - 2 -
however few pulses            |        | many COST     | many 0 1 0 1 - 9; few 0 1.002 0 1 - 1
half a thousandth is equal    |        | early END     | late 0 1 0 9; early 0 1.0005
two are not                   |        | late COST     | late 0 1 0 9; early 0 1.002
shifts within half a nrad     |        | early END     | late 0 1 0 9; early 0 1 2.9e-8
no further                    |        | late SHIFT    | late 0 1 0 9; early 0 1 1.2e-7
without propellant, impulse   |        | early END     | late 0 0.1 0 9; early 0 -
the spin is required too      | spin   | right ONLY    | cheap 0 0.1 0 1 3.04; right 0 0.2
within 1 % of the goal        | spin   | cheap COST    | cheap 0 0.1 0 1 3.02; right 0 0.2
a missed spin                 | spin   | cheap ONLY    | cheap 0 0.1 0 1 3.04
"""
CASES = [[cell.strip() for cell in line.split("|")] for line in RULE.strip().splitlines()]


@dataclass(frozen=True, eq=False)
class Given(Judged):
    """A plan that perhaps breaks a cone, and whose ΔV is given."""

    strays: bool = False
    speed: float | None = None

    @property
    def _kept(self) -> bool | None:
        return False if self.strays else None

    @property
    def _held(self) -> tuple[Held, ...]:
        broken = Held(Bound(Part.CONE, 0.2, True, Keep("star", None, most=0.2)), 0.3)
        return (*super()._held, *[broken] * self.strays)

    @property
    def _delta_v(self) -> Vector | None:
        return None if self.speed is None else self.speed * np.array([0.6, 0.0, -0.8])


def made(
    name: str,
    nutation: float,
    cost: float | None = None,
    shift: float = 0.0,
    end: float = 1.0,
    **more: Any,
) -> planning.Plan:
    degrees, speed = more.pop("degrees", 5.0), more.pop("speed", None)
    one = judged(name, nutation, propellant=cost, shift=shift, end=end, **more)
    if degrees != 5.0:
        one = replace(one, spacecraft=spinner(degrees=degrees))
    if name.startswith("!") or speed is not None:
        assert isinstance(one, Judged)
        strays = name.startswith("!")
        return Given(
            one.spacecraft, name, one.schedule, ended=one.ended, strays=strays, speed=speed
        )
    return INFEASIBLE if name == "?" else one


def plans_of(given: str, text: str) -> list[planning.Plan]:
    plans = []
    for name, *rest in (one.split() for one in text.split(";")):
        numbers = [None if one == "-" else float(one) for one in rest]
        more: dict[str, Any] = dict(zip(("spin", "pulses", "speed"), numbers[4:], strict=False))
        more = GIVEN[given] | more | {"pulses": int(more.get("pulses") or 1)}
        plans.append(made(name, *numbers[:4], **more))  # type: ignore[arg-type]
    return plans


def test_the_plan_to_fly_what_decided_and_the_notes_on_it_and_on_what_is_missed() -> None:
    """What is missed names the part, what is left, and what may be."""
    lines = [recommended("nothing feasible", Comparison(INFEASIBLE.spacecraft, (INFEASIBLE,)))]
    for what, given, decided, text in CASES:
        (best, ground), plans = decided.split(), plans_of(given, text)
        found = recommend(plans)
        assert found.plan is not None
        assert (found.plan.scheme, found.ground) == (best, Ground[ground]), what
        assert found.standing is found.plan._standing
        equals = [
            one
            for one in plans
            if one.feasible and (one._standing, one._kept) == (found.standing, found.plan._kept)
        ]
        assert found.count == len(equals), what
        if ground != "COST" or what.startswith(("of what", "where")):
            lines.append(recommended(what, Comparison(plans[0].spacecraft, tuple(plans))))
    check_text("plan.reasons", "\n".join(lines))
    for none in ([INFEASIBLE], []):
        assert (recommend(none).plan, recommend(none).standing, recommend(none).ground) == (
            None,
            None,
            None,
        )
    # Of equal costs the plan for nominal values stays.
    for share, why, name in (
        (1.0, Ground.NOMINAL, "late"),
        (1.0005, Ground.NOMINAL, "late"),
        (1.002, Ground.COST, "early"),
    ):
        late, early = made("late", 0.0, share, end=9.0), made("early", 0.0, 1.0)
        assert cheapest([early, late], late) == ({"late": late, "early": early}[name], why)


# What is tested | what is given | the best, what decided, its standing, of how many | plans | of
# the cases those that comply with each; of 0.997 that must. What lies between two is not known more
# closely.
BY_CASES = """
enough must comply     | half | dear ONLY COMPLIES 1  | cheap 0.4 0.1; dear 0 0.2  | 0.996; 0.998
then the cheapest      | half | cheap COST COMPLIES 2 | cheap 0.4 0.1; dear 0 0.2  | 0.997; 1
few may do to know     | half | cheap COST COMPLIES 2 | cheap 0.4 0.1; dear 0 0.2  | 0.997-1; 0.998
unknown does not count | half | dear ONLY COMPLIES 1  | cheap 0.4 0.1; dear 0 0.2  | 0.996-1; 0.997
too few: most          | half | dear CASES MISSES 2   | cheap 0.4 0.1; dear 0 0.2  | 0.8; 0.9
nominal does not count | half | off CASES MISSES 2    | off 0.6 0.2; fine 0 0.1    | 0.8; 0.7
surely most            | half | b CASES MISSES 2      | a 0 0.1; b 0 0.2           | 0.7-1; 0.75-0.8
of equals the cheapest | half | cheap CASES MISSES 3  | dear 0 2; cheap 0 1; c 0 0.5 | 0.8; 0.8; 0.7
none at all: the least | half | two LEFT MISSES 2     | one 0.7 0.1; two 0.6 9     | 0; 0
a plan alone           | half | a ONLY MISSES 1       | a 0 0.1                    | 0.5
unknown of one alone   | half | a ONLY MISSES 1       | a 0 0.1                    | 0-1
cones are kept         | half | kept ONLY COMPLIES 1  | !cheap 0 0.1; kept 0 0.2   | 1; 0.998
also with too few      | half | kept CASES MISSES 2   | !a 0 1; kept 0 2; b 0 3    | 0.9; 0.8; 0.7
what is free is damped | keep | damps ONLY COMPLIES 1 | idle 4.9 0; damps 0.01 0.5 0.1 | 1; 0.998
or else enough comply  | keep | idle ONLY MEETS 1     | idle 4.9 0; damps 0.01 0.5 0.1 | 0.998; 0.9
"""


def with_shares(plans: list[planning.Plan], text: str) -> Comparison:
    """The comparison of plans that flew so many cases that the share that complies is known so
    closely.
    """
    flown: dict[planning.Plan, FlownPlan] = {}
    for plan, bounds in zip(plans, text.split(";"), strict=True):
        low, high = (float(bound) for bound in (bounds.split("-") * 2)[:2])
        flown[plan] = FlownPlan(
            plan, None, cases=Cases(2_048, 1, 0.997, low, low, high, final=low == high)
        )
    return Comparison(plans[0].spacecraft, tuple(plans), flown)


def test_plans_with_which_too_few_dispersed_cases_comply_miss_the_requirement() -> None:
    lines = []
    for what, given, decided, text, shares in (
        [cell.strip() for cell in line.split("|")] for line in BY_CASES.strip().splitlines()
    ):
        best, ground, standing, count = decided.split()
        compared = with_shares(plans_of(given, text), shares)
        found = compared.recommendation
        cases = compared.cases[compared[best]]
        assert found.plan is compared.recommended is compared[best], what
        assert (found.ground, found.standing, found.count) == (
            Ground[ground],
            planning.Standing[standing],
            int(count),
        ), what
        enough = {
            each: each.meets_requirement and compared.cases[each].low >= 0.997 for each in compared
        }
        assert {each: verdict.met for each, verdict in compared.verdicts.items()} == enough
        # Undecided where the budget of work ended too early.
        missed = (
            Status.NOT_SHOWN
            if cases.enough is None and found.plan.meets_requirement
            else Status.NOT_ENOUGH
        )
        expected = Status.FLY if enough[found.plan] else missed
        assert compared.verdict.status is expected, what
        lines.append(recommended(what, compared))
    check_text("plan.reasons-by-cases", "\n".join(lines))
    # Nothing is required: no cases decide.
    free = with_shares(plans_of("", "a 0 0.1; b 0 0.2"), "0.1; 0.2")
    assert (free.cases, free.recommendation.ground, free.verdict.met) == ({}, Ground.COST, None)


# What is given | the plans, of which the first costs less | shares of the cases that comply.
WHY = """
both   | cheap 0.6 0.1; dear 0.1 0.2               | 1; 1
both   | cheap 0.1 0.1 0.3; dear 0.1 0.2           | 1; 1
keep   | cheap 4.9 0.1; dear 0.01 0.2              | 1; 1
target | cheap 0 0.1 0.12; dear 0 0.2 0.11         | 1; 1
spin   | cheap 0 0.1 0 1 3.04; dear 0 0.2          | 1; 1
       | !cheap 0 0.1; dear 0 0.2                  | 1; 1
half   | cheap 0.4 0.1; dear 0.4 0.2               | 0.9; 0.998
half   | cheap 0.4 0.1; dear 0.4 0.2               | 0.9-0.95; 0.998
half   | cheap 0.4 0.1; dear 0.4 0.2               | 0.9-1; 0.998
half   | cheap 0.6 0.1999; dear 0.4 0.2            | 1; 1
half   | cheap 0.4 0.1; dear 0.6 0.2; dearer 0 0.3 | 1; 1; 1
"""


def test_why_a_plan_that_costs_less_is_not_recommended() -> None:
    """By what it leaves, or by the cases that comply; costs within a thousandth are equal."""
    lines = []
    for given, text, shares in (
        [cell.strip() for cell in line.split("|")] for line in WHY.strip().splitlines()
    ):
        compared = with_shares(plans_of(given, text), shares)
        cheaper = compared.verdict.cheaper
        lines.append(f"{given}: {noted(each.why for each in cheaper)}")
        assert [each.schedule for each in cheaper] == [compared.plans[0].pulses] * len(cheaper)
    cheap, dear = plans_of("half", "cheap 0.4 0.1; dear 0.4 0.2")
    flown = FlownPlan(dear, None, cases=Cases(2_048, 1, 0.997, 1.0, 0.998, 1.0))
    unknown = Comparison(cheap.spacecraft, (cheap, dear), {dear: flown})
    assert unknown.cases[cheap] == planning.unflown(cheap)
    commands = nutdamp.load(case("cbp1004.yaml")).commands
    timed, block = (
        replace(each, spacecraft=replace(each.spacecraft, commands=commands))
        for each in (fired(0.1), fired(0.2, BLOCK))
    )
    sent = Comparison(timed.spacecraft, (timed, block))
    lines += [noted(each.why for each in compared.verdict.cheaper) for compared in (unknown, sent)]
    check_text("plan.why-not-cheaper", "\n".join(lines))


def test_what_is_to_be_saved_decides_on_the_plan() -> None:
    """Of equal ends, impulses or numbers of pulses, the one that costs less propellant."""
    plans = plans_of(
        "half",
        (
            "frugal 0.1 0.1 0 9 - 4; late 0.1 0.3 0 5.0001 - 2; soon 0.1 0.2 0 5 - 3; "
            "off 0.6 0.1 0 1 - 1"
        ),
    )
    for least, best in (("propellant", "frugal"), ("time", "soon"), ("pulses", "late")):
        found = recommend(plans, least=least)
        assert (present(found.plan).scheme, found.ground, found.least, found.count) == (
            best,
            Ground.COST,
            least,
            3,
        )
        compared = Comparison(plans[0].spacecraft, tuple(plans), least=least)
        assert [each.why.code for each in compared.verdict.cheaper] == ["why-nutation"] * (
            least != "propellant"
        )


@pytest.mark.deep
def test_the_plan_that_ends_first_is_recommended_where_time_is_to_be_saved() -> None:
    """One-pulse and four-pulse cost least, as much, and end at 27 and 15 s; two-pulse, at 4.2 s,
    leaves 0.8°.
    """
    compared = compare(
        nutdamp.load(case("rim.yaml")), options=catalogue.Options(least="time"), samples=0
    )
    assert (compared.verdict.status, compared.verdict.scheme) == (Status.FLY, "optimal")
    assert compared.verdict.schedule.end <= 3.356
    assert compared.verdict.schedule.end == min(
        each.end for each in compared if compared.verdicts[each].met
    )
    assert compare(compared.spacecraft, catalogue.CLASSIC, samples=0).verdict.scheme == "four-pulse"


@pytest.mark.parametrize("degrees", [8, 60])
def test_where_thrusters_are_too_weak_the_plan_that_leaves_least(degrees: int) -> None:
    text = case("nothing-damps.yaml").read_text(encoding="utf-8").replace("8 deg", f"{degrees} deg")
    compared = compare(read_spacecraft(text, "nothing-damps.yaml"), catalogue.CLASSIC)
    left = {one.scheme: one.flown.nutation for one in compared.plans if one.flown is not None}
    assert (
        present(compared.recommended).scheme
        == min(left, key=lambda name: left[name])
        == "four-pulse"
    )
    check_text(f"plan.weak-{degrees}", recommended("weak", compared))


def test_a_scheme_that_cannot_set_the_spin_says_so_and_a_spin_that_stays_takes_no_channel() -> None:
    body = replace(spinner(channels=cross(20.0)), goal=Goal(spin=3.3))
    compared = compare(body, (*catalogue.CLASSIC, "half-cone"))
    assert {one.feasible for one in compared.plans} == {False}
    check_text(
        "plan.spin-not-set", "\n".join(sorted({infeasibility(one) for one in compared.plans}))
    )
    assert "optimal" in usual(body)
    assert planning.plan(body, "none").meets_requirement is False
    assert not planning.plan(
        replace(body, omega0=body.omega0 * [0, 0, 1]), "four-pulse"
    ).feasible  # without nutation
    kept = replace(body, goal=SPIN)
    assert planning.plan(kept, "two-pulse").meets_requirement is True
    assert usual(kept) == (*catalogue.CLASSIC, "optimal")


MANY, FEW = made("many", 0.0, 0.1, pulses=10), made("few", 0.0, 0.1049, pulses=5)
SHIFTED, SLOW = made("cheap", 0.0, 12.0, 1.8), made("late", 0.0, 0.1, end=100.0)
ALONE, BOUND = made("cheap", 0.0, 12.0, 0.11, goal=POINTING), made("ideal", 0.0, 0.1, required=BOTH)
BLOCK = Block("T", 1, 0.1, 0.1, 1)


def fired(cost: float, *blocks: Block) -> planning.Plan:
    """Real pulse widths, perhaps sent as command blocks."""
    one = made("real", 0.1, cost, 0.15, end=4.0, required=BOTH)
    wide = tuple(replace(each, on_time=0.1, torque=10.0 * each.impulse) for each in one.pulses)
    return replace(one, schedule=Schedule(wide, blocks=blocks))


def test_the_cheapest_plan_that_gains_much_for_little_more_is_an_alternative() -> None:
    for best, others, gain, named in [
        (SHIFTED, (made("still", 0.0, 13.1, 0.35),), Gain.STEADIER, "still"),
        (SHIFTED, (made("still", 0.0, 13.1, 0.37),), Gain.STEADIER, None),
        (SHIFTED, (made("still", 0.0, 13.3, 0.35),), Gain.STEADIER, None),
        (SHIFTED, (made("idle", 4.0, 12.5),), Gain.STEADIER, None),
        (
            SHIFTED,
            (made("dear", 0.0, 13.0, 0.1), made("fair", 0.0, 12.5, 0.1)),
            Gain.STEADIER,
            "fair",
        ),
        (
            ALONE,
            (made("still", 0.0, 12.5, goal=POINTING),),
            Gain.STEADIER,
            None,
        ),  # with a target H shall not stay
        (MANY, (FEW,), Gain.SIMPLER, "few"),
        (MANY, (made("few", 0.0, 0.1049, pulses=6),), Gain.SIMPLER, None),
        (MANY, (made("few", 0.0, 0.1051, pulses=5),), Gain.SIMPLER, None),
        (MANY, (FEW, made("one", 0.0, 0.101)), Gain.SIMPLER, "one"),
        (made("a", 0.0, pulses=0), (made("b", 0.0, pulses=0),), Gain.SIMPLER, None),
        (
            SLOW,
            (made("soon", 0.0, 0.1045, 0.2, 50.0),),
            Gain.SOONER,
            "soon",
        ),  # half the time, and a period at least
        (SLOW, (made("soon", 0.0, 0.1045, end=51.0),), Gain.SOONER, None),
        (SLOW, (made("soon", 0.0, 0.1055, end=50.0),), Gain.SOONER, None),
        (BOUND, (fired(0.109),), Gain.REAL, "real"),
        (BOUND, (fired(0.111),), Gain.REAL, None),
        (fired(0.1), (fired(0.11),), Gain.REAL, None),
        (
            BOUND,
            (fired(9.0, BLOCK),),
            Gain.COMMANDED,
            "real",
        ),  # whatever it costs: it may be all that can be sent
        (BOUND, (fired(0.2),), Gain.COMMANDED, None),
        (fired(0.1, BLOCK), (fired(0.2, BLOCK),), Gain.COMMANDED, None),
        (
            made("early", 0.0, 0.1, end=PERIOD),
            (made("soon", 0.0, 0.1045, end=0.4 * PERIOD),),
            Gain.SOONER,
            None,
        ),
    ]:
        for plans in ((best, *others), (*reversed(others), best)):
            found = recommend(plans)
            other = gains(present(found.plan), found.rivals).get(gain)
            assert (None if other is None else other.scheme) == named, (best, gain)
            assert found.plan is best or len(best.pulses) == 0


def test_only_what_the_spacecraft_can_fire_is_recommended_unless_named_or_timed() -> None:
    """Where it takes commands: command blocks, and no pulse at all."""
    commands = present(nutdamp.load(case("cbp1004.yaml")).commands)
    given = fired(0.1), fired(0.2, BLOCK), made("none", 0.1, 0.0, pulses=0, required=BOTH)
    bodies = [replace(given[0].spacecraft, commands=one) for one in (None, commands)]
    for_free, commanded = ([replace(one, spacecraft=body) for one in given] for body in bodies)
    assert [one._commandable for one in for_free] == [True] * 3
    assert [one._commandable for one in commanded] == [False, True, True]
    timed, block, none = commanded
    assert Comparison(bodies[0], (for_free[1], for_free[0])).recommended is for_free[0]
    for plans, named, free, eligible in (
        ((timed, block), False, False, (block,)),
        ((timed, block, none), False, False, (block, none)),
        ((timed, block), True, False, (block,)),  # one of those named can be commanded
        ((timed,), True, False, (timed,)),
        ((timed,), False, False, ()),
        ((timed, block), False, True, (timed, block)),
        ((INFEASIBLE, block), False, True, (block,)),
        ((INFEASIBLE,), True, False, ()),
    ):
        compared = Comparison(bodies[1], plans, named=named, timed=free)
        assert compared.eligible == eligible
        assert compared.recommended is (
            min(eligible, key=lambda one: one.pulses.cost) if eligible else None
        )
    # A plan that would comply, were it one that can be fired, is named.
    few = with_shares([timed, replace(block, scheme="block")], "1; 0.5")
    warnings = {each.code: each.values.get("schemes") for each in comparison_warnings(few)}
    assert warnings == {"too-few-cases": None, "blocks-cannot": "real"}
    alone = Comparison(bodies[1], (timed,))
    assert (alone.verdict.status, noted(reasons(alone))) == (Status.NO_PLAN, "no-blocks")


def test_none_is_compared_and_recommended_where_no_pulse_is_needed() -> None:
    for degrees, needless in ((0.4, True), (0.6, False)):
        body = spinner(degrees=degrees, channels=cross(20.0), requirement=HALF_A_DEGREE)
        assert usual(body) == ("none",) * needless + (*catalogue.CLASSIC, "optimal")
        plans = tuple(planning.plan(body, name) for name in ("none", *catalogue.CLASSIC))
        verdict = Comparison(body, plans).verdict
        assert (verdict.status is Status.NO_PULSE, verdict.scheme == "none") == (needless, needless)
    for goal, able in ((Goal(), ()), (SPIN, ()), (Goal(spin=3.3), ("optimal",))):
        body = replace(spinner(channels=cross(20.0)), goal=goal)
        assert all(name in usual(body) for name in able)
        assert "command-block" not in usual(body)


def test_the_notes_on_what_a_plan_gains_and_what_it_is_worse_in() -> None:
    pairs = (
        (SHIFTED, made("still", 0.0, 12.8, 0.01)),
        (MANY, FEW),
        (made("many", 0.0, 0.1, 1.0, pulses=2), made("both", 0.0, 0.104, 0.01, pulses=1)),
        (MANY, made("few", 0.0, 0.104, 0.65, pulses=2)),
        (MANY, made("few", 0.0, 0.104, 0.65, 1.0 + 1.01 * PERIOD, pulses=2)),
        (SLOW, made("soon", 0.0, 0.1045, 0.2, 50.0)),
        (BOUND, fired(0.109)),
        (BOUND, fired(9.0, BLOCK)),
    )
    notes = (noted(alternatives(Comparison(pair[0].spacecraft, pair))) for pair in pairs)
    check_text("plan.hints", "\n".join(notes))


@pytest.mark.deep
def test_optimal_keeps_a_spin_without_a_channel_for_it() -> None:
    assert (
        planning.plan(
            replace(spinner(channels=cross(20.0)), goal=SPIN), "optimal"
        ).meets_requirement
        is True
    )


@pytest.mark.parametrize(
    ("name", "gain"), [deep("magnus-a03", Gain.REAL), weekly("lunar-prospector", Gain.COMMANDED)]
)
def test_examples_have_such_alternatives(name: str, gain: Gain) -> None:
    body = nutdamp.example(name)
    found = compare(body, usual(body), timed=gain is Gain.COMMANDED).recommendation
    best = present(found.plan)
    assert (best.pulses.idealised, bool(best.pulses.blocks)) == (gain is Gain.REAL, False)
    other = gains(best, found.rivals)[gain]
    assert bool(other.pulses.blocks) is (gain is Gain.COMMANDED)
