"""What the commands trade, disperse, verify and export do, for plans in memory; the numbers are those of their JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

from nutdamp import arguments, dispersion, fronts, planning, verification
from nutdamp.dispersion.study import Results, run, threads_here
from nutdamp.errors import BadRequest
from nutdamp.library.craft import expected
from nutdamp.library.views import feasible
from nutdamp.loop import budget as budgets
from nutdamp.planning import Plan
from nutdamp.rounding import finite
from nutdamp.schemes.options import LEAST, OptimalOptions
from nutdamp.spacecraft import Spacecraft

if TYPE_CHECKING:
    from nutdamp.loop.study import LoopResults


@dataclass(frozen=True, eq=False)
class Trade:
    """What time costs: ``fronts`` of schedules of the scheme optimal, one for each shift of H allowed."""

    spacecraft: Spacecraft
    fronts: tuple[fronts.Front, ...]

    @property
    def plans(self) -> tuple[Plan, ...]:
        """The plans of all points, front after front, each from its earliest end to its latest."""
        return tuple(point.plan for _, _, point in fronts.numbered(self.fronts))

    def to_dict(self) -> dict[str, Any]:
        """What ``trade --json`` gives."""
        from nutdamp.files.trade_files import trade_json

        return finite(trade_json(self.spacecraft, self.fronts))


@dataclass(frozen=True, eq=False)
class Dispersion:
    """A schedule flown in many dispersed cases; ``core`` holds the distributions of what they leave."""

    core: Results
    scheme: str

    @property
    def met_fraction(self) -> float | None:
        """Share of the cases that meet the requirement; None where nothing is required."""
        return self.core.met_fraction

    @property
    def meets_requirement(self) -> bool | None:
        """Whether as many cases meet it as the file requires; None where nothing is required."""
        return self.core.meets_requirement

    def to_dict(self, worst: int = 5) -> dict[str, Any]:
        """What ``disperse --json`` gives, with as many ``worst`` cases."""
        from nutdamp.files.dispersion_json import dispersion_json

        return finite(dispersion_json(self.core, scheme=self.scheme, worst=worst))


@dataclass(frozen=True, eq=False)
class LoopDispersion:
    """The loop of a file flown in many dispersed cases; ``core`` holds what each does."""

    core: LoopResults

    @property
    def settled_fraction(self) -> float:
        """Share of the cases that fall quiet, and are not stopped."""
        return self.core.settled / self.core.done

    @property
    def met_fraction(self) -> float | None:
        """Share of the cases that meet the requirement; None where nothing is required."""
        return self.core.met_fraction

    def to_dict(self, worst: int = 5) -> dict[str, Any]:
        """What ``disperse --loop --json`` gives, with as many ``worst`` cases."""
        from nutdamp.files.loop_cases import loop_cases_json

        return finite(loop_cases_json(self.core, worst=worst))


@dataclass(frozen=True, eq=False)
class Verified:
    """A schedule flown by independent methods: ``core`` holds them, what is conserved, and the error budget."""

    core: verification.Verification
    plan: Plan

    @property
    def agree(self) -> bool:
        """Whether an independent integration was flown, and all of them confirm the flown motion."""
        return self.core.agree

    def to_dict(self) -> dict[str, Any]:
        """What ``verify --json`` gives."""
        from nutdamp.files.verification_json import verification_json

        return finite(verification_json(self.plan.flight, self.plan.scheme, self.core))


@dataclass(frozen=True, eq=False)
class Budget:
    """What it takes to hold the nutation against energy dissipation; ``core`` holds a row for each two thresholds."""

    core: budgets.Budget

    def to_dict(self) -> dict[str, Any]:
        """What ``budget --json`` gives."""
        from nutdamp.files.budget_files import budget_json

        return finite(budget_json(self.core))

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write what ``budget --csv`` writes; raises CannotWrite."""
        from nutdamp.files.budget_files import budget_csv
        from nutdamp.files.output import write_whole

        write_whole(arguments.path("path", path), budget_csv(self.core))


def trade(
    spacecraft: Spacecraft,
    points: int = 10,
    allow: Iterable[float] = (0.0, math.inf),
    least: str = "propellant",
    *,
    with_disturbances: bool = False,
    progress: Callable[[int], None] = lambda _: None,
) -> Trade:
    """Time against propellant (``least="impulse"``: impulse), as ``nutdamp trade`` does; raises BadRequest.

    ``points``: horizons tried for each front; ``allow``: how far from its target H may end, rad, a front for each;
    ``progress`` is called with the number of horizons tried so far.
    """
    body = expected(spacecraft)
    count, shifts = arguments.count("points", points), arguments.shifts(allow)
    least = arguments.one_of("least", least, LEAST[:2])
    options = OptimalOptions(least=least, with_disturbances=with_disturbances)
    return Trade(body, fronts.fronts(body, options, count=count, shifts=shifts, progress=progress))


def budget(
    spacecraft: Spacecraft,
    thresholds: Iterable[tuple[float, float]] = (),
    *,
    largest: float | None = None,
    seed: int = 1,
    progress: Callable[[int], None] = lambda _: None,
) -> Budget:
    """Pulses a day and propellant a year that hold the nutation, as ``nutdamp budget`` does; raises BadRequest.

    ``thresholds``: pairs (start, stop), rad, default those of the loop in the file; ``largest``: the nutation (rad) by
    which damping must begin, default the one required.
    """
    body, pairs = expected(spacecraft), arguments.thresholds(thresholds)
    if largest is not None and not (arguments.is_number(largest) and 0.0 < largest < 0.5 * math.pi):
        raise BadRequest(f"largest = {arguments.shown(largest)}: expected an angle in rad between 0 and a right angle")
    if pairs and body.loop is None:
        raise BadRequest("thresholds: expected a spacecraft with a loop")
    seed = arguments.instance("seed", seed, int, "a whole number")
    made = [budgets.Thresholds(*pair) for pair in pairs]
    return Budget(budgets.budget(body, made, largest, seed=seed, progress=progress))


def disperse(plan: Plan, samples: int = dispersion.SAMPLES, *, seed: int = dispersion.SEED) -> Dispersion:
    """Fly the schedule through its real widths in dispersed cases, as ``nutdamp disperse`` does.

    Raises Infeasible where there is no schedule, BadRequest for a spacecraft without dispersions.
    """
    feasible(plan)
    _expect_seed(seed)
    study = dispersion.study_of(plan.spacecraft, plan.pulses, seed=seed)
    results = Results(study, arguments.count("samples", samples))
    return Dispersion(run(results, threads=threads_here()), plan.scheme)


def disperse_loop(
    spacecraft: Spacecraft,
    samples: int = dispersion.SAMPLES,
    *,
    until: float | None = None,
    seed: int = dispersion.SEED,
) -> LoopDispersion:
    """Fly the closed loop of the file in dispersed cases to ``until`` s, as ``nutdamp disperse --loop`` does.

    Raises BadRequest for a spacecraft without loop or dispersions, Infeasible where its firings come too late to damp.
    """
    from nutdamp.loop import study

    body, count = expected(spacecraft), arguments.count("samples", samples)
    _expect_seed(seed)
    end = None if until is None else arguments.end_of_flight(until)
    found = study.loop_study(body, end, seed=seed)
    found.expect_affordable(count)
    return LoopDispersion(study.run(study.LoopResults(found, count)))


def _expect_seed(seed: int) -> None:
    if not 0 <= arguments.instance("seed", seed, int, "a whole number") < 2**64:
        raise BadRequest(f"seed = {seed}: expected a whole number from 0 to 2**64 - 1")


def verify(plan: Plan) -> Verified:
    """Fly the schedule by independent methods, as ``nutdamp verify`` does; raises Infeasible without a schedule."""
    body, known = feasible(plan).spacecraft, plan.options.with_disturbances
    return Verified(verification.verify(body, plan.pulses, planning.unrounded(plan), expected=known), plan)


def export(plan: Plan, format: str, path: str | PathLike[str], *, until: float | None = None) -> None:  # noqa: A002 - as --format
    """Write what ``nutdamp export`` writes in one of its formats; CCSDS messages as XML where the name says .xml.

    ``until``: end of a history or spin table, s. Raises Infeasible, BadRequest or CannotWrite.
    """
    from nutdamp.files.exchange import FORMATS, MESSAGES, export_text
    from nutdamp.files.output import write_whole

    made, form = feasible(plan), arguments.one_of("format", format, FORMATS)
    name = arguments.path("path", path)
    end = None if until is None else arguments.end_of_flight(until)
    write_whole(name, export_text(made, form, xml=form in MESSAGES and name.lower().endswith(".xml"), until=end))
