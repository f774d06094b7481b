"""What is to be decided of a plan: each part of the requirement with its margin, the cases that comply, how it ends.

Data, no sentences: `nutdamp.presentation.decisions` has the words, which every screen, page and file takes from there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from nutdamp import aspect, compliance
from nutdamp.aspect import Aspect
from nutdamp.comparison import Comparison
from nutdamp.compliance import Bound, Held, Part
from nutdamp.flight import Final, Flight
from nutdamp.outcome import left_by
from nutdamp.planning import Plan

if TYPE_CHECKING:  # few decisions rest on dispersed cases
    from nutdamp.dispersion.study import Results


@dataclass(frozen=True, slots=True)
class Cases:
    """How one schedule fares in ``samples`` dispersed cases of ``seed``.

    ``complying``: the share that keeps every part of the requirement, None where nothing is required;
    ``probability``: the share that must. ``levels``: what that share of the cases does not exceed, rad, by part; the
    spin error has none.
    """

    samples: int
    seed: int
    complying: float | None
    probability: float
    levels: Mapping[Part, float]

    @property
    def met(self) -> bool | None:
        """Whether as many cases comply as must; None where nothing is required."""
        return None if self.complying is None else self.complying >= self.probability


def cases_of(results: Results) -> Cases:
    """What a study says of its schedule."""
    probability, levels = results.probability, {}
    for part in (Part.NUTATION, compliance.aim(results.study.model.spacecraft)):
        distribution = results.distribution(part.value)
        assert distribution is not None
        levels[part] = float(distribution.quantiles(np.array([probability]))[0])
    return Cases(results.done, results.study.seed, results.met_fraction, probability, levels)


@dataclass(frozen=True, slots=True)
class Line:
    """A part of the requirement: its bound, and what is left with ``nominal`` values (rad, rad/s).

    ``dispersed``: what the share of cases required does not exceed, None where that is not known. ``met``: whether it
    is kept, None where the cases do not say.
    """

    bound: Bound
    nominal: float
    dispersed: float | None
    met: bool | None

    @property
    def margin(self) -> float:
        """By how much less is left than may be, rad (rad/s): of the dispersed value, where it is known."""
        return self.bound.most - (self.nominal if self.dispersed is None else self.dispersed)


@dataclass(frozen=True, eq=False)
class Decision:
    """The plan to decide on, the parts of its requirement, and how it fares in dispersed ``cases``, None if not flown.

    ``shares``: of every scheme that was dispersed, by name, the share of cases that comply. ``seen``: the flight of the
    plan through its real widths as it has come by a certain time, None for that to the end of the last pulse.
    """

    plan: Plan
    cases: Cases | None = None
    shares: Mapping[str, float] = field(default_factory=dict)
    seen: Flight | None = None

    @property
    def flight(self) -> Flight:
        """What is judged."""
        return self.plan.flight if self.seen is None else self.seen

    @property
    def lines(self) -> tuple[Line, ...]:
        """The parts that are required, and those for which it is said what counts as damped or reached."""
        return tuple(self._line(one.bound, one.left) for one in self._held)

    @property
    def _held(self) -> tuple[Held, ...]:
        return self.plan.held if self.seen is None else compliance.held(self.plan.spacecraft, left_by(self.seen))

    @cached_property
    def aspects(self) -> tuple[Aspect, ...]:
        """How near the spin axis comes to each direction that is watched, with nominal values."""
        return self.plan.aspects if self.seen is None else aspect.aspects(self.seen, self.seen.until)

    @property
    def strays(self) -> tuple[Aspect, ...]:
        """Those of the `aspects` that break a cone."""
        return tuple(one for one in self.aspects if not one.kept)

    @property
    def damped(self) -> bool:
        """Whether all of `lines` is kept with nominal values, what is not required as well."""
        return all(one.met for one in self._held)

    @property
    def nominal(self) -> bool | None:
        """Whether what is required at the end is met with nominal values; None where nothing is."""
        required = [one.met for one in self._held if one.bound.required]
        return all(required) if required else None

    def _line(self, bound: Bound, nominal: float) -> Line:
        kept, cases = nominal <= bound.most, self.cases
        if cases is None:
            return Line(bound, nominal, None, kept)
        dispersed = cases.levels.get(bound.part)
        if not bound.required or cases.met is None:
            return Line(bound, nominal, dispersed, kept if dispersed is None else kept and dispersed <= bound.most)
        alone = len(compliance.required(self.plan.spacecraft)) == 1 and not self.plan.spacecraft.keep
        if cases.met or alone:  # the count of cases and the percentile, which lies between two of them, say the same
            return Line(bound, nominal, dispersed, kept and cases.met)
        return Line(bound, nominal, dispersed, None if dispersed is None else kept and dispersed <= bound.most)

    @property
    def met(self) -> bool | None:
        """Whether the requirement is met, with nominal values and in enough cases; None where nothing is required.

        It is not where the spin axis breaks a cone on the way.
        """
        if self.strays:
            return False
        return self.nominal if not self.nominal or self.cases is None else self.cases.met

    @property
    def undispersed(self) -> bool:
        """Whether the file says how far its values may be off, and no such cases were flown."""
        return self.cases is None and self.plan.spacecraft.dispersions is not None

    @property
    def better(self) -> tuple[tuple[str, float], ...]:
        """Other schemes with which more cases comply, and the share, the most first."""
        if self.cases is None or self.cases.complying is None:
            return ()
        own = self.cases.complying
        found = [(name, share) for name, share in self.shares.items() if name != self.plan.scheme and share > own]
        return tuple(sorted(found, key=lambda one: -one[1]))

    @property
    def final(self) -> Final:
        """Where spin axis and H end, and the spin."""
        return self.flight.final


def decide(compared: Comparison, cases: Mapping[str, Cases] | None = None) -> Decision | None:
    """The decision on the recommended plan, with the ``cases`` flown by scheme; None where no scheme is feasible."""
    plan, flown = compared.recommended, cases or {}
    if plan is None:
        return None
    shares = {name: one.complying for name, one in flown.items() if one.complying is not None}
    return Decision(plan, flown.get(plan.scheme), shares)
