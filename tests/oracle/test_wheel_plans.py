"""Plans of bodies with a wheel, end to end: what each scheme plans, flown by the reference integrator."""

import math
from typing import Any

import numpy as np
import pytest
from support import reference
from support.builders import events
from support.cases import spread

import nutdamp
from nutdamp.physics import attitude

THRUSTERS = [
    {"name": f"{sign}M{axis}", "torque": [int(f"{sign}2") * (axis == 1), int(f"{sign}2") * (axis == 2), 0]}
    for axis in (1, 2)
    for sign in "+-"
]

COMSAT: dict[str, Any] = {
    "name": "Comsat",
    "inertia": {"A": 300, "C": 200},
    "wheel": {"momentum": 60},
    "state": {"spin": 0, "nutation": "1 deg"},
    "attitude": {"quaternion": [1, 0, 0, 0]},
    "thrusters": THRUSTERS,
}

MOTIONS = [("0 rpm", 60), ("0 rpm", -60), ("3 rpm", 60), ("-3 rpm", 150), ("1 rpm", -90), ("20 rpm", 30)]
"""Spin, and momentum of the wheel in N m s: both senses, and H against the spin."""


def planned(scheme: str, **changes: Any) -> nutdamp.Plan:
    return nutdamp.plan(nutdamp.load({**COMSAT, **changes}), scheme)


def end_of(plan: nutdamp.Plan) -> tuple[float, np.ndarray]:
    """Nutation (rad) and H (N m s, inertial) at the end of the plan by the reference integrator."""
    body = plan.spacecraft
    wheel, moments = body.inertia.wheel, body.inertia.moments
    rotation = attitude.matrix(body.initial.quaternion)
    flown = reference.fly(
        moments, body.omega0, events(plan.pulses), plan.pulses.end, rotation, growth=body.growth, wheel=wheel
    )
    sense = math.copysign(1.0, moments[2] * body.spin + wheel)
    return reference.nutation(moments, flown.rates, sense, wheel), reference.momentum(moments, flown, wheel)


@spread(("scheme", "motion"), [(scheme, motion) for scheme in ("one-pulse", "two-pulse", "four-pulse", "optimal")
                               for motion in MOTIONS], quick=8)  # fmt: skip
def test_damping(scheme: str, motion: tuple[str, int]) -> None:
    """No nutation is left; schemes that keep H leave it where it was."""
    spin, wheel = motion
    required = {"nutation": "0.1 deg", "momentum_shift": "0.02 deg"}
    plan = planned(
        scheme, state={"spin": spin, "nutation": "1 deg"}, wheel={"momentum": wheel}, requirement=required,
        limits={"horizon": "1500 s"},
    )  # fmt: skip
    nutation, momentum = end_of(plan)
    assert nutation == pytest.approx(plan.flight.residual.nutation, abs=1e-9)
    assert nutation < math.radians(0.01)
    shift = reference.angle(momentum, plan.spacecraft.momentum)
    assert shift == pytest.approx(plan.flight.residual.momentum_shift, abs=1e-9)
    if scheme in ("two-pulse", "optimal"):
        assert shift < math.radians(0.02)
    else:
        # A|ω0| is the least impulse but for the nutation that may be left.
        floor = plan.spacecraft.inertia.A * plan.spacecraft.transverse_rate
        assert plan.pulses.total_impulse >= 0.99 * floor


@spread(("scheme", "motion"), [(scheme, motion) for scheme in ("two-pulse", "half-cone", "rhumb-line", "optimal")
                               for motion in MOTIONS[2:5]] + [("optimal", motion) for motion in MOTIONS[:2]],
        quick=5)  # fmt: skip
def test_turns_to_a_target(scheme: str, motion: tuple[str, int]) -> None:
    """The axis ends on the target, also where the thrusters stand still in space."""
    spin, wheel = motion
    turn: dict[str, Any] = {
        "state": {"spin": spin, "nutation": 0},
        "wheel": {"momentum": wheel},
        "goal": {"tilt": "4 deg", "azimuth": "50 deg"},
        "limits": {"horizon": "1500 s"},
    }
    plan = planned(scheme, **turn)
    nutation, momentum = end_of(plan)
    assert nutation < math.radians(0.05)
    assert reference.angle(momentum, plan.spacecraft.target_axis) < math.radians(0.05)


@spread("horizon", ["60 s", "150 s", "300 s", "628 s"], quick=2)
def test_thrusters_that_stand_still_in_space(horizon: str) -> None:
    """Two pulses push H along one line alone: what they miss beside it must be small, not nothing."""
    plan = planned(
        "optimal",
        dissipation={"time_constant": "2 hours", "nutation": "grows"},
        thrusters=[{**thruster, "min_on_time": "20 ms"} for thruster in THRUSTERS],
        requirement={"nutation": "0.05 deg", "momentum_shift": "0.1 deg"},
        limits={"horizon": horizon},
    )
    nutation, momentum = end_of(plan)
    assert nutation < math.radians(0.005)
    assert reference.angle(momentum, plan.spacecraft.momentum) < math.radians(0.005)
    assert plan.pulses.total_impulse < 1.02 * plan.spacecraft.least_impulse


def test_a_train_needs_a_body_that_spins() -> None:
    """Others reach the target without one."""
    aimed = {"goal": {"right_ascension": "50 deg", "declination": "86 deg"}, "limits": {"horizon": "100 s"}}
    assert not planned("rhumb-line", **aimed).feasible
    plan = planned("optimal", **aimed)
    nutation, momentum = end_of(plan)
    assert nutation < math.radians(0.005)
    assert reference.angle(momentum, plan.spacecraft.target_axis) < math.radians(0.005)


@pytest.mark.parametrize("scheme", ["one-pulse", "two-pulse", "four-pulse", "optimal"])
def test_three_moments_dissipation_and_a_spin_that_changes(scheme: str) -> None:
    """Of a platform that spins the other way than H."""
    changes: dict[str, Any] = {
        "inertia": {"tensor": [[300, 0, 0], [0, 330, 0], [0, 0, 200]]},
        "state": {"spin": "-1 rpm", "nutation": "2 deg"},
        "dissipation": {"time_constant": "2 hours", "nutation": "grows"},
        "thrusters": [{**thruster, "torque": [*thruster["torque"][:2], 0.1]} for thruster in THRUSTERS],
    }
    plan = planned(scheme, **changes)
    nutation, momentum = end_of(plan)
    residual = plan.flight.residual
    assert plan.flight.settled.spin != plan.spacecraft.spin
    # The largest of a nutation that swings between two angles is not that of one moment.
    assert nutation <= residual.nutation + 1e-9
    assert residual.nutation < math.radians(0.05)
    assert reference.angle(momentum, plan.spacecraft.momentum) == pytest.approx(residual.momentum_shift, abs=1e-9)
