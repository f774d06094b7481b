"""Axes of frames against numbers of ERFA, by angles that nutdamp does not use."""

import numpy as np
import pytest

from nutdamp.common.time import Epoch
from nutdamp.errors import BadRequest
from nutdamp.physics import attitude, frames

DIRECTION = np.radians([312.5, -21.25])

# Right ascension and declination in EME2000, deg, of DIRECTION in a frame: by pyerfa 2.0.1,
# R1(ε_A) R3(-z_A) R2(θ_A) R3(-ζ_A) of eraP06e, and without R1 for MOD.
ROWS = (
    ("ECLIPJ2000", None, 322.3214378685162, -37.29090983524017),
    ("ECLIPDATE", "1978-08-12T15:12:00Z", 322.65223425754056, -37.19815664216941),
    ("ECLIPDATE", "2026-03-01T12:00:00Z", 321.9159296104716, -37.40378473691797),
    ("ECLIPDATE", "2090-07-01T00:00:00Z", 320.91479700129355, -37.678544771399864),
    ("MOD", "1978-08-12T15:12:00Z", 312.80797708754466, -21.16931725186092),
    ("MOD", "2026-03-01T12:00:00Z", 312.1227961338028, -21.348044238931866),
    ("MOD", "2090-07-01T00:00:00Z", 311.19310282155266, -21.586043426183036),
)


@pytest.mark.parametrize(("frame", "epoch", "right_ascension", "declination"), ROWS)
def test_directions_are_those_of_erfa(
    frame: str, epoch: str | None, right_ascension: float, declination: float
) -> None:
    days = 0.0 if epoch is None else Epoch.parse(epoch).days_of_j2000
    seen = frames.frame_axes(frame, days) @ frames.on_sphere(*DIRECTION)
    expected = frames.on_sphere(*np.radians([right_ascension, declination]))
    assert float(attitude.angle_between(seen, expected)) < np.radians(1e-9)


def test_the_bias_of_the_celestial_frame_is_that_of_erfa() -> None:
    # eraBp06, rows.
    bias = [
        [0.9999999999999941, -7.078368960971556e-08, 8.056213977613186e-08],
        [7.078368694637676e-08, 0.9999999999999969, 3.3059437354321375e-08],
        [-8.056214211620057e-08, -3.305943169218395e-08, 0.9999999999999962],
    ]
    # which takes ξ0 from dψ sin ε0: 0.3 µas off
    assert frames.frame_axes("GCRF") == pytest.approx(np.array(bias), abs=2e-12)


def test_names_without_precession_and_unknown_ones() -> None:
    for name in (None, "EME2000", "J2000"):
        assert np.array_equal(frames.frame_axes(name), np.eye(3))
    with pytest.raises(BadRequest, match="'TEME' is no frame"):
        frames.frame_axes("TEME")
