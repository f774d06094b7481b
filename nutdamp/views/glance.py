"""The default screen of ``plan``: what to fire on top, in at most `LINES` lines of `WIDTH` columns.

The headline, requirements that are not met, warnings and the end of the flight are never dropped; the rest gives way in
the order of its worth and stands on the full screen (``-v``).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from io import StringIO

from rich.console import Console, Group, RenderableType
from rich.text import Text

from nutdamp.planning.decision import Comparison, Decision, Line, notes_on
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import SLACK
from nutdamp.spacecraft.requirements import Bound, Part
from nutdamp.views import verdicts
from nutdamp.views.decisions import coloured, limit, notes, size, verdict
from nutdamp.views.end_tables import add_aspects, angle_names, angle_texts, cone_margins, lasting
from nutdamp.views.layout import FittedColumns, columns, facts
from nutdamp.views.plan_tables import SHORT_NAMES, channel_text
from nutdamp.views.text import MISSING, RPM, degrees, mass, quantity

WIDTH, LINES = 80, 24
"""Columns and lines of the screen."""

ROWS = 6
"""Pulses or blocks that are shown one by one; of more the first `FIRST` and the last."""

FIRST = 4

TIGHTEST = 2
"""Requirements that are shown where there is no room for all that are met."""

NOTES = 3
"""Notes that are shown, at most."""

FINE = 0.01
"""Share of a limit below which what is left of it is shown as 0."""

COARSE = 5e-4
"""Degrees below which an angle without a limit is shown as 0."""

NEXT = "-v all values · --csv pulses.csv · --plot plan.png · nutdamp report"
"""Next steps, the last line."""


def glance(compared: Comparison, decision: Decision | None, reason: str, robust: str = "") -> RenderableType:
    """The screen of a comparison and the plan to fly; without one the ``reason`` why there is none.

    ``robust``: the name of the plan among those compared, where it was chosen by dispersed cases.
    """
    body = compared.spacecraft
    what = f"{body.inertia.shape}, {body.spin * RPM:.4g} rpm, nutation {short(body.widest.nutation)} deg"
    name = Text(body.name, style="bold")
    title = [Text.assemble(name, f"   {what}")] if len(body.name) + len(what) + 3 <= WIDTH else [name, Text(what)]
    if decision is None:
        head = [Text.assemble(("NO PLAN", "bold red"), f": {reason}")]
        return _fitted([*title, *head], [], [], [*_infeasible(compared)], _schemes(compared, ""))
    plan = decision.plan
    head = [_headline(compared, plan, robust), coloured(verdict(decision), decision.met)]
    warnings = verdicts.warnings(compared, beside_verdict=True)
    head += [Text.assemble(("warning: ", "bold red"), text) for text in warnings]
    said_of = [*notes(decision), *verdicts.hints(compared), *_infeasible(compared), *_remarks(compared, plan)]
    fired = [] if not len(plan.pulses) else [Text(), _fired(plan)]
    return _fitted([*title, *head], [*_requirements(decision)], [_ends(decision), *fired], said_of,
                   _schemes(compared, robust or plan.scheme))  # fmt: skip


def _headline(compared: Comparison, plan: Plan, robust: str) -> Text:
    """Headline of the plan to fly: scheme, pulses, cost and end."""
    pulses = plan.pulses
    if not len(pulses):
        return Text.assemble(("NO PULSE needed", "bold"), f": {verdicts.needless(compared) or 'nothing is fired'}")
    spent = quantity(pulses.total_impulse, "N m s") if pulses.propellant is None else mass(pulses.propellant)
    blocks = f"{len(pulses.blocks)} command block{'s' * (len(pulses.blocks) != 1)}, " if pulses.blocks else ""
    count = f"{blocks}{len(pulses)} pulse{'s' * (len(pulses) != 1)}, {spent}, ends at {pulses.end:.4g} s"
    return Text.assemble(("FLY ", "bold"), (robust or plan.scheme, "bold"), f": {count}")


def short(angle: float | None, largest: float = math.inf) -> str:
    """An angle given in rad, in degrees to three figures; "0" where it does not matter beside a ``largest`` (rad)."""
    if angle is None or math.isnan(angle):
        return MISSING
    least = COARSE if math.isinf(largest) else min(COARSE, FINE * math.degrees(largest))
    return "0" if abs(math.degrees(angle)) < least else f"{math.degrees(angle):.3g}"


def _requirements(decision: Decision) -> list[tuple[float, bool, tuple[str | Text, ...]]]:
    """Rows of what is required, each with the share of the limit that is left and whether it is met."""
    rows: list[tuple[float, bool, tuple[str | Text, ...]]] = []
    cases = decision.cases
    level = "" if cases is None else f"{verdicts.exact_percent(cases.probability)}: "
    for line in decision.lines:
        if not line.bound.required:
            continue
        dispersed = "" if cases is None or line.dispersed is None else level + _left(line.bound, line.dispersed)
        cells = (dispersed, f"nominal {_left(line.bound, line.nominal)}", f"limit {limit(line.bound)[2:]}")
        met = coloured(verdicts.VERDICT[line.met], line.met)
        rows.append((_slack(line), line.met is not False, (line.bound.part.label, *cells, met)))
    for aspect in decision.aspects:
        for bound, angle, margin in cone_margins(aspect):
            kept = margin >= -SLACK
            word = coloured("met" if kept else "NOT met", kept)
            label = f"axis from {aspect.keep.name}"
            rows.append((margin, kept, (label, "", f"nominal {degrees(angle)}", f"limit {bound}", word)))
    return rows


def _slack(line: Line) -> float:
    """Share of the limit that is left of it."""
    worst = line.nominal if line.dispersed is None else line.dispersed
    return math.inf if worst is None else 1.0 - worst / line.bound.most


def _left(bound: Bound, value: float | None) -> str:
    return size(bound, value) if bound.part is Part.SPIN else f"{short(value, bound.most)} deg"


def _ends(decision: Decision) -> RenderableType:
    """End of the flight, flown and by the impulse sum (17), and direction of the spin axis."""
    plan, left, body = decision.plan, decision.flight.residual, decision.plan.spacecraft
    table, formula = facts(), plan.residual
    angles = [f"nutation {short(left.nutation)}", f"body cone {short(left.body_cone)}"]
    angles += [f"space cone {short(left.space_cone)}"]
    if formula is not None:
        angles[0] += f" (17: {short(formula.nutation)})"
    table.add_row("ends, deg", "  ".join(angles))
    first, second = angle_texts(body, decision.final.axis)
    names = angle_names(body) if body.attitude is None else SHORT_NAMES
    turned = f"turned by {short(left.momentum_shift)} deg"
    turned = turned if body.goal.axis is None else f"{short(left.axis_error)} deg off target"
    spun = abs(decision.final.spin - body.spin) > requirements.SPIN_TOLERANCE * abs(body.spin)
    spin = f"; spin {decision.final.spin * RPM:.5g} rpm" * spun
    table.add_row("axis", f"{names[0]} {first}, {names[1]} {second}; H {turned}{spin}")
    if lasting(decision.flight):
        table.add_row("", lasting(decision.flight))
    add_aspects(table, [aspect for aspect in decision.aspects if not aspect.kept])
    return table


def _fired(plan: Plan) -> RenderableType:
    """The blocks or pulses to fire, of many the first ones and the last."""
    flown = plan.flight
    _, after = flown.around_pulses()
    rows: list[list[str]]
    heads: tuple[str, ...]
    if plan.pulses.blocks:
        rows = [
            [str(number), block.channel, str(block.first), f"{block.delay:.6g}", f"{block.width:.6g}",
             str(block.count), str(block.every)]
            for number, block in enumerate(plan.pulses.blocks, 1)
        ]  # fmt: skip
        heads = ("block", "channel", "first Sun pulse", "delay s", "width s", "pulses", "every")
    else:
        rows = [
            [str(number), f"{pulse.loaded[0]:.4f}", f"{pulse.loaded[1]:.4f}" if pulse.loaded[1] else "ideal",
             channel_text(pulse, plan.spacecraft), short(left)]
            for number, (pulse, left) in enumerate(zip(plan.pulses, after.nutation.tolist(), strict=True), 1)
        ]  # fmt: skip
        heads = ("pulse", "start s", "on-time s", "channel", "nutation after, deg")
    table = columns(*heads, text=("channel",))
    for row in rows if len(rows) <= ROWS else rows[:FIRST]:
        table.add_row(*row)
    if len(rows) > ROWS:
        between = [""] * len(heads)
        between[0], between[heads.index("channel")] = "…", f"{len(rows) - FIRST - 1} more"
        table.add_row(*between)
        table.add_row(*rows[-1])
    return table


def _schemes(compared: Comparison, chosen: str) -> FittedColumns:
    """One line a scheme; the one to fly is marked."""
    body = compared.spacecraft
    propellant = all(plan.pulses.propellant is not None for plan in compared.plans if plan.feasible)
    shift = "momentum shift" if body.goal.axis is None else "off target"
    heads = ["scheme", "pulses", "end s", "propellant g" if propellant else "impulse N m s", "nutation", shift]
    heads += ["cases"] * bool(compared.shares)
    table = columns(*heads, "verdict", text=("verdict",))
    for plan in compared.plans:
        name = Text(plan.scheme, style="bold" if plan.scheme == chosen else "")
        if not plan.feasible:
            table.add_row(name, *[""] * (len(heads) - 1), "infeasible" if plan.failure is None else "error")
            continue
        flown, pulses = plan.flown, plan.pulses
        spent = f"{1e3 * (pulses.propellant or 0.0):.4g}" if propellant else f"{pulses.total_impulse:.4g}"
        nutation = None if flown is None else flown.nutation
        turned = None if flown is None else flown.momentum_shift if body.goal.axis is None else flown.axis_error
        cells = [str(len(pulses)), f"{pulses.end:.4g}", spent, short(nutation), short(turned)]
        if compared.shares:
            cells.append(verdicts.share_text(compared.shares.get(plan)).removesuffix(" %"))
        met = compared.meets(plan)
        table.add_row(name, *cells, coloured(verdicts.VERDICT[met] + ", timed" * (not plan.commandable), met))
    return table


def _infeasible(compared: Comparison) -> Iterator[str]:
    """Reasons of schemes without a plan."""
    for plan in compared.plans:
        if not plan.feasible:
            yield from (f"{plan.scheme}: {text}" for text in notes_on(plan))


def _remarks(compared: Comparison, chosen: Plan) -> Iterator[str]:
    """Notes of the scheme to fly on its plan."""
    yield from (f"{chosen.scheme}: {text}" for text in (notes_on(chosen) if chosen in compared.plans else ()))


def _fitted(
    head: Sequence[Text],
    required: Sequence[tuple[float, bool, tuple[str | Text, ...]]],
    middle: Sequence[RenderableType],
    more: Sequence[str],
    schemes: FittedColumns,
) -> RenderableType:
    """All parts within the lines there are; notes go first, then requirements that are met with room."""
    lines = _lines(*head, *middle, schemes) + len(required) + 2
    shown = list(required)
    if lines > LINES and len(required) > TIGHTEST:
        tight = sorted(required, key=lambda row: row[:2])[:TIGHTEST]
        shown = [row for row in required if not row[1] or row in tight]
        lines -= len(required) - len(shown)
    table = facts()
    for _ in range(3):
        table.add_column()
    for _, _, cells in shown:
        table.add_row(*cells)
    told: list[str] = []
    for text in more:
        taken = _lines(Text(f"note: {text}"))
        if lines + taken <= LINES and len(told) < NOTES:
            told.append(text)
            lines += taken
    hidden = len(more) - len(told) + len(required) - len(shown)
    further = f"-v {hidden} more note{'s' * (hidden != 1)}" if hidden else "-v all values"
    remarks = [Text.assemble(("note: ", "bold"), text) for text in told]
    steps = Text(NEXT.replace("-v all values", further), style="dim")
    return Group(*head, *[table] * bool(shown), *middle, Text(), schemes, *remarks, steps)


def _lines(*parts: RenderableType) -> int:
    """Lines that parts take on a screen of `WIDTH` columns."""
    console = Console(width=WIDTH, file=StringIO(), markup=False, emoji=False, highlight=False)
    return sum(len(console.render_lines(part)) for part in parts)
