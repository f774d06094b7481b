"""The numbered equations of the lecture texts "Kreisel-Bewegungen" and "Kreiseltheorie", and the energy sink."""

from __future__ import annotations

from nutdamp.guide.equation import Equation

_PHYSICS = "nutdamp.physics"

KREISEL = (
    Equation(
        "K(5)",
        "free motion in the body, equations",
        (
            "0 = J_xy dω_x/dt + (J_z - J_xy) ω_y ω_z",
            "0 = J_xy dω_y/dt - (J_z - J_xy) ω_x ω_z",
            "0 = J_z dω_z/dt",
        ),
        "J_xy J_z ω_x ω_y ω_z",
        f"{_PHYSICS}.rates.impulse_sum",
        "M(1) without torque.",
    ),
    Equation(
        "K(6)",
        "free motion in the body, solution",
        ("ω_n = (Â cos(ω_N t + ψ), Â sin(ω_N t + ψ), ω_z)",),
        "ω_n Â ω_N t ψ ω_z",
        f"{_PHYSICS}.rates.impulse_sum",
        "As M(17) without pulses: ω(t) = ω0 e^(-iaω3t).",
    ),
    Equation(
        "K(7)",
        "rate of the nutation in the body",
        ("ω_N = (J_z - J_xy)/J_xy ω_z",),
        "ω_N J_xy J_z ω_z",
        f"{_PHYSICS}.stability.nutation_rates",
        "Nothing but the letters: -aω3, with the sign of the turn.",
    ),
    Equation(
        "K(8)",
        "free motion in the despun frame, equations",
        ("0 = J_xy dω_x/dt + J_z ω_y ω_z", "0 = J_xy dω_y/dt - J_z ω_x ω_z"),
        "J_xy J_z ω_x ω_y ω_z",
        f"{_PHYSICS}.stability.nutation_rates",
    ),
    Equation(
        "K(9)",
        "free motion in the despun frame, solution",
        ("ω_n = (Â cos(ω_N t + ψ), Â sin(ω_N t + ψ), 0)",),
        "ω_n Â ω_N t ψ",
        f"{_PHYSICS}.stability.nutation_rates",
    ),
    Equation(
        "K(10)",
        "rate of the nutation in the despun frame",
        ("ω_N = J_z/J_xy ω_z",),
        "ω_N J_xy J_z ω_z",
        f"{_PHYSICS}.stability.nutation_rates",
        "Nothing but the letters: Cω3/A. The rate in the body is this one less ω3.",
    ),
    Equation(
        "K(11)",
        "angular momentum as a sum",
        ("L = J_xy ω_n + (J_z - J_xy) ω_z",),
        "L J_xy J_z ω_n ω_z",
        f"{_PHYSICS}.cones.inertial_rate",
        "ω_n and ω_z are vectors here.",
    ),
    Equation(
        "K(12)",
        "nutation in inertial components",
        ("ω_n = (Â cos(ω_N t + ψ), Â sin(ω_N t + ψ), 0)",),
        "ω_n Â ω_N t ψ",
        f"{_PHYSICS}.attitude.arc",
        "A form for small angles. The arcs of nutdamp are exact: the body turns about H by |H|t/A and about axis 3 by "
        "aω3t.",
    ),
    Equation(
        "K(13)",
        "rate of the nutation seen inertially",
        ("ω_N = L/J_xy",),
        "ω_N L J_xy",
        f"{_PHYSICS}.cones.inertial_rate",
        "The rate is |H|/A; the vector L/J_xy is printed.",
        ("|H|/A = √(|ω|² + (C/A)² ω3²)",),
    ),
    Equation(
        "K(14)",
        "precession under a torque fixed in the body",
        (
            "ω_Px =  M_y/((J_xy - J_z) ω_z)",
            "ω_Py = -M_x/((J_xy - J_z) ω_z)",
            "M = ω_P × ω_z (J_xy - J_z)",
        ),
        "ω_P M_x M_y J_xy J_z ω_z",
        f"{_PHYSICS}.forced.steady_response",
        "Holds for M_z = 0. The sign of the last line is misprinted: it must read (J_z - J_xy).",
        ("M = ω_P × ω_z (J_z - J_xy)",),
    ),
    Equation(
        "K(15)",
        "precession under a torque fixed in the despun frame",
        (
            "ω_Px = -M_y/(J_z ω_z)",
            "ω_Py =  M_x/(J_z ω_z)",
            "M = ω_P × ω_z J_z",
        ),
        "ω_P M_x M_y J_z ω_z",
        f"{_PHYSICS}.forced.steady_response",
        "Holds for M_z = 0; its third component is 0, where ∫M_z/J_z dt is printed. In the body such a torque turns at "
        "-ω3: the forced term of M(27).",
    ),
    Equation(
        "24.4",
        "stability of spin about a principal axis",
        ("p² = -(I1 - I2)(I1 - I3) ω1²/(I2 I3)   (spin about axis 1)", "bounded where p² <= 0"),
        "p² I1 I2 I3 ω1",
        f"{_PHYSICS}.stability.growth",
        "With p = 0 a nutation grows linearly: only p² < 0 is stable. For spin about axis 3:",
        ("p² = -(I3 - I1)(I3 - I2) ω3²/(I1 I2)",),
    ),
)

OWN = (
    Equation(
        "energy sink",
        "coast with energy dissipation",
        ("tan θ = tan θ0 e^(κt),   H at rest in space",),
        "θ θ0 κ t H",
        f"{_PHYSICS}.energy_sink.arc",
        "In none of the sources: see `nutdamp explain dissipation`.",
    ),
)
"""Equations that nutdamp adds."""

SOURCES = (
    'M(n): K. Magnus, "Untersuchungen über zeitabhängig selbsterregte, symmetrische Kreisel", 1970',
    'K(n): lecture text "Kreisel-Bewegungen"',
    '24.4: lecture text "Kreiseltheorie", section 24.4',
)
