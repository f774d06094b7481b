"""Interior-point descent of many pulse sequences at once, each to the cheapest schedule near it.

Channels and their order stay. Unknown are starts and on-times; the misses of the flight must
vanish, and on-times, gap, windows and horizon bound them linearly. A primal-dual interior-point
iteration with quasi-Newton curvature (Nocedal and Wright 2006, ch. 18.3 and 19) keeps all bounds at
every step, on arrays that carry the sequence first. Slopes are differences of flights, which cost
little where hundreds are flown at a time.
"""

from __future__ import annotations

import copy
import math
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.common.numerics import cos_sin
from nutdamp.flight.dynamics import make_dynamics
from nutdamp.physics import attitude
from nutdamp.physics.motion import BLOCK, Bodies, MotionStretch, advance
from nutdamp.schemes.optimal.refinement import (
    AROUND,
    EndEquations,
    Influence,
    small_angles,
    square_to_target,
)
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft, Vector

LEAST_ROOM = 1e-10  # share of the room to a bound that a step must leave

Indices = NDArray[np.int_]
Complex = NDArray[np.complex128]

DIFFERENCE = 1e-6  # step of the difference quotients, in scaled unknowns
FLIGHT, CASE = (
    0.05,
    0.0003,
)  # units of `work` of a stretch of a flight of many sequences, and of each of them
RADIAN, CASE_RADIAN = 0.8, 0.0025  # and where it is integrated, of each radian


class Sequences(NamedTuple):
    """Channels ``which`` (b, n), by number, of b sequences of n pulses.

    ``begins`` and ``ends`` (b, n) s: the window of each pulse; ``shortest`` and ``longest`` (b, n)
    s: its on-time.
    """

    which: Indices
    begins: Vector
    ends: Vector
    shortest: Vector
    longest: Vector

    def of(self, rows: Any) -> Sequences:
        """Some of the sequences."""
        return Sequences._make(part[rows] for part in self)


class Task:
    """Task of ``channels`` at ``costs`` per second, see `EndEquations`; H may end ``off`` N m s off
    target.

    Unknowns x (b, 2n) of a sequence are the starts of its pulses, then their on-times, s; two more
    where H may end off its target: how far, over ``off``.
    """

    def __init__(
        self,
        spacecraft: Spacecraft,
        equations: EndEquations,
        channels: tuple[Channel, ...],
        costs: Vector,
        off: float = 0.0,
    ) -> None:
        self.spacecraft, self.channels, self.costs = spacecraft, channels, costs
        self.chosen = equations.chosen
        self.torques = np.array([channel.torque for channel in channels])
        self.off = off if equations.shift else 0.0
        self.loose = 2 if self.off > 0.0 else 0
        self.momentum = float(np.linalg.norm(spacecraft.momentum))
        self.spin = spacecraft.spin if spacecraft.goal.spin is None else spacecraft.goal.spin
        size = max(
            spacecraft.least_impulse,
            spacecraft.turning_impulse,
            spacecraft.inertia.C * abs(self.spin - spacecraft.spin),
        )
        self.unit = size / np.linalg.norm(self.torques, axis=1)
        """s of each channel that are worth all there is to do"""
        self.least = float(np.min(costs * self.unit))
        self.shortest = np.array([channel.min_on_time for channel in channels])
        self.pace = min(1.0 / spacecraft.fastest, spacecraft.inertial_period)
        dynamics = make_dynamics(spacecraft)
        start = spacecraft.initial
        self._forced = dynamics.constant, dynamics.forcing  # external torques, see `Bodies`
        self._start = np.asarray(dynamics.moments, dtype=float), start.rates, start.quaternion
        self._free = dynamics.free and spacecraft.growth == 0.0
        self._pace = float(np.linalg.norm(start.rates))
        self._linear = None if spacecraft.inertia.symmetric else small_angles(spacecraft, equations)
        self._across = square_to_target(spacecraft)

    def misses(self, which: Indices, x: Vector, kicks: int) -> Vector:
        """Misses of the flights of ``x`` (b, …), (b, equations), over |H|.

        Pulses act as so many ``kicks`` spread over them, without disturbances and dissipation, with
        I1 ≠ I2 as at small angles; 0: the true motion.
        """
        misses = [np.zeros((0, len(self.chosen)))]
        for begin in range(0, len(x), BLOCK):
            some, part = which[begin : begin + BLOCK], x[begin : begin + BLOCK]
            work.spend(which.shape[1] * (max(kicks, 1) + 1) * (FLIGHT + CASE * len(part)))
            if kicks and self._linear is not None:
                misses.append(self._at_small_angles(self._linear, some, part))
                continue
            # The true motion of a body with dissipation, which follows the kicks, is dear.
            if not self._free and (not kicks or self.spacecraft.growth):
                n = which.shape[1]
                turned = float(np.max(part[:, n - 1] + part[:, 2 * n - 1])) * self._pace
                work.spend(turned * (RADIAN + CASE_RADIAN * len(part)))
            momentum, turn = (
                self._together(some, part, kicks)
                if kicks or self._free
                else self._in_turn(some, part)
            )
            inertial = attitude.rotate(turn.T, momentum.T)
            shift = inertial @ self._across.T
            shift[inertial @ self.spacecraft.target_axis < 0.0] += (
                self.momentum
            )  # the other way round is no solution
            if self.loose:
                shift = shift - self.off * part[:, -2:]
            spin = momentum[2] - self.spacecraft.inertia.axial(self.spin)
            ended = np.column_stack([momentum[:2].T, shift, spin])
            misses.append(ended[:, self.chosen] / self.momentum)
        return np.concatenate(misses)

    def _at_small_angles(self, linear: Influence, which: Indices, x: Vector) -> Vector:
        """Misses by the equations of small angles."""
        n = which.shape[1]
        on = x[:, n : 2 * n]
        rows = linear.rows((x[:, :n] + 0.5 * on).ravel()) * linear.widths(on.ravel())[:, :, None]
        impulses = self.torques[which] * on[:, :, None]
        left = np.einsum("bnek,bnk->be", rows.reshape(*which.shape, -1, 3), impulses) - linear.goal
        if self.loose:
            left[:, 2:4] -= self.off * x[:, -2:]
        return np.asarray(left / self.momentum)

    def _in_turn(self, which: Indices, x: Vector) -> tuple[Vector, Vector]:
        """H in body axes (3, b) and quaternions (4, b) at the end, stretch by stretch."""
        count, n = which.shape
        starts, on_times = x[:, :n], x[:, n : 2 * n]
        moments, rates, turn = (np.repeat(part[:, None], count, axis=1) for part in self._start)
        bodies = Bodies(moments, *self._forced)
        now = np.zeros(count)
        for pulse in range(n):
            torque = self.torques[which[:, pulse]].T
            advance(MotionStretch(bodies, now, rates, turn), starts[:, pulse] - now)
            advance(
                MotionStretch(bodies, starts[:, pulse], rates, turn, torque), on_times[:, pulse]
            )
            now = starts[:, pulse] + on_times[:, pulse]
        return bodies.momentum(rates), turn

    def _together(self, which: Indices, x: Vector, kicks: int) -> tuple[Vector, Vector]:
        """`_in_turn` of a symmetric body left alone; in real widths, or so many kicks in each."""
        # In the frame that turns with the nutation pulses add to H whatever it is, and between them
        # the body turns about H and its own axis: so the motion at all edges is known first, and
        # then all turns are. A quaternion is a pair of complex numbers, w + iz and x + iy.
        count, n = which.shape
        (A, _, C), rates, turn = self._start
        wheel = self.spacecraft.inertia.wheel
        parts = max(kicks, 1)
        starts, widths = x[:, :n], x[:, n : 2 * n]
        impulses = np.repeat(self.torques[which] * (widths / parts)[:, :, None], parts, axis=1)
        if kicks:
            shares = (np.arange(kicks) + 0.5) / kicks
            starts = (starts[:, :, None] + widths[:, :, None] * shares).reshape(count, n * kicks)
            widths = np.zeros_like(starts)
        coasts = np.diff(starts, axis=1, prepend=0.0)
        coasts[:, 1:] -= widths[:, :-1]
        axial = C * rates[2] + wheel + np.cumsum(impulses[:, :, 2], axis=1)
        before, pace = axial - impulses[:, :, 2], 1.0 / C - 1.0 / A
        turned = (pace * before - wheel / C) * coasts
        within = (pace * (before + 0.5 * impulses[:, :, 2]) - wheel / C) * widths
        phase = np.cumsum(turned + within, axis=1)
        begun = np.exp(1j * (phase - within))  # as each pulse begins
        added = impulses[:, :, 0] + 1j * impulses[:, :, 1]
        if not kicks and self.torques[:, 2].any():
            added = self._pulsed(which, np.zeros_like(added), before, widths)[0] * np.exp(
                1j * within
            )
        else:
            added = added * np.exp(0.5j * within) * np.sinc(within / (2.0 * np.pi))
        after = A * complex(rates[0], rates[1]) + np.cumsum(added * begun, axis=1)
        # In body axes as each pulse begins: H turns back in a coast.
        across = (after - added * begun) / begun
        size = np.sqrt(across.real**2 + across.imag**2 + before**2)
        cosine, sine = cos_sin(0.5 / A * size * coasts)
        sine /= np.where(size > 0.0, size, 1.0)
        half = np.exp(0.5j * turned)
        first, second = (cosine + 1j * (sine * before)) * half, sine * across * half
        if not kicks:
            turns = zip(
                (first, second), self._pulsed(which, across, before, widths)[1:], strict=True
            )
            first, second = (np.stack(pair, axis=2).reshape(count, 2 * n) for pair in turns)
        while (number := first.shape[1]) > 1:  # the product of all turns in their order, by pairs
            last = number & ~1
            u, v, w, z = first[:, :last:2], second[:, :last:2], first[:, 1::2], second[:, 1::2]
            products = (u * w - v * z.conj(), first), (u * z + v * w.conj(), second)
            first, second = (
                np.concatenate([product, rest[:, last:]], axis=1) for product, rest in products
            )
        momentum = after[:, -1] * np.exp(-1j * phase[:, -1])
        (one,), (other,) = first.T, second.T
        spun = attitude.product(turn, (one.real, other.real, other.imag, one.imag))
        return np.array([momentum.real, momentum.imag, axial[:, -1]]), np.array(spun)

    def _pulsed(
        self, which: Indices, across: Complex, before: Vector, widths: Vector
    ) -> tuple[Complex, ...]:
        """H across axis 3 (b, n) after pulses, each alone, that begin with H ``across`` and along
        it; turn of each.
        """
        moments = np.repeat(self._start[0][:, None], which.size, axis=1)
        begun = np.array([across.real, across.imag, before - self.spacecraft.inertia.wheel])
        rates = begun.reshape(3, -1) / moments
        turns = np.repeat(np.eye(4)[:, :1], which.size, axis=1)
        bodies = Bodies(moments, *self._forced)
        torques = self.torques[which].reshape(-1, 3).T
        stretch = MotionStretch(bodies, np.zeros(which.size), rates, turns, torques)
        advance(stretch, widths.ravel())
        pairs = (rates[0], rates[1]), (turns[0], turns[3]), (turns[1], turns[2])
        after, *turned = ((real + 1j * imaginary).reshape(which.shape) for real, imaginary in pairs)
        return after * self._start[0][0], *turned

    def slopes(self, which: Indices, x: Vector, scale: Vector, here: Vector, kicks: int) -> Vector:
        """Slopes of the misses, ``here`` now, by the unknowns in units of ``scale`` (b, …): (b,
        equations, …).
        """
        number = x.shape[1]
        moved = x[:, None, :] + DIFFERENCE * scale[:, None, :] * np.eye(number)
        there = self.misses(np.repeat(which, number, axis=0), moved.reshape(-1, number), kicks)
        changes = there.reshape(*moved.shape[:2], len(self.chosen)) - here[:, None, :]
        return np.swapaxes(changes, 1, 2) / DIFFERENCE

    def price(self, which: Indices, on: Vector) -> Vector:
        """Cost of sequences with on-times ``on`` (…, n) s."""
        return np.asarray(np.sum(self.costs[which] * on, axis=-1))

    def bounds(self, sequences: Sequences) -> tuple[Vector, Vector]:
        """Rows (r, …) and levels (b, r): rows @ x >= levels keeps gap, windows, on-times and
        ``off``.
        """
        count, n = sequences.which.shape
        identity = np.eye(n)
        zero = np.zeros((n, n))
        after = identity - np.eye(n, k=-1)
        matrix = np.block(
            [
                [after, -np.eye(n, k=-1)],
                [identity, zero],
                [-identity, -identity],
                [zero, identity],
                [zero, -identity],
            ]
        )[1:]
        levels = [
            np.full((count, n - 1), self.spacecraft.limits.gap),
            sequences.begins,
            -sequences.ends,
        ]
        levels += [sequences.shortest, -sequences.longest]
        if self.loose:
            # Within the polygon that touches the circle in all directions where H may end.
            sides = np.pad(-AROUND.T, ((0, 0), (2 * n, 0)))
            matrix = np.vstack([np.pad(matrix, ((0, 0), (0, 2))), sides])
            levels.append(np.full((count, len(sides)), -math.cos(math.pi / len(sides))))
        return matrix, np.hstack(levels)


WHOLE, SHARES = (
    np.array([1.0]),
    np.array([0.5, 0.2, 0.05, 0.01]),
)  # of a step, where all of it does not help

# Share of the cost at which the barrier of the bounds ends; relative error of the conditions for an
# optimum at which a sequence is done.
BARRIER, SETTLED = 1e-9, 1e-7

# Share of the cost below which the next step's promise, the barrier and the misses are not worth
# taking it; weight that keeps the multipliers finite where equations depend on one another.
FLAT, PROXIMAL = 1e-5, 1e-9


class DescentState(NamedTuple):
    """State of the descents of b sequences: unknowns ``x`` (b, v), slacks of the r bounds and their
    multipliers.

    ``misses`` (b, m), ``slopes`` (b, m, v), ``prices`` (b, m) multipliers of the equations,
    ``curvature`` (b, v, v) of the Lagrangian, ``barrier`` and ``penalty`` (b,), ``error`` (b,) of
    the conditions for an optimum.
    """

    x: Vector
    slack: Vector
    dual: Vector
    misses: Vector
    slopes: Vector
    prices: Vector
    curvature: Vector
    barrier: Vector
    penalty: Vector
    error: Vector


class Descent:
    """The descents of ``sequences`` from ``x`` (b, v), which must lie within all bounds."""

    def __init__(
        self, task: Task, sequences: Sequences, x: Vector, *, kicks: int, barrier: float = 0.1
    ) -> None:
        self.task, self.sequences, self.kicks = task, sequences, kicks
        which, (count, number) = sequences.which, x.shape
        n = which.shape[1]
        # Natural sizes of the unknowns.
        self.scale = np.hstack(
            [np.full((count, n), task.pace), task.unit[which], np.ones((count, task.loose))]
        )
        rows, levels = task.bounds(sequences)
        scaled = rows * self.scale[:, None, :]
        size = np.abs(scaled).max(axis=2)
        self.rows = scaled / size[:, :, None]
        self.price = np.zeros_like(self.scale)
        self.price[:, n : 2 * n] = (task.costs * task.unit)[which] / task.least
        slack = (x @ rows.T - levels) / size
        misses = task.misses(which, x, kicks)
        self.state = DescentState(
            x=np.array(x),
            slack=slack,
            dual=barrier / slack,
            misses=misses,
            slopes=task.slopes(which, x, self.scale, misses, kicks),
            prices=np.zeros((count, len(task.chosen))),
            curvature=np.repeat(np.eye(number)[None], count, axis=0),
            barrier=np.full(count, barrier),
            penalty=np.ones(count),
            error=np.full(count, np.inf),
        )

    @property
    def cost(self) -> Vector:
        """Present cost of the sequences, (b,)."""
        which = self.sequences.which
        return self.task.price(which, self.state.x[:, which.shape[1] : 2 * which.shape[1]])

    @property
    def left(self) -> Vector:
        """Largest miss, (b,), over |H|."""
        return np.asarray(np.abs(self.state.misses).max(axis=1))

    def of(self, rows: Indices) -> Descent:
        """The descents of some of the sequences."""
        some = copy.copy(self)
        some.sequences, some.state = (
            self.sequences.of(rows),
            DescentState._make(part[rows] for part in self.state),
        )
        some.scale, some.rows, some.price = self.scale[rows], self.rows[rows], self.price[rows]
        return some

    def run(self, steps: int) -> None:
        """Take at most so many steps with each sequence."""
        for _ in range(steps):
            going = np.flatnonzero(self.state.error > SETTLED)
            if not len(going) or work.exhausted():
                break
            with np.errstate(all="ignore"):  # a sequence that gets lost is left as it is
                for state, stepped in zip(self.state, self.of(going)._stepped(), strict=True):
                    state[going] = stepped

    def close(self, steps: int = 5) -> None:
        """Take the last misses away by the least moves, measured by the room that is left."""
        state, which = self.state, self.sequences.which
        for _ in range(steps):
            curvature = _weighted(self.rows, 1.0 / state.slack**2)
            move, _ = _newton(
                state.slopes, curvature, np.zeros_like(state.x), state.misses, state.prices * 0.0
            )
            move[~np.isfinite(move).all(axis=1)] = 0.0
            closer = np.einsum("bri,bi->br", self.rows, move)
            step = _to_bound(state.slack, closer, np.full(len(move), 0.5))[:, None]
            x, slack = state.x + step * move * self.scale, state.slack + step * closer
            misses = self.task.misses(which, x, self.kicks)
            better = np.abs(misses).sum(axis=1) < np.abs(state.misses).sum(axis=1)
            if not better.any():
                break
            state.x[better], state.slack[better], state.misses[better] = (
                x[better],
                slack[better],
                misses[better],
            )

    def _stepped(self) -> DescentState:
        """The state of all descents one step on."""
        old, rows = self.state, self.rows
        weight = old.dual / old.slack
        uphill = self.price - np.einsum("br,bri->bi", old.barrier[:, None] / old.slack, rows)
        curvature = old.curvature + _weighted(rows, weight)
        move, prices = _newton(old.slopes, curvature, uphill, old.misses, old.prices)
        lost = ~np.isfinite(move).all(axis=1) | ~np.isfinite(prices).all(axis=1)
        move[lost], prices[lost] = 0.0, 0.0
        penalty = np.maximum(old.penalty, 1.5 * np.abs(prices).max(axis=1))
        ahead = np.einsum("bi,bi->b", uphill, move)
        slope = np.minimum(ahead - penalty * np.abs(old.misses).sum(axis=1), 0.0)
        closer = np.einsum("bri,bi->br", rows, move)
        step = _to_bound(old.slack, closer, old.barrier)[:, None] * move

        def merit(x: Vector, slack: Vector, misses: Vector, k: Indices) -> Vector:
            dear = np.einsum("bi,bi->b", self.price[k], x / self.scale[k])
            dear -= old.barrier[k] * np.log(slack).sum(axis=1)
            return np.asarray(dear + penalty[k] * np.abs(misses).sum(axis=1))

        # Along the step, by the first share of it by which cost, barrier and misses fall enough.
        x, slack, misses = old.x.copy(), old.slack.copy(), old.misses.copy()
        stuck = np.arange(len(x))
        before = merit(x, slack, misses, stuck)
        for attempt, shares in enumerate((WHOLE, WHOLE, SHARES)):
            if not len(stuck):
                break
            moved = step[stuck]
            if attempt == 1:  # the equations are curved: from there back onto them
                moved = (
                    moved
                    + _newton(
                        old.slopes[stuck],
                        curvature[stuck],
                        0.0 * moved,
                        misses[stuck],
                        0.0 * prices[stuck],
                    )[0]
                )
            k, share = np.tile(stuck, len(shares)), np.repeat(shares, len(stuck))
            moved = share[:, None] * np.tile(moved, (len(shares), 1))
            room = old.slack[k] + np.einsum("bri,bi->br", rows[k], moved)
            # As much of the room must be left.
            inside = np.all(room > LEAST_ROOM * old.slack[k], axis=1)
            there = np.where(inside[:, None], old.x[k] + moved * self.scale[k], old.x[k])
            room = np.where(inside[:, None], room, old.slack[k])
            missed = self.task.misses(self.sequences.which[k], there, self.kicks)
            least = before[k] + 1e-4 * share * slope[k] + 1e-11 * np.abs(before[k])
            enough = (inside & (merit(there, room, missed, k) <= least)).reshape(len(shares), -1)
            none = ~enough.any(axis=0)
            # Rows of the first share that falls enough, or of the last.
            chosen = np.where(none, len(shares) - 1, np.argmax(enough, axis=0)) * len(stuck)
            chosen += np.arange(len(stuck))
            x[stuck], slack[stuck], misses[stuck] = there[chosen], room[chosen], missed[chosen]
            stuck = stuck[none]
        slopes = self.task.slopes(self.sequences.which, x, self.scale, misses, self.kicks)
        change = np.einsum("bmi,bm->bi", slopes - old.slopes, prices)
        curvature = _curved(old.curvature, (x - old.x) / self.scale, change)
        curvature[stuck] = np.eye(x.shape[1])
        dearer = old.barrier[:, None] / old.slack - old.dual - weight * closer
        dual = old.dual + _to_bound(old.dual, dearer, old.barrier)[:, None] * dearer
        central = old.barrier[:, None] / slack
        dual = np.clip(dual, 1e-2 * central, 1e2 * central)
        gradient = (
            self.price
            + np.einsum("bmi,bm->bi", slopes, prices)
            - np.einsum("br,bri->bi", dual, rows)
        )
        wrong = np.maximum(np.abs(gradient).max(axis=1), np.abs(misses).max(axis=1))
        near = (
            np.maximum(wrong, np.abs(dual * slack - old.barrier[:, None]).max(axis=1))
            < 10.0 * old.barrier
        )
        barrier = np.where(
            near, np.maximum(np.minimum(0.2 * old.barrier, old.barrier**1.5), BARRIER), old.barrier
        )
        flat = (np.abs(ahead) < FLAT) & (old.barrier < FLAT) & (np.abs(misses).max(axis=1) < FLAT)
        error = np.where(flat | lost, 0.0, np.maximum(wrong, (dual * slack).max(axis=1)))
        return DescentState(
            x, slack, dual, misses, slopes, prices, curvature, barrier, penalty, error
        )


def _weighted(rows: Vector, weight: Vector) -> Vector:
    """rowsᵀ weight rows, (b, v, v), for rows (b, r, v) and weights (b, r)."""
    return np.asarray(np.matmul(np.swapaxes(rows * weight[:, :, None], 1, 2), rows))


def _newton(
    slopes: Vector, curvature: Vector, uphill: Vector, misses: Vector, prices: Vector
) -> tuple[Vector, Vector]:
    """Step (b, v) in scaled unknowns and prices (b, m) of the equations, by the conditions for an
    optimum.
    """
    count, m, v = slopes.shape
    system = np.zeros((count, v + m, v + m))
    system[:, :v, :v] = curvature
    system[:, :v, v:] = np.swapaxes(slopes, 1, 2)
    system[:, v:, :v] = slopes
    system[:, v:, v:] = -PROXIMAL * np.eye(m)
    right = np.concatenate([-uphill, -misses - PROXIMAL * prices], axis=1)
    try:
        step = np.linalg.solve(system, right[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:  # some are singular: those are lost, not all
        step = np.full(right.shape, np.nan)
        for row in range(count):
            with suppress(np.linalg.LinAlgError):
                step[row] = np.linalg.solve(system[row], right[row])
    return step[:, :v], step[:, v:]


def _to_bound(value: Vector, change: Vector, barrier: Vector) -> Vector:
    """Largest step (b,), at most 1, that leaves a little of each ``value`` (b, r)."""
    keep = np.maximum(0.99, 1.0 - barrier)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.where(change < 0.0, -keep * value / change, np.inf)
    return np.asarray(np.minimum(steps.min(axis=1), 1.0))


def _curved(curvature: Vector, moved: Vector, change: Vector) -> Vector:
    """Powell's damped BFGS update of (b, v, v) by the ``change`` (b, v) of the gradient along
    ``moved`` (b, v).
    """
    along = np.einsum("bij,bj->bi", curvature, moved)
    size, gain = np.einsum("bi,bi->b", moved, along), np.einsum("bi,bi->b", moved, change)
    spread = np.where(size > gain, size - gain, 1.0)
    share = np.where(gain >= 0.2 * size, 1.0, 0.8 * size / spread)[:, None]
    change = share * change + (1.0 - share) * along
    gain = np.einsum("bi,bi->b", moved, change)
    good = (size > 1e-20) & (gain > 1e-20)
    size, gain = np.where(good, size, 1.0)[:, None, None], np.where(good, gain, 1.0)[:, None, None]
    update = (
        change[:, :, None] * change[:, None, :] / gain
        - along[:, :, None] * along[:, None, :] / size
    )
    return np.asarray(curvature + np.where(good[:, None, None], update, 0.0))
