"""Starts and on-times on the ticks of the commands, so that together they leave as little as they can.

Rounding each pulse on its own leaves what half a tick of each can do. Here starts and on-times are stepped to and fro,
two pulses at a time, by the linear model of what is left, which is taken anew about the ticks found.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from nutdamp.flight import Flight
from nutdamp.limits import Windows
from nutdamp.schedule import TOUCHING, Schedule
from nutdamp.schemes.optimal.pulse_parameters import PulseParameters
from nutdamp.spacecraft import Spacecraft, Vector

REACH = 2.0
"""Ticks that a start or on-time may lie from what it was before."""

STEPS = 300
"""Steps of one tick, two pulses at a time, by one linear model."""

MODELS = 4
"""Linear models, each about the best ticks so far."""

WAYS = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
"""A step: of the start, of the on-time."""


def on_ticks(
    spacecraft: Spacecraft,
    parameters: PulseParameters,
    x: Vector,
    left: Callable[[Schedule], tuple[Vector, Flight]],
    slopes: Callable[[Schedule, Flight], Vector],
) -> Schedule:
    """The schedule of settings ``x`` (2k,) s of the ``parameters`` on ticks.

    ``left`` gives what a schedule leaves (equations,) and its flight, ``slopes`` what the scaled parameters change
    in it.
    """
    lattice = _Lattice(spacecraft, parameters, x)
    ticks = lattice.rounded
    best, least = parameters.schedule(lattice.settings(ticks)), np.inf
    for _ in range(MODELS):
        made = parameters.schedule(lattice.settings(ticks))
        missing, flown = left(made)
        size = float(np.linalg.norm(missing))
        if size >= least:
            break
        best, least = made, size
        ticks = lattice.stepped(ticks, missing, slopes(made, flown) / parameters.scale)
    return best


class _Lattice:
    """Starts and on-times in ticks, (k, 2) each, and which of them may be commanded."""

    def __init__(self, spacecraft: Spacecraft, parameters: PulseParameters, x: Vector) -> None:
        windows, channels = Windows(spacecraft), parameters.channels
        self.tick = spacecraft.limits.tick or 0.0
        centres, needed = x.reshape(-1, 2).T
        self.bounds = np.array([[channel.min_on_time, channel.max_on_time] for channel in channels]).T
        self.room = np.array(parameters.room).T
        self.exact = np.column_stack([centres - 0.5 * needed, needed]) / self.tick
        on_times = [windows.on_time(on_time, *bounds) for on_time, bounds in zip(needed, self.bounds.T, strict=True)]
        self.rounded = np.rint(np.column_stack([self.exact[:, 0], np.array(on_times) / self.tick]))

    def settings(self, ticks: Vector) -> Vector:
        """Centres and on-times, (2k,) s."""
        return self.tick * np.ravel(np.column_stack([ticks[:, 0] + 0.5 * ticks[:, 1], ticks[:, 1]]))

    def allowed(self, ticks: Vector) -> NDArray[np.bool_]:
        """Pulses (k,) that keep their limits, and are near enough for a linear model."""
        start, on_time = self.tick * ticks.T
        near = np.abs(ticks - self.exact).max(axis=1) < REACH
        inside = near & (start >= self.room[0] - TOUCHING) & (start + on_time <= self.room[1] + TOUCHING)
        bounded = (on_time >= self.bounds[0] - TOUCHING) & (on_time <= self.bounds[1] + TOUCHING)
        return np.asarray(inside & bounded & (on_time > 0.5 * self.tick))

    def stepped(self, ticks: Vector, missing: Vector, slopes: Vector) -> Vector:
        """Ticks that leave less, where ``ticks`` leave ``missing`` and ``slopes`` (…, 2k) are per s."""
        ticks = ticks.copy()
        for _ in range(STEPS):
            possible = [(index, way) for way in WAYS for index in np.flatnonzero(self.allowed(ticks + way))]
            if not possible:
                break
            pulse = np.array([index for index, _ in possible])
            start, on_time = np.array([way for _, way in possible]).T
            centre = start + 0.5 * on_time
            changes = self.tick * (slopes[:, 2 * pulse] * centre + slopes[:, 2 * pulse + 1] * on_time)
            alone = missing[:, None] + changes
            pairs = np.linalg.norm(alone[:, :, None] + changes[:, None, :], axis=0)
            # Two steps of one pulse might leave its room; on the diagonal is the single step.
            pairs[pulse[:, None] == pulse[None, :]] = np.inf
            np.fill_diagonal(pairs, np.linalg.norm(alone, axis=0))
            one, two = divmod(int(np.argmin(pairs)), len(pulse))
            if pairs[one, two] >= float(np.linalg.norm(missing)) * (1.0 - 1e-9):
                break
            for index in {one, two}:
                ticks[pulse[index]] += start[index], on_time[index]
                missing = missing + changes[:, index]
        return ticks
