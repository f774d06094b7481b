"""Results of ``disperse``: percentiles, requirement, cones, cases, and the tolerance budget: effect
of each input alone, and its share of the variance; tolerances in words.

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
from rich.text import Text

from nutdamp.common.results import Note, note
from nutdamp.files.export import column, cone_columns
from nutdamp.flight.propagation import IDEAL_IMPULSES, model_name
from nutdamp.montecarlo.inputs import DispersedInput, Unused, together
from nutdamp.montecarlo.statistics import OUTPUTS, Array, cases_to_show
from nutdamp.montecarlo.study import EARLY, Results, Study
from nutdamp.planning.causes import main_causes
from nutdamp.planning.screening import Dispersion
from nutdamp.planning.verdict import Verdict
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.units import screen_unit
from nutdamp.views import decisions
from nutdamp.views import verdict as verdicts
from nutdamp.views.glance import end_rows
from nutdamp.views.parts import STEP, Summary, named
from nutdamp.views.tables import (
    REAL,
    TEXT,
    WHOLE,
    Column,
    DataTable,
    FittedColumns,
    Shared,
    facts,
    to_figures,
    values_of,
)
from nutdamp.views.text import digits, quantity

if TYPE_CHECKING:
    from nutdamp.control_loop.controller import Ending
    from nutdamp.control_loop.dispersion import LoopResults, LoopStudy


PERCENTS = (50.0, 90.0, 95.0, 99.0, 99.7)
LEVELS = tuple(f"{percent:g}" for percent in PERCENTS)
BRIEFLY = ("50", "95", "99.7")
"""Their names, and those on the default screen."""

BOTH = "screen full"  # the default screen, and that of all values


class StudyOutput(NamedTuple):
    """An output: ``key`` in files, heading and unit for people, factor to it.

    ``ranks``: worst cases show it; ``signed``: screens have percentiles of its size.
    """

    name: str
    key: str
    heading: str
    unit: str = "deg"
    scale: float = 1.0
    ranks: bool = False
    signed: bool = False

    @property
    def shown_unit(self) -> tuple[str, float]:
        """Unit of screens, and the factor to it."""
        return screen_unit(self.unit, self.scale)

    @property
    def label(self) -> str:
        """Heading and unit of its percentiles."""
        heading = f"|{self.heading}|" if self.signed else self.heading
        return f"{heading}, {self.shown_unit[0]}" if self.unit else heading


FLOWN_OUTPUTS = (  # the outputs of a schedule, in the order of `OUTPUTS`
    *(
        StudyOutput(part.value, f"{part.value}_deg", part.label, ranks=True)
        for part in (Part.NUTATION, Part.SHIFT, Part.DISTANCE)
    ),
    StudyOutput("spin_change", "spin_change_rad_s", "spin change", "mrad/s", 1e3, signed=True),
    StudyOutput("propellant", "propellant_kg", "propellant", "g", 1e3),
)

NOTHING = 1e-9  # values, in these units, below which a number is rounding

EMPTY = (
    "the pulses need more propellant than the tank has, so the last ones do not "
    "fire and the case does not comply"
)
"""Note on a case whose tank runs empty."""

ACCURACY = "Percentiles are right to 0.006 % of their value; nominal and max are exact."
"""Note on a study of more cases than are kept."""


def dispersion_screen(
    flown: Dispersion, *, worst: int, verbose: bool = True, planned: Sequence[Note] = ()
) -> RenderableType:
    """The screen of ``disperse``: verdict, percentiles, what counts most, and worst cases;
    ``planned``: notes on the plan that it flies.
    """
    results, judged = flown.core, flown.verdict
    study = results.study
    ideal = model_name([study.model.schedule]) == IDEAL_IMPULSES
    how = "ideal impulses" if ideal else "full simulation"
    title = named(study.model.spacecraft, f": {flown.plan.scheme}, {how}; {drawn(results)}")
    head = [title, *verdict_lines(judged, results)]
    percentiles = percentile_table(results, FLOWN_OUTPUTS, study.outputs_of({}), alone=True)
    varies = any(entry.sigma for entry in study.model.inputs.drawn)
    notes = [*unused_notes(study.model.inputs.unused), *planned]
    if not verbose:
        steps = STEP.join(["--plot cases.png", *([f"{again(results)} (worst)"] if varies else [])])
        brief = percentiles.screen("screen")
        return Summary(head, lambda **_: [brief], [*main_causes(judged), *notes], steps)
    accuracy = [] if results.exact else [Text(ACCURACY, style="dim")]
    tables: list[RenderableType] = [
        Group(percentiles.screen("full"), *accuracy),
        Group(
            Text("Nominal case", style="bold"),
            facts(end_rows(flown.plan._flight, flown.plan._aspects)),
        ),
    ]
    budget, caption = budget_of(results)
    tables.append(Text(caption) if budget is None else captioned(budget, caption))
    if worst and varies:
        cases = worst_cases(results, worst)
        tables.append(
            captioned(cases, f"Inspect one: nutdamp disperse, as here, with {again(results)}")
        )
    return Summary(head, lambda: tables, notes, verbose=True)


def drawn(results: Results | LoopResults) -> str:
    """Clause on the cases that were flown."""
    redrawn = f", unphysical and drawn again: {results.redrawn:,}" if results.redrawn else ""
    return f"cases: {results.done:,}, seed {results.study.seed}{redrawn}"


def captioned(table: DataTable, caption: str) -> Group:
    """A table of the screen below its title, and its caption."""
    return Group(Text(table.title, "bold"), table.screen("screen"), Text(caption, "dim"))


def dispersion_json(flown: Dispersion, *, worst: int) -> dict[str, Any]:
    """Percentiles, requirement, tolerance budget, ``worst`` cases and end of the nominal one;
    degrees, else SI.

    ``shares`` are of the nutation, of other outputs below their names; with ``correlation`` each is
    the increment over those before it. ``effect_deg``: on the nutation, of one sigma of an input
    alone (or all of a bias).
    """
    results, study, spacecraft = flown.core, flown.core.study, flown.plan.spacecraft
    return {
        **decisions.heading(spacecraft),
        "scheme": flown.plan.scheme,
        **counts_json(results),
        "final": decisions.final_json(study.nominal),
        "target": decisions.target_json(spacecraft),
        "exact_percentiles": results.exact,
        "percentiles": percentiles_json(results, FLOWN_OUTPUTS, study.outputs_of({})),
        "requirement": requirement_of(flown.verdict),
        "decision": verdicts.verdict_json(flown.verdict),
        **cones_json(results),
        **({"tank_empty_fraction": results.emptied / results.done} if spacecraft.tank else {}),
        "shares": list(_shares(results)),
        **correlation_json(spacecraft),
        "unused": [entry.name for entry in study.model.inputs.unused],
        "unused_because": dict(study.model.inputs.unused),
        "worst": worst_cases(results, worst).json(),
    }


def counts_json(results: Results | LoopResults) -> dict[str, Any]:
    """Number of cases, and their seed."""
    counts = values_of(results, "samples=done", "requested") | {
        "interrupted": results.done < results.requested
    }
    return counts | values_of(results, "seed=study.seed", "redrawn")


def worst_cases(results: Results, count: int) -> DataTable:
    """The worst cases, one row each, with what contributes most."""
    study = results.study
    rows = [
        _flown(study, case, study.draws_of(case)) for case in results.worst.cases[:count].tolist()
    ]
    return case_table(study, FLOWN_OUTPUTS, rows, _effects(study))


def again(results: Results | LoopResults) -> str:
    """Options that show the worst case alone."""
    return f"--seed {results.study.seed} --case {results.worst.cases[0] + 1}"


# --- percentiles


def percentile_table(
    results: Results | LoopResults,
    outputs: Sequence[StudyOutput],
    nominal: Array,
    *,
    alone: bool = False,
    sizes: bool = True,
) -> DataTable:
    """One row an output: values by shares of the cases, with ``sizes`` those of signed ones, to the
    digits of the largest; ``alone``: the ``nominal`` values of a case with digits of their own, as
    other places show them.
    """
    rows = []
    for output, value in zip(outputs, nominal[: len(outputs)].tolist(), strict=True):
        distribution = results.distribution(output.name)
        values = {"nominal": value}
        if distribution is not None:
            if output.signed and sizes:
                distribution = distribution.sizes()
                values["nominal"] = abs(value)
            levels = distribution.quantiles(np.array(PERCENTS) / 100.0).tolist()
            values |= {"min": distribution.minimum, "max": distribution.maximum}
            values |= zip(LEVELS, levels, strict=True)
        rows.append((output, {key: shown(output.key, size) for key, size in values.items()}))

    def text(key: str, row: tuple[StudyOutput, dict[str, float]]) -> str | None:
        output, values = row
        size = values.get(key, math.nan)
        if math.isnan(size) or "max" not in values:
            return None
        scale = output.shown_unit[1]
        if not output.unit:
            return f"{size:.0f}"
        if alone and key == "nominal":
            return "0" if abs(scale * size) < NOTHING else digits(abs(scale * size), 4)
        return beside(scale * size, abs(scale * values["max"]))

    def column(key: str, heading: str, where: str) -> Column:
        words = partial(text, key)
        return Column(key, heading, "", lambda row: row[1].get(key), where=where, words=words)

    columns = (
        Column("", "", "", lambda row: row[0].label, where=BOTH, kind=TEXT),
        column("nominal", Shared.NOMINAL, f"{BOTH} json"),
        column("min", "", "json"),
        *(column(key, f"{key} %", f"{BOTH if key in BRIEFLY else 'full'} json") for key in LEVELS),
        column("max", Shared.MOST, f"{BOTH} json"),
    )
    return DataTable("Percentiles", columns, rows)


def percentiles_json(
    results: Results | LoopResults, outputs: Sequence[StudyOutput], nominal: Array
) -> dict[str, dict[str, float | None]]:
    """Rows of `percentile_table` with signed values, by the keys of their outputs."""
    table = percentile_table(results, outputs, nominal, sizes=False)
    return dict(zip((output.key for output in outputs), table.json(), strict=True))


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


# --- requirement and cones


def verdict_lines(judged: Verdict, results: Results | LoopResults) -> list[RenderableType]:
    """The verdict, what more cases would show, a row for each bound, and tanks that run empty."""
    parts: list[RenderableType] = [verdicts.coloured(*verdicts.stated(judged))]
    if judged.cases is not None and judged.cases.complying is not None:
        low, high, probability = judged.cases.low, judged.cases.high, judged.cases.probability
        few = cases_to_show(probability) if probability < 1.0 else 0
        if not judged.unshown:
            ends = (verdicts.percent(share, probability) for share in (low, high))
            parts.append(Text("95 % interval {} to {}".format(*ends)))
        elif results.done < few:
            parts.append(Text(f"It takes at least {few:,} cases to show it."))
    parts.append(verdicts.bound_table(judged).screen("screen"))
    if isinstance(results, Results) and results.emptied:
        share = verdicts.percent(results.emptied / results.done, 1.0 - results.probability)
        words = (f"empty too soon in {share} of cases", "red")
        parts.append(Text.assemble(("Tank ", "bold"), words, f": {EMPTY}."))
    return parts


def requirement_of(judged: Verdict) -> dict[str, Any] | None:
    """The share of cases that comply beside the one required; None where nothing is."""
    entry = verdicts.cases_json(judged.cases)
    if entry is None:
        return None
    shares = {name: entry[name] for name in ("met_fraction", "low", "high", "probability")}
    return {**shares, "confidence": 0.95, "met": judged.met}


def cones_json(results: Results | LoopResults) -> dict[str, Any]:
    """Number of cases that break each cone, and least and largest angle from it to the axis;
    nothing without cones, or before the first case.
    """
    keeps = results.study.model.spacecraft.keep
    if not (results.done and keeps):
        return {}
    angles = np.degrees([results.aspects, results.study.nominal_aspects]).transpose(1, 0, 2)
    names = ("least_deg", "largest_deg", "nominal_least_deg", "nominal_largest_deg")
    entries = []
    for keep, broken, sizes in zip(keeps, results.broken, angles.reshape(-1, 4), strict=True):
        entry = values_of(keep, "name", "min_deg=least", "max_deg=most")
        entry["broken_fraction"] = float(broken / results.done)
        entries.append(entry | dict(zip(names, sizes.tolist(), strict=True)))
    return {"aspects": entries}


# --- cases


class CaseRow(NamedTuple):
    """A case, from 0, or `ESTIMATE`: deviations of its inputs, its values as of `DrawnCases`, and
    the ending of a loop.
    """

    case: int
    draws: Mapping[str, float]
    values: Sequence[float]
    stop: Ending | None = None


ESTIMATE = -1  # number of the nominal case


def _flown(study: Study, case: int, draws: Mapping[str, float]) -> CaseRow:
    return CaseRow(case, draws, study.outputs_of(draws).tolist())


def case_json(study: Study, case: int, draws: Mapping[str, float]) -> dict[str, Any]:
    """One case (from 0): the true value of each input, in SI, and the outputs."""
    return case_table(study, FLOWN_OUTPUTS, [_flown(study, case, draws)]).json()[0]


def case_table(
    study: Study | LoopStudy,
    outputs: Sequence[StudyOutput],
    rows: Sequence[CaseRow],
    effects: Array | None = None,
) -> DataTable:
    """Cases, one row each; ``effects`` of the drawn inputs by which
    their contributors are ranked.
    """
    spacecraft, inputs = study.model.spacecraft, study.model.inputs.drawn

    def true(entry: DispersedInput, row: CaseRow) -> float:
        return entry.nominal + row.draws.get(entry.name, 0.0)

    def in_file(entry: DispersedInput, row: CaseRow) -> float:
        return math.degrees(true(entry, row)) if entry.unit == "rad" else true(entry, row)

    def angle(at: int, end: int, row: CaseRow) -> float | None:
        return math.degrees(row.values[len(outputs) + 2 * at + end])

    def output_of(at: int, row: CaseRow) -> float | None:
        value = row.values[at]
        if math.isnan(value):
            return None
        return shown(outputs[at].key, value) if outputs[at].unit else int(value)

    def cones(row: CaseRow) -> list[dict[str, Any]]:
        return [
            {"name": keep.name, "least_deg": angle(at, 0, row), "largest_deg": angle(at, 1, row)}
            for at, keep in enumerate(spacecraft.keep)
        ]

    columns = [
        Column("case", "case", "", lambda row: row.case + 1, where="screen csv json", kind=WHOLE),
        Column(
            "",
            "",
            "",
            lambda row: Shared.NOMINAL if row.case == ESTIMATE else Shared.THIS_CASE,
            where="case",
            kind=TEXT,
        ),
        Column(
            "inputs",
            "",
            "",
            lambda row: {entry.name: true(entry, row) for entry in inputs},
            where="json",
        ),
        Column("aspects", "", "", cones, where="json" if spacecraft.keep else ""),
    ]
    for entry in inputs:
        columns.append(Column(column(entry), "", "", partial(in_file, entry), where="csv"))
    for at, output in enumerate(outputs):
        value = partial(output_of, at)
        where = "csv json screen" if output.ranks else "csv json"
        text = to_figures(4, output.scale)
        columns.append(Column(output.key, output.heading, output.unit, value, text, where))
        text = _text_beside(output, map(value, rows))
        columns.append(Column("", output.heading, output.shown_unit[0], value, text, "case"))
    columns.append(
        Column(
            "stopped",
            "",
            "",
            lambda row: row.stop.name.lower() if row.stop else None,
            where="csv",
            kind=TEXT,
        )
    )
    keys = iter(cone_columns(spacecraft))
    for at, keep in enumerate(spacecraft.keep):
        ends = (("least", keep.least > 0.0), ("largest", keep.most < math.pi))
        for end, (which, bounded) in enumerate(ends):
            where = "csv case screen" if bounded else "csv case"
            heading = f"{which} from {keep.name}"
            value = partial(angle, at, end)
            columns.append(Column(next(keys), heading, "deg", value, to_figures(4), where))
    ranked = "inputs" if effects is None else "contributors"
    largest = partial(_largest, inputs, effects)
    columns.append(
        Column("", f"largest {ranked}, in sigmas", "", largest, where="screen", kind=TEXT)
    )
    return DataTable("Worst cases", columns, rows)


def _text_beside(output: StudyOutput, values: Iterable[float | None]) -> Callable[[float], str]:
    """Text of an output of few cases beside each other, to the digits of the largest; counts are
    whole.
    """
    if not output.unit:
        return "{:.0f}".format
    factor = output.shown_unit[1]
    largest = max((abs(factor * value) for value in values if value is not None), default=0.0)
    return lambda value: beside(factor * value, largest)


def _largest(inputs: Sequence[DispersedInput], effects: Array | None, row: CaseRow) -> str:
    sigmas = np.array([row.draws[entry.name] / (entry.sigma or math.inf) for entry in inputs])
    order = np.argsort(-np.abs(sigmas if effects is None else effects * sigmas), kind="stable")[
        :3
    ].tolist()
    return ", ".join(f"{in_words(inputs[at].name)} {sigmas[at]:+.1f}" for at in order if sigmas[at])


def _effects(study: Study) -> Array:
    return np.hypot(*(study.first_order.effects(output) for output, _ in budgeted_outputs(study)))


def case_screen(study: Study, case: int, draws: dict[str, float], *, scheme: str) -> Group:
    """One case (from 0): every input, and the ends of it and of the nominal case."""
    rows = [_flown(study, ESTIMATE, {}), _flown(study, case, draws)]
    empty = Text(f"Tank empty too soon: {EMPTY}.", "red")
    told = [empty] if study.ends_of(draws).drained > 1.0 else []
    return one_case(study, FLOWN_OUTPUTS, scheme, rows, told)


def one_case(
    study: Study | LoopStudy,
    outputs: Sequence[StudyOutput],
    name: str,
    rows: Sequence[CaseRow],
    told: Sequence[Text],
) -> Group:
    """The screen of a case: its inputs, its end beside the nominal one, ``rows`` of both, and what
    is ``told`` of it.
    """
    row = rows[-1]
    title = named(study.model.spacecraft, f": {name}, seed {study.seed}, case {row.case + 1}")
    inputs = inputs_table(study.model.inputs.drawn, row.draws)
    ends = case_table(study, outputs, rows).transposed("case")
    return Group(title, Text(), inputs, Text(), ends, *told)


def _shares(results: Results) -> Iterator[dict[str, Any]]:
    first = results.study.first_order
    linear = {name: first.shares(name).tolist() for name in OUTPUTS}
    effects = np.degrees(first.effects("nutation")).tolist()
    for at, entry in enumerate(first.inputs):
        sampled = results.shares.get(entry.name, {})
        both = {
            name: {"analytic": linear[name][at], "sampled": sampled.get(name, 0.0)}
            for name in OUTPUTS
        }
        about = values_of(entry, "tolerance", "sigma") | {"effect_deg": effects[at]}
        yield {"input": entry.name, **both.pop("nutation"), **about, **both}


# --- tolerances

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


def budget_of(results: Results) -> tuple[DataTable | None, str]:
    """Shares of the variance by input, by first order and by the cases, with a caption; the caption
    alone where nothing varies.
    """
    study = results.study
    inputs, first, sampled = study.model.inputs.drawn, study.first_order, results.shares
    if not any(entry.sigma for entry in inputs):
        return None, "Nothing varies from case to case, so there is no tolerance budget."
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
    return table, caption


def _percent(share: float) -> str:
    return f"{100 * share:.1f}" if share >= 5e-4 else "0"


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
