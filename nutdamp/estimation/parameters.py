"""Parameters that are fitted to a record, each with its value in the file and the tolerance there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.estimation.signals import (
    ACCELERATION,
    APART,
    DIRECTION,
    GYROS,
    KIND,
    KINDS,
    SUN_ASPECT,
    Record,
    quantisation,
)
from nutdamp.montecarlo.inputs import SPREAD
from nutdamp.spacecraft.equipment import GYRO
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.tolerances import Tolerance

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

RATIO = "C/A"
"""Name of the parameter that a coast fixes."""

BIAS = math.radians(0.02)
"""Standard deviation of the bias of a gyro, rad/s, where the file names none (dispersions.sensor_bias)."""

TILT = math.radians(1.0)
"""Standard deviation of each tilt of the gyros, and of the attitude sensors, from the principal axes, rad."""

THRUST = 0.5
"""Standard deviation of a thrust factor in a fit at least: a valve that stays shut must not pass for noise."""

DELAY = 0.05
"""Standard deviation of what a channel's thrust is late, s."""

TINY = 1e-7
"""Step of derivatives, rad, or as a share of a value."""


class Parameter(NamedTuple):
    """One number to be estimated: its ``name`` and ``unit``, SI.

    ``file``: what the file says, to within ``prior`` (one sigma; infinite where it says nothing that counts);
    ``step``: by which it is changed for derivatives.
    """

    name: str
    unit: str
    file: float
    prior: float
    step: float


def parameters(spacecraft: Spacecraft, record: Record, *, unequal: bool, growing: bool) -> tuple[Parameter, ...]:
    """The parameters of a record, the motion first; ``unequal``: with I1 ≠ I2, ``growing``: with dissipation.

    Rates are those at the start of the record.
    """
    return tuple(_all(spacecraft, record, unequal, growing))


def moments(spacecraft: Spacecraft) -> Iterator[Parameter]:
    """A and the ratio C/A, as far as the file lets them differ from its values; the ratio in any case.

    Its prior is that of A and C together; with A they are correlated, see `prior`. What has no tolerance is fixed: A
    where neither has one. The ratio and not C, because what telemetry fixes best is then linear in the parameters.
    """
    of_A, of_C = _of_moments(spacecraft)
    ratio = of_C[0] / of_A[0]
    if of_A[1] > 0.0 and of_C[1] > 0.0:
        yield Parameter("A", "kg m²", of_A[0], of_A[1], TINY * of_A[0])
    both = 2.0 * _together(spacecraft) * of_A[1] / of_A[0] * of_C[1] / of_C[0]
    sigma = ratio * math.sqrt((of_A[1] / of_A[0]) ** 2 + (of_C[1] / of_C[0]) ** 2 - both)
    yield Parameter(RATIO, "", ratio, sigma or math.inf, TINY * ratio)


def in_moments(spacecraft: Spacecraft, values: Mapping[str, float]) -> tuple[float, float]:
    """A and C (kg m²) of the ``values`` of parameters."""
    of_A, of_C = _of_moments(spacecraft)
    ratio = values[RATIO]
    # Of a body with a wheel it is A that C/A changes where neither has a tolerance: despun, C does not matter.
    if of_C[1] == 0.0 and (of_A[1] > 0.0 or spacecraft.inertia.wheel != 0.0):
        return of_C[0] / ratio, of_C[0]
    A = values.get("A", of_A[0])
    return A, ratio * A


def prior(spacecraft: Spacecraft, chosen: Sequence[Parameter]) -> tuple[Matrix, Vector]:
    """Rows (k, p) of what the file says of the parameters, over its sigmas, and their values (k,)."""
    rows, values = [], []
    names = [parameter.name for parameter in chosen]
    for index, parameter in enumerate(chosen):
        row = np.zeros(len(chosen))
        row[index] = 1.0 / parameter.prior
        value = parameter.file / parameter.prior if math.isfinite(parameter.prior) else 0.0
        if parameter.name == RATIO and "A" in names:
            # What of C = A·(C/A), to first order, A does not tell.
            (A, of_A), (C, of_C) = _of_moments(spacecraft)
            both = _together(spacecraft)
            left = of_C * math.sqrt(1.0 - both * both)
            row[index], row[names.index("A")] = A / left, (parameter.file - both * of_C / of_A) / left
            value = (2.0 * C - both * of_C / of_A * A) / left
        if row.any():
            rows.append(row)
            values.append(value)
    return np.array(rows).reshape(-1, len(chosen)), np.array(values)


def _together(spacecraft: Spacecraft) -> float:
    """Correlation of A and C by the file."""
    pairs = () if spacecraft.dispersions is None else spacecraft.dispersions.correlation
    return next((value for first, second, value in pairs if {first, second} == {"A", "C"}), 0.0)


def _of_moments(spacecraft: Spacecraft) -> tuple[tuple[float, float], tuple[float, float]]:
    """Means and standard deviations of A and C by the file, kg m²."""
    given, inertia = spacecraft.dispersions, spacecraft.inertia
    pairs = ((inertia.A, None if given is None else given.A), (inertia.C, None if given is None else given.C))
    of_A, of_C = ((value, 0.0) if tolerance is None else prior_of(tolerance, value) for value, tolerance in pairs)
    return of_A, of_C


def _all(spacecraft: Spacecraft, record: Record, unequal: bool, growing: bool) -> Iterator[Parameter]:
    given, spin, step = spacecraft.dispersions, float(spacecraft.omega0[2]), TINY * spacecraft.fastest
    yield from moments(spacecraft)
    if given is not None and given.wheel_momentum is not None and spacecraft.inertia.wheel != 0.0:
        wheel, sigma = prior_of(given.wheel_momentum, spacecraft.inertia.wheel)
        yield Parameter("wheel", "N m s", wheel, sigma, TINY * abs(wheel))
    for number in (1, 2):
        yield Parameter(f"omega_{number}", "rad/s", float(spacecraft.omega0[number - 1]), math.inf, step)
    if record.shows_spin:
        yield Parameter("omega_3", "rad/s", spin, math.inf, step)
    elif given is not None and given.omega0[2] is not None:
        mean, sigma = prior_of(given.omega0[2], spin)
        yield Parameter("omega_3", "rad/s", mean, sigma, step)
    if growing and (spacecraft.inertia.a != 0.0 or spacecraft.inertia.wheel != 0.0):
        yield Parameter("growth", "1/s", spacecraft.growth, math.inf, 1e-5 / max(record.length, 1e-3))
    if any(kind.attitude for kind in record.kinds):
        yield from _attitude(spacecraft, record)
    yield from _gyros(spacecraft, record)
    if any(kind.wobble for kind in record.kinds):
        for number in (1, 2):
            yield Parameter(f"wobble_{number}", "rad", 0.0, TILT, TINY)
    if record.has(ACCELERATION):
        size = 1e-6 * spin * spin
        yield Parameter("bias_acceleration", KIND[ACCELERATION].unit, 0.0, math.inf, size)
    if unequal:
        first, second, _ = spacecraft.inertia.moments
        yield Parameter("unequal_1", "", (first - second) / (first + second), math.inf, 1e-6)
        yield Parameter("unequal_2", "", 0.0, math.inf, 1e-6)
    yield from _channels(spacecraft, record)


def _attitude(spacecraft: Spacecraft, record: Record) -> Iterator[Parameter]:
    """Turns of the attitude at the start about body axes; the last shows only beside what turns with the body."""
    seen, given = _tells_attitude(spacecraft, record), spacecraft.dispersions
    sigma = math.inf
    if not seen:
        sigma = 0.0 if given is None or given.attitude is None else prior_of(given.attitude, 0.0)[1]
        # The file has the attitude at t = 0: where on its cone the axis is as the record begins is less sure.
        turn = min(2.0 * math.pi / spacecraft.inertial_period * abs(record.start), math.pi)
        sigma = math.hypot(sigma, 2.0 * math.sin(0.5 * turn) * spacecraft.nutation) if sigma > 0.0 else 0.0
    for number in (1, 2) if sigma > 0.0 else ():
        yield Parameter(f"attitude_{number}", "rad", 0.0, sigma, TINY)
    if record.shows_turn:
        yield Parameter("attitude_3", "rad", 0.0, math.inf, TINY)


def _tells_attitude(spacecraft: Spacecraft, record: Record) -> bool:
    """True for a record of the axis, or of two directions: of one the attitude may be turned about it."""
    if record.has("axis_x"):
        return True
    directions = [record.samples(DIRECTION)[1]]
    if record.has(SUN_ASPECT) and spacecraft.sun is not None:
        directions.append(spacecraft.sun[None, :])
    every = np.concatenate(directions)
    return len(every) > 0 and bool(np.linalg.norm(np.cross(every, every[0]), axis=1).max() > APART)


def _gyros(spacecraft: Spacecraft, record: Record) -> Iterator[Parameter]:
    """Biases; misalignment only beside gyro 3, for else it looks like a bias of gyros 1 and 2."""
    loop, given = spacecraft.loop, spacecraft.dispersions
    mean = loop.sensor.bias if loop is not None and loop.sensor.kind == GYRO else 0.0
    sigma = BIAS
    if loop is not None and given is not None and given.sensor_bias is not None and loop.sensor.kind == GYRO:
        mean, sigma = prior_of(given.sensor_bias, mean)
    aligned = record.has(GYROS[2])
    for name in GYROS:
        if record.has(name):
            step = quantisation(record.signals[name])
            free = math.hypot(sigma, step / math.sqrt(12.0)) if aligned else math.inf
            yield Parameter(f"bias_{name}", "rad/s", mean, free, TINY)
    if aligned and (record.has(GYROS[0]) or record.has(GYROS[1])):
        for number in (1, 2):
            yield Parameter(f"misalignment_{number}", "rad", 0.0, TILT, TINY)


def _channels(spacecraft: Spacecraft, record: Record) -> Iterator[Parameter]:
    """Thrust factor and delay of each channel that fired."""
    for name in dict.fromkeys(pulse.channel for pulse in record.fired):
        mean, sigma = thrust_prior(spacecraft, name)
        yield Parameter(f"thrust {name}", "", mean, max(sigma, THRUST), TINY)
        yield Parameter(f"delay {name}", "s", 0.0, DELAY, 1e-6)


def thrust_prior(spacecraft: Spacecraft, name: str) -> tuple[float, float]:
    """Thrust factor of a channel by the file, and its standard deviation; that is infinite without a tolerance."""
    given = spacecraft.dispersions
    channel = next((channel for channel in spacecraft.channels if channel.name == name), None)
    if given is None or channel is None:
        return 1.0, math.inf
    sizes = [given.thrust.get(thruster.name) for thruster in channel.thrusters]
    priors = [prior_of(size, 1.0) for size in sizes if size is not None]
    mean = 1.0 + math.fsum(factor - 1.0 for factor, _ in priors) / len(sizes)
    return mean, math.hypot(*(sigma for _, sigma in priors)) / len(sizes) or math.inf


def prior_of(tolerance: Tolerance, nominal: float) -> tuple[float, float]:
    """Mean and standard deviation of a value of the file, in its unit."""
    size = tolerance.size * (abs(nominal) if tolerance.relative else 1.0)
    if tolerance.kind == "bias":
        return nominal + math.copysign(size, tolerance.size), 0.0
    return nominal, abs(size) * SPREAD[tolerance.kind]


def untold(record: Record) -> Iterator[str]:
    """Words on what signals of the kinds in a record cannot tell, whatever the file."""
    if not record.fired:
        yield "a coast fixes C/A only, never A and C apart: what it does not fix stays at the tolerances of the file"
    if not record.has(GYROS[2]) and (record.has(GYROS[0]) or record.has(GYROS[1])):
        yield "without omega_3 a misalignment of the gyros times the spin counts as their bias"
    if not record.shows_spin:
        shown = ", ".join(kind.name for kind in KINDS if kind.spin)
        yield f"no signal shows the spin ({shown}): it is that of the file"
