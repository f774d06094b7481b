"""The Sun and its pulses of nutating bodies, extreme angles of the spin axis from directions.

On a free arc of a symmetric body the axis goes round H on a cone: with H at the angle β from the
direction and the axis at θ from H it comes as near as |β - θ| and as far as β + θ, if it goes so
far round. Where dissipation changes θ only the turns that count are followed in steps; any other
motion all the way.

A Sun pulse comes when the Sun passes the azimuth of the sensor in the nutating body. Arrays carry
the case last.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.physics.attitude import angle_of_parts, rotate, turned
from nutdamp.physics.energy_sink import damper
from nutdamp.physics.motion import MotionStretch, advance, between_edges, pieces

Array = NDArray[np.float64]

ROWS = 24  # steps per turn of the axis, where it is followed in steps

CIRCLE = 2.0 * math.pi

AXIS = 0.0, 0.0, 1.0  # the third body axis

BACK = np.array([[1.0], [-1.0], [-1.0], [-1.0]])  # factors of the inverse turn

OBLIQUITY = math.radians(23.43928)  # obliquity of the ecliptic at J2000.0
ABERRATION = 20.4898 / 3600.0  # mean aberration of the Sun, deg (Meeus, 25.10)

TILTING, NODE = math.radians(0.013056), math.radians(174.876)
"""Tilt of the ecliptic per century, and the longitude of its axis."""


@dataclass(frozen=True, slots=True, eq=False)
class AxisWatch:
    """Extreme angles so far between the spin axis and directions."""

    directions: Array  # inertial unit vectors (m, 3, n)
    least: Array  # (m, n) rad
    largest: Array  # (m, n) rad
    sense: float  # sign of the spin
    momentum: int | None  # number of the direction in place of which H is taken, wherever it points
    rows: NDArray[np.intp]  # indices of the observed cases among the n

    @classmethod
    def of(cls, directions: Array, sense: float, momentum: int | None = None) -> AxisWatch:
        """Observer without observations."""
        shape = len(directions), directions.shape[2]
        return cls(
            directions,
            np.full(shape, math.pi),
            np.zeros(shape),
            sense,
            momentum,
            np.arange(shape[1]),
        )

    @property
    def angles(self) -> Array:
        """Least and largest, (m, 2, n)."""
        return np.stack([self.least, self.largest], axis=1)

    def some(self, cases: Any) -> AxisWatch:
        """Observer of a subset of ``cases`` (an index of arrays), which adds to this one."""
        return replace(self, rows=self.rows[cases])

    def motion(self, here: MotionStretch, duration: Array) -> None:
        """Record the motion that `motion.advance` makes with these arguments, which stay as they
        are.
        """
        if here.bodies.forcing.timed:
            moving = here._replace(rates=here.rates.copy(), quaternion=here.quaternion.copy())
            for part, length in between_edges(moving, duration):
                self.motion(part, length)
                advance(part, length)
        elif here.torque is not None or not here.bodies.free:
            self._steps(here, duration)
        elif here.bodies.forcing.growth == 0.0:
            self._arc(here, duration)
        else:
            self._slow(here, duration)

    def turn(self, here: MotionStretch, until: float = 0.0) -> None:
        """Record a motion free of pulses: one turn of the axis about H, behind the last edge of a
        torque, and to ``until`` s at least.
        """
        first, second, _ = here.bodies.moments
        wait = np.maximum(max(here.bodies.forcing.edges, default=0.0) - here.since, 0.0)
        turned = wait + CIRCLE * 0.5 * (first + second) / _momentum(here)
        self.motion(here, np.maximum(turned, until - here.since))

    def _take(self, number: int, least: Array, largest: Array, cases: Any = ...) -> None:
        np.minimum.at(self.least[number], self.rows[cases], least)  # a case may come twice
        np.maximum.at(self.largest[number], self.rows[cases], largest)

    def _arc(self, here: MotionStretch, duration: Array) -> None:
        """Record start and inner extremes of arcs; their ends are starts of others."""
        momentum = np.array(turned(here.quaternion, here.bodies.momentum(here.rates)))
        axis = self.sense * np.array(turned(here.quaternion, AXIS))
        size = np.sqrt(np.sum(momentum * momentum, axis=0))
        momentum = momentum / size
        way = size / here.bodies.moments[0] * duration
        theta = angle_of_parts(momentum, axis)
        for number, direction in enumerate(self._towards(momentum)):
            begins, beta = angle_of_parts(axis, direction), angle_of_parts(momentum, direction)
            along = np.sum(axis * direction, axis=0) - np.cos(theta) * np.cos(beta)
            ahead = np.sum(np.cross(momentum, axis, axis=0) * direction, axis=0)
            nearest = (
                np.arctan2(ahead, along) % CIRCLE
            )  # how far round from where it is the axis comes nearest
            farthest = (nearest + math.pi) % CIRCLE
            least = np.abs(beta - theta)
            largest = np.minimum(beta + theta, CIRCLE - beta - theta)
            self._take(
                number,
                np.where(way >= nearest, least, begins),
                np.where(way >= farthest, largest, begins),
            )

    def _slow(self, here: MotionStretch, duration: Array) -> None:
        """Record arcs with dissipation: in steps the first turn and the last, or all where θ passes
        β or π - β.
        """
        turn = CIRCLE * here.bodies.moments[0] / _momentum(here)
        last = here.moved(here.since + np.maximum(duration - turn, 0.0))
        momentum = np.array(turned(here.quaternion, here.bodies.momentum(here.rates)))
        momentum /= np.sqrt(np.sum(momentum * momentum, axis=0))
        before, after = (
            angle_of_parts(momentum, self.sense * np.array(turned(stretch.quaternion, AXIS)))
            for stretch in (here, last)
        )
        betas = np.array(
            [angle_of_parts(momentum, direction) for direction in self._towards(momentum)]
        )
        # Else |β - θ| and β + θ change monotonically between the first turn and the last, as θ
        # does.
        passed = [
            (before - other) * (after - other) <= 0.0 for other in (*betas, *(math.pi - betas))
        ]
        whole = (duration <= 2.0 * turn) | np.any(passed, axis=0)
        for cases, begins, lasts in (
            (whole, here, duration),
            (~whole, here, turn),
            (~whole, last, turn),
        ):
            if cases.any():
                self.some(cases)._steps(begins.some(cases), lasts[cases])

    def _steps(self, here: MotionStretch, duration: Array) -> None:
        """Record start, end, and the extremes between the steps on the way."""
        first, second, _ = here.bodies.moments
        pace = _momentum(here) / np.minimum(first, second)
        if not np.array_equal(first, second):
            pace = pace + np.abs(here.rates[2])
        self._record(here, ...)
        before = self._look(here)
        for piece in pieces(here, duration):
            count = max(math.ceil(float(np.max(pace * piece.duration)) * ROWS / CIRCLE), 1)
            looks = np.array([before, *(self._look(here := step) for step in piece.along(count))])
            before = looks[-1]
            for cosines, rates in looks.transpose(1, 2, 0, 3):
                steps, cases = np.nonzero(
                    rates[:-1] * rates[1:] < 0.0
                )  # in between it comes nearest, or goes farthest
                if len(cases):
                    slopes = (
                        rates[steps + late, cases] * piece.duration[cases] / count
                        for late in (0, 1)
                    )
                    way = _extreme(cosines[steps + 1, cases] - cosines[steps, cases], *slopes)
                    self._record(piece.at((steps + way) / count, cases), cases)
        self._record(here, ...)

    def _record(self, here: MotionStretch, cases: Any) -> None:
        """Record the angles of some of the observed cases at one instant."""
        for number, (x, y, z) in enumerate(self._seen(here, cases)):
            angles = np.arctan2(np.hypot(x, y), self.sense * z)
            self._take(number, angles, angles, cases)

    def _look(self, here: MotionStretch) -> list[tuple[Array, Array]]:
        """Cosine of each angle, and the rate, 1/s, at which it rises: the axis comes nearer."""
        (first, second, _), growth = here.rates, here.bodies.forcing.growth
        looks: list[tuple[Array, Array]] = []
        for number, seen in enumerate(self._seen(here, ...)):
            rate = second * seen[0] - first * seen[1]  # of e3, by ω × e3
            if growth != 0.0 or number == self.momentum:
                momentum = here.bodies.momentum(here.rates)
                size = np.sqrt(np.sum(momentum * momentum, axis=0))
                along = momentum[2] / size
                A = 0.5 * (here.bodies.moments[0] + here.bodies.moments[1])
                forcing = here.bodies.forcing
                by_body, by_wheel = damper(
                    A, here.bodies.moments[2], forcing.wheel, size, forcing.sense
                )
                pace = growth * (by_body * along + by_wheel)
            if growth != 0.0:  # the axis leaves H at θ' = κ sin θ (u cos θ + v)
                rate = rate + pace * (along * seen[2] - np.sum(momentum * seen, axis=0) / size)
            if number == self.momentum:  # which turns at the torque across it, over |H|
                torque = _torque(here)
                rate = rate + (torque[2] - np.sum(torque * seen, axis=0) * along) / size
            looks.append((self.sense * seen[2], self.sense * rate))
        return looks

    def _seen(self, here: MotionStretch, cases: Any) -> Iterator[Array]:
        """Directions (3, n) in body axes, of some of the observed cases."""
        back = here.quaternion * BACK
        for number, directions in enumerate(self.directions[:, :, self.rows]):
            if number == self.momentum:
                momentum = here.bodies.momentum(here.rates)
                yield momentum / np.sqrt(np.sum(momentum * momentum, axis=0))
            else:
                yield np.array(turned(back, directions[:, cases]))

    def _towards(self, momentum: Array) -> Iterator[Array]:
        """Directions (3, n) of the observed cases, whose H is along the unit vectors ``momentum``
        (3, n).
        """
        for number, directions in enumerate(self.directions[:, :, self.rows]):
            yield momentum if number == self.momentum else directions


def _extreme(rise: Array, before: Array, after: Array) -> Array:
    """Level point of a cubic from 0 to 1 that gains a ``rise``, with slopes ``before`` and
    ``after`` of either sign.
    """
    square = 3.0 * (before + after - 2.0 * rise)
    linear = 6.0 * rise - 4.0 * before - 2.0 * after
    root = np.sqrt(np.maximum(linear * linear - 4.0 * square * before, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        level = 2.0 * before / (np.copysign(root, before) - linear)
    return np.where((level >= 0.0) & (level <= 1.0), level, before / (before - after))


def _torque(here: MotionStretch) -> Array:
    """Torque (3, n) N m of pulses and disturbances on bodies at the time of ``here``,
    in body axes.
    """
    turning = sum(
        (size * np.exp(1j * rate * here.since) for size, rate in here.bodies.forcing.turning),
        0.0 * here.since,
    )
    lasting = np.array([turning.real, turning.imag, 0.0 * here.since])
    lasting += here.bodies.constant.reshape(3, -1)
    return lasting if here.torque is None else lasting + here.torque


def _momentum(here: MotionStretch) -> Array:
    """Size (n,) of H, N m s."""
    return np.asarray(np.sqrt(np.sum(here.bodies.momentum(here.rates) ** 2, axis=0)))


HALF = 1.01 * math.pi  # rad: a Sun pulse farther off than half a turn is lost
ITERATIONS = 40  # largest number of Newton steps to a Sun pulse; three or four are usual
SLOW = 0.01  # rate of the Sun's azimuth over its mean rate below which Newton's steps take the mean
EXACT = 1e-13  # tolerance of the time of a Sun pulse, in spin turns
# largest number of Sun pulses skipped between two computed ones; the mean rate predicts the next
AHEAD = 8


class TorqueRamp(NamedTuple):
    """Torque that runs linearly from ``first`` (3, n) N m at ``begin`` s to ``last`` at ``end``;
    times (n,) or one.
    """

    begin: Any
    end: Any
    first: Array
    last: Array


class SunPulseClock:
    """Motion of bodies from Sun pulse to Sun pulse, which count from 1, the first after t = 0.

    ``sun`` (3, n) are inertial unit vectors, ``azimuth`` rad is that of the sensor about axis 3
    from axis 1, ``sense`` the sign of the spin. ``mount`` (3, 3, n) takes vectors in body axes to
    those in which the sensor has its place; None: they are the same. ``time`` (n,) s is that of the
    last computed Sun pulse; there was none where ``lost`` (n,): the Sun is too near to the axis to
    go round. ``over`` (n,) s: end of the last pulse, command and thrust.
    """

    def __init__(
        self,
        start: MotionStretch,
        sun: Array,
        sense: float,
        azimuth: float,
        mount: Array | None = None,
    ) -> None:
        self.sun = sun if mount is None else np.vstack([sun, mount.reshape(9, -1)])
        self.azimuth, self.sense = azimuth, sense
        self._stretches = [start]
        self._latest = start  # motion from which the next Sun pulse is looked for
        self.over = start.since
        ahead, _ = self._ahead(start, self.sun)
        # as if one had come before t = 0
        self._number = 0
        self._sun_pulse = start
        self._fired_at = self._earlier = 0
        self.time = start.since + (ahead - CIRCLE) / self._pace
        self.lost = np.zeros(len(start.since), dtype=bool)

    @property
    def here(self) -> MotionStretch:
        """Motion since the end of the last pulse."""
        return self._stretches[-1]

    @property
    def passed(self) -> Iterator[tuple[MotionStretch, Array]]:
        """Stretches from the end of the last pulse but one to that of the last,
        each with its end.
        """
        stretches = self._stretches[self._earlier :]
        return zip(stretches, (stretch.since for stretch in stretches[1:]), strict=False)

    def fire(
        self,
        sun_pulse: MotionStretch,
        delay: Array,
        width: float,
        pushes: Sequence[TorqueRamp],
        sheds: Array | None,
    ) -> Array:
        """Fire a command of ``width`` s, ``delay`` (n,) s after the last Sun pulse, ``sun_pulse``.

        ``pushes`` are its torques, s after its start; the moments fall by ``sheds`` (3, n) kg m²,
        half as the first begins. Returns the starts (n,) s of the commands: not before the end of
        the previous pulse.
        """
        before = self.here
        # What was fired after the same Sun pulse is kept: the next Sun pulse may come before it.
        earlier = self._stretches[:-1] if self._fired_at == self._number else []
        half = None if sheds is None else 0.5 * sheds
        starts: Array = np.maximum(sun_pulse.since + delay, self.over)
        self.over = starts + reduce(np.maximum, (push.end for push in pushes), width)
        if not pushes:
            return starts
        begun = sun_pulse.moved(starts + pushes[0].begin)
        late = np.flatnonzero(
            sun_pulse.since < before.since
        )  # it came while the pulse before was on
        if len(late):
            begun.rates[:, late], begun.quaternion[:, late] = before.some(late).moved(
                begun.since[late]
            )[2:4]
        begun = begun._replace(bodies=before.bodies.lighter(half))
        self._stretches = [*earlier, before]
        self._earlier, self._fired_at = len(earlier), self._number
        for push in pushes:
            length = np.where(push.end - push.begin == 0.0, 1.0, push.end - push.begin)
            slope = (
                None if np.array_equal(push.first, push.last) else (push.last - push.first) / length
            )
            firing = begun._replace(since=starts + push.begin, torque=push.first, slope=slope)
            begun = firing.moved(starts + push.end)._replace(torque=None, slope=None)
            self._stretches.append(firing)
        self._stretches.append(begun._replace(bodies=begun.bodies.lighter(half)))
        self._latest = self.here
        return starts

    def sun_pulse(self, number: int) -> MotionStretch:
        """Motion at the Sun pulse of this ``number``, if nothing is fired before; numbers must not
        decrease.
        """
        stretch = self._sun_pulse
        while self._number < number:
            step = min(number - self._number, AHEAD)
            pace, (ahead, _) = self._pace, self._ahead(self.here, self.sun)
            passed = np.rint((pace * (self.here.since - self.time) + ahead) / CIRCLE)
            expected = self.here.since + (ahead + CIRCLE * (step - passed)) / pace
            stretch = self._root(self._latest.moved(expected), pace, self.sun, ~self.lost)
            self._look_back(stretch, expected, pace)
            off, rate = self._off(stretch, self.sun)
            astray = np.abs(stretch.since - expected) * pace > math.pi
            self.lost |= astray | (rate <= 0.0) | ~(np.abs(off) < 1e-6)
            self._number = self._number + step
            self._sun_pulse = stretch
            self.time = stretch.since
            # From one Sun pulse to the next: seen one by one, each from the end of the last pulse
            # on, they took steps of integration by the square of their number.
            if np.all((stretch.since >= self.here.since) | self.lost):
                self._latest = stretch
        return stretch

    def turning(self, angle: Array) -> Array:
        """Time (n,) s in which the Sun turns by an ``angle`` (n,) rad from the last Sun pulse on,
        if nothing more is fired.
        """
        since: Array = self._sun_pulse.since
        if not np.any(angle):
            return np.zeros(len(since))
        pace = self._pace
        expected = np.maximum(since + angle / pace, self.here.since)
        turned = self._root(
            self.here.moved(expected), pace, self.sun, (angle > 0.0) & ~self.lost, angle
        )
        return np.asarray(np.where(angle > 0.0, turned.since - since, 0.0))

    def angle(self, here: MotionStretch) -> Array:
        """Angle between spin axis and Sun, (n,) rad."""
        axis = np.array(turned(here.quaternion, AXIS))
        if len(self.sun) > 3:
            axis = rotate(here.quaternion.T, self.sun[9:].T).T
        return np.asarray(angle_of_parts(self.sense * axis, self.sun[:3]))

    @property
    def _pace(self) -> Array:
        """Mean rate (n,) rad/s of the Sun in the free body: |H|/A about H, and ω3 - H3/A about the
        axis.
        """
        first, second, _ = self.here.bodies.moments
        A = 0.5 * (first + second)
        momentum = self.here.bodies.momentum(self.here.rates)
        return np.asarray(
            np.abs(self.sense * _momentum(self.here) / A + self.here.rates[2] - momentum[2] / A)
        )

    def _look_back(self, sun_pulse: MotionStretch, expected: Array, pace: Array) -> None:
        """Recompute in place the Sun pulses that came before the end of the last pulse."""
        for stretch, over in zip(self._stretches[-2::-1], self._stretches[:0:-1], strict=True):
            cases = np.flatnonzero((sun_pulse.since < over.since) & ~self.lost)
            if not len(cases):
                return
            start = stretch.some(cases).moved(np.minimum(expected, over.since)[cases])
            again = self._root(start, pace[cases], self.sun[:, cases])
            for whole, part in zip(sun_pulse[1:4], again[1:4], strict=True):
                whole[..., cases] = part

    def _root(
        self,
        start: MotionStretch,
        pace: Array,
        sun: Array,
        wanted: NDArray[np.bool_] | None = None,
        angle: Array | None = None,
    ) -> MotionStretch:
        """Motion as the Sun passes the sensor, or an ``angle`` (n,) rad behind it, at the time
        nearest to that of ``start``: by Newton's method, of those ``wanted`` (n,), default all.
        """
        here = start
        behind = 0.0 * start.since if angle is None else angle
        count = len(start.since)
        pending = np.ones(count, dtype=bool) if wanted is None else wanted.copy()
        # A pulse more than half a turn off is lost. Under thrust Newton's steps may go on for
        # hundreds of radians: a plan of blocks took 75 s so, and 15 s within a turn.
        low, high = start.since - HALF / pace, start.since + HALF / pace
        begun, ended = np.zeros((2, count), dtype=bool)  # where the motion at low, high is known
        for _ in range(ITERATIONS):
            rows = np.flatnonzero(pending)
            if not len(rows):
                break
            # Few that take long, as at an end of that turn, do not keep the others.
            few = 2 * len(rows) < count
            rows = rows if few else np.arange(count)
            some = here.some(rows) if few else here
            off, rate = self._off(some, sun[:, rows], behind[rows])
            apart = np.abs(off) >= CIRCLE * EXACT
            later = off > 0.0
            low[rows] = np.where(later, some.since, low[rows])
            high[rows] = np.where(later, high[rows], some.since)
            begun[rows] |= later
            ended[rows] |= ~later
            # Where the Sun is near the axis its azimuth may not change for a moment: then by the
            # mean rate, and by no more than a quarter turn, for beyond half a turn it is another
            # passage that is off by less. Where it turns back Newton's steps go to and fro for
            # ever: bisection ends.
            step = off / np.where(rate > SLOW * pace[rows], rate, pace[rows])
            quarter = 0.5 * math.pi / pace[rows]
            time = some.since + np.clip(step, -quarter, quarter)
            time = np.clip(time, low[rows], high[rows])
            stuck = np.where(
                later, ended[rows] & (time == high[rows]), begun[rows] & (time == low[rows])
            )
            time = np.where(apart & stuck, 0.5 * (low[rows] + high[rows]), time)
            moved = some.moved(time)
            pending[rows] &= apart & (moved.since != some.since)
            if few:
                for whole, part in zip(here[1:4], moved[1:4], strict=True):
                    whole[..., rows] = part
            else:
                here = moved
        return here

    def _off(
        self, here: MotionStretch, sun: Array, behind: Array | float = 0.0
    ) -> tuple[Array, Array]:
        """Angle (n,) in [-π, π) by which the body has to turn until the Sun is ``behind`` the
        sensor by that angle, rad, and its rate.
        """
        ahead, rate = self._ahead(here, sun)
        return (ahead + behind + math.pi) % CIRCLE - math.pi, rate

    def _ahead(self, here: MotionStretch, sun: Array) -> tuple[Array, Array]:
        """`_off` in [0, 2π)."""
        return ahead(here.rates, here.quaternion, sun, self.azimuth, self.sense)


def sun_direction(days: float) -> Array:
    """Geocentric unit vector (3,) to the apparent Sun in the mean equator and equinox of J2000.0.

    ``days`` since J2000.0 (2000-01-01T12:00 TT). To 0.01 deg from 1972 to 2100. By J. Meeus,
    Astronomical Algorithms, 2nd ed., chapter 25, "low accuracy", with aberration, taken to ecliptic
    and equinox of J2000.0 (21).
    """
    centuries = days / 36525.0
    mean_longitude = 280.46646 + centuries * (36000.76983 + centuries * 0.0003032)
    anomaly = math.radians(357.52911 + centuries * (35999.05029 - centuries * 0.0001537))
    eccentricity = 0.016708634 - centuries * (0.000042037 + centuries * 0.0000001267)
    centre = (
        (1.914602 - centuries * (0.004817 + centuries * 0.000014)) * math.sin(anomaly)
        + (0.019993 - centuries * 0.000101) * math.sin(2.0 * anomaly)
        + 0.000289 * math.sin(3.0 * anomaly)
    )
    seen = centre - ABERRATION * (1.0 + eccentricity * math.cos(anomaly + math.radians(centre)))
    longitude = math.radians(mean_longitude + seen - centuries * (1.396971 + centuries * 0.0003086))
    latitude = centuries * TILTING * math.sin(longitude - NODE)
    x = math.cos(latitude) * math.cos(longitude)
    y = math.cos(latitude) * math.sin(longitude)
    z = math.sin(latitude)
    cosine = math.cos(OBLIQUITY)
    sine = math.sin(OBLIQUITY)
    return np.array([x, cosine * y - sine * z, sine * y + cosine * z])


def ahead(
    rates: Array, quaternion: Array, sun: Array, azimuth: float, sense: float
) -> tuple[Array, Array]:
    """Angle (n,) in [0, 2π) by which bodies have to turn until the Sun passes the sensor, and its
    rate, rad/s.

    ``rates`` (3, n) rad/s, ``quaternion`` (4, n) body -> inertial; the others are those of a
    `SunPulseClock`, ``sun`` (3, n) or with the mount below it (12, n).
    """
    s1, s2, s3 = turned(quaternion * BACK, sun[:3])  # as the body sees it
    first, second, third = rates
    if len(sun) > 3:
        mount = sun[3:].reshape(3, 3, -1)
        s1, s2, s3 = np.einsum("kan,an->kn", mount, np.array([s1, s2, s3]))
        first, second, third = np.einsum("kan,an->kn", mount, rates)
    turning = s1 * (s3 * first - s1 * third) - s2 * (s2 * third - s3 * second)  # ds/dt = s × ω
    return sense * (np.arctan2(s2, s1) - azimuth) % (2.0 * math.pi), -sense * turning / (
        s1 * s1 + s2 * s2
    )
