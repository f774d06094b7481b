"""The contents of a spacecraft file as far as they can be read: values by path, and the body.

Unreadable values are skipped, so that rules work beside any other fault.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from nutdamp.files.fields import SMALLEST, Finding, Values
from nutdamp.files.keys import SPACECRAFT, thrust_behind
from nutdamp.files.yaml import KeyPath, Node
from nutdamp.physics import body as rigid_body
from nutdamp.spacecraft.model import Inertia
from nutdamp.spacecraft.schedule import STEERABLE

Vector = NDArray[np.float64]

CANCELLED = 1e-12
"""A sum smaller than its terms by this factor is their rounding: 4,000 times that of one number."""

SYMMETRIC = 1e-9
"""Asymmetry of a tensor, over its largest entry, that ten printed digits leave."""


class Facts(Values):
    """The values of a spacecraft file by path, and what follows from them."""

    def __init__(self, root: Node) -> None:
        super().__init__(root)
        self.contents = self.read(SPACECRAFT, root)

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
    def tensor(self) -> Vector | None:
        """The inertia tensor (3, 3) kg m²."""
        rows = [self.vector(*row) for row in self.below("inertia", "tensor")]
        return None if len(rows) != 3 or any(row is None for row in rows) else np.array(rows)

    @cached_property
    def principal(self) -> tuple[rigid_body.Moments, Vector] | None:
        """Principal moments, kg m², and axes; None where no body has them."""
        if self.tensor is not None:
            sound = tensor_fault(self.tensor) is None
            return rigid_body.principal_axes(symmetric(self.tensor)) if sound else None
        A, C = self.number("inertia", "A"), self.number("inertia", "C")
        return None if A is None or C is None else ((A, A, C), np.eye(3))

    @cached_property
    def inertia(self) -> Inertia | None:
        """The inertia; None where no body has it, or it cannot spin so."""
        if self.principal is None or moments_fault(np.array(self.principal[0])) is not None:
            return None
        try:
            return Inertia(*self.principal, self.wheel)
        except ValueError:
            return None

    @cached_property
    def wheel(self) -> float:
        """Momentum of the wheel, N m s; zero where there is none."""
        return self.number("wheel", "momentum") or 0.0

    @cached_property
    def stated_spin(self) -> tuple[KeyPath, float | None]:
        """The rate about principal axis 3, rad/s, and its path; a rate that is rounding is zero."""
        if not self.has("omega0"):
            return ("state", "spin"), self.number("state", "spin")
        omega0 = self.vector("omega0")
        if omega0 is None or (self.tensor is not None and self.principal is None):
            return ("omega0",), None
        if self.tensor is None or self.principal is None:
            return ("omega0", 2), float(omega0[2])
        spin = float(self.principal[1][:, 2] @ omega0)
        return ("omega0",), spin if abs(spin) > CANCELLED * math.hypot(*omega0) else 0.0

    @cached_property
    def spin(self) -> float | None:
        """The rate about principal axis 3, rad/s; None where it is zero without a wheel."""
        spin = self.stated_spin[1]
        return spin if spin is not None and (abs(spin) >= SMALLEST or self.wheel) else None

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
