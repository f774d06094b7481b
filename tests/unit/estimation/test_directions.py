"""Directions seen from the body, and attitudes: what DOP853 flew is estimated, each within what its
sigma says.
"""

import math
import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp
from support import reference
from support.builders import present
from support.cases import deep, weekly
from support.golden import check_text
from support.telemetry import SENSED, Array

import nutdamp
from nutdamp.errors import Unsuitable
from nutdamp.estimation.fit import fit
from nutdamp.estimation.model import Fit, Model
from nutdamp.estimation.parameters import DIRECTION, SEEN, SUN_ASPECT, Record, of_quaternions
from nutdamp.estimation.results import Fitted, carried, doubts, pointings
from nutdamp.files.reader import Source
from nutdamp.files.yaml import dotted
from nutdamp.physics import attitude

TOLERANCES = {key: {"normal": "0.5 %"} for key in "AC"} | {"attitude": {"normal": "0.3 deg"}}
FILE = SENSED | {"dispersions": TOLERANCES}
NOISE = math.radians(0.05)
SLIT = 1.0
EARLY = 2e-4
"""One sigma of directions, rad; azimuth of the slit of the star sensor, rad; one sigma of Sun
pulses, s.
"""

TOLD = ("C/A", "omega_1", "omega_2", "omega_3", "growth", "attitude_3")
"""Parameters of which the file says little or nothing."""

KINDS = ("aspect", "sun crossings", "one star", "three stars", "quaternions")


class Flown(NamedTuple):
    """A file, the telemetry of a body that differs from it, true values of parameters, the
    rotation at the end, and the direction of H.
    """

    spacecraft: nutdamp.Spacecraft
    record: Record
    truth: Mapping[str, float]
    rotation: Array
    momentum: Array


def fly(seed: int, kind: str, length: float = 40.0) -> Flown:
    """A symmetric body whose sensors are tilted; by rotation matrices of DOP853 and a spline
    through them.
    """
    draw = np.random.default_rng([53, seed])
    C = 120.0 * (draw.uniform(0.5, 0.85) if seed % 2 else draw.uniform(1.15, 1.6))
    keys: dict[str, object] = {
        "inertia.C": C,
        "state.spin": float(draw.choice([-1.0, 1.0]) * draw.uniform(1.5, 4.0)),
    }
    keys |= {
        "state.nutation": f"{draw.uniform(1.0, 10.0)} deg",
        "state.phase": f"{draw.uniform(-180, 180)} deg",
    }
    body = nutdamp.load(FILE, set=keys)
    begin = Rotation.random(random_state=seed)
    while (
        not 30.0
        < math.degrees(math.acos(float(begin.as_matrix()[:, 2] @ present(body.sun))))
        < 150.0
    ):
        begin = Rotation.random(random_state=int(draw.integers(1 << 30)))
    body = body.with_(attitude={"quaternion": scalar_first(begin).tolist()})
    moments = 120.0 * (1.0 + 0.005 * draw.normal()), C * (1.0 + 0.005 * draw.normal())
    rates = body.omega0 * (1.0 + np.array([0.05, 0.05, 0.01]) * draw.normal(size=3))
    off = Rotation.from_rotvec([*(math.radians(0.3) * draw.normal(size=2)), 0.0])
    begin = begin * off * Rotation.from_rotvec([0.0, 0.0, draw.uniform(-3.0, 3.0)])
    grid = np.linspace(0.0, length, math.ceil(length * abs(body.spin) / (2.0 * math.pi) * 60))
    start = reference.Motion(rates, begin.as_matrix())
    flight = reference.path((moments[0], *moments), start, (), grid)
    tilt = math.radians(1.0) * draw.normal(size=2)
    true = Rotation.from_matrix([one.rotation for one in flight])
    record = _record(draw, kind, body, grid, true, true * Rotation.from_rotvec([*tilt, 0.0]))
    edges = record.start, record.end
    first, last = reference.path((moments[0], *moments), start, (), edges)
    truth = {"A": moments[0], "C/A": moments[1] / moments[0], "growth": 0.0}
    truth |= {"wobble_1": float(tilt[0]), "wobble_2": float(tilt[1])}
    truth |= {f"omega_{number + 1}": float(rate) for number, rate in enumerate(first.rates)}
    turned = _turned(body, record, first.rotation)
    momentum = unit(first.rotation @ ((moments[0], *moments) * first.rates))
    return Flown(body, record, truth | turned, last.rotation, momentum)


def scalar_first(rotation: Rotation) -> Array:
    """Quaternions (..., 4), scalar first."""
    return np.roll(rotation.as_quat(), 1, axis=-1)


def _turned(body: nutdamp.Spacecraft, record: Record, rotation: Array) -> dict[str, float]:
    """The true attitude, by what the file has at the start of a record: the tilt of axis 3, then
    the turn about it.
    """
    of_file = Rotation.from_quat(np.roll(Model(body, record).reference.quaternion, -1))
    apart = of_file.inv() * Rotation.from_matrix(rotation)
    turn = 2.0 * math.atan2(*apart.as_quat()[2:])
    tilt = (apart * Rotation.from_rotvec([0.0, 0.0, -turn])).as_rotvec()
    return {"attitude_1": float(tilt[0]), "attitude_2": float(tilt[1]), "attitude_3": turn}


def _record(
    draw: np.random.Generator,
    kind: str,
    body: nutdamp.Spacecraft,
    grid: Array,
    true: Rotation,
    shown: Rotation,
) -> Record:
    if kind == "quaternions":
        times = np.arange(0.0, grid[-1], 0.5)
        error = NOISE * draw.normal(size=(len(times), 3)) * np.array([1.0, 1.0, 5.0])
        seen = Slerp(grid, shown)(times) * Rotation.from_rotvec(error)
        return Record(times, of_quaternions(scalar_first(seen), body))
    sun = present(body.sun)
    if kind == "aspect":
        times = passing(grid, true.inv().apply(sun), math.radians(35.0))
        x, y, z = at(grid, shown.inv().apply(sun), times).T
        aspect = np.arctan2(np.hypot(x, y), z) + NOISE * draw.normal(size=len(times))
        return Record(
            times,
            {SUN_ASPECT: aspect},
            np.sort(np.abs(times + EARLY * draw.normal(size=len(times)))),
        )
    crossings = []
    stars = {"sun crossings": 0, "one star": 1, "sun and Earth": 1, "three stars": 3}[kind]
    for number in range("sun" not in kind, stars + 1):
        star = sun
        while number > 0 and (star is sun or abs(float(star @ true[0].as_matrix()[:, 2])) > 0.7):
            star = unit(draw.normal(size=3))
        there = shown.inv().apply(star)
        times = passing(grid, there, SLIT)
        crossings += [
            (time, to, star) for time, to in zip(times, at(grid, there, times), strict=True)
        ]
    crossings.sort(key=lambda one: float(one[0]))
    directions = np.array([one[1] for one in crossings])
    directions = unit(directions + NOISE * draw.normal(size=directions.shape))
    columns = np.column_stack([directions, [one[2] for one in crossings]])
    return Record(
        np.array([one[0] for one in crossings]),
        dict(zip((*SEEN, *DIRECTION), columns.T, strict=True)),
    )


def unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def at(grid: Array, vectors: Array, times: Array) -> Array:
    """Vectors (n, 3) between the times of a grid."""
    return np.asarray(CubicSpline(grid, vectors)(times))


def passing(grid: Array, seen: Array, azimuth: float) -> Array:
    """Times at which a direction (n, 3) in the body passes an azimuth, s."""
    turns = (np.unwrap(np.arctan2(seen[:, 1], seen[:, 0])) - azimuth) / (2.0 * math.pi)
    turns = turns * math.copysign(1.0, turns[-1] - turns[0])
    spline = CubicSpline(grid, turns)
    whole = np.arange(math.ceil(turns[0]), math.floor(turns[-1]) + 1)
    return np.array([spline.solve(float(one), extrapolate=False)[0] for one in whole])


def off(flown: Flown, fitted: Fit) -> dict[str, float]:
    """Estimates less true values, in their sigmas."""
    sigmas = dict(zip((one.name for one in fitted.model.parameters), fitted.sigmas, strict=True))
    apart = {
        name: fitted.named[name] - value for name, value in flown.truth.items() if name in sigmas
    }
    apart["attitude_3"] = math.remainder(apart["attitude_3"], 2.0 * math.pi)
    return {name: value / sigmas[name] for name, value in apart.items()}


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        *((kind, 0) for kind in ("three stars", "quaternions")),
        *(deep(kind, 0) for kind in ("aspect", "sun crossings", "one star")),
        *(deep(kind, 1) for kind in KINDS),
    ],
)
def test_what_flew_is_estimated_within_the_sigmas(kind: str, seed: int) -> None:
    """The attitude at the end of the record too."""
    flown = fly(seed, kind)
    fitted = fit(flown.spacecraft, flown.record)
    assert not {name: value for name, value in off(flown, fitted).items() if not abs(value) < 4.0}
    assert fitted.sigmas[fitted.index("C/A") or 0] < 5e-4
    known = carried(fitted, flown.record.end)
    axis = Rotation.from_quat(np.roll(known.quaternion, -1)).as_matrix()[:, 2]
    assert reference.angle(axis, flown.rotation[:, 2]) < 4.0 * present(known.tilt)


@pytest.mark.parametrize("kind", [weekly(kind) for kind in KINDS])
def test_estimates_are_off_as_often_as_their_sigmas_say(kind: str) -> None:
    """Of 24 records, each parameter; the rms of so many is within
    0.45 of 1 in all but 1 of 1000.
    """
    flights = [fly(100 + seed, kind) for seed in range(24)]
    apart = [off(flown, fit(flown.spacecraft, flown.record)) for flown in flights]
    sizes = {
        name: math.sqrt(float(np.mean([one[name] ** 2 for one in apart if name in one])))
        for name in TOLD
    }
    assert not {name: size for name, size in sizes.items() if not abs(size - 1.0) < 0.45}


@pytest.mark.deep
def test_the_axis_is_off_as_its_covariance_says() -> None:
    """Sun and Earth seen once a turn: of 20 records the sum of what spin axis and H are off, over
    their covariances, is χ² of 40 degrees of freedom, in [16, 78] but for 1 of 2000.
    """
    sums = {"spin axis": 0.0, "H": 0.0}
    for seed in range(20):
        flown = fly(200 + seed, "sun and Earth")
        fitted = fit(flown.spacecraft, flown.record)
        sense = math.copysign(1.0, flown.spacecraft.spin)
        truth = {"spin axis": sense * flown.rotation[:, 2], "H": flown.momentum}
        for row in pointings(fitted, flown.record.end):
            x, y, _ = row.direction
            east = np.array([-y, x, 0.0]) / math.hypot(x, y)
            off = np.stack([east, np.cross(row.direction, east)]) @ truth[row.name]
            sums[row.name] += float(off @ np.linalg.solve(row.covariance, off))
    assert not {name: size for name, size in sums.items() if not 16.0 < size < 78.0}


@pytest.mark.parametrize(
    ("kind", "source"), [("one star", "both"), ("aspect", "both"), ("quaternions", "data")]
)
def test_what_the_record_shows_of_the_axis_is_said(kind: str, source: str) -> None:
    """About one direction it is that of the file."""
    flown = fly(0, kind)
    rows = pointings(fit(flown.spacecraft, flown.record), flown.record.start)
    assert [(row.name, row.source) for row in rows] == [("spin axis", source), ("H", source)]


@pytest.mark.parametrize("of", ["axis", "momentum"])
def test_a_file_with_spin_axis_and_phase_gets_them_back(of: str) -> None:
    flown = fly(0, "quaternions")
    source = flown.spacecraft.source
    assert isinstance(source, Source)
    settings = {
        dotted(each.path): each.value for each in source.settings if each.path[0] != "attitude"
    }
    keys = {"spin_axis": ["80 deg", "0.1 rad"], "phase": "30 deg", "of": of}
    keys["epoch"] = "2026-03-01T12:00:00Z"
    spacecraft = nutdamp.load(FILE | {"attitude": keys}, set=settings)
    fitted = Fitted(fit(spacecraft, flown.record))
    text = fitted.text(flown.record.end)
    written = r"\[[0-9.]+ deg, -?[0-9.]+ rad\],\s+.phase.: -?[0-9.]+ deg,\s+.of.: ." + of
    assert re.search(written, text)
    moved = fitted.spacecraft(flown.record.end)
    rows = {row.name: row for row in pointings(fitted.core, flown.record.end)}
    assert reference.angle(moved.axis, rows["spin axis"].direction) < 1e-9
    assert reference.angle(moved.momentum, rows["H"].direction) < 1e-9
    apart = attitude.multiply(
        attitude.conjugate(present(moved.attitude).quaternion),
        carried(fitted.core, flown.record.end).quaternion,
    )
    assert np.linalg.norm(apart[1:]) < 1e-9


def test_a_quaternion_tells_what_the_axis_alone_does_not() -> None:
    flown = fly(0, "quaternions")
    fitted = fit(flown.spacecraft, flown.record)
    assert fitted.model.signals == ("axis", "turn")
    assert fitted.noise == pytest.approx([NOISE, 5.0 * NOISE], rel=0.2)
    assert not list(doubts(fitted))


def test_the_attitude_about_one_direction_is_that_of_the_file() -> None:
    """Of two it is told; without a tolerance of the file, one leaves it as it is there."""
    one, three = (
        Model(each.spacecraft, each.record) for each in (fly(0, "one star"), fly(0, "three stars"))
    )
    for model, finite in ((one, True), (three, False)):
        assert math.isfinite(present(model.parameter("attitude_1")).prior) == finite
    body = one.spacecraft.replace(dispersions=None)
    assert Model(body, one.record).parameter("attitude_1") is None


def test_the_file_must_have_what_a_direction_needs() -> None:
    bare = nutdamp.load({name: FILE[name] for name in ("name", "inertia", "state")})
    texts = []
    for kind in ("aspect", "one star"):
        record = fly(0, kind).record
        with pytest.raises(Unsuitable) as raised:
            fit(bare, Record(record.times, record.signals))
        texts.append(str(raised.value))
    check_text("estimation.directions-refused", "\n".join(texts))
