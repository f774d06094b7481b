"""The contents of a spacecraft file as far as they can be read: values by path, and the body.

Unreadable values are skipped, so that rules work beside any other fault.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from nutdamp.files.fields import SMALLEST, Finding, Values
from nutdamp.files.keys import SPACECRAFT, thrust_behind
from nutdamp.files.yaml import KeyPath, Node
from nutdamp.physics import inertia as principal_moments
from nutdamp.spacecraft.model import Inertia
from nutdamp.spacecraft.schedule import STEERABLE

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
