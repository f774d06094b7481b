"""Which tolerances have to shrink, and to what, so that a schedule meets its requirement in enough cases."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from nutdamp import compliance
from nutdamp.compliance import Part
from nutdamp.dispersion import SEED, study_of
from nutdamp.dispersion.inputs import Input
from nutdamp.dispersion.study import Results, run, threads_here
from nutdamp.planning import Plan
from nutdamp.tolerances import Dispersions, Tolerance

MOST = 4
"""Tolerances that may have to shrink together."""

HALVINGS = 6
"""Of what is between the size with which too few cases comply and the one with which enough do."""

CASES = 8_192
"""That each is tried in."""


@dataclass(frozen=True, slots=True)
class Tightening:
    """Inputs of the ``tolerances`` that are to be ``factor`` times as large; all others stay."""

    tolerances: tuple[str, ...]
    factor: float
    inputs: tuple[Input, ...]


def tightening(plan: Plan, probability: float) -> Tightening | None:
    """The fewest of the tolerances that count most, and how far they shrink, so that cases comply in that share.

    None where enough do, or do not with the `MOST` of them exactly known.
    """
    body, given = plan.spacecraft, plan.spacecraft.dispersions
    if given is None or not compliance.required(body):
        return None
    study = study_of(body, plan.pulses)

    def complying(names: Iterable[str], factor: float) -> bool:
        changed = replace(body, dispersions=scaled(given, names, factor))
        results = run(Results(study_of(changed, plan.pulses, seed=SEED), CASES), threads=threads_here())
        return (results.met_fraction or 0.0) >= probability

    shares: dict[str, float] = {}
    parts = [bound.part.value for bound in compliance.required(body) if bound.part is not Part.SPIN]
    for output in parts or ["spin_change"]:
        for entry, share in zip(study.first_order.inputs, study.first_order.shares(output).tolist(), strict=True):
            shares[entry.tolerance] = max(shares.get(entry.tolerance, 0.0), share)
    ranked = [name for name in sorted(shares, key=lambda one: -shares[one]) if hasattr(given, name)]
    for count in range(1, min(len(ranked), MOST) + 1):
        names = tuple(ranked[:count])
        if complying(names, 0.0):
            low, high = 0.0, 1.0
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if complying(names, middle) else (low, middle)
            first = {one.tolerance: one for one in reversed(study.model.inputs.drawn) if one.kind != "bias"}
            return Tightening(names, low, tuple(first[name] for name in names))
    return None


def scaled(given: Dispersions, names: Iterable[str], factor: float) -> Dispersions:
    """Dispersions of which those of some names are ``factor`` times as large; fixed offsets stay."""
    return replace(given, **{name: _scaled(getattr(given, name), factor) for name in names})


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, Tolerance):
        return value if value.kind == "bias" else replace(value, size=factor * value.size)
    if isinstance(value, Mapping):
        return {name: _scaled(one, factor) for name, one in value.items()}
    return None if value is None else tuple(_scaled(one, factor) for one in value)
