"""Schedules from very many starts, each brought to the cheapest near it, for strong thrusters and
short horizons.

Sequences of a few channels at random moments, corners of the horizon among them, are descended as
ideal impulses, which fly in closed form; the better half goes on, twice. About the best of them
every channel is then priced at every moment (Lawden's primer vector): where a small impulse is
worth more than it costs it is added, and the descent repeated. Last, the best few go down on the
true motion through real widths, without the pulses that nothing needs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.schemes.optimal.descent import Descent, Sequences, Task
from nutdamp.schemes.optimal.linear_program import peaks
from nutdamp.spacecraft.constraints import free_windows
from nutdamp.spacecraft.model import Vector
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

# cost of a miss beside the propellant when the better part is chosen, per |H|, over the least cost
UNMET_COST = 100.0
NEAR = 1.03  # schedules of ideal impulses so much dearer than the best go on to the true motion
# share of the least on-time from which a pulse is lengthened to it; shorter ones are left out
HALF = 0.5
STARTS, BEST = 512, 8  # random sequences to begin with, and schedules that go on to the next stage
ROUNDS = (
    (12, 1 / 2),
    (12, 1 / 3),
    (40, 1.0),
)  # steps of descent, and share of the sequences that goes on after them
SPARE, ADDITIONS = (
    2,
    2,
)  # more pulses than equations, which may go back to nothing; rounds of adding them
MOMENTS, SMALL = (
    97,
    1e-6,
)  # moments at which each channel is priced, by an impulse of that share of all there is to do
GAIN = 1e-4  # share of the cost that is worth another round, and by which two schedules differ
FOUND, EXACT = (
    1e-6,
    1e-10,
)  # largest miss, over |H|, of ideal impulses, and of a flight through real widths
# Shares of all there is to do below which a pulse may be left out, and is even where nothing makes
# good for it.
NEEDLESS, NOTHING = 1e-3, 1e-10

WIDE, MOST_KICKS = (
    0.25,
    24,
)  # rad of the faster turn from which a pulse is first so many kicks, and the most of them

# Barrier for a schedule that is nearly the cheapest nearby; steps of its descent, over its pulses;
# the fewest.
CLOSE, MOVES, FEWEST_MOVES = 1e-5, 30, 3

# Barrier for one that has lost its way from there; share of the way off the target that H may end,
# to begin with.
APART, INSIDE = 1e-2, 0.98


class Moments(NamedTuple):
    """Pulses still without order: channels ``which``, centres ``t`` and on-times ``on`` in s, (b,
    n) each.
    """

    which: NDArray[np.int_]
    t: Vector
    on: Vector

    def of(self, pulses: NDArray[np.bool_]) -> Moments:
        """Some of the pulses of one sequence (n,)."""
        return Moments._make(part[pulses] for part in self)

    def in_order(self) -> Moments:
        """The pulses of each sequence (b, n) by their centres."""
        order = np.argsort(self.t, axis=1, kind="stable")
        return Moments._make(np.take_along_axis(part, order, axis=1) for part in self)


def schedules(task: Task, known: Iterable[Schedule] = ()) -> list[Schedule]:
    """Schedules that leave nothing and are the cheapest nearby, the cheapest first; ``known`` ones
    are improved too.
    """
    if not np.all(task.unit > 0.0):
        return []
    rng = np.random.default_rng(0)  # the same plan every time
    for pulses in range(
        _pulses(task, 0), 0, -1
    ):  # fewer where gap and windows leave no room for more
        sequences, x = random_starts(task, pulses, STARTS, rng)
        if len(x):
            break
    descent = Descent(task, sequences, x, kicks=1)
    for steps, share in ROUNDS:  # after each only the better part, misses and all, goes on
        descent.run(steps)
        score = np.nan_to_num(descent.cost / task.least + UNMET_COST * descent.left, nan=np.inf)
        descent = descent.of(np.argsort(score, kind="stable")[: max(int(share * len(score)), 1)])
    best = _best(descent)
    for _ in range(ADDITIONS):
        added = _added(task, best, _pulses(task, SPARE), rng)
        if not added:
            break
        descent = Descent(task, *laid_out(task, _together(added)), kicks=1, barrier=1e-2)
        descent.run(50)
        more = _best(descent)
        if not len(more.cost) or more.cost[0] > best.cost[0] * (1.0 - GAIN):
            break
        best = more
    return _flown(task, best, known)


def cheapened(task: Task, schedule: Schedule) -> Schedule | None:
    """A schedule of the same channels after a few steps down on the true motion; None where there
    is none.
    """
    sequences, x = laid_out(task, _together([_moments_of(task, schedule)]), bounded=True)
    ways = [(CLOSE, max(MOVES // len(schedule), FEWEST_MOVES))]
    if len(schedule) <= _pulses(
        task, 2 * SPARE
    ):  # pulses that touched lie apart now, and miss too much for few steps
        ways.append((APART, MOVES))
    for barrier, steps in ways if len(x) else ():
        if lowered := _lowered(Descent(task, sequences, x, kicks=0, barrier=barrier), steps):
            return _schedule(task, lowered[0])
    return None


def _pulses(task: Task, spare: int) -> int:
    """Pulses of a sequence: one for each equation, at least three so that there is a choice, and
    ``spare`` ones.
    """
    most = task.spacecraft.limits.max_pulses
    count = max(len(task.chosen), 3) + spare
    return count if most is None else min(count, most)


def random_starts(
    task: Task, pulses: int, count: int, rng: np.random.Generator
) -> tuple[Sequences, Vector]:
    """Random channels and moments of ``count`` sequences;
    many begin or end with the time there is.
    """
    limits, horizon = task.spacecraft.limits, task.spacecraft.horizon
    which = rng.integers(len(task.channels), size=(count, pulses))
    share = np.sort(rng.uniform(size=(count, pulses)), axis=1)
    share[rng.random(count) < 0.4, 0] = 0.0
    share[rng.random(count) < 0.4, -1] = 1.0
    on = task.unit[which] / pulses * rng.uniform(0.3, 1.5, (count, pulses))
    return laid_out(task, Moments(which, limits.earliest + (horizon - limits.earliest) * share, on))


def laid_out(task: Task, moments: Moments, *, bounded: bool = False) -> tuple[Sequences, Vector]:
    """Sequences that fit, and their unknowns: pulses in order, moved apart and into windows,
    strictly within bounds.

    Pulses may still vanish unless on-times are ``bounded`` from below.
    """
    which, t, on = moments.in_order()
    least = task.shortest[which] if bounded else np.zeros(which.shape)
    limits = task.spacecraft.limits
    free = [(begin, end) for begin, end in free_windows(task.spacecraft) if begin < end]
    begins, ends = np.array(free or [(limits.earliest, limits.earliest)]).T
    # The windows without blackout in which the moments lie, or the nearest.
    nearest = np.argmin(np.maximum(begins - t[..., None], t[..., None] - ends), axis=-1)
    begins, ends = begins[nearest], ends[nearest]
    longest = np.minimum(
        np.array([channel.max_on_time for channel in task.channels])[which], ends - begins
    )
    inside = 1e-4 * (task.spacecraft.horizon - limits.earliest) / which.shape[1]
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
    if bounded and task.loose:  # H begins as far off its target as they leave it
        off = task.misses(which, x, 0)[:, 2:4] * task.momentum / task.off
        x[:, -2:] = off * (INSIDE / np.maximum(np.hypot(*off.T), INSIDE))[:, None]
    rows, levels = task.bounds(sequences)
    fits = np.all(x @ rows.T > levels, axis=1)
    return sequences.of(fits), x[fits]


def _best(descent: Descent) -> Descent:
    """The cheapest distinct sequences that leave nothing, cheapest first."""
    cost, left = descent.cost, descent.left
    chosen: list[int] = []
    for row in np.argsort(cost, kind="stable").tolist():
        if left[row] < FOUND and all(
            abs(cost[row] - cost[other]) > GAIN * cost[other] for other in chosen
        ):
            chosen.append(row)
    return descent.of(np.array(chosen[:BEST], dtype=int))


def _added(task: Task, best: Descent, pulses: int, rng: np.random.Generator) -> list[Moments]:
    """The best sequences with more pulses, where they are worth most; three choices of each."""
    grid = np.linspace(task.spacecraft.limits.earliest, task.spacecraft.horizon, MOMENTS)
    every: list[Moments] = []
    for ideal, x, prices in zip(_every(best), best.state.x, best.state.prices, strict=True):
        worth = _worth(task, ideal, x, prices, grid)
        channel, moment = peaks(worth, GAIN)
        order = np.argsort(-worth[channel, moment], kind="stable")
        old = ideal.of(ideal.on > NEEDLESS * task.unit[ideal.which])
        room = pulses - len(old.which)
        for first, step in ((0, 1), (1, 3), (2, 3)):
            chosen = order[first::step][: max(room, 0)]
            if not len(chosen):
                break
            spare = rng.integers(len(task.channels), size=max(room - len(chosen), 0))
            added = np.concatenate([channel[chosen], spare])
            t = np.concatenate([grid[moment[chosen]], rng.uniform(grid[0], grid[-1], len(spare))])
            on = task.unit[added] * np.repeat([0.02, 0.01], [len(chosen), len(spare)])
            every.append(
                Moments(*(np.concatenate(pair) for pair in zip(old, (added, t, on), strict=True)))
            )
    return every


def _worth(task: Task, ideal: Moments, x: Vector, prices: Vector, t: Vector) -> Vector:
    """Saving by a small impulse of each channel at ``t`` (k,) s beside the pulses of unknowns x,
    (channels, k).
    """
    count = len(task.channels)
    channel = np.repeat(np.arange(count), len(t))
    added = channel, np.tile(t, count), SMALL * task.unit[channel]
    joined = (
        np.column_stack([new, np.tile(old, (len(new), 1))])
        for new, old in zip(added, ideal, strict=True)
    )
    which, centres, on = Moments(*joined).in_order()
    loose = np.tile(x[2 * len(ideal.which) :], (len(channel), 1))
    there = task.misses(which, np.hstack([centres - 0.5 * on, on, loose]), 1)
    here = task.misses(ideal.which[None], x[None], 1)
    # By the prices of the equations: its change in them, less its cost.
    worth = -(there - here) / SMALL @ prices - (task.costs * task.unit / task.least)[channel]
    return np.asarray(worth.reshape(count, len(t)))


def _flown(task: Task, best: Descent, known: Iterable[Schedule]) -> list[Schedule]:
    """Schedules on the true motion from the best of ideal impulses and from ``known`` ones, the
    cheapest first.
    """
    given = [
        _moments_of(task, schedule)
        for schedule in known
        if 0 < len(schedule) <= _pulses(task, 2 * SPARE)
    ]
    ideal = _every(best)
    near = (
        int(np.count_nonzero(best.cost <= NEAR * best.cost[0])) if ideal else 0
    )  # the cheapest come first
    flown = _on_the_true_motion(task, [*ideal[:near], *given]) or _on_the_true_motion(
        task, ideal[near:]
    )
    lean, spare = list[Moments](), list[Moments]()
    for moments in flown:
        (spare if len(_needed(task, moments).which) < len(moments.which) else lean).append(moments)
    lean += _on_the_true_motion(task, spare)

    def price(moments: Moments) -> float:
        return float(task.price(moments.which, moments.on))

    most = min(map(price, lean), default=math.inf) * (1.0 - GAIN)
    kept = lean + [moments for moments in spare if price(moments) < most]
    return [_schedule(task, moments) for moments in sorted(kept, key=price)]


def _on_the_true_motion(task: Task, every: Sequence[Moments]) -> list[Moments]:
    """Sequences (n,) each, descended on the true motion without their needless pulses."""
    lowered: list[Moments] = []
    fewer = [_needed(task, moments) for moments in every]
    for count in sorted({len(moments.which) for moments in fewer} - {0}):
        together = _together([moments for moments in fewer if len(moments.which) == count])
        sequences, x = laid_out(task, together, bounded=True)
        if len(x):
            barrier = 1e-4
            widest = float(np.max(together.on)) / task.pace
            if widest > WIDE:  # kicks fly faster than the true motion
                kicks = min(math.ceil(widest / WIDE), MOST_KICKS)
                descent = Descent(task, sequences, x, kicks=kicks, barrier=barrier)
                descent.run(30)
                x = descent.state.x
                barrier = 1e-6
            lowered += _lowered(Descent(task, sequences, x, kicks=0, barrier=barrier), 20)
    return lowered


def _lowered(descent: Descent, steps: int) -> list[Moments]:
    """The sequences (n,) that leave nothing after some steps of a descent on the true motion."""
    descent.run(steps)
    descent.close()
    return _every(descent.of(np.flatnonzero(descent.left < EXACT)))


def _together(every: Iterable[tuple[Any, Any, Any]]) -> Moments:
    """Pulses as arrays (n,), or sequences (n,) of as many pulses each as arrays (b, n)."""
    return Moments(*(np.array(part) for part in zip(*every, strict=True)))


def _moments_of(task: Task, schedule: Schedule) -> Moments:
    """The pulses of a schedule."""
    numbers = {channel.name: number for number, channel in enumerate(task.channels)}
    return _together((numbers[pulse.channel], pulse.t, pulse.on_time) for pulse in schedule)


def _every(descent: Descent) -> list[Moments]:
    """The sequences (n,) of a descent."""
    which = descent.sequences.which
    start, on = np.split(descent.state.x[:, : 2 * which.shape[1]], 2, axis=1)
    return [Moments(*each) for each in zip(which, start + 0.5 * on, on, strict=True)]


def _schedule(task: Task, moments: Moments) -> Schedule:
    """One sequence (n,) as a schedule."""
    felt = moments.of(moments.on > NOTHING * task.unit[moments.which])
    pulses = zip(*(part.tolist() for part in felt), strict=True)
    return Schedule(tuple(channel_pulse(task.channels[number], t, on) for number, t, on in pulses))


def _needed(task: Task, moments: Moments) -> Moments:
    """One sequence (n,) without needless pulses, and with pulses of a channel that touch as one."""
    kept = moments.on > np.maximum(
        NEEDLESS * task.unit[moments.which], HALF * task.shortest[moments.which]
    )
    moments = moments.of(kept)
    which, start, on = (
        moments.which.tolist(),
        (moments.t - 0.5 * moments.on).tolist(),
        moments.on.tolist(),
    )
    for number in reversed(range(1, len(which))):
        before = number - 1
        together = start[number] + on[number] - start[before]
        touching = start[number] - start[before] - on[before] < NEEDLESS * task.unit[which[number]]
        if (
            which[number] == which[before]
            and touching
            and together < task.channels[which[number]].max_on_time
        ):
            on[before] = together
            del which[number], start[number], on[number]
    return Moments(np.array(which, dtype=int), np.array(start) + 0.5 * np.array(on), np.array(on))
