"""Schedules beside those of the linear program: simple spin changes, other ends, other schemes as
starts.

And firing almost without a pause, one channel after another: the earliest end, and the least cost
in a short horizon. Channels share each slot of time: what one after another can supply is the
convex hull of what each can. The slots become burns without gaps, whose lengths are then found on
the true motion.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.flight.end_state import left_by
from nutdamp.schemes.catalogue import (
    FOUR_PULSE,
    HALF_CONE,
    ONE_PULSE,
    RHUMB_LINE,
    TWO_PULSE,
    FourPulseOptions,
    HalfConeOptions,
    RhumbLineOptions,
    Scheme,
    SchemeOptions,
    TwoPulseOptions,
)
from nutdamp.schemes.correction import Correction, SymmetricModel, model_of, solve
from nutdamp.schemes.optimal.descent import Task
from nutdamp.schemes.optimal.linear_program import GrowingProgram, Shares
from nutdamp.schemes.optimal.problem import LEFT, UNMET, Problem
from nutdamp.schemes.optimal.refinement import AROUND, Influence, along, small_angles
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import Windows, keeps_limits
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

# programs one after the other, each about the flight of the one before: at large angles small ones
# mislead
LINES = 4
PROGRAM = 4.0  # units of work of a program
STARTS, MOST_PULSES = (
    8,
    200,
)  # starts in a nutation period of a channel with a transverse torque; pulses at most
CORRECTED = 4  # flights by which the length of a spin change is corrected


def spin_changes(problem: Problem) -> Iterator[Schedule]:
    """Simple spin changes that keep limits and requirement; none where H has a target.

    The pulses of a channel from one moment on, one each turn or one after the other.
    """
    spacecraft, goal = problem.spacecraft, problem.spacecraft.goal.spin
    if goal is None or spacecraft.goal.axis is not None:
        return
    for channel in spacecraft.channels:
        if (goal - spacecraft.spin) * channel.axial <= 0.0:
            continue
        starts = STARTS if abs(channel.transverse) > 1e-12 * abs(channel.axial) else 1
        whole = (goal - spacecraft.spin) * spacecraft.inertia.C / channel.axial
        count = max(math.ceil(whole / channel.max_on_time * (1.0 - 1e-9)), 1)
        turns = (0.0, 2.0 * math.pi / spacecraft.fastest)[: 1 if count == 1 else 2]
        if count <= MOST_PULSES:
            for number, turn in itertools.product(range(starts), turns):
                start = spacecraft.limits.earliest + number / starts * spacecraft.nutation_period
                if schedule := _spin_change(problem, channel, whole, count, start, turn):
                    yield schedule


def _spin_change(
    problem: Problem, channel: Channel, whole: float, count: int, start: float, turn: float
) -> Schedule | None:
    """So many pulses that are on for about ``whole`` s together, corrected on their flights."""
    spacecraft, tick = problem.spacecraft, problem.spacecraft.limits.tick
    goal = spacecraft.goal.spin or 0.0
    for _ in range(CORRECTED):
        on_time = Windows(spacecraft).nearest_tick(whole / count)
        if not channel.min_on_time <= on_time <= channel.max_on_time * (1.0 + 1e-12):
            return None
        apart = max(turn, on_time + spacecraft.limits.gap)
        if tick is not None:
            start, apart = (math.ceil(time / tick - 1e-9) * tick for time in (start, apart))
        centres = start + apart * np.arange(count) + 0.5 * on_time
        schedule = Schedule(tuple(channel_pulse(channel, t, on_time) for t in centres.tolist()))
        if schedule.end > spacecraft.horizon:
            return None
        flight = problem.flown(schedule)
        missed = goal - flight.settled.spin
        if tick is not None or abs(missed) < 1e-12 * abs(goal):
            break
        whole += missed * spacecraft.inertia.C / channel.axial
    held = requirements.held(spacecraft, left_by(flight))
    kept = all(bound.met for bound in held) and keeps_limits(spacecraft, schedule)
    return schedule if kept else None


def by_other_schemes(spacecraft: Spacecraft, *, shift: bool) -> Iterator[Schedule]:
    """Schedules by the channels of the ``spacecraft`` for the same goal, one after the other;
    ``shift``: H counts.

    The later ones take longer to plan, and are rarely better.
    """
    from nutdamp.schemes import half_cone, legs, one_pulse, rhumb_line, two_pulse

    # The Sun keeps the phase of trains alone.
    without = replace(spacecraft, steerable=None, goal=replace(spacecraft.goal, sun=None))
    model = (
        SymmetricModel(without, without, np.ones(2))
        if without.inertia.symmetric
        else model_of(without)
    )
    plans: list[
        tuple[Scheme, Callable[[Spacecraft, Any], Schedule | Iterable[Schedule]], SchemeOptions]
    ]
    if not shift:
        plans = [(ONE_PULSE, one_pulse.schedule, SchemeOptions())]
        if not without.inertia.symmetric:
            plans.append(
                (
                    FOUR_PULSE,
                    lambda _, options: legs.on_true_motion(without, options),
                    FourPulseOptions(),
                )
            )
    elif without.goal.axis is None:
        plans = [(TWO_PULSE, two_pulse.alternatives, TwoPulseOptions())]
    else:
        plans = [(TWO_PULSE, two_pulse.schedule, TwoPulseOptions())]
        if without.spin != 0.0:
            plans.append((RHUMB_LINE, rhumb_line.schedule, RhumbLineOptions()))
        plans += [
            (HALF_CONE, half_cone.schedule, HalfConeOptions(cones=cones))
            for cones in (None, 12, 6, 3)
        ]
    for number, (scheme, plan, options) in enumerate(plans):
        if number and work.exhausted():
            return
        try:
            planned = plan(model.symmetric, options)
            every = [planned] if isinstance(planned, Schedule) else list(planned)
        except Infeasible:
            continue
        if not without.inertia.symmetric:
            every = [
                Correction(scheme, options)(without, model.translate(schedule))
                for schedule in every
            ]
        yield from (schedule for schedule in every if keeps_limits(spacecraft, schedule))


SLOTS, MOST_SLOTS = 40, 320  # slots in the faster of the two turns, at ω3 and at aω3, and in all
SHORTEST = 0.02  # share of a slot below which a burn is left out before the lengths are found

# Steps in which the earliest end by small angles is found: ends found to 0.1 % were up to 8 %
# later, for the next of the shares added to it was taken then; in the built-in example 13 %.
HALVINGS = 10
# Shares added to the earliest end by small angles that are tried in turn.
LONGER = (0.0, 0.01, 0.03, 0.08, 0.2, 0.4, 0.8)


# Numbers (n,) of channels that fire one after the other, -1 where none does; for how long, (n,) s;
# how far from the target H is to end, where it may, (2,) N m s.
Pieces = tuple[NDArray[np.int_], Vector, Vector]


def earliest(problem: Problem) -> Schedule | None:
    """The schedule of one channel after another that ends first, as far as it is found; None where
    there is none.
    """
    begin, horizon = problem.spacecraft.limits.earliest, problem.spacecraft.horizon
    influence = small_angles(problem.spacecraft, problem.equations)

    if _pieces(problem, influence, horizon) is None:
        return None
    low, high = begin, horizon
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        enough = _pieces(problem, influence, middle) is not None
        low, high = (low, middle) if enough else (middle, high)
        if work.exhausted():
            return None
    for share in LONGER:
        end = min(high + share * (high - begin), horizon)
        schedule = within(problem, end)
        if schedule is not None or end == horizon or work.exhausted():
            return schedule
    return None


def within(problem: Problem, horizon: float) -> Schedule | None:
    """A schedule of one channel after another within ``horizon`` s that leaves nothing; None where
    none is found.
    """
    influence = small_angles(problem.spacecraft, problem.equations)
    slot = 2.0 * math.pi / problem.spacecraft.fastest / SLOTS
    late = 0.0
    for _ in range(LINES):
        pieces = None if work.exhausted() else _pieces(problem, influence, horizon - late)
        if pieces is None:
            return None
        schedule = _exact(problem, pieces)
        try:
            flown = problem.flown(schedule)
        except Infeasible:
            return None
        late += 2.0 * max(schedule.end - horizon, 0.0)
        in_time = problem.left(flown) <= LEFT and schedule.end <= horizon
        if in_time and keeps_limits(problem.spacecraft, schedule.pulses):
            return schedule
        burns = _burns(problem, *pieces[:2])
        influence = along(problem.flown(burns), problem.equations, slot)
    return None


def _pieces(problem: Problem, influence: Influence, horizon: float) -> Pieces | None:
    """The cheapest firing of one channel after another in time order; None where none is worth one,
    to first order.
    """
    spacecraft, channels, limits = problem.spacecraft, problem.channels, problem.spacecraft.limits
    if limits.gap > 0.0 or limits.tick is not None or limits.max_pulses is not None:
        # burns may not follow each other without a gap, begin at any time and be of any number
        return None
    begin = limits.earliest
    turns = (horizon - begin) * spacecraft.fastest / (2.0 * math.pi)
    count = min(max(math.ceil(turns * SLOTS), 2 * SLOTS // 3), MOST_SLOTS)
    edges = np.linspace(begin, horizon, count + 1)
    free = np.flatnonzero(~Windows(spacecraft).blocked(edges[:-1], edges[1:]))
    width = float(edges[1] - edges[0])
    if not len(free):
        return None
    work.spend(PROGRAM)
    centres = 0.5 * (edges[1:] + edges[:-1])[free]
    lost = influence.widths(np.array([width]))[0]
    torques = np.array([channel.torque for channel in channels])
    # What a whole slot of each channel adds to each equation, over all there is to do; columns
    # channel by channel.
    size = float(np.linalg.norm(influence.goal)) or 1.0
    whole = np.einsum("nek,ck->ecn", influence.rows(centres) * lost[:, None], torques) * (
        width / size
    )
    equations, slots = len(influence.goal), len(free)
    program = GrowingProgram(influence.goal / size, np.ones(slots + 1), np.ones(equations))
    slack = np.hstack([np.eye(equations), -np.eye(equations)])
    program.add(np.full(2 * equations, 1e4 * slots), slack, np.full(2 * equations, np.inf))
    # For free in all directions of the shift; the shares add up to no more than one.
    ring = np.zeros((equations, AROUND.shape[1] if problem.off > 0.0 else 0))
    if problem.off > 0.0:
        ring[2:4] = problem.off / size * AROUND
    free_shares = Shares(np.full(ring.shape[1], slots), np.ones(ring.shape[1]))
    program.add(np.zeros(ring.shape[1]), ring, np.ones(ring.shape[1]), free_shares)
    every = np.ones(slots * len(channels))
    cost = np.repeat(problem.costs / float(problem.costs.max()), slots)
    program.add(
        cost,
        whole.reshape(equations, -1),
        every,
        Shares(np.tile(np.arange(slots), len(channels)), every),
    )
    optimum = program.optimum()
    if optimum is None or float(optimum.x[: 2 * equations].sum()) > UNMET:
        return None
    fired = np.zeros((len(channels), count + 1))  # and one slot more, in which nothing fires
    around, shares = np.split(optimum.x[2 * equations :], [ring.shape[1]])
    fired[:, free] = shares.reshape(len(channels), slots) * width
    return _in_order(
        fired, width, -size * (ring @ around)[2:4] if problem.off > 0.0 else np.zeros(2)
    )


def _in_order(times: Vector, width: float, off: Vector) -> Pieces | None:
    """Burns from ``times`` (channels, slots) s: in each slot first what fired before, last what
    fires on after it.
    """
    pieces = list[tuple[int, float]]()
    for mine, following in itertools.pairwise(times.T):
        before = pieces[-1][0] if pieces else -1
        firing = np.flatnonzero(mine > SHORTEST * width).tolist()
        firing.sort(key=lambda number: (number != before, following[number] > 0.0))
        pieces += [(number, float(mine[number])) for number in firing]
        idle = width - float(sum(mine[number] for number in firing))
        if idle > SHORTEST * width:
            pieces.append((-1, idle))
    groups = itertools.groupby(pieces, key=lambda piece: piece[0])
    joined = [(number, sum(time for _, time in group)) for number, group in groups]
    if joined[-1][0] < 0:
        joined.pop()
    which, lengths = (np.array([part[at] for part in joined]) for at in (0, 1))
    return (which, lengths, off) if joined else None


def _burns(problem: Problem, which: NDArray[np.int_], times: Vector) -> Schedule:
    """The pieces, one after the other."""
    starts = problem.spacecraft.limits.earliest + np.concatenate([[0.0], np.cumsum(times)[:-1]])
    pieces = zip(which.tolist(), starts.tolist(), times.tolist(), strict=True)
    on = [
        (problem.channels[number], start, time)
        for number, start, time in pieces
        if number >= 0 and time > 0.0
    ]
    return Schedule(
        tuple(channel_pulse(channel, start + 0.5 * time, time) for channel, start, time in on)
    )


def _exact(problem: Problem, pieces: Pieces) -> Schedule:
    """The schedule whose flown motion leaves nothing but ``off``, by Newton's method for the
    lengths of its pieces.
    """
    which, times, off = pieces
    aside = np.array([0.0, 0.0, *off, 0.0])[problem.equations.chosen]
    spacecraft = problem.spacecraft
    size = float(np.linalg.norm(spacecraft.momentum))
    scale = np.full(len(times), float(times.max(initial=1e-9)))
    most = np.full(len(times), spacecraft.horizon - spacecraft.limits.earliest)
    task = Task(spacecraft, problem.equations, problem.channels, problem.costs)
    firing = which >= 0

    def left(rows: Vector) -> Vector:
        """Misses of many times (k, n) s, (k, equations), over |H|."""
        starts = spacecraft.limits.earliest + np.cumsum(rows, axis=1) - rows
        settings = np.hstack([starts[:, firing], rows[:, firing]])
        return task.misses(np.tile(which[firing], (len(rows), 1)), settings, 0) - aside / size

    def slopes(times: Vector, value: Vector) -> Vector:
        return (left(times + 1e-6 * np.diag(scale)) - value).T / 1e-6

    free = np.column_stack([times, scale, np.zeros(len(times)), most])
    times = solve(lambda times: left(times[None])[0], free, work.exhausted, slopes)
    return _burns(problem, which, times)
