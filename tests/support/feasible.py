"""Plans that must be feasible and keep the limits, and what they leave."""

from __future__ import annotations

from support.checker import violations

from nutdamp import flight, planning
from nutdamp.remarks import infeasibility
from nutdamp.schemes import Options
from nutdamp.spacecraft import Spacecraft


def feasible_by(scheme: str, spacecraft: Spacecraft, options: Options | None = None) -> planning.Plan:
    plan = planning.plan(spacecraft, scheme, options)
    assert plan.feasible, infeasibility(plan)
    assert violations(spacecraft, plan.pulses) == []
    return plan


def left(plan: planning.Plan) -> flight.Residual:
    assert plan.flown is not None
    return plan.flown
