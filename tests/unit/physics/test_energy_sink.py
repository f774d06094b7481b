"""The energy sink: its closed form against DOP853 on angles and on the attitude, its limits, its two forms."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import reference
from support.cases import spread
from support.reference import Array, Motion

from nutdamp.physics import attitude, energy_sink, rigid

EPS = float(np.finfo(float).eps)
QUATERNION = np.array([0.5, -0.1, 0.7, 0.5])  # of length 1


class Body(NamedTuple):
    """A symmetric body in motion, and its sink."""

    A: float
    C: float
    growth: float
    omega: complex
    spin: float

    def arc(self, times: Array) -> tuple[Array, Array]:
        """Rates (n, 3) and rotations (n, 3, 3) by the closed form."""
        omega, spin, turned = energy_sink.arc(self.A, self.C, self.growth, QUATERNION, self.omega, self.spin, times)
        return np.column_stack([omega.real, omega.imag, spin]), np.array([attitude.matrix(one) for one in turned])

    @property
    def moments(self) -> tuple[float, float, float]:
        return self.A, self.A, self.C

    @property
    def start(self) -> Motion:
        return Motion(np.array([self.omega.real, self.omega.imag, self.spin]), attitude.matrix(QUATERNION))


def body(A: float, C: float, spin: float, degrees: float, tau: float, phase: float = 0.7) -> Body:
    """With |H| of the pure spin C ``spin``; beyond 90 degrees it spins about -e3."""
    theta, size = math.radians(degrees), C * abs(spin)
    omega = size / A * math.sin(theta) * complex(math.cos(phase), math.sin(phase))
    return Body(A, C, math.copysign(1 / tau, A - C), omega, size / C * math.cos(theta) * math.copysign(1.0, spin))


BODIES = {
    "prolate": body(120, 80, 3.0, 5.0, 100.0),
    "prolate, spin reversed": body(120, 80, -3.0, 5.0, 100.0),
    "prolate, far out": body(2000, 300, 4.0, 75.0, 60.0),
    "oblate": body(80, 120, 2.0, 30.0, 80.0),
    "oblate, spin reversed": body(80, 120, -2.0, 60.0, 80.0),
    "oblate from nearly flat": body(80, 130, 2.0, 89.0, 40.0),
    "disc": body(80, 160, 1.5, 20.0, 90.0),
    "nearly a sphere": body(100, 100.001, 2.0, 40.0, 50.0),
    "about -e3": body(120, 80, 3.0, 120.0, 150.0),
}


def random_bodies(count: int) -> list[Body]:
    draw = np.random.default_rng(20)
    found = []
    for _ in range(count):
        A = 10.0 ** draw.uniform(0, 3)
        C = A * draw.uniform(0.1, 2.0)
        spin = draw.choice([-1.0, 1.0]) * draw.uniform(0.5, 3.0) * min(1.0, A / C)
        degrees = draw.choice([10.0 ** draw.uniform(-6, 1), draw.uniform(1.0, 89.9)])
        found.append(body(A, C, spin, degrees, 10.0 ** draw.uniform(1.0, 3.0), draw.uniform(0.0, 6.0)))
    return found


def assert_is_motion(one: Body, until: float, tolerance: float) -> None:
    """Rates, rad/s, and attitude, rad, over ``until`` s against DOP853 on H in space and the attitude."""
    times = np.linspace(0.0, until, 6)[1:]
    rates, turned = one.arc(times)
    motions = reference.sinking(one.moments, one.start, np.zeros(3), times, one.growth)
    for row, motion in enumerate(motions):
        assert rates[row] == pytest.approx(motion.rates, abs=tolerance)
        assert reference.turned(motion.rotation, turned[row]) < tolerance


@spread("name", BODIES, quick=1)
def test_200_s_agree_with_dop853(name: str) -> None:
    assert_is_motion(BODIES[name], 200.0, 1e-9)


@spread("one", random_bodies(12), quick=3)
def test_random_bodies_agree_with_dop853(one: Body) -> None:
    assert_is_motion(one, 50.0, 1e-9)


@pytest.mark.parametrize("name", BODIES)
def test_the_euler_angles_agree_with_their_own_equations(name: str) -> None:
    """φ, θ and ψ over 200 s, read from the closed form's attitude, against DOP853 on dφ/dt, dθ/dt, dψ/dt."""
    one = BODIES[name]
    times = np.linspace(0.0, 200.0, 41)
    rates, turned = one.arc(times)
    h = reference.momentum(one.moments, one.start)
    size = float(np.linalg.norm(h))
    z = h / size
    x = np.cross(z, [0.3, -0.5, 0.8])
    x /= np.linalg.norm(x)
    frame = np.array([x, np.cross(z, x), z])
    third, across = turned[:, :, 2] @ frame.T, np.einsum("nij,nj->ni", turned, rates * one.moments) @ frame.T
    assert across == pytest.approx(np.tile([0.0, 0.0, size], (41, 1)), abs=1e-10 * size)  # H stays in space
    phi = np.unwrap(np.arctan2(third[:, 0], -third[:, 1]))
    theta = np.arctan2(np.hypot(third[:, 0], third[:, 1]), third[:, 2])
    psi = np.unwrap(np.arctan2(rates[:, 0], rates[:, 1]))
    start = np.array([phi[0], theta[0], psi[0]])
    expected = reference.euler_angles(one.A, one.C, size, one.growth, start, times[1:])
    for found, column in ((phi, 0), (theta, 1), (psi, 2)):
        off = found[1:] - expected[:, column]
        assert np.abs(off - 2 * math.pi * np.round(off / (2 * math.pi))).max() < 2e-9


def test_the_torque_law() -> None:
    """dH/dt = κ H1 cos²θ, κ H2 cos²θ, -κ H3 sin²θ beside the free motion, by a difference quotient of the arc."""
    for one in BODIES.values():
        step = 1e-4
        times = np.array([0.0, step, 2 * step, 3 * step, 4 * step])
        rates, _ = one.arc(times)
        free, _ = one._replace(growth=0.0).arc(times)
        momentum = (rates - free) * one.moments
        slope = np.array([-25, 48, -36, 16, -3]) / (12 * step) @ momentum
        h = one.start.rates * one.moments
        cosine = h[2] / np.linalg.norm(h)
        expected = one.growth * h * np.array([cosine**2, cosine**2, cosine**2 - 1])
        assert slope == pytest.approx(expected, abs=1e-9 * float(np.linalg.norm(h)))


def test_the_example_of_the_course() -> None:
    """C = 1000, A = 2000 kg m², 60 rpm, ω_t = 0.10 rad/s, τ = 100 s."""
    times = np.array([0.0, 50.0, 100.0, 200.0, 300.0, 600.0])
    omega, spin, _ = energy_sink.arc(2000.0, 1000.0, 0.01, QUATERNION, 0.1 + 0j, 2 * math.pi, times)
    degrees = np.degrees(np.arctan2(2000 * np.abs(omega), 1000 * spin))
    assert degrees[:-1] == pytest.approx([1.82, 3.00, 4.95, 13.24, 32.59], abs=0.005)
    assert degrees[-1] == pytest.approx(85.5, abs=0.05)
    halfway = 100.0 * math.log(1000 * 2 * math.pi / (2000 * 0.1))
    assert halfway == pytest.approx(345.0, abs=0.5)
    omega, spin, _ = energy_sink.arc(2000.0, 1000.0, 0.01, QUATERNION, 0.1 + 0j, 2 * math.pi, np.array([halfway, 3e4]))
    assert 2 * abs(omega[0]) == pytest.approx(spin[0], rel=1e-12)
    # In the end flat, at 30 rpm.
    assert spin[1] == pytest.approx(0.0, abs=1e-100)
    assert abs(omega[1]) * 30 / math.pi == pytest.approx(30.0, rel=1e-3)


@pytest.mark.parametrize("name", BODIES)
def test_energy_falls_and_the_size_of_h_stays(name: str) -> None:
    one = BODIES[name]
    rates, _ = one.arc(np.linspace(0.0, 400.0, 50))
    momentum = rates * one.moments
    size = np.linalg.norm(momentum, axis=1)
    assert size == pytest.approx(np.full(50, size[0]), rel=20 * EPS)
    energies = [reference.energy(one.moments, row) for row in rates]
    assert np.all(np.diff(energies) <= 4 * EPS * energies[0])
    assert energies[-1] < energies[0]


@given(
    st.sampled_from(sorted(BODIES)),
    st.floats(0.0, 1e4),
    st.floats(0.0, 1e4),
)
def test_an_arc_is_made_of_arcs(name: str, first: float, second: float) -> None:
    one = BODIES[name]
    omega, spin, middle = energy_sink.arc_end(one.A, one.C, one.growth, QUATERNION, one.omega, one.spin, first)
    omega, spin, end = energy_sink.arc_end(one.A, one.C, one.growth, middle, omega, spin, second)
    rates, turned = one.arc(np.array([first + second]))
    # Near flat spin, what the first arc's rounding does to θ is what the second makes of it: up to e^{κt} as much.
    loose = 1e-9 if one.growth < 0.0 or second < 500.0 else 1e-6
    assert [omega.real, omega.imag, spin] == pytest.approx(rates[0].tolist(), abs=loose)
    assert reference.turned(attitude.matrix(end), turned[0]) < loose


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("time", [0.0, 1e-9, 0.7, 30.0, 900.0, 1e6])
def test_one_moment_and_many_agree(name: str, time: float) -> None:
    one = BODIES[name]
    omega, spin, end = energy_sink.arc_end(one.A, one.C, one.growth, QUATERNION, one.omega, one.spin, time)
    found, spins, turned = energy_sink.arc(one.A, one.C, one.growth, QUATERNION, one.omega, one.spin, np.array([time]))
    scale = 1.0 + abs(one.spin) * time  # roundings of the angle turned
    assert omega == pytest.approx(complex(found[0]), abs=8 * EPS * scale)
    assert spin == pytest.approx(float(spins[0]), rel=8 * EPS, abs=1e-100)
    assert end == pytest.approx(turned[0], abs=8 * EPS * scale)
    assert float(np.linalg.norm(end)) == pytest.approx(1.0, abs=20 * EPS)


# --- limits ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("growth", [0.0, 1e-300, -1e-300, 1e-18, -1e-18])
def test_no_dissipation_is_the_free_arc(growth: float) -> None:
    for one in BODIES.values():
        times = np.array([0.0, 1.0, 50.0])
        omega, spin, turned = energy_sink.arc(one.A, one.C, growth, QUATERNION, one.omega, one.spin, times)
        free = attitude.arc(one.A, one.C, QUATERNION, one.omega, one.spin, times)
        assert turned == pytest.approx(free, abs=200 * EPS)
        assert spin == pytest.approx(np.full(3, one.spin), rel=8 * EPS)
        assert np.abs(omega) == pytest.approx(np.full(3, abs(one.omega)), rel=8 * EPS)


@pytest.mark.parametrize("growth", [0.02, -0.02])
@pytest.mark.parametrize("spin", [2.0, -2.0])
def test_pure_spin_stays_pure_spin(growth: float, spin: float) -> None:
    times = np.array([0.0, 10.0, 1e5])
    omega, spins, turned = energy_sink.arc(120.0, 80.0, growth, QUATERNION, 0j, spin, times)
    assert np.array_equal(omega, np.zeros(3))
    assert np.array_equal(spins, np.full(3, spin))
    assert turned == pytest.approx(attitude.arc(120.0, 80.0, QUATERNION, 0j, spin, times), abs=1e-10)


def test_a_small_nutation_grows_by_the_exponential() -> None:
    omega, spin, _ = energy_sink.arc(120.0, 80.0, 0.01, QUATERNION, 1e-12 + 0j, 3.0, np.array([0.0, 100.0, 1000.0]))
    assert np.abs(omega) == pytest.approx(1e-12 * np.exp([0.0, 1.0, 10.0]), rel=1e-12)
    assert spin == pytest.approx([3.0, 3.0, 3.0], rel=1e-14)


@pytest.mark.parametrize("growth", [0.02, -0.02])
def test_flat_spin_stays_flat(growth: float) -> None:
    omega, spin, turned = energy_sink.arc(120.0, 80.0, growth, QUATERNION, 2.0 + 0j, 0.0, np.array([0.0, 10.0, 1e5]))
    assert np.array_equal(omega, np.full(3, 2.0 + 0j))
    assert np.array_equal(spin, np.zeros(3))
    free = attitude.arc(120.0, 80.0, QUATERNION, 2.0 + 0j, 0.0, np.array([0.0, 10.0, 1e5]))
    assert turned == pytest.approx(free, abs=1e-10)


def test_near_90_degrees_the_angle_from_flat_shrinks_by_the_exponential() -> None:
    one = body(120, 80, 3.0, 90.0 - 1e-7, 50.0)
    rates, _ = one.arc(np.array([0.0, 50.0, 500.0]))
    assert rates[:, 2] == pytest.approx(one.spin * np.exp([0.0, -1.0, -10.0]), rel=1e-9)


def test_a_body_at_rest_stays_at_rest() -> None:
    omega, spin, turned = energy_sink.arc_end(120.0, 80.0, 0.02, QUATERNION, 0j, 0.0, 100.0)
    assert (omega, spin) == (0j, 0.0)
    assert turned == pytest.approx(QUATERNION)


@given(
    st.floats(-1e3, 1e3),
    st.floats(0.0, 180.0),
    st.floats(0.0, 1e15),
)
def test_no_time_is_too_long(growth: float, degrees: float, time: float) -> None:
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    found = energy_sink.course(growth, cosine, sine * sine, time)
    for value in (
        cosine * found.axial,
        sine * found.transverse,
        cosine * found.turned,
        found.cosine,
        sine * found.sine,
    ):
        assert math.isfinite(value)
    assert math.hypot(cosine * found.axial, sine * found.transverse) == pytest.approx(1.0, abs=20 * EPS)
    # Squares of times below 1e-150 s are denormal numbers.
    assert abs(cosine * found.turned) <= time * (1 + 20 * EPS) + 1e-150
    assert math.hypot(found.cosine, sine * found.sine) == pytest.approx(1.0, abs=20 * EPS)


def test_a_complex_step_gives_the_derivative_by_time() -> None:
    theta = math.radians(30.0)
    found = energy_sink.courses(0.02, math.cos(theta), math.sin(theta) ** 2, np.array([20.0 + 1e-30j]))
    tilt = math.atan2(math.sin(theta) * found.transverse[0].real, math.cos(theta) * found.axial[0].real)
    assert math.cos(theta) * found.turned[0].imag / 1e-30 == pytest.approx(math.cos(tilt), rel=1e-13)
    rise = math.sin(theta) * found.transverse[0].imag / 1e-30
    assert rise == pytest.approx(0.02 * math.sin(tilt) * math.cos(tilt) ** 2, rel=1e-12)


# --- torques, and three different moments: the series of `rigid` -----------------------------------------------------


@pytest.mark.parametrize(
    "moments", [(120.0, 120.0, 80.0), (80.0, 80.0, 130.0), (120.0, 100.0, 80.0), (80.0, 90.0, 130.0)]
)
@pytest.mark.parametrize("spin", [2.0, -2.0])
def test_powered_arcs_agree_with_dop853(moments: tuple[float, float, float], spin: float) -> None:
    start = Motion(np.array([0.5, -0.3, spin]), attitude.matrix(QUATERNION))
    torque, growth = np.array([9.0, -5.0, 3.0]), math.copysign(0.05, moments[0] - moments[2])
    pieces = rigid.integrate(moments, torque, start.rates, QUATERNION, 0.0, 6.0, rigid.Forcing(growth=growth))
    rates, turned = pieces[-1].final
    (expected,) = reference.sinking(moments, start, torque, np.array([6.0]), growth)
    assert rates == pytest.approx(expected.rates, abs=2e-12)
    assert reference.turned(expected.rotation, attitude.matrix(turned)) < 2e-12


@pytest.mark.parametrize("name", ["prolate", "oblate, spin reversed", "nearly a sphere"])
def test_the_series_is_the_closed_form(name: str) -> None:
    one = BODIES[name]
    forcing = rigid.Forcing(growth=one.growth)
    pieces = rigid.integrate(one.moments, np.zeros(3), one.start.rates, QUATERNION, 0.0, 60.0, forcing)
    rates, turned = pieces[-1].final
    expected, rotation = one.arc(np.array([60.0]))
    assert rates == pytest.approx(expected[0], abs=2e-13)
    assert reference.turned(rotation[0], attitude.matrix(turned)) < 2e-12


@pytest.mark.parametrize(("moments", "least"), [((120.0, 100.0, 80.0), True), ((80.0, 90.0, 130.0), False)])
def test_three_moments_lose_energy_and_end_about_the_largest(moments: tuple[float, float, float], least: bool) -> None:
    """Also beyond the separatrix: about axis 1 (prolate) or axis 3 (oblate) in the end; H stays in space."""
    forcing = rigid.Forcing(growth=1 / 15 if least else -1 / 15)
    rates, turned, energies, sizes = np.array([0.4, 0.3, 2.0]), QUATERNION, [], []
    h = attitude.rotate(turned, rates * moments)
    for start in range(0, 400, 10):
        pieces = rigid.integrate(moments, np.zeros(3), rates, turned, float(start), start + 10.0, forcing)
        rates, turned = pieces[-1].final
        energies.append(reference.energy(moments, rates))
        sizes.append(attitude.rotate(turned, rates * moments))
    assert np.all(np.diff(energies) < 1e-13 * energies[0])
    assert np.array(sizes) == pytest.approx(np.tile(h, (40, 1)), abs=1e-10)
    assert energies[-1] == pytest.approx(0.5 * float(h @ h) / max(moments), rel=1e-3)


@pytest.mark.parametrize("aside", [0.0, 1e-12, 1e-6])
def test_a_torque_through_rest_takes_few_steps(aside: float) -> None:
    """H passes zero, or nearly: the direction of H turns about at once there, and the series must not stop."""
    torque = np.array([aside, 0.0, -8.0])
    rates = np.array([0.0, 0.0, 1.0])
    pieces = rigid.integrate((120.0, 120.0, 80.0), torque, rates, QUATERNION, 0.0, 20.0, rigid.Forcing(growth=0.05))
    assert len(pieces) < 200
    assert pieces[-1].final[0][2] == pytest.approx(-1.0, abs=1e-9)
