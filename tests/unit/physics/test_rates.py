"""The impulse sum, Magnus 1970 (17), and what finite pulses do to ω, against DOP853 and quadrature."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from support import reference
from support.builders import within

from nutdamp.physics import rates

EPS = float(np.finfo(float).eps)
FLOWN = 1e-11
"""rad/s; what DOP853 at 1e-13 a step adds up over the flights here, at rates of a few rad/s."""

BODIES = [(120.0, 80.0), (80.0, 120.0), (100.0, 100.0), (100.0, 200.0), (100.0, 5.0)]
SPINS = [3.0, -3.0]


def summed(
    A: float, C: float, start: reference.Array, kicks: list[reference.Kick], until: float
) -> tuple[complex, float]:
    omega, spin = rates.impulse_sum(
        np.array([until]),
        complex(start[0], start[1]),
        float(start[2]),
        A,
        C,
        np.array([kick.t for kick in kicks]),
        np.array([complex(kick.impulse[0], kick.impulse[1]) for kick in kicks]),
        np.array([kick.impulse[2] for kick in kicks]),
    )
    return complex(omega[0]), float(spin[0])


# --- (17) ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), BODIES)
def test_magnus_17_transverse_impulses(A: float, C: float, spin: float) -> None:
    start = reference.vector(0.9, -0.4, spin)
    kicks = [reference.Kick(t, reference.vector(40 - 20 * t, 15 * t, 0)) for t in (0.0, 0.7, 2.5, 2.9)]
    end = reference.fly((A, A, C), start, kicks, 6.0)
    omega, spin_after = summed(A, C, start, kicks, 6.0)
    assert omega == pytest.approx(complex(end.rates[0], end.rates[1]), abs=FLOWN)
    assert spin_after == spin


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), BODIES)
def test_magnus_17_axial_impulses_through_spin_reversal(A: float, C: float, spin: float) -> None:
    """ω3 goes from +3 over +1, 0 and -2 to -4 rad/s (or mirrored): the arcs stay exact, at no spin too."""
    start = reference.vector(0.2, 0.5, spin)
    steps = [(0.5, -2), (1.5, -1), (2.2, -2), (4.0, -2)]
    kicks = [reference.Kick(t, reference.vector(10 * t, -5, math.copysign(C, spin) * step)) for t, step in steps]
    end = reference.fly((A, A, C), start, kicks, 7.0)
    omega, spin_after = summed(A, C, start, kicks, 7.0)
    assert end.rates[2] == pytest.approx(-4 * math.copysign(1, spin), abs=FLOWN)
    assert spin_after == pytest.approx(end.rates[2], abs=FLOWN)
    assert omega == pytest.approx(complex(end.rates[0], end.rates[1]), abs=FLOWN)


def test_magnus_17_without_impulses_omega_turns_at_minus_a_omega3() -> None:
    times = np.linspace(0.0, 20.0, 7)
    nothing = np.array([])
    omega, spin = rates.impulse_sum(times, 0.3 + 0.4j, -2.0, 120.0, 80.0, nothing, nothing.astype(complex), nothing)
    assert omega == pytest.approx((0.3 + 0.4j) * np.exp(2j * times / 3), abs=20 * EPS)
    assert np.array_equal(spin, np.full(7, -2.0))


def test_magnus_17_at_the_moment_of_an_impulse_it_has_been_given() -> None:
    """The unit step of (17): 0 before t_v, 1 from t_v on."""
    at = np.array([1.0])
    before, after = (
        rates.impulse_sum(np.array([t]), 0j, 1.0, 50.0, 50.0, at, np.array([100.0 + 0j]), np.array([25.0]))
        for t in (math.nextafter(1.0, 0.0), 1.0)
    )
    assert (before[0][0], before[1][0]) == (0.0, 1.0)
    assert (after[0][0], after[1][0]) == (2.0, 1.5)


# --- width factor ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize("on_time", [1e-3, 0.4, 3.0, 9.0])
@pytest.mark.parametrize(("A", "C"), BODIES)
def test_rectangular_pulse_acts_on_omega_as_its_impulse_times_sinc_at_its_centre(
    A: float, C: float, on_time: float, spin: float
) -> None:
    """Exactly, at any width and any angle: M τ sinc(aω3τ/2)."""
    start, torque = reference.vector(0.3, -0.2, spin), reference.vector(6.0, 9.0, 0.0)
    begin = 1.0
    end = begin + on_time
    flown = reference.fly((A, A, C), start, [reference.Push(begin, end, torque)], end)
    half = 0.5 * (A - C) / A * spin * on_time
    sinc = math.sin(half) / half if half else 1.0
    factor = rates.width_factor((A - C) / A, spin, 0.0, on_time)
    assert factor == pytest.approx(sinc, abs=2 * EPS)
    omega, _ = summed(A, C, start, [reference.Kick(begin + 0.5 * on_time, factor.real * on_time * torque)], end)
    assert omega == pytest.approx(complex(flown.rates[0], flown.rates[1]), abs=FLOWN)


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize("axial", [0.5, -4.0, 60.0, -120.0])
@pytest.mark.parametrize(("A", "C"), BODIES)
def test_pulse_with_axial_torque_acts_as_an_impulse_times_the_width_factor_at_its_centre(
    A: float, C: float, axial: float, spin: float
) -> None:
    """Where half the width is turned at the old spin and half at the new one; through spin reversal too."""
    start, torque, on_time = reference.vector(0.3, -0.2, spin), reference.vector(6.0, 9.0, axial), 4.0
    flown = reference.fly((A, A, C), start, [reference.Push(0.0, on_time, torque)], on_time)
    factor = rates.width_factor((A - C) / A, spin, axial / C, on_time)
    pushed = factor * complex(torque[0], torque[1]) * on_time
    kick = reference.Kick(0.5 * on_time, reference.vector(pushed.real, pushed.imag, axial * on_time))
    omega, spin_after = summed(A, C, start, [kick], on_time)
    assert spin_after == pytest.approx(flown.rates[2], abs=FLOWN)
    # Slender bodies are spun up to a hundred rad/s here; the reference keeps its error relative to that.
    assert omega == pytest.approx(complex(flown.rates[0], flown.rates[1]), abs=FLOWN * max(1.0, abs(spin_after)))


@given(
    st.floats(-1.0, 1.0),
    st.floats(-10.0, 10.0),
    st.floats(-5.0, 5.0),
    st.floats(1e-3, 5.0),
)
def test_width_factor_by_quadrature(a: float, spin: float, spin_rate: float, on_time: float) -> None:
    """F = (1/τ) ∫ exp(i a (spin s + spin_rate (s + τ/2)²/2)) ds over |s| <= τ/2."""

    def phase(s: float) -> float:
        return a * (spin * s + 0.5 * spin_rate * (s + 0.5 * on_time) ** 2)

    half = 0.5 * on_time
    real, imaginary = (
        quad(lambda s, part=part: part(phase(s)), -half, half, epsabs=1e-13, epsrel=1e-13, limit=500)[0] / on_time
        for part in (math.cos, math.sin)
    )
    assert rates.width_factor(a, spin, spin_rate, on_time) == pytest.approx(complex(real, imaginary), abs=1e-12)


@pytest.mark.parametrize("spin_rate", [0.05, -0.2])
def test_width_factor_of_long_pulses_by_quadrature(spin_rate: float) -> None:
    """Over some hundred panels, against Simpson's rule on a fine grid."""
    a, spin, on_time = 0.7, 3.0, 90.0
    s = np.linspace(-0.5 * on_time, 0.5 * on_time, 400_001)
    values = np.exp(1j * a * (spin * s + 0.5 * spin_rate * (s + 0.5 * on_time) ** 2))
    weights = np.array([1.0, *([4.0, 2.0] * 199_999), 4.0, 1.0]) / (3.0 * 400_000)
    assert rates.width_factor(a, spin, spin_rate, on_time) == pytest.approx(complex(weights @ values), abs=1e-12)


def test_width_factor_is_continuous_where_the_axial_torque_vanishes() -> None:
    plain = rates.width_factor(0.5, 3.0, 0.0, 1.5)
    assert rates.width_factor(0.5, 3.0, 1e-14, 1.5) == pytest.approx(plain, abs=1e-13)


@given(st.floats(-1.0, 1.0), st.floats(-10.0, 10.0), st.floats(-5.0, 5.0), st.floats(0.0, 50.0))
def test_width_only_loses(a: float, spin: float, spin_rate: float, on_time: float) -> None:
    assert abs(rates.width_factor(a, spin, spin_rate, on_time)) <= 1.0 + 1e-13


# --- on-time of one pulse --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), BODIES)
def test_one_pulse_of_the_on_time_of_the_formula_leaves_no_omega(A: float, C: float, spin: float) -> None:
    """τ = (2/(aω3)) asin(aω3 A|ω|/(2M)), centred where ω opposes the torque (US patent 4504032)."""
    a, size, torque = (A - C) / A, 0.2, 40.0
    on_time = rates.on_time_for(A * size, torque, a, spin, 0.0, math.inf)
    assert on_time is not None
    if a:
        assert on_time == pytest.approx(2 / (a * spin) * math.asin(a * spin * A * size / (2 * torque)), rel=4 * EPS)
    # ω0 such that ω = -|ω| at the centre of the pulse along +1.
    omega0 = -size * cmath.exp(0.5j * a * spin * on_time)
    start = reference.vector(omega0.real, omega0.imag, spin)
    push = reference.Push(0.0, on_time, reference.vector(torque, 0, 0))
    end = reference.fly((A, A, C), start, [push], on_time)
    assert np.abs(end.rates[:2]).max() < FLOWN


@pytest.mark.parametrize("a", [1e-3, -1e-6, 1e-9, -1e-12, 1e-300, 0.0])
def test_on_time_goes_to_impulse_over_torque_for_a_to_zero(a: float) -> None:
    """asin x / x = 1 + x²/6 …: nothing cancels."""
    impulse, torque, spin = 12.0, 4.0, 2.0
    x = 0.5 * a * spin * impulse / torque
    on_time = rates.on_time_for(impulse, torque, a, spin, 0.0, math.inf)
    assert on_time == pytest.approx(3.0 * (1 + x * x / 6), rel=max(x**4, 4 * EPS))


def test_one_pulse_can_do_no_more_than_twice_the_torque_over_the_body_rate() -> None:
    a, spin, torque = 0.5, -2.0, 3.0
    most = 2 * torque / abs(a * spin)
    assert rates.on_time_for(most * (1 - 1e-12), torque, a, spin, 0.0, math.inf) == pytest.approx(math.pi, rel=1e-5)
    assert rates.on_time_for(most * (1 + 1e-12), torque, a, spin, 0.0, math.inf) is None


def test_on_time_longer_than_allowed_is_none() -> None:
    assert rates.on_time_for(10.0, 1.0, 0.0, 1.0, 0.0, 10.0) == 10.0
    assert rates.on_time_for(10.0, 1.0, 0.0, 1.0, 0.0, 9.999) is None
    assert rates.on_time_for(10.0, 1.0, 0.0, 1.0, 0.1, 9.999) is None


def test_no_impulse_takes_no_time() -> None:
    assert rates.on_time_for(0.0, 5.0, 0.3, 1.0, 0.0, math.inf) == 0.0
    assert rates.on_time_for(0.0, 5.0, 0.3, 1.0, 0.2, math.inf) == 0.0


@given(
    st.floats(-0.95, 0.95).filter(lambda a: abs(a) > 0.01),
    st.sampled_from([-3.0, -0.7, 0.7, 3.0]),
    st.floats(-0.1, 0.1),
    st.floats(0.01, 0.95),
)
def test_on_time_with_axial_torque_gives_the_impulse_requested(
    a: float, spin: float, share: float, part: float
) -> None:
    """While the spin changes by less than a third: found, and exact to rounding."""
    torque = 5.0
    rate = abs(a * spin)
    spin_rate = share * abs(spin) * rate / math.pi * 3
    impulse = part * 0.9 * 2 * torque / rate
    on_time = rates.on_time_for(impulse, torque, a, spin, spin_rate, math.inf)
    assert on_time is not None
    given_ = torque * on_time * abs(rates.width_factor(a, spin, spin_rate, on_time))
    assert given_ == pytest.approx(impulse, rel=1e-13)


def test_on_time_is_exact_where_the_axial_torque_reverses_the_spin() -> None:
    """A spin that passes zero within the pulse bends the curve; false position still finds the crossing to rounding."""
    a, spin, spin_rate, impulse = 0.847171258807392, -0.8766341758481142, 0.47537038364894224, 2.665260255191444
    on_time = rates.on_time_for(impulse, 1.0, a, spin, spin_rate, math.inf)
    assert on_time is not None
    assert on_time * abs(rates.width_factor(a, spin, spin_rate, on_time)) == pytest.approx(impulse, rel=1e-13)


def test_on_time_is_found_where_the_pulse_does_most_before_half_a_period_is_over() -> None:
    """At the end of half a period less is reached than in between (30.6 N m s of 1/3): the first crossing counts."""
    a, spin, spin_rate, torque = 0.21068867019307735, -0.5783760751564644, 0.208649381851118, 2.947761893524505
    on_time = rates.on_time_for(21.796764904268404, torque, a, spin, spin_rate, math.inf)
    assert on_time is not None
    assert torque * on_time * abs(rates.width_factor(a, spin, spin_rate, on_time)) == pytest.approx(21.796764904268404)


def test_on_time_of_a_near_sphere_with_axial_torque_takes_no_time_to_find() -> None:
    """The search begins with the pulse without axial torque, not with one of 10⁹ turns of the body."""
    with within(100_000):
        on_time = rates.on_time_for(10.0, 5.0, 1e-9, 3.0, 0.01, math.inf)
    assert on_time == pytest.approx(2.0, rel=1e-12)


@given(
    *(st.sampled_from([0.0, 1e-320, 1e-300, 1e-30, 1.0, 1e30, 1e300]) for _ in range(3)),
    st.sampled_from([-1.0, -1e-9, 0.0, 1e-15, 0.3, 0.99]),
    st.sampled_from([1e-300, 1.0, -3.0, 1e30]),
    st.sampled_from([0.0, 1e-300, 0.1, -5.0, 1e10]),
)
def test_the_search_for_an_on_time_ends(
    impulse: float, torque: float, longest: float, a: float, spin: float, spin_rate: float
) -> None:
    """Also where the on-time without axial torque is too small for a number: it was then stretched for ever."""
    with within(3_000_000):
        on_time = rates.on_time_for(impulse, torque or 1.0, a, spin, spin_rate, longest or math.inf)
    assert on_time is None or 0.0 <= on_time <= (longest or math.inf)
