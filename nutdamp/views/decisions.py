"""Words of a decision, for all screens, pages and files: requirement met or not, margins, and final motion."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from operator import attrgetter
from typing import NamedTuple

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.flight.end_state import Aspect
from nutdamp.flight.propagation import Flight
from nutdamp.planning.decision import Comparison, Decision, Line, strays
from nutdamp.planning.notes import alternatives, comparison_warnings, decision_notes, reasons
from nutdamp.planning.plan import Plan
from nutdamp.planning.recommendation import Share
from nutdamp.schemes import catalogue
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import SLACK
from nutdamp.spacecraft.requirements import Bound, Part
from nutdamp.views.spacecraft import FRAME_N, aspect_facts, cone_margins, direction_text, required, spin_text
from nutdamp.views.tables import TEXT, Column, DataTable, Shared, facts
from nutdamp.views.text import MISSING, degrees, duration, joined, mass, moment, most, ordered, quantity, screen_line

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
        return f"NOT met: {broken}; {cases_share(cases.complying, cases.probability)}"
    return f"NOT met: {broken}; otherwise {_at_end(decision)}"


def statement(decision: Decision) -> Text:
    """The verdict as a sentence."""
    lead = "Requirement: " if decision.nominal is None and not decision.strays else "Requirement "
    return Text.assemble(lead, coloured(verdict(decision), decision.met), ".")


def _at_end(decision: Decision) -> str:
    """Verdict on the end, regardless of cones on the way."""
    cases, nominal = decision.cases, decision.nominal
    if nominal is None:
        what, done = ("nutation", "damped") if decision.plan.spacecraft.goal.axis is None else ("target", "reached")
        return f"no requirement in file; {what} {'NOT ' * (not decision.damped)}{done} with nominal values"
    if decision.unknown:
        return f"NOT met{' with nominal values' * (not nominal)}: {UNDECIDED}"
    if cases is not None and cases.complying is not None:
        if nominal:
            return cases_verdict(cases.complying, cases.probability)
        return f"NOT met with nominal values; {cases_share(cases.complying, cases.probability)}"
    return f"{'met' if nominal else 'NOT met'} with nominal values"


class MarginRow(NamedTuple):
    """A requirement, its limit, values with nominal values and in cases, margin, and whether it is ``met``, as text."""

    name: str
    limit: str
    nominal: str
    dispersed: str
    margin: str
    verdict: str
    met: bool | None


def decision_table(decision: Decision, values: str = Shared.NOMINAL) -> DataTable:
    """One row a part of the requirement, and one for the share of cases that comply; ``values`` heads the residuals."""
    cases = decision.cases
    level = "" if cases is None else f"({exact_percent(cases.probability)})"
    columns = (
        Column("", "requirement", "", attrgetter("name"), where="screen", kind=TEXT),
        Column("", "limit", "", attrgetter("limit"), where="screen"),
        Column("", values, "", attrgetter("nominal"), where="screen"),
        Column("", "dispersed", level, attrgetter("dispersed"), where="screen" * bool(level)),
        Column("", "margin", "", attrgetter("margin"), where="screen"),
        Column("", Shared.VERDICT, "", attrgetter("verdict"), where="screen", kind=TEXT, met=attrgetter("met")),
    )
    return DataTable("Requirement", columns, list(_margins(decision)))


def _margins(decision: Decision) -> Iterator[MarginRow]:
    cases = decision.cases
    for line in decision.lines:
        nominal, dispersed, margin = (size(line.bound, each) for each in (line.nominal, line.dispersed, line.margin))
        yield MarginRow(line.bound.part.label, limit(line.bound), nominal, dispersed, margin, _met(line), line.met)
    for aspect in decision.aspects:
        for bound, angle, left in cone_margins(aspect):
            words = KEPT[left >= -SLACK] + " (nominal)" * (cases is not None)
            name = f"axis from {aspect.keep.name}"
            yield MarginRow(name, bound, degrees(angle), "", degrees(left), words, left >= -SLACK)
    if cases is not None and cases.complying is not None:
        least, share = exact_percent(cases.probability), percent(cases.complying, cases.probability)
        margin = f"{100.0 * (cases.complying - cases.probability):.3g} points"
        yield MarginRow(COUNT, f"≥ {least}", "", share, margin, VERDICT[cases.met], cases.met)


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
    """Verdict on a part: met or not; on one that is not required, damped or reached."""
    if line.bound.required:
        return VERDICT[line.met]
    done = "reached" if line.bound.part is Part.DISTANCE else "damped"
    return MISSING if line.met is None else f"{'NOT ' * (not line.met)}{done}"


def cost(decision: Decision) -> Iterator[tuple[str, str]]:
    """Cost and end of the plan: names and values."""
    pulses = decision.flight.schedule
    count = f"pulses: {len(pulses)}"
    if pulses.propellant is None:
        yield "impulse", f"{quantity(pulses.total_impulse, 'N m s')}, {count}"
    else:
        yield "propellant", f"{mass(pulses.propellant)}, {count}"
    yield "last pulse ends", moment(pulses.end) if len(pulses) else "no pulse is needed"


def end_facts(decision: Decision) -> Table:
    """Final spin axis, H and spin, cost, and end time."""
    return facts([*end_rows(decision.flight, decision.aspects), *cost(decision)])


def decision_screen(compared: Comparison, decision: Decision) -> list[RenderableType]:
    """The decision as the top of a screen: plan and reason, verdict, margins, and final motion."""
    why, warnings = joined(reasons(compared)), comparison_warnings(compared, cones=False)
    return [
        Text.assemble("Recommended: ", (decision.plan.scheme, "bold"), f" – {why}."),
        statement(decision),
        *map(screen_line, ordered([*warnings, *decision_notes(decision), *alternatives(compared)])),
        *figures(decision),
    ]


def requirement(decision: Decision) -> Iterator[Text]:
    """The verdict as a line of a screen, and its notes."""
    yield statement(decision)
    yield from map(screen_line, ordered(decision_notes(decision)))


def figures(decision: Decision) -> list[RenderableType]:
    """The numbers of a decision on a screen: margins, then the final motion."""
    return [Text(), decision_table(decision).screen("screen"), Text(), end_facts(decision)]


def margin_lines(decision: Decision, values: str = Shared.NOMINAL) -> list[RenderableType]:
    """The margins of a flight, where there are any; ``values`` heads the residuals."""
    return [decision_table(decision, values).screen("screen")] if decision.lines or decision.aspects else []


def end_rows(flown: Flight, watched: Iterable[Aspect]) -> Iterator[tuple[str, str]]:
    """Spin axis and angular momentum after the last pulse, beside the target, and the motion from then on.

    ``watched``: least distances of the axis from directions in space.
    """
    body, final = flown.spacecraft, flown.final
    yield "spin axis ends at", direction_text(body, final.axis)
    yield "H ends at", direction_text(body, final.momentum)
    if body.goal.axis is not None:
        off = degrees(flown.residual.axis_error)
        yield "target", f"{direction_text(body, body.goal.axis)}; H ends {off} off"
    yield "final state", f"spin {spin_text(final.spin)}, nutation {degrees(final.nutation)}"
    if lasting(flown):
        yield "", lasting(flown)
    yield from aspect_facts(watched)
    if body.attitude is None:
        yield "", FRAME_N
    elif body.attitude.frame is not None:
        yield "frame", body.attitude.frame


def lasting(flown: Flight) -> str:
    """Time of the end shown where the motion does not last, and the cause of its change; empty where it lasts."""
    body = flown.spacecraft
    causes = [*["dissipation"] * (body.growth != 0.0), *["disturbances"] * bool(body.disturbances)]
    end = "as the last pulse ends, at " + moment(flown.schedule.end)
    end = end if flown.until is None else f"at {moment(flown.until)}"
    return f"{end}; changed further by {' and '.join(causes)}" if causes else ""
