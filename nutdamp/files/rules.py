"""Constraints between the keys of a spacecraft file: the plain ones in a table; body, motion, sky.

The rules read the raw tree (`Facts`) and skip unreadable values, so that they work beside any other
fault.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import pairwise
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
from nutdamp.units import KINDS, bar, parse, shown

Vector = NDArray[np.float64]


MOMENT = re.compile(r"[IJ]_?([xyz]{1,2}|[123]{1,2})", re.IGNORECASE)  # keys for parts of a tensor


class Finding(NamedTuple):
    """Something wrong at ``path``, which need not exist; ``at_key`` points at the key and not at
    its value.
    """

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

    def matching(self, pattern: str) -> list[KeyPath]:
        """Paths of a pattern such as ``thrusters.*.force``; its last step need not be there."""
        paths: list[KeyPath] = [()]
        for step in pattern.split("."):
            key = int(step) if step.isdigit() else step
            deeper = [self.below(*path) if step == "*" else [(*path, key)] for path in paths]
            paths = [path for each in deeper for path in each]
        return paths


KEEP = "keep one of the two"
SKY = "[right ascension, declination]"
SUN = f": {SKY}, or sun: epoch"
POINTING = ", which says where the body points at t = 0"
SAMPLED = ", such as rate: 100 Hz: it applies to samples"
MOUNTING = ".position .direction .force"
COMPONENT = "expected at least one component other than 0"

RULES = (
    # Path; kind of rule; other keys (one beside it begins with a dot), or the quantity; the cure.
    ("omega0", "missing", ".state", "give omega0: [ω1, ω2, ω3], or state: {spin: …, nutation: …}"),
    ("state", "beside", ".omega0", KEEP),
    ("inertia.A", "missing", ".tensor", "the transverse moment of inertia, in kg m^2"),
    ("inertia.C", "missing", ".tensor", "the axial moment of inertia, in kg m^2"),
    ("inertia.tensor", "beside", ".A .C", "keep either tensor, or A and C"),
    (
        "attitude.quaternion",
        "missing",
        ".spin_axis",
        f"turn from body to frame, scalar first, or spin_axis: {SKY}",
    ),
    ("attitude.quaternion", "not zero", "number", "expected a rotation, such as [1, 0, 0, 0]"),
    ("attitude.spin_axis", "beside", ".quaternion", KEEP),
    ("attitude.of", "beside", ".quaternion", KEEP),
    ("attitude.phase", "beside", ".quaternion", KEEP),
    ("attitude.sun_phase", "beside", ".quaternion .phase", KEEP),
    ("attitude.sun_phase", "needs", "sun", SUN),
    ("sun", "needs", "attitude", POINTING),
    ("sun_sensor", "needs", "sun", SUN),
    ("commands", "needs", "sun_sensor", ", whose pulse fires the blocks"),
    ("commands.width.min", "at most", ".max", "time"),
    (
        "orbit",
        "needs",
        "attitude.epoch attitude.frame",
        ": the moment of the position and the axes that it is in",
    ),
    (
        "orbit.position",
        "not zero",
        "length",
        "expected the position of the spacecraft relative to center",
    ),
    ("keep", "once", "name", "take another"),
    ("keep.*.direction", "needs", "attitude", POINTING),
    ("keep.*.min", "missing", ".max", "give min, max or both, else the cone has no effect"),
    ("keep.*.min", "at most", ".max", "angle"),
    (
        "goal.tilt",
        "beside",
        ".right_ascension .declination",
        "keep tilt and azimuth, or the other pair",
    ),
    ("goal.tilt", "completes", ".azimuth", "names no direction"),
    ("goal.declination", "completes", ".right_ascension", "names no direction"),
    ("goal.right_ascension", "completes", ".declination", "names no direction"),
    ("goal.right_ascension", "needs", "attitude", f"{POINTING}; without it give tilt and azimuth"),
    ("goal.spin", "not zero", "rate", "expected a rate about axis 3"),
    ("limits.earliest", "below", ".horizon", "time"),
    ("disturbances", "once", "name", "take another"),
    ("disturbances.*.torque", "not zero", "torque", COMPONENT),
    ("disturbances.*.rate", "not zero", "rate", "leave rate out for a torque fixed in the body"),
    ("thrusters", "once", "name", "take another"),
    ("thrusters.*.torque", "missing", MOUNTING, "give torque, or position, direction and force"),
    ("thrusters.*.torque", "beside", MOUNTING, "keep torque, or position, direction and force"),
    ("thrusters.*.torque", "not zero", "torque", COMPONENT),
    ("thrusters.*.position", "completes", ".direction .force", "cannot give a torque"),
    ("thrusters.*.direction", "completes", ".position .force", "cannot give a torque"),
    ("thrusters.*.force", "completes", ".position .direction", "cannot give a torque"),
    ("thrusters.*.direction", "not zero", "number", "expected a direction, such as [1, 0, 0]"),
    ("thrusters.*.lever_arm", "beside", ".position", "leave it out, position gives the arm"),
    ("thrusters.*.min_on_time", "at most", ".max_on_time", "time"),
    ("thrusters.*.impulse_bit", "beside", ".valve", KEEP),
    ("thrusters.*.impulse_bit", "rising", "time impulse time", "expected rows that rise"),
    ("channels.*", "once", "", "expected once in a channel"),
    ("valve", "needs", "thrusters", ", which it belongs to"),
    ("cold", "needs", "thrusters", ", whose nozzles are meant"),
    ("tank", "needs", "thrusters", ", which it feeds"),
    ("tank.final_pressure", "at most", ".pressure", "pressure"),
    ("tank.propellant", "below", "mass", "mass"),
    ("tank.isp", "rising", "pressure", "expected rows that rise"),
    ("loop", "needs", "thrusters", ", which it fires"),
    ("loop.stop", "below", ".start", "angle"),
    ("loop.sensor.noise", "needs", "loop.sensor.rate", SAMPLED),
    ("loop.sensor.quantisation", "needs", "loop.sensor.rate", SAMPLED),
    ("loop.sensor.low_pass", "needs", "loop.sensor.rate", SAMPLED),
    ("loop.sensor.axis", "not zero", "number", "expected a direction, such as [0, 0, 1]"),
    (
        "loop.sensor.scale",
        "not zero",
        "ratio",
        "the sensor would show nothing; expected about 100 %",
    ),
    ("loop.faults.reversed", "once", "", "expected each channel once"),
)


def _others(path: KeyPath, others: str) -> list[KeyPath]:
    """Paths of the other keys in a row of the table."""
    paths: list[KeyPath] = []
    for other in others.split():
        beside = other.startswith(".")
        paths.append((*path[:-1], other[1:]) if beside else tuple(other.split(".")))
    return paths


def _beside(facts: Facts, path: KeyPath, others: str, cure: str) -> Iterator[Finding]:
    there = [str(other[-1]) for other in _others(path, others) if facts.has(*other)]
    if there and facts.has(*path):
        yield Finding(path, f"given together with {' and '.join(there)}; {cure}", True)


def _needs(facts: Facts, path: KeyPath, others: str, why: str) -> Iterator[Finding]:
    lacking = [dotted(other) for other in _others(path, others) if not facts.has(*other)]
    if lacking and facts.has(*path):
        yield Finding(path, f"needs {' and '.join(lacking)}{why}", True)


def _missing(facts: Facts, path: KeyPath, others: str, cure: str) -> Iterator[Finding]:
    """A key that must be there unless one of the others is."""
    there = any(facts.has(*other) for other in (path, *_others(path, others)))
    if not there and facts.is_mapping(*path[:-1]):
        yield Finding(path, f"missing; {cure}")


def _completes(facts: Facts, path: KeyPath, others: str, what: str) -> Iterator[Finding]:
    """A key that must be there beside each of the others."""
    there = [str(other[-1]) for other in _others(path, others) if facts.has(*other)]
    if there and not facts.has(*path):
        yield Finding(path, f"missing; {' and '.join(there)} alone {what}")


def _bounded(
    facts: Facts,
    path: KeyPath,
    other: str,
    kind: str,
    *,
    equal: bool,
) -> Iterator[Finding]:
    (bound,) = _others(path, other)
    value, limit = facts.number(kind, *path), facts.number(kind, *bound)
    if value is None or limit is None:
        return
    if value > limit and equal:
        problem = f"exceeds {bound[-1]}; expected at most {amount(kind, limit)}"
        yield Finding(path, f"{amount(kind, value)} {problem}")
    elif value >= limit and not equal:
        problem = f"is not below {bound[-1]}; expected less than {amount(kind, limit)}"
        yield Finding(path, f"{amount(kind, value)} {problem}")


def _not_zero(facts: Facts, path: KeyPath, kind: str, cure: str) -> Iterator[Finding]:
    """A quantity, or a list of such, that is no zero."""
    size = len(facts.children(*path))
    numbers = facts.vector(kind, size, *path) if size else facts.number(kind, *path)
    if numbers is not None and np.max(np.abs(numbers)) < SMALLEST:
        yield Finding(path, f"zero; {cure}")


def _rising(facts: Facts, path: KeyPath, kinds: str, cure: str) -> Iterator[Finding]:
    """A list of rows, of quantities of these kinds, in which each rises."""
    for column, kind in enumerate(kinds.split()):
        values = [facts.number(kind, *row, column) for row in facts.below(*path)]
        for row, (before, value) in enumerate(pairwise(values), start=1):
            if before is not None and value is not None and value <= before:
                last = f"that of the row before, {amount(kind, before)}"
                problem = f"{amount(kind, value)} is not above {last}; {cure}"
                yield Finding((*path, row, column), problem)


def _once(facts: Facts, path: KeyPath, key: str, cure: str) -> Iterator[Finding]:
    """A list of which no two entries have the same text, or the same at a ``key``."""
    first: dict[str, KeyPath] = {}
    for entry in facts.below(*path):
        place: KeyPath = (*entry, key) if key else entry
        name = facts.text(*place)
        if name is not None and (other := first.setdefault(name, entry)) != entry:
            yield Finding(place, f"{shown(name)} is given twice, first in {dotted(other)}; {cure}")


RULE_KINDS: dict[str, Callable[[Facts, KeyPath, str, str], Iterator[Finding]]] = {
    "beside": _beside,
    "needs": _needs,
    "missing": _missing,
    "completes": _completes,
    "at most": partial(_bounded, equal=True),
    "below": partial(_bounded, equal=False),
    "not zero": _not_zero,
    "rising": _rising,
    "once": _once,
}


def amount(kind: str, value: float) -> str:
    """A quantity as people read it, angles in deg."""
    if kind == "angle":
        return f"{math.degrees(value):g} deg"
    return bar(value) if kind == "pressure" else f"{value:g} {KINDS[kind].si}"


def findings(root: Node) -> Iterator[Finding]:
    """All faults of the table, and those of body, motion and sky."""
    facts = Facts(root)
    for pattern, kind, others, cure in RULES:
        for path in facts.matching(pattern):
            yield from RULE_KINDS[kind](facts, path, others, cure)
    for rule in (_names, _inertia, _motion, _disturbances, _blackout, _sun, _declinations):
        yield from rule(facts)


def _names(facts: Facts) -> Iterator[Finding]:
    lists = ("name", "thrusters.*.name", "disturbances.*.name", "keep.*.name", "orbit.center")
    named = [(path, facts.text(*path), False) for each in lists for path in facts.matching(each)]
    named += [(path, str(path[-1]), True) for path in facts.below("channels")]
    for path, name, at_key in named:
        if name is None:
            continue
        if not name.strip() or not name.isprintable():
            yield Finding(path, f"{shown(name)} is no name; expected printable characters", at_key)
        elif name == STEERABLE and path[0] in ("thrusters", "channels"):
            problem = f"the name {STEERABLE!r} is kept for the steerable torquer; take another"
            yield Finding(path, problem, at_key)


CANCELLED = 1e-12  # a sum that is smaller than its terms by this factor counts as zero

SYMMETRIC = 1e-9  # asymmetry of an inertia tensor that is rounding, relative to its largest entry


def norm(vector: Vector) -> float:
    """Length of a vector, without the underflow of squares."""
    return math.hypot(*vector)


def force_vector(direction: Iterable[float], force: float) -> Vector:
    """Force in N along ``direction``, which need not have length one."""
    components = tuple(direction)
    return np.array([part / math.hypot(*components) * force for part in components])


def symmetric(tensor: Vector) -> Vector:
    """A tensor without the asymmetry that passes for rounding."""
    return 0.5 * (tensor + tensor.T)


def _inertia(facts: Facts) -> Iterator[Finding]:
    tensor = tensor_of(facts)
    fault = None if tensor is None else tensor_fault(tensor) or _spin_axis_fault(tensor, facts)
    if fault is not None:
        yield fault
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
        return Finding(
            (*path, row, column), f"not symmetric: {tensor[row, column]:g} here, but {mirrored}"
        )
    fault = moments_fault(np.asarray(np.linalg.eigvalsh(symmetric(tensor))))
    return None if fault is None else Finding(path, fault)


def moments_fault(moments: Vector) -> str | None:
    """The reason why no body has these principal moments (3,) kg m²."""
    values = f"principal moments {', '.join(f'{moment:g}' for moment in moments)} kg m^2"
    least, middle, largest = np.sort(moments).tolist()
    if least <= (smallest := max(SMALLEST, 1e-14 * largest)):
        wrong = " or ".join(f"{moment:g}" for moment in moments if moment <= smallest)
        return f"{values}; all three must be above 0, not {wrong}"
    if largest > (least + middle) * (1 + SYMMETRIC):
        limit = "the largest must not exceed the sum of the other two (triangle inequality)"
        return f"{values}: {limit}"
    return None


def principal_of(facts: Facts) -> tuple[rigid_body.Moments, Vector] | None:
    """Principal moments, kg m², and axes, by the tensor or by A and C; None where they cannot be
    read.
    """
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
    """The reason why free spin about principal axis 3 is unstable, and its growth, if the spin is
    known.
    """
    moments = rigid_body.principal_axes(symmetric(tensor))[0]
    spin = spin_of(facts)
    wheel = wheel_of(facts)
    if wheel != 0.0:
        if spin is None or (grows := rigid_body.growth(moments, spin, wheel)).stable:
            return None
        low, high = sorted(moment * spin - moments[2] * spin for moment in moments[:2])
        growth = (
            f"grows e-fold in {grows.growth_time:.2g} s"
            if grows.squared_exponent
            else "is not turned back"
        )
        cure = f"expected a momentum below {low:.4g} or above {high:.4g} N m s"
        return Finding(
            ("wheel", "momentum"), f"nutation about the spin axis {growth} with it; {cure}"
        )
    named = sorted(zip(moments, ("I1", "I2", "I3"), strict=True), reverse=True)
    values = ", ".join(f"{name} = {moment:.10g}" for moment, name in named)
    kind = rigid_body.axis_class(moments)
    growth = ""
    if kind == "degenerate":
        problem = f"the same principal moment as just one other axis ({values} kg m^2)"
        growth = " and drifts evenly"
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
    spin = (
        _spin_of_omega0(facts)[1] if facts.has("omega0") else facts.number("rate", "state", "spin")
    )
    return spin if spin is not None and (abs(spin) >= SMALLEST or wheel_of(facts)) else None


def _motion(facts: Facts) -> Iterator[Finding]:
    for path, spin in (
        (("state", "spin"), facts.number("rate", "state", "spin")),
        _spin_of_omega0(facts),
    ):
        if spin is not None and abs(spin) < SMALLEST and not wheel_of(facts):
            cure = "expected a rate about axis 3, or a wheel; nothing nutates without"
            yield Finding(path, f"the spin is zero; {cure}")
    spin = spin_of(facts)
    inertia = inertia_of(facts)
    final = facts.number("rate", "goal", "spin")
    if final is not None and spin is not None and final * spin < 0.0:
        yield Finding(
            ("goal", "spin"),
            "of the other sign than the spin at t = 0; the spin cannot be reversed",
        )
    if spin is None or inertia is None or not inertia.wheel:
        return
    axial = inertia.axial(spin)
    path = ("wheel", "momentum")
    if abs(axial) <= CANCELLED * abs(inertia.wheel):
        problem = f"cancels the C ω3 of the body, {inertia.C * spin:.4g} N m s"
        yield Finding(path, f"{problem}: without momentum nothing nutates")
    elif axial * spin < 0.0 and facts.has("sun_sensor"):
        problem = "turns the angular momentum against the spin: blocks fired from the Sun pulse"
        yield Finding(path, f"{problem} are not planned then; leave sun_sensor out")
    if facts.has("dissipation") and not facts.has("dissipation", "nutation"):
        problem = "missing; with a wheel the place of the loss decides: give grows or decays"
        yield Finding(("dissipation", "nutation"), problem)


def _spin_of_omega0(facts: Facts) -> tuple[KeyPath, float | None]:
    """The rate about principal axis 3, and its path; a transverse rate that is rounding counts as
    zero.
    """
    omega0 = facts.vector("rate", 3, "omega0")
    tensor = tensor_of(facts)
    if omega0 is None or (tensor is not None and tensor_fault(tensor) is not None):
        return (), None
    if tensor is None:
        return ("omega0", 2), float(omega0[2])
    _, axes = rigid_body.principal_axes(symmetric(tensor))
    spin = float(axes[:, 2] @ omega0)
    return ("omega0",), spin if abs(spin) > CANCELLED * norm(omega0) else 0.0


def disturbance_kind(kind: str | None, turns: bool) -> str:
    """Kind of a disturbance that says ``kind`` or nothing; ``turns``: rate or fixed_in is given."""
    return kind or ("rotating" if turns else "constant")


def _disturbances(facts: Facts) -> Iterator[Finding]:
    for path in filter(lambda path: facts.is_mapping(*path), facts.below("disturbances")):
        turning = [key for key in ("rate", "fixed_in") if facts.has(*path, key)]
        stated = facts.value(*path, "kind")
        kind = disturbance_kind(None if stated is None else str(stated), bool(turning))
        if kind in ("constant", "axial"):
            for key in turning:
                problem = f"goes with kind rotating, not {kind}; leave one of the two out"
                yield Finding((*path, key), problem, True)
        elif len(turning) == 2:
            yield Finding((*path, "fixed_in"), f"given together with rate; {KEEP}", True)
        elif kind == "rotating" and not turning:
            cure = "give rate: … rad/s, as seen in the body, or fixed_in: inertial"
            yield Finding((*path, "rate"), f"missing; {cure}")
        if kind in ("constant", "rotating") and facts.number("torque", *path, "torque") is not None:
            problem = "expected three components, [M1, M2, M3], got a single torque"
            cure = "; or, for a torque about axis 3 only, kind: axial"
            yield Finding((*path, "torque"), problem + cure)


def _blackout(facts: Facts) -> Iterator[Finding]:
    for path in facts.below("limits", "blackout"):
        window = facts.vector("time", 2, *path)
        if window is not None and window[1] < window[0]:
            yield Finding(path, "ends before it begins; expected [begin, end]")


ALONG = 1e-3  # rad from the spin axis, up to which the Sun counts as along it


def _sun(facts: Facts) -> Iterator[Finding]:
    """A Sun that is asked for and not there, cannot be computed, or has no side."""
    for path in facts.matching("keep.*.direction"):
        if facts.text(*path) == "sun" and not facts.has("sun"):
            yield Finding(path, f"needs sun{SUN}")
    sun = _to_sun(facts)
    axis = facts.vector("angle", 2, "attitude", "spin_axis")
    undated = facts.has("attitude") and not facts.has("attitude", "epoch")
    if sun is None and facts.text("sun") == "epoch" and undated:
        yield Finding(("sun",), f"epoch needs attitude.epoch, the date of t = 0; or give {SKY}")
    if sun is not None and axis is not None and facts.has("attitude", "sun_phase"):
        angle = float(attitude.angle_between(attitude.on_sphere(*axis.tolist()), sun))
        if min(angle, math.pi - angle) < ALONG:
            problem = "the Sun lies along spin_axis, which has no side of the Sun then; give phase"
            yield Finding(("attitude", "sun_phase"), problem, True)


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


def _declinations(facts: Facts) -> Iterator[Finding]:
    for pattern in ("sun", "attitude.spin_axis", "keep.*.direction"):
        for path in facts.matching(pattern):
            angle = facts.number("angle", *path, 1)
            if angle is not None and abs(angle) > 0.5 * math.pi * (1.0 + 1e-12):
                problem = f"{math.degrees(angle):g} deg is no declination"
                yield Finding((*path, 1), f"{problem}; expected -90 deg to 90 deg")
