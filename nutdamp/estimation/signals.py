"""Telemetry records, and the measurement model of each kind of signal in them: a row of `KINDS`.

A row predicts the samples of its kind from the motion and from what its sensor is off; derivatives, noise and
statistics follow from it. Angles on the sphere are compared by what is off across the direction that was measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.control_loop.sensor import felt
from nutdamp.physics import attitude, sky
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Pulse, Schedule

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Values = Mapping[str, float]

GYROS = ("omega_1", "omega_2", "omega_3")
AXIS = ("axis_x", "axis_y", "axis_z")
QUATERNION = ("q_w", "q_x", "q_y", "q_z")
SEEN = ("crossing_1", "crossing_2", "crossing_3")
DIRECTION = ("crossing_x", "crossing_y", "crossing_z")
ACCELERATION, SUN_ASPECT, CROSSING = "acceleration", "sun_aspect", "crossing"
SUN_PULSE = "sun_pulse"

BODY, SPACE = "body", "space"
"""Where a signal shows the nutation: at its rate in the body, or at that of the axis about H."""

APART = math.sin(math.radians(1.0))
"""Sine of the angle from which on two directions are two."""

STEPS = 4000
"""Values of a signal from which the step of its quantisation is found, at most."""

MULTIPLES = 0.9
"""Share of the differences of values that are multiples of a step, for it to be one."""


@dataclass(frozen=True, eq=False)
class Record:
    """Telemetry: ``signals`` by name, (n,) each, at ``times`` (n,) s that rise; NaN where there is no sample.

    Body rates (rad/s) are in the axes of the file, ``axis_x``, ``axis_y``, ``axis_z`` the inertial unit vector along
    the spin axis, ``q_w`` to ``q_z`` the attitude of the axes of the file, ``acceleration`` is m/s². ``crossing_1`` to
    ``crossing_3`` are the unit vector in the body to what is in the inertial direction ``crossing_x`` to
    ``crossing_z``; ``sun_aspect`` (rad) is the angle of the Sun from body axis 3. ``sun_pulses`` (k,) s are the times
    of Sun pulses, known to within ``sun_step`` s (full width). ``schedule`` was fired meanwhile. All times count from
    t = 0 of the file.
    """

    times: Vector
    signals: Mapping[str, Vector] = field(default_factory=dict)
    sun_pulses: Vector = field(default_factory=lambda: np.empty(0))
    sun_step: float = 0.0
    schedule: Schedule = field(default_factory=Schedule)

    @property
    def start(self) -> float:
        """Time at which it begins, s."""
        return float(min([*self.times[:1], *self.sun_pulses[:1]]))

    @property
    def end(self) -> float:
        """Time at which it ends, s."""
        return float(max([*self.times[-1:], *self.sun_pulses[-1:]]))

    @property
    def length(self) -> float:
        """Its length, s."""
        return self.end - self.start

    @property
    def interval(self) -> float:
        """Usual time between two samples, s; of Sun pulses where there is nothing else."""
        times = self.times if len(self.times) > 1 else self.sun_pulses
        return float(np.median(np.diff(times)))

    @property
    def fired(self) -> tuple[Pulse, ...]:
        """The pulses of the schedule whose thrust falls in the record, wholly or in part."""
        return tuple(pulse for pulse in self.schedule if pulse.over > self.start and pulse.thrust[0] < self.end)

    def has(self, *names: str) -> bool:
        """True where all of these signals are there."""
        return all(name in self.signals for name in names)

    def samples(self, names: tuple[str, ...]) -> tuple[Vector, Vector]:
        """Times (m,) s at which all of some signals have a sample, and these (m, k)."""
        if not self.has(*names):
            return np.empty(0), np.empty((0, len(names)))
        table = np.column_stack([self.signals[name] for name in names])
        there = np.isfinite(table).all(axis=1)
        return self.times[there], table[there]

    @property
    def kinds(self) -> tuple[SignalKind, ...]:
        """Kinds of signals that it has samples of."""
        return tuple(kind for kind in KINDS if len(kind.samples(self)[0]))

    @property
    def shows_turn(self) -> bool:
        """True where a signal shows how the body is turned about its axis."""
        return any(kind.turn for kind in self.kinds)

    @property
    def shows_spin(self) -> bool:
        """True where a signal shows ω3."""
        return any(kind.spin for kind in self.kinds)


def of_quaternions(quaternions: Vector, spacecraft: Spacecraft) -> dict[str, Vector]:
    """Signals of measured attitudes (n, 4), NaN where there are none: the spin axis, and the turn about it.

    They are compared apart, for star trackers tell them with different noise.
    """
    up = spacecraft.sense * spacecraft.inertia.axes[:, 2]
    axis = attitude.rotate(quaternions, up)
    return dict(zip((*AXIS, *QUATERNION), np.column_stack([axis, quaternions]).T, strict=True))


def quantisation(values: Vector) -> float:
    """Step of which the differences of the values (n,) are multiples, but for some; 0 where there is none."""
    distinct = np.unique(values[np.isfinite(values)][:STEPS])
    gaps = np.diff(distinct)
    gaps = gaps[gaps > 1e-9 * np.abs(distinct).max(initial=0.0)]
    if not len(gaps):
        return 0.0
    multiples = gaps / gaps.min()
    return float(gaps.min()) if np.mean(np.abs(multiples - np.rint(multiples)) < 1e-2) > MULTIPLES else 0.0


class Sighting(NamedTuple):
    """The motion at the samples (n, k) of one signal, in the axes of the file: rates (n, 3), quaternion (n, 4).

    ``values`` are those of all parameters, ``moments`` about the principal axes of the file, kg m².
    """

    spacecraft: Spacecraft
    values: Values
    moments: tuple[float, float, float]
    samples: Vector
    rates: Vector
    quaternion: Vector

    @property
    def principal(self) -> Vector:
        """Attitude (n, 4) of the principal axes of the file, tilted as attitude sensors see them."""
        axes = attitude.from_matrix(self.spacecraft.inertia.axes)
        return attitude.multiply(self.quaternion, attitude.multiply(axes, tilted(self.values, "wobble")))

    @property
    def sensors(self) -> Vector:
        """Attitude (n, 4) of the axes of the file, tilted so too."""
        back = attitude.conjugate(attitude.from_matrix(self.spacecraft.inertia.axes))
        return attitude.multiply(self.principal, back)


@dataclass(frozen=True)
class SignalKind:
    """Measurement model: ``predicted`` samples of the signals ``columns`` of a record, in ``unit``.

    ``parts`` (values compared per sample) are what is ``off``, zero if nothing is, or the samples themselves.
    ``nutation``: where it shows one, if it does; ``turn``, ``spin``: True where it shows how the body is turned about
    axis 3, and ω3; ``attitude``: True where it takes the attitude, and ``wobble`` where its sensor may be tilted.
    ``spread``: what is usually off before a fit, over a spin period of Sun pulses.
    """

    name: str
    columns: tuple[str, ...]
    unit: str
    predicted: Callable[[Sighting], Vector]
    nutation: str = ""
    parts: int = 1
    off: bool = False
    turn: bool = False
    spin: bool = False
    attitude: bool = False
    wobble: bool = False
    spread: float = 1e-4

    def samples(self, record: Record) -> tuple[Vector, Vector]:
        """Times (n,) s and samples (n, k) of a record."""
        if self.columns:
            return record.samples(self.columns)
        return record.sun_pulses, np.zeros((len(record.sun_pulses), 1))


def _gyro(index: int) -> Callable[[Sighting], Vector]:
    """Rate about one axis of gyros that are turned by a rotation vector across axis 3: ω seen in their axes."""

    def shown(seen: Sighting) -> Vector:
        along = attitude.rotate(tilted(seen.values, "misalignment"), np.eye(3)[index])
        return np.asarray(seen.rates @ along + seen.values.get(f"bias_{GYROS[index]}", 0.0))

    return shown


def _felt(seen: Sighting) -> Vector:
    """Acceleration at the accelerometer, m/s²."""
    spacecraft, moments = seen.spacecraft, np.array(seen.moments)
    assert spacecraft.loop is not None
    rates = seen.rates @ spacecraft.inertia.axes
    sinking = _sinking(moments * rates, seen.values.get("growth", spacecraft.growth))
    columns = felt(spacecraft.loop.sensor, moments, rates.T, sinking.T)
    return np.asarray(columns[0] + seen.values.get("bias_acceleration", 0.0))


def _sinking(momentum: Vector, growth: float) -> Vector:
    """The torque (n, 3) N m that would change H (n, 3) N m s in the body as dissipation does.

    Of a body whose axis e turns at κ cos θ (t × e) besides, t along H: dH/dt = κ cos θ (cos θ H - |H| e).
    """
    size = np.linalg.norm(momentum, axis=1, keepdims=True)
    cosine = momentum[:, 2:] / size
    return np.asarray(growth * cosine * (cosine * momentum - size * np.array([0.0, 0.0, 1.0])))


def _axis_off(seen: Sighting) -> Vector:
    """Components of the spin axis across the measured one."""
    up = np.array([0.0, 0.0, seen.spacecraft.sense])
    return _off(seen.samples, attitude.rotate(seen.principal, up))


def _turn_off(seen: Sighting) -> Vector:
    """Angles by which the body is turned about axis 3 from a measured attitude, rad."""
    of_file = attitude.from_matrix(seen.spacecraft.inertia.axes)
    measured = attitude.multiply(seen.samples, of_file)
    apart = attitude.multiply(attitude.conjugate(measured), seen.principal)
    return wrapped(2.0 * np.arctan2(apart[:, 3], apart[:, 0]))


def _crossing_off(seen: Sighting) -> Vector:
    """Components of a known direction, as the body has it, across where it was seen."""
    there = attitude.rotate(attitude.conjugate(seen.sensors), seen.samples[:, 3:])
    return _off(seen.samples[:, :3], there)


def _sun_aspect(seen: Sighting) -> Vector:
    """Angle of the Sun from body axis 3, rad."""
    sun = seen.spacecraft.sun
    assert sun is not None
    x, y, z = attitude.rotate(attitude.conjugate(seen.sensors), sun).T
    return np.asarray(np.arctan2(np.hypot(x, y), z))


def _sun_late(seen: Sighting) -> Vector:
    """Times by which Sun pulses should have come later than they came, s."""
    body, sensor = seen.spacecraft, seen.spacecraft.sun_sensor
    assert sensor is not None
    assert body.sun is not None
    of_body = attitude.multiply(seen.quaternion, attitude.from_matrix(body.inertia.axes))
    sun = np.broadcast_to(body.sun[:, None], (3, len(seen.rates)))
    sense = body.sense
    ahead, rate = sky.ahead((seen.rates @ body.inertia.axes).T, of_body.T, sun, sensor.azimuth, sense)
    return np.asarray(wrapped(ahead) / np.where(rate > 0.0, rate, abs(body.spin)))


def _off(measured: Vector, there: Vector) -> Vector:
    """Components (2n,) of unit vectors across measured ones, (n, 3) each."""
    first = np.cross(measured, np.eye(3)[np.argmin(np.abs(measured), axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.concatenate([np.sum(across * there, axis=1) for across in (first, np.cross(measured, first))])


def wrapped(angles: Vector) -> Vector:
    """Angles in [-π, π), rad."""
    return np.asarray((angles + math.pi) % (2.0 * math.pi) - math.pi)


def turned(angles: Vector) -> Vector:
    """Quaternion of the turn by a vector of angles (3,), rad."""
    size = float(np.linalg.norm(angles))
    share = math.sin(0.5 * size) / size if size > 0.0 else 0.5
    return np.array([math.cos(0.5 * size), *(share * angles)])


def tilted(values: Values, kind: str) -> Vector:
    """Quaternion of the turn by the rotation vector across axis 3 that two parameters of a kind make."""
    return turned(np.array([values.get(f"{kind}_1", 0.0), values.get(f"{kind}_2", 0.0), 0.0]))


KINDS = (
    SignalKind(GYROS[0], GYROS[:1], "rad/s", _gyro(0), BODY, turn=True),
    SignalKind(GYROS[1], GYROS[1:2], "rad/s", _gyro(1), BODY, turn=True),
    SignalKind(GYROS[2], GYROS[2:], "rad/s", _gyro(2), spin=True),
    SignalKind(ACCELERATION, (ACCELERATION,), "m/s²", _felt, BODY, turn=True),
    SignalKind("axis", AXIS, "rad", _axis_off, SPACE, parts=2, off=True, attitude=True, wobble=True, spread=1e-3),
    SignalKind("turn", QUATERNION, "rad", _turn_off, off=True, turn=True, spin=True, attitude=True, wobble=True,
               spread=1e-3),
    SignalKind(CROSSING, (*SEEN, *DIRECTION), "rad", _crossing_off, SPACE, parts=2, off=True, turn=True, spin=True,
               attitude=True, wobble=True, spread=1e-3),
    SignalKind(SUN_ASPECT, (SUN_ASPECT,), "rad", _sun_aspect, SPACE, attitude=True, wobble=True),
    SignalKind(SUN_PULSE, (), "s", _sun_late, off=True, turn=True, spin=True, attitude=True, spread=0.01),
)  # fmt: skip
"""Measurement models, in the order of a fit."""

KIND = {kind.name: kind for kind in KINDS}
"""Measurement models by name."""
