"""The same loop flown by DOP853, its events found on the interpolants of that: firing by firing, do they agree?"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nutdamp.dop853 import Equations
from nutdamp.dynamics import Dynamics, Push
from nutdamp.errors import Infeasible
from nutdamp.loop.run import SEED, Run, fly
from nutdamp.motion import Path
from nutdamp.physics.rigid import NOTHING
from nutdamp.spacecraft import Spacecraft, SpinState, Vector

AGREE = 1e-6
"""s; firings that begin and last alike to this are the same."""


EVALUATIONS = 1_000_000
"""Evaluations of Euler's equations by DOP853, at most: a loop flies on where a schedule is over."""


@dataclass(frozen=True, eq=False)
class _Solved:
    """A stretch that was integrated, by its interpolant."""

    equations: Equations
    solution: Any
    steps: int

    def motion(self, times: Vector) -> tuple[Vector, Vector]:
        """Rates (n, 3) in rad/s and quaternions (n, 4) at ``times`` (n,) s."""
        return self.equations.motion(np.atleast_2d(self.solution(np.asarray(times, dtype=float)).T))


@dataclass(frozen=True, slots=True)
class _Independent(Dynamics):
    """Moves a body by DOP853 on Euler's equations with the full tensor; evaluations of these are counted, not steps."""

    equations: Equations = field(kw_only=True)

    @property
    def free(self) -> bool:
        """Whether coasts are known in closed form: none is."""
        return False

    def _path(
        self,
        state: SpinState,
        start: float,
        end: float,
        push: Push,
        most: int,  # noqa: ARG002 - of steps
    ) -> tuple[Path, SpinState]:
        first = self.equations.state(state)  # no loop is flown with moments that fall
        if end <= start:
            return _Solved(self.equations, lambda times: np.outer(first, np.ones(np.size(times))), 0), state
        torque = (np.asarray(sum(push.torques, np.zeros(3))), push.slope)
        found = self.equations.solved(first, start, end, [torque], dense=True)
        rates, quaternion = self.equations.motion(found.y[:, -1:].T)
        one, two, three = rates[0].tolist()
        return _Solved(self.equations, found.sol, len(found.t)), SpinState(complex(one, two), three, quaternion[0])


@dataclass(frozen=True, eq=False)
class LoopVerification:
    """A loop and the same by DOP853; ``missing`` is why that was not flown to the end."""

    run: Run
    other: Run | None
    missing: str = ""
    evaluations: int = 0
    pairs: tuple[tuple[float, float, float], ...] = field(default=())
    """Of each firing the differences of start and on-time, s, and of the nutation before it, rad."""

    @property
    def same(self) -> bool:
        """Whether the same channels fire, in the same order."""
        names = [[one.pulse.channel for one in run.fired] for run in (self.run, self.other) if run is not None]
        return len(names) == 2 and names[0] == names[1]

    @property
    def worst(self) -> float:
        """Largest difference of a start or an on-time, s."""
        return max((max(abs(start), abs(lasts)) for start, lasts, _ in self.pairs), default=0.0)

    @property
    def agree(self) -> bool:
        """Whether DOP853 confirms every firing to `AGREE`, and why the loop ended."""
        return self.same and self.worst <= AGREE and self.other is not None and self.other.stop is self.run.stop


def verify_loop(spacecraft: Spacecraft, until: float | None = None, *, seed: int = SEED) -> LoopVerification:
    """Fly the loop of the file in closed form and by DOP853; raises Infeasible where it cannot be flown at all."""
    loop = spacecraft.loop
    assert loop is not None
    run = fly(spacecraft, loop, until, seed=seed)
    equations, inertia = Equations(spacecraft, EVALUATIONS), spacecraft.inertia
    mover = _Independent(inertia.moments, np.zeros(3), NOTHING, equations=equations)
    try:
        other = fly(spacecraft, loop, run.until, seed=seed, dynamics=mover)
    except Infeasible as reason:
        return LoopVerification(run, None, str(reason), equations.evaluations)
    pairs = tuple(
        (
            one.pulse.loaded[0] - two.pulse.loaded[0],
            one.pulse.loaded[1] - two.pulse.loaded[1],
            one.true_nutation - two.true_nutation,
        )
        for one, two in zip(run.fired, other.fired, strict=False)
    )
    return LoopVerification(run, other, "", equations.evaluations, pairs)
