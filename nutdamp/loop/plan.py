"""A closed loop as a plan: what it fired, judged by the motion from when it was first down to its stop threshold."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from nutdamp.compliance import Left
from nutdamp.errors import Infeasible
from nutdamp.flight import Flight
from nutdamp.loop.run import SEED, Run, fly
from nutdamp.loop.stability import Band, Margin, dead_band, feeding, margins
from nutdamp.outcome import left_by, seen_at
from nutdamp.planning import Plan
from nutdamp.spacecraft import Spacecraft
from nutdamp.track import widest

LOOP = "loop"
"""Name in place of a scheme."""

ROWS = 2000
"""Even moments at which the largest nutation is looked for."""


@dataclass(frozen=True, eq=False, repr=False)
class LoopPlan(Plan):
    """The pulses that a loop fired in a ``run``; its flight is the one in which it fired them, to the end of the run.

    With growing nutation the same pulses fired again without looking would not do the same: errors of rounding grow.
    """

    run: Run | None = None

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
        run = self.flown_run
        if run.settled is None:
            return self.flight.residual.nutation, run.until
        made = run.flight
        track = widest(made.sampled(ROWS, run.until), made.moments, self.spacecraft.spin)
        later = track.t >= run.settled
        most = float(track.nutation[later].max())
        row = int(np.argmax(later & (track.nutation >= most * (1.0 - 1e-9))))  # not where rounding has its largest
        return float(track.nutation[row]), float(track.t[row])

    @property
    def left(self) -> Left:
        """The largest nutation since it was first quiet; direction of H and spin at the end."""
        return left_by(self.flight)._replace(nutation=self.largest[0])

    @cached_property
    def margins(self) -> tuple[Margin, ...]:
        """How far each channel is from feeding the nutation, at the start threshold."""
        return margins(self.spacecraft, self.flown_run.loop)

    @cached_property
    def band(self) -> Band:
        """How much nutation the loop leaves by what it was built for."""
        return dead_band(self.spacecraft, self.flown_run.loop)


def loop_of(spacecraft: Spacecraft, until: float | None = None, *, seed: int = SEED) -> LoopPlan:
    """The loop of the file flown to ``until`` s with the noise of ``seed``.

    Raises Infeasible where no law can work, and where its firings would feed the nutation by how late they come.
    """
    loop = spacecraft.loop
    assert loop is not None
    late = feeding(spacecraft, loop)
    if late is not None:
        raise Infeasible(too_late(late))
    run = fly(spacecraft, loop, until, seed=seed)
    return LoopPlan(spacecraft, LOOP, run.schedule, from_file=True, run=run)


def too_late(margin: Margin) -> str:
    """Why a loop does not damp, before it is flown: what to say of one of its channels."""
    degrees = np.degrees(margin.late)
    theta = np.degrees(margin.nutation)
    what = f"a firing of {margin.channel} leaves {100.0 * margin.gain:.4g} % of a nutation of {theta:.4g} deg"
    if margin.growth > 1.0:
        what += f", which grows by {100.0 * (margin.growth - 1.0):.3g} % in a period"
    if margin.delay == -np.inf:
        return f"the loop does not damp: {what}; raise start, or allow other on-times"
    late = f"it comes up to {degrees:.4g} deg late, and damps up to {np.degrees(margin.latest):.4g} deg"
    return f"the loop does not damp: {what}: {late}; shorten the delays by {-margin.delay:.4g} s, or set predict: true"
