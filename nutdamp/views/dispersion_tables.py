"""The screens of ``disperse``: percentiles, requirement, tolerance budget, worst cases; and one single case."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.errors import listed
from nutdamp.flight.end_state import aspects
from nutdamp.flight.propagation import IDEAL_IMPULSES, Flight, model_name
from nutdamp.montecarlo.inputs import DispersedInput, Unused
from nutdamp.montecarlo.statistics import OUTPUTS, Array, Distribution, cases_to_show
from nutdamp.montecarlo.study import Results, Study
from nutdamp.spacecraft.model import Keep, Spacecraft
from nutdamp.views import verdicts
from nutdamp.views.end_tables import bounds_text, end_table
from nutdamp.views.layout import columns, facts
from nutdamp.views.text import MISSING, degrees, digits
from nutdamp.views.tolerance_tables import SHOWN, budgeted_outputs, in_words, of_nominal, tolerance_budget

if TYPE_CHECKING:
    from nutdamp.control_loop.dispersion import LoopResults


PERCENTS = (50.0, 90.0, 95.0, 99.0, 99.7)
NAMES = ("nutation, deg", "momentum shift, deg", "axis error, deg", "spin change, mrad/s", "propellant, g")
NOTHING = 1e-9
"""Values, in these units, below which a number is rounding."""
SCALES = (180.0 / math.pi, 180.0 / math.pi, 180.0 / math.pi, 1e3, 1e3)
EMPTY = "the pulses take more propellant than there is, so that the last ones do not fire, and it does not comply"
"""Note on a case whose tank runs empty."""


def dispersion_screen(results: Results, *, scheme: str, worst: int, nominal: Flight | None = None) -> Group:
    """All tables of ``disperse``; ``nominal``: the nominal case, where its end is to be shown too."""
    parts: list[RenderableType] = [_title(results, scheme), Text(), _percentiles(results)]
    parts.append(angles_note(results.study.model.spacecraft))
    if not results.exact:
        parts.append(Text("Percentiles are right to 0.05 % of their value; nominal and all are exact.", style="dim"))
    if nominal is not None:
        parts += [Text(), Text("Nominal case", style="bold"), end_table(nominal, aspects(nominal))]
    parts += [Text(), *requirement_lines(results), *cone_lines(results), *_emptied(results)]
    parts += [Text(), *tolerance_budget(results)]
    if worst and any(entry.sigma for entry in results.study.model.inputs.drawn):
        parts += [Text(), *_worst(results, worst)]
    unused = results.study.model.inputs.unused
    if unused:
        parts += [Text(), Text("Unused dispersions", style="bold"), unused_table(unused)]
    return Group(*parts)


def _title(results: Results, scheme: str) -> Text:
    study = results.study
    pulses = "ideal impulses" if model_name([study.model.schedule]) == IDEAL_IMPULSES else "real widths"
    drawn = f"{results.done:,} case{'s' * (results.done > 1)}, seed {study.seed}"
    if results.redrawn:
        drawn += f", {results.redrawn:,} unphysical ones drawn again"
    how = f"flown by {pulses} and true tensor"
    return Text.assemble((study.model.spacecraft.name, "bold"), f": {scheme}, {how}, {drawn}")


def _percentiles(results: Results) -> Table:
    table = columns("", "nominal", *(f"{percent:g} %" for percent in PERCENTS), "all")
    shares = np.array(PERCENTS) / 100.0
    nominal = results.study.outputs_of({})
    for output, name, scale, plan in zip(OUTPUTS, NAMES, SCALES, nominal, strict=True):
        distribution = results.distribution(output)
        if distribution is None:
            table.add_row(Text(name, style="dim"), *[MISSING] * (len(PERCENTS) + 2))
            continue
        largest = scale * max(abs(distribution.minimum), abs(distribution.maximum))
        # The nominal value has digits of its own: other places show it alone.
        own = "0" if abs(scale * plan) < NOTHING else digits(scale * plan, 4)
        for sign, reached in _tails(distribution, shares):
            values = (beside(scale * value, largest) for value in reached)
            table.add_row(Text(name.replace(",", f"{sign},"), style="dim"), own, *values)
    for column in table.columns[1:]:
        column.no_wrap = True
    return table


def _tails(distribution: Distribution, shares: Array) -> Iterator[tuple[str, list[float]]]:
    """Quantiles of outputs by shares of the cases, and maxima; where values are negative, lower quantiles too."""
    upward, downward = distribution.maximum > 0.0, distribution.minimum < 0.0
    if upward or not downward:
        yield " ≤" * downward, [*distribution.quantiles(shares).tolist(), distribution.maximum]
    if downward:
        yield " ≥", [*distribution.quantiles(1.0 - shares).tolist(), distribution.minimum]


def angles_note(body: Spacecraft) -> Text:
    """Note on the reference of the angles of H in dispersed cases."""
    aim = "H at t = 0 with nominal values" if body.goal.axis is None else "the target"
    note = f"Momentum shift: from H at t = 0 of the same case; axis error: from {aim}."
    return Text(f"{note} The spin axis swings about H by the nutation.", style="dim")


def beside(value: float, largest: float) -> str:
    """A number with the decimals that show four digits of the ``largest`` beside it."""
    if largest < NOTHING:
        return "0"
    if not 1e-5 <= largest < 1e6:
        return f"{value:.2e}"
    shown = f"{value:.{max(3 - math.floor(math.log10(largest)), 0)}f}"
    return shown if float(shown) else shown.lstrip("-")


def requirement_lines(results: Results | LoopResults) -> list[RenderableType]:
    """The requirement, and the verdict on the number of cases that comply."""
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
    """Number of cases that break each cone, and range of the angles from the spin axis to its direction."""
    study = results.study
    nominal = study.nominal_aspects.tolist() if results.done and study.model.spacecraft.keep else ()
    for index, (keep, flown) in enumerate(zip(study.model.spacecraft.keep, nominal, strict=False)):
        broken = int(results.broken[index])
        share = verdicts.percent(broken / results.done, 1.0 - results.probability)
        seen, alone = (" to ".join(map(degrees, angles)) for angles in (results.aspects[index].tolist(), flown))
        yield Text.assemble(
            (f"Axis {bounds_text(keep)} from {keep.name} ", "bold"),
            (f"broken in {share} of cases", "red" if broken else "green"),
            f"; {seen} in all cases, {alone} in the nominal one.",
        )


def _emptied(results: Results) -> Iterator[RenderableType]:
    """Number of cases in which the tank runs empty, where any does."""
    if results.emptied:
        share = verdicts.percent(results.emptied / results.done, 1.0 - results.probability)
        yield Text.assemble(("Tank ", "bold"), (f"empty too soon in {share} of cases", "red"), f": {EMPTY}.")


def _worst(results: Results, count: int) -> list[RenderableType]:
    """The worst cases, each with the inputs that count most in it."""
    study = results.study
    table = columns(
        "case",
        "nutation\ndeg",
        "momentum shift\ndeg",
        "axis error\ndeg",
        *bounded_heads(study.model.spacecraft.keep),
        "what counts most, in sigmas",
        text=("what counts most, in sigmas",),
    )
    effects = np.hypot(study.first_order.effects("nutation"), study.first_order.effects(budgeted_outputs(study)[1][0]))
    cases = results.worst.cases[:count].tolist()
    for case in cases:
        draws = study.draws_of(case)
        outputs = np.degrees(study.outputs_of(draws)[:3])
        sigmas = [draws[entry.name] / entry.sigma if entry.sigma else 0.0 for entry in study.model.inputs.drawn]
        order = np.argsort(-np.abs(effects * sigmas), kind="stable")[:3]
        names = [in_words(entry.name) for entry in study.model.inputs.drawn]
        drawn = ", ".join(f"{names[row]} {sigmas[row]:+.1f}" for row in order if sigmas[row])
        aspects = study.aspects_of(draws)
        seen = () if aspects is None else bounded(study.model.spacecraft.keep, np.degrees(aspects).tolist())
        angles = [f"{angle:.4g}" for angle in seen]
        table.add_row(str(case + 1), *(f"{value:.4g}" for value in outputs), *angles, drawn)
    again = (
        "Each can be looked at alone, with all its inputs: nutdamp disperse, as here, with "
        f"--seed {study.seed} --case {cases[0] + 1}"
    )
    return [Text("Worst cases", style="bold"), table, Text(again, style="dim")]


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


def unused_table(unused: Iterable[Unused]) -> Table:
    """Inputs without effect; names that share a reason are listed together."""
    table = facts()
    reasons: dict[str, list[str]] = {}
    for name, reason in unused:
        reasons.setdefault(reason, []).append(in_words(name))
    for reason, names in reasons.items():
        table.add_row(", ".join(names), reason)
    return table


def inputs_table(drawn: Iterable[DispersedInput], draws: Mapping[str, float]) -> Table:
    """Every input of one case: nominal, drawn, and the deviation."""
    inputs = columns("input", "nominal", "this case", "off by", "in sigmas")
    for entry in drawn:
        unit, scale = SHOWN.get(entry.unit, (entry.unit, 1.0))
        draw = draws[entry.name]
        sigmas = f"{draw / entry.sigma:+.2f}" if entry.sigma else "bias"
        off = of_nominal(entry, draw, "+.4g") if entry.unit == "" else f"{scale * draw:+.4g} {unit}"
        estimate, truth = (f"{scale * value:.6g}" for value in (entry.nominal, entry.nominal + draw))
        inputs.add_row(Text(in_words(entry.name), style="dim"), estimate, truth, off, sigmas)
    return inputs


def case_screen(study: Study, case: int, draws: dict[str, float], *, scheme: str) -> RenderableType:
    """One case (from 0): every input, and the ends of it and of the nominal case."""
    inputs = inputs_table(study.model.inputs.drawn, draws)
    outcome = columns("", "nominal", "this case")
    cases: tuple[dict[str, float], ...] = {}, draws
    for name, scale, *values in zip(NAMES, SCALES, *map(study.outputs_of, cases), strict=True):
        largest = scale * float(np.max(np.abs(values)))
        cells = (MISSING if math.isnan(value) else beside(scale * value, largest) for value in values)
        outcome.add_row(Text(name, style="dim"), *cells)
    flights = [angles for angles in map(study.aspects_of, cases) if angles is not None]
    add_angles(outcome, study.model.spacecraft.keep, flights)
    empty = [Text(f"Tank empty too soon: {EMPTY}.", "red")] * bool(study.ends_of(draws).drained > 1.0)
    title = Text.assemble((study.model.spacecraft.name, "bold"), f": {scheme}, seed {study.seed}, case {case + 1}")
    return Group(title, Text(), inputs, Text(), outcome, *empty)


def add_angles(table: Table, keep: Sequence[Keep], flights: Sequence[Array]) -> None:
    """Two rows for each cone: the least and the largest angle from its direction in each of ``flights``, (m, 2) rad."""
    for index, cone in enumerate(keep):
        for row, which in enumerate(("least", "largest")):
            cells = (f"{math.degrees(angles[index, row]):.4g}" for angles in flights)
            table.add_row(Text(f"{which} from {cone.name}, deg", style="dim"), *cells)
