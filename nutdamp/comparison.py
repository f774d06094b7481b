"""Several plans for one spacecraft, and which of them is recommended."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

from nutdamp import compliance, schemes, views, work
from nutdamp.errors import NutdampError
from nutdamp.planning import Plan, plan, reaches_spin, spinning
from nutdamp.recommendation import Recommendation, Share, Standing, recommend
from nutdamp.spacecraft import Spacecraft

if TYPE_CHECKING:  # few spacecraft have dispersions
    from nutdamp.dispersion.study import Results
    from nutdamp.screening import Candidate, Cases

BUG = "internal error, please report"
"""Why there is no plan where a scheme raised what it should not; the name of the exception follows."""


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(views.Data, views.Tabled):
    """Several plans for one spacecraft, and which of them is recommended on what ground.

    ``comparison["two-pulse"]`` is one of them, iterating gives all. ``flown``: the feasible ones in dispersed cases;
    None where these were not to be flown. ``named``: their schemes were; ``timed``: pulses may be timed one by one
    though the spacecraft takes commands.
    """

    spacecraft: Spacecraft
    plans: tuple[Plan, ...]
    flown: Mapping[Plan, Candidate] | None = field(default=None, repr=False)
    named: bool = False
    timed: bool = False

    def __len__(self) -> int:
        return len(self.plans)

    def __iter__(self) -> Iterator[Plan]:
        return iter(self.plans)

    def __getitem__(self, scheme: str) -> Plan:
        for one in self.plans:
            if one.scheme == scheme:
                return one
        raise KeyError(scheme)

    @property
    def reason(self) -> str:
        """Why the recommended one."""
        return views.reason(self)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the recommended plan does not reach, and what hinders it."""
        return views.sentences(self)

    @cached_property
    def recommendation(self) -> Recommendation[Plan]:
        """Which plan to fly, and what decided."""
        return recommend(self.eligible, self.shares)

    @property
    def only_commanded(self) -> bool:
        """Whether only plans that can be commanded may be recommended.

        Others may, where pulses may be ``timed``, or schemes were ``named`` and none of their plans can be commanded.
        """
        return not self.timed and (not self.named or any(one.feasible and one.commandable for one in self.plans))

    @property
    def eligible(self) -> tuple[Plan, ...]:
        """The feasible plans that may be recommended."""
        return tuple(one for one in self.plans if one.feasible and (one.commandable or not self.only_commanded))

    @property
    def restricted(self) -> bool:
        """Whether feasible plans were left out because they cannot be commanded."""
        return len(self.eligible) < sum(one.feasible for one in self.plans)

    @property
    def needless(self) -> bool:
        """Whether no pulse has to be fired: the recommended plan has none, or those named are not needed."""
        chosen = self.recommended
        return compliance.unaided(self.spacecraft) and (self.named or chosen is None or not len(chosen.pulses))

    @cached_property
    def shares(self) -> Mapping[Plan, Share]:
        """The share of dispersed cases that comply with each feasible plan; nothing where they do not decide."""
        if self.flown is None:
            return {}
        from nutdamp.screening import shares_of

        return shares_of([one for one in self.plans if one.feasible], self.flown)

    def cases(self, plan: Plan) -> Cases | None:
        """How a plan fares in dispersed cases; None where they were not flown."""
        candidate = None if self.flown is None else self.flown.get(plan)
        return None if candidate is None else candidate.cases

    def results(self, plan: Plan) -> Results | None:
        """All its dispersed cases; None where they have not flown."""
        candidate = None if self.flown is None else self.flown.get(plan)
        return None if candidate is None or not candidate.cases.decided else candidate.results

    def meets(self, plan: Plan) -> bool | None:
        """Whether a plan meets the requirement, in enough dispersed cases too where they decide."""
        met = plan.meets_requirement
        return bool(self.shares[plan].met) if met and plan in self.shares else met

    @property
    def recommended(self) -> Plan | None:
        """The plan to fly; None where no scheme is feasible."""
        return self.recommendation.plan

    @cached_property
    def with_disturbances(self) -> Plan | None:
        """What would be recommended of the same schemes if they planned with the disturbances, where they did not.

        None where that is the case already. A scheme that is slow is planned only where no other one complies.
        """
        chosen, body = self.recommended, self.spacecraft
        if chosen is None or not body.disturbances or chosen.options.with_disturbances:
            return None
        others: tuple[Plan, ...] = ()
        try:
            for slow in (False, True):
                for one in self.plans:
                    if one.scheme in schemes.SCHEMES and schemes.SCHEMES[one.scheme].slow == slow:
                        aware = replace(one.options, with_disturbances=True)
                        others = (*others, attempt(body, one.scheme, aware))
                best = replace(self, plans=others, flown=None).recommended
                if best is not None and best.standing is Standing.COMPLIES:
                    break
        except NutdampError:
            return None
        return best

    @property
    def failed(self) -> tuple[Plan, ...]:
        """Those whose scheme has a bug."""
        return tuple(one for one in self.plans if one.failure is not None)


def usual(spacecraft: Spacecraft) -> tuple[str, ...]:
    """The schemes to compare where none is named: the classic ones and optimal, with a target those that can point.

    Those that can set the spin are among them where it has to change, and `none` where no pulse may be needed.
    """
    names = schemes.COMPARED if spacecraft.goal.axis is None else schemes.POINTING
    if compliance.unaided(spacecraft):
        names = ("none", *names)
    if spacecraft.commands is not None:  # before those that may take all the work
        slow = [name for name in names if schemes.SCHEMES[name].slow]
        names = (*(name for name in names if name not in slow), *schemes.COMMANDED, *slow)
    return names if reaches_spin(spacecraft) else tuple(dict.fromkeys((*names, *spinning(spacecraft))))


def compare(
    spacecraft: Spacecraft,
    names: Sequence[str] = (),
    options: schemes.Choice = None,
    *,
    samples: int | None = None,
    timed: bool = False,
) -> Comparison:
    """Plan the schemes named, else the `usual` ones, and recommend one; one that has a bug takes no other down.

    With dispersions each plan flies ``samples`` cases (default `dispersion.SAMPLES`, 0: none), as many of them as it
    takes to know whether enough comply; where nothing is required, and no number is given, none. ``timed``: pulses may
    be timed one by one though the file has commands. Raises NutdampError, such as BadRequest, and KeyError for a name
    not in `schemes.NAMES`.
    """
    unknown = set(names) - set(schemes.NAMES)
    if unknown:
        raise KeyError(*sorted(unknown))
    with work.budget("the comparison", work.COMMAND):
        plans = tuple(attempt(spacecraft, name, options) for name in names or usual(spacecraft))
    return compare_plans(plans, named=bool(names), samples=samples, timed=timed)


def compare_plans(
    plans: Sequence[Plan], *, named: bool = True, samples: int | None = None, timed: bool = False
) -> Comparison:
    """The comparison of plans of one spacecraft, as the schedule of a file, in the dispersed cases of `compare`."""
    spacecraft = plans[0].spacecraft
    nominal = Comparison(spacecraft, tuple(plans), named=named, timed=timed)
    wanted = compliance.judged(spacecraft) if samples is None else samples > 0
    if spacecraft.dispersions is None or not wanted:
        return nominal
    return replace(nominal, flown=_dispersed(nominal, samples))


def _dispersed(compared: Comparison, samples: int | None) -> dict[Plan, Candidate]:
    """The feasible plans in dispersed cases."""
    from nutdamp.dispersion import SAMPLES
    from nutdamp.screening import fly_compared

    feasible = [one for one in compared.plans if one.feasible]
    count = SAMPLES if samples is None else samples
    with work.budget("the dispersed cases", work.CASES * max(1.0, count / SAMPLES)):
        return fly_compared(feasible, count, lambda shares: recommend(compared.eligible, shares).plan)


def attempt(spacecraft: Spacecraft, scheme: str, options: schemes.Choice) -> Plan:
    """The plan of a scheme, or one that carries the exception which nobody expected."""
    try:
        made = plan(spacecraft, scheme, options)
        # Judged here, where a failure is that of this scheme alone, and not when the first figure is shown.
        _ = made.residual, made.delta_v, made.left_if_symmetric
    except NutdampError:
        raise
    except Exception as failure:
        return Plan(spacecraft, scheme, None, f"{BUG}: {type(failure).__name__}", failure=failure)
    return made
