"""What a flight is charged for."""

import numpy as np
import pytest
from support.builders import spinner

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.flight.dynamics import STEP, make_dynamics


def test_a_motion_that_is_refused_is_charged_for_the_steps_it_took() -> None:
    """At 89.999 deg of nutation half-cone flew one such after the other, without an end."""
    spacecraft = spinner(degrees=80.0)
    torque = 20.0 * spacecraft.inertia.A
    with work.budget("a flight", 1e6) as spent, pytest.raises(Infeasible, match="too many steps"):
        make_dynamics(spacecraft).path(
            spacecraft.initial, 0.0, 100.0, [np.array([torque, 0.0, 0.0])], most=50
        )
    assert spent.done >= 50 * STEP
