"""Fly the closed loop event by event: coast in closed form, decide by samples, fire through the real width, judge."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.dynamics import make_dynamics
from nutdamp.errors import Infeasible
from nutdamp.flight import Flight, Leg
from nutdamp.limits import commandable
from nutdamp.loop.diagnosis import STALE, Diagnosis, Glimpse, Stop
from nutdamp.loop.law import Firing, Law
from nutdamp.loop.sensor import Signal
from nutdamp.loop.watch import GRID, MOST, Coast, Found, Mover, Seen
from nutdamp.loop_settings import ACCELEROMETER, Loop
from nutdamp.motion import Path
from nutdamp.physics import rigid
from nutdamp.schedule import Pulse, Schedule, channel_pulse
from nutdamp.spacecraft import Spacecraft, SpinState
from nutdamp.supply import Supply

SEED = 1
"""Of the noise, where none is named."""

MOST_FIRINGS = 10_000
"""Firings of one flight, at most."""

NO_NOISE = 8.0
"""Sigmas that noise does not reach: a chance of 1e-15 a sample."""

WAVES = 40.0
"""Time constants of the low-pass filter after which it has forgotten how it began."""


class Fired(NamedTuple):
    """A firing: the ``pulse`` as it acts, when it was ``decided`` on (s), and the nutation (rad) that was seen then.

    ``true_nutation`` rad is what it was in truth as the pulse began.
    """

    pulse: Pulse
    decided: float
    seen: float
    true_nutation: float


@dataclass(frozen=True, eq=False)
class Run:
    """A loop flown to ``until`` s with the noise of ``seed``: its firings, why it ended, and the channel to blame.

    ``quiet``: the times (s) from which it saw no more than the stop threshold, until the next start.
    """

    spacecraft: Spacecraft
    loop: Loop
    until: float
    seed: int
    fired: tuple[Fired, ...]
    stop: Stop
    channel: str | None
    quiet: tuple[float, ...]
    looked_at: int
    flight: Flight

    @property
    def schedule(self) -> Schedule:
        """The pulses that were fired."""
        return self.flight.schedule

    @property
    def settled(self) -> float | None:
        """When it was first down to the stop threshold, s; None where it never was."""
        return self.quiet[0] if self.quiet else None


def until_default(spacecraft: Spacecraft, loop: Loop) -> float:
    """End of a flight where none is named, s: the horizon, and before it the time until the nutation starts it."""
    growth, now = spacecraft.growth, math.tan(spacecraft.nutation)
    waits = math.log(math.tan(loop.start) / now) / growth if growth > 0.0 < now < math.tan(loop.start) else 0.0
    return waits + spacecraft.horizon


def fly(
    spacecraft: Spacecraft,
    loop: Loop,
    until: float | None = None,
    *,
    seed: int = SEED,
    dynamics: Mover | None = None,
) -> Run:
    """The loop of a ``spacecraft`` flown to ``until`` s; ``dynamics`` flies it by another integrator.

    Raises Infeasible where no law can work, or the flight takes too many samples or firings.
    """
    end = until_default(spacecraft, loop) if until is None else until
    return _Pilot(spacecraft, loop, end, seed, dynamics or make_dynamics(spacecraft)).fly()


class _Pilot:
    """One flight in the making."""

    def __init__(self, truth: Spacecraft, loop: Loop, until: float, seed: int, dynamics: Mover) -> None:
        self.truth, self.loop, self.until, self.seed, self.dynamics = truth, loop, until, seed, dynamics
        self.law, self.signal = Law(truth, loop), Signal(truth, loop.sensor, seed)
        self.diagnosis = Diagnosis(self.law.period)
        self.most = min(MOST_FIRINGS, truth.limits.max_pulses or MOST_FIRINGS)
        self.channels = {channel.name: channel for channel in truth.channels}
        self.supply = Supply(truth)
        self.fired: list[Fired] = []
        self.legs: list[Leg] = []
        self.quiet: list[float] = []
        self.active, self.looked_at = False, 0
        self.ready, self.ending = truth.limits.earliest, (Stop.END, "")
        self._pending: tuple[Pulse, Firing, Glimpse] | None = None
        self._seen: list[Seen] = []

    def fly(self) -> Run:
        """Coast and fire until the end, or until something is wrong."""
        state, now = self.truth.initial, 0.0
        while True:
            found = self._next(Coast(self.law, self.signal, self.dynamics, state, now))
            pulse = None if found is None else self._pulse(found)
            if found is None or pulse is None:
                break
            path, begin = self.dynamics.path(state, now, pulse.thrust[0], most=rigid.MOST_STEPS)
            self._leg(now, pulse.thrust[0], path)
            self._take(found, pulse, begin)
            state, now = self._fire(pulse, begin), pulse.thrust[1]
        last = max(self.until, now)
        self._leg(now, last, self.dynamics.path(state, now, last, most=rigid.MOST_STEPS)[0])
        return self._run(state)

    def _fire(self, pulse: Pulse, state: SpinState) -> SpinState:
        """The motion through the thrust of a pulse, from its beginning to its end."""
        for start, end in itertools.pairwise(sorted(set(pulse.edges))):
            push = pulse.push(start, end)
            torque, slope = ([], None) if push is None else ([push[0]], push[1])
            path, state = self.dynamics.path(state, start, end, torque, slope, most=rigid.MOST_STEPS)
            self._leg(start, end, path, firing=True, last=end == pulse.thrust[1])
        return state

    def _leg(self, start: float, end: float, path: Path, *, firing: bool = False, last: bool = False) -> None:
        done = len(self.fired) - firing
        self.legs.append(Leg(start, end, path, done, jump=start == 0.0, completed_at_end=done + last))

    def _run(self, settled: SpinState) -> Run:
        """The run, which ends its firings with the motion ``settled``."""
        stop, channel = self.ending
        schedule = Schedule(tuple(one.pulse for one in self.fired))
        spans = tuple(pulse.thrust for pulse in schedule)
        made = Flight(self.truth, schedule, tuple(self.legs), settled, self.dynamics.moments, spans, until=self.until)
        return Run(
            self.truth,
            self.loop,
            self.until,
            self.seed,
            tuple(self.fired),
            stop,
            channel or None,
            tuple(self.quiet),
            self.looked_at,
            made,
        )

    def _pulse(self, found: Found) -> Pulse | None:
        """What the channel does in truth when it is commanded; None where it may not, or not before the end."""
        channel = self.channels[found.actuator.channel.name]
        made = channel_pulse(channel, found.start + found.firing.lead, found.firing.on_time)
        if channel.valve is not None:
            made = commandable(self.truth, made)
        if made.over > self.until:
            return None
        if len(self.fired) == self.most:
            self.ending = Stop.FULL, ""
            if self.most == MOST_FIRINGS:
                raise Infeasible(f"more than {MOST_FIRINGS} firings by {made.start:.6g} s; an earlier end helps")
            return None
        made = self.supply.fire(made, channel)
        if channel.name not in self.loop.reversed:
            return made
        torque, force = (None if one is None else -one for one in (made.torque, made.force))
        return replace(made, impulse=-made.impulse, torque=torque, force=force)

    def _take(self, found: Found, pulse: Pulse, begin: SpinState) -> None:
        """Notes a firing, and what was seen before it."""
        seen = self._seen[-1]
        spin = float(seen.spin[found.row])
        shown = float(self.law.nutation(abs(seen.z[found.row]), spin))
        true = float(self.law.nutation(abs(complex(self.law.seen(begin.omega))), begin.spin))
        self.fired.append(Fired(pulse, found.now, shown, true))
        glimpse = self._glimpse(pulse.t, found.row, last=True)
        self._pending = None if glimpse is None else (pulse, found.firing, glimpse)
        self.ready = pulse.over + max(self.loop.min_interval, self.truth.limits.gap)

    def _glimpse(self, centre: float, row: int, *, last: bool) -> Glimpse | None:
        """What was seen on this coast up to a ``row`` of the last stretch: of the ``last`` period, or of the first."""
        parts = [one if one is not self._seen[-1] else one.up_to(row) for one in self._seen]
        times = np.concatenate([one.times for one in parts])
        best, spin = np.concatenate([one.best for one in parts]), np.concatenate([one.spin for one in parts])
        known = ~np.isnan(best)
        if not known.any():
            return None
        times, best, spin = times[known], best[known], spin[known]
        edge = times[-1] - self.law.period if last else times[0] + self.law.period
        near = times >= edge if last else times <= edge
        rate = complex(self.law.rate(float(spin[-1])), self.law.growth)
        return Glimpse.of(times[near], best[near], rate, centre)

    def _next(self, coast: Coast) -> Found | None:
        """The next firing; None where the end, or a fault, comes first."""
        self._seen = []
        while (seen := coast.look(self.until)) is not None:
            self.looked_at += len(seen.times)
            if self.looked_at > MOST:
                raise Infeasible(
                    f"more than {MOST:.2g} samples by {coast.since:.6g} s; an earlier end, or a lower rate, helps"
                )
            self._seen.append(seen)
            found = self._decide(coast, seen)
            if found is not None or self.ending[0].fault:
                return None if self.ending[0].fault else found
            self._seen = self._seen[-3:] if self._pending is None else self._seen
            later = None if self.active or self._pending is not None else self._idle_until(coast, seen)
            if later is not None:
                coast = Coast(self.law, self.signal, self.dynamics, coast.at(later), later)
                self._seen = []
        return None

    def _decide(self, coast: Coast, seen: Seen) -> Found | None:
        """The first firing among the moments of a stretch; thresholds and firings are judged in their order."""
        waits = coast.waits(seen)
        fires = coast.triggered(waits)
        shown = self.law.nutation(np.abs(seen.z), seen.spin)
        row, count = 0, len(seen.times)
        while row < count:
            if not self.active:
                begins = _first(np.asarray(shown >= self.loop.start), row)
                if begins is None:
                    break
                self.active, row = True, begins
            downs, fire = _first(np.asarray(shown <= self.loop.stop), row), _first(np.asarray(fires.any(axis=0)), row)
            if downs is not None and (fire is None or downs <= fire):
                self.active, row = False, downs + 1
                self.diagnosis.rest()
                self.quiet.append(float(seen.now[downs]))
                continue
            if fire is None:
                break
            if self._faulty(coast, seen, fire):
                return None
            found = self._allowed(coast, seen, fire, np.flatnonzero(fires[:, fire]).tolist())
            if found is not None:
                return found
            row = fire + 1
        if count and not (self._pending is not None and seen.times[-1] < self._known(coast)):
            self._faulty(coast, seen, count - 1)
        return None

    def _known(self, coast: Coast) -> float:
        """When enough has been seen of the coast after a firing to judge it, s."""
        return coast.estimator.first + 0.25 * self.law.period

    def _faulty(self, coast: Coast, seen: Seen, row: int) -> bool:
        """Judges the last firing by what was seen since, up to a ``row``; whether the loop has to stop."""
        if self._pending is not None:
            pulse, firing, before = self._pending
            after = self._glimpse(pulse.t, row, last=False)
            if after is not None and seen.now[row] > pulse.t + STALE * self.law.period:
                self._pending = None
            elif after is not None:
                self._pending = None
                estimator = coast.estimator
                doubt = (estimator.doubt(before.samples), estimator.doubt(after.samples), estimator.offset)
                verdict = self.diagnosis.judge(pulse.channel, float(seen.now[row]), before, after, firing.acts, doubt)
                if verdict is not None:
                    self.ending = verdict
        if self._pending is None and not self.ending[0].fault:
            overdue = self.diagnosis.overdue(float(seen.now[row]))
            if overdue is not None:
                self.ending = overdue
        return self.ending[0].fault

    def _allowed(self, coast: Coast, seen: Seen, row: int, channels: list[int]) -> Found | None:
        """The firing at a row, on a tick, if the limits allow it."""
        usable = [index for index in channels if self.law.actuators[index].channel.name != self.diagnosis.suspect]
        found = coast.found(seen, row, usable)
        if found is None:
            return None
        windows = self.law.windows
        start = windows.nearest_tick(found.start)
        start = windows.tick_after(found.start) if start < found.now else start
        return found._replace(start=start) if windows.allows(start, found.firing.lasts, self.ready) else None

    def _idle_until(self, coast: Coast, seen: Seen) -> float | None:
        """When the sensor can first show the start threshold, less what it takes to be looking; None where soon."""
        body, law = self.truth, self.law
        if not self.dynamics.free or not len(seen.times):
            return None
        estimator, loop = coast.estimator, self.loop
        now, spin = float(seen.times[-1]), float(seen.spin[-1])
        threshold = law.size(loop.start, spin)
        margin = estimator.offset + NO_NOISE * estimator.doubt(1)
        share = 0.5 if loop.sensor.kind == ACCELEROMETER else 1.0
        reach = (share * threshold - margin) / abs(loop.sensor.scale)
        size = abs(complex(law.seen(coast.at(now).omega)))
        if reach <= size:
            return None
        growth = body.growth
        # tan θ grows by e^{κt}, and |ω| by no more.
        waits = math.log(reach / size) / growth if growth > 0.0 < size else math.inf
        later = min(now + waits, self.until) - max(law.period, WAVES * loop.sensor.low_pass) - law.period / GRID
        return later if later > now + law.period else None


def _first(mask: NDArray[np.bool_], row: int) -> int | None:
    """Number of the first true one from ``row`` on."""
    found = int(np.argmax(mask[row:]))
    return row + found if mask[row + found] else None
