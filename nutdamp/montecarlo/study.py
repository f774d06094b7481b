"""Dispersion studies: many dispersed cases fly one schedule, some at a time, so that a study can be
watched and stopped.
"""

from __future__ import annotations

import math
import os
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import results, work
from nutdamp.common.numerics import finite
from nutdamp.errors import CannotWrite
from nutdamp.flight import propagation
from nutdamp.flight.cones import aspects
from nutdamp.flight.dynamics import shed
from nutdamp.flight.propagation import Flight
from nutdamp.montecarlo.cases import DispersedModel
from nutdamp.montecarlo.inputs import (
    BLOCK,
    DispersedInput,
    Draws,
    DrawSource,
    Group,
    independent,
    some_of,
    together,
)
from nutdamp.montecarlo.propagated import Ends, RealWidths
from nutdamp.montecarlo.statistics import (
    ANGLES,
    CERTAIN,
    EXACT_CASES,
    OUTPUTS,
    ROWS,
    SHOWN,
    Distribution,
    Exact,
    FirstOrder,
    Sketch,
    Worst,
    correlated_shares,
    first_order,
    measure,
    sampled_shares,
    share_interval,
    vectors,
)
from nutdamp.physics import motion
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft, required_share
from nutdamp.spacecraft.requirements import Bound, Left, Part
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.spacecraft.tolerances import expect_dispersions

Array = NDArray[np.float64]

STRIDE = motion.BLOCK  # cases that are always flown together; blocks of draws are multiples of it

FREED = 32_000_000  # bytes of the largest block that the C library counts for what it keeps
EARLY = 2 * BLOCK  # number of first cases whose outcome is kept whole for `sampled_shares`
KEPT_WORST = 1_000  # worst cases that are kept

STAGES = (2_048, 8_192, 20_000, 40_000, 80_000, 160_000)
"""Numbers of cases after which a share is judged: by its interval of all but a millionth, at the
last by that of 95 %. Two screen plans, the third is flown of every plan that is shown; the others
where that leaves it undecided.
"""

WORTH_SAYING = math.radians(
    1e-4
)  # rad by which cases of falling moments must err for that to be said


def by_tolerance(
    inputs: Sequence[DispersedInput], groups: Sequence[Group], shares: Mapping[str, float]
) -> dict[str, float]:
    """Sums of the ``shares`` of inputs by the key of the file that they belong to, of correlated
    ones by name.
    """
    sums: dict[str, float] = {}
    for rows in together(inputs, groups):
        entries = [inputs[row] for row in rows]
        name = (
            entries[0].tolerance
            if len(entries) == 1
            else " and ".join(entry.name for entry in entries)
        )
        sums[name] = sums.get(name, 0.0) + math.fsum(
            shares.get(entry.name, 0.0) for entry in entries
        )
    return {name: share for name, share in sums.items() if share > 0.0}


def threads_here() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class DrawnCases:
    """Cases of a ``model`` drawn from a ``seed``. They count from 0 here; people see them count
    from 1.

    The values of a case, of a schedule or of a loop, are a row each: the ``outputs``, the least and
    the largest angle to each cone (rad), and the error of a spin required (rad/s).
    """

    model: Any
    seed: int
    outputs: ClassVar[tuple[str, ...]]

    @property
    def rows(self) -> int:
        """Number of values of a case."""
        spacecraft: Spacecraft = self.model.spacecraft
        return len(self.outputs) + 2 * len(spacecraft.keep) + (spacecraft.goal.spin is not None)

    def row_of(self, bound: Bound) -> int:
        """Row of the value of a bound's part."""
        if bound.keep is not None:
            place: int = self.model.spacecraft.keep.index(bound.keep)
            return len(self.outputs) + 2 * place + (not bound.inner)
        return self.rows - 1 if bound.part is Part.SPIN else self.outputs.index(bound.part.value)

    def left(self, values: Array) -> Left:
        """Residual of cases by their values, (rows,) or (rows, n); the spin is as far off the goal,
        above it.
        """
        spacecraft = self.model.spacecraft
        nutation, aim = (
            values[self.outputs.index(part.value)]
            for part in (Part.NUTATION, requirements.aim(spacecraft))
        )
        first, cones = len(self.outputs), len(spacecraft.keep)
        angles = values[first : first + 2 * cones].reshape(cones, 2, *values.shape[1:])
        spin = math.nan if spacecraft.goal.spin is None else spacecraft.goal.spin + values[-1]
        return Left(nutation, aim, spin, angles if cones else None)

    def source(self) -> DrawSource:
        """Draws for one thread."""
        return DrawSource(
            self.model.inputs.drawn, self.seed, self.model.physical, self.model.groups
        )

    def draws_of(self, case: int) -> dict[str, float]:
        """Deviations of one case (from 0), by input."""
        return {
            name: float(np.ravel(draw)[0])
            for name, draw in self.draws_of_all(np.array([case])).items()
        }

    def draws_of_all(self, cases: NDArray[np.intp]) -> dict[str, Array | float]:
        """Deviations of ``cases`` (from 0, ascending), by input."""
        source = self.source()
        blocks = cases // BLOCK
        parts = list[dict[str, Any]]()
        for block in np.unique(blocks).tolist():
            draws, _ = source.block(block)
            parts.append(some_of(draws, cases[blocks == block] % BLOCK))
        return {
            name: draw
            if isinstance(draw, float)
            else np.concatenate([part[name] for part in parts])
            for name, draw in parts[0].items()
        }


Flown = tuple[Array, Array, NDArray[np.bool_], Array]  # see `Study.flown`


@dataclass(frozen=True, eq=False)
class Study(DrawnCases):
    """Study: cases of ``model`` drawn from ``seed``."""

    model: DispersedModel
    seed: int = 1
    outputs = OUTPUTS

    @cached_property
    def flies(self) -> RealWidths:
        """Flight model of the cases."""
        return RealWidths(self.model)

    @cached_property
    def first_order(self) -> FirstOrder:
        """Sensitivities of the flight."""
        return first_order(self.model, self.flies)

    def flown(self, draws: Draws) -> Flown:
        """A stride of cases of these draws: their `values`, `severity` (n,), whether the tank runs
        empty (n,), and `vectors`.
        """
        ends = self.flies(self.model.cases(draws))
        values = self.values(ends, STRIDE)
        severity = np.broadcast_to(self.severity(values, ends.drained), STRIDE)
        emptied = np.broadcast_to(np.asarray(ends.drained) > 1.0, STRIDE)
        return values, severity, emptied, vectors(self.model, ends, STRIDE)

    def ends_of(self, draws: Draws) -> Ends:
        """End state of one case with these deviations; none: of the estimate itself."""
        return self.flies(
            self.model.cases({name: np.atleast_1d(draw) for name, draw in draws.items()})
        )

    def values(self, ends: Ends, count: int) -> Array:
        """Values (rows, n) of ``count`` cases, of angles at the end the larger ones of those as the
        last pulse ends and after the last disturbance.
        """
        spacecraft = self.model.spacecraft
        outputs = measure(self.model, ends, count)
        if ends.disturbed is not None:
            after = measure(self.model, ends.disturbed, count)[:ANGLES]
            outputs[:ANGLES] = np.maximum(outputs[:ANGLES], after)
        rows = [outputs]
        if ends.aspects is not None:
            rows.append(
                np.broadcast_to(ends.aspects, (*ends.aspects.shape[:2], count)).reshape(-1, count)
            )
        if spacecraft.goal.spin is not None:
            spins = [ends.spin] if ends.disturbed is None else [ends.spin, ends.disturbed.spin]
            off = np.max(np.abs(np.array(spins) - spacecraft.goal.spin), axis=0)
            rows.append(np.broadcast_to(off, (1, count)))
        return np.concatenate(rows)

    def outputs_of(self, draws: Draws) -> Array:
        """Values (rows,) of one case with these deviations; none: of the estimate itself."""
        return self.values(self.ends_of(draws), 1)[:, 0]

    @property
    def nominal(self) -> Flight:
        """Estimate itself, flown alone as the cases are."""
        return propagation.flown(self.model.spacecraft, self.model.schedule)

    @property
    def nominal_aspects(self) -> Array:
        """Least and largest angle (m, 2) rad from the spin axis to the direction of each cone in
        that flight.
        """
        seen = aspects(self.nominal)[: len(self.model.spacecraft.keep)]
        return np.array([(aspect.least, aspect.largest) for aspect in seen])

    def severity(self, values: Array, drained: Any) -> Array:
        """Severity of cases, (n,), by their `values` and the propellant they take; see
        `requirements.severity`.
        """
        return np.asarray(requirements.severity(self.model.spacecraft, self.left(values), drained))

    @property
    def lightening_error(self) -> str:
        """Message on the error of falling moments in cases, by the nominal one; empty where
        negligible.
        """
        if shed(self.model.spacecraft) is None:
            return ""
        outputs = measure(self.model, self.ends_of({}), 1)[:, 0]
        exact = self.nominal.residual
        part = requirements.aim(self.model.spacecraft)
        aim = exact.momentum_shift if part is Part.SHIFT else exact.axis_error
        errors = {
            Part.NUTATION: outputs[0] - exact.nutation,
            part: outputs[OUTPUTS.index(part.value)] - aim,
        }
        if max(map(abs, errors.values())) < WORTH_SAYING:
            return ""
        message = " and ".join(
            f"{math.degrees(abs(error)):.2g} deg of {part.label}" for part, error in errors.items()
        )
        text = (
            "cases let the moments of inertia fall at the edges of pulses: "
            "in the nominal one that errs by"
        )
        return f"{text} {message}"


@dataclass(eq=False)
class Counted(ABC):
    """Results of a study so far: the cases from 0 to ``done`` of the ``requested``, of which
    ``met`` comply.

    ``kept``: those that keep each of the ``bounds`` at the end and on the way, required or not.
    """

    study: Any
    requested: int
    done: int = 0
    redrawn: int = 0
    met: int = 0
    worst: Worst = field(default_factory=lambda: Worst(KEPT_WORST))
    bounds: tuple[Bound, ...] = field(init=False)
    kept: NDArray[np.int64] = field(init=False)
    broken: NDArray[np.int64] = field(init=False)  # cases that break each cone, (m,)
    aspects: Array = field(init=False)  # least and largest angle to it in all cases, (m, 2) rad

    def __post_init__(self) -> None:
        spacecraft = self.study.model.spacecraft
        self.bounds = (*requirements.bounds(spacecraft), *requirements.cones(spacecraft))
        self.kept = np.zeros(len(self.bounds), dtype=np.int64)
        self.broken, self.aspects = (
            np.zeros(len(spacecraft.keep), dtype=np.int64),
            np.tile([math.pi, 0.0], (len(spacecraft.keep), 1)),
        )

    def count(self, severity: Array, values: Array, able: NDArray[np.bool_]) -> None:
        """Count cases from ``done`` on: their severity (n,), values (rows, n), and who may comply
        at all.
        """
        spacecraft, residuals = self.study.model.spacecraft, self.study.left(values)
        complies = able.copy()
        astray = np.zeros((len(spacecraft.keep), len(severity)), dtype=bool)
        for row, bound in enumerate(self.bounds):
            met = np.broadcast_to(
                bound.met(requirements.left_of(bound, residuals, spacecraft)), len(severity)
            )
            self.kept[row] += np.count_nonzero(met)
            if bound.required:
                complies &= met
            if bound.keep is not None:
                astray[spacecraft.keep.index(bound.keep)] |= ~met
        self.met += int(np.count_nonzero(complies))
        self.broken += astray.sum(axis=1)
        if residuals.angles is not None:
            self.aspects[:, 0] = np.minimum(self.aspects[:, 0], residuals.angles[:, 0].min(axis=1))
            self.aspects[:, 1] = np.maximum(self.aspects[:, 1], residuals.angles[:, 1].max(axis=1))
        self.worst.add(self.done, severity)
        self.done += len(severity)

    @property
    def met_fraction(self) -> float | None:
        """Share of cases that comply; None where nothing is required, and there are no cones."""
        return (
            self.met / self.done
            if self.done and requirements.judged(self.study.model.spacecraft)
            else None
        )

    @property
    def probability(self) -> float:
        """Share of cases that must comply."""
        return required_share(self.study.model.spacecraft.requirement)

    def interval(self, *, certain: bool = False) -> tuple[float, float]:
        """Interval of the share that complies: of 95 %, where it must be ``certain`` of all but a
        millionth.
        """
        return share_interval(self.met, self.done, CERTAIN if certain else SHOWN)

    def shown(self, *, certain: bool = False) -> bool | None:
        """Compliance of enough cases, or of too few, beyond the interval; None where that is not
        decided.

        True where nothing is required.
        """
        if self.met_fraction is None:
            return True
        return requirements.enough(*self.interval(certain=certain), self.probability)

    def level(self, bound: Bound) -> float | None:
        """Value of a bound's part that the share of cases required keeps; None where it is not
        known.
        """
        spread = self.spread(bound)
        share = self.probability
        if spread is None:
            return None
        return float(spread.quantiles(np.array([1.0 - share if bound.inner else share]))[0])

    @abstractmethod
    def spread(self, bound: Bound) -> Distribution | None:
        """Distribution of the value of a bound's part."""

    @abstractmethod
    def contributions(self, bound: Bound) -> dict[str, float]:
        """Share of each tolerance of the file in the variance of the value of a bound's part."""


@dataclass(eq=False)
class Results(Counted):
    """Results of a study of a schedule."""

    study: Study
    emptied: int = 0  # cases whose tank runs empty
    early: Array = field(
        default_factory=lambda: np.zeros((ROWS, EARLY))
    )  # `vectors` of the first cases
    values: Array | None = field(init=False)  # of each case, (rows, n)
    sketches: list[Sketch] = field(
        init=False
    )  # of the outputs, beyond `EXACT_CASES`, in place of ``values``

    def __post_init__(self) -> None:
        super().__post_init__()
        exact = self.requested <= EXACT_CASES
        rows = self.study.rows
        self.values = np.empty((rows, self.requested)) if exact else None
        self.sketches = [] if exact else [Sketch() for _ in range(rows)]

    @property
    def exact(self) -> bool:
        """True if percentiles are exact."""
        return self.values is not None

    def distribution(self, output: str) -> Distribution | None:
        """Distribution of an output; None where it is unknown (propellant)."""
        return self.spread_of(OUTPUTS.index(output))

    def spread(self, bound: Bound) -> Distribution | None:
        """Distribution of the value of a bound's part."""
        return self.spread_of(self.study.row_of(bound))

    def spread_of(self, row: int) -> Distribution | None:
        """Distribution of a row of `Study.values`; None where it is unknown."""
        if self.values is None:
            return self.sketches[row] if math.isfinite(self.sketches[row].minimum) else None
        values = self.values[row, : self.done]
        return None if not len(values) or math.isnan(values[0]) else Exact(values)

    def _early_draws(self) -> dict[str, Array]:
        """Draws of the first cases, without biases; of correlated inputs the independent normals
        behind them.
        """
        model = self.study.model
        draws = self.study.draws_of_all(np.arange(min(self.done, EARLY)))
        varied = {name: draw for name, draw in draws.items() if not isinstance(draw, float)}
        return independent(varied, model.inputs.drawn, model.groups)

    @cached_property
    def shares(self) -> dict[str, dict[str, float]]:
        """`sampled_shares` of the first cases, of correlated inputs like `FirstOrder.shares`; call
        it at the end.
        """
        return sampled_shares(self._early_draws(), self.early[:, : min(self.done, EARLY)])

    def contributions(self, bound: Bound) -> dict[str, float]:
        """Share of each tolerance in the variance of the value of a bound's part; correlated ones
        together.

        By first order; of the angle to a cone, which has no derivative, the squared correlation
        over the first cases.
        """
        first, groups = self.study.first_order, self.study.model.groups
        if bound.keep is None:
            each = dict(
                zip(
                    (entry.name for entry in first.inputs),
                    first.shares(bound.part.value).tolist(),
                    strict=True,
                )
            )
        else:
            spread = self.spread(bound)
            values = spread.values[:EARLY] if isinstance(spread, Exact) else np.empty(0)
            each = correlated_shares(self._early_draws(), values)
        return by_tolerance(first.inputs, groups, each)

    def take(
        self, values: Array, severity: Array, emptied: NDArray[np.bool_], linear: Array
    ) -> None:
        """Count further cases by their ``values``, see `count`; ``emptied`` (n,): whose tank runs
        empty; ``linear``: their `vectors`.
        """
        self.emptied += int(np.count_nonzero(emptied))
        rows = slice(self.done, self.done + len(severity))
        if self.done < EARLY:
            self.early[:, rows] = linear
        if self.values is not None:
            self.values[:, rows] = values
        for sketch, row in zip(self.sketches, values, strict=False):
            sketch.add(row)
        self.count(severity, values, ~emptied)

    def extended(self, requested: int) -> Results:
        """Copy with room for ``requested`` cases: no fewer than are done, and no more than
        `EXACT_CASES`.
        """
        more = replace(self, requested=requested)
        more.kept, more.broken, more.aspects = self.kept, self.broken, self.aspects
        assert self.values is not None
        assert more.values is not None
        more.values[:, : self.done] = self.values[:, : self.done]
        return more


def run(
    results: Results,
    *,
    threads: int = 1,
    watch: Callable[[int], None] = lambda _: None,
    stopped: Callable[[], bool] = lambda: False,
    collect: Callable[[int, Array], None] | None = None,
) -> Results:
    """Fly the cases that ``results`` is to have and does not have yet; returns ``results``.

    ``watch`` is called now and then with how many are done; they are kept when ``stopped`` says so.
    ``collect`` is given the number (from 0) of the first of some cases, and their `Results.values`,
    in order.

    Block after block of draws; whole strides are flown, even for fewer cases: what flies them may
    let one depend on its stride.
    """
    # The C library keeps freed memory up to twice the largest block freed so far: else each stride
    # asks for new pages.
    np.empty(FREED, dtype=np.uint8)
    study, source = results.study, results.study.source()
    while results.done < results.requested and not stopped():
        first = results.done
        block = first - first % BLOCK
        last = min(results.requested, block + BLOCK)
        draws, redrawn = source.block(block // BLOCK)
        strides = range(first - first % STRIDE, last, STRIDE)
        drawn = [some_of(draws, slice(begin - block, begin - block + STRIDE)) for begin in strides]
        parts = []
        flights = _by_threads(study.flown, drawn, threads)
        for begin, (values, severity, emptied, linear) in zip(strides, flights, strict=True):
            inner = slice(results.done - begin, min(last - begin, STRIDE))
            parts.append(values[:, inner])
            results.take(parts[-1], severity[inner], emptied[inner], linear[:, inner])
            watch(results.done)
            if stopped():
                break
        redone = (redrawn >= first - block) & (redrawn < results.done - block)
        results.redrawn += int(np.count_nonzero(redone))
        if collect is not None:
            collect(first, np.concatenate(parts, axis=1))
    return results


def _by_threads(
    fly: Callable[[Draws], Flown], drawn: Sequence[Draws], threads: int
) -> Iterator[Flown]:
    """Results of ``fly`` for each of the ``drawn``, in order, by several threads at a time."""
    flights: list[Any] = [None] * len(drawn)
    landed = [threading.Event() for _ in drawn]
    remaining = iter(range(len(drawn)))

    def work() -> None:
        for number in remaining:
            try:
                flights[number] = fly(drawn[number])
            except BaseException as failure:  # handed to the thread that waits
                flights[number] = failure
            landed[number].set()

    try:
        # Daemons: an interrupt need not wait for the flights in work, which nobody uses then.
        for _ in range(min(threads, len(drawn))):
            threading.Thread(target=work, daemon=True).start()
        for number, event in enumerate(landed):
            event.wait()
            if isinstance(flights[number], BaseException):
                raise flights[number]
            yield flights[number]
    finally:
        for _ in remaining:  # nothing more is begun
            pass


def effort(study: Study, samples: int) -> float:
    """Units of `work` of so many cases: of whole strides, which are flown together."""
    return study.flies.effort * STRIDE * math.ceil(samples / STRIDE)


def affordable(study: Study, samples: int) -> bool:
    """True if the open budget of work suffices for so many cases, which are flown at once."""
    return effort(study, samples) <= work.left()


def next_stage(
    begun: Results, samples: int | None = None, *, fly: Callable[[Results], object] | None = None
) -> Results:
    """Results with the cases of the next stage, of ``samples`` in all, default of as many of
    `STAGES` as it takes.

    The same ones where no more are to be flown: the share is known beyond the default number, or
    the budgets `work.CASES`, beyond it `work.MORE_CASES`, allow no more. The first stage is flown
    in any case. ``fly`` flies the cases that results lack, default `run`.
    """
    stages = (
        STAGES if samples is None else (*(stage for stage in STAGES if stage < samples), samples)
    )
    if samples is not None and samples > EXACT_CASES:
        stages = (samples,)  # they are counted and not kept: from the first one on
    stage = next((count for count in stages if count > begun.done), None)
    beyond = samples is None and stage is not None and stage > work.SAMPLES
    if stage is None or (beyond and begun.shown(certain=True) is not None):
        return begun
    study = begun.study
    most = work.MORE_CASES if beyond else work.CASES * max(stage / work.SAMPLES, 1.0)
    with work.budget("the dispersed cases", most):
        if begun.done and not affordable(study, stage - begun.done):
            return begun
        further = begun.extended(stage) if stage <= EXACT_CASES else Results(study, stage)
        work.spend(effort(study, stage - begun.done))
        if fly is None:
            run(further, threads=threads_here())
        else:
            fly(further)
    return further


def flown_in_stages(
    study: Study,
    samples: int | None = None,
    *,
    fly: Callable[[Results], object] | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> Results:
    """Results of all stages of a study, see `next_stage`, unless ``stopped`` says so."""
    done = None
    further = Results(study, 0)
    while further is not done and not stopped():
        done = further
        further = next_stage(further, samples, fly=fly)
    return further


@dataclass(frozen=True, eq=False, repr=False)
class Dispersed(results.Data, results.Drawn):
    """Many dispersed cases; ``core`` holds their distributions, ``unsaved`` the error of a file
    that was not saved.
    """

    core: Counted
    unsaved: CannotWrite | None = None

    @property
    def met_fraction(self) -> float | None:
        """Share of the cases that meet the requirement; None where nothing is required."""
        return self.core.met_fraction

    def to_dict(self, worst: int = 5) -> dict[str, Any]:
        """Contents of the file that the command writes with ``--json``, with as many ``worst``
        cases.
        """
        return finite(results.view(self, "data", worst=worst))

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.core.met} of {self.core.done} cases comply>"


SEED = 1  # default seed of the draws


def study_of(spacecraft: Spacecraft, schedule: Schedule, *, seed: int = SEED) -> Study:
    """Study of ``schedule`` with the dispersions of ``spacecraft``; raises BadRequest where it has
    none.
    """
    expect_dispersions(spacecraft.dispersions)
    return Study(DispersedModel(spacecraft, schedule), seed)
