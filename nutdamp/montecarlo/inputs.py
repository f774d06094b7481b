"""Dispersed inputs of a study: selection, correlation, random draws.

Correlated inputs are a Gaussian copula: each input is a monotonic function of a standard normal
number, and the correlation given is that of these numbers (Nelsen 2006, 5.2): of two uniform inputs
theirs is (6/π) asin(ρ/2).

Every input has a stream of its own in every block of `BLOCK` cases: the counter-based Philox
generator with the seed and the input's name in the key, the block in the counter. So a case is the
same in a study of any size and with any number of threads, and a tolerance that is tightened or
dropped leaves all other draws as they were.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import BadRequest, Unsuitable
from nutdamp.flight.dynamics import shed
from nutdamp.spacecraft.equipment import ACCELEROMETER, Thruster
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import STEERABLE, Schedule, channel_pulse, steerable_pulse
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance

Array = NDArray[np.float64]

SPREAD = {
    "normal": 1.0,
    "uniform": 1.0 / math.sqrt(3.0),
    "triangular": 1.0 / math.sqrt(6.0),
    "bias": 0.0,
}
"""Standard deviation of each kind for a size of one."""

BY_VALVE = ("open_delay", "close_delay", "rise_time", "fall_time", "impulse_bit")
"""Tolerances of a valve, or in the last place of a table."""

TENSOR = {
    f"inertia {'xyz'[row]}{'xyz'[column]}": (row, column)
    for row in range(3)
    for column in range(row, 3)
}
"""Inputs of the inertia tensor, and the row and column of each."""

TANK = {"propellant": "kg", "pressure": "Pa", "final_pressure": "Pa", "exponent": ""}
"""Dispersed values of a tank, and their units."""

SENSED = ("bias", "scale", "noise", "delay")  # tolerances of the sensor of a loop

KNOWN_BY_TORQUE = "the file gives only its torque, not position and direction of its force"

SCHEDULE_IDLE = "the schedule does not fire"


class DispersedInput(NamedTuple):
    """Drawn quantity: its value in a case = ``nominal`` + draw, in ``unit``."""

    name: str
    tolerance: str  # key of the file's ``dispersions``
    kind: str  # of `nutdamp.spacecraft.tolerances.KINDS`, which says what ``size`` means
    size: float
    nominal: float
    unit: str  # empty for factors

    @property
    def sigma(self) -> float:
        """Standard deviation, in ``unit``; zero for a bias."""
        return abs(self.size) * SPREAD[self.kind]


class Unused(NamedTuple):
    """A tolerance of the file that touches nothing, and why."""

    name: str
    reason: str


class Inputs(NamedTuple):
    """Inputs of a study in a fixed order, and unused tolerances."""

    drawn: tuple[DispersedInput, ...]
    unused: tuple[Unused, ...]


class _Row(NamedTuple):
    """Inputs of one tolerance of the file; ``idle`` says why they touch nothing, empty: they do."""

    key: str
    names: Sequence[str]
    nominal: float = 0.0
    unit: str = ""
    idle: str = ""
    tolerance: Tolerance | None = None  # None: that of the key


def list_inputs(spacecraft: Spacecraft, schedule: Schedule) -> Inputs:
    """Inputs of a study of ``schedule``; none for a spacecraft without dispersions."""
    requested = spacecraft.dispersions
    rows = [] if requested is None else _rows(spacecraft, requested, schedule)
    return _listed(requested, rows)


def _listed(requested: Dispersions | None, rows: Iterable[_Row]) -> Inputs:
    """Inputs, whose relative sizes become absolute, and unused tolerances, those too whose size is
    zero.
    """
    drawn, unused = list[DispersedInput](), list[Unused]()
    for key, names, nominal, unit, idle, own in rows:
        tolerance = own or getattr(requested, key, None)
        if tolerance is None:
            continue
        size = tolerance.size * (nominal if tolerance.relative else 1.0)
        if size == 0.0 and not idle:
            share = key in ("A", "C", "omega0", "wheel_momentum") and nominal == 0.0
            idle = "given in % of a value that is zero" if share else "its size is zero"
        if idle:
            unused += [Unused(name, idle) for name in names]
            continue
        size = size if tolerance.kind == "bias" else abs(size)
        drawn += [DispersedInput(name, key, tolerance.kind, size, nominal, unit) for name in names]
    return Inputs(tuple(drawn), tuple(unused))


def reachable(spacecraft: Spacecraft) -> Inputs:
    """Inputs of any schedule: those of one that fires each channel and the torquer; what pulses
    draw is there once.
    """
    pulses = [channel_pulse(channel, 0.0, 0.0) for channel in spacecraft.channels]
    if spacecraft.torquer is not None:
        pulses.append(steerable_pulse(spacecraft.torquer, 0.0, 0.0))
    drawn, unused = with_sensor(
        spacecraft, list_inputs(spacecraft, Schedule(tuple(pulses))), "no channel fires"
    )
    once = [
        entry for entry in drawn if " pulse " not in entry.name or entry.name.endswith(" pulse 1")
    ]
    return Inputs(
        tuple(each._replace(name=each.name.replace(" pulse 1", " of each pulse")) for each in once),
        unused,
    )


def with_sensor(spacecraft: Spacecraft, fired: Inputs, idle: str) -> Inputs:
    """Inputs of a loop by those of what is ``fired``, and of its sensor; ``idle`` in place of
    `SCHEDULE_IDLE`.
    """
    loop = spacecraft.loop
    rows = []
    if loop is not None:
        sensor = loop.sensor
        axes, unit = ([""], "m/s²") if sensor.kind == ACCELEROMETER else ([" 1", " 2"], "rad/s")
        silent = "" if sensor.noise else "the sensor has no noise"
        rows = [
            _Row("sensor_bias", [f"sensor bias{axis}" for axis in axes], sensor.bias, unit),
            _Row("sensor_scale", [f"sensor scale{axis}" for axis in axes], 1.0),
            _Row("sensor_noise", ["sensor noise"], 1.0, "", silent),
            _Row("sensor_delay", ["sensor delay"], sensor.delay, "s"),
        ]
    seen = _listed(spacecraft.dispersions, rows)
    rest = (entry for entry in fired.unused if not entry.name.startswith("sensor "))
    unused = (entry._replace(reason=entry.reason.replace(SCHEDULE_IDLE, idle)) for entry in rest)
    return Inputs((*fired.drawn, *seen.drawn), (*unused, *seen.unused))


def _rows(spacecraft: Spacecraft, requested: Dispersions, schedule: Schedule) -> list[_Row]:
    """Inputs in the order of their listing: body and motion, thrusters, supply, pulses, attitude,
    sensor.
    """
    inertia, cold, tank = spacecraft.inertia, spacecraft.cold, spacecraft.tank
    members = _fired(spacecraft, schedule)
    thrusters = [thruster for thruster in members.values() if thruster is not None]
    pushed = any(each.force is not None for each in thrusters)
    by_torque = KNOWN_BY_TORQUE if members else f"{SCHEDULE_IDLE} any thruster"
    unfed = "" if thrusters else "the schedule fires no thruster"
    of_cold = "the file has no cold nozzles" if cold is None else unfed
    of_tank = "the file has no tank" if tank is None else unfed
    light = shed(spacecraft) is None and tank is not None
    per_kg = "the tank has no inertia_per_kg" if light else of_tank
    numbers = range(1, len(schedule) + 1)
    no_pulses = "" if len(schedule) else "the schedule has no pulses"
    thrusts = [f"thrust pulse {number}" for number in numbers] or ["thrust per pulse"]
    timings = [f"timing pulse {number}" for number in numbers] or ["timing"]
    unseen = "a schedule does not use the sensor; --loop flies the loop"
    sun = spacecraft.sun_sensor
    jitter = sun.jitter if schedule.blocks and sun is not None else 0.0
    fired_with = dict.fromkeys(schedule.fired_with) if jitter > 0.0 else ()
    passages = [f"Sun pulse {number}" for number in fired_with]
    return [
        _Row("A", ["A"], inertia.A, "kg m²"),
        _Row("C", ["C"], inertia.C, "kg m²"),
        *_of_tensor(inertia.tensor, requested.inertia_tensor),
        _Row("wheel_momentum", ["wheel momentum"], inertia.wheel, "N m s"),
        *(
            _Row("omega0", [f"omega0_{at + 1}"], rate, "rad/s", "", requested.omega0[at])
            for at, rate in enumerate((inertia.axes @ spacecraft.omega0).tolist())
            if requested.omega0[at] is not None
        ),
        *(
            _of_thruster(key, name, tolerance, members)
            for key in ("thrust", "thrust_direction", "position", *BY_VALVE)
            for name, tolerance in getattr(requested, key).items()
        ),
        _Row(
            "center_of_mass",
            [f"center of mass {axis}" for axis in "xyz"],
            0.0,
            "m",
            "" if pushed else by_torque,
        ),
        _Row("cold", ["cold"], getattr(cold, "first", 0.0), "", of_cold),
        _Row("cold_pulses", ["cold_pulses"], getattr(cold, "pulses", 0.0), "", of_cold),
        *(
            _Row(f"tank_{name}", [f"tank {name}"], getattr(tank, name, 0.0), unit, of_tank)
            for name, unit in TANK.items()
        ),
        _Row("inertia_per_kg", ["inertia_per_kg"], 1.0, "", per_kg),
        _Row("thrust_per_pulse", thrusts, 1.0, "", no_pulses),
        _Row("timing", timings, 0.0, "s", no_pulses),
        _Row("timing_offset", ["timing offset"], 0.0, "s", no_pulses),
        _Row("sun_sensor.jitter", passages, 0.0, "s", "", Tolerance("normal", jitter)),
        _Row("attitude", ["attitude x", "attitude y"], 0.0, "rad"),
        *(_Row(f"sensor_{name}", [f"sensor {name}"], 0.0, "", unseen) for name in SENSED),
    ]


def _of_tensor(tensor: Array, spread: Tolerance | None) -> list[_Row]:
    """Components of the inertia tensor, of which a relative spread is that of moments."""
    if spread is None:
        return []
    rows = []
    for name, (row, column) in TENSOR.items():
        size = math.sqrt(tensor[row, row] * tensor[column, column]) if spread.relative else 1.0
        own = replace(spread, size=spread.size * size, relative=False)
        rows.append(_Row("inertia_tensor", [name], float(tensor[row, column]), "kg m²", "", own))
    return rows


def _fired(spacecraft: Spacecraft, schedule: Schedule) -> dict[str, Thruster | None]:
    """Thrusters fired by the schedule, by name; the steerable torquer has None."""
    channels = {channel.name: channel for channel in spacecraft.channels}
    members: dict[str, Thruster | None] = {}
    for pulse in schedule:
        if pulse.channel in channels:
            members |= {thruster.name: thruster for thruster in channels[pulse.channel].thrusters}
        elif pulse.channel == STEERABLE and spacecraft.torquer is not None:
            members[STEERABLE] = None
    return members


def _of_thruster(
    key: str, name: str, tolerance: Tolerance, members: Mapping[str, Thruster | None]
) -> _Row:
    """Inputs of a tolerance of a thruster, its valve or the table in its place."""
    thruster = members.get(name)
    called = f"{key.removeprefix('thrust_')} {name}"
    valve = None if thruster is None else thruster.valve
    names = [called]
    nominal = 0.0
    unit = "rad"
    idle = ""
    if name not in members:
        idle = f"{SCHEDULE_IDLE} {'the steerable torquer' if name == STEERABLE else name}"
    elif key in ("thrust", "impulse_bit"):
        nominal, unit = 1.0, ""
        if key == "impulse_bit" and (valve is None or hasattr(valve, "open_delay")):
            idle = f"{name} has no impulse_bit"
    elif key in BY_VALVE:
        nominal = getattr(valve, key, 0.0)
        unit = "s"
        idle = "" if hasattr(valve, key) else f"{name} has no valve"
    elif thruster is None:
        idle = (
            "a steerable torquer gives a pure torque, wherever it is mounted"
            if key == "position"
            else ""
        )
    elif thruster.force is None or (key == "thrust_direction" and thruster.position is None):
        idle = KNOWN_BY_TORQUE
    else:
        axes, unit = ("xyz", "m") if key == "position" else ("ab", "rad")
        names = [f"{called} {axis}" for axis in axes]
    return _Row(key, names, nominal, unit, idle, tolerance)


Pair = tuple[str, str, float]  # names of two inputs, and their correlation
NODES = 96  # nodes of the quadrature for the correlation of values that are not normal


class Group(NamedTuple):
    """Group of directly or indirectly correlated inputs: ``matrix`` (m, m) of their normals."""

    names: tuple[str, ...]
    matrix: Array

    @property
    def factor(self) -> Array:
        """Cholesky factor L (m, m), lower: L times independent standard normals has this
        correlation.
        """
        return np.asarray(np.linalg.cholesky(self.matrix))

    def among(self, names: Iterable[str]) -> Group:
        """Subgroup of the inputs among ``names``."""
        rows = [row for row, name in enumerate(self.names) if name in set(names)]
        return Group(tuple(self.names[row] for row in rows), self.matrix[np.ix_(rows, rows)])

    def mixed(self, independent: Sequence[Array]) -> list[Array]:
        """Correlated standard normals (m, n) of independent ones; each sum is taken in the same
        order for any n.
        """
        return [
            sum(
                (entry * independent[at] for at, entry in enumerate(row[: index + 1])), np.zeros(())
            )
            for index, row in enumerate(self.factor.tolist())
        ]


def positive_definite(group: Group) -> bool:
    """True if numbers with these correlations exist, none of which follows from the others."""
    try:
        return bool(np.all(np.isfinite(group.factor)))
    except np.linalg.LinAlgError:
        return False


def grouped(pairs: Iterable[Pair]) -> tuple[Group, ...]:
    """Groups connected by ``pairs``, names in the order of their first pair."""
    pairs = list(pairs)
    members = list[list[str]]()
    for first, second, _ in pairs:
        touched = [member for member in members if first in member or second in member]
        members = [member for member in members if member not in touched]
        members.append(
            list(dict.fromkeys([*(name for member in touched for name in member), first, second]))
        )
    groups = []
    for names in members:
        matrix = np.eye(len(names))
        for first, second, size in pairs:
            if first in names:
                row, column = names.index(first), names.index(second)
                matrix[row, column] = matrix[column, row] = size
        groups.append(Group(tuple(names), matrix))
    return tuple(groups)


def groups_of(pairs: Iterable[Pair]) -> tuple[Group, ...]:
    """`grouped`; raises BadRequest for groups that are not positive definite."""
    for group in (groups := grouped(pairs)):
        if not positive_definite(group):
            raise BadRequest(
                f"the correlation of {', '.join(group.names)} is not positive definite"
            )
    return groups


def value_of(entry: DispersedInput, normal: Array) -> Array:
    """Deviation of a standard ``normal`` number, at the same level of its distribution."""
    if entry.kind == "normal":
        return entry.size * normal
    from scipy.special import ndtr  # few files have correlated inputs that are not normal

    if entry.kind == "uniform":
        return np.asarray(entry.size * (2.0 * ndtr(normal) - 1.0))
    return np.asarray(entry.size * np.sign(normal) * (1.0 - np.sqrt(2.0 * ndtr(-np.abs(normal)))))


def normal_of(entry: DispersedInput, value: Array) -> Array:
    """Inverse of `value_of`."""
    if entry.kind == "normal":
        return value / entry.size
    from scipy.special import ndtri  # as above

    share = value / entry.size
    below = 0.5 * (1.0 - np.abs(share)) ** (1 if entry.kind == "uniform" else 2)
    return np.asarray(-np.sign(share) * ndtri(np.maximum(below, np.finfo(float).tiny)))


def mixing(inputs: Sequence[DispersedInput], groups: Iterable[Group]) -> Array:
    """M (d, d): M Mᵀ is the correlation of the values of ``inputs``; in a group, column k is what
    input k adds.
    """
    mixed = np.eye(len(inputs))
    rows = {entry.name: row for row, entry in enumerate(inputs) if entry.sigma > 0.0}
    for group in groups:
        present = group.among(rows)
        at = [rows[name] for name in present.names]
        for row, line in zip(at, present.matrix.tolist(), strict=True):
            mixed[row, at] = [
                _of_values(inputs[row], inputs[other], rho)
                for other, rho in zip(at, line, strict=True)
            ]
        mixed[np.ix_(at, at)] = np.linalg.cholesky(mixed[np.ix_(at, at)])
    return mixed


def independent(
    draws: Mapping[str, Array], inputs: Iterable[DispersedInput], groups: Iterable[Group]
) -> dict[str, Array]:
    """Draws with those of a group replaced by the independent normals behind them."""
    named = {entry.name: entry for entry in inputs}
    normals_of = dict(draws)
    for group in groups:
        present = group.among(draws)
        if len(present.names) < 2:
            continue
        normals = np.array([normal_of(named[name], draws[name]) for name in present.names])
        normals_of.update(zip(present.names, np.linalg.solve(present.factor, normals), strict=True))
    return normals_of


def together(inputs: Sequence[DispersedInput], groups: Iterable[Group]) -> list[list[int]]:
    """Rows of ``inputs``, those of a group in one list, in order."""
    rows = {entry.name: row for row, entry in enumerate(inputs) if entry.sigma > 0.0}
    blocks = [[rows[name] for name in group.among(rows).names] for group in groups]
    blocks += [[row] for row in range(len(inputs)) if not any(row in block for block in blocks)]
    return sorted(filter(None, blocks), key=min)


def _of_values(first: DispersedInput, second: DispersedInput, rho: float) -> float:
    """Correlation of the values of two inputs whose normals have ``rho``, by Gauss-Hermite
    quadrature.
    """
    if first.name == second.name:
        return 1.0
    if first.kind == second.kind == "normal":
        return rho
    if first.kind == second.kind == "uniform":
        return 6.0 / math.pi * math.asin(0.5 * rho)
    nodes, weights = _nodes()
    other = rho * nodes[:, None] + math.sqrt(1.0 - rho * rho) * nodes
    mean = weights @ (value_of(first, nodes)[:, None] * value_of(second, other)) @ weights
    return float(mean / (first.sigma * second.sigma))


@cache
def _nodes() -> tuple[Array, Array]:
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    return nodes, weights / math.sqrt(2.0 * math.pi)


Draws = Mapping[
    str, "Array | float"
]  # deviations from nominal by the name of the input, (n,) or one for all cases


def some_of(draws: Draws, rows: Any) -> dict[str, Any]:
    """Draws of some cases, or of one, by their ``rows``."""
    return {name: draw if isinstance(draw, float) else draw[rows] for name, draw in draws.items()}


BLOCK = 16_384  # cases that share a substream of each input
MOST_ATTEMPTS = (
    1_000  # largest number of redraws of a case; beyond it the dispersions count as impossible
)


class DrawSource:
    """Draws of the blocks of a study; ``physical`` tells which cases can be, (n,) or
    True for all.
    """

    def __init__(
        self,
        inputs: Sequence[DispersedInput],
        seed: int,
        physical: Callable[[Draws], NDArray[np.bool_] | bool],
        groups: Iterable[Group] = (),
    ):
        self._random = [entry for entry in inputs if entry.kind != "bias"]
        self._fixed = {entry.name: entry.size for entry in inputs if entry.kind == "bias"}
        names = {entry.name for entry in self._random}
        self._groups = [group for group in groups if names & set(group.names)]
        self._seed, self._physical = seed, physical
        self._table = np.empty((len(self._random), BLOCK))

    def block(self, number: int) -> tuple[dict[str, Array | float], NDArray[np.intp]]:
        """Deviations of the cases of block ``number`` (from 0), and the rows drawn again (once per
        redraw).

        The next block overwrites the arrays. Raises Unsuitable where no physical case is found.
        """
        rows = np.arange(BLOCK)
        redrawn = [np.empty(0, dtype=np.intp)]
        for attempt in range(MOST_ATTEMPTS + 1):
            drawn = np.empty((len(self._random), len(rows))) if attempt else self._table
            self._fill(drawn, number, attempt)
            if attempt:
                self._table[:, rows] = drawn
            rows = rows[~np.broadcast_to(np.asarray(self._physical(self._named(drawn))), len(rows))]
            if not len(rows):
                return self._named(self._table), np.concatenate(redrawn)
            redrawn.append(rows)
        raise Unsuitable(
            ("dispersions",), "almost all draws are unphysical (C > 2A, thrust < 0, delay < 0)"
        )

    def _named(self, table: Array) -> dict[str, Array | float]:
        return {
            **self._fixed,
            **{entry.name: row for entry, row in zip(self._random, table, strict=True)},
        }

    def _fill(self, table: Array, block: int, attempt: int) -> None:
        """Fill ``table`` (inputs, cases) by the deviations of a block; each ``attempt`` has a
        stream of its own.
        """
        at = (self._seed, block, attempt, table.shape[1])
        normals = dict[str, Array]()
        for group in self._groups:
            alone = [_drawn(name, "normal", *at) for name in group.names]
            normals.update(zip(group.names, group.mixed(alone), strict=True))
        for entry, row in zip(self._random, table, strict=True):
            if entry.name in normals:
                row[:] = value_of(entry, normals[entry.name])
            else:
                np.multiply(_drawn(entry.name, entry.kind, *at), entry.size, out=row)


# streams of blocks that are kept, 128 KiB each: all candidates and stages of a study fly the same
# draws
KEPT = 128


@lru_cache(KEPT)
def _drawn(name: str, kind: str, seed: int, block: int, attempt: int, count: int) -> Array:
    """First ``count`` draws of an input, of size one; read-only."""
    stream = int.from_bytes(
        hashlib.blake2b(name.encode(), digest_size=8).digest(), "little"
    )  # the same everywhere
    key, counter = np.array([seed, stream], np.uint64), np.array([0, 0, attempt, block], np.uint64)
    generator = np.random.Generator(np.random.Philox(key=key, counter=counter))
    if kind == "normal":
        draws = generator.standard_normal(count)
    elif kind == "uniform":
        draws = 2.0 * generator.random(count) - 1.0
    else:
        draws = generator.random(count) + generator.random(count) - 1.0
    draws.setflags(write=False)
    return draws
