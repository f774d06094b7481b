"""Spin and nutation of a body that is symmetric about its third axis, as attitude data messages have them.

Euler angles Z-X-Z (504.0-B-2, annex F5): the third body axis turns about H at |H|/A, and the body about that axis at ω3
less its share of that turn, aω3 (Poinsot). A body that spins backwards has its third axis at more than 90 deg from H.
Both rates are those of the moment, under torque too: ω = (|H|/A) h + aω3 e3 whatever moves H.
"""

from __future__ import annotations

import math

import numpy as np

from nutdamp.physics import attitude
from nutdamp.rounding import cleaned
from nutdamp.spacecraft import Inertia, Vector

AXIS = 1e-12
"""Tilt in rad up to which the symmetry axis counts as the third axis of the file."""

FULL = 2.0 * math.pi


def spinning(inertia: Inertia) -> bool:
    """Whether the model of these keywords is that of the body."""
    return inertia.symmetric and math.hypot(*inertia.axes[:2, 2]) <= AXIS


def spin_values(inertia: Inertia, rates: Vector, quaternion: Vector) -> dict[str, Vector]:
    """Every keyword of the spin, (n,) each in deg, deg/s and s, for a motion in the axes of the file.

    ``rates`` (n, 3) rad/s; ``quaternion`` (n, 4) body -> frame, scalar first.
    """
    first, second, third = (cleaned(attitude.rotate(quaternion, axis)) for axis in np.eye(3))
    right_ascension, declination = _on_sphere(third)
    # The first axis after the first two turns is the node; the angle from it to body axis 1 is the third.
    node = cleaned(np.stack([-np.sin(right_ascension), np.cos(right_ascension), 0.0 * declination], axis=-1))
    momentum = rates @ inertia.tensor
    size, transverse = np.linalg.norm(momentum, axis=-1), np.hypot(momentum[:, 0], momentum[:, 1])
    phase = np.where(transverse > 0.0, np.arctan2(-momentum[:, 1], momentum[:, 0]), 0.0)
    of_momentum = _on_sphere(cleaned(attitude.rotate(quaternion, momentum)))
    along = [np.sum(node * axis, axis=-1) for axis in (first, second)]
    return {
        "SPIN_ALPHA": np.degrees(right_ascension),
        "SPIN_DELTA": np.degrees(declination),
        "SPIN_ANGLE": np.degrees(np.arctan2(-along[1], along[0])),
        "SPIN_ANGLE_VEL": np.degrees(inertia.a * rates[:, 2]),
        "NUTATION": np.degrees(np.arctan2(transverse, momentum[:, 2])),
        "NUTATION_PER": FULL * inertia.A / size,
        "NUTATION_PHASE": np.degrees(phase),
        "MOMENTUM_ALPHA": np.degrees(of_momentum[0]),
        "MOMENTUM_DELTA": np.degrees(of_momentum[1]),
        "NUTATION_VEL": np.degrees(size / inertia.A),
    }


def _on_sphere(vectors: Vector) -> tuple[Vector, Vector]:
    """Right ascension in [0, 2π) and declination of vectors (n, 3), rad; the former is 0 at a pole."""
    x, y, z = vectors.T
    turned = np.arctan2(y, x) % FULL
    return np.where(turned < FULL, turned, 0.0), np.arctan2(z, np.hypot(x, y))
