"""Constraints between the keys of a closed loop and those of the body that it damps."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from nutdamp.errors import span
from nutdamp.files.fields import KeyPath
from nutdamp.files.rules import Facts, Finding, Vector, inertia_of, norm, spin_axis, spin_of
from nutdamp.files.thruster_rules import instead, on_times_of, torque_of
from nutdamp.files.yaml import Node
from nutdamp.spacecraft.model import Inertia
from nutdamp.spacecraft.tolerances import KINDS
from nutdamp.units import KINDS as UNITS
from nutdamp.units import shown

SAMPLES = 4.0  # samples a nutation period without which the phase of the nutation is hardly seen
MOST_SAMPLES = 1e6  # samples a nutation period, more than which tell no more and take for ever to fly
LATE = 20.0  # nutation periods after which a sample tells nothing: how long delay, filter and settling may be
LONGEST_WAIT = 1e4  # nutation periods, more than which from firing to firing damp nothing

LARGEST_BIAS, FARTHEST = 1e3, 1e3
"""m/s² and m of an accelerometer beyond which it is none of a spacecraft: its nutation would be lost in rounding."""

SCALES = (0.1, 10.0)  # sizes of scales between which a sensor still measures

SENSOR: KeyPath = ("loop", "sensor")
UNITS_OF = {"gyro": "a gyro: rad/s, deg/s or rpm", "accelerometer": "an accelerometer: m/s^2"}


def loop_findings(root: Node) -> Iterator[Finding]:
    """All faults of ``loop``."""
    facts = Facts(root)
    start, stop = (facts.number("angle", "loop", key) for key in ("start", "stop"))
    if start is not None and stop is not None and stop >= start > 0.0:
        problem = f"{math.degrees(stop):g} deg is not below start; expected less than {math.degrees(start):g} deg"
        yield Finding(("loop", "stop"), problem)
    yield from _sensor(facts)
    yield from _channels(facts)
    inertia, spin = inertia_of(facts), spin_of(facts)
    if inertia is None or spin is None:
        return
    if inertia.nutation_rate(spin) == 0.0:
        problem = "in a sphere ω does not rotate in the body, so that a loop has no phase to fire by; leave loop out"
        yield Finding(("loop",), problem, True)
        return
    yield from _timing(facts, abs(inertia.nutation_rate(spin)) / (2.0 * math.pi))
    yield from _accelerometer(facts, inertia)
    yield from _seen(facts, inertia, spin)


def _known_channels(facts: Facts) -> list[tuple[str, bool, bool, float, float]]:
    """Readable channels: name, whether the torque is known, and more transverse than axial, on-times, s."""
    thrusters = {facts.text(*path, "name"): path for path in facts.below("thrusters")}
    named = {str(name): [entry.value for _, entry in node.children()] for name, node in facts.children("channels")}
    named = named or {name: [name] for name in thrusters if name is not None}
    axis, channels = spin_axis(facts), []
    for name, members in named.items():
        paths: list[KeyPath] = [thrusters[member] for member in members if member in thrusters]
        torques = [torque[0] for path in paths if (torque := torque_of(facts, path)) is not None]
        pushes = bool(torques) and len(torques) == len(paths)
        total = np.sum(torques, axis=0) if pushes else np.zeros(3)
        damps = norm(total - (total @ axis) * axis) > abs(float(total @ axis))
        times = [on_times_of(facts, path) for path in paths]
        least, most = max((time for time, _ in times), default=0.0), min((time for _, time in times), default=math.inf)
        channels.append((name, pushes, damps, least, most))
    return channels


def _sensor(facts: Facts) -> Iterator[Finding]:
    kind = facts.text(*SENSOR, "kind")
    scale = facts.number("ratio", *SENSOR, "scale")
    if scale == 0.0:
        yield Finding((*SENSOR, "scale"), "zero: the sensor shows nothing; expected about 100 %")
    elif scale is not None and not SCALES[0] <= abs(scale) <= SCALES[1]:
        allowed = f"{100.0 * SCALES[0]:g} % to {100.0 * SCALES[1]:g} %, or the same below zero"
        yield Finding((*SENSOR, "scale"), f"{100.0 * scale:g} % is no scale of a sensor; expected {allowed}")
    for key in ("noise", "quantisation", "low_pass"):
        if facts.has(*SENSOR, key) and not facts.has(*SENSOR, "rate"):
            yield Finding((*SENSOR, key), "applies to samples: it needs rate, such as rate: 100 Hz", True)
    needed = {"rate": "samples, of which a sine is made", "position": "where it is, from the centre of mass"}
    for key, what in needed.items():
        if kind == "accelerometer" and not facts.has(*SENSOR, key):
            yield Finding((*SENSOR, key), f"missing; an accelerometer needs {key}: {what}")
    for key in ("position", "axis"):
        if kind == "gyro" and facts.has(*SENSOR, key):
            yield Finding((*SENSOR, key), "is for kind: accelerometer; a gyro measures the same everywhere", True)
    axis = facts.vector("number", 3, *SENSOR, "axis")
    if axis is not None and not axis.any():
        yield Finding((*SENSOR, "axis"), "zero; expected a direction, such as [0, 0, 1]")
    other, right = "acceleration" if kind == "gyro" else "rate", UNITS_OF.get(kind or "")
    for key in ("noise", "bias", "quantisation") if right else ():
        text = facts.text(*SENSOR, key)
        if text is not None and facts.number(other, *SENSOR, key) is not None:
            yield Finding((*SENSOR, key), f"{shown(text)} is not in a unit of {right}")


def _channels(facts: Facts) -> Iterator[Finding]:
    known = _known_channels(facts)
    law, on_time = facts.text("loop", "law"), facts.number("time", "loop", "on_time")
    if not known:
        yield Finding(("loop",), "needs channels to fire: thrusters with a torque across axis 3", True)
    elif all(pushes and not damps for _, pushes, damps, *_ in known):
        yield Finding(
            ("loop",), "no channel has a torque more transverse than axial, so none can damp a nutation", True
        )
    if law == "bang" and not facts.has("loop", "on_time"):
        yield Finding(("loop", "on_time"), "missing; the law bang fires pulses of this length")
    if law == "one-pulse" and facts.has("loop", "on_time"):
        yield Finding(("loop", "on_time"), "is for four-pulse and bang; one-pulse fires for as long as it takes", True)
    elif on_time is not None:
        for name, *_, least, most in known:
            if not least <= on_time <= most:
                problem = f"{on_time:g} s is outside what {name} allows: {span(least, most, 's')}"
                yield Finding(("loop", "on_time"), problem)
    names, before = [name for name, *_ in known], set()
    for path in facts.below("loop", "faults", "reversed"):
        turned = facts.value(*path)
        if turned in before:
            yield Finding(path, f"{shown(turned)} is named twice; expected each channel once")
        before.add(turned)
        if isinstance(turned, str) and turned not in names:
            yield Finding(path, f"no channel is called {shown(turned)}; {instead(turned, names)}")


def _timing(facts: Facts, frequency: float) -> Iterator[Finding]:
    """Samples too seldom, and delays too long, for a nutation of this ``frequency``, Hz, in the body."""
    given, alias, period = facts.number("frequency", *SENSOR, "rate"), facts.root.get("loop", "alias"), 1.0 / frequency
    least, most = SAMPLES * frequency, MOST_SAMPLES * frequency
    if given is not None and 0.0 < given < least and (alias is None or alias.value is not True):
        problem = f"{given:g} Hz is below four times the nutation frequency; expected at least {least:.4g} Hz"
        yield Finding((*SENSOR, "rate"), f"{problem}, or alias: true beside start")
    if given is not None and given > most:
        problem = f"{given:g} Hz is more than a million samples a nutation period of {period:.4g} s"
        cure = f"expected at most {most:.4g} Hz, or no rate for a continuous signal"
        yield Finding((*SENSOR, "rate"), f"{problem}; {cure}")
    lags = ((*SENSOR, "delay"), (*SENSOR, "low_pass"), ("loop", "settle"))
    for path, most in (*((path, LATE) for path in lags), (("loop", "min_interval"), LONGEST_WAIT)):
        value = facts.number("time", *path)
        if value is not None and value > most * period:
            problem = f"{value:g} s is {value / period:.3g} nutation periods; expected at most {most:g}"
            yield Finding(path, f"{problem} of them, {most * period:.4g} s")


def _accelerometer(facts: Facts, inertia: Inertia) -> Iterator[Finding]:
    from nutdamp.control_loop.sensor import is_blind

    position, axis = _mounting(facts, inertia)
    if facts.text(*SENSOR, "kind") != "accelerometer" or position is None or axis is None:
        return
    if inertia.wheel != 0.0:
        yield Finding((*SENSOR, "kind"), "accelerometer: with a wheel only gyros are modelled; expected gyro")
        return
    if math.hypot(*position) > FARTHEST:
        away = f"{math.hypot(*position):.4g} m from the centre of mass; expected at most {FARTHEST:g} m"
        yield Finding((*SENSOR, "position"), away)
    if not is_blind(inertia.moments, position, axis):
        return
    if inertia.symmetric and inertia.C == 2.0 * inertia.A and abs(axis[2]) > 1.0 - 1e-9:
        problem = "blind: along axis 3 it shows r ω1 ω3 (1 + a), which is nothing at C = 2A, where a = -1"
        yield Finding((*SENSOR, "kind"), f"{problem}; measure across axis 3, off its plane")
    else:
        problem = "blind: here it shows nothing of the nutation; move it off axis 3, or turn its axis"
        yield Finding((*SENSOR, "position"), problem)


def _mounting(facts: Facts, inertia: Inertia) -> tuple[Vector | None, Vector | None]:
    """Position (3,) m and unit axis (3,) of an accelerometer in principal axes."""
    position = facts.vector("length", 3, *SENSOR, "position")
    axis = facts.vector("number", 3, *SENSOR, "axis") if facts.has(*SENSOR, "axis") else np.array([0.0, 0.0, 1.0])
    if axis is not None:
        axis = inertia.axes.T @ (axis / math.hypot(*axis)) if axis.any() else None
    return None if position is None else inertia.axes.T @ position, axis


def _seen(facts: Facts, inertia: Inertia, spin: float) -> Iterator[Finding]:
    """Noise, steps and bias in which the start threshold is lost."""
    start, kind = facts.number("angle", "loop", "start"), facts.text(*SENSOR, "kind")
    if start is None or not 0.0 < start < 0.5 * math.pi or kind not in ("gyro", "accelerometer"):
        return
    size = abs(inertia.axial(spin)) / inertia.A * math.tan(start)
    if kind == "accelerometer":
        from nutdamp.control_loop.sensor import gain

        position, axis = _mounting(facts, inertia)
        if position is None or axis is None:
            return
        size *= abs(spin) * math.hypot(*gain(inertia.moments, position, axis))
        if size == 0.0:
            return
    quantity = "rate" if kind == "gyro" else "acceleration"
    # The offset of an accelerometer is fitted, and does not matter.
    shares = {(*SENSOR, "noise"): 1.0, (*SENSOR, "quantisation"): 2.0}
    biases: list[KeyPath] = [(*SENSOR, "bias"), *(("dispersions", "sensor_bias", kind) for kind in KINDS)]
    for path, share in (*shares.items(), *((path, 1.0 if kind == "gyro" else LARGEST_BIAS / size) for path in biases)):
        value = facts.number(quantity, *path)
        if value is None or abs(value) <= share * size or (value < 0.0 and path in shares):
            continue
        unit, scale = ("rad/s" if kind == "gyro" else "m/s^2"), 1.0
        written = (facts.text(*path) or "").rpartition(" ")[2]
        if kind == "gyro" and written in UNITS["rate"].factors:
            unit, scale = written, UNITS["rate"].factors[written]
        most = f"{share * size / scale:.4g} {unit}"
        if kind == "gyro" or path in shares:
            problem = f"{value / scale:.4g} {unit} hides start, which shows as {size / scale:.4g} {unit}"
        else:
            problem = f"{value:.4g} {unit} is no bias of an accelerometer"
        yield Finding(path, f"{problem}; expected at most {most}")
