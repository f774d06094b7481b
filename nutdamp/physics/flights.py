"""Flights of many rigid bodies through pulses; arrays carry the body last."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from nutdamp.physics.motion import MotionStretch, advance
from nutdamp.physics.series import Bodies

Array = NDArray[np.float64]

# cases flown together: enough to hide the cost of calls, few enough that their series stay in the
# cache
BLOCK = 2048


@dataclass(frozen=True, slots=True)
class Pulses:
    """Rectangular pulses; the moments fall half as one begins and half as it ends, which errs in
    second order.
    """

    starts: Array  # (k, n) s
    on_times: Array  # (k, n) s, or (k, 1) for all cases; 0: an ideal impulse
    impulses: Array  # torque × on-time, (k, 3, n) N m s
    leans: Array | None = (
        None  # (k, n): torques run evenly from 1 - lean to 1 + lean times their mean
    )
    sheds: Array | None = None  # decrease of the moments, (k, 3, n) kg m²

    def some(self, cases: Any) -> Pulses:
        """Subset of ``cases`` (an index of arrays)."""
        on_times = self.on_times if self.on_times.shape[1] == 1 else self.on_times[:, cases]
        leans = None if self.leans is None else self.leans[:, cases]
        sheds = None if self.sheds is None else self.sheds[:, :, cases]
        return Pulses(self.starts[:, cases], on_times, self.impulses[:, :, cases], leans, sheds)

    @property
    def slopes(self) -> Array | None:
        """Slope of each torque, (k, 3, n) N m/s; None where all are constant."""
        if self.leans is None or not self.leans.any():
            return None
        lasts = np.where(self.on_times == 0.0, 1.0, self.on_times)
        return np.asarray(self.impulses * (2.0 * self.leans / lasts**2)[:, None])

    @property
    def edges(self) -> Array:
        """Starts and ends in turn, (2k, n) s."""
        ends = self.starts + self.on_times
        return np.stack([self.starts, ends], axis=1).reshape(-1, self.starts.shape[1])

    @property
    def torques(self) -> tuple[Array, Array]:
        """Torque as each pulse begins and as it ends, (k, 3, n) N m each; 0 of ideal impulses."""
        on_times = self.on_times[:, None]
        ideal = on_times == 0.0
        mean = np.where(ideal, 0.0, self.impulses / np.where(ideal, 1.0, on_times))
        if self.leans is None:
            return mean, mean
        leans = self.leans[:, None]
        return (1.0 - leans) * mean, (1.0 + leans) * mean


class Observer(Protocol):
    """Observer of the motion of cases; see `sky`."""

    def some(self, cases: Any) -> Observer:
        """Observer of a subset of ``cases`` (an index of arrays)."""

    def motion(self, here: MotionStretch, duration: Array) -> None:
        """Receive the motion that `advance` is about to make with the same arguments."""


def fly(
    bodies: Bodies, rates: Array, quaternion: Array, pulses: Pulses, watch: Observer | None = None
) -> tuple[Array, Array]:
    """Rates (3, n) rad/s and unit quaternions (4, n), body -> inertial, as the last pulse of each
    case ends.

    ``rates`` and ``quaternion`` at t = 0; ``watch`` sees the motion until then. Exact to some 1e-13
    rad for each hundred radians flown. Pulses may overlap and come in any order. Raises Infeasible
    beyond `LONGEST` rad.
    """
    rates, quaternion = np.array(rates, dtype=float), np.array(quaternion, dtype=float)
    for begin in range(0, rates.shape[1], BLOCK):
        cases = slice(begin, begin + BLOCK)
        seen = None if watch is None else watch.some(cases)
        _fly_block(
            bodies.some(cases), rates[:, cases], quaternion[:, cases], pulses.some(cases), seen
        )
    return rates, quaternion


def _fly_block(
    bodies: Bodies, rates: Array, quaternion: Array, pulses: Pulses, watch: Observer | None
) -> None:
    """Fly one block, in place."""
    edges = pulses.edges
    if not len(edges):
        return
    usual = np.argsort(edges.mean(axis=1), kind="stable")
    sorted_alike = np.all(np.diff(edges[usual], axis=0) >= 0.0, axis=0)
    if sorted_alike.all():
        _fly_alike(bodies, rates, quaternion, pulses, watch, usual)
        return
    for cases, alike in (
        (np.flatnonzero(sorted_alike), True),
        (np.flatnonzero(~sorted_alike), False),
    ):
        if len(cases):
            flown, turned = rates[:, cases], quaternion[:, cases]
            chosen = (
                bodies.some(cases),
                flown,
                turned,
                pulses.some(cases),
                watch and watch.some(cases),
            )
            if alike:
                _fly_alike(*chosen, usual)
            else:
                _fly_each(*chosen)
            rates[:, cases], quaternion[:, cases] = flown, turned


def _fly_alike(
    bodies: Bodies,
    rates: Array,
    quaternion: Array,
    pulses: Pulses,
    watch: Observer | None,
    order: NDArray[np.intp],
) -> None:
    """Fly cases whose edges have the same ``order``, in place: between pulses all of them coast."""
    edges, slopes = pulses.edges, pulses.slopes
    firsts, _ = pulses.torques
    half = None if pulses.sheds is None else 0.5 * pulses.sheds
    now = np.zeros(rates.shape[1])
    on = set[int]()
    for edge in order.tolist():
        torque = slope = None
        if on:
            acting = sorted(on)
            torque = np.sum(firsts[acting], axis=0)
            if slopes is not None:
                slope = np.sum(slopes[acting], axis=0)
                torque += sum(slopes[number] * (now - edges[2 * number]) for number in acting)
        _advance(
            MotionStretch(bodies, now, rates, quaternion, torque, slope), edges[edge] - now, watch
        )
        now = edges[edge]
        number, ends = divmod(edge, 2)
        bodies = bodies.lighter(None if half is None else half[number])
        if np.any(pulses.on_times[number]):
            (on.remove if ends else on.add)(number)
        elif not ends:
            rates += pulses.impulses[number] / bodies.moments


def _fly_each(
    bodies: Bodies, rates: Array, quaternion: Array, pulses: Pulses, watch: Observer | None
) -> None:
    """Fly cases with different orders of edges, in place.

    Those that coast from one edge to the next go on in closed form: with times widely dispersed one
    coast may be long where another case has a pulse on, whose steps it would take.
    """
    edges, slopes = pulses.edges, pulses.slopes
    firsts, lasts = pulses.torques
    ideal = np.broadcast_to(pulses.on_times == 0.0, pulses.starts.shape)
    order = np.argsort(edges, axis=0, kind="stable")
    on = np.cumsum(1 - 2 * (order % 2), axis=0)  # pulses that are on behind each edge
    now = np.zeros(rates.shape[1])
    torque = np.zeros_like(rates)
    slope = None
    for number, edge_of_each in enumerate(order):
        here = MotionStretch(bodies, now, rates, quaternion, torque, slope)
        edge = _of_each(edges, edge_of_each)
        coasts = on[number - 1] == 0 if number else np.ones(len(now), dtype=bool)
        groups = (
            (np.flatnonzero(coasts), np.flatnonzero(~coasts))
            if bodies.free
            else (np.arange(len(now)),)
        )
        for cases in filter(len, groups):
            part = here.some(cases)
            if bodies.free and coasts[cases[0]]:
                part = part._replace(torque=None, slope=None)
            _advance(part, (edge - now)[cases], watch and watch.some(cases))
            rates[:, cases], quaternion[:, cases] = part.rates, part.quaternion
        if slope is not None:
            torque = torque + slope * (edge - now)
        pulse, ends = np.divmod(edge_of_each, 2)
        torque = torque + np.where(ends, -_of_each(lasts, pulse), _of_each(firsts, pulse))
        now = edge
        if slopes is not None:
            bend = np.where(ends, -1.0, 1.0) * _of_each(slopes, pulse)
            slope = bend if slope is None else slope + bend
        if pulses.sheds is not None:
            bodies = bodies.lighter(0.5 * _of_each(pulses.sheds, pulse))
        kicked = _of_each(ideal, pulse) & (ends == 0)
        if kicked.any():
            rates += np.where(kicked, _of_each(pulses.impulses, pulse), 0.0) / bodies.moments


def _of_each(values: Any, rows: NDArray[np.intp]) -> Any:
    """Values (m, …, n) of one row of each case, (…, n)."""
    index = rows.reshape(1, *(1,) * (values.ndim - 2), len(rows))
    return np.take_along_axis(values, index, axis=0)[0]


def _advance(here: MotionStretch, duration: Array, watch: Observer | None) -> None:
    """Propagate in place; ``watch`` sees the motion before that."""
    if watch is not None:
        watch.motion(here, duration)
    advance(here, duration)
