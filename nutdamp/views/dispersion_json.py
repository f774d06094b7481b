"""Result of ``disperse --json``."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.files.samples import OUTPUT_COLUMNS
from nutdamp.montecarlo.statistics import OUTPUTS, Array, Distribution
from nutdamp.montecarlo.study import CONFIDENCE, Results, Study
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views.plan_json import final_json, heading, target_json

if TYPE_CHECKING:
    from nutdamp.control_loop.dispersion import LoopResults


PERCENTS = (50.0, 90.0, 95.0, 99.0, 99.7)


def dispersion_json(results: Results, *, scheme: str, worst: int) -> dict[str, Any]:
    """Percentiles, requirement, tolerance budget and the ``worst`` cases; angles in degrees, else SI.

    ``shares`` are those of the nutation, with those of the other outputs below their names; ``effect_deg`` is that on
    the nutation of one sigma of an input alone (or all of a bias). Of inputs in ``correlation`` each share is the
    increment over those before it, and their sum that of all of them. ``final`` is the end of the nominal case.
    """
    study = results.study
    return {
        **heading(study.model.spacecraft),
        "scheme": scheme,
        "samples": results.done,
        "requested": results.requested,
        "interrupted": results.done < results.requested,
        "seed": study.seed,
        "redrawn": results.redrawn,
        "final": final_json(study.nominal),
        "target": target_json(study.model.spacecraft),
        "exact_percentiles": results.exact,
        "percentiles": {
            column: _percentiles(results, name, column) for name, column in zip(OUTPUTS, OUTPUT_COLUMNS, strict=True)
        },
        "requirement": requirement_of(results),
        **cones_json(results),
        **({"tank_empty_fraction": results.emptied / results.done} if study.model.spacecraft.tank else {}),
        "shares": _shares(results),
        **correlation_json(study.model.spacecraft),
        "unused": [entry.name for entry in study.model.inputs.unused],
        "unused_because": {entry.name: entry.reason for entry in study.model.inputs.unused},
        "worst": [
            case_json(study, int(case), study.draws_of(int(case))) for case in results.worst.cases[:worst].tolist()
        ],
    }


def _percentiles(results: Results, output: str, column: str) -> dict[str, float | None]:
    distribution = results.distribution(output)
    nominal = None if distribution is None else float(results.study.outputs_of({})[OUTPUTS.index(output)])
    return percentiles_json(column, nominal, distribution)


def percentiles_json(column: str, nominal: float | None, distribution: Distribution | None) -> dict[str, float | None]:
    """The ``nominal`` value of an output, and its distribution; nulls for unknown values."""
    names = ("nominal", "min", *(f"{percent:g}" for percent in PERCENTS), "max")
    spread: list[float | None] = [None] * (len(names) - 1)
    if distribution is not None:
        shares = np.array(PERCENTS) / 100.0
        spread = [distribution.minimum, *distribution.quantiles(shares).tolist(), distribution.maximum]
    values = zip(names, (nominal, *spread), strict=True)
    return {name: None if value is None else shown(column, value) for name, value in values}


def shown(column: str, value: float) -> float:
    """A value in the unit of its ``column``."""
    return math.degrees(value) if column.endswith("_deg") else value


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


def correlation_json(spacecraft: Spacecraft) -> dict[str, Any]:
    """Pairs of inputs that are correlated, as the file gives them; nothing without any."""
    pairs = () if spacecraft.dispersions is None else spacecraft.dispersions.correlation
    return {"correlation": [list(pair) for pair in pairs]} if pairs else {}


def cones_json(results: Results | LoopResults) -> dict[str, Any]:
    """Number of cases that break each cone, and least and largest angle from it to the axis; nothing without cones."""
    body, entries = results.study.model.spacecraft, []
    nominal = np.degrees(results.study.nominal_aspects).tolist() if body.keep else ()
    for index, (keep, (least, largest)) in enumerate(zip(body.keep, nominal, strict=False)):
        least_of_all, largest_of_all = np.degrees(results.aspects[index]).tolist()
        entries.append(
            {
                "name": keep.name,
                "min_deg": math.degrees(keep.least),
                "max_deg": math.degrees(keep.most),
                "broken_fraction": float(results.broken[index] / results.done),
                "least_deg": least_of_all,
                "largest_deg": largest_of_all,
                "nominal_least_deg": least,
                "nominal_largest_deg": largest,
            }
        )
    return {"aspects": entries} if entries else {}


def _shares(results: Results) -> list[dict[str, Any]]:
    analytic, sampled = results.study.first_order, results.shares
    shares = {name: analytic.shares(name).tolist() for name in OUTPUTS}
    effects = np.degrees(analytic.effects("nutation")).tolist()
    rows = []
    for index, entry in enumerate(analytic.inputs):
        both = {
            name: {"analytic": shares[name][index], "sampled": sampled.get(entry.name, {}).get(name, 0.0)}
            for name in OUTPUTS
        }
        rows.append(
            {
                "input": entry.name,
                **both["nutation"],
                "tolerance": entry.tolerance,
                "sigma": entry.sigma,
                "effect_deg": effects[index],
                **{name: both[name] for name in OUTPUTS[1:]},
            }
        )
    return rows


def case_json(study: Study, case: int, draws: dict[str, float]) -> dict[str, Any]:
    """One case (from 0): the true value of each input, in SI, and the outputs."""
    return {
        "case": case + 1,
        "inputs": {entry.name: entry.nominal + draws[entry.name] for entry in study.model.inputs.drawn},
        **{
            column: shown(column, float(value))
            for column, value in zip(OUTPUT_COLUMNS, study.outputs_of(draws), strict=True)
        },
        **_angles_of(study, draws),
    }


def _angles_of(study: Study, draws: dict[str, float]) -> dict[str, Any]:
    """Least and largest angle from the axis to the direction of each cone in one case; nothing without cones."""
    angles = study.aspects_of(draws)
    return {} if angles is None else angles_json(study.model.spacecraft, angles)


def angles_json(spacecraft: Spacecraft, angles: Array) -> dict[str, Any]:
    """Least and largest angle to the direction of each cone, of angles (m, 2) rad."""
    if not spacecraft.keep:
        return {}
    named = zip(spacecraft.keep, np.degrees(angles).tolist(), strict=True)
    return {"aspects": [{"name": keep.name, "least_deg": least, "largest_deg": far} for keep, (least, far) in named]}
