"""A closed loop as a plan: what it fired, judged by the motion from when it was first down to its stop threshold."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from nutdamp.aspect import Aspect, aspects
from nutdamp.compliance import Left
from nutdamp.errors import Infeasible
from nutdamp.flight import Flight
from nutdamp.loop.run import SEED, Run, fly, largest_since
from nutdamp.loop.stability import Band, Margin, dead_band, feeding, margins, too_late
from nutdamp.outcome import left_by, seen_at
from nutdamp.planning import Plan
from nutdamp.spacecraft import Spacecraft

LOOP = "loop"
"""Name in place of a scheme."""


@dataclass(frozen=True, eq=False, repr=False)
class LoopPlan(Plan):
    """The pulses that a loop fired in a ``run``; its flight is the one in which it fired them, to the end of the run.

    ``known`` is the spacecraft as the law knows it, where that is not the truth.
    With growing nutation the same pulses fired again without looking would not do the same: errors of rounding grow.
    """

    run: Run | None = None
    known: Spacecraft | None = None

    @property
    def flown_run(self) -> Run:
        """The run."""
        assert self.run is not None
        return self.run

    @cached_property
    def flight(self) -> Flight:
        """The motion to the end of the run."""
        return replace(seen_at(self.flown_run.flight, self.flown_run.until), scheme=LOOP)

    @cached_property
    def largest(self) -> tuple[float, float]:
        """The largest nutation from when the loop was first quiet, rad, and when, s; of the end where it never was."""
        return largest_since(self.flown_run)

    @property
    def left(self) -> Left:
        """The largest nutation since it was first quiet; direction of H and spin at the end."""
        return left_by(self.flight)._replace(nutation=self.largest[0])

    @property
    def meets_requirement(self) -> bool | None:
        """As of any plan; not where the loop was stopped or never quiet."""
        found = super().meets_requirement
        return False if found is not None and self.flown_run.lost else found

    @cached_property
    def aspects(self) -> tuple[Aspect, ...]:
        """How near the spin axis comes to each direction that is watched, to the end of the run."""
        return aspects(self.flight, self.flown_run.until)

    @cached_property
    def margins(self) -> tuple[Margin, ...]:
        """How far each channel is from feeding the nutation, at the start threshold."""
        return margins(self._known, self._known.loop or self.flown_run.loop)

    @cached_property
    def band(self) -> Band:
        """How much nutation the loop leaves by what it was built for."""
        return dead_band(self._known, self._known.loop or self.flown_run.loop)

    @property
    def _known(self) -> Spacecraft:
        return self.known or self.spacecraft


def loop_of(
    spacecraft: Spacecraft, until: float | None = None, *, seed: int = SEED, case: int | None = None
) -> LoopPlan:
    """The loop of the file flown to ``until`` s with the noise of ``seed``; as dispersed in a ``case`` of it, from 0.

    Raises Infeasible where no law can work, and where its firings would feed the nutation by how late they come.
    """
    loop = spacecraft.loop
    assert loop is not None
    late = feeding(spacecraft, loop)
    if late is not None:
        raise Infeasible(too_late(late))
    if case is None:
        run = fly(spacecraft, loop, until, seed=seed)
        return LoopPlan(spacecraft, LOOP, run.schedule, from_file=True, run=run)
    from nutdamp.loop.study import loop_study  # most flights are none of a study

    study = loop_study(spacecraft, until, seed=seed)
    one = study.case(case)
    assert one.truth.loop is not None
    run = fly(one.truth, one.truth.loop, study.until, seed=one.key, law=study.law, scatter=one.scatter)
    return LoopPlan(one.truth, LOOP, run.schedule, from_file=True, run=run, known=spacecraft)
