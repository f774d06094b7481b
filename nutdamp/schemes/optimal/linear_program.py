"""Least-cost firing of body-fixed channels: a linear program over channels and firing times, by
column generation.

Unknown are on-times. Time is cut into slots in which a channel can be on for at most the slot, so
that long burns and what their width loses come out right; a channel that gives all that is needed
within one slot fires impulses at any moment. Columns enter the program by their price, since a
handful of equations needs few of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import highspy
import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.schemes.optimal.refinement import AROUND, Influence
from nutdamp.spacecraft.constraints import Windows
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft, Vector

# cost of what no column supplies, over the dearest channel's: used only where there is no solution
SLACK_COST = 1e3
LOOK = 0.05  # peaks of the price this far below zero are looked at more closely within their slots


class ProgramColumns(NamedTuple):
    """Unknowns of the program, n each: index of the channel, moment in s, width in s (0: an
    impulse).

    Columns of the same ``burn``, a number from 0 on, are together on for no longer than their
    channel may be.
    """

    channel: NDArray[np.int_]
    t: Vector
    width: Vector
    burn: NDArray[np.int_]

    def of(self, which: NDArray[np.bool_] | NDArray[np.int_]) -> ProgramColumns:
        """Some of the columns."""
        return ProgramColumns._make(part[which] for part in self)

    def joined(self, other: ProgramColumns) -> ProgramColumns:
        """These columns and others."""
        return ProgramColumns._make(
            np.concatenate(parts) for parts in zip(self, other, strict=True)
        )


def alone(channel: NDArray[np.int_], t: Vector, width: Vector) -> ProgramColumns:
    """Columns that belong to no burn."""
    return ProgramColumns(channel, t, width, np.full(len(t), -1))


@dataclass(frozen=True, slots=True)
class Burn:
    """Neighbouring slots of one channel taken together: centre and on-time in s."""

    channel: Channel
    t: float
    on_time: float

    @property
    def impulse(self) -> float:
        """Torque times on-time, N m s."""
        return self.on_time * float(np.linalg.norm(self.channel.torque))


def above(worth: Vector, least: float, most: int) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Channels and slots (n,) whose ``worth`` (channels, slots) is more than the ``least``; the
    ``most`` best ones.
    """
    channel, slot = np.nonzero(worth > least)
    if len(slot) > most:
        best = np.argpartition(worth[channel, slot], -most)[-most:]
        channel, slot = channel[best], slot[best]
    return channel, slot


def peaks(worth: Vector, least: float) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Channels and moments (n,) whose ``worth`` (channels, moments) is more than the ``least``, and
    highest nearby.
    """
    padded = np.pad(worth, ((0, 0), (1, 1)), constant_values=-np.inf)
    channel, moment = np.nonzero(
        (worth >= padded[:, :-2]) & (worth >= padded[:, 2:]) & (worth > least)
    )
    return channel, moment


def burns(
    channels: Sequence[Channel], columns: ProgramColumns, on_times: Vector, apart: float
) -> tuple[Burn, ...]:
    """Columns of a channel that are less than ``apart`` s from one another as one burn about their
    common centre.
    """
    result: list[Burn] = []
    order = np.lexsort((columns.t, columns.channel))
    channel, t, _, burn = columns.of(order)
    cut = (np.diff(t) > apart) | (np.diff(burn) != 0) | (np.diff(channel) != 0)
    for group in np.split(order, np.flatnonzero(cut) + 1) if len(order) else ():
        total = float(on_times[group].sum())
        centre = float(on_times[group] @ columns.t[group]) / total
        result.append(Burn(channels[columns.channel[group[0]]], centre, total))
    return tuple(sorted(result, key=lambda burn: burn.t))


# Slots in the faster of the turns at ω3 and at aω3, and of all channels: of a longer horizon no
# more is seen.
SLOTS, MOST_SLOTS = 64, 600_000

SOLVED, SLOT, COLUMN, LIMITED = (
    3.0,
    3e-4,
    1.5e-3,
    0.06,
)  # units of `work`: solution, slot, column, limited burn

# Relative reduced cost below which a column cannot lower the cost any more, and that for the best
# moment of a strong channel, which may lie close beside one taken.
PRICE, PEAK = 1e-7, 1e-6

# Columns taken in per round, the best priced first, and over one the share of all worth taking in
# that is taken in while they do not supply what is needed.
BEST, MANY = 250, 4

FIRST, ROUNDS = 400, 60  # columns to begin with, and rounds in which more are taken in

# Coefficient below which an equation is not scaled up; share of what is needed below which an
# on-time is none.
TINIEST, SOME = 1e-6, 1e-12


@dataclass(frozen=True, slots=True)
class Solution:
    """Burns of least ``cost`` in time order; ``unmet``: share of all there is to do that columns
    cannot supply.

    Where the program could not be solved both are infinite. ``off`` (2,) N m s is how far from the
    target H is to end, where it may. ``prices`` (equations,) are what one more N m s of each goal
    costs, zero where that is not known.
    """

    burns: tuple[Burn, ...]
    cost: float
    unmet: float
    off: Vector
    prices: Vector


class Program:
    """The linear program of one spacecraft.

    ``costs`` (channels,) per second of on-time. ``influence`` holds the equations, which may be
    exchanged for others between solutions. ``off`` N m s is how far from its target H may end.
    ``haste``: by how much (relatively) the end of the horizon seems dearer than its beginning,
    among equals the early moments are taken. ``forbidden`` (channels, slots) may not be used.
    """

    def __init__(
        self,
        spacecraft: Spacecraft,
        channels: tuple[Channel, ...],
        costs: Vector,
        influence: Influence,
        off: float = 0.0,
    ) -> None:
        self.spacecraft = spacecraft
        self.channels = channels
        self.costs = costs
        self.off = off
        self.haste = 0.0
        begin = spacecraft.limits.earliest
        slot = 2 * math.pi / spacecraft.fastest / SLOTS
        self.end = min(spacecraft.horizon, begin + MOST_SLOTS // len(channels) * slot)
        edges = np.linspace(begin, self.end, max(math.ceil((self.end - begin) / slot), 1) + 1)
        self.width = float(edges[1] - edges[0])
        self.centres: Vector = 0.5 * (edges[1:] + edges[:-1])
        self.forbidden: NDArray[np.bool_] = np.tile(
            Windows(spacecraft).blocked(edges[:-1], edges[1:]), (len(channels), 1)
        )
        self._pool: ProgramColumns | None = None
        self._torques = np.array([channel.torque for channel in channels])
        self.aim(influence)

    def aim(self, influence: Influence) -> None:
        """Take other equations."""
        self.influence = influence
        self._scale = float(np.linalg.norm(influence.goal))
        strength = np.linalg.norm(self._torques, axis=1)
        self._unit = self._scale / strength  # s of firing that are worth all there is to do
        self._direction = self._torques / strength[:, None]
        # Channels (channels,) that give all that is needed within one slot, and so act at a moment.
        self.strong: NDArray[np.bool_] = self._unit < self.width
        self._price = self.costs * self._unit
        self._dearest = float(self._price.max())
        # Columns (equations, n) for free in all directions of the shift, where H may end off its
        # target.
        self._ring = np.zeros((len(influence.goal), AROUND.shape[1] if self.off > 0.0 else 0))
        if self.off > 0.0:
            self._ring[2:4] = AROUND
        self._grid: Vector | None = None

    def solve(self, columns: ProgramColumns | None = None, *, enough: bool = False) -> Solution:
        """Least cost over the ``columns`` given, or over all that is not forbidden, by column
        generation.

        ``enough``: only to see whether there is a solution, at whatever cost.
        """
        work.spend(
            SOLVED + (SLOT * self.forbidden.size if columns is None else COLUMN * len(columns.t))
        )
        count = len(self.influence.goal)
        generate = columns is None
        if self._scale == 0.0:
            return Solution((), 0.0, 0.0, np.zeros(2), np.zeros(count))
        chosen = self._first() if columns is None else columns
        master = self._master(chosen, growing=generate)
        optimum = master.optimum()
        unsolved = Solution((), math.inf, math.inf, np.zeros(2), np.zeros(count))
        if optimum is None:
            return unsolved
        for _ in range(ROUNDS if generate else 0):
            unmet = float(optimum.x[: 2 * count].sum())
            if work.exhausted():
                if unmet > SOME:  # columns that would supply it may not be among them yet
                    return unsolved
                break
            if enough and unmet <= SOME:
                break
            new = self._priced(optimum.prices, chosen, unmet)
            if not len(new.t):
                break
            self._add(master, new)
            better = master.optimum()
            if better is None:  # what would lower the cost is lost on the solver
                break
            chosen = chosen.joined(new)
            optimum = better
        if generate:
            self._pool = chosen
        free, amounts = np.split(optimum.x, [len(optimum.x) - len(chosen.t)])
        off = (
            -(self._ring @ free[2 * count :])[2:4] * self._scale if self.off > 0.0 else np.zeros(2)
        )
        used = amounts > SOME
        on_times = amounts[used] * self._unit[chosen.channel[used]]
        return Solution(
            burns(self.channels, chosen.of(used), on_times, 1.01 * self.width),
            float(self.costs[chosen.channel[used]] @ on_times),
            float(free[: 2 * count].sum()),
            np.asarray(off),
            optimum.prices * self._dearest / self._scale,
        )

    def _master(self, columns: ProgramColumns, *, growing: bool) -> GrowingProgram:
        """The program of these columns, in units of all there is to do,
        after slacks and the ring.
        """
        count = len(self.influence.goal)
        ring = self._ring
        if (
            growing
        ):  # the most that one unit of any channel does in each of the equations, or a little more
            reach = (np.abs(self._slot_rows()).max(axis=2) @ np.abs(self._direction).T).max(axis=1)
        else:
            reach = np.abs(self._coefficients(columns)).max(axis=1, initial=0.0)
        # Where H may end off its target, the shares of the directions add up to no more than `off`.
        shares = min(ring.shape[1], 1)
        limited = int(self._longest(columns).limit.max(initial=shares - 1)) + 1 - shares
        work.spend(LIMITED * limited)
        limits = np.concatenate([np.full(shares, self.off / self._scale), np.ones(limited)])
        master = GrowingProgram(
            self.influence.goal / self._scale, limits, np.maximum(reach, TINIEST)
        )
        rows = np.zeros((count + shares, 2 * count + ring.shape[1]))
        rows[:count] = np.hstack([np.eye(count), -np.eye(count), ring])
        rows[count:, 2 * count :] = 1.0
        cost = np.repeat([SLACK_COST, 0.0], [2 * count, ring.shape[1]])
        master.add(cost, rows, np.full(len(cost), np.inf))
        self._add(master, columns)
        return master

    def _add(self, master: GrowingProgram, columns: ProgramColumns) -> None:
        """Let the program have these columns."""
        most = np.where(columns.width > 0.0, columns.width / self._unit[columns.channel], np.inf)
        costs, shares = self._costs(columns.channel, columns.t), self._longest(columns)
        master.add(costs, self._coefficients(columns), most, shares)

    def _longest(self, columns: ProgramColumns) -> Shares:
        """Shares in the limits, one per burn, that hold its on-time, over the longest that its
        channel may be on.
        """
        longest = np.array([channel.max_on_time for channel in self.channels])[columns.channel]
        bounded = (columns.burn >= 0) & np.isfinite(longest)
        limit = np.full(len(longest), -1)
        # After that of the ring.
        limit[bounded] = np.unique(columns.burn[bounded], return_inverse=True)[1] + (self.off > 0.0)
        return Shares(limit, self._unit[columns.channel] / longest)

    def _costs(self, channel: NDArray[np.int_], times: Vector) -> Vector:
        """Cost of one unit of each ``channel`` at these ``times``, over the dearest channel's."""
        dearness = 1.0 + self.haste * times / float(self.centres[-1])
        return np.asarray(self._price[channel] / self._dearest * dearness)

    def _coefficients(self, columns: ProgramColumns) -> Vector:
        """Coefficients of one unit of each column, (equations, n)."""
        rows = self.influence.rows(columns.t) * self.influence.widths(columns.width)[:, :, None]
        return np.asarray(np.einsum("nek,nk->en", rows, self._direction[columns.channel]))

    def _slot_rows(self) -> Vector:
        """Coefficients of one N m s in each slot, (equations, 3, slots)."""
        if self._grid is None:
            lost = self.influence.widths(np.array([self.width]))[0]
            self._grid = np.ascontiguousarray(
                (self.influence.rows(self.centres) * lost[:, None]).transpose(1, 2, 0)
            )
        return self._grid

    def _gains(self, weights: Vector) -> Vector:
        """Worth of one unit of each channel in each slot by prices ``weights``, less its cost,
        (channels, slots).
        """
        worth = weights @ self._slot_rows().reshape(len(weights), -1)
        gains = np.asarray(self._direction @ worth.reshape(3, -1))
        gains[self.forbidden] = -np.inf
        every = np.arange(len(self.channels))[:, None]
        # Large: in place, and with one time where none is dearer.
        gains -= self._costs(every, self.centres if self.haste else self.centres[:1])
        return gains

    def reachable(self) -> bool | None:
        """True where all slots together can supply the goal, see `supplies`; None where that is not
        known.
        """
        if (
            self._scale == 0.0 or self.strong.any()
        ):  # strong ones act at moments, of which slots are only samples
            return None
        work.spend(SOLVED + SLOT * self.forbidden.size)
        most = (
            np.einsum("ekn,ck->ecn", self._slot_rows(), self._direction)
            * (self.width / self._unit)[None, :, None]
        )
        return supplies(
            most[:, ~self.forbidden], self.influence.goal / self._scale, self.off / self._scale
        )

    def _first(self) -> ProgramColumns:
        """Columns to begin with: those of the last time, or along the shortest way to the goal,
        spread over time.
        """
        if self._pool is not None:
            return self._pool.of(~self.forbidden[self._pool.channel, self._slot(self._pool.t)])
        worth = (
            self._gains(self.influence.goal / self._scale) * (self._dearest / self._price)[:, None]
        )
        channel, slot = np.nonzero(worth > 0.7 * worth.max(initial=0.0) - 0.3)
        chosen = np.linspace(0, len(slot) - 1, min(FIRST, len(slot))).astype(int)
        return self._slots(channel[chosen], slot[chosen])

    def _slots(self, channel: NDArray[np.int_], slot: NDArray[np.int_]) -> ProgramColumns:
        return alone(channel, self.centres[slot], np.where(self.strong[channel], 0.0, self.width))

    def _priced(self, duals: Vector, taken: ProgramColumns, unmet: float) -> ProgramColumns:
        """Columns worth more than they cost: whole slots of a weak channel, the best moments of a
        strong one.
        """
        gains = self._gains(duals)
        weak = np.where(self.strong[:, None], -np.inf, gains)
        weak[taken.channel, self._slot(taken.t)] = -np.inf
        # More of them at a time as long as something is unmet: then most of what there is may be
        # needed.
        most = max(BEST, int(np.count_nonzero(weak > PRICE)) // MANY if unmet > SOME else 0)
        columns = self._slots(*above(weak, PRICE, most))
        return columns.joined(self._peaks(gains, duals)) if self.strong.any() else columns

    def _peaks(self, gains: Vector, duals: Vector) -> ProgramColumns:
        """Moments within slots at which a strong channel is worth most, in slots in which it costs
        little more.
        """
        channel, slot = peaks(np.where(self.strong[:, None], gains, -np.inf), -LOOK)
        order = np.argsort(gains[channel, slot])[::-1][: 2 * BEST]
        channel, centre = channel[order], self.centres[slot[order]]
        within = (
            0.25 * self.width * np.arange(-2, 3)
        )  # both ends of the slot among them: there may be none beside it
        times = centre[:, None] + within
        fives = alone(np.repeat(channel, 5), times.ravel(), np.zeros(times.size))
        worth = (duals @ self._coefficients(fives) - self._costs(fives.channel, fives.t)).reshape(
            -1, 5
        )
        # By the parabola through the best of the five and those beside it; at an end of them, that
        # end.
        best = np.argmax(worth, axis=1)
        every = np.arange(len(best))
        inner = np.clip(best, 1, 3)
        low, top, high = (worth[every, inner + shift] for shift in (-1, 0, 1))
        bend = low - 2.0 * top + high
        aside = np.divide(0.5 * (low - high), bend, out=np.zeros_like(bend), where=bend < 0.0)
        aside = np.where(best == inner, aside, best - inner)
        most = np.where(best == inner, top - 0.25 * (low - high) * aside, worth[every, best])
        t = times[every, inner] + aside * (times[:, 1] - times[:, 0])
        good = most > PEAK
        return alone(channel[good], t[good], np.zeros(int(good.sum())))

    def forbid(self, channel: Channel | None, start: float, end: float) -> None:
        """Forbid the slots of a channel (of all channels)
        that lie within ``start`` to ``end`` s.
        """
        inside = (self.centres > start) & (self.centres < end)
        rows = slice(None) if channel is None else self.channels.index(channel)
        self.forbidden[rows, inside] = True

    def about(self, burns: Sequence[Burn], zoom: float = 1.0) -> ProgramColumns:
        """Columns from which ``burns`` may be made anew: their slots, and an eighth of the faster
        turn on each side.

        Strong channels fire within that divided by ``zoom``.
        """
        owner = np.full(self.forbidden.shape, -1)
        away = np.full(self.forbidden.shape, np.inf)
        impulses = alone(np.zeros(0, dtype=int), np.zeros(0), np.zeros(0))
        half = 0.5 * self.width
        for number, burn in enumerate(burns):
            index = self.channels.index(burn.channel)
            reach = 0.5 * burn.on_time + SLOTS // 8 * self.width
            if self.strong[index]:
                times = burn.t + np.linspace(-1.0, 1.0, 17) * reach / zoom
                times = np.clip(times, self.centres[0] - half, self.centres[-1] + half)
                times = times[
                    (np.diff(times, prepend=-np.inf) > 0.0)
                    & ~self.forbidden[index, self._slot(times)]
                ]
                impulses = impulses.joined(
                    ProgramColumns(*np.broadcast_arrays(index, times, 0.0, number))
                )
            else:
                first, last = self._slot(np.array([burn.t - reach, burn.t + reach]))
                near = np.arange(first, last + 1)
                distance = np.abs(self.centres[near] - burn.t)
                nearer = (distance < reach) & (distance < away[index, near])
                owner[index, near[nearer]], away[index, near[nearer]] = number, distance[nearer]
        kept = np.nonzero((owner >= 0) & ~self.forbidden)
        return self._slots(*kept)._replace(burn=owner[kept]).joined(impulses)

    def _slot(self, times: Vector) -> NDArray[np.int_]:
        """The slots in which ``times`` (n,) s lie."""
        slot = np.floor((times - self.centres[0]) / self.width + 0.5).astype(int)
        return np.asarray(np.clip(slot, 0, len(self.centres) - 1))


# Unknowns above which interior points come first: a step of the dual simplex then passes thousands
# of their bounds, at a time that grows with the square of their number, where interior points take
# 0.4 s instead of 10 s for 75,000. Nothing is presolved: that compares each unknown with all
# others, 13 s for as many in two equations (nutation of 89.9°, 64 times the horizon).
LARGE = 10_000

MOST_STEPS = 100_000  # steps of the simplex or of the interior points, in one way of solving
SMALL, NONZERO = (
    10_000,
    1e-2,
)  # coefficients that count for nothing here, and units of `work` of each above them


class Optimum(NamedTuple):
    """Unknowns ``x`` (n,), ``prices`` (m,) of one more of each right-hand side, ``shadows`` of the
    limits, ≤ 0.
    """

    x: Vector
    prices: Vector
    shadows: Vector


class Shares(NamedTuple):
    """The ``limit`` (n,), a number from 0 on or -1 for none, in which each unknown has this
    ``share`` (n,).
    """

    limit: NDArray[np.int_]
    share: Vector


class GrowingProgram:
    """Least cost @ x with equations and upper limits, 0 ≤ x ≤ most; each column added counts from
    the next solution on.

    Begins without columns: ``right`` (m,) of the equations, ``limits`` (k,) of the rows that come
    below them. Equations are divided by their ``level`` (m,), which should be about the largest of
    their coefficients.
    """

    charge = NONZERO  # units of work for each nonzero beyond `SMALL`

    def __init__(self, right: Vector, limits: Vector, level: Vector) -> None:
        self._level = level
        self._highs = _SilentSolver()
        least = np.concatenate([right / level, np.full(len(limits), -highspy.kHighsInf)])
        for lower, upper in zip(
            least.tolist(), [*(right / level).tolist(), *limits.tolist()], strict=True
        ):
            self._highs.addRow(lower, upper, 0, np.zeros(0, dtype=np.int32), np.zeros(0))

    def add(self, cost: Vector, rows: Vector, most: Vector, shares: Shares | None = None) -> None:
        """More unknowns: ``cost`` (n,), coefficients ``rows`` (m + k, n) and the ``most`` (n,) that
        they may be.

        ``rows`` may end before the last limits; ``shares`` are further coefficients, in one limit
        each.
        """
        rows = rows / np.concatenate([self._level, np.ones(len(rows) - len(self._level))])[:, None]
        column, row = np.nonzero(rows.T)
        values = rows.T[column, row]
        if shares is not None and (limited := np.flatnonzero(shares.limit >= 0)).size:
            column = np.concatenate([column, limited])
            order = np.argsort(column, kind="stable")
            column = column[order]
            row = np.concatenate([row, len(self._level) + shares.limit[limited]])[order]
            values = np.concatenate([values, shares.share[limited]])[order]
        starts = np.searchsorted(column, np.arange(len(cost))).astype(np.int32)
        zeros = np.zeros(len(cost))
        self._highs.addCols(
            len(cost), cost, zeros, most, len(values), starts, row.astype(np.int32), values
        )

    def limit(self, row: Vector, most: float) -> None:
        """One more limit, of the unknowns (n,) that there are: row @ x ≤ most."""
        used = np.flatnonzero(row)
        self._highs.addRow(-highspy.kHighsInf, most, len(used), used.astype(np.int32), row[used])

    def optimum(self) -> Optimum | None:
        """The cheapest solution, from the last one's basis if there is one; None where there is
        none.

        Where the simplex loses its way, interior points, which do not know the trouble, mostly find
        the solution, and where they fail the simplex does.
        """
        first, second = ("simplex", "ipm")[:: 1 if self._highs.getNumCol() <= LARGE else -1]
        optimum = self._solved(first)
        if optimum is None:
            self._highs.clearSolver()
            optimum = self._solved(second)
        return optimum

    def _solved(self, method: str) -> Optimum | None:
        highs = self._highs
        highs.setOptionValue("solver", method)
        work.spend(self.charge * max(highs.getNumNz() - SMALL, 0))
        if highs.run() == highspy.HighsStatus.kError:
            # Threads are set once in a process, by whoever solves first; zero takes what there is.
            highs.setOptionValue("threads", 0)
            highs.run()
        if highs.getModelStatus() != highspy.HighsModelStatus.kOptimal:
            return None
        solution = highs.getSolution()
        prices, shadows = np.split(np.array(solution.row_dual), [len(self._level)])
        return Optimum(np.array(solution.col_value), prices / self._level, shadows)


class _SilentSolver(highspy.Highs):
    """A solver that prints nothing, on one thread, with a bound on its steps."""

    def __init__(self) -> None:
        highspy.Highs.__init__(self)
        self.setOptionValue("output_flag", False)
        self.setOptionValue("threads", 1)
        self.setOptionValue("presolve", "off")
        self.setOptionValue("parallel", "off")
        for way in ("simplex", "ipm"):
            self.setOptionValue(f"{way}_iteration_limit", MOST_STEPS)
        for side in ("primal", "dual"):
            self.setOptionValue(f"{side}_feasibility_tolerance", 1e-9)

    def enableCallbacks(self) -> None:
        """No banner: in highspy 1.16 the constructor calls this, which prints one to stdout, where
        CSV and JSON go.
        """
        self.setOptionValue("output_flag", False)
        highspy.Highs.enableCallbacks(self)


CORNERS, FLAT = (
    3000,
    1e-12,
)  # looked at, at most, and share of the weight of one below which it is none

# Distance from the goal, over all there is to do, that is none; share of it that proves it, despite
# rounding.
MET, BEYOND = 3e-8, 1e-6


def supplies(most: Vector, goal: Vector, off: float = 0.0) -> bool | None:
    """True where some parts between 0 and 1 of the columns ``most`` (m, n) add up to ``goal`` (m,).

    ``off``: by how much its rows 2 and 3 may be missed, in norm. None where that is not known after
    `CORNERS`.
    """
    corners = -goal[None, :]
    weights = np.ones(1)
    for _ in range(CORNERS):
        nearest = weights @ corners
        distance = float(np.linalg.norm(nearest))
        if distance <= MET:
            return True
        direction = nearest / distance
        # The point of what can be supplied, less the goal, that lies least far along it.
        new = most @ (direction @ most < 0.0) - goal
        if size := float(np.linalg.norm(direction[2:4])):
            new[2:4] -= off / size * direction[2:4]
        ahead = float(nearest @ new) / distance
        if ahead > BEYOND * distance and ahead > MET:
            return False
        if ahead >= distance * (1.0 - FLAT):
            return None
        corners, weights = _nearest(np.vstack([corners, new]), np.append(weights, 0.0))
    return None


def _nearest(corners: Vector, weights: Vector) -> tuple[Vector, Vector]:
    """Corners (k, m) and weights (k,) of the point nearest to zero in their hull, those without
    weight left out.
    """
    while True:
        system = np.pad(corners @ corners.T, ((1, 0), (1, 0)), constant_values=1.0)
        system[0, 0] = 0.0
        weights_of = np.linalg.lstsq(system, np.eye(len(system))[0], rcond=None)[0][1:]
        if np.all(weights_of > FLAT):
            return corners, weights_of / weights_of.sum()
        falling = weights_of <= FLAT
        steps = weights[falling] / np.maximum(weights[falling] - weights_of[falling], 1e-300)
        share = min(float(steps.min()), 1.0)
        weights = (1.0 - share) * weights + share * weights_of
        kept = weights > FLAT
        kept[np.flatnonzero(falling)[int(np.argmin(steps))]] = False
        corners = corners[kept]
        weights = weights[kept] / weights[kept].sum()
