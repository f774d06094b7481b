"""Words of a robust plan: its reason, its cost against the nominal one, and tolerances that would have to shrink."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nutdamp.errors import listed
from nutdamp.planning.recommendation import Ground
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views.text import degrees, mass, moment, quantity
from nutdamp.views.verdicts import ROUNDING, exact_percent, percent

if TYPE_CHECKING:
    from nutdamp.planning.robust import RobustComparison


def robust_reason(robust: RobustComparison) -> str:
    """The reason for the robust plan, or for none."""
    chosen, count = robust.chosen, len(robust.candidates)
    if chosen is None:
        return "no scheme is feasible"
    if chosen.met is None:
        level = exact_percent(robust.probability)
        best = f"least {left_name(robust.comparison.spacecraft)} in {level} of the cases, of {count} plans"
        as_good = f"{robust.equals} leave about as little"
    elif chosen.met >= robust.probability:
        best = f"at least {exact_percent(robust.probability)} of cases comply with it, of {count} plans"
        as_good = f"they do with {robust.equals}"
    else:
        best = f"most cases comply, of {count} plans"
        as_good = f"{robust.equals} comply equally often within the sampling error"
    if count == 1:
        return "the scheme named" if len(robust.comparison.plans) == 1 else "the only plan"
    cost = "propellant" if robust.by_propellant else "impulse"
    then = {
        Ground.COST: f"least {cost}",
        Ground.NOMINAL: f"least {cost} within 0.1 %, and recommended without --robust",
        Ground.PULSES: f"least {cost} within 0.1 %, and fewest pulses",
        Ground.DELTA_V: f"least {cost} within 0.1 %, and least ΔV",
        Ground.SHIFT: f"least {cost} within 0.1 %, and least momentum shift",
        Ground.END: f"least {cost} within 0.1 %, and first to end",
    }
    return best if robust.ground not in then else f"{best}; {as_good}, of these {then[robust.ground]}"


def robust_cost(robust: RobustComparison) -> str:
    """The robust plan against the one that is recommended without ``--robust``."""
    chosen, usual, cost = robust.chosen, robust.usual, robust.cost
    if chosen is None or usual is None or cost is None:
        return "There is nothing to compare it with."
    if chosen is usual:
        return "It is the plan that is recommended without --robust too."
    pulses = usual.plan.pulses
    if cost.propellant is None:
        less = cost.impulse if abs(cost.impulse) > ROUNDING * pulses.total_impulse else 0.0
        spent = _more(less, quantity(abs(less), "N m s"), "impulse")
    else:
        less = cost.propellant if abs(cost.propellant) > ROUNDING * (pulses.propellant or 0.0) else 0.0
        spent = _more(less, mass(abs(less)), "propellant")
    when = "as early" if cost.end == 0.0 else f"{moment(abs(cost.end))} {'later' if cost.end > 0 else 'earlier'}"
    level = exact_percent(robust.probability)
    what = left_name(robust.comparison.spacecraft)
    gained = f"{degrees(chosen.left)} instead of {degrees(usual.left)} of {what} in {level} of the cases"
    if chosen.met is not None and usual.met is not None:
        shares = (percent(candidate.met or 0.0, robust.probability) for candidate in (chosen, usual))
        gained = f"{' instead of '.join(dict.fromkeys(shares))} of cases comply"
    return f"Against {usual.plan.scheme}, recommended without --robust: {gained}; it takes {spent} and ends {when}."


def tightened(robust: RobustComparison) -> str:
    """Tolerances that would have to shrink, and to which size, where too few cases comply; empty where not known."""
    from nutdamp.montecarlo.study import CONFIDENCE
    from nutdamp.views.tolerances import in_words, stated_text

    needed, chosen = robust.tightening, robust.chosen
    if needed is None or chosen is None:
        return ""
    sizes, tolerances = [], [entry.tolerance for entry, _ in needed.inputs]
    for entry, relative in needed.inputs:
        less = stated_text(entry._replace(size=needed.factor * entry.size), relative, down=True)
        named = in_words(entry.tolerance if tolerances.count(entry.tolerance) == 1 else entry.name)
        sizes.append(f"{named} {{{entry.kind}: {less}}} instead of {stated_text(entry, relative)}")
    level, least = exact_percent(robust.probability), 100.0 * math.floor(1e4 * needed.least) / 1e4
    checked = f"{percent(needed.complied, robust.probability)} of {needed.cases:,} other cases (seed {needed.seed}) do"
    shown = f"which shows at least {least:.4g} % with {exact_percent(CONFIDENCE)} confidence"
    return f"{level} of cases would comply with it, given {listed(sizes)}: {checked}, {shown}."


def left_name(spacecraft: Spacecraft) -> str:
    """Name of the residual that a plan is to minimise."""
    return "nutation" if spacecraft.goal.axis is None else "nutation or axis error"


def _more(difference: float, shown: str, what: str) -> str:
    if difference == 0.0:
        return f"as much {what}"
    return f"{shown} {'more' if difference > 0 else 'less'} {what}"
