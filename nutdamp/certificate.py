"""The proof of a least cost, to be checked by others: the prices of a program of small angles, and its primer curve.

q(t) of a channel is what a second of it is worth at t by the prices, over what it costs. Where q exceeds one nowhere,
no schedule costs less than what the prices are worth at the goal (weak duality; Lawden 1963, the primer vector); the
program fires where q is one. There are two programs: of `optimal`, whose prices are of equations, and of the robust
plan, whose prices are of tangents of cones (`nutdamp.schemes.optimal.chance_proof`).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from nutdamp import planning, schemes, surest
from nutdamp.demands import required_share
from nutdamp.errors import BadRequest, Infeasible
from nutdamp.limits import free_windows
from nutdamp.planning import Plan
from nutdamp.schemes.optimal import bounds
from nutdamp.schemes.optimal.bounds import Proof
from nutdamp.schemes.optimal.chance import ChanceProgram
from nutdamp.schemes.optimal.chance_proof import ChanceCurve, SureProof, prove, windows
from nutdamp.schemes.optimal.columns import Burn, burns
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

HOPELESS = 5e-3
"""Share by which a quick solution passes limits, from which on no exact one is looked for."""


@dataclass(frozen=True, eq=False)
class Certificate(ABC):
    """What a ``program`` of small angles costs at least, and the ``burns`` of a ``plan`` that cost so much.

    ``problem`` has the unit of the cost; its spacecraft is the symmetric body that the scheme plans on.
    """

    plan: Plan
    problem: Problem
    program: Program
    burns: tuple[Burn, ...]

    @property
    @abstractmethod
    def bound(self) -> float:
        """The least cost that is proved."""

    @property
    @abstractmethod
    def windows(self) -> list[tuple[float, float]]:
        """When the program may fire, (begin, end) s."""

    @abstractmethod
    def primer(self, times: Vector) -> Vector:
        """q at ``times`` (n,) s of each channel of the program, (n, channels)."""

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


@dataclass(frozen=True, eq=False)
class NominalCertificate(Certificate):
    """The ``proof`` of what a plan of the scheme optimal costs at least."""

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
        return SmallAngles(self.program, self.proof.prices).at(times, times)


@dataclass(frozen=True, eq=False)
class SureCertificate(Certificate):
    """The ``proof`` of what a robust plan costs at least by the program of margins, at the ``margin`` of the plan.

    That is so many sigmas of the dispersed inputs, to first order. It proves nothing about the share of flown cases
    that comply, by which the margin was chosen.
    """

    chance: ChanceProgram
    proof: SureProof
    margin: float

    @property
    def bound(self) -> float:
        """The least cost that is proved."""
        return self.proof.bound

    @property
    def windows(self) -> list[tuple[float, float]]:
        """When the program may fire, (begin, end) s: as long as first order is good for the dispersions."""
        return windows(self.chance.model)

    @property
    def probability(self) -> float:
        """Share of cases that must comply."""
        return required_share(self.plan.spacecraft.requirement)

    @cached_property
    def _curve(self) -> ChanceCurve:
        return ChanceCurve(self.chance.model, self.proof.tangents, self.proof.prices, self.margin)

    def primer(self, times: Vector) -> Vector:
        """q at ``times`` (n,) s of each channel of the program, (n, channels)."""
        return self._curve.at(times, times)


def certificate(plan: Plan) -> Certificate:
    """The certificate of a plan of optimal or of a robust one; raises BadRequest where there is none, with the reason.

    Of robust plans those have one that were made against the dispersions.
    """
    return _nominal(plan) if plan.margin is None else _sure(plan, plan.margin)


def _nominal(plan: Plan) -> NominalCertificate:
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
    return NominalCertificate(plan, problem, program, solution.burns, proof)


def _sure(plan: Plan, margin: float) -> SureCertificate:
    if plan.spacecraft.disturbances:
        raise BadRequest("the program of the robust plan does not know of the disturbances of the file")
    problem, chance = surest.program_of(plan)
    excess = chance.solve(margin).excess
    proof = prove(chance, margin) if excess <= HOPELESS else None
    if proof is None:
        passed = f"; the best found passes limits by {100.0 * excess:.3g} %" if excess > 0.0 else ""
        raise BadRequest(
            "the robust plan has no least cost to prove: by first order no firing was found that keeps the requirement "
            f"with its margin of {margin:.3g} σ{passed}"
        )
    program = chance.program
    fired = burns(program.channels, proof.columns, proof.on_times, 1.01 * program.width)
    return SureCertificate(plan, problem, program, fired, chance, proof, margin)
