"""Flights: exact arcs, the impulse sum and the real widths, against conservation laws and the reference integrator."""

from __future__ import annotations

import cmath
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from support import reference
from support.builders import events, pulse, spinner, transverse
from support.cases import spread

from nutdamp import flight
from nutdamp.physics import attitude
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Attitude, Inertia, Spacecraft, Vector

EPS = float(np.finfo(float).eps)
UNTIL = 12.0

# --- what is flown ---------------------------------------------------------------------------------------------------

angles = st.floats(-math.pi, math.pi)
spins = st.floats(0.5, 3.0) | st.floats(-3.0, -0.5)


@st.composite
def symmetric_spinners(draw: st.DrawFn) -> Spacecraft:
    a = draw(st.floats(-1.0, 0.9) | st.sampled_from([0.0, 1e-6, -1e-6, -1.0]))
    degrees = draw(st.floats(0.1, 80.0))
    return spinner(100.0, 100.0 * (1 - a), draw(spins), degrees, draw(angles))


@st.composite
def triaxial_spinners(draw: st.DrawFn) -> Spacecraft:
    """Triangle inequality kept: I1 = y² + z² and round of a mass distribution."""
    x, y, z = (draw(st.floats(30.0, 80.0)) for _ in range(3))
    return spinner(
        spin=draw(spins), degrees=draw(st.floats(0.1, 60.0)), phase=draw(angles), moments=(y + z, z + x, x + y)
    )


@st.composite
def schedules(draw: st.DrawFn, *, ideal: bool = False, axial: bool = True) -> Schedule:
    """Up to five pulses of different channels, which may overlap; widths from none to longer than a nutation."""
    pulses = []
    for index in range(draw(st.integers(0, 5))):
        on_time = 0.0 if ideal else draw(st.sampled_from([0.0, 0.01]) | st.floats(0.05, 3.0))
        t = draw(st.floats(0.5 * on_time, UNTIL - 0.5 * on_time))
        impulse = [draw(st.floats(-40.0, 40.0)) for _ in range(2)] + [draw(st.floats(-60.0, 60.0)) if axial else 0.0]
        pulses.append(pulse(t, on_time, np.array(impulse), f"T{index}"))
    return Schedule(tuple(pulses))


def state_at(flown: flight.Flight, time: float) -> tuple[Vector, Vector]:
    """Rates and rotation matrix at ``time`` on the last leg that holds it."""
    leg = next(leg for leg in reversed(flown.legs) if leg.start <= time <= leg.end)
    rates, quaternions = leg.path.motion(np.array([time]))
    return rates[0], attitude.matrix(quaternions[0])


# --- against the reference -------------------------------------------------------------------------------------------


@settings(max_examples=40)
@given(symmetric_spinners() | triaxial_spinners(), schedules())
def test_flown_is_the_motion_of_the_reference_integrator(spacecraft: Spacecraft, made: Schedule) -> None:
    """Overlapping pulses, axial torques, spin reversal and three different moments included; to 1e-9 rad."""
    moments = spacecraft.inertia.moments
    flown = flight.flown(spacecraft, made, UNTIL)
    rotation = attitude.matrix(spacecraft.initial.quaternion)
    for time, got in ((made.end, flown.settled), (UNTIL, None)):
        expected = reference.fly(moments, spacecraft.omega0, events(made), time, rotation)
        rates, turn = state_at(flown, time) if got is None else (got.rates, attitude.matrix(got.quaternion))
        size = max(1.0, float(np.linalg.norm(expected.rates)))
        assert rates == pytest.approx(expected.rates, abs=1e-9 * size)
        assert reference.turned(turn, expected.rotation) < 1e-9


@settings(max_examples=25)
@given(symmetric_spinners(), schedules(ideal=True))
def test_by_impulses_is_the_motion_of_the_reference_integrator(spacecraft: Spacecraft, made: Schedule) -> None:
    moments = spacecraft.inertia.moments
    summed = flight.by_impulses(spacecraft, made, UNTIL)
    expected = reference.fly(
        moments, spacecraft.omega0, events(made), UNTIL, attitude.matrix(spacecraft.initial.quaternion)
    )
    rates, turn = state_at(summed, UNTIL)
    assert rates == pytest.approx(expected.rates, abs=1e-9 * max(1.0, float(np.linalg.norm(expected.rates))))
    assert reference.turned(turn, expected.rotation) < 1e-9


def test_start_is_the_attitude_of_the_file_or_else_frame_n() -> None:
    quaternion = np.array([0.5, -0.5, 0.5, 0.5])
    given_ = spinner(attitude=Attitude(quaternion))
    assert np.array_equal(given_.initial.quaternion, quaternion)
    without = spinner()
    frame = reference.frame_n(without.inertia.moments, without.omega0)
    assert attitude.matrix(without.initial.quaternion) == pytest.approx(frame, abs=4 * EPS)


@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_frame_n_has_z_along_h_for_three_different_moments_too(spin: float) -> None:
    """The frame is laid by the true H, not by that of the equivalent symmetric body (0.45° off)."""
    spacecraft = spinner(moments=(120.0, 100.0, 80.0), spin=spin, degrees=5.0)
    start = flight.flown(spacecraft, Schedule(), 1.0).sampled(2, 1.0)
    h = start.momentum[0] / np.linalg.norm(start.momentum[0])
    assert h == pytest.approx([0, 0, 1], abs=4 * EPS)
    assert start.axis[0, 1] == pytest.approx(0.0, abs=4 * EPS)
    assert start.axis[0, 0] > 0.0


def test_start_turns_from_principal_axes_through_those_of_the_file() -> None:
    """The file's quaternion is for the axes of the file; principal axis j stands at q(axes[:, j])."""
    axes = reference.frame_n((1.0, 2.0, 3.0), reference.vector(0.3, 0.2, 1.0))
    spacecraft = replace(
        spinner(attitude=Attitude(np.array([0.5, -0.5, 0.5, 0.5]))), inertia=Inertia((120.0, 120.0, 80.0), axes)
    )
    expected = attitude.matrix(np.array([0.5, -0.5, 0.5, 0.5])) @ axes
    assert attitude.matrix(spacecraft.initial.quaternion) == pytest.approx(expected, abs=8 * EPS)


# --- conserved on arcs -----------------------------------------------------------------------------------------------


@settings(max_examples=30)
@given(symmetric_spinners() | triaxial_spinners())
def test_momentum_and_energy_stay_on_arcs(spacecraft: Spacecraft) -> None:
    track = flight.flown(spacecraft, Schedule(), 50.0).sampled(40, 50.0)
    first = track.momentum[0]
    # About two roundings in each of the hundred-odd steps of the integration; exact arcs take one.
    assert track.momentum == pytest.approx(np.tile(first, (40, 1)), abs=1000 * EPS * float(np.linalg.norm(first)))
    energies = [reference.energy(spacecraft.inertia.moments, rates) for rates in track.rates]
    assert energies == pytest.approx([energies[0]] * 40, rel=1000 * EPS)


@settings(max_examples=30)
@given(symmetric_spinners(), schedules())
def test_momentum_stays_between_pulses(spacecraft: Spacecraft, made: Schedule) -> None:
    """Along the whole flight |H| changes only while a torque acts or as an impulse is given."""
    flown = flight.flown(spacecraft, made, UNTIL)
    for leg in flown.legs:
        acting = any(pulse.start <= leg.start and leg.end <= pulse.end for pulse in made if pulse.on_time > 0.0)
        if not acting:
            rates, quaternions = leg.path.motion(np.linspace(leg.start, leg.end, 5))
            h = attitude.rotate(quaternions, rates * np.array(flown.moments))
            assert h == pytest.approx(np.tile(h[0], (5, 1)), abs=100 * EPS * float(np.linalg.norm(h[0])))


@settings(max_examples=30)
@given(symmetric_spinners() | triaxial_spinners(), st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_arcs_compose(spacecraft: Spacecraft, first: float, second: float) -> None:
    """A flight taken up again where another ended is the rest of it."""
    whole_rates, whole_turn = state_at(flight.flown(spacecraft, Schedule(), first + second), first + second)
    rates, turn = state_at(flight.flown(spacecraft, Schedule(), first), first)
    again = replace(spacecraft, omega0=rates, attitude=Attitude(attitude.from_matrix(turn)))
    rest_rates, rest_turn = state_at(flight.flown(again, Schedule(), second), second)
    assert rest_rates == pytest.approx(whole_rates, abs=1000 * EPS * float(np.linalg.norm(whole_rates)))
    assert reference.turned(rest_turn, whole_turn) < 1e-12


# --- symmetries ------------------------------------------------------------------------------------------------------


@settings(max_examples=25)
@given(symmetric_spinners() | triaxial_spinners(), schedules(), st.floats(0.0, UNTIL), st.sampled_from([0.0, 0.4]))
def test_a_pulse_of_no_impulse_changes_nothing(
    spacecraft: Spacecraft, made: Schedule, time: float, on_time: float
) -> None:
    nothing = pulse(max(time, 0.5 * on_time), on_time, np.zeros(3), "idle")
    more = Schedule((*made, nothing))
    for fly in (flight.flown, flight.by_impulses):
        if fly is flight.by_impulses and not spacecraft.inertia.symmetric:
            continue
        rates, turn = state_at(fly(spacecraft, made, 13.0), 13.0)
        same_rates, same_turn = state_at(fly(spacecraft, more, 13.0), 13.0)
        assert same_rates == pytest.approx(rates, abs=1e-12 * max(1.0, float(np.linalg.norm(rates))))
        assert reference.turned(turn, same_turn) < 1e-12


def mirrored(vector: Vector) -> Vector:
    """An axial vector (rate, torque, H) in the mirror of the 2-3 plane: components in the plane change sign."""
    return np.asarray(vector * np.array([1.0, -1.0, -1.0]))


def in_the_mirror(spacecraft: Spacecraft, made: Schedule) -> tuple[Spacecraft, Schedule]:
    pulses = (
        replace(one, impulse=mirrored(one.impulse), torque=None if one.torque is None else mirrored(one.torque))
        for one in made
    )
    return replace(spacecraft, omega0=mirrored(spacecraft.omega0)), Schedule(tuple(pulses))


@settings(max_examples=25)
@given(symmetric_spinners() | triaxial_spinners(), schedules())
def test_the_mirror_body_flies_the_mirror_schedule(spacecraft: Spacecraft, made: Schedule) -> None:
    """Spin reversed, torques mirrored: mirrored rates, and the same angles."""
    plain = flight.flown(spacecraft, made)
    mirror = flight.flown(*in_the_mirror(spacecraft, made))
    size = max(1.0, float(np.linalg.norm(plain.settled.rates)))
    assert mirror.settled.rates == pytest.approx(mirrored(plain.settled.rates), abs=1e-12 * size)
    one, other = plain.residual, mirror.residual
    for name in ("nutation", "body_cone", "space_cone", "momentum_shift", "axis_error"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), abs=1e-11)


@settings(max_examples=25)
@given(symmetric_spinners(), schedules(ideal=True), st.floats(-math.pi, math.pi))
def test_turning_the_body_about_its_axis_turns_what_must_be_fired(
    spacecraft: Spacecraft, made: Schedule, angle: float
) -> None:
    """A symmetric body has no first axis: turned ω and turned impulses give turned rates and the same angles."""
    turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
    other_body = replace(spacecraft, omega0=turn @ spacecraft.omega0)
    other = flight.by_impulses(other_body, Schedule(tuple(replace(one, impulse=turn @ one.impulse) for one in made)))
    plain = flight.by_impulses(spacecraft, made)
    size = max(1.0, float(np.linalg.norm(plain.settled.rates)))
    assert other.settled.rates == pytest.approx(turn @ plain.settled.rates, abs=1e-12 * size)
    assert other.residual.momentum_shift == pytest.approx(plain.residual.momentum_shift, abs=1e-12)


# --- the two models --------------------------------------------------------------------------------------------------


@settings(max_examples=30)
@given(symmetric_spinners(), schedules(ideal=True))
def test_for_ideal_impulses_both_models_are_one(spacecraft: Spacecraft, made: Schedule) -> None:
    summed, flown = flight.by_impulses(spacecraft, made), flight.flown(spacecraft, made)
    size = max(1.0, float(np.linalg.norm(flown.settled.rates)))
    assert summed.settled.rates == pytest.approx(flown.settled.rates, abs=1e-12 * size)
    turns = [attitude.matrix(one.settled.quaternion) for one in (summed, flown)]
    assert reference.turned(*turns) < 1e-12


@settings(max_examples=30)
@given(symmetric_spinners(), schedules())
def test_the_impulse_sum_gives_the_rates_after_real_widths_exactly(spacecraft: Spacecraft, made: Schedule) -> None:
    """With effective impulses; axial torques included as long as pulses with them do not overlap others."""
    ends = sorted((one.start, one.end, one.impulse[2]) for one in made)
    overlap = any(later[0] < earlier[1] for earlier, later in itertools.pairwise(ends))
    axial = any(part[2] for part in ends)
    if overlap and axial:
        made = Schedule(tuple(replace(one, impulse=one.impulse * (1, 1, 0), torque=None) for one in made))
        made = Schedule(tuple(pulse(one.t, one.on_time, one.impulse) for one in made))
    summed, flown = (fly(spacecraft, made, 13.0) for fly in (flight.by_impulses, flight.flown))
    rates, _ = state_at(summed, 13.0)
    expected, _ = state_at(flown, 13.0)
    assert rates == pytest.approx(expected, abs=1e-11 * max(1.0, float(np.linalg.norm(expected))))


def test_the_direction_of_h_after_real_widths_is_not_that_of_the_impulse_sum() -> None:
    """Widths cost ω the factor sinc(aω3τ/2) and the shift of H, to first order, sinc(ω3τ/2): two different ones."""
    spacecraft = spinner(120.0, 80.0, 3.0, degrees=1e-3)
    tau = 0.8
    impulse = np.array([1e-3, 0.0, 0.0])
    made = Schedule((pulse(1.0, tau, impulse),))
    a_factor, factor = (math.sin(x) / x for x in (0.5 * 3.0 * tau / 3, 0.5 * 3.0 * tau))
    assert flight.effective_impulses(spacecraft, made)[0] == pytest.approx(1e-3 * a_factor, rel=4 * EPS)
    shift = flight.flown(spacecraft, made).residual.momentum_shift
    by_sum = flight.by_impulses(spacecraft, made).residual.momentum_shift
    # Second order in angles of 1e-5 rad.
    assert shift == pytest.approx(1e-3 * factor / (80.0 * 3.0), rel=1e-4)
    assert by_sum == pytest.approx(1e-3 * a_factor / (80.0 * 3.0), rel=1e-4)


def test_effective_impulses_of_ideal_impulses_are_their_own() -> None:
    made = Schedule((pulse(1.0, 0.0, np.array([3.0, -4.0, 50.0])), pulse(2.0, 0.0, np.array([0.0, 1.0, 0.0]))))
    assert flight.effective_impulses(spinner(), made) == pytest.approx([3.0 - 4.0j, 1.0j], rel=2 * EPS)


def test_a_long_pulse_takes_all_the_nutation_for_more_than_the_floor_and_moves_h_by_less() -> None:
    """The example of the physics sheet, A = 120, C = 80, 10°: for 1.32 × A|ω0| H moves by 2.1°, to the last digit."""
    spacecraft = spinner(120.0, 80.0, 3.0, degrees=10.0, phase=0.0)
    half = brentq(lambda x: x / math.sin(x) - 1.32, 0.1, 3.0)  # the turn of ω to the middle of the pulse, aω3τ/2
    opposed = transverse(spacecraft.omega0) * cmath.exp(-1j * half)
    impulse = -1.32 * spacecraft.least_impulse * opposed / abs(opposed)
    made = Schedule((pulse(half, 2 * half, np.array([impulse.real, impulse.imag, 0.0])),))  # aω3 = 1 rad/s
    left = flight.flown(spacecraft, made).residual
    assert left.nutation < 1e-14
    assert math.degrees(left.momentum_shift) == pytest.approx(2.1, abs=0.05)


# --- residuals -------------------------------------------------------------------------------------------------------


@settings(max_examples=25)
@given(symmetric_spinners(), schedules())
def test_residual_is_what_the_vectors_say(spacecraft: Spacecraft, made: Schedule) -> None:
    """Angles between H, ω, the spin axis and H at the start, at the end of the last pulse."""
    flown = flight.flown(spacecraft, made)
    left, settled = flown.residual, flown.settled
    moments, sense = np.array(flown.moments), math.copysign(1.0, spacecraft.spin)
    axis = np.array([0.0, 0.0, sense])
    body_h = moments * settled.rates
    assert left.nutation == pytest.approx(reference.angle(body_h, axis), abs=8 * EPS)
    assert left.body_cone == pytest.approx(reference.angle(settled.rates, axis), abs=8 * EPS)
    assert left.space_cone == pytest.approx(left.nutation - left.body_cone, abs=4 * EPS)
    start = spacecraft.initial
    before = attitude.rotate(start.quaternion, moments * start.rates)
    after = attitude.rotate(settled.quaternion, body_h)
    assert left.momentum_shift == pytest.approx(reference.angle(before, after), abs=1e-14)
    assert left.axis_error == left.momentum_shift  # the target axis is H at the start


def test_residual_without_pulses_is_the_motion_at_the_start() -> None:
    spacecraft = spinner(degrees=5.0)
    left = flight.flown(spacecraft, Schedule()).residual
    assert math.degrees(left.nutation) == pytest.approx(5.0, rel=4 * EPS)
    assert left.momentum_shift == 0.0


def test_after_spin_reversal_the_nutation_counts_from_the_same_end_of_the_body() -> None:
    """ω3 from 3 to -1 rad/s: H now points nearly along -e3, so the nutation angle is above 90°."""
    spacecraft = spinner(spin=3.0, degrees=2.0)
    left = flight.flown(spacecraft, Schedule((pulse(1.0, 0.5, np.array([0.0, 0.0, -320.0])),))).residual
    assert math.pi - left.nutation == pytest.approx(math.atan(3 * math.tan(math.radians(2.0))), rel=1e-12)


STABLE = {"prolate": (120.0, 100.0, 80.0), "oblate": (80.0, 70.0, 120.0)}


@spread("degrees", [0.01, 10.0, 35.0], quick=1)
@spread("phase", [0.0, 0.4, 0.5 * math.pi, 2.5], quick=1)
@spread("spin", [2.0, -2.0], quick=1)
@spread("moments", STABLE.values(), quick=6, ids=STABLE)
def test_nutation_of_three_different_moments_is_the_largest_of_the_motion(
    moments: tuple[float, float, float], spin: float, phase: float, degrees: float
) -> None:
    """As a dense integration over more than a period of the body finds it."""
    spacecraft = spinner(moments=moments, spin=spin, degrees=degrees, phase=phase)
    times = np.linspace(0.01, 25.0, 4001)
    start = reference.Motion(spacecraft.omega0, np.eye(3))
    sense = math.copysign(1.0, spin)
    motions = reference.coast(moments, start, np.zeros(3), times)
    largest = max(reference.nutation(moments, motion.rates, sense) for motion in motions)
    # The peak lies between samples 1/160 s apart: 1 - cos of half the angle turned in that time.
    assert flight.flown(spacecraft, Schedule()).residual.nutation == pytest.approx(largest, rel=1e-4)


@spread("spin", [2.0, -2.0], quick=1)
@spread("moments", STABLE.values(), quick=1, ids=STABLE)
def test_nutation_beyond_the_separatrix_is_the_largest_of_the_motion(
    moments: tuple[float, float, float], spin: float
) -> None:
    """H circles another axis and comes as near to the far end of axis 3 as to this one."""
    spacecraft = spinner(moments=moments, spin=spin, degrees=80.0, phase=0.0 if moments[2] < 100 else 0.5 * math.pi)
    times = np.linspace(0.01, 60.0, 8001)
    start = reference.Motion(spacecraft.omega0, np.eye(3))
    sense = math.copysign(1.0, spin)
    motions = reference.coast(moments, start, np.zeros(3), times)
    largest = max(reference.nutation(moments, motion.rates, sense) for motion in motions)
    assert largest > math.radians(95)
    assert flight.flown(spacecraft, Schedule()).residual.nutation == pytest.approx(largest, rel=1e-4)


# --- widths that the clock can hardly tell ---------------------------------------------------------------------------


def test_a_pulse_narrower_than_the_clock_can_tell_still_gives_its_impulse() -> None:
    """At t = 10⁵ s start and end of a pulse of 1 ps are the same number, and it is flown as an impulse."""
    made = Schedule((pulse(1e5, 1e-12, np.array([6.0, 0.0, 0.0])),))
    spacecraft = spinner(120.0, 120.0)  # a sphere, so that only the pulse changes ω
    settled = flight.flown(spacecraft, made).settled
    assert settled.omega - transverse(spacecraft.omega0) == pytest.approx(6.0 / 120.0, rel=1e-6)
