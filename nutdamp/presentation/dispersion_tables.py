"""The screens of ``disperse``: percentiles, requirement, tolerance budget, worst cases; and one single case."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp import compliance
from nutdamp.aspect import aspects
from nutdamp.compliance import Part
from nutdamp.demands import Keep
from nutdamp.dispersion import study_of
from nutdamp.dispersion.binomial import cases_to_show
from nutdamp.dispersion.correlation import together
from nutdamp.dispersion.inputs import Input, Unused
from nutdamp.dispersion.outputs import OUTPUTS
from nutdamp.dispersion.sensitivity import FirstOrder
from nutdamp.dispersion.statistics import Array
from nutdamp.dispersion.study import EARLY, Results, Study
from nutdamp.flight import Flight
from nutdamp.presentation import verdicts
from nutdamp.presentation.end_tables import bounds_text, end_table
from nutdamp.presentation.layout import columns, facts
from nutdamp.presentation.text import MISSING, degrees, quantity
from nutdamp.words import listed

if TYPE_CHECKING:
    from nutdamp.loop.study import LoopResults

PERCENTS = (50.0, 90.0, 95.0, 99.0, 99.7)
NAMES = ("nutation, deg", "shift of H, deg", "axis error, deg", "spin change, mrad/s", "propellant, g")
SCALES = (180.0 / math.pi, 180.0 / math.pi, 180.0 / math.pi, 1e3, 1e3)
SHOWN = {
    "rad": ("deg", 180.0 / math.pi),
    "rad/s": ("deg/s", 180.0 / math.pi),
    "m": ("mm", 1e3),
    "s": ("ms", 1e3),
    "Pa": ("bar", 1e-5),
}
"""Units that people read for those of inputs, and the factor."""

MOST_ROWS = 12
"""Inputs that the budget names; the rest is summed up."""

EMPTY = "the pulses take more propellant than there is, so that the last ones do not fire, and it does not comply"
"""Of a case whose tank runs empty."""

TINY = 1e-300

ROUNDING = 1e-12
"""rad; what varies by less does not vary."""


def dispersion_screen(results: Results, *, scheme: str, worst: int, nominal: Flight | None = None) -> Group:
    """Everything that ``disperse`` shows; ``nominal``: the nominal case, where its end is to be shown too."""
    parts: list[RenderableType] = [_title(results, scheme), Text(), _percentiles(results)]
    if not results.exact:
        parts.append(Text("Percentiles are right to 0.05 % of their value; nominal and max are exact.", style="dim"))
    if nominal is not None:
        parts += [Text(), Text("Nominal case", style="bold"), end_table(nominal, aspects(nominal))]
    parts += [Text(), *requirement_lines(results), *cone_lines(results), *_emptied(results), Text(), *_budget(results)]
    if worst and any(entry.sigma for entry in results.study.model.inputs.drawn):
        parts += [Text(), *_worst(results, worst)]
    unused = results.study.model.inputs.unused
    if unused:
        parts += [Text(), Text("Unused dispersions", style="bold"), unused_table(unused)]
    return Group(*parts)


def _title(results: Results, scheme: str) -> Text:
    study = results.study
    how = "real widths and true tensor" if study.flown else "the impulse sum (17)"
    drawn = f"{results.done:,} case{'s' * (results.done > 1)}, seed {study.seed}"
    if results.redrawn:
        drawn += f", {results.redrawn:,} unphysical ones drawn again"
    return Text.assemble((study.model.spacecraft.name, "bold"), f": {scheme}, flown by {how}, {drawn}")


def _percentiles(results: Results) -> Table:
    table = columns("", "nominal", *(f"{percent:g} %" for percent in PERCENTS), "max")
    nominal = results.study.outputs_of({})
    for output, name, scale, plan in zip(OUTPUTS, NAMES, SCALES, nominal, strict=True):
        found = results.distribution(output)
        if found is None:
            table.add_row(Text(name, style="dim"), *[MISSING] * (len(PERCENTS) + 2))
            continue
        values = [float(plan), *found.quantiles(np.array(PERCENTS) / 100.0), found.maximum]
        largest = scale * max(abs(found.minimum), abs(found.maximum))
        table.add_row(Text(name, style="dim"), *(beside(scale * value, largest) for value in values))
    for column in table.columns[1:]:
        column.no_wrap = True
    return table


def beside(value: float, largest: float) -> str:
    """A number with the decimals that show four digits of the ``largest`` beside it."""
    if largest < 1e-9:
        return "0"  # but for rounding
    if not 1e-5 <= largest < 1e6:
        return f"{value:.2e}"
    shown = f"{value:.{max(3 - math.floor(math.log10(largest)), 0)}f}"
    return shown if float(shown) else shown.lstrip("-")


def requirement_lines(results: Results | LoopResults) -> list[RenderableType]:
    """What is required, and whether as many cases comply as must."""
    share, probability = results.met_fraction, results.probability
    if share is None:
        return [Text("The file has no requirement to meet.")]
    low, high = results.interval
    body = results.study.model.spacecraft
    cones = [f"axis {bounds_text(keep)} from {keep.name}" for keep in body.keep]
    requested = listed([*filter(None, [verdicts.required(body)]), *cones])
    verdict = Text(verdicts.cases_verdict(share, probability), "green" if results.meets_requirement else "red")
    interval = " to ".join(verdicts.percent(bound, probability) for bound in (low, high))
    text = Text.assemble(("Requirement ", "bold"), f"({requested}) ", verdict, f"; 95 % interval {interval}.")
    if results.meets_requirement and low < probability:
        few = cases_to_show(probability)
        hint = f" It takes at least {few:,}." if results.done < few else ""
        level = verdicts.exact_percent(probability)
        text.append(f" The interval reaches below {level}: more --samples would show it.{hint}")
    return [text]


def cone_lines(results: Results | LoopResults) -> Iterator[RenderableType]:
    """How many cases break each cone, and how near the spin axis comes to its direction and how far from it."""
    study = results.study
    nominal = study.nominal_aspects.tolist() if results.done and study.model.spacecraft.keep else ()
    for index, (keep, one) in enumerate(zip(study.model.spacecraft.keep, nominal, strict=False)):
        broken = int(results.broken[index])
        share = verdicts.percent(broken / results.done, 1.0 - results.probability)
        seen, alone = (" to ".join(map(degrees, angles)) for angles in (results.aspects[index].tolist(), one))
        yield Text.assemble(
            (f"Axis {bounds_text(keep)} from {keep.name} ", "bold"),
            (f"broken in {share} of cases", "red" if broken else "green"),
            f"; {seen} in all cases, {alone} in the nominal one.",
        )


def _emptied(results: Results) -> Iterator[RenderableType]:
    """In how many cases the tank runs empty, where any does."""
    if results.emptied:
        share = verdicts.percent(results.emptied / results.done, 1.0 - results.probability)
        yield Text.assemble(("Tank ", "bold"), (f"empty too soon in {share} of cases", "red"), f": {EMPTY}.")


class BudgetRow(NamedTuple):
    """A line of the tolerance budget: one input, or those that are left together.

    ``size``: one sigma or the bias as text; ``effects``: what it alone does to the two `_budgeted` outputs, rad, or the
    root mean square of what correlated inputs do together; ``inputs``: rows of the drawn inputs; ``bias``: nothing of
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
    outputs = [output for output, _ in _budgeted(study)]
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
    """What an input does alone, or what correlated ones do together (root mean square)."""
    if len(rows) == 1:
        return float(first.effects(output)[rows[0]])
    return float(np.linalg.norm(first.independent(output)[:, rows]))


def _named(entries: list[Input]) -> tuple[str, str]:
    """Name and size of an input, or of correlated ones."""
    name, size = (", ".join(map(text, entries)) for text in (lambda one: in_words(one.name), size_text))
    return (f"{name} (correlated)" if len(entries) > 1 else name), size


def _budget(results: Results) -> list[RenderableType]:
    """Shares of the variance by input, by first order and by the cases, and which tolerance dominates."""
    study, rows = results.study, budget_rows(results.study)
    if not rows:
        return [Text("Nothing varies from case to case, so there is no tolerance budget.")]
    inputs, first, sampled, budgeted = study.model.inputs.drawn, study.first_order, results.shares, _budgeted(study)
    shares = {output: first.shares(output) for output, _ in budgeted}
    aim = "H shift" if study.model.spacecraft.goal.axis is None else "axis err"
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
        1.0 - math.fsum(found[output] for found in sampled.values()) if first.sigma(output) > ROUNDING else 0.0
        for output, _ in budgeted
    ]
    texts = [part for share in remainder for part in ("", "", _share(max(share, 0.0)))]
    table.add_row(Text("together", style="dim"), "", *texts)
    count = min(results.done, EARLY)
    how = "central differences" if study.model.schedule.blocks else "analytic derivatives"
    note = (
        f"Effect of each input alone on the nutation and on the {_budgeted(study)[1][1]}, and its share of their "
        f"variance: linear by {how}, cases as the first {count:,} cases show it (first-order Sobol "
        "index)."
    )
    if study.model.groups:
        note += " Correlated inputs vary together, and their effect is the root mean square of what they do together."
    return [Text("Tolerance budget", style="bold"), table, Text(note, style="dim"), *_dominating(results)]


def _dominating(results: Results) -> list[RenderableType]:
    """The tolerances of the file with the largest shares, by name."""
    first = results.study.first_order
    lines: list[RenderableType] = []
    for output, name in _budgeted(results.study):
        sums: dict[str, float] = {}
        shares = first.shares(output)
        for rows in together(first.inputs, results.study.model.groups):
            entries = [first.inputs[row] for row in rows]
            key = _named(entries)[0] if len(rows) > 1 else in_words(entries[0].tolerance)
            sums[key] = sums.get(key, 0.0) + float(shares[rows].sum())
        ranked = sorted(sums.items(), key=lambda one: -one[1])
        leading = [f"{key} ({_percent(share)})" for key, share in ranked if share >= 0.1]
        leading = leading or [ranked[0][0]]
        verb = "dominates" if len(leading) == 1 else "dominate"
        named = leading[0] if len(leading) == 1 else f"{', '.join(leading[:-1])} and {leading[-1]}"
        if any(sums.values()):
            lines.append(Text.assemble(f"The {name}: ", (named, "bold"), f" {verb}."))
    return lines


def _share(share: float) -> str:
    return f"{100 * share:.1f}" if share >= 5e-4 else "0"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if share >= 5e-4 else "0"


def in_words(name: str) -> str:
    """A tolerance, or an input, in words: ``thrust_direction`` and ``omega0_1`` are keys of the file."""
    key, blank, whose = name.replace("tank ", "tank_", 1).partition(" ")
    if key.startswith("omega0"):
        return f"initial ω{key.removeprefix('omega0').removeprefix('_')}"
    return ("jitter of the Sun sensor" if key == "sun_sensor.jitter" else key.replace("_", " ")) + blank + whose


def size_text(entry: Input) -> str:
    """One sigma, or the bias, as the file might have it."""
    if entry.unit == "":
        return _of_nominal(entry, entry.sigma or entry.size, ".3g")
    unit, scale = SHOWN.get(entry.unit, (entry.unit, 1.0))
    return quantity(scale * (entry.sigma or entry.size), unit, 3)


def stated_text(entry: Input, relative: bool, *, down: bool = False) -> str:
    """The size as the file gives it, in % where it is ``relative``; to three digits, ``down``: never rounded up."""
    share = relative and entry.nominal != 0.0
    unit, scale = SHOWN.get(entry.unit, (entry.unit, 1.0))
    value = 100.0 * entry.size / abs(entry.nominal) if share or (unit == "" and entry.nominal) else scale * entry.size
    if down and value > 0.0:
        step = 10.0 ** (math.floor(math.log10(value)) - 2)
        value = step * math.floor(value / step * (1.0 + 1e-12))
    return quantity(value, "%" if share or (unit == "" and entry.nominal) else unit, 3).strip()


def _of_nominal(entry: Input, value: float, form: str) -> str:
    """A deviation of a bare number in % of the nominal one; as it is where that is zero."""
    return f"{100 * value / abs(entry.nominal):{form}} %" if entry.nominal else f"{value:{form}}"


def _worst(results: Results, count: int) -> list[RenderableType]:
    """The worst cases, each with the inputs that count most in it."""
    study = results.study
    table = columns(
        "case",
        "nutation\ndeg",
        "shift of H\ndeg",
        "axis error\ndeg",
        *bounded_heads(study.model.spacecraft.keep),
        "what counts most, in sigmas",
        text=("what counts most, in sigmas",),
    )
    effects = np.hypot(study.first_order.effects("nutation"), study.first_order.effects(_budgeted(study)[1][0]))
    cases = results.worst.cases[:count].tolist()
    for case in cases:
        draws = study.draws_of(case)
        outputs = np.degrees(study.outputs_of(draws)[:3])
        sigmas = [draws[entry.name] / entry.sigma if entry.sigma else 0.0 for entry in study.model.inputs.drawn]
        order = np.argsort(-np.abs(effects * sigmas), kind="stable")[:3]
        names = [in_words(entry.name) for entry in study.model.inputs.drawn]
        drawn = ", ".join(f"{names[row]} {sigmas[row]:+.1f}" for row in order if sigmas[row])
        found = study.aspects_of(draws)
        seen = () if found is None else bounded(study.model.spacecraft.keep, np.degrees(found).tolist())
        angles = [f"{angle:.4g}" for angle in seen]
        table.add_row(str(case + 1), *(f"{value:.4g}" for value in outputs), *angles, drawn)
    again = f"Each can be looked at alone, with all its inputs: --seed {study.seed} --case {cases[0] + 1}"
    return [Text("Worst cases", style="bold"), table, Text(again, style="dim")]


def _bounded(keep: Keep) -> list[str]:
    """Which of the angles to the direction of a cone are bounded: the least, the largest."""
    return ["least"] * (keep.least > 0.0) + ["largest"] * (keep.most < math.pi)


def bounded_heads(keep: Sequence[Keep]) -> list[str]:
    """Heads of the columns of the angles that are `bounded`."""
    return [f"{which} from\n{one.name}, deg" for one in keep for which in _bounded(one)]


def bounded(keep: Sequence[Keep], angles: Iterable[Iterable[float]]) -> list[float]:
    """Of the least and largest ``angles`` to the direction of each cone those that it bounds, cone after cone."""
    return [
        angle
        for one, seen in zip(keep, angles, strict=True)
        for which, angle in zip(("least", "largest"), seen, strict=True)
        if which in _bounded(one)
    ]


def unused_table(unused: Iterable[Unused]) -> Table:
    """Names that share a reason are listed together."""
    table = facts()
    reasons: dict[str, list[str]] = {}
    for name, reason in unused:
        reasons.setdefault(reason, []).append(in_words(name))
    for reason, names in reasons.items():
        table.add_row(", ".join(names), reason)
    return table


def inputs_table(drawn: Iterable[Input], draws: Mapping[str, float]) -> Table:
    """Every input of one case: nominal, drawn, and by how much it is off."""
    inputs = columns("input", "nominal", "this case", "off by", "in sigmas")
    for entry in drawn:
        unit, scale = SHOWN.get(entry.unit, (entry.unit, 1.0))
        draw = draws[entry.name]
        sigmas = f"{draw / entry.sigma:+.2f}" if entry.sigma else "bias"
        off = _of_nominal(entry, draw, "+.4g") if entry.unit == "" else f"{scale * draw:+.4g} {unit}"
        estimate, truth = (f"{scale * value:.6g}" for value in (entry.nominal, entry.nominal + draw))
        inputs.add_row(Text(in_words(entry.name), style="dim"), estimate, truth, off, sigmas)
    return inputs


def case_screen(
    study: Study, case: int, draws: dict[str, float], flown: tuple[Array, Array], *, scheme: str
) -> RenderableType:
    """One case (from 0): every input, and how it and the nominal one end by the impulse sum and through real widths.

    ``flown``: the outputs (5,) through real widths, of the nominal case and of this one.
    """
    inputs = inputs_table(study.model.inputs.drawn, draws)
    ways = "impulses", "flown"
    outcome = columns("\n", *(f"{which}\n{how}" for how in ways for which in ("nominal", "this case")))
    closed = Study(study.model, study.seed)
    real = study_of(study.model.spacecraft, study.model.schedule, seed=study.seed)
    ends = (closed.outputs_of({}), closed.outputs_of(draws), *flown)
    for name, scale, *values in zip(NAMES, SCALES, *ends, strict=True):
        largest = scale * float(np.max(np.abs(values)))
        cells = (MISSING if math.isnan(value) else beside(scale * value, largest) for value in values)
        outcome.add_row(Text(name, style="dim"), *cells)
    found = [one.aspects_of(case_) for one in (closed, real) for case_ in ({}, draws)]
    add_angles(outcome, study.model.spacecraft.keep, [one for one in found if one is not None])
    empty = [Text(f"Tank empty too soon: {EMPTY}.", "red")] * bool(real.ends_of(draws).drained > 1.0)
    title = Text.assemble((study.model.spacecraft.name, "bold"), f": {scheme}, seed {study.seed}, case {case + 1}")
    note = "impulses: by the impulse sum (17); flown: through real widths, with the true tensor and disturbances"
    return Group(title, Text(), inputs, Text(), outcome, Text(note, style="dim"), *empty)


def add_angles(table: Table, keep: Sequence[Keep], flights: Sequence[Array]) -> None:
    """Two rows for each cone: the least and the largest angle from its direction in each of ``flights``, (m, 2) rad."""
    for index, one in enumerate(keep):
        for row, which in enumerate(("least", "largest")):
            cells = (f"{math.degrees(found[index, row]):.4g}" for found in flights)
            table.add_row(Text(f"{which} from {one.name}, deg", style="dim"), *cells)


def _budgeted(study: Study) -> tuple[tuple[str, str], tuple[str, str]]:
    """The outputs of the tolerance budget, and what people call them."""
    first, second = Part.NUTATION, compliance.aim(study.model.spacecraft)
    return (first.value, first.label), (second.value, second.label)
