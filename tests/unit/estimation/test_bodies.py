"""Fits of bodies of three moments, with a wheel, and with large nutations."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import reference
from support.builders import noted, present
from support.cases import spread
from support.commands import printed
from support.golden import check_text
from support.places import case
from support.telemetry import Array, motion

import nutdamp
from nutdamp.common import work
from nutdamp.errors import BadRequest
from nutdamp.estimation.fit import fit
from nutdamp.estimation.model import Fit, Model
from nutdamp.estimation.parameters import ACCELERATION, AXIS, GYROS, Record
from nutdamp.estimation.results import carried, doubts, estimates
from nutdamp.files.carried import fitted_text
from nutdamp.files.telemetry import read_telemetry
from nutdamp.physics import attitude
from nutdamp.spacecraft.schedule import Schedule, channel_pulse
from nutdamp.views.fit import fit_screen

# --- bodies of three different moments: pulses in their records, by DOP853 and by a file of ACE

TENSOR = [[110.0, 2.0, 0.0], [2.0, 126.0, 0.0], [0.0, 0.0, 170.0]]
"""kg m²; its axis 1 is that of the least moment, which principal axes sorted by size are not."""

THREE: dict[str, object] = {
    "name": "three",
    "inertia": {"tensor": [[118.0, 0, 0], [0, 118.0, 0], [0, 0, 170.0]]},
    "omega0": [0.02, 0.01, 0.9],
    "thrusters": [{"name": "T1", "torque": [3, 1, 0]}, {"name": "T2", "torque": [0, 3, 0.5]}],
    "dispersions": {"A": {"normal": "2 %"}, "C": {"normal": "2 %"}, "thrust": {"normal": "3 %"}},
}

LATE = (0.02, -0.01)
"""By how much two channels are late, s."""


def pulses(body: nutdamp.Spacecraft, *fired: tuple[float, float]) -> Schedule:
    """One pulse of each channel in turn, by their start and on-time, s."""
    pairs = zip(body.channels, fired, strict=False)
    return Schedule(tuple(channel_pulse(one, start, on_time) for one, (start, on_time) in pairs))


def flown(
    tensor: Array, rates: Array, fired: Schedule, body: nutdamp.Spacecraft, times: Array
) -> Array:
    """Rates (n, 3) in the axes of the file, by DOP853 in the principal axes that an eigensolver
    gives.
    """
    moments, axes = np.linalg.eigh(tensor)
    axes = axes * np.array([1.0, 1.0, np.linalg.det(axes)])
    events = [
        reference.Push(one.start, one.end, axes.T @ (body.inertia.axes @ one.torque))
        for one in fired
        if one.torque is not None
    ]
    start = reference.Motion(axes.T @ rates, np.eye(3))
    motions = reference.path(moments.tolist(), start, events, times)
    return np.array([axes @ one.rates for one in motions])


def test_a_pulse_pushes_where_its_thruster_is_mounted_whatever_the_principal_axes() -> None:
    """The model against DOP853, with I1 < I2 and I12 ≠ 0: the principal axes are turned by almost
    90 deg.
    """
    body = nutdamp.load(THREE)
    times = np.linspace(0.0, 30.0, 40)
    fired = pulses(body, (8.0, 0.7), (17.0, 0.4))
    rates = np.array([0.02, 0.01, 0.9])
    record = Record(times, dict.fromkeys(GYROS, np.zeros(40)), schedule=fired)
    model = Model(body, record, unequal=True, growing=False)
    truth = {"A": 118.0, "C/A": 170.0 / 118.0, "unequal_1": -8.0 / 118.0, "unequal_2": 2.0 / 118.0}
    shown = model.predicted(truth | {f"omega_{at + 1}": float(one) for at, one in enumerate(rates)})
    expected = flown(np.array(TENSOR), rates, fired, body, times)
    assert np.abs(shown.reshape(3, -1).T - expected).max() < 1e-10


def calibrated(fitted: Fit, channel: str) -> tuple[float, float, float, float]:
    """Thrust factor and delay (s) of a channel, and their sigmas."""
    thrust, delay = (
        present(fitted.index(f"thrust {channel}")),
        present(fitted.index(f"delay {channel}")),
    )
    values, sigmas = fitted.values, fitted.sigmas
    return float(values[thrust]), float(values[delay]), float(sigmas[thrust]), float(sigmas[delay])


def of_ace(path: Path) -> Fit:
    body = nutdamp.load(path)
    fired = nutdamp.load_schedule(case("calp1.csv"), body).pulses
    return fit(body, read_telemetry(case("calibration.csv"), body, None, fired)[0])


@pytest.mark.deep
def test_a_thruster_of_a_body_of_three_moments_is_calibrated() -> None:
    thrust, late, of_thrust, of_delay = calibrated(of_ace(case("calibration.yaml")), "P1")
    assert abs(thrust - 1.0) < of_thrust < 0.02
    assert abs(late) < of_delay < 0.003


@pytest.mark.deep
def test_a_file_with_equal_moments_for_such_a_body_is_named(tmp_path: Path) -> None:
    path = tmp_path / "equal.yaml"
    text = case("calibration.yaml").read_text(encoding="utf-8")
    (given,) = (line for line in text.splitlines() if line.startswith("inertia"))
    path.write_text(text.replace(given, "inertia: {A: 308, C: 440}"), encoding="utf-8")
    fitted = of_ace(path)
    thrust, _, of_thrust, _ = calibrated(fitted, "P1")
    assert abs(thrust - 1.0) < of_thrust < 0.02
    check_text("estimation.equal-in-the-file", noted(doubts(fitted)))


@spread("seed", range(12), quick=0, deep=1)
def test_thrust_of_random_bodies_of_three_moments(seed: int) -> None:
    """Factors and delays within 4 sigma of the truth, from noisy gyros and a file with equal
    moments or not.
    """
    draw = np.random.default_rng([31, seed])
    size, turn = draw.uniform(0.01, 0.08), draw.uniform(-math.pi, math.pi)
    e1, e2 = size * math.cos(turn), size * math.sin(turn)
    A, C = (
        118.0 * (1.0 + 0.01 * draw.normal()),
        118.0 * (draw.choice([0.65, 1.4]) + 0.005 * draw.normal()),
    )
    body = nutdamp.load(
        THREE
        | {
            "inertia": {"A": 118.0, "C": 118.0 * round(C / 118.0, 2)},
            "omega0": [0.02, 0.01, draw.choice([-0.9, 0.9])],
        }
    )
    times = np.linspace(0.0, 80.0, 300)
    fired = pulses(body, (30.0, 0.7), (52.0, 0.5))
    rates = body.omega0 + math.radians(0.05) * draw.normal(size=3)
    factors = 1.0 + 0.03 * draw.normal(size=2)
    tensor = A * np.array([[1.0 + e1, e2, 0], [e2, 1.0 - e1, 0], [0, 0, C / A]])
    true = Schedule(
        tuple(
            replace(pulse.moved(late), torque=factor * pulse.torque)
            for pulse, factor, late in zip(fired, factors, LATE, strict=True)
            if pulse.torque is not None
        )
    )
    shown = flown(tensor, rates, true, body, times) + math.radians(0.01) * draw.normal(
        size=(300, 3)
    )
    fitted = fit(
        body, Record(times, {name: shown[:, at] for at, name in enumerate(GYROS)}, schedule=fired)
    )
    assert fitted.model.unequal
    for channel, factor, late in zip(("T1", "T2"), factors, LATE, strict=True):
        thrust, delay, of_thrust, of_delay = calibrated(fitted, channel)
        assert abs(thrust - factor) < 4.0 * of_thrust
        assert abs(delay - late) < 4.0 * of_delay


@pytest.mark.deep
def test_dissipation_that_does_not_show_is_not_taken_as_known() -> None:
    """Four sigma of growth would put the rates at the start off by as much, if they were estimated
    without it.
    """
    body = nutdamp.load(THREE | {"omega0": [0.1, 0.05, 0.9]})
    times = np.linspace(0.0, 80.0, 200)
    growth = -1e-4
    truth = {
        "omega_1": 0.1,
        "omega_2": 0.05,
        "unequal_1": 3.0 / 118.0,
        "unequal_2": 0.0,
        "growth": growth,
    }
    clean = motion((121.0, 115.0, 170.0), body.omega0, times, growth)
    squares = dict.fromkeys(truth, 0.0)
    for seed in range(6):
        shown = clean + math.radians(0.05) * np.random.default_rng([7, seed]).normal(
            size=clean.shape
        )
        fitted = fit(body, Record(times, {name: shown[:, at] for at, name in enumerate(GYROS)}))
        for name, value in truth.items():
            squares[name] += (
                (fitted.named[name] - value) / fitted.sigmas[fitted.index(name) or 0]
            ) ** 2
    # Of six, each sum of squares is below 22.5 in 999 of 1000 cases.
    assert not {name: total for name, total in squares.items() if total > 22.5}


@pytest.mark.weekly
def test_three_moments_and_growth_together_are_found_within_the_budget() -> None:
    """Each trial is integrated; begun with unequal moments as found without growth, all else as
    without them.
    """
    body = nutdamp.load(THREE | {"omega0": [0.1, 0.05, 0.9]})
    times = np.linspace(0.0, 200.0, 400)
    shown = motion((121.0, 115.0, 170.0), body.omega0, times, -0.004)
    shown += math.radians(0.01) * np.random.default_rng(2).normal(size=shown.shape)
    with work.budget("test", math.inf) as spent:
        fitted = fit(body, Record(times, {name: shown[:, at] for at, name in enumerate(GYROS)}))
    assert spent.done < 1.3 * work.FIT
    assert fitted.named["growth"] == pytest.approx(-0.004, rel=0.01)
    assert fitted.named["unequal_1"] == pytest.approx(3.0 / 118.0, rel=0.05)


# --- fits of bodies with a wheel: coasts and firings of DOP853, each estimate within what its
# sigma says

WHEELED: dict[str, Any] = {
    "name": "dual spin",
    "inertia": {"A": 300, "C": 200},
    "wheel": {"momentum": 60},
    "state": {"spin": "2 rpm", "nutation": "2 deg", "phase": "30 deg"},
    "dispersions": {"A": {"normal": "1 %"}, "C": {"normal": "1 %"}},
}
NOISE = math.radians(0.002)
MOTIONS = [("0 rpm", 60.0), ("2 rpm", 60.0), ("-2 rpm", 150.0), ("-3 rpm", 30.0), ("6 rpm", -20.0)]


def coasted(
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
    times = np.asarray(np.arange(800) * 0.25, dtype=float)
    start = reference.Motion(rates, reference.frame_n(moments, rates, wheel))
    motions = reference.path(moments, start, (), times, growth, wheel)
    shown = np.array([motion.rates for motion in motions])
    values = shown + NOISE * draw.normal(size=shown.shape)
    return Record(times, dict(zip(GYROS, values.T, strict=True))), rates


@spread("motion", MOTIONS, quick=3)
def test_a_coast_tells_the_moment_that_the_wheel_does_not_know(motion: tuple[str, float]) -> None:
    """A 1 % off: ω turns at ω3 - H3/A. Rates come out too, and the file written from them flies the
    same.
    """
    spin, wheel = motion
    body = nutdamp.load(
        {**WHEELED, "state": {**WHEELED["state"], "spin": spin}, "wheel": {"momentum": wheel}}
    )
    true = (303.0, 303.0, 199.0)
    seen, rates = coasted(body, true, wheel)
    known = carried(fit(body, seen), 0.0)
    sigmas = np.maximum(known.sigmas, 1e-12)
    assert known.values[0] == pytest.approx(true[0], abs=4.0 * sigmas[0])
    assert known.values[2:5] == pytest.approx(rates, abs=4.0 * float(sigmas[2:5].max()))
    # A and C apart are hardly told; H3/A is, by the noise over |ω| and the length of the coasted.
    told = (known.values[1] * rates[2] + wheel) / known.values[0]
    assert told == pytest.approx((true[2] * rates[2] + wheel) / true[0], abs=1e-4)


def test_the_screen_counts_the_turns_of_the_nutation() -> None:
    """Of a body that does not spin, too: 60 N m s / 300 kg m² for 199.75 s."""
    body = nutdamp.load({**WHEELED, "state": {**WHEELED["state"], "spin": 0}})
    seen, _ = coasted(body, (300.0, 300.0, 200.0), 60.0)
    assert "nutation periods: 6.36" in "\n".join(printed(fit_screen(fit(body, seen), 0.0), 120))


@pytest.mark.parametrize("rounding", [0.0, 1e-16, 1e-14])
def test_a_record_without_noise_of_a_body_that_does_not_spin(rounding: float) -> None:
    """Its third gyro shows 0 or rounding, which is no scale: ω turns at h/A, here 1 % slower."""
    body = nutdamp.load({**WHEELED, "state": {**WHEELED["state"], "spin": 0}})
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
    seen, _ = coasted(body, (300.0, 300.0, 200.0), 61.5)
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
            **WHEELED,
            "inertia": {"tensor": [[260, 0, 0], [0, 340, 0], [0, 0, 300]]},
            "wheel": {"momentum": 120},
            "dispersions": {"omega0": {"normal": "0.1 deg/s"}},
        }
    )
    seen, rates = coasted(three, (262.0, 338.0, 300.0), 120.0)
    known = carried(fit(three, seen), 0.0)
    assert known.values[2:5] == pytest.approx(rates, abs=4.0 * float(known.sigmas[2:5].max()))
    sinking = nutdamp.load({**WHEELED, "dissipation": {"time_constant": 500, "nutation": "grows"}})
    seen, _ = coasted(sinking, (300.0, 300.0, 200.0), 60.0, growth=1.0 / 400.0)
    fitted = fit(sinking, seen)
    at = present(fitted.index("growth"))
    assert fitted.values[at] == pytest.approx(1.0 / 400.0, abs=4.0 * fitted.sigmas[at])


def test_an_accelerometer_beside_a_wheel_is_refused() -> None:
    body = nutdamp.load(WHEELED)
    with pytest.raises(BadRequest):
        Model(body, Record(np.arange(10.0), {ACCELERATION: np.zeros(10)}))


# --- large nutations, seen by the axis alone: it goes round a cone, which no small motion about a
# mean axis is


def nutation(fitted: Fit) -> tuple[float, float]:
    """The nutation angle and its sigma, rad."""
    (found,) = (one for one in estimates(fitted, 0.0) if one.key == "nutation")
    return found.value, found.sigma


@spread("seed", range(40), quick=0, deep=2)
def test_cones_of_any_angle_are_found(seed: int) -> None:
    """15 to 65 deg, prolate and oblate, both spins, with moments and rates within the tolerances of
    the file.
    """
    draw = np.random.default_rng([77, seed])
    C = 240.0 * (draw.uniform(0.45, 0.85) if seed % 2 else draw.uniform(1.15, 1.8))
    facing = draw.normal(size=4)
    spin = draw.choice([-1.0, 1.0]) * draw.uniform(0.8, 4.0)
    body = nutdamp.load(
        {
            "name": "tumbling",
            "inertia": {"A": 240.0, "C": C},
            "state": {
                "spin": spin,
                "nutation": f"{draw.uniform(15.0, 65.0)} deg",
                "phase": f"{draw.uniform(0, 360)} deg",
            },
            "attitude": {
                "quaternion": (facing / np.linalg.norm(facing)).tolist(),
                "epoch": "2026-03-01T12:00:00Z",
                "frame": "EME2000",
            },
            "dispersions": {
                "A": {"normal": "1 %"},
                "C": {"normal": "1 %"},
                "omega0": {"normal": "0.3 deg/s"},
            },
        }
    )
    A, C = 240.0 * (1.0 + 0.01 * draw.normal()), C * (1.0 + 0.01 * draw.normal())
    rates = body.omega0 + math.radians(0.3) * draw.normal(size=3)
    pace = float(np.linalg.norm(np.array([A, A, C]) * rates)) / A
    times = np.linspace(0.0, draw.uniform(4.0, 12.0) * 2.0 * math.pi / pace, 250)[1:]
    start = reference.Motion(rates, attitude.matrix(body.initial.quaternion))
    axis = np.array(
        [
            math.copysign(1.0, spin) * one.rotation[:, 2]
            for one in reference.path((A, A, C), start, (), times)
        ]
    )
    axis += 10.0 ** draw.uniform(-4.5, -2.5) * draw.normal(size=axis.shape)
    fitted = fit(
        body, Record(times, dict(zip(AXIS, axis.T / np.linalg.norm(axis, axis=1), strict=True)))
    )
    angle, sigma = nutation(fitted)
    expected = math.atan2(A * math.hypot(rates[0], rates[1]), C * abs(rates[2]))
    assert abs(angle - expected) < 4.0 * sigma < math.radians(3.0)
    ratio = fitted.index("C/A") or 0
    assert abs(fitted.values[ratio] - C / A) < 4.0 * fitted.sigmas[ratio]
