"""Warnings of numbers that probably lack a unit."""

from __future__ import annotations

import math
from collections.abc import Iterator

from nutdamp.files.fields import KeyPath
from nutdamp.files.rules import Facts, Finding, inertia_of, spin_of
from nutdamp.files.study_keys import VALVE_TIMES
from nutdamp.files.yaml import Node
from nutdamp.physics.body import momentary
from nutdamp.units import KINDS

FAR = 50.0  # m; few spacecraft reach further from their centre of mass, and many a drawing counts in mm

NEAR, SLOW = 1e6, 50.0
"""m, m/s; no orbit about a planet is as near to its centre or as slow, and most tables count in km."""

FAST = 100.0  # rad/s; no spacecraft spins faster
FAST_AND_WHOLE = 20.0  # rad/s; from here on (191 rpm) a whole number is more likely one of rpm
LOOSE = 0.1  # rad; few requirements on an angle are looser than this 5.7 deg, and many a file counts in deg
LASTING = 50.0  # spin turns; no pulse against a nutation lasts longer
SLUGGISH = 1.0  # s; few valves take so long, and many a data sheet counts in ms
THIN = 1e3  # Pa; no tank feeds thrusters with less, and most data sheets count in bar
STRONG = 2.0  # times the thrust of a warm nozzle; none gives as much when it is cold


def doubts(root: Node) -> Iterator[Finding]:
    """Numbers beyond any plausible value in SI."""
    facts = Facts(root)
    for path, kind, meant, low, high, most in _bands(facts):
        value = _bare(facts, path)
        if value is not None and (value < low or high < value < most):
            yield Finding(path, reading(value, kind, meant))
    start, largest = facts.number("angle", "loop", "start"), facts.number("angle", "requirement", "nutation")
    if start is not None and largest is not None and start > largest:
        degrees = f"{math.degrees(start):g} deg is above requirement.nutation, {math.degrees(largest):g} deg"
        yield Finding(("loop", "start"), f"{degrees}: the loop lets more nutation stand than is required")
    first = _bare(facts, ("cold", "first"))
    if first is not None and first > STRONG:
        cure = f"write {first} % if that is meant"
        yield Finding(("cold", "first"), f"{first} is read as {first} times the thrust of a warm nozzle; {cure}")


def reading(value: float, kind: str, meant: str) -> str:
    """The reading of a bare number, and the text to write where the unit ``meant`` is more likely."""
    unit = KINDS[kind].si
    in_degrees = f" ({math.degrees(value):.4g} deg)" if kind == "angle" else ""
    return f"{value} is read as {value} {unit}{in_degrees}; write {value} {meant} if that is meant, else {value} {unit}"


def _bare(facts: Facts, path: KeyPath) -> float | None:
    """The finite number at ``path``; None where there is none, or a text with a unit."""
    value = facts.value(*path)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return value


def _bands(facts: Facts) -> Iterator[tuple[KeyPath, str, str, float, float, float]]:
    """Paths, kinds and units that may be meant of numbers doubtful below the first and between the other two bounds."""
    # Other angles are refused where they are too large, with a hint: so are these from a right angle on.
    path: KeyPath
    for path in (("state", "phase"), ("goal", "azimuth"), ("goal", "right_ascension")):
        yield path, "angle", "deg", -2.0 * math.pi, 2.0 * math.pi, math.inf
    for path in (("requirement", "nutation"), ("requirement", "momentum_shift"), ("state", "nutation")):
        usual = min(LOOSE, _nutation(facts)) if path == ("requirement", "nutation") else LOOSE
        yield path, "angle", "deg", -math.inf, usual, 0.5 * math.pi
    for path in (("state", "spin"), ("goal", "spin"), *facts.below("omega0")):
        fastest = FAST if (_bare(facts, path) or 0.0) % 1 else FAST_AND_WHOLE
        yield path, "rate", "deg/s" if path[0] == "omega0" else "rpm", -fastest, fastest, math.inf
    for key, kind, least, meant in (("position", "length", NEAR, "km"), ("velocity", "speed", SLOW, "km/s")):
        given = facts.vector(kind, 3, "orbit", key)
        if given is not None and 0.0 < math.hypot(*given) < least:
            yield ("orbit", key, int(abs(given).argmax())), kind, meant, math.inf, math.inf, math.inf
    thrusters = facts.below("thrusters")
    positions = [position for path in thrusters for position in facts.below(*path, "position")]
    for path in (*positions, *((*path, "lever_arm") for path in (*thrusters, ("steerable",)))):
        yield path, "length", "mm", -FAR, FAR, math.inf
    spin = spin_of(facts)
    turn = 2.0 * math.pi / abs(spin) if spin else math.inf
    for path in thrusters:  # a torque cancels itself within a turn
        yield (*path, "min_on_time"), "time", "ms", -math.inf, turn, math.inf
        yield (*path, "max_on_time"), "time", "ms", -math.inf, LASTING * turn, math.inf
    times: list[KeyPath] = [(*path, "valve", key) for path in ((), *thrusters) for key in VALVE_TIMES]
    for path in thrusters:
        times += [(*row, column) for row in facts.below(*path, "impulse_bit") for column in (0, 2)]
    for path in times:
        yield path, "time", "ms", -math.inf, SLUGGISH, math.inf
    pressures = [(*row, 0) for row in facts.below("tank", "isp")]
    for path in (("tank", "pressure"), ("tank", "final_pressure"), *pressures):
        yield path, "pressure", "bar", -math.inf, 0.0, THIN


def _nutation(facts: Facts) -> float:
    """Nutation angle at t = 0, rad; infinite where it cannot be read."""
    stated, inertia = facts.number("angle", "state", "nutation"), inertia_of(facts)
    omega0, spin = facts.vector("rate", 3, "omega0"), spin_of(facts)
    if stated is not None or omega0 is None or spin is None or inertia is None:
        return math.inf if stated is None else stated
    sense = math.copysign(1.0, inertia.axial(spin))
    return momentary(inertia.moments, inertia.axes.T @ omega0, sense, inertia.wheel).nutation
