"""What is said of a numbered equation of the sources, and the symbols that equations share."""

from __future__ import annotations

from typing import NamedTuple

from nutdamp.guide.topic import Block, Formula, Part, Rows, Topic


class Equation(NamedTuple):
    """One or more numbered equations as printed, and what nutdamp makes of them.

    ``symbols`` names keys of `SYMBOLS`, with blanks between; ``changed`` says what differs from the print, with the
    formula used instead in ``used``; ``place`` is the dotted name of the code that holds it.
    """

    number: str
    subject: str
    formula: tuple[str, ...]
    symbols: str
    place: str
    changed: str = ""
    used: tuple[str, ...] = ()

    @property
    def topic(self) -> Topic:
        """The equation as a topic of the guide."""
        parts = [Part("", (Formula(self.formula),))]
        parts.append(Part("Symbols", (Rows(tuple((name, SYMBOLS[name]) for name in self.symbols.split())),)))
        changed: tuple[Block, ...] = (self.changed or "Nothing: it is used as printed.",)
        parts.append(Part("What nutdamp changes", (*changed, Formula(self.used)) if self.used else changed))
        parts.append(Part("In the code", (self.place,)))
        return Topic(self.number, self.subject, tuple(parts))


SYMBOLS = {
    "A": "transverse moment of inertia, kg m²",
    "C": "moment of inertia about the spin axis 3, kg m²",
    "a": "(A - C)/A, a number: above 0 prolate, below 0 oblate, 0 a sphere",
    "ω1": "body rate about axis 1, rad/s",
    "ω2": "body rate about axis 2, rad/s",
    "ω3": "body rate about axis 3, the spin, signed, rad/s",
    "ω": "ω1 + i ω2, the transverse rate, rad/s",
    "ω0": "ω at t = 0, rad/s",
    "ω10": "ω1 at t = 0, rad/s",
    "ω20": "ω2 at t = 0, rad/s",
    "ω30": "ω3 at t = 0, rad/s",
    "ω'": "dω/dα, a number per rad",
    "M": "M1 + i M2, transverse torque fixed in the body, N m",
    "M1": "torque about axis 1, N m",
    "M2": "torque about axis 2, N m",
    "M3": "torque about axis 3, N m",
    "M_v": "impulse of pulse v, N m s (nutdamp: J_v)",
    "J_v": "impulse of pulse v, J1 + i J2, N m s",
    "m": "M/(A ω3), rad/s: the torque per rad of α",
    "m0": "m where it is constant, or its size where it turns, rad/s",
    "m_v": "M_v/(A ω3), rad",
    "m_p": "size and phase of turning torque p over A ω3, rad/s",
    "b_p": "rate of turn of torque p in the body over ω3, a number",
    "α": "∫ω3 dt, rad",
    "β": "α at which a part of the torque acts, rad",
    "Δω": "change of ω by one impulse, rad/s",
    "δ": "Dirac's function: an impulse at one moment, 1/s",
    "1(t)": "0 before the pulse, 1 after it",
    "t": "time, s",
    "t_v": "moment of pulse v, s",
    "τ": "time at which a part of the torque acts, s",
    "T_ω": "period of the nutation seen in the body, s",
    "Δt": "wait from the first pulse to the second, s",
    "μ": "body cone: angle between ω_i = (ω1, ω2, ω3) and the spin axis, rad",
    "λ": "space cone: angle between ω_i and H, rad",
    "θ": "nutation angle λ + μ between H and the spin axis, rad",
    "ϑ0": "tilt of axis 3 from the fixed axis of rotation, rad",
    "φ0": "Euler angle of proper rotation, rad",
    "J_xy": "transverse moment of inertia, kg m² (nutdamp: A)",
    "J_z": "moment of inertia about the spin axis, kg m² (nutdamp: C)",
    "ω_x": "body rate about the first transverse axis, rad/s (nutdamp: ω1)",
    "ω_y": "body rate about the second transverse axis, rad/s (nutdamp: ω2)",
    "ω_z": "spin, rad/s (nutdamp: ω3)",
    "ω_n": "rotation vector of the nutation, rad/s",
    "ω_N": "rate of the nutation, rad/s",
    "ω_P": "rotation vector of the precession, rad/s",
    "Â": "amplitude of the nutation, |ω|, rad/s (printed: A)",
    "ψ": "phase at t = 0, rad",
    "L": "angular momentum, N m s (nutdamp: H)",
    "M_x": "torque about the first transverse axis, N m",
    "M_y": "torque about the second transverse axis, N m",
    "M_z": "torque about the spin axis, N m",
    "p²": "square of the exponent of a small disturbance, 1/s²",
    "I1": "principal moment of inertia about axis 1, kg m²",
    "I2": "principal moment of inertia about axis 2, kg m²",
    "I3": "principal moment of inertia about axis 3, kg m²",
    "H": "angular momentum, N m s",
    "κ": "+1/time_constant for prolate, -1/time_constant for oblate bodies, 1/s",
    "θ0": "nutation angle at t = 0, rad",
}
"""Symbols of the sources with their units."""
