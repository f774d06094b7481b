"""Each numbered equation has a place in the code and a test; those without a test of their own are
checked here.
"""

import itertools
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from support.spinning import spinners

from nutdamp.flight import propagation
from nutdamp.schemes.catalogue import SchemeOptions
from nutdamp.schemes.one_pulse import schedule as one_pulse
from nutdamp.spacecraft.model import Inertia, Spacecraft
from nutdamp.spacecraft.schedule import Pulse, Schedule
from nutdamp.views.guide import entries

PHYSICS = Path(__file__).parent / "physics"
TESTED = {
    "test_rigid.py::test_motion_under_fixed_and_turning_torques": [
        f"M({number})" for number in (1, 2, 3, 5, 6, 8, 9, 10)
    ],
    "test_inertia.py::test_magnus_4_ratio_and_shape": ["M(4)"],
    "test_attitude.py::test_magnus_17_steps_at_an_impulse_and_turns_at_minus_a_omega3": ["M(7)"],
    "test_forced.py::test_constant_torque_11_circles_the_centre_of_its_pole_cone": ["M(11)"],
    "test_attitude.py::test_magnus_12_omega_is_back_in_the_body_after_t_omega": ["M(12)"],
    "test_forced.py::test_permanent_rotation_13_stays_and_has_the_euler_angles_14": [
        "M(13)",
        "M(14)",
    ],
    "../test_equations.py::test_a_pulse_in_the_schedule_is_15": ["M(15)"],
    "test_attitude.py::test_magnus_17_is_the_motion": ["M(16)", "M(17)"],
    "test_attitude.py::test_magnus_18_19_20_are_the_angles_between_the_vectors": [
        "M(18)",
        "M(19)",
        "M(20)",
    ],
    "../test_equations.py::test_one_pulse_21": ["M(21)"],
    "test_attitude.py::test_magnus_21_and_22_made_exact": ["M(22)"],
    "test_forced.py::test_rotating_torques_23_24": ["M(23)", "M(24)"],
    "test_forced.py::test_resonance_25_without_cancellation": ["M(25)"],
    "test_forced.py::test_26_opposite_rotation_and_its_straight_pole_curves": ["M(26)"],
    "test_forced.py::test_27_nearly_space_fixed_torque_and_its_beat": ["M(27)"],
    "test_inertia.py::test_nutation_in_three_frames": [f"K({number})" for number in range(5, 14)],
    "test_forced.py::test_precession_k14_k15_is_steady": ["K(14)", "K(15)"],
    "test_inertia.py::test_growth_is_what_integration_shows": ["24.4"],
    "test_energy_sink.py::test_the_arc_agrees_with_dop853": ["energy sink"],
    "test_triaxial.py::test_arcs": ["gyrostat"],
}
"""The equations that each test checks."""


def test_every_equation_of_magnus_and_kreisel_is_there_once_with_place_and_test() -> None:
    sources = [
        *(f"M({number})" for number in range(1, 28)),
        *(f"K({number})" for number in range(5, 16)),
        "24.4",
    ]
    names = [equation.name for equation in entries("equations")]
    assert names == [*sources, "energy sink", "gyrostat"]
    assert sorted(itertools.chain(*TESTED.values())) == sorted(names)
    for equation in entries("equations"):
        module, _, name = dict(equation.rows)["place"].rpartition(".")
        assert callable(getattr(import_module(module), name))
    for place in TESTED:
        path, _, function = place.partition("::")
        assert f"def {function}(" in (PHYSICS / path).read_text(encoding="utf-8")


@spinners
def test_one_pulse_21(A: float, C: float, spin: float) -> None:
    body = Spacecraft("x", Inertia((A, A, C)), np.array([0.3, -0.4, spin]))
    schedule = one_pulse(body, SchemeOptions())
    assert schedule.total_impulse == pytest.approx(A * 0.5, rel=1e-14)
    left = propagation.by_impulses(body, schedule).residual
    assert left.nutation < 1e-14
    assert left.momentum_shift == pytest.approx(body.nutation, rel=1e-12)


def test_a_pulse_in_the_schedule_is_15() -> None:
    """M(t) = Σ M_v δ(t - t_v): an ideal impulse changes ω by M_v/A at t_v and nothing else."""
    body = Spacecraft("x", Inertia((120.0, 120.0, 80.0)), np.array([0.2, 0.1, 3.0]))
    schedule = Schedule((Pulse(1.0, 0.0, "x", np.array([6.0, 0.0, 0.0])),))
    before, after = propagation.flown(body, schedule).around_pulses()
    assert after.rates[0] - before.rates[0] == pytest.approx([0.05, 0.0, 0.0], abs=1e-15)
    assert after.quaternion[0] == pytest.approx(before.quaternion[0], abs=1e-15)
