"""Files of ``disperse --loop``: JSON of all cases together or of one, and CSV case by case."""

from __future__ import annotations

import math
from typing import IO, Any

import numpy as np

from nutdamp import __version__
from nutdamp.control_loop.batch import FlownLoops
from nutdamp.control_loop.dispersion import OUTPUTS, LoopResults, LoopStudy
from nutdamp.control_loop.law import Ending
from nutdamp.files.samples import column, cone_columns
from nutdamp.files.tabular import csv_text, number
from nutdamp.montecarlo.statistics import Array
from nutdamp.montecarlo.study import CONFIDENCE
from nutdamp.views.dispersion import (
    angles_json,
    cones_json,
    correlation_json,
    percentiles_json,
    requirement_of,
    shown,
)
from nutdamp.views.plan_json import heading

COLUMNS = (
    "settled_s",
    "quiet_nutation_deg",
    "largest_nutation_deg",
    "momentum_shift_deg",
    "axis_error_deg",
    "spin_change_rad_s",
    "propellant_kg",
    "firings",
)
"""Columns of `OUTPUTS`, in their order."""


def loop_cases_json(results: LoopResults, *, worst: int) -> dict[str, Any]:
    """Percentiles, the shares that fall quiet and keep the dead band, requirement, worst cases; degrees, else SI."""
    study = results.study
    return {
        **heading(study.spacecraft),
        "law": study.law.loop.law,
        "until_s": study.until,
        "samples": results.done,
        "requested": results.requested,
        "interrupted": results.done < results.requested,
        "seed": study.seed,
        "redrawn": results.redrawn,
        "alone_because": study.alone or None,
        "percentiles": {
            name: percentiles_json(name, nominal, results.distribution(output))
            for name, output, nominal in zip(COLUMNS, OUTPUTS, study.nominal.tolist(), strict=True)
        },
        "settled": _share(results, results.settled, results.done),
        "never_started": results.idle,
        "dead_band": {
            "expected_deg": math.degrees(study.band.most),
            **_share(results, results.within, len(results.of("quiet"))),
        },
        "stopped": {stop.name.lower(): count for stop, count in results.stops.items() if stop is not Ending.END},
        "requirement": requirement_of(results),
        **cones_json(results),
        "shares": {
            name: results.shares(output)
            for name, output in zip(COLUMNS, OUTPUTS, strict=True)
            if output in ("settled", "nutation", "propellant")
        },
        **correlation_json(study.spacecraft),
        "each_firing": {entry.name: entry._asdict() for entry in study.model.of_firings},
        "unused_because": {entry.name: entry.reason for entry in study.model.inputs.unused},
        "worst": [
            {
                **_inputs(study, case),
                **outputs_json(results.values[:, case]),
                **angles_json(study.spacecraft, results.angles[:, :, case]),
            }
            for case in results.worst.cases[:worst].tolist()
        ],
    }


def loop_case_json(study: LoopStudy, case: int, flown: FlownLoops) -> dict[str, Any]:
    """One case (from 0), ``flown`` alone: the true value of each input, in SI, and the outputs."""
    values, stop = study.measured(flown)[0][:, 0], flown.pilots[0].ending[0]
    seen = angles_json(study.spacecraft, flown.aspects[:, :, 0])
    outputs = {"stopped": stop.name.lower(), **outputs_json(values), **seen}
    return {"nutdamp": __version__, "seed": study.seed, "until_s": study.until, **_inputs(study, case), **outputs}


def _inputs(study: LoopStudy, case: int) -> dict[str, Any]:
    draws = study.draws_of(case)
    entries = study.model.inputs.drawn
    return {"case": case + 1, "inputs": {entry.name: entry.nominal + draws[entry.name] for entry in entries}}


def outputs_json(values: Array) -> dict[str, float]:
    """The outputs (8,) of a case by their columns; unknown ones are not a number."""
    return {name: shown(name, value) for name, value in zip(COLUMNS, values.tolist(), strict=True)}


def _share(results: LoopResults, count: int, of: int) -> dict[str, float | None]:
    low, high = results.interval_about(count, of) if of else (None, None)
    return {"fraction": count / of if of else None, "low": low, "high": high, "confidence": CONFIDENCE}


class LoopCasesWriter:
    """Writer of one row a case: its number (from 1), the true value of each input, the outputs; angles in degrees.

    With cones the least and the largest angle from the spin axis to the direction of each cone follow.
    """

    def __init__(self, stream: IO[bytes], study: LoopStudy) -> None:
        self._stream, self._study = stream, study
        inputs = (column(entry) for entry in study.model.inputs.drawn)
        header = ["case", *inputs, *COLUMNS, "stopped", *cone_columns(study.spacecraft)]
        stream.write(csv_text(header, []).encode())
        stream.flush()

    def write(self, first: int, values: Array, stops: list[Ending], angles: Array) -> None:
        """Write the cases from ``first`` (from 0) on, with their outputs (8, n) and ``angles`` (m, 2, n) rad."""
        entries = self._study.model.inputs.drawn
        drawn = self._study.draws_from(first, len(stops))
        rows = []
        for row, stop in enumerate(stops):
            truths = [entry.nominal + float(drawn[entry.name][row]) for entry in entries]
            inputs = [
                number(math.degrees(value) if entry.unit == "rad" else value)
                for entry, value in zip(entries, truths, strict=True)
            ]
            outputs = outputs_json(values[:, row]).values()
            cells = ["" if math.isnan(value) else number(value) for value in outputs]
            ending = [str(int(values[-1, row])), stop.name.lower(), *map(number, np.degrees(angles[..., row]).flat)]
            rows.append([str(first + row + 1), *inputs, *cells[:-1], *ending])
        self._stream.write(csv_text(rows[0], rows[1:]).encode())
