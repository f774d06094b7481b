"""Tolerances: dispersions of the true values about those of the plan, as a spacecraft file gives
them, in SI.

A dispersed truth is the nominal value plus a draw, or times one plus a draw where the tolerance is
relative.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from nutdamp.errors import BadRequest

KINDS = ("normal", "uniform", "triangular", "bias")
"""Distribution, by the meaning of the size: one sigma, half width, half width, a fixed offset."""


# kind of the signal of a sensor: angular rate of a gyro, acceleration of an accelerometer
READING = "reading"

Each = Literal["", "axis", "thruster"]
"""Tolerances that may differ by axis or by thruster; empty for a single one."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Tolerance of one quantity.

    ``kind`` is one of `KINDS`; ``size`` is SI (rad for angles), or a fraction of the nominal value
    where ``relative``. Only a bias may be negative; a size of zero disperses nothing.
    """

    kind: str
    size: float
    relative: bool = False


class SpinTolerance(NamedTuple):
    """Tolerance of the spin at the end about its goal: ``relative`` to it, else in rad/s."""

    size: float = 0.01
    relative: bool = True


Known = Tolerance | None
ByThruster = Mapping[str, Tolerance]


def tolerance(kind: str, text: str, size: str, by: str = "normal", each: Each = "") -> Any:
    """Field of `Dispersions` for a quantity of ``kind``; its example has ``size`` in ``by``."""
    default = (None, None, None) if each == "axis" else None
    return field(
        default=default, metadata={"kind": kind, "each": each, "text": text, "example": {by: size}}
    )


def by_thruster(kind: str, text: str, size: str) -> Any:
    """`tolerance` of each thruster, in the file of all or by name."""
    declared = tolerance(kind, f"{text}; or by name.", size, each="thruster").metadata
    return field(default_factory=dict, metadata=declared)


@dataclass(frozen=True, slots=True)
class Dispersions:
    """Tolerances of a spacecraft; None, or no entry, for exactly known values. The steerable
    torquer is a thruster.

    Each field declares the key of the file. ``A`` is of both transverse moments; the axes of
    ``omega0`` are those of the file. ``correlation``: pairs of inputs, by the names of
    `nutdamp.montecarlo.inputs`, that vary together.
    """

    A: Known = tolerance("inertia", "Of the transverse moment of inertia, kg m² or %.", "2 %")
    C: Known = tolerance(
        "inertia", "Of the moment of inertia about the spin axis, kg m² or %.", "1.6 kg m^2"
    )
    inertia_tensor: Known = tolerance(
        "inertia",
        "Of each entry of the inertia tensor by itself, in the axes of the file, kg m² or %. "
        "For products the percentage is of √(Ii Ij).",
        "1 %",
    )
    wheel_momentum: Known = tolerance(
        "momentum", "Of the angular momentum of the wheel, N m s or %.", "0.5 N m s"
    )
    omega0: tuple[Known, Known, Known] = tolerance(
        "rate",
        "Of each body rate at t = 0, rad/s or %; one tolerance or a list of three.",
        "0.1 deg/s",
        each="axis",
    )
    thrust: ByThruster = by_thruster(
        "force", "Of each thruster, the same in all its pulses, % or N", "3 %"
    )
    thrust_per_pulse: Known = tolerance(
        "ratio", "Of the thrust of each pulse, drawn anew, %.", "1 %"
    )
    thrust_direction: ByThruster = by_thruster(
        "angle", "Tilt of each force about two axes across it, rad", "0.5 deg"
    )
    position: ByThruster = by_thruster(
        "length", "Of each thruster's position, each component, m", "5 mm"
    )
    center_of_mass: Known = tolerance("length", "Of the center of mass, each component, m.", "2 mm")
    timing: Known = tolerance("time", "Shift of each pulse, drawn anew, s.", "5 ms", "uniform")
    timing_offset: Known = tolerance("time", "One shift of the whole schedule, s.", "2 ms", "bias")
    attitude: Known = tolerance(
        "angle",
        "Of the direction of the spin axis at t = 0, about two axes across it, rad.",
        "0.2 deg",
    )
    open_delay: ByThruster = by_thruster(
        "time", "Of each valve's open_delay, the same in all its pulses, s", "1 ms"
    )
    close_delay: ByThruster = by_thruster(
        "time", "Of each valve's close_delay, the same in all its pulses, s", "1 ms"
    )
    rise_time: ByThruster = by_thruster(
        "time", "Of each valve's rise_time, the same in all its pulses, s", "0.5 ms"
    )
    fall_time: ByThruster = by_thruster(
        "time", "Of each valve's fall_time, the same in all its pulses, s", "1 ms"
    )
    impulse_bit: ByThruster = by_thruster(
        "ratio", "Of the impulses of each impulse_bit, the same in all its pulses, %", "2 %"
    )
    cold: Known = tolerance(
        "ratio", "Of the factor of a first cold pulse, cold.first, in % of it.", "2 %"
    )
    sensor_bias: Known = tolerance(
        READING,
        "Of the bias of each gyro of a loop, rad/s, or of its accelerometer, m/s².",
        "0.01 deg/s",
    )
    sensor_scale: Known = tolerance(
        "ratio", "Of the scale of each gyro of a loop, or of its accelerometer, %.", "1 %"
    )
    sensor_noise: Known = tolerance(
        "ratio", "Of the noise of the sensor of a loop, %.", "20 %", "uniform"
    )
    sensor_delay: Known = tolerance(
        "time",
        "Of the delay of the sensor of a loop, s. Values below 0 are drawn again.",
        "2 ms",
        "uniform",
    )
    cold_pulses: Known = tolerance(
        "ratio", "Of the number of pulses over which nozzles warm up, in %.", "10 %"
    )
    tank_propellant: Known = tolerance(
        "mass", "Of the propellant in the tank at t = 0, kg or %.", "1 %"
    )
    tank_pressure: Known = tolerance(
        "pressure",
        "Of the pressure at t = 0, at which the thrust of the file holds, Pa or %.",
        "0.2 bar",
    )
    tank_final_pressure: Known = tolerance(
        "pressure", "Of the pressure of the empty tank, Pa or %.", "0.2 bar"
    )
    tank_exponent: Known = tolerance(
        "ratio", "Of the exponent of pressure in the thrust, in %.", "5 %"
    )
    inertia_per_kg: Known = tolerance(
        "ratio",
        "Of the decrease of the moments of inertia for each kg used, of all alike, in %.",
        "10 %",
    )
    correlation: tuple[tuple[str, str, float], ...] = ()


DISPERSIONS = """\
the spacecraft file has no dispersions: it does not say how far its values may be off. For example:

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
