"""The method behind the numbers of the page: equations, references, assumptions and limits."""

from __future__ import annotations

import re
from collections.abc import Iterator

from nutdamp.flight import propagation
from nutdamp.flight.end_state import left_by, tolerated
from nutdamp.flight.verification import AGREE, Verification
from nutdamp.page.document import Block, FactList, Listing, Points, Prose, Sheet
from nutdamp.planning.decision import Comparison
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import Part, left_of
from nutdamp.views import guide
from nutdamp.views.guide import Formula, Topic, TopicRows
from nutdamp.views.schemes import beyond_floors
from nutdamp.views.tables import Heading
from nutdamp.views.text import MISSING, degrees, quantity

EQUATIONS = ("1", "17", "18", "19")
"""Equations of Magnus that every plan and flight rest on, as the guide numbers them."""


def method_blocks(compared: Comparison) -> Iterator[Block]:
    """A paragraph on the method, the equations used with their symbols, the sources."""
    names = ", ".join(plan.scheme for plan in compared.plans)
    unequal = "; with I1 ≠ I2 the true tensor moves freely in between" * (not compared.spacecraft.inertia.symmetric)
    yield Prose(
        f"Schemes tried, on the nominal values of the input file: {names}. Each schedule found is then flown: Euler's "
        "equations with the true principal moments are integrated through the real pulse widths (ideal impulses take "
        "no time) by Taylor series, coasts of symmetric bodies as exact arcs. Recommendation, requirement and verdict "
        "go by that flight. By M(17), the impulse sum, also written (17), each pulse acts at its centre with its "
        f"effective impulse{unequal}. one-pulse, two-pulse, four-pulse and optimal aim at no nutation at the end, "
        "however much the requirement allows."
    )
    chosen = compared.recommended
    topics = [guide.found(number) for number in EQUATIONS]
    lines = [line for topic in topics for line in _listed(topic, _formulas(topic)[-1])]
    if chosen is not None and chosen.scheme in guide.NAMES:
        scheme = guide.found(chosen.scheme)
        lines += _listed(scheme, _formulas(scheme)[0])
    yield Listing("Equations", "\n".join(lines))
    symbols = _symbols(topics, chosen, " ".join([*lines, "θ"]))
    yield FactList("Symbols", (*symbols, *_floors(compared.spacecraft)))
    yield Points(guide.SOURCES[:1])


def _formulas(topic: Topic) -> list[Formula]:
    """The formulas of a topic; the last one of a numbered equation is the one in use."""
    return [block for part in topic.parts for block in part.blocks if isinstance(block, Formula)]


def _listed(topic: Topic, formula: Formula) -> list[str]:
    return [f"{topic.name}  {topic.summary}", *(f"    {line}" for line in formula.lines), ""]


def _symbols(topics: list[Topic], chosen: Plan | None, listed: str) -> Iterator[tuple[str, str]]:
    """Each symbol of the equations that are ``listed`` once, and those of the formula of the scheme, as it has them."""
    seen: dict[str, str] = {}
    for topic in topics:
        for part in topic.parts:
            for block in part.blocks:
                if isinstance(block, TopicRows):
                    seen.update((symbol, text) for symbol, text in block.rows if symbol.removesuffix(")") in listed)
    yield from seen.items()
    if chosen is None or chosen.scheme not in guide.NAMES:
        return
    for part in guide.found(chosen.scheme).parts:
        if any(isinstance(block, Formula) for block in part.blocks):
            yield chosen.scheme, " ".join(block for block in part.blocks if isinstance(block, str))
            return


def _floors(body: Spacecraft) -> Iterator[tuple[str, str]]:
    """The bounds that the impulses of plans are compared with."""
    beyond = beyond_floors(body)
    holds = f"no floor here, with {beyond}" if beyond else "no schedule that does so takes less"
    yield "A|ω0|", f"{quantity(body.least_impulse, 'N m s')}, the impulse that takes out the nutation; {holds}"
    if body.goal.axis is not None:
        turning = quantity(body.turning_impulse, "N m s")
        yield "C|ω3|β", f"{turning}, the impulse that turns the spin by β, the angle from H to the target; {holds}"


def assumption_blocks() -> Iterator[Block]:
    """Assumptions and limits, as the guide has them."""
    yield Points(tuple(re.sub(r"`", "", limit) for limit in guide.limits()))


def checks_sheet(plan: Plan, verification: Verification) -> Sheet:
    """Criteria of a verification, its results, and their verdicts."""
    body = plan.spacecraft
    rows = []
    for method in verification.methods:
        if method.outside and method.missing:
            rows.append((method.name, *MOTION_WITHIN, "not flown", MISSING))
        elif method.outside:
            passed = method.difference <= AGREE
            rows.append((method.name, *MOTION_WITHIN, _size(method.difference), PASSED[passed]))
    for course in (verification.momentum, verification.energy):
        verdict = (
            f"not judged: changed by {' and '.join(course.changed)}" if course.kept is None else PASSED[course.kept]
        )
        rows.append((f"{course.name} on coasts", "keeps to", f"{AGREE:g} of itself", _size(course.drift), verdict))
    required = {bound.part for bound in requirements.required(body)}
    impulsive, real = (left_by(flown) for flown in (propagation.by_impulses(body, plan.pulses), plan.flight))
    for part, most in tolerated(body).items():
        first, second = (end.spin if part is Part.SPIN else left_of(part, end, body) for end in (impulsive, real))
        shown, allowed = (
            quantity(value, "rad/s") if part is Part.SPIN else degrees(value) for value in (abs(first - second), most)
        )
        verdict = "pass" if abs(first - second) <= most else "differs: what is flown counts"
        share = " (a tenth of what is required)" * (part in required)
        differs = f"differs from what is flown by at most{share}"
        rows.append((f"impulse sum (17): {part.label}", differs, allowed, shown, verdict))
    heads = ("check", "criterion", "threshold", "found", "verdict")
    return Sheet("Checks and their thresholds", tuple(Heading(head, number=False) for head in heads), tuple(rows))


def _size(difference: float) -> str:
    return f"{difference:.1e}" if difference else "0"


MOTION_WITHIN = (
    "axis, H and rates differ from the flown motion by at most",
    f"{AGREE:g} rad; rates {AGREE:g} of their size",
)
PASSED = {True: "pass", False: "FAIL"}
