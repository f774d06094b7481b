"""The comparison of schemes as CSV: one row a scheme, with cost, residuals, and final motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.files.tabular import csv_text, number, truth
from nutdamp.planning.decision import Comparison, Decision
from nutdamp.planning.plan import Plan
from nutdamp.views.plan_json import compared_json, residual_json

WORDS = ("scheme", "feasible", "recommended", "meets_requirement", "why")
"""Columns of text."""


def schemes_array(compared: Comparison, decided: Decision | None) -> NDArray[np.void]:
    """One row a scheme; residuals are those of the flight through real widths. Unknown values are NaN or empty.

    ``decided``: decision on the recommended plan; ``met_fraction``: share of cases that comply, where all have flown.
    """
    chosen, shares = None if decided is None else decided.plan, compared.shares
    rows = []
    for plan in compared.plans:
        share = shares[plan].exact if plan in shares else None
        rows.append(_row(plan, compared_json(compared, plan), plan is chosen, share))
    names = list(rows[0]) if rows else list(WORDS)
    longest = {name: max(1, *(len(row[name]) for row in rows)) if rows else 1 for name in WORDS}
    kinds = [(name, f"U{longest[name]}" if name in WORDS else "i8" if name == "pulses" else "f8") for name in names]
    values = [tuple(math.nan if row[name] is None else row[name] for name in names) for row in rows]
    return np.array(values, dtype=kinds)


def _row(plan: Plan, data: dict[str, Any], recommended: bool, share: float | None) -> dict[str, Any]:
    speed = plan.delta_v
    final, left = data["final"], data["flown"] if plan.feasible else residual_json(None)
    around, off = ("tilt_deg", "azimuth_deg") if plan.spacecraft.attitude is None else _CELESTIAL
    angles = {
        f"{what}_{name}": None if final is None else final[what][name]
        for what in ("axis", "momentum")
        for name in (around, off)
    }
    return {
        "scheme": plan.scheme,
        "feasible": truth(plan.feasible),
        "recommended": truth(recommended),
        "meets_requirement": truth(data["meets_requirement"]),
        "met_fraction": share,
        "pulses": len(plan.pulses),
        **{key: data[key] for key in ("end_s", "total_impulse_Nms", "least_impulse_Nms", "propellant_kg")},
        **left,
        **angles,
        "spin_rad_s": None if final is None else final["spin_rad_s"],
        "spin_change_rad_s": data["spin_change_rad_s"],
        "delta_v_m_s": None if speed is None else math.hypot(*speed),
        "why": data["why"] or "",
    }


_CELESTIAL = ("right_ascension_deg", "declination_deg")


def schemes_csv(compared: Comparison, decided: Decision | None) -> str:
    """The rows of `schemes_array` as CSV; unknown values are empty."""
    table = schemes_array(compared, decided)
    texts = ([number(cell) if isinstance(cell, float) else str(cell) for cell in row] for row in table.tolist())
    return csv_text(table.dtype.names or WORDS, texts)
