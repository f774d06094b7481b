"""Reference frames, directions by two angles, and attitudes by the direction of a body axis.

Vectors are (3,); quaternions are those of `attitude`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import BadRequest
from nutdamp.physics.attitude import from_matrix, matrix

Array = NDArray[np.float64]

PRECESSED = ("ECLIPJ2000", "ECLIPDATE", "MOD")
"""Frames that no message and no other program is written in; the last two are of date."""


ARCSECOND = math.radians(1.0 / 3600.0)


PRECESSION = (
    (0.0000000260, -0.000002788, -0.00031238, 0.4932044, 10.556403, 0.0),
    (-0.0000000176, -0.000000440, 0.00053289, 0.0511269, -46.811015, 84381.406),
    (-0.0000000148, -0.000026452, -0.00018522, 1.5584176, 5038.481507, 0.0),
    (-0.0000000434, -0.000000576, 0.00200340, -0.0001831, -46.836769, 84381.406),
)
"""Angles γ, φ and ψ of Fukushima and Williams and the obliquity of date, arcseconds, by powers of
the centuries since J2000.0 from the highest down: precession IAU 2006, N. Capitaine, P. T. Wallace
and J. Chapront 2003, A&A 412, 567, as in ``iauP06e`` of SOFA.
"""


BIAS = (-0.0146, -0.016617, -0.0068192)
"""dα0, ξ0 and η0 of GCRF, arcseconds: IERS Conventions 2003, chapter 5."""


POLE = 1e-9  # rad from a pole of the frame, up to which an axis has no ascending node


def about_axis(body_axis: Array, body_side: Array, axis: Array, side: Array, phase: float) -> Array:
    """Quaternion (4,) body -> inertial that lays a ``body_axis`` (3,) along an inertial ``axis``
    (3,), unit vectors.

    ``phase`` rad about it leads from an inertial ``side`` (3,) to a ``body_side`` (3,), both seen
    along the axis.
    """
    frames = []
    for along, towards in ((body_axis, body_side), (axis, side)):
        across = np.cross(along, towards)
        across /= np.linalg.norm(across)
        frames.append(np.column_stack([np.cross(across, along), across, along]))
    cosine = math.cos(phase)
    sine = math.sin(phase)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return from_matrix(frames[1] @ turn @ frames[0].T)


def phase_about(towards: Array, axis: Array, side: Array) -> float:
    """Angle, rad, about an inertial ``axis`` (3,) from a ``side`` to a direction (3,), both seen
    along it: the phase of `about_axis`.
    """
    sine = np.dot(axis, np.cross(side, towards))
    cosine = np.dot(side, towards) - np.dot(side, axis) * np.dot(towards, axis)
    return math.atan2(sine, cosine)


def ascending_node(axis: Array) -> Array:
    """Direction (3,) of the ascending node of an inertial unit ``axis`` (3,): z × axis; x at a
    pole.
    """
    node = np.array([-axis[1], axis[0], 0.0])
    return node if np.linalg.norm(node) > POLE else np.array([1.0, 0.0, 0.0])


def on_sphere(right_ascension: float, declination: float) -> Array:
    """Unit vector (3,) towards ``right_ascension`` and ``declination``, rad."""
    across = math.cos(declination)
    return np.array(
        [
            across * math.cos(right_ascension),
            across * math.sin(right_ascension),
            math.sin(declination),
        ]
    )


def frame_axes(frame: str | None, days: float = 0.0) -> Array:
    """(3, 3), whose columns are the axes of a ``frame`` in EME2000; None is EME2000, as is J2000.

    ``days``: the date of frames of date, since J2000.0 (TT). Raises BadRequest for an unknown one.
    """
    if frame in (None, "EME2000", "J2000"):
        return np.eye(3)
    if frame == "GCRF":
        ascension, xi, eta = (ARCSECOND * part for part in BIAS)
        return _about(0, -eta) @ _about(1, xi) @ _about(2, ascension)
    if frame not in PRECESSED:
        raise BadRequest(f"{frame!r} is no frame whose axes are known here")
    centuries = 0.0 if frame == "ECLIPJ2000" else days / 36525.0
    angles = [ARCSECOND * float(np.polyval(row, centuries)) for row in PRECESSION]
    gamma, phi, psi, obliquity = angles
    from_equator = _about(2, -psi) @ _about(0, phi) @ _about(2, gamma)
    if frame == "MOD":
        from_equator = _about(0, -obliquity) @ from_equator
    return np.asarray(from_equator.T)


def _about(axis: int, angle: float) -> Array:
    """(3, 3): components in axes turned by ``angle`` rad about one of them, from those before."""
    half = np.zeros(4)
    half[0], half[axis + 1] = math.cos(0.5 * angle), math.sin(0.5 * angle)
    return matrix(half).T
