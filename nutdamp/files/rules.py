"""Constraints between the keys of a spacecraft file: its values as far as they can be read, a table
of rules, and what body and motion need; and warnings of numbers that probably lack a unit.

Unreadable values are skipped, so that rules work beside any other fault.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import cure_of, span
from nutdamp.files.fields import SMALLEST, Finding, Values
from nutdamp.files.keys import BY_THRUSTER, SPACECRAFT, VALVE_TIMES, by_name, thrust_behind
from nutdamp.files.yaml import KeyPath, Node, dotted
from nutdamp.physics import inertia as principal_moments
from nutdamp.spacecraft.model import Inertia, Spacecraft
from nutdamp.spacecraft.schedule import STEERABLE
from nutdamp.spacecraft.tolerances import Tolerance
from nutdamp.units import FASTEST, KINDS, bar, parse, reading, shown

Vector = NDArray[np.float64]

CANCELLED = 1e-12
"""A sum smaller than its terms by this factor is their rounding: 4,000 times that of one number."""

SYMMETRIC = 1e-9
"""Asymmetry of a tensor, over its largest entry, that ten printed digits leave."""


class Facts(Values):
    """The values of a spacecraft file by path, and what follows from them: ``principal`` moments,
    kg m², and axes, the ``inertia`` of a body that can spin so, and the ``spin`` about principal
    axis 3, rad/s; each None where it is not known, or impossible.
    """

    principal: tuple[principal_moments.Moments, Vector] | None = None
    inertia: Inertia | None = None
    spin: float | None = None

    def __init__(self, root: Node) -> None:
        super().__init__(root)
        self.contents = self.read(SPACECRAFT, root)
        self.findings += self._body()

    def _body(self) -> Iterator[Finding]:
        """Findings where no body has these moments and this spin."""
        path: KeyPath = ("inertia", "tensor")
        A, C = self.number("inertia", "A"), self.number("inertia", "C")
        rows = [self.vector(*row) for row in self.below(*path)]
        wheel = self.number("wheel", "momentum") or 0.0
        spin_path: KeyPath = ("state", "spin")
        spin, omega0 = self.number(*spin_path), self.vector("omega0")
        if self.has("omega0"):
            spin_path = ("omega0", 2)
            spin = None if omega0 is None else float(omega0[2])
        fault = None
        if len(rows) == 3 and all(row is not None for row in rows):
            fault = tensor_fault(np.array(rows))
            if fault is None:
                self.principal = principal_moments.principal_axes(symmetric(np.array(rows)))
            if omega0 is not None:
                spin_path = ("omega0",)
                spin = None
                if self.principal is not None:  # a rate that is rounding is zero
                    along = float(self.principal[1][:, 2] @ omega0)
                    spin = along if abs(along) > CANCELLED * math.hypot(*omega0) else 0.0
        elif A is not None and C is not None and C <= 2 * A:
            self.principal = ((A, A, C), np.eye(3))
        elif A is not None and C is not None:
            fault = Finding(
                ("inertia", "C"),
                f"C = {C:g} exceeds 2 A = {2 * A:g} kg m^2: not physically possible (A and C "
                "swapped?); at most 2 A (a flat disc)",
            )
        if fault is not None:
            yield fault
        if spin is not None and abs(spin) < SMALLEST and not wheel:
            spin = None
            yield Finding(
                spin_path,
                "the spin is zero; expected a rate about axis 3, or a wheel; without both there is "
                "no nutation",
            )
        self.spin = spin
        if self.principal is None:
            return
        moments = self.principal[0]
        stable = principal_moments.growth(moments, spin or 0.0, wheel).stable
        if rows and wheel and spin is not None and not stable:
            low, high = sorted(moment * spin - moments[2] * spin for moment in moments[:2])
            yield Finding(
                ("wheel", "momentum"),
                f"nutation about the spin axis grows with it; expected a momentum below {low:.4g} "
                f"or above {high:.4g} N m s",
            )
        unstable = {
            "degenerate": "the same principal moment as just one other axis",
            "intermediate": "the middle principal moment",
        }
        kind = principal_moments.axis_class(moments)
        if kind in unstable and not wheel:
            named = sorted(zip(moments, ("I1", "I2", "I3"), strict=True), reverse=True)
            values = ", ".join(f"{name} = {moment:.10g}" for moment, name in named)
            yield Finding(
                path,
                f"the spin axis has {unstable[kind]} ({values} kg m^2): free spin about it is "
                "unstable; spin about the axis of the smallest or largest moment, or hold it by a "
                "wheel",
            )
            return
        with suppress(ValueError):
            self.inertia = Inertia(*self.principal, wheel)

    def has(self, *path: str | int) -> bool:
        """True where something is at ``path``."""
        return self.root.get(*path) is not None

    def value(self, *path: str | int) -> object:
        """The text, number, dict or list of nodes at ``path`` as it is written; None where there is
        none.
        """
        node = self.root.get(*path)
        return None if node is None else node.value

    def text(self, *path: str | int) -> str | None:
        """The text at ``path``."""
        value = self.value(*path)
        return value if isinstance(value, str) else None

    def number(self, *path: str | int) -> float | None:
        """The quantity at ``path``, SI; None where there is none, or no sound one."""
        value = self.by_path.get(path)
        return value if isinstance(value, float) else None

    def vector(self, *path: str | int) -> Vector | None:
        """The quantities in the list at ``path``; None unless all can be read."""
        entries = self.by_path.get(path)
        if not isinstance(entries, list) or None in entries:
            return None
        return np.array(entries, dtype=np.float64)

    def below(self, *path: str | int) -> list[KeyPath]:
        """Paths of the entries at ``path``."""
        node = self.root.get(*path)
        return [] if node is None else [(*path, step) for step, _ in node.children()]

    def matching(self, pattern: str) -> list[KeyPath]:
        """Paths of a pattern such as ``thrusters.*.force``, whose last step need not be there.

        ``loop.sensor.kind=gyro`` is the path only where it has that value.
        """
        keys, _, value = pattern.partition("=")
        paths: list[KeyPath] = [()]
        for step in keys.split("."):
            key = int(step) if step.isdigit() else step
            deeper = [self.below(*path) if step == "*" else [(*path, key)] for path in paths]
            paths = [path for group in deeper for path in group]
        return [path for path in paths if not value or self.text(*path) == value]

    @cached_property
    def names(self) -> dict[str, dict[str, KeyPath]]:
        """Paths of the thrusters and of the channels by their names."""
        entries = ((self.text(*path, "name"), path) for path in self.below("thrusters"))
        thrusters = {name: path for name, path in entries if name is not None}
        channels = {str(path[-1]): path for path in self.below("channels")}
        return {"thruster": thrusters, "channel": channels or thrusters}

    @cached_property
    def thrusts(self) -> dict[str, float | None]:
        """Thrust in N of each thruster and of the torquer; None where it is not known."""
        forces: dict[str, float | None] = {}
        for name, path in self.names["thruster"].items():
            torque = self.vector(*path, "torque")
            size = None if torque is None else math.hypot(*torque)
            lever = self.number(*path, "lever_arm")
            forces[name] = self.number(*path, "force") or thrust_behind(size, lever)
        if self.has("steerable") or not self.below("thrusters"):
            size = self.number("steerable", "torque")
            forces[STEERABLE] = thrust_behind(size, self.number("steerable", "lever_arm"))
        return forces


def force_vector(direction: Iterable[float], force: float) -> Vector:
    """Force in N along ``direction``, which need not have length one."""
    components = tuple(direction)
    return np.array([part / math.hypot(*components) * force for part in components])


def symmetric(tensor: Vector) -> Vector:
    """A tensor without the asymmetry that passes for rounding."""
    return 0.5 * (tensor + tensor.T)


def tensor_fault(tensor: Vector) -> Finding | None:
    """The fault that makes a 3×3 tensor impossible as an inertia tensor."""
    path: KeyPath = ("inertia", "tensor")
    skew = np.abs(tensor - tensor.T)
    if skew.max() > SYMMETRIC * np.abs(tensor).max():
        column, row = map(int, np.unravel_index(np.argmax(skew), skew.shape))
        problem = (
            f"not symmetric: {tensor[row, column]:g} here, but {tensor[column, row]:g} at "
            f"[{column}][{row}]; both must be equal"
        )
        return Finding((*path, row, column), problem)
    fault = moments_fault(np.asarray(np.linalg.eigvalsh(symmetric(tensor))))
    return None if fault is None else Finding(path, fault)


def moments_fault(moments: Vector) -> str | None:
    """The reason why no body has these principal moments (3,) kg m²."""
    values = f"principal moments {', '.join(f'{moment:g}' for moment in moments)} kg m^2"
    smallest, middle, largest = np.sort(moments).tolist()
    # 1e-14 of the largest is the rounding of eigenvalues.
    limit = max(SMALLEST, 1e-14 * largest)
    if smallest <= limit:
        wrong = " or ".join(f"{moment:g}" for moment in moments if moment <= limit)
        return f"{values}; all three must be above 0, not {wrong}"
    if largest > (smallest + middle) * (1.0 + SYMMETRIC):
        return (
            f"{values}: the largest must not exceed the sum of the other two (triangle inequality)"
        )
    return None


_TABLE = """
omega0 | missing | .state | give omega0: [ω1, ω2, ω3], or state: {spin: …, nutation: …}
state | beside | .omega0 | keep one of the two
inertia.A | missing | .tensor | the transverse moment of inertia, in kg m^2
inertia.C | missing | .tensor | the axial moment of inertia, in kg m^2
inertia.tensor | beside | .A .C | keep either tensor, or A and C
attitude.quaternion | missing | .spin_axis | turn from body to frame, scalar first, or spin_axis:
    [right ascension, declination]
attitude.quaternion | not zero | | expected a rotation, such as [1, 0, 0, 0]
attitude.spin_axis | beside | .quaternion | keep one of the two
attitude.of | beside | .quaternion | keep one of the two
attitude.phase | beside | .quaternion | keep one of the two
attitude.sun_phase | beside | .quaternion .phase | keep one of the two
attitude.sun_phase | needs | sun | : [right ascension, declination], or sun: epoch
attitude.frame=ECLIPDATE | needs | .epoch | , the date of its equinox; or take ECLIPJ2000 or
    EME2000
attitude.frame=MOD | needs | .epoch | , the date of its equinox; or take ECLIPJ2000 or EME2000
sun | needs | attitude | , which says where the body points at t = 0
sun=epoch | needs | attitude.epoch | , the date of t = 0; or give [right ascension, declination]
sun_sensor | needs | sun | : [right ascension, declination], or sun: epoch
commands | needs | sun_sensor | , whose pulse fires the blocks
commands.width.min | at most | .max | time
orbit | needs | attitude.epoch attitude.frame | , which give time and axes of the position
orbit.position | not zero | | expected the position of the spacecraft relative to center
keep | once | name | take another
keep.*.direction | needs | attitude | , which says where the body points at t = 0
keep.*.direction=sun | needs | sun | : [right ascension, declination], or sun: epoch
keep.*.min | missing | .max | give min, max or both; without them the cone has no effect
keep.*.min | at most | .max | angle
goal.tilt | beside | .right_ascension .declination | keep tilt and azimuth, or the other pair
goal.tilt | completes | .azimuth | names no direction
goal.declination | completes | .right_ascension | names no direction
goal.right_ascension | completes | .declination | names no direction
goal.right_ascension | needs | attitude | , which says where the body points at t = 0; without it
    give tilt and azimuth
goal.sun_angle | beside | .tilt .azimuth .right_ascension .declination | keep one target
goal.sun_angle | needs | sun | : [right ascension, declination], or sun: epoch
goal.spin | not zero | | expected a rate about axis 3
requirement.probability | needs | .nutation/.momentum_shift/.pointing/.spin | : this is a share of
    it
requirement.pointing | beside | .momentum_shift | pointing counts from the target, momentum_shift
    from t = 0; keep one of the two
limits.earliest | below | .horizon | time
limits.blackout.*.0 | at most | .1 | time
disturbances | once | name | take another
disturbances.*.torque | not zero | | expected at least one component other than 0
disturbances.*.rate | not zero | | leave rate out for a torque fixed in the body
disturbances.*.rate | beside | .kind=constant .kind=axial | only a rotating torque turns
disturbances.*.fixed_in | beside | .kind=constant .kind=axial .rate | keep one of the two
disturbances.*.from | below | .until | time
disturbances.*.kind=rotating | needs | .rate/.fixed_in | , the rate seen in the body
thrusters | once | name | take another
thrusters.*.name=steerable | wrong | | the name 'steerable' is reserved for the steerable torquer;
    use another
thrusters.*.torque | missing | .position .direction .force | give torque, or position, direction
    and force
thrusters.*.torque | beside | .position .direction .force | keep torque, or position, direction
    and force
thrusters.*.torque | not zero | | expected at least one component other than 0
thrusters.*.position | completes | .direction .force | cannot give a torque
thrusters.*.direction | completes | .position .force | cannot give a torque
thrusters.*.force | completes | .position .direction | cannot give a torque
thrusters.*.direction | not zero | | expected a direction, such as [1, 0, 0]
thrusters.*.lever_arm | beside | .position | leave it out: position gives the arm
thrusters.*.min_on_time | at most | .max_on_time | time
thrusters.*.impulse_bit | beside | .valve | keep one of the two
thrusters.*.impulse_bit | needs | .force/.lever_arm | , which tells the thrust
thrusters.*.impulse_bit | rising | time impulse time | expected rows that rise
channels.steerable | wrong | | the name 'steerable' is reserved for the steerable torquer; use
    another
channels.* | once | | expected once in a channel
channels.*.* | named | thruster |
valve | needs | thrusters | , which it belongs to
cold | needs | thrusters | , whose nozzles are meant
tank | needs | thrusters | , which it feeds
tank.final_pressure | at most | .pressure | pressure
tank.propellant | below | mass | mass
tank.isp | rising | pressure | expected rows that rise
thrusters.*.isp | fed | tank.isp | the tank needs it for the propellant used
thrusters.*.lever_arm | fed | .force | the tank needs it for the propellant used
loop | needs | thrusters | , which it fires
loop.stop | below | .start | angle
loop.law=bang | needs | .on_time | , the length of its pulses
loop.on_time | beside | .law=one-pulse | one-pulse fires as long as needed
loop.sensor.kind=accelerometer | needs | .rate | : a sine is fitted to its samples
loop.sensor.kind=accelerometer | needs | .position | , from the centre of mass
loop.sensor.position | beside | .kind=gyro | a gyro measures the same everywhere
loop.sensor.axis | beside | .kind=gyro | a gyro measures the same everywhere
loop.sensor.axes | beside | .kind=accelerometer | it measures along axis
loop.sensor.noise | needs | .rate | , such as rate: 100 Hz: it applies to samples
loop.sensor.quantisation | needs | .rate | , such as rate: 100 Hz: it applies to samples
loop.sensor.low_pass | needs | .rate | , such as rate: 100 Hz: it applies to samples
loop.sensor.axis | not zero | | expected a direction, such as [0, 0, 1]
loop.sensor.scale | not zero | | the sensor would show nothing; expected about 100 %
loop.faults.reversed | once | | expected each channel once
loop.faults.reversed.* | named | channel |
dispersions.inertia_tensor | beside | .A .C | keep the tensor, or A and C
dispersions.inertia_tensor | beside | wheel | the wheel is along principal axis 3, which would
    move; give A and C instead
dispersions.sensor_bias | needs | loop | , whose sensor it is of
dispersions.sensor_scale | needs | loop | , whose sensor it is of
dispersions.sensor_noise | needs | loop | , whose sensor it is of
dispersions.sensor_delay | needs | loop | , whose sensor it is of
"""
RULES = [
    [cell.strip() for cell in row.split("|")]
    for row in _TABLE.replace("\n    ", " ").strip().split("\n")
]
"""Path | kind of rule | other keys | the cure, or the kind of a quantity.

Other keys beside that of the path begin with a dot; / is or; =value is the key only with that
value. Rules of rising rows have the kinds of quantity of their columns there.
"""


def _broken(facts: Facts, path: KeyPath, kind: str, names: str, cure: str) -> Iterator[Finding]:
    """Findings by one row of `RULES` at one of its paths."""

    def place(other: str) -> KeyPath:
        if not other.startswith("."):
            return tuple(other.split("."))
        return (*path[:-1], int(other[1:]) if other[1:].isdigit() else other[1:])

    def holds(other: str) -> bool:
        key, _, value = other.partition("=")
        return facts.text(*place(key)) == value if value else facts.has(*place(key))

    def words(others: list[str]) -> str:
        alone = " and ".join(other.removeprefix(".") for other in others)
        return alone.replace("/.", " or ").replace("=", ": ")

    others = names.split()
    exists = facts.has(*path)
    present = [other for other in others if holds(other)]
    number, text = facts.number(*path), facts.text(*path)
    match kind:
        case "beside" if exists and present:
            yield Finding(path, f"given together with {words(present)}; {cure}", True)
        case "needs" if exists:
            lacking = [other for other in others if not any(map(holds, other.split("/")))]
            if lacking:
                yield Finding(path, f"needs {words(lacking)}{cure}", True)
        case "missing" if not exists and not present:
            # a key that must be there unless one of the others is
            if isinstance(facts.value(*path[:-1]), dict):
                yield Finding(path, f"missing; {cure}")
        case "completes" if present and not exists:
            yield Finding(path, f"missing; {words(present)} alone {cure}")
        case "fed" if not exists and not present and facts.has("tank"):
            yield Finding(path, f"missing; {cure}")
        case "wrong" if exists:
            yield Finding(path, cure, text is None)
        case "at most" | "below" if number is not None:
            limit = facts.number(*place(names))
            equal = number == limit and kind == "at most"
            if limit is not None and number >= limit and not equal:
                fault = "exceeds" if kind == "at most" else "is not below"
                expected = "at most" if kind == "at most" else "less than"
                yield Finding(
                    path,
                    f"{amount(cure, number)} {fault} {dotted(place(names))}; expected {expected} "
                    f"{amount(cure, limit)}",
                )
        case "not zero":
            numbers = facts.vector(*path) if number is None else number
            if numbers is not None and np.max(np.abs(numbers), initial=0.0) < SMALLEST:
                yield Finding(path, f"zero; {cure}")
        case "rising":
            for column, quantity in enumerate(others):
                values = [facts.number(*row, column) for row in facts.below(*path)]
                for row, (before, value) in enumerate(pairwise(values), start=1):
                    if before is not None and value is not None and value <= before:
                        cured = (
                            f"{amount(quantity, value)} is not above that of the row before, "
                            f"{amount(quantity, before)}; {cure}"
                        )
                        yield Finding((*path, row, column), cured)
        case "once":  # a list of which no two entries have the same text, or the same at a key
            first: dict[str, KeyPath] = {}
            for entry in facts.below(*path):
                name = facts.text(*entry, *others)
                if name in first:
                    yield Finding(
                        (*entry, *others),
                        f"{shown(name)} is given twice, first in {dotted(first[name])}; {cure}",
                    )
                elif name is not None:
                    first[name] = entry
        case "named" if text is not None and text not in facts.names[names]:
            cure = cure_of(text, facts.names[names])
            yield Finding(path, f"no {names} is called {shown(text)}; {cure}")


def amount(kind: str, value: float) -> str:
    """A quantity as people read it, angles in deg."""
    if kind == "angle":
        return f"{math.degrees(value):g} deg"
    return bar(value) if kind == "pressure" else f"{value:g} {KINDS[kind].si}"


TARGETS = ("tilt", "right_ascension", "sun_angle")  # keys of goal that name a target


def findings(facts: Facts, *, aimed: bool) -> Iterator[Finding]:
    """All faults of the table, and those of body, motion, thrusters and studies; ``aimed``: a
    target is given beside the file.
    """
    target = aimed or any(facts.has("goal", key) for key in TARGETS)
    if facts.has("requirement", "pointing") and not target:
        cure = "give goal or --target, or momentum_shift for the turn from t = 0"
        yield Finding(("requirement", "pointing"), f"needs a target to count from; {cure}", True)
    for pattern, kind, others, cure in RULES:
        for path in facts.matching(pattern):
            yield from _broken(facts, path, kind, others, cure)
    for rule in (_motion, _torques, _channels, _tank, _dispersions, _loop):
        yield from rule(facts)


def _motion(facts: Facts) -> Iterator[Finding]:
    """A spin that cannot be reached, and a wheel that turns with it."""
    spin, inertia = facts.spin, facts.inertia
    final = facts.number("goal", "spin")
    if final is not None and spin is not None and final * spin < 0.0:
        yield Finding(
            ("goal", "spin"), "its sign differs from the spin at t = 0; the spin cannot be reversed"
        )
    if spin is None or inertia is None or not inertia.wheel:
        return
    axial = inertia.axial(spin)
    path: KeyPath = ("wheel", "momentum")
    if abs(axial) <= CANCELLED * abs(inertia.wheel):
        yield Finding(
            path,
            f"cancels the C ω3 of the body, {inertia.C * spin:.4g} N m s: without momentum there "
            "is no nutation",
        )
    elif axial * spin < 0.0 and facts.has("sun_sensor"):
        yield Finding(
            path,
            "points the angular momentum against the spin: blocks fired from the Sun pulse are "
            "not planned then; leave out sun_sensor",
        )
    if facts.has("dissipation") and not facts.has("dissipation", "nutation"):
        yield Finding(
            ("dissipation", "nutation"),
            "missing; with a wheel it depends on where energy is lost: give grows or decays",
        )


def _torques(facts: Facts) -> Iterator[Finding]:
    """A single torque across the spin axis, and thrusters that give none."""
    for path in facts.matching("disturbances.*.torque"):
        across = facts.value(*path[:-1], "kind") in (None, "constant", "rotating")
        if across and not isinstance(facts.value(*path), list) and path in facts.by_path:
            yield Finding(
                path,
                "expected three components, [M1, M2, M3], got a single torque; or kind: axial, "
                "along the third axis of the file",
            )
    center = facts.vector("center_of_mass")
    for path in facts.below("thrusters"):
        position, direction = facts.vector(*path, "position"), facts.vector(*path, "direction")
        force = facts.number(*path, "force")
        if facts.has(*path, "torque") or position is None or direction is None or force is None:
            continue
        if math.hypot(*direction) < SMALLEST:
            continue
        arm = position if center is None else position - center
        torque = np.cross(arm, force_vector(direction, force))
        if math.hypot(*torque) <= CANCELLED * math.hypot(*position) * force:
            yield Finding(
                (*path, "position"),
                "no torque: the force passes through the centre of mass; move or turn the thruster",
            )


def _channels(facts: Facts) -> Iterator[Finding]:
    """A channel has one valve: thrusters with another one would not fire as planned."""
    thrusters = facts.names["thruster"]
    for path in facts.below("channels"):
        members = [thrusters.get(facts.text(*entry) or "") for entry in facts.below(*path)]
        valves = [
            [facts.by_path.get((*member, key)) for key in ("valve", "impulse_bit")]
            for member in members
            if member is not None
        ]
        if any(valve != valves[0] for valve in valves):
            yield Finding(
                path,
                "its thrusters do not have the same valve or impulse_bit; write them alike, or "
                "use channels of their own",
            )


def _tank(facts: Facts) -> Iterator[Finding]:
    """Once all propellant is used, the moments must be those of a body."""
    path = ("tank", "inertia_per_kg")
    propellant = facts.number("tank", "propellant")
    rows = facts.vector(*path)
    transverse, axial = facts.number(*path, "A"), facts.number(*path, "C")
    if transverse is not None and axial is not None:
        rows = np.array([transverse, transverse, axial])
    if propellant is None or facts.principal is None or rows is None:
        return
    fault = moments_fault(np.asarray(facts.principal[0]) - propellant * rows)
    if fault is not None:
        yield Finding(path, f"after {propellant:g} kg are used it leaves {fault}")


def _dispersions(facts: Facts) -> Iterator[Finding]:
    """Faults of tolerances by thruster, and of thrusts in N, which become a share of the thrust."""
    for key in BY_THRUSTER:
        path: KeyPath = ("dispersions", key)
        node = facts.root.get(*path)
        places = dict.fromkeys(facts.thrusts, path)
        if node is not None and by_name(node):
            places = {str(entry[-1]): entry for entry in facts.below(*path)}
        for name, place in places.items():
            if name not in facts.thrusts:
                yield Finding(
                    place,
                    f"no thruster is called {shown(name)}; {cure_of(name, facts.thrusts)}",
                    True,
                )
            elif key == "thrust" and facts.thrusts[name] is None:
                for size in facts.below(*place):
                    tolerance = facts.by_path.get(size)
                    if isinstance(tolerance, Tolerance) and not tolerance.relative:
                        yield Finding(
                            size,
                            f"needs the thrust of {shown(name)}, which is not known; give its "
                            "lever_arm, or a tolerance in %",
                        )


OTHER_SENSOR = {
    "gyro": ("acceleration", "a gyro: rad/s, deg/s or rpm"),
    "accelerometer": ("rate", "an accelerometer: m/s^2"),
}
"""Kind of quantity that a sensor does not measure, and the units that it has."""


SAMPLES = 4.0  # samples a nutation period without which the phase of the nutation is hardly seen


def _loop(facts: Facts) -> Iterator[Finding]:
    """Faults of the loop: an on-time that a channel does not allow, a sensor that shows nothing."""
    sensor: KeyPath = ("loop", "sensor")
    sensor_kind = facts.text(*sensor, "kind")
    sensed = [(*sensor, key) for key in ("noise", "bias", "quantisation")]
    for path in (*sensed, *facts.matching("dispersions.sensor_bias.*")):
        text = facts.text(*path)
        if text is not None and sensor_kind in OTHER_SENSOR:
            quantity, units = OTHER_SENSOR[sensor_kind]
            with suppress(ValueError):
                parse(text, quantity)
                yield Finding(path, f"{shown(text)} does not have a unit of {units}")
    on_time = facts.number("loop", "on_time")
    thrusters = facts.names["thruster"]
    for name, path in facts.names["channel"].items() if on_time is not None else ():
        entries = [facts.text(*entry) for entry in facts.below(*path)] or [name]
        members = [thrusters[entry] for entry in entries if entry in thrusters]
        shortest = [facts.number(*member, "min_on_time") or 0.0 for member in members]
        longest = [facts.number(*member, "max_on_time") for member in members]
        low = max(shortest, default=0.0)
        high = min((time for time in longest if time is not None), default=math.inf)
        if on_time is not None and not low <= on_time <= high:
            yield Finding(
                ("loop", "on_time"),
                f"{on_time:g} s is outside what {name} allows: {span(low, high, 's')}",
            )
    inertia, spin = facts.inertia, facts.spin
    if inertia is None or spin is None:
        return
    rate = facts.number(*sensor, "rate")
    lowest = SAMPLES * abs(inertia.nutation_rate(spin)) / (2.0 * math.pi)
    if rate is not None and 0.0 < rate < lowest and facts.value("loop", "alias") is not True:
        yield Finding(
            (*sensor, "rate"),
            f"{rate:g} Hz is below four times the nutation frequency; expected at least "
            f"{lowest:.4g} Hz, or alias: true beside start",
        )
    if sensor_kind != "accelerometer":
        return
    if inertia.wheel != 0.0:
        yield Finding(
            (*sensor, "kind"), "accelerometer: with a wheel only gyros are modelled; expected gyro"
        )
        return
    position = facts.vector(*sensor, "position")
    axis = facts.vector(*sensor, "axis")
    if not facts.has(*sensor, "axis"):
        axis = np.array([0.0, 0.0, 1.0])
    if position is None or axis is None or not axis.any():
        return
    from nutdamp.control_loop.sensor import is_blind

    turn = inertia.axes.T
    if is_blind(inertia.moments, turn @ position, turn @ axis / math.hypot(*axis)):
        yield Finding(
            (*sensor, "position"),
            "blind: here it shows nothing of the nutation; move it off axis 3, or turn its axis",
        )


def correlation_findings(spacecraft: Spacecraft) -> Iterator[Finding]:
    """Faults of correlated inputs, whose names are known once the spacecraft is."""
    pairs = () if spacecraft.dispersions is None else spacecraft.dispersions.correlation
    if not pairs:
        return
    path = ("dispersions", "correlation")
    from nutdamp.montecarlo.inputs import grouped, positive_definite, reachable  # here: few files

    inputs = reachable(spacecraft)
    names = [*(entry.name for entry in inputs.drawn), *(entry.name for entry in inputs.unused)]
    correlated = [name for name in names if not name.endswith("of each pulse")]
    fixed = {entry.name for entry in inputs.drawn if entry.kind == "bias"}
    before: set[frozenset[str]] = set()
    faults: list[Finding] = []
    for row, (first, second, _) in enumerate(pairs):
        for place, name in enumerate((first, second)):
            if name not in correlated:
                faults.append(
                    Finding(
                        (*path, row, place),
                        f"the dispersions have no input called {shown(name)}; "
                        f"{cure_of(name, correlated)}",
                    )
                )
            elif name in fixed:
                faults.append(
                    Finding(
                        (*path, row, place),
                        f"{shown(name)} is a fixed offset (bias) and does not vary",
                    )
                )
        if first == second:
            faults.append(
                Finding((*path, row, 1), f"{shown(first)} again; expected two different inputs")
            )
        elif frozenset((first, second)) in before:
            faults.append(
                Finding((*path, row), f"{first} and {second} are given before; keep one of the two")
            )
        before.add(frozenset((first, second)))
    yield from faults
    for group in () if faults else grouped(pairs):
        if not positive_definite(group):
            yield Finding(
                path,
                f"not positive definite for {', '.join(group.names)}: these correlations "
                "contradict each other; pairs that are not given count as 0",
            )


# --- numbers that probably lack a unit

FAR = 50.0  # m; few spacecraft reach further from their centre of mass, and drawings count in mm
FAST_AND_WHOLE = 12.0  # rad/s; above (115 rpm) a whole number is more likely one of rpm
LOOSE = 0.1  # rad; few requirements are looser than this 5.7 deg, and many a file counts in deg
TURN = 2.0 * math.pi


def _fast(value: float, _: Facts) -> bool:
    return abs(value) > (FASTEST if value % 1 else FAST_AND_WHOLE)


# Paths, kind of quantity, the unit that a number there probably lacks, and the test that says so.
BANDS: tuple[tuple[str, str, str, Callable[[float, Facts], bool]], ...] = (
    (
        "state.phase goal.azimuth goal.right_ascension",
        "angle",
        "deg",
        lambda value, _: abs(value) > TURN,
    ),
    (
        "requirement.momentum_shift requirement.pointing requirement.nutation state.nutation",
        "angle",
        "deg",
        lambda value, _: LOOSE < value < 0.5 * math.pi,
    ),
    ("state.spin goal.spin", "rate", "rpm", _fast),
    ("omega0.*", "rate", "deg/s", _fast),
    (
        "thrusters.*.position.* thrusters.*.lever_arm steerable.lever_arm",
        "length",
        "mm",
        lambda value, _: abs(value) > FAR,
    ),
    (  # within a turn a torque cancels itself
        "thrusters.*.min_on_time",
        "time",
        "ms",
        lambda value, facts: facts.spin is not None and value * abs(facts.spin) > TURN,
    ),
    (  # s; few valves take so long, and many a data sheet counts in ms
        " ".join(f"valve.{key} thrusters.*.valve.{key}" for key in VALVE_TIMES)
        + " thrusters.*.impulse_bit.*.0 thrusters.*.impulse_bit.*.2",
        "time",
        "ms",
        lambda value, _: value > 1.0,
    ),
    (  # s; no chemical thruster has as much, and data sheets also give the speed in m/s
        "thrusters.*.isp steerable.isp tank.isp.*.1",
        "time",
        "m/s",
        lambda value, _: value > 500.0,
    ),
    (  # Pa; no tank feeds thrusters with less, and most data sheets count in bar
        "tank.pressure tank.final_pressure tank.isp.*.0",
        "pressure",
        "bar",
        lambda value, _: 0.0 < value < 1e3,
    ),
)


def doubts(facts: Facts) -> Iterator[Finding]:
    """Numbers beyond any plausible value in SI."""
    for paths, kind, meant, lacks in BANDS:
        for path in (path for pattern in paths.split() for path in facts.matching(pattern)):
            value = facts.value(*path)  # a text has a unit
            if isinstance(value, bool) or not isinstance(value, int | float):
                continue
            if math.isfinite(value) and lacks(value, facts):
                yield Finding(path, reading(value, kind, meant))
