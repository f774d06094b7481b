"""Directions in space: by tilt and azimuth, by an angle from the Sun, as two angles; other frames.

Directions are unit vectors (3,) in the inertial frame of the spacecraft's attitude.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from nutdamp.physics import attitude, frames
from nutdamp.spacecraft.model import Spacecraft, Vector


def direction_in_n(spacecraft: Spacecraft, tilt: float, azimuth: float) -> Vector:
    """Inertial unit vector (3,) ``tilt`` rad from H at t = 0, ``azimuth`` rad about it from x
    of the frame N.
    """
    in_n = np.array(
        [math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)]
    )
    if spacecraft.attitude is None:
        return in_n
    body_to_n = replace(spacecraft, attitude=None).initial.quaternion
    in_body = attitude.matrix(body_to_n).T @ in_n
    return attitude.rotate(spacecraft.initial.quaternion, in_body)


def at_sun_angle(spacecraft: Spacecraft, angle: float) -> Vector:
    """Inertial unit vector (3,), ``angle`` rad from the Sun and nearest to H at t = 0. With H
    along the Sun, or opposite, the one on the north side of the frame.
    """
    sun = spacecraft.sun
    assert sun is not None
    side = np.cross(np.cross(sun, attitude.unit(spacecraft.momentum)), sun)
    if np.linalg.norm(side) < frames.POLE:
        side = np.cross(sun, frames.ascending_node(sun))
    return np.asarray(math.cos(angle) * sun + math.sin(angle) * attitude.unit(side))


def seen_in(spacecraft: Spacecraft, frame: str) -> Spacecraft:
    """The same spacecraft, with its attitude and all inertial directions given in another
    frame.
    """
    start, orbit, goal = spacecraft.attitude, spacecraft.orbit, spacecraft.goal
    if start is None or start.frame in (None, frame):
        return spacecraft
    seen = start.seen_in(frame)
    rotation = seen.axes.T @ start.axes

    def turned(direction: Vector | None) -> Vector | None:
        return None if direction is None else rotation @ direction

    return replace(
        spacecraft,
        attitude=seen,
        orbit=orbit
        and replace(orbit, position=rotation @ orbit.position, velocity=rotation @ orbit.velocity),
        sun=turned(spacecraft.sun),
        keep=tuple(replace(cone, direction=turned(cone.direction)) for cone in spacecraft.keep),
        goal=replace(goal, axis=turned(goal.axis), sun=turned(goal.sun)),
    )
