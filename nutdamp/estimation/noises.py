"""The noise of each signal, from what a fit leaves of its samples."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from nutdamp.estimation.model import Model, Vector
from nutdamp.estimation.record import SUN_PULSE, quantisation

NORMAL_MAD = 1.4826
"""Standard deviation of normal numbers over their median magnitude."""

ROUNDING = 1e-7
"""Noise that a signal has at least, as a share of its largest value: no telemetry has more digits."""


def least(model: Model) -> Vector:
    """Noise that each signal has at least: that of its steps, and rounding."""
    found = []
    for index, name in enumerate(model.signals):
        values = model.measured[model.signal == index]
        step = model.record.sun_step if name == SUN_PULSE else 0.0 if name == "axis" else quantisation(values)
        size = {"axis": 1.0, SUN_PULSE: 1.0 / abs(model.spacecraft.spin)}.get(name, float(np.abs(values).max()))
        found.append(max(step / math.sqrt(12.0), ROUNDING * size))
    return np.array(found)


def robust(model: Model, left: Vector) -> Vector:
    """One sigma of each signal by its median magnitude, which outliers hardly change."""
    return np.array(
        [NORMAL_MAD * float(np.median(np.abs(left[model.signal == index]))) for index in range(len(model.signals))]
    )


def plain(model: Model, left: Vector, used: NDArray[np.bool_], leverage: Vector | None = None) -> Vector:
    """One sigma of each signal by its samples that are no outliers; ``leverage`` is what the fit takes of each.

    Of n samples with leverages that add up to p the mean of the variance is Σr²/(n - p - 2): that of its posterior,
    so that regions made with it hold as often as they should.
    """
    found, signal = [], model.signal[used]
    for index in range(len(model.signals)):
        rows = signal == index
        spent = 0.0 if leverage is None else float(leverage[rows].sum()) + 2.0
        total = float(left[used][rows] @ left[used][rows])
        found.append(math.sqrt(total / max(float(rows.sum()) - spent, 1.0)))
    return np.array(found)
