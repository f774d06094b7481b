"""Fits of bodies with a wheel: coasts and firings of DOP853, each estimate within what its sigma
says.
"""

import io
import math
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from support import reference
from support.builders import present
from support.cases import spread

import nutdamp
from nutdamp.errors import BadRequest
from nutdamp.estimation.fit import fit
from nutdamp.estimation.model import Model
from nutdamp.estimation.parameters import ACCELERATION, GYROS, Record
from nutdamp.estimation.results import carried
from nutdamp.files.carried import fitted_text
from nutdamp.views.fit import fit_screen

FILE: dict[str, Any] = {
    "name": "dual spin",
    "inertia": {"A": 300, "C": 200},
    "wheel": {"momentum": 60},
    "state": {"spin": "2 rpm", "nutation": "2 deg", "phase": "30 deg"},
    "dispersions": {"A": {"normal": "1 %"}, "C": {"normal": "1 %"}},
}
NOISE = math.radians(0.002)
MOTIONS = [("0 rpm", 60.0), ("2 rpm", 60.0), ("-2 rpm", 150.0), ("-3 rpm", 30.0), ("6 rpm", -20.0)]


def record(
    body: nutdamp.Spacecraft,
    moments: tuple[float, float, float],
    wheel: float,
    *,
    growth: float = 0.0,
    seed: int = 1,
) -> tuple[Record, np.ndarray]:
    """Gyros of a coast of 200 s at 4 Hz with noise, and the true rates at t = 0."""
    draw = np.random.default_rng([59, seed])
    rates = body.omega0 * 1.03
    times = np.asarray(np.arange(1, 800) * 0.25, dtype=float)
    start = reference.Motion(rates, reference.frame_n(moments, rates, wheel))
    motions = (
        reference.sinking(moments, start, np.zeros(3), times, growth, wheel)
        if growth
        else reference.coast(moments, start, np.zeros(3), times, wheel=wheel)
    )
    shown = np.array([rates, *(motion.rates for motion in motions)])
    values = shown + NOISE * draw.normal(size=shown.shape)
    return Record(np.append(0.0, times), dict(zip(GYROS, values.T, strict=True))), rates


@spread("motion", MOTIONS, quick=3)
def test_a_coast_tells_the_moment_that_the_wheel_does_not_know(motion: tuple[str, float]) -> None:
    """A 1 % off: ω turns at ω3 - H3/A. Rates come out too, and the file written from them flies the
    same.
    """
    spin, wheel = motion
    body = nutdamp.load(
        {**FILE, "state": {**FILE["state"], "spin": spin}, "wheel": {"momentum": wheel}}
    )
    true = (303.0, 303.0, 199.0)
    seen, rates = record(body, true, wheel)
    known = carried(fit(body, seen), 0.0)
    sigmas = np.maximum(known.sigmas, 1e-12)
    assert known.values[0] == pytest.approx(true[0], abs=4.0 * sigmas[0])
    assert known.values[2:5] == pytest.approx(rates, abs=4.0 * float(sigmas[2:5].max()))
    # A and C apart are hardly told; H3/A is, by the noise over |ω| and the length of the record.
    told = (known.values[1] * rates[2] + wheel) / known.values[0]
    assert told == pytest.approx((true[2] * rates[2] + wheel) / true[0], abs=1e-4)


def test_the_screen_counts_the_turns_of_the_nutation() -> None:
    """Of a body that does not spin, too: 60 N m s / 300 kg m² for 199.75 s."""
    body = nutdamp.load({**FILE, "state": {**FILE["state"], "spin": 0}})
    seen, _ = record(body, (300.0, 300.0, 200.0), 60.0)
    console = Console(file=io.StringIO(), width=120, record=True)
    console.print(fit_screen(fit(body, seen), 0.0))
    assert "nutation periods: 6.36" in console.export_text()


@pytest.mark.parametrize("rounding", [0.0, 1e-16, 1e-14])
def test_a_record_without_noise_of_a_body_that_does_not_spin(rounding: float) -> None:
    """Its third gyro shows 0 or rounding, which is no scale: ω turns at h/A, here 1 % slower."""
    body = nutdamp.load({**FILE, "state": {**FILE["state"], "spin": 0}})
    times = np.asarray(np.arange(800) * 0.25, dtype=float)
    omega = complex(body.omega0[0], body.omega0[1]) * np.exp(1j * 60.0 / 303.0 * times)
    third = rounding * np.random.default_rng(3).normal(size=len(times))
    seen = Record(times, dict(zip(GYROS, (omega.real, omega.imag, third), strict=True)))
    A, C, *rates = carried(fit(body, seen), 0.0).values[:5]
    assert rates[:2] == pytest.approx(body.omega0[:2], abs=1e-9)
    assert rates[2] - (C * rates[2] + 60.0) / A == pytest.approx(-60.0 / 303.0, abs=1e-9)


def test_a_momentum_with_a_tolerance_is_estimated_and_written() -> None:
    """Beside moments that are known well the coast tells the momentum."""
    text = """\
name: dual spin
inertia: {A: 300, C: 200}
wheel: {momentum: 60 N m s}
state: {spin: 2 rpm, nutation: 2 deg, phase: 30 deg}
dispersions: {A: {normal: 0.05 %}, C: {normal: 0.05 %}, wheel_momentum: {normal: 2 N m s}}
"""
    body = nutdamp.read(text)
    seen, _ = record(body, (300.0, 300.0, 200.0), 61.5)
    fitted = fit(body, seen)
    at = present(fitted.index("wheel"))
    assert fitted.values[at] == pytest.approx(61.5, abs=4.0 * fitted.sigmas[at])
    assert fitted.sigmas[at] < 0.1
    written = nutdamp.read(fitted_text(fitted, carried(fitted, 0.0)))
    assert written.inertia.wheel == pytest.approx(float(fitted.values[at]), rel=1e-9)
    assert written.dispersions is not None
    assert present(written.dispersions.wheel_momentum).size == pytest.approx(
        float(fitted.sigmas[at]), rel=1e-5
    )


@pytest.mark.deep
def test_three_moments_and_dissipation() -> None:
    """About the middle axis, which the wheel holds; then a symmetric body whose nutation grows."""
    three = nutdamp.load(
        {
            **FILE,
            "inertia": {"tensor": [[260, 0, 0], [0, 340, 0], [0, 0, 300]]},
            "wheel": {"momentum": 120},
            "dispersions": {"omega0": {"normal": "0.1 deg/s"}},
        }
    )
    seen, rates = record(three, (262.0, 338.0, 300.0), 120.0)
    known = carried(fit(three, seen), 0.0)
    assert known.values[2:5] == pytest.approx(rates, abs=4.0 * float(known.sigmas[2:5].max()))
    sinking = nutdamp.load({**FILE, "dissipation": {"time_constant": 500, "nutation": "grows"}})
    seen, _ = record(sinking, (300.0, 300.0, 200.0), 60.0, growth=1.0 / 400.0)
    fitted = fit(sinking, seen)
    at = present(fitted.index("growth"))
    assert fitted.values[at] == pytest.approx(1.0 / 400.0, abs=4.0 * fitted.sigmas[at])


def test_an_accelerometer_beside_a_wheel_is_refused() -> None:
    body = nutdamp.load(FILE)
    with pytest.raises(BadRequest):
        Model(body, Record(np.arange(10.0), {ACCELERATION: np.zeros(10)}))
