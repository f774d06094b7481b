"""Numbers of a plan: Δv, spin change, propellant and impulse, against the reference integrator and by hand."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import simpson
from support import reference
from support.builders import channel, cross, events, spinner
from support.cases import deep

from nutdamp.planning.plan import Plan, plan
from nutdamp.schemes.catalogue import CLASSIC
from nutdamp.spacecraft.equipment import Channel, Steerable
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import Schedule, channel_pulse
from nutdamp.units import STANDARD_GRAVITY


def jet(name: str, position: tuple[float, float, float], force: tuple[float, float, float]) -> Channel:
    return channel(name, *np.cross(position, force), isp=220.0, thrust=float(np.linalg.norm(force)), force=force)


JETS = (
    jet("T1", (0.0, 0.5, 0.8), (0.0, 10.0, 1.0)),
    jet("T2", (0.5, 0.0, 0.8), (8.0, 2.0, 0.0)),
    jet("T3", (0.0, -0.5, 0.8), (0.0, -10.0, -3.0)),
)
BODY, REVERSED = spinner(channels=JETS, mass=250.0), spinner(spin=-3.0, channels=JETS, mass=250.0)


def flown_force(body: Spacecraft, made: Schedule) -> Vector:
    """∫ R(t) F dt by Simpson's rule on the reference motion, from each moment that a pulse begins or ends to the next.

    Pulses may overlap: forces add.
    """
    moments, gained = body.inertia.moments, np.zeros(3)
    rotation = reference.frame_n(moments, body.omega0)
    edges = sorted({edge for pulse in made for edge in (pulse.start, pulse.end)})
    for begin, end in itertools.pairwise(edges):
        pushing = [one for one in made if one.start < 0.5 * (begin + end) < one.end]
        if pushing:
            start = reference.fly(moments, body.omega0, events(made), begin, rotation)
            times = np.linspace(0.0, end - begin, 2001)
            torque, force = (np.sum([getattr(one, of) for one in pushing], axis=0) for of in ("torque", "force"))
            motions = [start, *reference.coast(moments, start, torque, times[1:])]
            gained += simpson(np.array([motion.rotation @ force for motion in motions]), x=times, axis=0)
    return gained


@pytest.mark.parametrize(
    ("body", "fired"),
    [
        *((BODY, "one-pulse"), deep(BODY, "two-pulse"), deep(BODY, "four-pulse")),
        *(deep(REVERSED, "one-pulse"), deep(REVERSED, "two-pulse"), (REVERSED, "four-pulse")),
        # Stretches are cut by how fast the body turns at either end of the pulse, not as it begins.
        (spinner(2.0, 1.0, 0.1, mass=10.0), [(channel("up", 0.0, 1.2, 1.0, force=(1.0, 0.0, 0.5)), 5.0, 10.0)]),
        (BODY, [(JETS[0], 2.0, 1.0), (JETS[1], 2.4, 1.0)]),  # overlapping
        (BODY, [(channel("couple", 0.0, 20.0, 0.0, force=(0.0, 0.0, 0.0)), 2.0, 1.0)]),
    ],
)
def test_delta_v_is_the_force_turned_into_the_inertial_frame_over_the_mass(
    body: Spacecraft, fired: str | list[tuple[Channel, float, float]]
) -> None:
    by_hand = isinstance(fired, list)
    made = Plan(body, "", Schedule(tuple(channel_pulse(*one) for one in fired))) if by_hand else plan(body, str(fired))
    expected = flown_force(made.spacecraft, made.pulses) / (body.mass or 0.0)
    assert made.delta_v == pytest.approx(expected, abs=(1e-9 if by_hand else 1e-10) * float(np.linalg.norm(expected)))
    assert replace(made, spacecraft=replace(body, mass=None)).delta_v is None
    unknown = replace(made.pulses.pulses[0], force=None)
    assert replace(made, schedule=Schedule((unknown, *made.pulses.pulses[1:]))).delta_v is None


@pytest.mark.parametrize("scheme", CLASSIC)
def test_spin_change_and_propellant(scheme: str) -> None:
    """By the reference integrator, by the sum of axial impulses, and by F t / (Isp g0)."""
    made = plan(BODY, scheme)
    end = reference.fly(BODY.inertia.moments, BODY.omega0, events(made.pulses), made.pulses.end)
    assert made.spin_change == pytest.approx(end.rates[2] - 3.0, abs=1e-11)
    assert made.spin_change == pytest.approx(math.fsum(one.impulse[2] for one in made.pulses) / 80.0, abs=1e-13)
    thrust = {one.name: one.thrusters[0].thrust or 0.0 for one in JETS}
    expected = math.fsum(thrust[pulse.channel] * pulse.on_time / (220.0 * 9.80665) for pulse in made.pulses)
    assert made.pulses.propellant == pytest.approx(expected, rel=1e-14)
    assert STANDARD_GRAVITY == 9.80665


def test_propellant_of_all_thrusters_of_a_channel_and_by_lever_arms_and_one_unknown_makes_the_sum_unknown() -> None:
    pulse = channel_pulse(Channel("both", tuple(one.thrusters[0] for one in JETS[:2])), 3.0, 2.0)
    thrust = math.hypot(10.0, 1.0) + math.hypot(8.0, 2.0)
    assert pulse.propellant == pytest.approx(thrust * 2.0 / (220.0 * 9.80665), rel=1e-15)
    assert np.array_equal(pulse.impulse, 2.0 * (JETS[0].torque + JETS[1].torque))
    assert (None if pulse.force is None else pulse.force.tolist()) == [8.0, 12.0, 1.0]
    unknown = channel_pulse(cross(20.0)[0], 6.0, 1.0)
    known = [Schedule(some).propellant is not None for some in ((), (pulse,), (pulse, unknown))]
    assert known == [True, True, False]
    made = plan(spinner(steerable=Steerable(torque=20.0, isp=220.0, lever_arm=0.8)), "two-pulse").pulses
    assert made.propellant == pytest.approx(made.total_impulse / 0.8 / (220.0 * 9.80665), rel=1e-14)
    assert plan(spinner(steerable=Steerable(20.0)), "two-pulse").pulses.propellant is None


def test_impulses_and_the_end_of_a_schedule_in_the_order_of_its_centres() -> None:
    body = spinner(degrees=5.0)
    made = plan(body, "two-pulse").pulses
    assert body.least_impulse == pytest.approx(80.0 * 3.0 * math.tan(math.radians(5.0)), rel=1e-15)
    assert made.total_impulse == math.fsum(float(np.linalg.norm(one.impulse)) for one in made)
    ordered = Schedule((channel_pulse(JETS[0], 9.0, 4.0), channel_pulse(JETS[1], 8.0, 0.5)))
    assert ([pulse.t for pulse in ordered], ordered.end) == ([8.0, 9.0], 11.0)
