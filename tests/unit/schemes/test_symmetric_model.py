"""Planning real bodies: I1 ≠ I2, dissipation and disturbances are planned for, trimmed, and reported."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from nutdamp import flight
from nutdamp.files.examples import example_text
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.physics import forced
from nutdamp.planning import Plan, plan
from nutdamp.remarks import infeasibility, remarks
from nutdamp.schemes import CLASSIC, Options
from nutdamp.schemes.tools.symmetric_model import model_of, steady_omega
from nutdamp.spacecraft import Disturbance, Inertia, Limits, Spacecraft, Steerable

EXAMPLE = read_spacecraft(example_text(), "example.yaml")
DISTURBED = Options(with_disturbances=True)
NEARLY_NOTHING = math.radians(1e-7)


def body(moments: tuple[float, float, float], *, steerable: bool = False) -> Spacecraft:
    if steerable:
        return replace(EXAMPLE, inertia=Inertia(moments), channels=(), steerable=Steerable(20.0, 220.0, 1.0))
    return replace(EXAMPLE, inertia=Inertia(moments))


def left(one: Plan) -> float:
    assert one.flown is not None, infeasibility(one)
    return one.flown.nutation


def test_the_model_of_a_symmetric_body_is_the_body() -> None:
    model = model_of(EXAMPLE)
    assert model.body is EXAMPLE
    assert model.exact


def test_the_model_turns_at_the_true_nutation_rate() -> None:
    """0.775 rad/s for 120, 100, 80 kg m² and 3 rad/s, which the mean (0.818) misses."""
    spacecraft = replace(body((120.0, 100.0, 80.0)), omega0=np.array([0.1, 0.05, 3.0]))
    model = model_of(spacecraft).body
    assert model.inertia.a * 3.0 == pytest.approx(0.775, abs=5e-4)
    assert spacecraft.inertia.a * 3.0 == pytest.approx(0.818, abs=5e-4)


@pytest.mark.parametrize("moments", [(123.0, 117.0, 80.0), (80.0, 84.0, 120.0), (120.0, 100.0, 80.0)])
@pytest.mark.parametrize("scheme", ["one-pulse", "two-pulse"])
@pytest.mark.parametrize("steerable", [False, True], ids=["fixed", "steerable"])
def test_unequal_moments_are_trimmed_away(moments: tuple[float, float, float], scheme: str, steerable: bool) -> None:
    spacecraft = body(moments, steerable=steerable)
    made = plan(spacecraft, scheme)
    assert left(made) < NEARLY_NOTHING
    if scheme == "two-pulse":
        assert made.flown is not None
        assert made.flown.momentum_shift < NEARLY_NOTHING


def test_a_plan_says_how_much_is_due_to_unequal_moments() -> None:
    """Ticks leave some nutation too, so that the three angles of the remark differ."""
    made = plan(replace(body((123.0, 117.0, 80.0)), limits=Limits(tick=0.05)), "four-pulse")
    (said,) = [remark for remark in remarks(made) if "I1 ≠ I2" in remark]
    symmetric = replace(made.spacecraft, inertia=Inertia((120.0, 120.0, 80.0)))
    without = flight.flown(symmetric, made.pulses).residual.nutation
    share, flown, even = (f"{math.degrees(angle):.3g}°" for angle in (abs(left(made) - without), left(made), without))
    assert len({share, flown, even}) == 3
    assert said == (
        f"I1 ≠ I2 by 5 % changes what these pulses leave by {share}: "
        f"{flown} of nutation, {even} if both were their mean"
    )


@pytest.mark.parametrize("moments", [(120.0, 120.0, 80.0), (80.0, 80.0, 120.0)])
def test_dissipation_is_planned_for(moments: tuple[float, float, float]) -> None:
    spacecraft = replace(body(moments, steerable=True), dissipation=120.0)
    for scheme in ("one-pulse", "two-pulse"):
        assert left(plan(spacecraft, scheme)) < NEARLY_NOTHING


def test_a_train_fires_once_more_where_the_nutation_grows() -> None:
    growing = replace(EXAMPLE, dissipation=60.0)
    assert len(plan(growing, "one-pulse").pulses) > len(plan(EXAMPLE, "one-pulse").pulses)
    assert left(plan(growing, "one-pulse")) < NEARLY_NOTHING


@pytest.mark.parametrize(
    "disturbance",
    [Disturbance(0.3 + 0.1j), Disturbance(0.2j, rate=-EXAMPLE.spin), Disturbance(0.05 + 0j, rate=2.0)],
    ids=["constant", "space-fixed", "turning"],
)
@pytest.mark.parametrize("scheme", CLASSIC)
def test_with_disturbances_only_their_steady_tilt_is_left(disturbance: Disturbance, scheme: str) -> None:
    spacecraft = replace(EXAMPLE, disturbances=(disturbance,))
    made = plan(spacecraft, scheme, DISTURBED)
    tilt = spacecraft.inertia.A * abs(steady_omega(spacecraft, 0.0)) / (spacecraft.inertia.C * spacecraft.spin)
    assert left(made) == pytest.approx(math.atan(tilt), rel=2e-3, abs=1e-9)
    assert any("steady tilt" in remark for remark in remarks(made))


@pytest.mark.parametrize("scheme", CLASSIC)
def test_an_axial_disturbance_is_planned_for(scheme: str) -> None:
    spacecraft = replace(EXAMPLE, disturbances=(Disturbance(0j, axial=0.05),))
    assert left(plan(spacecraft, scheme, DISTURBED)) < NEARLY_NOTHING
    assert left(plan(spacecraft, scheme)) > 100 * NEARLY_NOTHING


def test_a_resonant_disturbance_has_no_steady_tilt_and_is_fought() -> None:
    nutation_rate = EXAMPLE.inertia.a * EXAMPLE.spin
    spacecraft = replace(EXAMPLE, disturbances=(Disturbance(0.1 + 0j, rate=-nutation_rate),))
    assert steady_omega(spacecraft, 0.0) == 0.0
    for scheme in ("one-pulse", "two-pulse"):
        assert left(plan(spacecraft, scheme, DISTURBED)) < NEARLY_NOTHING
        assert left(plan(spacecraft, scheme)) > math.radians(0.02)


def test_plans_stay_nominal_unless_requested() -> None:
    spacecraft = replace(EXAMPLE, disturbances=(Disturbance(0.3 + 0.1j),))
    for scheme in CLASSIC:
        reported, nominal = plan(spacecraft, scheme), plan(EXAMPLE, scheme)
        assert [pulse.t for pulse in reported.pulses] == [pulse.t for pulse in nominal.pulses]
        assert any("--with-disturbances" in remark for remark in remarks(reported))


def test_steady_omega_is_the_forced_term() -> None:
    spacecraft = replace(EXAMPLE, disturbances=(Disturbance(0.3 + 0.1j, rate=2.0),))
    inertia = spacecraft.inertia
    times = np.linspace(0.0, 5.0, 7)
    start = steady_omega(spacecraft, 0.0)
    moved = forced.rotating_torques(
        times, start, spacecraft.spin, inertia.A, inertia.C, np.array([0.3 + 0.1j]), np.array([2.0])
    )
    assert moved == pytest.approx(np.array([steady_omega(spacecraft, time) for time in times]), rel=1e-12)


@pytest.mark.parametrize(("beats", "settles"), [(0.9, False), (1.1, True)])
def test_a_disturbance_that_beats_within_the_horizon_has_a_steady_response(beats: float, settles: bool) -> None:
    detuning = 2.0 * math.pi * beats / EXAMPLE.horizon
    disturbance = Disturbance(0.1 + 0j, rate=detuning - EXAMPLE.inertia.a * EXAMPLE.spin)
    assert (steady_omega(replace(EXAMPLE, disturbances=(disturbance,)), 0.0) != 0.0) is settles
