"""Each kind of signal, and pulses fired within a record: what is estimated is what DOP853 flew."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
from support import reference
from support.cases import spread
from support.synthetic import Array, motion

import nutdamp
from nutdamp.errors import BadRequest, Infeasible, Unsuitable
from nutdamp.estimation.doubts import doubts
from nutdamp.estimation.fit import Fit, fit
from nutdamp.estimation.guess import spin_of
from nutdamp.estimation.model import Model
from nutdamp.estimation.record import ACCELERATION, AXIS, GYROS, Record, quantisation
from nutdamp.estimation.results import carried, estimates
from nutdamp.physics import attitude
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.spacecraft import Spacecraft

NOISE = math.radians(0.01)
TRUE = (120.48, 83.76)
"""A and C of the bodies that are flown, kg m²."""

FILE: dict[str, object] = {
    "name": "signals",
    "inertia": {"A": 120.0, "C": 84.0},
    "state": {"spin": 3.0, "nutation": "4 deg", "phase": "20 deg"},
    "attitude": {"quaternion": [1, 0.1, 0.2, 0.3], "epoch": "2026-03-01T12:00:00Z", "frame": "EME2000"},
    "sun": "epoch",
    "sun_sensor": {"azimuth": "35 deg"},
    "thrusters": [{"name": "T1", "torque": [8, 0, 0]}, {"name": "T2", "torque": [0, 8, 0]}],
    "dispersions": {
        "A": {"normal": "0.5 %"},
        "C": {"normal": "0.5 %"},
        "omega0": {"normal": "0.3 deg/s"},
        "thrust": {"normal": "3 %"},
    },
}

ACCELEROMETER = {
    "sensor": {"kind": "accelerometer", "rate": "10 Hz", "position": ["0.8 m", 0, 0], "axis": [0, 0, 1]},
    "law": "four-pulse",
    "start": "0.5 deg",
    "stop": "0.05 deg",
}


def flown(times: Array, body: Spacecraft, events: tuple[reference.Push, ...] = ()) -> list[reference.Motion]:
    """The motion of a body that differs from its file, at rising times > 0; turned about its axis by 0.3 rad."""
    rates = body.omega0 * np.array([1.2, 0.7, 1.001]) + np.array([0.01, 0.02, 0.0])
    turn = np.array([[math.cos(0.3), -math.sin(0.3), 0.0], [math.sin(0.3), math.cos(0.3), 0.0], [0.0, 0.0, 1.0]])
    start = reference.Motion(rates, attitude.matrix(body.initial.quaternion) @ turn)
    moments = (TRUE[0], TRUE[0], TRUE[1])
    if not events:
        return reference.coast(moments, start, np.zeros(3), times)
    return [reference.fly(moments, rates, events, float(time), start.rotation) for time in times]


def gyros(motions: list[reference.Motion], draw: np.random.Generator) -> dict[str, Array]:
    rates = np.array([one.rates for one in motions])
    return {name: rates[:, at] + NOISE * draw.normal(size=len(rates)) for at, name in enumerate(GYROS)}


def axes(motions: list[reference.Motion], sense: float, draw: np.random.Generator) -> dict[str, Array]:
    axis = np.array([sense * one.rotation[:, 2] for one in motions])
    axis = axis + NOISE * draw.normal(size=axis.shape)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    return dict(zip(AXIS, axis.T, strict=True))


def off(found: Fit, truth: Mapping[str, float]) -> dict[str, float]:
    """By how many of their sigmas estimates are off."""
    named = dict(zip((one.name for one in found.model.parameters), found.sigmas, strict=True))
    return {name: (found.named[name] - value) / named[name] for name, value in truth.items()}


def expect_close(found: Fit, truth: Mapping[str, float]) -> None:
    far = {name: value for name, value in off(found, truth).items() if not abs(value) < 4.0}
    assert not far


@spread(("spin", "C"), [(3.0, 84.0), (-2.0, 84.0)], quick=1)
def test_the_axis_tells_its_cone_and_the_ratio_as_well_as_the_spin_is_known(spin: float, C: float) -> None:
    body = nutdamp.load(FILE, set={"state.spin": spin, "inertia.C": C})
    times = np.linspace(0.05, 60.0, 500)
    motions = flown(times, body)
    found = fit(body, Record(times, axes(motions, math.copysign(1.0, spin), np.random.default_rng(1))))
    size = math.hypot(found.named["omega_1"], found.named["omega_2"])
    assert size == pytest.approx(float(np.hypot(*motions[0].rates[:2])), rel=3e-3)
    expect_close(found, {"A": TRUE[0], "C/A": TRUE[1] / TRUE[0], "omega_3": float(motions[0].rates[2])})
    assert "omega_3" in found.kept  # no signal shows the spin: it stays as the file has it
    truth = motions[-1].rotation[:, 2] * math.copysign(1.0, spin)
    state = carried(found, float(times[-1])).state
    axis = attitude.rotate(state.quaternion, np.array([0.0, 0.0, math.copysign(1.0, spin)]))
    assert reference.angle(axis, truth) < 5e-5


@pytest.mark.deep
def test_the_phase_of_the_axis_alone_is_that_of_the_file() -> None:
    body, times = nutdamp.load(FILE), np.linspace(0.05, 60.0, 300)
    seen = axes(flown(times, body), 1.0, np.random.default_rng(1))
    found = fit(body, Record(times, seen))
    row = next(one for one in estimates(found, 0.0) if one.key == "phase")
    assert (row.source, row.sigma) == ("file", math.inf)
    assert any("the axis alone does not show how the body is turned" in one for one in doubts(found))
    beside = fit(body, Record(times, seen | gyros(flown(times, body), np.random.default_rng(2))))
    row = next(one for one in estimates(beside, 0.0) if one.key == "phase")
    assert row.source == "data"
    assert row.sigma < math.radians(0.5)


def test_an_accelerometer_feels_dissipation() -> None:
    """By differences of the rates that DOP853 flies: dω/dt has the part that dissipation gives it."""
    body = nutdamp.load(FILE, set={"loop": ACCELEROMETER, "state.nutation": "12 deg"})
    times, step, arm = np.linspace(0.05, 60.0, 300), 1e-5, np.array([0.8, 0.0, 0.0])
    near = np.sort(np.concatenate([times - step, times + step]))
    around = motion((TRUE[0], TRUE[0], TRUE[1]), body.omega0, near, 0.003)
    rates, change = 0.5 * (around[1::2] + around[::2]), (around[1::2] - around[::2]) / (2.0 * step)
    felt = (np.cross(change, arm) + np.cross(rates, np.cross(rates, arm)))[:, 2]
    model = Model(body, Record(times, {ACCELERATION: felt}))
    start = motion((TRUE[0], TRUE[0], TRUE[1]), body.omega0, times[:1], 0.003)[0]
    truth = {"A": TRUE[0], "C/A": TRUE[1] / TRUE[0], "growth": 0.003}
    truth |= {f"omega_{at + 1}": float(one) for at, one in enumerate(start)}
    off = np.abs(model.predicted(truth) - felt).max()
    assert off < 1e-5 * np.abs(felt).max()


@pytest.mark.deep
def test_gyros_and_axis_together_tell_bias_misalignment_and_wobble_apart() -> None:
    body, draw = nutdamp.load(FILE), np.random.default_rng(2)
    times = np.linspace(0.05, 60.0, 500)
    motions = flown(times, body)
    signals = gyros(motions, draw)
    tilt, bias = np.array([0.004, -0.003, 0.0]), np.array([3e-4, -2e-4, 2e-4])
    rates = np.array([one.rates for one in motions])
    turned = -np.cross(tilt, rates) + bias
    signals = {name: values + turned[:, at] for at, (name, values) in enumerate(signals.items())}
    wobbling = [
        one._replace(rotation=one.rotation @ np.array([[1, 0, 0.002], [0, 1, -0.001], [0, 0, 1]])) for one in motions
    ]
    found = fit(body, Record(times, signals | axes(wobbling, 1.0, draw)))
    truth = {"misalignment_1": 0.004, "misalignment_2": -0.003, "wobble_1": 0.001, "wobble_2": 0.002}
    truth |= {f"bias_{name}": float(one) for name, one in zip(GYROS, bias, strict=True)}
    expect_close(found, truth | {"C/A": TRUE[1] / TRUE[0], "omega_3": float(motions[0].rates[2])})
    assert found.sigmas[found.index("bias_omega_3") or 0] < 0.1 * math.radians(0.02)  # which gyros alone do not tell


def test_an_accelerometer_tells_what_it_feels_by_its_kinematics() -> None:
    body, draw = nutdamp.load(FILE, set={"loop": ACCELEROMETER}), np.random.default_rng(3)
    times = np.linspace(0.05, 60.0, 500)
    rates = np.array([one.rates for one in flown(times, body)])
    step, arm = 1e-5, np.array([0.8, 0.0, 0.0])
    near = np.sort(np.concatenate([times - step, times + step]))
    around = np.array([one.rates for one in flown(near, body)])
    change = (around[1::2] - around[::2]) / (2.0 * step)
    felt = (np.cross(change, arm) + np.cross(rates, np.cross(rates, arm)))[:, 2]
    found = fit(body, Record(times, {ACCELERATION: felt + 0.002 + 1e-4 * draw.normal(size=500)}))
    truth = dict(zip(("omega_1", "omega_2", "omega_3"), rates[0].tolist(), strict=True))
    expect_close(found, truth | {"C/A": TRUE[1] / TRUE[0], "bias_acceleration": 0.002})


def sun_pulses(body: Spacecraft, azimuth: float, until: float) -> Array:
    """When the Sun passes the azimuth in the body, by the rotations of DOP853 on a fine grid."""
    assert body.sun is not None
    times = np.linspace(0.0, until, 20_001)[1:]
    seen = np.array([one.rotation.T @ body.sun for one in flown(times, body)])
    turns = (np.unwrap(np.arctan2(seen[:, 1], seen[:, 0])) - azimuth) / (2.0 * math.pi)
    turns *= -math.copysign(1.0, body.spin)
    return np.interp(np.arange(math.ceil(turns[0]), turns[-1]), turns, times)


@pytest.mark.deep
def test_sun_pulses_tell_the_spin_and_so_the_bias_of_the_third_gyro() -> None:
    body, draw = nutdamp.load(FILE), np.random.default_rng(4)
    times = np.linspace(0.05, 100.0, 500)
    motions, passed = flown(times, body), sun_pulses(body, math.radians(35.0), 100.0)
    signals = gyros(motions, draw)
    signals[GYROS[2]] = signals[GYROS[2]] + 5e-4
    found = fit(body, Record(times, signals, passed + 5e-4 * draw.normal(size=len(passed))))
    expect_close(found, {"C/A": TRUE[1] / TRUE[0], "bias_omega_3": 5e-4})
    assert found.sigmas[found.index("bias_omega_3") or 0] < 0.1 * math.radians(0.02)
    assert found.noise[-1] == pytest.approx(5e-4, rel=0.4)


@pytest.mark.weekly
def test_pulses_in_a_record_tell_thrust_and_delay_of_their_channels() -> None:
    body, draw = nutdamp.load(FILE), np.random.default_rng(5)
    times = np.linspace(0.05, 40.0, 200)
    by_name = {channel.name: channel for channel in body.channels}
    fired = Schedule(tuple(channel_pulse(by_name[name], at, 0.5) for name, at in (("T1", 12.0), ("T2", 25.0))))
    factors, late = {"T1": 0.96, "T2": 1.03}, {"T1": 0.02, "T2": 0.035}
    events = tuple(
        reference.Push(one.start + late[one.channel], one.end + late[one.channel], factors[one.channel] * one.torque)
        for one in fired
        if one.torque is not None
    )
    found = fit(body, Record(times, gyros(flown(times, body, events), draw), schedule=fired))
    A = found.named["A"]
    # What a pulse shows is thrust over A, so that the factor is as uncertain as A.
    for name in factors:
        at, of_A = found.index(f"thrust {name}"), found.index("A")
        assert at is not None
        assert of_A is not None
        seen = found.named[f"thrust {name}"] / A * TRUE[0]
        apart = found.covariance[at, at] - found.covariance[at, of_A] ** 2 / found.covariance[of_A, of_A]
        assert abs(seen - factors[name]) < 4.0 * math.sqrt(apart)
        assert math.sqrt(apart) < 0.002
    expect_close(found, {"A": TRUE[0], "C/A": TRUE[1] / TRUE[0], **{f"delay {name}": late[name] for name in late}})
    after = carried(found, 40.0)
    assert after.values[2:5] == pytest.approx(flown(np.array([40.0]), body, events)[0].rates, abs=6.0 * NOISE)


@pytest.mark.deep
def test_unequal_transverse_moments_are_seen_and_their_axes() -> None:
    body, draw = nutdamp.load(FILE), np.random.default_rng(6)
    times = np.linspace(0.0, 60.0, 400)
    turn = math.radians(25.0)
    about = np.array([[math.cos(turn), -math.sin(turn), 0.0], [math.sin(turn), math.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    rates = motion((121.5, 118.5, 84.2), about.T @ body.omega0, times) @ about.T
    shown = rates + NOISE * draw.normal(size=rates.shape)
    found = fit(body, Record(times, dict(zip(GYROS, shown.T, strict=True))))
    assert found.model.unequal
    size = 1.5 / 120.0
    expect_close(found, {"unequal_1": size * math.cos(2 * turn), "unequal_2": size * math.sin(2 * turn)})
    expect_close(found, {"C/A": 84.2 / 120.0})


@pytest.mark.deep
def test_equal_moments_are_not_taken_for_different_ones() -> None:
    body = nutdamp.load(FILE)
    times = np.linspace(0.0, 60.0, 300)
    rates = motion((TRUE[0], TRUE[0], TRUE[1]), body.omega0, times)
    for seed in range(10):
        shown = rates + NOISE * np.random.default_rng(seed).normal(size=rates.shape)
        assert not fit(body, Record(times, dict(zip(GYROS, shown.T, strict=True)))).model.unequal


@pytest.mark.deep
def test_fast_growth_over_many_periods_is_followed() -> None:
    body = nutdamp.load(FILE, set={"state.nutation": "2 deg"})
    times = np.linspace(0.0, 150.0, 700)
    rates = motion((TRUE[0], TRUE[0], TRUE[1]), body.omega0, times, 0.025)
    assert math.atan2(TRUE[0] * float(np.hypot(*rates[-1, :2])), TRUE[1] * rates[-1, 2]) > math.radians(50.0)
    shown = rates + NOISE * np.random.default_rng(7).normal(size=rates.shape)
    found = fit(body, Record(times, dict(zip(GYROS, shown.T, strict=True))))
    expect_close(found, {"growth": 0.025, "C/A": TRUE[1] / TRUE[0]})


def record(body: Spacecraft, times: Array, **changed: float) -> Record:
    rates = motion((TRUE[0], TRUE[0], TRUE[1]), body.omega0, times)
    shown = rates + NOISE * np.random.default_rng(8).normal(size=rates.shape)
    return Record(times, dict(zip(GYROS, shown.T, strict=True)))


@pytest.mark.deep
def test_records_that_tell_nothing_say_what_would_help() -> None:
    still = nutdamp.load(FILE, set={"state.nutation": "0.001 deg"})
    with pytest.raises(Infeasible, match=r"no nutation is seen.*larger nutation"):
        fit(still, record(still, np.linspace(0.0, 60.0, 200)))
    body = nutdamp.load(FILE)
    with pytest.raises(Infeasible, match=r"too short: 2 s are 0.29 of a nutation period .*6.98 s, is needed"):
        fit(body, record(body, np.linspace(0.0, 2.0, 60)))
    with pytest.raises(Infeasible, match="2 rows of samples, with 6 values in all, cannot tell"):
        fit(body, record(body, np.array([0.0, 9.0])))


def test_sun_pulses_alone_are_not_taken_for_a_nutation() -> None:
    with pytest.raises(
        Infeasible,
        match=r"no nutation is seen in sun_pulse alone: .*spin, 171.88.* deg/s.*or an acceleration beside them would",
    ):
        fit(nutdamp.load(FILE), Record(np.empty(0), {}, 2.0944 * np.arange(1.0, 60.0)))


def test_the_spin_of_sun_pulses_in_a_column_is_no_surer_than_its_samples_allow() -> None:
    """Of n even turns T the line through times of variance s²/12 has the sigma of its slope s/√(12 Σ(k - mean)²)."""
    sigma = spin_of(2.0 * np.arange(20.0), 0.1)[1]
    expected = 0.1 / math.sqrt(12.0 * float(np.sum((np.arange(20.0) - 9.5) ** 2)))
    assert sigma == pytest.approx(2.0 * math.pi * expected / 2.0**2)


def test_signals_need_what_explains_them_in_the_file() -> None:
    plain = nutdamp.load({name: FILE[name] for name in ("name", "inertia", "state")})
    times = np.linspace(0.0, 60.0, 100)
    with pytest.raises(Unsuitable, match=r"loop.sensor: .*accelerometer"):
        fit(plain, Record(times, {ACCELERATION: np.sin(times)}))
    with pytest.raises(Unsuitable, match=r"sun: expected the key sun"):
        fit(plain, Record(times, {}, np.arange(1.0, 30.0)))


def test_a_pulse_that_is_on_as_the_record_begins_is_refused() -> None:
    body = nutdamp.load(FILE)
    fired = Schedule((channel_pulse(body.channels[0], 10.0, 1.0),))
    begun = record(body, np.linspace(0.0, 60.0, 100))
    late = Record(begun.times + 10.0, begun.signals, schedule=fired)
    with pytest.raises(BadRequest, match="is on as the record begins"):
        Model(body, late)


def test_a_moment_without_tolerance_stays_as_it_is() -> None:
    times = np.linspace(0.0, 60.0, 200)
    for tolerances, fixed in (({"A": {"normal": "0.5 %"}}, "C"), ({"C": {"normal": "0.5 %"}}, "A"), (None, "A")):
        given = {name: FILE[name] for name in ("name", "inertia", "state")}
        body = nutdamp.load(given | ({} if tolerances is None else {"dispersions": tolerances}))
        found = fit(body, record(body, times))
        known = carried(found, 0.0)
        at = known.names.index(fixed)
        assert known.values[at] == pytest.approx({"A": 120.0, "C": 84.0}[fixed], rel=1e-14)
        assert known.sigmas[at] == 0.0
        assert known.values[1] / known.values[0] == pytest.approx(TRUE[1] / TRUE[0], rel=2e-4)


def test_steps_are_found_and_noise_is_not_taken_for_them() -> None:
    draw = np.random.default_rng(9)
    values = draw.normal(size=300)
    assert quantisation(values) == 0.0
    assert quantisation(np.rint(values / 0.25) * 0.25) == pytest.approx(0.25)
    assert quantisation(np.array([1.0, np.nan, 1.0])) == 0.0
