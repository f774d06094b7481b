"""Notes on plans and decisions, as data: codes of the sentences of ``guide/notes.md``, with their
values.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from nutdamp.common.numerics import RPM, down
from nutdamp.common.results import Note, Value, note
from nutdamp.errors import NotFound, NutdampError
from nutdamp.flight.propagation import Flight
from nutdamp.physics import inertia as principal_moments
from nutdamp.planning.decision import (
    ROBUST,
    TIES,
    Comparison,
    Ground,
    attempt,
    cost_unit,
    off_target,
)
from nutdamp.planning.plan import Plan, Standing
from nutdamp.planning.verdict import Verdict
from nutdamp.schemes import catalogue
from nutdamp.schemes.catalogue import OPTIMAL, OptimalOptions
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import WASTEFUL, worths
from nutdamp.spacecraft.equipment import ANGLE
from nutdamp.spacecraft.model import LIGHTER, Spacecraft
from nutdamp.spacecraft.requirements import DAMPED_ANGLE, Part

if TYPE_CHECKING:
    from nutdamp.flight.cones import Aspect

# percent above the bound of small angles from which a plan of optimal is told to be dear on every
# screen: schedules of few pulses cost 0.1 to 0.4 % more
TOLD_GAP = 0.5
TELLING = math.radians(1e-6)  # remaining nutation angle in rad from which there is a note on it


TURNED = math.radians(0.1)  # turn of H, rad, from which it is mentioned
DRIFT = 0.1  # turn of a torque from where it is in space, rad, from which a tenth of it is wrong

# Angle between torques, rad, up to which channels push alike: pulses of four-pulse, T_ω/8 long,
# then overlap by half or more. Pairs mounted for two pulses are farther apart: 45° at C = 4A/3.
ALIKE = math.pi * catalogue.DEFAULT_SHARE


def spacecraft_notes(spacecraft: Spacecraft) -> Iterator[Note]:
    """Notes on a spacecraft that hold before any plan and for each."""
    tilt = principal_moments.principal_tilt(spacecraft.inertia.axes)
    damped = next(one for one in requirements.bounds(spacecraft) if one.part is Part.NUTATION)
    if not damped.met(tilt):
        limit = math.degrees(damped.limit)
        yield note("principal-axis-off", tilt_deg=math.degrees(tilt), limit_deg=limit)
    commands = spacecraft.commands
    if commands is not None and commands.per_turn > 1 and commands.delay_is != ANGLE:
        yield note("delays-in-time", per_turn=commands.per_turn)
    channels = [channel for channel in spacecraft.channels if channel.damps]
    pushes = np.array([channel.transverse / abs(channel.transverse) for channel in channels])
    if len(channels) > 1 and np.outer(pushes, pushes.conj()).real.min() >= math.cos(ALIKE):
        names = ", ".join(channel.name for channel in channels)
        yield note("channels-push-alike", channels=names, period_s=spacecraft.body_period)
    shares = dict(zip((each.name for each in channels), worths(spacecraft, channels), strict=True))
    wasting = {name: share for name, share in shares.items() if share < WASTEFUL}
    if wasting:
        yield note(
            "channels-waste",
            channels=", ".join(wasting),
            worth_percent=100.0 * max(wasting.values()),
            best=max(shares, key=shares.__getitem__),
        )


def plan_notes(plan: Plan, *, cones: bool = True) -> tuple[Note, ...]:
    """Notes on a plan, its scheme's first, broken ``cones`` last; or the reason for the lack of a
    schedule.
    """
    if not plan.feasible:
        from nutdamp.planning.causes import infeasibility  # no plan

        why = infeasibility(plan)
        if isinstance(plan._why, NotFound):
            return (note("not-found", scheme=plan.scheme, why=why),)
        return (note("infeasible", scheme=plan.scheme, why=why),)
    notes = list(plan.pulses.notes)
    if plan._cut:
        notes.append(note("search-ended"))
    if plan.flown is not None and len(plan.pulses):
        notes += [*_bounds(plan), *_left(plan)]
        broken = [aspect for aspect in plan._aspects if cones and not aspect.kept]
        notes += map(broken_cone, broken)
    return tuple(entry.of(plan.scheme) for entry in notes)


def _bounds(plan: Plan) -> Iterator[Note]:
    """Possible saving by another schedule."""
    bounds = plan.pulses.bounds
    if bounds is None or (bounds.unit == "kg" and plan.pulses.propellant is None):
        return
    spent = plan.pulses.cost_in(bounds.unit)
    scale, unit = (1e3, "g") if bounds.unit == "kg" else (1.0, "N m s")
    # Where the nutation damps itself, waiting makes any cost small: the least of ideal pulses says
    # nothing.
    if (
        bounds.first_order is not None
        and bounds.first_order > 0.0
        and plan.spacecraft.growth >= 0.0
    ):
        least, gap = scale * bounds.first_order, 100.0 * (spent / bounds.first_order - 1.0)
        gap = 0.0 if abs(gap) < 1e-6 else gap
        cheap = isinstance(plan.options, OptimalOptions) and plan.options.saves_cost
        yield note(
            "above-bound" if cheap and gap > TOLD_GAP else "small-angle-bound",
            cost=scale * spent,
            unit=unit,
            bound=least,
            within_s=bounds.within,
            gap_percent=gap,
        )
    if bounds.rigorous is not None and bounds.rigorous > 0.0:
        yield note("proven-bound", bound=down(scale * bounds.rigorous), unit=unit)
    if bounds.keeping is not None:
        yield note("cost-of-keeping", keeping=scale * bounds.keeping, unit=unit)


def _left(plan: Plan) -> Iterator[Note]:
    """Reasons for remaining nutation, equal pulses of a given length among them."""
    spacecraft, options, left, inertia = (
        plan.spacecraft,
        plan.options,
        plan._left,
        plan.spacecraft.inertia,
    )
    nutation = plan._flight.residual.nutation
    if nutation >= TELLING and not options.uncorrected:
        spared = spacecraft.goal.spin is not None or plan.scheme == ROBUST
        if spared and plan.meets_requirement:
            yield note("remains-allowed", nutation_deg=math.degrees(nutation))
        else:
            from nutdamp.planning.causes import remaining  # nutation remains

            yield remaining(plan)
    simple = inertia.symmetric and not spacecraft.disturbances and spacecraft.growth == 0.0
    if (
        left is not None
        and not simple
        and options.equal
        and not options.resizable
        and not options.uncorrected
    ):
        off = float(requirements.missed(spacecraft, left.nutation, left.aim))
        if off >= TELLING:
            yield note("fixed-length", off_deg=math.degrees(off))


def broken_cone(aspect: Aspect) -> Note:
    """A cone about a direction that the spin axis breaks."""
    assert aspect.broken_at is not None
    bound, angle, at = aspect.broken_at
    angle, limit = math.degrees(angle), math.degrees(bound.limit)
    return note(
        "cone-broken", angle_deg=angle, direction=aspect.keep.name, at_s=at, limit_deg=limit
    )


def shift_notes(spacecraft: Spacecraft) -> Iterator[Note]:
    """Note on a requirement.momentum_shift that counts from a target."""
    requested = spacecraft.requirement
    counted = requested is not None and requested.momentum_shift is not None
    if counted and spacecraft.goal.axis is not None:
        yield note("momentum-shift-of-target")


def verdict_notes(verdict: Verdict, plan: Plan, *, looped: bool = False) -> Iterator[Note]:
    """Notes beside the verdict on a plan; ``looped``: it is that of a closed loop, which goes on
    firing.
    """
    spacecraft = plan.spacecraft
    flight = verdict.flight or plan._flight
    final = flight.residual
    if verdict.unshown:
        yield note(
            "probability-without-tolerances"
            if spacecraft.dispersions is None
            else "undecided-cases"
        )
    if verdict.cases is None and requirements.judged(spacecraft):
        yield note("no-tolerances" if spacecraft.dispersions is None else "tolerances-not-checked")
    if (
        spacecraft.goal.spin is None
        and spacecraft.requirement is not None
        and spacecraft.requirement.spin is not None
    ):
        yield note("spin-required-without-goal")
    yield from shift_notes(spacecraft)
    if verdict.empties:
        yield note("tank-empties")
    if verdict.met is False:
        from nutdamp.planning.causes import main_causes  # a requirement is missed

        yield from main_causes(verdict)
    if code := ideal_code(plan):
        yield note(code, scheme=plan.scheme)
    if looped:
        return
    if verdict.status.barred:
        single = spacecraft.commands is not None and not plan.pulses.blocks
        yield note("not-commandable" if single else "breaks-limits", scheme=plan.scheme)
    disturbed = plan._disturbed
    if disturbed is not None:
        yield note(
            "disturbed-after",
            at_s=max(spacecraft.edges),
            earliest=f"{math.ceil(max(spacecraft.edges))} s",
            nutation_deg=math.degrees(disturbed.nutation),
            off_deg=math.degrees(disturbed.aim),
        )
    still = [each for each in spacecraft.disturbances if each.rate == -spacecraft.spin]
    if still and plan.flown is not None:
        lasts = min(max(each.end for each in still), spacecraft.watched_until(plan.end))
        drift = abs(plan._flight.settled.spin - spacecraft.spin) * lasts
        if drift > DRIFT:
            yield note("inertial-torque-drifts", drift_deg=math.degrees(drift), until_s=lasts)
    now = spacecraft.nutation
    limit = _limit_of(spacecraft, Part.NUTATION)
    if requirements.only_nutation(spacecraft):
        idle, damped = (
            requirements.to_required(spacecraft, now, growing=growing) for growing in (True, False)
        )
        if damped is not None and damped < spacecraft.horizon:
            yield note(
                "met-without-pulse-from",
                from_s=damped,
                nutation_deg=math.degrees(now),
                limit_deg=limit,
            )
        if idle:
            yield note(
                "met-without-pulse-until",
                until_s=idle,
                nutation_deg=math.degrees(now),
                limit_deg=limit,
            )
    if len(plan.pulses):
        if verdict.required and requirements.unaided(spacecraft):
            yield note("pulses-unneeded", scheme=plan.scheme)
        # Nutation that grows keeps the requirement for a time after the last pulse.
        values = (line.value for line in verdict.lines if line.bound.part is Part.NUTATION)
        left = next(values, flight.final.nutation)
        again = requirements.to_required(flight.spacecraft, left, growing=True)
        if again and left > TELLING:
            after = flight.schedule.end if flight.until is None else flight.until
            figures_: dict[str, Value] = {
                "after_s": after,
                "left_deg": math.degrees(left),
                "limit_deg": limit,
                "lasting_s": again,
            }
            if verdict.cases is not None:
                figures_["share"] = f"{100.0 * verdict.cases.probability:.10g}"
            yield note(
                "grows-again" if verdict.cases is None else "grows-again-in-cases", **figures_
            )
    limited = spacecraft.goal.axis is not None or _limit_of(spacecraft, Part.SHIFT) is not None
    if not limited and final.momentum_shift > TURNED:
        yield note(
            "momentum-shift",
            scheme=plan.scheme,
            momentum_shift_deg=math.degrees(final.momentum_shift),
        )
    yield from _spin_change(plan, flight)
    if spacecraft.loop is not None:
        yield note("loop-not-judged")


def _spin_change(plan: Plan, flight: Flight) -> Iterator[Note]:
    """Change of the spin that nobody asked for, and its causes: axial impulses of channels, then
    what else acts.
    """
    spacecraft = plan.spacecraft
    before, after = RPM * spacecraft.spin, RPM * flight.final.spin
    # One of five digits has to change.
    resolution = 10.0 ** (math.floor(math.log10(max(abs(before), abs(after), 1e-9))) - 4)
    if spacecraft.goal.spin is not None or abs(after - before) <= resolution:
        return
    pulses = flight.schedule
    changes = {
        name: RPM
        * math.fsum(float(pulse.impulse[2]) for pulse in pulses if pulse.channel == name)
        / spacecraft.inertia.C
        for name in dict.fromkeys(pulse.channel for pulse in pulses)
    }
    causes = [f"{name} {change:+.3g} rpm" for name, change in changes.items() if change]
    if abs(after - before - sum(changes.values())) > resolution:
        others = {
            "dissipation": spacecraft.growth != 0.0,
            "disturbances": bool(spacecraft.disturbances),
            LIGHTER: LIGHTER in spacecraft.thrust_laws,
            "I1 ≠ I2": not spacecraft.inertia.symmetric,
        }
        causes += [cause for cause, acts in others.items() if acts]
    yield note(
        "spin-change",
        scheme=plan.scheme,
        before_rpm=before,
        after_rpm=after,
        cause=", ".join(causes),
    )


def ideal_code(plan: Plan) -> str:
    """Code of the note on impulses which take no time; empty where the plan fires none."""
    torquer = plan.spacecraft.torquer
    if not plan.pulses.idealised:
        return ""
    if torquer is not None and plan.spacecraft.steerable is None:
        return "ideal-torquer-assumed"
    return (
        "ideal-torque-missing"
        if torquer is not None and torquer.torque is None
        else "ideal-impulses"
    )


def _limit_of(spacecraft: Spacecraft, part: Part) -> float | None:
    most = next(
        (bound.limit for bound in requirements.required(spacecraft) if bound.part is part), None
    )
    return None if most is None else math.degrees(most)


def comparison_warnings(compared: Comparison, *, tabulated: bool = False) -> Iterator[Note]:
    """Requirements that the recommended plan misses, the causes, and cones that the axis breaks.

    ``tabulated``: a table of the requirement beside them shows what is missed and broken.
    """
    chosen = compared.recommended
    if chosen is None:
        return
    complies = compared.recommendation.standing is Standing.COMPLIES
    if not complies:
        yield from _missed(chosen, compared, tabulated=tabulated)
    broken = [aspect for aspect in chosen._aspects if not aspect.kept]
    yield from (broken_cone(aspect).of(chosen.scheme) for aspect in broken if not tabulated)
    keeping = [plan.scheme for plan in compared.plans if plan.feasible and plan._kept]
    if broken and keeping:
        yield note("plans-keep-cones", schemes=", ".join(keeping))
    if compared.spacecraft.watched:
        from nutdamp.flight.cones import at_start  # directions to watch

        for aspect in at_start(compared.spacecraft):
            if not aspect.kept:
                items = (item for item in broken_cone(aspect).items if item[0] != "at_s")
                yield Note("cone-broken-at-start", tuple(items))
    others = [plan.scheme for plan in compared.plans if plan.feasible and not plan._commandable]
    better = [scheme for scheme in others if compared.verdicts[compared[scheme]].met]
    if better and chosen._commandable and compared.verdicts[chosen].met is False:
        yield note("blocks-cannot", schemes=", ".join(better))
    cut = [plan.scheme for plan in compared.plans if plan._cut]
    if cut and not complies:
        yield note("search-incomplete", schemes=", ".join(cut))


def _missed(chosen: Plan, compared: Comparison, *, tabulated: bool) -> Iterator[Note]:
    """Requirements that the recommended plan misses, and the causes, the best cure first."""
    cases = compared.verdicts[chosen].cases
    if (
        chosen._standing is not Standing.MISSES
        and compared.cases
        and not compared.cases[chosen].enough
    ):
        if (
            chosen._kept is not False and cases is not None and cases.enough is False
        ):  # else the cones are the reason
            yield note(
                "too-few-cases" if compared.preferred is None else "too-few-cases-robust",
                required_share=100.0 * cases.probability,
            )
        return
    from nutdamp.flight.cones import at_start
    from nutdamp.planning.causes import obstacles, shortfalls

    yield from shortfalls(chosen, tabulated=tabulated)
    spacecraft = chosen.spacecraft
    parts = {bound.part for bound in chosen._shortfalls}
    if spacecraft.disturbances and not chosen.options.with_disturbances:
        aware = with_disturbances(compared)
        if aware is None:
            yield note("unplanned-disturbances")
        elif aware._standing is Standing.COMPLIES:
            yield note("disturbances-helped", scheme=aware.scheme)
        else:
            yield note("disturbances-not-helped")
    if Part.NUTATION in parts:
        yield from obstacles(chosen)
    if Part.DISTANCE in parts and chosen.scheme not in (*catalogue.POINTING, *catalogue.COMMANDED):
        yield note(
            "scheme-does-not-turn", scheme=chosen.scheme, schemes=", ".join(catalogue.POINTING)
        )
    if parts != {Part.SPIN} and any(channel.damps for channel in spacecraft.channels):
        if OPTIMAL.name not in {plan.scheme for plan in compared.plans}:
            yield note("optimal-not-compared")
        elif requirements.required(spacecraft) and all(one.kept for one in at_start(spacecraft)):
            yield note("try-trade")  # no end and no axis of H keeps a cone that is broken at t = 0


def with_disturbances(compared: Comparison) -> Plan | None:
    """Recommendation among the schemes planned with the disturbances; None where they were, or
    there are none.

    A scheme that is slow is planned only where no other one complies.
    """
    chosen, spacecraft = compared.recommended, compared.spacecraft
    if chosen is None or not spacecraft.disturbances or chosen.options.with_disturbances:
        return None
    others: tuple[Plan, ...] = ()
    try:
        for slow in (False, True):
            for plan in compared.plans:
                scheme = catalogue.SCHEMES.get(plan.scheme)
                if scheme is None or scheme.slow != slow:
                    continue
                if not scheme.on_true_body:  # which is planned with them in any case
                    aware = replace(plan.options, with_disturbances=True)
                    plan = attempt(spacecraft, plan.scheme, aware)
                others = (*others, plan)
            best = replace(compared, plans=others, flown=None, preferred=None).recommended
            if best is not None and best._standing is Standing.COMPLIES:
                break
    except NutdampError:
        return None
    return best


# share of the recommended plan's momentum shift below which another plan keeps H much better
STEADIER_SHIFT = 0.2
FEWER_PULSES = 0.5  # share of its pulses up to which another plan is much simpler
# share of its end up to which another one, a nutation period earlier at least, is much sooner
SOONER_END = 0.5
STEADIER_COST = 1.1  # largest cost ratio at which a smaller momentum shift is worth a note
FEWER_COST = 1.05  # largest cost ratio at which fewer pulses are
SOONER_COST = 1.05  # largest cost ratio at which an earlier end is
# largest cost ratio of a plan with real widths beside one of ideal impulses that is worth a note
REAL_COST = 1.1


class Gain(Enum):
    """Advantage of another plan over the recommended one, by the code of its note."""

    STEADIER = "smaller-shift"
    SIMPLER = "fewer-pulses"
    SOONER = "ends-sooner"
    REAL = "real-widths"
    COMMANDED = "as-blocks"


def gains(best: Plan, plans: Sequence[Plan]) -> dict[Gain, Plan]:
    """Cheapest of the ``plans`` with each gain on the ``best`` for little more; of command blocks
    at any cost.
    """
    unit = cost_unit(plans)
    spacecraft = best.spacecraft
    turned = (
        0.0
        if spacecraft.goal.axis is not None or off_target(best) <= DAMPED_ANGLE
        else STEADIER_SHIFT * off_target(best)
    )
    few = FEWER_PULSES * len(best.pulses)
    soon = min(SOONER_END * best.pulses.end, best.pulses.end - spacecraft.inertial_period)
    gains_of: dict[Gain, Plan] = {}
    for gain, ratio, has in (
        (Gain.STEADIER, STEADIER_COST, lambda plan: off_target(plan) < turned),
        (Gain.SIMPLER, FEWER_COST, lambda plan: len(plan.pulses) <= few),
        (Gain.SOONER, SOONER_COST, lambda plan: plan.pulses.end <= soon),
        (Gain.REAL, REAL_COST, lambda plan: best.pulses.idealised and not plan.pulses.idealised),
        (
            Gain.COMMANDED,
            math.inf,
            lambda plan: bool(plan.pulses.blocks) and not best.pulses.blocks,
        ),
    ):
        most = ratio * best.pulses.cost_in(unit)
        those = [
            plan
            for plan in plans
            if len(plan.pulses) and has(plan) and plan.pulses.cost_in(unit) <= most
        ]
        if those:
            gains_of[gain] = min(those, key=lambda plan: plan.pulses.cost_in(unit))
    return gains_of


def alternatives(compared: Comparison) -> Iterator[Note]:
    """Plans that the reader may prefer: much better in some way for little more, each once, with
    its figures.
    """
    recommendation = compared.recommendation
    chosen, rivals = recommendation.plan, recommendation.rivals
    if chosen is None or not rivals:
        return
    others = dict[int, tuple[Gain, Plan]]()
    for gain, plan in gains(chosen, rivals).items():
        others.setdefault(id(plan), (gain, plan))
    for gain, other in others.values():
        yield note(
            gain.value, scheme=other.scheme, **figures(other, chosen, recommendation.by_propellant)
        )


def figures(plan: Plan, than: Plan, by_propellant: bool) -> dict[str, Value]:
    """Figures of a plan and of the one it is compared with, as values of a note."""
    assert plan.flown is not None
    assert than.flown is not None
    off, than_off = (math.degrees(left.axis_error) for left in (plan.flown, than.flown))
    counts: dict[str, Value] = {"pulses": len(plan.pulses), "than_pulses": len(than.pulses)}
    return {
        **counts,
        **beside(plan, than, by_propellant),
        "axis_error_deg": off,
        "than_axis_error_deg": than_off,
    }


def beside(plan: Plan, than: Plan, by_propellant: bool) -> dict[str, Value]:
    """Cost and end of a plan and of the one it is compared with, as values of a note."""
    unit, scale, shown = ("kg", 1e3, "g") if by_propellant else ("N m s", 1.0, "N m s")
    cost, than_cost = (scale * each.pulses.cost_in(unit) for each in (plan, than))
    return {
        "cost": cost,
        "than_cost": than_cost,
        "unit": shown,
        "end_s": plan.end,
        "than_end_s": than.end,
    }


LEAST_CODES = {"impulse": "least-impulse", "time": "least-time", "pulses": "least-pulses"}
"""Codes of the notes on the plan that takes least of what is saved, but propellant."""


def reasons(compared: Comparison) -> Iterator[Note]:
    """Reason for the recommended plan, or for none."""
    recommendation, spacecraft = compared.recommendation, compared.spacecraft
    ground, count = recommendation.ground, recommendation.count
    if recommendation.plan is None:
        if any(plan.feasible for plan in compared.plans):
            yield note("no-blocks")
            return
        damped = (
            requirements.to_required(spacecraft, spacecraft.nutation, growing=False)
            if requirements.only_nutation(spacecraft)
            else None
        )
        yield note("none-feasible") if damped is None else note("none-needed-from", from_s=damped)
        able = any(channel.damps for channel in spacecraft.channels) and (
            spacecraft.goal.spin is None or any(channel.axial for channel in spacecraft.channels)
        )
        if able and OPTIMAL.name not in {plan.scheme for plan in compared.plans}:
            yield note("optimal-not-tried")
        return
    if ground is Ground.ONLY:
        yield note("as-requested" if len(compared.plans) == 1 else "only-plan")
        return
    if ground is Ground.CASES:
        yield note("most-cases", count=count)
    elif ground is Ground.ROBUST:
        complies = recommendation.standing is not Standing.MISSES
        yield note("made-for-cases" if complies else "made-for-most-cases")
    elif recommendation.standing is not Standing.COMPLIES:
        yield note("nearest" if ground is Ground.NEAREST else "least-left", count=count)
    elif recommendation.plan._kept is False:
        yield note("cheapest-at-end", count=count)
    elif not requirements.required(spacecraft):
        yield note("damps-at-least", count=count)
    else:
        usual = "least-propellant" if recommendation.by_propellant else "least-impulse"
        yield note(LEAST_CODES.get(recommendation.least, usual), count=count)
    if ground in TIES:
        yield note(ground.value)
