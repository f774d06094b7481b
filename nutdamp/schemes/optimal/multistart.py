"""Schedules from very many starts, each brought to the cheapest near it, for strong thrusters and short horizons.

Sequences of a few channels at random moments, corners of the horizon among them, are descended as ideal impulses,
which fly in closed form; the better half goes on, twice. About the best of them every channel is then priced at every
moment (Lawden's primer vector): where a small impulse is worth more than it costs it is added, and the descent
repeated. Last, the best few go down on the true motion through real widths, without the pulses that nothing needs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.schemes.optimal.descent import Descent, Sequences, Task
from nutdamp.spacecraft.constraints import free_windows
from nutdamp.spacecraft.model import Vector
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

UNMET_COST = 100.0  # cost of a miss beside the propellant when the better part is chosen, per |H|, over the least cost
NEAR = 1.03  # schedules of ideal impulses so much dearer than the best go on to the true motion
HALF = 0.5  # share of the least on-time from which a pulse is lengthened to it; shorter ones are left out

STARTS, BEST = 512, 8  # random sequences to begin with, and schedules that go on to the next stage
ROUNDS = ((12, 1 / 2), (12, 1 / 3), (40, 1.0))  # steps of descent, and share of the sequences that goes on after them

SPARE, ADDITIONS = 2, 2
"""Pulses more than equations when some are added: what they make needless goes back to nothing; rounds of that."""

MOMENTS, SMALL = 97, 1e-6  # moments at which each channel is priced, by an impulse of that share of all there is to do
GAIN = 1e-4  # share of the cost that is worth another round, and by which two schedules differ

FOUND, EXACT = 1e-6, 1e-10
"""Largest miss, over |H|, of a schedule of ideal impulses, and of one flown through real widths."""

NEEDLESS, NOTHING = 1e-3, 1e-10
"""Shares of all there is to do below which a pulse may be left out, and is even where nothing makes good for it."""

WIDE, MOST_KICKS = 0.25, 24
"""Angle of the faster turn, rad, from which pulses are first taken as several kicks, and the most of them."""

CLOSE, MOVES, FEWEST_MOVES = 1e-5, 30, 3
"""Barrier of the bounds from which a schedule that is nearly the cheapest nearby is descended, steps of such a descent,
over the number of pulses, and the fewest."""


class Starts(NamedTuple):
    """Sequences and unknowns of `Task` from which they are descended."""

    sequences: Sequences
    x: Vector


class Moments(NamedTuple):
    """Pulses still without order: channels ``which``, centres ``t`` and on-times ``on`` in s, (b, n) each."""

    which: NDArray[np.int_]
    t: Vector
    on: Vector


def schedules(task: Task, known: Iterable[Schedule] = ()) -> list[Schedule]:
    """Schedules that leave nothing and are the cheapest nearby, the cheapest first; ``known`` ones are improved too."""
    if not np.all(task.unit > 0.0):
        return []
    rng = np.random.default_rng(0)  # the same plan every time
    for pulses in range(_pulses(task, 0), 0, -1):  # fewer where gap and windows leave no room for more
        starts = random_starts(task, pulses, STARTS, rng)
        if len(starts.x):
            break
    best = _screened(task, starts)
    for _ in range(ADDITIONS):
        added = _added(task, best, _pulses(task, SPARE), rng)
        if added is None:
            break
        descent = Descent(task, *added, kicks=1, barrier=1e-2)
        descent.run(50)
        more = _best(descent)
        if not len(more.left) or more.cost[0] > best.cost[0] * (1.0 - GAIN):
            break
        best = more
    return _flown(task, best, known)


def cheapened(task: Task, schedule: Schedule) -> Schedule | None:
    """A schedule after a few steps down on the true motion, fewer where it has many pulses; None where there is none.

    Its sequence of channels stays, and what it leaves too.
    """
    every = Moments._make(part[None] for part in _moments_of(task, schedule))
    starts = laid_out(task, every, task.shortest[every.which])
    if not len(starts.x):
        return None
    descent = Descent(task, *starts, kicks=0, barrier=CLOSE)
    descent.run(max(MOVES // len(schedule), FEWEST_MOVES))
    descent.close()
    there = bool(descent.left[0] < EXACT)
    return _schedule(task, _moments(descent.sequences.which[0], descent.state.x[0])) if there else None


def _pulses(task: Task, spare: int) -> int:
    """Pulses of a sequence: one for each equation, at least three so that there is a choice, and ``spare`` ones."""
    most = task.body.limits.max_pulses
    count = max(len(task.chosen), 3) + spare
    return count if most is None else min(count, most)


def random_starts(task: Task, pulses: int, count: int, rng: np.random.Generator) -> Starts:
    """Random channels and moments of ``count`` sequences; many begin or end with the time there is."""
    limits, horizon = task.body.limits, task.body.horizon
    which = rng.integers(len(task.channels), size=(count, pulses))
    share = np.sort(rng.uniform(size=(count, pulses)), axis=1)
    share[rng.random(count) < 0.4, 0] = 0.0
    share[rng.random(count) < 0.4, -1] = 1.0
    on = task.unit[which] / pulses * rng.uniform(0.3, 1.5, (count, pulses))
    return laid_out(task, Moments(which, limits.earliest + (horizon - limits.earliest) * share, on))


def laid_out(task: Task, moments: Moments, shortest: Vector | None = None) -> Starts:
    """The pulses in order, moved apart and into windows, strictly within all bounds; those that do not fit left out.

    ``shortest`` (b, n) s, least on-times; none where pulses may still vanish.
    """
    order = np.argsort(moments.t, axis=1, kind="stable")
    which = np.take_along_axis(moments.which, order, axis=1)
    t, on = (np.take_along_axis(part, order, axis=1) for part in moments[1:])
    least = np.zeros(which.shape) if shortest is None else np.take_along_axis(shortest, order, axis=1)
    begins, ends = _windows(task, t)
    longest = np.minimum(np.array([channel.max_on_time for channel in task.channels])[which], ends - begins)
    limits = task.body.limits
    inside = 1e-4 * (task.body.horizon - limits.earliest) / which.shape[1]
    edge = 1e-3 * np.minimum(task.unit[which], np.maximum(longest - least, 0.0))
    on = np.minimum(np.maximum(on, least + edge), longest - edge)
    start = t - 0.5 * on
    ready, close = np.full(len(t), -np.inf), np.full(len(t), np.inf)
    for pulse in range(which.shape[1]):
        start[:, pulse] = np.maximum(np.maximum(start[:, pulse], begins[:, pulse] + inside), ready)
        ready = start[:, pulse] + on[:, pulse] + limits.gap + inside
    for pulse in reversed(range(which.shape[1])):
        latest = np.minimum(ends[:, pulse], close - limits.gap) - inside - on[:, pulse]
        start[:, pulse] = np.minimum(start[:, pulse], latest)
        close = start[:, pulse]
    sequences = Sequences(which, begins, ends, least, longest)
    x = np.hstack([start, on, np.zeros((len(t), task.loose))])
    rows, levels = task.bounds(sequences)
    fits = np.all(x @ rows.T > levels, axis=1)
    return Starts(sequences.of(fits), x[fits])


def _windows(task: Task, t: Vector) -> tuple[Vector, Vector]:
    """Begin and end, s, of the windows without blackout in which moments ``t`` lie, or of the nearest."""
    limits = task.body.limits
    free = [(begin, end) for begin, end in free_windows(task.body) if begin < end]
    if not free:
        return np.full(t.shape, limits.earliest), np.full(t.shape, limits.earliest)
    begins, ends = np.array(free).T
    nearest = np.argmin(np.maximum(begins - t[..., None], t[..., None] - ends), axis=-1)
    return begins[nearest], ends[nearest]


class _Best(NamedTuple):
    """The cheapest distinct sequences that leave nothing, cheapest first, and the ``prices`` of their equations."""

    sequences: Sequences
    x: Vector
    cost: Vector
    left: Vector
    prices: Vector


def _best(descent: Descent) -> _Best:
    cost, left = descent.cost, descent.left
    chosen: list[int] = []
    for row in np.argsort(cost, kind="stable").tolist():
        if left[row] < FOUND and all(abs(cost[row] - cost[other]) > GAIN * cost[other] for other in chosen):
            chosen.append(row)
    rows = np.array(chosen[:BEST], dtype=int)
    state = descent.state.of(rows)
    return _Best(descent.sequences.of(rows), state.x, cost[rows], left[rows], state.prices)


def _screened(task: Task, starts: Starts) -> _Best:
    """The best of very many: in each round some steps, after which only the better part, misses and all, goes on."""
    descent = Descent(task, *starts, kicks=1)
    for steps, share in ROUNDS:
        descent.run(steps)
        score = np.nan_to_num(descent.cost / task.least + UNMET_COST * descent.left, nan=np.inf)
        descent.keep(np.argsort(score, kind="stable")[: max(int(share * len(score)), 1)])
    return _best(descent)


def _added(task: Task, best: _Best, pulses: int, rng: np.random.Generator) -> Starts | None:
    """The best sequences with more pulses, where they are worth most; three choices of each."""
    grid = np.linspace(task.body.limits.earliest, task.body.horizon, MOMENTS)
    every: list[Moments] = []
    for row in range(len(best.left)):
        which, x = best.sequences.which[row], best.x[row]
        count = len(which)
        worth = _worth(task, which, x, best.prices[row], grid)
        padded = np.pad(worth, ((0, 0), (1, 1)), constant_values=-np.inf)
        peak = (worth >= padded[:, :-2]) & (worth >= padded[:, 2:]) & (worth > GAIN)
        channel, moment = np.nonzero(peak)
        order = np.argsort(-worth[channel, moment], kind="stable")
        needed = x[count : 2 * count] > NEEDLESS * task.unit[which]
        old = Moments(which[needed], (x[:count] + 0.5 * x[count : 2 * count])[needed], x[count : 2 * count][needed])
        room = pulses - len(old.which)
        for first, step in ((0, 1), (1, 3), (2, 3)):
            chosen = order[first::step][: max(room, 0)]
            if not len(chosen):
                break
            spare = rng.integers(len(task.channels), size=max(room - len(chosen), 0))
            added = np.concatenate([channel[chosen], spare])
            t = np.concatenate([grid[moment[chosen]], rng.uniform(grid[0], grid[-1], len(spare))])
            on = task.unit[added] * np.repeat([0.02, 0.01], [len(chosen), len(spare)])
            every.append(Moments(*(np.concatenate(pair) for pair in zip(old, (added, t, on), strict=True))))
    if not every:
        return None
    return laid_out(task, Moments(*(np.array(part) for part in zip(*every, strict=True))))


def _worth(task: Task, which: NDArray[np.int_], x: Vector, prices: Vector, t: Vector) -> Vector:
    """Saving of a sequence's cost by a small impulse of each channel at moments ``t`` (k,), (channels, k), over all."""
    count, n = len(which), len(task.channels) * len(t)
    channel, moment = np.repeat(np.arange(len(task.channels)), len(t)), np.tile(t, len(task.channels))
    centres = x[:count] + 0.5 * x[count : 2 * count]
    place = np.searchsorted(centres, moment)
    order = np.argsort(np.hstack([np.tile(np.arange(count) + 0.5, (n, 1)), place[:, None]]), axis=1, kind="stable")
    small = SMALL * task.unit[channel]

    def among(old: Any, new: Any) -> Any:
        return np.take_along_axis(np.hstack([np.tile(old, (n, 1)), new[:, None]]), order, axis=1)

    on = among(x[count : 2 * count], small)
    start = among(centres, moment) - 0.5 * on
    loose = np.tile(x[2 * count :], (n, 1))
    there = task.misses(among(which, channel), np.hstack([start, on, loose]), 1)
    here = task.misses(which[None], x[None], 1)
    # By the prices of the equations: its change in them, less its cost.
    worth = -(there - here) / SMALL @ prices - (task.costs * task.unit / task.least)[channel]
    return np.asarray(worth.reshape(len(task.channels), len(t)))


def _flown(task: Task, best: _Best, known: Iterable[Schedule]) -> list[Schedule]:
    """Schedules on the true motion from the best of ideal impulses and from ``known`` ones, the cheapest first."""
    given = [_moments_of(task, schedule) for schedule in known if 0 < len(schedule) <= _pulses(task, 2 * SPARE)]
    ideal = [_moments(which, x) for which, x in zip(best.sequences.which, best.x, strict=True)]
    near = int(np.count_nonzero(best.cost <= NEAR * best.cost[0])) if ideal else 0  # the cheapest come first
    flown = _on_the_true_motion(task, [*ideal[:near], *given]) or _on_the_true_motion(task, ideal[near:])
    spare = [len(_needed(task, moments).which) < len(moments.which) for moments in flown]
    lean = [moments for moments, more in zip(flown, spare, strict=True) if not more]
    lean += _on_the_true_motion(task, [moments for moments, more in zip(flown, spare, strict=True) if more])

    def price(moments: Moments) -> float:
        return float(task.price(moments.which, moments.on))

    most = min(map(price, lean), default=math.inf) * (1.0 - GAIN)
    kept = lean + [moments for moments, more in zip(flown, spare, strict=True) if more and price(moments) < most]
    return [_schedule(task, moments) for moments in sorted(kept, key=price)]


def _on_the_true_motion(task: Task, every: Sequence[Moments]) -> list[Moments]:
    """Sequences (n,) each, descended on the true motion without their needless pulses."""
    lowered: list[Moments] = []
    fewer = [_needed(task, moments) for moments in every]
    for count in sorted({len(moments.which) for moments in fewer} - {0}):
        alike = [moments for moments in fewer if len(moments.which) == count]
        together = Moments(*(np.array(part) for part in zip(*alike, strict=True)))
        starts = laid_out(task, together, task.shortest[together.which])
        if len(starts.x):
            barrier, widest = 1e-4, float(np.max(together.on)) / task.pace
            if widest > WIDE:  # kicks fly faster than the true motion
                descent = Descent(task, *starts, kicks=min(math.ceil(widest / WIDE), MOST_KICKS), barrier=barrier)
                descent.run(30)
                starts, barrier = Starts(descent.sequences, descent.state.x), 1e-6
            descent = Descent(task, *starts, kicks=0, barrier=barrier)
            descent.run(20)
            descent.close()
            rows = np.flatnonzero(descent.left < EXACT)
            lowered += [_moments(descent.sequences.which[row], descent.state.x[row]) for row in rows]
    return lowered


def _moments_of(task: Task, schedule: Schedule) -> Moments:
    """The pulses of a schedule."""
    numbers = {channel.name: number for number, channel in enumerate(task.channels)}
    which = np.array([numbers[pulse.channel] for pulse in schedule], dtype=int)
    return Moments(which, np.array([pulse.t for pulse in schedule]), np.array([pulse.on_time for pulse in schedule]))


def _moments(which: NDArray[np.int_], x: Vector) -> Moments:
    """One sequence (n,) from its unknowns."""
    start, on = x[: len(which)], x[len(which) : 2 * len(which)]
    return Moments(which, start + 0.5 * on, on)


def _schedule(task: Task, moments: Moments) -> Schedule:
    """One sequence (n,) as a schedule."""
    felt = moments.on > NOTHING * task.unit[moments.which]
    every = zip(*(part[felt].tolist() for part in moments), strict=True)
    return Schedule(tuple(channel_pulse(task.channels[number], t, on) for number, t, on in every))


def _needed(task: Task, moments: Moments) -> Moments:
    """One sequence (n,) without needless pulses, and with pulses of a channel that touch as one."""
    kept = moments.on > np.maximum(NEEDLESS * task.unit[moments.which], HALF * task.shortest[moments.which])
    moments = Moments(*(part[kept] for part in moments))
    which, start, on = moments.which.tolist(), (moments.t - 0.5 * moments.on).tolist(), moments.on.tolist()
    for number in reversed(range(1, len(which))):
        before = number - 1
        together = start[number] + on[number] - start[before]
        touching = start[number] - start[before] - on[before] < NEEDLESS * task.unit[which[number]]
        if which[number] == which[before] and touching and together < task.channels[which[number]].max_on_time:
            on[before] = together
            del which[number], start[number], on[number]
    return Moments(np.array(which, dtype=int), np.array(start) + 0.5 * np.array(on), np.array(on))
