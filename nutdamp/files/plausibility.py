"""Warnings of numbers that probably lack a unit."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

from nutdamp.files.fields import KeyPath
from nutdamp.files.rules import Facts, Finding, inertia_of, spin_of
from nutdamp.files.study_keys import VALVE_TIMES
from nutdamp.files.yaml import Node
from nutdamp.physics.body import momentary
from nutdamp.units import KINDS, STANDARD_GRAVITY

# m; few spacecraft reach further from their centre of mass, and many a drawing counts in mm
FAR = 50.0

NEAR, SLOW = 1e6, 50.0
"""m, m/s; no orbit about a planet is as near to its centre or as slow,
and most tables count in km.
"""

FAST = 100.0  # rad/s; no spacecraft spins faster
FAST_AND_WHOLE = 12.0  # rad/s; above (115 rpm) a whole number is more likely one of rpm
# rad; few requirements on an angle are looser than this 5.7 deg, and many a file counts in deg
LOOSE = 0.1
LASTING = 50.0  # spin turns; no pulse against a nutation lasts longer
SLUGGISH = 1.0  # s; few valves take so long, and many a data sheet counts in ms
THIN = 1e3  # Pa; no tank feeds thrusters with less, and most data sheets count in bar
EXHAUST = (
    500.0  # s; no chemical thruster has more, and data sheets also give the exhaust velocity in m/s
)
STRONG = 2.0  # times the thrust of a warm nozzle; none gives as much when it is cold


class UsualRange(NamedTuple):
    """Numbers that probably lack the unit ``meant``: below ``low``, and from ``high`` to what is
    refused with a hint.

    ``paths``: patterns of keys; an end of the band may depend on the file and the number.
    """

    paths: str
    kind: str
    meant: str
    low: float | Callable[[Facts, float], float]
    high: float | Callable[[Facts, float], float]
    refused: float = math.inf


def _fastest(_: Facts, value: float) -> float:
    return FAST if value % 1 else FAST_AND_WHOLE


def _turns(count: float) -> Callable[[Facts, float], float]:
    """So many spin turns, s: a torque cancels itself within one."""

    def lasts(facts: Facts, _: float) -> float:
        spin = spin_of(facts)
        return count * 2.0 * math.pi / abs(spin) if spin else math.inf

    return lasts


def _orbit(key: str, kind: str, least: float) -> Callable[[Facts, float], float]:
    """The end that doubts the largest component of a vector shorter than ``least``."""

    def low(facts: Facts, value: float) -> float:
        vector = facts.vector(kind, 3, "orbit", key)
        short = (
            vector is not None
            and 0.0 < math.hypot(*vector) < least
            and abs(value) == abs(vector).max()
        )
        return math.inf if short else -math.inf

    return low


BANDS = (
    UsualRange(
        "state.phase goal.azimuth goal.right_ascension",
        "angle",
        "deg",
        -2.0 * math.pi,
        2.0 * math.pi,
    ),
    UsualRange(
        "requirement.momentum_shift state.nutation", "angle", "deg", -math.inf, LOOSE, 0.5 * math.pi
    ),
    UsualRange(
        "requirement.nutation",
        "angle",
        "deg",
        -math.inf,
        lambda facts, _: min(LOOSE, _nutation(facts)),
        0.5 * math.pi,
    ),
    UsualRange(
        "state.spin goal.spin",
        "rate",
        "rpm",
        lambda facts, value: -_fastest(facts, value),
        _fastest,
    ),
    UsualRange("omega0.*", "rate", "deg/s", lambda facts, value: -_fastest(facts, value), _fastest),
    UsualRange("orbit.position.*", "length", "km", _orbit("position", "length", NEAR), math.inf),
    UsualRange("orbit.velocity.*", "speed", "km/s", _orbit("velocity", "speed", SLOW), math.inf),
    UsualRange(
        "thrusters.*.position.* thrusters.*.lever_arm steerable.lever_arm",
        "length",
        "mm",
        -FAR,
        FAR,
    ),
    UsualRange("thrusters.*.min_on_time", "time", "ms", -math.inf, _turns(1.0)),
    UsualRange("thrusters.*.max_on_time", "time", "ms", -math.inf, _turns(LASTING)),
    UsualRange(
        " ".join(f"valve.{key} thrusters.*.valve.{key}" for key in VALVE_TIMES),
        "time",
        "ms",
        -math.inf,
        SLUGGISH,
    ),
    UsualRange(
        "thrusters.*.impulse_bit.*.0 thrusters.*.impulse_bit.*.2", "time", "ms", -math.inf, SLUGGISH
    ),
    UsualRange(
        "tank.pressure tank.final_pressure tank.isp.*.0", "pressure", "bar", -math.inf, 0.0, THIN
    ),
)
ISP = "thrusters.*.isp steerable.isp tank.isp.*.1"


def doubts(root: Node) -> Iterator[Finding]:
    """Numbers beyond any plausible value in SI."""
    facts = Facts(root)
    for band in BANDS:
        for path in (path for pattern in band.paths.split() for path in facts.matching(pattern)):
            value = _bare(facts, path)
            if value is None:
                continue
            low, high = (
                end(facts, value) if callable(end) else end for end in (band.low, band.high)
            )
            if value < low or high < value < band.refused:
                yield Finding(path, reading(value, band.kind, band.meant))
    for path in (path for pattern in ISP.split() for path in facts.matching(pattern)):
        isp = _bare(facts, path)
        if isp is not None and isp > EXHAUST:
            yield Finding(
                path,
                (
                    f"{isp} is read as {isp} s; if m/s is meant write {isp / STANDARD_GRAVITY:.4g} "
                    "s, "
                    f"else {isp} s"
                ),
            )
    start, largest = (
        facts.number("angle", "loop", "start"),
        facts.number("angle", "requirement", "nutation"),
    )
    if start is not None and largest is not None and start > largest:
        degrees = (
            f"{math.degrees(start):g} deg is above requirement.nutation, "
            f"{math.degrees(largest):g} deg"
        )
        yield Finding(
            ("loop", "start"), f"{degrees}: the loop lets more nutation stand than is required"
        )
    first = _bare(facts, ("cold", "first"))
    if first is not None and first > STRONG:
        cure = f"write {first} % if that is meant"
        yield Finding(
            ("cold", "first"),
            f"{first} is read as {first} times the thrust of a warm nozzle; {cure}",
        )


def reading(value: float, kind: str, meant: str) -> str:
    """The reading of a bare number, and the text to write where the
    unit ``meant`` is more likely.
    """
    unit = KINDS[kind].si
    in_degrees = f" ({math.degrees(value):.4g} deg)" if kind == "angle" else ""
    return (
        f"{value} is read as {value} {unit}{in_degrees}; write {value} {meant} if that is "
        f"meant, else {value} {unit}"
    )


def _bare(facts: Facts, path: KeyPath) -> float | None:
    """The finite number at ``path``; None where there is none, or a text with a unit."""
    value = facts.value(*path)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return value


def _nutation(facts: Facts) -> float:
    """Nutation angle at t = 0, rad; infinite where it cannot be read."""
    stated = facts.number("angle", "state", "nutation")
    inertia = inertia_of(facts)
    omega0 = facts.vector("rate", 3, "omega0")
    spin = spin_of(facts)
    if stated is not None or omega0 is None or spin is None or inertia is None:
        return math.inf if stated is None else stated
    sense = math.copysign(1.0, inertia.axial(spin))
    return momentary(inertia.moments, inertia.axes.T @ omega0, sense, inertia.wheel).nutation
