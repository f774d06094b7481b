"""Which quantities a dispersion study draws: the tolerances of the file against the pulses of the schedule.

Every drawn quantity is one `Input` with a name of its own. A tolerance that cannot touch the outcome is not dropped
in silence: it becomes an `Unused` with its reason.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import partial
from typing import NamedTuple

from nutdamp.lightening import shed
from nutdamp.loop_settings import ACCELEROMETER
from nutdamp.schedule import STEERABLE, Schedule, channel_pulse, steerable_pulse
from nutdamp.spacecraft import Spacecraft, Thruster
from nutdamp.tolerances import Dispersions, Tolerance

SPREAD = {"normal": 1.0, "uniform": 1.0 / math.sqrt(3.0), "triangular": 1.0 / math.sqrt(6.0), "bias": 0.0}
"""Standard deviation of each kind for a size of one."""

BY_VALVE = ("open_delay", "close_delay", "rise_time", "fall_time", "impulse_bit")
"""Tolerances of a valve, or in the last place of a table."""

KNOWN_BY_TORQUE = "the file gives only its torque: where and which way its force acts is not known"

SCHEDULE_IDLE = "the schedule does not fire"


class Input(NamedTuple):
    """One drawn quantity: its value in a case = ``nominal`` + draw, in ``unit``.

    ``tolerance`` is the key of the file's ``dispersions`` it comes from; ``size`` is what its ``kind`` means in
    `nutdamp.tolerances.KINDS`, in ``unit`` (a bare number for factors).
    """

    name: str
    tolerance: str
    kind: str
    size: float
    nominal: float
    unit: str

    @property
    def sigma(self) -> float:
        """Standard deviation, in ``unit``; zero for a bias."""
        return abs(self.size) * SPREAD[self.kind]


class Unused(NamedTuple):
    """A tolerance of the file that touches nothing, and why."""

    name: str
    reason: str


class Inputs(NamedTuple):
    """What a study draws, in a fixed order, and what it leaves."""

    drawn: tuple[Input, ...]
    unused: tuple[Unused, ...]


def list_inputs(spacecraft: Spacecraft, schedule: Schedule) -> Inputs:
    """The inputs of a study of ``schedule``; none for a spacecraft without dispersions."""
    drawn: list[Input] = []
    unused: list[Unused] = []
    for entry in _entries(spacecraft, schedule):
        if isinstance(entry, Unused):
            unused.append(entry)
        elif entry.size == 0.0:
            unused.append(Unused(entry.name, _no_size(entry)))
        else:
            drawn.append(entry)
    return Inputs(tuple(drawn), tuple(unused))


def reachable(spacecraft: Spacecraft) -> Inputs:
    """What any schedule could draw: the inputs of one that fires each channel and the torquer once.

    What each pulse draws is there once.
    """
    pulses = [channel_pulse(channel, 0.0, 0.0) for channel in spacecraft.channels]
    if spacecraft.torquer is not None:
        pulses.append(steerable_pulse(spacecraft.torquer, 0.0, 0.0))
    drawn, unused = list_inputs(spacecraft, Schedule(tuple(pulses)))
    once = (entry for entry in drawn if " pulse " not in entry.name or entry.name.endswith(" pulse 1"))
    sensor = of_sensor(spacecraft)
    rest = (entry for entry in unused if not entry.name.startswith("sensor "))
    return Inputs(
        (*(entry._replace(name=entry.name.replace(" pulse 1", " of each pulse")) for entry in once), *sensor.drawn),
        (
            *(entry._replace(reason=entry.reason.replace(SCHEDULE_IDLE, "no channel fires")) for entry in rest),
            *sensor.unused,
        ),
    )


def of_sensor(spacecraft: Spacecraft) -> Inputs:
    """What a loop draws of its sensor: bias and scale of each gyro on its own; nothing for a spacecraft without one."""
    requested, loop = spacecraft.dispersions, spacecraft.loop
    if requested is None or loop is None:
        return Inputs((), ())
    sensor = loop.sensor
    single = sensor.kind == ACCELEROMETER
    axes, unit = ([""], "m/s²") if single else ([" 1", " 2"], "rad/s")
    known = {
        **{f"sensor bias{axis}": ("sensor_bias", sensor.bias, unit) for axis in axes},
        **{f"sensor scale{axis}": ("sensor_scale", 1.0, "") for axis in axes},
        "sensor noise": ("sensor_noise", 1.0, ""),
        "sensor delay": ("sensor_delay", sensor.delay, "s"),
    }
    drawn, unused = [], []
    for name, (key, nominal, of) in known.items():
        tolerance: Tolerance | None = getattr(requested, key)
        if tolerance is None:
            continue
        idle = "the sensor has no noise" if key == "sensor_noise" and sensor.noise == 0.0 else ""
        if idle or tolerance.size == 0.0:
            unused.append(Unused(name, idle or "its size is zero"))
        else:
            drawn.append(_input(name, key, tolerance, nominal, of))
    return Inputs(tuple(drawn), tuple(unused))


def _no_size(entry: Input) -> str:
    if entry.tolerance in ("A", "C", "omega0") and entry.nominal == 0.0:
        return "given in % of a value that is zero"
    return "its size is zero"


def _entries(spacecraft: Spacecraft, schedule: Schedule) -> Iterator[Input | Unused]:
    requested = spacecraft.dispersions
    if requested is None:
        return
    moments = (("A", spacecraft.inertia.A, requested.A), ("C", spacecraft.inertia.C, requested.C))
    rates = spacecraft.inertia.axes @ spacecraft.omega0
    for name, nominal, tolerance in moments:
        if tolerance is not None:
            yield _input(name, name, tolerance, nominal, "kg m²")
    for number, (tolerance, rate) in enumerate(zip(requested.omega0, rates.tolist(), strict=True), start=1):
        if tolerance is not None:
            yield _input(f"omega0_{number}", "omega0", tolerance, rate, "rad/s")
    members = fired(spacecraft, schedule)
    kinds = [("thrust", _thrust), ("thrust_direction", _direction), ("position", _position)]
    kinds += [(key, partial(_valve, key)) for key in BY_VALVE]
    for key, of_thruster in kinds:
        for name, tolerance in getattr(requested, key).items():
            if name in members:
                yield from of_thruster(name, tolerance, members[name])
            else:
                who = "the steerable torquer" if name == STEERABLE else name
                yield Unused(f"{key.removeprefix('thrust_')} {name}", f"{SCHEDULE_IDLE} {who}")
    yield from _feed(spacecraft, requested, any(thruster is not None for thruster in members.values()))
    pulses = range(1, len(schedule) + 1)
    if requested.thrust_per_pulse is not None:
        named = [f"thrust pulse {number}" for number in pulses]
        yield from _of_pulses("thrust_per_pulse", named, requested.thrust_per_pulse, 1.0, "")
    if requested.timing is not None:
        yield from _of_pulses("timing", [f"timing pulse {number}" for number in pulses], requested.timing, 0.0, "s")
    if requested.timing_offset is not None:
        yield from _of_pulses("timing_offset", ["timing offset"] * bool(pulses), requested.timing_offset, 0.0, "s")
    sensor = spacecraft.sun_sensor
    if schedule.blocks and sensor is not None and sensor.jitter > 0.0:
        for number in pulses:
            yield Input(f"Sun pulse {number}", "sun_sensor.jitter", "normal", sensor.jitter, 0.0, "s")
    if requested.attitude is not None:
        for axis in "xy":
            yield _input(f"attitude {axis}", "attitude", requested.attitude, 0.0, "rad")
    for key in ("sensor_bias", "sensor_scale", "sensor_noise", "sensor_delay"):
        if getattr(requested, key) is not None:
            yield Unused(key.replace("_", " "), "a schedule is fired whatever a sensor shows: --loop flies the loop")


def _input(name: str, key: str, tolerance: Tolerance, nominal: float, unit: str) -> Input:
    """Sizes of relative tolerances become absolute; a factor (nominal one) stays what it is."""
    size = tolerance.size * (nominal if tolerance.relative else 1.0)
    return Input(name, key, tolerance.kind, size if tolerance.kind == "bias" else abs(size), nominal, unit)


def fired(spacecraft: Spacecraft, schedule: Schedule) -> dict[str, Thruster | None]:
    """The thrusters that the schedule fires, by name; the steerable torquer has None."""
    channels = {channel.name: channel for channel in spacecraft.channels}
    members: dict[str, Thruster | None] = {}
    for pulse in schedule:
        if pulse.channel in channels:
            members |= {thruster.name: thruster for thruster in channels[pulse.channel].thrusters}
        elif pulse.channel == STEERABLE and spacecraft.torquer is not None:
            members[STEERABLE] = None
    return members


def _thrust(name: str, tolerance: Tolerance, _: Thruster | None) -> Iterator[Input | Unused]:
    yield Input(f"thrust {name}", "thrust", tolerance.kind, tolerance.size, 1.0, "")


def _direction(name: str, tolerance: Tolerance, thruster: Thruster | None) -> Iterator[Input | Unused]:
    if thruster is None:
        yield _input(f"direction {name}", "thrust_direction", tolerance, 0.0, "rad")
    elif thruster.force is None or thruster.position is None:
        yield Unused(f"direction {name}", KNOWN_BY_TORQUE)
    else:
        for axis in "ab":
            yield _input(f"direction {name} {axis}", "thrust_direction", tolerance, 0.0, "rad")


def _position(name: str, tolerance: Tolerance, thruster: Thruster | None) -> Iterator[Input | Unused]:
    if thruster is None:
        yield Unused(f"position {name}", "a steerable torquer gives a pure torque, wherever it is mounted")
    elif thruster.force is None:
        yield Unused(f"position {name}", KNOWN_BY_TORQUE)
    else:
        for axis in "xyz":
            yield _input(f"position {name} {axis}", "position", tolerance, 0.0, "m")


def _feed(spacecraft: Spacecraft, requested: Dispersions, fires: bool) -> Iterator[Input | Unused]:
    """Tolerances of cold nozzles and of the tank; ``fires``: whether any thruster does."""
    cold, tank = spacecraft.cold, spacecraft.tank
    first, count = (0.0, 0.0) if cold is None else (cold.first, cold.pulses)
    of_cold = {"cold": (first, ""), "cold_pulses": (count, "")}
    units = {"propellant": "kg", "pressure": "Pa", "final_pressure": "Pa", "exponent": ""}
    of_tank = {f"tank_{name}": (0.0 if tank is None else getattr(tank, name), unit) for name, unit in units.items()}
    for key, (nominal, unit) in (of_cold | of_tank | {"inertia_per_kg": (1.0, "")}).items():
        tolerance: Tolerance | None = getattr(requested, key)
        if tolerance is None:
            continue
        name = key.replace("tank_", "tank ")
        if (cold if key in of_cold else tank) is None:
            yield Unused(name, f"the file has no {'cold nozzles' if key in of_cold else 'tank'}")
        elif key == "inertia_per_kg" and shed(spacecraft) is None:
            yield Unused(name, "the tank has no inertia_per_kg")
        elif not fires:
            yield Unused(name, "the schedule fires no thruster")
        else:
            yield _input(name, key, tolerance, nominal, unit)


def _valve(key: str, name: str, tolerance: Tolerance, thruster: Thruster | None) -> Iterator[Input | Unused]:
    """A tolerance of a valve, or of a table in its place."""
    called, valve = f"{key} {name}", None if thruster is None else thruster.valve
    delay = getattr(valve, key, None)
    if key == "impulse_bit" and valve is not None and not hasattr(valve, "open_delay"):
        yield Input(called, key, tolerance.kind, tolerance.size, 1.0, "")
    elif key == "impulse_bit" or delay is None:
        yield Unused(called, f"{name} has no {'impulse_bit' if key == 'impulse_bit' else 'valve'}")
    else:
        yield _input(called, key, tolerance, delay, "s")


def _of_pulses(
    key: str, names: Iterable[str], tolerance: Tolerance, nominal: float, unit: str
) -> Iterator[Input | Unused]:
    named = list(names)
    if not named:
        yield Unused(key.replace("_", " "), "the schedule has no pulses")
    for name in named:
        yield Input(name, key, tolerance.kind, tolerance.size, nominal, unit)
