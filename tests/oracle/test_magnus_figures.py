"""The figures of Magnus 1970 as numbers: pole curve of the four-pulse scheme (5), axis tracks (6)-(8)."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support import places

from nutdamp.files.reader import load_spacecraft
from nutdamp.flight import propagation
from nutdamp.physics import attitude
from nutdamp.schemes.catalogue import FourPulseOptions, TwoPulseOptions
from nutdamp.schemes.four_pulse import schedule as four_pulse
from nutdamp.schemes.two_pulse import schedule as two_pulse
from nutdamp.spacecraft.model import Inertia, Spacecraft
from nutdamp.spacecraft.schedule import Schedule

BODIES = {name: load_spacecraft(places.CONFIGS / f"magnus-{name}.yaml") for name in ("a09", "a03", "oblate")}
every_body = pytest.mark.parametrize("spacecraft", BODIES.values(), ids=BODIES)


def coarse(spacecraft: Spacecraft, on_time: float = 0.05) -> Schedule:
    """The four-pulse scheme as in fig. 5: equal pulses, short against the nutation."""
    return four_pulse(spacecraft, FourPulseOptions(on_time=on_time, coarse=True))


def unbounded(spacecraft: Spacecraft) -> Spacecraft:
    """The spacecraft with thrusters that can fire as short as one likes."""
    free = tuple(
        replace(channel, thrusters=tuple(replace(one, min_on_time=0.0) for one in channel.thrusters))
        for channel in spacecraft.channels
    )
    return replace(spacecraft, channels=free, steerable=None)


def around(spacecraft: Spacecraft, made: Schedule) -> tuple[np.ndarray, np.ndarray]:
    """ω just before and after each pulse by the impulse sum."""
    before, after = (track.rates for track in propagation.by_impulses(spacecraft, made).around_pulses())
    return before[:, 0] + 1j * before[:, 1], after[:, 0] + 1j * after[:, 1]


@every_body
def test_fig_5_pole_curve_steps_inwards_by_equal_amounts_each_quarter_turn(spacecraft: Spacecraft) -> None:
    """|ω| falls by J/A at each pulse, down to the rest of at most J/(2A); then no pulse helps.

    π/2 in the body between pulses, clockwise for prolate bodies and mirrored for oblate ones, whatever a is.
    """
    made = coarse(spacecraft)
    before, after = around(spacecraft, made)
    step = abs(propagation.effective_impulses(spacecraft, made)[0]) / spacecraft.inertia.A
    assert len(made) == round(spacecraft.transverse_rate / step)
    expected = spacecraft.transverse_rate - step * np.arange(1, len(made) + 1)
    assert np.abs(after) == pytest.approx(np.abs(expected), abs=1e-13)
    assert abs(after[-1]) <= 0.5 * step
    # On arcs between pulses |ω| is constant, and each pulse is fired straight at the origin or through it.
    assert np.abs(before[1:]) == pytest.approx(np.abs(after[:-1]), rel=1e-12)
    arcs, gaps = np.angle(before[1:] / after[:-1]), np.diff([pulse.t for pulse in made])
    assert arcs == pytest.approx(np.full(len(arcs), -math.copysign(math.pi / 2, spacecraft.inertia.a)), abs=1e-12)
    assert gaps == pytest.approx(np.full(len(gaps), spacecraft.body_period / 4), rel=1e-12)


def test_fig_5_the_curve_of_an_oblate_body_is_the_mirror_image_and_each_faster_the_farther_a_is_from_zero() -> None:
    """Mirrored on the axis of the first pulse it is that of the prolate one; the time for it goes as 1/|a|."""
    curves = []
    for name in ("a03", "oblate"):
        spacecraft = unbounded(BODIES[name])
        before, after = around(spacecraft, coarse(spacecraft, on_time=0.01))
        curves.append(np.stack([before, after])[:, :20] / before[0])
    prolate, oblate = curves
    # The width of a pulse costs sinc(aω3τ/2), which is one but for 3e-5 here.
    assert np.abs(prolate - np.conj(oblate)).max() < 1e-3
    assert np.abs(np.angle(prolate[0] * oblate[0])).max() < 1e-9
    quarters = []
    for a in (0.9, 0.3, 0.1, -0.1, -0.6, -0.9):
        made = coarse(replace(BODIES["a09"], inertia=Inertia((100.0, 100.0, 100.0 * (1 - a)))), on_time=0.01)
        quarters.append(abs(a) * (made.pulses[-1].t - made.pulses[0].t) / (len(made) - 1))
    assert quarters == pytest.approx([quarters[0]] * 6, rel=1e-9)


@pytest.mark.parametrize(("name", "arc_deg"), [("a09", 10.0), ("a03", 210.0)], ids=["fig 6", "fig 7"])
def test_fig_6_and_7_arcs_of_the_axis_track(name: str, arc_deg: float) -> None:
    """Between pulses the spin axis runs ω_n T_ω/4 about H: 10° for a = 0.9, 210° for a = 0.3, at small angles."""
    spacecraft, inertia = unbounded(BODIES[name]), BODIES[name].inertia
    small = replace(spacecraft, omega0=spacecraft.omega0 * (1e-3, 1e-3, 1.0))
    rate = inertia.C * small.spin / inertia.A
    assert math.degrees(rate * small.body_period / 4) == pytest.approx(arc_deg, rel=1e-12)
    legs = propagation.by_impulses(small, coarse(small, on_time=5e-5)).legs[1:-1]
    assert len(legs) >= 3
    for leg in legs[:3]:
        body, quaternion = leg.path.motion(np.linspace(leg.start, leg.end, 400))
        momentum = attitude.rotate(quaternion[0], body[0] * (inertia.A, inertia.A, inertia.C))
        up, axis = momentum / np.linalg.norm(momentum), attitude.rotate(quaternion, np.array([0.0, 0.0, 1.0]))
        flat = axis - np.outer(axis @ up, up)
        flat /= np.linalg.norm(flat, axis=1, keepdims=True)
        steps = np.arctan2(np.cross(flat[:-1], flat[1:]) @ up, np.sum(flat[:-1] * flat[1:], axis=1))
        assert math.degrees(steps.sum()) == pytest.approx(arc_deg, rel=1e-4)


@every_body
def test_fig_6_and_7_the_centre_of_each_arc_is_where_h_has_jumped_to(spacecraft: Spacecraft) -> None:
    for leg in propagation.by_impulses(spacecraft, coarse(spacecraft)).legs[1:]:
        if leg.end > leg.start:
            body, quaternion = leg.path.motion(np.linspace(leg.start, leg.end, 30))
            momentum = attitude.rotate(quaternion, body * spacecraft.inertia.moments)
            away = attitude.angle_between(attitude.rotate(quaternion, np.array([0.0, 0.0, 1.0])), momentum)
            assert np.ptp(away) < 1e-12
            assert np.abs(momentum - momentum[0]).max() < 1e-11 * np.linalg.norm(momentum[0])


@every_body
def test_fig_8_two_pulses_stop_the_axis_where_h_was(spacecraft: Spacecraft) -> None:
    """D0 -> D1 at half the cone, half a turn on the smaller circle, and back to D0 with no nutation left."""
    before, after = propagation.by_impulses(spacecraft, two_pulse(spacecraft, TwoPulseOptions())).around_pulses()
    start, d0, d1, back = spacecraft.nutation, before.momentum[0], after.momentum[0], after.momentum[1]
    assert (before.nutation[0], after.nutation[0]) == pytest.approx((start, start / 2), rel=1e-12)
    assert attitude.angle_between(d0, d1) == pytest.approx(start / 2, rel=1e-12)
    assert attitude.angle_between(d0, back) < 1e-13
    assert attitude.angle_between(after.axis[1], d0) < 1e-13
    # Half a turn: at the second pulse the axis stands opposite, seen from D1, to where it stood at the first.
    up = d1 / np.linalg.norm(d1)
    first, second = (axis - (axis @ up) * up for axis in (after.axis[0], before.axis[1]))
    assert attitude.angle_between(first, -second) < 1e-7
