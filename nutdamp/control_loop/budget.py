"""Propellant and pulses a year that hold the nutation against energy dissipation, and how long the
tank lasts.

They are those of the limit cycle of the loop from event to event: between two, z grows as e^{(κ -
iω)t}, so that the time from one size to another is ln(s1/s0)/κ; noise decides in which sample a
threshold is first reached, and only the few samples in which a channel may come to fire are worked
out one by one. Many cycles are followed side by side.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import results, work
from nutdamp.control_loop.controller import SAMPLED, Watch
from nutdamp.control_loop.law import Actuator, ComplexArray, Law
from nutdamp.control_loop.simulation import fly
from nutdamp.control_loop.stability import (
    FARTHEST,
    Band,
    Odds,
    dead_band,
    expect_in_time,
    margins,
    transfer,
)
from nutdamp.errors import Infeasible
from nutdamp.flight.dynamics import Supply
from nutdamp.physics.thruster import Ramp, shape_factor
from nutdamp.planning.verdict import Status, status_of
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import commandable
from nutdamp.spacecraft.equipment import Loop
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.roles import with_limits
from nutdamp.spacecraft.schedule import Pulse, channel_pulse

Rows = NDArray[np.int64]


class Cycle(NamedTuple):
    """Limit cycle; rates are 1/s, nutations rad."""

    pulses: float
    cycles: float  # from pause to pause; 0 where the loop never pauses
    impulse: float  # N m s/s
    propellant: float | None  # kg/s; None if unknown
    spin_rate: float  # rad/s²
    doubt: float  # one sigma of ``pulses`` over it
    high: float  # nutation as firings begin, mean
    low: float  # nutation as they have ended, geometric mean
    largest: float


class Sums(NamedTuple):
    """Sums of a chain up to the last pulse: its time (s), and its largest and last |z|, rad/s."""

    time: float = 0.0
    pulses: float = 0.0
    impulse: float = 0.0
    propellant: float = 0.0
    spin: float = 0.0
    cycles: float = 0.0
    largest: float = 0.0
    last: float = 0.0


ADDED = 6  # columns of `Sums` of which differences count


@dataclass(eq=False)
class Chains:
    """State of each chain: z at the sample ``number``; ``fresh``: at the first estimate after a
    firing.
    """

    z: ComplexArray
    number: Rows
    active: NDArray[np.bool_]
    fresh: NDArray[np.bool_]
    ready: Vector  # s from which on it may fire again
    carried: Vector  # previous waits of its channels
    white: ComplexArray  # noise of its samples
    sums: list[Sums]

    def __post_init__(self) -> None:
        self.firings: list[list[Sums]] = [[] for _ in self.sums]
        self.cycles: list[list[Sums]] = [[] for _ in self.sums]


class Entry(NamedTuple):
    """State in which a chain begins: z rad/s at ``time`` s; ``active`` after a firing; ``ready`` s
    to fire again.
    """

    z: complex
    time: float
    active: bool
    ready: float


CHAINS, CYCLES, SETTLING = (
    64,
    16,
    2,
)  # cycles followed side by side, counted cycles of each, and cycles before those
FIRINGS = 200  # firings of each, at most, and as many more as bring the nutation down from start
MOST_FOLLOWED = 2000  # firings of each, at most, whatever start
ALONE = 8  # factor on cycles and firings of chains that have no noise
ENTRIES, LOOKED = (
    16,
    1_000_000,
)  # flights, at most, from the state of the file down to start, and samples of them all
FEW = 4  # cycles per so many firings below which firings are counted instead
STEP = 0.1  # units of work of a stretch of sixteen chains
MOST_STEPS = 100_000  # stretches in all, at most
ROWS = 128  # largest number of samples computed one by one at a time
EARLY, LATE = (
    0.003,
    3.0,
)  # probabilities of the start threshold between which samples are examined one by one
LONGEST_LOOKED = 10_000  # largest number of samples examined one by one
SIGMAS = 5.0  # reach of noise, sigmas, in which a channel may come to fire
OUTGROWN = 4.0  # multiple of the expected dead band at which a loop does not hold the nutation
# by which a random walk first passes a level, 0.58 steps, in sigmas of new noise: √2 times
OVERSHOOT = 0.82
# growth of the nutation from the first of many firings to the middle, and on, where it is not held
RISING = 1.1
SPENT = "the budget of work was used up before the limit cycle was reached"
TOO_FAST = "the nutation grows faster than the firings damp it"
REFINED = 4  # steps in which the moment of a firing is found on a continuous signal


class Map:
    """From event to event of the ``loop`` of a ``spacecraft`` with growing nutation, ``used`` kg of
    propellant gone.

    Raises Infeasible where no law can work. Blackout windows, and nozzles that are cold at first,
    are left out.
    """

    def __init__(
        self, spacecraft: Spacecraft, loop: Loop, *, used: float = 0.0, seed: int = 1
    ) -> None:
        limits = replace(spacecraft.limits, blackout=(), earliest=0.0)
        tank = spacecraft.tank and spacecraft.tank.doubled  # so that none runs empty amid a cycle
        self.truth = replace(spacecraft, cold=None, tank=tank, limits=limits)
        self.used = used
        self.law = Law(self.truth, loop)
        self.spin = spacecraft.spin
        self.watch, self.rng = Watch(self.law, 0.0), np.random.default_rng(seed)
        self.seen = transfer(self.law, self.spin)
        self.ahead = self.watch.ahead = (
            self.seen.step if loop.predict or loop.sensor.rate is None else 0.0
        )
        self.turn = complex(self.law.growth, -float(self.law.rate(self.spin)))
        self.slower = requirements.slower(spacecraft, loop.start)
        self.start, self.stop = (
            self.law.size(angle, self.spin) for angle in (loop.start, loop.stop)
        )
        self.channels = {channel.name: channel for channel in spacecraft.channels}
        self.up = Odds(self.seen, self.start, self.law.growth, below=False)
        self.down = (
            Odds(self.seen, self.stop, self.law.growth, below=True) if self.stop > 0.0 else None
        )
        self.near = self._near()
        reach = SIGMAS * self.seen.sigma + abs(self.seen.offset)
        half = abs(0.5 * self.turn.imag)
        acts = [
            abs(actuator.kick) * abs(math.sin(half * actuator.shortest)) / half
            for actuator in self.law.actuators
        ]
        longest = min(
            abs(each.kick) * abs(math.sin(half * each.longest)) / half
            for each in self.law.actuators
        )
        self.firings = FIRINGS + min(math.ceil(2.0 * self.start / longest), MOST_FOLLOWED)
        self.reach, self.helps = reach, (0.5 * min(acts) - reach) / abs(self.seen.direct)
        self.bound = OUTGROWN * (max(self.start, *acts) + 2.0 * reach) / abs(self.seen.direct)
        self.memory = len(self.seen.weights) if len(self.seen.weights) > 1 else 0
        self.shapes: dict[tuple[str, float], complex] = {}

    def entries(self, spacecraft: Spacecraft, seed: int = 1) -> list[Entry]:
        """States in which flights of the loop from that of the file come down to start, by the
        noise of each.
        """
        z = complex(self.law.seen(spacecraft.initial.omega))
        if abs(z) <= FARTHEST * self.start:
            return []
        now = Entry(z, 0.0, active=False, ready=spacecraft.limits.earliest)
        if abs(z) < self.start:
            return [now]
        loop = self.law.loop
        entries = list[Entry]()
        looked = 0
        limited = with_limits(spacecraft, max_pulses=None)
        each = 3.0 * (self.law.period + self.seen.first + loop.min_interval) + loop.sensor.delay
        until = spacecraft.limits.earliest + each * self.firings * abs(z) / self.start
        for number in range(ENTRIES):
            run = fly(limited, loop, until, seed=seed + number, down_to=self.start)
            if not run.fired:
                return [now]
            z = complex(self.law.seen(run.flight.settled.omega))
            if run.stop.fault or not abs(z) < self.start:
                why = run.stop.value if run.stop.fault else TOO_FAST
                raise Infeasible(f"the loop does not come down to start: {why}")
            entries.append(
                Entry(z, run.fired[-1].pulse.thrust[1], active=True, ready=run.pilot.ready)
            )
            looked += run.looked_at
            if loop.sensor.noise == 0.0 or looked * (number + 2) > LOOKED * (number + 1):
                break
        return entries

    def cycle(self, chains: int = CHAINS, cycles: int = CYCLES) -> Cycle:
        """Limit cycle of chains in random phases; raises Infeasible where the loop does not hold
        the nutation.
        """
        at = self._begin(chains)
        self._follow(at, SETTLING + cycles, self.firings)
        return self._summed(at.firings, at.cycles)

    def attractors(
        self, entries: Sequence[Entry] = (), chains: int = CHAINS
    ) -> tuple[tuple[Cycle, float], ...]:
        """Limit cycles in which chains end, most first, with the share of each; raises as `cycle`.

        They begin in the ``entries``, by turns, or in random phases at half the start threshold.
        """
        alike = bool(entries) and not (any(self.seen.scatter) or any(self.seen.grain))
        chains, longer = (len(entries), ALONE) if alike else (chains, 1)
        at = self._begin(chains)
        for row, entry in zip(
            range(chains if entries else 0), itertools.cycle(entries), strict=False
        ):
            self._enter(at, row, entry)
        self._follow(at, 0, self.firings)  # until each has paused, or fires on at the same size
        at = replace(at, sums=[total._replace(pulses=0.0, cycles=0.0) for total in at.sums])
        self._follow(at, SETTLING + longer * CYCLES, longer * self.firings)
        ends: list[list[tuple[list[Sums], list[Sums]]]] = [[], []]
        for firings, cycles in zip(at.firings, at.cycles, strict=True):
            paused = cycles[-1].pulses if cycles else 0.0
            later = [total for total in firings if total.pulses > paused]
            never = 2 * len(later) >= self.firings  # it does not pause any more
            ends[never].append((later, []) if never else (firings, cycles))
        parts = sorted(filter(None, ends), key=len, reverse=True)
        return tuple((self._summed(*zip(*part, strict=True)), len(part) / chains) for part in parts)

    def _enter(self, at: Chains, row: int, entry: Entry) -> None:
        """Put a chain where ``entry`` is, at its first estimate."""
        number = math.ceil((entry.time + self.seen.first) / self.seen.step - SAMPLED)
        at.z[row] = entry.z * np.exp(self.turn * (number * self.seen.step - entry.time))
        at.number[row], at.active[row], at.fresh[row], at.ready[row] = (
            number,
            entry.active,
            True,
            entry.ready,
        )

    def _follow(self, at: Chains, cycles: int, firings: int) -> None:
        """Follow every chain until it has paused more than ``cycles`` times, or fired ``firings``
        times.
        """
        going = np.ones(len(at.z), dtype=bool)
        for _ in range(MOST_STEPS):
            work.spend(STEP * (1.0 + len(going) / 16.0))
            if work.exhausted():
                break
            self._wake(at, np.flatnonzero(going & ~at.active))
            self._skip(at, np.flatnonzero(going & at.active & ~at.fresh))
            self._look(at, np.flatnonzero(going))
            going = np.array(
                [total.cycles <= cycles and total.pulses < firings for total in at.sums]
            )
            if not going.any():
                return
        raise Infeasible(SPENT)

    def _near(self) -> float | None:
        """Size of z from which on every sample is examined; None where the chances of the samples
        add up.
        """
        seen = (
            self.seen
        )  # chances add up where the noise of each sample is new, or z grows little while it lasts
        if not any(seen.grain) and (seen.fresh > 0.5 or seen.sigma == 0.0):
            return None
        # No more likely than if each sample had a chance of its own.
        bound = Odds(seen._replace(fresh=1.0), self.start, self.law.growth, below=False)
        first, last = (
            float(odds.size(1e-3 * self.start, chance))
            for odds, chance in ((bound, EARLY), (self.up, LATE))
        )
        return (
            first
            if math.log(last / first) / (self.turn.real * seen.step) < LONGEST_LOOKED
            else None
        )

    def _begin(self, count: int) -> Chains:
        """Coasts at half the start threshold, in random phases."""
        z = (
            0.5
            * self.start
            / abs(self.seen.direct)
            * np.exp(1j * self.rng.uniform(0.0, 2.0 * math.pi, count))
        )
        number = self.rng.integers(1, 2 + round(self.law.period / self.seen.step), count)
        quiet = np.zeros(count, dtype=bool)
        waits = np.full((len(self.law.actuators), count), math.nan)
        white = self._drawn(count)
        sums = [Sums()] * count
        return Chains(z, number, quiet, quiet.copy(), np.zeros(count), waits, white, sums)

    def _drawn(self, rows: int) -> ComplexArray:
        return self.seen.drawn(self.rng, rows, len(self.seen.weights))

    def _waits(self, seen: ComplexArray) -> Vector:
        return self.watch.waits(seen, np.full(seen.shape, self.spin))

    def _goes(self, at: Chains, rows: Rows, samples: Rows) -> None:
        """Advance coasts by some samples, and forget the noise of those before."""
        at.z[rows] *= np.exp(self.turn * self.seen.step * samples)
        at.number[rows] += samples
        at.white[rows] = self._drawn(len(rows))
        at.carried[:, rows] = self._waits(
            self.seen.mean(at.z[rows] * np.exp(-self.turn * self.seen.step))
        )

    def _until(self, size: Vector | float, now: Vector) -> Rows:
        """Samples until |z| has grown from ``now`` to ``size``."""
        samples = np.log(np.maximum(size / now, 1.0)) / (self.turn.real * self.seen.step)
        return np.asarray(np.ceil(samples - SAMPLED), dtype=np.int64)

    def _wake(self, at: Chains, rows: Rows) -> None:
        """From pauses to the sample that first shows the start threshold, or to where each is
        looked at.
        """
        now = np.abs(at.z[rows])
        if (now <= FARTHEST * self.start).any():
            raise Infeasible(
                "a firing leaves no nutation that could grow: sensor and valves have no errors"
            )
        if self.near is not None:
            far = now < self.near
            self._goes(at, rows[far], self._until(self.near, now[far]))
            return
        self._goes(
            at, rows, self._until(self.up.size(now, self.rng.exponential(size=len(rows))), now)
        )
        at.active[rows] = True
        if not any(self.seen.scatter):
            return
        for row in rows.tolist():
            mean = complex(self.seen.mean(at.z[row]))
            short = (self.start - abs(mean)) / self.seen.sigma
            if short > 0.0:  # the noise of this sample is what was missing, and a little more
                more = short + self.rng.exponential() * min(
                    1.0 / max(short, 1.0), OVERSHOOT * math.sqrt(self.seen.fresh)
                )
                at.white[row] += self.seen.change(
                    at.white[row], mean / abs(mean), more * self.seen.sigma
                )

    def _skip(self, at: Chains, rows: Rows) -> None:
        """Over the samples in which no channel can come to fire: to the first that may, or to a
        pause.
        """
        size = np.abs(at.z[rows])
        mean = self.seen.mean(at.z[rows])
        waits = self._waits(mean)
        share = np.minimum(self.reach / np.maximum(np.abs(mean), self.reach + 1e-300), 1.0)
        slack = 3.0 * self.seen.step + 0.25 * share * self.law.period
        due = (
            np.where(waits < self.ahead - slack, waits + self.law.period, waits)
            - self.ahead
            - slack
        )
        idle = np.isnan(due).all(axis=0)
        soonest = np.where(idle, 0.0, np.where(np.isnan(due), math.inf, due).min(axis=0))
        samples = np.maximum(np.floor(soonest / self.seen.step), 0.0).astype(np.int64)
        samples[samples < self.memory] = 0
        useless = idle & (
            size < self.helps
        )  # the smallest pulse would leave more than there is: no pause, it waits
        samples[useless] = self._until(self.helps, size[useless])
        if self.down is not None:
            event = self.down.size(size, self.rng.exponential(size=len(rows)))
            quiet = event < size * np.exp(self.turn.real * self.seen.step * samples)
            samples[quiet] = self._until(event[quiet], size[quiet])
            at.active[rows[quiet]] = False
            self._rest(at, rows[quiet])
        moved = samples > 0
        self._goes(at, rows[moved], samples[moved])

    def _look(self, at: Chains, rows: Rows) -> None:
        """Examine the next samples one by one, up to the first event of each."""
        step = self.seen.step
        count = min(max(math.ceil(0.5 * self.law.period / step), 4), ROWS)
        white = np.concatenate(
            [at.white[rows], self.seen.drawn(self.rng, len(rows), count)], axis=1
        )
        course = np.exp(self.turn * step * np.arange(count))
        seen = self.seen.stepped(
            self.seen.mean(at.z[rows][:, None] * course) + self.seen.noise(white)
        )
        awake = np.logical_or.accumulate(
            (np.abs(seen) >= self.start) | at.active[rows, None], axis=1
        )
        waits = np.full((len(at.carried), *seen.shape), math.nan)
        some = awake[:, -1]
        waits[:, some] = self._waits(seen[some])
        waits[:, ~some, -1] = self._waits(seen[~some, -1])
        fires = self.watch.triggered(np.concatenate([at.carried[:, rows, None], waits], axis=2))
        downs = awake & (np.abs(seen) <= self.stop)
        firsts = np.where(downs.any(axis=1), downs.argmax(axis=1), count)
        at.active[rows] = awake[:, -1]
        fires &= awake & (np.arange(count) < firsts[:, None])
        passes = np.ones(len(rows), dtype=bool)
        for index in np.flatnonzero(fires.any(axis=(0, 2))).tolist():
            passes[index] = not self._fires(at, int(rows[index]), seen[index], fires[:, index])
        resting = rows[passes & (firsts < count)]
        at.active[resting] = False
        self._rest(at, resting)
        places = np.flatnonzero(passes)
        going = rows[passes]
        passed = np.minimum(firsts[places] + 1, count)
        at.z[going] *= np.exp(self.turn * step * passed)
        at.number[going] += passed
        at.white[going] = white[
            places[:, None], passed[:, None] + np.arange(white.shape[1] - count)
        ]
        at.carried[:, going], at.fresh[going] = waits[:, places, passed - 1], False

    def _fires(self, at: Chains, row: int, seen: ComplexArray, fires: NDArray[np.bool_]) -> bool:
        """First firing at one of the moments at which a channel triggers, if any."""
        for moment in np.flatnonzero(fires.any(axis=0)).tolist():
            time = (int(at.number[row]) + moment) * self.seen.step
            actuators = (
                self.law.actuators[index] for index in np.flatnonzero(fires[:, moment]).tolist()
            )
            firings = [
                firing
                for each in actuators
                if (firing := self._firing(each, complex(seen[moment]), time)) is not None
            ]
            if not firings:
                continue
            start, lasts, pulse, actuator = min(firings, key=lambda firing: firing[0])
            if self.law.windows.allows(start, lasts, float(at.ready[row])):
                self._fire(at, row, pulse, actuator)
                return True
        return False

    def _firing(
        self, actuator: Actuator, seen: complex, time: float
    ) -> tuple[float, float, Pulse, Actuator] | None:
        """Start, length and pulse of a firing decided on z ``seen`` at ``time`` s."""
        now = time + self.law.loop.sensor.delay
        law = self.law
        more = (
            REFINED if law.loop.sensor.rate is None else 0
        )  # a continuous signal shows the moment itself
        while (firing := law.firing(actuator, seen, self.spin)) is not None and more > 0:
            now = now + firing.wait
            seen = seen * complex(np.exp(self.turn * firing.wait))
            more = more - 1
        if firing is None:
            return None
        begins = now + (max(firing.wait, 0.0) if law.loop.predict else 0.0)
        start = law.windows.nearest_tick(begins)
        start = law.windows.tick_after(begins) if start < now else start
        pulse = channel_pulse(
            self.channels[actuator.channel.name], start + firing.lead, firing.on_time
        )
        return (
            start,
            firing.lasts,
            pulse if pulse.command is None else commandable(self.truth, pulse),
            actuator,
        )

    def _fire(self, at: Chains, row: int, pulse: Pulse, actuator: Actuator) -> None:
        """Propagate through a pulse, and on to the first estimate after it."""
        supplied = Supply(self.truth, used=self.used).fire(pulse, actuator.channel)
        level = supplied.magnitude / pulse.magnitude
        (begins, ends), time = pulse.thrust, int(at.number[row]) * self.seen.step
        before = complex(at.z[row])
        sums = at.sums[row]
        size = abs(before) * math.exp(self.turn.real * (begins - time))
        if size > self.bound:
            raise Infeasible(TOO_FAST)
        acts = actuator.kick * level * pulse.on_time * self._shape(actuator, pulse)
        after = (before * np.exp(self.turn * (pulse.t - time)) + acts) * np.exp(
            self.turn * (ends - pulse.t)
        )
        # Dissipation takes spin as |z| grows at the same H: cos θ goes with ω3.
        grown, settled = (
            math.cos(float(self.law.nutation(angle, self.spin))) for angle in (size, sums.last)
        )
        slowed = float(self.law.inertia.equivalent(self.spin)) * (1.0 - grown / settled)
        at.sums[row] = sums._replace(
            time=pulse.t,
            pulses=sums.pulses + 1.0,
            impulse=sums.impulse + supplied.magnitude,
            propellant=sums.propellant
            + (math.nan if supplied.propellant is None else supplied.propellant),
            spin=sums.spin + (actuator.spin_rate * level * pulse.on_time - slowed),
            largest=max(sums.largest, size),
            last=abs(after),
        )
        at.firings[row].append(at.sums[row]._replace(largest=size))
        at.ready[row] = pulse.over + max(self.law.loop.min_interval, self.truth.limits.gap)
        at.white[row], at.carried[:, row] = self._drawn(1)[0], math.nan
        self._enter(at, row, Entry(after, ends, active=True, ready=at.ready[row]))

    def _shape(self, actuator: Actuator, pulse: Pulse) -> complex:
        """Factor on the effect of a pulse on z by its width, with the growth in it."""
        key = (pulse.channel, round(pulse.on_time, 9))
        if key not in self.shapes:
            ramps = (
                (Ramp(pulse.start, pulse.end, 1.0, 1.0),)
                if pulse.command is None
                else pulse.command.ramps
            )
            moved = [
                ramp._replace(begin=ramp.begin - pulse.t, end=ramp.end - pulse.t) for ramp in ramps
            ]
            rate = float(self.law.rate(self.spin))
            slope = self.law.slope * actuator.spin_rate
            self.shapes[key] = shape_factor(rate, slope, moved, 0.0, self.law.growth)
        return self.shapes[key]

    def _rest(self, at: Chains, rows: Rows) -> None:
        """Record the sums of finished cycles, if anything was fired in them."""
        for row in rows.tolist():
            sums = at.sums[row]
            if sums.largest > 0.0:
                sums = sums._replace(cycles=sums.cycles + 1.0)
                at.cycles[row].append(sums)
                at.sums[row] = sums._replace(largest=0.0)

    def _summed(self, firings: Iterable[list[Sums]], cycles: Sequence[list[Sums]]) -> Cycle:
        """Mean of all chains, between the first and the last counted cycle, or firing."""
        if all(len(cycle) >= SETTLING + FEW for cycle in cycles):
            counted = [cycle[SETTLING:] for cycle in cycles]
        else:
            counted = [firing[len(firing) // 4 :] for firing in firings]
            places = [
                [part[place].largest for place in (0, len(part) // 2, -1)] for part in counted
            ]
            sizes = np.array(places).mean(axis=0)
            if sizes[2] > sizes[1] * RISING > sizes[0] * RISING**2:
                raise Infeasible(TOO_FAST)
        spans = np.array([np.subtract(cycle[-1], cycle[0])[:ADDED] for cycle in counted])
        spans[:, 0] += self.slower * spans[:, 5]
        total = spans.sum(axis=0)
        rates = (total / total[0]).tolist()
        apart = spans[:, 1] - rates[1] * spans[:, 0]
        angles = self.law.nutation(
            np.concatenate([np.array(cycle[1:])[:, ADDED:] for cycle in counted]), self.spin
        )
        return Cycle(
            pulses=rates[1],
            cycles=rates[5],
            impulse=rates[2],
            propellant=None if math.isnan(rates[3]) else rates[3],
            spin_rate=rates[4],
            doubt=math.sqrt(float((apart**2).sum())) / float(total[1]),
            high=float(angles[:, 0].mean()),
            low=float(np.exp(np.log(np.maximum(angles[:, 1], 1e-300)).mean())),
            largest=float(angles[:, 0].max()),
        )


DAY = 86400.0
YEAR = 365.25 * DAY  # s
LASTING = YEAR  # s that a tank must last: the time for which propellant is budgeted
# Noise of estimates (one sigma), over the start threshold, above which the map underestimates
# firings, and the share by which their number is then known at best: flown loops fire up to a fifth
# more at 0.2 of start.
NOISY, WIDENED = 0.1, 0.2
DIFFERENT = 0.3  # relative difference of pulses by which one limit cycle differs from another
# Shares of the propellant used at which a rate of use is worked out, with the weights of Simpson's
# rule: so many, as the rate is uneven; how well the last pulse of a cycle fits differs with the
# thrust.
STAGES = tuple(
    (part / 8.0, weight / 24.0) for part, weight in enumerate((1, 4, 2, 4, 2, 4, 2, 4, 1))
)


class Thresholds(NamedTuple):
    """Nutation, rad, from which a loop fires, and down to which."""

    start: float
    stop: float


@dataclass(frozen=True, eq=False)
class HeldNutation:
    """Nutation held between ``thresholds``: the limit ``cycle`` at the present spin; ``why`` there
    is none.
    """

    spacecraft: Spacecraft
    thresholds: Thresholds
    begins: float  # time at which the loop first fires, s
    band: Band | None = None  # allowed by the sensor and the smallest pulse
    cycle: Cycle | None = None  # the one in which most loops end that begin as the file says
    share: float = 1.0  # of those that do
    other: Cycle | None = None  # a second one
    lasts: float | None = None  # s that the propellant in the tank is enough for; None if unknown
    noisy: bool = False  # noise above `NOISY` of start
    why: str = ""

    @property
    def meets_requirement(self) -> bool | None:
        """True if the nutation stays within the requirement, and the tank lasts `LASTING` s.

        False without a limit cycle, or where it never falls quiet but should; else None where
        neither is given.
        """
        bounds = [
            bound for bound in requirements.required(self.spacecraft) if bound.part is Part.NUTATION
        ]
        if self.cycle is not None and self.cycle.cycles == 0.0 and self.thresholds.stop > 0.0:
            return False
        if not bounds and self.spacecraft.tank is None:
            return None
        if self.cycle is None or (self.lasts is not None and self.lasts < LASTING):
            return False
        return all(bool(bound.met(self.cycle.largest)) for bound in bounds)

    @property
    def slows(self) -> float | None:
        """Relative change of the spin in a year of the cycle, at the present rate; signed. None
        without spin.
        """
        spin = self.spacecraft.spin
        return None if self.cycle is None or spin == 0.0 else self.cycle.spin_rate * YEAR / spin


@dataclass(frozen=True, eq=False, repr=False)
class Budget(results.Data, results.Written):
    """Growth of nutation in a ``spacecraft``, and the cost of holding it, for each pair of
    thresholds in ``held``; ``largest``: θ_max, rad, None where none is named.
    """

    spacecraft: Spacecraft
    largest: float | None
    held: tuple[HeldNutation, ...]

    def __repr__(self) -> str:
        return f"<Budget of {self.spacecraft.name}, pairs of thresholds: {len(self.held)}>"

    @property
    def until_largest(self) -> float | None:
        """Time, s, after which damping must have begun; see `requirements.reached`."""
        return None if self.largest is None else requirements.reached(self.spacecraft, self.largest)

    @property
    def feasible(self) -> bool:
        """True if some pair of thresholds has a limit cycle, or none is needed."""
        return not self.held or any(pair.cycle is not None for pair in self.held)

    @property
    def meets_requirement(self) -> bool | None:
        """True if some pair of thresholds meets the requirement; None where nothing is required of
        a loop.
        """
        meets = [pair.meets_requirement for pair in self.held]
        return None if not meets or None in meets else any(meets)

    @property
    def status(self) -> Status:
        """Status of the best pair of thresholds."""
        return status_of(met=self.meets_requirement, feasible=self.feasible)


def budget(
    spacecraft: Spacecraft,
    pairs: Sequence[Thresholds] = (),
    largest: float | None = None,
    *,
    seed: int = 1,
) -> Budget:
    """Budget of a ``spacecraft`` with dissipation, for ``pairs`` of thresholds, default those of
    its loop.

    ``largest`` rad: θ_max, default the nutation required. Nothing is held where the nutation does
    not grow, or the file has no loop. The pairs are the steps of the task.
    """
    requirements.expect_dissipation(spacecraft)
    required = spacecraft.requirement
    if largest is None and required is not None:
        largest = required.nutation
    loop = spacecraft.loop
    if loop is None or spacecraft.growth <= 0.0:
        return Budget(spacecraft, largest, ())
    held = []
    asked = pairs or [Thresholds(loop.start, loop.stop)]
    grown = [pair for pair in asked if math.isfinite(requirements.slower(spacecraft, pair.start))]
    for done, pair in enumerate(grown, start=1):
        with work.budget("the limit cycle", work.CYCLES), work.steps(1 + len(STAGES)):
            held.append(_held(spacecraft, replace(loop, start=pair.start, stop=pair.stop), seed))
        work.reach(done)
    return Budget(spacecraft, largest, tuple(held))


def _held(spacecraft: Spacecraft, loop: Loop, seed: int) -> HeldNutation:
    truth = replace(spacecraft, loop=loop)
    band = None
    result = HeldNutation(
        truth, Thresholds(loop.start, loop.stop), requirements.reached(truth, loop.start)
    )
    try:
        band = dead_band(truth, loop)
        turned = [margin.channel for margin in margins(truth, loop) if margin.turned]
        if turned:
            raise Infeasible(
                f"firings of {' and '.join(turned)} feed the nutation: "
                "wired backwards against the sensor"
            )
        expect_in_time(truth, loop)
        cycles = Map(truth, loop, seed=seed)
        entries = cycles.entries(truth, seed)
        ends = list(cycles.attractors(entries))
        # There may be others where a firing can leave more than the stop threshold that no smaller
        # pulse lowers.
        if 0.5 * band.step > loop.stop > 0.0:
            half = complex(cycles.law.size(0.5 * band.step, truth.spin))
            ends += [
                *cycles.attractors(),
                *cycles.attractors([Entry(half, 0.0, active=True, ready=0.0)]),
            ]
        (cycle, share), *rest = ends
        others = (
            each for each, _ in rest if abs(each.pulses - cycle.pulses) > DIFFERENT * cycle.pulses
        )
        noisy = cycles.seen.sigma > NOISY * cycles.start
        if noisy:
            cycle = cycle._replace(doubt=max(cycle.doubt, WIDENED))
        result = replace(result, noisy=noisy, cycle=cycle, share=share, other=next(others, None))
        return replace(result, band=band, lasts=_lasts(truth, loop, seed, entries))
    except Infeasible as reason:
        rate = None if result.cycle is None else result.cycle.propellant
        if work.exhausted() and truth.tank is not None and rate:
            return replace(
                result, band=band, lasts=truth.tank.propellant / rate
            )  # as if the pressure stayed
        return replace(result, band=band, why=SPENT if work.exhausted() else str(reason))


def _lasts(spacecraft: Spacecraft, loop: Loop, seed: int, entries: Sequence[Entry]) -> float | None:
    """Lifetime of the limit cycle, s: ∫ dm over the flow, as the pressure in the tank falls."""
    if spacecraft.tank is None:
        return None
    mass = spacecraft.tank.propellant
    total = 0.0
    for done, (share, weight) in enumerate(STAGES, start=1):
        work.reach(done)
        cycles = Map(spacecraft, loop, used=share * mass, seed=seed)
        rate = cycles.attractors(entries)[0][0].propellant
        if rate is None:
            return None
        total += weight / rate
    return float(mass * total)
