"""Each numbered equation has a place in the code and a test; those without a test of their own are checked here."""

from __future__ import annotations

import cmath
import math
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from nutdamp import flight
from nutdamp.guide.equation import EQUATIONS, Equation
from nutdamp.physics import attitude, cones, damping, forced, inertia, rates, stability
from nutdamp.schedule import Pulse, Schedule
from nutdamp.schemes import SchemeOptions
from nutdamp.schemes.one_pulse import schedule as one_pulse
from nutdamp.spacecraft import Inertia, Spacecraft

TESTS = Path(__file__).parents[1]
BODIES = [(A, C, spin) for A, C in ((120.0, 80.0), (80.0, 120.0), (100.0, 100.0)) for spin in (3.0, -3.0)]


_FORCED = "unit/physics/test_forced.py::"
_HERE = "unit/test_equations.py::"
TESTED = {
    **dict.fromkeys(
        ("M(1)", "M(2)", "M(3)", "M(5)", "M(6)", "M(8)", "M(10)"), f"{_FORCED}test_stepwise_torques_8_9_10"
    ),
    "M(4)": f"{_HERE}test_inertia_ratio_4",
    "M(7)": f"{_HERE}test_one_impulse_7",
    "M(9)": f"{_FORCED}test_real_form_9_is_the_complex_one",
    "M(11)": f"{_FORCED}test_constant_torque_11_circles_the_centre_of_its_pole_cone",
    "M(12)": f"{_HERE}test_period_12",
    **dict.fromkeys(("M(13)", "M(14)"), f"{_FORCED}test_permanent_rotation_13_stays_and_has_the_euler_angles_14"),
    "M(15)": f"{_HERE}test_a_pulse_in_the_schedule_is_15",
    **dict.fromkeys(("M(16)", "M(17)"), f"{_HERE}test_impulse_sum_17"),
    **dict.fromkeys(("M(18)", "M(19)", "M(20)"), f"{_HERE}test_cones_18_19_20"),
    "M(21)": f"{_HERE}test_one_pulse_21",
    "M(22)": f"{_HERE}test_two_pulses_22",
    **dict.fromkeys(("M(23)", "M(24)"), f"{_FORCED}test_rotating_torques_23_24"),
    "M(25)": f"{_FORCED}test_resonance_25_without_cancellation",
    "M(26)": f"{_FORCED}test_26_opposite_rotation_and_its_straight_pole_curves",
    "M(27)": f"{_FORCED}test_27_nearly_space_fixed_torque_and_its_beat",
    **dict.fromkeys((f"K({number})" for number in range(5, 14)), f"{_HERE}test_free_motion_in_three_frames_k5_to_k13"),
    **dict.fromkeys(("K(14)", "K(15)"), f"{_HERE}test_precession_k14_k15"),
    "24.4": f"{_HERE}test_stability_24_4",
    "energy sink": "unit/physics/test_energy_sink.py::test_200_s_agree_with_dop853",
}
"""The test of each equation."""


def test_every_equation_of_magnus_1_to_27_and_kreisel_5_to_15_is_there_once() -> None:
    sources = [*(f"M({number})" for number in range(1, 28)), *(f"K({number})" for number in range(5, 16)), "24.4"]
    assert [one.number for one in EQUATIONS] == [*sources, "energy sink"]
    assert set(TESTED) == {one.number for one in EQUATIONS}


@pytest.mark.parametrize("equation", EQUATIONS, ids=lambda equation: str(equation.number))
def test_place_and_test_exist(equation: Equation) -> None:
    module, _, name = equation.place.rpartition(".")
    assert callable(getattr(import_module(module), name))
    path, _, function = TESTED[equation.number].partition("::")
    assert f"def {function}(" in (TESTS / path).read_text(encoding="utf-8")


def test_inertia_ratio_4() -> None:
    assert inertia.ratio(100.0, 10.0) == 0.9
    assert inertia.ratio(100.0, 200.0) == -1.0
    assert inertia.ratio(100.0, 100.0) == 0.0


@pytest.mark.parametrize(("A", "C", "spin"), BODIES)
def test_one_impulse_7(A: float, C: float, spin: float) -> None:
    """A body in pure spin that is kicked nutates with Δω e^{-iaα}."""
    got, _ = rates.impulse_sum(
        np.array([0.5, 1.0, 4.0]), 0.0, spin, A, C, np.array([1.0]), np.array([6.0 + 2.0j]), np.array([0.0])
    )
    a = (A - C) / A
    assert got[0] == 0.0
    assert got[1] == pytest.approx((6.0 + 2.0j) / A, rel=1e-14)
    assert got[2] == pytest.approx((6.0 + 2.0j) / A * cmath.exp(-1j * a * spin * 3.0), rel=1e-13)


def test_period_12() -> None:
    assert cones.body_period(100.0, 70.0, 3.0) == pytest.approx(2 * math.pi / (0.3 * 3.0), rel=1e-14)
    for A, C, spin in BODIES[:4]:
        period = cones.body_period(A, C, spin)
        a = (A - C) / A
        assert cmath.exp(-1j * a * spin * period) == pytest.approx(1.0, abs=1e-13)
    assert math.isinf(cones.body_period(100.0, 100.0, 3.0))


def integrated(
    moments: np.ndarray, state: np.ndarray, pulses: list[tuple[float, np.ndarray]], end: float
) -> np.ndarray:
    """Euler's equations and a rotation matrix by DOP853, with ideal impulses; the state (12,) at the end."""

    def slope(_: float, y: np.ndarray) -> np.ndarray:
        w, R = y[:3], y[3:].reshape(3, 3)
        W = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.concatenate([-(W @ (moments * w)) / moments, (R @ W).ravel()])

    now = 0.0
    for time, impulse in [*pulses, (end, np.zeros(3))]:
        if time > now:
            state = solve_ivp(slope, (now, time), state, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
            now = time
        state = state.copy()
        state[:3] += impulse / moments
    return np.asarray(state)


@pytest.mark.parametrize(("A", "C", "spin"), BODIES)
def test_impulse_sum_17(A: float, C: float, spin: float) -> None:
    """With axial impulses too, one of which reverses the spin."""
    moments = np.array([A, A, C])
    pulses = [(0.7, [5.0, -3.0, 0.0]), (2.0, [0.0, 9.0, -1.5 * C * spin]), (3.1, [-4.0, 1.0, 20.0])]
    start = np.concatenate([[0.2, 0.1, spin], np.eye(3).ravel()])
    end = integrated(moments, start, [(time, np.array(impulse)) for time, impulse in pulses], 6.0)
    times = np.array([time for time, _ in pulses])
    table = np.array([impulse for _, impulse in pulses])
    omega, spins = rates.impulse_sum(
        np.array([6.0]), 0.2 + 0.1j, spin, A, C, times, table[:, 0] + 1j * table[:, 1], table[:, 2]
    )
    assert omega[0] == pytest.approx(complex(end[0], end[1]), abs=1e-11)
    assert spins[0] == pytest.approx(end[2], abs=1e-11)


@pytest.mark.parametrize(("A", "C", "spin"), BODIES)
def test_cones_18_19_20(A: float, C: float, spin: float) -> None:
    """From vectors: θ between H and the spin axis, μ between ω and the spin axis, λ = θ - μ."""
    omega = 0.7
    body, momentum = np.array([omega, 0.0, spin]), np.array([A * omega, 0.0, C * spin])
    axis = np.array([0.0, 0.0, math.copysign(1.0, spin)])

    def between(u: np.ndarray, v: np.ndarray) -> float:
        return math.acos(float(u @ v) / float(np.linalg.norm(u) * np.linalg.norm(v)))

    theta, mu = between(momentum, axis), between(body, axis)
    assert cones.nutation_angle(A, C, omega, spin) == pytest.approx(theta, rel=1e-12)
    assert cones.body_cone(omega, spin) == pytest.approx(mu, rel=1e-12)
    assert cones.space_cone(A, C, omega, spin) == pytest.approx(theta - mu, abs=1e-14)
    assert abs(cones.space_cone(A, C, omega, spin)) == pytest.approx(between(momentum, body), abs=2e-8)
    # The print: minus in the denominator.
    printed = math.atan((A - C) * omega * abs(spin) / (C * spin**2 - A * omega**2))
    if A != C:
        assert abs(printed - (theta - mu)) > 1e-3


def test_one_pulse_21() -> None:
    for A, C, spin in BODIES:
        body = Spacecraft("x", Inertia((A, A, C)), np.array([0.3, -0.4, spin]))
        made = one_pulse(body, SchemeOptions())
        assert made.total_impulse == pytest.approx(A * 0.5, rel=1e-14)
        left = flight.by_impulses(body, made).residual
        assert left.nutation < 1e-14
        assert left.momentum_shift == pytest.approx(body.nutation, rel=1e-12)


@pytest.mark.parametrize(("angle", "displaced"), [(2.0, 0.0016), (10.0, 0.19), (30.0, 5.1)])
def test_two_pulses_22(angle: float, displaced: float) -> None:
    """As printed H is left displaced, exactly it is not; flown by DOP853."""
    A, C, spin = 120.0, 80.0, 3.0
    omega = cones.transverse_rate(A, C, math.radians(angle), spin)
    moments = np.array([A, A, C])
    a = (A - C) / A
    for form, expected in ((damping.half_pulses_as_printed, displaced), (damping.half_pulses, 0.0)):
        first, second, wait = form(A, C, omega, spin)
        turn = cmath.exp(-1j * a * spin * wait)
        pulses = [(0.0, np.array([-first, 0.0, 0.0])), (wait, -second * np.array([turn.real, turn.imag, 0.0]))]
        end = integrated(moments, np.concatenate([[omega, 0.0, spin], np.eye(3).ravel()]), pulses, wait)
        assert np.hypot(end[0], end[1]) < 1e-12
        before = moments * (omega, 0.0, spin)
        after = end[3:].reshape(3, 3) @ (moments * end[:3])
        shift = math.degrees(float(attitude.angle_between(before, after)))
        assert shift == pytest.approx(expected, rel=0.03, abs=1e-9)


@pytest.mark.parametrize(("A", "C", "spin"), BODIES)
def test_free_motion_in_three_frames_k5_to_k13(A: float, C: float, spin: float) -> None:
    """Rates of turn of ω in the body, in the despun frame and of the axis about H, from a free flight."""
    body = Spacecraft("x", Inertia((A, A, C)), np.array([0.2, 0.1, spin]))
    moments = np.array([A, A, C])
    step = 0.01
    start = np.concatenate([body.omega0, attitude.matrix(body.initial.quaternion).ravel()])
    end = integrated(moments, start, [], step)
    found = stability.nutation_rates(A, C, abs(0.2 + 0.1j), spin)
    turned = cmath.phase(complex(end[0], end[1]) / (0.2 + 0.1j))
    assert turned / step == pytest.approx(found.body, abs=1e-10)
    # The despun frame turns back by the spin against the body.
    assert (turned + spin * step) / step == pytest.approx(found.despun, abs=1e-10)
    axes = [attitude.matrix(body.initial.quaternion)[:, 2], end[3:].reshape(3, 3)[:, 2]]
    round_h = cmath.phase(complex(axes[1][0], axes[1][1]) / complex(axes[0][0], axes[0][1]))
    assert round_h / step == pytest.approx(found.inertial, abs=1e-9)


def test_precession_k14_k15() -> None:
    """Started at the steady rate, ω stands still in its frame; flown by DOP853 with the torque of that frame."""
    A, C, spin, torque = 120.0, 80.0, 3.0, 4.0 - 2.0j
    for rate, omega in (
        (0.0, forced.steady_response(A, C, spin, torque)),
        (-spin, forced.steady_response(A, C, spin, torque, -spin)),
    ):

        def slope(t: float, y: np.ndarray, rate: float = rate) -> list[float]:
            M = torque * cmath.exp(1j * rate * t)
            return [((A - C) * y[1] * spin + M.real) / A, (-(A - C) * spin * y[0] + M.imag) / A]

        done = solve_ivp(slope, (0, 5.0), [omega.real, omega.imag], method="DOP853", rtol=1e-13, atol=1e-15)
        end = complex(*done.y[:, -1]) * cmath.exp(-1j * rate * 5.0)
        assert end == pytest.approx(omega, abs=1e-12)


def test_stability_24_4() -> None:
    """2, 3, 4 kg m² about the middle axis grows at 0.5303/s for 1.5 rad/s, as an integration shows."""
    found = stability.growth((2.0, 4.0, 3.0), 1.5)
    assert not found.stable
    assert 1 / found.growth_time == pytest.approx(0.5303, abs=5e-5)
    moments = np.array([2.0, 4.0, 3.0])
    small = np.concatenate([[1e-9, 0.0, 1.5], np.eye(3).ravel()])
    early, late = (np.linalg.norm(integrated(moments, small, [], end)[:2]) for end in (12.0, 16.0))
    assert math.log(late / early) / 4.0 == pytest.approx(1 / found.growth_time, rel=1e-4)


def test_a_pulse_in_the_schedule_is_15() -> None:
    """M(t) = Σ M_v δ(t - t_v): an ideal impulse changes ω by M_v/A at t_v and nothing else."""
    body = Spacecraft("x", Inertia((120.0, 120.0, 80.0)), np.array([0.2, 0.1, 3.0]))
    made = Schedule((Pulse(1.0, 0.0, "x", np.array([6.0, 0.0, 0.0])),))
    before, after = flight.flown(body, made).around_pulses()
    assert after.rates[0] - before.rates[0] == pytest.approx([0.05, 0.0, 0.0], abs=1e-15)
    assert after.quaternion[0] == pytest.approx(before.quaternion[0], abs=1e-15)
