"""Lasting torques, Magnus 1970 (8)-(14) and (23)-(27), against DOP853 on Euler's equations (1)."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp

from nutdamp.physics import forced

BODIES = [(120.0, 80.0), (80.0, 120.0), (100.0, 100.0), (100.0, 10.0), (100.0, 199.0)]
SPINS = [3.0, -3.0, 0.0]


def euler(
    A: float, C: float, omega0: complex, spin0: float, torque: Callable[[float], np.ndarray], times: list[float]
) -> tuple[np.ndarray, np.ndarray]:
    """ω and ω3 at ``times`` by Magnus (1), restarted at each time so that torques may jump there."""
    state, now = [omega0.real, omega0.imag, spin0], 0.0
    omegas, spins = [], []

    def slope(t: float, y: np.ndarray) -> list[float]:
        M = torque(t)
        return [((A - C) * y[1] * y[2] + M[0]) / A, (-(A - C) * y[2] * y[0] + M[1]) / A, M[2] / C]

    for time in times:
        if time > now:
            middle = 0.5 * (now + time)
            done = solve_ivp(slope, (now, time), state, method="DOP853", rtol=1e-13, atol=1e-14, max_step=0.2)
            assert done.success
            assert middle > now
            state, now = list(done.y[:, -1]), time
        omegas.append(complex(state[0], state[1]))
        spins.append(state[2])
    return np.array(omegas), np.array(spins)


@pytest.mark.parametrize(("A", "C"), BODIES)
@pytest.mark.parametrize("spin0", SPINS)
def test_stepwise_torques_8_9_10(A: float, C: float, spin0: float) -> None:
    rng = np.random.default_rng(8)
    edges = np.array([0.0, 1.0, 2.5, 4.0, 7.0])
    torques = rng.normal(size=(4, 3)) * (10, 10, 25)
    times = [0.0, 0.5, 1.0, 2.0, 2.5, 3.9, 4.0, 6.0, 7.0]

    def torque(t: float) -> np.ndarray:
        return np.asarray(torques[min(int(np.searchsorted(edges, t, side="right")) - 1, 3)])

    omega, spin = forced.stepwise_torque(np.array(times), 0.1 - 0.2j, spin0, A, C, edges, torques)
    expected, expected_spin = euler(A, C, 0.1 - 0.2j, spin0, torque, times)
    assert np.abs(omega - expected).max() < 1e-11
    assert np.abs(spin - expected_spin).max() < 1e-11


def test_real_form_9_is_the_complex_one() -> None:
    A, C, spin = 120.0, 80.0, 3.0
    rate = (A - C) / A * spin
    torque, omega0, t = (4.0, -7.0), (0.1, 0.2), 2.3
    one = quad(lambda s: (torque[0] * math.cos(rate * (t - s)) + torque[1] * math.sin(rate * (t - s))) / A, 0, t)[0]
    two = quad(lambda s: (torque[1] * math.cos(rate * (t - s)) - torque[0] * math.sin(rate * (t - s))) / A, 0, t)[0]
    omega1 = omega0[0] * math.cos(rate * t) + omega0[1] * math.sin(rate * t) + one
    omega2 = omega0[1] * math.cos(rate * t) - omega0[0] * math.sin(rate * t) + two
    got, _ = forced.stepwise_torque(
        np.array([t]), complex(*omega0), spin, A, C, np.array([0.0, t]), np.array([[*torque, 0.0]])
    )
    assert got[0] == pytest.approx(complex(omega1, omega2), abs=1e-14)


@given(
    slope=st.floats(-30, 30),
    bend=st.floats(-5, 5) | st.sampled_from([0.0, 1e-9, -1e-6, 1e-3]),
    length=st.floats(0.01, 15),
)
def test_phase_integral_by_quadrature(slope: float, bend: float, length: float) -> None:
    got = forced.phase_integral(np.array([slope]), np.array([bend]), np.array([length]))[0]
    edges = np.linspace(0.0, length, 400)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    half = 0.5 * (edges[1] - edges[0])
    s = (0.5 * (edges[1:] + edges[:-1]))[:, None] + half * nodes
    expected = half * np.sum(np.exp(1j * (slope + bend * s) * s) * weights)
    # The phase itself is only known to its rounding.
    size = abs(slope) * length + abs(bend) * length**2
    assert abs(got - expected) <= 1e-14 * length * (10 + size)


def test_constant_torque_11_circles_the_centre_of_its_pole_cone() -> None:
    A, C, spin, omega0, torque = 120.0, 80.0, 3.0, 0.05 + 0.1j, 5.0 - 2.0j
    centre = forced.steady_response(A, C, spin, torque)
    # Magnus' centre: ω1P = M2/((A-C)ω3), ω2P = -M1/((A-C)ω3)
    assert centre == pytest.approx(complex(torque.imag, -torque.real) / ((A - C) * spin), rel=1e-14)
    times = np.linspace(0.0, 12.0, 40)
    edges = np.array([0.0, 12.0])
    omega, _ = forced.stepwise_torque(times, omega0, spin, A, C, edges, np.array([[torque.real, torque.imag, 0.0]]))
    radius = math.hypot(omega0.real - centre.real, omega0.imag - centre.imag)
    assert np.abs(omega - centre) == pytest.approx(radius, rel=1e-12)
    rotating = forced.rotating_torques(times, omega0, spin, A, C, np.array([torque]), np.array([0.0]))
    assert np.abs(omega - rotating).max() < 1e-14


@pytest.mark.parametrize(("A", "C"), [(120.0, 80.0), (80.0, 120.0)])
@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_permanent_rotation_13_stays_and_has_the_euler_angles_14(A: float, C: float, spin: float) -> None:
    torque = 5.0 - 2.0j
    found = forced.permanent_rotation(A, C, spin, torque)
    moved, _ = euler(A, C, found.omega, spin, lambda _: np.array([5.0, -2.0, 0.0]), [7.0])
    assert abs(moved[0] - found.omega) < 1e-13
    assert math.tan(found.theta) == pytest.approx(abs(torque) / (abs(A - C) * spin * abs(spin)), rel=1e-13)
    components = (
        found.rate * math.sin(found.theta) * math.sin(found.phi),
        found.rate * math.sin(found.theta) * math.cos(found.phi),
        found.rate * math.cos(found.theta),
    )
    assert components == pytest.approx((found.omega.real, found.omega.imag, spin), rel=1e-13)
    # The torque lies along the line of nodes: tan φ0 = -M2/M1
    assert math.tan(found.phi) == pytest.approx(-torque.imag / torque.real, rel=1e-12)


@pytest.mark.parametrize(("A", "C"), BODIES)
@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_rotating_torques_23_24(A: float, C: float, spin: float) -> None:
    torques, rates = np.array([2.0 + 1.0j, -0.5j, 3.0]), np.array([0.4, -3.0, 7.0])

    def torque(t: float) -> np.ndarray:
        total = complex(np.sum(torques * np.exp(1j * rates * t)))
        return np.array([total.real, total.imag, 0.0])

    times = [0.0, 1.0, 5.0, 11.0]
    got = forced.rotating_torques(np.array(times), 0.2 - 0.1j, spin, A, C, torques, rates)
    assert np.abs(got - euler(A, C, 0.2 - 0.1j, spin, torque, times)[0]).max() < 1e-11


def test_omega0_of_the_print_of_24_is_an_integration_constant() -> None:
    """With ω(0) given it is ω(0) + iΣ m_p/(a + b_p); read as ω(0) itself, (24) is wrong."""
    A, C, spin, t = 120.0, 80.0, 3.0, 2.0
    a, alpha, b = (A - C) / A, spin * t, 0.6
    m, start = (2.0 + 1.0j) / (A * spin), 0.2 - 0.1j
    got = forced.rotating_torques(np.array([t]), start, spin, A, C, np.array([m * A * spin]), np.array([b * spin]))[0]

    def printed(omega0: complex) -> complex:
        return omega0 * cmath.exp(-1j * a * alpha) - 1j * m / (a + b) * cmath.exp(1j * b * alpha)

    assert got == pytest.approx(printed(start + 1j * m / (a + b)), abs=1e-14)
    assert abs(got - printed(start)) > 1e-3


@pytest.mark.parametrize("detuning", [0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3])
def test_resonance_25_without_cancellation(detuning: float) -> None:
    A, C, spin, start, torque = 120.0, 80.0, 3.0, 0.01 + 0.02j, 0.5 + 0.2j
    nutation = (A - C) / A * spin
    times = np.linspace(0.0, 60.0, 31)
    got = forced.rotating_torques(times, start, spin, A, C, np.array([torque]), np.array([-nutation + detuning]))
    resonant = (start + torque / A * times) * np.exp(-1j * nutation * times)
    # To first order the detuning turns what is added by δt/2.
    assert np.abs(got - resonant).max() <= abs(torque) / A * 60.0 * 0.5 * detuning * 60.0 + 1e-14


def test_26_opposite_rotation_and_its_straight_pole_curves() -> None:
    """b = +a: as printed with its own constant; pole curves are straight whenever |ω0| = |m0/2a|."""
    A, C, spin = 120.0, 80.0, 3.0
    a = (A - C) / A
    m0 = 0.05 + 0.02j
    alpha = np.linspace(0.0, 20.0, 60)
    for turn in (0.0, 1.0, 2.5):
        constant = abs(m0 / (2 * a)) * cmath.exp(1j * turn)  # the print's ω0
        start = constant - 1j * m0 / (2 * a)
        got = forced.rotating_torques(alpha / spin, start, spin, A, C, np.array([m0 * A * spin]), np.array([a * spin]))
        printed = (constant - 1j * m0 / (2 * a)) * np.cos(a * alpha) - 1j * (constant + 1j * m0 / (2 * a)) * np.sin(
            a * alpha
        )
        assert np.abs(got - printed).max() < 1e-14
        # Straight through the origin: all points lie along one direction.
        direction = got[np.argmax(np.abs(got))]
        assert np.abs((got * np.conj(direction)).imag).max() < 1e-14


def test_27_nearly_space_fixed_torque_and_its_beat() -> None:
    A, C, spin, torque = 100.0, 10.0, 3.0, 0.4
    steady = forced.steady_response(A, C, spin, torque, -spin)
    m0 = torque / (A * spin)
    assert steady == pytest.approx(1j * m0 * A / C, rel=1e-13)  # the forced term of (27)
    largest, period = forced.beat(A, C, spin, torque, -spin)
    times = np.linspace(0.0, period, 2001)
    omega = forced.rotating_torques(times, 0.0, spin, A, C, np.array([torque]), np.array([-spin]))
    assert np.abs(omega).max() == pytest.approx(largest, rel=1e-6)
    assert abs(omega[-1]) < 1e-12 * largest
    assert abs(omega[1000]) == pytest.approx(largest, rel=1e-12)


def test_the_resonant_torque_reaches_a_cone_when_it_says() -> None:
    A, C, spin, torque = 120.0, 80.0, 3.0, 0.5 + 0.2j
    for start in (0.0, 0.03 - 0.02j, -0.05 + 0.01j):
        expected = math.radians(4.0)
        time = forced.resonant_time(A, C, start, spin, torque, expected)
        nutation = (A - C) / A * spin
        omega = forced.rotating_torques(np.array([time]), start, spin, A, C, np.array([torque]), np.array([-nutation]))
        assert math.atan2(A * abs(omega[0]), C * spin) == pytest.approx(expected, rel=1e-12)
    assert forced.resonant_time(A, C, 1.0, spin, torque, 0.01) == 0.0


def test_a_sphere_and_a_resonance_have_no_steady_response() -> None:
    assert math.isinf(abs(forced.steady_response(100.0, 100.0, 3.0, 1.0)))
    assert forced.beat(100.0, 100.0, 3.0, 1.0, 0.0) == (math.inf, math.inf)
    assert forced.permanent_rotation(100.0, 100.0, 3.0, 1.0).theta == pytest.approx(math.pi / 2)
