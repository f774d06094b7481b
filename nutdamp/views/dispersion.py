"""Results of ``disperse``: percentiles, requirement, cones, tolerance budget and cases; tolerances in words.

The files of loops and the screens of other commands use the same parts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.files.samples import OUTPUT_COLUMNS
from nutdamp.flight.end_state import aspects
from nutdamp.flight.propagation import IDEAL_IMPULSES, Flight, model_name
from nutdamp.montecarlo.inputs import DispersedInput, Unused, together
from nutdamp.montecarlo.statistics import OUTPUTS, Array, Distribution, FirstOrder, cases_to_show
from nutdamp.montecarlo.study import CONFIDENCE, EARLY, Results, Study
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Keep, Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.views import verdicts
from nutdamp.views.end_tables import bounds_text, end_table, requested
from nutdamp.views.layout import brief, columns, facts
from nutdamp.views.plan_json import final_json, heading, target_json
from nutdamp.views.tables import TEXT, WHOLE, Column, DataTable
from nutdamp.views.text import degrees, digits, quantity

if TYPE_CHECKING:
    from nutdamp.control_loop.dispersion import LoopResults


PERCENTS = (50.0, 90.0, 95.0, 99.0, 99.7)
BRIEFLY = (50.0, 95.0, 99.7)
"""Those of the default screen."""

NAMES = (
    ("nutation", "deg", 1.0),
    ("momentum shift", "deg", 1.0),
    ("axis error", "deg", 1.0),
    ("spin change", "mrad/s", 1e3),
    ("propellant", "g", 1e3),
)
"""Names of `OUTPUTS` for people, their units, and the factors to these from the units of files."""

NOTHING = 1e-9
"""Values, in these units, below which a number is rounding."""

EMPTY = "the pulses take more propellant than there is, so that the last ones do not fire, and it does not comply"
"""Note on a case whose tank runs empty."""

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


def dispersion_brief(results: Results, *, scheme: str) -> RenderableType:
    """The default screen of ``disperse``: verdict, percentiles, what counts most, and the worst case."""
    head = [_title(results, scheme), *requirement_lines(results), *cone_lines(results), *_emptied(results)]
    notes, case = list(_main_causes(results)), ""
    if _varies(results):
        case = f" · {_again(results)} (worst)"
    if unused := results.study.model.inputs.unused:
        notes.append(f"Dispersions without effect: {', '.join(in_words(entry.name) for entry in unused)}.")
    return brief(head, _percentiles(results).screen("screen"), notes, f"--plot cases.png{case}")


def dispersion_screen(results: Results, *, scheme: str, worst: int, nominal: Flight | None = None) -> Group:
    """All tables of ``disperse``; ``nominal``: the nominal case, where its end is to be shown too."""
    body = results.study.model.spacecraft
    parts: list[RenderableType] = [_title(results, scheme), Text(), _percentiles(results).screen("full")]
    parts.append(angles_note(body))
    if not results.exact:
        parts.append(Text("Percentiles are right to 0.05 % of their value; nominal and max are exact.", style="dim"))
    if nominal is not None:
        parts += [Text(), Text("Nominal case", style="bold"), end_table(nominal, aspects(nominal))]
    parts += [Text(), *requirement_lines(results), *cone_lines(results), *_emptied(results)]
    parts += [Text(), *_tolerance_budget(results)]
    if worst and _varies(results):
        cases = _cases(results.study, _worst(results, worst))
        parts += [Text(), Text(cases.title, "bold"), cases.screen("full")]
        parts.append(Text(f"Inspect one: nutdamp disperse, as here, with {_again(results)}", "dim"))
    unused = results.study.model.inputs.unused
    if unused:
        parts += [Text(), Text("Unused dispersions", style="bold"), unused_table(unused)]
    return Group(*parts)


def dispersion_json(results: Results, *, scheme: str, worst: int) -> dict[str, Any]:
    """Percentiles, requirement, tolerance budget and the ``worst`` cases; angles in degrees, else SI.

    ``shares`` are those of the nutation, with those of the other outputs below their names; ``effect_deg`` is that on
    the nutation of one sigma of an input alone (or all of a bias). Of inputs in ``correlation`` each share is the
    increment over those before it, and their sum that of all of them. ``final`` is the end of the nominal case.
    """
    study, body = results.study, results.study.model.spacecraft
    nominal = study.outputs_of({}).tolist()
    return {
        **heading(body),
        "scheme": scheme,
        "samples": results.done,
        "requested": results.requested,
        "interrupted": results.done < results.requested,
        "seed": study.seed,
        "redrawn": results.redrawn,
        "final": final_json(study.nominal),
        "target": target_json(body),
        "exact_percentiles": results.exact,
        "percentiles": {
            column: percentiles_json(column, value, results.distribution(output))
            for column, value, output in zip(OUTPUT_COLUMNS, nominal, OUTPUTS, strict=True)
        },
        "requirement": requirement_of(results),
        **cones_json(results),
        **({"tank_empty_fraction": results.emptied / results.done} if body.tank else {}),
        "shares": list(_shares(results)),
        **correlation_json(body),
        "unused": [entry.name for entry in study.model.inputs.unused],
        "unused_because": {entry.name: entry.reason for entry in study.model.inputs.unused},
        "worst": _worst(results, worst),
    }


def _worst(results: Results, count: int) -> list[dict[str, Any]]:
    study, cases = results.study, results.worst.cases[:count].tolist()
    return [case_json(study, case, study.draws_of(case)) for case in cases]


def _title(results: Results, scheme: str) -> Text:
    study = results.study
    how = "ideal impulses" if model_name([study.model.schedule]) == IDEAL_IMPULSES else "full simulation"
    drawn = f"cases: {results.done:,}, seed {study.seed}"
    if results.redrawn:
        drawn += f", unphysical and drawn again: {results.redrawn:,}"
    return Text.assemble((study.model.spacecraft.name, "bold"), f": {scheme}, {how}; {drawn}")


def _again(results: Results) -> str:
    """Options that show the worst case alone."""
    return f"--seed {results.study.seed} --case {results.worst.cases[0] + 1}"


def _varies(results: Results) -> bool:
    """True where any input varies from case to case."""
    return any(entry.sigma for entry in results.study.model.inputs.drawn)


# --- percentiles


def percentiles_json(
    column: str, nominal: float | None, distribution: Distribution | None, *, lower: bool = False
) -> dict[str, float | None]:
    """The ``nominal`` value of an output and its distribution, in the unit of its ``column``; nulls where unknown.

    ``lower``: the values that so many cases do not fall short of.
    """
    spread: list[float | None] = [None] * (len(PERCENTS) + 2)
    if distribution is not None:
        shares = np.array(PERCENTS) / 100.0
        levels = distribution.quantiles(1.0 - shares if lower else shares).tolist()
        spread = [distribution.minimum, *levels, distribution.maximum]
    names = ("nominal", "min", *(f"{percent:g}" for percent in PERCENTS), "max")
    values = zip(names, (nominal, *spread), strict=True)
    return {name: None if value is None else shown(column, value) for name, value in values}


def _percentiles(results: Results) -> DataTable:
    """One row an output: values by shares of the cases; where any are negative, lower ones in a row of their own."""
    rows = []
    nominal = results.study.outputs_of({}).tolist()
    for output, column, (name, unit, scale), plan in zip(OUTPUTS, OUTPUT_COLUMNS, NAMES, nominal, strict=True):
        distribution = results.distribution(output)
        signs = {"": False}
        if distribution is not None and distribution.minimum < 0.0:
            signs = {" ≤": False, " ≥": True} if distribution.maximum > 0.0 else {" ≥": True}
        for sign, lower in signs.items():
            values = percentiles_json(column, plan, distribution, lower=lower)
            texts = _side_by_side({key: None if value is None else scale * value for key, value in values.items()})
            last = texts["min" if lower else "max"]
            # The nominal value has digits of its own: other places show it alone.
            own = texts["max"] and ("0" if abs(scale * plan) < NOTHING else digits(scale * shown(column, plan), 4))
            rows.append({**texts, "name": f"{name}{sign}, {unit}", "nominal": own, "max": last})
    return DataTable("Percentiles", PERCENTILES, rows)


def _side_by_side(values: Mapping[str, float | None]) -> dict[str, str | None]:
    """Numbers with as many decimals as the largest of the cases has."""
    largest = max(abs(values[key] or 0.0) for key in ("min", "max"))
    return {key: None if value is None else beside(value, largest) for key, value in values.items()}


PERCENTILES = (
    Column("", "", "", itemgetter("name"), where="screen full", kind=TEXT),
    Column("", "nominal", "", itemgetter("nominal"), where="screen full"),
    *(
        Column(
            "", f"{percent:g} %", "", itemgetter(f"{percent:g}"), where="screen full" if percent in BRIEFLY else "full"
        )
        for percent in PERCENTS
    ),
    Column("", "max", "", itemgetter("max"), where="screen full"),
)


def shown(column: str, value: float) -> float:
    """A value in the unit of its ``column``."""
    return math.degrees(value) if column.endswith("_deg") else value


def beside(value: float, largest: float) -> str:
    """A number with the decimals that show four digits of the ``largest`` beside it."""
    if largest < NOTHING:
        return "0"
    if not 1e-5 <= largest < 1e6:
        return f"{value:.2e}"
    text = f"{value:.{max(3 - math.floor(math.log10(largest)), 0)}f}"
    return text if float(text) else text.lstrip("-")


def angles_note(body: Spacecraft) -> Text:
    """Note on the reference of the angles of H in dispersed cases."""
    aim = "H at t = 0 with nominal values" if body.goal.axis is None else "the target"
    note = f"Momentum shift: from H at t = 0 of the same case; axis error: from {aim}."
    return Text(f"{note} The spin axis swings about H by the nutation.", style="dim")


# --- requirement and cones


def requirement_lines(results: Results | LoopResults) -> list[RenderableType]:
    """The requirement, and the verdict on the number of cases that comply."""
    share, probability = results.met_fraction, results.probability
    if share is None:
        return [Text("The file has no requirement to meet.")]
    low, high = results.interval
    required = requested(results.study.model.spacecraft)
    verdict = Text(verdicts.cases_verdict(share, probability), "green" if results.meets_requirement else "red")
    interval = " to ".join(verdicts.percent(bound, probability) for bound in (low, high))
    text = Text.assemble(("Requirement ", "bold"), f"({required}) ", verdict, f"; 95 % interval {interval}.")
    if results.meets_requirement and low < probability:
        few = cases_to_show(probability)
        hint = f" It takes at least {few:,}." if results.done < few else ""
        level = verdicts.exact_percent(probability)
        text.append(f" The interval reaches below {level}: more --samples would show it.{hint}")
    return [text]


def requirement_of(results: Results | LoopResults) -> dict[str, Any] | None:
    """The share of cases that comply beside the one required; None where nothing is."""
    if results.met_fraction is None:
        return None
    low, high = results.interval
    return {
        "met_fraction": results.met_fraction,
        "low": low,
        "high": high,
        "confidence": CONFIDENCE,
        "probability": results.probability,
        "met": results.meets_requirement,
    }


def cone_lines(results: Results | LoopResults) -> Iterator[Text]:
    """Number of cases that break each cone, and range of the angles from the spin axis to its direction."""
    for keep, entry in _cones(results):
        share = verdicts.percent(entry["broken_fraction"], 1.0 - results.probability)
        bounds = ("least_deg", "largest_deg", "nominal_least_deg", "nominal_largest_deg")
        least, most, *alone = (degrees(math.radians(entry[key])) for key in bounds)
        yield Text.assemble(
            (f"Axis {bounds_text(keep)} from {keep.name} ", "bold"),
            (f"broken in {share} of cases", "red" if entry["broken_fraction"] else "green"),
            f"; {least} to {most} in all cases, {alone[0]} to {alone[1]} in the nominal one.",
        )


def cones_json(results: Results | LoopResults) -> dict[str, Any]:
    """Number of cases that break each cone, and least and largest angle from it to the axis; nothing without cones."""
    entries = [entry for _, entry in _cones(results)]
    return {"aspects": entries} if entries else {}


def _cones(results: Results | LoopResults) -> Iterator[tuple[Keep, dict[str, Any]]]:
    """Each cone with its entry in files; none before the first case."""
    body = results.study.model.spacecraft
    nominal = np.degrees(results.study.nominal_aspects).tolist() if results.done and body.keep else ()
    for index, (keep, (least, largest)) in enumerate(zip(body.keep, nominal, strict=False)):
        least_of_all, largest_of_all = np.degrees(results.aspects[index]).tolist()
        yield (
            keep,
            {
                "name": keep.name,
                "min_deg": math.degrees(keep.least),
                "max_deg": math.degrees(keep.most),
                "broken_fraction": float(results.broken[index] / results.done),
                "least_deg": least_of_all,
                "largest_deg": largest_of_all,
                "nominal_least_deg": least,
                "nominal_largest_deg": largest,
            },
        )


def _emptied(results: Results) -> Iterator[Text]:
    """Number of cases in which the tank runs empty, where any does."""
    if results.emptied:
        share = verdicts.percent(results.emptied / results.done, 1.0 - results.probability)
        yield Text.assemble(("Tank ", "bold"), (f"empty too soon in {share} of cases", "red"), f": {EMPTY}.")


# --- cases


def case_json(study: Study, case: int, draws: Mapping[str, float]) -> dict[str, Any]:
    """One case (from 0): the true value of each input, in SI, and the outputs."""
    outputs = study.outputs_of(draws).tolist()
    angles = study.aspects_of(draws)
    return {
        "case": case + 1,
        "inputs": {entry.name: entry.nominal + draws.get(entry.name, 0.0) for entry in study.model.inputs.drawn},
        **{column: shown(column, value) for column, value in zip(OUTPUT_COLUMNS, outputs, strict=True)},
        **({} if angles is None else angles_json(study.model.spacecraft, angles)),
    }


def _cases(study: Study, rows: Sequence[Mapping[str, Any]]) -> DataTable:
    """Cases as `case_json` has them, one row each; number 0 is the nominal one."""
    return DataTable("Worst cases", tuple(_case_columns(study, rows)), rows)


def _case_columns(study: Study, rows: Sequence[Mapping[str, Any]]) -> Iterator[Column]:
    yield Column("", "case", "", itemgetter("case"), where="full", kind=WHOLE)
    yield Column("", "", "", lambda row: "this case" if row["case"] else "nominal", where="case", kind=TEXT)
    for key, (name, unit, scale) in zip(OUTPUT_COLUMNS, NAMES, strict=True):
        largest = max((scale * abs(row[key]) for row in rows), default=0.0)
        yield Column("", name, unit, _known(key, scale), partial(beside, largest=largest), "case")
        if unit == "deg":
            yield Column("", name, unit, itemgetter(key), _four, "full")
    for at, cone in enumerate(study.model.spacecraft.keep):
        for which in ("least", "largest"):
            where = "full case" if which in _bounded(cone) else "case"
            yield Column("", f"{which} from {cone.name}", "deg", _angle(at, which), _four, where)
    yield Column("", "largest contributors, in sigmas", "", _contributors(study), where="full", kind=TEXT)


def _known(key: str, scale: float) -> Callable[[Mapping[str, Any]], float | None]:
    return lambda row: None if math.isnan(row[key]) else scale * row[key]


def _angle(cone: int, which: str) -> Callable[[Mapping[str, Any]], float]:
    return lambda row: float(row["aspects"][cone][f"{which}_deg"])


def _four(value: float) -> str:
    return f"{value:.4g}"


def _contributors(study: Study) -> Callable[[Mapping[str, Any]], str]:
    """The three inputs that count most in a case, by name and size in sigmas."""
    inputs = study.model.inputs.drawn
    outputs = [output for output, _ in budgeted_outputs(study)]

    def text(row: Mapping[str, Any]) -> str:
        effects = np.hypot(*(study.first_order.effects(output) for output in outputs))
        sigmas = [(row["inputs"][entry.name] - entry.nominal) / (entry.sigma or math.inf) for entry in inputs]
        order = np.argsort(-np.abs(effects * sigmas), kind="stable")[:3].tolist()
        return ", ".join(f"{in_words(inputs[at].name)} {sigmas[at]:+.1f}" for at in order if sigmas[at])

    return text


def case_screen(study: Study, case: int, draws: dict[str, float], *, scheme: str) -> RenderableType:
    """One case (from 0): every input, and the ends of it and of the nominal case."""
    outcome = _cases(study, [case_json(study, -1, {}), case_json(study, case, draws)])
    empty = [Text(f"Tank empty too soon: {EMPTY}.", "red")] * bool(study.ends_of(draws).drained > 1.0)
    title = Text.assemble((study.model.spacecraft.name, "bold"), f": {scheme}, seed {study.seed}, case {case + 1}")
    inputs = inputs_table(study.model.inputs.drawn, draws)
    return Group(title, Text(), inputs, Text(), outcome.transposed("case"), *empty)


def inputs_table(drawn: Iterable[DispersedInput], draws: Mapping[str, float]) -> Table:
    """Every input of one case: nominal, drawn, and the deviation."""
    inputs = columns("input", "nominal", "this case", "off by", "in sigmas")
    for entry in drawn:
        (unit, scale), draw = _of_people(entry), draws[entry.name]
        sigmas = f"{draw / entry.sigma:+.2f}" if entry.sigma else "bias"
        off = of_nominal(entry, draw, "+.4g") if entry.unit == "" else f"{scale * draw:+.4g} {unit}"
        estimate, truth = (f"{scale * value:.6g}" for value in (entry.nominal, entry.nominal + draw))
        inputs.add_row(Text(in_words(entry.name), style="dim"), estimate, truth, off, sigmas)
    return inputs


def _of_people(entry: DispersedInput) -> tuple[str, float]:
    """The unit of an input for people, and the factor to it."""
    return SHOWN.get(entry.unit, (entry.unit, 1.0))


def _bounded(keep: Keep) -> list[str]:
    """Bounded ones of the angles to the direction of a cone: the least, the largest."""
    return ["least"] * (keep.least > 0.0) + ["largest"] * (keep.most < math.pi)


def bounded_heads(keep: Sequence[Keep]) -> list[str]:
    """Heads of the columns of the angles that are `bounded`."""
    return [f"{which} from\n{cone.name}, deg" for cone in keep for which in _bounded(cone)]


def bounded(keep: Sequence[Keep], angles: Iterable[Iterable[float]]) -> list[float]:
    """Of the least and largest ``angles`` to the direction of each cone those that it bounds, cone after cone."""
    return [
        angle
        for cone, seen in zip(keep, angles, strict=True)
        for which, angle in zip(("least", "largest"), seen, strict=True)
        if which in _bounded(cone)
    ]


def add_angles(table: Table, keep: Sequence[Keep], flights: Sequence[Array]) -> None:
    """Two rows for each cone: the least and the largest angle from its direction in each of ``flights``, (m, 2) rad."""
    for index, cone in enumerate(keep):
        for row, which in enumerate(("least", "largest")):
            cells = (f"{math.degrees(angles[index, row]):.4g}" for angles in flights)
            table.add_row(Text(f"{which} from {cone.name}, deg", style="dim"), *cells)


def angles_json(spacecraft: Spacecraft, angles: Array) -> dict[str, Any]:
    """Least and largest angle to the direction of each cone, of angles (m, 2) rad."""
    if not spacecraft.keep:
        return {}
    named = zip(spacecraft.keep, np.degrees(angles).tolist(), strict=True)
    return {"aspects": [{"name": keep.name, "least_deg": least, "largest_deg": far} for keep, (least, far) in named]}


def unused_table(unused: Iterable[Unused]) -> Table:
    """Inputs without effect; names that share a reason are listed together."""
    table = facts()
    reasons: dict[str, list[str]] = {}
    for name, reason in unused:
        reasons.setdefault(reason, []).append(in_words(name))
    for reason, names in reasons.items():
        table.add_row(", ".join(names), reason)
    return table


# --- tolerance budget


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


def _tolerance_budget(results: Results) -> list[RenderableType]:
    """Shares of the variance by input, by first order and by the cases, and the tolerances that count most."""
    study, rows = results.study, budget_rows(results.study)
    if not rows:
        return [Text("Nothing varies from case to case, so there is no tolerance budget.")]
    inputs, first, sampled = study.model.inputs.drawn, study.first_order, results.shares
    outputs = dict(budgeted_outputs(study))
    heads = (head for label in outputs.values() for head in (f"{label}\ndeg", "linear\n%", "cases\n%"))
    table = columns("input\n", "one sigma\nor bias", *heads)
    for row in rows:
        cells = []
        for output, effect in zip(outputs, row.effects, strict=True):
            seen = math.fsum(sampled.get(inputs[index].name, {}).get(output, 0.0) for index in row.inputs)
            linear = float(first.shares(output)[row.inputs].sum())
            cells += [f"{math.degrees(effect):.3g}", *(("bias", "") if row.bias else map(_percent, (linear, seen)))]
        name, size = (text.replace(", ", ",\n") for text in (row.name, row.size))
        table.add_row(Text(name, style="dim"), size, *cells)
    rest = (1.0 - math.fsum(fractions[output] for fractions in sampled.values()) for output in outputs)
    shares = (max(share, 0.0) * (first.sigma(output) > ROUNDING) for share, output in zip(rest, outputs, strict=True))
    table.add_row(Text("interactions", "dim"), "", *(cell for share in shares for cell in ("", "", _percent(share))))
    note = (
        "Effect: of the input alone. Shares of the variance of the residual vector: linear by derivatives of the "
        f"flight; cases by the first {min(results.done, EARLY):,} cases (first-order Sobol index), an estimate that "
        "may not total 100 %."
    )
    if study.model.groups:
        note += " Correlated inputs vary together: their effect is the root mean square of the group."
    return [Text("Tolerance budget", "bold"), table, Text(note, "dim"), *map(Text, _main_causes(results))]


def _percent(share: float) -> str:
    return f"{100 * share:.1f}" if share >= 5e-4 else "0"


def _main_causes(results: Results) -> Iterator[str]:
    """The tolerances of the file with the largest shares of each residual."""
    first = results.study.first_order
    for output, name in budgeted_outputs(results.study):
        sums: dict[str, float] = {}
        shares = first.shares(output)
        for rows in together(first.inputs, results.study.model.groups):
            entries = [first.inputs[row] for row in rows]
            key = _named(entries)[0] if len(rows) > 1 else in_words(entries[0].tolerance)
            sums[key] = sums.get(key, 0.0) + float(shares[rows].sum())
        ranked = sorted(sums.items(), key=lambda item: -item[1])
        leading = [f"{key} ({100 * share:.1f} %)" for key, share in ranked if share >= 0.1]
        if any(sums.values()):
            yield f"Main causes of {name}: {', '.join(leading or [ranked[0][0]])}."


def _shares(results: Results) -> Iterator[dict[str, Any]]:
    """Share of each input in each output, by first order and by the cases."""
    first = results.study.first_order
    linear = {name: first.shares(name).tolist() for name in OUTPUTS}
    effects = np.degrees(first.effects("nutation")).tolist()
    for at, entry in enumerate(first.inputs):
        sampled = results.shares.get(entry.name, {})
        both = {name: {"analytic": linear[name][at], "sampled": sampled.get(name, 0.0)} for name in OUTPUTS}
        about = {"tolerance": entry.tolerance, "sigma": entry.sigma, "effect_deg": effects[at]}
        yield {"input": entry.name, **both.pop("nutation"), **about, **both}


def correlation_json(spacecraft: Spacecraft) -> dict[str, Any]:
    """Pairs of inputs that are correlated, as the file gives them; nothing without any."""
    pairs = () if spacecraft.dispersions is None else spacecraft.dispersions.correlation
    return {"correlation": [list(pair) for pair in pairs]} if pairs else {}


def budgeted_outputs(study: Study) -> tuple[tuple[str, str], tuple[str, str]]:
    """The outputs of the tolerance budget, and their names for people."""
    first, second = Part.NUTATION, requirements.aim(study.model.spacecraft)
    return (first.value, first.label), (second.value, second.label)


# --- tolerances in words


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
    unit, scale = _of_people(entry)
    return quantity(scale * (entry.sigma or entry.size), unit, 3)


def stated_text(entry: DispersedInput, relative: bool, *, down: bool = False) -> str:
    """The size as the file gives it, in % where it is ``relative``; to three digits, ``down``: never rounded up."""
    share = entry.nominal != 0.0 and (relative or entry.unit == "")
    unit, scale = ("%", 100.0 / abs(entry.nominal)) if share else _of_people(entry)
    value = scale * entry.size
    if down and value > 0.0:
        step = 10.0 ** (math.floor(math.log10(value)) - 2)
        value = step * math.floor(value / step * (1.0 + 1e-12))
    return quantity(value, unit, 3).strip()


def of_nominal(entry: DispersedInput, value: float, form: str) -> str:
    """A deviation of a bare number in % of the nominal one; as it is where that is zero."""
    return f"{100 * value / abs(entry.nominal):{form}} %" if entry.nominal else f"{value:{form}}"
