"""Tolerances in words, and the tolerance budget: effect of each input alone, and its share of the
variance.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from operator import itemgetter
from typing import Any

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from nutdamp.common.results import Note, note
from nutdamp.montecarlo.inputs import DispersedInput, Unused, together
from nutdamp.montecarlo.study import EARLY, Results, Study
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.units import screen_unit
from nutdamp.views.tables import REAL, TEXT, Column, DataTable, FittedColumns, Shared
from nutdamp.views.text import quantity

SHOWN = {  # units for people of those of inputs, and the factor
    "rad": ("deg", 180.0 / math.pi),
    "rad/s": ("deg/s", 180.0 / math.pi),
    "m": ("mm", 1e3),
    "s": ("ms", 1e3),
    "Pa": ("bar", 1e-5),
}


MAIN = 0.1  # least share of the variance of a main cause
MOST_ROWS = 12  # largest number of inputs that the budget names; the rest is summed up
TINY = 1e-300
ROUNDING = 1e-12  # rad; a smaller variation is rounding


def tolerance_budget(results: Results) -> list[RenderableType]:
    """Shares of the variance by input, by first order and by the cases, and the tolerances that
    count most.
    """
    study = results.study
    inputs, first, sampled = study.model.inputs.drawn, study.first_order, results.shares
    if not any(entry.sigma for entry in inputs):
        return [Text("Nothing varies from case to case, so there is no tolerance budget.")]
    outputs = budgeted_outputs(study)
    units = together(inputs, study.model.groups)  # places of inputs that vary together

    def effect(output: str, places: list[int]) -> float:
        if len(places) == 1:
            return float(first.effects(output)[places[0]])
        return float(np.linalg.norm(first.independent(output)[:, places]))

    # The units that count most, the largest first, and the others in one row.
    effects = np.array([[effect(output, places) for places in units] for output, _ in outputs])
    scales = np.array([[max(first.sigma(output), TINY)] for output, _ in outputs])
    order = np.argsort(-(effects / scales).max(axis=0), kind="stable").tolist()
    count = len(order) if len(order) <= MOST_ROWS + 1 else MOST_ROWS
    groups = [[unit] for unit in order[:count]]
    if order[count:]:
        groups.append(order[count:])
    rows = []
    for members in groups:
        places = [place for unit in members for place in units[unit]]
        entries = [inputs[place] for place in places]
        name = ",\n".join(in_words(entry.name) for entry in entries)
        row = [f"{name} (correlated)" if len(entries) > 1 else name]
        row.append(",\n".join(map(size_text, entries)))
        if len(members) > 1:
            row = [f"{len(entries)} others", ""]
        bias = not any(entry.sigma for entry in entries)
        alone = np.sqrt((effects[:, members] ** 2).sum(axis=1)).tolist()
        for (output, _), angle in zip(outputs, alone, strict=True):
            cases = math.fsum(sampled.get(entry.name, {}).get(output, 0.0) for entry in entries)
            linear = float(first.shares(output)[places].sum())
            row.append(f"{math.degrees(angle):.3g}")
            row += ["bias", ""] if bias else [_percent(linear), _percent(cases)]
        rows.append(row)
    interactions = ["interactions", ""]
    for output, _ in outputs:
        rest = 1.0 - math.fsum(fractions[output] for fractions in sampled.values())
        varies = first.sigma(output) > ROUNDING
        interactions += ["", "", _percent(rest if varies else 0.0)]
    headings = [(Shared.INPUT, ""), ("one sigma\nor bias", "")]
    for _, label in outputs:
        headings += [(label, "deg"), (Shared.LINEAR, "%"), (Shared.CASES, "%")]
    columns = [
        Column("", heading, unit, itemgetter(place), where="screen", kind=REAL if place else TEXT)
        for place, (heading, unit) in enumerate(headings)
    ]
    table = DataTable("Tolerance budget", columns, [*rows, interactions])
    caption = (
        "Effect: of the input alone. Shares of the variance of the residual vector: "
        "linear by derivatives of the "
        f"flight; cases by the first {min(results.done, EARLY):,} cases (first-order Sobol index), "
        "an estimate that "
        "may not total 100 %."
    )
    if study.model.groups:
        caption += (
            " Correlated inputs vary together: their effect is the root mean square of the group."
        )
    return [Text(table.title, "bold"), table.screen("screen"), Text(caption, "dim")]


def _percent(share: float) -> str:
    return f"{100 * share:.1f}" if share >= 5e-4 else "0"


def leading(part: str, shares: Mapping[str, float]) -> Iterator[Note]:
    """The largest ``shares`` of the variance of ``part``,
    by the names of their inputs for people.
    """
    ranked = sorted(shares.items(), key=lambda item: -item[1])
    causes = [f"{key} ({100 * share:.1f} %)" for key, share in ranked if share >= MAIN]
    if any(shares.values()):
        yield note("main-causes", part=part, causes=", ".join(causes or [ranked[0][0]]))


def unused_notes(unused: Iterable[Unused]) -> Iterator[Note]:
    """Dispersions of the file that change nothing, and why; those that share a reason together."""
    reasons: dict[str, list[str]] = {}
    for name, reason in unused:
        reasons.setdefault(reason, []).append(in_words(name))
    for reason, names in reasons.items():
        yield note("dispersions-unused", dispersions=", ".join(names), why=reason)


def budgeted_outputs(study: Study) -> tuple[tuple[str, str], tuple[str, str]]:
    """The outputs of the tolerance budget, and their names for people."""
    first = Part.NUTATION
    second = requirements.aim(study.model.spacecraft)
    return (first.value, first.label), (second.value, second.label)


def inputs_table(drawn: Sequence[DispersedInput], draws: Mapping[str, float]) -> FittedColumns:
    """Every input of one case: nominal, drawn, and the deviation."""

    def scaled(entry: DispersedInput, value: float, form: str = ".6g") -> str:
        return f"{unit_of_people(entry)[1] * value:{form}}"

    def off(entry: DispersedInput) -> str:
        if entry.unit == "":
            return of_nominal(entry, draws[entry.name], "+.4g")
        return f"{scaled(entry, draws[entry.name], '+.4g')} {unit_of_people(entry)[0]}"

    columns = (
        Column("", Shared.INPUT, "", lambda row: in_words(row.name), where="screen", kind=TEXT),
        Column("", Shared.NOMINAL, "", lambda row: scaled(row, row.nominal), where="screen"),
        Column(
            "",
            Shared.THIS_CASE,
            "",
            lambda row: scaled(row, row.nominal + draws[row.name]),
            where="screen",
        ),
        Column("", "off by", "", off, where="screen"),
        Column(
            "",
            "in sigmas",
            "",
            lambda row: f"{draws[row.name] / row.sigma:+.2f}" if row.sigma else "bias",
            where="screen",
        ),
    )
    return DataTable("Inputs", columns, drawn).screen("screen")


def unit_of_people(entry: DispersedInput) -> tuple[str, float]:
    """The unit of an input for people, and the factor to it."""
    return screen_unit(*SHOWN.get(entry.unit, (entry.unit, 1.0)))


def in_words(name: str) -> str:
    """A tolerance, or an input, in words: ``thrust_direction`` and ``omega0_1`` are keys of the
    file.
    """
    key, blank, whose = name.replace("tank ", "tank_", 1).partition(" ")
    if key.startswith("omega0"):
        return f"initial ω{key.removeprefix('omega0').removeprefix('_')}"
    return (
        ("jitter of the Sun sensor" if key == "sun_sensor.jitter" else key.replace("_", " "))
        + blank
        + whose
    )


def size_text(entry: DispersedInput) -> str:
    """One sigma, or the bias, in the form of the file."""
    if entry.unit == "":
        return of_nominal(entry, entry.sigma or entry.size, ".3g")
    unit, scale = unit_of_people(entry)
    return quantity(scale * (entry.sigma or entry.size), unit, 3)


def stated_text(entry: DispersedInput, relative: bool, *, down: bool = False) -> str:
    """The size as the file gives it, in % where it is ``relative``; to three digits, ``down``:
    never rounded up.
    """
    share = entry.nominal != 0.0 and (relative or entry.unit == "")
    unit, scale = ("%", 100.0 / abs(entry.nominal)) if share else unit_of_people(entry)
    value = scale * entry.size
    if down and value > 0.0:
        step = 10.0 ** (math.floor(math.log10(value)) - 2)
        value = step * math.floor(value / step * (1.0 + 1e-12))
    return quantity(value, unit, 3).strip()


def of_nominal(entry: DispersedInput, value: float, form: str) -> str:
    """A deviation of a bare number in % of the nominal one; as it is where that is zero."""
    return f"{100 * value / abs(entry.nominal):{form}} %" if entry.nominal else f"{value:{form}}"


def correlation_json(spacecraft: Spacecraft) -> dict[str, Any]:
    """Pairs of inputs that are correlated, as the file gives them; nothing without any."""
    pairs = () if spacecraft.dispersions is None else spacecraft.dispersions.correlation
    return {"correlation": [list(pair) for pair in pairs]} if pairs else {}
