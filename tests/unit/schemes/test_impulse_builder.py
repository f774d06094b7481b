"""The closed-form builder against the reference integrator: coasts and pulses while the spin changes."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from support import reference
from support.builders import channel, spinner, transverse

from nutdamp.schedule import channel_pulse
from nutdamp.schemes.tools.impulse_builder import ImpulseBuilder
from nutdamp.spacecraft import Disturbance, Spacecraft

AXIAL = 2.0
"""Torque about axis 3, N m: in 30 s it changes the spin by a quarter, and the phase of the nutation by 3.75 rad."""


def spun_up(spin: float) -> Spacecraft:
    body = spinner(spin=spin, channels=(channel("T", 8.0, 3.0, 0.0),))
    return replace(body, disturbances=(Disturbance(0j, axial=AXIAL),))


def flown(body: Spacecraft, end: float, *pushes: reference.Push) -> complex:
    """ω1 + iω2 at ``end`` s by DOP853, under the axial torque and the pushes."""
    edges = sorted({0.0, end, *(edge for push in pushes for edge in push[:2])})
    acting = []
    for start, stop in itertools.pairwise(edges):
        torque = np.array([0.0, 0.0, AXIAL])
        for push in pushes:
            if push.start <= start and stop <= push.end:
                torque = torque + push.torque
        acting.append(reference.Push(start, stop, torque))
    moments = body.inertia.moments
    rotation = reference.frame_n(moments, body.omega0)
    return transverse(reference.fly(moments, body.omega0, acting, end, rotation).rates)


@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_omega_turns_with_a_spin_that_drifts(spin: float) -> None:
    body = spun_up(spin)
    for time in (1.0, 10.0, 30.0):
        assert ImpulseBuilder(body).omega_at(time) == pytest.approx(flown(body, time), rel=1e-10)


@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_a_pulse_acts_and_the_motion_goes_on_while_the_spin_drifts(spin: float) -> None:
    """A pulse of half a second at 12 s, and ω long after it."""
    body, builder = spun_up(spin), ImpulseBuilder(spun_up(spin))
    pulse = channel_pulse(body.channels[0], 12.0, 0.5)
    builder.fire(pulse)
    assert pulse.torque is not None
    push = reference.Push(pulse.start, pulse.end, pulse.torque)
    for time in (pulse.end, 30.0):
        assert builder.omega_at(time) == pytest.approx(flown(body, time, push), rel=1e-10)
    assert builder.spin == pytest.approx(spin + AXIAL / body.inertia.C * 12.0, rel=1e-14)
