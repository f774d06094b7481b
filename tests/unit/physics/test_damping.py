"""What to fire, and when: Magnus 1970 (21), (22), the mounting angle and the sign table, flown by DOP853."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from support import reference

from nutdamp.physics import cones, damping

EPS = float(np.finfo(float).eps)
FLOWN = 2e-11
"""rad; what DOP853 at 1e-13 a step adds up over the flights here."""

BODIES = [(120.0, 80.0), (80.0, 120.0), (100.0, 100.0), (100.0, 200.0), (100.0, 10.0)]
SPINS = [3.0, -3.0]
ANGLES = [1e-6, 2.0, 10.0, 30.0, 60.0, 85.0]


def after(
    A: float, C: float, spin: float, omega0: complex, kicks: list[tuple[float, complex]]
) -> tuple[float, float, complex]:
    """Nutation angle, shift of H (rad) and ω (rad/s) just after the last of the impulses (s, N m s)."""
    moments, rates = (A, A, C), reference.vector(omega0.real, omega0.imag, spin)
    fired = [reference.Kick(t, reference.vector(J.real, J.imag, 0)) for t, J in kicks]
    rotation = reference.frame_n(moments, rates)
    end = reference.fly(moments, rates, fired, kicks[-1][0], rotation)
    before = reference.momentum(moments, reference.Motion(rates, rotation))
    return (
        reference.nutation(moments, end.rates, math.copysign(1, spin)),
        reference.angle(before, reference.momentum(moments, end)),
        complex(end.rates[0], end.rates[1]),
    )


def turned(A: float, C: float, spin: float, omega: complex, time: float) -> complex:
    """ω after a free arc: it turns at -aω3 in the body."""
    return omega * cmath.exp(-1j * (A - C) / A * spin * time)


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), BODIES)
def test_magnus_21_one_impulse_against_omega_takes_out_all_and_moves_h_by_the_nutation_angle(
    A: float, C: float, spin: float, degrees: float
) -> None:
    theta = math.radians(degrees)
    omega = cmath.rect(cones.transverse_rate(A, C, theta, spin), 0.7)
    nutation, shift, _ = after(A, C, spin, omega, [(0.0, -A * omega)])
    assert nutation < 2 * EPS * max(1.0, math.tan(theta))  # the rounding of A|ω|, as an angle
    assert shift == pytest.approx(theta, abs=8 * EPS)


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), BODIES)
def test_magnus_22_made_exact_leaves_no_nutation_and_h_where_it_was(
    A: float, C: float, spin: float, degrees: float
) -> None:
    """At every angle, for A|ω| together: not a gram more than one pulse."""
    size = cones.transverse_rate(A, C, math.radians(degrees), spin)
    halves = damping.half_pulses(A, C, size, spin)
    assert halves.first + halves.second == pytest.approx(A * size, rel=2 * EPS)
    assert min(halves) > 0.0
    omega = cmath.rect(size, 0.7)
    second = turned(A, C, spin, omega * (1 - halves.first / (A * size)), halves.wait)
    nutation, shift, _ = after(
        A, C, spin, omega, [(0.0, -halves.first * omega / size), (halves.wait, -halves.second * second / abs(second))]
    )
    assert nutation < FLOWN
    assert shift < FLOWN


@pytest.mark.parametrize("half_turns", [3, 5, 9])
@pytest.mark.parametrize(("A", "C"), [(120.0, 80.0), (80.0, 120.0)])
def test_the_second_pulse_may_come_any_odd_number_of_half_turns_later(A: float, C: float, half_turns: int) -> None:
    spin = -2.0
    size = cones.transverse_rate(A, C, math.radians(25), spin)
    halves = damping.half_pulses(A, C, size, spin)
    wait = half_turns * halves.wait
    second = turned(A, C, spin, size - halves.first / A + 0j, wait)
    nutation, shift, _ = after(
        A, C, spin, size + 0j, [(0.0, -halves.first + 0j), (wait, -halves.second * second / abs(second))]
    )
    assert nutation < FLOWN
    assert shift < FLOWN


def displaced(A: float, C: float, spin: float, degrees: float, wait: str) -> float:
    """Shift of H in degrees by two equal halves, with Δt from the ω before or after the first, or πA/(Cω3)."""
    size = cones.transverse_rate(A, C, math.radians(degrees), spin)
    printed = damping.half_pulses_as_printed(A, C, size, spin)
    assert printed.first == printed.second == 0.5 * A * size
    waits = {
        "before": printed.wait,
        "after": math.pi / math.hypot(0.5 * size, C / A * spin),
        "approximation": math.pi * A / (C * abs(spin)),
    }
    second = turned(A, C, spin, complex(0.5 * size), waits[wait])
    kicks = [(0.0, complex(-printed.first)), (waits[wait], -printed.second * second / abs(second))]
    nutation, shift, _ = after(A, C, spin, complex(size), kicks)
    assert nutation < FLOWN
    return math.degrees(shift)


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), [(120.0, 80.0), (80.0, 120.0), (100.0, 190.0)])
@pytest.mark.parametrize(
    ("wait", "figures"),
    [
        ("before", {2.0: (0.0016, 5e-5), 10.0: (0.19, 5e-3), 30.0: (5.1, 0.05)}),
        ("after", {2.0: (0.0006, 5e-5), 10.0: (0.077, 5e-4), 30.0: (2.2, 0.05)}),
        ("approximation", {2.0: (0.0008, 5e-5), 10.0: (0.098, 5e-4), 30.0: (2.9, 0.05)}),
    ],
)
def test_magnus_22_as_printed_displaces_h_by_the_figures_of_the_physics_sheet(
    A: float, C: float, spin: float, wait: str, figures: dict[float, tuple[float, float]]
) -> None:
    """The figures to their last digit; they are the same for every body and both spins."""
    for degrees, (figure, last_digit) in figures.items():
        assert displaced(A, C, spin, degrees, wait) == pytest.approx(figure, abs=last_digit)


# --- mounting angle --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [1e-6, 5.0, 40.0])
@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), BODIES)
def test_two_actuators_at_the_mounting_angle_give_both_pulses(A: float, C: float, spin: float, degrees: float) -> None:
    """The second actuator stands along ω, either way, as the axis has gone half a turn; at small angles -σπA/C."""
    size = cones.transverse_rate(A, C, math.radians(degrees), spin)
    halves = damping.half_pulses(A, C, size, spin)
    angle = damping.mounting_angle(A, C, size, spin)
    assert 0.0 <= angle < math.pi
    _, _, omega = after(A, C, spin, complex(size), [(0.0, complex(-halves.first)), (halves.wait, 0j)])
    assert abs((omega * cmath.exp(-1j * angle)).imag) < FLOWN * max(size, 1.0)
    if degrees < 1e-3:
        assert cmath.exp(2j * angle) == pytest.approx(cmath.exp(-2j * math.copysign(math.pi, spin) * A / C), abs=1e-11)


# --- sign table ------------------------------------------------------------------------------------------------------

TABLE = {+1: ("omega2", +1), -1: ("omega2", -1), +2: ("omega1", -1), -2: ("omega1", +1)}
"""Magnus 1970 before fig. 5: thruster -> the component that passes zero, and the sign of its rate of change."""


def direction(thruster: int) -> complex:
    return complex(math.copysign(1, thruster)) * (1 if abs(thruster) == 1 else 1j)


def moment(A: float, C: float, spin: float, thruster: int, mirrored: bool) -> complex:
    """ω of size 1/5 at the moment at which the table fires a thruster, by the rates of change of Euler's equations."""
    passing, sign = TABLE[thruster]
    rate = (A - C) / A * spin
    expected = sign * (-1 if mirrored else 1)
    for omega in (0.2, -0.2, 0.2j, -0.2j):
        slope = {"omega1": rate * complex(omega).imag, "omega2": -rate * complex(omega).real}
        zero = {"omega1": complex(omega).real, "omega2": complex(omega).imag}
        if zero[passing] == 0.0 and slope[passing] * expected > 0:
            return complex(omega)
    raise AssertionError("the table names no moment")


@pytest.mark.parametrize("thruster", TABLE)
@pytest.mark.parametrize(("A", "C", "spin"), [(120.0, 80.0, 3.0), (80.0, 120.0, -3.0)])
def test_sign_table_of_magnus_for_a_omega3_above_zero(A: float, C: float, spin: float, thruster: int) -> None:
    """The rule "ω against the torque" is the table: no angle is left to turn, and firing lowers |ω|."""
    omega = moment(A, C, spin, thruster, mirrored=False)
    assert damping.phase_to_oppose(omega, direction(thruster)) == 0.0
    _, _, left = after(A, C, spin, omega, [(0.0, 3.0 * direction(thruster))])
    assert abs(left) == pytest.approx(abs(omega) - 3.0 / A, rel=4 * EPS)


@pytest.mark.parametrize("thruster", TABLE)
@pytest.mark.parametrize(("A", "C", "spin"), [(120.0, 80.0, -3.0), (80.0, 120.0, 3.0)])
def test_sign_table_is_mirrored_for_a_omega3_below_zero(A: float, C: float, spin: float, thruster: int) -> None:
    """Its mirror image damps; as printed it pumps the nutation up."""
    mirrored, printed = (moment(A, C, spin, thruster, mirrored=flag) for flag in (True, False))
    assert damping.phase_to_oppose(mirrored, direction(thruster)) == 0.0
    assert abs(damping.phase_to_oppose(printed, direction(thruster))) == math.pi
    _, _, damped = after(A, C, spin, mirrored, [(0.0, 3.0 * direction(thruster))])
    _, _, pumped = after(A, C, spin, printed, [(0.0, 3.0 * direction(thruster))])
    assert abs(damped) == pytest.approx(abs(mirrored) - 3.0 / A, rel=4 * EPS)
    assert abs(pumped) == pytest.approx(abs(printed) + 3.0 / A, rel=4 * EPS)


@pytest.mark.parametrize("phase", [0.0, 0.4, -1.7, 3.0])
@pytest.mark.parametrize("torque", [5.0 + 0j, -2.0 + 1j, 0.3j])
def test_phase_to_oppose_is_the_turn_left_to_the_opposite_of_the_torque(phase: float, torque: complex) -> None:
    """ω turns at -aω3: after the time phase/(aω3) it stands against the torque."""
    omega, rate = cmath.rect(0.3, phase), 0.8
    time = damping.phase_to_oppose(omega, torque) / rate
    then = omega * cmath.exp(-1j * rate * time)
    assert then / abs(then) == pytest.approx(-torque / abs(torque), abs=8 * EPS)
