"""The screens of ``disperse --loop``: final motion and cost of dispersed loops, share that settles; one case alone."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.control_loop.batch import FlownLoops
from nutdamp.control_loop.dispersion import OUTPUTS, LoopResults, LoopStudy
from nutdamp.control_loop.law import Ending
from nutdamp.montecarlo.statistics import Exact
from nutdamp.views import verdicts
from nutdamp.views.dispersion import (
    PERCENTS,
    add_angles,
    angles_note,
    beside,
    bounded,
    bounded_heads,
    cone_lines,
    requirement_lines,
)
from nutdamp.views.layout import columns
from nutdamp.views.loop_tables import described
from nutdamp.views.text import MISSING, degrees, duration
from nutdamp.views.tolerances import MOST_ROWS, in_words, inputs_table, size_text, unused_table

NAMES = {
    "settled": ("first quiet, s", 1.0),
    "quiet": ("left then, deg", 180.0 / math.pi),
    "nutation": ("largest, deg", 180.0 / math.pi),
    "momentum_shift": ("momentum shift, deg", 180.0 / math.pi),
    "axis_error": ("axis error, deg", 180.0 / math.pi),
    "spin_change": ("spin off, mrad/s", 1e3),
    "propellant": ("propellant, g", 1e3),
    "firings": ("firings", 1.0),
}
"""Short names of the outputs for people, and the factors to their units."""

SHARED = ("settled", "nutation", "propellant")
"""Outputs whose dependence on the inputs is shown."""


def loop_cases_screen(results: LoopResults, *, worst: int) -> Group:
    """All tables of ``disperse --loop``."""
    study = results.study
    drawn = f"{results.done:,} case{'s' * (results.done > 1)}, seed {study.seed}"
    if results.redrawn:
        drawn += f", {results.redrawn:,} unphysical ones drawn again"
    title = Text.assemble((study.spacecraft.name, "bold"), f": loop, 0 to {duration(study.until)}, {drawn}")
    parts: list[RenderableType] = [title, Text(described(study.law.loop)), Text(), _percentiles(results)]
    parts += [angles_note(study.spacecraft), Text()]
    parts += [*_settled(results), _dead_band(results), *requirement_lines(results), *cone_lines(results)]
    parts += list(_shares(results))
    anew = ", ".join(f"{in_words(entry.name)} {size_text(entry)}" for entry in study.model.of_firings)
    if anew:
        parts.append(Text(f"Each firing draws anew, one sigma or bias: {anew}.", "dim"))
    if worst:
        parts += [Text(), *_worst(results, worst)]
    if study.model.inputs.unused:
        parts += [Text(), Text("Unused dispersions", style="bold"), unused_table(study.model.inputs.unused)]
    return Group(*parts)


def _percentiles(results: LoopResults) -> Table:
    table = columns("", "nominal", *(f"{percent:g} %" for percent in PERCENTS), "max")
    for output, plan in zip(OUTPUTS, results.study.nominal.tolist(), strict=True):
        name, scale = NAMES[output]
        distribution = results.distribution(output)
        if distribution is not None and output == "spin_change":  # up or down, the largest change is the worst
            distribution, plan = Exact(np.abs(results.of(output))), abs(plan)
        if distribution is None:
            table.add_row(Text(name, style="dim"), *[MISSING] * (len(PERCENTS) + 2))
            continue
        values = [plan, *distribution.quantiles(np.array(PERCENTS) / 100.0).tolist(), distribution.maximum]
        largest = scale * max(abs(distribution.minimum), abs(distribution.maximum))
        table.add_row(Text(name, style="dim"), *(_number(output, scale * value, largest) for value in values))
    for column in table.columns[1:]:
        column.no_wrap = True
    return table


def _number(output: str, value: float, largest: float) -> str:
    if math.isnan(value):
        return MISSING
    return f"{value:.0f}" if output == "firings" else beside(value, largest)


def _share(results: LoopResults, count: int, of: int) -> str:
    if not of:
        return "no case"
    low, high = results.interval_about(count, of)
    share, least, most = (verdicts.percent(fraction, 0.99) for fraction in (count / of, low, high))
    return f"{share} of cases (95 % interval {least} to {most})"


def _settled(results: LoopResults) -> Iterator[RenderableType]:
    stopped = [(stop, count) for stop, count in results.stops.most_common() if stop is not Ending.END]
    lasting = "and is not stopped, " if stopped else ""
    yield Text.assemble(("Falls quiet ", "bold"), f"{lasting}in {_share(results, results.settled, results.done)}.")
    parts = [f"stopped in {count:,}: {stop.value}" for stop, count in stopped]
    never = results.done - results.settled - sum(count for _, count in stopped)
    if never:
        parts.append(f"not down to the stop threshold in {never:,}")
    if parts:
        yield Text(f"Of the others: {'; '.join(parts)}.")
    if results.idle:
        yield Text(f"In {results.idle:,} cases the sensor never shows the start threshold, and nothing fires.")


def _dead_band(results: LoopResults) -> Text:
    expected = degrees(results.study.band.most)
    share = _share(results, results.within, len(results.of("quiet")))
    return Text.assemble(("Dead band ", "bold"), f"(at most {expected}, from the nominal sensor): kept in {share}.")


def _shares(results: LoopResults) -> Iterator[RenderableType]:
    """Shares of the inputs in the variance of the outputs."""
    shares = {output: results.shares(output) for output in SHARED}
    inputs = [entry for entry in results.study.model.inputs.drawn if entry.sigma]
    if not inputs or not any(shares.values()):
        return
    most = {entry.name: max(share.get(entry.name, 0.0) for share in shares.values()) for entry in inputs}
    heads = (f"{NAMES[output][0].partition(',')[0]}\n%" for output in SHARED)
    table = columns("input\n", "one sigma\n", *heads)
    for entry in sorted(inputs, key=lambda drawn: -most[drawn.name])[:MOST_ROWS]:
        cells = (f"{100.0 * share[entry.name]:.1f}" if share else MISSING for share in shares.values())
        table.add_row(Text(in_words(entry.name), style="dim"), size_text(entry), *cells)
    yield Text()
    yield Text("What it depends on", style="bold")
    yield table
    note = "Squared correlation over the cases that fall quiet; the rest is noise and what is not linear."
    if results.study.model.groups:
        note += " Of correlated inputs each has what it adds to those before it in the file's correlation."
    yield Text(note, "dim")


def _worst(results: LoopResults, count: int) -> Iterator[RenderableType]:
    study, keep = results.study, results.study.spacecraft.keep
    heads = (
        "case\n",
        "first quiet\ns",
        "largest\ndeg",
        "propellant\ng",
        "firings\n",
        *bounded_heads(keep),
        "largest inputs, in sigmas\n",
    )
    table = columns(*heads, text=(heads[-1],))
    cases = results.worst.cases[:count].tolist()
    for case in cases:
        values = dict(zip(OUTPUTS, results.values[:, case].tolist(), strict=True))
        draws = study.draws_of(case)
        sigmas = [
            (in_words(entry.name), draws[entry.name] / entry.sigma) for entry in study.model.inputs.drawn if entry.sigma
        ]
        largest = sorted(sigmas, key=lambda pair: -abs(pair[1]))[:3]
        cells = (
            MISSING if math.isnan(values[name]) else f"{values[name] * NAMES[name][1]:.4g}"
            for name in ("settled", "nutation", "propellant", "firings")
        )
        angles = [f"{angle:.4g}" for angle in bounded(keep, np.degrees(results.angles[:, :, case]).tolist())]
        table.add_row(str(case + 1), *cells, *angles, ", ".join(f"{name} {sigma:+.1f}" for name, sigma in largest))
    yield Text("Worst cases", style="bold")
    yield table
    options = f"--seed {study.seed} --case {cases[0] + 1}"
    yield Text(f"Each can be looked at alone: {options}; `nutdamp loop` flies it with {options} again", "dim")


def loop_case_screen(study: LoopStudy, case: int, flown: FlownLoops) -> Group:
    """One case (from 0), ``flown`` alone: every input, and its end beside the nominal one."""
    values, stop = study.measured(flown)[0][:, 0], flown.pilots[0].ending[0]
    table = columns("", "nominal", "this case")
    for output, *pair in zip(OUTPUTS, study.nominal.tolist(), values.tolist(), strict=True):
        name, scale = NAMES[output]
        largest = scale * max((abs(value) for value in pair if not math.isnan(value)), default=0.0)
        table.add_row(Text(name, style="dim"), *(_number(output, scale * value, largest) for value in pair))
    add_angles(table, study.spacecraft.keep, [study.nominal_aspects, flown.aspects[:, :, 0]])
    title = Text.assemble((study.spacecraft.name, "bold"), f": loop, seed {study.seed}, case {case + 1}")
    parts: list[RenderableType] = [title, Text(), inputs_table(study.model.inputs.drawn, study.draws_of(case)), Text()]
    parts.append(table)
    if stop is not Ending.END:
        parts.append(Text.assemble(("Stopped: ", "bold red"), f"{stop.value}."))
    parts.append(Text(f"Firing by firing: nutdamp loop --seed {study.seed} --case {case + 1}", "dim"))
    return Group(*parts)
