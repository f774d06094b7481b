"""Where each numbered equation of the sources stands in the code, and which test checks it."""

from __future__ import annotations

from typing import NamedTuple


class Equation(NamedTuple):
    """One or more numbered equations: subject, the ``place`` that holds them, the ``test`` that checks them.

    ``place`` is a dotted name, ``test`` a file and a function of tests/; ``note`` says what differs from the print.
    """

    number: str
    subject: str
    place: str
    test: str
    note: str = ""


_PHYSICS = "nutdamp.physics"

MAGNUS = (
    Equation(
        "M(1)",
        "Euler's equations, symmetric body",
        f"{_PHYSICS}.rigid.integrate",
        "physics/test_forced.py::test_stepwise_torques_8_9_10",
        "for three different moments; the tests integrate (1) as printed",
    ),
    Equation(
        "M(2)",
        "α = ∫ω3 dt",
        f"{_PHYSICS}.rates.impulse_sum",
        "physics/test_forced.py::test_stepwise_torques_8_9_10",
        "stays harmless where the spin passes zero",
    ),
    Equation(
        "M(3), (5), (6)",
        "equations in α, with m = M/(Aω3)",
        f"{_PHYSICS}.forced.stepwise_torque",
        "physics/test_forced.py::test_stepwise_torques_8_9_10",
        "kept in time: dividing by ω3 breaks at zero spin",
    ),
    Equation(
        "M(4)", "inertia ratio a = (A - C)/A", f"{_PHYSICS}.inertia.ratio", "test_equations.py::test_inertia_ratio_4"
    ),
    Equation(
        "M(7)",
        "nutation started by one impulse",
        f"{_PHYSICS}.rates.impulse_sum",
        "test_equations.py::test_one_impulse_7",
    ),
    Equation(
        "M(8), (9), (10)",
        "general solution, complex and real",
        f"{_PHYSICS}.forced.stepwise_torque",
        "physics/test_forced.py::test_real_form_9_is_the_complex_one",
    ),
    Equation(
        "M(11)",
        "constant torque, pole cone",
        f"{_PHYSICS}.forced.rotating_torques",
        "physics/test_forced.py::test_constant_torque_11_circles_the_centre_of_its_pole_cone",
    ),
    Equation(
        "M(12)",
        "period T_ω in the body",
        f"{_PHYSICS}.cones.body_period",
        "test_equations.py::test_period_12",
        "|aω3|: holds for oblate bodies and reversed spin",
    ),
    Equation(
        "M(13), (14)",
        "permanent rotation and its Euler angles",
        f"{_PHYSICS}.forced.permanent_rotation",
        "physics/test_forced.py::test_permanent_rotation_13_stays_and_has_the_euler_angles_14",
        "|A - C| and arctan2; ψ' is |ω|, not |dω/dt|",
    ),
    Equation(
        "M(15), (16), (17)",
        "sum of impulses",
        f"{_PHYSICS}.rates.impulse_sum",
        "test_equations.py::test_impulse_sum_17",
        "with axial impulses; the lines before (17) want +i",
    ),
    Equation("M(18)", "body cone", f"{_PHYSICS}.cones.body_cone", "test_equations.py::test_cones_18_19_20"),
    Equation("M(19)", "nutation angle", f"{_PHYSICS}.cones.nutation_angle", "test_equations.py::test_cones_18_19_20"),
    Equation(
        "M(20)",
        "space cone",
        f"{_PHYSICS}.cones.space_cone",
        "test_equations.py::test_cones_18_19_20",
        "misprinted: plus in the denominator, and |ω|² for ω1²",
    ),
    Equation(
        "M(21)",
        "one pulse of A|ω|",
        "nutdamp.schemes.one_pulse.schedule",
        "test_equations.py::test_one_pulse_21",
    ),
    Equation(
        "M(22)",
        "two half pulses",
        f"{_PHYSICS}.damping.half_pulses",
        "test_equations.py::test_two_pulses_22",
        "as printed it is a small-angle scheme (half_pulses_as_printed)",
    ),
    Equation(
        "M(23), (24)",
        "turning torques",
        f"{_PHYSICS}.forced.rotating_torques",
        "physics/test_forced.py::test_rotating_torques_23_24",
        "ω0 of the print is an integration constant, not ω(0)",
    ),
    Equation(
        "M(25)",
        "resonance",
        f"{_PHYSICS}.forced.rotating_torques",
        "physics/test_forced.py::test_resonance_25_without_cancellation",
    ),
    Equation(
        "M(26)",
        "b = a, straight pole curves",
        f"{_PHYSICS}.forced.rotating_torques",
        "physics/test_forced.py::test_26_opposite_rotation_and_its_straight_pole_curves",
        "straight for every |ω0| = |m0/2a|",
    ),
    Equation(
        "M(27)",
        "b = -1, nearly space-fixed torque",
        f"{_PHYSICS}.forced.beat",
        "physics/test_forced.py::test_27_nearly_space_fixed_torque_and_its_beat",
    ),
)

KREISEL = (
    Equation(
        "K(5), (6)",
        "free motion in the body",
        f"{_PHYSICS}.rates.impulse_sum",
        "test_equations.py::test_free_motion_in_three_frames_k5_to_k13",
    ),
    Equation(
        "K(7)",
        "nutation rate in the body",
        f"{_PHYSICS}.stability.nutation_rates",
        "test_equations.py::test_free_motion_in_three_frames_k5_to_k13",
    ),
    Equation(
        "K(8), (9), (10)",
        "nutation in the despun frame",
        f"{_PHYSICS}.stability.nutation_rates",
        "test_equations.py::test_free_motion_in_three_frames_k5_to_k13",
    ),
    Equation(
        "K(11), (13)",
        "nutation seen inertially, |H|/A",
        f"{_PHYSICS}.cones.inertial_rate",
        "test_equations.py::test_free_motion_in_three_frames_k5_to_k13",
        "a rate: K(13) prints the vector L/J_xy",
    ),
    Equation(
        "K(12)",
        "nutation in inertial components",
        f"{_PHYSICS}.attitude.arc",
        "test_equations.py::test_free_motion_in_three_frames_k5_to_k13",
        "a small-angle form; the arcs here are exact",
    ),
    Equation(
        "K(14)",
        "precession, torque fixed in the body",
        f"{_PHYSICS}.forced.steady_response",
        "test_equations.py::test_precession_k14_k15",
        "needs M_z = 0; last line must read (J_z - J_xy)",
    ),
    Equation(
        "K(15)",
        "precession, torque fixed in the despun frame",
        f"{_PHYSICS}.forced.steady_response",
        "test_equations.py::test_precession_k14_k15",
        "needs M_z = 0; its third component is 0",
    ),
    Equation(
        "§24.4",
        "stability of spin about a principal axis",
        f"{_PHYSICS}.stability.growth",
        "test_equations.py::test_stability_24_4",
        "prints p² <= 0: with p = 0 it grows linearly",
    ),
    Equation(
        "energy sink",
        "coast with energy dissipation",
        f"{_PHYSICS}.energy_sink.arc",
        "physics/test_energy_sink.py::test_200_s_agree_with_dop853",
        "tan θ = tan θ0 e^{±t/τ} with H at rest in space; in none of the sources",
    ),
)

EQUATIONS = (*MAGNUS, *KREISEL)
SOURCES = (
    'M(n): K. Magnus, "Untersuchungen über zeitabhängig selbsterregte, symmetrische Kreisel"',
    'K(n): lecture text "Kreisel-Bewegungen"',
    '§24.4: lecture text "Kreiseltheorie"',
)
