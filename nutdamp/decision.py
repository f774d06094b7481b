"""What is to be decided of a plan: each part of the requirement with its margin, the cases that comply, how it ends.

Data, no sentences: `nutdamp.presentation.decisions` has the words, which every screen, page and file takes from there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from nutdamp import aspect, compliance
from nutdamp.aspect import Aspect
from nutdamp.comparison import Comparison
from nutdamp.compliance import Bound, Held
from nutdamp.flight import Final, Flight
from nutdamp.outcome import left_by
from nutdamp.planning import Plan

if TYPE_CHECKING:  # few decisions rest on dispersed cases
    from nutdamp.screening import Cases


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

    ``unknown``: cases were to decide, but they could not be flown, or not all of them within the budget of work.
    ``seen``: the flight of the plan through its real widths as it has come by a certain time, None for that to the end
    of the last pulse.
    """

    plan: Plan
    cases: Cases | None = None
    unknown: bool = False
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
        if self.strays or (self.unknown and self.nominal):
            return False
        return self.nominal if not self.nominal or self.cases is None else self.cases.met

    @property
    def undispersed(self) -> bool:
        """Whether the file says how far its values may be off, and no such cases were flown."""
        return self.cases is None and not self.unknown and self.plan.spacecraft.dispersions is not None

    @property
    def final(self) -> Final:
        """Where spin axis and H end, and the spin."""
        return self.flight.final


def decide(compared: Comparison) -> Decision | None:
    """The decision on the recommended plan, by its dispersed cases where they were flown; None where there is none."""
    plan = compared.recommended
    if plan is None:
        return None
    cases, share = compared.cases(plan), compared.shares.get(plan)
    undecided = share is not None and share.met is None
    return Decision(plan, None if undecided else cases, undecided)
