"""Fronts of ``trade``: schedules by their ends on screens and in files, and notes beside a
recommendation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp.common.results import Note, note
from nutdamp.flight.propagation import Residual
from nutdamp.planning import notes
from nutdamp.planning.decision import SAME_ANGLE
from nutdamp.planning.plan import Plan
from nutdamp.planning.tradeoff import Front, Point, Trade, numbered
from nutdamp.planning.verdict import Light, Verdict
from nutdamp.schemes.catalogue import OPTIMAL
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import DAMPED_ANGLE, SAME_COST, Part
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.views.decisions import derived_table, heading, plan_json
from nutdamp.views.parts import Summary, named, pulse_table, requested
from nutdamp.views.tables import (
    TEXT,
    WHOLE,
    YES_NO,
    Column,
    DataTable,
    Shared,
    file_columns,
    values_of,
)
from nutdamp.views.text import cost, degrees, fixed, sentences, small_angle
from nutdamp.views.verdict import coloured, lead, share_text, verdict_json

# factor of distance by which H ends farther off for a plan to be worse in it
FARTHER = 1.1
ROWS = 18  # points on the default screen, at most: evenly some of more
# share of its time by which a plan that costs as much has to end sooner to be worth a remark
SOONER = 0.05
FAILS = "is not to be flown"  # by its verdict


class TradeRow(NamedTuple):
    """Point ``number`` of all, on its ``front``."""

    number: int
    front: Front
    point: Point

    @property
    def pulses(self) -> Schedule:
        """Its schedule."""
        return self.point.plan.pulses

    @property
    def residual(self) -> Residual:
        """Residual of its flight."""
        return self.point.plan._flight.residual

    @property
    def bound(self) -> float | None:
        """Lower bound of the cost for small angles."""
        return self.front.least(self.point)

    def spent(self, value: float | None) -> str:
        """A cost with its unit."""
        return cost(value, self.point.unit)


def rows_of(fronts: Sequence[Front]) -> list[TradeRow]:
    """The points of all fronts."""
    return [TradeRow(*entry) for entry in numbered(fronts)]


def _table(rows: Sequence[TradeRow]) -> DataTable:
    """One row a point; ``full`` is the table of one front, ``brief`` that of all."""
    first = rows[0].number if rows else 1
    others = any(row.point.plan.scheme != OPTIMAL.name for row in rows)
    judged = any(row.point.verdict.met is not None for row in rows)
    flown = any(row.point.verdict.cases is not None for row in rows)
    bounded = any(row.bound is not None for row in rows)
    shown = "full brief"
    everywhere = "csv full brief"

    def within(shift: float) -> str:
        return "any" if math.isinf(shift) else degrees(math.radians(shift)).removesuffix(" deg")

    def count(row: TradeRow) -> int:
        return len(row.pulses)

    def met(row: TradeRow) -> bool | None:
        return row.point.verdict.met

    def saved(row: TradeRow) -> str:
        first = next(other for other in rows if other.front is row.front)
        return fixed(100.0 * (row.point.cost / first.point.cost - 1.0), 1)

    columns = [
        Column.named("point=number", "point", "", where=f"{everywhere} json-head", kind=WHOLE),
        *file_columns("json-head", "horizon_s=point.horizon"),
        Column.named(
            "shift_allowed_deg=front.shift", "H within", "deg", within, "csv brief", rank=2
        ),
        Column.named("end_s=pulses.end", Shared.END, "s", "{:.3f}".format, everywhere),
        Column("", "cost", "", lambda row: row.spent(row.point.cost), where=shown),
        Column(
            "",
            "small-angle bound",
            "",
            lambda row: row.spent(row.bound),
            where="full" if bounded else "",
            rank=5,
        ),
        Column("pulses", Shared.PULSES, "", count, where=everywhere, kind=WHOLE, rank=4),
        *file_columns(
            "csv",
            "propellant_kg=pulses.propellant",
            "total_impulse_Nms=pulses.total_impulse",
            "first_order_least=bound",
        ),
        Column.named("least_unit=point.unit", "", "", where="csv", kind=TEXT),
        *file_columns("csv", "nutation_deg=residual.nutation"),
        Column.named(
            "momentum_shift_deg=residual.momentum_shift",
            Part.SHIFT.label,
            "deg",
            small_angle,
            everywhere,
            rank=1,
        ),
        *file_columns("csv", "axis_error_deg=residual.axis_error"),
        Column("", f"vs point {first}", "%", saved, where="full"),
        Column("", "vs first", "%", saved, where="" if others else "brief", rank=3),
        Column.named(
            "scheme=point.plan.scheme",
            Shared.SCHEME,
            "",
            where=everywhere if others else "csv",
            kind=TEXT,
        ),
        Column.named("status=point.verdict.status.value", "", "", where="csv json", kind=TEXT),
        *file_columns("csv json", "share=point.verdict.cases.complying"),
        Column("meets_requirement", "", "", met, where="csv json", kind=YES_NO),
        Column(
            "", "comply", "", attrgetter("point.verdict.cases"), share_text, shown if flown else ""
        ),
        Column(
            "",
            Shared.VERDICT,
            "",
            attrgetter("point.verdict"),
            lead,
            shown if judged else "",
            kind=TEXT,
            met=met,
        ),
    ]
    return DataTable("Schedules by their ends", columns, rows)


def trade_screen(traded: Trade, *, verbose: bool) -> RenderableType:
    """The screen of ``trade``: the cheapest and the earliest schedule, the points of all fronts."""
    spacecraft, fronts = traded.spacecraft, traded.fronts
    points = rows_of(fronts)
    head = [named(spacecraft, f": finish time against cost; schedules: {len(points)}")]
    good = [row for row in points if not fails(row.point)]
    for name, order in (("Cheapest", itemgetter(0, 1)), ("Earliest", itemgetter(1, 0))):
        row = min(
            good or points,
            key=lambda row: order((row.point.cost, row.pulses.end)),
            default=None,
        )
        if row is not None:
            end = f"ends at {row.pulses.end:.3f} s (point {row.number})"
            head.append(Text.assemble((f"{name}: ", "bold"), f"{row.spent(row.point.cost)}, {end}"))
    required = requested(spacecraft)
    if not points:
        head.append(Text("NO SCHEDULE", "bold red"))
    elif required:
        light = next((row.point.verdict.light for row in good), Light.RED)
        words = coloured(f"{len(good)} of {len(points)} schedules may be flown", light)
        head.append(Text.assemble(("Requirement ", "bold"), f"({required}) ", words))
    if verbose:
        more = [derived_table(spacecraft), *front_parts(spacecraft, fronts)]
        return Summary(head, lambda: more, verbose=True)
    notes = missing(spacecraft, fronts)
    if points and spacecraft.commands is not None:
        notes.append(note("trade-not-commandable"))
    # Of points with the same printed values, but for the number, the first; evenly some of more.
    printed = [cells[1:] for cells in _table(points).cells("brief")]
    rows = [row for at, row in enumerate(points) if printed[at] not in printed[:at]]
    evenly = np.linspace(0, len(rows) - 1, min(ROWS, len(rows)))
    rows = [rows[round(at)] for at in evenly.tolist()]
    if len(rows) < len(points):
        notes.append(note("trade-points", shown=len(rows), count=len(points)))
    return Summary(
        head,
        lambda **_: [_table(rows).screen("brief")] if points else [],
        [*notes, *_ends_off(fronts)],
        "--csv points.csv · --plot trade.png · --schedules FOLDER",
    )


def front_parts(spacecraft: Spacecraft, fronts: Sequence[Front]) -> list[RenderableType]:
    """The table of each front under its name, and notes on all."""
    parts: list[RenderableType] = []
    for name, reason, table in front_tables(spacecraft, fronts):
        lines: list[RenderableType] = [Text(name, style="bold"), *map(Text, reason)]
        if table.rows:
            lines.append(table.screen("full"))
        parts.append(Group(*lines))
    return [*parts, *(Text(sentence, style="dim") for sentence in front_notes(fronts))]


def front_tables(
    spacecraft: Spacecraft, fronts: Sequence[Front]
) -> Iterator[tuple[str, list[str], DataTable]]:
    """Name of each front, the reason that optimal gives no schedule, if it gives none, and its
    table.
    """
    for front in fronts:
        reason = [] if front.why is None else [_without_optimal(front)]
        rows = [row for row in rows_of(fronts) if row.front is front]
        yield front_name(front, pointing=spacecraft.goal.axis is not None), reason, _table(rows)


def front_notes(fronts: Sequence[Front]) -> tuple[str, ...]:
    """Sentences on the tables of all fronts."""
    priced = [(row.spent(row.point.cost), row.spent(row.bound)) for row in rows_of(fronts)
              if row.bound is not None and row.point.cost < row.bound]  # fmt: skip
    # As the table writes both.
    differ = any(spent != bound for spent, bound in priced)
    below = [note("trade-below-bound")] if differ else []
    return sentences((*below, *_ends_off(fronts)))


def _ends_off(fronts: Sequence[Front]) -> Iterator[Note]:
    off = [row.residual.axis_error for row in rows_of(fronts) if row.front.shift == 0.0]
    if max(off, default=0.0) > DAMPED_ANGLE:
        yield note("trade-ends-off")


def fails(point: Point) -> bool:
    """True where the schedule is not to be flown, by its verdict."""
    return bool(point.verdict.status.exit_status)


def _without_optimal(front: Front) -> str:
    return f"no schedule of optimal: {front.why}" if front.points else f"none: {front.why}"


def missing(spacecraft: Spacecraft, traded: Sequence[Front]) -> list[Note]:
    """Fronts and points that a picture lacks, with the reasons."""
    pointing = spacecraft.goal.axis is not None
    fronts: dict[str, list[str]] = {}
    for entry in traded:
        if entry.why is not None:
            fronts.setdefault(_without_optimal(entry), []).append(
                front_name(entry, pointing=pointing)
            )
    return [
        note("trade-missing", fronts=", ".join(names), why=reason)
        for reason, names in fronts.items()
    ]


def schemes_of(fronts: Sequence[Front]) -> list[str]:
    """Schemes of all points, by name; optimal where there are none."""
    return sorted({point.plan.scheme for _, _, point in numbered(fronts)}) or [OPTIMAL.name]


def front_name(front: Front, *, pointing: bool) -> str:
    """The requirement on H, in words."""
    if math.isinf(front.shift):
        return "H may end anywhere"
    if front.shift == 0.0:
        return "H ends on its target" if pointing else "H ends where it was"
    return f"H ends within {degrees(front.shift)} of " + (
        "its target" if pointing else "where it was"
    )


# --- files


def trade_csv(traded: Trade) -> str:
    """One row a point; a shift allowed of any size is empty."""
    return _table(rows_of(traded.fronts)).csv()


def trade_json(traded: Trade) -> dict[str, Any]:
    """All fronts with their plans, in the form of ``plan --json``."""
    entries = []
    for front in traded.fronts:
        table = _table([row for row in rows_of(traded.fronts) if row.front is front])
        points = [
            {
                **head,
                **plan_json(row.point.plan),
                **judged,
                "decision": verdict_json(row.point.verdict),
            }
            for row, head, judged in zip(
                table.rows, table.json("json-head"), table.json(), strict=True
            )
        ]
        entries.append({**values_of(front, "shift_allowed_deg=shift", "why"), "points": points})
    return {**heading(traded.spacecraft), "fronts": entries}


def schedule_files(fronts: Sequence[Front], folder: str) -> list[tuple[str, str]]:
    """The pulses of every point: (path in ``folder``, contents)."""
    files = [pulse_table(row.point.plan._flight).csv() for row in rows_of(fronts)]
    return list(zip(schedule_paths(folder, len(files)), files, strict=True))


def schedule_paths(folder: str, count: int) -> list[str]:
    """Paths of the files of pulses of ``count`` points."""
    return [str(Path(folder) / f"point-{index}.csv") for index in range(1, count + 1)]


# --- beside a recommended plan


def trade_notes(
    fronts: Sequence[Front], chosen: Plan, judged: Verdict, craft: str = "SPACECRAFT"
) -> Iterator[Note]:
    """The schedule of a front that is better than the ``chosen`` plan, with its command for the
    words ``craft`` of a spacecraft; or that costs more.
    """
    misses = judged.met is False
    error = chosen._flight.residual.axis_error
    better = []
    for row in rows_of(fronts):
        saved = 1.0 - row.point.cost / chosen.pulses.cost_in(row.point.unit)
        earlier = chosen.pulses.end - row.pulses.end
        cheaper = saved > SAME_COST and earlier >= 0.0
        near = row.residual.axis_error <= FARTHER * error + SAME_ANGLE
        sooner = abs(saved) <= SAME_COST and earlier > SOONER * chosen.pulses.end and near
        able = row.point.verdict.met and not fails(row.point)
        if able and (misses or cheaper or sooner):
            better.append((saved if misses or cheaper else 0.0, earlier, row))
    if better:
        _, _, row = max(better, key=itemgetter(0, 1))
        shift = row.front.shift
        aim = "--free-axis " if math.isinf(shift) else ""
        if 0.0 < shift < math.inf:
            aim = f'--shift "{degrees(shift)}" '
        horizon = f'--set "limits.horizon={row.point.horizon:.6g} s"'
        plan = " ".join(filter(None, ("nutdamp plan", craft)))
        command = f"{plan} --scheme {row.point.plan.scheme} {aim}{horizon}"
        shown = notes.figures(row.point.plan, chosen, row.point.unit == "kg")
        yield note(
            "trade-meets" if misses else "trade-better",
            point=row.number,
            command=command,
            **shown,
        )
    rows = [
        row
        for row in rows_of(fronts)
        if row.pulses.end <= chosen.pulses.end and not fails(row.point)
    ]
    nearest = min(rows, key=lambda row: row.point.cost, default=None)
    if nearest is None:
        return
    spent = chosen.pulses.cost_in(nearest.point.unit)
    cheapest = nearest.point.cost
    if spent < cheapest * (1.0 - SAME_COST):
        if chosen.scheme not in schemes_of(fronts):
            saved = 100.0 * (1.0 - spent / cheapest)
            yield note(
                "trade-dearer", scheme=chosen.scheme, saved_percent=saved, point=nearest.number
            )
    elif spent < cheapest and nearest.spent(spent) != nearest.spent(cheapest):
        yield note("trade-alike", point=nearest.number)
