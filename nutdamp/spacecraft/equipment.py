"""Equipment that a spacecraft fires, is commanded with and senses by; SI and rad, in principal
axes.

Thrusters, channels of them and Magnus' steerable torquer; a Sun sensor that starts the clock of
each spin, and the steps of command blocks; the sensor, law and faults of a closed loop.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from nutdamp.physics.thruster import Valve

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SunSensor:
    """Gives a pulse in each spin, when the Sun passes its ``azimuth``: rad in the body, about axis
    3 from axis 1.

    It sees the Sun at most ``half_width`` rad from ``elevation``, which is counted from the plane
    square to axis 3 towards the spin axis. ``jitter`` s is one sigma of its pulses.
    """

    azimuth: float
    elevation: float = 0.0
    half_width: float = 0.5 * math.pi
    jitter: float = 0.0

    @property
    def sees_all(self) -> bool:
        """True if the sensor sees every passage of the Sun unless the Sun is along the axis."""
        return self.elevation == 0.0 and self.half_width >= 0.5 * math.pi

    def sees(self, sun_angle: Any) -> Any:
        """True if the Sun is in view at this angle (rad) from the spin axis; elementwise."""
        return abs(0.5 * math.pi - sun_angle - self.elevation) <= self.half_width


TIME, ANGLE = "time", "angle"
"""What a delay is: so many seconds, or an angle by the clock of Sun sectors."""


@dataclass(frozen=True, slots=True, eq=False)
class Commands:
    """Possible command blocks: delays 0, ``delay_step``, … up to ``delay_max`` s, ``widths`` (n,)
    s, at most ``max_count`` pulses, one in ``every`` so many spins.

    With a ``width_step`` the widths are the shortest and the longest of all in such steps, which no
    array lists. So many blocks as ``per_turn`` may fire in the same turns. ``delay_is`` one of the
    names below: by `ANGLE` the step and the longest delay are those at the spin of t = 0.
    """

    delay_step: float
    delay_max: float
    widths: Vector
    max_count: int
    every: tuple[int, ...]
    width_step: float | None = None
    per_turn: int = 1
    delay_is: str = TIME

    def after_sun_pulse(self, delay: float, spin: float) -> tuple[float, float]:
        """A ``delay``, s, at a ``spin``, rad/s, as delay and angle of a `Block`."""
        return (0.0, delay * abs(spin)) if self.delay_is == ANGLE else (delay, 0.0)

    def some_widths(self, least: float, most: float, count: int) -> Vector:
        """Widths from ``least`` to ``most`` s that can be commanded; ``count`` of steps."""
        if self.width_step is None:
            return np.asarray(self.widths[(self.widths >= least) & (self.widths <= most)])
        first, last = self.widths.tolist()
        low = math.ceil((max(least, first) - first) / self.width_step * (1.0 - 1e-12))
        high = math.floor((min(most, last) - first) / self.width_step * (1.0 + 1e-12))
        steps = np.unique(np.rint(np.linspace(low, high, max(min(high - low + 1, count), 0))))
        return np.asarray(first + self.width_step * steps)

    def nearest_width(self, width: float) -> float:
        """The nearest to a ``width``, s, that can be commanded."""
        step = self.width_step or 0.0
        near = np.append(self.widths, self.some_widths(width - step, width + step, 3))
        return float(near[np.abs(near - width).argmin()])

    def counts(self, name: str, time: float) -> int:
        """Steps of a ``delay`` or ``width``, s; in a list of widths the number of the nearest."""
        step = self.delay_step if name == "delay" else self.width_step
        return 1 + int(np.abs(self.widths - time).argmin()) if step is None else round(time / step)

    def time(self, name: str, counts: float) -> float | None:
        """Inverse of `counts`, s; None where the list has no such number."""
        step = self.delay_step if name == "delay" else self.width_step
        if step is not None:
            return counts * step
        return float(self.widths[int(counts) - 1]) if 1 <= counts <= len(self.widths) else None


@dataclass(frozen=True, slots=True)
class Block:
    """``count`` pulses of ``channel``, each ``width`` s long and begun ``delay`` s after a Sun
    pulse, or after the Sun has turned on by an ``angle``, rad in the body.

    ``first`` is the number of the Sun pulse of the first one, 1 the first after t = 0; from then on
    every ``every``-th Sun pulse fires one.
    """

    channel: str
    first: int
    delay: float
    width: float
    count: int
    every: int = 1
    angle: float = 0.0

    def delay_at(self, spin: float) -> float:
        """Time from the Sun pulse to a start, s, at a steady ``spin``, rad/s."""
        return self.delay + self.angle / abs(spin)

    @property
    def sun_pulses(self) -> range:
        """Numbers of the Sun pulses that fire it."""
        return range(self.first, self.first + self.count * self.every, self.every)


class BlockPulse(NamedTuple):
    """A pulse of the ``block`` at this place in its row, from 0, fired by the Sun pulse of a
    ``number``.
    """

    number: int
    at: int
    block: Block


def firings(blocks: Sequence[Block]) -> list[BlockPulse]:
    """One queue of the pulses of all blocks: by Sun pulses, of one Sun pulse by their delays."""
    queue = [
        BlockPulse(number, index, block)
        for index, block in enumerate(blocks)
        for number in block.sun_pulses
    ]
    return sorted(queue, key=lambda each: (each.number, each.block.angle, each.block.delay))


GYRO, ACCELEROMETER = "gyro", "accelerometer"
"""Kinds of sensor: rate gyros about the body axes 1 and 2, or one accelerometer."""

FOUR_PULSE, ONE_PULSE, BANG = "four-pulse", "one-pulse", "bang"
"""Laws: pulses in proportion to the remaining nutation; one pulse for all of it; equal pulses."""


@dataclass(frozen=True, slots=True, eq=False)
class Sensor:
    """Sensor of the loop: ``scale`` times the truth plus ``bias``, with ``noise`` (one sigma), in
    steps.

    ``bias``, ``noise`` and the steps of ``quantisation`` are rad/s of a gyro, m/s² of an
    accelerometer, which is at ``position`` (3,) m from the centre of mass and measures along the
    unit vector ``axis`` (3,), both in principal axes; the gyros measure about the rows of ``axes``
    (2, 3), unit vectors in those. ``rate`` Hz is that of its samples, None is a continuous signal;
    ``delay`` s until a sample can be used; ``low_pass`` s the time constant of a first-order filter
    over the samples, 0 is none. ``second`` is what the second gyro has as scale and bias, where
    that differs.
    """

    kind: str = GYRO
    rate: float | None = None
    quantisation: float = 0.0
    noise: float = 0.0
    bias: float = 0.0
    scale: float = 1.0
    delay: float = 0.0
    low_pass: float = 0.0
    position: Vector = field(default_factory=lambda: np.zeros(3))
    axis: Vector = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    axes: Vector = field(default_factory=lambda: np.eye(3)[:2])
    second: tuple[float, float] | None = None

    @property
    def scales(self) -> tuple[float, ...]:
        """Scale of each column of the signal: axis 1, and of a gyro axis 2."""
        return self._each(self.scale, 0)

    @property
    def biases(self) -> tuple[float, ...]:
        """Bias of each column, rad/s or m/s²."""
        return self._each(self.bias, 1)

    def _each(self, value: float, which: int) -> tuple[float, ...]:
        if self.kind == ACCELEROMETER:
            return (value,)
        return (value, value if self.second is None else self.second[which])


@dataclass(frozen=True, slots=True)
class Loop:
    """Closed loop: fire by ``sensor`` from a nutation of ``start`` rad down to ``stop`` rad.

    ``law`` is one of the names above; ``on_time`` s is the longest pulse of four-pulse (None: as
    the scheme) and every pulse of bang. After a firing the sensor is not looked at for ``settle``
    s, and the next one begins ``min_interval`` s later at the earliest. ``predict``: delay, filter
    and half the on-time are compensated. ``reversed``: channels that in truth push the other way.
    """

    sensor: Sensor
    law: str = FOUR_PULSE
    start: float = 0.0
    stop: float = 0.0
    settle: float = 0.0
    min_interval: float = 0.0
    predict: bool = True
    on_time: float | None = None
    reversed: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Thruster:
    """Thruster: ``torque`` (3,) N m, ``thrust`` N or None, ``isp`` s or None.

    ``force`` (3,) N and ``position`` (3,) m, where it acts, are None for a thruster known by its
    torque only. ``valve`` is what it makes of commands; None gives full thrust from the start of a
    command to its end.
    """

    name: str
    torque: Vector
    force: Vector | None = None
    thrust: float | None = None
    isp: float | None = None
    min_on_time: float = 0.0
    max_on_time: float = math.inf
    position: Vector | None = None
    valve: Valve | None = None

    @property
    def mass_flow(self) -> float | None:
        """Propellant flow in kg/s; None where thrust or specific impulse is not known."""
        if self.thrust is None or self.isp is None:
            return None
        return self.thrust / (self.isp * STANDARD_GRAVITY)


CANCELLED = 1e-12  # share of its largest thruster torque below which a channel's is rounding


@dataclass(frozen=True)
class Channel:
    """Channel: thrusters that fire together, as one body-fixed torque.

    ``spends`` N m s is the impulse that a second of it counts for, where the torque is not the true
    one.
    """

    name: str
    thrusters: tuple[Thruster, ...]
    spends: float | None = None

    def of(self, **changed: Any) -> Channel:
        """Copy with these fields ``changed`` in each thruster."""
        return replace(
            self, thrusters=tuple(replace(thruster, **changed) for thruster in self.thrusters)
        )

    @cached_property
    def torque(self) -> Vector:
        """Sum of the torques, (3,) N m; zero where they cancel but for rounding."""
        torques = np.array([thruster.torque for thruster in self.thrusters], dtype=np.float64)
        total: Vector = torques.sum(axis=0)
        total[np.abs(total) <= CANCELLED * np.abs(torques).max()] = 0.0
        total.setflags(write=False)
        return total

    @property
    def valve(self) -> Valve | None:
        """Valve of its thrusters, which all have the same."""
        return self.thrusters[0].valve

    @property
    def transverse(self) -> complex:
        """M1 + i M2 in N m."""
        torque = self.torque
        return complex(torque[0], torque[1])

    @property
    def axial(self) -> float:
        """M3 in N m, which changes the spin."""
        return float(self.torque[2])

    @property
    def strength(self) -> float:
        """Impulse of a second of firing, N m s: the size of the torque."""
        return float(np.linalg.norm(self.torque)) if self.spends is None else self.spends

    @property
    def damps(self) -> bool:
        """True if the torque is more transverse than axial; others are for the spin."""
        return abs(self.transverse) > abs(self.axial)

    @property
    def min_on_time(self) -> float:
        """Largest of the thrusters' minima, s."""
        return max(thruster.min_on_time for thruster in self.thrusters)

    @property
    def max_on_time(self) -> float:
        """Smallest of the thrusters' maxima, s."""
        return min(thruster.max_on_time for thruster in self.thrusters)

    @property
    def mass_flow(self) -> float | None:
        """Propellant flow of all thrusters in kg/s; None where one of them is unknown."""
        flows = [thruster.mass_flow for thruster in self.thrusters]
        known = [flow for flow in flows if flow is not None]
        return math.fsum(known) if len(known) == len(flows) else None

    @property
    def price(self) -> float:
        """Propellant, kg (else impulse, N m s), per N m s of transverse impulse."""
        return self.cost_rate(by_propellant=True) / abs(self.transverse)

    def cost_rate(self, *, by_propellant: bool) -> float:
        """Propellant flow, kg/s, of firing; impulse, N m,
        where that is unknown or not the measure.
        """
        flow = self.mass_flow
        return flow if by_propellant and flow is not None else self.strength

    @property
    def force(self) -> Vector | None:
        """Sum of the forces in body axes, (3,) N; None where the direction of one is unknown."""
        known = [thruster.force for thruster in self.thrusters if thruster.force is not None]
        return np.sum(known, axis=0) if len(known) == len(self.thrusters) else None


@dataclass(frozen=True, slots=True)
class Steerable:
    """Steerable torquer (Magnus): a torque about any transverse axis, body-fixed during one pulse.

    ``torque`` in N m; None is an ideal impulse of no width.
    """

    torque: float | None = None
    isp: float | None = None
    lever_arm: float | None = None

    @property
    def propellant_per_impulse(self) -> float | None:
        """kg for each N m s; None where specific impulse or lever arm is not known."""
        if self.isp is None or self.lever_arm is None:
            return None
        return 1.0 / (self.lever_arm * self.isp * STANDARD_GRAVITY)
