"""Dispersed loops: what is drawn, that each is what it says, and what is made of many."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.builders import channel, spinner
from support.cases import spread
from support.dispersed import jet, normal

from nutdamp.demands import Keep
from nutdamp.dispersion import study_of
from nutdamp.errors import BadRequest, Infeasible
from nutdamp.loop.diagnosis import Stop
from nutdamp.loop.plan import loop_of
from nutdamp.loop.run import fly
from nutdamp.loop.stability import dead_band
from nutdamp.loop.study import OUTPUTS, LoopResults, LoopStudy, loop_study, run
from nutdamp.loop_settings import ACCELEROMETER, BANG, Loop, Sensor
from nutdamp.physics.feed import Cold, Tank
from nutdamp.physics.valve import Trapezoid
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.spacecraft import Attitude, Channel, Disturbance, Requirement, Spacecraft
from nutdamp.tolerances import Dispersions, Tolerance

VALVE = Trapezoid(0.01, 0.02, 0.01, 0.01)
JETS = {
    "+M1": ((0.0, 0.0, 0.8), (0.0, -9.0, 0.0)),
    "-M1": ((0.0, 0.0, 0.8), (0.0, 9.0, 0.0)),
    "+M2": ((0.0, 0.0, 0.8), (9.0, 0.0, 0.0)),
    "-M2": ((0.0, 0.0, 0.8), (-9.0, 0.0, 0.0)),
}
GYRO = Sensor(rate=20.0, noise=math.radians(0.02), bias=math.radians(0.01), delay=0.05)


def rad(degrees: float) -> float:
    return math.radians(degrees)


def relative(size: float, kind: str = "normal") -> Tolerance:
    return Tolerance(kind, size, relative=True)


ALL = Dispersions(
    A=relative(0.02),
    C=relative(0.02),
    omega0=(normal(0.004),) * 3,
    thrust=dict.fromkeys(JETS, relative(0.03)),
    thrust_per_pulse=relative(0.01),
    thrust_direction=dict.fromkeys(JETS, normal(0.01)),
    position=dict.fromkeys(JETS, normal(0.005)),
    timing=Tolerance("uniform", 0.004),
    timing_offset=Tolerance("triangular", 0.01),
    attitude=normal(0.01),
    open_delay=dict.fromkeys(JETS, normal(0.002)),
    close_delay=dict.fromkeys(JETS, normal(0.002)),
    cold=relative(0.02),
    sensor_bias=normal(rad(0.01)),
    sensor_scale=relative(0.02),
    sensor_noise=relative(0.3, "uniform"),
    sensor_delay=Tolerance("uniform", 0.02),
)


def craft(sensor: Sensor = GYRO, dispersions: Dispersions = ALL, **loop: object) -> Spacecraft:
    channels = tuple(
        Channel(name, (replace(jet(name, *one), min_on_time=0.02, max_on_time=0.3, valve=VALVE),))
        for name, one in JETS.items()
    )
    body = spinner(degrees=2.0, channels=channels, requirement=Requirement(nutation=rad(0.4)))
    keys = {"start": rad(0.4), "stop": rad(0.1), "on_time": 0.1, **loop}
    made = Loop(sensor, **keys)  # type: ignore[arg-type]
    return replace(body, loop=made, dispersions=dispersions, cold=Cold(0.9, 3.0))


def study(body: Spacecraft, until: float = 60.0, seed: int = 3) -> LoopStudy:
    return loop_study(body, until, seed=seed)


def test_every_case_has_its_own_body_thrusters_and_sensor() -> None:
    body = craft()
    found = study(body)
    draws, (case,) = found.draws_of(40), [found.case(40)]
    truth, nominal = case.truth, body.inertia
    assert {entry.name for entry in found.model.inputs.drawn} == set(draws)
    assert pytest.approx(nominal.A + draws["A"]) == truth.inertia.A
    assert pytest.approx(nominal.C + draws["C"]) == truth.inertia.C
    assert truth.omega0 == pytest.approx(body.omega0 + [draws[f"omega0_{axis}"] for axis in (1, 2, 3)])
    assert truth.loop is not None
    sensor = truth.loop.sensor
    assert sensor.scales == pytest.approx([1.0 + draws["sensor scale 1"], 1.0 + draws["sensor scale 2"]])
    assert sensor.biases == pytest.approx([GYRO.bias + draws["sensor bias 1"], GYRO.bias + draws["sensor bias 2"]])
    assert sensor.noise == pytest.approx(GYRO.noise * (1.0 + draws["sensor noise"]))
    assert sensor.delay == pytest.approx(GYRO.delay + draws["sensor delay"])
    valve = truth.channels[2].valve
    assert isinstance(valve, Trapezoid)
    assert valve.open_delay == pytest.approx(0.01 + draws["open_delay +M2"])
    assert truth.cold is not None
    assert truth.cold.first == pytest.approx(0.9 + draws["cold"])
    assert case.tilt == pytest.approx([draws["attitude x"], draws["attitude y"]])
    assert case.scatter is not None
    assert case.scatter.of(3) == case.scatter.of(3) != case.scatter.of(4)


def test_torques_are_those_of_a_dispersed_schedule() -> None:
    body = replace(craft(), cold=None)
    still = replace(body, dispersions=replace(ALL, thrust_per_pulse=None, open_delay={}, close_delay={}))
    found = study(still)
    schedule = Schedule(tuple(channel_pulse(one, 2.0 + number, 0.1) for number, one in enumerate(still.channels)))
    fixed = study_of(still, schedule, seed=3)
    draws = fixed.draws_of(17)
    alike = found.draws_of(17)
    assert {name: draws[name] for name in alike if name in draws} == {
        name: draw for name, draw in alike.items() if not name.startswith("sensor ")
    }
    impulses = fixed.model.cases(draws).impulses
    for one, impulse in zip(found.case(17).truth.channels, impulses, strict=True):
        assert one.torque * 0.1 == pytest.approx(impulse, abs=1e-12)


def test_a_case_is_the_same_in_a_study_of_any_size_and_flown_alone() -> None:
    found = study(craft())
    small, large = (run(LoopResults(found, count)) for count in (9, 40))
    assert np.allclose(small.values, large.values[:, :9], rtol=1e-12, atol=1e-15, equal_nan=True)
    assert small.done == 9
    for case in (2, 7):
        plan = loop_of(found.spacecraft, 60.0, seed=3, case=case)
        outputs = dict(zip(OUTPUTS, small.values[:, case].tolist(), strict=True))
        assert plan.flown_run.settled == pytest.approx(outputs["settled"], abs=1e-9)
        assert len(plan.flown_run.fired) == outputs["firings"]
        assert plan.propellant == pytest.approx(outputs["propellant"], rel=1e-9)
        assert plan.flown_run.case == case + 1
        assert plan.flight.residual.momentum_shift == pytest.approx(outputs["momentum_shift"], abs=1e-9)


def test_tolerances_of_zero_fly_the_file_itself_but_for_the_noise() -> None:
    still = replace(GYRO, noise=0.0)
    body = craft(still, Dispersions(A=relative(0.0), sensor_bias=normal(0.0)))
    found = study(body)
    assert not found.model.inputs.drawn
    results = run(LoopResults(found, 3))
    assert np.allclose(results.values, found.nominal[:, None], rtol=1e-12, atol=1e-15)


@pytest.mark.deep
def test_shares_worst_cases_and_verdict_are_of_the_cases() -> None:
    results = run(LoopResults(study(craft()), 300))
    nutation = results.of("nutation")
    assert results.settled == 300
    assert results.worst.cases[0] == int(np.argmax(nutation))
    assert results.met == int(np.count_nonzero(nutation <= rad(0.4)))
    assert results.meets_requirement == (results.met / 300 >= 0.997)
    assert results.within == int(np.count_nonzero(results.of("quiet") <= results.study.band.most))
    shares = results.shares("propellant")
    assert max(shares, key=lambda name: shares[name]).startswith("omega0_")
    assert 0.5 < sum(shares.values()) < 1.1


def test_what_never_settles_is_worst_and_does_not_comply() -> None:
    weak = replace(GYRO, scale=1.0, noise=rad(0.02))
    body = craft(weak, Dispersions(omega0=(normal(0.02), normal(0.02), None)))
    results = run(LoopResults(study(body, until=8.0), 60))
    never = np.isnan(results.values[0]) & (results.values[OUTPUTS.index("firings")] > 0)
    assert 0 < never.sum() < 60
    assert results.settled == 60 - never.sum()
    assert set(results.worst.cases[: never.sum()]) == set(np.flatnonzero(never))
    assert results.met <= results.settled


def test_a_loop_whose_tank_is_empty_fires_no_more_and_does_not_comply() -> None:
    body = craft(dispersions=Dispersions(tank_propellant=Tolerance("uniform", 0.3, relative=True)))
    assert body.loop is not None
    needs = fly(body, body.loop, 60.0).schedule.propellant
    assert needs is not None
    tank = Tank(needs, 22e5, 22e5, 0.0)
    results = run(LoopResults(study(replace(body, tank=tank)), 200))
    empty = results.stops[Stop.EMPTY]
    assert 60 < empty < 140
    assert results.met == results.settled == 200 - empty
    used = results.values[OUTPUTS.index("propellant")]
    tanks = np.broadcast_to(needs + results.study.draws_from(0, 200)["tank propellant"], 200)
    assert used[results.lost] == pytest.approx(tanks[results.lost], rel=1e-9)
    assert np.all(used <= tanks)


def test_faults_stop_each_case_on_its_own() -> None:
    body = craft(reversed=("+M1",))
    results = run(LoopResults(study(body), 20))
    assert results.stops[Stop.CHANNEL] >= 18
    assert results.settled == 20 - sum(count for stop, count in results.stops.items() if stop is not Stop.END)


@pytest.mark.deep
@spread("kind", ["tensor", "disturbed", "continuous"], quick=1)
def test_cases_that_cannot_fly_together_fly_one_by_one(kind: str) -> None:
    body = craft()
    changed = {
        "tensor": lambda: replace(body, inertia=replace(body.inertia, moments=(120.0, 112.0, 80.0))),
        "disturbed": lambda: replace(body, disturbances=(Disturbance(0.001 + 0.001j),)),
        "continuous": lambda: craft(replace(GYRO, rate=None, noise=0.0)),
    }[kind]()
    found = study(changed, until=30.0)
    assert found.alone
    results = run(LoopResults(found, 3))
    assert results.settled == 3
    plan = loop_of(changed, 30.0, seed=3, case=1)
    assert plan.largest[0] == pytest.approx(results.values[OUTPUTS.index("nutation"), 1], rel=1e-9)


def test_alone_or_together_measures_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    found = study(craft())
    together = run(LoopResults(found, 5)).values
    monkeypatch.setattr("nutdamp.loop.study.expects_alone", lambda *_: "a test")
    one_by_one = run(LoopResults(study(craft()), 5)).values
    rows = [row for row, name in enumerate(OUTPUTS) if name != "nutation"]  # alone it is looked for in pulses too
    assert np.allclose(together[rows], one_by_one[rows], rtol=1e-9, atol=1e-12)
    assert np.all(one_by_one >= together - 1e-9 * np.abs(together))


def test_too_many_samples_are_refused_before_they_are_flown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nutdamp.loop.study.MOST_SAMPLES", 10_000)
    found = study(craft())
    assert 0 < found.expect_affordable(2) <= 10_000
    with pytest.raises(BadRequest, match=r"at most \d+ --samples"):
        found.expect_affordable(1000)


def test_what_a_study_needs() -> None:
    with pytest.raises(BadRequest, match="no dispersions"):
        loop_study(replace(craft(), dispersions=None))
    with pytest.raises(BadRequest, match="no loop"):
        loop_study(replace(craft(), loop=None))
    late = craft(replace(GYRO, delay=3.0), predict=False)
    with pytest.raises(Infeasible, match="does not damp"):
        loop_study(late)


def test_an_interrupted_study_keeps_whole_portions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nutdamp.loop.study.PORTION", 16)
    seen: list[int] = []
    results = run(LoopResults(study(craft()), 64), watch=seen.append, stopped=lambda: bool(seen) and seen[-1] > 20)
    assert results.done == 16
    whole = run(LoopResults(study(craft()), 16))
    assert np.array_equal(results.values[:, :16], whole.values, equal_nan=True)


FOUR = tuple(
    channel(name, *torque, min_on_time=0.002, max_on_time=0.3)
    for name, torque in {"+M1": (6, 0, 0), "-M1": (-6, 0, 0), "+M2": (0, 6, 0), "-M2": (0, -6, 0)}.items()
)
NOISY = {
    "noise": Sensor(rate=20.0, noise=rad(0.03)),
    "noise, bias, steps": Sensor(rate=20.0, noise=rad(0.02), bias=rad(0.02), quantisation=rad(0.01), delay=0.05),
    "accelerometer": Sensor(ACCELEROMETER, 20.0, noise=2e-3, position=np.array([1.0, 0.0, 0.0])),
}


BANGS = {"law": BANG, "on_time": 0.1}


def check_dead_band(name: str, law: dict[str, object], count: int) -> None:
    loop = Loop(NOISY[name], start=rad(0.3), stop=rad(0.1), **law)  # type: ignore[arg-type]
    body = spinner(degrees=1.0, channels=FOUR)
    starts = Dispersions(omega0=(Tolerance("uniform", 0.03), Tolerance("uniform", 0.03), None))
    results = run(LoopResults(study(replace(body, loop=loop, dispersions=starts), 200.0), count))
    assert results.settled == count
    fired = results.of("quiet")
    assert 0.9 * count < len(fired) == count - results.idle  # some begin below the start threshold
    assert results.within >= 0.99 * len(fired)
    if law:  # pulses all alike leave anything up to it
        assert results.study.band.most < 2.0 * np.quantile(fired, 0.99)
    assert results.study.band == dead_band(body, loop)


def test_what_a_loop_draws_is_correlated_as_the_file_says() -> None:
    scaled = replace(ALL, sensor_scale=relative(0.05, "uniform"))
    pairs = (("A", "C", 0.9), ("sensor scale 1", "sensor scale 2", 0.7))
    draws = loop_study(craft(dispersions=replace(scaled, correlation=pairs))).draws_from(0, 4_000)
    assert np.corrcoef(draws["A"], draws["C"])[0, 1] == pytest.approx(0.9, abs=0.02)
    found = np.corrcoef(draws["sensor scale 1"], draws["sensor scale 2"])[0, 1]
    assert found == pytest.approx(6.0 / math.pi * math.asin(0.35), abs=0.03)
    plain = loop_study(craft(dispersions=scaled)).draws_from(0, 4_000)
    changed = [name for name in plain if not np.array_equal(plain[name], draws[name])]
    assert changed == ["C", "sensor scale 1", "sensor scale 2"]


@spread("law", [{}, BANGS], quick=1, ids=["proportional", "bang"])
@spread("name", NOISY, quick=1)
def test_noisy_loops_fall_quiet_within_the_dead_band(name: str, law: dict[str, object]) -> None:
    check_dead_band(name, law, 500)


@pytest.mark.weekly
@pytest.mark.parametrize(("name", "law"), [*zip(NOISY, ({}, BANGS, {}), strict=True)], ids=str)
def test_ten_thousand_noisy_loops_fall_quiet_within_the_dead_band(name: str, law: dict[str, object]) -> None:
    check_dead_band(name, law, 10_000)


SIX: dict[str, tuple[float, float, str, dict[str, object]]] = {
    "prolate": (80.0, 3.0, "noise, bias, steps", {}),
    "oblate": (150.0, 3.0, "noise, bias, steps", {}),
    "reversed": (80.0, -3.0, "noise, bias, steps", {}),
    "oblate, reversed, bang": (150.0, -3.0, "noise, bias, steps", BANGS),
    "prolate, accelerometer": (60.0, 3.0, "accelerometer", {}),
    "oblate, reversed, accelerometer": (160.0, -3.0, "accelerometer", {}),
}


def check_six(name: str, count: int) -> None:
    C, spin, sensor, law = SIX[name]
    loop = Loop(NOISY[sensor], start=rad(0.3), stop=rad(0.1), **law)  # type: ignore[arg-type]
    starts = Dispersions(omega0=(Tolerance("uniform", 0.03), Tolerance("uniform", 0.03), None))
    body = replace(spinner(C=C, spin=spin, degrees=1.0, channels=FOUR), loop=loop, dispersions=starts)
    results = run(LoopResults(study(body, 200.0), count))
    fired = results.of("quiet")
    assert len(fired) >= 0.9 * count
    assert results.within >= 0.99 * len(fired)
    assert results.settled >= 0.999 * count
    assert set(results.stops) == {Stop.END}


@spread("name", SIX, quick=1)
def test_noisy_loops_of_six_spacecraft_keep_the_dead_band(name: str) -> None:
    check_six(name, 300)


@pytest.mark.weekly
@pytest.mark.parametrize("name", ["prolate", "oblate, reversed, bang", "oblate, reversed, accelerometer"])
def test_ten_thousand_noisy_loops_of_six_spacecraft_keep_the_dead_band(name: str) -> None:
    check_six(name, 10_000)


@pytest.mark.weekly
@spread("dissipation", [None, 200.0], quick=1, deep=1)
def test_cases_that_break_a_cone_do_not_comply(dissipation: float | None) -> None:
    body = replace(craft(), dissipation=dissipation, attitude=Attitude(np.array([0.8, 0.0, 0.6, 0.0])))
    at = body.direction_in_n(rad(3.0), 0.4)
    watched = replace(body, keep=(Keep("star", at, most=rad(5.0)), Keep("Sun", -at, least=rad(174.0))))
    free, kept = (run(LoopResults(study(one), 40)) for one in (body, watched))
    assert kept.values == pytest.approx(free.values, nan_ok=True)
    alone = []
    for case in range(12):
        seen = loop_of(watched, 60.0, seed=3, case=case)
        angles = np.array([(one.least, one.largest) for one in seen.aspects])
        assert kept.angles[:, :, case] == pytest.approx(angles, abs=rad(2e-3))
        alone.append(seen.meets_requirement)
    assert len(set(alone)) == 2
    broken = np.any([keep.used(*pair) > 1.0 for keep, pair in zip(watched.keep, kept.angles, strict=True)], axis=0)
    assert 0 < np.count_nonzero(broken) < 40
    assert kept.met == np.count_nonzero(~broken) - (free.done - free.met)
    assert alone == [not one for one in broken[:12]]
    assert kept.broken.tolist() == [np.count_nonzero(kept.angles[0, 1] > rad(5.0)), int(kept.broken[1])]
    assert kept.aspects[0] == pytest.approx([kept.angles[0, 0].min(), kept.angles[0, 1].max()])
    only = run(LoopResults(study(replace(watched, requirement=None)), 40))
    assert only.met_fraction == pytest.approx(np.mean(~broken))
