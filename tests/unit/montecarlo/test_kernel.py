"""The closed form over many cases, against an independent integrator and against the flight of single cases."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support import dispersed, reference, swarm
from support.builders import spinner
from support.single_case import realised

from nutdamp import flight
from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.kernel import ClosedForm, nodes_for
from nutdamp.dispersion.outputs import OUTPUTS, measure
from nutdamp.dispersion.study import Study
from nutdamp.physics import rates
from nutdamp.physics.rigid_cases import cos_sin
from nutdamp.schedule import Schedule, steerable_pulse
from nutdamp.spacecraft import Steerable
from nutdamp.tolerances import Dispersions, Tolerance

CASES = 100
MODELS = {
    "prolate": dispersed.with_jets(),
    "prolate, spin reversed": dispersed.with_jets(spin=-3.0),
    "oblate": dispersed.with_jets(moments=(80.0, 80.0, 120.0), spin=2.0),
    "near a sphere": dispersed.with_jets(moments=(100.0, 100.0, 100.0)),
    "steerable, oblate, spin reversed": dispersed.steered(moments=(70.0, 70.0, 110.0), spin=-4.0),
}
SINKING = {
    "prolate": dispersed.sinking(MODELS["prolate"]),
    "steerable, oblate, spin reversed": dispersed.sinking(MODELS["steerable, oblate, spin reversed"], 4.0),
}


def outputs(model: Model, draws: object) -> np.ndarray:
    out = np.empty((5, CASES))
    measure(model, ClosedForm(model)(model.cases(draws)), out)  # type: ignore[arg-type]
    return out


@pytest.mark.parametrize("name", MODELS)
def test_500_cases_agree_with_an_independent_integrator(name: str) -> None:
    """Kicks at the pulse centres; the body is flown by DOP853."""
    model = MODELS[name]
    draws = dispersed.first_cases(Study(model), CASES)
    found = outputs(model, draws)
    body, pulses, _ = dispersed.body_of(model)
    moments, omega0 = np.empty((CASES, 3)), np.empty((CASES, 3))
    times, kicks = np.empty((len(pulses), CASES)), np.empty((len(pulses), CASES, 3))
    tilts = np.empty((CASES, 2))
    for case in range(CASES):
        one = dispersed.one_of(draws, case)
        true, schedule = realised(model, one)
        moments[case], omega0[case] = true.inertia.moments, true.omega0
        spin = float(true.omega0[2])
        for row, pulse in enumerate(schedule):
            axial = 0.0 if pulse.torque is None else float(pulse.torque[2])
            factor = rates.width_factor(true.inertia.a, spin, axial / true.inertia.C, pulse.on_time)
            acting = complex(pulse.impulse[0], pulse.impulse[1]) * factor
            kicks[row, case] = acting.real, acting.imag, pulse.impulse[2]
            times[row, case] = pulse.t
            spin += float(pulse.impulse[2]) / true.inertia.C
        tilts[case] = one["attitude x"], one["attitude y"]
    end, rotation = swarm.fly(moments, omega0, times, kicks)
    momentum = moments * end
    sense = math.copysign(1.0, body.spin)
    after = np.einsum("nij,nj->ni", rotation, momentum)
    assert found[0] == pytest.approx(swarm.angles(momentum, np.array([[0.0, 0.0, sense]])), abs=1e-9)
    assert found[1] == pytest.approx(swarm.angles(moments * omega0, after), abs=1e-9)
    assert found[3] == pytest.approx(end[:, 2] - omega0[:, 2], abs=1e-9)
    # The axis error: H in the estimated body axes, from the true ones by the tilt, against H as the estimate has it.
    from scipy.spatial.transform import Rotation

    pointed = Rotation.from_rotvec(np.column_stack([tilts, np.zeros(CASES)])).apply(after)
    estimate = np.asarray(body.inertia.moments) * body.omega0
    assert found[2] == pytest.approx(swarm.angles(pointed, estimate[None, :]), abs=1e-9)
    assert found[0].std() > 1e-3  # the cases do differ


def test_the_swarm_is_the_reference_integrator() -> None:
    moments, omega0 = np.array([[120.0, 120.0, 80.0]]), np.array([[0.1, 0.2, 3.0]])
    kick = np.array([4.0, -3.0, 1.0])
    end, rotation = swarm.fly(moments, omega0, np.array([[2.0]]), kick[None, None, :])
    alone = reference.fly(moments[0], omega0[0], [reference.Kick(2.0, kick)], 2.0, np.eye(3))
    assert end[0] == pytest.approx(alone.rates, abs=1e-11)
    assert rotation[0] == pytest.approx(alone.rotation, abs=1e-11)


@pytest.mark.parametrize(
    "model", [*MODELS.values(), *SINKING.values()], ids=[*MODELS, *(f"{n}, sink" for n in SINKING)]
)
def test_each_case_is_the_impulse_sum_of_its_own_spacecraft(model: Model) -> None:
    draws = dispersed.first_cases(Study(model), CASES)
    found = outputs(model, draws)
    for case in range(0, CASES, 5):
        left = flight.by_impulses(*realised(model, dispersed.one_of(draws, case))).residual
        assert found[0, case] == pytest.approx(left.nutation, abs=1e-12)
        assert found[1, case] == pytest.approx(left.momentum_shift, abs=1e-12)


@pytest.mark.parametrize("name", SINKING)
def test_cases_with_dissipation_agree_with_an_independent_integrator(name: str) -> None:
    """Kicks at the pulse centres, by DOP853 on H in space and the attitude."""
    model = SINKING[name]
    draws = dispersed.first_cases(Study(model), CASES)
    found = outputs(model, draws)
    for case in range(0, CASES, 10):
        true, schedule = realised(model, dispersed.one_of(draws, case))
        kicks = [
            reference.Kick(pulse.t, np.array([acting.real, acting.imag, pulse.impulse[2]]))
            for pulse, acting in zip(schedule, flight.effective_impulses(true, schedule), strict=True)
        ]
        until = max(pulse.t for pulse in schedule)
        start = reference.frame_n(true.inertia.moments, true.omega0)
        end = reference.fly(true.inertia.moments, true.omega0, kicks, until, start, true.growth)
        before = start @ (np.asarray(true.inertia.moments) * true.omega0)
        shift = reference.angle(before, reference.momentum(true.inertia.moments, end))
        sense = math.copysign(1.0, true.spin)
        assert found[0, case] == pytest.approx(reference.nutation(true.inertia.moments, end.rates, sense), abs=1e-9)
        assert found[1, case] == pytest.approx(shift, abs=1e-9)
        assert found[3, case] == pytest.approx(end.rates[2] - true.spin, abs=1e-9)


@pytest.mark.parametrize("model", [MODELS["prolate"], SINKING["prolate"]], ids=["free", "sink"])
def test_no_draw_is_the_estimate_itself(model: Model) -> None:
    left = flight.by_impulses(model.spacecraft, model.schedule).residual
    found = outputs(model, {})[:, 0]
    assert found[:3] == pytest.approx([left.nutation, left.momentum_shift, left.axis_error], abs=1e-13)
    assert found[4] == pytest.approx(model.schedule.propellant)


def test_pulses_that_change_places_act_in_their_own_order() -> None:
    """Impulses 20 ms apart, of which a fixed error of 50 ms makes the second the first."""
    torquer = Steerable()
    pulses = Schedule(tuple(steerable_pulse(torquer, t, angle, impulse=4.0) for t, angle in ((1.0, 0.3), (1.02, 2.0))))
    model = Model(replace(spinner(), dispersions=Dispersions(timing=Tolerance("uniform", 0.05))), pulses)
    draws = {"timing pulse 1": 0.05, "timing pulse 2": 0.0}
    left = flight.by_impulses(*realised(model, draws)).residual
    assert outputs(model, draws)[:2, 0] == pytest.approx([left.nutation, left.momentum_shift], abs=1e-12)


def test_a_pulse_shifted_before_t_0_fires_at_0() -> None:
    body = replace(spinner(steerable=Steerable(20.0)), dispersions=Dispersions(timing_offset=Tolerance("bias", -5.0)))
    pulses = Schedule((steerable_pulse(Steerable(20.0), 0.4, 0.3, on_time=0.4),))
    cases = Model(body, pulses).cases({"timing offset": -5.0})
    assert cases.starts == (0.0,)


def test_a_schedule_without_pulses_leaves_what_is_there() -> None:
    body = replace(spinner(), dispersions=Dispersions(A=Tolerance("normal", 0.01, True)))
    study = Study(Model(body, Schedule()))
    nutation, shift, *_ = study.outputs_of({"A": 1.2})
    assert nutation == pytest.approx(math.atan(1.01 * math.tan(math.radians(5.0))))
    assert shift == 0.0


@pytest.mark.parametrize("phase", [0.0, 1e-9, 0.1, 1.0, 3.0, 10.0, 40.0])
def test_the_quadrature_of_wide_pulses_is_exact_to_rounding(phase: float) -> None:
    places, weights = np.polynomial.legendre.leggauss(nodes_for(phase))
    mean = 0.5 * float(weights @ np.cos(phase * places))
    assert mean == pytest.approx(np.sinc(phase / np.pi), abs=1e-14)


def test_the_half_angle_form_is_as_exact_as_the_library() -> None:
    angle = np.concatenate([np.linspace(-400.0, 400.0, 20_001), [0.0, np.pi, -np.pi, 1e-300]])
    cosine, sine = cos_sin(angle)
    assert np.abs(cosine - np.cos(angle)).max() < 1e-15
    assert np.abs(sine - np.sin(angle)).max() < 1e-15


def test_outputs_stand_in_the_order_of_their_names() -> None:
    assert OUTPUTS == ("nutation", "momentum_shift", "axis_error", "spin_change", "propellant")
