"""Simulation of closed loops: one event by event, and many in batches, each with its own body,
sensor and noise.

In a batch each loop decides by its own `Pilot`, the same that flies alone; coasts and their
samples, closed forms of a symmetric body, are computed together for all loops that have looked as
often since they last fired.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.control_loop.controller import (
    GRID,
    LONGEST,
    SAMPLED,
    Case,
    Coast,
    Course,
    Ending,
    Pilot,
    Scatter,
    Seen,
    Watch,
)
from nutdamp.control_loop.law import Law
from nutdamp.control_loop.sensor import Noise, Signal, felt, stepped
from nutdamp.control_loop.stability import dead_band
from nutdamp.errors import Infeasible
from nutdamp.flight import cones
from nutdamp.flight.dynamics import Dynamics, Joined, Path, make_dynamics
from nutdamp.flight.propagation import Flight, Leg, widest
from nutdamp.montecarlo.cases import watch_over
from nutdamp.physics import attitude, energy_sink
from nutdamp.physics.motion import MOST_STEPS, Bodies, Forcing, MotionStretch, advance
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.equipment import Loop
from nutdamp.spacecraft.model import Spacecraft, SpinState, Vector
from nutdamp.spacecraft.schedule import Pulse, Schedule

SEED = 1  # default seed of the noise
LEFT = 0.1  # share of the stop threshold that a last firing leaves, about
SMALLEST = (
    1e-3  # share of the start threshold from which a cycle of growing nutation is counted at least
)
REGROWN = 2_000_000  # largest number of samples in a wait for the nutation to grow again
ROWS = 2000  # even moments at which the largest nutation of a run is looked for


class LoopRun:
    """Loop of a ``case`` flown to ``until`` s: its firings, the reason of its end, and the
    ``channel`` to blame.

    ``case``: number of the dispersed case, from 1, or None. ``quiet``: times (s) from which it saw
    no more than the stop threshold, ``settled`` the first of them, None without; ``lost``: see
    `Pilot`.
    """

    def __init__(
        self,
        law: Law,
        case: Case,
        until: float,
        dynamics: Dynamics | None = None,
    ) -> None:
        own = make_dynamics(case.truth)
        # Free as the body is: so that any integrator flies the same decisions.
        pilot = self.pilot = Pilot(law, case, until, free=own.free)
        self.dynamics = dynamics or own
        self.loop = pilot.loop
        self.until = until
        self.key, self.seed, self.case = (
            case.key,
            case.key[0],
            case.key[1] if len(case.key) > 1 else None,
        )
        self.legs: list[Leg] = []
        state = pilot.truth.initial
        now = 0.0
        signal = Signal(case.truth, self.loop.sensor, case.key)
        coast = Coast(pilot.law, signal, self.dynamics, state, now)
        while (seen := coast.look(self.until, active=pilot.active)) is not None:
            step = pilot.step(coast, seen)
            if step is Course.OVER:
                break
            if isinstance(step, float):
                coast = coast.later(step)
            elif isinstance(step, Pulse):
                begin = self._coasted(coast, state, now, step.thrust[0])
                pilot.take(step, abs(complex(pilot.law.seen(begin.omega))), begin.spin)
                state = self._fire(step, begin)
                now = step.thrust[1]
                coast = Coast(pilot.law, signal, self.dynamics, state, now)
        self._coasted(coast, state, now, max(self.until, now))
        self.fired, self.quiet = tuple(pilot.fired), tuple(pilot.quiet)
        self.settled = self.quiet[0] if self.quiet else None
        self.stop = pilot.ending[0]
        self.channel = pilot.ending[1] or None
        self.lost, self.looked_at = pilot.lost, pilot.looked_at
        self.schedule = Schedule(tuple(firing.pulse for firing in self.fired))
        legs, spans = tuple(self.legs), tuple(pulse.thrust for pulse in self.schedule)
        self.flight = Flight(
            case.truth, self.schedule, legs, state, self.dynamics.moments, spans, until=until
        )

    def _coasted(self, coast: Coast, state: SpinState, start: float, end: float) -> SpinState:
        """Motion at the ``end`` of a coast that began as ``state``; where it was integrated to be
        seen, as it was.
        """
        if coast.parts and not self.dynamics.free:
            arrived = coast.at(end)
            path: Path = Joined([(begin, part.motion) for begin, part in coast.parts])
        else:
            path, arrived = self.dynamics.path(state, start, end, most=MOST_STEPS)
        self._leg(start, end, path)
        return arrived

    def _fire(self, pulse: Pulse, state: SpinState) -> SpinState:
        self.dynamics.command(pulse)
        for start, end in itertools.pairwise(sorted(set(pulse.edges))):
            push = pulse.push(start, end)
            torque, slope = ([], None) if push is None else ([push[0]], push[1])
            path, state = self.dynamics.path(state, start, end, torque, slope, most=MOST_STEPS)
            self._leg(start, end, path, firing=True, last=end == pulse.thrust[1])
        return state

    def _leg(
        self, start: float, end: float, path: Path, *, firing: bool = False, last: bool = False
    ) -> None:
        done = len(self.pilot.fired) - firing
        self.legs.append(
            Leg(start, end, path, done, jump=start == 0.0, completed_at_end=done + last)
        )


def until_default(spacecraft: Spacecraft, loop: Loop) -> float:
    """Default end of a flight, s: the horizon, and before it the time until the nutation starts the
    loop.

    Where the nutation grows again from what is left, a cycle longer, in which at most `REGROWN`
    samples are looked at.
    """
    if spacecraft.growth <= 0.0:
        return spacecraft.horizon
    first = math.tan(loop.start)
    waits = requirements.reached(spacecraft, loop.start)
    low = max(
        LEFT * math.tan(max(loop.stop, 0.5 * dead_band(spacecraft, loop).step)), SMALLEST * first
    )
    step = spacecraft.body_period / GRID if loop.sensor.rate is None else 1.0 / loop.sensor.rate
    again = requirements.reached(spacecraft, loop.start, math.atan(low))
    return (
        (waits if math.isfinite(waits) else 0.0) + spacecraft.horizon + min(again, REGROWN * step)
    )


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

    ``law`` is that on board, where it does not know spacecraft and sensor as they are in truth, and
    ``scatter`` what its firings are off by. Raises Infeasible where no law can work, or the flight
    takes too many samples or firings.
    """
    end = until_default(spacecraft, loop) if until is None else until
    key = seed if isinstance(seed, tuple) else (seed,)
    case = Case(
        spacecraft if spacecraft.loop is loop else replace(spacecraft, loop=loop), key, scatter
    )
    with work.budget("the loop", work.LOOP):
        return LoopRun(law or Law(spacecraft, loop), case, end, dynamics)


def largest_since(run: LoopRun) -> tuple[float, float]:
    """Largest nutation since a loop first settled, rad, and its time, s; at the end where it never
    did.
    """
    flight, spacecraft = run.flight, run.flight.spacecraft
    if run.settled is None:
        rates = flight.motion(np.array([run.until]))[0][0]
        inertia = replace(spacecraft.inertia, moments=flight.moments)
        return inertia.cones(rates, spacecraft.sense).nutation, run.until
    track = widest(
        flight.sampled(ROWS, run.until),
        np.asarray(flight.moments),
        spacecraft.sense,
        spacecraft.inertia.wheel,
    )
    later = track.t >= run.settled
    peak = float(track.nutation[later].max())
    row = int(
        np.argmax(later & (track.nutation >= peak * (1.0 - 1e-9)))
    )  # not where rounding has its largest
    return float(track.nutation[row]), float(track.t[row])


TOGETHER = (
    1 << 16
)  # samples times cases that are worked out together: few enough that they stay in the cache

Rows = NDArray[np.int_]


@dataclass(frozen=True, eq=False)
class FlownLoops:
    """End of the loops of ``cases``: firings and judgements of the ``pilots``, and the motion at
    the end.
    """

    cases: Sequence[Case]
    pilots: list[Pilot]
    rates: Vector  # (3, n) rad/s
    quaternion: Vector  # (4, n) from the body axes of t = 0
    quiet: Vector  # (n,) rad: nutation as a loop first fell quiet
    largest: (
        Vector  # (n,) rad: nutation of its coasts since, at most; at the end where it never did
    )
    # (m, 2, n) rad: least and largest angle from the spin axis to the direction of each cone
    aspects: Vector

    def momentum(self, rates: Vector) -> Vector:
        """Angular momentum (3, n) N m s of the true bodies at ``rates`` (3, n) rad/s,
        in body axes.
        """
        bodies = zip(self.cases, rates.T, strict=True)
        return np.array([case.truth.inertia.momentum(turning) for case, turning in bodies]).T


@dataclass(frozen=True, eq=False)
class _Group:
    """Coasts looked at as often: the ``rows`` of their cases, and the ``numbers`` of the next
    samples.
    """

    rows: Rows
    watch: Watch
    numbers: Rows

    def some(self, places: Any) -> _Group:
        """Subset at some of the places."""
        return _Group(self.rows[places], self.watch.some(places), self.numbers[places])

    def parts(self, size: int) -> Iterator[_Group]:
        """Parts of at most ``size`` cases."""
        if len(self.rows) <= size:
            yield self
            return
        for begin in range(0, len(self.rows), size):
            yield self.some(np.arange(begin, min(begin + size, len(self.rows))))


def expects_alone(law: Law, spacecraft: Spacecraft) -> str:
    """Reason why loops of a law and a spacecraft can only be flown alone; empty where they go
    together.
    """
    if law.loop.sensor.rate is None:
        return "a continuous signal"
    if spacecraft.disturbances:
        return "disturbances"
    drawn = spacecraft.dispersions is not None and spacecraft.dispersions.inertia_tensor
    alike = spacecraft.inertia.symmetric and not drawn
    return "" if alike else "three different moments of inertia"


def fly_alone(
    law: Law, cases: Sequence[Case], until: float, watch: Callable[[int], None] = lambda _: None
) -> FlownLoops:
    """Loops as of a `Fleet`, each flown by itself, for any disturbance and sensor."""
    count = len(cases)
    rates, quaternion = np.empty((3, count)), np.empty((4, count))
    quiet = np.full(count, math.nan)
    largest = np.empty(count)
    pilots = []
    aspects = np.empty((len(law.spacecraft.keep), 2, count))
    for row, case in enumerate(cases):
        run = LoopRun(law, case, until)
        pilots.append(run.pilot)
        end = run.flight.motion(np.array([run.flight.legs[-1].end]))
        rates[:, row] = end[0][0]
        quaternion[:, row] = attitude.multiply(
            attitude.conjugate(case.truth.initial.quaternion), end[1][0]
        )
        if run.settled is not None:
            at = run.flight.motion(np.array([run.settled]))[0][0]
            quiet[row] = case.truth.inertia.cones(at, case.truth.sense).nutation
        largest[row] = largest_since(run)[0]
        if law.spacecraft.keep:
            seen = (
                aspect
                for aspect in cones.aspects(run.flight, run.until)
                if aspect.keep in law.spacecraft.keep
            )
            aspects[:, :, row] = [(aspect.least, aspect.largest) for aspect in seen]
        watch(row + 1)
    return FlownLoops(cases, pilots, rates, quaternion, quiet, largest, aspects)


class Fleet:
    """Loops of ``cases`` flown together to ``until`` s, or (``once``) to the last pulse before each
    falls quiet: symmetric bodies without disturbance, see `expects_alone`.
    """

    def __init__(
        self, law: Law, cases: Sequence[Case], until: float, *, once: bool = False
    ) -> None:
        self.law, self.cases, self.until, self.once = law, cases, until, once
        self.pilots = [Pilot(law, case, until, free=True, once=once) for case in cases]
        sensors = [pilot.loop.sensor for pilot in self.pilots]
        self.noises = [Noise(case.key, law.loop.sensor) for case in cases]
        self.scales = np.array([sensor.scales for sensor in sensors])
        self.biases = np.array([sensor.biases for sensor in sensors])
        self.noise, self.delays = np.array(
            [(sensor.noise, sensor.delay) for sensor in sensors]
        ).T.copy()
        moments = np.array([case.truth.inertia.moments for case in cases]).T
        wheels = np.array([case.truth.inertia.wheel for case in cases])
        self.bodies = Bodies(
            moments, np.zeros(3), Forcing((), law.growth, wheels, law.spacecraft.sense)
        )
        self.rates = np.array([case.truth.omega0 for case in cases]).T.copy()
        self.quaternion = np.zeros((4, len(cases)))
        self.quaternion[0] = 1.0
        self.watch = watch_over(
            law.spacecraft, tuple(np.array([case.tilt for case in cases]).T), len(cases)
        )
        self.now = np.zeros(len(cases))
        self.settled = np.full(len(cases), math.inf)
        self.quiet, self.largest = np.full(len(cases), math.nan), np.full(len(cases), -math.inf)

    def fly(self, watch: Callable[[int], None] = lambda _: None) -> FlownLoops:
        """Fly all loops to their ends; ``watch`` is called with the number of finished ones."""
        groups = [self._begun(np.arange(len(self.pilots)))]
        over = 0
        while groups:
            groups, fired, later = self._round(groups)
            if fired:
                self._fire(fired)
            if later:
                self._go(np.array([row for row, _ in later]), np.array([time for _, time in later]))
            fresh = np.array(sorted([row for row, _ in (*fired, *later)]), dtype=int)
            if len(fresh):
                groups.append(self._begun(fresh))
            flying = sum(len(group.rows) for group in groups)
            if len(self.pilots) - flying > over:
                over = len(self.pilots) - flying
                watch(over)
        rows = np.arange(len(self.pilots))
        if not self.once:
            self._go(rows, np.maximum(self.until, self.now))
        unsettled = np.isinf(self.settled)
        self.largest[unsettled] = self._nutation(rows)[unsettled]
        ends = self.rates, self.quaternion, self.quiet, self.largest
        return FlownLoops(self.cases, self.pilots, *ends, self.watch.angles)

    def _begun(self, rows: Rows) -> _Group:
        watch = Watch(self.law, self.now[rows, None])
        return _Group(rows, watch, watch.first(self.now[rows]))

    def _round(
        self, groups: Iterable[_Group]
    ) -> tuple[list[_Group], list[tuple[int, Pulse]], list[tuple[int, float]]]:
        """One look at every coast: those that go on, pulses, and times until which nothing is to be
        seen.
        """
        going: list[_Group] = []
        fired: list[tuple[int, Pulse]] = []
        later: list[tuple[int, float]] = []
        for whole in groups:
            for group in whole.parts(max(TOGETHER // whole.watch.reach, 1)):
                stays = []
                for place, seen in enumerate(self._look(group)):
                    row = int(group.rows[place])
                    step = Course.OVER if seen is None else self._decided(row, seen)
                    if self.pilots[row].quiet and math.isinf(self.settled[row]):
                        self.settled[row] = self.pilots[row].quiet[0]
                    if step is Course.ON:
                        stays.append(place)
                    elif isinstance(step, Pulse):
                        fired.append((row, step))
                    elif isinstance(step, float):
                        later.append((row, step))
                if stays:
                    going.append(
                        group if len(stays) == len(group.rows) else group.some(np.array(stays))
                    )
        return going, fired, later

    def _decided(self, row: int, seen: Seen) -> Pulse | float | Course:
        """Next action of a loop; one that fires without end is over."""
        try:
            return self.pilots[row].step(Watch(self.law, float(self.now[row])), seen)
        except Infeasible:
            self.pilots[row].ending = Ending.FULL, ""
            return Course.OVER

    def _look(self, group: _Group) -> Iterator[Seen | None]:
        """Next samples of the coasts of a group, one after the other;
        None for those that are over.
        """
        rows, watch, sensor = group.rows, group.watch, self.law.loop.sensor
        assert sensor.rate is not None
        last = np.floor((self.until - self.delays[rows]) * sensor.rate + SAMPLED).astype(int)
        counts = np.clip(last - group.numbers + 1, 0, watch.reach)
        count = int(counts.max())
        if not count:
            yield from itertools.repeat(None, len(rows))
            return
        times: Vector = np.asarray(
            (group.numbers[:, None] + np.arange(count)) * watch.estimator.step, dtype=np.float64
        )
        moments = self.bodies.moments[:, rows, None]
        forcing = self.bodies.forcing
        x, y, axial = self.rates[:, rows, None]
        wheel, now = forcing.wheel[rows, None], self.now[rows, None]
        omega, spin = energy_sink.rates_on_arc(
            moments[0],
            moments[2],
            forcing.growth,
            x + 1j * y,
            axial,
            times - now,
            wheel,
            forcing.sense,
        )
        shown = np.stack(felt(sensor, moments, (omega.real, omega.imag, spin)), axis=-1)
        values = shown * self.scales[rows, None] + self.biases[rows, None]
        if (self.noise[rows] > 0.0).any():
            drawn = [
                self.noises[row].of(first, count)
                for row, first in zip(rows, group.numbers.tolist(), strict=True)
            ]
            values = values + self.noise[rows, None, None] * np.array(drawn)
        active = np.array([self.pilots[row].active for row in rows])
        z, best, nutation, fires = watch.judged(times, stepped(sensor, values), spin, active)
        ends = np.maximum(counts - 1, 0)
        sizes = np.abs(self.law.seen(omega[np.arange(len(rows)), ends])).tolist()
        decided: Vector = times + self.delays[rows, None]
        group.numbers[:] += count
        watch.reach = min(2 * watch.reach, LONGEST)
        for place, (end, size) in enumerate(zip(counts.tolist(), sizes, strict=True)):
            at = (place, slice(0, end))
            seen = Seen(
                times[at], decided[at], z[at], best[at], spin[at], nutation[at], fires[:, *at], size
            )
            yield seen if end else None

    def _nutation(self, rows: Rows, since: Vector | float = 0.0) -> Vector:
        """θ (n,) rad of cases after a coast ``since`` (n,) s from now."""
        bodies = self.bodies.some(rows)
        (A, _, C), (x, y, axial), (_, growth, wheel, sense, _) = (
            bodies.moments,
            self.rates[:, rows],
            bodies.forcing,
        )
        times = np.broadcast_to(since, x.shape)
        omega, spin = energy_sink.rates_on_arc(A, C, growth, x + 1j * y, axial, times, wheel, sense)
        return np.asarray(np.arctan2(A * np.abs(omega), np.abs(C * spin + wheel)))

    def _go(self, rows: Rows, times: Vector) -> None:
        """Coasts to ``times`` (n,) s."""
        now, settled = self.now[rows], self.settled[rows]
        since = settled <= times
        if since.any():
            seen = rows[since]
            begin = np.maximum(settled, now)[since]
            nutation = self._nutation(seen, begin - now[since])
            self.largest[seen] = np.maximum(self.largest[seen], nutation)
            self.quiet[seen] = np.where(np.isnan(self.quiet[seen]), nutation, self.quiet[seen])
        self._advance(rows, times - now, None, None)
        self.now[rows] = times
        if since.any():
            self.largest[seen] = np.maximum(self.largest[seen], self._nutation(seen))

    def _advance(
        self, rows: Rows, lasts: Vector, torque: Vector | None, slope: Vector | None
    ) -> None:
        motion = self.now[rows], self.rates[:, rows], self.quaternion[:, rows]
        stretch = MotionStretch(self.bodies.some(rows), *motion, torque, slope)
        if self.law.spacecraft.keep:
            self.watch.some(rows).motion(stretch, lasts)
        advance(stretch, lasts)
        self.rates[:, rows], self.quaternion[:, rows] = stretch.rates, stretch.quaternion

    def _fire(self, fired: list[tuple[int, Pulse]]) -> None:
        rows = np.array([row for row, _ in fired])
        self._go(rows, np.array([pulse.thrust[0] for _, pulse in fired]))
        sizes = np.abs(self.law.seen(self.rates[0, rows] + 1j * self.rates[1, rows])).tolist()
        for (row, pulse), size, spin in zip(
            fired, sizes, self.rates[2, rows].tolist(), strict=True
        ):
            self.pilots[row].take(pulse, size, spin)
        spans = [list(itertools.pairwise(sorted(set(pulse.edges)))) for _, pulse in fired]
        for number in range(max(map(len, spans))):
            on = [place for place, span in enumerate(spans) if number < len(span)]
            pushes = [
                fired[place][1].push(*spans[place][number]) or (np.zeros(3), None) for place in on
            ]
            lasts = np.array([spans[place][number][1] - spans[place][number][0] for place in on])
            torque = np.array([push for push, _ in pushes]).T
            slope = np.array([np.zeros(3) if rise is None else rise for _, rise in pushes]).T
            self._advance(rows[on], lasts, torque, slope if slope.any() else None)
            self.now[rows[on]] += lasts
        self.now[rows] = [pulse.thrust[1] for _, pulse in fired]
