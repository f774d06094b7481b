"""Computation budgets, machine-independent bounds on searches; and progress, in steps done of steps
expected.

One unit of a budget is somewhat less than a millisecond of a core of 2020. Flights, linear programs
and descents `spend` units by counts that do not depend on the clock; searches test whether the open
budget is `exhausted` and end with the best solution so far. A budget is no measure of progress,
since a search may end long before it is spent.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

SCHEME = 9_000.0  # units for the search of one scheme
# units for all searches of one comparison: two that take all of theirs leave some to others
COMMAND = 20_000.0
CURE = 1_000.0  # units for the search of a limit that would make a scheme feasible
CASES, SAMPLES = (
    20_000.0,
    20_000,
)  # units for the dispersed cases of one comparison by so many, the default number
# units for cases beyond that number, where they leave it undecided whether enough comply
MORE_CASES = 5_000.0
# units for the tolerances needed: what the cases of one comparison take is too much beside it
TOLERANCES = 5_000.0
FRONTS = 30_000.0  # units for all points of `trade` but those that `plan` finds
# units for the robust plans that `plan` tries by itself: at most 8 s, for programs and flights of
# cases take 0.5 ms a unit (products.yaml) or less
ROBUST = 12_000.0
LOOP = 20_000.0  # units for the flight of one closed loop
CYCLES = 30_000.0  # units: limit cycles of one pair of thresholds, and lifetime of the tank
FIT, FITTED = (
    4_500.0,
    600,
)  # units that a fit may spend on a record of so many rows; in proportion if more


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


@dataclass(eq=False)
class StepCount:
    """Steps ``done`` of those ``expected``, and the ``inner`` task under way; this one is ``size``
    steps of its own.

    ``hook`` is called with both numbers.
    """

    expected: float
    size: float
    hook: Callable[[Any, Any], object]
    done: float = 0.0
    inner: StepCount | None = None

    @property
    def share(self) -> float:
        """Fraction done, 0 to 1, with what is done of the step under way."""
        begun = 0.0 if self.inner is None else self.inner.size * self.inner.share
        return min((self.done + begun) / self.expected, 1.0) if self.expected > 0.0 else 1.0

    def reach(self, done: float) -> None:
        """Set the number done."""
        self.done = done
        self.hook(done, self.expected)


class Monitor:
    """Handle by which another thread sees the innermost budget, and the steps of the whole task."""

    budget: WorkBudget | None = None
    task: StepCount | None = None


_budget: ContextVar[WorkBudget | None] = ContextVar("budget", default=None)
_cures: ContextVar[bool] = ContextVar("cures", default=True)
_steps: ContextVar[StepCount | None] = ContextVar("steps", default=None)
_watch: ContextVar[Monitor | None] = ContextVar("watch", default=None)


@contextmanager
def budget(what: str, most: float) -> Iterator[WorkBudget]:
    """Open a budget of ``most`` units, but no more than is left of the enclosing one."""
    around, watch = _budget.get(), _watch.get()
    inner = WorkBudget(
        what,
        most if around is None else min(most, max(around.most - around.done, 0.0)),
        around=around,
    )
    token = _budget.set(inner)
    if watch is not None:
        watch.budget = inner
    try:
        yield inner
    finally:
        _budget.reset(token)
        if watch is not None:
            watch.budget = around


def cure(what: str) -> AbstractContextManager[WorkBudget]:
    """Open the budget for the search of a limit that would make a scheme feasible."""
    return budget(what, CURE if _cures.get() else 0.0)


@contextmanager
def no_cures() -> Iterator[None]:
    """Search no such limits: for plans of which nobody is told why they are infeasible."""
    token = _cures.set(False)
    try:
        yield
    finally:
        _cures.reset(token)


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
def steps(
    expected: float,
    size: float = 1.0,
    *,
    hook: Callable[[Any, Any], object] = lambda _done, _all: None,
) -> Iterator[StepCount]:
    """Count the steps of a task of ``size`` steps of the task around it; ``hook``: `StepCount`."""
    around, watch = _steps.get(), _watch.get()
    task = StepCount(expected, size, hook)
    token = _steps.set(task)
    if around is not None:
        around.inner = task
    elif watch is not None:
        watch.task = task
    try:
        yield task
    finally:
        _steps.reset(token)
        if around is not None:
            around.inner = None
            around.done = around.done + size


def reach(done: float) -> None:
    """Set the number of steps done of the innermost task; without one nothing is counted."""
    task = _steps.get()
    if task is not None:
        task.reach(done)


@contextmanager
def watched() -> Iterator[Monitor]:
    """Handle on the budgets and the steps within."""
    watch = Monitor()
    token = _watch.set(watch)
    try:
        yield watch
    finally:
        _watch.reset(token)
