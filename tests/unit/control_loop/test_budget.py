"""The budget of a loop: against long closed-loop flights, against what limits say, and what it
refuses.
"""

import cmath
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.builders import codes, noted, present, spinner
from support.cases import deep, spread
from support.golden import check_text, refused
from support.loops import fired_by, fires, follow_few_cycles, four, rad, turned

import nutdamp
from nutdamp.common import work
from nutdamp.control_loop.budget import (
    DAY,
    YEAR,
    Budget,
    Cycle,
    Cycles,
    HeldNutation,
    Thresholds,
    budget,
)
from nutdamp.control_loop.controller import Ending
from nutdamp.control_loop.evaluation import loop_of
from nutdamp.control_loop.law import Law
from nutdamp.control_loop.sensor import Estimator, Signal
from nutdamp.control_loop.simulation import fly
from nutdamp.control_loop.stability import Odds, Transfer, transfer
from nutdamp.errors import BadRequest, Infeasible
from nutdamp.figures.signals import budget_figure
from nutdamp.physics.thruster import Cold, Tank, Trapezoid
from nutdamp.planning.verdict import Status
from nutdamp.spacecraft.equipment import BANG, ONE_PULSE, Channel, Loop, Sensor
from nutdamp.spacecraft.model import Limits, Requirement, Spacecraft
from nutdamp.spacecraft.requirements import reached
from nutdamp.views.loop import _budget_notes

few_cycles = pytest.mark.usefixtures("_few_cycles")
"""Budgets follow few cycles, which is quick."""


@pytest.fixture
def _few_cycles(monkeypatch: pytest.MonkeyPatch) -> None:
    follow_few_cycles(monkeypatch)


def thrusters(
    torque: float = 6.0, least: float = 0.002, isp: float | None = 220.0
) -> tuple[Channel, ...]:
    return four(torque, least, isp=isp, thrust=torque)


def craft(tau: float = 100.0, **given: Any) -> Spacecraft:
    return fired_by(**{"degrees": 0.5, "channels": thrusters(), "dissipation": tau, **given})


def gyro(**given: Any) -> Sensor:
    return replace(Sensor(rate=10.0, noise=rad(0.004), delay=0.02), **given)


def loop(sensor: Sensor, start: float = 0.5, stop: float = 0.05, **given: Any) -> Loop:
    return fires(sensor, start, stop, **given)


VALVED = tuple(each.of(valve=Trapezoid(0.008, 0.012, 0.005, 0.01)) for each in thrusters())
STAGE = nutdamp.example("upper-stage")
STAGE_LOOP = present(STAGE.loop)
SEEN = replace(STAGE_LOOP.sensor, rate=10.0)
FILTERED = replace(SEEN, low_pass=0.1)

EXACT = {
    "continuous gyro": (craft(), loop(Sensor())),
    "continuous gyro, late": (craft(), loop(Sensor(delay=0.05), predict=False)),
    "nine samples a period": (craft(), loop(gyro(rate=0.9, noise=0.0))),
}
LONG = {
    "gyro": (craft(), loop(gyro())),
    "bias and steps": (craft(), loop(gyro(bias=rad(0.01), quantisation=rad(0.01)))),
    "late": (craft(), loop(gyro(), predict=False)),
    "low-pass filter": (craft(), loop(gyro(low_pass=0.3))),
    "bang": (craft(channels=thrusters(2.0, 0.05)), loop(gyro(), law=BANG, on_time=0.05)),
    "least on-time": (craft(channels=thrusters(6.0, 0.1)), loop(gyro(), 1.0, 0.02)),
    "one channel": (craft(channels=thrusters()[:1]), loop(gyro(), settle=1.0, min_interval=5.0)),
    "valves and ticks": (craft(channels=VALVED, limits=Limits(tick=0.004)), loop(gyro())),
    "one-pulse, reversed spin": (craft(spin=-3.0), loop(gyro(), law=ONE_PULSE)),
    "slender": (craft(C=20.0, tau=300.0), loop(gyro())),
    "grows by a third in a period": (craft(tau=25.0), loop(gyro(), 1.0, law=ONE_PULSE)),
    "accelerometer": (STAGE, replace(STAGE_LOOP, sensor=replace(SEEN, noise=0.004))),
    "accelerometer, filter": (STAGE, replace(STAGE_LOOP, sensor=replace(FILTERED, noise=0.01))),
}


def cycle_of(body: Spacecraft, made: Loop, **given: Any) -> Cycle:
    """The cycle in which most loops end that begin at the start threshold."""
    return Cycles(body, made, **given).attractors()[0][0]


def flown(body: Spacecraft, made: Loop, cycles: int, seeds: int) -> tuple[float, float, int]:
    """Pulses and impulse (N m s) a second between the first pauses and the last, and how many
    cycles that are.
    """
    until = (cycles / seeds + 4) / Cycles(body, made).attractors(0j, 8, 2)[0][0].cycles
    sums = np.zeros(4)
    for seed in range(1, seeds + 1):
        run = fly(body, made, until, seed=seed)
        first, last = run.quiet[1], run.quiet[-1]
        counted = [each.pulse.magnitude for each in run.fired if first < each.pulse.t <= last]
        sums += [len(counted), math.fsum(counted), last - first, len(run.quiet) - 2]
    return sums[0] / sums[2], sums[1] / sums[2], int(sums[3])


def check_budget(body: Spacecraft, made: Loop, cycles: int, seeds: int, least: int) -> None:
    """The cycle and long flights of at ``least`` so many cycles, to 2 %."""
    cycle = cycle_of(body, made)
    pulses, impulse, count = flown(body, made, cycles, seeds)
    assert count >= least
    assert (cycle.pulses, cycle.impulse) == pytest.approx((pulses, impulse), rel=0.02)


@spread("name", EXACT, quick=1, deep=2)
def test_a_budget_is_that_of_a_long_flight(name: str) -> None:
    """Of nine samples a period 24 cycles have 1.2 % fewer pulses than 200, 100 have 1.1 % more."""
    check_budget(*EXACT[name], 100, 1, 80)


@pytest.mark.weekly
@pytest.mark.parametrize("name", LONG)
def test_with_noise_a_budget_is_that_of_many_long_flights(name: str) -> None:
    """With noise the length of a cycle scatters by about 15 %: over 600 of them the mean is known
    to 0.6 %.
    """
    check_budget(*LONG[name], 600, 8, 400)


@pytest.mark.deep
def test_on_ticks_a_budget_is_that_of_flights_from_many_phases() -> None:
    """On ticks the length of a cycle scatters by 15 %, one by one: the mean of 12 times 40 is known
    to 0.7 %.
    """
    body = craft(spin=-3.0, limits=Limits(tick=0.004))
    made = loop(gyro(noise=0.0))
    rates = []
    for number in range(12):
        turned = complex(*body.omega0[:2]) * cmath.exp(2j * math.pi * number / 12)
        pulses, _, count = flown(
            body.replace(omega0=[turned.real, turned.imag, body.spin]), made, 40, 1
        )
        assert count >= 20
        rates.append(pulses)
    assert cycle_of(body, made).pulses == pytest.approx(np.mean(rates), rel=0.02)


@pytest.mark.weekly
def test_a_loop_below_the_noise_fires_without_end_as_often_as_one_that_is_flown() -> None:
    body = craft()
    made = loop(gyro(noise=rad(0.6)))
    cycle = cycle_of(body, made)
    assert cycle.pulses == pytest.approx(len(fly(body, made, 600.0).fired) / 600.0, rel=0.03)
    assert cycle.pulses * DAY > 1e5


@pytest.mark.deep
def test_without_a_stop_the_smallest_pulse_sets_the_limit_cycle() -> None:
    cycle = cycle_of(craft(channels=thrusters(6.0, 0.1)), loop(gyro(), 1.0, 0.0))
    assert cycle.high == pytest.approx(0.5 * math.atan(6.0 * 0.1 / (80.0 * 3.0)), rel=0.05)


@pytest.mark.weekly
@pytest.mark.parametrize(("degrees", "pauses"), [(2.0, True), (2.07, False)])
def test_of_two_limit_cycles_the_budget_is_of_the_one_that_the_loop_falls_into(
    degrees: float, pauses: bool
) -> None:
    """Pulses all alike, half of each above stop: what is left of the first nutation decides whether
    it ever pauses.
    """
    made = loop(gyro(noise=rad(0.002)), 1.0, 0.02, law=BANG, on_time=0.1)
    body = craft(tau=1000.0, channels=thrusters(least=0.1), degrees=degrees, loop=made)
    (held,) = budget(body).held
    assert held.cycle is not None
    assert (held.cycle.cycles > 0.0, present(held.other).cycles > 0.0) == (pauses, not pauses)
    run = fly(body, made, 6000.0, seed=2)
    assert bool(run.quiet) is pauses
    if not pauses:
        # 5,000 s, cut into tens, scatter by 5 %: their mean is known to 1.5 %.
        doubt = math.hypot(held.cycle.doubt, 0.015)
        later = sum(each.pulse.t > 1000.0 for each in run.fired)
        assert doubt < 0.025
        assert held.cycle.pulses == pytest.approx(later / 5000.0, rel=3.0 * doubt)
        assert present(held.other).pulses < 0.01 * held.cycle.pulses


CASES = Path(__file__).parents[2] / "cases"


@pytest.mark.deep
@pytest.mark.parametrize(
    ("name", "pulses"), [("budget-bistable", 3340.0), ("budget-never-quiet", 2151.0)]
)
@few_cycles
def test_a_budget_is_of_the_state_in_which_the_loop_of_the_file_ends(
    name: str, pulses: float
) -> None:
    """Never quiet, though loops at less nutation fall quiet: pulses a day of loops flown for 60,000
    s and 40,000 s.
    """
    made = nutdamp.budget(nutdamp.load(CASES / f"{name}.yaml"))
    (held,) = made.held
    assert (present(held.cycle).cycles, present(held.other).cycles > 0.0, held.share) == (
        0.0,
        True,
        1.0,
    )
    assert present(held.cycle).pulses * DAY == pytest.approx(pulses, rel=0.05)
    assert made.status is Status.NOT_ENOUGH
    assert loop_of(made.spacecraft, 2000.0).verdict.status is Status.NOT_ENOUGH


@pytest.mark.deep
def test_chains_that_change_over_are_told_by_their_share() -> None:
    """Nearly all fall quiet; one cycle in a thousand leaves what no pulse lowers, and they never do
    again: of 59 loops flown alone, over 404 cycles, none.
    """
    body = nutdamp.load(CASES / "budget-bistable.yaml")
    (quiet, most), (never, least) = Cycles(body, present(body.loop)).attractors(0j, 128, 17)
    assert (quiet.cycles > 0.0, never.cycles) == (True, 0.0)
    assert most + least == 1.0
    assert 1.0 / 128.0 <= least < 0.05


@pytest.mark.deep
def test_dissipation_slows_the_spin_as_in_flight() -> None:
    body = craft()
    made = loop(Sensor(delay=0.05), 5.0, 1.0, predict=False)
    cycle = cycle_of(body, made)
    run = fly(body, made, 6.0 / cycle.cycles)
    assert len(run.quiet) > 3
    spins = run.flight.motion(np.array(run.quiet[:4]))[0][:, 2]
    slows = cycle.spin_rate / cycle.cycles / body.spin
    assert np.diff(np.log(spins)).mean() == pytest.approx(slows, rel=0.03)
    assert slows < -0.004


def body_of(sensor: Sensor) -> Spacecraft:
    return STAGE if sensor.kind == "accelerometer" else craft()


TILTED = gyro(bias=0.001, scale=-1.1, low_pass=0.3, axes=turned(0.004, -0.003, 0.7)[:2])


@pytest.mark.parametrize("sensor", [gyro(bias=0.001), gyro(low_pass=0.3), TILTED, SEEN, FILTERED])
@pytest.mark.parametrize("predict", [True, False])
def test_what_is_seen_is_what_the_estimator_makes_of_samples(sensor: Sensor, predict: bool) -> None:
    body = body_of(sensor)
    body = replace(body, omega0=body.omega0 * [0.01, 0.01, 1.0])
    law = Law(body, loop(sensor, predict=predict))
    seen = transfer(law, body.spin)
    times = np.asarray(np.arange(400) * seen.step, dtype=np.float64)
    rates = fly(body, loop(sensor, 80.0), float(times[-1])).flight.motion(times)[0]
    estimator = Estimator(law, sensor, 0.0)
    shown = Signal(body, sensor, (1,)).shown(rates)
    true = rates[:, 0] + 1j * rates[:, 1]
    board = estimator.on_board(estimator.feed(times, shown, rates[:, 2]), rates[:, 2])
    first = int(np.argmax(~np.isnan(board)))
    assert first == math.ceil(seen.first / seen.step - 1e-6)
    assert np.abs(board - seen.mean(true))[first + 60 :].max() < 1e-3 * np.abs(true).max()


@pytest.mark.parametrize("sensor", [gyro(low_pass=0.3), SEEN, FILTERED])
def test_noise_is_what_the_estimator_makes_of_noise(sensor: Sensor) -> None:
    body = body_of(sensor)
    numbers = np.arange(20_000)
    law = Law(body, loop(sensor))
    spin = np.full(len(numbers), body.spin)
    seen = transfer(law, body.spin)
    estimator = Estimator(law, sensor, 0.0)
    still = np.zeros((len(numbers), 1 if sensor.kind == "accelerometer" else 2))
    values = Signal(body, sensor, (1,)).sampled(numbers, still)
    estimated = estimator.on_board(
        estimator.feed(np.asarray(numbers * seen.step), values, spin), spin
    )[200:]
    turn = np.exp(1j * float(law.rate(body.spin)) * seen.step)
    square = float((np.abs(estimated) ** 2).mean())
    assert math.sqrt(0.5 * square) == pytest.approx(seen.sigma, rel=0.05)
    lasting = complex((estimated[1:] * estimated[:-1].conj()).mean() * turn / square)
    assert 1.0 - lasting.real == pytest.approx(seen.fresh, rel=0.1)
    size = math.sqrt(square)
    # Of an accelerometer it counts the axis in which the sensor shows least.
    least = 0.95 * estimator.doubts.noise if sensor.kind == "gyro" else 0.0
    assert least < size < 1.05 * estimator.doubts.noise


@pytest.mark.parametrize(("sigma", "offset"), [deep(0.05, 0j), (0.3, 0j), (0.05, 0.2 + 0.1j)])
def test_the_odds_of_a_threshold_are_those_of_samples_drawn(sigma: float, offset: complex) -> None:
    """Growing z seen in white noise, sample by sample, until it first shows 1."""
    growth = 0.01
    rng = np.random.default_rng(5)
    seen = Transfer(
        0.1, np.ones(1, complex), 1.0 + 0j, 0j, offset, sigma, 1.0, (sigma, sigma), (0.0, 0.0), 0.0
    )
    sizes = 0.2 * np.exp(growth * seen.step * np.arange(3000))
    crossed = []
    for _ in range(400):
        noise = rng.normal(scale=sigma, size=(2, 3000))
        shown = (
            sizes * np.exp(1j * (0.3 * np.arange(3000) + rng.uniform(0.0, 7.0)))
            + offset
            + noise[0]
            + 1j * noise[1]
        )
        crossed.append(sizes[np.argmax(np.abs(shown) >= 1.0)])
    expected = Odds(seen, 1.0, growth).size(np.full(20_000, 0.2), rng.exponential(size=20_000))
    assert np.mean(crossed) == pytest.approx(float(expected.mean()), rel=0.01)
    assert np.std(crossed) == pytest.approx(float(expected.std()), rel=0.15)


def test_when_damping_must_begin_is_that_of_the_course_example() -> None:
    stage = replace(
        spinner(A=2000.0, C=1000.0), omega0=np.array([0.1, 0.0, 2.0 * math.pi]), dissipation=100.0
    )
    assert reached(stage, rad(32.59)) == pytest.approx(300.0, abs=0.05)
    assert reached(stage, stage.nutation) == 0.0
    oblate = replace(spinner(A=80.0, C=120.0, degrees=5.0), dissipation=100.0)
    assert reached(oblate, rad(1.0)) == pytest.approx(
        100.0 * math.log(math.tan(rad(5.0)) / math.tan(rad(1.0)))
    )
    assert reached(oblate, rad(6.0)) == 0.0
    assert reached(replace(stage, omega0=np.array([0.0, 0.0, 1.0])), 0.1) == math.inf


def held_by(body: Spacecraft) -> tuple[HeldNutation, Cycle]:
    (held,) = budget(body).held
    return held, present(held.cycle, held.why)


@few_cycles
def test_propellant_follows_from_impulse_and_isp() -> None:
    cycle = held_by(craft(loop=loop(gyro())))[1]
    assert cycle.propellant == pytest.approx(
        cycle.impulse / (220.0 * 9.80665), rel=1e-9
    )  # 1 m arms
    assert held_by(craft(channels=thrusters(isp=None), loop=loop(gyro())))[1].propellant is None


@pytest.mark.weekly
def test_a_tank_lasts_as_long_as_its_propellant() -> None:
    steady = replace(craft(loop=loop(gyro())), cold=Cold(0.5, 10.0), tank=Tank(2.0, 22e5, 8e5, 0.0))
    held, cycle = held_by(steady)
    assert held.lasts == pytest.approx(2.0 / present(cycle.propellant), rel=1e-9)
    falling = held_by(replace(steady, tank=Tank(2.0, 22e5, 8e5, 1.0)))[0]
    # Weaker than the law believes, a pulse leaves a good part of the nutation: more pulses for the
    # same impulse.
    assert present(falling.lasts) == pytest.approx(held.lasts, rel=0.6)
    assert present(falling.lasts) != pytest.approx(held.lasts, rel=0.01)
    half_full = cycle_of(steady, loop(gyro()), used=1.0)
    assert half_full.pulses == pytest.approx(cycle_of(steady, loop(gyro())).pulses, rel=1e-9)


def spent(*_: object) -> float:
    work.spend(work.CYCLES)
    raise Infeasible("spent")


def test_a_search_for_cycles_ends_with_its_budget_of_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a cycle nothing is known; with one the lifetime is that of its flow."""
    body = replace(craft(loop=loop(gyro())), tank=Tank(2.0, 22e5, 6e5, 1.0))
    monkeypatch.setattr("nutdamp.common.work.CYCLES", 0.5)
    assert budget(body).held[0].cycle is None
    check_text("budget.work-spent", budget(body).held[0].why)
    monkeypatch.undo()
    follow_few_cycles(monkeypatch)
    monkeypatch.setattr("nutdamp.control_loop.budget._lasts", spent)
    held = budget(body).held[0]
    assert held.lasts == pytest.approx(2.0 / (present(held.cycle).propellant or math.nan))


@pytest.mark.weekly
def test_a_tank_whose_pressure_falls_lasts_as_long_as_a_loop_flown_until_it_is_empty() -> None:
    body = replace(craft(degrees=0.4, loop=loop(gyro())), tank=Tank(0.15, 22e5, 8e5, 1.0))
    lasts = present(held_by(body)[0].lasts)
    run = fly(body, loop(gyro()), 1.2 * lasts, seed=3)
    assert (run.stop, len(run.fired) > 400) == (Ending.EMPTY, True)
    assert run.fired[-1].pulse.t - run.fired[0].pulse.t == pytest.approx(lasts, rel=0.02)


@few_cycles
def test_noise_above_a_tenth_of_start_widens_what_is_known() -> None:
    start = Law(craft(), loop(gyro())).size(rad(0.5), 3.0)
    for share, noisy in ((0.05, False), (0.2, True)):
        held, cycle = held_by(craft(loop=loop(gyro(noise=share * start))))
        assert (held.noisy, cycle.doubt >= 0.2) == (noisy, noisy)
        notes = list(_budget_notes(Budget(held.spacecraft, None, (held,))))
        assert ("start-noisy" in codes(notes)) is noisy
    check_text("budget.noisy", noted(notes))


@few_cycles
def test_pairs_of_thresholds_are_rows() -> None:
    body = craft(loop=loop(gyro()), requirement=Requirement(nutation=rad(0.6)))
    both = budget(body, [Thresholds(rad(0.5), rad(0.05)), Thresholds(rad(1.0), rad(0.05))])
    assert [held.meets_requirement for held in both.held] == [True, False]
    assert both.meets_requirement is True
    assert both.largest == rad(0.6)
    assert both.until_largest == pytest.approx(
        100.0 * math.log(math.tan(rad(0.6)) / math.tan(rad(0.5)))
    )
    wide = budget(body, [Thresholds(rad(1.0), rad(0.05))])
    assert wide.held[0].cycle == both.held[1].cycle
    assert wide.meets_requirement is False
    assert wide.held[0].begins == pytest.approx(
        100.0 * math.log(math.tan(rad(1.0)) / math.tan(rad(0.5)))
    )


@few_cycles
def test_what_cannot_be_held_says_why() -> None:
    weak, tense = craft(channels=thrusters(0.4)), craft(channels=thrusters(4.0))
    slow = loop(gyro(), 2.0, min_interval=10.0)
    budgets = [
        budget(replace(body, loop=made))
        for body, made in (
            (craft(), loop(gyro(), reversed=("+M1",))),
            (craft(), loop(gyro(scale=-1.0))),
            (craft(), loop(gyro(delay=2.0), predict=False)),
            (weak, slow),
            (tense, loop(gyro(), 2.0, min_interval=30.0, on_time=0.2)),
        )
    ]
    assert not any(made.feasible for made in budgets)
    check_text("budget.why", "\n".join(made.held[0].why for made in budgets))
    with refused(Infeasible, "budget.too-fast"):
        cycle_of(weak, slow)


def test_without_growth_nothing_is_held() -> None:
    oblate = budget(craft(A=80.0, C=120.0, loop=loop(gyro())))
    assert (oblate.held, oblate.feasible, oblate.meets_requirement) == ((), True, None)
    assert budget(craft()).held == ()  # no loop
    with refused(BadRequest, "budget.no-dissipation"):
        budget(replace(craft(), dissipation=None))


@few_cycles
def test_the_library_gives_what_the_command_writes() -> None:
    made = nutdamp.budget(STAGE, [(rad(0.5), rad(0.1))])
    (row,) = made.to_dict()["thresholds"]
    cycle = present(made.held[0].cycle)
    assert row["pulses_per_day"] == cycle.pulses * DAY
    assert row["propellant_kg_per_year"] == present(cycle.propellant) * YEAR
    wrong: list[Any] = [[(0.1, 0.2)], [(0.1,)], "0.1", [("a", "b")]]
    given: list[dict[str, Any]] = [{"thresholds": each} for each in wrong] + [{"largest": 4.0}]
    for number, options in enumerate(given):
        with refused(BadRequest, f"budget.library-{number}"):
            nutdamp.budget(STAGE, **options)
    with refused(BadRequest, "budget.library-no-loop"):
        nutdamp.budget(replace(STAGE, loop=None), [(0.1, 0.05)])


def test_the_picture_shows_what_is_held() -> None:
    """Hand-made cycles: the sawtooth rises from low to high at the growth of the body."""
    body = craft(requirement=Requirement(nutation=rad(2.0)), loop=loop(gyro()))
    cycles = [
        Cycle(each, 1e-3, 0.01, None, 0.0, 0.01, rad(0.5), rad(0.05), rad(0.6))
        for each in (1e-4, 1e-4)
    ]
    held = tuple(
        HeldNutation(body, Thresholds(rad(start), rad(0.1)), 100.0 * start, cycle=cycle)
        for start, cycle in zip((0.5, 1.0), cycles, strict=True)
    )
    lost = HeldNutation(body, Thresholds(rad(3.0), rad(0.1)), math.inf, why="a reason")
    (courses,) = budget_figure(Budget(body, rad(2.0), (*held, lost))).axes
    names = ["no firing", "0.500° to 0.100°", "1.00° to 0.100°", "largest allowed"]
    assert [str(line.get_label()) for line in courses.lines] == names
    free, first, second = (np.asarray(line.get_xydata()) for line in courses.lines[:3])
    assert courses.get_ylim()[1] > 2.0  # the largest nutation has its line
    hours = 3600.0 if courses.get_xlabel() == "time, hours" else 1.0
    size = 100.0 + 4.0 / 1e-3
    assert (free[0], free[-1, 0] * hours) == (pytest.approx([0.0, 0.5]), pytest.approx(size))
    grown = math.tan(rad(0.5)) * math.exp(body.growth * free[5, 0] * hours)
    assert free[5, 1] == pytest.approx(math.degrees(math.atan(grown)))
    assert first[:3, 1] == pytest.approx([0.05, 0.05, 0.5])
    assert first[0, 0] * hours == pytest.approx(50.0)
    ratio = math.tan(rad(0.5)) / math.tan(rad(0.05))
    assert second[:3, 0] * hours == pytest.approx(
        [100.0, 1100.0 - math.log(ratio) / body.growth, 1100.0]
    )
    (alone,) = budget_figure(Budget(replace(body, loop=None), None, ())).axes
    assert len(alone.lines) == 1
