"""The figures of Magnus 1970 as numbers: pole curve of the four-pulse scheme (5), axis tracks (6)-(8)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support import places

from nutdamp import flight
from nutdamp.files.spacecraft_file import load_spacecraft
from nutdamp.physics import attitude
from nutdamp.schedule import Schedule
from nutdamp.schemes.four_pulse import schedule as four_pulse
from nutdamp.schemes.options import FourPulseOptions, TwoPulseOptions
from nutdamp.schemes.two_pulse import schedule as two_pulse
from nutdamp.spacecraft import Inertia, Spacecraft

CONFIGS = places.CONFIGS
NEEDLE, BLUNT, OBLATE = (load_spacecraft(CONFIGS / f"magnus-{name}.yaml") for name in ("a09", "a03", "oblate"))
BODIES = {"a = 0.9": NEEDLE, "a = 0.3": BLUNT, "oblate": OBLATE}


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
    before, after = flight.by_impulses(spacecraft, made).around_pulses()
    return tuple(track.rates[:, 0] + 1j * track.rates[:, 1] for track in (before, after))  # type: ignore[return-value]


@pytest.mark.parametrize("spacecraft", BODIES.values(), ids=BODIES)
def test_fig_5_pole_curve_steps_inwards_by_equal_amounts(spacecraft: Spacecraft) -> None:
    """|ω| falls by J/A at each pulse, down to the rest of at most J/(2A); then no pulse helps."""
    made = coarse(spacecraft)
    before, after = around(spacecraft, made)
    step = abs(flight.effective_impulses(spacecraft, made)[0]) / spacecraft.inertia.A
    assert len(made) == round(spacecraft.transverse_rate / step)
    expected = spacecraft.transverse_rate - step * np.arange(1, len(made) + 1)
    assert np.abs(after) == pytest.approx(np.abs(expected), abs=1e-13)
    assert abs(after[-1]) <= 0.5 * step
    # On arcs between pulses |ω| is constant, and each pulse is fired straight at the origin or through it.
    assert np.abs(before[1:]) == pytest.approx(np.abs(after[:-1]), rel=1e-12)


@pytest.mark.parametrize("spacecraft", BODIES.values(), ids=BODIES)
def test_fig_5_a_quarter_turn_in_the_body_between_pulses(spacecraft: Spacecraft) -> None:
    """π/2 in the body, clockwise for prolate bodies and mirrored for oblate ones, whatever a is."""
    made = coarse(spacecraft)
    before, after = around(spacecraft, made)
    arcs = np.angle(before[1:] / after[:-1])
    assert arcs == pytest.approx(np.full(len(arcs), -math.copysign(math.pi / 2, spacecraft.inertia.a)), abs=1e-12)
    gaps = np.diff([pulse.t for pulse in made])
    assert gaps == pytest.approx(np.full(len(gaps), spacecraft.body_period / 4), rel=1e-12)


def test_fig_5_the_curve_of_an_oblate_body_is_the_mirror_image() -> None:
    """Mirrored on the axis of the first pulse, the pole curve of the oblate body is that of the prolate one."""
    curves = []
    for spacecraft in (BLUNT, OBLATE):
        before, after = around(spacecraft, coarse(unbounded(spacecraft), on_time=0.01))
        curves.append(np.stack([before, after])[:, :20] / before[0])
    prolate, oblate = curves
    # The width of a pulse costs sinc(aω3τ/2), which is one but for 3e-5 here.
    assert np.abs(prolate - np.conj(oblate)).max() < 1e-3
    assert np.abs(np.angle(prolate[0] * oblate[0])).max() < 1e-9


@pytest.mark.parametrize(("spacecraft", "arc_deg"), [(NEEDLE, 10.0), (BLUNT, 210.0)], ids=["fig 6", "fig 7"])
def test_fig_6_and_7_arcs_of_the_axis_track(spacecraft: Spacecraft, arc_deg: float) -> None:
    """Between pulses the spin axis runs ω_n T_ω/4 about H: 10° for a = 0.9, 210° for a = 0.3, at small angles."""
    inertia = spacecraft.inertia
    small = replace(unbounded(spacecraft), omega0=spacecraft.omega0 * (1e-3, 1e-3, 1.0))
    rate = inertia.C * small.spin / inertia.A
    assert math.degrees(rate * small.body_period / 4) == pytest.approx(arc_deg, rel=1e-12)
    made = coarse(small, on_time=5e-5)
    legs = flight.by_impulses(small, made).legs[1:-1]
    assert len(legs) >= 3
    for leg in legs[:3]:
        body, quaternion = leg.path.motion(np.linspace(leg.start, leg.end, 400))
        momentum = attitude.rotate(quaternion[0], body[0] * (inertia.A, inertia.A, inertia.C))
        up = momentum / np.linalg.norm(momentum)
        axis = attitude.rotate(quaternion, np.array([0.0, 0.0, 1.0]))
        flat = axis - np.outer(axis @ up, up)
        flat /= np.linalg.norm(flat, axis=1, keepdims=True)
        steps = np.arctan2(np.cross(flat[:-1], flat[1:]) @ up, np.sum(flat[:-1] * flat[1:], axis=1))
        assert math.degrees(steps.sum()) == pytest.approx(arc_deg, rel=1e-4)


@pytest.mark.parametrize("spacecraft", BODIES.values(), ids=BODIES)
def test_fig_6_and_7_the_centre_of_each_arc_is_where_h_has_jumped_to(spacecraft: Spacecraft) -> None:
    made = coarse(spacecraft)
    for leg in flight.by_impulses(spacecraft, made).legs[1:]:
        if leg.end > leg.start:
            body, quaternion = leg.path.motion(np.linspace(leg.start, leg.end, 30))
            momentum = attitude.rotate(quaternion, body * spacecraft.inertia.moments)
            away = attitude.angle_between(attitude.rotate(quaternion, np.array([0.0, 0.0, 1.0])), momentum)
            assert np.ptp(away) < 1e-12
            assert np.abs(momentum - momentum[0]).max() < 1e-11 * np.linalg.norm(momentum[0])


def test_damping_is_the_faster_the_farther_a_is_from_zero() -> None:
    """The same pole curve is run through in a time that goes as 1/|a|."""
    ends = {}
    for a in (0.9, 0.6, 0.3, 0.1, -0.1, -0.3, -0.6, -0.9):
        body = replace(NEEDLE, inertia=Inertia((100.0, 100.0, 100.0 * (1 - a))))
        made = coarse(body, on_time=0.01)
        ends[a] = (made.pulses[-1].t - made.pulses[0].t) / (len(made) - 1)
    for a, quarter in ends.items():
        assert quarter * abs(a) == pytest.approx(ends[0.9] * 0.9, rel=1e-9)


@pytest.mark.parametrize("spacecraft", BODIES.values(), ids=BODIES)
def test_fig_8_two_pulses_stop_the_axis_where_h_was(spacecraft: Spacecraft) -> None:
    """D0 -> D1 at half the cone, half a turn on the smaller circle, and back to D0 with no nutation left."""
    made = two_pulse(spacecraft, TwoPulseOptions())
    flown = flight.by_impulses(spacecraft, made)
    before, after = flown.around_pulses()
    start = spacecraft.nutation
    assert before.nutation[0] == pytest.approx(start, rel=1e-12)
    assert after.nutation[0] == pytest.approx(start / 2, rel=1e-12)
    d0, d1, back = before.momentum[0], after.momentum[0], after.momentum[1]
    assert attitude.angle_between(d0, d1) == pytest.approx(start / 2, rel=1e-12)
    assert attitude.angle_between(d0, back) < 1e-13
    assert attitude.angle_between(after.axis[1], d0) < 1e-13
    # Half a turn: at the second pulse the axis stands opposite, seen from D1, to where it stood at the first.
    up = d1 / np.linalg.norm(d1)
    first, second = (axis - (axis @ up) * up for axis in (after.axis[0], before.axis[1]))
    assert attitude.angle_between(first, -second) < 1e-7
