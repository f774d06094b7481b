"""Warnings of numbers that probably lack a unit."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

from nutdamp.files.facts import Facts, Finding
from nutdamp.files.study_keys import VALVE_TIMES
from nutdamp.physics.body import momentary
from nutdamp.units import KINDS, STANDARD_GRAVITY

FAR = 50.0  # m; few spacecraft reach further from their centre of mass, and drawings count in mm
NEAR = 1e6  # m; no orbit about a planet is as near to its centre, and most tables count in km
SLOW = 50.0  # m/s; no orbit is as slow, and most tables count in km/s
FAST = 100.0  # rad/s; no spacecraft spins faster
FAST_AND_WHOLE = 12.0  # rad/s; above (115 rpm) a whole number is more likely one of rpm
LOOSE = 0.1  # rad; few requirements are looser than this 5.7 deg, and many a file counts in deg
LASTING = 50.0  # spin turns; no pulse against a nutation lasts longer
SLUGGISH = 1.0  # s; few valves take so long, and many a data sheet counts in ms
THIN = 1e3  # Pa; no tank feeds thrusters with less, and most data sheets count in bar
EXHAUST = 500.0  # s; no chemical thruster has more, and data sheets also give the speed in m/s
STRONG = 2.0  # times the thrust of a warm nozzle; none gives as much when it is cold
TURN = 2.0 * math.pi


def _fast(value: float, _: Facts) -> bool:
    return abs(value) > (FAST if value % 1 else FAST_AND_WHOLE)


def _long(turns: float) -> Callable[[float, Facts], bool]:
    """Test of a time that is more than so many spin turns: a torque cancels itself within one."""
    return lambda value, facts: facts.spin is not None and value * abs(facts.spin) > turns * TURN


def _short(kind: str, shortest: float, *path: str) -> Callable[[float, Facts], bool]:
    """Test of the largest component of a vector that is too short."""

    def test(value: float, facts: Facts) -> bool:
        vector = facts.vector(kind, 3, *path)
        if vector is None or abs(value) < abs(vector).max():
            return False
        return 0.0 < math.hypot(*vector) < shortest

    return test


def _nutation(facts: Facts) -> float:
    """Nutation angle at t = 0, rad; infinite where it cannot be read."""
    stated = facts.number("angle", "state", "nutation")
    omega0 = facts.vector("rate", 3, "omega0")
    spin, inertia = facts.spin, facts.inertia
    if stated is not None or omega0 is None or spin is None or inertia is None:
        return math.inf if stated is None else stated
    sense = math.copysign(1.0, inertia.axial(spin))
    return momentary(inertia.moments, inertia.axes.T @ omega0, sense, inertia.wheel).nutation


class Doubtful(NamedTuple):
    """Numbers at ``paths`` of which a test says that they probably lack the unit ``meant``."""

    paths: str
    kind: str
    meant: str
    test: Callable[[float, Facts], bool]


BANDS = (
    Doubtful(
        "state.phase goal.azimuth goal.right_ascension",
        "angle",
        "deg",
        lambda value, _: abs(value) > TURN,
    ),
    Doubtful(
        "requirement.momentum_shift state.nutation",
        "angle",
        "deg",
        lambda value, _: LOOSE < value < 0.5 * math.pi,
    ),
    Doubtful(
        "requirement.nutation",
        "angle",
        "deg",
        lambda value, facts: min(LOOSE, _nutation(facts)) < value < 0.5 * math.pi,
    ),
    Doubtful("state.spin goal.spin", "rate", "rpm", _fast),
    Doubtful("omega0.*", "rate", "deg/s", _fast),
    Doubtful("orbit.position.*", "length", "km", _short("length", NEAR, "orbit", "position")),
    Doubtful("orbit.velocity.*", "speed", "km/s", _short("speed", SLOW, "orbit", "velocity")),
    Doubtful(
        "thrusters.*.position.* thrusters.*.lever_arm steerable.lever_arm",
        "length",
        "mm",
        lambda value, _: abs(value) > FAR,
    ),
    Doubtful("thrusters.*.min_on_time", "time", "ms", _long(1.0)),
    Doubtful("thrusters.*.max_on_time", "time", "ms", _long(LASTING)),
    Doubtful(
        " ".join(f"valve.{key} thrusters.*.valve.{key}" for key in VALVE_TIMES)
        + " thrusters.*.impulse_bit.*.0 thrusters.*.impulse_bit.*.2",
        "time",
        "ms",
        lambda value, _: value > SLUGGISH,
    ),
    Doubtful(
        "tank.pressure tank.final_pressure tank.isp.*.0",
        "pressure",
        "bar",
        lambda value, _: 0.0 < value < THIN,
    ),
    Doubtful(
        "thrusters.*.isp steerable.isp tank.isp.*.1",
        "time",
        "m/s",
        lambda value, _: value > EXHAUST,
    ),
    Doubtful("cold.first", "ratio", "%", lambda value, _: value > STRONG),
)


def doubts(facts: Facts) -> Iterator[Finding]:
    """Numbers beyond any plausible value in SI."""
    for band in BANDS:
        for path in (path for each in band.paths.split() for path in facts.matching(each)):
            value = facts.value(*path)  # a text has a unit
            if isinstance(value, bool) or not isinstance(value, int | float):
                continue
            if math.isfinite(value) and band.test(value, facts):
                yield Finding(path, reading(value, band.kind, band.meant))


def reading(value: float, kind: str, meant: str) -> str:
    """The reading of a bare number, and the text to write where ``meant`` is its likelier unit."""
    unit = KINDS[kind].si
    cure = f"write {value} {meant} if that is meant"
    if kind == "angle":
        unit = f"rad ({math.degrees(value):.4g} deg)"
    elif kind == "ratio":
        return f"{value} is read as {100 * value} %; {cure}"
    elif meant == "m/s":  # of the exhaust
        cure = f"write {value / STANDARD_GRAVITY:.4g} s if m/s is meant"
    return f"{value} is read as {value} {unit}; {cure}, else {value} {KINDS[kind].si}"
