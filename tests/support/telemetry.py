"""Synthetic telemetry by DOP853, of every kind of column, and fits whose values are given."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation
from support import reference

import nutdamp
from nutdamp.common.time import Epoch
from nutdamp.estimation.model import Fit, Model
from nutdamp.estimation.parameters import GYROS, Record
from nutdamp.files.telemetry import read_telemetry
from nutdamp.physics import attitude
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

# --- synthetic telemetry by DOP853 with noise, gaps, outliers, steps and biases

Array = NDArray[np.float64]

SIGMA = 0.005
"""Standard deviation of A and C in the files, as a share."""

GYRO_BIAS = math.radians(0.02)
"""Standard deviation of the biases, as fits take it where a file says nothing."""


@dataclass(frozen=True, eq=False)
class Case:
    """A file, the record of a body that differs from it,
    and the true values of what is estimated.
    """

    spacecraft: nutdamp.Spacecraft
    record: Record
    truth: dict[str, float]
    noise: float


def motion(
    moments: tuple[float, float, float], rates: Array, times: Array, growth: float = 0.0
) -> Array:
    """Body rates (n, 3) at ``times`` (n,) s from 0, rad/s."""
    start = reference.Motion(rates, np.eye(3))
    return np.array([one.rates for one in reference.path(moments, start, (), times, growth)])


def gyro_case(seed: int) -> Case:
    """A minute or so of gyro data of a body of either shape and sense, by ``seed``."""
    draw = np.random.default_rng([16, seed])
    prolate = seed % 2 == 0
    A = 120.0
    C = A * (draw.uniform(0.45, 0.85) if prolate else draw.uniform(1.15, 1.8))
    spin = (-1.0 if seed % 4 > 1 else 1.0) * draw.uniform(0.8, 4.0)
    nutation = math.radians(draw.uniform(0.5, 15.0))
    phase = draw.uniform(-math.pi, math.pi)
    nominal = nutdamp.load(
        {
            "name": "synthetic",
            "inertia": {"A": A, "C": C},
            "state": {
                "spin": spin,
                "nutation": f"{math.degrees(nutation)} deg",
                "phase": f"{math.degrees(phase)} deg",
            },
            "dispersions": {"A": {"normal": "0.5 %"}, "C": {"normal": "0.5 %"}},
        }
    )
    truth = {"A": A * (1.0 + SIGMA * draw.normal()), "C": C * (1.0 + SIGMA * draw.normal())}
    rates = nominal.omega0 + math.radians(0.5) * draw.normal(size=3)
    truth |= {f"omega_{number}": float(rates[number - 1]) for number in (1, 2, 3)}
    growing = draw.uniform() < 0.5
    truth["growth"] = draw.uniform(0.0005, 0.003) * (1.0 if prolate else -1.0) if growing else 0.0
    period = 2.0 * math.pi / abs(1.0 - truth["C"] / truth["A"]) / abs(spin)
    length = draw.uniform(3.0, 12.0) * period
    count = int(draw.integers(150, 500))
    times = (
        np.sort(draw.uniform(0.0, length, count))
        if draw.uniform() < 0.3
        else np.linspace(0.0, length, count)
    )
    times -= times[0]
    rates_ = motion((truth["A"], truth["A"], truth["C"]), rates, times, truth["growth"])
    tilt = math.radians(1.0) * draw.normal(size=2)
    bias = GYRO_BIAS * draw.normal(size=3)
    truth |= {"misalignment_1": float(tilt[0]), "misalignment_2": float(tilt[1])}
    truth |= {f"bias_{name}": float(one) for name, one in zip(GYROS, bias, strict=True)}
    turned = Rotation.from_rotvec([-tilt[0], -tilt[1], 0.0]).apply(rates_)
    noise = math.radians(10.0 ** draw.uniform(-2.5, -1.3))
    shown = turned + bias + noise * draw.normal(size=turned.shape)
    outliers = draw.uniform(size=shown.shape) < draw.choice([0.0, 0.01, 0.03])
    shown = np.where(
        outliers,
        shown + noise * draw.choice([-1.0, 1.0], shown.shape) * draw.uniform(15, 500, shown.shape),
        shown,
    )
    if draw.uniform() < 0.5:  # steps up to twice the noise
        step = draw.uniform(0.5, 2.0) * noise
        shown = np.rint(shown / step) * step
    gaps = draw.uniform(size=shown.shape) < draw.choice([0.0, 0.1, 0.3])
    if draw.uniform() < 0.3:
        begin = draw.uniform(0.2, 0.6) * length
        gaps |= ((times > begin) & (times < begin + 0.2 * length))[:, None]
    shown = np.where(gaps, np.nan, shown)
    record = Record(times, {name: shown[:, at] for at, name in enumerate(GYROS)})
    return Case(nominal, record, truth, noise)


# --- synthetic telemetry of every kind of column, as CSV files, flown by DOP853

KINDS = (
    ("omega_12",),
    ("omega_123",),
    ("omega_123", "fired"),
    ("omega_1",),
    ("radec",),
    ("axis",),
    ("omega_123", "radec"),
    ("omega_12", "axis"),
    ("acceleration",),
    ("acceleration", "omega_3"),
    ("omega_123", "sun_times"),
    ("omega_12", "sun_column"),
    ("axis", "sun_times"),
)
"""Columns of the records, in turn."""

EPOCH = "2026-03-01T12:00:00Z"
BIAS, TILT, ATTITUDE = math.radians(0.02), math.radians(1.0), math.radians(0.3)
"""Standard deviations of gyro biases, of tilts of sensors, and of the attitude of the file."""

TOLERANCES: dict[str, object] = {
    "A": {"normal": "0.5 %"},
    "C": {"normal": "0.5 %"},
    "omega0": {"normal": "0.3 deg/s"},
    "thrust": {"normal": "3 %"},
}
ATTITUDE_OF_FILE = {"quaternion": [1, 0.1, 0.2, 0.3], "epoch": EPOCH, "frame": "EME2000"}
ACCELEROMETER: dict[str, object] = {
    "sensor": {
        "kind": "accelerometer",
        "rate": "10 Hz",
        "position": ["0.8 m", 0, 0],
        "axis": [0, 0, 1],
    },
    "law": "four-pulse",
    "start": "0.5 deg",
    "stop": "0.05 deg",
}
SENSED: dict[str, object] = {
    "name": "sensed",
    "inertia": {"A": 120.0, "C": 84.0},
    "state": {"spin": 3.0, "nutation": "4 deg", "phase": "20 deg"},
    "attitude": ATTITUDE_OF_FILE,
    "sun": "epoch",
    "sun_sensor": {"azimuth": "35 deg"},
    "thrusters": [{"name": "T1", "torque": [8, 0, 0]}, {"name": "T2", "torque": [0, 8, 0]}],
    "dispersions": TOLERANCES,
}
"""The file of a body with a Sun sensor and two thrusters."""

FARTHEST = math.cos(math.radians(25.0))
"""Cosine of the angle of the Sun from the axis, at most: nutations are half of that."""


@dataclass(frozen=True, eq=False)
class Telemetry:
    """A file, the record of a body that differs from it, and true values of what is estimated."""

    spacecraft: nutdamp.Spacecraft
    record: Record
    truth: dict[str, float]
    kind: str


def file_of(draw: np.random.Generator, seed: int) -> tuple[nutdamp.Spacecraft, bool]:
    """A spacecraft file, and whether it is prolate; the Sun goes round the sensor."""
    body, prolate = _any_file(draw, seed)
    again = np.random.default_rng([18, seed])
    up = np.array([0.0, 0.0, 1.0])
    assert body.sun is not None
    while abs(float(attitude.rotate(body.initial.quaternion, up) @ body.sun)) > FARTHEST:
        facing = again.normal(size=4)
        body = body.with_(attitude={"quaternion": (facing / np.linalg.norm(facing)).tolist()})
        assert body.sun is not None
    return body, prolate


def _any_file(draw: np.random.Generator, seed: int) -> tuple[nutdamp.Spacecraft, bool]:
    prolate = bool(draw.uniform() < 0.6)
    C = 120.0 * (draw.uniform(0.45, 0.85) if prolate else draw.uniform(1.15, 1.7))
    spin = (-1.0 if draw.uniform() < 0.5 else 1.0) * draw.uniform(0.8, 4.0)
    facing = draw.normal(size=4)
    state = {
        "spin": spin,
        "nutation": f"{draw.uniform(1.0, 12.0)} deg",
        "phase": f"{draw.uniform(-180, 180)} deg",
    }
    keys = {
        "name": f"kind {seed}",
        "inertia": {"A": 120.0, "C": C},
        "state": state,
        "attitude": ATTITUDE_OF_FILE | {"quaternion": (facing / np.linalg.norm(facing)).tolist()},
        "loop": ACCELEROMETER,
        "dispersions": TOLERANCES | {"attitude": {"normal": "0.3 deg"}},
    }
    return nutdamp.load(SENSED | keys), prolate


def telemetry(folder: Path, seed: int, kind: tuple[str, ...] | None = None) -> Telemetry:
    """Record number ``seed``, of a kind or of that whose turn it is, from a CSV in ``folder``."""
    draw = np.random.default_rng([17, seed])
    kind = kind or KINDS[seed % len(KINDS)]
    body, prolate = file_of(draw, seed)
    A, C = 120.0 * (1.0 + 0.005 * draw.normal()), body.inertia.C * (1.0 + 0.005 * draw.normal())
    rates = body.omega0 + math.radians(0.3) * draw.normal(size=3)
    turn = np.array([*(ATTITUDE * draw.normal(size=2)), draw.uniform(-1.0, 1.0)])
    if kind in (("radec",), ("axis",)):  # which do not show how the body is turned about the axis
        turn[2] = 0.0
    truth = {"A": A, "C": C, "C/A": C / A} | {
        f"omega_{at + 1}": float(one) for at, one in enumerate(rates)
    }
    truth |= {f"attitude_{at + 1}": float(one) for at, one in enumerate(turn)}
    growing = draw.uniform() < 0.4 and "fired" not in kind
    truth["growth"] = draw.uniform(0.0005, 0.003) * (1.0 if prolate else -1.0) if growing else 0.0
    size = float(np.hypot(*turn[:2]))
    tilted = np.array([math.cos(0.5 * size), *(math.sin(0.5 * size) / size * turn[:2]), 0.0])
    turned = np.array([math.cos(0.5 * turn[2]), 0.0, 0.0, math.sin(0.5 * turn[2])])
    quaternion = attitude.multiply(body.initial.quaternion, attitude.multiply(tilted, turned))
    period = 2.0 * math.pi / abs(1.0 - C / A) / abs(rates[2])
    length = draw.uniform(4.0, 12.0) * period
    count = int(draw.integers(200, 500))
    times: Array = np.linspace(0.0, length, count).round(6)
    fired = _fired(draw, body, length) if "fired" in kind else Schedule()
    flight = _Flight(
        (A, A, C), reference.Motion(rates, attitude.matrix(quaternion)), truth, draw, fired
    )
    columns = _columns(draw, kind, body, flight, times, truth)
    path = folder / f"{seed}.csv"
    sun = None
    utc = draw.uniform() < 0.3
    begin = Epoch.parse(EPOCH)
    stamps = [begin.plus(float(one)).text if utc else f"{one:.6f}" for one in times]
    rows = (
        [stamp, *("" if math.isnan(one[at]) else repr(float(one[at])) for one in columns.values())]
        for at, stamp in enumerate(stamps)
    )
    header = ["utc" if utc else "t_s", *columns]
    path.write_text("".join(",".join(row) + "\n" for row in (header, *rows)), encoding="utf-8")
    if "sun_times" in kind:
        sun = folder / f"{seed}-sun.csv"
        seen = flight.sun(body, length) + 10.0 ** draw.uniform(-4, -2.5) * draw.normal(
            size=len(flight.sun(body, length))
        )
        seen = seen[(draw.uniform(size=len(seen)) > 0.05) & (seen > 0.0)]
        sun.write_text("t_s\n" + "".join(f"{one:.6f}\n" for one in seen), encoding="utf-8")
    return Telemetry(body, read_telemetry(path, body, sun, fired)[0], truth, "+".join(kind))


def _fired(draw: np.random.Generator, body: nutdamp.Spacecraft, length: float) -> Schedule:
    pulses = zip(body.channels, (0.3, 0.65), strict=True)
    return Schedule(
        tuple(channel_pulse(one, share * length, draw.uniform(0.3, 0.8)) for one, share in pulses)
    )


class _Flight:
    """The true motion at any times, through the pulses."""

    def __init__(
        self,
        moments: tuple[float, float, float],
        start: reference.Motion,
        truth: dict[str, float],
        draw: np.random.Generator,
        fired: Schedule,
    ) -> None:
        """Draws thrust factors and delays of the channels of ``fired`` into ``truth``."""
        self.moments = moments
        self.growth = truth["growth"]
        self.start = start
        self.events = list[reference.Push]()
        for pulse in fired:
            factor = 1.0 + 0.03 * draw.normal()
            late = 0.05 * draw.normal()
            truth |= {f"thrust {pulse.channel}": factor, f"delay {pulse.channel}": late}
            assert pulse.torque is not None
            pushed = pulse.start + late, pulse.end + late, factor * pulse.torque
            self.events.append(reference.Push(*pushed))

    def at(self, times: Array) -> list[reference.Motion]:
        """The motion at rising times."""
        return reference.path(self.moments, self.start, self.events, times, self.growth)

    def change(self, rates: Array) -> Array:
        """dω/dt (n, 3) on a coast: H stands still in space, and the body turns with ω and what
        dissipation adds.

        Not by differences of the motion, whose errors are as large as the noise of an
        accelerometer.
        """
        momentum = rates * np.array(self.moments)
        along = momentum / np.linalg.norm(momentum, axis=1, keepdims=True)
        slip = self.growth * along[:, 2:] * np.cross(along, np.array([0.0, 0.0, 1.0]))
        return np.asarray(-np.cross(rates + slip, momentum) / np.array(self.moments))

    def sun(self, body: nutdamp.Spacecraft, length: float) -> Array:
        """When the Sun passes the azimuth of the sensor, s."""
        assert body.sun is not None
        assert body.sun_sensor is not None
        times = np.linspace(0.0, length, math.ceil(length * abs(body.spin) / (2.0 * math.pi) * 80))
        seen = np.array([one.rotation.T @ body.sun for one in self.at(times)])
        angle = np.unwrap(np.arctan2(seen[:, 1], seen[:, 0])) - body.sun_sensor.azimuth
        turns = -math.copysign(1.0, body.spin) * angle / (2.0 * math.pi)
        spline = CubicSpline(times, turns)
        whole = np.arange(math.ceil(turns[0]), math.floor(turns[-1]) + 1)
        return np.array([spline.solve(float(one), extrapolate=False)[0] for one in whole])


def _columns(
    draw: np.random.Generator,
    kind: tuple[str, ...],
    body: nutdamp.Spacecraft,
    flight: _Flight,
    times: Array,
    truth: dict[str, float],
) -> dict[str, Array]:
    """Columns with noise, outliers, steps and gaps;
    what their sensors are off goes into ``truth``.
    """
    motions = flight.at(times)
    made = {}
    rates = np.array([one.rates for one in motions])
    noise = 10.0 ** draw.uniform(-2.5, -1.3) * math.pi / 180.0
    sense = math.copysign(1.0, body.spin)
    if any(one.startswith("omega") for one in kind):
        tilt, bias = TILT * draw.normal(size=2), BIAS * draw.normal(size=3)
        shown = Rotation.from_rotvec([*-tilt, 0.0]).apply(rates) + bias
        which = next(one for one in kind if one.startswith("omega")).removeprefix("omega_")
        if "3" not in which or which == "3":  # without misalignment, which is no parameter then
            shown = rates + bias
        truth |= {f"misalignment_{at + 1}": float(one) for at, one in enumerate(tilt)}
        truth |= {f"bias_{name}": float(one) for name, one in zip(GYROS, bias, strict=True)}
        unit, factor = ("rad_s", 1.0) if draw.uniform() < 0.5 else ("deg_s", 180.0 / math.pi)
        for number in which:
            values = _spoilt(draw, shown[:, int(number) - 1], noise)
            made[f"omega_{number}_{unit}"] = values * factor
    if "acceleration" in kind:
        arm = np.array([0.8, 0.0, 0.0])
        change = flight.change(rates)
        truth["bias_acceleration"] = 0.002
        felt = (np.cross(change, arm) + np.cross(rates, np.cross(rates, arm)))[:, 2] + 0.002
        made["acceleration_m_s2"] = _spoilt(draw, felt, 0.3 * noise)
    if "radec" in kind or "axis" in kind:
        wobble = TILT * draw.normal(size=2)
        truth |= {"wobble_1": float(wobble[0]), "wobble_2": float(wobble[1])}
        along = Rotation.from_rotvec([*wobble, 0.0]).apply(np.array([0.0, 0.0, 1.0]))
        axis = sense * np.array([one.rotation @ along for one in motions])
        axis = axis + noise * draw.normal(size=axis.shape)
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        axis[draw.uniform(size=len(axis)) < draw.choice([0.0, 0.1, 0.3])] = math.nan
        made |= (
            dict(zip(("axis_x", "axis_y", "axis_z"), axis.T, strict=True))
            if "axis" in kind
            else {
                "axis_ra_deg": np.degrees(np.arctan2(axis[:, 1], axis[:, 0])) % 360.0,
                "axis_dec_deg": np.degrees(np.arcsin(axis[:, 2])),
            }
        )
    if "star" in kind or "sun" in kind:
        assert body.sun is not None
        to = np.array([-0.6, 0.64, 0.48]) if "star" in kind else body.sun
        x, y, z = np.array([one.rotation.T @ to for one in motions]).T
        made["crossing_azimuth_deg"] = np.degrees(
            np.arctan2(y, x) + noise * draw.normal(size=len(x))
        )
        made["crossing_elevation_deg"] = np.degrees(np.arcsin(z) + noise * draw.normal(size=len(x)))
        if "star" in kind:
            made["crossing_ra_deg"] = np.full(len(x), math.degrees(math.atan2(to[1], to[0])))
            made["crossing_dec_deg"] = np.full(len(x), math.degrees(math.asin(to[2])))
    if "quaternion" in kind:
        about = Rotation.from_rotvec(noise * draw.normal(size=(len(motions), 3)))
        x, y, z, w = (Rotation.from_matrix([one.rotation for one in motions]) * about).as_quat().T
        made |= {"q_w": w, "q_x": x, "q_y": y, "q_z": z}
    if "sun_column" in kind:
        seen = flight.sun(body, float(times[-1]))
        made["sun_pulse"] = np.zeros(len(times))
        made["sun_pulse"][np.searchsorted(times, seen)] = 1.0
    return made


def _spoilt(draw: np.random.Generator, values: Array, noise: float) -> Array:
    shown = values + noise * draw.normal(size=len(values))
    outliers = draw.uniform(size=len(values)) < draw.choice([0.0, 0.02])
    shown = np.where(outliers, shown + noise * draw.choice([-1.0, 1.0], len(values)) * 100.0, shown)
    if draw.uniform() < 0.3:
        step = draw.uniform(0.5, 1.5) * noise
        shown = np.rint(shown / step) * step
    return np.asarray(
        np.where(draw.uniform(size=len(values)) < draw.choice([0.0, 0.2]), math.nan, shown)
    )


# --- fits whose values and sigmas are given, as if a record had told them


def silent(
    *signals: str, until: float = 10.0, count: int = 11, schedule: Schedule | None = None
) -> Record:
    """A record of ``signals`` that are all zero but for the axis, which points along z."""
    zeros = {name: np.full(count, float(name == "axis_z")) for name in signals}
    return Record(np.linspace(0.0, until, count), zeros, schedule=schedule or Schedule())


def told(
    body: Spacecraft,
    record: Record,
    given: Mapping[str, float],
    sigmas: Mapping[str, float],
    *,
    unequal: bool = False,
) -> Fit:
    """The ``given`` values of parameters, others as in the file; known to a step if alone."""
    model = Model(body, record, unequal=unequal)
    parameters = model.parameters
    unknown = ({*given} | {*sigmas}) - {one.name for one in parameters}
    assert not unknown, unknown
    values = np.array([given.get(one.name, one.file) for one in parameters])
    covariance = np.diag([sigmas.get(one.name, one.step) ** 2 for one in parameters])
    count = len(model.measured)
    used = np.ones(count, dtype=bool)
    noise = np.ones(len(model.signals))
    return Fit(
        model, values, covariance, noise, used, np.zeros(count), np.zeros((count, len(parameters)))
    )
