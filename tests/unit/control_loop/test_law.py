"""When the law fires: Magnus' sign table, its mirror image, directions of any kind, three different moments."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from support import reference
from support.builders import channel, spinner
from support.cases import spread

from nutdamp.errors import Infeasible
from nutdamp.loop.law import Law
from nutdamp.loop_settings import BANG, ONE_PULSE, Loop, Sensor

FOUR = tuple(
    channel(name, *torque, min_on_time=0.01, max_on_time=1.0)
    for name, torque in {"+M1": (6, 0, 0), "-M1": (-6, 0, 0), "+M2": (0, 6, 0), "-M2": (0, -6, 0)}.items()
)
TABLE = {"+M1": (1, 1), "-M1": (1, -1), "+M2": (0, -1), "-M2": (0, 1)}
"""Magnus 1970, section 4, for a ω3 > 0: which of ω1, ω2 is zero as a channel fires, and how it then changes."""


@pytest.mark.parametrize(("C", "spin"), [(80.0, 3.0), (80.0, -3.0), (160.0, 3.0), (160.0, -3.0)])
def test_sign_table_of_magnus_and_its_mirror_image(C: float, spin: float) -> None:
    craft = spinner(C=C, spin=spin, channels=FOUR)
    law, mirrored = Law(craft, Loop(Sensor(), start=0.01)), (120.0 - C) * spin < 0.0
    for actuator in law.actuators:
        z = 0.1 * cmath.exp(0.3j)
        firing = law.firing(actuator, z, spin)
        assert firing is not None
        turn = cmath.exp(-1j * (120.0 - C) / 120.0 * spin * (firing.wait + 0.5 * firing.on_time))
        then = z * turn
        change = -1j * (120.0 - C) / 120.0 * spin * then
        zero, sign = TABLE[actuator.channel.name]
        assert (then.real, then.imag)[zero] == pytest.approx(0.0, abs=1e-14)
        assert math.copysign(1.0, (change.real, change.imag)[zero]) == sign * (-1 if mirrored else 1)
        assert (then * actuator.kick.conjugate()).real < 0.0  # whatever the table: against ω


@spread("moments", [(120.0, 120.0, 80.0), (80.0, 80.0, 120.0), (120.0, 95.0, 80.0), (70.0, 90.0, 130.0)], quick=1)
@spread("spin", [2.0, -2.0], quick=1)
def test_a_firing_lowers_the_nutation_as_much_as_can_be(moments: tuple[float, float, float], spin: float) -> None:
    """Moved by a few degrees to either side it lowers less: by DOP853, small angles."""
    for degrees in (10.0, 205.0):
        torque = 0.5 * cmath.exp(1j * math.radians(degrees))
        craft = spinner(
            moments=moments, spin=spin, degrees=0.2, channels=(channel("one", torque.real, torque.imag, 0.0),)
        )
        law = Law(craft, Loop(Sensor(), start=1e-4, on_time=0.4))
        (actuator,) = law.actuators
        z = complex(law.seen(complex(*craft.omega0[:2])))
        firing = law.firing(actuator, z, spin)
        assert firing is not None
        start = firing.wait % craft.body_period + craft.body_period
        left = [_widest(moments, craft.omega0, np.array([torque.real, torque.imag, 0.0]), t) for t in _around(start)]
        assert left[1] < min(left[0], left[2])
        assert left[1] < _widest(moments, craft.omega0, np.zeros(3), start)


def _around(start: float) -> tuple[float, float, float]:
    return start - 0.3, start, start + 0.3


def _widest(moments: tuple[float, float, float], rates: np.ndarray, torque: np.ndarray, start: float) -> float:
    """Largest nutation angle on the arc after a pulse of 0.4 s."""
    begun = reference.coast(moments, reference.Motion(rates, np.eye(3)), np.zeros(3), np.array([start]))[-1]
    over = reference.coast(moments, begun, torque, np.array([0.4]))[-1]
    arc = reference.coast(moments, over, np.zeros(3), np.linspace(0.01, 7.5, 900))
    return max(reference.nutation(moments, one.rates, math.copysign(1.0, rates[2])) for one in arc)


@pytest.mark.parametrize("kind", ["four-pulse", ONE_PULSE, BANG])
@pytest.mark.parametrize("predict", [True, False])
def test_waits_of_many_moments_are_those_of_one(kind: str, predict: bool) -> None:
    rng = np.random.default_rng(3)
    channels = (*FOUR, channel("slanted", 2.0, 3.0, 0.0, min_on_time=0.02), channel("axial", 2.0, -1.0, 0.9))
    craft = spinner(channels=channels)
    law = Law(craft, Loop(Sensor(), kind, start=0.01, predict=predict, on_time=0.05 if kind != ONE_PULSE else None))
    z = rng.normal(size=200) * np.exp(rng.uniform(-9.0, 0.0, size=200)) * np.exp(1j * rng.uniform(0, 7, size=200))
    spin = rng.uniform(2.5, 3.5, size=200)
    for actuator in law.actuators:
        found = law.waits(actuator, z, spin)
        single = [law.firing(actuator, complex(one), float(turn)) for one, turn in zip(z, spin, strict=True)]
        wanted = np.array([math.nan if one is None else one.wait for one in single])
        exact = actuator.spin_rate == 0.0
        assert np.allclose(found, wanted, rtol=1e-12, atol=1e-12 if exact else 0.03, equal_nan=True)


def test_on_time_is_the_exact_one_for_what_is_left() -> None:
    """τ = (2/(aω3)) asin(aω3 A|ω|/(2M)), flown by DOP853: nothing is left."""
    craft = spinner(degrees=0.4, channels=FOUR)
    law = Law(craft, Loop(Sensor(), ONE_PULSE, start=1e-4))
    firing = law.firing(law.actuators[0], complex(*craft.omega0[:2]), 3.0)
    assert firing is not None
    rate, left = 3.0 / 3.0, 120.0 * abs(complex(*craft.omega0[:2]))
    assert firing.on_time == pytest.approx(2.0 / rate * math.asin(rate * left / (2.0 * 6.0)), rel=1e-13)
    start = firing.wait % craft.body_period
    begun = reference.coast((120, 120, 80), reference.Motion(craft.omega0, np.eye(3)), np.zeros(3), np.array([start]))
    torque = np.array([6.0, 0.0, 0.0])
    over = reference.coast((120, 120, 80), begun[-1], torque, np.array([firing.on_time]))[-1]
    assert np.hypot(*over.rates[:2]) < 1e-11


def test_a_pulse_that_would_leave_more_than_it_finds_is_not_fired() -> None:
    law = Law(spinner(channels=FOUR), Loop(Sensor(), start=1e-4))
    smallest = 0.01 * 6.0 / 120.0
    assert law.firing(law.actuators[0], complex(0.499 * smallest), 3.0) is None
    assert law.firing(law.actuators[0], complex(0.501 * smallest), 3.0) is not None


def test_no_law_for_a_sphere_or_without_channels() -> None:
    with pytest.raises(Infeasible, match="sphere"):
        Law(spinner(A=100.0, C=100.0, channels=FOUR), Loop(Sensor(), start=0.01))
    with pytest.raises(Infeasible, match="thrusters"):
        Law(spinner(), Loop(Sensor(), start=0.01))


def test_size_and_nutation_are_inverse_and_those_of_the_arc() -> None:
    for moments in ((120.0, 120.0, 80.0), (120.0, 95.0, 80.0), (70.0, 90.0, 130.0)):
        craft = spinner(moments=moments, degrees=0.05, channels=FOUR)
        law = Law(craft, Loop(Sensor(), start=0.01))
        size = abs(complex(law.seen(complex(*craft.omega0[:2]))))
        assert float(law.nutation(size, 3.0)) == pytest.approx(craft.nutation, rel=1e-5)
        assert law.size(float(law.nutation(size, 3.0)), -3.0) == pytest.approx(size)
