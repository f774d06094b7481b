"""Constraints between the keys of a spacecraft file: body, motion, goal, disturbances, limits and directions in space.

The rules read the raw tree (`Facts`) and skip unreadable values, so that they work beside any other fault.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.time import Epoch
from nutdamp.files.fields import SMALLEST, KeyPath
from nutdamp.files.yaml import Node, dotted
from nutdamp.physics import attitude, sky
from nutdamp.physics import body as rigid_body
from nutdamp.spacecraft.model import Inertia
from nutdamp.spacecraft.schedule import STEERABLE
from nutdamp.units import parse, shown

Vector = NDArray[np.float64]


MOMENT = re.compile(r"[IJ]_?([xyz]{1,2}|[123]{1,2})", re.IGNORECASE)  # keys for parts of a tensor


class Finding(NamedTuple):
    """Something wrong at ``path``, which need not exist; ``at_key`` points at the key and not at its value."""

    path: KeyPath
    problem: str
    at_key: bool = False


class Facts:
    """The values of a tree that can be read."""

    def __init__(self, root: Node) -> None:
        self.root = root

    def has(self, *path: str | int) -> bool:
        """True where something is at ``path``."""
        return self.root.get(*path) is not None

    def value(self, *path: str | int) -> object:
        """The text, number, dict or list of nodes at ``path``; None where there is none."""
        node = self.root.get(*path)
        return None if node is None else node.value

    def is_mapping(self, *path: str | int) -> bool:
        """True where keys may be at ``path``."""
        return isinstance(self.value(*path), dict)

    def text(self, *path: str | int) -> str | None:
        """The text at ``path``."""
        value = self.value(*path)
        return value if isinstance(value, str) else None

    def number(self, kind: str, *path: str | int) -> float | None:
        """The quantity at ``path``, SI."""
        node = self.root.get(*path)
        try:
            return None if node is None else parse(node.plain(), kind)
        except ValueError:
            return None

    def vector(self, kind: str, size: int, *path: str | int) -> Vector | None:
        """The ``size`` quantities at ``path``, SI; None unless all can be read."""
        if len(self.children(*path)) != size:
            return None
        numbers = [self.number(kind, *path, index) for index in range(size)]
        return None if None in numbers else np.array(numbers, dtype=np.float64)

    def children(self, *path: str | int) -> list[tuple[str | int, Node]]:
        """Keys or positions at ``path``, and their nodes."""
        node = self.root.get(*path)
        return [] if node is None else list(node.children())

    def below(self, *path: str | int) -> list[KeyPath]:
        """Paths of the entries at ``path``."""
        return [(*path, step) for step, _ in self.children(*path)]


ALONG = 1e-3  # rad from the spin axis, up to which the Sun counts as along it


def _command_blocks(facts: Facts) -> Iterator[Finding]:
    if facts.has("commands") and not facts.has("sun_sensor"):
        yield Finding(("commands",), "needs the key sun_sensor, whose pulse fires the blocks", True)
    if facts.has("sun_sensor") and not facts.has("sun"):
        yield Finding(("sun_sensor",), "needs the key sun: [right ascension, declination], or sun: epoch", True)
    least, most = (facts.number("time", "commands", "width", key) for key in ("min", "max"))
    spin = spin_of(facts)
    if spin:
        turn = 2.0 * math.pi / abs(spin)
        if most is not None and most >= turn:
            problem = f"{most:g} s is not less than a spin turn of {turn:.4g} s, in which the next Sun pulse comes"
            yield Finding(("commands", "width", "max"), problem)
        yield from _sun_in_view(facts, math.copysign(1.0, spin) * spin_axis(facts))
    if least is not None and most is not None and least > most:
        yield Finding(("commands", "width", "min"), f"{least:g} s exceeds max; expected at most {most:g} s")


def _sun_in_view(facts: Facts, axis: Vector) -> Iterator[Finding]:
    """A Sun that gives no pulse: along the spin ``axis`` (3,) in the body at t = 0, or out of the sensor's view."""
    angle = _sun_angle(facts, axis) if facts.has("sun_sensor") else None
    if angle is None:
        return
    if min(angle, math.pi - angle) < ALONG:
        yield Finding(("sun",), "lies along the spin axis at t = 0, so that no Sun pulse comes to fire blocks")
        return
    middle = facts.number("angle", "sun_sensor", "elevation") or 0.0
    half_width = facts.number("angle", "sun_sensor", "half_width")
    if half_width is not None and abs(0.5 * math.pi - angle - middle) > half_width:
        low, high = (math.degrees(0.5 * math.pi - middle + side * half_width) for side in (-1.0, 1.0))
        problem = (
            f"never sees the Sun, which is {math.degrees(angle):.4g} deg from the spin axis at t = 0; "
            f"it sees from {max(low, 0.0):.4g} to {min(high, 180.0):.4g} deg"
        )
        yield Finding(("sun_sensor",), problem, True)


def _sun_angle(facts: Facts, axis: Vector) -> float | None:
    """Angle of the Sun from the spin ``axis`` (3,) in the body at t = 0, rad; None where it cannot be read."""
    direction, turned = _to_sun(facts), facts.vector("number", 4, "attitude", "quaternion")
    if direction is None:
        return None
    if turned is not None and np.any(turned):
        seen = attitude.rotate(attitude.conjugate(turned / np.linalg.norm(turned)), direction)
        return float(attitude.angle_between(seen, axis))
    given = facts.vector("angle", 2, "attitude", "spin_axis")
    if given is None or facts.text("attitude", "of") == "momentum":
        return None
    return float(attitude.angle_between(attitude.on_sphere(*given.tolist()), direction))


def _orbit(facts: Facts) -> Iterator[Finding]:
    missing = " and ".join(f"attitude.{key}" for key in ("epoch", "frame") if not facts.has("attitude", key))
    if missing and facts.has("orbit"):
        yield Finding(("orbit",), f"needs {missing}: the moment of the position and the axes that it is in", True)
    position = facts.vector("length", 3, "orbit", "position")
    if position is not None and not position.any():
        yield Finding(("orbit", "position"), "is zero; expected the position of the spacecraft relative to center")
    center = facts.text("orbit", "center")
    if center is not None and not (center.strip() and center.isascii() and center.isprintable()):
        yield Finding(("orbit", "center"), f"{shown(center)} is no name of a body; expected one such as EARTH")


def _to_sun(facts: Facts) -> Vector | None:
    """The direction (3,) to the Sun, given or of the epoch; None where it cannot be read."""
    given = facts.vector("angle", 2, "sun")
    if given is not None:
        return attitude.on_sphere(*given.tolist())
    epoch = facts.text("attitude", "epoch")
    if facts.text("sun") != "epoch" or epoch is None:
        return None
    try:
        return sky.direction(Epoch.parse(epoch).days_of_j2000)
    except ValueError:
        return None


def _sun(facts: Facts) -> Iterator[Finding]:
    yield from _direction(facts, ("sun",))
    if facts.text("sun") == "epoch" and facts.has("attitude") and _to_sun(facts) is None:
        epoch, cure = facts.text("attitude", "epoch"), "give [right ascension, declination]"
        problem = f"the Sun is computed for epochs from 1972 on, not for {epoch}; {cure}"
        yield Finding(("sun",), problem if epoch else f"epoch needs attitude.epoch, the date of t = 0; or {cure}")


def _cones(facts: Facts) -> Iterator[Finding]:
    for path in facts.below("keep"):
        yield from _direction(facts, (*path, "direction"))
        if facts.text(*path, "direction") == "sun" and not facts.has("sun"):
            yield Finding((*path, "direction"), "needs the key sun: [right ascension, declination], or sun: epoch")
        least, most = (facts.number("angle", *path, key) for key in ("min", "max"))
        if not facts.has(*path, "min") and not facts.has(*path, "max"):
            yield Finding((*path, "min"), "missing; give min, max or both, else the cone has no effect")
        if least is not None and most is not None and most < least <= math.pi:  # more than that is out of range
            problem = f"{math.degrees(least):g} deg exceeds max; expected at most {math.degrees(most):g} deg"
            yield Finding((*path, "min"), problem)


def _direction(facts: Facts, path: KeyPath) -> Iterator[Finding]:
    if not facts.has("attitude") and facts.has(*path):  # at the key, since its value is judged too
        yield Finding(path, "needs attitude, which says where the body points at t = 0", True)
    declination = facts.number("angle", *path, 1)
    if declination is not None and abs(declination) > 0.5 * math.pi * (1.0 + 1e-12):
        angle = f"{math.degrees(declination):g} deg"
        yield Finding((*path, 1), f"{angle} is no declination; expected an angle from -90 deg to 90 deg")


CANCELLED = 1e-12  # a sum that is smaller than its terms by this factor is rounding; it counts as zero


def norm(vector: Vector) -> float:
    """Length of a vector, without the underflow of squares."""
    return math.hypot(*vector)


def force_vector(direction: Iterable[float], force: float) -> Vector:
    """Force in N along ``direction``, which need not have length one."""
    components = tuple(direction)
    return np.array([part / math.hypot(*components) * force for part in components])


SYMMETRIC = 1e-9  # asymmetry of an inertia tensor that passes for rounding, relative to its largest entry


def findings(root: Node) -> Iterator[Finding]:
    """All faults between the keys of a file."""
    facts = Facts(root)
    of_body = (_names, _inertia, _motion, _attitude, _disturbances, _dissipation, _limits, _goal)
    for rule in (*of_body, _orbit, _sun, _command_blocks, _cones):
        yield from rule(facts)


def symmetric(tensor: Vector) -> Vector:
    """A tensor without the asymmetry that passes for rounding."""
    return 0.5 * (tensor + tensor.T)


def _names(facts: Facts) -> Iterator[Finding]:
    lists = ("thrusters", "disturbances", "keep")
    entries: list[KeyPath] = [(*path, "name") for key in lists for path in facts.below(key)]
    named = [(path, facts.text(*path), False) for path in (("name",), *entries)]
    named += [(path, str(path[-1]), True) for path in facts.below("channels")]
    for path, name, at_key in named:
        if name is None:
            continue
        if not name.strip() or not name.isprintable():
            yield Finding(path, f"{shown(name)} is no name; expected printable characters", at_key)
        elif name[0] in "=@":
            yield Finding(path, f"{shown(name)} would be a formula in a spreadsheet; take another", at_key)
        elif name == STEERABLE and path[0] in ("thrusters", "channels"):
            yield Finding(path, f"the name {STEERABLE!r} is kept for the steerable torquer; take another", at_key)
    first: dict[tuple[str | int, str], KeyPath] = {}
    for path in entries:
        name = facts.text(*path)
        if name is not None and (other := first.setdefault((path[0], name), path)) != path:
            place = facts.root.place_of(other)
            where = place.setting or f"line {place.line}"
            yield Finding(path, f"duplicate name; {dotted(other[:2])} has it already ({where}); take another")


def _inertia(facts: Facts) -> Iterator[Finding]:
    node = facts.root.get("inertia")
    keys = [key for key in ("A", "C", "tensor") if facts.has("inertia", key)]
    if "tensor" in keys:
        if len(keys) > 1:
            yield Finding(("inertia", "tensor"), "given together with A or C; keep either tensor, or A and C", True)
        tensor = tensor_of(facts)
        fault = None if tensor is None else tensor_fault(tensor) or _spin_axis_fault(tensor, facts)
        if fault is not None:
            yield fault
    elif node is not None and isinstance(node.value, dict) and not any(map(MOMENT.fullmatch, node.keys)):
        for key, what in (("A", "transverse"), ("C", "axial")):
            if key not in keys:
                yield Finding(("inertia", key), f"missing; the {what} moment of inertia, in kg m^2")
    A, C = facts.number("inertia", "inertia", "A"), facts.number("inertia", "inertia", "C")
    if A is not None and C is not None and C > 2 * A > 0:
        most = "not physically possible (A and C swapped?); at most 2 A (a flat disc)"
        yield Finding(("inertia", "C"), f"C = {C:g} exceeds 2 A = {2 * A:g} kg m^2: {most}")


def tensor_of(facts: Facts) -> Vector | None:
    """The inertia tensor (3, 3) kg m²; None where there is none, or it cannot be read."""
    rows = [facts.vector("inertia", 3, "inertia", "tensor", row) for row in range(3)]
    if len(facts.children("inertia", "tensor")) != 3 or any(row is None for row in rows):
        return None
    return np.array(rows)


def tensor_fault(tensor: Vector) -> Finding | None:
    """The fault that makes a 3×3 tensor impossible as an inertia tensor."""
    path: KeyPath = ("inertia", "tensor")
    skew = np.abs(tensor - tensor.T)
    if skew.max() > SYMMETRIC * np.abs(tensor).max():
        column, row = map(int, np.unravel_index(np.argmax(skew), skew.shape))
        mirrored = f"{tensor[column, row]:g} at [{column}][{row}]; both must be equal"
        return Finding((*path, row, column), f"not symmetric: {tensor[row, column]:g} here, but {mirrored}")
    moments = np.linalg.eigvalsh(symmetric(tensor))
    values = f"principal moments {', '.join(f'{moment:g}' for moment in moments)} kg m^2"
    least = max(SMALLEST, 1e-14 * moments[2])
    if moments[0] <= least:
        wrong = " or ".join(f"{moment:g}" for moment in moments if moment <= least)
        return Finding(path, f"{values}; all three must be above 0, not {wrong}")
    if moments[2] > (moments[0] + moments[1]) * (1 + SYMMETRIC):
        return Finding(path, f"{values}: the largest must not exceed the sum of the other two (triangle inequality)")
    return None


def principal_of(facts: Facts) -> tuple[rigid_body.Moments, Vector] | None:
    """Principal moments, kg m², and axes, by the tensor or by A and C; None where they cannot be read."""
    tensor = tensor_of(facts)
    if tensor is not None:
        return None if tensor_fault(tensor) else rigid_body.principal_axes(symmetric(tensor))
    A, C = (facts.number("inertia", "inertia", key) for key in "AC")
    return None if A is None or C is None or A <= 0.0 or C <= 0.0 else ((A, A, C), np.eye(3))


def inertia_of(facts: Facts) -> Inertia | None:
    """The inertia; None where it cannot be read, or no body can have it and spin."""
    principal = principal_of(facts)
    if principal is None or principal[0][2] > sum(principal[0][:2]) * (1.0 + SYMMETRIC):
        return None
    try:
        return Inertia(*principal, wheel_of(facts))
    except ValueError:
        return None


def wheel_of(facts: Facts) -> float:
    """Momentum of the wheel, N m s; zero where there is none or it cannot be read."""
    return facts.number("momentum", "wheel", "momentum") or 0.0


def _spin_axis_fault(tensor: Vector, facts: Facts) -> Finding | None:
    """The reason why free spin about principal axis 3 is unstable, and its growth, if the spin is known."""
    moments, spin, wheel = rigid_body.principal_axes(symmetric(tensor))[0], spin_of(facts), wheel_of(facts)
    if wheel != 0.0:
        if spin is None or (grows := rigid_body.growth(moments, spin, wheel)).stable:
            return None
        low, high = sorted(moment * spin - moments[2] * spin for moment in moments[:2])
        growth = f"grows e-fold in {grows.growth_time:.2g} s" if grows.squared_exponent else "is not turned back"
        cure = f"expected a momentum below {low:.4g} or above {high:.4g} N m s"
        return Finding(("wheel", "momentum"), f"nutation about the spin axis {growth} with it; {cure}")
    named = sorted(zip(moments, ("I1", "I2", "I3"), strict=True), reverse=True)
    values = ", ".join(f"{name} = {moment:.10g}" for moment, name in named)
    kind, growth = rigid_body.axis_class(moments), ""
    if kind == "degenerate":
        problem, growth = f"the same principal moment as just one other axis ({values} kg m^2)", " and drifts evenly"
    elif kind == "intermediate":
        problem = f"the middle principal moment ({values} kg m^2)"
        if spin is not None:
            growth = f" and grows e-fold in {rigid_body.growth(moments, spin).growth_time:.2g} s"
    else:
        return None
    cure = "spin about the axis of the smallest or largest moment, or hold it by a wheel"
    problem = f"the spin axis has {problem}: free spin about it is unstable{growth}; {cure}"
    return Finding(("inertia", "tensor"), problem)


def spin_of(facts: Facts) -> float | None:
    """The rate about principal axis 3; None where it is zero without a wheel or cannot be read."""
    spin = _spin_of_omega0(facts)[1] if facts.has("omega0") else facts.number("rate", "state", "spin")
    return spin if spin is not None and (abs(spin) >= SMALLEST or wheel_of(facts)) else None


def _motion(facts: Facts) -> Iterator[Finding]:
    if facts.has("omega0") and facts.has("state"):
        yield Finding(("state",), "given together with omega0; keep one of the two", True)
    if not facts.has("omega0") and not facts.has("state"):
        yield Finding(("omega0",), "missing; give omega0: [ω1, ω2, ω3], or state: {spin: …, nutation: …}")
    for path, spin in ((("state", "spin"), facts.number("rate", "state", "spin")), _spin_of_omega0(facts)):
        if spin is not None and abs(spin) < SMALLEST and not wheel_of(facts):
            yield Finding(path, "the spin is zero; expected a rate about axis 3, or a wheel; nothing nutates without")
    spin, inertia = spin_of(facts), inertia_of(facts)
    if spin is not None and inertia is not None and inertia.wheel:
        axial, path = inertia.axial(spin), ("wheel", "momentum")
        if abs(axial) <= CANCELLED * abs(inertia.wheel):
            momentum = f"{inertia.C * spin:.4g} N m s"
            yield Finding(path, f"cancels the C ω3 of the body, {momentum}: without momentum nothing nutates")
        elif spin == 0.0 and facts.has("sun_sensor"):
            cure = "there are no Sun pulses; leave it out"
            yield Finding(("sun_sensor",), f"the body does not turn about axis 3: {cure}", True)
        elif axial * spin < 0.0 and facts.has("sun_sensor"):
            problem = "turns the angular momentum against the spin: blocks fired from the Sun pulse are not planned"
            yield Finding(path, f"{problem} then; leave sun_sensor out")


def spin_axis(facts: Facts) -> Vector:
    """Principal axis 3 in the axes of the file, (3,); the file's third where the tensor cannot be read."""
    principal = principal_of(facts)
    return np.array([0.0, 0.0, 1.0]) if principal is None else principal[1][:, 2]


def _spin_of_omega0(facts: Facts) -> tuple[KeyPath, float | None]:
    """The rate about principal axis 3, and its path; a transverse rate that is rounding counts as zero."""
    omega0, tensor = facts.vector("rate", 3, "omega0"), tensor_of(facts)
    if omega0 is None or (tensor is not None and tensor_fault(tensor) is not None):
        return (), None
    if tensor is None:
        return ("omega0", 2), float(omega0[2])
    spin = float(spin_axis(facts) @ omega0)
    return ("omega0",), spin if abs(spin) > CANCELLED * norm(omega0) else 0.0


def _attitude(facts: Facts) -> Iterator[Finding]:
    by_axis = [key for key in ("spin_axis", "phase", "sun_phase", "of") if facts.has("attitude", key)]
    if facts.has("attitude", "quaternion"):
        for key in by_axis:
            yield Finding(("attitude", key), "given together with quaternion; keep one of the two", True)
    elif facts.is_mapping("attitude"):
        if "spin_axis" not in by_axis:
            cure = "or spin_axis: [right ascension, declination]"
            yield Finding(("attitude", "quaternion"), f"missing; turn from body to frame, scalar first, {cure}")
        if "sun_phase" in by_axis:
            yield from _sun_phase(facts)
    yield from _direction(facts, ("attitude", "spin_axis"))
    quaternion = facts.vector("number", 4, "attitude", "quaternion")
    if quaternion is not None and norm(quaternion) < SMALLEST:
        yield Finding(("attitude", "quaternion"), "zero; expected a rotation, such as [1, 0, 0, 0]")


def _sun_phase(facts: Facts) -> Iterator[Finding]:
    """Faults of an attitude whose phase counts from the side of the Sun."""
    path = ("attitude", "sun_phase")
    if facts.has("attitude", "phase"):
        yield Finding(path, "given together with phase; keep one of the two", True)
    if not facts.has("sun"):
        yield Finding(path, "needs the key sun: [right ascension, declination], or sun: epoch", True)
    axis, direction = facts.vector("angle", 2, "attitude", "spin_axis"), _to_sun(facts)
    if axis is not None and direction is not None:
        angle = float(attitude.angle_between(attitude.on_sphere(*axis.tolist()), direction))
        if min(angle, math.pi - angle) < ALONG:
            yield Finding(path, "the Sun lies along spin_axis, which has no side of the Sun then; give phase", True)


def disturbance_kind(kind: str | None, turns: bool) -> str:
    """Kind of a disturbance that says ``kind`` or nothing; ``turns``: rate or fixed_in is given."""
    return kind or ("rotating" if turns else "constant")


def _disturbances(facts: Facts) -> Iterator[Finding]:
    for path in filter(lambda path: facts.is_mapping(*path), facts.below("disturbances")):
        turning = [key for key in ("rate", "fixed_in") if facts.has(*path, key)]
        unreadable = facts.has(*path, "kind") and facts.text(*path, "kind") is None
        kind = "" if unreadable else disturbance_kind(facts.text(*path, "kind"), bool(turning))
        yield from _turning(facts, path, kind, turning)
        yield from _disturbing_torque(facts, path, kind)


def _turning(facts: Facts, path: KeyPath, kind: str, turning: list[str]) -> Iterator[Finding]:
    """Faults of rate and fixed_in of a disturbance, of which ``turning`` are given."""
    if kind in ("constant", "axial"):
        for key in turning:
            yield Finding((*path, key), f"goes with kind rotating, not {kind}; leave one of the two out", True)
        return
    if len(turning) == 2:
        yield Finding((*path, "fixed_in"), "given together with rate; keep one of the two", True)
    elif kind == "rotating" and not turning:
        yield Finding((*path, "rate"), "missing; give rate: … rad/s, as seen in the body, or fixed_in: inertial")
    rate = facts.number("rate", *path, "rate")
    if rate is not None and abs(rate) < SMALLEST:
        yield Finding((*path, "rate"), "zero; for a torque fixed in the body say kind: constant and leave rate out")
    if facts.text(*path, "fixed_in") == "body":
        problem = "expected 'inertial', got 'body'; for a torque fixed in the body say kind: constant"
        yield Finding((*path, "fixed_in"), f"{problem} and leave fixed_in out")


def _disturbing_torque(facts: Facts, path: KeyPath, kind: str) -> Iterator[Finding]:
    path = (*path, "torque")
    single, torque = facts.number("torque", *path), facts.vector("torque", 3, *path)
    if single is not None and kind in ("constant", "rotating"):
        cure = "; or, for a torque about axis 3 only, kind: axial" if kind == "constant" else ""
        yield Finding(path, f"expected three components, [M1, M2, M3], got a single torque{cure}")
    elif single is not None and abs(single) < SMALLEST:
        yield Finding(path, "zero; expected a torque other than 0")
    if torque is None:
        return
    size = norm(torque)
    if size < SMALLEST:
        yield Finding(path, "zero; expected at least one component other than 0")
    elif kind == "axial" and norm(torque[:2]) > CANCELLED * size:
        yield Finding(path, "an axial torque has no transverse components; expected [0, 0, M3], or kind: constant")
    elif kind == "rotating" and abs(torque[2]) > CANCELLED * size:
        problem = "a rotating torque has no part about axis 3; expected 0"
        yield Finding((*path, 2), f"{problem}, and this part as a disturbance of its own, kind: axial")


def _dissipation(facts: Facts) -> Iterator[Finding]:
    time_constant = facts.number("time", "dissipation", "time_constant")
    if time_constant == 0.0:
        path: KeyPath = ("dissipation", "time_constant")
        yield Finding(path, "zero; expected a time above 0, or leave dissipation out for none")
    path, inertia = ("dissipation", "nutation"), inertia_of(facts)
    if time_constant is not None and wheel_of(facts) and not facts.has(*path):
        yield Finding(path, "missing; with a wheel the place of the loss decides: give grows or decays")
    elif inertia is not None and inertia.a == inertia.wheel == 0.0 and facts.has(*path):
        yield Finding(path, "the nutation of a sphere neither grows nor decays; leave it out", True)


def _limits(facts: Facts) -> Iterator[Finding]:
    earliest, horizon = facts.number("time", "limits", "earliest"), facts.number("time", "limits", "horizon")
    if earliest is not None and horizon is not None and earliest >= horizon > 0:
        yield Finding(("limits", "earliest"), f"not before the horizon; expected less than {horizon:g} s")
    for path in facts.below("limits", "blackout"):
        window = facts.vector("time", 2, *path)
        if window is not None and window[1] < window[0]:
            yield Finding(path, "ends before it begins; expected [begin, end]")


def _goal(facts: Facts) -> Iterator[Finding]:
    pairs = (("tilt", "azimuth"), ("right_ascension", "declination"))
    in_n, in_sky = ([key for key in pair if facts.has("goal", key)] for pair in pairs)
    if in_n and in_sky:
        problem = f"given together with {' and '.join(in_sky)}; keep tilt and azimuth, or the other pair"
        yield Finding(("goal", in_n[0]), problem, True)
    elif in_n == ["azimuth"]:
        yield Finding(("goal", "tilt"), "missing; azimuth alone names no direction")
    elif len(in_sky) == 1:
        (other,) = {*pairs[1]} - {*in_sky}
        yield Finding(("goal", other), f"missing; {in_sky[0]} alone names no direction")
    elif in_sky and not facts.has("attitude"):
        problem = "needs attitude, which says where the body points at t = 0; without it give tilt and azimuth"
        yield Finding(("goal", in_sky[0]), problem, True)
    final, spin = facts.number("rate", "goal", "spin"), spin_of(facts)
    if final is not None and abs(final) < SMALLEST:
        yield Finding(("goal", "spin"), "zero; expected a rate about axis 3")
    elif final is not None and spin is not None and final * spin < 0.0:
        yield Finding(("goal", "spin"), "of the other sign than the spin at t = 0; the spin cannot be reversed")
