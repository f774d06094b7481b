"""Dispersion studies: many dispersed cases fly one schedule, in rounds, so that a study can be watched and stopped."""

from __future__ import annotations

import math
import operator
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import results
from nutdamp.common.numerics import finite
from nutdamp.errors import CannotWrite
from nutdamp.flight import propagation
from nutdamp.flight.dynamics import shed
from nutdamp.flight.end_state import aspects
from nutdamp.flight.propagation import Flight
from nutdamp.montecarlo.cases import DispersedModel, cones_used
from nutdamp.montecarlo.inputs import BLOCK, Draws, DrawSource, independent, some_of
from nutdamp.montecarlo.propagated import Ends, RealWidths
from nutdamp.montecarlo.statistics import (
    EXACT_CASES,
    OUTPUTS,
    ROWS,
    Distribution,
    Exact,
    FirstOrder,
    Sketch,
    Worst,
    as_flown,
    binomial_interval,
    measure,
    sampled_shares,
    vectors,
)
from nutdamp.physics import batch
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.model import Spacecraft, required_share
from nutdamp.spacecraft.requirements import Left, Part
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.spacecraft.tolerances import expect_dispersions

Array = NDArray[np.float64]

STRIDE = batch.BLOCK  # cases that are always flown together
PORTION = 2 * STRIDE  # cases that a thread takes at once; blocks are multiples of it


class Round:
    """Some cases of a study, flown by several threads that take one portion of a block of draws after the other."""

    def __init__(self, results: Results, first: int, last: int, out: Array) -> None:
        self.results, self.first, self.last, self.out = results, first, last, out
        self.severity, self.emptied = np.empty(last - first), np.zeros(last - first, dtype=bool)
        self.aspects = out[len(OUTPUTS) :].reshape(-1, 2, last - first)  # the same memory
        self.portions = range(first // PORTION, math.ceil(last / PORTION))
        self.left = iter(self.portions)
        self.flown = self.redrawn = 0  # cases
        self.failures: list[BaseException] = []
        self.lock = threading.Lock()

    def fly(self, threads: int, watch: Callable[[int], None], stopped: Callable[[], bool]) -> tuple[int, int]:
        """Fly the round; returns the number of flown cases, always the first ones, and of redraws."""
        count = min(threads, len(self.portions))
        # Daemons: an interrupt need not wait for the portions that are in work, which nobody uses then.
        workers = [threading.Thread(target=self._work, args=(stopped,), daemon=True) for _ in range(count)]
        for worker in workers:
            worker.start()
        try:
            for worker in workers:
                while worker.is_alive():
                    worker.join(0.1)
                    if worker.is_alive():
                        watch(self.first + self.flown)
        except BaseException:
            self.left = iter(())  # nothing more is begun
            raise
        if self.failures:
            raise self.failures[0]
        return self.flown, self.redrawn

    def _work(self, stopped: Callable[[], bool]) -> None:
        try:
            source, block = self.results.study.source(), -1
            while not stopped():
                with self.lock:
                    portion = next(self.left, None)
                if portion is None:
                    return
                begin, end = max(self.first, portion * PORTION), min(self.last, (portion + 1) * PORTION)
                if begin // BLOCK != block:
                    block = begin // BLOCK
                    drawn = source.block(block)
                redrawn = self._fly(drawn, block * BLOCK, begin, end)
                with self.lock:
                    self.flown += end - begin
                    self.redrawn += redrawn
        except BaseException as failure:  # handed to the thread that waits
            self.failures.append(failure)
            self.left = iter(())

    def _fly(self, drawn: tuple[Draws, NDArray[np.intp]], start: int, begin: int, end: int) -> int:
        """Fly cases ``begin`` to ``end`` of the block that starts at ``start``; returns the number of redraws."""
        study, early, (draws, redrawn) = self.results.study, self.results.early, drawn
        # Whole strides are flown, even for fewer cases: what flies them may let one depend on its stride.
        low, high = begin - begin % STRIDE, end + -end % STRIDE
        ends = study.flies(study.model.cases(some_of(draws, slice(low - start, high - start))))
        outputs = measure(study.model, ends, high - low)
        inner, place = slice(begin - low, end - low), slice(begin - self.first, end - self.first)
        self.out[: len(OUTPUTS), place] = outputs[:, inner]
        self.severity[place] = study.severity(outputs, ends)[inner]
        self.emptied[place] = np.broadcast_to(np.real(ends.drained) > 1.0, high - low)[inner]
        if ends.aspects is not None:
            self.aspects[:, :, place] = ends.aspects[:, :, inner]
        if low < early.shape[1]:
            early[:, begin:end] = vectors(study.model, ends, high - low)[:, inner]
        return int(np.count_nonzero((redrawn >= begin - start) & (redrawn < end - start)))


ROUND = 64 * BLOCK  # cases between two looks at the results
FREED = 32_000_000  # bytes of the largest block that counts for that
EARLY = 2 * BLOCK  # number of first cases whose outcome is kept whole for `sampled_shares`
KEPT_WORST = 1_000  # worst cases that are kept
CONFIDENCE = 0.95  # confidence level of the interval about the fraction that complies
WORTH_SAYING = math.radians(1e-4)  # rad by which cases of falling moments must err for that to be said


def threads_here() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class DrawnCases:
    """Cases of a ``model`` drawn from a ``seed``. They count from 0 here; people see them count from 1."""

    model: Any
    seed: int

    def source(self) -> DrawSource:
        """Draws for one thread."""
        return DrawSource(self.model.inputs.drawn, self.seed, self.model.physical, self.model.groups)

    def draws_of(self, case: int) -> dict[str, float]:
        """Deviations of one case (from 0), by input."""
        return {name: float(np.ravel(draw)[0]) for name, draw in self.draws_of_all(np.array([case])).items()}

    def draws_of_all(self, cases: NDArray[np.intp]) -> dict[str, Array | float]:
        """Deviations of ``cases`` (from 0, ascending), by input."""
        source, blocks, parts = self.source(), cases // BLOCK, list[dict[str, Any]]()
        for block in np.unique(blocks).tolist():
            draws, _ = source.block(block)
            parts.append(some_of(draws, cases[blocks == block] % BLOCK))
        return {
            name: draw if isinstance(draw, float) else np.concatenate([part[name] for part in parts])
            for name, draw in parts[0].items()
        }


@dataclass(frozen=True, eq=False)
class Study(DrawnCases):
    """Study: cases of ``model`` drawn from ``seed``."""

    model: DispersedModel
    seed: int = 1

    @cached_property
    def flies(self) -> RealWidths:
        """Flight model of the cases."""
        return RealWidths(self.model)

    @cached_property
    def first_order(self) -> FirstOrder:
        """Sensitivities of the flight."""
        return as_flown(self.model, self.flies)

    def ends_of(self, draws: Draws) -> Ends:
        """End state of one case with these deviations; none: of the estimate itself."""
        return self.flies(self.model.cases({name: np.atleast_1d(draw) for name, draw in draws.items()}))

    def outputs_of(self, draws: Draws) -> Array:
        """Outputs (5,) of one case with these deviations; none: of the estimate itself."""
        return measure(self.model, self.ends_of(draws), 1)[:, 0]

    @property
    def nominal(self) -> Flight:
        """Estimate itself, flown alone as the cases are."""
        return propagation.flown(self.model.spacecraft, self.model.schedule)

    @property
    def nominal_aspects(self) -> Array:
        """Least and largest angle (m, 2) rad from the spin axis to the direction of each cone in that flight."""
        seen = aspects(self.nominal)[: len(self.model.spacecraft.keep)]
        return np.array([(aspect.least, aspect.largest) for aspect in seen])

    def severity(self, values: Array, ends: Ends) -> Array:
        """Severity of cases, (n,), by their outputs (5, n), cones and propellant; see `requirements.severity`."""
        body, aim = self.model.spacecraft, OUTPUTS.index(requirements.aim(self.model.spacecraft).value)
        shares = [*([] if ends.aspects is None else cones_used(body.keep, ends.aspects)), ends.drained]
        return np.asarray(requirements.severity(body, Left(values[0], values[aim], ends.spin), shares))

    @property
    def lightening_error(self) -> str:
        """Message on the error of falling moments in cases, by the nominal one; empty where negligible."""
        if shed(self.model.spacecraft) is None:
            return ""
        outputs, exact, part = self.outputs_of({}), self.nominal.residual, requirements.aim(self.model.spacecraft)
        aim = exact.momentum_shift if part is Part.SHIFT else exact.axis_error
        errors = {Part.NUTATION: outputs[0] - exact.nutation, part: outputs[OUTPUTS.index(part.value)] - aim}
        if max(map(abs, errors.values())) < WORTH_SAYING:
            return ""
        message = " and ".join(f"{math.degrees(abs(error)):.2g} deg of {part.label}" for part, error in errors.items())
        text = "cases let the moments of inertia fall at the edges of pulses: in the nominal one that errs by"
        return f"{text} {message}"


@dataclass(eq=False)
class Counted:
    """Results of a study so far: the cases from 0 to ``done`` of the ``requested``, of which ``met`` comply."""

    study: Any
    requested: int
    done: int = 0
    redrawn: int = 0
    met: int = 0
    worst: Worst = field(default_factory=lambda: Worst(KEPT_WORST))
    broken: NDArray[np.int64] = field(init=False)  # cases that break each cone, (m,)
    aspects: Array = field(init=False)  # least and largest angle to it in all cases, (m, 2) rad

    def __post_init__(self) -> None:
        cones = len(self.study.model.spacecraft.keep)
        self.broken, self.aspects = np.zeros(cones, dtype=np.int64), np.tile([math.pi, 0.0], (cones, 1))

    def count(self, severity: Array, angles: Array, good: NDArray[np.bool_]) -> None:
        """Count cases from ``done`` on: their `Study.severity` (n,), ``angles`` (m, 2, n) to cones, who may comply."""
        broken = cones_used(self.study.model.spacecraft.keep, angles) > 1.0
        self.met += int(np.count_nonzero(good & ~broken.any(axis=0)))
        self.broken += broken.sum(axis=1)
        self.aspects[:, 0] = np.minimum(self.aspects[:, 0], angles[:, 0].min(axis=1))
        self.aspects[:, 1] = np.maximum(self.aspects[:, 1], angles[:, 1].max(axis=1))
        self.worst.add(self.done, severity)
        self.done += len(severity)

    @property
    def met_fraction(self) -> float | None:
        """Share of cases that comply; None where nothing is required, and there are no cones."""
        return self.met / self.done if self.done and requirements.judged(self.study.model.spacecraft) else None

    @property
    def interval(self) -> tuple[float, float]:
        """Exact interval about `met_fraction`."""
        return binomial_interval(self.met, self.done, CONFIDENCE)

    @property
    def probability(self) -> float:
        """Share of cases that must comply."""
        return required_share(self.study.model.spacecraft.requirement)

    @property
    def meets_requirement(self) -> bool | None:
        """True if enough cases comply; None where nothing is required."""
        fraction = self.met_fraction
        return None if fraction is None else fraction >= self.probability


@dataclass(eq=False)
class Results(Counted):
    """Results of a study of a schedule."""

    study: Study
    emptied: int = 0  # cases whose tank runs empty
    early: Array = field(default_factory=lambda: np.zeros((ROWS, EARLY)))  # `vectors` of the first cases
    values: Array | None = field(init=False)  # outputs, least and largest angle (rad) to each of m cones: (5 + 2m, n)
    sketches: list[Sketch] = field(init=False)  # of the outputs, beyond `EXACT_CASES`, in place of ``values``

    def __post_init__(self) -> None:
        super().__post_init__()
        exact = self.requested <= EXACT_CASES
        self.values = np.empty((self.rows, self.requested)) if exact else None
        self.sketches = [] if exact else [Sketch() for _ in OUTPUTS]

    @property
    def rows(self) -> int:
        """Rows of ``values``."""
        return len(OUTPUTS) + 2 * len(self.study.model.spacecraft.keep)

    @property
    def exact(self) -> bool:
        """True if percentiles are exact."""
        return self.values is not None

    def distribution(self, output: str) -> Distribution | None:
        """Distribution of an output; None where it is unknown (propellant)."""
        row = OUTPUTS.index(output)
        if self.values is None:
            return self.sketches[row] if math.isfinite(self.sketches[row].minimum) else None
        values = self.values[row, : self.done]
        return None if not len(values) or math.isnan(values[0]) else Exact(values)

    @cached_property
    def shares(self) -> dict[str, dict[str, float]]:
        """`sampled_shares` of the first cases, of correlated inputs like `FirstOrder.shares`; call it at the end."""
        count, model = min(self.done, EARLY), self.study.model
        draws = self.study.draws_of_all(np.arange(count))
        drawn = {name: draw for name, draw in draws.items() if not isinstance(draw, float)}  # not of a bias
        return sampled_shares(independent(drawn, model.inputs.drawn, model.groups), self.early[:, :count])

    def take(self, values: Array, severity: Array, angles: Array, emptied: NDArray[np.bool_]) -> None:
        """Count further cases: outputs (5, n), see `count`; ``emptied`` (n,): whose tank runs empty."""
        missed = (severity > 1.0) & bool(requirements.required(self.study.model.spacecraft))
        self.emptied += int(np.count_nonzero(emptied))
        for sketch, row in zip(self.sketches, values, strict=False):
            sketch.add(row)
        self.count(severity, angles, ~(missed | emptied))

    def extended(self, requested: int) -> Results:
        """Copy with room for ``requested`` cases: no fewer than are done, and no more than `EXACT_CASES`."""
        more = replace(self, requested=requested)
        more.broken, more.aspects = self.broken, self.aspects
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

    ``watch`` is called now and then with how many are done; they are kept when ``stopped`` says so. ``collect`` is
    given the number (from 0) of the first of some cases, and their `Results.values`, in order.
    """
    # The C library keeps freed memory up to twice the largest block freed so far: else each stride asks for new pages.
    np.empty(FREED, dtype=np.uint8)
    while results.done < results.requested and not stopped():
        first = results.done
        last = min(results.requested, first - first % ROUND + ROUND)
        out = np.empty((results.rows, last - first)) if results.values is None else results.values[:, first:last]
        flights = Round(results, first, last, out)
        done, redrawn = flights.fly(threads, watch, stopped)
        if done == 0:
            break
        results.redrawn += redrawn
        results.take(out[:, :done], flights.severity[:done], flights.aspects[:, :, :done], flights.emptied[:done])
        if collect is not None:
            collect(first, out[:, :done])
        watch(results.done)
    return results


@dataclass(frozen=True, eq=False, repr=False)
class Dispersed(results.Data, results.Drawn):
    """Many dispersed cases; ``core`` holds their distributions, ``unsaved`` the error of a file that was not saved."""

    core: Counted
    unsaved: CannotWrite | None = None

    @property
    def met_fraction(self) -> float | None:
        """Share of the cases that meet the requirement; None where nothing is required."""
        return self.core.met_fraction

    @property
    def meets_requirement(self) -> bool | None:
        """True where as many cases meet it as the file requires; None where nothing is required."""
        return self.core.meets_requirement

    def to_dict(self, worst: int = 5) -> dict[str, Any]:
        """Contents of the file that the command writes with ``--json``, with as many ``worst`` cases."""
        return finite(results.view(self, "data", worst=worst))

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.core.met} of {self.core.done} cases comply>"


@dataclass(frozen=True, eq=False, repr=False)
class Dispersion(Dispersed):
    """Schedule of a ``scheme`` flown in dispersed cases."""

    core: Results
    scheme: str = ""


SEED = 1  # default seed of the draws


def study_of(spacecraft: Spacecraft, schedule: Schedule, *, seed: int = SEED) -> Study:
    """Study of ``schedule`` with the dispersions of ``spacecraft``; raises BadRequest where it has none."""
    expect_dispersions(spacecraft.dispersions)
    return Study(DispersedModel(spacecraft, schedule), seed)


CASES = 2 * STRIDE  # dispersed cases that are flown for each range: the first ones of the study
TAILS = (0.0015, 0.9985)  # quantiles of the cases between which a flight is as expected
STEPS, HALVINGS = 16, 5  # even steps in which the edge of a window is sought, and halvings of the one that holds it


class Range(NamedTuple):
    """Least and largest value."""

    least: float
    most: float


class Checkpoints:
    """Ranges of the first cases of a ``study``."""

    def __init__(self, study: Study) -> None:
        self.study, self._draws = study, study.draws_of_all(np.arange(CASES))
        self._initial = study.model.cases(self._draws)

    @property
    def spin(self) -> Range:
        """Spin at t = 0, rad/s."""
        return _range(self._initial.omega0[2])

    @property
    def nutation(self) -> Range:
        """Angle from H to the spin axis at t = 0, rad."""
        first, second, axial = map(operator.mul, self._initial.moments, self._initial.omega0)
        return _range(np.arctan2(np.hypot(first, second), np.abs(axial + self._initial.wheel)))

    def nutation_after(self, counts: Sequence[int]) -> Iterator[Range]:
        """Nutation, rad, after the first ``counts`` pulses."""
        body, schedule = self.study.model.spacecraft, self.study.model.schedule
        for count in counts:
            part = study_of(body, first_pulses(schedule, count), seed=self.study.seed)
            yield _range(self._flown(part, self._draws)[0][0])

    def window(self, probability: float) -> Range | None:
        """Shifts (s) of all pulses, to half a turn, with which the share ``probability`` complies; None without any."""
        if not self._complies(0.0, probability):
            return None
        first = min(pulse.loaded[0] for pulse in self.study.model.schedule)
        half = math.pi / self.study.model.spacecraft.fastest
        return Range(-self._reach(-1.0, min(half, first), probability), self._reach(1.0, half, probability))

    def _reach(self, sense: float, most: float, probability: float) -> float:
        """Largest shift one way, s, up to ``most``: in even steps, then by halving the one that is too far."""
        step = most / STEPS
        good = next(
            (step * count for count in range(STEPS) if not self._complies(sense * step * (count + 1), probability)),
            most,
        )
        if good < most:
            for _ in range(HALVINGS):
                step *= 0.5
                good += step * self._complies(sense * (good + step), probability)
        return good

    def _complies(self, shift: float, probability: float) -> bool:
        """True where the share ``probability`` of the cases complies with all pulses ``shift`` s later."""
        late = self._draws.get("timing offset", 0.0) + shift
        _, severity = self._flown(self.study, {**self._draws, "timing offset": late})
        return float(np.mean(severity <= 1.0)) >= probability

    def _flown(self, study: Study, draws: Draws) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Outputs (5, n) and severity (n,) of the cases."""
        ends = study.flies(study.model.cases(draws))
        outputs = measure(study.model, ends, CASES)
        return outputs, np.broadcast_to(study.severity(outputs, ends), CASES)


def _range(values: object) -> Range:
    return Range(*np.quantile(np.broadcast_to(np.asarray(values, dtype=np.float64), CASES), TAILS).tolist())


def first_pulses(schedule: Schedule, count: int) -> Schedule:
    """First ``count`` pulses of a schedule, and the blocks cut to them."""
    blocks, left = list[Block](), count
    for block in schedule.blocks:
        if left > 0:
            blocks.append(replace(block, count=min(block.count, left)))
        left -= block.count
    return replace(schedule, pulses=schedule.pulses[:count], blocks=tuple(blocks))


def even(count: int, most: int) -> list[int]:
    """Up to ``most`` (two or more) of the numbers 1 … ``count``, evenly spaced, with the first and the last."""
    return sorted({round(number) for number in np.linspace(1, count, min(most, count)).tolist()})
