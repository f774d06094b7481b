"""Command blocks in dispersed cases: each fires from its own Sun pulses, as the same body alone does."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import dispersed
from support.builders import channel, cross, spinner
from support.cases import spread
from support.single_case import flown_outputs, realised, timed
from support.spinners import commanded, flown_by_reference

from nutdamp import flight
from nutdamp.commands import Block, SunSensor
from nutdamp.dispersion import study_of
from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.flown import RealWidths
from nutdamp.dispersion.outputs import OUTPUTS, measure
from nutdamp.dispersion.study import Results, run
from nutdamp.physics.feed import Cold, Tank
from nutdamp.physics.valve import Trapezoid
from nutdamp.schemes.tools.sun_pulses import fired
from nutdamp.spacecraft import Disturbance
from nutdamp.tolerances import Dispersions, Tolerance

CASES = 16
DISPERSED = """
dispersions:
  A: {normal: 2 %}
  omega0: [{normal: 0.1 deg/s}, {normal: 0.1 deg/s}, {normal: 0.5 %}]
  thrust: {normal: 3 %}
"""
BODY = Dispersions(
    A=dispersed.normal(0.03, relative=True),
    C=dispersed.normal(0.03, relative=True),
    omega0=(dispersed.normal(0.01), dispersed.normal(0.01), dispersed.normal(0.05)),
)
"""Errors of the body alone: then `fired` fires the same pulses."""


def model_of(dispersions: Dispersions = BODY, *, spin: float = -2.0, **fields: Any) -> Model:
    """Three blocks of two thrusters, one of them with an axial torque, of an oblate body that nutates."""
    body = spinner(110.0, 150.0, spin, 2.0, channels=(channel("T", 8.0, 3.0, 2.0), *cross(9.0)))
    turn = 2.0 * math.pi / abs(spin)
    blocks = (
        Block("T", 2, 0.3 * turn, 0.05 * turn, 6, 1),
        Block("+1", 19, 0.96 * turn, 0.07 * turn, 4, 1),  # still on when the next Sun pulse comes
        Block("-2", 26, 0.1 * turn, 0.03 * turn, 5, 2),
    )
    body = replace(commanded(body, np.array([1.0, 0.3, -0.4])), dispersions=dispersions, **fields)
    return Model(body, fired(body, blocks))


def three_moments(spin: float) -> Model:
    model = model_of(spin=spin)
    body = replace(model.spacecraft, inertia=replace(model.spacecraft.inertia, moments=(110.0, 98.0, 150.0)))
    return Model(body, fired(body, model.schedule.blocks))


@spread(
    "model",
    [
        model_of(),
        model_of(spin=1.3),
        three_moments(2.0),
        model_of(disturbances=(Disturbance(0.02 + 0.01j, 0.03), Disturbance(0.03 + 0.0j, rate=-3.0))),
    ],
    quick=1,
    ids=["spin reversed", "spin", "three moments", "disturbances"],
)
def test_each_case_fires_as_its_own_body_alone(model: Model) -> None:
    draws = dispersed.first_cases(study_of(model.spacecraft, model.schedule), CASES)
    own = timed(model, model.cases(draws))
    found = np.empty((len(OUTPUTS), CASES))
    measure(model, RealWidths(model)(model.cases(draws)), found)
    planned = np.array([pulse.start for pulse in model.schedule])
    for case in range(0, CASES, 7):
        one = dispersed.one_of(draws, case)
        true, _ = realised(model, one)
        starts = np.array([pulse.start for pulse in fired(true, model.schedule.blocks)])
        assert np.array([start[case] for start in own.starts]) == pytest.approx(starts, abs=1e-9)
        assert np.abs(starts - planned).max() > 0.05  # at planned times they would be elsewhere
        assert found[:, case] == pytest.approx(flown_outputs(model, one), abs=1e-9, nan_ok=True)


def test_cases_fire_what_their_valves_give() -> None:
    """Ramps, cold nozzles and falling pressure; a Sun pulse comes while the thrust is on."""
    valve = Trapezoid(open_delay=0.06, close_delay=0.09, rise_time=0.03, fall_time=0.08)
    model = model_of(cold=Cold(0.7, 3.0), tank=Tank(1.0, 2e6, 1e6, 1.0))
    body = replace(model.spacecraft, channels=tuple(one.of(valve=valve) for one in model.spacecraft.channels))
    model = Model(body, fired(body, model.schedule.blocks))
    draws = dispersed.first_cases(study_of(model.spacecraft, model.schedule), CASES)
    own = timed(model, model.cases(draws))
    found = np.empty((len(OUTPUTS), CASES))
    measure(model, RealWidths(model)(model.cases(draws)), found)
    for case in (2, 11):
        one = dispersed.one_of(draws, case)
        true, _ = realised(model, one)
        made = fired(true, model.schedule.blocks)
        middles = [start[case] + 0.5 * width for start, width in zip(own.starts, model.on_times, strict=True)]
        assert middles == pytest.approx([pulse.t for pulse in made], abs=1e-9)
        assert np.abs(np.array(middles) - [pulse.t for pulse in model.schedule]).max() > 0.05
        settled = flight.flown(true, made).settled
        assert found[:, case] == pytest.approx(flown_outputs(model, one), abs=1e-9, nan_ok=True)
        assert found[OUTPUTS.index("spin_change"), case] == pytest.approx(settled.spin - true.spin, abs=1e-9)


@pytest.mark.deep
def test_and_as_the_reference_has_it() -> None:
    """Euler's equations by DOP853, Sun pulses as their roots."""
    model = model_of()
    draws = dispersed.first_cases(study_of(model.spacecraft, model.schedule), 4)
    own = timed(model, model.cases(draws))
    for case in (0, 3):
        true, _ = realised(model, dispersed.one_of(draws, case))
        _, starts = flown_by_reference(true, model.schedule.blocks)
        assert [start[case] for start in own.starts] == pytest.approx(starts, abs=1e-7)


def test_errors_of_timing_and_of_the_attitude_are_those_of_the_case() -> None:
    """A tilt of the truth moves its Sun pulses; an offset, a timing error and jitter come on top."""
    given = Dispersions(attitude=dispersed.normal(0.03), timing=Tolerance("uniform", 0.01))
    model = model_of(replace(given, timing_offset=dispersed.normal(0.02)), sun_sensor=SunSensor(0.4, jitter=2e-3))
    names = [entry.name for entry in model.inputs.drawn]
    assert names.count("Sun pulse 15") == 1
    assert sum(name.startswith("Sun pulse") for name in names) == len(model.schedule)
    draws = dispersed.first_cases(study_of(model.spacecraft, model.schedule), CASES)
    own = timed(model, model.cases(draws))
    one = dispersed.one_of(draws, 5)
    true, _ = realised(model, {name: draw for name, draw in one.items() if name.startswith("attitude")})
    late = one["timing offset"] + one["timing pulse 1"] + one["Sun pulse 1"]
    first = fired(replace(true, sun_sensor=SunSensor(0.4)), model.schedule.blocks[:1]).pulses[0]
    assert own.starts[0][5] == pytest.approx(first.start + late, abs=1e-9)


def test_an_error_of_the_spin_turns_no_heading() -> None:
    """From its own Sun pulses a train keeps its phase against the Sun; at planned times it would be smeared."""
    body = commanded(spinner(120.0, 170.0, 1.2, 0.0, channels=cross(3.0)), np.array([1.0, 0.2, 0.1]))
    body = replace(body, dispersions=Dispersions(omega0=(None, None, dispersed.normal(0.01, relative=True))))
    made = fired(body, (Block("+1", 1, 1.0, 0.2, 60),))
    by_sun = run(Results(study_of(body, made), 512))
    at_times = run(Results(study_of(body, replace(made, blocks=())), 512))
    own, fixed = (np.std(one.values[1]) for one in (by_sun, at_times) if one.values is not None)
    assert 5.0 * own < fixed


def test_a_sensor_that_loses_the_sun_fires_nothing() -> None:
    model = model_of()
    body = model.spacecraft
    ends = RealWidths(model)(model.cases({}))
    blind = replace(body, sun_sensor=SunSensor(0.4, elevation=1.4, half_width=0.1), dispersions=BODY)
    blinded = Model(blind, model.schedule)
    own, gone = timed(blinded, model.cases({})), RealWidths(blinded)(model.cases({}))
    assert not np.array(own.impulses).any()
    assert gone.propellant is None or float(np.max(gone.propellant)) == 0.0
    assert float(np.squeeze(gone.spin_change)) == pytest.approx(0.0, abs=1e-12)
    assert abs(float(np.squeeze(ends.spin_change))) > 1e-3


def derivative(model: Model, name: str, step: float) -> Mapping[str, float]:
    plus, minus = (flown_outputs(model, {name: sign * step}) for sign in (1.0, -1.0))
    return dict(zip(OUTPUTS, (plus - minus) / (2.0 * step), strict=True))


def test_sensitivities_are_those_of_pulses_fired_by_the_sun() -> None:
    model = model_of()
    first = study_of(model.spacecraft, model.schedule).first_order
    for name in ("A", "C", "omega0_3"):
        index = [entry.name for entry in first.inputs].index(name)
        expected = derivative(model, name, 1e-3 * first.inputs[index].size)["spin_change"]
        assert first.jacobian[8, index] == pytest.approx(expected, rel=1e-4, abs=1e-9)
