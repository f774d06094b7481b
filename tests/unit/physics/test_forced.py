"""Lasting torques, Magnus 1970 (11)-(14), (23)-(27), Kreisel K(14), K(15), against DOP853."""

import cmath
import math

import numpy as np
import pytest
from support import reference
from support.spinning import driven, plain_spinners, spinners, turning

from nutdamp.physics import driven as forced

PROLATE = (120.0, 80.0, 3.0)
RATE = (120.0 - 80.0) / 120.0 * 3.0
"""aω3 of it, rad/s."""


def start_of(omega: complex, spin: float) -> reference.Motion:
    return reference.Motion(reference.vector(omega.real, omega.imag, spin), np.eye(3))


def rotating(
    times: list[float] | np.ndarray,
    omega0: complex,
    A: float,
    C: float,
    spin: float,
    *torques: tuple[complex, float],
) -> np.ndarray:
    sizes, rates = (np.array(part) for part in zip(*torques, strict=True))
    return forced.rotating_torques(
        np.array(times), omega0, (A - C) / A * spin, A, sizes.astype(complex), rates
    )


def test_constant_torque_11_circles_the_centre_of_its_pole_cone() -> None:
    A, C, spin = PROLATE
    omega0 = 0.05 + 0.1j
    torque = 5.0 - 2.0j
    centre = forced.steady_response(A, (A - C) / A * spin, torque)
    # Magnus' centre: ω1P = M2/((A-C)ω3), ω2P = -M1/((A-C)ω3)
    assert centre == pytest.approx(complex(torque.imag, -torque.real) / ((A - C) * spin), rel=1e-14)
    times = np.linspace(0.0, 12.0, 40)
    omega = rotating(times, omega0, A, C, spin, (torque, 0.0))
    assert np.abs(omega - centre) == pytest.approx(abs(omega0 - centre), rel=1e-12)


@plain_spinners
def test_permanent_rotation_13_stays_and_has_the_euler_angles_14(
    A: float, C: float, spin: float
) -> None:
    torque = 5.0 - 2.0j
    omega, rate, theta, phi = forced.permanent_rotation(A, C, spin, torque)
    start = start_of(omega, spin)
    (later,) = reference.coast((A, A, C), start, reference.vector(5.0, -2.0, 0.0), np.array([7.0]))
    assert later.rates == pytest.approx(start.rates, abs=1e-13)
    assert math.tan(theta) == pytest.approx(
        abs(torque) / (abs(A - C) * spin * abs(spin)), rel=1e-13
    )
    across = rate * math.sin(theta)
    angles = across * math.sin(phi), across * math.cos(phi), rate * math.cos(theta)
    assert angles == pytest.approx(start.rates.tolist(), rel=1e-13)
    # The torque lies along the line of nodes: tan φ0 = -M2/M1
    assert math.tan(phi) == pytest.approx(-torque.imag / torque.real, rel=1e-12)


@spinners
def test_rotating_torques_23_24(A: float, C: float, spin: float) -> None:
    torques = ((2.0 + 1.0j, 0.4), (-0.5j, -3.0), (3.0 + 0j, 7.0))
    times = [0.0, 1.0, 6.0]
    motions = driven((A, A, C), start_of(0.2 - 0.1j, spin), turning(*torques), times)
    expected = [complex(motion.rates[0], motion.rates[1]) for motion in motions]
    omega = rotating(times, 0.2 - 0.1j, A, C, spin, *torques)
    assert omega[0] == pytest.approx(0.2 - 0.1j)
    assert np.abs(omega[1:] - expected).max() < 1e-11


@pytest.mark.parametrize("detuning", [0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3])
def test_resonance_25_without_cancellation(detuning: float) -> None:
    start = 0.01 + 0.02j
    torque = 0.5 + 0.2j
    times = np.linspace(0.0, 60.0, 31)
    omega = rotating(times, start, *PROLATE, (torque, -RATE + detuning))
    resonant = (start + torque / 120.0 * times) * np.exp(-1j * RATE * times)
    # To first order the detuning turns what is added by δt/2.
    assert (
        np.abs(omega - resonant).max() <= abs(torque) / 120.0 * 60.0 * 0.5 * detuning * 60.0 + 1e-14
    )


def test_the_resonant_torque_reaches_a_cone_when_it_says() -> None:
    A, C, spin = PROLATE
    torque = 0.5 + 0.2j
    for start in (0.0, 0.03 - 0.02j, -0.05 + 0.01j):
        time = forced.resonant_time(A, C * spin, start, torque, math.radians(4.0))
        (omega,) = rotating([time], start, A, C, spin, (torque, -RATE))
        assert math.atan2(A * abs(omega), C * spin) == pytest.approx(math.radians(4.0), rel=1e-12)
    assert forced.resonant_time(A, C * spin, 1.0, torque, 0.01) == 0.0


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.5])
def test_26_opposite_rotation_and_its_straight_pole_curves(turn: float) -> None:
    """b = +a: as printed with its own constant;
    pole curves are straight whenever |ω0| = |m0/2a|.
    """
    A, C, spin = PROLATE
    a = (A - C) / A
    m0 = 0.05 + 0.02j
    alpha = np.linspace(0.0, 20.0, 60)
    # the print's ω0
    constant = abs(m0 / (2 * a)) * cmath.exp(1j * turn)
    shift = 1j * m0 / (2 * a)
    omega = rotating(alpha / spin, constant - shift, A, C, spin, (m0 * A * spin, a * spin))
    printed = (constant - shift) * np.cos(a * alpha) - 1j * (constant + shift) * np.sin(a * alpha)
    assert np.abs(omega - printed).max() < 1e-14
    # Straight through the origin: all points lie along one direction.
    assert np.abs((omega * np.conj(omega[np.argmax(np.abs(omega))])).imag).max() < 1e-14


def test_27_nearly_space_fixed_torque_and_its_beat() -> None:
    A, C, spin, torque = 100.0, 10.0, 3.0, 0.4
    forced_term = 1j * torque / (A * spin) * A / C
    assert forced.steady_response(A, (A - C) / A * spin, torque, -spin) == pytest.approx(
        forced_term, rel=1e-13
    )
    largest, period = forced.beat(A, (A - C) / A * spin, torque, -spin)
    omega = rotating(np.linspace(0.0, period, 2001), 0.0, A, C, spin, (torque, -spin))
    assert np.abs(omega).max() == pytest.approx(largest, rel=1e-6)
    assert abs(omega[-1]) < 1e-12 * largest
    assert abs(omega[1000]) == pytest.approx(largest, rel=1e-12)


def test_a_sphere_and_a_resonance_have_no_steady_response() -> None:
    assert math.isinf(abs(forced.steady_response(100.0, 0.0, 1.0)))
    assert forced.beat(100.0, 0.0, 1.0, 0.0) == (math.inf, math.inf)
    assert forced.permanent_rotation(100.0, 100.0, 3.0, 1.0)[2] == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("torque", [2.0 + 0.0j, -1.0 + 3.0j])
@plain_spinners
def test_precession_k14_k15_is_steady(A: float, C: float, spin: float, torque: complex) -> None:
    """Fixed in the despun frame (turning at -ω3 in the body) or in the body: there ω stands still,
    once steady.
    """
    despun, body = (
        forced.steady_response(A, (A - C) / A * spin, torque, rate) for rate in (-spin, 0.0)
    )
    assert despun == pytest.approx(1j * torque / (C * spin))
    assert body == pytest.approx(-1j * torque / ((A - C) * spin))
    times = np.linspace(0.0, 5.0, 11)
    for steady, turn in ((despun, -spin), (body, 0.0)):
        motions = driven((A, A, C), start_of(steady, spin), turning((torque, turn)), times)
        rates = np.array([motion.rates for motion in motions])
        still = (rates[:, 0] + 1j * rates[:, 1]) * np.exp(-1j * turn * times[1:])
        assert still == pytest.approx(np.full(10, steady), abs=1e-12)
        assert rates[:, 2] == pytest.approx(np.full(10, spin), rel=1e-12)
        if turn:  # In space the spin axis goes straight on towards σM, about the axis that ω names.
            towards = math.copysign(1, spin) * torque / abs(torque)
            angle = abs(steady) * 5.0
            expected = [
                math.sin(angle) * towards.real,
                math.sin(angle) * towards.imag,
                math.cos(angle),
            ]
            assert motions[-1].rotation[:, 2] == pytest.approx(expected, abs=1e-12)
