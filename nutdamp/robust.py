"""Robust planning: the plan that leaves least nutation for nearly all dispersed truths, instead of for the estimate.

Candidates are the schedules of the schemes and variants of them: later starts, channels left unused, other alignments.
All of them fly the same draws, so that what is compared is the plans and not their luck.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from nutdamp import planning
from nutdamp.dispersion import study_of
from nutdamp.dispersion.study import PROBABILITY, Results, run, threads_here
from nutdamp.errors import Infeasible
from nutdamp.planning import Comparison, Plan
from nutdamp.schedule import Schedule
from nutdamp.schemes import Options
from nutdamp.spacecraft import Spacecraft

SAMPLES = 20_000
"""Dispersed truths that every candidate flies in closed form."""

SAMPLES_FLOWN = 6_000
"""The same where the closed form leaves something out, so that real widths are flown, which takes longer."""

SEED = 1

LATER = (0.25, 0.5, 0.75, 1.0, 2.0)
"""Later starts that are tried, in nutation periods as seen in the body (inertial ones for a sphere)."""

AS_GOOD = 1.05
"""Candidates within this factor of the least nutation count as equally good: so far apart may be their luck."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A plan and how it fares with dispersed truths.

    ``variant`` says how it differs from what its scheme plans; ``nutation`` and ``momentum_shift`` rad are not exceeded
    with the probability asked; ``met`` is the fraction of truths that keep the requirement, None without one.
    """

    plan: Plan
    variant: str
    nutation: float
    momentum_shift: float
    met: float | None

    @property
    def cost(self) -> float:
        """Propellant in kg, impulse in N m s where that is not known."""
        pulses = self.plan.pulses
        return pulses.total_impulse if pulses.propellant is None else pulses.propellant


class Cost(NamedTuple):
    """What one plan takes more than another: propellant kg (None: unknown), impulse N m s, time s, nutation rad."""

    propellant: float | None
    impulse: float
    end: float
    nutation: float


@dataclass(frozen=True, eq=False)
class RobustComparison:
    """Candidates from the best down; ``usual`` is what `planning.recommend` takes, ``chosen`` the robust plan.

    Each candidate flew ``samples`` truths of ``seed``, in closed form or, ``flown``, through real widths.
    """

    comparison: Comparison
    candidates: tuple[Candidate, ...]
    usual: Candidate | None
    chosen: Candidate | None
    reason: str
    probability: float
    samples: int
    seed: int
    flown: bool

    @property
    def cost(self) -> Cost | None:
        """What the robust plan takes more than the usual one; None where there is only one of them."""
        if self.chosen is None or self.usual is None:
            return None
        more, less = self.chosen.plan.pulses, self.usual.plan.pulses
        known = more.propellant is not None and less.propellant is not None
        return Cost(
            (more.propellant or 0.0) - (less.propellant or 0.0) if known else None,
            more.total_impulse - less.total_impulse,
            more.end - less.end,
            self.chosen.nutation - self.usual.nutation,
        )

    @property
    def meets_requirement(self) -> bool | None:
        """Whether enough dispersed truths keep the requirement with the robust plan; None without requirement."""
        if self.chosen is None or self.chosen.met is None:
            return None
        return self.chosen.met >= self.probability


def variants(comparison: Comparison, options: Options | None = None) -> list[tuple[str, Plan]]:
    """Feasible plans, with what sets each apart from the one that its scheme makes; no schedule comes twice."""
    body = comparison.spacecraft
    found: dict[object, tuple[str, Plan]] = {}
    for base in comparison.plans:
        for variant, plan in (("as planned", base), *_others(body, base, options or Options())):
            # Planned for other limits or channels, but always flown by this spacecraft.
            if plan.feasible and not planning.broken_limits(body, plan.pulses):
                found.setdefault(
                    _kind(plan), (variant, plan if plan.spacecraft is body else replace(plan, spacecraft=body))
                )
    return list(found.values())


def compare(
    comparison: Comparison, plans: Sequence[tuple[str, Plan]], watch: Callable[[int], None] = lambda _: None
) -> RobustComparison:
    """Let dispersed truths fly each of the ``plans``, as `variants` gives them, and recommend one.

    ``watch`` is told how many are done. Raises BadRequest for a spacecraft without dispersions.
    """
    spacecraft = comparison.spacecraft
    asked = spacecraft.requirement
    probability = PROBABILITY if asked is None or asked.probability is None else asked.probability
    flown = bool(study_of(spacecraft, Schedule()).remarks)
    samples = SAMPLES_FLOWN if flown else SAMPLES
    candidates: list[Candidate] = []
    for number, (variant, plan) in enumerate(plans):
        watch(number)
        with suppress(Infeasible):  # truths that cannot be flown, such as those that take too long
            candidates.append(_dispersed(plan, variant, probability, samples, flown=flown))
    candidates.sort(key=lambda one: (-_tier(one, probability), one.nutation, one.plan.pulses.end))
    nominal = comparison.recommended
    usual = next((one for one in candidates if nominal is not None and _kind(one.plan) == _kind(nominal)), None)
    chosen, reason = _choose(candidates, probability)
    return RobustComparison(comparison, tuple(candidates), usual, chosen, reason, probability, samples, SEED, flown)


def _kind(plan: Plan) -> object:
    """What two plans share whose pulses are the same but for rounding."""
    return tuple(
        (pulse.channel, round(pulse.t, 6), round(pulse.on_time, 6), *np.round(pulse.impulse, 6).tolist())
        for pulse in plan.pulses
    )


def _others(body: Spacecraft, base: Plan, options: Options) -> Iterator[tuple[str, Plan]]:
    """Variants of a scheme's plan."""
    for plan in planning.alternatives(body, base.scheme, options):
        yield " then ".join(dict.fromkeys(pulse.channel for pulse in plan.pulses)), plan
    period = body.body_period if math.isfinite(body.body_period) else body.inertial_period
    for periods in LATER:
        earliest = body.limits.earliest + periods * period
        if earliest < body.horizon:
            limits = replace(body.limits, earliest=earliest)
            yield f"from {earliest:.4g} s on", planning.plan(replace(body, limits=limits), base.scheme, options)
    for name in dict.fromkeys(pulse.channel for pulse in base.pulses):
        left = tuple(channel for channel in body.channels if channel.name != name)
        if left and len(left) < len(body.channels):
            yield f"without {name}", planning.plan(replace(body, channels=left), base.scheme, options)


def _dispersed(plan: Plan, variant: str, probability: float, samples: int, *, flown: bool) -> Candidate:
    """How a plan fares with dispersed truths."""
    study = study_of(plan.spacecraft, plan.pulses, seed=SEED, flown=flown)
    results = run(Results(study, samples), threads=threads_here())
    ends = []
    for output in ("nutation", "momentum_shift"):
        distribution = results.distribution(output)
        assert distribution is not None
        ends.append(float(distribution.quantiles(np.array([probability]))[0]))
    return Candidate(plan, variant, ends[0], ends[1], results.met_fraction)


def _tier(candidate: Candidate, probability: float) -> int:
    """2: keeps the requirement with the probability asked; 1: at least as the estimate has it; 0: does not."""
    if candidate.met is None or candidate.met >= probability:
        return 2
    return int(candidate.plan.meets_requirement is True)


def _choose(candidates: Sequence[Candidate], probability: float) -> tuple[Candidate | None, str]:
    """The candidate to fly, and why; ``candidates`` from the best down."""
    if not candidates:
        return None, "no scheme is feasible"
    best = candidates[0]
    tier = _tier(best, probability)
    those = [one for one in candidates if _tier(one, probability) == tier]
    close = [one for one in those if one.nutation <= AS_GOOD * best.nutation]
    known = all(one.plan.pulses.propellant is not None for one in close)

    def cost(one: Candidate) -> float:
        return one.cost if known else one.plan.pulses.total_impulse

    cheapest = min(map(cost, close))
    chosen = min((one for one in close if cost(one) <= cheapest * (1.0 + 1e-6)), key=lambda one: one.plan.pulses.end)
    level = f"{100 * probability:.6g} %"
    which = f"of {len(those)} plans" if len(those) > 1 else "by the only plan"
    if best.met is not None:
        keep = "keep" if len(those) > 1 else "keeps"
        which += {
            2: f" that {keep} the requirement with {level}",
            1: f" that {keep} the requirement for the estimate, none with {level}",
            0: "; none keeps the requirement",
        }[tier]
    if len(close) == 1:
        return chosen, f"least nutation within {level} {which}"
    what = "propellant" if known else "impulse"
    return chosen, f"least {what} of {len(close)} that leave about the least nutation within {level}, {which}"
