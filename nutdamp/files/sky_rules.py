"""What must hold between the keys of a spacecraft file that name directions in space: Sun, cones, attitude."""

from __future__ import annotations

import math
from collections.abc import Iterator

from nutdamp.epoch import Epoch
from nutdamp.files.facts import Facts, Finding
from nutdamp.files.yaml_tree import KeyPath

NO_ATTITUDE = "needs attitude, which says where the body points at t = 0"


def sky_findings(facts: Facts) -> Iterator[Finding]:
    """Everything wrong with ``sun`` and ``keep``."""
    yield from _sun(facts)
    for index, _ in facts.children("keep"):
        yield from _cone(facts, ("keep", index))


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
        yield Finding((*path, "min"), "missing; give min, max or both, else the cone keeps nothing")
    if least is not None and most is not None and least > most:
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
