"""Flights: exact arcs, the impulse sum and the real widths, against conservation laws and the
reference integrator, of this moment and as golden/make_golden.py kept it.
"""

import cmath
import itertools
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from golden.make_golden import FILE, event, fly
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from support import reference
from support.builders import channel, events, pulse, spinner, transverse
from support.cases import deep, spread
from support.golden import check_text
from support.places import case
from support.process import Run
from support.spinning import (
    EPS,
    UNTIL,
    about,
    angles,
    schedules,
    symmetric_spinners,
    triaxial_spinners,
)

from nutdamp import load
from nutdamp.figures.overview import title
from nutdamp.flight import propagation
from nutdamp.montecarlo.cases import DispersedModel
from nutdamp.montecarlo.propagated import RealWidths
from nutdamp.montecarlo.statistics import measure
from nutdamp.physics import attitude
from nutdamp.spacecraft.model import Attitude, Inertia, Spacecraft, Vector
from nutdamp.spacecraft.schedule import Pulse, Schedule, channel_pulse
from nutdamp.views.decisions import residual_json, spacecraft_json

QUATERNION = np.array([0.5, -0.5, 0.5, 0.5])

any_spinners = symmetric_spinners() | triaxial_spinners()


def state_at(flown: propagation.Flight, time: float) -> reference.Motion:
    """The motion at ``time`` on the last leg that holds it."""
    leg = next(leg for leg in reversed(flown.legs) if leg.start <= time <= leg.end)
    (rates,), (quaternion,) = leg.path.motion(np.array([time]))
    return reference.Motion(rates, attitude.matrix(quaternion))


def assert_same(one: reference.Motion, other: reference.Motion, rates: float, turn: float) -> None:
    """Within ``rates`` of their size, at least rad/s, and ``turn`` rad."""
    assert one.rates == pytest.approx(
        other.rates, abs=rates * max(1.0, float(np.linalg.norm(other.rates)))
    )
    assert reference.turned(one.rotation, other.rotation) < turn


def by_reference(spacecraft: Spacecraft, made: Schedule, until: float) -> reference.Motion:
    rotation = attitude.matrix(spacecraft.initial.quaternion)
    return reference.fly(
        spacecraft.inertia.moments, spacecraft.omega0, events(made), until, rotation
    )


# --- against the reference
# -------------------------------------------------------------------------------------------


@settings(max_examples=12)
@given(any_spinners, schedules())
def test_flown_is_the_motion_of_the_reference_integrator(
    spacecraft: Spacecraft, made: Schedule
) -> None:
    """Overlapping pulses, axial torques, spin reversal and three different moments included; to
    1e-9 rad.
    """
    flown = propagation.flown(spacecraft, made, UNTIL)
    settled = reference.Motion(flown.settled.rates, attitude.matrix(flown.settled.quaternion))
    assert_same(settled, state_at(flown, made.end), 1e-13, 1e-13)
    assert_same(state_at(flown, UNTIL), by_reference(spacecraft, made, UNTIL), 1e-9, 1e-9)


@settings(max_examples=16)
@given(symmetric_spinners(), schedules(ideal=True), angles)
def test_for_ideal_impulses_both_models_are_the_reference(
    spacecraft: Spacecraft, made: Schedule, angle: float
) -> None:
    """A symmetric body has no first axis: turned ω and turned impulses give turned rates and the
    same angles.
    """
    summed = propagation.by_impulses(spacecraft, made, UNTIL)
    assert_same(state_at(summed, UNTIL), by_reference(spacecraft, made, UNTIL), 1e-9, 1e-9)
    assert_same(
        state_at(summed, UNTIL),
        state_at(propagation.flown(spacecraft, made, UNTIL), UNTIL),
        1e-12,
        1e-12,
    )
    turn = about((0.0, 0.0, 1.0), angle)
    turned = Schedule(tuple(replace(one, impulse=turn @ one.impulse) for one in made))
    other = propagation.by_impulses(
        replace(spacecraft, omega0=turn @ spacecraft.omega0), turned, UNTIL
    )
    size = max(1.0, float(np.linalg.norm(summed.settled.rates)))
    assert other.settled.rates == pytest.approx(turn @ summed.settled.rates, abs=1e-12 * size)
    assert other.residual.momentum_shift == pytest.approx(summed.residual.momentum_shift, abs=1e-12)


def test_start_is_the_attitude_of_the_file_or_else_frame_n() -> None:
    """The file's quaternion is for the axes of the file; principal axis j stands at q(axes[:,
    j]).
    """
    spacecraft = spinner(attitude=Attitude(QUATERNION))
    assert np.array_equal(spacecraft.initial.quaternion, QUATERNION)
    frame = reference.frame_n((120.0, 120.0, 80.0), spinner().omega0)
    assert attitude.matrix(spinner().initial.quaternion) == pytest.approx(frame, abs=4 * EPS)
    axes = reference.frame_n((1.0, 2.0, 3.0), reference.vector(0.3, 0.2, 1.0))
    turned = replace(spacecraft, inertia=Inertia((120.0, 120.0, 80.0), axes)).initial.quaternion
    assert attitude.matrix(turned) == pytest.approx(attitude.matrix(QUATERNION) @ axes, abs=8 * EPS)
    for spin in (
        3.0,
        -3.0,
    ):  # By the true H of three different moments, not by their symmetric body's (0.45° off).
        body = spinner(moments=(120.0, 100.0, 80.0), spin=spin, degrees=5.0)
        start = propagation.flown(body, Schedule(), 1.0).sampled(2, 1.0)
        assert start.momentum[0] / np.linalg.norm(start.momentum[0]) == pytest.approx(
            [0, 0, 1], abs=4 * EPS
        )
        assert start.axis[0, 1] == pytest.approx(0.0, abs=4 * EPS)
        assert start.axis[0, 0] > 0.0


# --- conservation and symmetries
# -------------------------------------------------------------------------------------


@given(any_spinners, st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_momentum_and_energy_stay_on_arcs_and_arcs_compose(
    spacecraft: Spacecraft, first: float, second: float
) -> None:
    """A flight taken up again where another ended is the rest of it."""
    track = propagation.flown(spacecraft, Schedule(), 50.0).sampled(40, 50.0)
    h = track.momentum[0]
    # About two roundings in each of the hundred-odd steps of the integration; exact arcs take one.
    assert track.momentum == pytest.approx(
        np.tile(h, (40, 1)), abs=1000 * EPS * float(np.linalg.norm(h))
    )
    energies = [reference.energy(spacecraft.inertia.moments, rates) for rates in track.rates]
    assert energies == pytest.approx([energies[0]] * 40, rel=1000 * EPS)
    middle = state_at(propagation.flown(spacecraft, Schedule(), first), first)
    again = replace(
        spacecraft, omega0=middle.rates, attitude=Attitude(attitude.from_matrix(middle.rotation))
    )
    rest = state_at(propagation.flown(again, Schedule(), second), second)
    assert_same(
        rest,
        state_at(propagation.flown(spacecraft, Schedule(), first + second), first + second),
        1e-12,
        1e-12,
    )


@given(symmetric_spinners(), schedules())
def test_momentum_stays_between_pulses_and_the_residual_is_what_the_vectors_say(
    spacecraft: Spacecraft, made: Schedule
) -> None:
    """Angles between H, ω, the spin axis and H at the start, at the end of the last pulse."""
    flown = propagation.flown(spacecraft, made, UNTIL)
    moments = np.array(flown.moments)
    for leg in flown.legs:
        if not any(
            pulse.start <= leg.start and leg.end <= pulse.end
            for pulse in made
            if pulse.on_time > 0.0
        ):
            rates, quaternions = leg.path.motion(np.linspace(leg.start, leg.end, 5))
            h = attitude.rotate(quaternions, rates * moments)
            assert h == pytest.approx(
                np.tile(h[0], (5, 1)), abs=100 * EPS * float(np.linalg.norm(h[0]))
            )
    left, settled, start = flown.residual, flown.settled, spacecraft.initial
    axis = np.array([0.0, 0.0, math.copysign(1.0, spacecraft.spin)])
    body_h = moments * settled.rates
    assert left.nutation == pytest.approx(reference.angle(body_h, axis), abs=8 * EPS)
    assert left.body_cone == pytest.approx(reference.angle(settled.rates, axis), abs=8 * EPS)
    assert left.space_cone == pytest.approx(left.nutation - left.body_cone, abs=4 * EPS)
    before, after = (
        attitude.rotate(start.quaternion, moments * start.rates),
        attitude.rotate(settled.quaternion, body_h),
    )
    assert left.momentum_shift == pytest.approx(reference.angle(before, after), abs=1e-14)
    assert left.axis_error == left.momentum_shift  # the target axis is H at the start


def mirrored(vector: Vector) -> Vector:
    """An axial vector (rate, torque, H) in the mirror of the 2-3 plane: components in the plane
    change sign.
    """
    return np.asarray(vector * np.array([1.0, -1.0, -1.0]))


@settings(max_examples=16)
@given(any_spinners, schedules(), st.floats(0.0, UNTIL), st.sampled_from([0.0, 0.4]))
def test_a_pulse_of_nothing_changes_nothing_and_the_mirror_body_flies_the_mirror_schedule(
    spacecraft: Spacecraft, made: Schedule, time: float, on_time: float
) -> None:
    """Spin reversed, torques mirrored: mirrored rates, and the same angles."""
    more = Schedule((*made, pulse(max(time, 0.5 * on_time), on_time, np.zeros(3), "idle")))
    for model in (
        (propagation.flown, propagation.by_impulses)
        if spacecraft.inertia.symmetric
        else (propagation.flown,)
    ):
        assert_same(
            state_at(model(spacecraft, more, 13.0), 13.0),
            state_at(model(spacecraft, made, 13.0), 13.0),
            1e-12,
            1e-12,
        )
    pulses = (pulse(one.t, one.on_time, mirrored(one.impulse), one.channel) for one in made)
    other_body = replace(spacecraft, omega0=mirrored(spacecraft.omega0))
    plain, mirror = (
        propagation.flown(spacecraft, made),
        propagation.flown(other_body, Schedule(tuple(pulses))),
    )
    size = max(1.0, float(np.linalg.norm(plain.settled.rates)))
    assert mirror.settled.rates == pytest.approx(mirrored(plain.settled.rates), abs=1e-12 * size)
    for name in ("nutation", "body_cone", "space_cone", "momentum_shift", "axis_error"):
        assert getattr(mirror.residual, name) == pytest.approx(
            getattr(plain.residual, name), abs=1e-11
        )


# --- the two models
# --------------------------------------------------------------------------------------------------


@given(symmetric_spinners(), schedules())
def test_the_impulse_sum_gives_the_rates_after_real_widths_exactly(
    spacecraft: Spacecraft, made: Schedule
) -> None:
    """With effective impulses; axial torques included as long as pulses with them do not overlap
    others.
    """
    ends = sorted((one.start, one.end, one.impulse[2]) for one in made)
    if any(later[0] < earlier[1] for earlier, later in itertools.pairwise(ends)):
        made = Schedule(tuple(pulse(one.t, one.on_time, one.impulse * (1, 1, 0)) for one in made))
    summed, flown = (
        state_at(model(spacecraft, made, 13.0), 13.0).rates
        for model in (propagation.by_impulses, propagation.flown)
    )
    assert summed == pytest.approx(flown, abs=1e-11 * max(1.0, float(np.linalg.norm(flown))))


def test_the_direction_of_h_after_real_widths_is_not_that_of_the_impulse_sum() -> None:
    """Widths cost ω the factor sinc(aω3τ/2) and the shift of H, to first order, sinc(ω3τ/2): two
    different ones.
    """
    spacecraft = spinner(120.0, 80.0, 3.0, degrees=1e-3)
    tau = 0.8
    made = Schedule((pulse(1.0, tau, np.array([1e-3, 0.0, 0.0])),))
    a_factor, factor = (math.sin(x) / x for x in (0.5 * 3.0 * tau / 3, 0.5 * 3.0 * tau))
    assert propagation.effective_impulses(spacecraft, made)[0] == pytest.approx(
        1e-3 * a_factor, rel=4 * EPS
    )
    # Second order in angles of 1e-5 rad.
    for model, share in ((propagation.flown, factor), (propagation.by_impulses, a_factor)):
        assert model(spacecraft, made).residual.momentum_shift == pytest.approx(
            1e-3 * share / (80.0 * 3.0), rel=1e-4
        )
    ideal = Schedule(
        (pulse(1.0, 0.0, np.array([3.0, -4.0, 50.0])), pulse(2.0, 0.0, np.array([0.0, 1.0, 0.0])))
    )
    assert propagation.effective_impulses(spinner(), ideal) == pytest.approx(
        [3.0 - 4.0j, 1.0j], rel=2 * EPS
    )


def test_a_long_pulse_takes_all_the_nutation_for_more_than_the_floor_and_moves_h_by_less() -> None:
    """The example of the physics sheet, A = 120, C = 80, 10°: for 1.32 × A|ω0| H moves by 2.1°, to
    the last digit.
    """
    spacecraft = spinner(120.0, 80.0, 3.0, degrees=10.0, phase=0.0)
    half = brentq(
        lambda x: x / math.sin(x) - 1.32, 0.1, 3.0
    )  # the turn of ω to the middle of the pulse, aω3τ/2
    opposed = transverse(spacecraft.omega0) * cmath.exp(-1j * half)
    impulse = -1.32 * spacecraft.least_impulse * opposed / abs(opposed)
    made = Schedule(
        (pulse(half, 2 * half, np.array([impulse.real, impulse.imag, 0.0])),)
    )  # aω3 = 1 rad/s
    left = propagation.flown(spacecraft, made).residual
    assert left.nutation < 1e-14
    assert math.degrees(left.momentum_shift) == pytest.approx(2.1, abs=0.05)


def test_residuals_without_pulses_after_reversal_and_of_a_pulse_the_clock_hardly_tells() -> None:
    left = propagation.flown(spinner(degrees=5.0), Schedule()).residual
    assert math.degrees(left.nutation) == pytest.approx(5.0, rel=4 * EPS)
    assert left.momentum_shift == 0.0
    # ω3 from 3 to -1 rad/s: H now points nearly along -e3, and nutation counts from the same end of
    # the body.
    reversed_ = Schedule((pulse(1.0, 0.5, np.array([0.0, 0.0, -320.0])),))
    left = propagation.flown(spinner(spin=3.0, degrees=2.0), reversed_).residual
    assert math.pi - left.nutation == pytest.approx(
        math.atan(3 * math.tan(math.radians(2.0))), rel=1e-12
    )
    # At t = 10⁵ s start and end of a pulse of 1 ps are the same number, and it is flown as an
    # impulse.
    sphere = spinner(120.0, 120.0)  # so that only the pulse changes ω
    settled = propagation.flown(
        sphere, Schedule((pulse(1e5, 1e-12, np.array([6.0, 0.0, 0.0])),))
    ).settled
    assert settled.omega - transverse(sphere.omega0) == pytest.approx(6.0 / 120.0, rel=1e-6)


# --- golden numbers
# --------------------------------------------------------------------------------------------------

GOLDEN: dict[str, dict[str, Any]] = json.loads(FILE.read_text(encoding="utf-8"))
CLOSE = 1e-10
"""rad, and relative for rates and H; the reference adds up a few 1e-12."""


def fired(given: dict[str, Any]) -> Pulse:
    one = event(given)
    if isinstance(one, reference.Kick):
        return Pulse(one.t, 0.0, "T", one.impulse)
    on_time = one.end - one.start
    return Pulse(one.start + 0.5 * on_time, on_time, "T", one.torque * on_time, one.torque)


@pytest.mark.parametrize("name", GOLDEN)
def test_flown_is_golden(name: str) -> None:
    golden = GOLDEN[name]
    first, second, third = golden["moments_kgm2"]
    body = Spacecraft(name, Inertia((first, second, third)), np.array(golden["rates_rad_s"]))
    flown = propagation.flown(body, Schedule(tuple(fired(one) for one in golden["pulses"])))
    end = flown.settled
    size = float(np.linalg.norm(golden["end_rates_rad_s"]))
    assert end.rates == pytest.approx(golden["end_rates_rad_s"], abs=CLOSE * size)
    # Frame N of a body of three different moments is laid by the H of its equivalent symmetric one.
    start = attitude.matrix(body.initial.quaternion)
    to_n = reference.frame_n(golden["moments_kgm2"], body.omega0) @ start.T
    assert (
        reference.turned(to_n @ attitude.matrix(end.quaternion), np.array(golden["end_rotation"]))
        < CLOSE
    )
    h = to_n @ attitude.rotate(end.quaternion, end.rates * np.array(flown.moments))
    assert h == pytest.approx(golden["momentum_Nms"], abs=CLOSE * float(np.linalg.norm(h)))
    left = flown.residual
    assert left.momentum_shift == pytest.approx(golden["momentum_shift_rad"], abs=CLOSE)
    assert flown.sampled(2, flown.legs[-1].end).nutation[-1] == pytest.approx(
        golden["nutation_rad"], abs=CLOSE
    )
    assert left.space_cone + left.body_cone == pytest.approx(left.nutation, abs=1e-15 * math.pi)
    if body.inertia.symmetric:
        assert left.nutation == pytest.approx(golden["nutation_rad"], abs=CLOSE)
    else:  # the largest on the arc that follows
        assert left.nutation >= golden["nutation_rad"] - CLOSE


@pytest.mark.parametrize(
    "name", ["prolate, wide pulses", "three different moments, coast and pulses"]
)
def test_the_script_makes_what_the_file_holds(name: str) -> None:
    """So that the script cannot rot."""
    for key, value in fly(GOLDEN[name]).items():
        assert np.array(GOLDEN[name][key]) == pytest.approx(np.array(value), abs=1e-9)


# --- nutation angle = body cone + space cone, everywhere and with I1 ≠ I2 too

ROWS = 4001
"""Moments of the reference motion; between them the angle stays below its largest by 1e-6 of its
swing.
"""


@spread(
    ("moments", "rates"),
    [
        ((100.0, 130.0, 180.0), (1.5, 0.2, 0.3)),  # about axis 1: axis 3 is turned over
        ((100.0, 130.0, 180.0), (0.4, 0.0, 2.0)),
        ((100.0, 130.0, 180.0), (-0.2, 0.3, -2.0)),
        ((120.0, 100.0, 80.0), (0.05, 0.2, 3.0)),
        ((120.0, 100.0, 80.0), (4.0, 0.0, -1.0)),  # beyond the separatrix
        ((38.2, 35.1, 22.7), (0.0, 1e-3, 0.7)),
    ],
    quick=2,
    deep=4,
)
def test_the_cones_of_an_arc_are_those_where_its_nutation_is_largest(
    moments: tuple[float, float, float], rates: tuple[float, float, float]
) -> None:
    sense = math.copysign(1.0, rates[2])
    start = reference.Motion(np.array(rates), np.eye(3))
    motion = reference.coast(moments, start, np.zeros(3), np.linspace(0.01, 40.0, ROWS))
    angles = [reference.nutation(moments, one.rates, sense) for one in motion]
    widest = int(np.argmax(angles))
    inertia = Inertia(moments)
    cones = inertia.cones(np.array(rates), sense)
    assert cones.nutation == pytest.approx(angles[widest], rel=2e-5)
    assert cones.body == pytest.approx(
        reference.angle(motion[widest].rates, np.array([0.0, 0.0, sense])), rel=2e-5
    )
    # From the other end of the axis the largest angle is π less the least.
    assert inertia.cones(np.array(rates), -sense).nutation == pytest.approx(
        math.pi - min(angles), rel=2e-5
    )
    left = propagation.flown(
        replace(spinner(moments=moments), omega0=np.array(rates)), Schedule()
    ).residual
    assert (left.nutation, left.body_cone) == pytest.approx((cones.nutation, cones.body), rel=1e-12)


@spread(
    "moments", [(120.0, 100.0, 80.0), (300.0, 316.0, 440.0), (100.0, 110.0, 190.0)], quick=1, deep=2
)
@pytest.mark.parametrize("spin", [3.0, deep(-0.7)])
def test_a_small_nutation_turns_as_fast_as_that_of_the_reference(
    moments: tuple[float, float, float], spin: float
) -> None:
    """In the body and inertially: the mean of I1 and I2 would be off
    by up to 5.6 and 2 per cent.
    """
    body = spinner(spin=spin, degrees=0.01, moments=moments)
    times = np.linspace(0.0, 200.0 / abs(spin), 1001)
    motion = reference.coast(moments, reference.Motion(body.omega0, np.eye(3)), np.zeros(3), times)
    third = reference.momentum(moments, motion[0])
    first = np.cross([0.0, 1.0, 0.0], third)
    second = np.cross(third, first) / np.linalg.norm(third)
    seen = np.array([[one.rotation[:, 2] @ first, one.rotation[:, 2] @ second] for one in motion])
    within = np.array([one.rates[:2] for one in motion])
    for period, path in ((body.inertial_period, seen), (body.body_period, within)):
        turned = np.unwrap(np.arctan2(path[:, 1], path[:, 0]))
        assert math.tau / period == pytest.approx(abs(np.polyfit(times, turned, 1)[0]), rel=2e-4)


@pytest.mark.parametrize(
    "name", ["state-three-moments.yaml", "tensor-microsat.yaml", "disperse-three-moments.yaml"]
)
def test_free_motion_is_one_thing_in_all_that_tells_it(name: str) -> None:
    """Header, both residuals, track, JSON and dispersed closed form of a body with I1 ≠ I2."""
    body = load(case(name))
    assert not body.inertia.symmetric
    until = 3.0 * body.body_period
    now = reference.nutation(body.inertia.moments, body.omega0, math.copysign(1.0, body.spin))
    assert body.tilt == pytest.approx(now, rel=1e-12)
    said = spacecraft_json(body)
    assert said["nutation_deg"] == pytest.approx(
        said["body_cone_deg"] + said["space_cone_deg"], rel=1e-14
    )
    assert said["nutation_at_start_deg"] == pytest.approx(math.degrees(now), rel=1e-12)
    for flies in (propagation.flown, propagation.by_impulses):
        flown = flies(body, Schedule(), until)
        left = residual_json(flown.residual)
        track = flown.sampled(2000, until)
        assert track.nutation[0] == pytest.approx(now, rel=1e-9)
        assert math.degrees(track.nutation.max()) == pytest.approx(said["nutation_deg"], rel=1e-4)
        for key in ("nutation_deg", "body_cone_deg", "space_cone_deg"):
            assert left[key] == pytest.approx(said[key], rel=1e-12)
        assert f"nutation at most {said['nutation_deg']:#.3g}°" in title(flown)
    model = DispersedModel(body, Schedule())
    out = measure(model, RealWidths(model)(model.cases({})), 1)
    most = math.radians(said["nutation_deg"])
    assert out[:3, 0] == pytest.approx(
        [most, 0.0, 0.0], rel=1e-12, abs=1e-12
    )  # nutation, shift of H, axis error


def test_the_angles_around_the_pulses_are_those_of_what_is_left() -> None:
    """So the last line of a table of pulses says what the residual says, and the first what the
    header says.
    """
    push = channel("T", 4.0, 1.0, 0.0)
    body = spinner(moments=(100.0, 130.0, 180.0), channels=(push,))
    flown = propagation.flown(
        body, Schedule((channel_pulse(push, 1.0, 0.5), channel_pulse(push, 4.0, 0.7))), 20.0
    )
    before, after = flown.around_pulses()
    left = flown.residual
    assert (after.nutation[-1], after.body_cone[-1]) == pytest.approx(
        (left.nutation, left.body_cone), rel=1e-12
    )
    assert before.nutation[0] == pytest.approx(body.nutation, rel=1e-12)
    assert before.nutation[1] == pytest.approx(after.nutation[0], rel=1e-10)
    assert before.space_cone + before.body_cone == pytest.approx(before.nutation, rel=1e-12)
    # Effective impulses turn by the rate of the true body: at small angles both models agree to
    # their square.
    for moments in ((100.0, 130.0, 180.0), (120.0, 100.0, 80.0)):
        body = spinner(moments=moments, degrees=0.01, channels=(push,))
        wide = Schedule((channel_pulse(push, 0.9, 1.2),))
        real, sharp = (
            fly(body, wide).residual.nutation
            for fly in (propagation.flown, propagation.by_impulses)
        )
        assert sharp == pytest.approx(real, rel=2e-4)


def test_commands_disperse_and_start_free_motion_as_it_is(run: Run, tmp_path: Path) -> None:
    cases = (
        str(case("disperse-three-moments.yaml")),
        "--scheme",
        "none",
        "--samples",
        "100",
        "--json",
        "disperse.json",
    )
    assert run("disperse", *cases).returncode == 4
    percentiles = json.loads((tmp_path / "disperse.json").read_text())["percentiles"]
    assert percentiles["axis_error_deg"]["max"] == pytest.approx(0.0, abs=1e-9)
    assert percentiles["nutation_deg"]["max"] == pytest.approx(
        math.degrees(math.atan2(130.0 * 0.4, 360.0)), abs=1.0
    )
    simulate = "simulate", str(case("state-three-moments.yaml")), "--scheme", "none"
    for flown in ((), ("--flown",)):
        screen = run(*simulate, "--csv", "-", "--samples", "2", *flown)
        header, first, *_ = screen.stdout.splitlines()
        row = dict(zip(header.split(","), map(float, first.split(",")), strict=True))
        axis, momentum = (
            [row[f"{name}_{part}{unit}"] for part in "xyz"]
            for name, unit in (("axis", ""), ("momentum", "_Nms"))
        )
        apart = math.degrees(reference.angle(np.array(axis), np.array(momentum)))
        assert (row["nutation_deg"], apart) == pytest.approx((10.0, 10.0), rel=1e-12)
    nutation = next(
        line for line in run(*simulate, "-v").stdout.splitlines() if line.startswith("nutation  ")
    )
    check_text("cones.at-start", nutation)
