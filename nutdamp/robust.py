"""Robust planning: the plan that leaves least nutation for nearly all dispersed truths, instead of for the estimate.

Candidates are the schedules of the schemes and variants of them: later starts, channels left unused, other alignments.
All of them fly the same draws, so that what is compared is the plans and not their luck.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from nutdamp import planning
from nutdamp.dispersion import study_of
from nutdamp.dispersion.outputs import aim_output
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

    ``variant`` says how it differs from what its scheme plans; ``nutation`` and ``off`` rad (how far H ends from
    where it shall) are not exceeded with the probability asked; ``met`` is the fraction of truths that keep the
    requirement, None without one.
    """

    plan: Plan
    variant: str
    nutation: float
    off: float
    met: float | None

    @property
    def left(self) -> float:
        """What it leaves, rad: nutation, or the distance from a target axis where that is more."""
        return self.nutation if self.plan.spacecraft.goal.axis is None else max(self.nutation, self.off)

    @property
    def nominal(self) -> float | None:
        """The same for the estimate, rad."""
        return None if self.plan.flown is None else planning.missed(self.plan, self.plan.flown)

    @property
    def cost(self) -> float:
        """Propellant in kg, impulse in N m s where that is not known."""
        return self.plan.pulses.cost


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
            self.chosen.left - self.usual.left,
        )

    @property
    def meets_requirement(self) -> bool | None:
        """Whether enough dispersed truths keep the requirement with the robust plan; None without requirement."""
        if self.chosen is None or self.chosen.met is None:
            return None
        return self.chosen.met >= self.probability


Attempt = Callable[[], Iterable[tuple[str, Plan]]]
"""Makes plans when it is called, each with what sets it apart from the one that its scheme makes."""


def attempts(comparison: Comparison, options: Options | None = None) -> list[Attempt]:
    """What `compare` is to try: the plans compared, and variants of each."""
    body, options = comparison.spacecraft, options or Options()
    found: list[Attempt] = []
    for base in comparison.plans:
        found.append(partial(list, [("as planned", base)]))
        found.append(partial(_alignments, body, base.scheme, options))
        found += [partial(_planned, *other, base.scheme, options) for other in _others(body, base)]
    return found


def compare(
    comparison: Comparison, trials: Sequence[Attempt], watch: Callable[[int], None] = lambda _: None
) -> RobustComparison:
    """Make the plans of the ``trials``, let dispersed truths fly each, and recommend one; no schedule comes twice.

    ``watch`` is told how many trials are done. Raises BadRequest for a spacecraft without dispersions.
    """
    body = comparison.spacecraft
    asked = body.requirement
    probability = PROBABILITY if asked is None or asked.probability is None else asked.probability
    flown = bool(study_of(body, Schedule()).remarks)
    samples = SAMPLES_FLOWN if flown else SAMPLES
    found: dict[object, Candidate] = {}
    for number, trial in enumerate(trials):
        watch(number)
        for variant, plan in trial():
            kind = _kind(plan)
            # Planned for other limits or channels, perhaps, but always flown by this spacecraft.
            if not plan.feasible or kind in found or planning.broken_limits(body, plan.pulses):
                continue
            own = plan if plan.spacecraft is body else replace(plan, spacecraft=body)
            with suppress(Infeasible):  # truths that cannot be flown, such as those that take too long
                found[kind] = _dispersed(own, variant, probability, samples, flown=flown)
    candidates = sorted(found.values(), key=lambda one: (-_tier(one, probability), one.left, one.plan.pulses.end))
    usual = None if comparison.recommended is None else found.get(_kind(comparison.recommended))
    chosen, reason = _choose(candidates, probability)
    return RobustComparison(comparison, tuple(candidates), usual, chosen, reason, probability, samples, SEED, flown)


def _kind(plan: Plan) -> object:
    """What two plans share whose pulses are the same but for rounding."""
    return tuple(
        (pulse.channel, round(pulse.t, 6), round(pulse.on_time, 6), *np.round(pulse.impulse, 6).tolist())
        for pulse in plan.pulses
    )


def _alignments(body: Spacecraft, scheme: str, options: Options) -> Iterator[tuple[str, Plan]]:
    """The plans by other alignments that a scheme weighs, named by their channels."""
    for plan in planning.alternatives(body, scheme, options):
        yield " then ".join(dict.fromkeys(pulse.channel for pulse in plan.pulses)), plan


def _others(body: Spacecraft, base: Plan) -> Iterator[tuple[str, Spacecraft]]:
    """Spacecraft for which the scheme plans in another way: later, or without one of the channels that it fires."""
    period = body.body_period if math.isfinite(body.body_period) else body.inertial_period
    for periods in LATER:
        earliest = body.limits.earliest + periods * period
        if earliest < body.horizon:
            yield f"from {earliest:.4g} s on", replace(body, limits=replace(body.limits, earliest=earliest))
    for name in dict.fromkeys(pulse.channel for pulse in base.pulses):
        left = tuple(channel for channel in body.channels if channel.name != name)
        if left and len(left) < len(body.channels):
            yield f"without {name}", replace(body, channels=left)


def _planned(variant: str, body: Spacecraft, scheme: str, options: Options) -> list[tuple[str, Plan]]:
    return [(variant, planning.plan(body, scheme, options))]


def _dispersed(plan: Plan, variant: str, probability: float, samples: int, *, flown: bool) -> Candidate:
    """How a plan fares with dispersed truths."""
    study = study_of(plan.spacecraft, plan.pulses, seed=SEED, flown=flown)
    results = run(Results(study, samples), threads=threads_here())
    ends = []
    aim, _ = aim_output(plan.spacecraft)
    for output in ("nutation", aim):
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
    close = [one for one in those if one.left <= AS_GOOD * best.left]
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
