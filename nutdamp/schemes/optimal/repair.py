"""Burns of the linear program that can be fired: few of them, within on-times, gap and number, as pulses."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from nutdamp import work
from nutdamp.limits import Windows
from nutdamp.schedule import TOUCHING, Schedule, channel_pulse
from nutdamp.schemes.optimal.columns import Burn
from nutdamp.schemes.optimal.linear_program import Program, Solution
from nutdamp.spacecraft import Channel, Spacecraft

UNMET = 1e-7
"""Share of what there is to do that columns may fail to supply: the program's own tolerance."""

REPAIRS = 60
"""Rounds in which burns that break a limit are moved elsewhere."""

THRIFT = 0.004
"""Share of the least cost that is given away for fewer pulses."""

GAIN = 0.0005
"""The same where there are few, and share that is not worth another search."""


class Unrepairable(Exception):
    """No burns were found that keep on-times, gap and max_pulses all at once."""


def thinned(program: Program, solution: Solution, cost: float, *, fewest: bool) -> Solution:
    """As few burns as hardly cost more than ``cost``, or whatever they cost: the longest are kept and may grow.

    The optimum itself has a burn at every alignment, for the shorter a burn the less it loses to its width.
    """
    few = len(solution.burns) <= 2 * len(program.influence.goal)
    most = max(cost, solution.cost) * (1.0 + (GAIN if few else THRIFT))
    order = sorted(solution.burns, key=lambda burn: -burn.impulse)
    best, low, high = solution, 1, len(order)
    allowed = program.spacecraft.limits.max_pulses
    if fewest or (allowed is not None and high > allowed):
        most = math.inf
    while low < high:
        middle = (low + high) // 2
        found = program.solve(program.about(order[:middle]))
        if found.unmet <= UNMET and found.cost <= most:
            best, high = found, middle
        else:
            low = middle + 1
    return best


def repaired(program: Program, solution: Solution) -> Solution:
    """The solution, once none of its burns breaks a limit: where one does, its slots are forbidden.

    Where that leaves too little, burns longer than their channel may be on become several side by side.
    Raises Unrepairable.
    """
    allowed = program.forbidden.copy()
    try:
        return _repaired(program, solution)
    except Unrepairable:
        program.forbidden = allowed
        if not _divide(program, solution.burns):
            raise
    return _repaired(program, program.solve())


def _repaired(program: Program, solution: Solution) -> Solution:
    """The solution with what breaks a limit moved to other slots. Raises Unrepairable."""
    if solution.unmet > UNMET:
        raise Unrepairable
    for _ in range(REPAIRS):
        if work.exhausted():
            raise Unrepairable
        broken = next(broken_by(program, solution.burns), None)
        if broken is None:
            return solution
        program.forbid(*broken)
        near = program.solve(program.about(solution.burns))
        solution = near if near.unmet <= UNMET else program.solve()
        if solution.unmet > UNMET:
            raise Unrepairable
    raise Unrepairable


def _divide(program: Program, burns: tuple[Burn, ...]) -> bool:
    """Forbid slots at regular distances about too long burns, so that no burn can be too long; whether there are any.

    Between two pulses the thruster is off for the gap, and no shorter than its shortest pulse: valves take their time.
    """
    every = np.arange(len(program.centres))
    divided = False
    for row, channel in enumerate(program.channels):
        long = sorted((one for one in burns if one.channel is channel and _too_long(one)), key=lambda one: one.t)
        window = math.floor(channel.max_on_time / program.width + TOUCHING) if long else 0
        if window == 0:
            continue
        divided = True
        pause = max(math.ceil(max(program.spacecraft.limits.gap, channel.min_on_time) / program.width - TOUCHING), 1)
        middles = np.searchsorted(program.centres, [one.t for one in long])
        nearest = np.searchsorted(0.5 * (middles[1:] + middles[:-1]), every)
        pieces = np.array([math.ceil(one.on_time / (window * program.width)) for one in long])
        # The first of the pieces begins so that all of them are centred on the burn.
        first = middles - (pieces * (window + pause) - pause) // 2
        within = (every - first[nearest]) % (window + pause)
        program.forbidden[row, within >= window] = True
        ends = np.flatnonzero(np.diff(nearest))
        for back in range(pause):  # windows of neighbouring patterns do not join
            program.forbidden[row, ends - back] = True
    return divided


def _too_long(burn: Burn) -> bool:
    return burn.on_time > burn.channel.max_on_time + TOUCHING


def broken_by(program: Program, burns: tuple[Burn, ...]) -> Iterator[tuple[Channel | None, float, float]]:
    """What to forbid: ends of too long burns, too short ones, the less of two too near, the least if too many."""
    limits, width = program.spacecraft.limits, program.width
    for burn in burns:
        longest, shortest = burn.channel.max_on_time, burn.channel.min_on_time
        if _too_long(burn):
            reach = burn.on_time + width
            yield burn.channel, burn.t - reach, burn.t - 0.5 * longest + 0.5 * width
            yield burn.channel, burn.t + 0.5 * longest - 0.5 * width, burn.t + reach
        if burn.on_time < 0.5 * shortest:
            yield burn.channel, burn.t - 2.0 * width, burn.t + 2.0 * width
    for one, two in itertools.pairwise(burns):
        if two.t - 0.5 * two.on_time < one.t + 0.5 * one.on_time + limits.gap - TOUCHING:
            less = min(one, two, key=lambda burn: burn.on_time)
            reach = 0.5 * less.on_time + width
            yield less.channel, less.t - reach, less.t + reach
    if limits.max_pulses is not None and len(burns) > limits.max_pulses:
        least = min(burns, key=lambda burn: burn.impulse)
        reach = 0.5 * least.on_time + 2.0 * width
        yield least.channel, least.t - reach, least.t + reach


def as_pulses(spacecraft: Spacecraft, burns: tuple[Burn, ...]) -> Schedule:
    """The burns as pulses, on-times within their bounds."""
    limits = spacecraft.limits
    windows = Windows(replace(spacecraft, limits=replace(limits, tick=None)))
    pulses = []
    for burn in burns:
        on_time = windows.on_time(burn.on_time, burn.channel.min_on_time, burn.channel.max_on_time)
        start = max(burn.t - 0.5 * on_time, limits.earliest)
        start = min(start, spacecraft.horizon - on_time)
        pulses.append(channel_pulse(burn.channel, start + 0.5 * on_time, on_time))
    return Schedule(tuple(pulses))
