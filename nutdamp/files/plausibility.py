"""Warnings of numbers that probably lack a unit, and recognition of files that are no spacecraft files.

Foreign files are of kinds that nutdamp writes or imports, known by their first lines.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import NamedTuple

from nutdamp.files.fields import KeyPath
from nutdamp.files.rules import Facts, Finding, inertia_of, spin_of
from nutdamp.files.study_keys import VALVE_TIMES
from nutdamp.files.yaml import Node
from nutdamp.physics.body import momentary
from nutdamp.units import KINDS

LOOKED_AT = 4000
"""Characters from the beginning that are looked at."""


class Foreign(NamedTuple):
    """A kind of file: the ``pattern`` of its first lines, its description ``is_``, and its cure."""

    pattern: str
    is_: str
    cure: str


FOREIGN = (
    Foreign(
        r"[^\n]*\bstart_s\b[^\n]*,|[^\n]*\bt_s,[^\n]*\bon_time_s\b",
        "a schedule, as `plan --csv` writes it",
        "name it with --schedule, behind its spacecraft file",
    ),
    Foreign(
        r"[^\n]*\bomega_1_rad_s\b",
        "a track, as `simulate --csv` writes it",
        "name the spacecraft file that it was made from",
    ),
    Foreign(
        r'\s*\{\s*"nutdamp"',
        "a result in JSON, as nutdamp writes it",
        "name the spacecraft file that it was made from",
    ),
    Foreign(
        r"\s*(?:COMMENT[^\n]*\n\s*)*CCSDS_APM_VERS",
        "a CCSDS attitude parameter message",
        "`nutdamp import FILE` makes a spacecraft file of it",
    ),
    Foreign(
        r"\s*(?:COMMENT[^\n]*\n\s*)*CCSDS_\w+_VERS|\s*<\?xml|\s*<!DOCTYPE|\s*<html",
        "a CCSDS message, or another XML or HTML text",
        "a spacecraft file is in YAML; `nutdamp init` writes one to start from",
    ),
)
"""Kinds of file; the first that fits counts."""


def foreign(text: str) -> str | None:
    """Message for a text of a known kind that is no spacecraft file, with the cure; None for any other text."""
    for kind in FOREIGN:
        if re.match(kind.pattern, text[:LOOKED_AT]):
            return f"expected a spacecraft file, got {kind.is_}; {kind.cure}"
    return None


FAR = 50.0
"""m; few spacecraft reach further from their centre of mass, and many a drawing counts in mm."""

NEAR, SLOW = 1e6, 50.0
"""m, m/s; no orbit about a planet is as near to its centre or as slow, and most tables count in km."""

FAST = 100.0
"""rad/s; no spacecraft spins faster."""

FAST_AND_WHOLE = 20.0
"""rad/s; from here on (191 rpm) a whole number is more likely one of rpm."""

LOOSE = 0.1
"""rad; few requirements on an angle are looser than this 5.7 deg, and many a file counts in deg."""

LASTING = 50.0
"""Spin turns; no pulse against a nutation lasts longer."""

SLUGGISH = 1.0
"""s; few valves take so long, and many a data sheet counts in ms."""

THIN = 1e3
"""Pa; no tank feeds thrusters with less, and most data sheets count in bar."""

STRONG = 2.0
"""Times the thrust of a warm nozzle; none gives as much when it is cold."""

ANGLES: tuple[KeyPath, ...] = (("state", "phase"), ("goal", "azimuth"), ("goal", "right_ascension"))
"""Angles that may be of any size; the others are refused where they are too large, with a hint."""


def doubts(root: Node) -> Iterator[Finding]:
    """Numbers beyond any plausible value in SI."""
    facts = Facts(root)
    for path in ANGLES:
        value = _bare(facts, path)
        if value is not None and abs(value) > 2.0 * math.pi:
            yield _doubt(path, value, "angle", "deg")
    yield from _requirements(facts)
    yield from _state(facts)
    for path in _lengths(facts):
        value = _bare(facts, path)
        if value is not None and abs(value) > FAR:
            yield _doubt(path, value, "length", "mm")
    yield from _orbit(facts)
    yield from _rates(facts)
    yield from _firings(facts)
    yield from _thrust(facts)


def reading(value: float, kind: str, meant: str) -> str:
    """The reading of a bare number, and the text to write where the unit ``meant`` is more likely."""
    unit = KINDS[kind].si
    in_degrees = f" ({math.degrees(value):.4g} deg)" if kind == "angle" else ""
    return f"{value} is read as {value} {unit}{in_degrees}; write {value} {meant} if that is meant, else {value} {unit}"


def _bare(facts: Facts, path: KeyPath) -> float | None:
    """The finite number at ``path``; None where there is none, or a text with a unit."""
    node = facts.root.get(*path)
    value = None if node is None else node.value
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return value


def _doubt(path: KeyPath, value: float, kind: str, meant: str) -> Finding:
    return Finding(path, reading(value, kind, meant))


def _requirements(facts: Facts) -> Iterator[Finding]:
    """Angles so large that nothing is required with them: looser than is usual, or than the motion at t = 0."""
    for key, least in (("nutation", min(LOOSE, _nutation(facts))), ("momentum_shift", LOOSE)):
        path = ("requirement", key)
        value = _bare(facts, path)
        if value is not None and least < value < 0.5 * math.pi:  # from there on it is refused, with the same hint
            yield _doubt(path, value, "angle", "deg")


def _state(facts: Facts) -> Iterator[Finding]:
    """A nutation at t = 0 that is large for one in rad; a loop that waits for more than is required at the end."""
    path = ("state", "nutation")
    value = _bare(facts, path)
    if value is not None and LOOSE < value < 0.5 * math.pi:
        yield _doubt(path, value, "angle", "deg")
    start, most = facts.number("angle", "loop", "start"), facts.number("angle", "requirement", "nutation")
    if start is not None and most is not None and start > most:
        degrees = f"{math.degrees(start):g} deg is above requirement.nutation, {math.degrees(most):g} deg"
        yield Finding(("loop", "start"), f"{degrees}: the loop lets more nutation stand than is required")


def _nutation(facts: Facts) -> float:
    """Nutation angle at t = 0, rad; infinite where it cannot be read."""
    stated, inertia = facts.number("angle", "state", "nutation"), inertia_of(facts)
    omega0, spin = facts.vector("rate", 3, "omega0"), spin_of(facts)
    if stated is not None or omega0 is None or spin is None or inertia is None:
        return math.inf if stated is None else stated
    sense = math.copysign(1.0, inertia.axial(spin))
    return momentary(inertia.moments, inertia.axes.T @ omega0, sense, inertia.wheel).nutation


def _lengths(facts: Facts) -> Iterator[KeyPath]:
    for index, _ in facts.children("thrusters"):
        yield ("thrusters", index, "lever_arm")
        for axis, _ in facts.children("thrusters", index, "position"):
            yield ("thrusters", index, "position", axis)
    yield ("steerable", "lever_arm")


def _orbit(facts: Facts) -> Iterator[Finding]:
    """Positions nearer to the centre, and velocities smaller, than any orbit has."""
    for key, kind, least, meant in (("position", "length", NEAR, "km"), ("velocity", "speed", SLOW, "km/s")):
        given = facts.vector(kind, 3, "orbit", key)
        if given is None or not 0.0 < math.hypot(*given) < least:
            continue
        path = ("orbit", key, int(abs(given).argmax()))
        value = _bare(facts, path)
        if value is not None:
            yield _doubt(path, value, kind, meant)


def _rates(facts: Facts) -> Iterator[Finding]:
    rates: list[tuple[KeyPath, str]] = [(("state", "spin"), "rpm"), (("goal", "spin"), "rpm")]
    rates += [(("omega0", axis), "deg/s") for axis, _ in facts.children("omega0")]
    for path, meant in rates:
        value = _bare(facts, path)
        if value is not None and abs(value) > (FAST_AND_WHOLE if value == int(value) else FAST):
            yield _doubt(path, value, "rate", meant)


def _firings(facts: Facts) -> Iterator[Finding]:
    """Shortest on-times of more than a spin turn, within which the torque would cancel itself; endless longest ones."""
    spin = spin_of(facts)
    for index, _ in facts.children("thrusters"):
        for key, turns in (("min_on_time", 1.0), ("max_on_time", LASTING)):
            path = ("thrusters", index, key)
            value = _bare(facts, path)
            if value is not None and spin is not None and value * abs(spin) > 2.0 * math.pi * turns:
                yield _doubt(path, value, "time", "ms")


def _thrust(facts: Facts) -> Iterator[Finding]:
    """Valves that take seconds, tanks of a few Pa, and first pulses of many times the thrust."""
    times: list[KeyPath] = []
    for path in ((), *(("thrusters", index) for index, _ in facts.children("thrusters"))):
        times += [(*path, "valve", key) for key in VALVE_TIMES]
        rows = facts.children(*path, "impulse_bit") if path else []
        times += [(*path, "impulse_bit", row, column) for row, _ in rows for column in (0, 2)]
    bare = [(path, "time", "ms") for path in times if (_bare(facts, path) or 0.0) > SLUGGISH]
    pressures: list[KeyPath] = [("tank", "pressure"), ("tank", "final_pressure")]
    pressures += [("tank", "isp", row, 0) for row, _ in facts.children("tank", "isp")]
    bare += [(path, "pressure", "bar") for path in pressures if 0.0 < (_bare(facts, path) or 0.0) < THIN]
    for path, kind, meant in bare:
        value = _bare(facts, path)
        assert value is not None
        yield _doubt(path, value, kind, meant)
    first = _bare(facts, ("cold", "first"))
    if first is not None and first > STRONG:
        problem = f"{first} is read as {first} times the thrust of a warm nozzle; write {first} % if that is meant"
        yield Finding(("cold", "first"), problem)
