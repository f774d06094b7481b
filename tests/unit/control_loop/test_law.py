"""When the law fires: Magnus' sign table, its mirror image, directions of any kind, three different moments."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from support import reference
from support.builders import channel, spinner
from support.cases import spread
from support.golden import refused
from support.loops import fired_by, fires, four, transverse_size

from nutdamp.errors import Infeasible
from nutdamp.loop.law import Firing, Law
from nutdamp.loop_settings import BANG, ONE_PULSE, Loop, Sensor
from nutdamp.spacecraft import Spacecraft, Vector

FOUR = four(least=0.01, most=1.0)
TABLE = {"+M1": (1, 1), "-M1": (1, -1), "+M2": (0, -1), "-M2": (0, 1)}
"""Magnus 1970, section 4, for a ω3 > 0: which of ω1, ω2 is zero as a channel fires, and how it then changes."""


def first_firing(law: Law, z: complex, spin: float = 3.0) -> Firing:
    firing = law.firing(law.actuators[0], z, spin)
    assert firing is not None
    return firing


def after(moments: tuple[float, float, float], rates: Vector, torque: Vector, start: float, width: float) -> Vector:
    """Rates after a coast from ``rates`` and a pulse, by DOP853; then rates along an arc of 7.5 s: (n, 3)."""
    motion = reference.Motion(rates, np.eye(3))
    for push, times in ((np.zeros(3), [start]), (torque, [width]), (np.zeros(3), np.linspace(0.02, 7.5, 350))):
        path = reference.coast(moments, motion, push, np.array(times))
        motion = path[-1]
    return np.array([each.rates for each in path])


@pytest.mark.parametrize(("C", "spin"), [(80.0, 3.0), (80.0, -3.0), (160.0, 3.0), (160.0, -3.0)])
def test_sign_table_of_magnus_and_its_mirror_image(C: float, spin: float) -> None:
    law, rate = Law(fired_by(5.0, FOUR, C=C, spin=spin), Loop(Sensor(), start=0.01)), (120.0 - C) / 120.0 * spin
    for actuator in law.actuators:
        z = 0.1 * cmath.exp(0.3j)
        firing = law.firing(actuator, z, spin)
        assert firing is not None
        then = z * cmath.exp(-1j * rate * (firing.wait + 0.5 * firing.on_time))
        change = -1j * rate * then
        zero, sign = TABLE[actuator.channel.name]
        assert (then.real, then.imag)[zero] == pytest.approx(0.0, abs=1e-14)
        assert math.copysign(1.0, (change.real, change.imag)[zero]) == sign * (-1 if rate < 0.0 else 1)
        assert (then * actuator.kick.conjugate()).real < 0.0  # whatever the table: against ω


@spread("moments", [(120.0, 120.0, 80.0), (80.0, 80.0, 120.0), (120.0, 95.0, 80.0), (70.0, 90.0, 130.0)], quick=1)
@spread("spin", [2.0, -2.0], quick=1)
def test_a_firing_lowers_the_nutation_as_much_as_can_be(moments: tuple[float, float, float], spin: float) -> None:
    """Moved by a few degrees to either side it lowers less: by DOP853, small angles."""
    for degrees in (10.0, 205.0):
        push = 0.5 * cmath.exp(1j * math.radians(degrees))
        torque = np.array([push.real, push.imag, 0.0])
        craft = spinner(moments=moments, spin=spin, degrees=0.2, channels=(channel("T", *torque),))
        law = Law(craft, Loop(Sensor(), start=1e-4, on_time=0.4))
        firing = first_firing(law, complex(law.seen(complex(*craft.omega0[:2]))), spin)
        start = firing.wait % craft.body_period + craft.body_period

        def widest(
            at: float, push: Vector = torque, of: Spacecraft = craft, sense: float = math.copysign(1.0, spin)
        ) -> float:
            rates = after(moments, of.omega0, push, at, 0.4)
            return max(reference.nutation(moments, each, sense) for each in rates)

        assert widest(start) < min(widest(start - 0.3), widest(start + 0.3), widest(start, np.zeros(3)))


@pytest.mark.parametrize("kind", ["four-pulse", ONE_PULSE, BANG])
@pytest.mark.parametrize("predict", [True, False])
def test_waits_of_many_moments_are_those_of_each(kind: str, predict: bool) -> None:
    rng = np.random.default_rng(3)
    channels = (*FOUR, channel("slanted", 2.0, 3.0, 0.0, min_on_time=0.02), channel("axial", 2.0, -1.0, 0.9))
    on_time = 0.05 if kind != ONE_PULSE else None
    law = Law(spinner(channels=channels), Loop(Sensor(), kind, start=0.01, predict=predict, on_time=on_time))
    z = rng.normal(size=200) * np.exp(rng.uniform(-9.0, 0.0, size=200)) * np.exp(1j * rng.uniform(0, 7, size=200))
    spin = rng.uniform(2.5, 3.5, size=200)
    for actuator in law.actuators:
        single = [law.firing(actuator, complex(each), float(turn)) for each, turn in zip(z, spin, strict=True)]
        wanted = np.array([math.nan if each is None else each.wait for each in single])
        off = 1e-12 if actuator.spin_rate == 0.0 else 0.03
        assert np.allclose(law.waits(actuator, z, spin), wanted, rtol=1e-12, atol=off, equal_nan=True)


def test_on_time_is_the_exact_one_for_what_is_left() -> None:
    """τ = (2/(aω3)) asin(aω3 A|ω|/(2M)), flown by DOP853: nothing is left."""
    craft = fired_by(0.4, FOUR)
    firing = first_firing(Law(craft, Loop(Sensor(), ONE_PULSE, start=1e-4)), complex(*craft.omega0[:2]))
    rate, left = 3.0 / 3.0, 120.0 * transverse_size(craft.omega0)
    assert firing.on_time == pytest.approx(2.0 / rate * math.asin(rate * left / (2.0 * 6.0)), rel=1e-13)
    start, torque = firing.wait % craft.body_period, np.array([6.0, 0.0, 0.0])
    assert transverse_size(after((120, 120, 80), craft.omega0, torque, start, firing.on_time)[0]) < 1e-11


def test_a_pulse_that_would_leave_more_than_it_finds_is_not_fired() -> None:
    law, smallest = Law(fired_by(5.0, FOUR), Loop(Sensor(), start=1e-4)), 0.01 * 6.0 / 120.0
    assert law.firing(law.actuators[0], complex(0.499 * smallest), 3.0) is None
    assert law.firing(law.actuators[0], complex(0.501 * smallest), 3.0) is not None


def test_no_law_for_a_sphere_or_without_channels() -> None:
    for key, body in (("sphere", fired_by(5.0, FOUR, A=100.0, C=100.0)), ("no-channels", spinner())):
        with refused(Infeasible, f"loop.{key}"):
            Law(body, fires())


def test_size_and_nutation_are_inverse_and_those_of_the_arc() -> None:
    for moments in ((120.0, 120.0, 80.0), (120.0, 95.0, 80.0), (70.0, 90.0, 130.0)):
        craft = fired_by(0.05, FOUR, moments=moments)
        law = Law(craft, fires())
        size = abs(complex(law.seen(complex(*craft.omega0[:2]))))
        assert float(law.nutation(size, 3.0)) == pytest.approx(craft.nutation, rel=1e-5)
        assert law.size(float(law.nutation(size, 3.0)), -3.0) == pytest.approx(size)
