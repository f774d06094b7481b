"""Tolerances: dispersions of the true values about those of the plan, as a spacecraft file gives them, in SI.

A dispersed truth is the nominal value plus a draw, or times one plus a draw where the tolerance is relative.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from nutdamp.errors import BadRequest

KINDS = ("normal", "uniform", "triangular", "bias")
"""Distribution, by the meaning of the size: one sigma, half width, half width, a fixed offset."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Tolerance of one quantity.

    ``kind`` is one of `KINDS`; ``size`` is SI (rad for angles), or a fraction of the nominal value where ``relative``.
    Only a bias may be negative; a size of zero disperses nothing.
    """

    kind: str
    size: float
    relative: bool = False


@dataclass(frozen=True, slots=True)
class Dispersions:
    """Tolerances of a spacecraft; None, or no entry, for exactly known values.

    ``A`` (both transverse moments) and ``C`` in kg m², ``wheel_momentum`` N m s; ``omega0`` the rates at t = 0 about
    the axes of the file, rad/s. ``thrust`` holds relative tolerances by thruster, the same factor in all its pulses;
    ``thrust_per_pulse`` is a relative one that each pulse draws anew. ``thrust_direction`` (rad, tilts about two axes
    across the force) and ``position`` (m, each component) are by thruster too. The steerable torquer counts as the
    thruster `schedule.STEERABLE`; ``center_of_mass`` is of each component, m. ``timing`` s shifts each pulse,
    ``timing_offset`` s the whole schedule; ``attitude`` rad tilts the spin axis at t = 0 about two axes across it.
    ``open_delay``, ``close_delay``, ``rise_time`` and ``fall_time`` s and ``impulse_bit``, a relative one, are by
    thruster and alike in all its pulses; ``cold`` is how far the factor of a first cold pulse is off,
    ``cold_pulses`` how far their number; ``tank_…`` are those of the tank (kg, Pa, a bare number),
    ``inertia_per_kg`` a relative one of all its moments alike. ``sensor_bias`` (rad/s or m/s²) and the relative
    ``sensor_scale`` are of each gyro, or of the accelerometer, of a loop, the relative ``sensor_noise`` and
    ``sensor_delay`` s of all its samples. ``correlation``: pairs of inputs, by the names of
    `nutdamp.montecarlo.inputs`, that vary together, see `nutdamp.montecarlo.inputs`.
    """

    A: Tolerance | None = None
    C: Tolerance | None = None
    wheel_momentum: Tolerance | None = None
    omega0: tuple[Tolerance | None, Tolerance | None, Tolerance | None] = (None, None, None)
    thrust: Mapping[str, Tolerance] = field(default_factory=dict)
    thrust_per_pulse: Tolerance | None = None
    thrust_direction: Mapping[str, Tolerance] = field(default_factory=dict)
    position: Mapping[str, Tolerance] = field(default_factory=dict)
    center_of_mass: Tolerance | None = None
    timing: Tolerance | None = None
    timing_offset: Tolerance | None = None
    attitude: Tolerance | None = None
    open_delay: Mapping[str, Tolerance] = field(default_factory=dict)
    close_delay: Mapping[str, Tolerance] = field(default_factory=dict)
    rise_time: Mapping[str, Tolerance] = field(default_factory=dict)
    fall_time: Mapping[str, Tolerance] = field(default_factory=dict)
    impulse_bit: Mapping[str, Tolerance] = field(default_factory=dict)
    cold: Tolerance | None = None
    sensor_bias: Tolerance | None = None
    sensor_scale: Tolerance | None = None
    sensor_noise: Tolerance | None = None
    sensor_delay: Tolerance | None = None
    cold_pulses: Tolerance | None = None
    tank_propellant: Tolerance | None = None
    tank_pressure: Tolerance | None = None
    tank_final_pressure: Tolerance | None = None
    tank_exponent: Tolerance | None = None
    inertia_per_kg: Tolerance | None = None
    correlation: tuple[tuple[str, str, float], ...] = ()


DISPERSIONS = """the spacecraft file has no dispersions: it does not say how far its values may be off. For example:

dispersions:
  A: {normal: 2 %}
  C: {normal: 2 %}
  omega0: {normal: 0.1 deg/s}
  thrust: {normal: 3 %}
  timing: {uniform: 5 ms}"""
"""Message for a file that should have dispersions."""


def expect_dispersions(dispersions: Dispersions | None) -> None:
    """Raise BadRequest, with an example to write, for a spacecraft without."""
    if dispersions is None:
        raise BadRequest(DISPERSIONS)
