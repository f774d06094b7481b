"""Which tolerances have to shrink, and to what, so that a schedule meets its requirement in enough cases."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from nutdamp import compliance
from nutdamp.compliance import Part
from nutdamp.dispersion import SAMPLES, SEED, study_of
from nutdamp.dispersion.binomial import cases_to_show
from nutdamp.dispersion.inputs import Input
from nutdamp.dispersion.study import CONFIDENCE, Results, Study, run, threads_here
from nutdamp.planning import Plan
from nutdamp.tolerances import Dispersions, Tolerance

MOST = 4
"""Tolerances that may have to shrink together."""

HALVINGS = 6
"""Of what is between the size with which too few cases comply and the one with which enough do."""

CASES = 8_192
"""That each is tried in."""

FRESH = 20_011
"""Seed of the first draws in which what was found is checked, which nothing was chosen by; each check has its own."""

CHECKS, SMALLER = 12, 0.96
"""Checks at most, and by what the tolerances shrink after one that fails."""

MOST_CASES = 100_000
"""Of one check."""


@dataclass(frozen=True, slots=True)
class Tightening:
    """Inputs of the ``tolerances`` that are to be ``factor`` times as large; all others stay.

    ``inputs``: one of each size that the file gives for them, and whether it gives it as a share of the nominal value.
    In ``cases`` new ones of ``seed`` so many ``complied``; the share that complies is ``least`` at least, by the exact
    interval of `CONFIDENCE`.
    """

    tolerances: tuple[str, ...]
    factor: float
    inputs: tuple[tuple[Input, bool], ...]
    cases: int
    seed: int
    complied: float
    least: float


def tightening(plan: Plan, probability: float) -> Tightening | None:
    """The fewest of the tolerances that count most, and how far they shrink, so that cases comply in that share.

    None where enough do, or do not with the `MOST` of them exactly known.
    """
    body, given = plan.spacecraft, plan.spacecraft.dispersions
    if given is None or not compliance.required(body):
        return None
    study = study_of(body, plan.pulses)

    def tried(names: Iterable[str], factor: float, cases: int = CASES, seed: int = SEED) -> Results:
        changed = replace(body, dispersions=scaled(given, names, factor))
        return run(Results(study_of(changed, plan.pulses, seed=seed), cases), threads=threads_here())

    def complying(names: Iterable[str], factor: float) -> bool:
        return (tried(names, factor).met_fraction or 0.0) >= probability

    ranked = _ranked(study, given)
    fresh = min(max(SAMPLES, 2 * cases_to_show(probability, CONFIDENCE)), MOST_CASES) if probability < 1.0 else SAMPLES
    for count in range(1, min(len(ranked), MOST) + 1):
        names = tuple(ranked[:count])
        if not complying(names, 0.0):
            continue
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if complying(names, middle) else (low, middle)
        # The tries all had the same draws, and the largest size that passes passes by luck too.
        for seed in range(FRESH, FRESH + CHECKS):
            found = tried(names, low, fresh, seed)
            if found.interval[0] >= probability:
                share = found.met_fraction or 0.0
                return Tightening(names, low, _stated(study, given, names), fresh, seed, share, found.interval[0])
            low *= SMALLER
    return None


def _ranked(study: Study, given: Dispersions) -> list[str]:
    """The tolerances by their share of what is required, the largest first."""
    shares: dict[str, float] = {}
    required = compliance.required(study.model.spacecraft)
    parts = [bound.part.value for bound in required if bound.part is not Part.SPIN]
    for output in parts or ["spin_change"]:
        for entry, share in zip(study.first_order.inputs, study.first_order.shares(output).tolist(), strict=True):
            shares[entry.tolerance] = max(shares.get(entry.tolerance, 0.0), share)
    return [name for name in sorted(shares, key=lambda one: -shares[one]) if hasattr(given, name)]


def _stated(study: Study, given: Dispersions, names: Iterable[str]) -> tuple[tuple[Input, bool], ...]:
    """An input of each size of the tolerances of some names, and whether that is relative."""
    found: dict[tuple[str, str, float], tuple[Input, bool]] = {}
    for name in names:
        for one in study.model.inputs.drawn:
            if one.tolerance == name and one.kind != "bias":
                found.setdefault((name, one.kind, one.size), (one, _relative(getattr(given, name), one)))
    return tuple(found.values())


def _relative(value: Any, entry: Input) -> bool:
    """Whether the size of an input is given as a share of its nominal value."""
    if isinstance(value, Tolerance):
        return value.relative
    if isinstance(value, Mapping):
        return any(one.relative for name, one in value.items() if name in entry.name.split())
    tolerance = value[int(entry.name.rpartition("_")[2]) - 1]
    return tolerance is not None and tolerance.relative


def scaled(given: Dispersions, names: Iterable[str], factor: float) -> Dispersions:
    """Dispersions of which those of some names are ``factor`` times as large; fixed offsets stay."""
    return replace(given, **{name: _scaled(getattr(given, name), factor) for name in names})


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, Tolerance):
        return value if value.kind == "bias" else replace(value, size=factor * value.size)
    if isinstance(value, Mapping):
        return {name: _scaled(one, factor) for name, one in value.items()}
    return None if value is None else tuple(_scaled(one, factor) for one in value)
