"""The budget of a loop: against long closed-loop flights, against what limits say, and what it refuses."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from support.builders import channel, spinner
from support.cases import spread

import nutdamp
from nutdamp.compliance import reached
from nutdamp.errors import BadRequest, Infeasible
from nutdamp.loop.budget import DAY, YEAR, Budget, Thresholds, budget
from nutdamp.loop.chains import Cycle
from nutdamp.loop.cycles import Map
from nutdamp.loop.diagnosis import Stop
from nutdamp.loop.law import Law
from nutdamp.loop.odds import Odds
from nutdamp.loop.run import fly
from nutdamp.loop.sensor import Estimator, Signal
from nutdamp.loop.transfer import Transfer, transfer
from nutdamp.loop_settings import BANG, ONE_PULSE, Loop, Sensor
from nutdamp.physics.feed import Cold, Tank
from nutdamp.physics.valve import Trapezoid
from nutdamp.presentation.budget_tables import _warnings
from nutdamp.spacecraft import Channel, Limits, Requirement, Spacecraft


def rad(degrees: float) -> float:
    return math.radians(degrees)


def four(torque: float = 6.0, least: float = 0.002, isp: float | None = 220.0) -> tuple[Channel, ...]:
    named = {"+M1": (1.0, 0.0), "-M1": (-1.0, 0.0), "+M2": (0.0, 1.0), "-M2": (0.0, -1.0)}
    return tuple(
        channel(name, torque * x, torque * y, 0.0, min_on_time=least, max_on_time=0.3, isp=isp, thrust=torque)
        for name, (x, y) in named.items()
    )


def craft(tau: float = 100.0, **given: object) -> Spacecraft:
    arguments = {"channels": four(), "degrees": 0.5, **given}
    return replace(spinner(**arguments), dissipation=tau)  # type: ignore[arg-type]


def gyro(**given: object) -> Sensor:
    return replace(Sensor(rate=10.0, noise=rad(0.004), delay=0.02), **given)  # type: ignore[arg-type]


def loop(sensor: Sensor, **given: object) -> Loop:
    return replace(Loop(sensor, start=rad(0.5), stop=rad(0.05)), **given)  # type: ignore[arg-type]


VALVED = tuple(one.of(valve=Trapezoid(0.008, 0.012, 0.005, 0.01)) for one in four())
STAGE = nutdamp.example("upper-stage")
assert STAGE.loop is not None
STAGE_LOOP = STAGE.loop
SEEN = STAGE_LOOP.sensor

QUICK = {
    "continuous gyro": (craft(), loop(Sensor())),
    "continuous gyro, late": (craft(), loop(Sensor(delay=0.05), predict=False)),
    "nine samples a period": (craft(), loop(gyro(rate=0.9, noise=0.0))),
}
LONG = {
    "gyro": (craft(), loop(gyro())),
    "bias and steps": (craft(), loop(gyro(bias=rad(0.01), quantisation=rad(0.01)))),
    "late": (craft(), loop(gyro(), predict=False)),
    "low-pass filter": (craft(), loop(gyro(low_pass=0.3))),
    "bang": (craft(channels=four(2.0, 0.05)), loop(gyro(), law=BANG, on_time=0.05)),
    "least on-time": (craft(channels=four(6.0, 0.1)), loop(gyro(), start=rad(1.0), stop=rad(0.02))),
    "one channel": (craft(channels=four()[:1]), loop(gyro(), settle=1.0, min_interval=5.0)),
    "valves and ticks": (craft(channels=VALVED, limits=Limits(tick=0.004)), loop(gyro())),
    "one-pulse, reversed spin": (craft(spin=-3.0), loop(gyro(), law=ONE_PULSE)),
    "slender": (craft(C=20.0, tau=300.0), loop(gyro())),
    "grows by a third in a period": (craft(tau=25.0), loop(gyro(), start=rad(1.0), law=ONE_PULSE)),
    "accelerometer": (STAGE, replace(STAGE_LOOP, sensor=replace(SEEN, rate=10.0, noise=0.004))),
    "accelerometer, filter": (STAGE, replace(STAGE_LOOP, sensor=replace(SEEN, rate=10.0, noise=0.01, low_pass=0.1))),
}


def flown(body: Spacecraft, made: Loop, cycles: int, seeds: int) -> tuple[float, float, int]:
    """Pulses and impulse (N m s) a second between the first pauses and the last, and how many cycles that are."""
    whole = Map(body, made).cycle(8, 4).cycles
    until = (cycles / seeds + 4) / whole
    pulses, impulse, time, count = 0, 0.0, 0.0, 0
    for seed in range(1, seeds + 1):
        run = fly(body, made, until, seed=seed)
        first, last = run.quiet[1], run.quiet[-1]
        counted = [one.pulse for one in run.fired if first < one.pulse.t <= last]
        pulses += len(counted)
        impulse += math.fsum(one.magnitude for one in counted)
        time += last - first
        count += len(run.quiet) - 2
    return pulses / time, impulse / time, count


def agrees(body: Spacecraft, made: Loop, cycles: int, seeds: int, least: int) -> None:
    """The cycle and long flights of at ``least`` so many cycles, to 2 %."""
    cycle = Map(body, made).cycle()
    pulses, impulse, count = flown(body, made, cycles, seeds)
    assert count >= least
    assert cycle.pulses == pytest.approx(pulses, rel=0.02)
    assert cycle.impulse == pytest.approx(impulse, rel=0.02)


@spread("name", QUICK, quick=1, deep=2)
def test_a_budget_is_that_of_a_long_flight(name: str) -> None:
    agrees(*QUICK[name], 40, 1, 20)


@pytest.mark.deep
def test_on_ticks_a_budget_is_that_of_flights_from_many_phases() -> None:
    """On ticks the length of a cycle scatters by 15 %, one by one: the mean of 12 times 40 is known to 0.7 %."""
    body, made = craft(spin=-3.0, limits=Limits(tick=0.004)), loop(gyro(noise=0.0))
    cycle, phases = Map(body, made).cycle(), 12
    start = complex(*body.omega0[:2])
    rates = []
    for number in range(phases):
        turned = start * cmath.exp(2j * math.pi * number / phases)
        pulses, _, count = flown(body.replace(omega0=[turned.real, turned.imag, body.spin]), made, 40, 1)
        assert count >= 20
        rates.append(pulses)
    assert cycle.pulses == pytest.approx(np.mean(rates), rel=0.02)


@pytest.mark.weekly
@pytest.mark.parametrize("name", LONG)
def test_with_noise_a_budget_is_that_of_many_long_flights(name: str) -> None:
    """With noise the length of a cycle scatters by about 15 %: over 600 of them the mean is known to 0.6 %."""
    agrees(*LONG[name], 600, 8, 400)


@pytest.mark.weekly
def test_a_loop_below_the_noise_fires_without_end_as_often_as_one_that_is_flown() -> None:
    body, made = craft(), loop(gyro(noise=rad(0.6)))
    cycle = Map(body, made).cycle()
    run = fly(body, made, 600.0)
    assert cycle.pulses == pytest.approx(len(run.fired) / 600.0, rel=0.03)
    assert cycle.pulses * DAY > 1e5


@pytest.mark.deep
def test_without_a_stop_the_smallest_pulse_sets_the_limit_cycle() -> None:
    body, made = craft(channels=four(6.0, 0.1)), loop(gyro(), start=rad(1.0), stop=0.0)
    cycle = Map(body, made).cycle()
    assert cycle.high == pytest.approx(0.5 * math.atan(6.0 * 0.1 / (80.0 * 3.0)), rel=0.05)


@pytest.mark.weekly
@pytest.mark.parametrize(("degrees", "pauses"), [(2.0, True), (2.07, False)])
def test_of_two_limit_cycles_the_budget_is_of_the_one_that_the_loop_falls_into(degrees: float, pauses: bool) -> None:
    """Pulses all alike, half of each above stop: what is left of the first nutation decides whether it ever pauses."""
    made = loop(gyro(noise=rad(0.002)), law=BANG, on_time=0.1, start=rad(1.0), stop=rad(0.02))
    body = replace(craft(tau=1000.0, channels=four(least=0.1), degrees=degrees), loop=made)
    (held,) = budget(body).held
    assert held.cycle is not None
    assert held.other is not None
    assert (held.cycle.cycles > 0.0, held.other.cycles > 0.0) == (pauses, not pauses)
    run = fly(body, made, 3000.0, seed=2)
    assert bool(run.quiet) is pauses
    if not pauses:
        later = sum(one.pulse.t > 1000.0 for one in run.fired)
        assert held.cycle.pulses == pytest.approx(later / 2000.0, rel=0.02)
        assert held.other.pulses < 0.01 * held.cycle.pulses


@pytest.mark.deep
def test_dissipation_slows_the_spin_as_in_flight() -> None:
    body, made = craft(), loop(Sensor(delay=0.05), start=rad(5.0), stop=rad(1.0), predict=False)
    cycle = Map(body, made).cycle()
    run = fly(body, made, 6.0 / cycle.cycles)
    assert len(run.quiet) > 3
    spins = run.flight.motion(np.array(run.quiet[:4]))[0][:, 2]
    assert np.diff(np.log(spins)).mean() == pytest.approx(cycle.spin_rate / cycle.cycles / body.spin, rel=0.03)
    assert cycle.spin_rate / cycle.cycles / body.spin < -0.004


@pytest.mark.parametrize(
    "sensor", [gyro(bias=0.001), gyro(low_pass=0.3), replace(SEEN, rate=10.0), replace(SEEN, rate=10.0, low_pass=0.1)]
)
@pytest.mark.parametrize("predict", [True, False])
def test_what_is_seen_is_what_the_estimator_makes_of_samples(sensor: Sensor, predict: bool) -> None:
    body = STAGE if sensor.kind == "accelerometer" else craft()
    body = replace(body, omega0=body.omega0 * [0.01, 0.01, 1.0])
    law = Law(body, loop(sensor, predict=predict))
    seen = transfer(law, body.spin)
    times = np.asarray(np.arange(400) * seen.step, dtype=np.float64)
    rates = fly(body, loop(sensor, start=rad(80.0)), float(times[-1])).flight.motion(times)[0]
    estimator, signal, true = Estimator(law, sensor, 0.0), Signal(body, sensor, 1), rates[:, 0] + 1j * rates[:, 1]
    board = estimator.on_board(estimator.feed(times, signal.shown(rates), rates[:, 2]), rates[:, 2])
    first = int(np.argmax(~np.isnan(board)))
    assert first == math.ceil(seen.first / seen.step - 1e-6)
    assert np.abs(board - seen.mean(true))[first + 60 :].max() < 1e-3 * np.abs(true).max()


@pytest.mark.parametrize(
    "sensor", [gyro(low_pass=0.3), replace(SEEN, rate=10.0), replace(SEEN, rate=10.0, low_pass=0.1)]
)
def test_noise_is_what_the_estimator_makes_of_noise(sensor: Sensor) -> None:
    body, count = STAGE if sensor.kind == "accelerometer" else craft(), 20_000
    law, spin = Law(body, loop(sensor)), np.full(count, body.spin)
    seen, estimator = transfer(law, body.spin), Estimator(law, sensor, 0.0)
    still = np.zeros((count, 1 if sensor.kind == "accelerometer" else 2))
    times, values = np.asarray(np.arange(count) * seen.step), Signal(body, sensor, 1).sampled(np.arange(count), still)
    found = estimator.on_board(estimator.feed(times, values, spin), spin)[200:]
    drawn = seen.noise(seen.drawn(np.random.default_rng(2), 1, count + len(seen.weights)))[0]
    turn = np.exp(1j * float(law.rate(body.spin)) * seen.step)
    for noise in (found, drawn):
        assert math.sqrt(float((np.abs(noise) ** 2).mean()) / 2.0) == pytest.approx(seen.sigma, rel=0.05)
        lasting = complex((noise[1:] * noise[:-1].conj()).mean() * turn / (np.abs(noise) ** 2).mean())
        assert 1.0 - lasting.real == pytest.approx(seen.fresh, rel=0.1)


def seen_by(sigma: float, offset: complex = 0j) -> Transfer:
    return Transfer(0.1, np.ones(1, complex), 1.0 + 0j, 0j, offset, sigma, 1.0, (sigma, sigma), (0.0, 0.0), 0.0)


@pytest.mark.parametrize(("sigma", "offset"), [(0.05, 0j), (0.3, 0j), (0.05, 0.2 + 0.1j)])
def test_the_odds_of_a_threshold_are_those_of_samples_drawn(sigma: float, offset: complex) -> None:
    """Growing z seen in white noise, sample by sample, until it first shows 1."""
    growth, seen, rng = 0.01, seen_by(sigma, offset), np.random.default_rng(5)
    sizes = 0.2 * np.exp(growth * seen.step * np.arange(3000))
    crossed = []
    for _ in range(400):
        noise = rng.normal(scale=sigma, size=(2, 3000))
        shown = sizes * np.exp(1j * (0.3 * np.arange(3000) + rng.uniform(0.0, 7.0))) + offset + noise[0] + 1j * noise[1]
        crossed.append(sizes[np.argmax(np.abs(shown) >= 1.0)])
    odds = Odds(seen, 1.0, growth, below=False)
    expected = odds.size(np.full(20_000, 0.2), rng.exponential(size=20_000))
    assert np.mean(crossed) == pytest.approx(float(expected.mean()), rel=0.01)
    assert np.std(crossed) == pytest.approx(float(expected.std()), rel=0.15)


def test_when_damping_must_begin_is_that_of_the_course_example() -> None:
    stage = replace(spinner(A=2000.0, C=1000.0), omega0=np.array([0.1, 0.0, 2.0 * math.pi]), dissipation=100.0)
    assert reached(stage, rad(32.59)) == pytest.approx(300.0, abs=0.05)
    assert reached(stage, stage.nutation) == 0.0
    oblate = replace(spinner(A=80.0, C=120.0, degrees=5.0), dissipation=100.0)
    assert reached(oblate, rad(1.0)) == pytest.approx(100.0 * math.log(math.tan(rad(5.0)) / math.tan(rad(1.0))))
    assert reached(oblate, rad(6.0)) == 0.0
    assert reached(replace(stage, omega0=np.array([0.0, 0.0, 1.0])), 0.1) == math.inf


def held_by(body: Spacecraft, **given: object) -> Cycle:
    (one,) = budget(replace(body, loop=loop(gyro(), **given))).held
    assert one.cycle is not None, one.why
    return one.cycle


def test_propellant_follows_from_impulse_and_isp() -> None:
    cycle = held_by(craft())
    assert cycle.propellant == pytest.approx(cycle.impulse / (220.0 * 9.80665), rel=1e-9)  # 1 m arms
    assert held_by(craft(channels=four(isp=None))).propellant is None


@pytest.mark.weekly
def test_a_tank_lasts_as_long_as_its_propellant() -> None:
    body = replace(craft(), loop=loop(gyro()), cold=Cold(0.5, 10.0))
    steady = replace(body, tank=Tank(2.0, 22e5, 8e5, 0.0))
    (one,) = budget(steady).held
    assert one.cycle is not None
    assert one.cycle.propellant is not None
    assert one.lasts == pytest.approx(2.0 / one.cycle.propellant, rel=1e-9)
    (falling,) = budget(replace(body, tank=Tank(2.0, 22e5, 8e5, 1.0))).held
    assert falling.lasts is not None
    # Weaker than the law believes, a pulse leaves a good part of the nutation: more pulses for the same impulse.
    assert falling.lasts == pytest.approx(one.lasts, rel=0.6)
    assert falling.lasts != pytest.approx(one.lasts, rel=0.01)
    assert Map(steady, loop(gyro()), used=1.0).cycle().pulses == Map(steady, loop(gyro())).cycle().pulses


@pytest.mark.weekly
def test_a_tank_whose_pressure_falls_lasts_as_long_as_a_loop_that_is_flown_until_it_is_empty() -> None:
    made = loop(gyro())
    body = replace(craft(degrees=0.4), loop=made, tank=Tank(0.15, 22e5, 8e5, 1.0))
    (held,) = budget(body).held
    assert held.lasts is not None
    run = fly(body, made, 1.2 * held.lasts, seed=3)
    assert (run.stop, len(run.fired) > 400) == (Stop.EMPTY, True)
    assert run.fired[-1].pulse.t - run.fired[0].pulse.t == pytest.approx(held.lasts, rel=0.02)


@pytest.mark.deep
def test_noise_above_a_tenth_of_start_widens_what_is_known() -> None:
    start = Law(craft(), loop(gyro())).size(rad(0.5), 3.0)
    for share, noisy in ((0.05, False), (0.2, True)):
        (held,) = budget(replace(craft(), loop=loop(gyro(noise=share * start)))).held
        assert held.cycle is not None
        assert (held.noisy, held.cycle.doubt >= 0.2) == (noisy, noisy)
        assert ("above 10 % of loop.start" in " ".join(_warnings(Budget(held.spacecraft, None, (held,))))) is noisy


@pytest.mark.deep
def test_pairs_of_thresholds_are_rows() -> None:
    body = replace(craft(), loop=loop(gyro()), requirement=Requirement(nutation=rad(0.6)))
    found = budget(body, [Thresholds(rad(0.5), rad(0.05)), Thresholds(rad(1.0), rad(0.05))])
    assert [one.meets_requirement for one in found.held] == [True, False]
    assert found.meets_requirement is True
    assert found.largest == rad(0.6)
    assert found.until_largest == pytest.approx(100.0 * math.log(math.tan(rad(0.6)) / math.tan(rad(0.5))))
    again = budget(body, [Thresholds(rad(1.0), rad(0.05))])
    assert again.held[0].cycle == found.held[1].cycle
    assert not again.meets_requirement
    assert again.held[0].begins == pytest.approx(100.0 * math.log(math.tan(rad(1.0)) / math.tan(rad(0.5))))


def test_what_cannot_be_held_says_why() -> None:
    def why(body: Spacecraft, made: Loop) -> str:
        found = budget(replace(body, loop=made))
        assert not found.feasible
        return found.held[0].why

    assert "+M1" in why(craft(), loop(gyro(), reversed=("+M1",)))
    assert "wired backwards" in why(craft(), loop(gyro(scale=-1.0)))
    assert "does not damp" in why(craft(), loop(gyro(delay=2.0), predict=False))
    weak = craft(channels=four(0.4))
    assert "does not damp" in why(weak, loop(gyro(), start=rad(2.0)))
    with pytest.raises(Infeasible, match="faster than the firings"):
        Map(weak, loop(gyro(), start=rad(2.0), min_interval=10.0)).cycle()
    tense = craft(channels=four(4.0))
    assert "faster than the firings" in why(tense, loop(gyro(), start=rad(2.0), min_interval=30.0, on_time=0.2))


def test_without_growth_nothing_is_held() -> None:
    oblate = replace(craft(A=80.0, C=120.0), loop=loop(gyro()))
    assert budget(oblate).held == ()
    assert budget(oblate).feasible
    assert budget(oblate).meets_requirement is None
    assert budget(craft()).held == ()  # no loop
    with pytest.raises(BadRequest, match="time_constant"):
        budget(replace(craft(), dissipation=None))


def test_the_library_gives_what_the_command_writes(tmp_path: object) -> None:
    found = nutdamp.budget(STAGE, [(rad(0.5), rad(0.1))])
    (row,) = found.to_dict()["thresholds"]
    cycle = found.core.held[0].cycle
    assert cycle is not None
    assert cycle.propellant is not None
    assert row["pulses_per_day"] == cycle.pulses * DAY
    assert row["propellant_kg_per_year"] == cycle.propellant * YEAR
    for wrong in ([(0.1, 0.2)], [(0.1,)], "0.1", [("a", "b")]):
        with pytest.raises(BadRequest, match="thresholds"):
            nutdamp.budget(STAGE, wrong)  # type: ignore[arg-type]
    with pytest.raises(BadRequest, match="largest"):
        nutdamp.budget(STAGE, largest=4.0)
    with pytest.raises(BadRequest, match="loop"):
        nutdamp.budget(replace(STAGE, loop=None), [(0.1, 0.05)])
