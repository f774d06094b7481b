"""Work, counted: what bounds a search on every machine alike, and tells how far it is.

One unit is somewhat less than a millisecond of a core of 2020. Flights, linear programs and descents `spend` what they
take, by counts that do not depend on the clock; searches look whether the budget they run in is `exhausted` and end
with the best found so far.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

SCHEME = 9_000.0
"""Units that the search of one scheme may spend."""

COMMAND = 10_000.0
"""Units that the searches of one comparison may spend together."""

CASES = 20_000.0
"""Units that the dispersed cases of one comparison may take together, by default so many; in proportion if more."""

FRONTS = 30_000.0
"""Units that the searches of all points of `trade` may spend together."""

FIT, FITTED = 4_500.0, 600
"""Units that a fit may spend on a record of so many rows; in proportion if more."""


@dataclass(eq=False)
class Budget:
    """Units of work that may be spent on ``what``, and those that are ``done``."""

    what: str
    most: float
    done: float = 0.0
    around: Budget | None = None

    @property
    def exhausted(self) -> bool:
        """Whether nothing is left."""
        return self.done >= self.most

    @property
    def share(self) -> float:
        """How much of it is spent, 0 to 1."""
        return min(self.done / self.most, 1.0) if self.most > 0.0 else 1.0


class Watch:
    """Shows from outside, as from another thread, which budget is being spent."""

    budget: Budget | None = None


_budget: ContextVar[Budget | None] = ContextVar("budget", default=None)
_watch: ContextVar[Watch | None] = ContextVar("watch", default=None)


@contextmanager
def budget(what: str, most: float) -> Iterator[Budget]:
    """A budget of ``most`` units for what runs within, no more than is left of the one around it."""
    around, watch = _budget.get(), _watch.get()
    one = Budget(what, most if around is None else min(most, max(around.most - around.done, 0.0)), around=around)
    token = _budget.set(one)
    if watch is not None:
        watch.budget = one
    try:
        yield one
    finally:
        _budget.reset(token)
        if watch is not None:
            watch.budget = around


def spend(units: float) -> None:
    """Count ``units`` of work towards the budgets that are open; without one nothing is counted."""
    one = _budget.get()
    while one is not None:
        one.done += units
        one = one.around


def left() -> float:
    """Units that are left of the budget that is open; endless without one."""
    one = _budget.get()
    return math.inf if one is None else max(one.most - one.done, 0.0)


def exhausted() -> bool:
    """Whether the budget that is open is spent; never without one."""
    one = _budget.get()
    return one is not None and one.exhausted


@contextmanager
def watched() -> Iterator[Watch]:
    """What shows the budgets opened within."""
    watch = Watch()
    token = _watch.set(watch)
    try:
        yield watch
    finally:
        _watch.reset(token)
