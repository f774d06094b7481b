"""Thruster: valve response (thrust, impulse, centroid), nozzle temperature, tank in blowdown.

Times are in s after the start of the command; thrust is counted in full thrust, so that an impulse
is a time, the
*effective on-time*: that of a rectangular pulse about the centroid with the same impulse and first
  moment.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.numerics import TINY, gauss_legendre


def possible(tank: Tank) -> Any:
    """True if the tank is possible: one value, or by case."""
    falls = (tank.final_pressure > 0.0) & (tank.final_pressure <= tank.pressure)
    return falls & (tank.propellant > 0.0) & (tank.exponent >= 0.0)


@dataclass(frozen=True, slots=True)
class Cold:
    """Cold nozzle; the first two may be arrays, of cases."""

    first: Any  # thrust of the first pulse of each channel over that of a warm one
    pulses: Any  # over which that decays to 1
    fired: Mapping[str, int] = field(default_factory=dict)  # pulses by channel before t = 0

    def factor(self, before: Any) -> Any:
        """Thrust factor of the pulse after ``before`` others: 1 - (1 - first) exp(-k/pulses)."""
        return 1.0 - (1.0 - self.first) * self.decay(before)

    def decay(self, before: Any) -> Any:
        """Remaining difference to a warm nozzle, over that of the first pulse."""
        lasts = -before / self.pulses
        return np.exp(lasts) if np.ndim(lasts) else math.exp(lasts)


SETTLED, REPEATS = (
    1e-7,
    20,
)  # relative step after which Newton's next one is below a rounding, and most steps


@dataclass(frozen=True, slots=True)
class Tank:
    """Tank in blowdown; the first four may be arrays, of cases."""

    propellant: Any  # kg
    pressure: Any  # Pa, when full
    final_pressure: Any  # Pa, with nothing left
    exponent: Any  # power of the pressure that the thrust goes with
    isp: tuple[tuple[float, float], ...] | None = (
        None  # rows of pressure, Pa, rising, and s; None: of the thrusters
    )
    used: float = 0.0  # kg, before t = 0
    inertia_per_kg: tuple[float, float, float] | None = (
        None  # kg m² by which I1, I2, I3 fall for each kg used
    )

    @property
    def doubled(self) -> Tank:
        """Tank with twice the propellant and the same fall of pressure, continued."""
        low = self.pressure / (2.0 * self.pressure / self.final_pressure - 1.0)
        return replace(self, propellant=2.0 * self.propellant, final_pressure=low)

    def pressure_after(self, used: Any) -> Any:
        """Gas pressure (Pa) after ``used`` kg, at most all of it: one number or an array.

        At constant temperature it expands from V0 to V0 + used/density, and final/initial pressure
        is V0/(V0 + propellant/density): p = p0/(1 + (p0/p1 - 1) used/propellant).
        """
        used = np.minimum(used, self.propellant)
        return self.pressure / (
            1.0 + (self.pressure / self.final_pressure - 1.0) * used / self.propellant
        )

    def thrust_factor(self, used: Any) -> Any:
        """Thrust over that of a full tank."""
        return (self.pressure_after(used) / self.pressure) ** self.exponent

    def burn(self, used: Any, flow: Any, time: Any) -> tuple[Any, Any]:
        """Propellant (kg) of ``time`` s of full thrust after ``used`` kg, and its mean thrust over
        that of a full tank.

        ``flow`` is that of a full tank, kg/s, times the specific impulse where the tank has it.
        With p = p0/(1 + κu/U), κ = p0/p1 - 1, and the thrust as its power x, (1 + κu/U)^(x+1) grows
        linearly in time, past the last kg too.
        """
        if self.isp is not None:
            return self._burn(used, flow * time)
        full = self.pressure / self.final_pressure - 1.0
        power = self.exponent + 1.0
        grown = 1.0 + full * np.minimum(used, self.propellant) / self.propellant
        level = grown ** (-self.exponent)
        rise = power * full * flow * level * time / (grown * self.propellant)
        still = rise == 0.0  # ((1 + rise)^(1/power) - 1) power/rise, 1 at 0
        safe = np.where(still, 1.0, rise)
        share = np.where(still, 1.0, np.expm1(np.log1p(safe) / power) * power / safe)[()]
        return flow * level * time * share, level * share

    def _burn(self, used: Any, given: Any) -> tuple[Any, Any]:
        """`burn` with the specific impulses of the table; ``given`` is the flow times the time.

        That is the integral over the propellant m of I(m)/F(m), specific impulse over thrust, and
        the thrust that acts the integral of I(m) over the same: of m/given by Newton's method.
        """
        speed, (nodes, weights) = (
            self.thrust_factor(used) / self.isp_after(used),
            gauss_legendre(NODES),
        )
        first = (-1, *[1] * np.ndim(speed * given))
        along, weights = (
            np.append(0.5 * (1.0 + nodes), 1.0).reshape(first),
            weights.reshape(first),
        )  # and the end
        for _ in range(REPEATS):
            pressure = self.pressure_after(used + speed * given * along)
            slowness = self._isp_at(pressure) / (pressure / self.pressure) ** self.exponent
            step = (0.5 * speed * (weights * slowness[:-1]).sum(axis=0) - 1.0) / slowness[-1]
            speed = speed - step
            if np.all(np.abs(step) <= SETTLED * np.abs(speed)):
                break
        isp = self.isp_after(used + speed * given * along[:-1])
        return speed * given, 0.5 * speed * (weights * isp).sum(axis=0)

    def share(self, used: Any, more: Any) -> Any:
        """Fraction fired of a pulse that takes ``more`` kg after ``used``: 1, or as far as the
        propellant lasts.
        """
        left = np.maximum(self.propellant - used, 0.0)
        lasts = more <= left
        return np.where(lasts, 1.0, left / np.where(lasts, 1.0, more))[()]

    def isp_after(self, used: Any) -> Any:
        """Specific impulse, s; None where the thrusters have their own."""
        return None if self.isp is None else self._isp_at(self.pressure_after(used))

    def _isp_at(self, pressure: Any) -> Any:
        """Specific impulse of the table, s."""
        pressures, values = zip(*self.isp or (), strict=True)
        return np.interp(pressure, pressures, values)


Array = NDArray[np.float64]

# nodes of Gauss-Legendre quadrature in a stretch of at most `REACH` rad: it errs by less than a
# rounding
NODES = 16

REACH = 2.0


class Ramp(NamedTuple):
    """Thrust that runs linearly from level ``first`` at ``begin`` s to ``last`` at ``end`` s; 1 is
    full thrust.
    """

    begin: float
    end: float
    first: float
    last: float

    @property
    def impulse(self) -> float:
        """Impulse over full thrust, s."""
        return 0.5 * (self.first + self.last) * (self.end - self.begin)


class Thrust(NamedTuple):
    """Response to a command: the effective ``on_time`` s about the ``centroid`` s, by the ``ramps``
    of the thrust.
    """

    on_time: float
    centroid: float
    ramps: tuple[Ramp, ...]


NOTHING = Thrust(0.0, 0.0, ())


class Opened(NamedTuple):
    """Thrust that rises, stays at a ``level`` and falls between four ``corners``, s: numbers, or
    arrays of cases.
    """

    corners: tuple[Any, Any, Any, Any]
    level: Any

    @property
    def pieces(self) -> tuple[tuple[Any, Any, Any, Any], ...]:
        """Start, length (s), mean level and lean to either side of rise, full thrust and fall."""
        first, second, third, last = self.corners
        half = 0.5 * self.level
        return (
            (first, second - first, half, 1.0),
            (second, third - second, self.level, 0.0),
            (third, last - third, half, -1.0),
        )

    def within(self, middle: Any, time: Any) -> Any:
        """Level at ``time`` s, an edge of a stretch about ``middle`` s without a corner in it."""
        first, second, third, last = self.corners
        rising = self.level * (time - first) / np.where(second == first, 1.0, second - first)
        falling = self.level * (last - time) / np.where(last == third, 1.0, last - third)
        inside = np.where(middle < second, rising, np.where(middle > third, falling, self.level))
        return np.where((middle <= first) | (middle >= last), 0.0, inside)

    @property
    def acts(self) -> tuple[Any, Any, Any]:
        """`action` of its pieces."""
        return action(
            [
                (begin, begin + length, level * (1.0 - lean), level * (1.0 + lean))
                for begin, length, level, lean in self.pieces
            ]
        )


def action(ramps: Sequence[tuple[Any, Any, Any, Any]]) -> tuple[Any, Any, Any]:
    """Effective on-time, centroid and spread, s, of thrust by its ``ramps`` (as of `Ramp`), numbers
    or arrays; without thrust the centroid is the begin of the first.

    The spread is the length of the rectangular pulse with the same second moment about the centroid
    for its impulse.
    """
    if not ramps:
        return 0.0, 0.0, 0.0
    pieces = []
    for begin, end, first, last in ramps:
        length = end - begin
        double = first + last + TINY
        middle = begin + length * (first + 2.0 * last) / (3.0 * double)
        own = length**2 * (1.0 + 2.0 * (first / double) * (last / double)) / 18.0
        pieces.append((0.5 * length * double, middle, own))
    total = sum(area for area, _, _ in pieces)
    whole = total + TINY
    centroid = (sum(area * middle for area, middle, _ in pieces) + TINY * ramps[0][0]) / whole
    parts = (area * (own + (middle - centroid) ** 2) for area, middle, own in pieces)
    return total, centroid, (12.0 * sum(parts) / whole) ** 0.5


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """Valve with linear rise and fall of the thrust: a triangle where it closes before full thrust
    is reached.
    """

    open_delay: float = 0.0  # s from the start of the command until the thrust rises
    close_delay: float = 0.0  # s from its end until the thrust falls
    rise_time: float = 0.0  # s to full thrust
    fall_time: float = 0.0  # s from full thrust to nothing
    effective: bool = False  # on-times are loaded as effective ones

    @property
    def known(self) -> tuple[float, float]:
        """Shortest and longest on-time (s) with known response: any."""
        return 0.0, math.inf

    def thrust(self, on_time: float) -> Thrust:
        """Response to a command of ``on_time`` s,
        from the areas and first moments of its pieces.
        """
        command = self._command(on_time) if self.effective else on_time
        opened = (
            command + self.close_delay - self.open_delay
        )  # from the first thrust to the beginning of its fall
        if opened <= 0.0 or on_time <= 0.0:
            return NOTHING
        level = 1.0 if opened >= self.rise_time else opened / self.rise_time
        ends = (0.0, level * self.rise_time, opened, opened + level * self.fall_time)
        corners = [self.open_delay + end for end in ends]
        spans = pairwise(zip(corners, (0.0, level, level, 0.0), strict=True))
        ramps = [
            Ramp(begin, end, first, last) for (begin, first), (end, last) in spans if end > begin
        ]
        effective, centroid, _ = action(ramps)
        return Thrust(effective, centroid, tuple(ramps))

    def opened(
        self, on_time: float, open_delay: Any, close_delay: Any, rise_time: Any, fall_time: Any
    ) -> Opened:
        """Response to a command with the four times longer by so much, s, elementwise."""
        command = self._command(on_time) if self.effective else on_time
        opens, rise, fall = (
            self.open_delay + open_delay,
            self.rise_time + rise_time,
            self.fall_time + fall_time,
        )
        held = command + self.close_delay + close_delay - opens
        held = np.maximum(held, 0.0)
        level = np.where(held < rise, held / np.where(rise == 0.0, 1.0, rise), held > 0.0)
        return Opened(
            (opens, opens + level * rise, opens + held, opens + held + level * fall), level
        )

    def on_time_for(self, effective: float) -> float:
        """On-time (s) of the command that acts like full thrust for ``effective`` s."""
        return effective if self.effective else self._command(effective)

    def _command(self, effective: float) -> float:
        """Length (s) of the command that gives full thrust for ``effective`` s.

        With full thrust: effective = τ + close - open + (fall - rise)/2, else (rise + fall)/2 ×
        level².
        """
        rise, fall = self.rise_time, self.fall_time
        corner = 0.5 * (rise + fall)
        if effective >= corner:
            opened = effective - 0.5 * (fall - rise)
        else:
            opened = rise * math.sqrt(max(effective, 0.0) / corner)
        return opened + self.open_delay - self.close_delay

    def reaches(self, shortest: float, longest: float) -> tuple[float, float]:
        """Bounds (s) of lead and lag of commands that act from ``shortest`` to ``longest`` s of
        full thrust.

        The lead is the time from the start of the command to that of the effective pulse, the lag
        that from the end of the effective pulse until command and thrust are over. With full thrust
        the lead is open + rise/2 + (fall² - rise²)/(24 × effective), the lag mirrors it; a triangle
        of level h has open + h(2 rise + fall)/3 - h²(rise + fall)/4. Both are monotone but for one
        maximum.
        """
        rise, fall = self.rise_time, self.fall_time
        corner = 0.5 * (rise + fall)
        peaks = []
        if corner > 0.0:
            tops = (
                2.0 * (2.0 * rise + fall) / (6.0 * corner),
                2.0 * (rise + 2.0 * fall) / (6.0 * corner),
            )
            peaks = [corner * min(top, 1.0) ** 2 for top in tops]
        places = [
            shortest,
            longest,
            *(min(max(peak, shortest), longest) for peak in (corner, *peaks)),
        ]
        leads, lags = [], []
        for place in places:
            if not 0.0 < place < math.inf:
                leads.append(self.open_delay + (0.5 * rise if place else 0.0))
                lags.append(0.5 * fall if place else 0.0)
                continue
            thrust = self.thrust(self.on_time_for(place))
            if thrust.ramps:
                leads.append(thrust.centroid - 0.5 * thrust.on_time)
                lags.append(thrust.ramps[-1].end - thrust.centroid - 0.5 * thrust.on_time)
        return max(leads, default=0.0), max(lags, default=0.0)


@dataclass(frozen=True, slots=True)
class Measured:
    """Valve by a table of tests: ``rows`` of on-time, effective on-time and centroid, s, each
    rising.

    Linear between the rows, unknown outside. The thrust is taken as full for the effective on-time
    about the centroid.
    """

    rows: tuple[tuple[float, float, float], ...]

    @property
    def known(self) -> tuple[float, float]:
        """First and last on-time of the table, s."""
        return self.rows[0][0], self.rows[-1][0]

    def thrust(self, on_time: float) -> Thrust:
        """Response to a command of ``on_time`` s; outside the table, that at its end."""
        effective, centroid = (self._between(0, on_time, column) for column in (1, 2))
        begin = centroid - 0.5 * effective
        return Thrust(effective, centroid, (Ramp(begin, begin + effective, 1.0, 1.0),))

    def on_time_for(self, effective: float) -> float:
        """On-time (s) of the command that acts like full thrust for ``effective`` s; the nearest in
        the table.
        """
        return self._between(1, effective, 0)

    def opened(self, on_time: float, factor: Any) -> Opened:
        """Response, not before the command, with all impulses of the table ``factor`` times as
        large, elementwise.
        """
        effective, centroid = (self._between(0, on_time, column) for column in (1, 2))
        begin = np.maximum(centroid - 0.5 * effective * factor, 0.0)
        end = begin + effective * factor
        return Opened((begin, begin, end, end), 1.0)

    def _between(self, known: int, value: float, sought: int) -> float:
        """Column ``sought`` where the column ``known`` has ``value``."""
        places = [row[known] for row in self.rows]
        value = min(max(value, places[0]), places[-1])
        row = min(max(bisect_right(places, value) - 1, 0), len(places) - 2)
        share = (value - places[row]) / (places[row + 1] - places[row])
        low, high = self.rows[row][sought], self.rows[row + 1][sought]
        return low + share * (high - low) if share < 1.0 else high

    def reaches(self, shortest: float, longest: float) -> tuple[float, float]:
        """Bounds (s) of lead and lag, see `Trapezoid.reaches`: both linear between the rows."""
        places = [shortest, longest, *(row[1] for row in self.rows if shortest < row[1] < longest)]
        ramps = [
            (on_time, self.thrust(on_time).ramps[0]) for on_time in map(self.on_time_for, places)
        ]
        lags = (max(on_time - ramp.end, 0.0) for on_time, ramp in ramps)
        return max(ramp.begin for _, ramp in ramps), max(lags)


Valve = (
    Trapezoid | Measured
)  # map from commands to thrust. Times of commands are on-times as they are loaded.


def shape_factor(
    rate: float,
    change: float,
    ramps: Sequence[Ramp],
    centroid: float,
    growth: float = 0.0,
    drift: float = 0.0,
) -> complex:
    """Factor on the impulse at the ``centroid`` for the effect of a shaped pulse on ω: see
    `response.width_factor`.

    F = (1/E) ∫ f(t) exp(i (rate (t - t_c) + drift (t² - t_c²)/2 + change ∫∫ f) - κ (t - t_c)) dt
    with the thrust f of the ``ramps``, their impulse E, and times from the start of the first: with
    the whole spin change at the centroid the body turns by the end as far as it does. ``rate`` is ν
    as the first begins, rad/s, ``change`` its derivative under the full axial torque.
    """
    nodes, weights = gauss_legendre(NODES)
    origin = ramps[0].begin
    centre = centroid - origin
    # ∫ f exp, ∫ f, ∫∫ f up to here
    total = 0.0 + 0.0j
    given = 0.0
    turned = 0.0
    for ramp in ramps:
        length = ramp.end - ramp.begin
        slope = (ramp.last - ramp.first) / length
        pace = abs(rate) + (abs(change) + abs(drift)) * (ramp.end - origin) + abs(growth)
        panels = min(max(math.ceil(pace * length / (2.0 * REACH)), 1), 20_000)
        half = 0.5 * length / panels
        s = ((2.0 * np.arange(panels)[:, None] + 1.0) * half + half * nodes).ravel()
        time = ramp.begin - origin + s
        level = ramp.first + slope * s
        swept = turned + given * s + 0.5 * ramp.first * s**2 + slope * s**3 / 6.0
        phase = rate * (time - centre) + 0.5 * drift * (time**2 - centre**2) + change * swept
        total += half * complex(
            np.exp(1j * phase - growth * (time - centre)) * level @ np.tile(weights, panels)
        )
        turned += given * length + 0.5 * ramp.first * length**2 + slope * length**3 / 6.0
        given += ramp.impulse
    return total / given
