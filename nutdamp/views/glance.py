"""The screens of ``plan``: what to fire on top, by default in at most `LINES` lines of `WIDTH` columns.

The headline, requirements that are not met, warnings and the end of the flight are never dropped; the rest gives way in
the order of its worth and stands on the full screen (``-v``). The schemes compared are one row each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from operator import attrgetter
from typing import Any, NamedTuple

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.common.numerics import RPM
from nutdamp.common.results import Note
from nutdamp.errors import listed
from nutdamp.flight.end_state import at_start
from nutdamp.flight.propagation import REAL_WIDTHS, model_name
from nutdamp.planning.decision import Comparison, Decision, decide, infeasibility
from nutdamp.planning.notes import alternatives, comparison_warnings, decision_notes, plan_notes, reasons
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import SLACK, Spacecraft
from nutdamp.spacecraft.requirements import Bound, Part
from nutdamp.views import decisions, parts, tables
from nutdamp.views.decisions import COUNT, coloured, lasting, limit, size, verdict
from nutdamp.views.tables import TEXT, WHOLE, YES_NO, Column, DataTable, Shared, angle_of, facts, to_figures
from nutdamp.views.text import degrees, digits, joined, ordered, screen_line, screen_lines, short_angle, small_angle

NOT = "✗"  # sign before a value above the requirement
SHORT_NAMES = ("RA", "dec")  # right ascension and declination, where there is little room


def scheme_table(compared: Comparison, chosen: Plan | None) -> DataTable:
    """One row a scheme, with residuals of the flight through real widths; the ``chosen`` one stands out."""
    mark = next((index for index, plan in enumerate(compared.plans) if plan is chosen), None)
    how = model_name(plan.pulses for plan in compared.plans)
    ideal = [plan.scheme for plan in compared.plans if plan.pulses.idealised]
    alone = f" (ideal impulses: {listed(ideal)})" if how == REAL_WIDTHS and ideal else ""
    subject = f"Cost and residuals of each scheme with nominal values, by {how}{alone}"
    return DataTable(subject, tuple(_columns(compared, chosen)), compared.plans, compared, mark)


def limits(body: Spacecraft) -> tuple[float, float]:
    """Limits, rad, of the nutation and of the end of H, infinite where there are none."""
    most = {bound.part: bound.most for bound in requirements.required(body)}
    ends = [most[part] for part in (Part.SHIFT, Part.DISTANCE) if part in most]
    return most.get(Part.NUTATION, math.inf), min(ends, default=math.inf)


def _feasible(get: Callable[[Plan], Any] | str) -> Callable[[Plan], Any]:
    """A value of plans that have a schedule, or an attribute of them."""
    value = attrgetter(get) if isinstance(get, str) else get
    return lambda plan: value(plan) if plan.feasible else None


def scheme_verdict(compared: Comparison, plan: Plan) -> str:
    """Verdict on a plan, or the reason in a word why there is none."""
    if not plan.feasible:
        return decisions.no_plan(plan)
    return decisions.VERDICT[compared.meets(plan)] + ", timed" * (not plan.commandable)


def _four(value: float) -> str:
    return digits(value, 4) if value else "0"


def _columns(compared: Comparison, chosen: Plan | None) -> Iterator[Column]:
    body, least = compared.spacecraft, limits(compared.spacecraft)
    feasible = [plan for plan in compared.plans if plan.feasible]
    fuelled = any(plan.pulses.propellant is not None for plan in feasible)
    aimed, everywhere = body.goal.axis is not None, "screen full page"
    met = _feasible(compared.meets)

    def share(plan: Plan) -> str:
        return decisions.share_text(compared.shares.get(plan)).removesuffix(" %")

    def shortly(largest: float) -> Callable[[float], str]:
        return lambda angle: short_angle(math.radians(angle), largest)

    yield Column("scheme", Shared.SCHEME, "", attrgetter("scheme"), where=f"{everywhere} csv", kind=TEXT)
    yield Column("feasible", "", "", attrgetter("feasible"), where="csv", kind=YES_NO)
    yield Column("recommended", "", "", lambda plan: plan is chosen, where="csv", kind=YES_NO)
    yield Column("meets_requirement", "", "", compared.meets, where="csv", kind=YES_NO)
    exact = {plan: known.exact for plan, known in compared.shares.items()}
    yield Column("met_fraction", "", "", exact.get, where="csv")
    count = _feasible(lambda plan: len(plan.pulses))
    yield Column("", Shared.PULSES, "", count, where=everywhere, kind=WHOLE)
    yield Column("pulses", "", "", lambda plan: len(plan.pulses), where="csv", kind=WHOLE)
    end, impulse = _feasible("pulses.end"), _feasible("pulses.total_impulse")
    yield Column("", "end", "s", end, to_figures(4), "screen")
    yield Column("end_s", "end", "s", end, lambda value: f"{value:.3f}", "full page csv")
    where = "full page csv" + " screen" * (not fuelled)
    yield Column("total_impulse_Nms", Shared.IMPULSE, "N m s", impulse, _four, where)
    yield Column("least_impulse_Nms", "", "", _feasible("spacecraft.least_impulse"), where="csv")
    for name, whole in ratios(body):
        yield Column("", f"impulse over {name}", "", _feasible(_over(whole)), lambda value: f"{value:.4f}", "full page")
    spent = _feasible("pulses.propellant")
    yield Column("propellant_kg", Shared.PROPELLANT, "kg", spent, where="csv")
    if fuelled:
        yield Column("", Shared.PROPELLANT, "g", spent, lambda mass: _four(1e3 * mass), "full page")
        yield Column("", Shared.PROPELLANT, "g", spent, to_figures(4, 1e3), "screen")
    for name in ("nutation", "momentum_shift"):
        heading = f"{name.replace('_', ' ')}, impulses (17)"
        yield Column("", heading, "deg", angle_of(f"residual.{name}"), small_angle, "full")
    ends = ("full page", everywhere) if aimed else (everywhere, "")
    shown = {"nutation": everywhere, "body_cone": "full", "space_cone": "full", "momentum_shift": ends[0],
             "axis_error": ends[1]}  # fmt: skip
    for name, where in shown.items():
        heading, angle = name.replace("_", " "), angle_of(f"flown.{name}")
        if "screen" in where:
            yield Column("", heading, "", angle, shortly(least[name != "nutation"]), "screen")
        yield Column(f"{name}_deg", heading, "deg", angle, small_angle, where.removeprefix("screen ") + " csv")
    yield from _directions(body)
    yield Column("spin_rad_s", "", "", _feasible("flight.final.spin"), where="csv")
    if body.goal.spin is not None:
        yield Column("", "final spin", "rad/s", _feasible("flight.settled.spin"), to_figures(6), "full")
    where = "full csv" + " page" * any(plan.spin_change for plan in compared.plans)
    yield Column("spin_change_rad_s", "spin change", "rad/s", attrgetter("spin_change"), _four, where)
    where = "csv" + " full page" * any(plan.delta_v is not None for plan in compared.plans)
    yield Column("delta_v_m_s", "|ΔV|", "m/s", lambda plan: None if plan.delta_v is None else math.hypot(*plan.delta_v),
                 _four, where)  # fmt: skip
    if compared.shares:
        yield Column("", Shared.CASES, "%", share, where="screen", kind=TEXT)
        yield Column("", COUNT, "%", share, where="full page", kind=TEXT)
    yield from _bounds(compared)
    yield Column("", Shared.VERDICT, "", partial(scheme_verdict, compared), where=everywhere, kind=TEXT, met=met)
    yield Column("why", "", "", infeasibility, where="csv", kind=TEXT)


def ratios(body: Spacecraft) -> Iterator[tuple[str, float]]:
    """The floors of impulse, N m s, by name: A|ω0|, and with a target C|ω3|β."""
    yield "A|ω0|", body.least_impulse
    if body.goal.axis is not None:
        yield parts.turn_floor(body), parts.turning(body)


def _over(whole: float) -> Callable[[Plan], float | None]:
    return lambda plan: plan.pulses.total_impulse / whole if whole > 0.0 else None


def _directions(body: Spacecraft) -> Iterator[Column]:
    keys = ("tilt_deg", "azimuth_deg") if body.attitude is None else ("right_ascension_deg", "declination_deg")
    names = parts.angle_names(body) if body.attitude is None else SHORT_NAMES
    for at, key in enumerate(keys):
        yield Column(f"axis_{key}", "", "", _feasible(partial(_direction, "axis", key)), where="csv")
        yield Column("", f"axis {names[at]}", "deg", _feasible(partial(_shown_direction, at)), where="full page")
    for key in keys:
        yield Column(f"momentum_{key}", "", "", _feasible(partial(_direction, "momentum", key)), where="csv")


def _direction(which: str, key: str, plan: Plan) -> float | None:
    return decisions.direction_json(plan.spacecraft, getattr(plan.flight.final, which))[key]


def _shown_direction(at: int, plan: Plan) -> str:
    return parts.angle_texts(plan.spacecraft, plan.flight.final.axis)[at].removesuffix(" deg")


def _bounds(compared: Comparison) -> Iterator[Column]:
    if not requirements.judged(compared.spacecraft):
        return
    for bound in requirements.required(compared.spacecraft):
        name, cell = f"{bound.part.label} {limit(bound)}", partial(_part, bound)
        yield Column("", name, "", _feasible(cell), where="full", kind=TEXT)
    for at, cone in enumerate(at_start(compared.spacecraft)[: len(compared.spacecraft.keep)]):
        for kept, _, _ in parts.cone_margins(cone):
            name = f"axis from {cone.keep.name} {kept}"
            yield Column("", name, "", _feasible(partial(_cone, at, kept)), where="full", kind=TEXT)


def _part(bound: Bound, plan: Plan) -> str:
    (part,) = (part for part in plan.held if part.bound == bound)
    shown = size(bound, part.left).removesuffix(" deg")  # the heading has the unit
    return shown if part.met else f"{NOT} {shown}"


def _cone(at: int, kept: str, plan: Plan) -> str:
    angles = ((angle, left) for bound, angle, left in parts.cone_margins(plan.aspects[at]) if bound == kept)
    return next(f"{NOT} " * (left < -SLACK) + degrees(angle).removesuffix(" deg") for angle, left in angles)


LINES = 24  # lines of the screen
ROWS, FIRST = 6, 4  # pulses or blocks that are shown one by one; of more the first and the last
TIGHTEST = 2  # requirements that are shown where there is no room for all that are met
NOTES = 3  # notes that are shown, at most
DIGITS = 8  # figures of a value beside its limit, at most


def glance(compared: Comparison, decision: Decision | None, robust: Sequence[Note] | None = None) -> RenderableType:
    """The screen of a comparison and the plan to fly, one of those compared, or of the reason why there is none.

    ``robust``: notes on the choice, where dispersed cases made it.
    """
    body = compared.spacecraft
    head = [*parts.title(body), headline(compared, decision)]
    warnings, more = screen_lines([*(robust or ()), *notes(compared, decision, robust=robust is not None)])
    table = scheme_table(compared, None if decision is None else decision.plan).screen("screen", between=" ")
    if decision is None:
        return _fitted(head, [], [], more, table)
    plan = decision.plan
    head += [coloured(verdict(decision), decision.met), *warnings]

    def screen(first: int, *apart: Text) -> RenderableType:
        fired: list[RenderableType] = []
        if plan.pulses.blocks:
            fired = [*apart, parts.block_table(plan.flight).screen("screen", first=first)]
        elif len(plan.pulses):
            shown = parts.pulse_table(plan.flight, least=limits(body)[0])
            fired = [*apart, shown.screen("screen", between=", ", first=first if len(shown.rows) > ROWS else None)]
        required, middle = requirement_rows(decision), [ends(decision), *fired]
        return _fitted(head, required, middle, more, table, blocks=bool(plan.pulses.blocks))

    sizes = (screen(first, Text()) for first in (FIRST, FIRST // 2, 1))
    return next((shown for shown in sizes if tables.lines_of(shown) <= LINES), screen(1))


def notes(compared: Comparison, decision: Decision | None, *, robust: bool = False) -> list[Note]:
    """Warnings, then notes in the order of their worth; a ``robust`` plan was made for what others miss."""
    infeasible = [note for plan in compared.plans if not plan.feasible for note in plan_notes(plan)]
    if decision is None:
        return infeasible
    own = plan_notes(decision.plan, cones=False) if decision.plan is compared.recommended else ()
    missed = () if robust else comparison_warnings(compared, tabulated=True)
    return ordered([*missed, *decision_notes(decision), *alternatives(compared), *infeasible, *own])


def headline(compared: Comparison, decision: Decision | None) -> Text:
    """Headline of the plan to fly: scheme, pulses, cost and end; or that it is not enough, not needed, not found."""
    if decision is None:
        return Text.assemble(("NO PLAN", "bold red"), f": {joined(reasons(compared))}")
    plan = decision.plan
    pulses = plan.pulses
    if not len(pulses):
        return Text.assemble(("NO PULSE needed", "bold"), f": {decisions.needless(compared) or 'nothing is fired'}")
    blocks = f"blocks {len(pulses.blocks)}, " if pulses.blocks else ""
    count = f"{blocks}pulses {len(pulses)}, {decisions.spent(pulses)}, ends at {pulses.end:.4g} s"
    lead = ("NOT ENOUGH: ", "bold red") if decision.met is False else ("FLY ", "bold")
    ideal = " (ideal impulses)" * pulses.idealised
    return Text.assemble(lead, (plan.scheme, "bold"), f"{ideal}: {count}")


class RequirementRow(NamedTuple):
    """Requirement in words: its label, values in the cases and nominally, limit, verdict and margin.

    ``used``: shares of the limit that the nominal value and that of the cases take, NaN where it is not known.
    """

    label: str
    dispersed: str
    nominal: str
    limit: str
    verdict: Text
    margin: str
    used: tuple[float, float]

    @property
    def met(self) -> bool:
        """True unless it is missed."""
        return self.verdict.plain != decisions.VERDICT[False]

    @property
    def worth(self) -> tuple[float, bool]:
        """Order in which requirements are shown: the least share of the limit that is left first."""
        worst = self.used[0] if math.isnan(self.used[1]) else self.used[1]
        return (math.inf if math.isnan(worst) else 1.0 - worst), self.met


def requirement_rows(decision: Decision) -> list[RequirementRow]:
    """Rows of what is required."""
    rows = []
    cases = decision.cases
    level = "" if cases is None else f"{decisions.exact_percent(cases.probability)}: "
    for line in decision.lines:
        if not line.bound.required:
            continue
        bound, values = line.bound, (line.nominal, None if cases is None else line.dispersed)
        dispersed = "" if values[1] is None else level + _left(bound, values[1])
        words = dispersed, f"nominal {_left(bound, line.nominal)}", f"limit {limit(bound)[2:]}"
        used = [math.nan if value is None else value / bound.most for value in values]
        met, spin = coloured(decisions.VERDICT[line.met], line.met), bound.part is Part.SPIN
        left = size(bound, line.margin) if spin else f"{short_angle(line.margin, bound.most)} deg"
        rows.append(RequirementRow(bound.part.label, *words, met, left, (used[0], used[1])))
    for aspect in decision.aspects:
        name, keep = f"axis from {aspect.keep.name}", aspect.keep
        for text, angle, margin in parts.cone_margins(aspect):
            kept, least = margin >= -SLACK, margin == aspect.least - keep.least
            used_up = keep.least / max(angle, SLACK) if least else angle / keep.most
            words, met = ("", f"nominal {degrees(angle)}", f"limit {text}"), coloured(decisions.VERDICT[kept], kept)
            rows.append(RequirementRow(name, *words, met, f"{short_angle(margin)} deg", (used_up, math.nan)))
    return rows


def _left(bound: Bound, value: float | None) -> str:
    """Residual of a part, with as many digits as it takes to stand on its side of the limit."""
    if bound.part is Part.SPIN or value is None or math.isnan(value):
        return size(bound, value)
    text, figures, shown = short_angle(value, bound.most), 3, float(f"{math.degrees(bound.most):.4g}")
    while (float(text) > shown) != (value > bound.most) and figures < DIGITS:
        figures += 1
        text = f"{math.degrees(value):.{figures}g}"
    return f"{text} deg"


def ends(decision: Decision) -> Table:
    """End of the flight, flown and by the impulse sum (17), and where the spin axis points."""
    plan, left, body = decision.plan, decision.flight.residual, decision.plan.spacecraft
    formula, (least, turn) = plan.residual, limits(body)
    angles = [f"nutation {short_angle(left.nutation, least)}", f"body cone {short_angle(left.body_cone, least)}"]
    angles += [f"space cone {short_angle(left.space_cone, least)}"]
    if formula is not None and (by_impulses := short_angle(formula.nutation, least)) not in angles[0].split():
        angles[0] += f" (17: {by_impulses})"
    rows = [("after pulses, deg", "  ".join(angles))]
    first, second = parts.angle_texts(body, decision.flight.final.axis)
    names = parts.angle_names(body) if body.attitude is None else SHORT_NAMES
    turned = f"turned by {short_angle(left.momentum_shift, turn)} deg"
    turned = turned if body.goal.axis is None else f"{short_angle(left.axis_error, turn)} deg off target"
    spun = abs(decision.flight.final.spin - body.spin) > requirements.SPIN_TOLERANCE * abs(body.spin)
    spin = f"; spin {decision.flight.final.spin * RPM:.5g} rpm" * spun
    rows.append(("axis", f"{names[0]} {first}, {names[1]} {second}; H {turned}{spin}"))
    if len(plan.pulses) and lasting(decision.flight):
        rows.append(("", lasting(decision.flight)))
    return facts(rows)


def _fitted(
    head: Sequence[Text],
    required: Sequence[RequirementRow],
    middle: Sequence[RenderableType],
    more: Sequence[Text],
    schemes: RenderableType,
    *,
    blocks: bool = False,
) -> RenderableType:
    """All parts within the lines there are; notes go first, then requirements that are met with room."""
    lines = tables.lines_of(*head, *middle, schemes) + len(required) + 2
    apart = [Text()] * (lines <= LINES)
    lines -= 1 - len(apart)
    shown = list(required)
    if lines > LINES and len(required) > TIGHTEST:
        tight = sorted(required, key=lambda row: row.worth)[:TIGHTEST]
        shown = [row for row in required if not row.met or row in tight]
        lines -= len(required) - len(shown)
    shown_notes: list[Text] = []
    for note in more:
        lines += tables.lines_of(note)
        if lines > LINES or len(shown_notes) == NOTES:
            break
        shown_notes.append(note)
    hidden = len(more) - len(shown_notes) + len(required) - len(shown)
    further = f"-v all values ({hidden} more)" if hidden else "-v all values"
    written = "--blocks blocks.csv" if blocks else "--csv pulses.csv"
    steps = Text(f"{further} · {written} · --plot plan.png · nutdamp report", style="dim")
    return Group(*head, *[facts(row[:5] for row in shown)] * bool(shown), *middle, *apart, schemes, *shown_notes, steps)


def comparison_screen(compared: Comparison) -> RenderableType:
    """All tables of ``plan``, the decision on top."""
    decided, needless = decide(compared), decisions.needless(compared)
    schemes = scheme_table(compared, compared.recommended).transposed("full")
    results: list[RenderableType] = [Text(), parts.derived_table(compared.spacecraft), Text(), schemes]
    lead: list[RenderableType] = [Text(compared.spacecraft.name, style="bold")]
    if needless is not None:
        lead.append(Text.assemble(("No pulse needed: ", "bold"), f"{needless}."))
    remarks = [note for plan in compared.plans for note in plan_notes(plan)]
    results += [Text(), *map(screen_line, ordered(remarks))] if remarks else []
    if decided is None:
        return Group(*lead, Text(f"No recommendation: {joined(reasons(compared))}.", style="bold"), *results)
    if decided.plan.pulses.blocks:
        results += [Text(), parts.blocks_screen(decided.plan.flight, decided.plan.delta_v)]
    elif len(decided.plan.pulses):
        results += [Text(), parts.pulse_table(decided.plan.flight).screen("full")]
    why, warnings = joined(reasons(compared)), comparison_warnings(compared, tabulated=True)
    return Group(
        *lead,
        Text.assemble("Recommended: ", (decided.plan.scheme, "bold"), f" – {why}."),
        decisions.statement(decided),
        *map(screen_line, ordered([*warnings, *decision_notes(decided), *alternatives(compared)])),
        *decisions.figures(decided),
        *results,
    )
