"""Words of a decision, for all screens, pages and files: requirement met or not, margins, and final motion."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.errors import listed
from nutdamp.planning.decision import TELLING, Comparison, Decision, Line, strays
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import SLACK
from nutdamp.spacecraft.requirements import Bound, Part
from nutdamp.views import verdicts
from nutdamp.views.end_tables import cone_margins, end_table
from nutdamp.views.layout import columns
from nutdamp.views.text import MISSING, degrees, lasting, mass, moment, most, quantity

KEPT = {True: "kept", False: "NOT kept"}
"""Words for a cone about a direction that the spin axis has to keep."""

COUNT = "cases that comply"
"""Name of the row of the decision and of the column of the comparison that count dispersed cases."""


def verdict(decision: Decision) -> str:
    """Verdict on the requirement, in words that leave no doubt about its subject."""
    broken, cases = " and ".join(map(strays, decision.strays)), decision.cases
    if not broken:
        return _at_end(decision)
    # Cases that break a cone do not comply, so that a verdict on cases covers more than the end.
    if cases is not None and cases.complying is not None:
        return f"NOT met: {broken}; {verdicts.cases_share(cases.complying, cases.probability)}"
    return f"NOT met: {broken}; otherwise {_at_end(decision)}"


def statement(decision: Decision) -> Text:
    """The verdict as a sentence."""
    lead = "Requirement: " if decision.nominal is None and not decision.strays else "Requirement "
    return Text.assemble(lead, coloured(verdict(decision), decision.met), ".")


def _at_end(decision: Decision) -> str:
    """Verdict on the end, regardless of cones on the way."""
    cases, nominal = decision.cases, decision.nominal
    if nominal is None:
        what = "nutation is damped" if decision.plan.spacecraft.goal.axis is None else "target is reached"
        what = what if decision.damped else what.replace(" is ", " is NOT ")
        return f"nothing is required at the end; with nominal values the {what}"
    if decision.unknown:
        return f"NOT met{' with nominal values' * (not nominal)}: {verdicts.UNDECIDED}"
    if cases is not None and cases.complying is not None:
        if nominal:
            return verdicts.cases_verdict(cases.complying, cases.probability)
        return f"NOT met with nominal values; {verdicts.cases_share(cases.complying, cases.probability)}"
    result = f"{'met' if nominal else 'NOT met'} with nominal values"
    return f"{result}; dispersed cases were not flown" if decision.undispersed else result


def notes(decision: Decision, *, looped: bool = False) -> Iterator[str]:
    """Notes beside the verdict: idealisations, and growth of the nutation.

    ``looped``: it is the flight of a closed loop, which goes on firing.
    """
    if ideal := verdicts.idealised(decision.plan):
        yield ideal
    if looped:
        return
    if turned := _turned(decision):
        yield f"{decision.plan.scheme} {listed(turned)}."
    if not decision.plan.commandable:
        yield f"{decision.plan.scheme} cannot be commanded: no command block fires its pulses."
    yield from _growing(decision)
    yield from _unaided(decision)
    if decision.plan.spacecraft.loop is not None:
        yield "The plan is a schedule and is judged without the closed loop of the file (nutdamp loop)."


def _turned(decision: Decision) -> list[str]:
    """Unrequested change of axis and spin by a plan, where it is large enough to be mentioned."""
    body, final, changes = decision.plan.spacecraft, decision.flight.residual, []
    if body.goal.axis is None and final.momentum_shift > TURNED:
        changes.append(f"turns the axis (H) by {degrees(final.momentum_shift)}")
    change = decision.final.spin - body.spin
    if body.goal.spin is None and abs(change) > requirements.SPIN_TOLERANCE * abs(body.spin):
        changes.append(f"changes the spin by {quantity(change, 'rad/s')}")
    return changes


TURNED = math.radians(0.1)
"""Turn of H, rad, from which it is mentioned."""


def _growing(decision: Decision) -> Iterator[str]:
    """Time for which nutation that grows keeps the requirement after the last pulse."""
    if not len(decision.plan.pulses):
        return
    left, whose, until = decision.final.nutation, "", decision.flight.until
    if decision.cases is not None:
        left = decision.cases.levels[Part.NUTATION]
        whose = f" (not exceeded in {verdicts.exact_percent(decision.cases.probability)} of cases)"
    body = decision.plan.spacecraft
    again = requirements.outgrown(body, left)
    if again and left > TELLING:
        most_nutation = next(most(bound.most) for bound in requirements.required(body) if bound.part is Part.NUTATION)
        grows = f"from {degrees(left)}{whose} to {most_nutation} in {lasting(again)}"
        yield f"After {'the last pulse' if until is None else moment(until)} what is left grows again: {grows}."


def _unaided(decision: Decision) -> Iterator[str]:
    """Time up to which, or from which on, the requirement is met without a pulse."""
    body = decision.plan.spacecraft
    if not requirements.only_nutation(body):
        return
    now, idle, damped = body.nutation, requirements.outgrown(body, body.nutation), requirements.subsides(body)
    limit_ = next((most(bound.most) for bound in requirements.required(body) if bound.part is Part.NUTATION), "")
    if damped is not None and damped < body.horizon:
        fallen = f"by then the nutation of {degrees(now)} at t = 0 has decayed to {limit_}"
        sooner = ", before this plan ends" if decision.plan.end > damped else ""
        yield f"Without a pulse the requirement is met from {quantity(damped, 's')} on{sooner}: {fallen}."
    if idle:
        grown = f"by then the nutation of {degrees(now)} at t = 0 has grown to {limit_}"
        yield f"Without a pulse the requirement is met up to {quantity(idle, 's')}: {grown}."


def decision_table(decision: Decision, values: str = "nominal") -> Table:
    """One row a part of the requirement, and one for the share of cases that comply; ``values`` heads the residuals."""
    cases = decision.cases
    heads = ["requirement", "limit", values]
    if cases is not None:
        heads.append(f"dispersed\n({verdicts.exact_percent(cases.probability)})")
    table = columns(*heads, "margin", "verdict", text=("verdict",))
    for line in decision.lines:
        dispersed = [] if cases is None else [size(line.bound, line.dispersed)]
        cells = (limit(line.bound), size(line.bound, line.nominal), *dispersed, size(line.bound, line.margin))
        table.add_row(line.bound.part.label, *cells, coloured(_met(line), line.met))
    for aspect in decision.aspects:
        for bound, angle, left in cone_margins(aspect):
            kept, none = left >= -SLACK, [""] * (cases is not None)
            words = coloured(KEPT[kept] + " (nominal)" * (cases is not None), kept)
            table.add_row(f"axis from {aspect.keep.name}", bound, degrees(angle), *none, degrees(left), words)
    if cases is not None and cases.complying is not None:
        least, share = verdicts.exact_percent(cases.probability), verdicts.percent(cases.complying, cases.probability)
        margin = f"{100.0 * (cases.complying - cases.probability):.3g} points"
        words = coloured(verdicts.VERDICT[cases.met], cases.met)
        table.add_row(COUNT, f"≥ {least}", "", share, margin, words)
    return table


def coloured(text: str, met: bool | None) -> Text:
    """A verdict in its colour."""
    return Text(text, "" if met is None else "green" if met else "bold red")


def limit(bound: Bound) -> str:
    """The bound of a part."""
    return f"≤ {quantity(bound.most, 'rad/s') if bound.part is Part.SPIN else most(bound.most)}"


def size(bound: Bound, value: float | None) -> str:
    """The residual of a part, in rad/s or degrees."""
    return quantity(value, "rad/s") if bound.part is Part.SPIN else degrees(value)


def _met(line: Line) -> str:
    """Verdict on a part: met or not; for one that is not required, whether that counts as damped or reached."""
    if line.bound.required:
        return verdicts.VERDICT[line.met]
    done = "reached" if line.bound.part is Part.DISTANCE else "damped"
    return MISSING if line.met is None else f"{done} (not required)" if line.met else f"NOT {done} (not required)"


def cost(decision: Decision) -> Iterator[tuple[str, str]]:
    """Cost and end of the plan: names and values."""
    pulses = decision.flight.schedule
    count = f"{len(pulses)} pulse{'s' * (len(pulses) != 1)}"
    if pulses.propellant is None:
        yield "impulse", f"{quantity(pulses.total_impulse, 'N m s')} in {count}"
    else:
        yield "propellant", f"{mass(pulses.propellant)} in {count}"
    yield "last pulse ends", moment(pulses.end) if len(pulses) else "no pulse is needed"


def end_facts(decision: Decision) -> Table:
    """Final spin axis, H and spin, cost, and end time."""
    table = end_table(decision.flight, decision.aspects)
    for name, value in cost(decision):
        table.add_row(name, value)
    return table


def decision_screen(compared: Comparison, decision: Decision, reason: str) -> list[RenderableType]:
    """The decision as the top of a screen: plan and reason, verdict, margins, and final motion."""
    plan, missed = decision.plan, verdicts.warnings(compared, beside_verdict=True)
    return [
        Text.assemble("Recommended: ", (plan.scheme, "bold"), f" – {reason}."),
        *requirement(decision),
        *[Text.assemble(("Warning: ", "bold red"), warning) for warning in missed],
        *[Text.assemble(("Note: ", "bold"), hint) for hint in verdicts.hints(compared)],
        *figures(decision),
    ]


def requirement(decision: Decision, *, looped: bool = False) -> Iterator[Text]:
    """The verdict as a line of a screen, and its notes; ``looped`` as in `notes`."""
    yield statement(decision)
    for note in notes(decision, looped=looped):
        yield Text.assemble(("Note: ", "bold"), note)


def figures(decision: Decision) -> list[RenderableType]:
    """The numbers of a decision on a screen: margins, then the final motion."""
    return [Text(), decision_table(decision), Text(), end_facts(decision)]
