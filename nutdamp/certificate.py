"""The proof of a least cost, to be checked by others: the prices of a program of small angles, and its primer curve.

q(t) of a channel is what a second of it is worth at t by the prices, over what it costs. Where q exceeds one nowhere,
no schedule costs less than what the prices are worth at the goal (weak duality; Lawden 1963, the primer vector); the
program fires where q is one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from nutdamp import planning, schemes
from nutdamp.errors import BadRequest, Infeasible
from nutdamp.limits import free_windows
from nutdamp.planning import Plan
from nutdamp.schemes.optimal import bounds
from nutdamp.schemes.optimal.bounds import Proof
from nutdamp.schemes.optimal.columns import Burn
from nutdamp.schemes.optimal.linear_program import Program
from nutdamp.schemes.optimal.primer import SmallAngles
from nutdamp.schemes.optimal.problem import Problem
from nutdamp.schemes.optimal.repair import UNMET
from nutdamp.schemes.optimal.residual_equations import growth_from
from nutdamp.schemes.options import OptimalOptions
from nutdamp.schemes.tools import commanding
from nutdamp.schemes.tools.symmetric_model import model_of
from nutdamp.spacecraft import Spacecraft, Vector

SCHEME = "optimal"

ROWS = ("nutation_1", "nutation_2", "shift_1", "shift_2", "spin")
"""What the equations are about."""

SAME = 1e-9
"""Relative difference up to which a bound is that of the plan."""

LOOKS = 32
"""Moments of the primer curve in a turn of the faster of its two parts."""

MOST_LOOKS = 6_000
"""Moments of the whole curve."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """The ``proof`` of what a plan of optimal costs at least, by a ``program`` of small angles and its ``burns``.

    ``problem`` has the unit of the cost; its spacecraft is the symmetric body that the scheme plans on.
    """

    plan: Plan
    problem: Problem
    program: Program
    burns: tuple[Burn, ...]
    proof: Proof

    @property
    def bound(self) -> float:
        """The least cost that is proved."""
        return self.proof.bound

    @property
    def rows(self) -> list[str]:
        """What each equation is about, see `ROWS`."""
        return [ROWS[row] for row in self.problem.equations.chosen]

    @property
    def windows(self) -> list[tuple[float, float]]:
        """When pulses may be on, (begin, end) s."""
        return free_windows(self.spacecraft, self.program.end)

    def primer(self, times: Vector) -> Vector:
        """q at ``times`` (n,) s of each channel of the program, (n, channels)."""
        return SmallAngles(self.program, self.proof.prices).at(times)

    @property
    def spacecraft(self) -> Spacecraft:
        """The symmetric body that the program is of."""
        return self.program.spacecraft

    @property
    def last(self) -> float:
        """Moment, s, from which what a pulse does to decaying nutation counts in full; 0 where it grows or stays."""
        return growth_from(self.spacecraft)

    @property
    def cost(self) -> float:
        """Cost of the burns."""
        price = dict(zip((one.name for one in self.program.channels), self.program.costs.tolist(), strict=True))
        return math.fsum(price[burn.channel.name] * burn.on_time for burn in self.burns)

    def moments(self) -> list[Vector]:
        """Even moments (n,) s in each window, many in a turn unless there are too many turns."""
        body, spans = self.spacecraft, self.windows
        turns = max(abs(body.inertia.a * body.spin), abs(body.spin)) / (2.0 * math.pi)
        total = sum(end - begin for begin, end in spans)
        pace = min(LOOKS * turns, MOST_LOOKS / max(total, 1e-9))
        return [np.linspace(begin, end, math.ceil((end - begin) * pace) + 2) for begin, end in spans]


def certificate(plan: Plan) -> Certificate:
    """The certificate of a plan of optimal; raises BadRequest where there is none, with the reason."""
    known = plan.pulses.bounds
    if plan.scheme != SCHEME:
        raise BadRequest(f"a certificate is of a plan of {SCHEME}, not of {plan.scheme}")
    if not plan.feasible or known is None or known.first_order is None:
        raise BadRequest(f"{SCHEME} has no least cost to prove here: {plan.refusal or 'there is no such plan'}")
    chosen = schemes.options_of(schemes.SCHEMES[SCHEME], plan.options)
    body = planning.known(plan.spacecraft, chosen)
    if body.thrust_laws:
        chosen, body = commanding.options(body, chosen), commanding.plain(body)
    body = model_of(body).body
    assert isinstance(chosen, OptimalOptions)
    try:
        problem = Problem(replace(body, limits=replace(body.limits, horizon=known.within)), chosen)
        program = problem.program()
        solution = program.solve()
    except Infeasible as reason:
        raise BadRequest(f"{SCHEME} has no least cost to prove here: {reason}") from None
    proof = bounds.first_order(program, solution.prices)
    if solution.unmet > UNMET or abs(proof.bound - known.first_order) > SAME * abs(known.first_order):
        raise BadRequest("the plan is put together from several programs, and none of them proves what all of it costs")
    return Certificate(plan, problem, program, solution.burns, proof)
