"""The rule of the recommendation, on plans whose figures are given."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from support.builders import (
    BOTH,
    COUNTS,
    HALF_A_DEGREE,
    INFEASIBLE,
    POINTING,
    Judged,
    chosen,
    cross,
    judged,
    said,
    spinner,
    warned,
)
from support.places import case

import nutdamp
from nutdamp import planning, schemes
from nutdamp.comparison import Comparison, compare, usual
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.planning import Plan
from nutdamp.presentation import verdicts
from nutdamp.recommendation import Gain, Ground, Standing, cheapest, recommend
from nutdamp.remarks import infeasibility
from nutdamp.spacecraft import Goal, Requirement

# --- which plan -----------------------------------------------------------------------------------------------------


def test_nothing_feasible_recommends_nothing() -> None:
    found = recommend([INFEASIBLE])
    assert (found.plan, found.standing, found.ground) == (None, None, None)
    assert chosen() is None
    assert said(INFEASIBLE) == "no scheme is feasible"
    assert warned(INFEASIBLE) == ""


def test_infeasible_plans_are_passed_over() -> None:
    assert chosen(INFEASIBLE, judged("a", 3.0)) == "a"


def test_of_those_that_damp_the_least_propellant() -> None:
    """One per cent of the initial 5° is as good as nothing; what leaves more is not considered, however cheap."""
    clean = judged("clean", 1e-12, propellant=0.2)
    assert chosen(judged("thrifty", 0.99 * COUNTS, propellant=0.1), clean) == "thrifty"
    assert chosen(judged("thrifty", 1.01 * COUNTS, propellant=0.1), clean) == "clean"
    assert chosen(judged("thrifty", 4.9, propellant=0.001), clean) == "clean"


class Straying(Judged):
    """A plan with which the spin axis breaks a cone."""

    @property
    def kept(self) -> bool | None:
        return False


def test_of_plans_that_do_as_much_those_count_that_keep_the_cones() -> None:
    def straying(name: str, nutation: float, propellant: float) -> Plan:
        made = judged(name, nutation, propellant=propellant)
        assert isinstance(made, Judged)
        return Straying(made.spacecraft, name, made.schedule, ended=made.ended)

    damps = judged("damps", 0.0, propellant=0.2)
    found = recommend([straying("thrifty", 0.0, 0.1), damps])
    assert (found.plan, found.count) == (damps, 1)
    assert chosen(straying("thrifty", 0.0, 0.1), judged("keeps", 3.0, propellant=0.2)) == "thrifty"
    assert chosen(straying("thrifty", 0.0, 0.1), straying("dear", 0.0, 0.2)) == "thrifty"


def test_below_a_thousandth_of_a_degree_it_counts_as_damped_whatever_the_initial_nutation() -> None:
    def small(one: Plan) -> Plan:
        return replace(one, spacecraft=spinner(degrees=0.02))

    clean = small(judged("clean", 1e-12, propellant=0.2))
    assert chosen(small(judged("thrifty", 0.99e-3, propellant=0.1)), clean) == "thrifty"
    assert chosen(small(judged("thrifty", 1.01e-3, propellant=0.1)), clean) == "clean"


def test_with_a_target_it_must_be_reached_too() -> None:
    there = judged("there", 1e-12, shift=0.11, propellant=0.2, goal=POINTING)  # 1 % of the turn is 0.1146°
    assert chosen(judged("beside", 1e-12, shift=0.12, propellant=0.1, goal=POINTING), there) == "there"
    assert chosen(judged("near", 1e-12, shift=0.114, propellant=0.1, goal=POINTING), there) == "near"


def test_where_nothing_damps_the_least_nutation_whatever_the_cost() -> None:
    """nothing-damps.yaml: the cheapest plan left 98 % of the nutation."""
    plans = [judged("two", 4.9, propellant=4.0), judged("four", 2.5, propellant=81.0), judged("one", 3.7, propellant=4)]
    assert chosen(*plans) == "four"
    found = recommend(plans)
    assert (found.standing, found.ground, found.count) == (Standing.MISSES, Ground.LEFT, 3)


def test_where_nothing_reaches_the_target_the_least_of_distance_and_nutation() -> None:
    plans = [
        judged("straight", 0.0, shift=9.0, goal=POINTING),
        judged("near", 4.0, shift=3.0, goal=POINTING),
        judged("wobbling", 6.0, shift=1.0, goal=POINTING),
    ]
    assert chosen(*plans) == "near"
    assert said(*plans) == "comes nearest to the target of the 3 feasible plans"


def test_plans_that_meet_the_requirement_come_first() -> None:
    """Even if one that does not leaves less nutation for less propellant."""
    drifting = judged("drifting", 0.01, shift=0.3, propellant=0.1, required=BOTH)
    meeting = judged("meeting", 0.4, shift=0.1, propellant=0.5, required=BOTH)
    assert chosen(drifting, meeting) == "meeting"


def test_of_those_that_meet_the_requirement_the_least_propellant() -> None:
    """The requirement says what is enough: 0.4° is, although it does not count as damped."""
    thrifty = judged("thrifty", 0.4, propellant=0.1, required=HALF_A_DEGREE)
    assert chosen(thrifty, judged("clean", 0.0, propellant=0.2, required=HALF_A_DEGREE)) == "thrifty"


def test_what_a_requirement_does_not_bound_must_be_damped() -> None:
    """Firing nothing keeps H best: that is no way to damp."""
    keep = Requirement(momentum_shift=math.radians(0.2))
    idle = judged("idle", 4.9, propellant=0.0, required=keep)
    damping = judged("damping", 0.01, shift=0.1, propellant=0.5, required=keep)
    assert idle.meets_requirement
    assert chosen(idle, damping) == "damping"
    worse = judged("worse", 3.0, shift=0.1, propellant=0.5, required=keep)
    assert chosen(idle, worse) == "worse"
    assert recommend([idle, worse]).standing is Standing.MEETS
    assert "none of the 2 schemes compared damps the nutation" in warned(idle, worse)


def test_if_none_meets_it_the_least_flown_nutation_whatever_the_cost() -> None:
    one = judged("one", 0.7, propellant=0.1, required=HALF_A_DEGREE)
    two = judged("two", 0.6, propellant=9.0, required=HALF_A_DEGREE)
    assert chosen(one, two) == "two"
    assert warned(one, two).startswith(
        "none of the 2 schemes compared meets the requirement. two leaves 0.6 deg of nutation (0.5 deg req"
    )


def test_if_none_meets_it_and_all_damp_the_nearest_to_the_requirement() -> None:
    """Of two that leave no nutation but for rounding, rounding must not decide."""
    far = judged("far", 1e-12, shift=3.5, propellant=0.1, required=BOTH)
    near = judged("near", 5e-12, shift=0.25, propellant=0.2, required=BOTH)
    assert chosen(far, near) == "near"
    assert "near leaves 0.25 deg of shift of H (0.2 deg required)" in warned(far, near)


def test_costs_within_a_thousandth_are_equal() -> None:
    """12.6312 g against 12.6323 g: both print as 12.63 g, and one ends in half the time."""
    late = judged("late", 0.0, shift=1.0, propellant=12.6312, end=28.0)
    early = judged("early", 0.0, shift=1.0, propellant=12.6323, end=15.0)
    assert chosen(late, early) == "early"
    assert recommend([late, early]).ground is Ground.END
    still = judged("still", 0.0, shift=0.5, propellant=12.6330, end=90.0)
    assert chosen(late, early, still) == "still"
    assert recommend([late, early, still]).ground is Ground.SHIFT
    sooner = judged("sooner", 0.0, shift=0.5, propellant=12.6330, end=80.0)
    assert chosen(late, early, still, sooner) == "sooner"
    assert recommend([late, early, still, sooner]).ground is Ground.SHIFT_END  # early ends before it
    dearer = judged("dearer", 0.0, shift=0.0, propellant=12.6312 * 1.0011, end=1.0)
    assert chosen(late, dearer) == "late"


@pytest.mark.parametrize(
    ("share", "ground", "best"),
    [(1.0005, Ground.END, "early"), (1.002, Ground.COST, "late"), (1.008, Ground.COST, "late")],
)
def test_costs_count_as_equal_within_a_thousandth_and_no_further(share: float, ground: Ground, best: str) -> None:
    late, early = judged("late", 0.0, propellant=1.0, end=9.0), judged("early", 0.0, propellant=share, end=1.0)
    assert recommend([late, early]).ground is ground
    assert chosen(late, early) == best


@pytest.mark.parametrize(
    ("share", "ground", "best"),
    [(1.0, Ground.NOMINAL, "late"), (1.0005, Ground.NOMINAL, "late"), (1.002, Ground.COST, "early")],
)
def test_of_equal_costs_the_plan_for_nominal_values_stays(share: float, ground: Ground, best: str) -> None:
    late, early = judged("late", 0.0, propellant=share, end=9.0), judged("early", 0.0, propellant=1.0, end=1.0)
    plan, why = cheapest([early, late], late)
    assert (plan.scheme, why) == (best, ground)


@pytest.mark.parametrize(
    ("shift", "ground", "best"),
    [
        (0.5e-9, Ground.END, "early"),
        (2e-9, Ground.SHIFT, "late"),
        (1e-6, Ground.SHIFT, "late"),
        (5e-3, Ground.SHIFT, "late"),
    ],
)
def test_shifts_count_as_equal_within_a_nanoradian_and_no_further(shift: float, ground: Ground, best: str) -> None:
    late, early = judged("late", 0.0, end=9.0), judged("early", 0.0, shift=math.degrees(shift), end=1.0)
    assert recommend([late, early]).ground is ground
    assert chosen(late, early) == best


@pytest.mark.parametrize(
    ("required", "nutation", "shift", "ground"),
    [
        (BOTH, 5e-6, 0.2501, Ground.COST),  # 0.04 % more than 0.25° of shift
        (BOTH, 5e-6, 0.251, Ground.NEAREST),
        (Requirement(nutation=math.radians(1e-6)), 5.0005e-6, 0.25, Ground.COST),
        (Requirement(nutation=math.radians(1e-6)), 5.1e-6, 0.25, Ground.NEAREST),  # 1e-7° are no rounding
    ],
)
def test_plans_are_as_near_to_the_requirement_within_a_thousandth(
    required: Requirement, nutation: float, shift: float, ground: Ground
) -> None:
    near = judged("near", 5e-6, shift=0.25, propellant=0.2, required=required)
    cheap = judged("cheap", nutation, shift=shift, propellant=0.1, required=required)
    assert recommend([near, cheap]).ground is ground
    assert chosen(near, cheap) == ("cheap" if ground is Ground.COST else "near")


def test_where_a_propellant_is_not_known_the_impulse_decides() -> None:
    plans = judged("a", 0.0, impulse=3.0, propellant=0.1), judged("b", 0.0, impulse=2.0)
    assert chosen(*plans) == "b"
    assert "least impulse of the 2 plans" in said(*plans)


@pytest.mark.parametrize("degrees", [8, 60])
def test_where_thrusters_are_too_weak_the_plan_that_leaves_least(degrees: int) -> None:
    text = case("nothing-damps.yaml").read_text(encoding="utf-8").replace("8 deg", f"{degrees} deg")
    body = read_spacecraft(text, "nothing-damps.yaml")
    compared = compare(body, schemes.CLASSIC)
    left = {one.scheme: one.flown.nutation for one in compared.plans if one.flown is not None}
    assert compared.recommended is not None
    assert compared.recommended.scheme == min(left, key=lambda name: left[name]) == "four-pulse"
    assert verdicts.reason(compared) == "leaves the least residual nutation of the 3 feasible plans"
    (warning,) = verdicts.warnings(compared)
    assert warning.startswith(
        f"none of the 3 schemes compared damps the nutation. four-pulse leaves "
        f"{math.degrees(left['four-pulse']):.4g} deg"
    )
    assert "each as long as max_on_time allows" in warning
    assert warning.endswith(
        "--scheme optimal was not compared; it can fire several pulses of a channel in each half turn."
    )


# --- the spin of the goal -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("spin", "meets"), [(3.0, True), (3.0029, True), (3.0031, False), (2.9969, False)])
@pytest.mark.parametrize("required", [None, HALF_A_DEGREE])
def test_a_spin_is_part_of_the_requirement(required: Requirement | None, spin: float, meets: bool) -> None:
    one = judged("a", 0.0, required=required, goal=Goal(spin=3.0), spin=spin)
    assert one.meets_requirement is meets
    assert (one.standing is Standing.COMPLIES) == meets


def test_a_plan_that_misses_the_spin_comes_after_one_that_does_not() -> None:
    goal = Goal(spin=3.0)
    cheap = judged("cheap", 0.0, propellant=0.1, goal=goal, spin=3.01)
    assert chosen(cheap, judged("right", 0.0, propellant=0.2, goal=goal)) == "right"
    assert "the spin at 28.743 rpm (28.648 rpm required)" in warned(cheap)


def test_a_scheme_that_cannot_set_the_spin_says_so() -> None:
    body = replace(spinner(channels=cross(20.0)), goal=Goal(spin=3.3))
    compared = compare(body, (*schemes.CLASSIC, "half-cone"))
    assert {one.feasible for one in compared.plans} == {False}
    assert all("cannot set the spin" in infeasibility(one) for one in compared.plans)
    assert "optimal" in usual(body)
    assert planning.plan(body, "none").meets_requirement is False
    kept = replace(body, goal=Goal(spin=3.0))
    assert planning.plan(kept, "two-pulse").meets_requirement is True
    assert usual(kept) == (*schemes.CLASSIC, "optimal")


def test_a_spin_that_is_kept_by_itself_takes_no_channel() -> None:
    body = replace(spinner(channels=cross(20.0)), goal=Goal(spin=3.0))
    assert planning.plan(body, "optimal").meets_requirement is True


def test_without_nutation_a_spin_to_set_is_something_to_do() -> None:
    body = replace(spinner(degrees=0.0, channels=cross(20.0)), goal=Goal(spin=3.3))
    assert not planning.plan(body, "four-pulse").feasible
    assert planning.plan(replace(body, goal=Goal(spin=3.0)), "four-pulse").meets_requirement is True


# --- keeping H ------------------------------------------------------------------------------------------------------


def test_a_plan_that_keeps_h_for_little_more_is_mentioned() -> None:
    cheap = judged("cheap", 0.0, shift=1.8, propellant=12.0)
    assert recommend([cheap, judged("still", 0.0, shift=0.35, propellant=13.1)]).alternatives
    for shift, propellant in ((0.37, 13.1), (0.35, 13.3)):
        assert (
            Gain.STEADIER
            not in recommend([cheap, judged("still", 0.0, shift=shift, propellant=propellant)]).alternatives
        )
    compared = Comparison(cheap.spacecraft, (cheap, judged("still", 0.0, shift=0.01, propellant=12.8)))
    assert verdicts.hints(compared) == (
        "still shifts H by 0.01 deg instead of 1.8 deg, for 800 g more propellant (6.7 %).",
    )


def test_of_plans_that_keep_h_for_little_more_the_cheapest_is_mentioned() -> None:
    best = judged("best", 0.0, shift=1.0, propellant=0.1)
    dear, cheap = (judged(name, 0.0, shift=0.1, propellant=cost) for name, cost in (("dear", 0.108), ("cheap", 0.105)))
    for plans in ((best, dear, cheap), (best, cheap, dear)):
        assert recommend(plans).alternatives[Gain.STEADIER] is cheap


def test_a_plan_of_half_the_pulses_for_little_more_is_mentioned() -> None:
    many = judged("many", 0.0, propellant=0.1, pulses=10)
    few = judged("few", 0.0, propellant=0.1049, pulses=5)
    found = Comparison(many.spacecraft, (many, few))
    assert found.recommended is many
    assert verdicts.hints(found) == ("few takes 5 pulses instead of 10, for 4.9 g more propellant (4.9 %).",)
    shares = {"many": 0.352, "few": 0.67}
    (hint,) = verdicts.hints(found, shares)
    assert hint.endswith("(4.9 %); 67.0 % instead of 35.2 % of cases comply.")
    assert verdicts.hints(found, {"many": 1.0, "few": 1.0}) == verdicts.hints(found), "what is equal is no reason"
    for pulses, propellant in ((6, 0.1049), (5, 0.1051)):
        other = judged("few", 0.0, propellant=propellant, pulses=pulses)
        assert Gain.SIMPLER not in recommend([many, other]).alternatives
    single = judged("single", 0.0, propellant=0.101, pulses=1)
    assert recommend([many, few, single]).alternatives[Gain.SIMPLER] is single
    both = judged("both", 0.0, shift=0.01, propellant=0.104, pulses=1)
    (hint,) = verdicts.hints(
        Comparison(many.spacecraft, (judged("many", 0.0, shift=1.0, propellant=0.1, pulses=2), both))
    )
    assert hint.startswith("both shifts H by 0.01 deg instead of 1 deg and takes 1 pulse instead of 2, for 4 g more")
    (hint,) = verdicts.hints(
        Comparison(many.spacecraft, (many, judged("few", 0.0, shift=0.65, propellant=0.104, pulses=2)))
    )
    assert hint.endswith("(4 %); but it shifts H by 0.65 deg instead of 0 deg."), "what it is worse in"
    slow = judged("few", 0.0, shift=0.65, propellant=0.104, pulses=2, end=1.0 + 1.01 * many.spacecraft.inertial_period)
    (hint,) = verdicts.hints(Comparison(many.spacecraft, (many, slow)))
    assert hint.endswith(f"instead of 0 deg and ends at {slow.pulses.end:.3f} s instead of 1.000 s.")
    nothing = judged("a", 0.0, pulses=0), judged("b", 0.0, pulses=0)
    assert Gain.SIMPLER not in recommend(nothing).alternatives


def test_a_plan_that_ends_far_sooner_for_little_more_is_mentioned() -> None:
    """Half the time at most, and a nutation period at least."""
    late = judged("late", 0.0, propellant=0.1, end=100.0)
    period = late.spacecraft.inertial_period
    soon = judged("soon", 0.0, shift=0.2, propellant=0.1045, end=50.0)
    (hint,) = verdicts.hints(Comparison(late.spacecraft, (late, soon)))
    assert hint == (
        "soon ends at 50.000 s instead of 100.000 s, for 4.5 g more propellant (4.5 %); but it shifts H by 0.2 deg "
        "instead of 0 deg."
    )
    for end, propellant in ((51.0, 0.1045), (50.0, 0.1055)):
        assert not recommend([late, judged("soon", 0.0, propellant=propellant, end=end)]).alternatives
    early = judged("early", 0.0, propellant=0.1, end=period)
    assert not recommend([early, judged("soon", 0.0, propellant=0.1045, end=0.4 * period)]).alternatives


def test_beside_ideal_impulses_a_plan_of_real_widths_is_mentioned() -> None:
    """They cost the same within 0.1 %, and the one that ends first is recommended: it cannot be fired as it stands."""
    body = nutdamp.example("magnus-a03")
    found = compare(body, usual(body))
    assert found.recommended is not None
    assert found.recommended.pulses.idealised
    real = found.recommendation.alternatives[Gain.REAL]
    assert not real.pulses.idealised
    (hint,) = [one for one in verdicts.hints(found) if "real pulse widths" in one]
    assert hint.startswith(f"{real.scheme} fires real pulse widths")
    without = recommend([one for one in found.plans if not one.pulses.idealised])
    assert Gain.REAL not in without.alternatives


def test_where_the_file_has_commands_the_plan_of_command_blocks_is_mentioned_whatever_it_costs() -> None:
    body = nutdamp.example("lunar-prospector")
    found = compare(body, usual(body))
    assert found.recommended is not None
    assert not found.recommended.pulses.blocks
    (hint,) = [one for one in verdicts.hints(found) if "blocks" in one]
    assert hint.startswith("command-block can be sent as command blocks, which optimal cannot, for ")
    assert " g more propellant (7.7 %); but it shifts H by " in hint
    assert ", leaves 0.1318 deg of nutation instead of < 1e-9 deg and ends at " in hint
    only = recommend([one for one in found.plans if one.scheme == "command-block"])
    assert Gain.COMMANDED not in only.alternatives


def test_only_a_plan_that_damps_as_well_is_mentioned() -> None:
    cheap = judged("cheap", 0.0, shift=1.8, propellant=12.0)
    assert Gain.STEADIER not in recommend([cheap, judged("idle", 4.0, shift=0.0, propellant=12.5)]).alternatives
    wandering = judged("cheap", 0.0, shift=0.11, propellant=12.0, goal=POINTING)
    pointing = judged("still", 0.0, shift=0.0, propellant=12.5, goal=POINTING)
    assert Gain.STEADIER not in recommend([wandering, pointing]).alternatives  # with a target H shall not stay


# --- rounding does not decide ---------------------------------------------------------------------------------------


def test_of_plans_that_leave_nothing_but_rounding_the_cheapest() -> None:
    """Where nothing meets a requirement below what a flight resolves, and where another part of it is missed."""
    tiny = Requirement(nutation=math.radians(1e-13))
    noisy = judged("noisy", 2e-12, propellant=0.1, required=tiny)
    quiet = judged("quiet", 3e-13, propellant=0.2, required=tiny)
    assert chosen(quiet, noisy) == "noisy"
    assert recommend([quiet, noisy]).ground is Ground.COST
    assert said(quiet, noisy).endswith("feasible plans, within 0.001 deg; of these least propellant")
    shifting = Requirement(nutation=math.radians(1e-13), momentum_shift=math.radians(0.1))
    dear = judged("dear", 1e-13, shift=0.3, propellant=0.2, required=shifting)
    assert chosen(dear, judged("cheap", 0.0, shift=0.3, propellant=0.1, required=shifting)) == "cheap"


def test_what_was_nearest_to_the_requirement_does_not_claim_least_nutation() -> None:
    far = judged("far", 1e-12, shift=3.5, propellant=0.1, required=BOTH)
    near = judged("near", 5e-12, shift=0.25, propellant=0.2, required=BOTH)
    assert said(far, near) == "comes nearest to the requirement of the 2 feasible plans"
