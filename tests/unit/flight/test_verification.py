"""``verify``: independent flights agree, differences are seen, the error budget names what costs."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import reference
from support.builders import spinner
from support.cases import spread
from support.process import Run

from nutdamp import basilisk, flight, planning
from nutdamp.basilisk import BasiliskFlight
from nutdamp.cli.root import group
from nutdamp.dop853 import integrate
from nutdamp.errors import MissingExtra
from nutdamp.files.examples import example_text
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.physics import attitude
from nutdamp.presentation.verify_tables import budget_note, conservation, verdict
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.schemes import Options
from nutdamp.spacecraft import Disturbance, Inertia, Limits, Spacecraft, Steerable
from nutdamp.verification import AGREE, AS_FLOWN, IDEAL, Conservation, Imperfection, Verification, verify

pytestmark = pytest.mark.usefixtures("plans_shared")

EXAMPLE = read_spacecraft(example_text(), "example.yaml")


def tilted() -> Spacecraft:
    """Three different moments, principal axes tilted from those of the file, and everything that can disturb."""
    cosine, sine = math.cos(0.1), math.sin(0.1)
    axes = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    return replace(
        EXAMPLE,
        inertia=Inertia((122.0, 118.0, 80.0), axes),
        disturbances=(Disturbance(0.02 + 0.01j), Disturbance(0.01j, rate=-1.0), Disturbance(0j, axial=0.01)),
        dissipation=900.0,
    )


@pytest.mark.deep
def test_dop853_in_the_axes_of_the_file_confirms_the_flight() -> None:
    for spacecraft in (EXAMPLE, tilted()):
        made = planning.plan(spacecraft, "two-pulse").pulses
        found = verify(spacecraft, made)
        dop853 = found.methods[2]
        assert max(dop853.axis or 1, dop853.momentum or 1, dop853.rate or 1) < 1e-11
        assert found.agree


def test_a_flight_of_another_body_does_not_agree() -> None:
    """The comparison can fail: DOP853 on a body 1 ppm heavier differs by more than AGREE."""
    made = planning.plan(EXAMPLE, "two-pulse").pulses
    heavier = replace(EXAMPLE, inertia=Inertia((120.00012, 120.00012, 80.0)))
    times = np.array([0.0, 5.0])
    (_, body), (_, other) = (integrate(one, made, times)[0] for one in (EXAMPLE, heavier))
    assert np.linalg.norm(body - other) > AGREE


@pytest.mark.deep
def test_basilisk_has_its_say_in_the_verdict(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A stand-in for Basilisk that flies another body, or another schedule, is named and turns the verdict."""
    plan = planning.plan(EXAMPLE, "two-pulse")

    def of(body: Spacecraft) -> Callable[[Spacecraft, Schedule, float], BasiliskFlight]:
        def fly(_: Spacecraft, made: Schedule, until: float) -> BasiliskFlight:
            times = np.unique([*np.linspace(0.0, until, 50), *(pulse.end for pulse in made)])
            return BasiliskFlight(times, *flight.flown(body, made, until).motion(times), 0.01)

        return fly

    monkeypatch.setattr(basilisk, "fly", of(EXAMPLE))
    found = verify(EXAMPLE, plan.pulses)
    assert found.agree
    assert found.checks == ("DOP853", "Basilisk")
    heavier = replace(EXAMPLE, inertia=Inertia((120.00012, 120.00012, 80.0)))
    monkeypatch.setattr(basilisk, "fly", of(heavier))
    found = verify(EXAMPLE, plan.pulses)
    assert found.disagreeing == ("Basilisk",)
    assert not found.agree
    assert verdict(found) == "The flown motion and Basilisk DO NOT AGREE (within 1e-09 rad)."
    with pytest.raises(SystemExit) as left:
        group.main(["verify", "--scheme", "two-pulse", "--quiet"], standalone_mode=False)
    assert left.value.code == 1
    assert "the flown motion and Basilisk do not agree" in capsys.readouterr().err


def test_the_impulse_sum_agrees_outside_the_pulses_in_its_rates() -> None:
    made = planning.plan(EXAMPLE, "four-pulse").pulses
    closed = verify(EXAMPLE, made).methods[0]
    assert closed.rate is not None
    assert closed.axis is not None
    assert closed.rate < 1e-14
    assert closed.axis > 1e-4  # H is off by the widths, which is what flown is for


def test_momentum_and_energy_keep_on_coasts_of_a_free_body() -> None:
    free = replace(tilted(), disturbances=(), dissipation=None)
    found = verify(free, planning.plan(free, "four-pulse").pulses)
    assert found.momentum.kept
    assert found.energy.kept
    assert found.momentum.drift < 1e-13
    assert found.energy.drift < 1e-13


def test_what_a_disturbance_does_to_momentum_and_energy_is_seen() -> None:
    """A pure spin under a torque about axis 3: |H| grows by M t, the energy as its square."""
    body = replace(EXAMPLE, omega0=np.array([0.0, 0.0, 3.0]), disturbances=(Disturbance(0j, axial=0.5),))
    found = verify(body, Schedule())
    after = 80.0 * 3.0 + 0.5 * body.inertial_period
    assert found.momentum.kept is found.energy.kept is None
    assert found.momentum.drift == pytest.approx(1.0 - 240.0 / after, rel=1e-9)
    assert found.energy.drift == pytest.approx(1.0 - (240.0 / after) ** 2, rel=1e-9)


def test_dissipation_takes_energy_and_leaves_the_momentum() -> None:
    body = replace(EXAMPLE, dissipation=20.0)
    found = verify(body, Schedule())
    end = flight.flown(body, Schedule(), body.inertial_period)
    rates, _ = end.motion(np.array([0.0, body.inertial_period]))
    before, after = (reference.energy(body.inertia.moments, one) for one in rates)
    assert found.momentum.kept, "dissipation is internal"
    assert found.momentum.drift < 1e-12
    assert found.energy.kept is None
    assert found.energy.changed == ("dissipation",)
    assert found.energy.drift == pytest.approx(1.0 - after / before, rel=1e-9)
    assert found.energy.drift > 1e-4


@pytest.mark.deep
def test_the_budget_names_each_imperfection_of_the_body() -> None:
    body = replace(tilted(), limits=Limits(tick=0.001))
    plan = planning.plan(body, "two-pulse")
    rows = {row.name: row for row in verify(body, plan.pulses, planning.unrounded(plan)).budget}
    assert list(rows) == [
        "none: ideal impulses",
        "pulse width",
        "command resolution",
        "disturbances",
        "all: as flown",
        "without I1 ≠ I2",
        "without dissipation",
    ]
    assert plan.flown is not None
    assert rows["all: as flown"].nutation == plan.flown.nutation


@pytest.mark.deep
def test_ideal_impulses_have_no_width_in_the_budget() -> None:
    body = spinner(steerable=Steerable())
    plans = [planning.plan(one, "one-pulse") for one in (body, EXAMPLE)]
    names = [[row.name for row in verify(one.spacecraft, one.pulses).budget] for one in plans]
    assert names[0] == [IDEAL, AS_FLOWN]
    assert names[1][:2] == [IDEAL, "pulse width"]


@pytest.mark.deep
def test_what_a_budget_row_says_is_what_that_imperfection_does() -> None:
    """On a plan that is exact for ideal impulses, each row alone is the flight with that imperfection alone."""
    ideal = read_spacecraft("name: X\ninertia: {A: 120, C: 80}\nstate: {spin: 3, nutation: 5 deg}\n", "x")
    body = replace(ideal, disturbances=(Disturbance(0.5 + 0j),), dissipation=300.0)
    made = planning.plan(ideal, "two-pulse").pulses
    rows = {row.name: row for row in verify(body, made).budget}
    alone = flight.flown(replace(ideal, disturbances=body.disturbances), made).residual
    damped = flight.flown(replace(body, disturbances=()), made).residual
    # Dissipation is part of what plans include: it acts in every row but the one without.
    assert rows["none: ideal impulses"].nutation == damped.nutation > 1e-5
    assert rows["without dissipation"].nutation < 1e-12
    assert rows["disturbances"].nutation == flight.flown(body, made).residual.nutation
    calm = {row.name: row for row in verify(replace(body, dissipation=None), made).budget}
    assert calm["none: ideal impulses"].nutation < 1e-12
    assert calm["disturbances"].nutation == alone.nutation > 1e-5


@pytest.mark.deep
@spread(
    ("changes", "scheme"),
    [
        ({"dissipation": 300.0}, "two-pulse"),
        ({"inertia": Inertia((122.0, 118.0, 80.0))}, "two-pulse"),
        ({"disturbances": (Disturbance(0.0j, axial=0.3),)}, "one-pulse"),
    ],
    quick=1,
)
def test_the_budget_of_a_plan_does_not_read_backwards(changes: dict[str, Any], scheme: str) -> None:
    """What the plan includes is in the ideal flight, which leaves next to nothing; without it the pulses miss."""
    body = replace(EXAMPLE, **changes)
    options = Options(with_disturbances=True)
    plan = planning.plan(body, scheme, options)
    rows = verify(body, plan.pulses, expected=options.with_disturbances).budget
    nutations = {row.name: row.nutation for row in rows}
    (missed,) = (left for name, left in nutations.items() if name.startswith("without"))
    assert missed > 100.0 * nutations["none: ideal impulses"]
    assert missed > 100.0 * nutations["all: as flown"]
    assert "disturbances" not in nutations


@pytest.mark.deep
def test_with_a_target_the_budget_is_of_the_distance_from_it(run: Run) -> None:
    screen = run("verify", "--scheme", "half-cone", "--target", "10deg,45deg", "--quiet").stdout
    budget = screen[screen.index("Error budget") :]
    assert re.search("^imperfection +nutation left +off the target$", budget, re.MULTILINE)
    assert re.search("^all: as flown +< 1e-9 +< 1e-9$", budget, re.MULTILINE)


def test_dissipation_keeps_the_momentum_and_drains_energy() -> None:
    body = replace(EXAMPLE, dissipation=600.0)
    rates, turn = integrate(body, Schedule(), np.array([0.0, 30.0]))
    momentum = attitude.rotate(turn, rates * body.inertia.moments)
    assert attitude.angle_between(momentum[0], momentum[1]) < 1e-12
    assert np.linalg.norm(momentum, axis=1) == pytest.approx(np.linalg.norm(momentum[0]), rel=1e-12)
    energy = rates**2 @ np.asarray(body.inertia.moments)
    assert energy[1] < energy[0]
    slopes = np.hypot(rates[:, 0], rates[:, 1]) / rates[:, 2]  # tan θ, but for a factor
    assert slopes[1] / slopes[0] == pytest.approx(math.exp(30 / 600), rel=1e-11)


@pytest.mark.weekly
@spread("moments", [(120.0, 120.0, 80.0), (80.0, 80.0, 120.0), (123.0, 117.0, 80.0)], quick=1, deep=2)
@spread("spin", [3.0, -3.0], quick=1, deep=2)
def test_dop853_by_the_torque_law_confirms_flights_with_dissipation(
    moments: tuple[float, float, float], spin: float
) -> None:
    """At 40 degrees of nutation, through real widths: exact arcs and series against the torque law."""
    body = replace(spinner(moments=moments, spin=spin, degrees=40.0), channels=EXAMPLE.channels, dissipation=60.0)
    pulses = [channel_pulse(EXAMPLE.channels[index], t, 0.8) for index, t in ((0, 2.0), (2, 21.0), (1, 50.0))]
    found = verify(body, Schedule(tuple(pulses)))
    dop853 = found.methods[2]
    assert max(dop853.axis or 1, dop853.momentum or 1, dop853.rate or 1) < 1e-10
    assert found.agree


@pytest.mark.weekly
def test_the_course_example_of_dissipation() -> None:
    """C = 1000, A = 2000 kg m², 60 rpm, ω_t = 0.10 rad/s, τ = 100 s: one law in both flights and in DOP853."""
    body = Spacecraft("x", Inertia((2000.0, 2000.0, 1000.0)), np.array([0.1, 0.0, 2 * math.pi]), dissipation=100.0)
    times = np.array([0.0, 50.0, 100.0, 200.0, 300.0, 345.0, 600.0])
    rates, _ = integrate(body, Schedule(), times)
    by_torque = np.degrees(np.arctan2(2.0 * np.hypot(rates[:, 0], rates[:, 1]), rates[:, 2]))
    assert by_torque[:-2] == pytest.approx([1.82, 3.00, 4.95, 13.24, 32.59], abs=0.005)
    assert by_torque[-2:] == pytest.approx([45.0, 85.5], abs=0.1)
    for fly in (flight.flown, flight.by_impulses):
        body_rates, _ = fly(body, Schedule(), 600.0).motion(times)
        angles = np.degrees(np.arctan2(2.0 * np.hypot(body_rates[:, 0], body_rates[:, 1]), body_rates[:, 2]))
        assert angles == pytest.approx(by_torque, abs=1e-9)


def test_verify_command_prints_both_tables(run: Run) -> None:
    done = run("verify", "--scheme", "two-pulse")
    assert done.returncode == 0
    for text in ("DOP853", "agree", "Error budget", "pulse width", "all: as flown"):
        assert text in done.stdout
    assert max(len(line.rstrip()) for line in done.stdout.splitlines()) <= 80


def test_verify_json_and_schedule_file(run: Run) -> None:
    run("plan", "--scheme", "one-pulse", "--csv", "pulses.csv")
    data = json.loads(run("verify", "--schedule", "pulses.csv", "--json", "-").stdout)
    assert data["agree"] is True
    assert [method["name"][:6] for method in data["methods"]] == ["impuls", "flown ", "DOP853", "Basili"]
    assert data["budget"][0]["imperfection"].startswith("none")


def test_verify_refuses_what_it_cannot_do(run: Run) -> None:
    assert run("verify", "--scheme", "two-pulse", "--schedule", "x.csv").returncode == 2
    assert run("verify", "--schedule", "missing.csv").returncode == 1


def test_a_motion_too_long_to_be_confirmed_is_not_called_confirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    """DOP853 had no end: it ran for as long as the motion did."""
    spacecraft = spinner(degrees=5.0)
    schedule = planning.plan(spacecraft, "one-pulse").pulses
    monkeypatch.setattr("nutdamp.dop853.EVALUATIONS", 50)
    monkeypatch.setattr("nutdamp.verification.basilisk.fly", _missing)
    found = verify(spacecraft, schedule)
    assert found.checks == ()
    assert not found.agree
    assert found.disagreeing == ()
    assert "more than 50 evaluations" in next(one.missing for one in found.methods if one.name.startswith("DOP853"))
    assert verdict(found).startswith("NOT CONFIRMED")
    (row,) = [one for one in found.methods if one.name.startswith("flown")]
    assert not row.missing


def _missing(*_: object) -> BasiliskFlight:
    raise MissingExtra("verify", "a flight by Basilisk")


@pytest.mark.weekly
def test_verify_of_what_cannot_be_confirmed_is_no_success(run: Run, tmp_path: Path) -> None:
    """Two thousand hours of coasting are more than DOP853 and Basilisk fly."""
    text = "name: X\ninertia: {A: 120, C: 80}\nstate: {spin: 3, nutation: 5 deg}\n"
    (tmp_path / "late.yaml").write_text(text + "limits: {horizon: 1e7, earliest: 8e6}\n")
    done = run("verify", "late.yaml", "--scheme", "one-pulse", "--json", "v.json")
    found = json.loads((tmp_path / "v.json").read_text())
    assert found["agree"] is None
    assert all(one["missing"] for one in found["methods"] if one["name"].startswith(("DOP853", "Basilisk")))
    assert done.returncode == 3
    assert "not confirmed" in done.stderr
    assert "NOT CONFIRMED" in done.stdout


@pytest.mark.parametrize(
    ("momentum", "energy", "changed", "said"),
    [
        (0.0, 0.0, (), "|H| and the energy are constant to the last digit."),
        (
            0.0,
            2.3e-15,
            (),
            "to the last digit, the energy is constant but for rounding (< 1e-12 of itself at most).",
        ),
        (
            3.1e-9,
            0.0,
            (),
            "|H| is NOT constant (3.1e-09 of itself at most), the energy is constant to the last digit.",
        ),
        (2e-13, 2e-4, ("dissipation",), "the energy is changed by dissipation (2.0e-04 of itself at most)."),
    ],
)
def test_what_is_conserved_is_no_number_of_noughts(
    momentum: float, energy: float, changed: tuple[str, ...], said: str
) -> None:
    """It read "at most 0.0e+00"."""
    found = Verification((), Conservation("|H|", momentum), Conservation("energy", energy, changed), ())
    assert said in conservation(found)
    assert found.drifting == (("|H|",) if momentum > AGREE else ())


@pytest.mark.parametrize(("ideal", "flown", "said"), [(1e-4, 1e-6, True), (1e-6, 1e-4, False), (1e-4, 1e-4, False)])
def test_ideal_impulses_that_leave_more_than_the_flown_pulses_are_explained(
    ideal: float, flown: float, said: bool
) -> None:
    rows = (
        Imperfection(IDEAL, 0.0, ideal, ideal),
        Imperfection("disturbances", 0.0, 0.0, 0.0),
        Imperfection(AS_FLOWN, 0.0, flown, flown),
    )
    kept = Conservation("|H|", 0.0, ())
    note = budget_note(Verification((), kept, kept, rows), aimed=False)
    rounded = (*rows[1:], Imperfection(IDEAL, 0.0, 0.0, 0.0), Imperfection("command resolution", ideal, 0.0, 0.0))
    alone = budget_note(Verification((), kept, kept, rounded), aimed=False)
    assert alone.startswith("With command resolution alone the pulses leave more nutation than as flown")
    assert note.startswith("As ideal impulses the pulses leave a larger shift of H than as flown") == said
    none = (Imperfection(IDEAL, 0.0, 0.0, 0.0), Imperfection(AS_FLOWN, 0.0, 0.0, 0.0))
    assert budget_note(Verification((), kept, kept, none), aimed=False).startswith("Nothing is imperfect here")
