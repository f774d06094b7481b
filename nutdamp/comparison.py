"""Several plans for one spacecraft, and which of them is recommended."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from nutdamp import schemes, views, work
from nutdamp.errors import NutdampError
from nutdamp.planning import Plan, plan, reaches_spin
from nutdamp.recommendation import Recommendation, Standing, recommend
from nutdamp.spacecraft import Spacecraft

BUG = "internal error, please report"
"""Why there is no plan where a scheme raised what it should not; the name of the exception follows."""


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(views.Data, views.Tabled):
    """Several plans for one spacecraft, and which of them is recommended on what ground.

    ``comparison["two-pulse"]`` is one of them, iterating gives all.
    """

    spacecraft: Spacecraft
    plans: tuple[Plan, ...]

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
        return recommend(self.plans)

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
                    if schemes.SCHEMES[one.scheme].slow == slow:
                        aware = replace(one.options, with_disturbances=True)
                        others = (*others, attempt(body, one.scheme, aware))
                best = Comparison(body, others).recommended
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

    Those that can set the spin are among them where it has to change.
    """
    names = schemes.COMPARED if spacecraft.goal.axis is None else schemes.POINTING
    if spacecraft.commands is not None:  # before those that may take all the work
        slow = [name for name in names if schemes.SCHEMES[name].slow]
        names = (*(name for name in names if name not in slow), *schemes.COMMANDED, *slow)
    return names if reaches_spin(spacecraft) else tuple(dict.fromkeys((*names, *schemes.SPINNING)))


def compare(spacecraft: Spacecraft, names: Sequence[str], options: schemes.Choice = None) -> Comparison:
    """Plan the schemes named and recommend one; one that has a bug does not take the others down.

    Raises NutdampError, such as BadRequest, and KeyError for a name not in `schemes.NAMES`.
    """
    unknown = set(names) - set(schemes.NAMES)
    if unknown:
        raise KeyError(*sorted(unknown))
    with work.budget("the comparison", work.COMMAND):
        return Comparison(spacecraft, tuple(attempt(spacecraft, name, options) for name in names))


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
