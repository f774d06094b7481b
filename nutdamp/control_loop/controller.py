"""On-board controller of one loop: samples of a coast, stretch by stretch, to firings, and the
diagnosis of these.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.control_loop.law import Actuator, ComplexArray, Firing, Law
from nutdamp.control_loop.sensor import Doubt, Estimator, Signal
from nutdamp.errors import Infeasible, Unsuitable
from nutdamp.flight.dynamics import Dynamics, Path, Supply, joined, shed, weakened
from nutdamp.physics.motion import MOST_STEPS
from nutdamp.spacecraft.constraints import commandable
from nutdamp.spacecraft.model import Spacecraft, SpinState, Vector
from nutdamp.spacecraft.schedule import Pulse, channel_pulse, on_command
from nutdamp.spacecraft.tolerances import Tolerance

# moments per nutation period at which a continuous signal is examined for a firing in between
GRID = 64
LONGEST = 1024  # moments looked at together, at most
LOOKED = 2e-3  # units of work of a moment looked at
MOST = round(work.LOOP / LOOKED)  # moments looked at in a flight, at most: a day of 100 Hz
# part of a sampling interval by which a sample at the end of a pulse may come before it: rounding
SAMPLED = 1e-6
REFINED = 60  # steps, at most, in which the moment of a firing is found between two of the `GRID`


class Seen(NamedTuple):
    """Some moments (n,) of a coast."""

    times: Vector  # of the samples, s
    now: Vector  # of the decisions on them, s
    z: ComplexArray  # transverse rate by the law then, rad/s
    best: ComplexArray  # that known at ``times``
    spin: Vector  # ω3, rad/s
    shown: Vector  # nutation by ``z``, rad
    fires: NDArray[np.bool_]  # (channels, n): True where each comes to fire
    size: float  # true |z| at the last sample, rad/s


class Decided(NamedTuple):
    """Firing decided ``now`` s on row ``row`` of the samples: it starts at ``start`` s."""

    row: int
    now: float
    start: float
    actuator: Actuator
    firing: Firing


class Watch:
    """Evaluation of samples of coasts from ``since`` s on, (cases, 1) for many; ``reach``: how many
    come together.
    """

    def __init__(self, law: Law, since: Any) -> None:
        self.law = law
        self.sensor = law.loop.sensor
        self.estimator = Estimator(law, self.sensor, since)
        step = self.estimator.step or law.period / GRID
        self.reach = min(max(round(0.5 * law.period / step), 2), LONGEST)
        # s from decision to start of a firing: until the next sample, where the law predicts.
        self.ahead = self.estimator.step if law.loop.predict else 0.0
        self._waits: Vector | None = None

    def first(self, since: Any) -> Any:
        """Number of the first sample of a coast from ``since`` s on."""
        assert self.sensor.rate is not None
        return np.ceil(since * self.sensor.rate - SAMPLED).astype(int)

    def judged(
        self, times: Vector, values: Vector, spin: Vector, active: NDArray[np.bool_]
    ) -> tuple[ComplexArray, ComplexArray, Vector, NDArray[np.bool_]]:
        """Estimates: z on board, best z, nutation, and triggers (channels, ..., n) where the loop
        is or gets active.
        """
        raw = self.estimator.feed(times, values, spin)
        z = self.estimator.on_board(raw, spin)
        best = self.estimator.best(raw, spin)
        shown = self.law.nutation(np.abs(z), spin)
        fires = np.zeros((len(self.law.actuators), *times.shape), dtype=bool)
        awake = active | np.any(shown >= self.law.loop.start, axis=-1)
        before = np.full((*fires.shape[:-1], 1), math.nan) if self._waits is None else self._waits
        if np.all(awake):
            waits = self.waits(z, spin)
            fires = self.triggered(np.concatenate([before, waits], axis=-1))
            self._waits = waits[..., -1:]
        else:
            self._waits = self.waits(z[..., -1:], spin[..., -1:])
            if np.any(awake):
                waits = np.concatenate(
                    [before[:, awake], self.waits(z[awake], spin[awake])], axis=-1
                )
                fires[:, awake] = self.triggered(waits)
        return z, best, shown, fires

    def some(self, cases: NDArray[Any]) -> Watch:
        """Subset of the cases."""
        subset = copy.copy(self)
        subset.estimator = self.estimator.some(cases)
        subset._waits = None if self._waits is None else self._waits[:, cases]
        return subset

    def firing(self, seen: Seen, row: int, actuator: Actuator) -> Decided | None:
        """Firing of a channel decided at ``row``, if it would help."""
        now = float(seen.now[row])
        firing = self.law.firing(actuator, complex(seen.z[row]), float(seen.spin[row]))
        if firing is None:
            return None
        return Decided(
            row,
            now,
            now + (max(firing.wait, 0.0) if self.law.loop.predict else 0.0),
            actuator,
            firing,
        )

    def waits(self, z: ComplexArray, spin: Vector) -> Vector:
        """`Law.waits` of all channels, (channels, ..., n)."""
        return np.array([self.law.waits(actuator, z, spin) for actuator in self.law.actuators])

    def triggered(self, waits: Vector) -> NDArray[np.bool_]:
        """True where a channel comes to fire at a moment after the first: its wait falls below
        ``ahead``.
        """
        before = waits[..., :-1]
        now = waits[..., 1:]
        ahead = self.ahead
        falls = (now < ahead) & (before >= ahead) & (before - now < 0.5 * self.law.period)
        slack = 1e-12 * self.law.period
        begins = np.isnan(before) & (now >= -slack) & (now < max(ahead, slack))
        return np.asarray(falls | begins)


class Coast(Watch):
    """Motion of one body from ``state`` at ``since`` s on without firing, and its samples;
    ``parts``: as integrated.
    """

    def __init__(
        self, law: Law, signal: Signal, dynamics: Dynamics, state: SpinState, since: float
    ) -> None:
        super().__init__(law, since)
        self.signal, self.dynamics = signal, dynamics
        self.path: Path | None = None
        self.parts: list[tuple[float, Path]] = []
        self.state, self.since = state, since
        self._until = since
        self._number = 0 if self.sensor.rate is None else int(self.first(np.float64(since)))

    def look(self, until: float, *, active: bool) -> Seen | None:
        """Next moments of the coast; None where all have been seen, up to a decision at ``until``
        s.
        """
        begins = self._until
        end = until - self.signal.sensor.delay
        numbers: NDArray[np.int64] | None = None
        if self.sensor.rate is None:
            end = min(begins + self.reach * self.law.period / GRID, end)
            if end <= begins:
                return None
            count = max(math.ceil((end - begins) / self.law.period * GRID), 2)
            times: Vector = np.asarray(
                np.linspace(begins, end, count + 1)[self.path is not None :], dtype=np.float64
            )
        else:
            last = min(self._number + self.reach - 1, math.floor(end * self.sensor.rate + SAMPLED))
            if last < self._number:
                return None
            numbers = np.arange(self._number, last + 1)
            times = np.asarray(numbers * self.estimator.step, dtype=np.float64)
            self._number, end = last + 1, max(float(times[-1]), begins)
        self._go_to(end)
        self.reach = min(2 * self.reach, LONGEST)
        rates, _ = self._motion(times)
        values = self.signal.shown(rates)
        if numbers is not None:
            values = self.signal.sampled(numbers, values)
        spin = rates[:, 2]
        z, best, shown, fires = self.judged(times, values, spin, np.array(active))
        size = abs(complex(self.law.seen(complex(*rates[-1, :2]))))
        return Seen(times, times + self.signal.sensor.delay, z, best, spin, shown, fires, size)

    def _go_to(self, end: float) -> None:
        """Has a path that reaches from the last moment looked at to ``end`` s."""
        if self.path is None or not self.dynamics.free:
            state = self.state if self.path is None else self.at(self._until)
            self.path, _ = self.dynamics.path(state, self._until, end, most=MOST_STEPS)
            self.parts.append((self._until, self.path))
        self._until = end

    def _motion(self, times: Vector) -> tuple[Vector, Vector]:
        """Rates (n, 3) rad/s and quaternions (n, 4) at ``times`` (n,) s that the path reaches."""
        begins, path = self.parts[-1]
        if self.dynamics.free or times[0] >= begins:
            return path.motion(times)
        return joined([(start, part.motion) for start, part in self.parts], times)

    def at(self, time: float) -> SpinState:
        """State at ``time`` s, which has been seen or lies within a nutation period after that."""
        if time == self.since:
            return self.state
        if self.path is None or (time > self._until and not self.dynamics.free):
            self._go_to(time)
        rates, quaternion = self._motion(np.array([time]))
        return SpinState.of(rates[0], quaternion[0])

    def later(self, time: float) -> Coast:
        """The coast from ``time`` s on, of which nothing was looked at before."""
        coast = Coast(self.law, self.signal, self.dynamics, self.at(time), time)
        coast.parts = self.parts
        return coast

    def firing(self, seen: Seen, row: int, actuator: Actuator) -> Decided | None:
        """As of any `Watch`; by a continuous signal at the end of its wait, which falls by 1 s a
        second (Newton).
        """
        if self.sensor.rate is not None:
            return super().firing(seen, row, actuator)
        now = float(seen.now[row])
        step = self.law.period / GRID
        delay = self.signal.sensor.delay
        low = max(now - 2.0 * step, self.estimator.since + delay)
        high = now + step
        firing = None
        for _ in range(REFINED):
            time = np.array([now - delay])
            rates, _ = self._motion(time)
            z = self.estimator.feed(time, self.signal.shown(rates), rates[:, 2])
            z = self.estimator.on_board(z, rates[:, 2])
            firing = self.law.firing(actuator, complex(z[0]), float(rates[0, 2]))
            if firing is None:
                return None
            low, high = (now, high) if firing.wait > 0.0 else (low, now)
            following = now + firing.wait
            following = following if low <= following <= high else 0.5 * (low + high)
            if abs(following - now) <= 2.0 * math.ulp(now):
                break
            now = following
        assert firing is not None
        return Decided(row, now, now, actuator, firing)


class Ending(Enum):
    """Reason for the end of the flight of a loop."""

    END = "the end of the time"
    FULL = "limits.max_pulses"
    EMPTY = "the tank is empty"
    SENSOR = "the sensor is reversed"
    CHANNEL = "a channel is wired backwards"
    UNCLEAR = "a channel is wired backwards, or the sensor is reversed"
    FED = "the firings feed the nutation"

    @property
    def fault(self) -> bool:
        """True if the loop was stopped before it could feed the nutation, or has nothing left to
        fire.
        """
        return self not in (Ending.END, Ending.FULL)


# Share of what a firing was to take off the nutation that tells whether it helped or added that:
# wired backwards it adds all of it, late by a quarter of a period nothing.
HELPS = 0.25
SIGMAS = 5.0  # of noise within which a firing is not judged: 1 in 3 million by chance
# Share of |z| by which estimates change as it turns, besides by unlike scales of two gyros: those
# of an accelerometer whose sine is fitted at a rate that is 1 % off.
UNEVEN = 2e-3
FED = 0.5  # growth of the nutation under fire, as a share of its first size, that stops a loop
LARGE = 100.0  # exponent of growth beyond which further growth does not matter


class Glimpse(NamedTuple):
    """Size |z| of an estimate, rad/s, at ``time`` s."""

    size: float
    time: float


@dataclass(slots=True)
class Diagnosis:
    """Judge of firings by what each takes off the nutation: two in a row that do not help stop the
    loop.

    After one that does not, the next shows whether it is its channel or all: the sensor.
    """

    rate: float  # at which z turns, rad/s
    growth: float  # of |z|, 1/s
    spacecraft: Spacecraft  # whose disturbances move z, too
    failed: str | None = None  # channel of the last firing that did not help
    first: Glimpse | None = None  # what was first fired at since the loop was quiet

    def judge(
        self, channel: str, before: Glimpse, after: Glimpse, acts: float, doubt: Doubt
    ) -> tuple[Ending, str] | None:
        """Reason to stop after a firing that adds ``acts`` rad/s, and the channel to name."""
        first, failed = self.first or before, self.failed
        self.first = first
        apart = after.time - before.time
        size = after.size / self._grown(apart)
        # A bias shows alike in both as far as z has not turned meanwhile.
        unsure = SIGMAS * doubt.noise + doubt.bias * min(self.rate * apart, 2.0)
        unsure += 2.0 * doubt.steps + (UNEVEN + doubt.scale) * before.size
        unsure += self._pushed(before.time, after.time)
        wanted = min(acts, 2.0 * before.size - acts)  # more than |z| leaves what is left over
        taken = before.size - size
        if taken + unsure < -HELPS * wanted:
            self.failed = channel
            if failed is not None:
                return Ending.UNCLEAR if failed == channel else Ending.SENSOR, channel
        elif taken >= HELPS * wanted and taken - unsure > -HELPS * wanted:
            self.failed = None
            if failed not in (None, channel):
                return Ending.CHANNEL, failed
        allowed = (1.0 + FED) * first.size * self._grown(after.time - first.time)
        allowed += 2.0 * (SIGMAS * doubt.noise + doubt.bias + doubt.steps)
        allowed += self._pushed(first.time, after.time)
        return (Ending.FED, channel) if self.failed is None and after.size > allowed else None

    def _pushed(self, begin: float, end: float) -> float:
        """Change of |z|, rad/s, that disturbances may make between two times, s; that of one which
        turns otherwise than z beats.
        """
        total = 0.0
        for each in self.spacecraft.disturbances:
            lasts = max(min(end, each.end) - max(begin, each.begin), 0.0)
            apart = abs(abs(self.rate) - abs(each.rate))
            beat = 2.0 / apart if apart > 0.0 else lasts
            total += abs(each.transverse) / self.spacecraft.inertia.A * min(lasts, beat)
        return total

    def _grown(self, lasts: float) -> float:
        return math.exp(min(self.growth * lasts, LARGE))


EARLIER = "an earlier end, or a lower rate, helps"
MOST_FIRINGS = 10_000  # largest number of firings of one flight
NO_NOISE = 8.0  # sigmas that noise does not reach: a chance of 1e-15 a sample
WAVES = 40.0  # time constants of the low-pass filter after which it has forgotten its start
TAG = (
    1  # ends the key of the random numbers of a firing: those of the noise are keyed by block alone
)


class Fired(NamedTuple):
    """Firing: the ``pulse`` as it acts, time of the decision (s), nutation (rad) observed then, and
    true at start.
    """

    pulse: Pulse
    decided: float
    seen: float
    true_nutation: float


@dataclass(frozen=True)
class Scatter:
    """Errors of single firings of a case, drawn by the ``key`` of the case; ``late`` s is common to
    all.
    """

    key: tuple[int, ...]
    thrust: Tolerance | None
    timing: Tolerance | None
    late: float = 0.0

    def of(self, number: int) -> tuple[float, float]:
        """Thrust factor of the firing ``number``, from 0, and its delay in s."""
        if self.thrust is None and self.timing is None:
            return 1.0, self.late
        random = np.random.default_rng((*self.key, number, TAG))
        thrust, timing = (_drawn(random, part) for part in (self.thrust, self.timing))
        return max(1.0 + thrust, 0.0), self.late + timing


def _drawn(random: np.random.Generator, tolerance: Tolerance | None) -> float:
    if tolerance is None:
        return 0.0
    first, second = random.random(2)
    normal = float(random.standard_normal())
    unit = {
        "normal": normal,
        "uniform": 2.0 * first - 1.0,
        "triangular": first + second - 1.0,
        "bias": 1.0,
    }
    return tolerance.size * float(unit[tolerance.kind])


class Case(NamedTuple):
    """Loop to be flown: the true spacecraft with its loop, and the errors of firings."""

    truth: Spacecraft
    key: tuple[int, ...]  # seed of the noise, and number of a dispersed case, from 1
    scatter: Scatter | None = None
    tilt: tuple[float, float] = (
        0.0,
        0.0,
    )  # rad, of the attitude at t = 0 about the body axes 1 and 2


class Course(Enum):
    """Next step of a loop that neither fires nor waits: looks on, or is over."""

    ON = "on"
    OVER = "over"


class Pilot:
    """Controller of one loop, known on board to the ``law`` and true in the ``case``: from samples
    to firings.

    ``free``: coasts are those of a symmetric body without torque from outside; ``once``: the flight
    is over as the loop falls quiet.
    """

    def __init__(
        self, law: Law, case: Case, until: float, *, free: bool, once: bool = False
    ) -> None:
        truth = case.truth
        if shed(truth) is not None:
            problem = "a loop flies with constant moments of inertia; leave out this key"
            raise Unsuitable(("tank", "inertia_per_kg"), problem)
        self.law = law
        self.truth = truth
        self.loop = truth.loop or law.loop
        self.scatter = case.scatter
        self.until, self.free, self.once = until, free, once
        self.diagnosis = Diagnosis(2.0 * math.pi / law.period, law.growth, law.spacecraft)
        self.most = min(MOST_FIRINGS, truth.limits.max_pulses or MOST_FIRINGS)
        self.channels = {channel.name: channel for channel in truth.channels}
        self.supply = Supply(truth)
        self.fired: list[Fired] = []
        self.quiet: list[float] = []
        self.active, self.looked_at = False, 0
        self.ready = truth.limits.earliest
        self.ending = (Ending.END, "")
        self._decision: Decided | None = None
        self._latest: Seen | None = None
        self._unjudged: tuple[str, Glimpse, float] | None = None  # last firing, see `Diagnosis`
        looks = until * (self.loop.sensor.rate or GRID / law.period)
        if looks > MOST and not (free and self._reach(truth.spin) > 0.0):  # it never rests
            raise Infeasible(f"{looks:.2g} samples by {until:.6g} s, {MOST:.2g} at most: {EARLIER}")

    def step(self, coast: Watch, seen: Seen) -> Pulse | float | Course:
        """Action after a stretch of a coast: a pulse; a time, s, until which nothing is to be seen;
        or `Course`.
        """
        self.looked_at += len(seen.times)
        work.spend(LOOKED * len(seen.times))
        if self.looked_at > MOST or work.exhausted():
            raise Infeasible(f"{self.looked_at:.2g} samples by {seen.times[0]:.6g} s: {EARLIER}")
        self._latest = seen
        self._judge(coast, seen)
        self._decision = None if self.ending[0].fault else self._decide(coast, seen)
        if self.ending[0].fault or (self.once and self.quiet):
            return Course.OVER
        if self._decision is not None:
            return self._pulse(self._decision) or Course.OVER
        later = None if self.active or self._unjudged is not None else self._idle_until(seen)
        return Course.ON if later is None else later

    @property
    def lost(self) -> bool:
        """True if the loop fails whatever it leaves: stopped,
        or fires and was never down to stop.
        """
        return self.ending[0] is not Ending.END or (
            self.active and not self.quiet and self.law.loop.stop > 0.0
        )

    def _pulse(self, decision: Decided) -> Pulse | None:
        """True response of the channel to its command; None where not allowed, or not before the
        end.
        """
        commanded = decision.actuator.channel
        channel = self.channels[decision.actuator.channel.name]
        pulse = channel_pulse(
            commanded, decision.start + decision.firing.lead, decision.firing.on_time
        )
        if commanded.valve is not None:
            pulse = commandable(self.law.spacecraft, pulse)
        factor, late = (1.0, 0.0) if self.scatter is None else self.scatter.of(len(self.fired))
        if channel is not commanded or late != 0.0:
            begins, lasts = pulse.loaded
            pulse = on_command(channel, max(begins + late, decision.now), lasts)
        if pulse.over > self.until:
            return None
        if len(self.fired) == self.most:
            self.ending = Ending.FULL, ""
            if self.most == MOST_FIRINGS:
                raise Infeasible(
                    f"more than {MOST_FIRINGS} firings by {pulse.start:.6g} s; an earlier end helps"
                )
            return None
        pulse = self.supply.fire(pulse, channel)
        if self.supply.shortage is not None:
            self.ending = Ending.EMPTY, ""
        sense = -factor if channel.name in self.loop.reversed else factor
        return pulse if sense == 1.0 else weakened(pulse, sense)

    def take(self, pulse: Pulse, size: float, spin: float) -> None:
        """Record a firing, with true |z| and ω3 (rad/s) at its start."""
        decision, seen = self._decision, self._latest
        assert decision is not None
        assert seen is not None
        row = decision.row
        true = float(self.law.nutation(size, spin))
        self.fired.append(Fired(pulse, decision.now, float(seen.shown[row]), true))
        before = Glimpse(abs(complex(seen.best[row])), float(seen.times[row]))
        self._unjudged = pulse.channel, before, abs(decision.firing.acts)
        self.ready = pulse.over + max(self.law.loop.min_interval, self.truth.limits.gap)

    def _judge(self, coast: Watch, seen: Seen) -> None:
        """Judge the last firing by the first estimate after it."""
        row = _first(~np.isnan(seen.best), 0)
        if self._unjudged is None or row is None:
            return
        channel, before, acts = self._unjudged
        after = Glimpse(abs(complex(seen.best[row])), float(seen.times[row]))
        fault = self.diagnosis.judge(channel, before, after, acts, coast.estimator.doubts)
        self._unjudged = None
        self.ending = fault or self.ending

    def _decide(self, coast: Watch, seen: Seen) -> Decided | None:
        """First firing among the moments of a stretch; thresholds and firings are judged in their
        order.
        """
        shown = seen.shown
        fires = seen.fires
        count = len(seen.times)
        row = 0
        while row < count:
            if not self.active:
                begins = _first(np.asarray(shown >= self.law.loop.start), row)
                if begins is None:
                    break
                self.active = True
                row = begins
            downs = _first(np.asarray(shown <= self.law.loop.stop), row)
            fire = _first(np.asarray(fires.any(axis=0)), row)
            if downs is not None and (fire is None or downs <= fire):
                self.active = False
                row = downs + 1
                self.diagnosis.first = None
                self.quiet.append(float(seen.now[downs]))
                continue
            if fire is None:
                break
            decision = self._allowed(coast, seen, fire, np.flatnonzero(fires[:, fire]).tolist())
            if decision is not None:
                return decision
            row = fire + 1
        return None

    def _allowed(self, coast: Watch, seen: Seen, row: int, channels: list[int]) -> Decided | None:
        """Firing at a row, on a tick, if the limits allow it."""
        fired = (coast.firing(seen, row, self.law.actuators[index]) for index in channels)
        decided = [decision for decision in fired if decision is not None]
        if not decided:
            return None
        decision = min(decided, key=lambda candidate: candidate.start)
        windows = self.law.windows
        start = windows.nearest_tick(decision.start)
        start = windows.tick_after(decision.start) if start < decision.now else start
        return (
            decision._replace(start=start)
            if windows.allows(start, decision.firing.lasts, self.ready)
            else None
        )

    def _idle_until(self, seen: Seen) -> float | None:
        """Earliest time at which the sensor can show the start threshold, less the look-ahead; None
        where soon.
        """
        law = self.law
        if not self.free:
            return None
        now = float(seen.times[-1])
        growth = self.truth.growth
        reach = self._reach(float(seen.spin[-1]))
        if reach <= seen.size:
            return None
        # tan θ grows by e^{κt}, and |ω| by no more; with a wheel κ may rise with θ.
        by_body, by_wheel = self.truth.damper
        growth *= max(1.0, by_body * math.cos(law.loop.start) + by_wheel)
        waits = math.log(reach / seen.size) / growth if growth > 0.0 < seen.size else math.inf
        settles = law.loop.settle + max(law.period, WAVES * self.loop.sensor.low_pass)
        later = min(now + waits, self.until) - settles - law.period / GRID
        return later if later > now + law.period else None

    def _reach(self, spin: float) -> float:
        """Largest |z|, rad/s, at which the sensor surely shows less than the start threshold."""
        margin, over = self._margins
        return (self.law.size(self.law.loop.start, spin) - margin) / over

    @cached_property
    def _margins(self) -> tuple[float, float]:
        """Largest overestimate of |z| by the sensor: rad/s, and a factor."""
        law, sensor = self.law, self.loop.sensor
        estimator = Estimator(law, sensor, 0.0)
        over = estimator.overestimate(self.truth, law.size(law.loop.start, self.truth.spin))
        doubts = estimator.doubts
        return doubts.bias + doubts.steps + NO_NOISE * doubts.noise, over * max(
            map(abs, sensor.scales)
        )


def _first(mask: NDArray[np.bool_], row: int) -> int | None:
    offset = int(np.argmax(mask[row:]))
    return row + offset if mask[row + offset] else None
