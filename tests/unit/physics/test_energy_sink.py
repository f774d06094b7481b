"""The energy sink: its closed form against DOP853 on angles and on the attitude, its limits, its
two forms.
"""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import reference
from support.cases import spread
from support.spinning import EPS, Triple, arc, series

from nutdamp.physics import attitude, energy_sink
from nutdamp.physics.motion import Forcing

QUATERNION = reference.vector(0.5, -0.1, 0.7, 0.5)  # of length 1
START = attitude.matrix(QUATERNION)


class Body(NamedTuple):
    """A symmetric body in motion, and its sink."""

    A: float
    C: float
    growth: float
    omega: complex
    spin: float

    def arc(self, *times: float) -> tuple[reference.Array, reference.Array]:
        """Rates (n, 3) and rotations (n, 3, 3) by the closed form."""
        omega, spin, turned = arc(
            self.A, self.C, self.growth, QUATERNION, self.omega, self.spin, np.array(times)
        )
        return np.column_stack([omega.real, omega.imag, spin]), np.array(
            [attitude.matrix(one) for one in turned]
        )

    @property
    def moments(self) -> Triple:
        return self.A, self.A, self.C

    @property
    def start(self) -> reference.Motion:
        return reference.Motion(
            reference.vector(self.omega.real, self.omega.imag, self.spin), START
        )


def body(A: float, C: float, spin: float, degrees: float, tau: float, phase: float = 0.7) -> Body:
    """With |H| of the pure spin C ``spin``; beyond 90 degrees it spins about -e3."""
    theta = math.radians(degrees)
    size = C * abs(spin)
    omega = size / A * math.sin(theta) * complex(math.cos(phase), math.sin(phase))
    return Body(
        A,
        C,
        math.copysign(1 / tau, A - C),
        omega,
        size / C * math.cos(theta) * math.copysign(1.0, spin),
    )


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


@spread("one", BODIES.values(), quick=2, deep=7, ids=BODIES)
def test_the_arc_agrees_with_dop853(one: Body) -> None:
    """On H in space and the attitude. Energy falls, the size of H stays."""
    times = np.linspace(0.0, 100.0, 6)
    rates, turned = one.arc(*times)
    motions = reference.coast(one.moments, one.start, np.zeros(3), times[1:], growth=one.growth)
    for rate, turn, motion in zip(rates[1:], turned[1:], motions, strict=True):
        assert rate == pytest.approx(motion.rates, abs=1e-9)
        assert reference.turned(motion.rotation, turn) < 1e-9
    size = np.linalg.norm(rates * one.moments, axis=1)
    assert size == pytest.approx(np.full(6, size[0]), rel=20 * EPS)
    assert np.all(np.diff([reference.energy(one.moments, row) for row in rates]) < 0)


def test_the_example_of_the_course() -> None:
    """C = 1000, A = 2000 kg m², 60 rpm, ω_t = 0.10 rad/s, τ = 100 s."""
    halfway = 100.0 * math.log(1000 * 2 * math.pi / (2000 * 0.1))
    assert halfway == pytest.approx(345.0, abs=0.5)
    rates, _ = Body(2000.0, 1000.0, 0.01, 0.1 + 0j, 2 * math.pi).arc(
        0.0, 50, 100, 200, 300, 600, halfway, 3e4
    )
    across = np.hypot(rates[:, 0], rates[:, 1])
    degrees = np.degrees(np.arctan2(2000 * across, 1000 * rates[:, 2]))
    assert degrees[:5] == pytest.approx([1.82, 3.00, 4.95, 13.24, 32.59], abs=0.005)
    assert degrees[5] == pytest.approx(85.5, abs=0.05)
    assert 2 * across[6] == pytest.approx(rates[6, 2], rel=1e-12)
    # In the end flat, at 30 rpm.
    assert rates[7, 2] == pytest.approx(0.0, abs=1e-100)
    assert across[7] * 30 / math.pi == pytest.approx(30.0, rel=1e-3)


# --- limits
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("growth", [0.0, 1e-300, -1e-300, 1e-18, -1e-18])
def test_no_dissipation_is_the_free_arc(growth: float) -> None:
    times = np.array([0.0, 1.0, 50.0])
    for one in BODIES.values():
        omega, spin, turned = arc(one.A, one.C, growth, QUATERNION, one.omega, one.spin, times)
        free = arc(one.A, one.C, 0.0, QUATERNION, one.omega, one.spin, times)[2]
        assert turned == pytest.approx(free, abs=200 * EPS)
        assert spin == pytest.approx(np.full(3, one.spin), rel=8 * EPS)
        assert np.abs(omega) == pytest.approx(np.full(3, abs(one.omega)), rel=8 * EPS)


@pytest.mark.parametrize("growth", [0.02, -0.02])
@pytest.mark.parametrize(("omega", "spin"), [(0j, 2.0), (0j, -2.0), (2.0 + 0j, 0.0), (0j, 0.0)])
def test_pure_spin_flat_spin_and_rest_stay(growth: float, omega: complex, spin: float) -> None:
    times = np.array([0.0, 10.0, 1e5])
    transverse, spins, turned = arc(120.0, 80.0, growth, QUATERNION, omega, spin, times)
    assert np.array_equal(transverse, np.full(3, omega))
    assert np.array_equal(spins, np.full(3, spin))
    assert turned == pytest.approx(
        arc(120.0, 80.0, 0.0, QUATERNION, omega, spin, times)[2], abs=1e-10
    )
    assert arc(120.0, 80.0, growth, QUATERNION, omega, spin, 10.0)[:2] == (omega, spin)


def test_small_angles_from_spin_grow_and_from_flat_shrink_by_the_exponential() -> None:
    rates, _ = Body(120.0, 80.0, 0.01, 1e-12 + 0j, 3.0).arc(0.0, 100.0, 1000.0)
    assert np.hypot(rates[:, 0], rates[:, 1]) == pytest.approx(
        1e-12 * np.exp([0.0, 1.0, 10.0]), rel=1e-12
    )
    assert rates[:, 2] == pytest.approx([3.0, 3.0, 3.0], rel=1e-14)
    one = body(120, 80, 3.0, 90.0 - 1e-7, 50.0)
    assert one.arc(0.0, 50.0, 500.0)[0][:, 2] == pytest.approx(
        one.spin * np.exp([0.0, -1.0, -10.0]), rel=1e-9
    )


@given(st.floats(-1e3, 1e3), st.floats(0.0, 180.0), st.floats(0.0, 1e15))
def test_no_time_is_too_long(growth: float, degrees: float, time: float) -> None:
    cosine = math.cos(math.radians(degrees))
    sine = math.sin(math.radians(degrees))
    course = energy_sink.course(growth, cosine, sine * sine, time)
    assert math.hypot(course.along, sine * course.transverse) == pytest.approx(1.0, abs=20 * EPS)
    # Squares of times below 1e-150 s are denormal numbers.
    assert abs(course.travel) <= time * (1 + 20 * EPS) + 1e-150
    assert math.hypot(course.cosine, sine * course.sine) == pytest.approx(1.0, abs=20 * EPS)


# --- torques, and three different moments: the series of `rigid`
# -----------------------------------------------------


@pytest.mark.parametrize("torque", [(9.0, -5.0, 3.0), (0.0, 0.0, 0.0)])
@pytest.mark.parametrize(
    ("moments", "spin"),
    [
        ((120.0, 120.0, 80.0), 2.0),
        ((80.0, 80.0, 130.0), -2.0),
        ((120.0, 100.0, 80.0), -2.0),
        ((80.0, 90.0, 130.0), 2.0),
    ],
)
def test_powered_arcs_agree_with_dop853(moments: Triple, spin: float, torque: Triple) -> None:
    """And those without torque with the closed form, which has two equal moments."""
    rates0 = reference.vector(0.5, -0.3, spin)
    growth = math.copysign(0.05, moments[0] - 100)
    pieces = series(
        moments,
        reference.vector(*torque),
        rates0,
        QUATERNION,
        0.0,
        6.0,
        Forcing(growth=growth),
    )
    rates, turned = pieces[-1].end()
    (expected,) = reference.coast(
        moments,
        reference.Motion(rates0, START),
        reference.vector(*torque),
        np.array([6.0]),
        growth=growth,
    )
    assert rates == pytest.approx(expected.rates, abs=2e-12)
    assert reference.turned(expected.rotation, attitude.matrix(turned)) < 2e-12
    if moments[0] == moments[1] and not any(torque):
        (closed,), (rotation,) = Body(moments[0], moments[2], growth, 0.5 - 0.3j, spin).arc(6.0)
        assert rates == pytest.approx(closed, abs=2e-13)
        assert reference.turned(rotation, attitude.matrix(turned)) < 2e-12


@pytest.mark.parametrize("aside", [0.0, 1e-12, 1e-6])
def test_a_torque_through_rest_takes_few_steps(aside: float) -> None:
    """H passes zero, or nearly: the direction of H turns about at once there, and the series must
    not stop.
    """
    torque = reference.vector(aside, 0, -8)
    rates = reference.vector(0, 0, 1)
    forcing = Forcing(growth=0.05)
    pieces = series((120.0, 120.0, 80.0), torque, rates, QUATERNION, 0.0, 20.0, forcing)
    assert len(pieces) < 200
    assert pieces[-1].end()[0][2] == pytest.approx(-1.0, abs=1e-9)
