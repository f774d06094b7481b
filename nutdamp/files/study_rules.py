"""Constraints on keys for studies: dispersions and correlations, the closed loop and the body that it damps."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from nutdamp.errors import nearest, span
from nutdamp.files.fields import RIGHT_ANGLE, KeyPath
from nutdamp.files.rules import Facts, Finding, Vector, inertia_of, norm, principal_of, spin_axis, spin_of
from nutdamp.files.study_keys import BY_THRUSTER, QUANTITIES, VALVE_TIMES, by_name, size_of
from nutdamp.files.thruster_rules import instead, on_times_of, thrusts, torque_of
from nutdamp.files.yaml import Node
from nutdamp.montecarlo.inputs import Pair, grouped, positive_definite
from nutdamp.spacecraft.equipment import ACCELEROMETER
from nutdamp.spacecraft.model import Inertia
from nutdamp.spacecraft.schedule import STEERABLE
from nutdamp.spacecraft.tolerances import KINDS, READING
from nutdamp.units import KINDS as UNITS
from nutdamp.units import bar, shown

PARTS = {
    "thrust_direction": ("direction", "ab"),
    "position": ("position", "xyz"),
    "attitude": ("attitude", "xy"),
    "center_of_mass": ("center of mass", "xyz"),
}
"""Tolerances of which several inputs are drawn: their first word and their last letters."""

EACH_PULSE = ("thrust_per_pulse", "timing")  # tolerances that each pulse draws anew


def _correlations(facts: Facts) -> Iterator[Finding]:
    path = ("dispersions", "correlation")
    pairs: dict[frozenset[str], Pair] = {}
    drawn, sound = _drawn(facts), True
    for row in facts.below(*path):
        first, second, size = facts.text(*row, 0), facts.text(*row, 1), facts.number("ratio", *row, 2)
        if len(facts.below(*row)) != 3 or first is None or second is None or size is None:
            sound = False
            continue  # reported already
        for place, name in enumerate((first, second)):
            if problem := _unknown(name, drawn):
                yield Finding((*row, place), problem)
        if first == second:
            yield Finding((*row, 1), f"{shown(first)} again; expected two different inputs")
        elif frozenset((first, second)) in pairs:
            yield Finding(row, f"{first} and {second} are given before; keep one of the two")
        elif abs(size) == 1.0:
            yield Finding((*row, 2), f"{size:g}: one would follow from the other; expected less than 1 in size")
        elif abs(size) < 1.0:
            pairs[frozenset((first, second))] = (first, second, size)
            continue
        sound = False
    for group in grouped(pairs.values()) if sound else ():
        if not positive_definite(group):
            problem = f"not positive definite for {', '.join(group.names)}: no numbers have these correlations"
            yield Finding(path, f"{problem}; pairs that are not given count as 0")


def _unknown(name: str, drawn: dict[str, bool]) -> str:
    """The reason why an input cannot be correlated; empty where it can. ``drawn``: True for inputs that vary."""
    if name in drawn:
        return "" if drawn[name] else f"{shown(name)} is a fixed offset (bias), which does not vary"
    if name.replace(" ", "_") in EACH_PULSE:
        return f"{shown(name)} is drawn by each pulse anew; expected an input that is the same for all pulses"
    close = nearest(name, list(drawn))
    known = f"did you mean {shown(close)}?" if close else f"known here: {', '.join(drawn) or 'none'}"
    return f"the dispersions have no input called {shown(name)}; {known}"


def _drawn(facts: Facts) -> dict[str, bool]:
    """Names of all inputs that any schedule could draw once, as `montecarlo.inputs` has them, and whether they vary."""
    varying = {}
    for path in _entries(facts):
        varies = facts.is_mapping(*path) and not facts.has(*path, "bias")
        varying.update(dict.fromkeys(_names(facts, path), varies))
    return varying


def _names(facts: Facts, path: KeyPath) -> list[str]:
    """Names of the inputs of a tolerance, which may be that of a thruster or an axis alone."""
    key, chosen = str(path[1]), path[2:]
    if key in EACH_PULSE:
        return []
    if key == "omega0":
        return [f"omega0_{int(axis) + 1}" for axis in chosen or range(3)]
    word, letters = PARTS.get(key, (key, ""))
    if key in BY_THRUSTER:
        return [
            f"{word} {name} {letter}".rstrip()
            for name in chosen or thrusts(facts)
            for letter in (letters if name != STEERABLE else "") or " "
        ]
    if key in ("sensor_bias", "sensor_scale") and facts.text("loop", "sensor", "kind") != ACCELEROMETER:
        return [f"{key.replace('_', ' ')} {axis}" for axis in (1, 2)]
    if letters:
        return [f"{word} {letter}" for letter in letters]
    spaced = key.startswith(("tank_", "sensor_", "timing_", "wheel_"))
    return [key.replace("_", " ", 1) if spaced else key]


LARGEST_SIGMA = 0.5
"""One sigma of a normal distribution, relative to the nominal value, that is still believed: beyond, more than one
draw in forty would turn its sign."""

LARGEST_OFFSET = 1.0
"""Half widths and fixed offsets must stay below this, relative to the nominal value, which would otherwise turn its
sign. Of an angle the nominal value is 90 deg."""


def dispersion_findings(root: Node) -> Iterator[Finding]:
    """All faults between the keys of the dispersions and with the rest of the file."""
    facts, asked = Facts(root), ("nutation", "momentum_shift")
    if facts.has("requirement", "probability") and not any(facts.has("requirement", key) for key in asked):
        problem = "given alone; name what must be met with it: nutation, momentum_shift or both"
        yield Finding(("requirement", "probability"), problem, True)
    if facts.has("dispersions"):
        for rule in (_thruster_names, _kinds, _shifted_moments, _of_sensor, _below_zero, _correlations):
            yield from rule(facts)


def _below_zero(facts: Facts) -> Iterator[Finding]:
    for key in VALVE_TIMES:
        for path in _each(facts, key):
            size = _size_of(facts, path, "time")
            for name, nominal in _valve_times(facts, key, path[2:]).items():
                if size is not None and size[1] > (1.0 + 1e-12) * nominal:
                    yield _negative(path, size, f"the {key} of {name}, {nominal:g} s")
                    break
    low = facts.number("pressure", "tank", "final_pressure")
    for key in ("tank_propellant", "tank_pressure", "tank_final_pressure"):
        level = facts.number(QUANTITIES[key], "tank", key.removeprefix("tank_"))
        size = None if level is None else _size_of(facts, ("dispersions", key), QUANTITIES[key], level)
        floor = low if key == "tank_pressure" and low is not None else 0.0
        if level is not None and size is not None and size[1] > (1.0 + 1e-12) * (level - floor):
            value = f"{level:g} kg" if key == "tank_propellant" else bar(level)
            below = f"less than final_pressure, {bar(floor)}" if floor else "negative"
            yield _negative(("dispersions", key), size, f"{key.replace('_', '.', 1)}, {value}", below)


def _negative(path: KeyPath, size: tuple[str, float], of: str, below: str = "negative") -> Finding:
    reach = "draws beyond three sigma" if size[0] == "normal" else "draws"
    problem = f"{reach} would make {of}, {below}; expected a smaller spread, or a larger nominal value"
    return Finding((*path, size[0]), problem)


def _each(facts: Facts, key: str) -> list[KeyPath]:
    """Paths to the tolerances of ``key``: one, or one a thruster."""
    path: KeyPath = ("dispersions", key)
    if not facts.is_mapping(*path):
        return []
    return facts.below(*path) if by_name(dict(facts.children(*path))) else [path]


def _size_of(facts: Facts, path: KeyPath, kind: str, nominal: float | None = None) -> tuple[str, float] | None:
    """Kind of a tolerance and depth of its draws, three sigma or all, in SI; of % by a ``nominal`` value."""
    for name in KINDS:
        size = facts.number(kind, *path, name)
        share = None if size is not None or nominal is None else facts.number("ratio", *path, name)
        if share is not None and nominal is not None:
            out_of_range = abs(share) > (LARGEST_SIGMA if name == "normal" else LARGEST_OFFSET)  # reported by `_kinds`
            size = None if out_of_range else share * nominal
        if size is not None:
            return name, -size if name == "bias" else 3.0 * size if name == "normal" else size
    return None


def _valve_times(facts: Facts, key: str, named: KeyPath) -> dict[str, float]:
    """The time of ``key`` of the valve of each thruster that a tolerance concerns, s."""
    times = {}
    for path in facts.below("thrusters"):
        name = facts.text(*path, "name")
        valve: KeyPath = (*path, "valve") if facts.has(*path, "valve") else ("valve",)
        time = facts.number("time", *valve, key) if facts.has(*valve, key) else 0.0
        opens = facts.has(*valve) and not facts.has(*path, "impulse_bit")
        if name is not None and time is not None and opens and named in ((), (name,)):
            times[name] = time
    return times


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


def _nominal(facts: Facts, path: KeyPath) -> tuple[float | None, str]:
    """The least value that a tolerance is of, and its name; None where it cannot be read, or nothing bounds it."""
    key, named = str(path[1]), path[2:]
    if key == "thrust":
        forces = thrusts(facts).items()
        least, name = min(
            ((thrust, name) for name, thrust in forces if thrust is not None and named in ((), (name,))),
            default=(None, ""),
        )
        return least, f"the thrust of {name}"
    if key in ("A", "C"):
        principal = principal_of(facts)
        if principal is None:
            return None, ""
        return (0.5 * sum(principal[0][:2]) if key == "A" else principal[0][2]), key
    if key == "omega0":
        spin = facts.number("rate", "omega0", 2) if facts.has("omega0") else facts.number("rate", "state", "spin")
        inertia = inertia_of(facts)
        if spin is None or named not in ((), (2,)):
            return None, ""
        if inertia is not None and inertia.wheel:
            return abs(inertia.equivalent(spin)) or None, "H3/C"
        return abs(spin) or None, "the spin"
    if QUANTITIES[key] == "angle":
        return RIGHT_ANGLE, "" if named else "a right angle"
    return (1.0 if QUANTITIES[key] == "ratio" else None), ""


def _thruster_names(facts: Facts) -> Iterator[Finding]:
    known = list(thrusts(facts))
    for key in BY_THRUSTER:
        path: KeyPath = ("dispersions", key)
        if facts.is_mapping(*path) and not facts.children(*path):
            yield Finding(path, f"empty; give {_example(QUANTITIES[key])}, or one such entry by thruster")
        for *_, name in (entry for entry in _each(facts, key) if entry != path):
            if name == STEERABLE and name not in known:
                yield Finding((*path, name), f"the file has no {STEERABLE} torquer; leave this out", True)
            elif name not in known:
                problem = f"no thruster is called {shown(name)}; {instead(str(name), known)}"
                yield Finding((*path, name), problem, True)


def _kinds(facts: Facts) -> Iterator[Finding]:
    for path in filter(lambda path: facts.is_mapping(*path), _entries(facts)):
        nodes = dict(facts.children(*path))
        given = [str(key) for key in nodes if key in KINDS]
        reported = not nodes and path[1:] in [(key,) for key in BY_THRUSTER]  # by `_thruster_names`
        if not given and not reported:
            yield Finding(path, f"names no distribution; give {_example(QUANTITIES[str(path[1])])}")
        for key in given[1:]:
            yield Finding((*path, key), f"given together with {given[0]}; keep one of the two", True)
        for key in given:
            problem = _size_fault(facts, path, key, nodes[key].plain())
            if problem is not None:
                yield Finding((*path, key), problem)


def _example(kind: str) -> str:
    sizes = {"inertia": "2 %", "mass": "1 %", "pressure": "2 %", "rate": "0.1 deg/s", "force": "3 %"}
    sizes |= {"ratio": "1 %", "angle": "0.5 deg", "length": "5 mm", READING: "0.01 deg/s"}
    return f"{{normal: {sizes.get(kind, '5 ms')}}}, or uniform, triangular, bias"


def _size_fault(facts: Facts, path: KeyPath, key: str, value: object) -> str | None:
    if value is None:
        return None  # reported already
    kind = QUANTITIES[str(path[1])]
    try:
        size, relative = size_of(value, kind)
    except ValueError as wrong:
        return str(wrong)
    if key != "bias" and size < 0.0:
        what = "one sigma" if key == "normal" else "half a width"
        return f"{shown(value)} is negative; expected {what} of at least 0, or bias for a fixed offset"
    for name, thrust in thrusts(facts).items() if kind == "force" and not relative else ():
        if thrust is None and path[2:] in ((), (name,)):
            unknown = f"the {STEERABLE} torquer" if name == STEERABLE else shown(name)
            return f"{shown(value)} needs the thrust of {unknown}, which is not known; give its lever_arm, or a %"
    nominal, of = (1.0, "") if relative else _nominal(facts, path)
    if nominal is None:
        return None
    fraction, limit = abs(size) / nominal, LARGEST_SIGMA if key == "normal" else LARGEST_OFFSET
    if fraction < limit or (key == "normal" and fraction == limit):
        return None
    most = f"{'of at most' if key == 'normal' else 'below'} {100 * limit:g} %"
    amounts = f"is {100 * fraction:.3g} % of {of}" if of else "is out of range"
    what = {"normal": "one sigma", "bias": "an offset"}.get(key, "half a width")
    return f"{shown(value)} {amounts}; expected {what} {most}"


def _shifted_moments(facts: Facts) -> Iterator[Finding]:
    """Fixed offsets of A and C that make a body no body: every draw would be refused."""
    principal = principal_of(facts)
    if principal is None:
        return
    moments = principal[0]
    wider = _offset(facts, "A", 0.5 * (moments[0] + moments[1]))
    longer = _offset(facts, "C", moments[2])
    if wider is None or longer is None or (wider == longer == 0.0):
        return
    first, second, third = (1 + wider) * moments[0], (1 + wider) * moments[1], (1 + longer) * moments[2]
    if third > (first + second) * (1 + 1e-9) or abs(first - second) > third:
        key = "C" if longer != 0.0 else "A"
        problem = f"with this offset C = {third:g} and A = {0.5 * (first + second):g} kg m^2: not physically possible"
        yield Finding(("dispersions", key, "bias"), f"{problem}; C must be at most 2 A")


def _of_sensor(facts: Facts) -> Iterator[Finding]:
    kind = facts.text("loop", "sensor", "kind")
    wrong, right = ("rate", "m/s^2") if kind == "accelerometer" else ("acceleration", "rad/s, deg/s or rpm")
    for key in ("sensor_bias", "sensor_scale", "sensor_noise", "sensor_delay"):
        path: KeyPath = ("dispersions", key)
        if facts.has(*path) and not facts.has("loop"):
            yield Finding(path, "is of the sensor of a loop, and the file has no loop; leave this out", True)
        for distribution in KINDS if key == "sensor_bias" and kind is not None else ():
            text = facts.text(*path, distribution)
            if text is not None and facts.number(wrong, *path, distribution) is not None:
                yield Finding((*path, distribution), f"{shown(text)} is not in the unit of the sensor: {right}")
    path = ("dispersions", "sensor_delay", "bias")
    offset, delay = facts.number("time", *path), facts.number("time", "loop", "sensor", "delay") or 0.0
    if offset is not None and delay + offset < 0.0 and facts.has("loop"):
        yield Finding(path, f"with this offset the delay is {delay + offset:g} s; expected a delay of at least 0")


def _offset(facts: Facts, key: str, nominal: float) -> float | None:
    """Fixed offset of a moment of inertia, relative; 0 where it is exactly known, None where it is random or faulty."""
    if not facts.has("dispersions", key):
        return 0.0
    path = ("dispersions", key, "bias")
    relative, value = facts.number("ratio", *path), facts.number("inertia", *path)
    if facts.text(*path) is None or relative is None:
        relative = None if value is None else value / nominal
    return relative if relative is not None and abs(relative) < LARGEST_OFFSET else None


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
