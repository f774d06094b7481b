"""Verdicts in words: recommended plan and reason, requirements missed and their causes, share of cases that comply.

The floors below give data; all sentences about them are here, so that every screen and page agrees.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from nutdamp.errors import listed
from nutdamp.flight import end_state
from nutdamp.flight.propagation import Flight
from nutdamp.planning.decision import Comparison, obstacle, strays
from nutdamp.planning.plan import Plan
from nutdamp.planning.recommendation import Gain, Ground, Obstacle, Share, Standing
from nutdamp.schemes import catalogue
from nutdamp.schemes.catalogue import OPTIMAL
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import Bound, Part
from nutdamp.views.text import MISSING, RPM, degrees, duration, mass, moment, most, quantity, sentence

VERDICT = {True: "met", False: "NOT met", None: MISSING}
"""Words for the values of `Plan.meets_requirement`."""


def no_plan(plan: Plan) -> str:
    """Text in the column of a scheme that has no plan."""
    if plan.failure is None:
        without = catalogue.SCHEMES[plan.scheme].body_fixed and not plan.spacecraft.channels
        return "no thrusters" if without else "infeasible"
    return f"internal error,\nplease report:\n{type(plan.failure).__name__}"


def needless(compared: Comparison) -> str | None:
    """Sentence that nothing has to be done, where that is so."""
    body = compared.spacecraft
    if not compared.needless:
        return None
    nutation = degrees(body.nutation)
    there = [
        f"the nutation of {nutation} at t = 0" if body.inertia.symmetric else f"the nutation of at most {nutation}"
    ]
    if body.goal.axis is not None:
        there.append(f"the {degrees(body.to_turn)} between H and the target")
    count = "" if len(there) > 1 else "s"
    if requirements.required(body):
        nominal = " with nominal values" * (body.dispersions is not None and compared.flown is None)
        verdict = f"already meet{count} the requirement ({required(body)}){nominal}"
    else:
        verdict = f"already count{count} as damped"
    lasting = f", up to the horizon of {duration(body.horizon)} too" if body.growth > 0.0 else ""
    plans = "; the plans below reduce it further" if any(len(plan.pulses) for plan in compared.plans) else ""
    return f"{' and '.join(there)} {verdict}{lasting}{plans}"


def reason(compared: Comparison) -> str:
    """The reason for the recommended plan, or for none."""
    recommendation, body = compared.recommendation, compared.spacecraft
    if recommendation.plan is None and any(entry.feasible for entry in compared.plans):
        return "no plan can be sent as command blocks; with --timed pulses are timed one by one"
    if recommendation.plan is None:
        untried = _optimal_untried(compared) and (body.goal.spin is None or any(entry.axial for entry in body.channels))
        damped = requirements.subsides(body) if requirements.only_nutation(body) else None
        idle = "" if damped is None else f"; without a pulse the requirement is met from {quantity(damped, 's')} on"
        return f"no scheme is feasible{'; --scheme optimal was not compared' * untried}{idle}"
    if recommendation.ground is Ground.ONLY:
        return _only(compared)
    cones = " and keep the cones" * bool(recommendation.plan.kept)
    cost = "propellant" if recommendation.by_propellant else "impulse"
    if recommendation.ground is Ground.CASES:
        return f"most cases comply of the {recommendation.count} feasible plans{cones.replace(' and', ' that')}"
    if recommendation.standing is Standing.COMPLIES:
        among = f"of the {recommendation.count} plans that {_those(body, recommendation.plan)}{cones}"
        least, equal = f"least {cost} {among}", "; of those that cost as much within 0.1 %"
        then = {
            Ground.PULSES: f"{equal}, fewest pulses",
            Ground.DELTA_V: f"{equal}, least ΔV",
            Ground.SHIFT: f"{equal}, least momentum shift",
            Ground.END: f"{equal}, it ends first",
        }
        return f"{least}{then.get(recommendation.ground or Ground.COST, '')}"
    meeting = recommendation.standing is Standing.MEETS
    those = (
        f"plans that {_meeting(recommendation.plan, 'meet')}{cones}"
        if meeting
        else f"feasible plans{cones.replace(' and', ' that')}"
    )
    among = f"of the {recommendation.count} {those}"
    least = "leaves the least residual nutation" if body.goal.axis is None else "comes nearest to the target"
    if recommendation.ground is Ground.NEAREST:
        return f"comes nearest to the requirement {among}" if requirements.required(body) else f"{least} {among}"
    least_cost = f", within {degrees(requirements.DAMPED_ANGLE)}; of these least {cost}"
    then = {
        Ground.COST: least_cost,
        Ground.PULSES: f"{least_cost}, then fewest pulses",
        Ground.DELTA_V: f"{least_cost}, then least ΔV",
        Ground.SHIFT: f"{least_cost}, then least momentum shift",
        Ground.END: f"{least_cost}, then it ends first",
    }
    return f"{least} {among}{then.get(recommendation.ground or Ground.LEFT, '')}"


def _only(compared: Comparison) -> str:
    """The reason for a plan that had no rival of its standing."""
    recommendation, body = compared.recommendation, compared.spacecraft
    verdict = {
        Standing.COMPLIES: _those(body, recommendation.plan, plural=False),
        Standing.MEETS: _meeting(recommendation.plan, "meets"),
        Standing.MISSES: "",
    }[recommendation.standing or Standing.MISSES]
    if len(compared.plans) == 1:
        return f"the scheme named{f'; it {verdict}' * bool(verdict)}"
    cones = "keeps the cones" if recommendation.plan is not None and recommendation.plan.kept else ""
    merits = " and ".join(filter(None, ("can be commanded" * compared.restricted, verdict, cones)))
    return f"the only {'' if verdict else 'feasible '}plan{f' that {merits}' * bool(merits)}"


def _those(body: Spacecraft, chosen: Plan | None = None, *, plural: bool = True) -> str:
    """The common merit of the plans that comply, of which one was ``chosen``."""
    if requirements.required(body):
        return _meeting(chosen, f"meet{'s' * (not plural)}")
    if body.goal.axis is None:
        return f"damp{'s' * (not plural)}"
    return f"reach{'es' * (not plural)} the target"


def _meeting(chosen: Plan | None, verb: str) -> str:
    """Words for plans that meet the requirement; at the end alone, where the ``chosen`` one breaks a cone before."""
    return f"{verb} the requirement{' at the end' * (chosen is not None and chosen.kept is False)}"


def warnings(compared: Comparison, *, beside_verdict: bool = False) -> tuple[str, ...]:
    """Requirements that the recommended plan misses, and the causes; nothing for a plan that complies.

    Then the cones that the spin axis breaks; ``beside_verdict``: only the plans that keep them, since the verdict says
    the rest.
    """
    recommendation = compared.recommendation
    if recommendation.plan is None:
        return ()
    return (*_missed(recommendation.plan, compared), *_cones_broken(recommendation.plan, compared, beside_verdict))


def _cones_broken(chosen: Plan, compared: Comparison, beside_verdict: bool) -> Iterator[str]:
    """The cones that the spin axis breaks with the recommended plan, and the plans that keep them."""
    keeping = [entry.scheme for entry in compared.plans if entry.feasible and entry.kept]
    if beside_verdict:
        yield from [sentence(f"plans that keep all cones: {listed(keeping) or 'none'}")] * (chosen.kept is False)
        return
    those = f"{listed(keeping)} keep{'s' * (len(keeping) == 1)} all cones" if keeping else "no plan compared keeps it"
    yield from (sentence(f"{strays(entry)}; {those}") for entry in chosen.aspects if not entry.kept)


def _missed(chosen: Plan, compared: Comparison) -> Iterator[str]:
    """Requirements that the recommended plan misses, and the causes."""
    recommendation, body = compared.recommendation, compared.spacecraft
    if recommendation.standing is Standing.COMPLIES:
        return
    share = compared.shares.get(chosen)
    if share is not None and not share.met and chosen.standing is not Standing.MISSES:
        if chosen.kept is not False:  # else the cones are the reason
            yield _too_few(chosen, compared)
        return
    required = recommendation.standing is Standing.MISSES and bool(requirements.required(body))
    does, do, what = ("damps", "damp", "nutation") if body.goal.axis is None else ("reaches", "reach", "target")
    if required:
        does, do, what = "meets", "meet", "requirement"
    it, head = "It", f"{chosen.scheme} does not {do} the {what}"
    if len(compared.plans) > 1:
        it, head = chosen.scheme, f"none of the {_rivals(compared)} {does} the {what}"
    missed = "; ".join(shortfall(chosen, bound) for bound in chosen.shortfalls)
    yield " ".join((f"{head}. {it} leaves {missed}.", *_obstacles(chosen, compared)))


def _too_few(chosen: Plan, compared: Comparison) -> str:
    """Sentence that no plan meets the requirement in enough dispersed cases."""
    share = compared.shares[chosen]
    if share.met is None:
        return f"{sentence(UNDECIDED)} Nominal values alone: plan --nominal."
    whom = f"any of the {_rivals(compared)}" if len(compared.plans) > 1 else chosen.scheme
    few = f"Fewer than {exact_percent(share.probability)} of cases comply with {whom}."
    return f"{few} nutdamp plan --robust looks for a plan made for the tolerances."


def _rivals(compared: Comparison) -> str:
    """The plans among which the recommended one was chosen."""
    return "plans that can be commanded" if compared.restricted else f"{len(compared.plans)} schemes compared"


UNDECIDED = "the share of cases that comply is undecided: not all of them could be flown within the budget of work"
"""Note on dispersed cases that do not decide between plans."""


def idealised(plan: Plan) -> str:
    """The reason why a plan fires impulses which take no time; empty where it does not."""
    if not plan.pulses.idealised:
        return ""
    torquer, unknown = plan.spacecraft.torquer, ""
    if torquer is not None and plan.spacecraft.steerable is None:
        unknown = ": the file names no actuator, and an ideal steerable torquer is assumed"
    elif torquer is not None and torquer.torque is None:
        unknown = ": the file has no steerable.torque"
    return f"{plan.scheme} fires ideal impulses, which take no time{unknown}."


def model_warnings(impulses: Flight, flown: Flight) -> tuple[str, ...]:
    """Difference between the impulse sum (17) and real widths at the end, where it exceeds the tolerance."""
    apart = end_state.deviations(impulses, flown)
    if not apart:
        return ()
    required = {bound.part for bound in requirements.required(flown.spacecraft)}
    parts = []
    for part in apart:
        most = "a tenth of the requirement" if part.part in required else degrees(part.most)
        parts.append(f"{part} (more than {most})")
    return (f"the impulse sum (17) and real widths differ by {' and '.join(parts)}. What is flown counts.",)


def shortfall(plan: Plan, bound: Bound) -> str:
    """One part that a plan misses: its residual, and its bound."""
    left = plan.left
    assert left is not None
    value = requirements.left_of(bound.part, left, plan.spacecraft)
    if bound.part is Part.SPIN:
        goal = plan.spacecraft.goal.spin or 0.0
        return f"the spin at {_rpm(left.spin)} ({_rpm(goal)} required)"
    allowed = "required" if bound.required else "would count as damped"
    return f"{degrees(value)} of {bound.part.label} ({most(bound.most)} {allowed})"


def _obstacles(plan: Plan, compared: Comparison) -> Iterator[str]:
    """Causes that prevent a smaller residual, in sentences; the best cure first."""
    body = plan.spacecraft
    parts = {bound.part for bound in plan.shortfalls}
    if body.disturbances and not plan.options.with_disturbances:
        yield _unplanned(compared)
    if Part.NUTATION in parts and plan.hindrance.obstacle is not Obstacle.UNPLANNED_DISTURBANCES:
        spent = plan.hindrance.obstacle in (Obstacle.LIMITS, Obstacle.SCHEME)
        yield _spent(plan) if spent else sentence(obstacle(plan))
    if Part.DISTANCE in parts and plan.scheme not in (*catalogue.POINTING, *catalogue.COMMANDED):
        yield f"{plan.scheme} does not turn H to a target; {', '.join(catalogue.POINTING)} do."
    if _optimal_untried(compared) and parts != {Part.SPIN}:
        more = "can fire several pulses of a channel in each half turn" if plan.hindrance.full else "may reach more"
        yield f"--scheme optimal was not compared; it {more}."
    elif any(channel.damps for channel in body.channels) and requirements.required(body) and parts != {Part.SPIN}:
        yield "nutdamp trade tries other ends, with H free too; one of its schedules may meet the requirement."


def _optimal_untried(compared: Comparison) -> bool:
    """True where there are channels that optimal can fire, and it was not compared."""
    able = any(channel.damps for channel in compared.spacecraft.channels)
    return able and OPTIMAL.name not in {plan.scheme for plan in compared.plans}


def _unplanned(compared: Comparison) -> str:
    """Changes by planning with the disturbances."""
    single, body = len(compared.plans) == 1, compared.spacecraft
    planned = f"The plan{' was' if single else 's were'} made without the disturbances of the file"
    aware = compared.with_disturbances
    if aware is not None and aware.standing is Standing.COMPLIES:
        return f"With --with-disturbances {aware.scheme} {_those(body, plural=False)}. {planned}."
    plans = f"{planned}; --with-disturbances plans with them"
    if aware is None:
        return f"{plans}."
    return f"{plans}, but then too {'it does not ' if single else 'no scheme compared '}{_those(body, plural=single)}."


def _spent(plan: Plan) -> str:
    """Share that the pulses give of the impulse that damping takes, and the cause of its limit."""
    body, pulses = plan.spacecraft, plan.pulses
    count = f"{len(pulses)} pulses give" if len(pulses) != 1 else "pulse gives"
    width = f", {'each ' * (len(pulses) > 1)}as long as max_on_time allows" if plan.hindrance.full else ""
    if plan.hindrance.shortest:
        width = ", and min_on_time allows no shorter ones"
    last = "The last one" if len(pulses) != 1 else "It"
    blackout = ", with blackout windows" if body.limits.blackout else ""
    return (
        f"Its {count} {quantity(pulses.total_impulse, 'N m s')}{width}; damping takes "
        f"{quantity(body.least_impulse, 'N m s')}. {last} ends at {moment(pulses.end)} of a horizon of "
        f"{duration(body.horizon)}{blackout}."
    )


def hints(compared: Comparison) -> tuple[str, ...]:
    """Plans that the reader may prefer: much better in some way for little more, with their drawbacks."""
    others = dict.fromkeys(compared.recommendation.alternatives.values())
    return tuple(hint(compared, other) for other in others)


def hint(compared: Comparison, other: Plan) -> str:
    """Advantage of one of the alternatives over the recommended plan, and its drawbacks."""
    recommendation = compared.recommendation
    chosen = recommendation.plan
    assert chosen is not None
    gains = [_gain(goal, other, chosen) for goal, plan in recommendation.alternatives.items() if plan is other]
    better = f"{other.scheme} {listed(gains)}, for {_dearer(other, chosen, recommendation.by_propellant)}"
    worse = listed([*_drawbacks(other, chosen)])
    return f"{'; '.join(filter(None, (better, f'but it {worse}' * bool(worse))))}."


def _gain(gain: Gain, other: Plan, chosen: Plan) -> str:
    """Advantage of a plan over the ``chosen`` one."""
    if gain is Gain.REAL:
        return "fires real pulse widths"
    if gain is Gain.COMMANDED:
        return f"can be sent as command blocks, which {chosen.scheme} cannot"
    if gain is Gain.STEADIER:
        return f"shifts H by {_shift(other)} instead of {_shift(chosen)}"
    if gain is Gain.SOONER:
        return f"ends at {moment(other.pulses.end)} instead of {moment(chosen.pulses.end)}"
    return f"takes {len(other.pulses)} pulse{'s' * (len(other.pulses) != 1)} instead of {len(chosen.pulses)}"


def _drawbacks(other: Plan, chosen: Plan) -> Iterator[str]:
    """Clear drawbacks of a plan against the ``chosen`` one: farther off, more nutation, a later end."""
    assert other.flown is not None
    assert chosen.flown is not None
    if other.flown.axis_error > FARTHER * chosen.flown.axis_error + requirements.DAMPED_ANGLE:
        if chosen.spacecraft.goal.axis is None:
            yield f"shifts H by {_shift(other)} instead of {_shift(chosen)}"
        else:
            off = degrees(other.flown.axis_error), degrees(chosen.flown.axis_error)
            yield f"leaves H {off[0]} instead of {off[1]} off the target"
    if other.flown.nutation > FARTHER * chosen.flown.nutation + requirements.DAMPED_ANGLE:
        yield f"leaves {degrees(other.flown.nutation)} of nutation instead of {degrees(chosen.flown.nutation)}"
    end, later = chosen.pulses.end, other.pulses.end - chosen.pulses.end
    if later > min(chosen.spacecraft.inertial_period, (FARTHER - 1.0) * end):
        yield f"ends at {moment(other.pulses.end)} instead of {moment(chosen.pulses.end)}"


def _shift(plan: Plan) -> str:
    assert plan.flown is not None
    return degrees(plan.flown.momentum_shift)


def _dearer(plan: Plan, other: Plan, by_propellant: bool) -> str:
    """Extra cost of a plan against another, with the share of it."""
    unit, what = ("kg", "propellant") if by_propellant else ("N m s", "impulse")
    more, less = plan.pulses.cost_in(unit), other.pulses.cost_in(unit)
    if more <= less * (1.0 + ROUNDING):
        return f"no more {what}"
    extra = mass(more - less) if by_propellant else quantity(more - less, unit)
    return f"{extra} more {what} ({100.0 * (more / less - 1.0):.2g} %)"


ROUNDING = 1e-9
"""Share by which costs that are equal may differ."""

FARTHER = 1.1
"""Factor of distance or of time by which H ends farther off, or later, for a plan to be called worse in it."""


def spoken(compared: Comparison) -> dict[str, Any]:
    """The words of a comparison for JSON files."""
    return {
        "no_pulse_needed": compared.needless,
        "reason": reason(compared),
        "warnings": list(warnings(compared)),
        "hints": list(hints(compared)),
    }


def required(spacecraft: Spacecraft) -> str:
    """The requirement, on one line; empty where there is none."""
    texts = []
    for bound in requirements.required(spacecraft):
        if bound.part is Part.SPIN:
            tolerance = 100.0 * requirements.SPIN_TOLERANCE
            texts.append(f"spin within {tolerance:g} % of {_rpm(spacecraft.goal.spin or 0.0)}")
        else:
            texts.append(f"{bound.part.label} within {most(bound.most)}")
    return listed(texts)


def cases_verdict(share: float, probability: float) -> str:
    """Verdict on the share of cases: "met: 99.9 % of cases comply (99.7 % required)"."""
    return f"{VERDICT[share >= probability]}: {cases_share(share, probability)}"


def cases_share(share: float, probability: float) -> str:
    """Share of cases that comply, and the share required."""
    return f"{percent(share, probability)} of cases comply ({exact_percent(probability)} required)"


def share_text(share: Share | None) -> str:
    """The share of cases that comply with a plan; where not all have flown, the side of the required one it is on."""
    if share is None or (share.exact is None and share.met is None):
        return MISSING
    if share.exact is not None:
        return percent(share.exact, share.probability)
    return f"{'≥' if share.met else '<'} {exact_percent(share.probability)}"


def percent(share: float, *others: float) -> str:
    """A share in percent to one decimal; to more where it would be taken for one of the ``others``, or for all."""
    distinct = [other for other in (*others, 0.0, 1.0) if other != share]
    for digits in range(1, 12):
        text = f"{100.0 * share:.{digits}f}"
        if all(float(text) != float(f"{100.0 * other:.10g}") for other in distinct):
            return f"{text} %"
    return f"{100.0 * share:.12g} %"


def exact_percent(share: float) -> str:
    """A share that a file gives, in percent as it was written."""
    return f"{100.0 * share:.10g} %"


def _rpm(spin: float) -> str:
    return f"{spin * RPM:.5g} rpm"
