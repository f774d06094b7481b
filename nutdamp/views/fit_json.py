"""What ``fit --json`` says."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from nutdamp.estimation.fit import Fit
from nutdamp.estimation.forecast import Outlook
from nutdamp.estimation.parameters import untold
from nutdamp.estimation.results import Carried, Estimate, doubts, estimates
from nutdamp.files.editing import notes
from nutdamp.views.plan_json import heading


def fit_json(
    found: Fit, carried: Carried, ahead: Outlook | None = None, warnings: Sequence[str] = ()
) -> dict[str, Any]:
    """Estimates with sigmas, what the file says, the signals, the covariance of what dispersions draw; prospects.

    ``warnings`` of reading the record go into the notes, before all that makes the estimates doubtful.
    """
    model = found.model
    return {
        **heading(model.spacecraft),
        "record": {
            "start_s": model.record.start,
            "end_s": model.record.end,
            "pulses": len(model.record.fired),
            "signals": [
                {
                    "signal": name,
                    "samples": int((model.signal == index).sum()),
                    "outliers": int(((model.signal == index) & ~found.used).sum()),
                    "noise_SI": float(found.noise[index]),
                    "white": found.white(index),
                }
                for index, name in enumerate(model.signals)
            ],
        },
        "time_s": carried.time,
        "estimates": [_estimate(one) for one in estimates(found, carried.time)],
        "kept": list(found.kept),
        "information": found.information.tolist(),
        "parameters": [one.name for one in model.parameters],
        "values_SI": found.values.tolist(),
        "covariance_SI": found.region.tolist(),
        "dispersed": {
            "inputs": list(carried.names),
            "values_SI": carried.values.tolist(),
            "sigmas_SI": carried.sigmas.tolist(),
            "correlation": carried.correlation.tolist(),
        },
        "notes": [*warnings, *doubts(found), *untold(model.record), *notes(found, carried)],
        "next": None if ahead is None else _outlook(ahead),
    }


def _outlook(ahead: Outlook) -> dict[str, Any]:
    longer, probe = ahead.longer, ahead.probe
    return {
        "scheme": ahead.scheme,
        "propellant_kg": ahead.propellant,
        "probability": ahead.probability,
        "longer_coast_s": None if longer is None else longer.length,
        "probe": None if probe is None else probe.probe,
        "prospects": [
            {
                "coast_s": one.length,
                "probe": one.probe or None,
                "on_time_s": one.on_time,
                "sigma_C_over_A": one.ratio,
                "sigma_thrust": one.thrust,
                "nutation_deg": math.degrees(one.nutation),
                "met_fraction": one.met,
                "propellant_kg": one.propellant,
            }
            for one in (*ahead.coasts, *ahead.probes)
        ],
    }


def _estimate(one: Estimate) -> dict[str, Any]:
    file = None if one.file is None else one.file * one.factor
    prior = None if one.prior is None or math.isinf(one.prior) else one.prior * one.factor
    return {
        "quantity": one.key,
        "unit": one.unit,
        "value": one.value * one.factor,
        "sigma": one.sigma * one.factor,
        "file": file,
        "file_sigma": prior,
        "change_sigmas": one.change,
        "from": one.source,
    }
