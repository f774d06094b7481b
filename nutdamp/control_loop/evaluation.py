"""Evaluation of a closed loop: as a plan, and against DOP853 firing by firing.

The plan is judged by the motion from the time at which the loop was first down to its stop
threshold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from nutdamp.common import results, work
from nutdamp.control_loop.controller import Case
from nutdamp.control_loop.simulation import SEED, LoopRun, fly, largest_since
from nutdamp.control_loop.stability import (
    Band,
    Margin,
    dead_band,
    expect_in_time,
    held_by,
    margins,
)
from nutdamp.errors import BadRequest, Infeasible
from nutdamp.flight.cones import Aspect, aspects
from nutdamp.flight.dynamics import Dynamics, Path, Push
from nutdamp.flight.end_state import left_on_the_way, seen_at
from nutdamp.flight.propagation import Flight
from nutdamp.flight.verification import command, reference_model
from nutdamp.physics import attitude
from nutdamp.physics.motion import NOTHING
from nutdamp.planning.plan import Plan
from nutdamp.planning.verdict import LOOP, Verdict, judge_loop
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft, SpinState, Vector
from nutdamp.spacecraft.requirements import Held, Left
from nutdamp.spacecraft.schedule import Pulse

if TYPE_CHECKING:
    from nutdamp.flight.reference_model import ReferenceModel

AGREE = 1e-6  # s; firings that begin and last alike to this are the same
# evaluations of Euler's equations by DOP853, at most: a loop flies on where a schedule is over
EVALUATIONS = 1_000_000


@dataclass(frozen=True, eq=False)
class _Solved:
    # A stretch that was integrated, by its interpolant of states in the axes of the file, (7, n).
    axes: Vector
    solution: Callable[[Vector], Vector]
    steps: int = 0

    def motion(self, times: Vector) -> tuple[Vector, Vector]:
        states = self.solution(np.asarray(times, dtype=float)).T
        quaternion = np.roll(
            states[:, 3:] / np.linalg.norm(states[:, 3:], axis=1, keepdims=True), 1, axis=1
        )
        return states[:, :3] @ self.axes, attitude.multiply(
            quaternion, attitude.from_matrix(self.axes)
        )


@dataclass(frozen=True, slots=True)
class _Independent(Dynamics):
    # Moves the body of a file by its reference model, which fires the pulses commanded.
    model: ReferenceModel = field(kw_only=True)
    spacecraft: Spacecraft = field(kw_only=True)

    @property
    def free(self) -> bool:
        return False  # no coast is known in closed form

    def command(self, pulse: Pulse) -> None:
        command(self.model, self.spacecraft, pulse)

    def _path(
        self, state: SpinState, start: float, end: float, push: Push, most: int
    ) -> tuple[Path, SpinState]:
        del push, most  # the model has its own
        inertia, first = self.spacecraft.inertia, self.model.initial
        if start > 0.0:
            rates, quaternion = inertia.in_file_axes(state.rates, state.quaternion)
            first = np.concatenate([rates, np.roll(quaternion, -1)])
        # A stretch that ends where it begins is integrated a little further, to be a motion too.
        path = _Solved(
            inertia.axes, self.model.fly(first, start, max(end, start + 1e-6), work.reach)
        )
        rates, quaternion = path.motion(np.array([end]))
        return path, SpinState.of(rates[0], quaternion[0])


@dataclass(frozen=True, eq=False)
class LoopVerification(results.Data):
    """The ``run`` of a loop and the ``other`` by DOP853, with its ``evaluations`` of the equations;
    ``missing`` is why that was not flown to the end.

    ``pairs``: differences of each firing, start and on-time, s, and nutation before it, rad.
    """

    run: LoopRun
    other: LoopRun | None
    missing: str = ""
    evaluations: int = 0
    pairs: tuple[tuple[float, float, float], ...] = field(default=())

    @property
    def same(self) -> bool:
        """True if the same channels fire in the same order."""
        names = [
            [firing.pulse.channel for firing in run.fired]
            for run in (self.run, self.other)
            if run is not None
        ]
        return len(names) == 2 and names[0] == names[1]

    @property
    def worst(self) -> float:
        """Largest difference of a start or an on-time, s."""
        return max((max(abs(start), abs(lasts)) for start, lasts, _ in self.pairs), default=0.0)

    @property
    def agree(self) -> bool:
        """True if DOP853 confirms every firing to `AGREE`, and the reason for the end."""
        return (
            self.same
            and self.worst <= AGREE
            and self.other is not None
            and self.other.stop is self.run.stop
        )


def verify_loop(
    spacecraft: Spacecraft, until: float | None = None, *, seed: int = SEED
) -> LoopVerification:
    """Fly the loop of the file in closed form and by its reference model.

    Raises Infeasible where it cannot be flown at all, or where fields of the spacecraft were
    replaced.
    """
    loop = requirements.expect_loop(spacecraft)
    run = fly(spacecraft, loop, until, seed=seed)
    model = reference_model(spacecraft, EVALUATIONS)
    moments = spacecraft.inertia.moments
    mover = _Independent(moments, np.zeros(3), NOTHING, model=model, spacecraft=spacecraft)
    try:
        with work.steps(run.until):
            other = fly(spacecraft, loop, run.until, seed=seed, dynamics=mover)
    except Infeasible as reason:
        return LoopVerification(run, None, str(reason), model.evaluations)
    pairs = tuple(
        (
            fired.pulse.loaded[0] - two.pulse.loaded[0],
            fired.pulse.loaded[1] - two.pulse.loaded[1],
            fired.true_nutation - two.true_nutation,
        )
        for fired, two in zip(run.fired, other.fired, strict=False)
    )
    return LoopVerification(run, other, "", model.evaluations, pairs)


@dataclass(frozen=True, eq=False, repr=False)
class LoopPlan(Plan):
    """Pulses fired by a loop in a ``flown_run``, with its flight; ``known`` is the spacecraft as
    the law knows it.

    The same pulses without the sensor leave another nutation where it grows, because errors of
    rounding grow with it.
    """

    flown_run: LoopRun = field(kw_only=True)
    known: Spacecraft = field(kw_only=True)

    @cached_property
    def _flight(self) -> Flight:
        """Motion to the end of the run."""
        return replace(seen_at(self.flown_run.flight, self.flown_run.until), scheme=LOOP)

    @property
    def _carried_at(self) -> float:
        """End of the run, s."""
        return self.flown_run.until

    def _reaching(self, time: float) -> Flight:
        """Flight of the run; raises BadRequest where it ends before ``time`` s."""
        if time > self.flown_run.until:
            raise BadRequest(
                f"the loop is flown to {self.flown_run.until:.6g} s: expected a time up to that"
            )
        return self.flown_run.flight

    @cached_property
    def largest(self) -> tuple[float, float]:
        """Largest nutation since the loop first settled, rad, and its time, s; at the end where it
        never did.
        """
        return largest_since(self.flown_run)

    @property
    def _left(self) -> Left:
        """Largest nutation since the loop first settled; direction of H and spin at the end, angles
        to cones.
        """
        return left_on_the_way(self._flight, self._aspects)._replace(nutation=self.largest[0])

    @property
    def _held(self) -> tuple[Held, ...]:
        """Residual beside each bound; without a requirement the nutation is judged by the
        thresholds of the loop.
        """
        loop = self.flown_run.loop
        return tuple(
            Held(held_by(loop, self.band, line.bound), line.left) for line in super()._held
        )

    @property
    def meets_requirement(self) -> bool | None:
        """Compliance as of any plan; False where the loop was stopped or never settled."""
        meets = super().meets_requirement
        return False if meets is not None and self.flown_run.lost else meets

    @cached_property
    def verdict(self) -> Verdict:
        """Judgement of this run: by its bounds, and by whether the loop was stopped or never falls
        quiet.
        """
        run = self.flown_run
        return judge_loop(
            self.spacecraft,
            self._held,
            flight=self._flight,
            observed=self._aspects,
            feasible=not run.stop.fault,
            lost=run.lost,
        )

    @cached_property
    def _aspects(self) -> tuple[Aspect, ...]:
        """Extreme angles of the spin axis from each watched direction, to the end of the run."""
        return aspects(self._flight, self.flown_run.until)

    @cached_property
    def margins(self) -> tuple[Margin, ...]:
        """Stability margin of each channel at the start threshold."""
        return margins(self.known, requirements.expect_loop(self.known))

    @cached_property
    def band(self) -> Band:
        """Dead band of the nutation by design."""
        return dead_band(self.known, requirements.expect_loop(self.known))


def loop_of(
    spacecraft: Spacecraft, until: float | None = None, *, seed: int = SEED, case: int | None = None
) -> LoopPlan:
    """Loop of the file flown to ``until`` s with the noise of ``seed``; as dispersed in a ``case``
    of it, from 0.

    Raises Infeasible where no law can work, and where its firings would feed the nutation by how
    late they come.
    """
    loop = requirements.expect_loop(spacecraft)
    expect_in_time(spacecraft, loop)
    flown = Case(spacecraft, (seed,))
    law = None
    if case is not None:
        from nutdamp.control_loop.dispersion import loop_study  # most flights are none of a study

        study = loop_study(spacecraft, until, seed=seed)
        flown = study.case(case)
        law = study.law
        until = study.until
    truth = flown.truth
    run = fly(truth, truth.loop or loop, until, seed=flown.key, law=law, scatter=flown.scatter)
    return LoopPlan(truth, LOOP, run.schedule, _from_file=True, flown_run=run, known=spacecraft)
