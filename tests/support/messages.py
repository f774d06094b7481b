"""Plans to write as messages: every file in configs/ with an epoch, and other bodies."""

import math
from functools import cache

import numpy as np
from support import places

from nutdamp.files.reader import load_spacecraft, read_spacecraft
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.model import Spacecraft, Vector

CONFIGS = places.CONFIGS

TILTED = """
name: Tilted
object_id: 2026-031A
inertia: {tensor: [[120, 3, 6], [3, 104, -4], [6, -4, 80]]}
omega0: [0.2, 0.1, -3]
attitude: {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [0.3, -0.2, 0.9, 0.1]}
thrusters:
  - {name: +M1, torque: [ 8, 0, 0], isp: 220 s, lever_arm: 1 m, max_on_time: 2 s}
  - {name: -M1, torque: [-8, 0, 0], isp: 220 s, lever_arm: 1 m, max_on_time: 2 s}
  - {name: +M2, torque: [0,  8, 0.1], isp: 220 s, lever_arm: 1 m, max_on_time: 2 s}
  - {name: -M2, torque: [0, -8, 0], isp: 220 s, lever_arm: 1 m, max_on_time: 2 s}
"""

STEERED = """
name: {name}
inertia: {{A: {A}, C: {C}}}
state: {{spin: {spin}, nutation: 5 deg, phase: 40 deg}}
attitude: {{epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [0.3, -0.2, 0.9, 0.1]}}
steerable: {{torque: 20 N m}}
"""

BODIES = {
    "tilted tensor, backwards": TILTED,
    "prolate": STEERED.format(name="Prolate", A=120, C=80, spin="30 rpm"),
    "prolate, backwards": STEERED.format(name="Backwards", A=120, C=80, spin="-30 rpm"),
    "oblate": STEERED.format(name="Oblate", A=80, C=120, spin="30 rpm"),
    "oblate, backwards": STEERED.format(name="Oblate backwards", A=80, C=120, spin="-30 rpm"),
    "sphere": STEERED.format(name="Sphere", A=100, C=100, spin="30 rpm"),
}

CASES = (
    *(path.stem for path in sorted(CONFIGS.glob("*.yaml")) if "epoch:" in path.read_text("utf-8")),
    *BODIES,
)
"""Names of the plans."""


def spacecraft(name: str) -> Spacecraft:
    """The spacecraft of a case."""
    return (
        read_spacecraft(BODIES[name], name)
        if name in BODIES
        else load_spacecraft(CONFIGS / f"{name}.yaml")
    )


@cache
def planned(name: str) -> planning.Plan:
    """A plan whose pulses have widths, for a case."""
    body = spacecraft(name)
    for scheme in ("two-pulse", "four-pulse", "one-pulse"):
        plan = planning.plan(body, scheme)
        if plan.feasible and all(pulse.torque is not None for pulse in plan.pulses):
            return plan
    raise AssertionError(f"nothing to export for {name}")


def in_file_axes(body: Spacecraft, vector: Vector) -> Vector:
    """A vector in principal axes as the file has it."""
    return np.asarray(body.inertia.axes @ vector)


def columns(body: Spacecraft, quaternion: Vector) -> Vector:
    """Axes of the file in the frame, as columns, for a quaternion of the principal axes."""
    return np.asarray(attitude.matrix(quaternion) @ body.inertia.axes.T)


def turned(first: Vector, second: Vector) -> float:
    """Angle between two attitudes given by columns of axes, deg; for small ones."""
    return math.degrees(float(np.linalg.norm(first - second)) / math.sqrt(2.0))
