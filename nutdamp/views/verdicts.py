"""Verdicts in words: recommended plan and reason, requirements missed and their causes, share of cases that comply.

The floors below give data; all sentences about them are here, so that every screen and page agrees.
"""

from __future__ import annotations

from nutdamp.errors import listed
from nutdamp.planning.decision import Comparison
from nutdamp.planning.plan import Plan
from nutdamp.planning.recommendation import Share
from nutdamp.schemes import catalogue
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.views.text import MISSING, RPM, degrees, duration, most

VERDICT = {True: "met", False: "NOT met", None: MISSING}
"""Words for the values of `Plan.meets_requirement`."""


def no_plan(plan: Plan) -> str:
    """Text in the column of a scheme that has no plan."""
    if plan.failure is None:
        without = catalogue.SCHEMES[plan.scheme].body_fixed and not plan.spacecraft.channels
        return "no thrusters" if without else "infeasible"
    return f"internal error,\nplease report:\n{type(plan.failure).__name__}"


def needless(compared: Comparison) -> str | None:
    """Clause that nothing has to be done, where that is so."""
    body = compared.spacecraft
    if not compared.needless:
        return None
    there = f"nutation {degrees(body.nutation)} at t = 0"
    if body.goal.axis is not None:
        there += f", H {degrees(body.to_turn)} from the target"
    if requirements.required(body):
        nominal = ", with nominal values" * (body.dispersions is not None and compared.flown is None)
        verdict = f"requirement met ({required(body)}){nominal}"
    else:
        verdict = "damped"
    lasting = f", up to the horizon of {duration(body.horizon)}" if body.growth > 0.0 else ""
    return f"{there}: {verdict}{lasting}"


UNDECIDED = "the share of cases that comply is undecided"
"""Verdict on dispersed cases that do not decide."""


ROUNDING = 1e-9
"""Share by which costs that are equal may differ."""

FARTHER = 1.1
"""Factor of distance or of time by which H ends farther off, or later, for a plan to be called worse in it."""


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
