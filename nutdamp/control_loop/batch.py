"""Batch simulation of closed loops, each with its own body, sensor and noise.

Each loop decides by its own `Pilot`, the same that flies alone. Coasts and their samples, closed forms of a
symmetric body, are computed together for all loops that have looked as often since they last fired.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.control_loop.controller import SAMPLED, Course, Pilot, Scatter, Seen, Watch
from nutdamp.control_loop.law import Ending, Law
from nutdamp.control_loop.sensor import Noise, felt, stepped
from nutdamp.control_loop.simulation import Alone, largest_since
from nutdamp.errors import Infeasible
from nutdamp.flight import end_state
from nutdamp.montecarlo.cases import watch_over
from nutdamp.physics import attitude, batch, energy_sink
from nutdamp.physics.taylor import Forcing
from nutdamp.physics.triaxial import arc_cones
from nutdamp.spacecraft.equipment import ACCELEROMETER
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import Pulse

TOGETHER = 1 << 16
"""Samples times cases that are worked out together: few enough that they stay in the cache."""

Rows = NDArray[np.int_]


class Case(NamedTuple):
    """Case of a loop: the true spacecraft with its loop; the ``key`` of its noise, and the errors of firings.

    ``tilt`` rad is by how much the attitude at t = 0 is off, about the body axes 1 and 2.
    """

    truth: Spacecraft
    key: tuple[int, ...]
    scatter: Scatter | None = None
    tilt: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class FlownLoops:
    """End of the loops of ``cases``: firings and judgements of the ``pilots``, and the motion at the end.

    ``rates`` (3, n) rad/s, ``quaternion`` (4, n) from the body axes of t = 0. ``quiet`` (n,) rad is the nutation as a
    loop first fell quiet, ``largest`` (n,) the largest of its coasts since; that of the end where it never did.
    ``aspects`` (m, 2, n) rad: least and largest angle from the spin axis to the direction of each cone of the file.
    """

    cases: Sequence[Case]
    pilots: list[Pilot]
    rates: Vector
    quaternion: Vector
    quiet: Vector
    largest: Vector
    aspects: Vector

    def momentum(self, rates: Vector) -> Vector:
        """Angular momentum (3, n) N m s of the true bodies at ``rates`` (3, n) rad/s, in body axes."""
        bodies = zip(self.cases, rates.T, strict=True)
        return np.array([case.truth.inertia.momentum(turning) for case, turning in bodies]).T


@dataclass(frozen=True, eq=False)
class _Group:
    """Coasts that have been looked at as often: the ``rows`` of their cases, and the ``numbers`` of the next samples.

    ``lanes`` are what the decisions of each are made with.
    """

    rows: Rows
    watch: Watch
    numbers: Rows
    lanes: list[Watch]

    def some(self, places: Any) -> _Group:
        """Subset at some of the places."""
        lanes = [self.lanes[place] for place in places.tolist()]
        return _Group(self.rows[places], self.watch.some(places), self.numbers[places], lanes)

    def parts(self, size: int) -> Iterator[_Group]:
        """Parts of at most ``most`` cases."""
        if len(self.rows) <= size:
            yield self
            return
        for begin in range(0, len(self.rows), size):
            yield self.some(np.arange(begin, min(begin + size, len(self.rows))))


def expects_alone(law: Law, spacecraft: Spacecraft) -> str:
    """Reason why loops of a law and a spacecraft can only be flown alone; empty where they go together."""
    if law.loop.sensor.rate is None:
        return "a continuous signal"
    if spacecraft.disturbances:
        return "disturbances"
    return "" if spacecraft.inertia.symmetric else "three different moments of inertia"


def fly_together(
    law: Law, cases: Sequence[Case], until: float, watch: Callable[[int], None] = lambda _: None
) -> FlownLoops:
    """Loops of ``cases``, flown to ``until`` s; ``watch`` is called with the number of finished ones.

    Bodies are symmetric and nothing acts on them but their pulses and dissipation; see `expects_alone`.
    """
    return _Fleet(law, cases, until).fly(watch)


def fly_alone(
    law: Law, cases: Sequence[Case], until: float, watch: Callable[[int], None] = lambda _: None
) -> FlownLoops:
    """`fly_together`, each loop by itself, for any disturbance and sensor."""
    count = len(cases)
    rates, quaternion = np.empty((3, count)), np.empty((4, count))
    quiet, largest, pilots = np.full(count, math.nan), np.empty(count), []
    aspects = np.empty((len(law.spacecraft.keep), 2, count))
    for row, case in enumerate(cases):
        alone = Alone.of(case.truth, case.truth.loop or law.loop, until, case.key, law, case.scatter)
        run = alone.fly()
        pilots.append(alone.pilot)
        end = run.flight.motion(np.array([run.flight.legs[-1].end]))
        rates[:, row] = end[0][0]
        quaternion[:, row] = attitude.multiply(attitude.conjugate(case.truth.initial.quaternion), end[1][0])
        if run.settled is not None:
            at = run.flight.motion(np.array([run.settled]))[0][0]
            inertia = case.truth.inertia
            quiet[row] = arc_cones(inertia.moments, at, case.truth.sense, inertia.wheel).nutation
        largest[row] = largest_since(run)[0]
        if law.spacecraft.keep:
            seen = (aspect for aspect in end_state.aspects(run.flight, run.until) if aspect.keep in law.spacecraft.keep)
            aspects[:, :, row] = [(aspect.least, aspect.largest) for aspect in seen]
        watch(row + 1)
    return FlownLoops(cases, pilots, rates, quaternion, quiet, largest, aspects)


class _Fleet:
    """Flights in the making."""

    def __init__(self, law: Law, cases: Sequence[Case], until: float) -> None:
        self.law, self.cases, self.until = law, cases, until
        loops = [case.truth.loop for case in cases]
        self.pilots = [
            Pilot(case.truth, loop or law.loop, until, law, free=True, scatter=case.scatter)
            for case, loop in zip(cases, loops, strict=True)
        ]
        sensors = [pilot.loop.sensor for pilot in self.pilots]
        columns = 1 if law.loop.sensor.kind == ACCELEROMETER else 2
        self.noises = [Noise(case.key, columns) for case in cases]
        self.scales, self.biases = (
            np.array(each) for each in zip(*((s.scales, s.biases) for s in sensors), strict=True)
        )
        self.noise, self.delays = (np.array(each) for each in zip(*((s.noise, s.delay) for s in sensors), strict=True))
        moments = np.array([case.truth.inertia.moments for case in cases]).T
        wheels = np.array([case.truth.inertia.wheel for case in cases])
        self.bodies = batch.Bodies(moments, np.zeros(3), Forcing(growth=law.growth, wheel=wheels))
        self.rates = np.array([case.truth.omega0 for case in cases]).T.copy()
        self.quaternion = np.zeros((4, len(cases)))
        self.quaternion[0] = 1.0
        self.watch = watch_over(law.spacecraft, tuple(np.array([case.tilt for case in cases]).T), len(cases))
        self.now = np.zeros(len(cases))
        self.settled = np.full(len(cases), math.inf)
        self.quiet, self.largest = np.full(len(cases), math.nan), np.full(len(cases), -math.inf)

    def fly(self, watch: Callable[[int], None]) -> FlownLoops:
        """Fly all loops to their ends."""
        groups, over = [self._begun(np.arange(len(self.pilots)))], 0
        while groups:
            groups, fired, later = self._round(groups)
            if fired:
                self._fire(fired)
            if later:
                self._go(np.array([row for row, _ in later]), np.array([time for _, time in later]))
            fresh = np.array(sorted([row for row, _ in (*fired, *later)]), dtype=int)
            if len(fresh):
                groups.append(self._begun(fresh))
            left = sum(len(group.rows) for group in groups)
            if len(self.pilots) - left > over:
                over = len(self.pilots) - left
                watch(over)
        rows = np.arange(len(self.pilots))
        self._go(rows, np.maximum(self.until, self.now))
        unsettled = np.isinf(self.settled)
        self.largest[unsettled] = self._nutation(rows)[unsettled]
        ends = self.rates, self.quaternion, self.quiet, self.largest
        return FlownLoops(self.cases, self.pilots, *ends, self.watch.angles)

    def _begun(self, rows: Rows) -> _Group:
        """Coasts of cases that begin now."""
        since = self.now[rows]
        watch = Watch(self.law, since[:, None])
        lanes = [Watch(self.law, start) for start in since.tolist()]
        return _Group(rows, watch, watch.first(since), lanes)

    def _round(self, groups: Iterable[_Group]) -> tuple[list[_Group], list[tuple[int, Pulse]], list[tuple[int, float]]]:
        """One look at every coast: those that go on, pulses, and times until which nothing is to be seen."""
        going: list[_Group] = []
        fired: list[tuple[int, Pulse]] = []
        later: list[tuple[int, float]] = []
        for whole in groups:
            for group in whole.parts(max(TOGETHER // whole.watch.reach, 1)):
                stays = []
                for place, seen in enumerate(self._look(group)):
                    row = int(group.rows[place])
                    step = Course.OVER if seen is None else self._decided(self.pilots[row], group.lanes[place], seen)
                    if self.pilots[row].quiet and math.isinf(self.settled[row]):
                        self.settled[row] = self.pilots[row].quiet[0]
                    if step is Course.ON:
                        stays.append(place)
                    elif isinstance(step, Pulse):
                        fired.append((row, step))
                    elif isinstance(step, float):
                        later.append((row, step))
                if stays:
                    going.append(group if len(stays) == len(group.rows) else group.some(np.array(stays)))
        return going, fired, later

    def _decided(self, pilot: Pilot, lane: Watch, seen: Seen) -> Pulse | float | Course:
        """Next action of a loop; one that fires without end is over."""
        try:
            return pilot.step(lane, seen)
        except Infeasible:
            pilot.ending = Ending.FULL, ""
            return Course.OVER

    def _look(self, group: _Group) -> Iterator[Seen | None]:
        """Next samples of the coasts of a group, one after the other; None for those that are over."""
        rows, watch, sensor = group.rows, group.watch, self.law.loop.sensor
        assert sensor.rate is not None
        last = np.floor((self.until - self.delays[rows]) * sensor.rate + SAMPLED).astype(int)
        counts = np.clip(last - group.numbers + 1, 0, watch.reach)
        count = int(counts.max())
        if not count:
            yield from itertools.repeat(None, len(rows))
            return
        times: Vector = np.asarray((group.numbers[:, None] + np.arange(count)) * watch.estimator.step, dtype=np.float64)
        omega, spin = self._motion(rows, times)
        moments = self.bodies.moments[:, rows, None]
        shown = np.stack(felt(sensor, moments, (omega.real, omega.imag, spin)), axis=-1)
        values = shown * self.scales[rows, None] + self.biases[rows, None]
        noisy = self.noise[rows] > 0.0
        if noisy.any():
            drawn = [self.noises[row].of(first, count) for row, first in zip(rows, group.numbers.tolist(), strict=True)]
            values = values + self.noise[rows, None, None] * np.array(drawn)
        active = np.array([self.pilots[row].active for row in rows])
        z, best, nutation, fires = watch.judged(times, stepped(sensor, values), spin, active)
        ends = np.maximum(counts - 1, 0)
        sizes = np.abs(self.law.seen(omega[np.arange(len(rows)), ends])).tolist()
        decided: Vector = times + self.delays[rows, None]
        group.numbers[:] += count
        watch.reach = watch.doubled
        for place, (end, size) in enumerate(zip(counts.tolist(), sizes, strict=True)):
            at = (place, slice(0, end))
            seen = Seen(times[at], decided[at], z[at], best[at], spin[at], nutation[at], fires[:, *at], size)
            yield seen if end else None

    def _motion(self, rows: Rows, times: Vector) -> tuple[NDArray[np.complex128], Vector]:
        """ω and ω3 (cases, n) of coasts at ``times`` (cases, n) s."""
        first, _, third = self.bodies.moments[:, rows, None]
        x, y, z = self.rates[:, rows, None]
        forcing, since = self.bodies.forcing, times - self.now[rows, None]
        wheel = forcing.wheel[rows, None]
        return energy_sink.rates_on_arc(first, third, forcing.growth, x + 1j * y, z, since, wheel)

    def _nutation(self, rows: Rows, growing: Vector | float = 0.0) -> Vector:
        """θ (n,) rad of cases now, and with tan θ grown by e to the power ``growing``."""
        h1, h2, h3 = self.bodies.some(rows).momentum(self.rates[:, rows])
        return np.asarray(np.arctan2(np.hypot(h1, h2) * np.exp(growing), np.abs(h3)))

    def _go(self, rows: Rows, times: Vector) -> None:
        """Coasts to ``times`` (n,) s."""
        now, settled, growth = self.now[rows], self.settled[rows], self.law.growth
        since = settled <= times
        if since.any():
            seen = rows[since]
            begin = np.maximum(settled, now)[since]
            nutation = self._nutation(seen, growth * (begin - now[since]))
            self.largest[seen] = np.maximum(self.largest[seen], nutation)
            self.quiet[seen] = np.where(np.isnan(self.quiet[seen]), nutation, self.quiet[seen])
        self._advance(rows, times - now, None, None)
        self.now[rows] = times
        if since.any():
            self.largest[seen] = np.maximum(self.largest[seen], self._nutation(seen))

    def _advance(self, rows: Rows, lasts: Vector, torque: Vector | None, slope: Vector | None) -> None:
        motion = self.now[rows], self.rates[:, rows], self.quaternion[:, rows]
        here = batch.MotionStretch(self.bodies.some(rows), *motion, torque, slope)
        if self.law.spacecraft.keep:
            self.watch.some(rows).motion(here, lasts)
        batch.advance(here, lasts)
        self.rates[:, rows], self.quaternion[:, rows] = here.rates, here.quaternion

    def _fire(self, fired: list[tuple[int, Pulse]]) -> None:
        """Pulses of cases, from the beginning of their thrust to its end."""
        rows = np.array([row for row, _ in fired])
        self._go(rows, np.array([pulse.thrust[0] for _, pulse in fired]))
        sizes = np.abs(self.law.seen(self.rates[0, rows] + 1j * self.rates[1, rows])).tolist()
        for (row, pulse), size, spin in zip(fired, sizes, self.rates[2, rows].tolist(), strict=True):
            self.pilots[row].take(pulse, size, spin)
        spans = [list(itertools.pairwise(sorted(set(pulse.edges)))) for _, pulse in fired]
        for number in range(max(map(len, spans))):
            on = [place for place, span in enumerate(spans) if number < len(span)]
            pushes = [fired[place][1].push(*spans[place][number]) or (np.zeros(3), None) for place in on]
            lasts = np.array([spans[place][number][1] - spans[place][number][0] for place in on])
            torque = np.array([push for push, _ in pushes]).T
            slope = np.array([np.zeros(3) if rise is None else rise for _, rise in pushes]).T
            self._advance(rows[on], lasts, torque, slope if slope.any() else None)
            self.now[rows[on]] += lasts
        self.now[rows] = [pulse.thrust[1] for _, pulse in fired]
