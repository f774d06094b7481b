"""Two pulses to a target axis: exact from any motion, the free numbers for least impulse, never below the floor."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support import reference
from support.builders import Outcome, aimed, channel, cross, events, fan, off_target, spinner
from support.cases import spread
from support.checker import violations
from support.places import case

from nutdamp import flight, planning
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.physics import pointing
from nutdamp.remarks import infeasibility
from nutdamp.schemes import Options
from nutdamp.schemes.tools.symmetric_model import model_of
from nutdamp.spacecraft import Attitude, Limits, Spacecraft, Steerable

BODIES = [(120.0, 80.0), (80.0, 120.0), (100.0, 100.0), (60.0, 119.0)]
TARGETS = [(1.0, 10.0), (10.0, 45.0), (60.0, -120.0), (120.0, 200.0)]


def acquired(spacecraft: Spacecraft) -> planning.Plan:
    plan = planning.plan(spacecraft, "two-pulse")
    assert plan.feasible, infeasibility(plan)
    assert violations(spacecraft, plan.pulses) == []
    assert len(plan.pulses) <= 2
    return plan


def floor(spacecraft: Spacecraft) -> float:
    return max(spacecraft.least_impulse, spacecraft.turning_impulse)


# --- steerable -------------------------------------------------------------------------------------------------------


@spread("spin", [3.0, -3.0], quick=1)
@spread(("A", "C"), BODIES, quick=1)
@spread(("tilt", "azimuth"), TARGETS, quick=12)
def test_any_axis_from_any_nutation_by_the_reference_integrator(
    tilt: float, azimuth: float, A: float, C: float, spin: float
) -> None:
    for degrees in (0.0, 5.0, 60.0):
        spacecraft = aimed(spinner(A, C, spin, degrees), tilt, azimuth)
        made = acquired(spacecraft).pulses
        assert Outcome(spacecraft, made).nutation < 1e-9
        assert off_target(spacecraft, made) < 1e-9


@spread("degrees", [0.0, 1.0, 5.0, 20.0, 40.0, 60.0], quick=1)
@spread("tilt", [0.5, 1.0, 5.0, 20.0, 60.0, 120.0], quick=12)
def test_cost_is_never_below_the_floor(tilt: float, degrees: float) -> None:
    for azimuth in (0.0, 45.0, 180.0, -100.0):
        spacecraft = aimed(spinner(degrees=degrees), tilt, azimuth)
        assert acquired(spacecraft).pulses.total_impulse >= floor(spacecraft) * (1 - 1e-12)


@pytest.mark.parametrize("degrees", [1.0, 10.0, 45.0])
@pytest.mark.parametrize(("A", "C"), BODIES)
def test_back_to_h_is_the_damping_without_drift(A: float, C: float, degrees: float) -> None:
    """A target along H: half the nutation, half a turn, A|ω0| in all."""
    spacecraft = aimed(spinner(A, C, degrees=degrees), 0.0, 0.0)
    plain = planning.plan(spinner(A, C, degrees=degrees), "two-pulse").pulses
    made = acquired(spacecraft).pulses
    assert made.total_impulse == pytest.approx(spacecraft.least_impulse, rel=1e-12)
    assert made.pulses[1].t - made.pulses[0].t == pytest.approx(plain.pulses[1].t - plain.pulses[0].t, rel=1e-12)
    assert [one.magnitude for one in made] == pytest.approx([one.magnitude for one in plain], rel=1e-9)


@pytest.mark.parametrize("tilt", [0.1, 10.0, 90.0, 150.0])
def test_from_a_pure_spin_it_is_a_half_cone(tilt: float) -> None:
    """2C|ω3| tan(β/2), at the start and half an inertial turn later."""
    spacecraft = aimed(spinner(degrees=0.0), tilt, 30.0)
    made = acquired(spacecraft).pulses
    half = math.radians(0.5 * tilt)
    assert made.total_impulse == pytest.approx(2 * 80.0 * 3.0 * math.tan(half), rel=1e-12)
    assert made.pulses[0].t == 0.0
    assert made.pulses[1].t == pytest.approx(math.pi * 120.0 * math.cos(half) / (80.0 * 3.0), rel=1e-12)


@pytest.mark.parametrize(("degrees", "tilt", "azimuth"), [(5.0, 10.0, 45.0), (20.0, 60.0, 200.0), (40.0, 15.0, -90.0)])
def test_both_free_numbers_are_the_best_on_a_grid(degrees: float, tilt: float, azimuth: float) -> None:
    """Start anywhere on the cone, H anywhere on the line of equal distance: written out here once more."""
    spacecraft = aimed(spinner(degrees=degrees), tilt, azimuth)
    h, target, momentum = 80.0 * 3.0, spacecraft.target_axis, spacecraft.momentum
    pole = momentum / np.linalg.norm(momentum)
    theta, best = math.radians(degrees), math.inf
    east = np.array([0.0, 1.0, 0.0])
    for phase in np.linspace(0.0, 2 * math.pi, 721):
        spin_axis = math.cos(theta) * pole + math.sin(theta) * (
            math.cos(phase) * np.cross(east, pole) + math.sin(phase) * east
        )
        line = np.cross(spin_axis, target)
        foot = np.linalg.lstsq(np.vstack([spin_axis, target]), np.array([h, h]), rcond=None)[0]
        places = np.linspace(-2.0, 2.0, 801)[:, None] * h * line / np.linalg.norm(line) + foot
        cost = np.linalg.norm(places - momentum, axis=1) + np.linalg.norm(places - h * target, axis=1)
        best = min(best, float(cost.min()))
    found = acquired(spacecraft).pulses.total_impulse
    assert found <= best * (1 + 1e-12)
    assert found >= best * (1 - 1e-4)  # the grid comes near


def test_within_a_short_horizon_h_goes_beside_its_shortest_way_for_as_little_as_it_saves() -> None:
    """By the shortest way at each start the two pulses would take 83.0204 N m s, 0.025 % more than the best found."""
    body = spinner(120.0, 60.0, 3.0, 19.544470631881207, steerable=Steerable(), limits=Limits(horizon=3.0))
    made = acquired(aimed(body, 25.385197892189165, 249.70422049304946)).pulses
    assert made.end == pytest.approx(3.0, abs=1e-8)
    assert made.total_impulse < 83.001


@pytest.mark.parametrize("torque", [500.0, 80.0])
@pytest.mark.parametrize(("A", "C"), BODIES[:3])
@pytest.mark.parametrize("degrees", [0.0, 5.0])
def test_real_widths_are_trimmed(degrees: float, A: float, C: float, torque: float) -> None:
    spacecraft = aimed(spinner(A, C, degrees=degrees, steerable=Steerable(torque)), 8.0, 45.0)
    made = acquired(spacecraft).pulses
    assert Outcome(spacecraft, made).nutation < 1e-9
    assert off_target(spacecraft, made) < 1e-9
    assert made.total_impulse < 1.5 * floor(spacecraft)


def test_a_target_on_the_cone_of_the_spin_axis_itself() -> None:
    """One ideal pulse is enough when the axis comes by; a real one has two widths to trim."""
    ideal, real = (aimed(spinner(degrees=5.0, steerable=one), 5.0, 90.0) for one in (Steerable(), Steerable(100.0)))
    assert acquired(ideal).pulses.total_impulse == pytest.approx(ideal.least_impulse, rel=1e-9)
    made = acquired(real).pulses
    assert Outcome(real, made).nutation < 1e-9
    assert off_target(real, made) < 1e-9


def test_too_weak_a_torque_says_what_one_pulse_can_do() -> None:
    plan = planning.plan(aimed(spinner(degrees=0.0, steerable=Steerable(10.0)), 40.0, 0.0), "two-pulse")
    assert f"turns H by {math.degrees(math.atan(2.0 * 10.0 / 3.0 / 240.0)):.4g} deg at most (2M/|ω3|" in infeasibility(
        plan
    )
    assert "20 deg are needed at once" in infeasibility(plan)
    assert "rhumb-line" in infeasibility(plan)


@pytest.mark.parametrize(
    "limits",
    [
        Limits(earliest=3.3),
        Limits(blackout=((0.0, 2.0), (3.0, 5.5))),
        Limits(gap=4.0),
        Limits(blackout=tuple((0.9 * n + 0.2, 0.9 * n + 0.9) for n in range(100))),
        Limits(horizon=2.2),
    ],
    ids=["earliest", "blackout", "gap", "narrow gates", "short horizon"],
)
def test_limits_are_kept_and_the_end_stays_exact(limits: Limits) -> None:
    spacecraft = aimed(spinner(degrees=5.0, limits=limits), 10.0, 45.0)
    made = acquired(spacecraft).pulses
    assert Outcome(spacecraft, made).nutation < 1e-9
    assert off_target(spacecraft, made) < 1e-9


def test_ticks_leave_no_more_than_their_resolution() -> None:
    spacecraft = aimed(spinner(degrees=5.0, steerable=Steerable(200.0), limits=Limits(tick=1e-3)), 10.0, 45.0)
    left = acquired(spacecraft).flown
    assert left is not None
    assert max(left.nutation, left.axis_error) < 2 * 3.0 * 1e-3 * math.radians(15.0) + 200.0 * 1e-3 / (80.0 * 3.0)


# --- body-fixed ------------------------------------------------------------------------------------------------------


@spread("spin", [3.0, -3.0], quick=1)
@spread(("A", "C"), BODIES[:2], quick=1)
@spread(("degrees", "tilt", "azimuth"), [(0.0, 5.0, 70.0), (5.0, 10.0, 45.0), (20.0, 40.0, -120.0)], quick=1)
def test_body_fixed_channels_are_exact(
    degrees: float, tilt: float, azimuth: float, A: float, C: float, spin: float
) -> None:
    for channels in (cross(500.0), fan(3, 800.0)):
        spacecraft = aimed(spinner(A, C, spin, degrees, channels=channels), tilt, azimuth)
        made = acquired(spacecraft).pulses
        left = flight.flown(spacecraft, made).residual
        assert max(left.nutation, left.axis_error) < 1e-10
        assert made.total_impulse < 1.3 * floor(spacecraft)
    assert Outcome(spacecraft, made).nutation < 1e-9
    assert off_target(spacecraft, made) < 1e-9


def test_a_target_on_the_cone_with_body_fixed_channels() -> None:
    spacecraft = aimed(spinner(degrees=5.0, channels=cross(500.0)), 5.0, 0.0)
    left = acquired(spacecraft).flown
    assert left is not None
    assert max(left.nutation, left.axis_error) < 1e-9


def test_a_sphere_is_acquired_by_fixed_channels_too() -> None:
    """ω stands still in the body, but from a pure spin nothing has to be waited for."""
    spacecraft = aimed(spinner(100.0, 100.0, degrees=0.0, channels=cross(500.0)), 10.0, 45.0)
    left = acquired(spacecraft).flown
    assert left is not None
    assert max(left.nutation, left.axis_error) < 1e-10


@pytest.mark.parametrize("tilt", [0.0, 0.5])
def test_wide_pulses_of_weak_channels_damp_to_a_target_nearby(tilt: float) -> None:
    """8 N m take 5° of nutation out within half a body period; they turn H by next to nothing meanwhile."""
    spacecraft = aimed(spinner(degrees=5.0, channels=cross(8.0)), tilt, 45.0)
    made = acquired(spacecraft).pulses
    assert Outcome(spacecraft, made).nutation < 1e-9
    assert off_target(spacecraft, made) < 1e-9


@pytest.mark.parametrize(
    ("channels", "words"),
    [
        ((channel("+1", 1.0, 0.0, 0.0),), "one pulse turns H by"),
        (cross(500.0, max_on_time=0.002), "one pulse turns H by"),
        ((channel("spin", 1.0, 0.0, 5.0),), "no channel has a torque more transverse than axial"),
    ],
)
def test_why_not(channels: tuple[object, ...], words: str) -> None:
    spacecraft = aimed(spinner(degrees=0.0, channels=channels), 10.0, 45.0)  # type: ignore[arg-type]
    plan = planning.plan(spacecraft, "two-pulse")
    assert words in infeasibility(plan)


# --- bodies that are not as planned ----------------------------------------------------------------------------------


@pytest.mark.parametrize("moments", [(120.0, 110.0, 80.0), (80.0, 85.0, 120.0)], ids=["prolate", "oblate"])
@pytest.mark.parametrize("actuators", ["torquer", "channels"])
def test_three_different_moments(moments: tuple[float, float, float], actuators: str) -> None:
    requested = {"steerable": Steerable(500.0)} if actuators == "torquer" else {"channels": cross(500.0)}
    spacecraft = aimed(spinner(moments=moments, degrees=4.0, **requested), 6.0, 45.0)
    made = acquired(spacecraft).pulses
    assert Outcome(spacecraft, made).nutation < 1e-8
    assert off_target(spacecraft, made) < 1e-8


def test_the_model_of_three_moments_has_the_turn_that_the_body_has() -> None:
    spacecraft = aimed(spinner(moments=(120.0, 100.0, 80.0), degrees=5.0), 10.0, 45.0)
    body = model_of(spacecraft).body
    assert body.to_turn == pytest.approx(spacecraft.to_turn, rel=1e-12)
    shift, truth = (one.target_axis - one.momentum / np.linalg.norm(one.momentum) for one in (body, spacecraft))
    assert reference.angle(shift, truth) < 0.05
    assert body.initial.quaternion == pytest.approx(spacecraft.initial.quaternion, abs=1e-12)


def test_a_target_by_right_ascension_in_a_given_attitude() -> None:
    """The same body seen from another frame: the same pulses."""
    plain = aimed(spinner(degrees=5.0), 10.0, 45.0)
    turned = replace(plain, attitude=Attitude(np.array([0.5, 0.5, -0.5, 0.5])))
    turned = replace(turned, goal=replace(plain.goal, axis=turned.direction_in_n(math.radians(10), math.radians(45))))
    for one, other in zip(acquired(plain).pulses, acquired(turned).pulses, strict=True):
        assert other.t == pytest.approx(one.t, abs=1e-6)
        assert other.impulse == pytest.approx(one.impulse, abs=1e-4)


def test_literal_leaves_the_target_alone() -> None:
    spacecraft = aimed(spinner(degrees=5.0), 10.0, 45.0)
    plan = planning.plan(spacecraft, "two-pulse", Options(literal=True))
    assert plan.flown is not None
    assert plan.flown.axis_error == pytest.approx(math.radians(10.0), abs=1e-2)


# --- the geometry ----------------------------------------------------------------------------------------------------


def test_arc_efficiency_is_the_mean_of_the_turning_torque() -> None:
    spin, on_time = 3.0, 0.6
    times = (np.arange(200_000) + 0.5) / 200_000 * on_time
    mean = abs(np.exp(1j * spin * times).mean())
    assert pointing.arc_efficiency(spin, on_time) == pytest.approx(mean, rel=1e-9)
    assert pointing.arc_efficiency(0.0, on_time) == 1.0


def test_on_time_to_turn_is_its_inverse() -> None:
    on_time = 0.6
    turned = 40.0 * on_time * pointing.arc_efficiency(3.0, on_time)
    assert pointing.on_times_to_turn(np.array([turned, 100.0]), 40.0, -3.0)[0] == pytest.approx(on_time, rel=1e-12)
    assert np.isnan(pointing.on_times_to_turn(np.array([100.0]), 40.0, 3.0)[0])


@pytest.mark.parametrize(
    ("name", "quarters"),
    [("crash-target-is-spin-axis.yaml", 0.0), ("crash-tilt-equals-nutation.yaml", 1.0)],
)
@pytest.mark.parametrize("scheme", ["two-pulse", "half-cone", "rhumb-line"])
def test_a_target_that_the_spin_axis_meets_by_itself_takes_one_impulse_when_it_is_there(
    name: str, quarters: float, scheme: str
) -> None:
    """Where the spin axis is at t = 0, or on its way about H a quarter turn later: damped then and there, at A|ω0|."""
    body = read_spacecraft(case(name).read_text(encoding="utf-8"), name)
    plan = planning.plan(body, scheme)
    (pulse,) = plan.pulses
    moments = np.asarray(body.inertia.moments)
    round_h = 2.0 * math.pi * moments[0] / float(np.linalg.norm(moments * body.omega0))
    assert pulse.t == pytest.approx(0.25 * quarters * round_h, abs=1e-9)
    assert pulse.magnitude == pytest.approx(moments[0] * math.hypot(*body.omega0[:2]), rel=1e-9)
    rotation = reference.frame_n(body.inertia.moments, body.omega0)
    turned = reference.fly(body.inertia.moments, body.omega0, events(plan.pulses), plan.pulses.end + 1.0, rotation)
    tilt, azimuth = math.radians(5.0), 0.5 * math.pi * quarters
    target = np.array([math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)])
    assert reference.angle(turned.rotation[:, 2], target) < 1e-8
    assert reference.angle(reference.momentum(body.inertia.moments, turned), target) < 1e-8
    assert reference.nutation(body.inertia.moments, turned.rates, 1.0) < 1e-8
