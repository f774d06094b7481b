"""Dispersed closed loops, for ``disperse --loop``: percentiles, share that settles, worst cases;
one case alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import IO, Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp import __version__
from nutdamp.common.results import Note, note
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
    correlation_json,
    in_words,
    size_text,
    unused_notes,
)
from nutdamp.views.loop import described
from nutdamp.views.parts import STEP, Summary, named
from nutdamp.views.tables import TEXT, Column, DataTable, Shared
from nutdamp.views.text import degrees, duration
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


def worst_cases(results: LoopResults, count: int) -> DataTable:
    """`case_table` of so many cases, the worst first."""
    study = results.study
    rows = [
        CaseRow(case, study.draws_of(case), results.values[:, case].tolist())
        for case in results.worst.cases[:count].tolist()
    ]
    return dispersion.case_table(study, SHOWN_OUTPUTS, rows)


def _flown_case(study: LoopStudy, case: int, flown: FlownLoops) -> CaseRow:
    values = study.measured(flown)[0][:, 0].tolist()
    ending = flown.pilots[0].ending[0]
    return CaseRow(case, study.draws_of(case), values, ending)


def loop_cases_screen(flown: LoopDispersion, *, worst: int, verbose: bool = True) -> RenderableType:
    """The screen of ``disperse --loop``: verdict, percentiles, main causes, and worst cases."""
    results, study = flown.core, flown.core.study
    drawn = dispersion.drawn(results)
    title = named(study.spacecraft, f": loop, 0 to {duration(study.until)}, {drawn}")
    head = [title, Text(described(study.law.loop)), *_verdicts(flown)]
    percentiles = dispersion.percentile_table(results, SHOWN_OUTPUTS, study.nominal)
    notes = [*unused_notes(study.model.inputs.unused)]
    again = dispersion.again(results) if len(results.worst.cases) else ""
    if not verbose:
        brief = percentiles.screen("screen")
        steps = f"--csv cases.csv{STEP}{again} (worst)" if again else "--csv cases.csv"
        return Summary(head, lambda **_: [brief], [*_causes(results), *notes], steps)
    anew = ", ".join(
        f"{in_words(entry.name)} {size_text(entry)}" for entry in study.model.of_firings
    )
    tables: list[RenderableType] = [percentiles.screen("full"), *_shares(results)]
    if anew:
        tables.append(Text(f"Each firing draws anew, one sigma or bias: {anew}.", "dim"))
    if worst and again:
        one = f"Inspect one: {again}; firing by firing: nutdamp loop {again}"
        tables.append(dispersion.captioned(worst_cases(results, worst), one))
    return Summary(head, lambda: tables, notes, verbose=True)


def _causes(results: LoopResults) -> Iterator[Note]:
    """The inputs that count most for each of `SHARED`, by their shares; the rest is noise."""
    parts = ("the time to quiet", "the largest nutation", "propellant")
    for output, part in zip(SHARED, parts, strict=True):
        shares = results.shares(output.name)
        main = sorted(filter(lambda name: shares[name] >= MAIN, shares), key=shares.__getitem__)
        causes = [f"{in_words(name)} ({100 * shares[name]:.1f} %)" for name in reversed(main)]
        if causes:
            yield note("main-causes", part=part, causes=", ".join(causes))


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
    about = (
        "Squared correlation over the cases that fall quiet; "
        "the rest is noise and what is not linear."
    )
    if results.study.model.groups:
        about += (
            " Of correlated inputs each has what it adds to those before it in the file's "
            "correlation."
        )
    yield dispersion.captioned(table, about)


def loop_case_screen(study: LoopStudy, case: int, flown: FlownLoops) -> Group:
    """One case (from 0), ``flown`` alone: every input, and its end beside the nominal one."""
    row = _flown_case(study, case, flown)
    nominal = CaseRow(dispersion.ESTIMATE, {}, study.nominal.tolist())
    told = [Text(f"Firing by firing: nutdamp loop --seed {study.seed} --case {case + 1}", "dim")]
    if row.stop is not None and row.stop is not Ending.END:
        told.insert(0, Text.assemble(("Stopped: ", "bold red"), f"{row.stop.value}."))
    return dispersion.one_case(study, SHOWN_OUTPUTS, "loop", [nominal, row], told)


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
        "percentiles": dispersion.percentiles_json(results, SHOWN_OUTPUTS, study.nominal),
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
        "worst": worst_cases(results, worst).json(),
    }


def loop_case_json(study: LoopStudy, case: int, flown: FlownLoops) -> dict[str, Any]:
    """One case (from 0), ``flown`` alone: the true value of each input, in SI, and the outputs."""
    row = _flown_case(study, case, flown)
    data = {"nutdamp": __version__, "seed": study.seed, "until_s": study.until}
    data |= {} if row.stop is None else {"stopped": row.stop.name.lower()}
    return data | dispersion.case_table(study, SHOWN_OUTPUTS, [row]).json()[0]


def _fraction(count: int, of: int) -> dict[str, float | None]:
    low, high = share_interval(count, of) if of else (None, None)
    return {"fraction": count / of if of else None, "low": low, "high": high, "confidence": 0.95}


class LoopCasesWriter:
    """Writer of a row a case: number (from 1), true inputs, outputs, least and largest angle to
    each cone; degrees.
    """

    def __init__(self, stream: IO[bytes], study: LoopStudy) -> None:
        self._stream, self._study = stream, study
        self._table = dispersion.case_table(study, SHOWN_OUTPUTS, ())
        stream.write(self._table.csv().encode())
        stream.flush()

    def write(self, first: int, values: Array, stops: list[Ending]) -> None:
        """Write the cases from ``first`` (from 0) on, with their values (rows, n)."""
        numbers = np.arange(first, first + len(stops))
        drawn = {
            name: np.broadcast_to(draws, numbers.shape).tolist()
            for name, draws in self._study.draws_of_all(numbers).items()
        }
        rows = [
            CaseRow(
                first + row,
                {name: draws[row] for name, draws in drawn.items()},
                values[:, row].tolist(),
                stop,
            )
            for row, stop in enumerate(stops)
        ]
        self._stream.write(replace(self._table, rows=rows).csv().partition("\n")[2].encode())
