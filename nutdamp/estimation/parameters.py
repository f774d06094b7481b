"""Telemetry records, the kinds of signals in them (a row of `KINDS` each), and the parameters that
are fitted to them.

A row predicts the samples of its kind from the motion and from what its sensor is off; derivatives,
noise and statistics follow from it. Angles on the sphere are compared by what is off across the
direction that was measured. A parameter has its value in the file and the tolerance there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.results import Note, note
from nutdamp.control_loop.sensor import felt
from nutdamp.montecarlo.inputs import SPREAD
from nutdamp.physics import attitude
from nutdamp.physics.sky import ahead as sun_ahead
from nutdamp.spacecraft.equipment import GYRO
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Pulse, Schedule
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Values = Mapping[str, float]

GYROS = ("omega_1", "omega_2", "omega_3")
AXIS = ("axis_x", "axis_y", "axis_z")
QUATERNION = ("q_w", "q_x", "q_y", "q_z")
SEEN = ("crossing_1", "crossing_2", "crossing_3")
DIRECTION = ("crossing_x", "crossing_y", "crossing_z")
ACCELERATION, SUN_ASPECT, CROSSING = "acceleration", "sun_aspect", "crossing"
TURN = "turn"
SUN_PULSE = "sun_pulse"

BODY, SPACE = (
    "body",
    "space",
)  # a signal shows the nutation at its rate in the body, or at that of the axis about H

APART = math.sin(math.radians(1.0))  # sine of the angle from which on two directions are two
STEPS = 4000  # values of a signal from which its steps are found, at most
MULTIPLES = 0.9  # share of their differences that are multiples of a step


@dataclass(frozen=True, eq=False)
class Record:
    """Telemetry: ``signals`` by name, (n,) each, at rising ``times`` (n,) s from t = 0; NaN where
    there is no sample.

    Body rates (rad/s) are in the axes of the file, ``axis_x`` to ``axis_z`` the inertial unit
    vector along the spin axis, ``q_w`` to ``q_z`` the attitude of the axes of the file,
    ``acceleration`` is m/s². ``crossing_1`` to ``_3`` are the unit vector in the body to what is in
    the inertial direction ``crossing_x`` to ``_z``; ``sun_aspect`` (rad) is the angle of the Sun
    from body axis 3. Times of ``sun_pulses`` (k,) s are known to within ``sun_step`` s (full
    width). ``schedule`` was fired meanwhile.
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
        return tuple(
            pulse
            for pulse in self.schedule
            if pulse.over > self.start and pulse.thrust[0] < self.end
        )

    def has(self, *names: str) -> bool:
        """True where all of these signals are there."""
        return all(name in self.signals for name in names)

    def samples(self, names: tuple[str, ...]) -> tuple[Vector, Vector]:
        """Times (m,) s at which all of some signals have a sample, and these (m, k)."""
        if not self.has(*names):
            return np.empty(0), np.empty((0, len(names)))
        table = np.column_stack([self.signals[name] for name in names])
        complete = np.isfinite(table).all(axis=1)
        return self.times[complete], table[complete]

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
    """Signals of measured attitudes (n, 4), NaN where there are none: spin axis and turn, which
    differ in noise.
    """
    up = spacecraft.sense * spacecraft.inertia.axes[:, 2]
    axis = attitude.rotate(quaternions, up)
    return dict(zip((*AXIS, *QUATERNION), np.column_stack([axis, quaternions]).T, strict=True))


def quantisation(values: Vector) -> float:
    """Step of which the differences of the values (n,) are multiples, but for some; 0 where there
    is none.
    """
    distinct = np.unique(values[np.isfinite(values)][:STEPS])
    gaps = np.diff(distinct)
    gaps = gaps[gaps > 1e-9 * np.abs(distinct).max(initial=0.0)]
    if not len(gaps):
        return 0.0
    multiples = gaps / gaps.min()
    return (
        float(gaps.min())
        if np.mean(np.abs(multiples - np.rint(multiples)) < 1e-2) > MULTIPLES
        else 0.0
    )


class Sighting(NamedTuple):
    """The motion at the samples (n, k) of one signal, in the axes of the file: rates (n, 3),
    quaternion (n, 4).
    """

    spacecraft: Spacecraft
    values: Values
    moments: tuple[float, float, float]  # about the principal axes of the file, kg m²
    samples: Vector
    rates: Vector
    quaternion: Vector

    @property
    def axes(self) -> Vector:
        """Quaternion (4,) of the principal axes of the file."""
        return attitude.from_matrix(self.spacecraft.inertia.axes)

    @property
    def principal(self) -> Vector:
        """Attitude (n, 4) of the principal axes of the file,
        tilted as attitude sensors see them.
        """
        return attitude.multiply(
            self.quaternion, attitude.multiply(self.axes, tilted(self.values, "wobble"))
        )

    def in_body(self, direction: Vector) -> Vector:
        """Inertial directions in the axes of the file, tilted so too, (n, 3)."""
        sensors = attitude.multiply(self.principal, attitude.conjugate(self.axes))
        return attitude.rotate(attitude.conjugate(sensors), direction)


@dataclass(frozen=True)
class SignalKind:
    """Measurement model: ``predicted`` samples of the signals ``columns`` of a record,
    in ``unit``.
    """

    name: str
    columns: tuple[str, ...]
    unit: str
    predicted: Callable[[Sighting], Vector]
    nutation: str = ""  # where it shows one, if it does
    parts: int = 1  # values compared per sample
    off: bool = False  # these are what is off, not the samples themselves
    turn: bool = False  # shows how the body is turned about axis 3
    spin: bool = False  # shows ω3
    attitude: bool = False  # takes the attitude
    wobble: bool = False  # its sensor may be tilted
    spread: float = 1e-4  # usually off before a fit, over a spin period of Sun pulses

    def samples(self, record: Record) -> tuple[Vector, Vector]:
        """Times (n,) s and samples (n, k) of a record."""
        if self.columns:
            return record.samples(self.columns)
        return record.sun_pulses, np.zeros((len(record.sun_pulses), 1))


def _gyro(index: int, seen: Sighting) -> Vector:
    """Rate about one axis of gyros that are turned by a rotation vector across axis 3: ω seen in
    their axes.
    """
    along = attitude.rotate(tilted(seen.values, "misalignment"), np.eye(3)[index])
    return np.asarray(seen.rates @ along + seen.values.get(f"bias_{GYROS[index]}", 0.0))


def _felt(seen: Sighting) -> Vector:
    """Acceleration at the accelerometer, m/s².

    Dissipation counts as the torque that changes H in the body alike: of a body whose axis e turns
    at κ cos θ (t × e) besides, t along H, dH/dt = κ cos θ (cos θ H - |H| e).
    """
    spacecraft = seen.spacecraft
    moments = np.array(seen.moments)
    assert spacecraft.loop is not None
    rates = seen.rates @ spacecraft.inertia.axes
    momentum = moments * rates
    growth = seen.values.get("growth", spacecraft.growth)
    size = np.linalg.norm(momentum, axis=1, keepdims=True)
    cosine = momentum[:, 2:] / size
    sinking = growth * cosine * (cosine * momentum - size * np.array([0.0, 0.0, 1.0]))
    columns = felt(spacecraft.loop.sensor, moments, rates.T, sinking.T)
    return np.asarray(columns[0] + seen.values.get("bias_acceleration", 0.0))


def _axis_off(seen: Sighting) -> Vector:
    """Components of the spin axis across the measured one."""
    up = np.array([0.0, 0.0, seen.spacecraft.sense])
    return _off(seen.samples, attitude.rotate(seen.principal, up))


def _turn_off(seen: Sighting) -> Vector:
    """Angles by which the body is turned about axis 3 from a measured attitude, rad."""
    measured = attitude.multiply(seen.samples, seen.axes)
    apart = attitude.multiply(attitude.conjugate(measured), seen.principal)
    return wrapped(2.0 * np.arctan2(apart[:, 3], apart[:, 0]))


def _crossing_off(seen: Sighting) -> Vector:
    """Components of a known direction, as the body has it, across where it was seen."""
    return _off(seen.samples[:, :3], seen.in_body(seen.samples[:, 3:]))


def _sun_aspect(seen: Sighting) -> Vector:
    """Angle of the Sun from body axis 3, rad."""
    assert seen.spacecraft.sun is not None
    x, y, z = seen.in_body(seen.spacecraft.sun).T
    return np.asarray(np.arctan2(np.hypot(x, y), z))


def _sun_late(seen: Sighting) -> Vector:
    """Times by which Sun pulses should have come later than they came, s."""
    spacecraft, sensor = seen.spacecraft, seen.spacecraft.sun_sensor
    assert sensor is not None
    assert spacecraft.sun is not None
    of_body = attitude.multiply(seen.quaternion, seen.axes)
    sun = np.broadcast_to(spacecraft.sun[:, None], (3, len(seen.rates)))
    ahead, rate = sun_ahead(
        (seen.rates @ spacecraft.inertia.axes).T, of_body.T, sun, sensor.azimuth, spacecraft.sense
    )
    return np.asarray(wrapped(ahead) / np.where(rate > 0.0, rate, abs(spacecraft.spin)))


def _off(measured: Vector, predicted: Vector) -> Vector:
    """Components (2n,) of unit vectors across measured ones, (n, 3) each; of opposite ones they add
    up to 2.
    """
    # The axes across turn with the sample from those across a pole, which stands far from the
    # opposite of every sample: chosen sample by sample noise would choose, and bias what it shows.
    poles = np.concatenate([np.eye(3), -np.eye(3)])
    pole = poles[np.argmax((measured @ poles.T).min(axis=0))]
    middle = measured + pole
    share = np.sum(predicted * middle, axis=1) / np.maximum(middle @ pole, TINY)
    off = (predicted - share[:, None] * measured)[:, pole == 0.0].T
    # Beyond 90 deg what is across falls again, and would be nothing for the opposite direction.
    sizes = np.hypot(*off)
    behind = np.sum(measured * predicted, axis=1) < 0.0
    return np.concatenate(off * np.where(behind, 2.0 / np.maximum(sizes, TINY) - 1.0, 1.0))


def wrapped(angles: Vector) -> Vector:
    """Angles in [-π, π), rad."""
    return np.asarray((angles + math.pi) % (2.0 * math.pi) - math.pi)


def turned(angles: Vector) -> Vector:
    """Quaternion of the turn by a vector of angles (3,), rad."""
    size = float(np.linalg.norm(angles))
    share = math.sin(0.5 * size) / size if size > 0.0 else 0.5
    return np.array([math.cos(0.5 * size), *(share * angles)])


def tilted(values: Values, kind: str) -> Vector:
    """Quaternion of the turn by the rotation vector across axis 3 that two parameters of a kind
    make.
    """
    return turned(np.array([values.get(f"{kind}_1", 0.0), values.get(f"{kind}_2", 0.0), 0.0]))


KINDS = (
    SignalKind(GYROS[0], GYROS[:1], "rad/s", partial(_gyro, 0), BODY, turn=True),
    SignalKind(GYROS[1], GYROS[1:2], "rad/s", partial(_gyro, 1), BODY, turn=True),
    SignalKind(GYROS[2], GYROS[2:], "rad/s", partial(_gyro, 2), spin=True),
    SignalKind(ACCELERATION, (ACCELERATION,), "m/s²", _felt, BODY, turn=True),
    SignalKind(
        "axis",
        AXIS,
        "rad",
        _axis_off,
        SPACE,
        parts=2,
        off=True,
        attitude=True,
        wobble=True,
        spread=1e-3,
    ),
    SignalKind(
        TURN,
        QUATERNION,
        "rad",
        _turn_off,
        off=True,
        turn=True,
        spin=True,
        attitude=True,
        wobble=True,
        spread=1e-3,
    ),
    SignalKind(
        CROSSING,
        (*SEEN, *DIRECTION),
        "rad",
        _crossing_off,
        SPACE,
        parts=2,
        off=True,
        turn=True,
        spin=True,
        attitude=True,
        wobble=True,
        spread=1e-3,
    ),
    SignalKind(SUN_ASPECT, (SUN_ASPECT,), "rad", _sun_aspect, SPACE, attitude=True, wobble=True),
    SignalKind(
        SUN_PULSE, (), "s", _sun_late, off=True, turn=True, spin=True, attitude=True, spread=0.01
    ),
)
"""Measurement models, in the order of a fit."""

KIND = {kind.name: kind for kind in KINDS}  # measurement models by name


RATIO = "C/A"  # name of the parameter that a coast fixes
BIAS = math.radians(
    0.02
)  # one sigma of the bias of a gyro, rad/s, where the file has no dispersions.sensor_bias
TILT = math.radians(
    1.0
)  # one sigma of each tilt of gyros and attitude sensors from the principal axes, rad
# standard deviation of a thrust factor in a fit at least: a valve that stays shut must not pass for
# noise
THRUST = 0.5
DELAY = 0.05  # standard deviation of what a channel's thrust is late, s
TINY = 1e-7  # step of derivatives, rad, or as a share of a value


class ParameterKind(NamedTuple):
    """Kind of the numbers to be estimated, in the SI ``unit``.

    Braces in ``name`` and ``label`` stand for which of several it is. Screens show the value times
    ``factor`` in the unit ``shown``; kinds without a label have no line of their own.
    """

    name: str
    unit: str
    label: str = ""
    shown: str = ""
    factor: float = 1.0
    of_body: bool = False  # beside its motion: shown first
    of_sensor: bool = False  # leaves the motion as it is


DEG = math.pi / 180.0

TRANSVERSE_MOMENT = ParameterKind("A", "kg m²")
MOMENT_RATIO = ParameterKind(RATIO, "")
BODY_RATE = ParameterKind("omega_{}", "rad/s")
WHEEL_MOMENTUM = ParameterKind("wheel", "N m s", "wheel momentum h", "N m s", of_body=True)
GROWTH = ParameterKind("growth", "1/s", "growth 1/τ", "1/s", of_body=True)
UNEQUAL_MOMENTS = ParameterKind("unequal_1", "", "(I1 - I2)/(I1 + I2)", of_body=True)
PRODUCT = ParameterKind("unequal_2", "", "I12/A", of_body=True)
TURN_AT_START = ParameterKind("attitude_{}", "rad", "attitude about {}", "deg", 1.0 / DEG)
GYRO_BIAS = ParameterKind("bias_{}", "rad/s", "bias of {}", "deg/s", 1.0 / DEG, of_sensor=True)
ACCELEROMETER_BIAS = ParameterKind(
    f"bias_{ACCELERATION}", "m/s²", f"bias of {ACCELERATION}", "m/s²", of_sensor=True
)
MISALIGNMENT = ParameterKind(
    "misalignment_{}", "rad", "gyros tilted about {}", "deg", 1.0 / DEG, of_sensor=True
)
WOBBLE = ParameterKind("wobble_{}", "rad", "axis tilted about {}", "deg", 1.0 / DEG, of_sensor=True)
THRUST_FACTOR = ParameterKind("thrust {}", "", "thrust factor of {}")
LATENESS = ParameterKind("delay {}", "s", "delay of {}", "ms", 1e3)


class Parameter(NamedTuple):
    """One number to be estimated."""

    kind: ParameterKind
    which: str  # of several
    file: float  # value by the file
    prior: float  # one sigma of that; infinite where the file says nothing that counts
    step: float  # change for derivatives

    @property
    def name(self) -> str:
        """Name in files."""
        return self.kind.name.format(self.which)

    @property
    def label(self) -> str:
        """Name for people."""
        return self.kind.label.format(self.which)


def _pair(kind: ParameterKind, sigma: float) -> Iterator[Parameter]:
    """Two angles, rad, about the axes across axis 3, zero by the file."""
    for number in "12":
        yield Parameter(kind, number, 0.0, sigma, TINY)


def moments(spacecraft: Spacecraft) -> Iterator[Parameter]:
    """A and the ratio C/A, as far as the file lets them differ from its values; the ratio in any
    case.

    Its prior is that of A and C together; with A they are correlated, see `prior`. What has no
    tolerance is fixed: A where neither has one. The ratio and not C, because what telemetry fixes
    best is then linear in the parameters.
    """
    (A, of_A), (C, of_C), together = _of_moments(spacecraft)
    ratio = C / A
    if of_A > 0.0 and of_C > 0.0:
        yield Parameter(TRANSVERSE_MOMENT, "", A, of_A, TINY * A)
    both = 2.0 * together * of_A / A * of_C / C
    sigma = ratio * math.sqrt((of_A / A) ** 2 + (of_C / C) ** 2 - both)
    yield Parameter(MOMENT_RATIO, "", ratio, sigma or math.inf, TINY * ratio)


def in_moments(spacecraft: Spacecraft, values: Mapping[str, float]) -> tuple[float, float]:
    """A and C (kg m²) of the ``values`` of parameters."""
    (A, of_A), (C, of_C), _ = _of_moments(spacecraft)
    ratio = values.get(RATIO, C / A)
    # Of a body with a wheel it is A that C/A changes where neither has a tolerance: despun, C does
    # not matter.
    if of_C == 0.0 and (of_A > 0.0 or spacecraft.inertia.wheel != 0.0):
        return C / ratio, C
    A = values.get("A", A)
    return A, ratio * A


def prior(spacecraft: Spacecraft, chosen: Sequence[Parameter]) -> tuple[Matrix, Vector]:
    """Rows (k, p) of what the file says of the parameters, over its sigmas,
    and their values (k,).
    """
    rows, values = [], []
    names = [parameter.name for parameter in chosen]
    for index, parameter in enumerate(chosen):
        row = np.zeros(len(chosen))
        row[index] = 1.0 / parameter.prior
        value = parameter.file / parameter.prior
        if parameter.name == RATIO and "A" in names:
            # What of C = A·(C/A), to first order, A does not tell.
            (A, of_A), (C, of_C), both = _of_moments(spacecraft)
            apart = of_C * math.sqrt(1.0 - both * both)
            row[index], row[names.index("A")] = (
                A / apart,
                (parameter.file - both * of_C / of_A) / apart,
            )
            value = (2.0 * C - both * of_C / of_A * A) / apart
        if row.any():
            rows.append(row)
            values.append(value)
    return np.array(rows).reshape(-1, len(chosen)), np.array(values)


EXACT = Dispersions()  # the dispersions of a file that has none


def _of_moments(spacecraft: Spacecraft) -> tuple[tuple[float, float], tuple[float, float], float]:
    """Means and standard deviations of A and C by the file, kg m², and their correlation."""
    dispersions = spacecraft.dispersions or EXACT
    inertia = spacecraft.inertia
    together = (
        value for first, second, value in dispersions.correlation if {first, second} == {"A", "C"}
    )
    return (
        prior_of(dispersions.A or dispersions.inertia_tensor, inertia.A),
        prior_of(dispersions.C or dispersions.inertia_tensor, inertia.C),
        next(together, 0.0),
    )


def parameters(
    spacecraft: Spacecraft, record: Record, *, unequal: bool, growing: bool, steady: bool
) -> Iterator[Parameter]:
    """The parameters of a record, motion at its start first; ``unequal``: I1 ≠ I2, ``growing``:
    with dissipation, ``steady``: without the moments, which only a nutation shows.
    """
    dispersions = spacecraft.dispersions or EXACT
    spin = float(spacecraft.omega0[2])
    step = TINY * spacecraft.fastest
    if not steady:
        yield from moments(spacecraft)
    if dispersions.wheel_momentum is not None and spacecraft.inertia.wheel != 0.0:
        wheel, sigma = prior_of(dispersions.wheel_momentum, spacecraft.inertia.wheel)
        yield Parameter(WHEEL_MOMENTUM, "", wheel, sigma, TINY * abs(wheel))
    for number in (1, 2):
        rate = float(spacecraft.omega0[number - 1])
        yield Parameter(BODY_RATE, str(number), rate, math.inf, step)
    if record.shows_spin:
        yield Parameter(BODY_RATE, "3", spin, math.inf, step)
    elif dispersions.omega0[2] is not None:
        mean, sigma = prior_of(dispersions.omega0[2], spin)
        yield Parameter(BODY_RATE, "3", mean, sigma, step)
    if growing and (spacecraft.inertia.a != 0.0 or spacecraft.inertia.wheel != 0.0):
        small = 1e-5 / max(record.length, 1e-3)
        yield Parameter(GROWTH, "", spacecraft.growth, math.inf, small)
    if any(kind.attitude for kind in record.kinds):
        yield from _attitude(spacecraft, record)
    yield from _gyros(spacecraft, record)
    if any(kind.wobble for kind in record.kinds):
        yield from _pair(WOBBLE, TILT)
    if record.has(ACCELERATION):
        yield Parameter(ACCELEROMETER_BIAS, "", 0.0, math.inf, 1e-6 * spin * spin)
    if unequal:
        first, second, _ = spacecraft.inertia.moments
        uneven = (first - second) / (first + second)
        yield Parameter(UNEQUAL_MOMENTS, "", uneven, math.inf, 1e-6)
        yield Parameter(PRODUCT, "", 0.0, math.inf, 1e-6)
    for name in dict.fromkeys(pulse.channel for pulse in record.fired):
        mean, sigma = thrust_prior(spacecraft, name)
        yield Parameter(THRUST_FACTOR, name, mean, max(sigma, THRUST), TINY)
        yield Parameter(LATENESS, name, 0.0, DELAY, 1e-6)


def _attitude(spacecraft: Spacecraft, record: Record) -> Iterator[Parameter]:
    """Turns of the attitude at the start about body axes; the last shows only beside what turns
    with the body.
    """
    # A record of the axis tells the attitude, or of two directions: of one it may be turned about
    # it.
    ways = record.samples(DIRECTION)[1]
    if record.has(SUN_ASPECT) and spacecraft.sun is not None:
        ways = np.vstack([ways, spacecraft.sun])
    apart = len(ways) > 0 and np.linalg.norm(np.cross(ways, ways[0]), axis=1).max() > APART
    sigma = math.inf
    if not (apart or record.has("axis_x")):
        sigma = prior_of((spacecraft.dispersions or EXACT).attitude, 0.0)[1]
        # The file has the attitude at t = 0: where on its cone the axis is as the record begins is
        # less sure.
        turn = min(2.0 * math.pi / spacecraft.inertial_period * abs(record.start), math.pi)
        sigma = (
            math.hypot(sigma, 2.0 * math.sin(0.5 * turn) * spacecraft.nutation)
            if sigma > 0.0
            else 0.0
        )
    if sigma > 0.0:
        yield from _pair(TURN_AT_START, sigma)
    if record.shows_turn:
        yield Parameter(TURN_AT_START, "3", 0.0, math.inf, TINY)


def _gyros(spacecraft: Spacecraft, record: Record) -> Iterator[Parameter]:
    """Biases; misalignment only beside gyro 3, for else it looks like a bias of gyros 1 and 2."""
    loop, tolerance = spacecraft.loop, (spacecraft.dispersions or EXACT).sensor_bias
    mean = 0.0
    sigma = BIAS
    if loop is not None and loop.sensor.kind == GYRO:
        mean, sigma = (
            (loop.sensor.bias, BIAS) if tolerance is None else prior_of(tolerance, loop.sensor.bias)
        )
    aligned = record.has(GYROS[2])
    for name in GYROS:
        if record.has(name):
            step = quantisation(record.signals[name])
            free = math.hypot(sigma, step / math.sqrt(12.0)) if aligned else math.inf
            yield Parameter(GYRO_BIAS, name, mean, free, TINY)
    if aligned and (record.has(GYROS[0]) or record.has(GYROS[1])):
        yield from _pair(MISALIGNMENT, TILT)


def thrust_prior(spacecraft: Spacecraft, name: str) -> tuple[float, float]:
    """Thrust factor of a channel by the file, and its standard deviation; that is infinite without
    a tolerance.
    """
    tolerances = (spacecraft.dispersions or EXACT).thrust
    channel = next((channel for channel in spacecraft.channels if channel.name == name), None)
    if channel is None:
        return 1.0, math.inf
    priors = [prior_of(tolerances.get(thruster.name), 1.0) for thruster in channel.thrusters]
    mean = 1.0 + math.fsum(factor - 1.0 for factor, _ in priors) / len(priors)
    return mean, math.hypot(*(sigma for _, sigma in priors)) / len(priors) or math.inf


def prior_of(tolerance: Tolerance | None, nominal: float) -> tuple[float, float]:
    """Mean and standard deviation of a value of the file, in its unit; zero without a tolerance."""
    if tolerance is None:
        return nominal, 0.0
    size = tolerance.size * (abs(nominal) if tolerance.relative else 1.0)
    if tolerance.kind == "bias":
        return nominal + math.copysign(size, tolerance.size), 0.0
    return nominal, abs(size) * SPREAD[tolerance.kind]


def untold(record: Record) -> Iterator[Note]:
    """Quantities that signals of the kinds in a record cannot tell, whatever the file."""
    if not record.fired:
        yield note("fit-coast")
    if not record.has(GYROS[2]) and (record.has(GYROS[0]) or record.has(GYROS[1])):
        yield note("fit-without-omega-3")
    if not record.shows_spin:
        shown = ", ".join(kind.name for kind in KINDS if kind.spin)
        yield note("fit-spin-of-file", signals=shown)
