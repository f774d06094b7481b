"""Every scheme under any limits ends: a feasible plan keeps them all and comes nearer, an
infeasible one says why.
"""

import itertools
import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.builders import (
    HALF_A_DEGREE,
    Outcome,
    aimed,
    channel,
    codes,
    cross,
    fan,
    judged,
    one_of,
    present,
    spinner,
    within,
)
from support.cases import spread
from support.checker import violations
from support.places import case
from support.random_bodies import disturbed_spacecraft, power, random_spacecraft

import nutdamp
from nutdamp.errors import Infeasible
from nutdamp.files.reader import load_spacecraft
from nutdamp.flight import propagation
from nutdamp.planning import plan as planning
from nutdamp.planning.causes import infeasibility
from nutdamp.planning.decision import Comparison, compare, usual
from nutdamp.planning.notes import comparison_warnings, plan_notes
from nutdamp.planning.plan import Plan, Standing
from nutdamp.planning.screening import FlownPlan
from nutdamp.planning.verdict import Cases, Status
from nutdamp.schemes.catalogue import CLASSIC, LEAST, Options
from nutdamp.schemes.sequential import MOST_PULSES, ImpulseBuilder
from nutdamp.spacecraft.constraints import Windows
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Disturbance, Limits, Requirement, Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import TOUCHING, Schedule, channel_pulse

PLENTY = 3_000_000
"""Calls of functions; most plans take a tenth of that, so that an endless search fails,
not hangs.
"""

DAMPING = {
    "one-pulse": ("one-pulse", Options()),
    "two-pulse": ("two-pulse", Options()),
    "two-pulse, literal": ("two-pulse", Options(literal=True)),
    "four-pulse": ("four-pulse", Options()),
    "four-pulse, coarse": ("four-pulse", Options(coarse=True)),
}
POINTING = ["two-pulse", "half-cone", "rhumb-line"]
Requested = tuple[str, Options]


def check(
    body: Spacecraft, scheme: str, options: Options | None = None, most: int = 3 * PLENTY
) -> planning.Plan:
    with within(most):
        plan = planning.plan(body, scheme, options)
        left, residual = plan.flown, plan.residual
        figures = (left, residual, plan._delta_v, plan._spin_change, plan.meets_requirement)
    assert plan.feasible == (infeasibility(plan) == "")
    if not plan.feasible:
        assert (len(plan.pulses), figures) == (0, (None,) * 5)
        return plan
    assert violations(body, plan.pulses) == []
    assert all(two.t > one.t for one, two in itertools.pairwise(plan.pulses))
    assert left is not None
    for angles in (left, present(residual)):
        assert np.isfinite(
            [angles.nutation, angles.body_cone, angles.space_cone, angles.momentum_shift]
        ).all()
    if body.inertia.symmetric and not body.disturbances and plan._spin_change is not None:
        # After a long wait the clock tells the width of a pulse to its own rounding only.
        slips = [
            abs(one.impulse[2]) * 4 * np.spacing(one.end) / one.on_time
            for one in plan.pulses
            if one.on_time
        ]
        change = math.fsum(one.impulse[2] for one in plan.pulses)
        rounding = 1e-9 * abs(body.spin) * body.inertia.C
        assert plan._spin_change * body.inertia.C == pytest.approx(
            change, abs=rounding + sum(slips)
        )
    if body.goal.axis is None:
        # Where ω stands still in the body, each of two channels beside it fires a pair.
        pairs = {2} if body.nutation_rate != 0.0 else {2, 4}
        assert len(plan.pulses) in pairs if scheme == "two-pulse" else len(plan.pulses) > 0
        assert left.nutation < body.nutation
        assert plan._spin_change is not None
        return plan
    requested = body.nutation + body.to_turn
    assert left.nutation < body.nutation or left.axis_error < body.to_turn or requested < 1e-12
    if body.inertia.symmetric:
        assert (
            max(left.nutation, left.axis_error)
            <= (0.05 if body.limits.tick is None else 0.5) * requested
        )
    return plan


@spread("requested", DAMPING.values(), quick=1, deep=2, ids=DAMPING)
@spread("block", range(20), quick=1, deep=1)
def test_whatever_the_limits(block: int, requested: Requested) -> None:
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
    "tick of a nanosecond": Limits(
        tick=1e-9, earliest=1.0 / 3.0, blackout=((1.0, 2.0 / 3.0 + 1.0),)
    ),
    "horizon too short for anything": Limits(horizon=1e-3),
    "earliest at the end": Limits(earliest=124.0),
    "earliest after the default horizon": Limits(earliest=1e9),
    "gap longer than the horizon": Limits(gap=1e6),
    "all dark": Limits(blackout=((0.0, 1e9),)),
    "hundred dark windows": Limits(blackout=tuple((0.7 * n, 0.7 * n + 0.6) for n in range(100))),
    "dark but for moments": Limits(
        blackout=tuple((0.7 * n, 0.7 * n + 0.69999) for n in range(1000))
    ),
    "windows of no length": Limits(blackout=tuple((0.1 * n, 0.1 * n) for n in range(200))),
    "one pulse": Limits(max_pulses=1),
    "a year": Limits(horizon=3.2e7, gap=3600.0),
}


@spread("requested", DAMPING.values(), quick=1, ids=DAMPING)
@spread("hard", HARD.values(), quick=1, ids=HARD)
def test_awkward_limits(hard: Limits, requested: Requested) -> None:
    for actuators in (cross(20.0), cross(0.5, min_on_time=0.02, max_on_time=0.3), fan(24, 3.0)):
        check(spinner(channels=actuators, limits=hard), *requested)
    for torque in (None, 50.0, 0.5) if requested[0] != "four-pulse" else ():
        check(spinner(steerable=Steerable(torque), limits=hard), *requested)


@spread("scheme", POINTING, quick=1, deep=1)
@spread("hard", HARD.values(), quick=1, deep=1, ids=HARD)
def test_awkward_limits_with_a_target(hard: Limits, scheme: str) -> None:
    for actuators in ({"channels": cross(60.0)}, {"steerable": Steerable(60.0)}, {}):
        check(aimed(spinner(limits=hard, **actuators), 10.0, 45.0), scheme)


@pytest.mark.parametrize("requested", DAMPING.values(), ids=DAMPING)
def test_units_do_not_matter(requested: Requested) -> None:
    """Inertia and torques scaled together: the same pulses. Spin × s, torques × s²: the same pulses
    s times as fast.
    """
    plain = planning.plan(spinner(channels=cross(20.0)), *requested)
    for mass, rate in ((1e-12, 1.0), (1e9, 1.0), (1.0, 1e-6), (1.0, 1e3)):
        body = spinner(120.0 * mass, 80.0 * mass, 3.0 * rate, channels=cross(20.0 * mass * rate**2))
        scaled = planning.plan(body, *requested)
        assert scaled.feasible == plain.feasible
        for one, other in zip(plain.pulses, scaled.pulses, strict=True):
            assert other.channel == one.channel
            assert (other.t * rate, other.on_time * rate) == pytest.approx(
                (one.t, one.on_time), rel=1e-8
            )


@pytest.mark.deep
@pytest.mark.parametrize("requested", DAMPING.values(), ids=DAMPING)
@spread("degrees", [1e-9, 1e-6, 1e-3, 70.0, 89.0], quick=2)
def test_nutation_from_next_to_nothing_to_next_to_a_right_angle(
    degrees: float, requested: Requested
) -> None:
    for C, spin in ((40.0, 3.0), (80.0, -3.0), (120.0, 3.0), (240.0, -3.0)):
        torque = spinner(120.0, C, spin, degrees).least_impulse * 3.0
        check(spinner(120.0, C, spin, degrees, channels=cross(torque)), *requested)
        if requested[0] != "four-pulse":
            check(spinner(120.0, C, spin, degrees, steerable=Steerable(torque)), *requested)


@spread(
    "requested",
    [DAMPING[name] for name in ("one-pulse", "two-pulse", "two-pulse, literal")],
    quick=1,
)
@spread("torque", [30.0, 100.0], quick=1)
@spread("moments", [(120.0, 100.0, 80.0), (80.0, 70.0, 120.0)], quick=1, ids=["prolate", "oblate"])
def test_torquer_on_a_body_of_three_different_moments_keeps_the_limits(
    moments: tuple[float, float, float], torque: float, requested: Requested
) -> None:
    """Going from the symmetric model to the body changes on-times, and must not move starts out of
    the limits.
    """
    windows = Limits(blackout=((0.0, 3.0),))
    for limits in (
        Limits(tick=0.01),
        Limits(earliest=2.0),
        Limits(earliest=2.0, tick=0.1),
        windows,
    ):
        plan = planning.plan(
            spinner(moments=moments, steerable=Steerable(torque), limits=limits), *requested
        )
        assert plan.feasible, infeasibility(plan)
        assert violations(plan.spacecraft, plan.pulses) == []


TRUE_BODIES = {
    "I1 ≠ I2": spinner(moments=(120.0, 100.0, 80.0), degrees=4.0),
    "axial disturbance": replace(spinner(degrees=4.0), disturbances=(Disturbance(0.0j, 0.05),)),
    "dissipation": replace(spinner(degrees=4.0), dissipation=40.0),
}


@spread("scheme", POINTING, quick=1)
@spread("true_body", TRUE_BODIES.values(), quick=1, ids=TRUE_BODIES)
def test_what_the_model_does_not_know_is_trimmed(true_body: Spacecraft, scheme: str) -> None:
    for body in (
        replace(true_body, channels=cross(60.0)),
        replace(true_body, steerable=Steerable(60.0)),
    ):
        left = present(
            planning.plan(aimed(body, 12.0, 45.0), scheme, Options(with_disturbances=True)).flown
        )
        assert max(left.nutation, left.axis_error) < 1e-9


@pytest.mark.weekly
@pytest.mark.parametrize("scheme", ["half-cone", "rhumb-line"])
@pytest.mark.parametrize("horizon", [0.6, 1.5, 6.0])
def test_the_horizon_that_is_named_is_long_enough_for_the_whole_plan(
    scheme: str, horizon: float
) -> None:
    """What was named covered the pulses that damp the nutation first, and the way to the target had
    no room.
    """
    body = aimed(
        spinner(channels=cross(20.0, max_on_time=2.0), limits=Limits(horizon=horizon)), 20.0, 45.0
    )
    why = infeasibility(planning.plan(body, scheme))
    named = present(re.search(r"limits\.horizon = (\S+) s is long enough$", why))
    assert planning.plan(replace(body, limits=Limits(horizon=float(named[1]))), scheme).feasible
    assert all(float(number) == horizon for number in re.findall(r"horizon of (\S+) s", why)), why


def at(name: str) -> Spacecraft:
    return load_spacecraft(case(f"{name}.yaml"))


ODD: list[dict[str, Any]] = [{"max_on_time": 0.05}, {"min_on_time": 0.12, "max_on_time": 0.19}]
RUNS_AWAY = (
    channel("T0", 0.0, 0.07812199696304258, 0.0),
    channel(
        "T1",
        0.0017921515598551382,
        -0.004499826153832031,
        0.00026736933327888593,
        min_on_time=0.0352,
    ),
    channel(
        "T2",
        -0.0058350853171264165,
        -0.022754617512655954,
        0.00035239014198196254,
        min_on_time=0.0038,
    ),
)
LATE = Limits(horizon=2194.4435233461004, earliest=1844.9859185150808)
ENDLESS = {
    # Closings of H, half turns and trials of two-pulse are not laid out one by one.
    **{
        f"a = {a}": ("two-pulse", spinner(120.0, 120.0 * (1 - a), channels=cross(8.0)), None)
        for a in (1e-6, 1e-15)
    },
    "116 days": ("two-pulse", spinner(channels=cross(8.0), limits=Limits(horizon=1e7)), True),
    "116 dark days": (
        "two-pulse",
        spinner(steerable=Steerable(8.0), limits=Limits(horizon=1e7, blackout=((0.0, 1e7),))),
        False,
    ),
    # On-times and moments are bounded, so that no trial flies for 10⁵ s under torque.
    "runs away": (
        "two-pulse",
        spinner(
            27.184196833257793,
            54.36839366651559,
            0.1298681271574343,
            2.4666967171796332,
            0.0,
            channels=RUNS_AWAY,
            limits=LATE,
        ),
        None,
    ),
    # Such a pulse ends within the slack for rounding: the next alignment was the same one, again
    # and again.
    **{
        f"nanosecond {scheme}": (scheme, at("crash-max-on-time-1e-9-hang"), True)
        for scheme in CLASSIC
    },
    # Thrusters whose torque about axis 3 spins a needle up to hundreds of turns a minute: minutes,
    # before.
    **{f"89° {scheme}": (scheme, at("slow-89-deg"), None) for scheme in CLASSIC},
    # No gain, no further pulse.
    "weak": (
        "four-pulse",
        spinner(channels=(channel("weak", 1e-30, 0.0, 0.0, max_on_time=0.1),)),
        None,
    ),
    # A tick longer than a channel may fire, or no multiple of it within the bounds: that channel is
    # left out.
    **{
        f"odd {number}": (
            "four-pulse",
            spinner(
                channels=(*cross(3.0), channel("odd", 2.0, 2.0, 0.0, **times)),
                limits=Limits(tick=0.1),
            ),
            True,
        )
        for number, times in enumerate(ODD)
    },
}


@spread(("scheme", "body", "feasible"), ENDLESS.values(), quick=4, deep=99, ids=ENDLESS)
def test_what_was_searched_for_ever_is_planned_or_declined(
    scheme: str, body: Spacecraft, feasible: bool | None
) -> None:
    plan = check(body, scheme, most=10 * PLENTY)
    assert feasible is None or plan.feasible == feasible
    assert all(pulse.channel != "odd" for pulse in plan.pulses)


def test_alignments_that_a_disturbance_moves_before_the_gap_is_over_are_passed_by() -> None:
    """They were awaited in steps of a nanosecond."""
    left = present(
        check(at("never-returns"), "four-pulse", Options(with_disturbances=True), PLENTY).flown
    )
    assert left.nutation < 1e-9


@pytest.mark.deep
@spread("scheme", ["one-pulse", "four-pulse"], quick=1)
def test_no_more_pulses_are_laid_than_anybody_commands(scheme: str) -> None:
    body = spinner(channels=cross(8.0, max_on_time=1e-4), limits=Limits(horizon=1e7))
    with within(10 * PLENTY):
        plan = planning.plan(body, scheme)
    assert len(plan.pulses) == MOST_PULSES
    assert one_of(plan_notes(plan), "most-pulses")["pulses"] == MOST_PULSES


@pytest.mark.deep
def test_the_next_alignment_is_found_or_given_up() -> None:
    pulses = 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        body = disturbed_spacecraft(rng)
        builder = ImpulseBuilder(body)
        for one in body.channels:
            on_time = power(rng, -6, 0) * min(body.body_period, body.inertial_period)
            for _ in range(3):
                with within(200_000):
                    pulse = builder.align(one, on_time)
                if pulse is None:
                    break
                assert pulse.start >= builder.ready - TOUCHING, seed
                assert not builder.pulses or pulse.t > builder.now, seed
                assert builder.windows.allows(pulse.start, pulse.on_time, builder.ready), seed
                pulses += 1
                builder.fire(pulse)
    assert pulses > 500


@given(
    st.floats(0.0, 1e6),
    st.sampled_from([1e-9, 1e-3, 0.1, 0.25, 1.0 / 3.0, 1.7]),
    st.lists(
        st.tuples(st.integers(0, 10_000), st.sampled_from([-2, -1, -0.5, 0, 0.5, 1, 2])),
        max_size=20,
    ),
)
def test_windows_that_end_beside_a_tick_are_left_behind(
    ready: float, tick: float, holes: list[tuple[int, float]]
) -> None:
    """An end a slack beside a tick is where rounding may call the tick neither before it nor after
    it.
    """
    blackout = tuple(
        (number * tick, (number + 3) * tick + part * TOUCHING) for number, part in holes
    )
    windows = Windows(spinner(limits=Limits(horizon=1e9, tick=tick, blackout=blackout)))
    with within(20_000):
        start = windows.earliest_start(0.5 * tick, ready)
    assert windows.allows(present(start), 0.5 * tick, ready)


@pytest.mark.weekly
@spread("degrees", [89.9, 89.999], quick=1, deep=1)
def test_up_to_a_right_angle_every_scheme_answers(degrees: float) -> None:
    for body in (
        spinner(degrees=degrees, channels=cross(5e3)),
        spinner(degrees=degrees, steerable=Steerable(1e4)),
    ):
        for scheme in (*CLASSIC, "half-cone", "rhumb-line"):
            with within(10 * PLENTY):
                plan = planning.plan(body if scheme in CLASSIC else aimed(body, 30.0, 10.0), scheme)
                assert (plan.flown is None) == (infeasibility(plan) != "")


@pytest.mark.weekly
def test_a_planned_schedule_is_flown_in_so_many_steps_and_a_track_in_more() -> None:
    """One pulse that spins a needle up to turn after turn."""
    body = spinner(2.0, 2e-4, spin=1e-3, degrees=60.0)
    screw = channel("screw", 1e-5, 0.0, 1e-4)
    with pytest.raises(Infeasible, match="too many steps"):
        propagation.flown(body, Schedule((channel_pulse(screw, 500.0, 1000.0),)))
    assert (
        0
        < propagation.flown(body, Schedule((channel_pulse(screw, 50.0, 100.0),))).steps
        <= propagation.PLANNED_STEPS
    )
    tumbling = spinner(moments=(100.0, 120.0, 80.0), degrees=5.0)
    assert propagation.flown(tumbling, Schedule(), 30_000.0).steps > propagation.PLANNED_STEPS


# --- no plan beats the recommended one in all that counts

COUNT = 200


def draw(number: int) -> Spacecraft:
    """With a requirement in half of the cases, a target in a tenth."""
    rng = np.random.default_rng([2024, number])
    body = random_spacecraft(rng)
    requirement = None
    if rng.random() < 0.5:
        nutation = body.nutation * power(rng, -3.0, -0.3) if rng.random() < 0.85 else None
        shift = (
            body.nutation * power(rng, -2.0, 0.0) if rng.random() < 0.5 or not nutation else None
        )
        requirement = Requirement(nutation, shift)
    body = replace(body, requirement=requirement)
    return (
        aimed(body, rng.uniform(1.0, 30.0), rng.uniform(0.0, 360.0)) if rng.random() < 0.1 else body
    )


def cost(plan: Plan, others: tuple[Plan, ...]) -> float:
    """Propellant in kg where all know it, else impulse in N m s."""
    known = [plan.pulses.propellant, *(one.pulses.propellant for one in others)]
    return plan.pulses.total_impulse if None in known else known[0] or 0.0


def left(plan: Plan) -> tuple[float, float]:
    return present(plan.flown).nutation, present(plan.flown).axis_error


def complies(body: Spacecraft, nutation: float, distance: float) -> bool:
    """The rule, written down again: the requirement, and what counts as damped where it says
    nothing.
    """
    requirement = body.requirement or Requirement()
    least = math.radians(1e-3)
    most, far = requirement.nutation, requirement.momentum_shift
    if far is None:
        far = math.inf if body.goal.axis is None else max(0.01 * body.to_turn, least)
    return (
        nutation <= (max(0.01 * body.nutation, least) if most is None else most) and distance <= far
    )


def standing(number: int, compared: Comparison) -> Standing | None:
    """What the recommended plan reaches, once it is seen that none beats it and that what is said
    of it is so.
    """
    body = compared.spacecraft
    chosen = compared.recommended
    warnings = [*comparison_warnings(compared)]
    assert not compared.failed, (number, [one._failure for one in compared.failed])
    feasible = tuple(one for one in compared.plans if one.flown is not None)
    if chosen is None or chosen.flown is None:
        assert not feasible
        return None
    for (
        other
    ) in feasible:  # none leaves no more of anything and costs less, by more than counts as equal
        no_more = all(theirs <= own for theirs, own in zip(left(other), left(chosen), strict=True))
        cheaper = cost(other, feasible) < cost(chosen, feasible) * (1.0 - 1e-3)
        assert not (no_more and cheaper), (number, chosen.scheme, other.scheme)
    good = [one for one in feasible if complies(body, *left(one))]
    assert (chosen in good) == bool(good) != bool(warnings), number
    aim = 0.0 if body.goal.axis is None else body.to_turn
    assert compared.verdict.idle == complies(body, body.nutation, aim), number
    if good:
        assert cost(chosen, tuple(good)) <= 1.001 * min(cost(one, tuple(good)) for one in good)
        return chosen._standing
    counts = (
        1 if body.goal.axis is None else 2
    )  # the nutation, or the distance from a target where that is more
    alike = [max(left(one)[:counts]) for one in feasible if one._standing is chosen._standing]
    assert max(left(chosen)[:counts]) <= min(alike) + math.radians(1e-3), number
    missed = [
        entry.values for entry in warnings if entry.code in ("requirement-missed", "not-damped")
    ]
    assert missed, number
    for values in missed:
        left_deg = math.degrees(left(chosen)[values["part"] != Part.NUTATION.label])
        assert values["left_deg"] == pytest.approx(left_deg), number
    untried = body.channels and all(one.scheme != "optimal" for one in compared.plans)
    assert ("optimal-not-compared" in codes(warnings)) == bool(untried), number
    return chosen._standing


@pytest.mark.weekly
def test_nothing_beats_what_is_recommended_and_what_is_said_of_it_is_so() -> None:
    """Its residuals too, by an integrator that shares nothing with the flights here."""
    standings = []
    flown = 0
    for number in range(COUNT):
        body = draw(number)
        # The rule does not know schemes by name.
        compared = compare(body, [name for name in usual(body) if name != "optimal"], Options())
        standings.append(standing(number, compared))
        chosen = compared.recommended
        if number % 7 or chosen is None or body.goal.axis is not None or len(chosen.pulses) > 30:
            continue
        outcome = Outcome(body, chosen.pulses)
        flown = flown + 1
        surely, hardly = (
            complies(
                body, *(angle * (1 + off) + off for angle in (outcome.nutation, outcome.shift))
            )
            for off in (1e-8, -1e-8)
        )
        assert surely <= (chosen._standing is Standing.COMPLIES) <= hardly
    assert flown > 20
    # Each kind of outcome is there, and often.
    assert min(standings.count(Standing.COMPLIES), standings.count(Standing.MISSES)) > COUNT // 5
    assert standings.count(None) < COUNT // 3


@pytest.mark.weekly
@pytest.mark.parametrize("number", range(0, COUNT, 15))
def test_nor_where_optimal_is_compared_too(number: int) -> None:
    body = draw(number)
    standing(number, compare(body, tuple(dict.fromkeys((*usual(body), "optimal")))))


# --- `plan` says what `disperse` says, and recommends what takes least

SCHEMES = ("one-pulse", "two-pulse", "four-pulse")


def tolerant(seed: int) -> Spacecraft:
    """The built-in example with other moments, motion, tolerances and requirement: some plans
    comply, others do not.
    """
    rng = np.random.default_rng(seed)
    size = float(10.0 ** rng.uniform(-1.0, 0.0))
    requirement: dict[str, Any] = {"nutation": f"{rng.uniform(0.2, 0.8)} deg"}
    if rng.random() < 0.5:
        requirement["momentum_shift"] = f"{rng.uniform(0.1, 1.0)} deg"
    return nutdamp.example().with_(
        inertia={"A": 120.0, "C": 120.0 * rng.uniform(0.4, 1.6)},
        state={
            "spin": f"{rng.choice([-20, 30])} rpm",
            "nutation": f"{rng.uniform(2.0, 8.0)} deg",
            "phase": "40 deg",
        },
        requirement=requirement | {"probability": float(rng.choice([0.9, 0.99, 0.997]))},
        dispersions={
            "A": {"normal": f"{0.5 * size} %"},
            "omega0": {"normal": f"{0.1 * size} deg/s"},
            "thrust": {"normal": f"{2.0 * size} %"},
            "timing": {"uniform": "5 ms"},
        },
    )


@spread("seed", range(100), quick=1, deep=5)
def test_plan_and_disperse_say_the_same(seed: int) -> None:
    """Of the plan recommended, all; of the others as far as their cases were flown."""
    compared = compare(tolerant(seed), SCHEMES, samples=4_000)
    verdict = compared.verdict
    recommended = present(compared.recommended)
    for plan in compared:
        cases = compared.verdicts[plan].cases
        if cases is None:
            continue
        flown = nutdamp.disperse(plan, 4_000).verdict
        if plan is recommended:
            assert (verdict.status, verdict.lines, verdict.cases) == (
                flown.status,
                flown.lines,
                present(flown.cases),
            )
        if cases.enough is not None:
            assert compared.verdicts[plan].status is flown.status, plan.scheme
        assert cases.low <= (present(flown.cases).complying or 0.0) <= cases.high
    complying = [plan for plan in compared if compared.verdicts[plan].met]
    if complying:
        assert recommended in complying
        assert recommended.pulses.cost <= min(plan.pulses.cost for plan in complying) * 1.001


PLANS = st.lists(
    st.tuples(
        st.floats(0.0, 0.8),
        st.floats(0.1, 2.0),
        st.floats(1.0, 9.0),
        st.integers(1, 4),
        st.floats(0.99, 1.0),
    ),
    min_size=1,
    max_size=6,
)


@given(PLANS, st.sampled_from(LEAST))
def test_of_the_plans_that_meet_the_one_that_takes_least_is_recommended(
    figures: list[tuple[float, float, float, int, float]], least: str
) -> None:
    """By brute force: what is saved within a thousandth, then propellant; half a degree may be
    left.
    """
    flown = {}
    for left, cost, end, pulses, low in figures:
        plan = judged(
            "any",
            left,
            propellant=cost,
            impulse=cost,
            end=end,
            pulses=pulses,
            required=HALF_A_DEGREE,
        )
        flown[plan] = FlownPlan(plan, None, cases=Cases(2_048, 1, 0.997, low, low, 1.0))
    compared = Comparison(next(iter(flown)).spacecraft, tuple(flown), flown, least=least)
    meeting = [
        plan
        for plan, each in flown.items()
        if plan.flown and each.cases.low >= 0.997 and plan._ends_well
    ]
    assert (compared.verdict.status is Status.FLY) is bool(meeting)
    if meeting:
        measure = {"propellant": "propellant", "impulse": "total_impulse", "time": "end"}.get(least)
        spent = [len(plan) if measure is None else getattr(plan, measure) for plan in meeting]
        equal = [
            plan
            for plan, amount in zip(meeting, spent, strict=True)
            if amount <= min(spent) * 1.001
        ]
        assert compared.recommended in equal
        assert compared.verdict.schedule.cost <= min(plan.pulses.cost for plan in equal) * 1.001
