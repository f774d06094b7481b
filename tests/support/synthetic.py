"""Synthetic telemetry by DOP853 with noise, gaps, outliers, steps and biases."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from support import reference

import nutdamp
from nutdamp.estimation.parameters import GYROS, Record

Array = NDArray[np.float64]

SIGMA = 0.005
"""Standard deviation of A and C in the files, as a share."""

GYRO_BIAS = math.radians(0.02)
"""Standard deviation of the biases, as fits take it where a file says nothing."""


@dataclass(frozen=True, eq=False)
class Case:
    """A file, the record of a body that differs from it,
    and the true values of what is estimated.
    """

    spacecraft: nutdamp.Spacecraft
    record: Record
    truth: dict[str, float]
    noise: float


def motion(
    moments: tuple[float, float, float], rates: Array, times: Array, growth: float = 0.0
) -> Array:
    """Body rates (n, 3) at ``times`` (n,) s from 0, rad/s."""
    start = reference.Motion(rates, np.eye(3))
    still = np.zeros(3)
    later = times[times > 0.0]
    found = (
        reference.sinking(moments, start, still, later, growth)
        if growth
        else reference.coast(moments, start, still, later)
    )
    return np.array([rates] * (len(times) - len(later)) + [one.rates for one in found])


def gyro_case(seed: int) -> Case:
    """A minute or so of gyro data of a body of either shape and sense, by ``seed``."""
    draw = np.random.default_rng([16, seed])
    prolate = seed % 2 == 0
    A = 120.0
    C = A * (draw.uniform(0.45, 0.85) if prolate else draw.uniform(1.15, 1.8))
    spin = (-1.0 if seed % 4 > 1 else 1.0) * draw.uniform(0.8, 4.0)
    nutation = math.radians(draw.uniform(0.5, 15.0))
    phase = draw.uniform(-math.pi, math.pi)
    nominal = nutdamp.load(
        {
            "name": "synthetic",
            "inertia": {"A": A, "C": C},
            "state": {
                "spin": spin,
                "nutation": f"{math.degrees(nutation)} deg",
                "phase": f"{math.degrees(phase)} deg",
            },
            "dispersions": {"A": {"normal": "0.5 %"}, "C": {"normal": "0.5 %"}},
        }
    )
    truth = {"A": A * (1.0 + SIGMA * draw.normal()), "C": C * (1.0 + SIGMA * draw.normal())}
    rates = nominal.omega0 + math.radians(0.5) * draw.normal(size=3)
    truth |= {f"omega_{number}": float(rates[number - 1]) for number in (1, 2, 3)}
    growing = draw.uniform() < 0.5
    truth["growth"] = draw.uniform(0.0005, 0.003) * (1.0 if prolate else -1.0) if growing else 0.0
    period = 2.0 * math.pi / abs(1.0 - truth["C"] / truth["A"]) / abs(spin)
    length = draw.uniform(3.0, 12.0) * period
    count = int(draw.integers(150, 500))
    times = (
        np.sort(draw.uniform(0.0, length, count))
        if draw.uniform() < 0.3
        else np.linspace(0.0, length, count)
    )
    times -= times[0]
    rates_ = motion((truth["A"], truth["A"], truth["C"]), rates, times, truth["growth"])
    tilt = math.radians(1.0) * draw.normal(size=2)
    bias = GYRO_BIAS * draw.normal(size=3)
    truth |= {"misalignment_1": float(tilt[0]), "misalignment_2": float(tilt[1])}
    truth |= {f"bias_{name}": float(one) for name, one in zip(GYROS, bias, strict=True)}
    turned = Rotation.from_rotvec([-tilt[0], -tilt[1], 0.0]).apply(rates_)
    noise = math.radians(10.0 ** draw.uniform(-2.5, -1.3))
    shown = turned + bias + noise * draw.normal(size=turned.shape)
    outliers = draw.uniform(size=shown.shape) < draw.choice([0.0, 0.01, 0.03])
    shown = np.where(
        outliers,
        shown + noise * draw.choice([-1.0, 1.0], shown.shape) * draw.uniform(15, 500, shown.shape),
        shown,
    )
    if draw.uniform() < 0.5:  # steps up to twice the noise
        step = draw.uniform(0.5, 2.0) * noise
        shown = np.rint(shown / step) * step
    gaps = draw.uniform(size=shown.shape) < draw.choice([0.0, 0.1, 0.3])
    if draw.uniform() < 0.3:
        begin = draw.uniform(0.2, 0.6) * length
        gaps |= ((times > begin) & (times < begin + 0.2 * length))[:, None]
    shown = np.where(gaps, np.nan, shown)
    record = Record(times, {name: shown[:, at] for at, name in enumerate(GYROS)})
    return Case(nominal, record, truth, noise)
