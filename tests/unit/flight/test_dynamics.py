"""Flights of trial schedules: flown anew from the first pulse that has changed, and the same to the last bit."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.builders import pulse, spinner
from support.cases import deep
from support.places import CASES
from support.strategies import schedules, symmetric_spinners, triaxial_spinners

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.files.reader import load_spacecraft
from nutdamp.flight import dynamics as motion
from nutdamp.flight import propagation
from nutdamp.physics import taylor
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule

THREE = spinner(moments=(100.0, 120.0, 80.0))


def bits(flown: propagation.Flight) -> list[bytes]:
    """All that a flight gives: legs, motion along them and how it ends."""
    legs = [repr((one.start, one.end, one.completed, one.jump, one.completed_at_end)).encode() for one in flown.legs]
    motion, settled = flown.motion(np.linspace(0.0, flown.legs[-1].end, 50)), flown.settled
    return [*legs, *(part.tobytes() for part in (*motion, settled.rates, settled.quaternion))]


def train(count: int, moved: int | None = None) -> Schedule:
    """So many pulses, one every 4 s; the one with the number ``moved`` comes later and is longer."""
    pulses = [(4.0 * n + 1.0, 0.5) if n != moved else (4.0 * n + 1.2, 0.7) for n in range(count)]
    return Schedule(tuple(pulse(t, on, on * np.array([3.0, -2.0, 0.5])) for t, on in pulses))


@pytest.mark.deep
@given(
    st.one_of(symmetric_spinners(), triaxial_spinners()),
    st.sampled_from([0.0, 200.0]),
    st.lists(st.one_of(schedules(), schedules(ideal=True)), min_size=2, max_size=3),
)
def test_what_is_remembered_changes_no_bit(body: Spacecraft, constant: float, every: list[Schedule]) -> None:
    body = replace(body, dissipation=constant) if constant else body
    remembering = motion.make_dynamics(body).remembering()
    mixed = [Schedule((*one.pulses, *other.pulses)) for one in every for other in every]
    for made in (*every, *mixed, *every):
        assert bits(propagation.flown(body, made, dynamics=remembering)) == bits(propagation.flown(body, made))


@pytest.mark.parametrize("moved", [0, 3, 7])
def test_a_trial_costs_what_comes_after_the_pulse_that_has_changed(moved: int) -> None:
    remembering = motion.make_dynamics(THREE).remembering()
    propagation.flown(THREE, train(8), dynamics=remembering)
    with work.budget("trial", 1e9) as trial:
        flown = propagation.flown(THREE, train(8, moved), dynamics=remembering)
    assert bits(flown) == bits(propagation.flown(THREE, train(8, moved)))
    changed = [leg for leg in flown.legs if leg.end > 4.0 * moved + 0.75]  # a leg for each coast, pulse, and the end
    assert len(changed) == 2 * (8 - moved) + 1
    integrated = [leg for leg in changed if leg.end > leg.start]
    steps = sum(leg.path.steps for leg in integrated)
    expected = len(changed) * motion.LEG + len(integrated) * motion.PULSE + steps * motion.STEP
    assert trial.done == pytest.approx(expected)


def test_a_flight_that_is_remembered_keeps_its_limit_of_steps() -> None:
    remembering = motion.make_dynamics(THREE).remembering()
    torque = [np.array([0.0, 0.0, 0.1])]
    path, _ = remembering.path(THREE.initial, 0.0, 50.0, torque, most=1000)
    assert remembering.path(THREE.initial, 0.0, 50.0, torque, most=path.steps)[0] is path
    with pytest.raises(Infeasible):
        remembering.path(THREE.initial, 0.0, 50.0, torque, most=path.steps - 1)


@given(triaxial_spinners())
def test_a_long_coast_in_closed_form_is_that_of_taylor_series(body: Spacecraft) -> None:
    end = 3.0 * motion.LONG / float(np.linalg.norm(body.omega0))
    path, after = motion.make_dynamics(body).path(body.initial, 0.0, end, most=1000)
    pieces = taylor.integrate(body.inertia.moments, np.zeros(3), body.omega0, body.initial.quaternion, 0.0, end)
    rates, quaternion = pieces[-1].final
    assert path.steps == 0
    assert np.allclose(after.rates, rates, rtol=0.0, atol=1e-10 * np.linalg.norm(rates))
    assert np.allclose(after.quaternion, quaternion, rtol=0.0, atol=1e-10)


def test_legs_are_forgotten_before_they_are_too_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion, "REMEMBERED", 3)
    body = spinner()
    remembering = motion.make_dynamics(body).remembering()
    for made in (train(2), train(2, 1), train(2, 0)):
        assert bits(propagation.flown(body, made, dynamics=remembering)) == bits(propagation.flown(body, made))
    assert 0 < len(remembering.known or ()) <= 3


@pytest.mark.parametrize("name", [deep("geo-dissipation"), deep("tensor-microsat")])
def test_plans_are_the_same_for_much_less_work(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    body = load_spacecraft(CASES / f"{name}.yaml")
    with work.budget("remembered", 1e9) as remembered:
        made = planning.plan(body, "two-pulse").pulses
    monkeypatch.setattr(motion.Dynamics, "remembering", lambda one: one)
    with work.budget("whole", 1e9) as whole:
        same = planning.plan(body, "two-pulse").pulses
    assert [(one.t, one.on_time) for one in made] == [(one.t, one.on_time) for one in same]
    assert 0.0 < remembered.done < 0.75 * whole.done
