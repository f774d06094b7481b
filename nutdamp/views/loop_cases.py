"""Dispersed closed loops, for ``disperse --loop``: percentiles, share that settles, worst cases;
one case alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import IO, Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp import __version__
from nutdamp.common.results import Note
from nutdamp.control_loop.controller import Ending
from nutdamp.control_loop.dispersion import LoopDispersion, LoopResults, LoopStudy
from nutdamp.control_loop.simulation import FlownLoops
from nutdamp.montecarlo.inputs import DispersedInput
from nutdamp.montecarlo.statistics import Array, share_interval
from nutdamp.views import decisions, dispersion
from nutdamp.views.dispersion import (
    MAIN,
    MOST_ROWS,
    CaseRow,
    StudyOutput,
    case_row,
    correlation_json,
    in_words,
    inputs_table,
    leading,
    size_text,
    unused_notes,
)
from nutdamp.views.loop import described
from nutdamp.views.parts import named, summary
from nutdamp.views.tables import TEXT, Column, DataTable, Shared
from nutdamp.views.text import degrees, duration, screen_line
from nutdamp.views.verdict import percent, verdict_json

SHOWN_OUTPUTS = (  # the outputs, in the order of `OUTPUTS`
    StudyOutput("settled", "settled_s", "first quiet", "s", ranks=True),
    StudyOutput("quiet", "quiet_nutation_deg", "left then"),
    StudyOutput("nutation", "largest_nutation_deg", "largest", ranks=True),
    StudyOutput("momentum_shift", "momentum_shift_deg", "momentum shift"),
    StudyOutput("axis_error", "axis_error_deg", "axis error"),
    StudyOutput("spin_change", "spin_change_rad_s", "spin off", "mrad/s", 1e3, signed=True),
    StudyOutput("propellant", "propellant_kg", "propellant", "g", 1e3, ranks=True),
    StudyOutput("firings", "firings", "firings", "", ranks=True),
)

SHARED = tuple(output for output in SHOWN_OUTPUTS if output.ranks and output.unit)
"""Outputs whose dependence on the inputs is shown."""


def _cases(study: LoopStudy, rows: Sequence[CaseRow]) -> DataTable:
    return dispersion.case_table(study, SHOWN_OUTPUTS, rows)


def _row(study: LoopStudy, case: int, values: Array, angles: Array | None, **more: Any) -> CaseRow:
    draws = study.draws_of(case)
    return case_row(study, SHOWN_OUTPUTS, case, draws, values.tolist(), angles, **more)


def _worst(results: LoopResults, count: int) -> list[CaseRow]:
    return [
        _row(results.study, case, results.values[:, case], results.angles[:, :, case])
        for case in results.worst.cases[:count].tolist()
    ]


def _flown_case(study: LoopStudy, case: int, flown: FlownLoops) -> CaseRow:
    values = study.measured(flown)[0][:, 0]
    return _row(study, case, values, flown.aspects[:, :, 0], stop=flown.pilots[0].ending[0])


def loop_cases_screen(flown: LoopDispersion, *, worst: int, verbose: bool = True) -> RenderableType:
    """The screen of ``disperse --loop``: verdict, percentiles, main causes, and worst cases."""
    results, study = flown.core, flown.core.study
    drawn = f"cases: {results.done:,}, seed {study.seed}"
    if results.redrawn:
        drawn += f", unphysical ones drawn again: {results.redrawn:,}"
    title = named(study.spacecraft, f": loop, 0 to {duration(study.until)}, {drawn}")
    head = [title, Text(described(study.law.loop))]
    percentiles = dispersion.percentile_table(results, SHOWN_OUTPUTS, study.nominal)
    unused = study.model.inputs.unused
    if not verbose:
        notes = list[Note]()
        for output, part in zip(
            SHARED, ("the time to quiet", "the largest nutation", "propellant"), strict=True
        ):
            shares = results.shares(output.name).items()  # the rest is noise
            main = {in_words(name): share for name, share in shares if share >= MAIN}
            notes += leading(part, main)
        steps = "--csv cases.csv"
        if len(results.worst.cases):
            steps += f" · {dispersion.again(results)} (worst)"
        return summary(
            [*head, *_verdicts(flown)],
            lambda **_: percentiles.screen("screen"),
            [*notes, *unused_notes(unused)],
            steps,
        )
    parts: list[RenderableType] = [*head, Text(), percentiles.screen("full"), Text()]
    parts += [*_verdicts(flown), *_shares(results)]
    anew = ", ".join(
        f"{in_words(entry.name)} {size_text(entry)}" for entry in study.model.of_firings
    )
    if anew:
        parts.append(Text(f"Each firing draws anew, one sigma or bias: {anew}.", "dim"))
    rows = _worst(results, worst)
    if rows:
        table = _cases(study, rows)
        options = dispersion.again(results)
        parts += [Text(), Text(table.title, style="bold"), table.screen("screen")]
        parts.append(
            Text(f"Inspect one: {options}; firing by firing: nutdamp loop {options}", "dim")
        )
    return Group(*parts, *map(screen_line, unused_notes(unused)))


def _verdicts(flown: LoopDispersion) -> Iterator[RenderableType]:
    results = flown.core
    yield from dispersion.verdict_lines(flown.verdict, results)
    stopped = [
        (stop, count) for stop, count in results.stops.most_common() if stop is not Ending.END
    ]
    lasting = "and is not stopped, " if stopped else ""
    yield Text.assemble(
        ("Falls quiet ", "bold"), f"{lasting}in {_share(results.settled, results.done)}."
    )
    parts = [f"stopped in {count:,}: {stop.value}" for stop, count in stopped]
    never = results.done - results.settled - sum(count for _, count in stopped)
    if never:
        parts.append(f"not down to the stop threshold in {never:,}")
    if parts:
        yield Text(f"Of the others: {'; '.join(parts)}.")
    if results.idle:
        yield Text(
            f"In {results.idle:,} cases the sensor never shows the start threshold, "
            "and nothing fires."
        )
    expected = degrees(results.study.band.most)
    share = _share(results.within, len(results.of("quiet")))
    yield Text.assemble(
        ("Dead band ", "bold"), f"(at most {expected}, from the nominal sensor): kept in {share}."
    )


def _share(count: int, of: int) -> str:
    if not of:
        return "no case"
    shares = (count / of, *share_interval(count, of))
    share, low, high = (percent(fraction, 0.99) for fraction in shares)
    return f"{share} of cases (95 % interval {low} to {high})"


def _shares(results: LoopResults) -> Iterator[RenderableType]:
    shares = {output.name: results.shares(output.name) for output in SHARED}
    inputs = [entry for entry in results.study.model.inputs.drawn if entry.sigma]
    if not inputs or not any(shares.values()):
        return

    def percent(output: StudyOutput, entry: DispersedInput) -> float | None:
        share = shares[output.name]
        return 100.0 * share[entry.name] if share else None

    ranked = sorted(
        inputs, key=lambda entry: -max(share.get(entry.name, 0.0) for share in shares.values())
    )
    table = DataTable(
        "What it depends on",
        (
            Column(
                "", Shared.INPUT, "", lambda entry: in_words(entry.name), where="screen", kind=TEXT
            ),
            Column("", "one sigma", "", size_text, where="screen"),
            *(
                Column(
                    "",
                    output.heading,
                    "%",
                    partial(percent, output),
                    lambda share: f"{share:.1f}",
                    "screen",
                )
                for output in SHARED
            ),
        ),
        ranked[:MOST_ROWS],
    )
    yield from (Text(), Text(table.title, style="bold"), table.screen("screen"))
    note = (
        "Squared correlation over the cases that fall quiet; "
        "the rest is noise and what is not linear."
    )
    if results.study.model.groups:
        note += (
            " Of correlated inputs each has what it adds to those before it in the file's "
            "correlation."
        )
    yield Text(note, "dim")


def loop_case_screen(study: LoopStudy, case: int, flown: FlownLoops) -> Group:
    """One case (from 0), ``flown`` alone: every input, and its end beside the nominal one."""
    row = _flown_case(study, case, flown)
    nominal = case_row(
        study,
        SHOWN_OUTPUTS,
        dispersion.ESTIMATE,
        {},
        study.nominal.tolist(),
        study.nominal_aspects,
    )
    table = _cases(study, [nominal, row]).transposed("case", names="")
    title = named(study.spacecraft, f": loop, seed {study.seed}, case {case + 1}")
    parts: list[RenderableType] = [
        title,
        Text(),
        inputs_table(study.model.inputs.drawn, row.draws),
        Text(),
        table,
    ]
    if row.stop is not None and row.stop is not Ending.END:
        parts.append(Text.assemble(("Stopped: ", "bold red"), f"{row.stop.value}."))
    parts.append(
        Text(f"Firing by firing: nutdamp loop --seed {study.seed} --case {case + 1}", "dim")
    )
    return Group(*parts)


def loop_cases_json(flown: LoopDispersion, *, worst: int) -> dict[str, Any]:
    """Percentiles, the shares that fall quiet and keep the dead band, requirement, worst cases;
    degrees, else SI.
    """
    results, study = flown.core, flown.core.study
    return {
        **decisions.heading(study.spacecraft),
        "law": study.law.loop.law,
        "until_s": study.until,
        **dispersion.counts_json(results),
        "alone_because": study.alone or None,
        "percentiles": dispersion.percentiles_of(results, SHOWN_OUTPUTS, study.nominal),
        "settled": _fraction(results.settled, results.done),
        "never_started": results.idle,
        "dead_band": {
            "expected_deg": math.degrees(study.band.most),
            **_fraction(results.within, len(results.of("quiet"))),
        },
        "stopped": {
            stop.name.lower(): count
            for stop, count in results.stops.items()
            if stop is not Ending.END
        },
        "requirement": dispersion.requirement_of(flown.verdict),
        "decision": verdict_json(flown.verdict),
        **dispersion.cones_json(results),
        "shares": {output.key: results.shares(output.name) for output in SHARED},
        **correlation_json(study.spacecraft),
        "each_firing": {entry.name: entry._asdict() for entry in study.model.of_firings},
        "unused_because": dict(study.model.inputs.unused),
        "worst": [row.data for row in _worst(results, worst)],
    }


def loop_case_json(study: LoopStudy, case: int, flown: FlownLoops) -> dict[str, Any]:
    """One case (from 0), ``flown`` alone: the true value of each input, in SI, and the outputs."""
    row = _flown_case(study, case, flown)
    data = {"nutdamp": __version__, "seed": study.seed, "until_s": study.until}
    data |= {} if row.stop is None else {"stopped": row.stop.name.lower()}
    return data | row.data


def _fraction(count: int, of: int) -> dict[str, float | None]:
    low, high = share_interval(count, of) if of else (None, None)
    return {"fraction": count / of if of else None, "low": low, "high": high, "confidence": 0.95}


class LoopCasesWriter:
    """Writer of a row a case: number (from 1), true inputs, outputs, least and largest angle to
    each cone; degrees.
    """

    def __init__(self, stream: IO[bytes], study: LoopStudy) -> None:
        self._stream, self._study, self._table = stream, study, _cases(study, ())
        stream.write(self._table.csv().encode())
        stream.flush()

    def write(self, first: int, values: Array, stops: list[Ending], angles: Array) -> None:
        """Write the cases from ``first`` (from 0) on, with their outputs (8, n) and ``angles`` (m,
        2, n) rad.
        """
        drawn = self._study.draws_of_all(np.arange(first, first + len(stops)))
        rows = []
        for row, stop in enumerate(stops):
            draws = {
                name: draw if isinstance(draw, float) else float(draw[row])
                for name, draw in drawn.items()
            }
            of_case = values[:, row].tolist(), angles[..., row]
            rows.append(case_row(self._study, SHOWN_OUTPUTS, first + row, draws, *of_case, stop))
        self._stream.write(replace(self._table, rows=rows).csv().partition("\n")[2].encode())
