"""Propellant and pulses a year that hold the nutation against energy dissipation, and how long the
tank lasts.

They are those of the limit cycle of the loop. Of each cycle only the firings are flown, from where
the loop sees its start threshold to where it falls quiet, many loops side by side. Between, z grows
as e^{(κ - iω)t}, so that the wait is ln(s1/s0)/κ; s1, at which noise first shows the threshold, is
drawn.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import results, work
from nutdamp.control_loop.controller import MOST, Case, Pilot
from nutdamp.control_loop.law import Array, ComplexArray, Law
from nutdamp.control_loop.simulation import Fleet
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
from nutdamp.planning.verdict import Status, status_of
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.equipment import Loop
from nutdamp.spacecraft.model import Inertia, Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.roles import with_limits


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


LOOPS, CYCLES = 64, 5  # loops flown side by side, and cycles counted of each
ALONE = 32  # factor on the cycles of a single loop without noise
ENTRIES = 16  # loops flown down from a state, and of those that never fall quiet
FIRINGS = 60  # firings of a flight, at most, and twice as many more as bring the nutation down
MOST_DOWN = 2000  # of these, at most, whatever the nutation
CONTINUOUS = 4096  # samples of a nutation period by which a continuous signal is flown
EARLY, LATE = 0.003, 3.0
"""Probabilities of the start threshold between which every sample is looked at where the chances of
samples do not add up.
"""
LONGEST_LOOKED = 10_000  # largest number of samples looked at so
# growth of the nutation from the first half of many firings to the second where it is not held
RISING = 1.1
OUTGROWN = 4.0  # multiple of the nutation that there may be at which a loop does not hold it
FOLDS = 3.0  # e-folds in which what a firing leaves, if anything, grows to what one may lower
SPENT = "the budget of work was used up before the limit cycle was reached"
TOO_FAST = "the nutation grows faster than the firings damp it"


class Cycles:
    """Flights of the ``loop`` of a ``spacecraft`` with growing nutation, ``used`` kg of propellant
    gone.

    Raises Infeasible where no law can work. Blackout windows, and nozzles that are cold at first,
    are left out; a body of three moments is the symmetric one whose small nutation turns as fast.
    """

    def __init__(
        self, spacecraft: Spacecraft, loop: Loop, *, used: float = 0.0, seed: int = 1
    ) -> None:
        # Doubled, so that none runs empty amid a cycle.
        tank = spacecraft.tank and replace(spacecraft.tank.doubled, used=used)
        plain = replace(spacecraft, cold=None, tank=tank, disturbances=())
        truth = _symmetric(with_limits(plain, blackout=(), earliest=0.0), loop)
        if loop.sensor.rate is None:
            rate = CONTINUOUS / truth.body_period
            loop = replace(
                loop, sensor=replace(loop.sensor, rate=rate, noise=0.0, quantisation=0.0)
            )
        self.truth, self.loop, self.spin = replace(truth, loop=loop), loop, truth.spin
        self.law = Law(truth, loop)
        self.seen = transfer(self.law, self.spin)
        self.start = self.law.size(loop.start, self.spin)
        self.turn = complex(self.law.growth, -float(self.law.rate(self.spin)))
        self.up = Odds(self.seen, self.start, self.law.growth)
        self.near = self._near()
        self.slower = requirements.slower(truth, loop.start)
        # Larger than what any firing takes off: firings are as long as can be.
        far = complex(1e6 * self.start)
        acts = (self.law.firing(actuator, far, self.spin) for actuator in self.law.actuators)
        self.takes = min(abs(firing.acts) for firing in acts if firing is not None)
        self.rng, self.seed, self.numbers = np.random.default_rng(seed), seed, itertools.count(1)

    @property
    def of_file(self) -> complex:
        """z as the file has it, rad/s."""
        return complex(self.law.seen(self.truth.initial.omega))

    def _near(self) -> float | None:
        """Size of z from which on every sample is looked at; None without noise, and where z grows
        so little in a sample that their chances add up.

        What a firing leaves depends on the very sample that showed the threshold: its noise is far
        out, and drawn anew it left a fifth less, for 5 % fewer pulses of a slender body.
        """
        seen = self.seen
        if not any(seen.grain) and seen.sigma == 0.0:
            return None
        # No more likely than if each sample had a chance of its own.
        bound = Odds(seen._replace(fresh=1.0), self.start, self.law.growth)
        first = float(bound.size(1e-3 * self.start, EARLY))
        last = float(self.up.size(1e-3 * self.start, LATE))
        looked = math.log(last / first) / (self.law.growth * seen.step)
        return first if looked < LONGEST_LOOKED else None

    def attractors(
        self,
        first: complex = 0j,
        loops: int = LOOPS,
        cycles: int = CYCLES,
        *,
        firing: bool = False,
    ) -> tuple[tuple[Cycle, float], ...]:
        """Limit cycles in which loops end that begin with z ``first`` rad/s, most first, with the
        share of each; raises Infeasible where they do not hold the nutation.

        Without any they begin at the start threshold in random phases; below it they wait for it
        unless they are ``firing``.
        """
        none = abs(first) <= FARTHEST * self.start
        z = np.full(ENTRIES, 0.5 * self.start if none else first, dtype=complex)
        if none:
            z *= np.exp(1j * self.rng.uniform(0.0, 2.0 * math.pi, len(z)))
        elif not any(self.seen.scatter) and not any(self.seen.grain):  # all would be alike
            z, loops, cycles = z[:1], 1, ALONE * cycles
        z, quiet, _ = self._flown(z, pausing=abs(z[0]) < self.start and not firing)
        share = float(quiet.mean())
        never, rounds = [z[~quiet]], list[Array]()
        z = np.resize(z[quiet], loops if share > 0.0 else 0)
        while len(z) and len(rounds) <= cycles:
            z, quiet, sums = self._flown(z, pausing=True)
            never.append(z[~quiet])
            z = z[quiet]
            rounds = [each[:, quiet] for each in (*rounds, sums)]
        share *= len(z) / loops
        ends = []
        if len(z):  # in the first round they part, by the noise of each
            ends.append((self._summed(np.array(rounds[1:])), share))
        if share < 1.0:
            _, _, sums = self._flown(np.concatenate(never)[:ENTRIES], pausing=False)
            ends.append((self._summed(sums[None]), 1.0 - share))
        return tuple(sorted(ends, key=lambda end: -end[1]))

    def _flown(
        self, z: ComplexArray, *, pausing: bool
    ) -> tuple[ComplexArray, NDArray[np.bool_], Array]:
        """Flight of each loop to where it falls quiet, or has fired too often: z (n,) after its
        last pulse, True where it is quiet, and sums (9, n) of it.

        Where ``pausing`` it begins as the loop sees the start threshold, after a wait that counts.
        """
        count = len(z)
        before = size = np.abs(z)
        if pausing:
            if (before <= FARTHEST * self.start).any():
                raise Infeasible(
                    "a firing leaves no nutation that could grow: sensor and valves have no errors"
                )
            # The sample at which it shows: all are looked at from ``near`` on, where there is one.
            size = np.maximum(before, self.near or 0.0)
            if self.near is None:
                size = self.up.size(before, self.rng.exponential(size=count))
            samples = np.ceil(np.log(size / before) / (self.law.growth * self.seen.step))
            size = before * np.exp(self.law.growth * (samples * self.seen.step - self.seen.first))
            z = z * (size / before) ** (self.turn / self.law.growth)
        first, second = self.law.gauge
        rates = np.column_stack([z.real / first, z.imag / second, np.full(count, self.spin)])
        down = math.ceil(2.0 * float(size.max()) / self.takes)
        most = FIRINGS + min(down, MOST_DOWN)
        truth = with_limits(self.truth, max_pulses=most)
        cases = [Case(replace(truth, omega0=row), (self.seed, next(self.numbers))) for row in rates]
        # What is not held ends at 90 deg, where nothing turns any more.
        each = 3.0 * (self.law.period + self.seen.first + self.loop.min_interval)
        until = most * (each + self.loop.sensor.delay) + FOLDS / self.law.growth
        fleet = Fleet(self.law, cases, min(until, MOST * self.seen.step), once=True)
        for pilot in fleet.pilots:
            pilot.active = not pausing or self.near is None
        fleet.fly()
        if work.exhausted():
            raise Infeasible(SPENT)
        if not pausing:
            self._expect_held([pilot for pilot in fleet.pilots if not pilot.quiet])
        after = np.asarray(self.law.seen(fleet.rates[0] + 1j * fleet.rates[1]))
        # Dissipation takes spin as |z| grows at the same H: cos θ goes with ω3.
        grown, rested = (np.cos(self.law.nutation(part, self.spin)) for part in (size, before))
        slowed = float(self.law.inertia.equivalent(self.spin)) * (1.0 - grown / rested)
        waited = np.log(size / before) / self.law.growth + (self.slower if pausing else 0.0)
        sums = [
            fleet.now + waited,
            fleet.rates[2] - self.spin - slowed,
            self.law.nutation(np.abs(after), self.spin),
            *np.array([self._of_firings(pilot) for pilot in fleet.pilots]).T,
        ]
        return after, np.array([bool(pilot.quiet) for pilot in fleet.pilots]), np.array(sums)

    def _expect_held(self, pilots: Sequence[Pilot]) -> None:
        """Raise Infeasible where loops that fire on do so at ever larger nutations.

        All of them together: with noise beyond the threshold the halves of a single flight differed
        by a third.
        """
        halves = np.zeros(2)
        for pilot in pilots:
            sizes = [each.true_nutation for each in pilot.fired]
            half = len(sizes) // 2
            if half:
                halves += np.mean(sizes[:half]), np.mean(sizes[half:])
        if halves[1] > RISING * halves[0]:
            raise Infeasible(TOO_FAST)

    def _summed(self, rounds: Array) -> Cycle:
        """Mean of the sums (rounds, 9, n) of some loops."""
        time, spin, low, pulses, cycles, impulse, propellant, high, largest = rounds.swapaxes(0, 1)
        total = float(time.sum())
        rate = float(pulses.sum()) / total
        used = float(propellant.sum()) / total
        apart = (pulses - rate * time).sum(axis=0)
        fired = pulses > 0.0
        return Cycle(
            pulses=rate,
            cycles=float(cycles.sum()) / total,
            impulse=float(impulse.sum()) / total,
            propellant=None if math.isnan(used) else used,
            spin_rate=float(spin.sum()) / total,
            doubt=math.sqrt(float((apart**2).sum())) / float(pulses.sum()),
            high=float(high[fired].mean()),
            low=float(np.exp(np.log(np.maximum(low[fired], 1e-300)).mean())),
            largest=float(largest.max()),
        )

    def _of_firings(self, pilot: Pilot) -> tuple[float, ...]:
        """Number of the firings of a flight, 1 if it ends in a pause, their impulse (N m s),
        propellant (kg), nutation as they begin (rad), of a cycle that of the first, and the
        largest; raises Infeasible where the nutation is not held.
        """
        sizes = np.array([each.true_nutation for each in pilot.fired] or [0.0])
        step = float(self.law.nutation(self.takes, self.spin))
        outgrown = sizes.max() > OUTGROWN * max(sizes[0], self.loop.start, step)
        if pilot.ending[0].fault or outgrown:
            raise Infeasible(TOO_FAST)
        pulses = [each.pulse for each in pilot.fired]
        used = [math.nan if pulse.propellant is None else pulse.propellant for pulse in pulses]
        return (
            len(pulses),
            bool(pilot.quiet),
            math.fsum(pulse.magnitude for pulse in pulses),
            math.fsum(used),
            sizes.max() if pilot.quiet else sizes.mean(),
            sizes.max(),
        )


def _symmetric(spacecraft: Spacecraft, loop: Loop) -> Spacecraft:
    """Symmetric body that nutates as one of three moments does, by a small nutation: as fast, with
    as much of a pulse, and with z as its ω.
    """
    inertia = spacecraft.inertia
    if inertia.symmetric:
        return spacecraft
    law = Law(spacecraft, loop)
    A = inertia.nutating(spacecraft.spin)
    first, second = np.array(law.gauge) * inertia.A / np.array(inertia.moments[:2])
    across = np.array([first, second, 1.0])
    channels = tuple(
        replace(
            channel,
            thrusters=tuple(
                replace(each, torque=across * each.torque) for each in channel.thrusters
            ),
        )
        for channel in spacecraft.channels
    )
    omega = complex(law.seen(spacecraft.initial.omega)) * inertia.A / A
    return replace(
        spacecraft,
        inertia=Inertia((A, A, inertia.C), inertia.axes, inertia.wheel),
        channels=channels,
        omega0=np.array([omega.real, omega.imag, spacecraft.spin]),
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
        cycles = Cycles(truth, loop, seed=seed)
        ends = list(cycles.attractors(cycles.of_file))
        # There may be others where a firing can leave more than the stop threshold that no smaller
        # pulse lowers.
        if 0.5 * band.step > loop.stop > 0.0:
            half = complex(cycles.law.size(0.5 * band.step, truth.spin))
            ends += [*cycles.attractors(), *cycles.attractors(half, firing=True)]
        (cycle, share), *rest = ends
        others = (
            each for each, _ in rest if abs(each.pulses - cycle.pulses) > DIFFERENT * cycle.pulses
        )
        noisy = cycles.seen.sigma > NOISY * cycles.start
        if noisy:
            cycle = cycle._replace(doubt=max(cycle.doubt, WIDENED))
        result = replace(result, noisy=noisy, cycle=cycle, share=share, other=next(others, None))
        return replace(result, band=band, lasts=_lasts(truth, loop, seed))
    except Infeasible as reason:
        rate = None if result.cycle is None else result.cycle.propellant
        if work.exhausted() and truth.tank is not None and rate:
            return replace(
                result, band=band, lasts=truth.tank.propellant / rate
            )  # as if the pressure stayed
        return replace(result, band=band, why=SPENT if work.exhausted() else str(reason))


def _lasts(spacecraft: Spacecraft, loop: Loop, seed: int) -> float | None:
    """Lifetime of the limit cycle, s: ∫ dm over the flow, as the pressure in the tank falls."""
    if spacecraft.tank is None:
        return None
    mass = spacecraft.tank.propellant
    total = 0.0
    for done, (share, weight) in enumerate(STAGES, start=1):
        work.reach(done)
        cycles = Cycles(spacecraft, loop, used=share * mass, seed=seed)
        rate = cycles.attractors(cycles.of_file)[0][0].propellant
        if rate is None:
            return None
        total += weight / rate
    return float(mass * total)
