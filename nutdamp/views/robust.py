"""All values of ``plan``; and of ``plan --robust`` candidates by the share of cases that comply,
the plan to fly and its cost.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from operator import attrgetter
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp.common.results import Note, note
from nutdamp.planning.decision import Comparison
from nutdamp.planning.notes import (
    reasons,
)
from nutdamp.planning.robust import RobustComparison, robust_cost, robust_reasons
from nutdamp.planning.screening import FlownPlan
from nutdamp.spacecraft import requirements
from nutdamp.views import verdict as verdicts
from nutdamp.views.decisions import derived_table, final_json, plan_json, target_json
from nutdamp.views.dispersion import in_words, stated_text
from nutdamp.views.glance import end_facts, glance, headline, notes, scheme_table
from nutdamp.views.parts import Summary, named, pulse_table
from nutdamp.views.simulation import blocks_screen
from nutdamp.views.tables import (
    TEXT,
    Column,
    DataTable,
    Shared,
    facts,
    file_columns,
    to_figures,
    values_of,
)
from nutdamp.views.text import (
    joined,
    note_json,
    screen_line,
    sentence,
    small_angle,
    text,
)
from nutdamp.views.verdict import cases_json, exact_percent, percent, share_text

MOST_ROWS = 12  # largest number of candidates in the table


def comparison_screen(compared: Comparison) -> RenderableType:
    """All tables of ``plan``, the verdict on top and the notes last."""
    judged, chosen = compared.verdict, compared.recommended
    head: list[RenderableType] = [named(compared.spacecraft), headline(compared)]
    tables: list[RenderableType] = []
    if chosen is not None:
        head.append(Text(sentence(verdicts.statement(judged)), verdicts.STYLES[judged.light]))
        head.append(Text(sentence(f"{chosen.scheme}: {joined(reasons(compared))}")))
        for cheaper in judged.cheaper:
            spent = verdicts.spent(cheaper.schedule)
            head.append(Text(f"cheaper: {cheaper.scheme}, {spent}, {text(cheaper.why)}", "dim"))
        tables = [verdicts.bound_table(judged).screen("screen"), end_facts(chosen)]
    tables.append(derived_table(compared.spacecraft))
    tables.append(scheme_table(compared, chosen).transposed("full"))
    if chosen is not None and chosen.pulses.blocks:
        tables.append(Group(*blocks_screen(chosen)))
    elif chosen is not None and len(chosen.pulses):
        totals: dict[str, float] = {}
        for pulse in chosen.pulses:
            totals[pulse.channel] = totals.get(pulse.channel, 0.0) + pulse.loaded[1]
        on_times = ((f"on-time of {name}", f"{total:.4f} s") for name, total in totals.items())
        tables += [pulse_table(chosen._flight).screen("full"), facts(on_times)]
    return Summary(head, lambda: tables, notes(compared, verbose=True), verbose=True)


def robust_screen(robust: RobustComparison, *, verbose: bool = True) -> RenderableType:
    """The screen of ``plan --robust``; ``verbose``: with all tables."""
    if not verbose:
        return glance(robust.joined, robust_notes(robust))
    shown = comparison_screen(robust.joined)
    if robust.chosen is None:
        return shown
    rows = list(robust.candidates[:MOST_ROWS])
    rows += [entry for entry in (robust.chosen, robust.usual) if entry and entry not in rows]
    below = f"Plans below these: {len(robust.candidates) - len(rows)}; * without --robust."
    name = f"{robust.chosen.plan.scheme}, {robust.chosen.variant}"
    reason = joined(robust_reasons(robust))
    return Group(
        shown,
        *(Text(), Text.assemble("Robust plan: ", (name, "bold"), f" – {reason}.")),
        *map(Text, _fresh(robust)),
        *map(screen_line, robust_notes(robust)),
        *(Text(), _table(robust, rows).screen("full"), Text(below, style="dim")),
    )


def robust_notes(robust: RobustComparison) -> list[Note]:
    """Tolerances with which enough cases would comply, where they are known, and the plan against
    the usual one.
    """
    needed = robust.tightening
    if needed is None or robust.chosen is None:
        return list(robust_cost(robust))
    sizes = []
    tolerances = [entry.tolerance for entry, _ in needed.inputs]
    for entry, relative in needed.inputs:
        less = stated_text(entry._replace(size=needed.factor * entry.size), relative, down=True)
        named = in_words(entry.tolerance if tolerances.count(entry.tolerance) == 1 else entry.name)
        sizes.append(f"{named} {{{entry.kind}: {less}}} instead of {stated_text(entry, relative)}")
    tighter = note(
        "tolerances-needed",
        required_share=100.0 * robust.probability,
        tolerances=", ".join(sizes),
        complied=percent(needed.complied, robust.probability),
        cases=f"{needed.cases:,}",
        seed=needed.seed,
        least=f"{math.floor(1e4 * needed.least) / 100.0:.4g} %",
        confidence_share=95.0,
    )
    return [tighter, *robust_cost(robust)]


def robust_json(robust: RobustComparison) -> dict[str, Any]:
    """Part of ``plan --robust --json`` beside the plans: candidates, the best first, the one to
    fly, and its cost.
    """
    chosen, fresh, cost, needed = robust.chosen, robust.fresh, robust.cost, robust.tightening
    plans = [entry for entry in (*robust.candidates, chosen, robust.usual) if entry is not None]
    entries = dict(zip(map(id, plans), _table(robust, plans).json(), strict=True))
    return {
        **values_of(robust, "probability"),
        "target": target_json(robust.comparison.spacecraft),
        "candidates": [entries[id(candidate)] for candidate in robust.candidates],
        "recommended": None
        if chosen is None
        else {**entries[id(chosen)], "plan": plan_json(chosen.plan)},
        "reason": joined(robust_reasons(robust)),
        "notes": [note_json(note) for note in robust_notes(robust)],
        "meets_requirement": robust.verdict.met,
        "fresh": cases_json(fresh),
        "tightening": needed
        and {
            "factor": needed.factor,
            "tolerances": {
                entry.tolerance: {"sigma": entry.sigma, "needed": needed.factor * entry.sigma}
                for entry, _ in needed.inputs[::-1]
            },
            "inputs": [
                {
                    "name": entry.name,
                    entry.kind: entry.size,
                    "needed": needed.factor * entry.size,
                    "unit": entry.unit,
                }
                for entry, _ in needed.inputs
            ],
            "checked": values_of(
                needed, "samples=cases", "seed", "met_fraction=complied", "at_least=least"
            ),
        },
        "against": entries.get(id(robust.usual)),
        "cost": cost
        and values_of(cost, "propellant_kg", "total_impulse_Nms=impulse", "end_s", "nutation_deg"),
    }


def _table(robust: RobustComparison, candidates: list[FlownPlan]) -> DataTable:
    """One row a candidate; ``full``: of the screen, with propellant only where all have it."""
    mark = next((index for index, entry in enumerate(candidates) if entry is robust.chosen), None)
    level = exact_percent(robust.probability)
    fuelled = all(candidate.plan.pulses.propellant is not None for candidate in robust.candidates)
    judged = requirements.judged(robust.comparison.spacecraft)

    def variant(row: FlownPlan) -> str:
        return f"{row.variant} *" if row is robust.usual else row.variant

    columns = [
        Column.named("scheme=plan.scheme", "plan", "", where="full json", kind=TEXT),
        Column.named("variant", "variant", "", where="full json", kind=TEXT, words=variant),
        Column("pulses", "", "", lambda row: len(row.plan.pulses), where="json"),
        Column.named("end_s=plan.pulses.end", Shared.END, "s", "{:.3f}".format, "full json"),
        Column.named(
            "total_impulse_Nms=plan.pulses.total_impulse",
            Shared.IMPULSE,
            "N m s",
            to_figures(4),
            "json" if fuelled else "full json",
        ),
        Column.named(
            "propellant_kg=plan.pulses.propellant",
            Shared.PROPELLANT,
            "g",
            to_figures(4, 1e3),
            "full json" if fuelled else "json",
        ),
        Column.named(
            "nominal_nutation_deg=plan.flown.nutation",
            Shared.NOMINAL,
            "deg",
            small_angle,
            "full json",
        ),
        Column.named("left_deg", level, "deg", small_angle, "full json"),
        *file_columns("json", "samples=cases.samples", "met_fraction=cases.complying"),
        Column(
            "",
            "cases that comply",
            "",
            attrgetter("cases"),
            share_text,
            "full" if judged else "",
        ),
        Column("final", "", "", lambda row: final_json(row.plan._flight), where="json"),
    ]
    return DataTable("Candidates", columns, candidates, robust, mark)


def _fresh(robust: RobustComparison) -> Iterator[str]:
    fresh = robust.fresh
    if fresh is not None and fresh.complying is not None:
        shares = (
            percent(share, robust.probability) for share in (fresh.complying, fresh.low, fresh.high)
        )
        met, low, high = shares
        new = f"{fresh.samples:,} new cases (seed {fresh.seed}), not used for the choice"
        yield f"Of {new}, {met} comply; 95 % interval {low} to {high}."
