"""Simulation of the closed loop event by event: coast in closed form, decide by samples, fire real widths, judge."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from nutdamp.control_loop.controller import GRID, Coast, Course, Fired, Joined, Pilot, Scatter
from nutdamp.control_loop.law import Ending, Law
from nutdamp.control_loop.sensor import Signal
from nutdamp.control_loop.stability import dead_band
from nutdamp.flight.dynamics import Dynamics, Path, make_dynamics
from nutdamp.flight.propagation import Flight, Leg
from nutdamp.flight.track import widest
from nutdamp.physics import taylor
from nutdamp.physics.triaxial import arc_cones
from nutdamp.spacecraft.equipment import Loop
from nutdamp.spacecraft.model import Spacecraft, SpinState
from nutdamp.spacecraft.schedule import Pulse, Schedule

SEED = 1
"""Default seed of the noise."""

LEFT = 0.1
"""Share of the stop threshold that a last firing leaves, about."""

SMALLEST = 1e-3
"""Share of the start threshold from which a cycle of growing nutation is counted at least."""

REGROWN = 2_000_000
"""Largest number of samples in a wait for the nutation to grow again."""

ROWS = 2000
"""Even moments at which the largest nutation of a run is looked for."""


@dataclass(frozen=True, eq=False)
class LoopRun:
    """Loop flown to ``until`` s: its firings, the reason of its end, and the channel to blame.

    ``key``: seed of the noise, and the number of the dispersed case from 1 where it is one.
    ``quiet``: the times (s) from which it saw no more than the stop threshold, until the next start; ``lost``: see
    `Pilot`.
    """

    spacecraft: Spacecraft
    loop: Loop
    until: float
    key: tuple[int, ...]
    fired: tuple[Fired, ...]
    stop: Ending
    channel: str | None
    quiet: tuple[float, ...]
    lost: bool
    looked_at: int
    flight: Flight

    @property
    def schedule(self) -> Schedule:
        """Fired pulses."""
        return self.flight.schedule

    @property
    def seed(self) -> int:
        """Seed of the noise."""
        return self.key[0]

    @property
    def case(self) -> int | None:
        """Number of the dispersed case, from 1; None for the file itself."""
        return self.key[1] if len(self.key) > 1 else None

    @property
    def settled(self) -> float | None:
        """Time at which the loop was first down to the stop threshold, s; None where it never was."""
        return self.quiet[0] if self.quiet else None


def until_default(spacecraft: Spacecraft, loop: Loop) -> float:
    """Default end of a flight, s: the horizon, and before it the time until the nutation starts the loop.

    Where the nutation grows again from what is left, a cycle longer, in which at most `REGROWN` samples are looked at.
    """
    growth, now = spacecraft.growth, math.tan(spacecraft.nutation)
    if growth <= 0.0:
        return spacecraft.horizon
    first = math.tan(loop.start)
    waits = math.log(first / now) / growth if 0.0 < now < first else 0.0
    low = max(LEFT * math.tan(max(loop.stop, 0.5 * dead_band(spacecraft, loop).step)), SMALLEST * first)
    step = spacecraft.body_period / GRID if loop.sensor.rate is None else 1.0 / loop.sensor.rate
    return waits + spacecraft.horizon + min(max(math.log(first / low), 0.0) / growth, REGROWN * step)


def fly(
    spacecraft: Spacecraft,
    loop: Loop,
    until: float | None = None,
    *,
    seed: int | tuple[int, ...] = SEED,
    law: Law | None = None,
    scatter: Scatter | None = None,
    dynamics: Dynamics | None = None,
) -> LoopRun:
    """Fly the loop of a ``spacecraft`` to ``until`` s; ``dynamics`` flies it by another integrator.

    ``law`` is that on board, where it does not know spacecraft and sensor as they are in truth, and ``scatter`` what
    its firings are off by. Raises Infeasible where no law can work, or the flight takes too many samples or firings.
    """
    end = until_default(spacecraft, loop) if until is None else until
    key = seed if isinstance(seed, tuple) else (seed,)
    return Alone.of(spacecraft, loop, end, key, law or Law(spacecraft, loop), scatter, dynamics).fly()


def largest_since(run: LoopRun) -> tuple[float, float]:
    """Largest nutation since a loop first settled, rad, and its time, s; at the end where it never did."""
    flight, body = run.flight, run.spacecraft
    if run.settled is None:
        rates = flight.motion(np.array([run.until]))[0][0]
        return arc_cones(flight.moments, rates, body.sense, body.inertia.wheel).nutation, run.until
    track = widest(flight.sampled(ROWS, run.until), np.asarray(flight.moments), body.sense, body.inertia.wheel)
    later = track.t >= run.settled
    most = float(track.nutation[later].max())
    row = int(np.argmax(later & (track.nutation >= most * (1.0 - 1e-9))))  # not where rounding has its largest
    return float(track.nutation[row]), float(track.t[row])


class Alone:
    """Single flight in progress, stretch by stretch."""

    def __init__(self, pilot: Pilot, signal: Signal, dynamics: Dynamics, key: tuple[int, ...]) -> None:
        self.pilot, self.signal, self.dynamics, self.key = pilot, signal, dynamics, key
        self.legs: list[Leg] = []

    @classmethod
    def of(
        cls,
        spacecraft: Spacecraft,
        loop: Loop,
        until: float,
        key: tuple[int, ...],
        law: Law,
        scatter: Scatter | None = None,
        dynamics: Dynamics | None = None,
    ) -> Alone:
        """Flight of a ``spacecraft`` and its ``loop`` as they are in truth; see `fly`."""
        moves = dynamics or make_dynamics(spacecraft)
        free = make_dynamics(spacecraft).free  # the body's, so that any integrator flies the same decisions
        pilot = Pilot(spacecraft, loop, until, law, free=free, scatter=scatter)
        return cls(pilot, Signal(spacecraft, loop.sensor, key), moves, key)

    def fly(self) -> LoopRun:
        """Coast and fire until the end, or until something is wrong."""
        pilot, state, now = self.pilot, self.pilot.truth.initial, 0.0
        coast = self._coast(state, now)
        while (seen := coast.look(pilot.until, active=pilot.active)) is not None:
            step = pilot.step(coast, seen)
            if step is Course.OVER:
                break
            if isinstance(step, float):
                coast = coast.later(step)
            elif isinstance(step, Pulse):
                begin = self._coasted(coast, state, now, step.thrust[0])
                pilot.take(step, abs(complex(pilot.law.seen(begin.omega))), begin.spin)
                state, now = self._fire(step, begin), step.thrust[1]
                coast = self._coast(state, now)
        self._coasted(coast, state, now, max(pilot.until, now))
        return self._run(state)

    def _coasted(self, coast: Coast, state: SpinState, start: float, end: float) -> SpinState:
        """Motion at the ``end`` of a coast that began as ``state``; where it was integrated to be seen, as it was."""
        if coast.parts and not self.dynamics.free:
            there, path = coast.at(end), Joined(coast.parts)
            self._leg(start, end, path)
            return there
        arc, there = self.dynamics.path(state, start, end, most=taylor.MOST_STEPS)
        self._leg(start, end, arc)
        return there

    def _coast(self, state: SpinState, since: float) -> Coast:
        return Coast(self.pilot.law, self.signal, self.dynamics, state, since)

    def _fire(self, pulse: Pulse, state: SpinState) -> SpinState:
        """Motion through the thrust of a pulse, from its beginning to its end."""
        for start, end in itertools.pairwise(sorted(set(pulse.edges))):
            push = pulse.push(start, end)
            torque, slope = ([], None) if push is None else ([push[0]], push[1])
            path, state = self.dynamics.path(state, start, end, torque, slope, most=taylor.MOST_STEPS)
            self._leg(start, end, path, firing=True, last=end == pulse.thrust[1])
        return state

    def _leg(self, start: float, end: float, path: Path, *, firing: bool = False, last: bool = False) -> None:
        done = len(self.pilot.fired) - firing
        self.legs.append(Leg(start, end, path, done, jump=start == 0.0, completed_at_end=done + last))

    def _run(self, settled: SpinState) -> LoopRun:
        """Run that ends its firings with the motion ``settled``."""
        pilot = self.pilot
        schedule = Schedule(tuple(firing.pulse for firing in pilot.fired))
        spans = tuple(pulse.thrust for pulse in schedule)
        moments = self.dynamics.moments
        flight = Flight(pilot.truth, schedule, tuple(self.legs), settled, moments, spans, until=pilot.until)
        return LoopRun(
            pilot.truth,
            pilot.loop,
            pilot.until,
            self.key,
            tuple(pilot.fired),
            pilot.ending[0],
            pilot.ending[1] or None,
            tuple(pilot.quiet),
            pilot.lost,
            pilot.looked_at,
            flight,
        )
