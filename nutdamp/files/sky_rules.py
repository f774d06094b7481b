"""What must hold between the keys of a spacecraft file that name directions in space: Sun, cones, attitude."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from nutdamp.epoch import Epoch
from nutdamp.files.facts import Facts, Finding
from nutdamp.files.yaml_tree import KeyPath
from nutdamp.physics import attitude, sun
from nutdamp.units import shown

Vector = NDArray[np.float64]

ALONG = 1e-3
"""rad from the spin axis, up to which the Sun counts as along it."""

NO_ATTITUDE = "needs attitude, which says where the body points at t = 0"


def sky_findings(facts: Facts, spin: float | None, axis: Vector) -> Iterator[Finding]:
    """Everything wrong with ``orbit``, ``sun``, ``keep`` and ``commands``.

    ``axis`` (3,) is the axis in the body about which it spins at ``spin`` rad/s, or None where that cannot be read.
    """
    yield from _orbit(facts)
    yield from _sun(facts)
    yield from _command_blocks(facts, spin, axis)
    for index, _ in facts.children("keep"):
        yield from _cone(facts, ("keep", index))


def _command_blocks(facts: Facts, spin: float | None, axis: Vector) -> Iterator[Finding]:
    """What is wrong between sun_sensor and commands; ``axis`` (3,) is axis 3, and ``spin`` rad/s its rate."""
    if facts.has("commands") and not facts.has("sun_sensor"):
        yield Finding(("commands",), "needs the key sun_sensor, whose pulse fires the blocks", True)
    if facts.has("sun_sensor") and not facts.has("sun"):
        yield Finding(("sun_sensor",), "needs the key sun: [right ascension, declination], or sun: epoch", True)
    if spin is not None:
        turn = 2.0 * math.pi / abs(spin)
        width = facts.number("time", "commands", "width", "max")
        if width is not None and width >= turn:
            problem = f"{width:g} s is not less than a spin turn of {turn:.4g} s, in which the next Sun pulse comes"
            yield Finding(("commands", "width", "max"), problem)
        yield from _sun_in_view(facts, math.copysign(1.0, spin) * axis)
    least, most = (facts.number("time", "commands", "width", key) for key in ("min", "max"))
    if least is not None and most is not None and least > most:
        yield Finding(("commands", "width", "min"), f"{least:g} s exceeds max; expected at most {most:g} s")


def _sun_in_view(facts: Facts, axis: Vector) -> Iterator[Finding]:
    """A Sun that gives no pulse: along the spin ``axis`` (3,) in the body at t = 0, or out of the sensor's view."""
    turned, direction = facts.vector("number", 4, "attitude", "quaternion"), _to_sun(facts)
    if not facts.has("sun_sensor") or turned is None or direction is None or not np.any(turned):
        return
    seen = attitude.rotate(attitude.conjugate(turned / np.linalg.norm(turned)), direction)
    angle = float(attitude.angle_between(seen, axis))
    if min(angle, math.pi - angle) < ALONG:
        yield Finding(("sun",), "lies along the spin axis at t = 0, so that no Sun pulse comes to fire blocks")
        return
    middle = facts.number("angle", "sun_sensor", "elevation") or 0.0
    half_width = facts.number("angle", "sun_sensor", "half_width")
    if half_width is not None and abs(0.5 * math.pi - angle - middle) > half_width:
        low, high = (math.degrees(0.5 * math.pi - middle + side * half_width) for side in (-1.0, 1.0))
        problem = (
            f"never sees the Sun, which is {math.degrees(angle):.4g} deg from the spin axis at t = 0; "
            f"it sees from {max(low, 0.0):.4g} to {min(high, 180.0):.4g} deg"
        )
        yield Finding(("sun_sensor",), problem, True)


def _orbit(facts: Facts) -> Iterator[Finding]:
    if not facts.has("orbit"):
        return
    missing = [key for key in ("epoch", "frame") if not facts.has("attitude", key)]
    if missing:
        names = " and ".join(f"attitude.{key}" for key in missing)
        yield Finding(("orbit",), f"needs {names}: the moment of the position and the axes that it is in", True)
    position = facts.vector("length", 3, "orbit", "position")
    if position is not None and not position.any():
        yield Finding(("orbit", "position"), "is zero; expected the position of the spacecraft relative to center")
    center = facts.text("orbit", "center")
    if center is not None and not (center.strip() and center.isascii() and center.isprintable()):
        yield Finding(("orbit", "center"), f"{shown(center)} is no name of a body; expected one such as EARTH")


def _to_sun(facts: Facts) -> Vector | None:
    """The direction (3,) to the Sun, given or of the epoch; None where it cannot be read."""
    given = facts.vector("angle", 2, "sun")
    if given is not None:
        return attitude.on_sphere(*given.tolist())
    epoch = facts.text("attitude", "epoch")
    if facts.text("sun") != "epoch" or epoch is None:
        return None
    try:
        return sun.direction(Epoch.parse(epoch).days_of_j2000)
    except ValueError:
        return None


def _sun(facts: Facts) -> Iterator[Finding]:
    if not facts.has("sun"):
        return
    yield from _direction(facts, ("sun",))
    if facts.text("sun") != "epoch" or not facts.has("attitude"):
        return
    epoch = facts.text("attitude", "epoch")
    if epoch is None:
        yield Finding(("sun",), "epoch needs attitude.epoch, the date of t = 0; or give [right ascension, declination]")
        return
    try:
        Epoch.parse(epoch)
    except ValueError:
        cure = "give [right ascension, declination]"
        yield Finding(("sun",), f"the Sun is computed for epochs from 1972 on, not for {epoch}; {cure}")


def _cone(facts: Facts, path: KeyPath) -> Iterator[Finding]:
    yield from _direction(facts, (*path, "direction"))
    if facts.text(*path, "direction") == "sun" and not facts.has("sun"):
        yield Finding((*path, "direction"), "needs the key sun: [right ascension, declination], or sun: epoch")
    least, most = (facts.number("angle", *path, key) for key in ("min", "max"))
    if not facts.has(*path, "min") and not facts.has(*path, "max"):
        yield Finding((*path, "min"), "missing; give min, max or both, else the cone has no effect")
    if least is not None and most is not None and most < least <= math.pi:  # more than that is out of range
        problem = f"{math.degrees(least):g} deg exceeds max; expected at most {math.degrees(most):g} deg"
        yield Finding((*path, "min"), problem)


def _direction(facts: Facts, path: KeyPath) -> Iterator[Finding]:
    """What is wrong with a direction, by two angles or by a word."""
    if not facts.has("attitude") and facts.has(*path):
        yield Finding(path, NO_ATTITUDE, True)  # at the key: what is written there is judged too
    declination = facts.number("angle", *path, 1)
    if declination is not None and abs(declination) > 0.5 * math.pi * (1.0 + 1e-12):
        found = f"{math.degrees(declination):g} deg"
        yield Finding((*path, 1), f"{found} is no declination; expected an angle from -90 deg to 90 deg")
