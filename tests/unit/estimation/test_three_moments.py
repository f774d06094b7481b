"""Bodies of three different moments: pulses in their records, by DOP853 and by a file of ACE."""

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import reference
from support.builders import noted, present
from support.cases import spread
from support.golden import check_text
from support.places import case
from support.synthetic import Array, motion

import nutdamp
from nutdamp.common import work
from nutdamp.estimation.fit import fit
from nutdamp.estimation.model import Model
from nutdamp.estimation.parameters import GYROS, Record
from nutdamp.estimation.results import doubts
from nutdamp.estimation.search import Fit
from nutdamp.files.telemetry import read_telemetry
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

TENSOR = [[110.0, 2.0, 0.0], [2.0, 126.0, 0.0], [0.0, 0.0, 170.0]]
"""kg m²; its axis 1 is that of the least moment, which principal axes sorted by size are not."""

FILE: dict[str, object] = {
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
    edges = sorted(
        {0.0, *(time for one in events for time in (one.start, one.end)), float(times[-1])}
    )
    now = reference.Motion(axes.T @ rates, np.eye(3))
    shown = [rates]
    for begin, end in itertools.pairwise(edges):
        torque = sum(
            (one.torque for one in events if one.start < 0.5 * (begin + end) < one.end), np.zeros(3)
        )
        inside = times[(times > begin) & (times <= end)]
        motions = reference.coast(
            moments.tolist(), now, torque, np.unique(np.append(inside, end)) - begin
        )
        shown = shown + [axes @ one.rates for one in motions[: len(inside)]]
        now = motions[-1]
    return np.array(shown)


def test_a_pulse_pushes_where_its_thruster_is_mounted_whatever_the_principal_axes() -> None:
    """The model against DOP853, with I1 < I2 and I12 ≠ 0: the principal axes are turned by almost
    90 deg.
    """
    body = nutdamp.load(FILE)
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
        FILE
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
    body = nutdamp.load(FILE | {"omega0": [0.1, 0.05, 0.9]})
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
    body = nutdamp.load(FILE | {"omega0": [0.1, 0.05, 0.9]})
    times = np.linspace(0.0, 200.0, 400)
    shown = motion((121.0, 115.0, 170.0), body.omega0, times, -0.004)
    shown += math.radians(0.01) * np.random.default_rng(2).normal(size=shown.shape)
    with work.budget("test", math.inf) as spent:
        fitted = fit(body, Record(times, {name: shown[:, at] for at, name in enumerate(GYROS)}))
    assert spent.done < 1.3 * work.FIT
    assert fitted.named["growth"] == pytest.approx(-0.004, rel=0.01)
    assert fitted.named["unequal_1"] == pytest.approx(3.0 / 118.0, rel=0.05)
