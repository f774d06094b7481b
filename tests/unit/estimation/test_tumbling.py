"""Large nutations, seen by the axis alone: it goes round a cone, which no small motion about a mean
axis is.
"""

import math

import numpy as np
import pytest
from support import reference
from support.cases import spread
from support.places import case

import nutdamp
from nutdamp.estimation.fit import fit
from nutdamp.estimation.parameters import AXIS, Record
from nutdamp.estimation.results import estimates
from nutdamp.estimation.search import Fit
from nutdamp.files.telemetry import read_telemetry
from nutdamp.physics import attitude


def nutation(fitted: Fit) -> tuple[float, float]:
    """The nutation angle and its sigma, rad."""
    (found,) = (one for one in estimates(fitted, 0.0) if one.key == "nutation")
    return found.value, found.sigma


def test_an_axis_that_goes_round_a_cone_of_forty_degrees_shows_a_nutation() -> None:
    body = nutdamp.load(case("axis-tumble.yaml"))
    angle, sigma = nutation(fit(body, read_telemetry(case("axis-tumble.csv"), body)[0]))
    assert math.degrees(angle) == pytest.approx(41.47, abs=0.2)
    assert math.degrees(sigma) < 0.1


@spread("seed", range(40), quick=0, deep=2)
def test_cones_of_any_angle_are_found(seed: int) -> None:
    """15 to 65 deg, prolate and oblate, both spins, with moments and rates within the tolerances of
    the file.
    """
    draw = np.random.default_rng([77, seed])
    C = 240.0 * (draw.uniform(0.45, 0.85) if seed % 2 else draw.uniform(1.15, 1.8))
    facing = draw.normal(size=4)
    spin = draw.choice([-1.0, 1.0]) * draw.uniform(0.8, 4.0)
    body = nutdamp.load(
        {
            "name": "tumbling",
            "inertia": {"A": 240.0, "C": C},
            "state": {
                "spin": spin,
                "nutation": f"{draw.uniform(15.0, 65.0)} deg",
                "phase": f"{draw.uniform(0, 360)} deg",
            },
            "attitude": {
                "quaternion": (facing / np.linalg.norm(facing)).tolist(),
                "epoch": "2026-03-01T12:00:00Z",
                "frame": "EME2000",
            },
            "dispersions": {
                "A": {"normal": "1 %"},
                "C": {"normal": "1 %"},
                "omega0": {"normal": "0.3 deg/s"},
            },
        }
    )
    A, C = 240.0 * (1.0 + 0.01 * draw.normal()), C * (1.0 + 0.01 * draw.normal())
    rates = body.omega0 + math.radians(0.3) * draw.normal(size=3)
    pace = float(np.linalg.norm(np.array([A, A, C]) * rates)) / A
    times = np.linspace(0.0, draw.uniform(4.0, 12.0) * 2.0 * math.pi / pace, 250)[1:]
    start = reference.Motion(rates, attitude.matrix(body.initial.quaternion))
    axis = np.array(
        [
            math.copysign(1.0, spin) * one.rotation[:, 2]
            for one in reference.coast((A, A, C), start, np.zeros(3), times)
        ]
    )
    axis += 10.0 ** draw.uniform(-4.5, -2.5) * draw.normal(size=axis.shape)
    fitted = fit(
        body, Record(times, dict(zip(AXIS, axis.T / np.linalg.norm(axis, axis=1), strict=True)))
    )
    angle, sigma = nutation(fitted)
    expected = math.atan2(A * math.hypot(rates[0], rates[1]), C * abs(rates[2]))
    assert abs(angle - expected) < 4.0 * sigma < math.radians(3.0)
    ratio = fitted.index("C/A") or 0
    assert abs(fitted.values[ratio] - C / A) < 4.0 * fitted.sigmas[ratio]
