"""Words of a decision, for all screens, pages and files: requirement met or not, margins, and final motion."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.planning.decision import Comparison, Decision, Line, strays
from nutdamp.planning.notes import alternatives, comparison_warnings, decision_notes, reasons
from nutdamp.spacecraft.model import SLACK
from nutdamp.spacecraft.requirements import Bound, Part
from nutdamp.views import verdicts
from nutdamp.views.end_tables import cone_margins, end_table
from nutdamp.views.layout import columns
from nutdamp.views.notes import joined, ordered, screen_line
from nutdamp.views.text import MISSING, degrees, mass, moment, most, quantity

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
    return f"{'met' if nominal else 'NOT met'} with nominal values"


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


def decision_screen(compared: Comparison, decision: Decision) -> list[RenderableType]:
    """The decision as the top of a screen: plan and reason, verdict, margins, and final motion."""
    why, warnings = joined(reasons(compared)), comparison_warnings(compared, cones=False)
    return [
        Text.assemble("Recommended: ", (decision.plan.scheme, "bold"), f" – {why}."),
        statement(decision),
        *map(screen_line, ordered([*warnings, *decision_notes(decision), *alternatives(compared)])),
        *figures(decision),
    ]


def requirement(decision: Decision, *, looped: bool = False) -> Iterator[Text]:
    """The verdict as a line of a screen, and its notes; ``looped``: it is the flight of a closed loop."""
    yield statement(decision)
    yield from map(screen_line, ordered(decision_notes(decision, looped=looped)))


def figures(decision: Decision) -> list[RenderableType]:
    """The numbers of a decision on a screen: margins, then the final motion."""
    return [Text(), decision_table(decision), Text(), end_facts(decision)]
