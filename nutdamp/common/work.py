"""Computation budgets: machine-independent bounds on searches, with progress.

One unit is somewhat less than a millisecond of a core of 2020. Flights, linear programs and descents `spend` units by
counts that do not depend on the clock; searches test whether the open budget is `exhausted` and end with the best
solution so far.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

SCHEME = 9_000.0
"""Units for the search of one scheme."""

COMMAND = 10_000.0
"""Units for all searches of one comparison."""

CASES = 20_000.0
"""Units for the dispersed cases of one comparison with the default number of cases; more in proportion."""

FRONTS = 30_000.0
"""Units for the searches of all points of `trade`."""

FIT, FITTED = 4_500.0, 600
"""Units that a fit may spend on a record of so many rows; in proportion if more."""


@dataclass(eq=False)
class WorkBudget:
    """Budget of ``most`` units for the task ``what``, of which ``done`` are spent."""

    what: str
    most: float
    done: float = 0.0
    around: WorkBudget | None = None

    @property
    def exhausted(self) -> bool:
        """True if nothing is left."""
        return self.done >= self.most

    @property
    def share(self) -> float:
        """Fraction spent, 0 to 1."""
        return min(self.done / self.most, 1.0) if self.most > 0.0 else 1.0


class BudgetMonitor:
    """Handle by which another thread sees the budget being spent."""

    budget: WorkBudget | None = None


_budget: ContextVar[WorkBudget | None] = ContextVar("budget", default=None)
_watch: ContextVar[BudgetMonitor | None] = ContextVar("watch", default=None)


@contextmanager
def budget(what: str, most: float) -> Iterator[WorkBudget]:
    """Open a budget of ``most`` units, but no more than is left of the enclosing one."""
    around, watch = _budget.get(), _watch.get()
    inner = WorkBudget(what, most if around is None else min(most, max(around.most - around.done, 0.0)), around=around)
    token = _budget.set(inner)
    if watch is not None:
        watch.budget = inner
    try:
        yield inner
    finally:
        _budget.reset(token)
        if watch is not None:
            watch.budget = around


def spend(units: float) -> None:
    """Charge ``units`` to the open budgets; without a budget nothing is counted."""
    current = _budget.get()
    while current is not None:
        current.done += units
        current = current.around


def left() -> float:
    """Units left of the open budget; infinite without one."""
    current = _budget.get()
    return math.inf if current is None else max(current.most - current.done, 0.0)


def exhausted() -> bool:
    """True if the open budget is spent; False without one."""
    current = _budget.get()
    return current is not None and current.exhausted


@contextmanager
def watched() -> Iterator[BudgetMonitor]:
    """Handle on the budgets opened within."""
    watch = BudgetMonitor()
    token = _watch.set(watch)
    try:
        yield watch
    finally:
        _watch.reset(token)
