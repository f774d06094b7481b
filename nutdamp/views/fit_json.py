"""Result of ``fit --json``."""

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


def fit_json(fit: Fit, carried: Carried, ahead: Outlook | None = None, warnings: Sequence[str] = ()) -> dict[str, Any]:
    """Estimates with sigmas, values of the file, signals, covariance of the inputs of dispersions; prospects.

    ``warnings`` of reading the record go into the notes, before the doubts about the estimates.
    """
    model = fit.model
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
                    "outliers": int(((model.signal == index) & ~fit.used).sum()),
                    "noise_SI": float(fit.noise[index]),
                    "white": fit.white(index),
                }
                for index, name in enumerate(model.signals)
            ],
        },
        "time_s": carried.time,
        "estimates": [_estimate(estimate) for estimate in estimates(fit, carried.time)],
        "kept": list(fit.kept),
        "information": fit.information.tolist(),
        "parameters": [parameter.name for parameter in model.parameters],
        "values_SI": fit.values.tolist(),
        "covariance_SI": fit.region.tolist(),
        "dispersed": {
            "inputs": list(carried.names),
            "values_SI": carried.values.tolist(),
            "sigmas_SI": carried.sigmas.tolist(),
            "correlation": carried.correlation.tolist(),
        },
        "notes": [*warnings, *doubts(fit), *untold(model.record), *notes(fit, carried)],
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
                "coast_s": prospect.length,
                "probe": prospect.probe or None,
                "on_time_s": prospect.on_time,
                "sigma_C_over_A": prospect.ratio,
                "sigma_thrust": prospect.thrust,
                "nutation_deg": math.degrees(prospect.nutation),
                "met_fraction": prospect.met,
                "propellant_kg": prospect.propellant,
            }
            for prospect in (*ahead.coasts, *ahead.probes)
        ],
    }


def _estimate(estimate: Estimate) -> dict[str, Any]:
    file = None if estimate.file is None else estimate.file * estimate.factor
    prior = None if estimate.prior is None or math.isinf(estimate.prior) else estimate.prior * estimate.factor
    return {
        "quantity": estimate.key,
        "unit": estimate.unit,
        "value": estimate.value * estimate.factor,
        "sigma": estimate.sigma * estimate.factor,
        "file": file,
        "file_sigma": prior,
        "change_sigmas": estimate.change,
        "from": estimate.source,
    }
