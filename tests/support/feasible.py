"""Plans that must be feasible and keep the limits, and what they leave."""

from support.checker import violations

from nutdamp.flight import propagation
from nutdamp.planning import plan as planning
from nutdamp.planning.notes import infeasibility
from nutdamp.schemes.catalogue import Options
from nutdamp.spacecraft.model import Spacecraft


def feasible_by(
    scheme: str, spacecraft: Spacecraft, options: Options | None = None
) -> planning.Plan:
    plan = planning.plan(spacecraft, scheme, options)
    assert plan.feasible, infeasibility(plan)
    assert violations(spacecraft, plan.pulses) == []
    return plan


def left(plan: planning.Plan) -> propagation.Residual:
    assert plan.flown is not None
    return plan.flown
