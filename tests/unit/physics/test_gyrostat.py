"""Bodies with a wheel: closed forms, series and cones against DOP853, with H3 = Cω3 + h in the place of Cω3."""

import cmath
import math

import numpy as np
import pytest
from numpy.typing import NDArray
from support import reference
from support.cases import spread
from support.places import case

from nutdamp.files.reader import load_spacecraft
from nutdamp.flight.dynamics import make_dynamics
from nutdamp.physics import attitude, batch, energy_sink, response, taylor, triaxial
from nutdamp.physics import body as rigid_body
from nutdamp.spacecraft import requirements

Array = NDArray[np.float64]

MOMENTS = [(120.0, 80.0), (100.0, 160.0), (100.0, 100.0), (80.0, 160.0)]
MOTIONS = [(3.0, 90.0), (0.0, 60.0), (0.0, -60.0), (-2.0, 250.0), (1.0, -300.0), (0.3, 5.0)]
"""ω3 in rad/s and h in N m s: both senses, at rest about axis 3, and H3 against the spin."""

gyrostats = spread(
    ("A", "C", "spin", "wheel"), [(*moments, *motion) for moments in MOMENTS for motion in MOTIONS], quick=8
)

OMEGA = 0.25 - 0.4j
TIMES = np.array([0.4, 3.0, 20.0])


def start(A: float, C: float, spin: float, wheel: float) -> tuple[reference.Motion, Array]:
    """The motion of the reference at t = 0, and its attitude as a quaternion."""
    rates = reference.vector(OMEGA.real, OMEGA.imag, spin)
    rotation = reference.frame_n((A, A, C), rates, wheel)
    return reference.Motion(rates, rotation), attitude.from_matrix(rotation)


def apart(quaternions: Array, motions: list[reference.Motion]) -> float:
    """Largest difference of attitudes."""
    return max(float(np.abs(attitude.matrix(q) - m.rotation).max()) for q, m in zip(quaternions, motions, strict=True))


@gyrostats
def test_arcs(A: float, C: float, spin: float, wheel: float) -> None:
    """ω turns in the body at ν = ω3 - H3/A, and the body about H at |H|/A and about axis 3 at ν."""
    motion, quaternion = start(A, C, spin, wheel)
    flown = reference.coast((A, A, C), motion, np.zeros(3), TIMES, wheel=wheel)
    arc = attitude.arc(A, C, quaternion, OMEGA, spin, TIMES, wheel)
    ends = [attitude.arc_end(A, C, quaternion, OMEGA, spin, time, wheel) for time in TIMES.tolist()]
    assert apart(arc, flown) < 1e-10
    assert np.array(ends) == pytest.approx(arc, abs=1e-12)
    none = np.zeros(0)
    omega, _ = response.impulse_sum(TIMES, OMEGA, spin, A, C, none, none.astype(complex), none, wheel)
    assert omega == pytest.approx([complex(*m.rates[:2]) for m in flown], abs=1e-10)


@gyrostats
def test_arcs_with_dissipation(A: float, C: float, spin: float, wheel: float) -> None:
    """Dissipation changes the whole of H3, and the wheel keeps its share of it."""
    motion, quaternion = start(A, C, spin, wheel)
    sense = math.copysign(1.0, C * spin + wheel)
    for growth in (0.05, -0.04):
        flown = reference.sinking((A, A, C), motion, np.zeros(3), TIMES, growth, wheel)
        omega, spins, turned = energy_sink.arc(A, C, growth, quaternion, OMEGA, spin, TIMES, wheel, sense)
        assert np.column_stack([omega.real, omega.imag, spins]) == pytest.approx(
            np.array([m.rates for m in flown]), abs=1e-10
        )
        assert apart(turned, flown) < 1e-10
        end = energy_sink.arc(A, C, growth, quaternion, OMEGA, spin, 20.0, wheel, sense)
        assert end[0] == pytest.approx(omega[-1], abs=1e-12)
        assert end[2] == pytest.approx(turned[-1], abs=1e-12)
        rates = energy_sink.rates_on_arc(A, C, growth, OMEGA, spin, TIMES, wheel, sense)
        assert rates[0] == pytest.approx(omega, abs=1e-12)
        assert rates[1] == pytest.approx(spins, abs=1e-12)


@pytest.mark.parametrize(
    ("time", "degrees", "spin"),
    [(120.0, 8.372, None), (240.0, 22.237, None), (400.0, 27.431, 2.7927), (1e6, 27.606, None)],
)
def test_growth_ends_where_omega_stands_still_in_the_body(time: float, degrees: float, spin: float | None) -> None:
    """By DOP853 of E(θ); with tan θ e^{κt} it was 8.72, 34.0 and 78.3 deg, and -8.63 rad/s."""
    body = load_spacecraft(case("wheel-growth.yaml"))
    end = make_dynamics(body).path(body.initial, 0.0, time, most=1)[1]
    moments, rates = body.inertia.moments, end.rates
    assert math.degrees(reference.nutation(moments, rates, 1.0, 1800.0)) == pytest.approx(degrees, abs=6e-4)
    assert spin is None or end.spin == pytest.approx(spin, abs=1e-4)
    assert requirements.idle(body, time) == pytest.approx(reference.nutation(moments, rates, 1.0, 1800.0), abs=1e-11)
    if time < 1e3:
        assert requirements.reached(body, math.radians(degrees)) == pytest.approx(time, abs=0.1)
        assert requirements.reached(body, math.radians(28.0)) == math.inf


def test_a_complex_step_gives_the_derivative_with_a_wheel() -> None:
    """As dispersed cases take it, and by any share of the wheel: toward an angle at rest, and past 90 deg."""
    for shares in ((8.8, -7.8), (0.4, 0.6), (-1.5, 2.5)):
        theta, time = math.radians(30.0), np.array([40.0 + 1e-30j])
        course = energy_sink.courses(0.02, math.cos(theta), math.sin(theta) ** 2, time, shares)
        tilt = math.atan2(math.sin(theta) * course.transverse[0].real, course.along[0].real)
        rise = 0.02 * math.sin(tilt) * (shares[0] * math.cos(tilt) + shares[1])
        assert course.travel[0].imag / 1e-30 == pytest.approx(math.cos(tilt), rel=1e-12)
        assert course.along[0].imag / 1e-30 == pytest.approx(-math.sin(tilt) * rise, rel=1e-9, abs=1e-12)
        assert math.hypot(course.cosine[0].real, math.sin(theta) * course.sine[0].real) == pytest.approx(1.0, rel=1e-13)


@gyrostats
def test_half_pulses(A: float, C: float, spin: float, wheel: float) -> None:
    """(22) at every angle, its wait and the turn of ω in between: no nutation left, and H where it was."""
    motion, _ = start(A, C, spin, wheel)
    axial = C * spin + wheel
    halves = rigid_body.half_pulses(A, C, abs(OMEGA), axial / C)
    turn = rigid_body.turn_between_halves(A, C, abs(OMEGA), spin, wheel)
    pushes = [-OMEGA / abs(OMEGA), -OMEGA / abs(OMEGA) * cmath.exp(1j * turn)]
    kicks = [
        reference.Kick(t, reference.vector((size * push).real, (size * push).imag, 0.0))
        for t, size, push in zip((0.0, halves.wait), halves[:2], pushes, strict=True)
    ]
    end = reference.fly((A, A, C), motion.rates, kicks, halves.wait, motion.rotation, wheel=wheel)
    assert np.abs(end.rates[:2]).max() < 1e-10
    shift = reference.angle(reference.momentum((A, A, C), end, wheel), reference.momentum((A, A, C), motion, wheel))
    assert shift < 1e-10
    assert halves.first + halves.second == pytest.approx(A * abs(OMEGA), rel=1e-14)


@gyrostats
def test_a_wide_pulse_acts_by_its_width_factor(A: float, C: float, spin: float, wheel: float) -> None:
    motion, _ = start(A, C, spin, wheel)
    on_time, torque, axial = 1.3, 4.0 + 3.0j, 6.0
    nutation = ((A - C) * spin - wheel) / A
    factor = response.width_factor(nutation, (A - C) / A * axial / C, on_time)
    kick = torque * on_time * factor / A
    after = ((A - C) * (spin + axial * on_time / C) - wheel) / A
    omega = (OMEGA * cmath.exp(-0.5j * nutation * on_time) + kick) * cmath.exp(-0.5j * after * on_time)
    push = reference.Push(0.0, on_time, reference.vector(torque.real, torque.imag, axial))
    end = reference.fly((A, A, C), motion.rates, [push], on_time, motion.rotation, wheel=wheel)
    assert complex(*end.rates[:2]) == pytest.approx(omega, abs=1e-10)


THREE = [(120.0, 100.0, 80.0), (90.0, 120.0, 160.0), (80.0, 120.0, 100.0)]


@spread(("moments", "spin", "wheel", "growth"), [
    (moments, spin, wheel, growth)
    for moments in [*THREE, (100.0, 100.0, 70.0)]
    for spin, wheel in [(2.0, 90.0), (0.0, -60.0), (-1.0, 400.0)]
    for growth in (0.0, 0.03)
], quick=6)  # fmt: skip
def test_series_under_a_torque(moments: tuple[float, float, float], spin: float, wheel: float, growth: float) -> None:
    """One body and many at once, with and without dissipation, on a short stretch and on a long one."""
    rates, torque = reference.vector(0.2, -0.1, spin), reference.vector(5.0, -2.0, 3.0)
    rotation = reference.frame_n(moments, rates, wheel)
    begin, quaternion = reference.Motion(rates, rotation), attitude.from_matrix(rotation)
    for time in (0.7, 12.0):
        sense, span = math.copysign(1.0, moments[2] * spin + wheel), np.array([time])
        forcing = taylor.Forcing(growth=growth, wheel=wheel, sense=sense)
        flown = (
            reference.sinking(moments, begin, torque, span, growth, wheel)
            if growth
            else reference.coast(moments, begin, torque, span, wheel=wheel)
        )
        body, turned = taylor.integrate(moments, torque, rates, quaternion, 0.0, time, forcing)[-1].final
        assert body == pytest.approx(flown[0].rates, abs=1e-10)
        assert apart(turned[None], flown) < 1e-10
        many = batch.Bodies(np.tile(moments, (3, 1)).T, np.zeros(3), forcing._replace(wheel=np.full(3, wheel)))
        here = batch.MotionStretch(
            many, np.zeros(3), np.tile(rates, (3, 1)).T, np.tile(quaternion, (3, 1)).T, np.tile(torque, (3, 1)).T
        )
        batch.advance(here, np.array([time, 0.5 * time, time]))
        assert here.rates[:, 2] == pytest.approx(flown[0].rates, abs=1e-10)
        assert apart(here.quaternion[:, 2][None], flown) < 1e-10
        begun = batch.MotionStretch(many, np.zeros(3), np.tile(rates, (3, 1)).T, np.tile(quaternion, (3, 1)).T)
        batch.advance(begun, np.full(3, time))
        free = (
            reference.sinking(moments, begin, np.zeros(3), span, growth, wheel)
            if growth
            else reference.coast(moments, begin, np.zeros(3), span, wheel=wheel)
        )
        assert begun.rates[:, 1] == pytest.approx(free[0].rates, abs=1e-10)


@spread("seed", range(24), quick=4)
def test_widest_cones_of_many_bodies_are_those_that_they_reach(seed: int) -> None:
    """Any moments, wheels and motions, over the separatrix and reversed: against the motion sampled densely."""
    draws = np.random.default_rng(seed)
    moments = np.sort(draws.uniform(60.0, 110.0, 3))[draws.permutation(3)]
    rates = draws.normal(size=3) * [0.5, 0.5, 2.0]
    if seed % 5 == 1:  # a small nutation, of a body that it does not leave
        rates[:2] *= 1e-5
        moments.sort()
    wheel = float(draws.normal() * 150.0) if seed % 4 else 0.0
    rates[2] = 0.0 if seed % 7 == 0 else rates[2]
    sense = math.copysign(1.0, moments[2] * rates[2] + wheel)
    series = taylor.integrate(
        (moments[0], moments[1], moments[2]), np.zeros(3), rates, np.array([1.0, 0, 0, 0]), 0.0, 60.0,
        taylor.Forcing(wheel=wheel),
    )  # fmt: skip
    body = np.concatenate([piece.at(np.linspace(piece.start, piece.start + piece.duration, 60))[0] for piece in series])
    momentum = body * moments + [0.0, 0.0, wheel]
    angles = np.arctan2(np.hypot(momentum[:, 0], momentum[:, 1]), sense * momentum[:, 2])
    nutation, cone = (float(angle) for angle in triaxial.widest_cones(moments, rates, sense, wheel))
    assert angles.max() <= nutation + 1e-11
    assert nutation == pytest.approx(angles.max(), rel=2e-3)
    widest = int(np.argmax(angles))
    reached = math.atan2(math.hypot(*body[widest, :2]), sense * body[widest, 2])
    assert cone == pytest.approx(reached, rel=0.02, abs=1e-9)


@pytest.mark.parametrize("spin", [2.0, 0.0, -1.5])
def test_stability_and_rate_of_a_small_nutation(spin: float) -> None:
    """The middle axis can be stabilised, and any other be made unstable: p² = -(H3 - I1ω3)(H3 - I2ω3)/(I1 I2)."""
    for moments in THREE:
        for wheel in (-400.0, -31.0, 5.0, 61.0, 400.0):
            grows = rigid_body.growth(moments, spin, wheel)
            small = np.array([1e-7, 0.0, spin])
            until = min(15.0 * grows.growth_time, 300.0) if grows.squared_exponent > 0.0 else 40.0
            series = taylor.integrate(
                moments, np.zeros(3), small, np.array([1.0, 0, 0, 0]), 0.0, until, taylor.Forcing(wheel=wheel)
            )
            sizes = np.abs(np.concatenate([piece.at(np.array([piece.start]))[0] for piece in series])[:, :2]).max()
            assert grows.stable is bool(sizes < 1e-5)
            if grows.stable:
                rate = triaxial.body_nutation_rate(moments, spin, wheel)
                assert rate * rate == pytest.approx(-grows.squared_exponent, rel=1e-12)
                turn = reference.coast(
                    moments, reference.Motion(small, np.eye(3)), np.zeros(3), np.array([2.0 * math.pi / abs(rate)]),
                    wheel=wheel,
                )[0]  # fmt: skip
                assert turn.rates[:2] == pytest.approx(small[:2], abs=1e-11)
            else:
                with pytest.raises(ValueError, match="no nutation rate"):
                    triaxial.body_nutation_rate(moments, spin, wheel)
