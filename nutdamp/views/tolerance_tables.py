"""Tolerances in words, and the tolerance budget: effect of each input alone, and its share of the variance."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from nutdamp.errors import listed
from nutdamp.montecarlo.inputs import DispersedInput, together
from nutdamp.montecarlo.statistics import FirstOrder
from nutdamp.montecarlo.study import EARLY, Results, Study
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.requirements import Part
from nutdamp.views.layout import columns
from nutdamp.views.text import quantity

SHOWN = {
    "rad": ("deg", 180.0 / math.pi),
    "rad/s": ("deg/s", 180.0 / math.pi),
    "m": ("mm", 1e3),
    "s": ("ms", 1e3),
    "Pa": ("bar", 1e-5),
}
"""Units for people of those of inputs, and the factor."""

MOST_ROWS = 12
"""Largest number of inputs that the budget names; the rest is summed up."""

TINY = 1e-300

ROUNDING = 1e-12
"""rad; a smaller variation is rounding."""


class BudgetRow(NamedTuple):
    """A line of the tolerance budget: one input, or those that are left together.

    ``size``: one sigma or the bias as text; ``effects``: those of it alone on the two `budgeted_outputs`, rad, or the
    root mean square of those of correlated inputs together; ``inputs``: rows of the drawn inputs; ``bias``: nothing of
    it varies.
    """

    name: str
    size: str
    effects: tuple[float, float]
    inputs: list[int]
    bias: bool


def budget_rows(study: Study) -> list[BudgetRow]:
    """The inputs that count most, the largest first, and the others together; none where nothing varies."""
    inputs, first = study.model.inputs.drawn, study.first_order
    if not any(entry.sigma for entry in inputs):
        return []
    outputs = [output for output, _ in budgeted_outputs(study)]
    units = together(inputs, study.model.groups)
    effects = np.array([[_effect(first, output, rows) for rows in units] for output in outputs])
    scales = np.array([[max(first.sigma(output), TINY)] for output in outputs])
    order = np.argsort(-(effects / scales).max(axis=0), kind="stable").tolist()
    named = order if len(order) <= MOST_ROWS + 1 else order[:MOST_ROWS]
    groups = [(*_named([inputs[row] for row in units[at]]), [at]) for at in named]
    if named != order:
        others = order[len(named) :]
        groups.append((f"{sum(len(units[at]) for at in others)} others", "", others))
    rows = []
    for name, size, members in groups:
        nutation, aim = np.sqrt((effects[:, members] ** 2).sum(axis=1)).tolist()
        of = [row for at in members for row in units[at]]
        rows.append(BudgetRow(name, size, (nutation, aim), of, not any(inputs[row].sigma for row in of)))
    return rows


def _effect(first: FirstOrder, output: str, rows: list[int]) -> float:
    """Effect of an input alone, or of correlated ones together (root mean square)."""
    if len(rows) == 1:
        return float(first.effects(output)[rows[0]])
    return float(np.linalg.norm(first.independent(output)[:, rows]))


def _named(entries: list[DispersedInput]) -> tuple[str, str]:
    """Name and size of an input, or of correlated ones."""
    name, size = (", ".join(map(text, entries)) for text in (lambda entry: in_words(entry.name), size_text))
    return (f"{name} (correlated)" if len(entries) > 1 else name), size


def tolerance_budget(results: Results) -> list[RenderableType]:
    """Shares of the variance by input, by first order and by the cases, and which tolerance dominates."""
    study, rows = results.study, budget_rows(results.study)
    if not rows:
        return [Text("Nothing varies from case to case, so there is no tolerance budget.")]
    inputs, first = study.model.inputs.drawn, study.first_order
    sampled, budgeted = results.shares, budgeted_outputs(study)
    shares = {output: first.shares(output) for output, _ in budgeted}
    aim = "H shift" if study.model.spacecraft.goal.axis is None else "H error"
    heads = ("nutation\ndeg", "linear\n%", "cases\n%", f"{aim}\ndeg", "linear\n%", "cases\n%")
    table = columns("input\n", "one sigma\nor bias", *heads)
    for row in rows:
        cells = []
        for (output, _), effect in zip(budgeted, row.effects, strict=True):
            seen = math.fsum(sampled.get(inputs[index].name, {}).get(output, 0.0) for index in row.inputs)
            both = ("bias", "") if row.bias else (_share(float(shares[output][row.inputs].sum())), _share(seen))
            cells += [f"{math.degrees(effect):.3g}", *both]
        name, size = (text.replace(", ", ",\n") for text in (row.name, row.size))
        table.add_row(Text(name, style="dim"), size, *cells)
    remainder = [
        1.0 - math.fsum(fractions[output] for fractions in sampled.values()) if first.sigma(output) > ROUNDING else 0.0
        for output, _ in budgeted
    ]
    texts = [part for share in remainder for part in ("", "", _share(max(share, 0.0)))]
    table.add_row(Text("in combination", style="dim"), "", *texts)
    count = min(results.done, EARLY)
    note = (
        f"Effect of each input alone on the nutation and on the {budgeted[1][1]}, and its share of the variance of the "
        f"residual vector (two components), whose length the angle is: linear by derivatives of the flight, cases as "
        f"the first {count:,} cases show it (first-order Sobol index), an estimate: its column need not add to 100 %."
    )
    if study.model.groups:
        note += " Correlated inputs vary together, and their effect is the root mean square of what they do together."
    return [Text("Tolerance budget", style="bold"), table, Text(note, style="dim"), *_dominating(results)]


def _dominating(results: Results) -> list[RenderableType]:
    """The tolerances of the file with the largest shares, by name."""
    first = results.study.first_order
    lines: list[RenderableType] = []
    for output, name in budgeted_outputs(results.study):
        sums: dict[str, float] = {}
        shares = first.shares(output)
        for rows in together(first.inputs, results.study.model.groups):
            entries = [first.inputs[row] for row in rows]
            key = _named(entries)[0] if len(rows) > 1 else in_words(entries[0].tolerance)
            sums[key] = sums.get(key, 0.0) + float(shares[rows].sum())
        ranked = sorted(sums.items(), key=lambda item: -item[1])
        leading = [f"{key} ({100 * share:.1f} %)" for key, share in ranked if share >= 0.1]
        leading = leading or [ranked[0][0]]
        verb = "dominates" if len(leading) == 1 else "dominate"
        if any(sums.values()):
            lines.append(Text.assemble(f"The {name}: ", (listed(leading), "bold"), f" {verb}."))
    return lines


def _share(share: float) -> str:
    return f"{100 * share:.1f}" if share >= 5e-4 else "0"


def in_words(name: str) -> str:
    """A tolerance, or an input, in words: ``thrust_direction`` and ``omega0_1`` are keys of the file."""
    key, blank, whose = name.replace("tank ", "tank_", 1).partition(" ")
    if key.startswith("omega0"):
        return f"initial ω{key.removeprefix('omega0').removeprefix('_')}"
    return ("jitter of the Sun sensor" if key == "sun_sensor.jitter" else key.replace("_", " ")) + blank + whose


def size_text(entry: DispersedInput) -> str:
    """One sigma, or the bias, in the form of the file."""
    if entry.unit == "":
        return of_nominal(entry, entry.sigma or entry.size, ".3g")
    unit, scale = SHOWN.get(entry.unit, (entry.unit, 1.0))
    return quantity(scale * (entry.sigma or entry.size), unit, 3)


def stated_text(entry: DispersedInput, relative: bool, *, down: bool = False) -> str:
    """The size as the file gives it, in % where it is ``relative``; to three digits, ``down``: never rounded up."""
    share = relative and entry.nominal != 0.0
    unit, scale = SHOWN.get(entry.unit, (entry.unit, 1.0))
    value = 100.0 * entry.size / abs(entry.nominal) if share or (unit == "" and entry.nominal) else scale * entry.size
    if down and value > 0.0:
        step = 10.0 ** (math.floor(math.log10(value)) - 2)
        value = step * math.floor(value / step * (1.0 + 1e-12))
    return quantity(value, "%" if share or (unit == "" and entry.nominal) else unit, 3).strip()


def of_nominal(entry: DispersedInput, value: float, form: str) -> str:
    """A deviation of a bare number in % of the nominal one; as it is where that is zero."""
    return f"{100 * value / abs(entry.nominal):{form}} %" if entry.nominal else f"{value:{form}}"


def budgeted_outputs(study: Study) -> tuple[tuple[str, str], tuple[str, str]]:
    """The outputs of the tolerance budget, and their names for people."""
    first, second = Part.NUTATION, requirements.aim(study.model.spacecraft)
    return (first.value, first.label), (second.value, second.label)
