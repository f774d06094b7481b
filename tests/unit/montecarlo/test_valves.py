"""Dispersed valves and cold nozzles: a case against the flight of a body that has them so."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.builders import channel, spinner
from support.cases import spread
from support.single_case import flown_outputs

from nutdamp import planning
from nutdamp.dispersion import study_of
from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.draws import Source
from nutdamp.dispersion.flown import RealWidths
from nutdamp.dispersion.inputs import list_inputs
from nutdamp.dispersion.kernel import ClosedForm
from nutdamp.dispersion.study import Results, run
from nutdamp.errors import FaultyFile
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.flight import flown
from nutdamp.physics.feed import Cold, Tank
from nutdamp.physics.valve import Measured, Trapezoid, Valve
from nutdamp.presentation.tolerance_tables import in_words, size_text
from nutdamp.schedule import Pulse, Schedule, on_command
from nutdamp.spacecraft import Requirement, Spacecraft
from nutdamp.supply import supplied
from nutdamp.tolerances import Dispersions, Tolerance

SLOW = Trapezoid(0.008, 0.012, 0.005, 0.010)
TABLE = Measured(((0.01, 0.008, 0.011), (0.05, 0.047, 0.036), (0.2, 0.198, 0.11)))
LATER = Measured(((0.01, 0.008, 0.016), (0.05, 0.047, 0.046), (0.2, 0.198, 0.16)))
"""With room for half the impulses again before the command."""

COLD = Cold(0.9, 4.0)

BODY = spinner(
    spin=math.pi,
    degrees=0.4,
    channels=tuple(
        channel(name, *torque, min_on_time=0.02, max_on_time=0.09, isp=220.0, thrust=10.0)
        for name, torque in {"a": (8.0, 0.0, 0.1), "b": (-8.0, 0.0, 0.1), "c": (0.0, 8.0, 0.1)}.items()
    ),
)


def through(valve: Valve, of: str = "", other: Valve | None = None) -> Spacecraft:
    """The body with this valve on its thrusters, and an ``other`` on one of them."""
    channels = []
    for one in BODY.channels:
        mounted = other if one.name == of else valve
        channels.append(replace(one, thrusters=tuple(replace(thruster, valve=mounted) for thruster in one.thrusters)))
    return replace(BODY, channels=tuple(channels), cold=COLD)


def refired(body: Spacecraft, made: Schedule) -> Schedule:
    """The same commands to a body that is not as it was planned for."""
    channels = {one.name: one for one in body.channels}
    return Schedule(supplied(body, (on_command(channels[pulse.channel], *pulse.loaded) for pulse in made)))


def nutation(model: Model, draws: dict[str, float]) -> float:
    """Of the case of these draws."""
    ends = RealWidths(model)(model.cases({name: np.full(2, draw) for name, draw in draws.items()}))
    return float(np.arctan2(np.hypot(*ends.momentum[:2]), ends.momentum[2])[0])


CHANGES: dict[str, tuple[dict[str, float], Valve, Valve, Cold]] = {
    "opens late": ({"open_delay a": 0.002}, SLOW, replace(SLOW, open_delay=0.010), COLD),
    "opens early": ({"open_delay a": -0.003}, SLOW, replace(SLOW, open_delay=0.005), COLD),
    "closes late": ({"close_delay a": 0.002}, SLOW, replace(SLOW, close_delay=0.014), COLD),
    "larger bits": (
        {"impulse_bit a": 0.05},
        TABLE,
        Measured(tuple((on_time, 1.05 * acts, centroid) for on_time, acts, centroid in TABLE.rows)),
        COLD,
    ),
    "opens as much later as it closes": (
        {"open_delay a": 0.004, "close_delay a": 0.004},
        SLOW,
        replace(SLOW, open_delay=0.012, close_delay=0.016),
        COLD,
    ),
    "opens later than it closes": ({"open_delay a": 0.012}, SLOW, replace(SLOW, open_delay=0.020), COLD),
    "rises slowly": ({"rise_time a": 0.004}, SLOW, replace(SLOW, rise_time=0.009), COLD),
    "falls at once": ({"fall_time a": -0.010}, SLOW, replace(SLOW, fall_time=0.0), COLD),
    "all of it": (
        {"open_delay a": 0.003, "close_delay a": -0.002, "rise_time a": 0.040, "fall_time a": 0.005},
        SLOW,
        Trapezoid(0.011, 0.010, 0.045, 0.015),
        COLD,
    ),
    "half the bits again": (
        {"impulse_bit a": 0.5},
        LATER,
        Measured(tuple((on_time, 1.5 * acts, centroid) for on_time, acts, centroid in LATER.rows)),
        COLD,
    ),
    "colder": ({"cold": -0.05}, SLOW, SLOW, Cold(0.85, 4.0)),
    "colder for longer": ({"cold": -0.05, "cold_pulses": 2.0}, SLOW, SLOW, Cold(0.85, 6.0)),
}


@pytest.mark.parametrize("late", [-0.01, 0.01, 0.03, 0.05, 0.2])
def test_a_valve_that_opens_so_late_that_the_thrust_does_not_rise_or_there_is_none(late: float) -> None:
    slow = Trapezoid(0.02, 0.012, 0.05, 0.08)
    body = replace(through(slow), cold=None)
    made = planning.plan(body, "one-pulse").pulses
    (fired,) = {pulse.channel for pulse in made}
    outputs = flown_outputs(Model(body, made), {f"open_delay {fired}": late})
    true = replace(through(slow, fired, replace(slow, open_delay=0.02 + late)), cold=None)
    given = refired(true, made)
    assert (given.total_impulse == 0.0) == (late == 0.2)
    assert outputs[0] == pytest.approx(flown(true, given).residual.nutation, rel=1e-9)
    assert outputs[4] == pytest.approx(given.propellant, rel=1e-9, abs=1e-15)


@spread("change", CHANGES, quick=1)
def test_a_case_is_the_flight_of_such_a_body(change: str) -> None:
    draws, valve, other, cold = CHANGES[change]
    body = through(valve)
    made = planning.plan(body, "optimal").pulses
    model = Model(body, made)
    nominal, found = nutation(model, {"cold": 0.0}), nutation(model, draws)
    true = replace(through(valve, "a", other), cold=cold)
    expected = flown(true, refired(true, made)).residual.nutation
    assert nominal < math.radians(1e-6)
    assert expected > math.radians(1e-4)
    assert found == pytest.approx(expected, rel=1e-9)
    assert flown_outputs(model, dict(draws))[0] == pytest.approx(found, rel=1e-9)
    by_sum = ClosedForm(model)(model.cases({name: np.full(2, draw) for name, draw in draws.items()}))
    assert np.arctan2(np.hypot(*by_sum.momentum[:2]), by_sum.momentum[2])[0] == pytest.approx(
        expected, rel=1e-5, abs=1e-9
    )


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
    body = replace(through(SLOW), cold=None, tank=TANK)
    made = planning.plan(body, "one-pulse").pulses
    model = Model(body, made)
    higher = (other.pressure / TANK.pressure) ** other.exponent
    channels = tuple(
        replace(
            one,
            thrusters=tuple(replace(each, torque=higher * each.torque, thrust=higher * 10.0) for each in one.thrusters),
        )
        for one in body.channels
    )
    true = replace(body, channels=channels, tank=other)
    given = refired(true, made)
    expected = flown(true, given).residual.nutation
    assert nutation(model, {"tank pressure": 0.0}) == pytest.approx(flown(body, made).residual.nutation, abs=1e-6)
    assert expected > math.radians(1e-5)
    # Half of what a ramp takes off the moments counts as it begins: of second order.
    assert nutation(model, draws) == pytest.approx(expected, rel=1e-3, abs=1e-6)
    outputs = flown_outputs(model, dict(draws))
    assert outputs[0] == pytest.approx(expected, rel=1e-9)
    assert outputs[4] == pytest.approx(given.propellant, rel=1e-12)


LAST = replace(TANK, exponent=0.0, isp=None, inertia_per_kg=None)
"""A tank that is all the same until it is empty."""


def weaker(pulse: Pulse, factor: float) -> Pulse:
    """So many times as strong."""
    assert pulse.torque is not None
    return replace(pulse, torque=factor * pulse.torque, impulse=factor * pulse.impulse)


@pytest.mark.parametrize("short", [0.3, 0.7, 1.2])
def test_with_an_empty_tank_nothing_fires_any_more(short: float) -> None:
    """A case is the flight of the pulses that the propellant goes round for, the last of them weakened."""
    body = replace(through(SLOW), cold=None)
    one, two, three = (on_command(body.channels[at], 1.0 + 0.7 * at, 0.06) for at in (0, 1, 2))
    each = one.propellant
    assert each is not None
    body = replace(body, tank=replace(LAST, propellant=3.0 * each))
    model = Model(body, Schedule((one, two, three)))
    draws = {"tank propellant": -short * each}
    whole, part = divmod(3.0 - short, 1.0)
    left = [*(one, two, three)[: int(whole)], weaker((one, two, three)[int(whole)], part)]
    expected = flown(replace(body, tank=None), Schedule(tuple(left))).residual.nutation
    assert nutation(model, {}) != pytest.approx(expected, rel=1e-2)
    assert nutation(model, draws) == pytest.approx(expected, rel=1e-9)
    ends = ClosedForm(model)(model.cases({"tank propellant": np.full(2, -short * each)}))
    assert np.arctan2(np.hypot(*ends.momentum[:2]), ends.momentum[2])[0] == pytest.approx(expected, rel=1e-5)
    assert ends.drained == pytest.approx(3.0 / (3.0 - short), rel=1e-9)
    assert flown_outputs(model, draws)[[0, 4]] == pytest.approx([expected, (3.0 - short) * each], rel=1e-9)


def test_what_a_schedule_takes_beyond_the_tank_does_not_fire() -> None:
    body = replace(through(SLOW), cold=None)
    pulses = [on_command(body.channels[at], 1.0 + 0.7 * at, 0.06) for at in (0, 1, 2)]
    each = pulses[0].propellant
    assert each is not None
    given = supplied(replace(body, tank=replace(LAST, propellant=1.5 * each)), pulses)
    assert [one.propellant for one in given] == pytest.approx([each, 0.5 * each, 0.0], rel=1e-9)
    for share, one, whole in zip((1.0, 0.5, 0.0), given, pulses, strict=True):
        assert one.impulse == pytest.approx(share * whole.impulse, rel=1e-9)


def test_cases_whose_tank_runs_empty_are_counted_and_do_not_comply() -> None:
    body = replace(through(SLOW), cold=None, requirement=Requirement(nutation=math.radians(5.0)))
    fires = Schedule((on_command(body.channels[0], 1.0, 0.06),))
    used = fires.propellant
    assert used is not None
    wide = Dispersions(tank_propellant=Tolerance("uniform", 0.2, relative=True))
    body = replace(body, tank=replace(LAST, propellant=1.1 * used), dispersions=wide)
    study = study_of(body, Schedule(supplied(body, fires)), seed=3)
    results = run(Results(study, 3000))
    tanks = 1.1 * used + study.source().block(0)[0]["tank propellant"][:3000]  # type: ignore[index]
    assert results.emptied == np.count_nonzero(tanks < used)
    assert 0.15 < results.emptied / 3000 < 0.35
    assert results.met == 3000 - results.emptied
    assert set(results.worst.cases[: results.emptied].tolist()) == set(np.flatnonzero(tanks < used).tolist())


@pytest.mark.parametrize(
    ("tolerance", "problem"),
    [
        ("open_delay: {normal: 3 ms}", "draws beyond three sigma would make the open_delay of a, 0.008 s, negative"),
        ("close_delay: {uniform: 13 ms}", "draws would make the close_delay of a, 0.012 s, negative"),
        ("rise_time: {a: {triangular: 6 ms}}", "draws would make the rise_time of a, 0.005 s, negative"),
        ("fall_time: {c: {bias: -11 ms}}", "draws would make the fall_time of c, 0.01 s, negative"),
        ("tank_pressure: {uniform: 7 bar}", "draws would make tank.pressure, 22 bar, less than final_pressure, 16 bar"),
        (
            "tank_pressure: {normal: 10 %}",
            "draws beyond three sigma would make tank.pressure, 22 bar, less than final_pressure, 16 bar",
        ),
        ("tank_final_pressure: {uniform: 17 bar}", "draws would make tank.final_pressure, 16 bar, negative"),
        ("tank_propellant: {normal: 40 %}", "draws beyond three sigma would make tank.propellant, 2 kg, negative"),
        ("tank_propellant: {normal: 51 %}", "of at most 50 %"),
    ],
)
def test_draws_that_make_a_number_negative_are_refused_where_they_are_written(tolerance: str, problem: str) -> None:
    tank = "tank: {propellant: 2 kg, pressure: 22 bar, final_pressure: 16 bar}\n"
    with pytest.raises(FaultyFile) as caught:
        read_spacecraft(FILE + tank + f"dispersions:\n  {tolerance}\n", "sat.yaml")
    (fault,) = caught.value.faults
    assert fault.where.startswith(f"dispersions.{tolerance.partition(':')[0]}")
    assert problem in fault.problem


def test_the_few_draws_below_zero_are_drawn_again() -> None:
    body = read_spacecraft(FILE + "dispersions: {open_delay: {a: {normal: 2.6 ms}}}\n", "sat.yaml")
    fires = Schedule((on_command(body.channels[0], 1.0, 0.05),))
    study = study_of(body, fires, seed=3)
    draws, redrawn = Source(study.model.inputs.drawn, 3, study.model.physical).block(0)
    assert len(redrawn) > 0
    assert float(np.min(draws["open_delay a"])) >= -0.008


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

TOLERANCES = """\
dispersions:
  open_delay: {normal: 1 ms}
  close_delay: {a: {uniform: 2 ms}, c: {normal: 1 ms}}
  impulse_bit: {normal: 3 %}
  cold: {normal: 2 %}
"""


def test_what_is_drawn_and_what_touches_nothing() -> None:
    body = read_spacecraft(FILE + "cold: {first: 90 %, pulses: 4}\n" + TOLERANCES, "sat.yaml")
    fires = Schedule(tuple(on_command(one, 1.0 + number, 0.05) for number, one in enumerate(body.channels)))
    drawn, unused = list_inputs(body, fires)
    assert [one.name for one in drawn] == [
        "open_delay a",
        "open_delay c",
        "close_delay a",
        "close_delay c",
        "impulse_bit b",
        "cold",
    ]
    assert {one.name: one.reason for one in unused} == {
        "open_delay b": "b has no valve",
        "impulse_bit a": "a has no impulse_bit",
        "impulse_bit c": "c has no impulse_bit",
    }
    warm = read_spacecraft(FILE + TOLERANCES, "sat.yaml")
    assert any(one.reason == "the file has no cold nozzles" for one in list_inputs(warm, fires).unused)


def test_a_study_spreads_as_its_valves_do() -> None:
    """Of a single pulse along ω the nutation is off by the impulse: one sigma of it is that of the draws."""
    body = read_spacecraft(FILE + "dispersions: {close_delay: {a: {normal: 1 ms}}}\n", "sat.yaml")
    fires = Schedule((on_command(body.channels[0], 1.0, 0.05),))
    found = run(Results(study_of(body, fires, seed=3), 4000)).distribution("nutation")
    slope = [nutation(Model(body, fires), {"close_delay a": late}) for late in (-0.001, 0.001)]
    assert found is not None
    low, high = found.quantiles(np.array([0.1587, 0.8413]))
    assert high - low == pytest.approx(abs(slope[1] - slope[0]), rel=0.05)


def test_no_case_is_left_without_a_body_when_the_tank_is_empty() -> None:
    """Moments less all of the propellant: drawn again where no rigid body has them."""
    fires = Schedule((on_command(through(SLOW).channels[0], 1.0, 0.05),))
    shed = replace(TANK, propellant=0.01, inertia_per_kg=(9000.0, 9000.0, 6500.0))  # 80 kg m² less 65
    body = replace(
        through(SLOW), tank=shed, dispersions=Dispersions(inertia_per_kg=Tolerance("normal", 0.15, relative=True))
    )
    model = study_of(body, Schedule(supplied(body, fires))).model
    (entry,) = model.inputs.drawn
    draws, redrawn = Source((entry,), 3, model.physical).block(0)
    left = np.array([[120.0], [120.0], [80.0]]) - 0.01 * np.outer(
        shed.inertia_per_kg or (), 1.0 + np.asarray(draws["inertia_per_kg"])
    )
    assert len(redrawn) > 100
    assert np.all(left > 0.0)
    assert np.all(left[2] <= 2.0 * left[0])


@pytest.mark.parametrize(
    ("line", "nominal", "shown"),
    [
        ("cold: {normal: 2 %}", 0.9, "2 %"),
        ("cold_pulses: {uniform: 10 %}", 4.0, "5.77 %"),
        ("tank_exponent: {bias: 5 %}", 1.2, "5 %"),
        ("tank_final_pressure: {normal: 0.5 bar}", 16e5, "0.5 bar"),
    ],
)
def test_bare_numbers_are_dispersed_and_shown_in_parts_of_their_own_values(
    line: str, nominal: float, shown: str
) -> None:
    tank = "tank: {propellant: 2, pressure: 22 bar, final_pressure: 16 bar, exponent: 1.2}\n"
    cold = "cold: {first: 90 %, pulses: 4}\n"
    body = read_spacecraft(FILE + cold + tank + f"dispersions: {{{line}}}\n", "sat.yaml")
    fires = Schedule((on_command(body.channels[0], 1.0, 0.05),))
    (entry,) = list_inputs(body, fires).drawn
    assert entry.nominal == pytest.approx(nominal)
    assert size_text(entry) == shown
    assert in_words(entry.name) == line.partition(":")[0].replace("_", " ")
    assert Model(body, fires).physical({entry.name: np.array([-1.001 * nominal])}) == [False]
