"""Dispersed valves, cold nozzles and tanks: a case against the flight of a body that has them so."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
import pytest
from support.builders import channel, spinner
from support.golden import check_text
from support.single_case import flown_outputs

from nutdamp.files.reader import read_spacecraft
from nutdamp.flight.dynamics import supplied
from nutdamp.flight.propagation import flown
from nutdamp.montecarlo.cases import DispersedModel
from nutdamp.montecarlo.inputs import DrawSource, list_inputs
from nutdamp.montecarlo.propagated import ClosedForm, Ends, RealWidths
from nutdamp.montecarlo.study import Results, run, study_of
from nutdamp.physics.thruster import Cold, Measured, Tank, Trapezoid, Valve
from nutdamp.spacecraft.model import Requirement, Spacecraft
from nutdamp.spacecraft.schedule import Pulse, Schedule, on_command
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance
from nutdamp.views.tolerances import in_words, size_text

SLOW = Trapezoid(0.008, 0.012, 0.005, 0.010)
TABLE = Measured(((0.01, 0.008, 0.011), (0.05, 0.047, 0.036), (0.2, 0.198, 0.11)))
LATER = Measured(((0.01, 0.008, 0.016), (0.05, 0.047, 0.046), (0.2, 0.198, 0.16)))
"""With room for half the impulses again before the command."""

COLD = Cold(0.9, 4.0)
TORQUES = {"a": (8.0, 0.0, 0.1), "b": (-8.0, 0.0, 0.1), "c": (0.0, 8.0, 0.1)}


def through(valve: Valve, other: Valve | None = None, cold: Cold | None = None, tank: Tank | None = None) -> Spacecraft:
    """A body with this valve on its thrusters, and an ``other`` on the first of them."""
    channels = tuple(
        channel(name, *torque, min_on_time=0.02, max_on_time=0.09, isp=220.0, thrust=10.0).of(
            valve=other if other is not None and name == "a" else valve
        )
        for name, torque in TORQUES.items()
    )
    return replace(spinner(spin=math.pi, degrees=0.4, channels=channels), cold=cold, tank=tank)


def commands(body: Spacecraft, on_time: float = 0.06) -> list[Pulse]:
    """One of each thruster, at full pressure."""
    return [on_command(one, 1.0 + 0.7 * at, on_time) for at, one in enumerate(body.channels)]


def fires(body: Spacecraft, pulses: Iterable[Pulse]) -> Schedule:
    """The same commands to a body that may not be as they were made for."""
    channels = {one.name: one for one in body.channels}
    return Schedule(supplied(body, [on_command(channels[pulse.channel], *pulse.loaded) for pulse in pulses]))


def ends_of(fly: type[ClosedForm | RealWidths], model: DispersedModel, draws: Mapping[str, float]) -> Ends:
    return fly(model)(model.cases({name: np.full(2, draw) for name, draw in draws.items()}))


def nutation(fly: type[ClosedForm | RealWidths], model: DispersedModel, draws: Mapping[str, float]) -> float:
    """Of the case of these draws."""
    x, y, z = ends_of(fly, model, draws).momentum
    return float(np.arctan2(np.hypot(x, y), z)[0])


def table(valve: Measured, factor: float) -> Measured:
    return Measured(tuple((on_time, factor * acts, centroid) for on_time, acts, centroid in valve.rows))


CHANGES: dict[str, tuple[dict[str, float], Valve, Valve, Cold]] = {
    "opens late": ({"open_delay a": 0.002}, SLOW, replace(SLOW, open_delay=0.010), COLD),
    "opens early": ({"open_delay a": -0.003}, SLOW, replace(SLOW, open_delay=0.005), COLD),
    "closes late": ({"close_delay a": 0.002}, SLOW, replace(SLOW, close_delay=0.014), COLD),
    "opens as much later as it closes": (
        {"open_delay a": 0.004, "close_delay a": 0.004}, SLOW, replace(SLOW, open_delay=0.012, close_delay=0.016), COLD,
    ),
    "opens later than it closes": ({"open_delay a": 0.012}, SLOW, replace(SLOW, open_delay=0.020), COLD),
    "rises slowly": ({"rise_time a": 0.004}, SLOW, replace(SLOW, rise_time=0.009), COLD),
    "falls at once": ({"fall_time a": -0.010}, SLOW, replace(SLOW, fall_time=0.0), COLD),
    "all of it": (
        {"open_delay a": 0.003, "close_delay a": -0.002, "rise_time a": 0.040, "fall_time a": 0.005},
        SLOW, Trapezoid(0.011, 0.010, 0.045, 0.015), COLD,
    ),
    "larger bits": ({"impulse_bit a": 0.05}, TABLE, table(TABLE, 1.05), COLD),
    "half the bits again": ({"impulse_bit a": 0.5}, LATER, table(LATER, 1.5), COLD),
    "colder": ({"cold": -0.05}, SLOW, SLOW, Cold(0.85, 4.0)),
    "colder for longer": ({"cold": -0.05, "cold_pulses": 2.0}, SLOW, SLOW, Cold(0.85, 6.0)),
}  # fmt: skip


@pytest.mark.parametrize("change", CHANGES)
def test_a_case_is_the_flight_of_such_a_body(change: str) -> None:
    draws, valve, other, cold = CHANGES[change]
    body = through(valve, cold=COLD)
    model = DispersedModel(body, fires(body, commands(body)))
    true = through(valve, other, cold)
    expected = flown(true, fires(true, model.schedule)).residual.nutation
    assert abs(nutation(RealWidths, model, {"cold": 0.0}) - expected) > math.radians(1e-4)
    assert nutation(RealWidths, model, draws) == pytest.approx(expected, rel=1e-9)
    assert nutation(ClosedForm, model, draws) == pytest.approx(expected, rel=1e-5)
    assert flown_outputs(model, dict(draws))[0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("late", [-0.01, 0.01, 0.03, 0.05, 0.2])
def test_a_valve_that_opens_so_late_that_the_thrust_does_not_rise_or_there_is_none(late: float) -> None:
    slow = Trapezoid(0.02, 0.012, 0.05, 0.08)
    body = through(slow)
    model = DispersedModel(body, fires(body, commands(body)[:1]))
    true = through(slow, replace(slow, open_delay=0.02 + late))
    given = fires(true, model.schedule)
    assert (given.total_impulse == 0.0) == (late == 0.2)
    outputs = flown_outputs(model, {"open_delay a": late})
    assert outputs[0] == pytest.approx(flown(true, given).residual.nutation, rel=1e-9)
    assert outputs[4] == pytest.approx(given.propellant, rel=1e-9, abs=1e-15)


TANK = Tank(0.001, 22e5, 16e5, 1.0, ((8e5, 215.0), (30e5, 228.0)), inertia_per_kg=(3000.0, 3000.0, 1500.0))
TANKS: dict[str, tuple[dict[str, float], Tank]] = {
    "more pressure": ({"tank pressure": 1e5}, replace(TANK, pressure=23e5)),
    "falls further": ({"tank final_pressure": -2e5}, replace(TANK, final_pressure=14e5)),
    "less in it": ({"tank propellant": -0.0002}, replace(TANK, propellant=0.0008)),
    "other power": ({"tank exponent": 0.1, "tank pressure": -1e5}, replace(TANK, exponent=1.1, pressure=21e5)),
    "sheds more": ({"inertia_per_kg": 0.2}, replace(TANK, inertia_per_kg=(3600.0, 3600.0, 1800.0))),
}


@pytest.mark.parametrize("change", TANKS)
def test_a_case_of_another_tank_is_the_flight_of_such_a_body(change: str) -> None:
    """The file gives the thrust at its own pressure: at another one all pulses are stronger or weaker."""
    draws, other = TANKS[change]
    body = through(SLOW, tank=TANK)
    model = DispersedModel(body, fires(body, commands(body)))
    higher = (other.pressure / TANK.pressure) ** other.exponent
    stronger = (one.of(torque=higher * one.torque, thrust=higher * 10.0) for one in body.channels)
    true = replace(body, channels=tuple(stronger), tank=other)
    given = fires(true, model.schedule)
    expected = flown(true, given).residual.nutation
    nominal = flown(body, model.schedule).residual.nutation
    assert nutation(RealWidths, model, {"tank pressure": 0.0}) == pytest.approx(nominal, abs=1e-6)
    assert abs(expected - nominal) > math.radians(1e-4)
    # Half of what a ramp takes off the moments counts as it begins: of second order.
    assert nutation(RealWidths, model, draws) == pytest.approx(expected, abs=1e-6)
    # A pulse falls as the nominal one does, whatever the tank of the case: of second order, too.
    own = flown_outputs(model, dict(draws))
    assert own[0] == pytest.approx(expected, abs=2e-7)
    assert own[4] == pytest.approx(given.propellant, rel=1e-9)


STEADY = replace(TANK, exponent=0.0, isp=None, inertia_per_kg=None)
"""A tank that is all the same until it is empty."""


@pytest.mark.parametrize("short", [0.3, 0.7, 1.2])
def test_with_an_empty_tank_nothing_fires_any_more(short: float) -> None:
    """A case is the flight of the pulses that the propellant goes round for, the last of them weakened."""
    body = through(SLOW)
    pulses = commands(body)
    each = pulses[0].propellant or math.nan
    model = DispersedModel(replace(body, tank=replace(STEADY, propellant=3.0 * each)), Schedule(tuple(pulses)))
    draws, (whole, part) = {"tank propellant": -short * each}, divmod(3.0 - short, 1.0)
    weak = pulses[int(whole)]
    assert weak.torque is not None
    weak = replace(weak, torque=part * weak.torque, impulse=part * weak.impulse)
    expected = flown(body, Schedule((*pulses[: int(whole)], weak))).residual.nutation
    assert nutation(RealWidths, model, {"tank pressure": 0.0}) != pytest.approx(expected, rel=1e-2)
    assert nutation(RealWidths, model, draws) == pytest.approx(expected, rel=1e-9)
    assert nutation(ClosedForm, model, draws) == pytest.approx(expected, rel=1e-5)
    assert ends_of(ClosedForm, model, draws).drained == pytest.approx(3.0 / (3.0 - short), rel=1e-9)
    assert flown_outputs(model, draws)[[0, 4]] == pytest.approx([expected, (3.0 - short) * each], rel=1e-9)


def test_what_a_schedule_takes_beyond_the_tank_does_not_fire() -> None:
    body = through(SLOW)
    pulses = commands(body)
    each = pulses[0].propellant or math.nan
    given = supplied(replace(body, tank=replace(STEADY, propellant=1.5 * each)), pulses)
    for share, one, whole in zip((1.0, 0.5, 0.0), given, pulses, strict=True):
        assert one.propellant == pytest.approx(share * each, rel=1e-9)
        assert one.impulse == pytest.approx(share * whole.impulse, rel=1e-9)


def test_cases_whose_tank_runs_empty_are_counted_and_do_not_comply() -> None:
    pulses = commands(through(SLOW))[:1]
    used = pulses[0].propellant or math.nan
    body = replace(
        through(SLOW, tank=replace(STEADY, propellant=1.1 * used)),
        requirement=Requirement(nutation=math.radians(5.0)),
        dispersions=Dispersions(tank_propellant=Tolerance("uniform", 0.2, relative=True)),
    )
    study = study_of(body, Schedule(supplied(body, pulses)), seed=3)
    results = run(Results(study, 3000))
    empty = np.flatnonzero(study.source().block(0)[0]["tank propellant"][:3000] < -0.1 * used)  # type: ignore[index]
    assert results.emptied == len(empty)
    assert 0.15 < results.emptied / 3000 < 0.35
    assert results.met == 3000 - results.emptied
    assert set(results.worst.cases[: results.emptied].tolist()) == set(empty.tolist())


def test_no_case_is_left_without_a_body_when_the_tank_is_empty() -> None:
    """Moments less all of the propellant: drawn again where no rigid body has them."""
    shed = np.array([9000.0, 9000.0, 6500.0])  # 80 kg m² less 65
    body = replace(
        through(SLOW, tank=replace(TANK, propellant=0.01, inertia_per_kg=tuple(shed.tolist()))),
        dispersions=Dispersions(inertia_per_kg=Tolerance("normal", 0.15, relative=True)),
    )
    model = study_of(body, fires(body, commands(body)[:1])).model
    draws, redrawn = DrawSource(model.inputs.drawn, 3, model.physical).block(0)
    left = np.array([[120.0], [120.0], [80.0]]) - 0.01 * np.outer(shed, 1.0 + np.asarray(draws["inertia_per_kg"]))
    assert len(redrawn) > 100
    assert np.all(left > 0.0)
    assert np.all(left[2] <= 2.0 * left[0])


FILE = """\
name: Sat
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 0.4 deg, phase: 40 deg}
thrusters:
  - {name: a, torque: [8, 0, 0], lever_arm: 0.8, isp: 220, min_on_time: 20 ms, max_on_time: 90 ms}
  - {name: b, torque: [-8, 0, 0], lever_arm: 0.8, isp: 220, impulse_bit: [[20 ms, 0.15, 16 ms], [90 ms, 0.8, 60 ms]]}
  - {name: c, torque: [0, 8, 0], lever_arm: 0.8, isp: 220, min_on_time: 20 ms, max_on_time: 90 ms}
valve: {open_delay: 8 ms, close_delay: 12 ms, rise_time: 5 ms, fall_time: 10 ms}
"""
ALL_VALVES = (
    "open_delay: {normal: 1 ms}, close_delay: {a: {uniform: 2 ms}, c: {normal: 1 ms}}, impulse_bit: {normal: 3 %}"
)


def craft(dispersions: str, more: str = "") -> Spacecraft:
    return read_spacecraft(f"{FILE}{more}dispersions: {{{dispersions}}}\n", "sat.yaml")


def test_the_few_draws_below_zero_are_drawn_again() -> None:
    body = craft("open_delay: {a: {normal: 2.6 ms}}")
    model = DispersedModel(body, fires(body, commands(body)[:1]))
    draws, redrawn = DrawSource(model.inputs.drawn, 3, model.physical).block(0)
    assert len(redrawn) > 0
    assert float(np.min(draws["open_delay a"])) >= -0.008


def test_what_is_drawn_and_what_touches_nothing() -> None:
    body = craft(f"{ALL_VALVES}, cold: {{normal: 2 %}}", "cold: {first: 90 %, pulses: 4}\n")
    drawn, unused = list_inputs(body, fires(body, commands(body)))
    names = "open_delay a, open_delay c, close_delay a, close_delay c, impulse_bit b, cold"
    assert ", ".join(one.name for one in drawn) == names
    warm = craft("cold: {normal: 2 %}")
    unused += list_inputs(warm, fires(warm, commands(warm))).unused
    check_text("montecarlo.unused-valves", "\n".join(f"{one.name}: {one.reason}" for one in unused))


def test_a_study_spreads_as_its_valves_do() -> None:
    """Of a single pulse along ω the nutation is off by the impulse: one sigma of it is that of the draws."""
    body = craft("close_delay: {a: {normal: 1 ms}}")
    made = fires(body, commands(body, 0.05)[:1])
    spread = run(Results(study_of(body, made, seed=3), 4000)).distribution("nutation")
    early, late = (nutation(RealWidths, DispersedModel(body, made), {"close_delay a": one}) for one in (-0.001, 0.001))
    assert spread is not None
    low, high = spread.quantiles(np.array([0.1587, 0.8413]))
    assert high - low == pytest.approx(abs(late - early), rel=0.05)


def test_bare_numbers_are_dispersed_and_shown_in_parts_of_their_own_values() -> None:
    more = "cold: {first: 90 %, pulses: 4}\n"
    more += "tank: {propellant: 2, pressure: 22 bar, final_pressure: 16 bar, exponent: 1.2}\n"
    for line, nominal, shown in (
        ("cold: {normal: 2 %}", 0.9, "2 %"),
        ("cold_pulses: {uniform: 10 %}", 4.0, "5.77 %"),
        ("tank_exponent: {bias: 5 %}", 1.2, "5 %"),
        ("tank_final_pressure: {normal: 0.5 bar}", 16e5, "0.5 bar"),
    ):
        body = craft(line, more)
        model = DispersedModel(body, fires(body, commands(body)[:1]))
        (entry,) = model.inputs.drawn
        assert entry.nominal == pytest.approx(nominal)
        assert size_text(entry) == shown
        assert in_words(entry.name) == line.partition(":")[0].replace("_", " ")
        assert model.physical({entry.name: np.array([-1.001 * nominal])}) == [False]
