"""What to fire, and when: Magnus 1970 (21), (22), the mounting angle and the sign table, flown by DOP853."""

from __future__ import annotations

import cmath
import math

import pytest
from support import reference
from support.cases import spread
from support.spinning import BODIES, EPS, plain_spinners, spinners

from nutdamp.physics import cones, damping

FLOWN = 2e-11
"""rad; what DOP853 at 1e-13 a step adds up over the flights here."""

every_angle = spread("degrees", [1e-6, 2.0, 10.0, 30.0, 60.0, 85.0], quick=2, deep=4)


def after(
    A: float, C: float, spin: float, omega0: complex, *kicks: tuple[float, complex]
) -> tuple[float, float, complex]:
    """Nutation angle, shift of H (rad) and ω (rad/s) just after the last of the impulses (s, N m s)."""
    moments, rates = (A, A, C), reference.vector(omega0.real, omega0.imag, spin)
    fired = [reference.Kick(t, reference.vector(J.real, J.imag, 0)) for t, J in kicks]
    rotation = reference.frame_n(moments, rates)
    end = reference.fly(moments, rates, fired, kicks[-1][0], rotation)
    before = reference.momentum(moments, reference.Motion(rates, rotation))
    nutation = reference.nutation(moments, end.rates, math.copysign(1, spin))
    return nutation, reference.angle(before, reference.momentum(moments, end)), complex(end.rates[0], end.rates[1])


def after_two(
    A: float, C: float, spin: float, omega: complex, first: float, second: float, wait: float
) -> tuple[float, float]:
    """Nutation and shift of H, rad, after two impulses against ω, which turns at -aω3 in between."""
    left = omega * (1 - first / (A * abs(omega))) * cmath.exp(-1j * (A - C) / A * spin * wait)
    kicks = (0.0, -first * omega / abs(omega)), (wait, -second * left / abs(left))
    return after(A, C, spin, omega, *kicks)[:2]


@every_angle
@spinners
def test_magnus_21_and_22_made_exact(A: float, C: float, spin: float, degrees: float) -> None:
    """One impulse against ω takes out all and moves H by θ; two leave H where it was, for not a gram more."""
    theta = math.radians(degrees)
    size = cones.transverse_rate(A, C, theta, spin)
    omega = cmath.rect(size, 0.7)
    nutation, shift, _ = after(A, C, spin, omega, (0.0, -A * omega))
    assert nutation < 2 * EPS * max(1.0, math.tan(theta))  # the rounding of A|ω|, as an angle
    assert shift == pytest.approx(theta, abs=8 * EPS)
    halves = damping.half_pulses(A, C, size, spin)
    assert halves.first + halves.second == pytest.approx(A * size, rel=2 * EPS)
    assert min(halves) > 0.0
    assert max(after_two(A, C, spin, omega, *halves)) < FLOWN


@pytest.mark.parametrize("half_turns", [3, 9])
@pytest.mark.parametrize(("A", "C"), BODIES[:2])
def test_the_second_pulse_may_come_any_odd_number_of_half_turns_later(A: float, C: float, half_turns: int) -> None:
    size = cones.transverse_rate(A, C, math.radians(25), -2.0)
    first, second, wait = damping.half_pulses(A, C, size, -2.0)
    assert max(after_two(A, C, -2.0, size + 0j, first, second, half_turns * wait)) < FLOWN


@pytest.mark.parametrize(("A", "C", "spin"), [(120.0, 80.0, 3.0), (80.0, 120.0, -3.0), (100.0, 190.0, 3.0)])
@pytest.mark.parametrize(
    ("degrees", "before", "after_first", "approximation"),
    [(2.0, 0.0016, 0.0006, 0.0008), (10.0, 0.19, 0.077, 0.098), (30.0, 5.1, 2.2, 2.9)],
)
def test_magnus_22_as_printed_displaces_h_by_the_figures_of_the_physics_sheet(
    A: float, C: float, spin: float, degrees: float, before: float, after_first: float, approximation: float
) -> None:
    """Equal halves, with Δt from the ω before or after the first, or πA/(Cω3): to the last digit, for every body."""
    size = cones.transverse_rate(A, C, math.radians(degrees), spin)
    printed = damping.half_pulses_as_printed(A, C, size, spin)
    assert printed.first == printed.second == 0.5 * A * size
    halfway, small = math.pi / math.hypot(0.5 * size, C / A * spin), math.pi * A / (C * abs(spin))
    for wait, figure in ((printed.wait, before), (halfway, after_first), (small, approximation)):
        nutation, shift = after_two(A, C, spin, complex(size), printed.first, printed.second, wait)
        assert nutation < FLOWN
        last_digit = 0.5 * 10.0 ** -len(str(figure).partition(".")[2])
        assert math.degrees(shift) == pytest.approx(figure, abs=last_digit)


@every_angle
@spinners
def test_two_actuators_at_the_mounting_angle_give_both_pulses(A: float, C: float, spin: float, degrees: float) -> None:
    """The second actuator stands along ω, either way, as the axis has gone half a turn; at small angles -σπA/C."""
    size = cones.transverse_rate(A, C, math.radians(degrees), spin)
    halves, angle = damping.half_pulses(A, C, size, spin), damping.mounting_angle(A, C, size, spin)
    assert 0.0 <= angle < math.pi
    _, _, omega = after(A, C, spin, complex(size), (0.0, complex(-halves.first)), (halves.wait, 0j))
    assert abs((omega * cmath.exp(-1j * angle)).imag) < FLOWN * max(size, 1.0)
    if degrees < 1e-3:
        assert cmath.exp(2j * angle) == pytest.approx(cmath.exp(-2j * math.copysign(math.pi, spin) * A / C), abs=1e-11)


TABLE = {+1: ("omega2", +1), -1: ("omega2", -1), +2: ("omega1", -1), -2: ("omega1", +1)}
"""Magnus 1970 before fig. 5: thruster -> the component that passes zero, and the sign of its rate of change."""


def moment(A: float, C: float, spin: float, thruster: int, mirrored: bool) -> complex:
    """ω of size 1/5 at the moment at which the table fires a thruster, by the rates of change of Euler's equations."""
    passing, sign = TABLE[thruster]
    rate = (A - C) / A * spin
    for omega in (0.2 + 0j, -0.2 + 0j, 0.2j, -0.2j):
        slope = {"omega1": rate * omega.imag, "omega2": -rate * omega.real}[passing]
        zero = {"omega1": omega.real, "omega2": omega.imag}[passing]
        if zero == 0.0 and slope * sign * (-1 if mirrored else 1) > 0:
            return omega
    raise AssertionError("the table names no moment")


@pytest.mark.parametrize("thruster", TABLE)
@plain_spinners
def test_sign_table_of_magnus(A: float, C: float, spin: float, thruster: int) -> None:
    """The rule "ω against the torque" is the table for aω3 > 0, else its mirror image; the other one pumps."""
    direction = complex(math.copysign(1, thruster)) * (1 if abs(thruster) == 1 else 1j)
    damps, pumps = (moment(A, C, spin, thruster, wrong == ((A - C) * spin > 0)) for wrong in (False, True))
    for omega, phase, change in ((damps, 0.0, -3.0 / A), (pumps, math.pi, 3.0 / A)):
        assert abs(damping.phase_to_oppose(omega, direction)) == phase
        _, _, left = after(A, C, spin, omega, (0.0, 3.0 * direction))
        assert abs(left) == pytest.approx(abs(omega) + change, rel=4 * EPS)


@pytest.mark.parametrize("phase", [0.0, 0.4, -1.7, 3.0])
@pytest.mark.parametrize("torque", [5.0 + 0j, -2.0 + 1j, 0.3j])
def test_phase_to_oppose_is_the_turn_left_to_the_opposite_of_the_torque(phase: float, torque: complex) -> None:
    """ω turns at -aω3: after the time phase/(aω3) it stands against the torque."""
    omega = cmath.rect(0.3, phase)
    then = omega * cmath.exp(-1j * damping.phase_to_oppose(omega, torque))
    assert then / abs(then) == pytest.approx(-torque / abs(torque), abs=8 * EPS)
