"""Prediction of telemetry from parameters: closed forms for coasts, the flight where pulses were fired.

A coast of a symmetric body is that of `energy_sink`, of three different moments that of `triaxial`; where there are
pulses, disturbances, or dissipation of three moments, it is `flight.flown`. What an accelerometer feels is
`loop.sensor.felt`, when the Sun passes a sensor `sky.ahead`.

Transverse moments that differ are A[[1 + e1, e2], [e2, 1 - e1]] about the axes 1 and 2 of the file's principal axes:
regular at e = 0, where principal axes are any.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.control_loop.sensor import felt, is_blind
from nutdamp.errors import BadRequest, Infeasible, Unsuitable
from nutdamp.estimation.parameters import (
    ACCELERATION,
    AXIS,
    GYROS,
    SUN_PULSE,
    Parameter,
    Record,
    in_moments,
    parameters,
    prior,
)
from nutdamp.flight.dynamics import Arc, Dynamics, FreeCoast, Path, Push, make_dynamics
from nutdamp.flight.propagation import Flight, flown
from nutdamp.physics import attitude, energy_sink, sky, triaxial
from nutdamp.physics.taylor import Forcing
from nutdamp.spacecraft.equipment import ACCELEROMETER
from nutdamp.spacecraft.model import Attitude, Inertia, Spacecraft, SpinState
from nutdamp.spacecraft.schedule import Pulse, Schedule

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Values = Mapping[str, float]

PREDICTION, SHOWN, SAMPLE = 0.1, 2e-4, 1e-3
"""Units of `work` of a prediction, of each sample, and of each time of a motion that is new, besides steps."""

POLHODE = 0.8
"""Units of a coast of three moments between pulses."""

OF_SENSORS = ("bias", "misalignment", "wobble")
"""Beginnings of the names of parameters that change nothing of the motion."""


@dataclass(frozen=True, eq=False)
class Body:
    """The body that parameters describe: its ``state`` at the start of the record in its own principal axes.

    ``moments`` (I1, I2, I3) kg m², ``axes`` (3, 3) its principal axes in those of the file, as columns.
    """

    moments: tuple[float, float, float]
    axes: Matrix
    state: SpinState
    growth: float

    @property
    def symmetric(self) -> bool:
        """True where I1 = I2."""
        return self.moments[0] == self.moments[1]


class Model:
    """Predictor of a record of a spacecraft.

    ``parameters`` are estimated; ``measured`` (m,) are the samples that there are, signal by signal, ``signals`` their
    names and ``signal`` (m,) which of them each is; ``times`` (m,) s when. Raises BadRequest where the spacecraft
    file lacks what a signal needs.
    """

    def __init__(
        self, spacecraft: Spacecraft, record: Record, *, unequal: bool | None = None, growing: bool = True
    ) -> None:
        """``unequal``: with I1 ≠ I2, as the file has it where that is not said; ``growing``: κ is estimated."""
        _expect_described(spacecraft, record)
        self.spacecraft, self.record = spacecraft, record
        self.unequal = not spacecraft.inertia.symmetric if unequal is None else unequal
        self.start = record.start
        self._last: tuple[tuple[tuple[str, float], ...], tuple[Vector, Vector]] | None = None
        self.parameters = parameters(spacecraft, record, unequal=self.unequal, growing=growing)
        self.prior = prior(spacecraft, self.parameters)
        self.pulses = self._pulses()
        parts = list(self._parts())
        if not parts:
            raise Infeasible("the record has no samples")
        self.signals = tuple(name for name, *_ in parts)
        self.measured = np.concatenate([values for _, _, values in parts])
        self.times = np.concatenate([times for _, times, _ in parts])
        self.signal = np.repeat(np.arange(len(parts)), [len(values) for *_, values in parts])

    @cached_property
    def reference(self) -> SpinState:
        """The motion at the start of the record as the file has it."""
        inertia = self.spacecraft.inertia
        body = Body(inertia.moments, inertia.axes, self.spacecraft.initial, self.spacecraft.growth)
        # As if the record began at t = 0; a file's disturbances are too small to turn it much before.
        rates, quaternion = _coast(body).motion(np.array([self.start]))
        return SpinState(complex(rates[0, 0], rates[0, 1]), float(rates[0, 2]), quaternion[0])

    def parameter(self, name: str) -> Parameter | None:
        """The one of that name, if it is estimated."""
        return next((parameter for parameter in self.parameters if parameter.name == name), None)

    def turned(self, values: Values) -> Vector:
        """Attitude (4,) of the file's principal axes at the start of the record."""
        # The axis is tilted first, then the body turned about it, by any angle: no turn makes the tilts singular.
        turn = _turned(np.array([0.0, 0.0, values.get("attitude_3", 0.0)]))
        return attitude.multiply(self.reference.quaternion, attitude.multiply(_tilted(values, "attitude"), turn))

    def body(self, values: Values) -> Body:
        """The body that parameters describe."""
        of_file, spacecraft = self.spacecraft.inertia, self.spacecraft
        A, C = in_moments(spacecraft, values)
        rates = np.array([values["omega_1"], values["omega_2"], values.get("omega_3", spacecraft.omega0[2])])
        quaternion = self.turned(values)
        growth = values.get("growth", spacecraft.growth)
        e1, e2 = values.get("unequal_1", 0.0), values.get("unequal_2", 0.0)
        size = math.hypot(e1, e2)
        if not (A > 0.0 and C > 0.0 and size < 1.0):
            raise Infeasible("no body has such moments of inertia")
        moments, axes = (A, A, C), of_file.axes
        if size > 0.0:
            half = 0.5 * math.atan2(e2, e1)
            about = np.array([[math.cos(half), -math.sin(half), 0.0], [math.sin(half), math.cos(half), 0.0], [0, 0, 1]])
            moments, axes, rates = (A * (1.0 + size), A * (1.0 - size), C), axes @ about, about.T @ rates
            quaternion = attitude.multiply(quaternion, np.array([math.cos(0.5 * half), 0, 0, math.sin(0.5 * half)]))
        return Body(moments, axes, SpinState(complex(rates[0], rates[1]), float(rates[2]), quaternion), growth)

    def motion(self, values: Values, times: Vector) -> tuple[Vector, Vector]:
        """Rates (n, 3) rad/s and quaternions (n, 4) of the file's axes at rising ``times`` (n,) s."""
        body = self.body(values)
        rates, quaternion = self._path(body, self._fired(values), float(times[-1])).motion(times - self.start)
        return rates @ body.axes.T, attitude.multiply(quaternion, attitude.from_matrix(body.axes.T))

    def moved(self, body: Body, schedule: Schedule, time: float) -> SpinState:
        """The motion of a body at ``time`` s, in its own principal axes; before the record it coasts."""
        if time < self.start:
            schedule = Schedule()
        path = self._path(body, schedule, time)
        rates, quaternion = path.motion(np.array([time - self.start]))
        return SpinState(complex(rates[0, 0], rates[0, 1]), float(rates[0, 2]), quaternion[0])

    def at(self, values: Values, time: float) -> tuple[Body, SpinState]:
        """The body, and its motion at ``time`` s."""
        body = self.body(values)
        return body, self.moved(body, self._fired(values), time)

    def predicted(self, values: Values) -> Vector:
        """Samples of `measured` as they would be without noise, (m,)."""
        work.spend(PREDICTION + SHOWN * len(self.measured))
        _, back = self._all_times
        rates, quaternion = (part[back] for part in self._remembered(values))
        parts = []
        for index, name in enumerate(self.signals):
            rows = self.signal == index
            parts.append(self._shown(name, values, rates[rows], quaternion[rows]))
        return np.concatenate(parts)

    def _remembered(self, values: Values) -> tuple[Vector, Vector]:
        """The motion at all times; once for values that differ in what only the sensors are off."""
        key = tuple((name, value) for name, value in values.items() if not name.startswith(OF_SENSORS))
        if self._last is None or self._last[0] != key:
            times, _ = self._all_times
            work.spend(SAMPLE * len(times))
            bare = np.empty((len(times), 0))
            self._last = key, self.motion(values, times) if self._turned else (self._rates(values, times), bare)
        return self._last[1]

    @property
    def _turned(self) -> bool:
        """True where any signal shows the attitude."""
        return "axis" in self.signals or SUN_PULSE in self.signals

    def _rates(self, values: Values, times: Vector) -> Vector:
        """The rates of `motion` alone."""
        body = self.body(values)
        if self.pulses.pulses or self.spacecraft.disturbances or not (body.symmetric or body.growth == 0.0):
            return self.motion(values, times)[0]
        state, (A, _, C) = body.state, body.moments
        if not body.symmetric:
            return triaxial.free_rates(body.moments, state.rates, times - self.start) @ body.axes.T
        omega, spin = energy_sink.rates_on_arc(A, C, body.growth, state.omega, state.spin, times - self.start)
        return np.column_stack([omega.real, omega.imag, spin]) @ body.axes.T

    @cached_property
    def _all_times(self) -> tuple[Vector, NDArray[np.intp]]:
        return np.unique(self.times, return_inverse=True)

    @cached_property
    def axes(self) -> Vector:
        """The axes that are measured, unit vectors (n, 3)."""
        axis = np.column_stack([self.record.signals[name] for name in AXIS])
        return np.asarray(axis[np.isfinite(axis).all(axis=1)])

    @cached_property
    def _across(self) -> tuple[Vector, Vector]:
        """Two unit vectors (n, 3) across each measured axis."""
        axis = self.axes
        aside = np.eye(3)[np.argmin(np.abs(axis), axis=1)]
        first = np.cross(axis, aside)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        return first, np.cross(axis, first)

    def _parts(self) -> Iterator[tuple[str, Vector, Vector]]:
        """Name, times and samples of each signal; of the axis and of Sun pulses what is off, zero if nothing is."""
        record = self.record
        for name in (*GYROS, ACCELERATION):
            if name in record.signals:
                there = np.isfinite(record.signals[name])
                if there.any():
                    yield name, record.times[there], record.signals[name][there]
        if record.has(*AXIS):
            there = np.all(np.isfinite([record.signals[name] for name in AXIS]), axis=0)
            if there.any():
                times = np.concatenate([record.times[there]] * 2)
                yield "axis", times, np.zeros(len(times))
        if len(record.sun_pulses):
            yield SUN_PULSE, record.sun_pulses, np.zeros(len(record.sun_pulses))

    def _shown(self, name: str, values: Values, rates: Vector, quaternion: Vector) -> Vector:
        """A signal at the motion of its samples."""
        if name in GYROS:
            # Of gyros that are turned by a rotation vector across axis 3: ω seen in their axes.
            along = attitude.rotate(_tilted(values, "misalignment"), np.eye(3)[GYROS.index(name)])
            return np.asarray(rates @ along + values.get(f"bias_{name}", 0.0))
        if name == ACCELERATION:
            assert self.spacecraft.loop is not None
            of_file = self.spacecraft.inertia
            moments, rates = np.array(self._moments(values)), rates @ of_file.axes
            sinking = _sinking(moments * rates, values.get("growth", self.spacecraft.growth))
            columns = felt(self.spacecraft.loop.sensor, moments, rates.T, sinking.T)
            return np.asarray(columns[0] + values.get("bias_acceleration", 0.0))
        if name == SUN_PULSE:
            return self._sun_late(rates, quaternion)
        half = len(rates) // 2
        sense = math.copysign(1.0, self.spacecraft.spin)
        along = attitude.rotate(_tilted(values, "wobble"), np.array([0.0, 0.0, sense]))
        axis = attitude.rotate(quaternion[:half], self.spacecraft.inertia.axes @ along)
        return np.concatenate([np.sum(across * axis, axis=1) for across in self._across])

    def _moments(self, values: Values) -> tuple[float, float, float]:
        A, C = in_moments(self.spacecraft, values)
        e1 = values.get("unequal_1", 0.0)
        return A * (1.0 + e1), A * (1.0 - e1), C

    def _sun_late(self, rates: Vector, quaternion: Vector) -> Vector:
        """Times by which Sun pulses should have come later than they came, s, (k,)."""
        body, sensor = self.spacecraft, self.spacecraft.sun_sensor
        assert sensor is not None
        assert body.sun is not None
        of_body = attitude.multiply(quaternion, attitude.from_matrix(body.inertia.axes))
        sun = np.broadcast_to(body.sun[:, None], (3, len(rates)))
        sense = math.copysign(1.0, body.spin)
        ahead, rate = sky.ahead((rates @ body.inertia.axes).T, of_body.T, sun, sensor.azimuth, sense)
        off = (ahead + math.pi) % (2.0 * math.pi) - math.pi
        return np.asarray(off / np.where(rate > 0.0, rate, abs(body.spin)))

    def _pulses(self) -> Schedule:
        """The pulses fired since the record began; times count from there."""
        kept = []
        for pulse in self.record.schedule:
            if pulse.over <= self.start:
                continue
            if pulse.thrust[0] < self.start:
                raise BadRequest(f"the pulse at {pulse.t:g} s is on as the record begins, at {self.start:g} s")
            kept.append(pulse.moved(-self.start))
        return Schedule(tuple(kept))

    def _fired(self, values: Values) -> Schedule:
        """The pulses with the thrust factors and delays of their channels."""
        pulses = []
        for pulse in self.pulses:
            factor = values.get(f"thrust {pulse.channel}", 1.0)
            torque = None if pulse.torque is None else factor * pulse.torque
            late = max(values.get(f"delay {pulse.channel}", 0.0), -pulse.thrust[0])
            pulses.append(replace(pulse.moved(late), torque=torque, impulse=factor * pulse.impulse))
        return Schedule(tuple(pulses))

    def _path(self, body: Body, fired: Schedule, until: float) -> Path:
        """The motion from the start of the record, from which its times count, to ``until`` s from t = 0."""
        if not fired.pulses and not self.spacecraft.disturbances and (body.symmetric or body.growth == 0.0):
            return _coast(body)
        if until < self.start:
            raise Infeasible(
                f"the motion at {until:g} s, before the record begins at {self.start:g} s, needs an integration "
                "backwards: name a later --at"
            )
        spacecraft = self._as_spacecraft(body)
        acting = make_dynamics(spacecraft)
        dynamics = _Closed(body.moments, acting.constant, Forcing(acting.forcing.turning, body.growth))
        pulses = tuple(self._in_axes(body, pulse) for pulse in fired)
        return _Flown(flown(spacecraft, Schedule(pulses), until - self.start, dynamics=dynamics))

    def _in_axes(self, body: Body, pulse: Pulse) -> Pulse:
        """A pulse, which is in the principal axes of the file, in those of the ``body``."""
        turn = body.axes.T @ self.spacecraft.inertia.axes
        torque = None if pulse.torque is None else turn @ pulse.torque
        return replace(pulse, torque=torque, impulse=turn @ pulse.impulse)

    def _as_spacecraft(self, body: Body) -> Spacecraft:
        to_file = attitude.multiply(body.state.quaternion, attitude.from_matrix(body.axes.T))
        turn = body.axes.T @ self.spacecraft.inertia.axes
        about = complex(turn[0, 0], turn[1, 0])  # both have axis 3
        return replace(
            self.spacecraft,
            inertia=Inertia(body.moments, body.axes, self.spacecraft.inertia.wheel),
            disturbances=tuple(
                replace(disturbance, transverse=about * disturbance.transverse)
                for disturbance in self.spacecraft.disturbances
            ),
            omega0=body.state.rates,
            attitude=Attitude(to_file),
        )


def _coast(body: Body) -> Path:
    """The motion without pulses; of three moments that without dissipation."""
    if body.symmetric:
        return Arc(body.moments[0], body.moments[2], 0.0, body.state, body.growth)
    return FreeCoast(body.moments, 0.0, body.state)


class _Closed(Dynamics):
    """Dynamics whose coasts are closed forms for three different moments too, where nothing acts on them.

    A fit flies thousands of times, and most of a record is coast.
    """

    def _path(self, state: SpinState, start: float, end: float, push: Push, most: int) -> tuple[Path, SpinState]:
        acts = bool(push.torques) or push.falling is not None or self.constant.any() or self.forcing != Forcing()
        if acts or end == start or self.moments[0] == self.moments[1]:
            return super()._path(state, start, end, push, most)
        work.spend(POLHODE)
        coast = FreeCoast(self.moments, start, state)
        rates, quaternion = coast.motion(np.array([end]))
        return coast, SpinState(complex(rates[0, 0], rates[0, 1]), float(rates[0, 2]), quaternion[0])


@dataclass(frozen=True)
class _Flown:
    """A flight as a path."""

    flight: Flight
    steps: int = 0

    def motion(self, times: Vector) -> tuple[Vector, Vector]:
        return self.flight.motion(np.maximum(times, 0.0))


def _sinking(momentum: Vector, growth: float) -> Vector:
    """The torque (n, 3) N m that would change H (n, 3) N m s in the body as dissipation does.

    Of a body whose axis e turns at κ cos θ (t × e) besides, t along H: dH/dt = κ cos θ (cos θ H - |H| e).
    """
    size = np.linalg.norm(momentum, axis=1, keepdims=True)
    cosine = momentum[:, 2:] / size
    return np.asarray(growth * cosine * (cosine * momentum - size * np.array([0.0, 0.0, 1.0])))


def _turned(angles: Vector) -> Vector:
    """Quaternion of the turn by a vector of angles (3,), rad."""
    size = float(np.linalg.norm(angles))
    share = math.sin(0.5 * size) / size if size > 0.0 else 0.5
    return np.array([math.cos(0.5 * size), *(share * angles)])


def _tilted(values: Values, kind: str) -> Vector:
    """Quaternion of the turn by the rotation vector across axis 3 that two parameters of a kind make."""
    return _turned(np.array([values.get(f"{kind}_1", 0.0), values.get(f"{kind}_2", 0.0), 0.0]))


def _expect_described(spacecraft: Spacecraft, record: Record) -> None:
    """Raise BadRequest where the file does not describe what a signal needs."""
    if record.has(ACCELERATION):
        loop = spacecraft.loop
        if loop is None or loop.sensor.kind != ACCELEROMETER:
            problem = "expected kind: accelerometer with its position, for the column acceleration_m_s2"
            raise Unsuitable(("loop", "sensor"), problem)
        if is_blind(spacecraft.inertia.moments, loop.sensor.position, loop.sensor.axis):
            raise Unsuitable(("loop", "sensor"), "the accelerometer shows nothing of a nutation where it is")
    if len(record.sun_pulses) and (spacecraft.sun is None or spacecraft.sun_sensor is None):
        key = "sun" if spacecraft.sun is None else "sun_sensor"
        raise Unsuitable((key,), f"expected the key {key}: Sun pulses are timed by attitude, sun and sun_sensor")
