"""Constraints on keys for studies that no row of a table says: dispersions, correlations, loop."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from nutdamp.errors import nearest, span
from nutdamp.files.fields import RIGHT_ANGLE, KeyPath
from nutdamp.files.rules import Facts, Finding, inertia_of, spin_of
from nutdamp.files.study_keys import BY_THRUSTER, QUANTITIES, by_name, size_of
from nutdamp.files.thruster_rules import instead, on_times_of, thrusts
from nutdamp.files.yaml import Node
from nutdamp.montecarlo.inputs import grouped, positive_definite, reachable
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import STEERABLE
from nutdamp.spacecraft.tolerances import KINDS, READING
from nutdamp.units import shown

LARGEST_SIGMA, LARGEST_OFFSET = 0.5, 1.0
"""One sigma of a normal distribution, and half widths and fixed offsets of others, in % of a value
or of a right angle: beyond the first one draw in forty would turn its sign, beyond the second any.
"""


EXAMPLES = {
    "inertia": "2 %",
    "mass": "1 %",
    "pressure": "2 %",
    "rate": "0.1 deg/s",
    "force": "3 %",
    "ratio": "1 %",
    "angle": "0.5 deg",
    "length": "5 mm",
    READING: "0.01 deg/s",
}


def dispersion_findings(root: Node) -> Iterator[Finding]:
    """Faults of the dispersions, and of the share of cases that is to comply."""
    facts = Facts(root)
    asked = ("nutation", "momentum_shift", "spin")
    if facts.has("requirement", "probability") and not any(
        facts.has("requirement", key) for key in asked
    ):
        problem = "given alone; name what must be met with it: nutation, momentum_shift or spin"
        yield Finding(("requirement", "probability"), problem, True)
    if not facts.has("dispersions"):
        return
    known = list(thrusts(facts))
    for key in BY_THRUSTER:
        path: KeyPath = ("dispersions", key)
        for *_, name in (entry for entry in _each(facts, key) if entry != path):
            if name not in known:
                problem = f"no thruster is called {shown(name)}; {instead(str(name), known)}"
                yield Finding((*path, name), problem, True)
    for path in filter(lambda path: facts.is_mapping(*path), _entries(facts)):
        nodes = dict(facts.children(*path))
        given = [str(key) for key in nodes if key in KINDS]
        if not given:
            size = EXAMPLES.get(QUANTITIES[str(path[1])], "5 ms")
            yield Finding(
                path,
                f"names no distribution; give {{normal: {size}}}, or uniform, triangular, bias",
            )
        for key in given[1:]:
            yield Finding(
                (*path, key), f"given together with {given[0]}; keep one of the two", True
            )
        for key in given:
            fault = _size_fault(facts, path, key, nodes[key].plain())
            if fault is not None:
                yield Finding((*path, key), fault)
    kind = facts.text("loop", "sensor", "kind")
    wrong, right = (
        ("rate", "m/s^2") if kind == "accelerometer" else ("acceleration", "rad/s, deg/s or rpm")
    )
    for key in ("sensor_bias", "sensor_scale", "sensor_noise", "sensor_delay"):
        path = ("dispersions", key)
        if facts.has(*path) and not facts.has("loop"):
            yield Finding(
                path, "is of the sensor of a loop, and the file has no loop; leave this out", True
            )
        for distribution in KINDS if key == "sensor_bias" and kind is not None else ():
            text = facts.text(*path, distribution)
            if text is not None and facts.number(wrong, *path, distribution) is not None:
                yield Finding(
                    (*path, distribution),
                    f"{shown(text)} is not in the unit of the sensor: {right}",
                )


def _each(facts: Facts, key: str) -> list[KeyPath]:
    """Paths to the tolerances of ``key``: one, or one a thruster."""
    path: KeyPath = ("dispersions", key)
    if not facts.is_mapping(*path):
        return []
    return facts.below(*path) if by_name(dict(facts.children(*path))) else [path]


def _entries(facts: Facts) -> Iterator[KeyPath]:
    """Paths to all tolerances."""
    for key in QUANTITIES:
        path: KeyPath = ("dispersions", key)
        if key in BY_THRUSTER and facts.is_mapping(*path):
            yield from _each(facts, key)
        elif key == "omega0" and isinstance(facts.value(*path), list):
            yield from facts.below(*path)
        elif facts.has(*path):
            yield path


def _size_fault(facts: Facts, path: KeyPath, key: str, value: object) -> str | None:
    if value is None:
        return None  # reported already
    kind = QUANTITIES[str(path[1])]
    try:
        size, relative = size_of(value, kind)
    except ValueError as wrong:
        return str(wrong)
    what = {"normal": "one sigma", "bias": "an offset"}.get(key, "half a width")
    if key != "bias" and size < 0.0:
        return (
            f"{shown(value)} is negative; expected {what} of at least 0, or bias for a fixed offset"
        )
    for name, thrust in thrusts(facts).items() if kind == "force" and not relative else ():
        if thrust is None and path[2:] in ((), (name,)):
            unknown = f"the {STEERABLE} torquer" if name == STEERABLE else shown(name)
            return (
                f"{shown(value)} needs the thrust of {unknown}, which is not known; "
                "give its lever_arm, or a %"
            )
    if not relative and kind != "angle":
        return None
    share = abs(size) if relative else abs(size) / RIGHT_ANGLE
    if key == "normal" and share > LARGEST_SIGMA:
        most = _percent(LARGEST_SIGMA, relative)
        return f"{shown(value)} is out of range; expected {what} of at most {most}"
    if key != "normal" and share >= LARGEST_OFFSET:
        most = _percent(LARGEST_OFFSET, relative)
        return f"{shown(value)} is out of range; expected {what} below {most}"
    return None


def _percent(share: float, relative: bool) -> str:
    return f"{100 * share:g} %" if relative else f"{90 * share:g} deg"


def correlation_findings(spacecraft: Spacecraft) -> Iterator[Finding]:
    """Faults of correlated inputs, whose names are known once the spacecraft is."""
    pairs = () if spacecraft.dispersions is None else spacecraft.dispersions.correlation
    if not pairs:
        return
    path = ("dispersions", "correlation")
    inputs = reachable(spacecraft)
    names = [*(entry.name for entry in inputs.drawn), *(entry.name for entry in inputs.unused)]
    known = [name for name in names if not name.endswith("of each pulse")]
    fixed = {entry.name for entry in inputs.drawn if entry.kind == "bias"}
    before: set[frozenset[str]] = set()
    found: list[Finding] = []
    for row, (first, second, size) in enumerate(pairs):
        for place, name in enumerate((first, second)):
            if name not in known:
                close = nearest(name, known)
                cure = f"known here: {', '.join(known) or 'none'}"
                if close is not None:
                    cure = f"did you mean {shown(close)}?"
                problem = f"the dispersions have no input called {shown(name)}; {cure}"
                found.append(Finding((*path, row, place), problem))
            elif name in fixed:
                problem = f"{shown(name)} is a fixed offset (bias), which does not vary"
                found.append(Finding((*path, row, place), problem))
        if first == second:
            problem = f"{shown(first)} again; expected two different inputs"
            found.append(Finding((*path, row, 1), problem))
        elif frozenset((first, second)) in before:
            problem = f"{first} and {second} are given before; keep one of the two"
            found.append(Finding((*path, row), problem))
        elif abs(size) == 1.0:
            problem = f"{size:g}: one would follow from the other; expected less than 1 in size"
            found.append(Finding((*path, row, 2), problem))
        before.add(frozenset((first, second)))
    yield from found
    for group in () if found else grouped(pairs):
        if not positive_definite(group):
            problem = f"not positive definite for {', '.join(group.names)}"
            why = "no numbers have these correlations; pairs that are not given count as 0"
            yield Finding(path, f"{problem}: {why}")


SAMPLES = 4.0  # samples a nutation period without which the phase of the nutation is hardly seen

SENSOR: KeyPath = ("loop", "sensor")
UNITS_OF = {"gyro": "a gyro: rad/s, deg/s or rpm", "accelerometer": "an accelerometer: m/s^2"}


def loop_findings(root: Node) -> Iterator[Finding]:
    """Faults of ``loop`` beside those of the table."""
    facts = Facts(root)
    law = facts.text("loop", "law")
    if law == "bang" and not facts.has("loop", "on_time"):
        yield Finding(("loop", "on_time"), "missing; the law bang fires pulses of this length")
    if law == "one-pulse" and facts.has("loop", "on_time"):
        yield Finding(
            ("loop", "on_time"),
            "is for four-pulse and bang; one-pulse fires for as long as it takes",
            True,
        )
    yield from _channels(facts)
    kind = facts.text(*SENSOR, "kind")
    needed = {
        "rate": "samples, of which a sine is made",
        "position": "where it is, from the centre of mass",
    }
    for key, what in needed.items():
        if kind == "accelerometer" and not facts.has(*SENSOR, key):
            yield Finding((*SENSOR, key), f"missing; an accelerometer needs {key}: {what}")
    for key in ("position", "axis"):
        if kind == "gyro" and facts.has(*SENSOR, key):
            yield Finding(
                (*SENSOR, key),
                "is for kind: accelerometer; a gyro measures the same everywhere",
                True,
            )
    if kind == "accelerometer" and facts.has(*SENSOR, "axes"):
        yield Finding(
            (*SENSOR, "axes"), "is for kind: gyro; an accelerometer measures along axis", True
        )
    other = "acceleration" if kind == "gyro" else "rate"
    right = UNITS_OF.get(kind or "")
    for key in ("noise", "bias", "quantisation") if right else ():
        text = facts.text(*SENSOR, key)
        if text is not None and facts.number(other, *SENSOR, key) is not None:
            yield Finding((*SENSOR, key), f"{shown(text)} is not in a unit of {right}")
    inertia = inertia_of(facts)
    spin = spin_of(facts)
    if inertia is None or spin is None:
        return
    rate = facts.number("frequency", *SENSOR, "rate")
    alias = facts.value("loop", "alias")
    least = SAMPLES * abs(inertia.nutation_rate(spin)) / (2.0 * math.pi)
    if rate is not None and 0.0 < rate < least and alias is not True:
        problem = f"{rate:g} Hz is below four times the nutation frequency"
        cure = f"expected at least {least:.4g} Hz, or alias: true beside start"
        yield Finding((*SENSOR, "rate"), f"{problem}; {cure}")
    if kind != "accelerometer":
        return
    from nutdamp.control_loop.sensor import is_blind

    if inertia.wheel != 0.0:
        yield Finding(
            (*SENSOR, "kind"), "accelerometer: with a wheel only gyros are modelled; expected gyro"
        )
        return
    position = facts.vector("length", 3, *SENSOR, "position")
    axis = (
        facts.vector("number", 3, *SENSOR, "axis")
        if facts.has(*SENSOR, "axis")
        else np.array([0.0, 0.0, 1.0])
    )
    if position is None or axis is None or not axis.any():
        return
    turn = inertia.axes.T
    if is_blind(inertia.moments, turn @ position, turn @ axis / math.hypot(*axis)):
        problem = "blind: here it shows nothing of the nutation"
        yield Finding((*SENSOR, "position"), f"{problem}; move it off axis 3, or turn its axis")


def _channels(facts: Facts) -> Iterator[Finding]:
    """Channels that are not there, and an on-time that one does not allow."""
    thrusters = facts.below("thrusters")
    times = {facts.text(*path, "name"): on_times_of(facts, path) for path in thrusters}
    named = {str(path[-1]): facts.below(*path) for path in facts.below("channels")}
    channels = {name: [facts.text(*entry) for entry in entries] for name, entries in named.items()}
    channels = channels or {name: [name] for name in times if name is not None}
    on_time = facts.number("time", "loop", "on_time")
    for name, members in channels.items():
        allowed = [times[member] for member in members if member in times]
        if on_time is not None and allowed:
            least = max(shortest for shortest, _ in allowed)
            most = min(longest for _, longest in allowed)
            if not least <= on_time <= most:
                problem = f"{on_time:g} s is outside what {name} allows: {span(least, most, 's')}"
                yield Finding(("loop", "on_time"), problem)
    for path in facts.below("loop", "faults", "reversed"):
        turned = facts.text(*path)
        if turned is not None and turned not in channels:
            problem = f"no channel is called {shown(turned)}"
            yield Finding(path, f"{problem}; {instead(turned, list(channels))}")
