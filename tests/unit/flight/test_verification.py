"""``verify``: independent flights agree, differences are seen,
the error budget names what costs.
"""

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
from support.builders import documented, present, spinner
from support.cases import spread
from support.golden import check_text
from support.places import case
from support.process import Planner, Run

from nutdamp.cli.main import group
from nutdamp.errors import MissingExtra
from nutdamp.files.reader import Source, example_text, read_spacecraft
from nutdamp.flight import basilisk, propagation, verification
from nutdamp.flight.dynamics import supplied
from nutdamp.flight.reference_model import ReferenceModel
from nutdamp.flight.verification import (
    AGREE,
    AS_FLOWN,
    IDEAL,
    Conservation,
    Verification,
    reference_model,
    verify,
)
from nutdamp.planning import plan as planning
from nutdamp.planning.simulation import unrounded
from nutdamp.schemes.catalogue import Options
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Disturbance, Inertia, Limits, Spacecraft
from nutdamp.spacecraft.schedule import Schedule, channel_pulse
from nutdamp.views import text as words
from nutdamp.views.simulation import conservation, verdict

EXAMPLE = read_spacecraft(example_text(), "example.yaml")
HEAVIER = replace(EXAMPLE, inertia=Inertia((120.00012, 120.00012, 80.0)))  # by 1 ppm
AXES = np.array(
    [[math.cos(0.1), 0.0, math.sin(0.1)], [0.0, 1.0, 0.0], [-math.sin(0.1), 0.0, math.cos(0.1)]]
)
TILTED = documented(
    replace(
        EXAMPLE,
        inertia=Inertia((122.0, 118.0, 80.0), AXES),
        disturbances=(
            Disturbance(0.02 + 0.01j),
            Disturbance(0.01j, rate=-1.0),
            Disturbance(0j, axial=0.01),
            Disturbance(0.5 - 0.2j, 0.1, 0.7, begin=1.0, end=5.0),
        ),
        dissipation=900.0,
        limits=Limits(tick=0.001),
    )
)
"""Three different moments, principal axes tilted from those of the file, and everything that can
disturb.
"""


@pytest.fixture(autouse=True)
def few_samples(plans_shared: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Flights are compared at 21 even times and the edges of pulses: DOP853 begins anew at each."""
    monkeypatch.setattr(verification, "SAMPLES", 21)


def left_in(verified: Verification) -> dict[str, float]:
    """Nutation left, rad, by the rows of the budget."""
    return {row.name: row.nutation for row in verified.budget}


def confirmed(verified: Verification, within: float) -> bool:
    """Whether DOP853 agrees, and to ``within`` rad."""
    return verified.agree and verified.methods[2].difference < within


def test_dop853_confirms_the_flight(planned: Planner) -> None:
    verified = verify(EXAMPLE, planned(EXAMPLE, "two-pulse").pulses)
    assert confirmed(verified, 1e-11)
    assert list(left_in(verified)) == [IDEAL, "pulse width", AS_FLOWN]
    assert (
        verified.methods[0].rate or 1.0
    ) < 1e-14  # the impulse sum agrees outside the pulses in its rates
    assert (
        verified.methods[0].axis or 0.0
    ) > 1e-4  # H is off by the widths, which is what flown is for
    ideal = planned(documented(spinner(steerable=Steerable())), "one-pulse")
    assert list(left_in(verify(ideal.spacecraft, ideal.pulses))) == [IDEAL, AS_FLOWN]


@pytest.mark.deep
def test_in_the_axes_of_the_file_too_and_the_budget_names_each_imperfection(
    planned: Planner,
) -> None:
    plan = planned(TILTED, "two-pulse")
    verified = verify(TILTED, plan.pulses, unrounded(plan))
    assert confirmed(verified, 1e-11)
    check_text("flight.error-budget", "\n".join(left_in(verified)))
    assert left_in(verified)[AS_FLOWN] == present(plan.flown).nutation


def test_a_flight_of_another_body_does_not_agree(planned: Planner) -> None:
    """The comparison can fail: a body 1 ppm heavier than its file
    says differs by more than AGREE.
    """
    verified = verify(HEAVIER, planned(EXAMPLE, "two-pulse").pulses)
    assert verified.disagreeing == ("DOP853",)
    assert not verified.agree


def test_a_spacecraft_with_fields_replaced_has_no_file_to_be_flown_by(planned: Planner) -> None:
    made = planned(EXAMPLE, "two-pulse").pulses
    read = Source(example_text(), "example.yaml").read()
    verified = verify(read.replace(mass=210.0), made)
    assert verified.checks == verified.disagreeing == ()
    assert "with_" in verified.methods[2].missing
    assert verify(read.with_(mass=210.0), made).agree


@pytest.mark.deep
def test_basilisk_has_its_say_in_the_verdict(
    planned: Planner, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A stand-in for Basilisk that flies another body is named and turns the verdict."""

    def of(body: Spacecraft) -> Callable[[Spacecraft, Schedule, float], basilisk.BasiliskFlight]:
        def fly(_: Spacecraft, made: Schedule, until: float) -> basilisk.BasiliskFlight:
            times = np.unique([*np.linspace(0.0, until, 50), *(pulse.end for pulse in made)])
            return basilisk.BasiliskFlight(
                times, *propagation.flown(body, made, until).motion(times), 0.01
            )

        return fly

    pulses = planned(EXAMPLE, "two-pulse").pulses
    monkeypatch.setattr(basilisk, "fly", of(EXAMPLE))
    verified = verify(EXAMPLE, pulses)
    assert verified.agree
    assert verified.checks == ("DOP853", "Basilisk")
    monkeypatch.setattr(basilisk, "fly", of(HEAVIER))
    verified = verify(EXAMPLE, pulses)
    assert verified.disagreeing == ("Basilisk",)
    assert not verified.agree
    with pytest.raises(SystemExit) as left:
        group.main(["verify", "--scheme", "two-pulse", "--quiet"], standalone_mode=False)
    assert left.value.code == 1
    check_text("flight.basilisk-disagrees", f"{verdict(verified)}\n{capsys.readouterr().err}")


def test_momentum_and_energy_keep_on_coasts_of_a_free_body_alone() -> None:
    free = replace(TILTED, disturbances=(), dissipation=None)
    verified = verify(free, Schedule((channel_pulse(EXAMPLE.channels[0], 1.0, 0.3),)))
    assert verified.momentum.kept
    assert verified.energy.kept
    assert max(verified.momentum.drift, verified.energy.drift) < 1e-13
    # A pure spin under a torque about axis 3: |H| grows by M t, the energy as its square.
    turned = replace(
        EXAMPLE, omega0=np.array([0.0, 0.0, 3.0]), disturbances=(Disturbance(0j, axial=0.5),)
    )
    body = documented(turned)
    verified = verify(body, Schedule())
    share = 240.0 / (240.0 + 0.5 * body.inertial_period)
    assert verified.momentum.kept is verified.energy.kept is None
    assert verified.momentum.drift == pytest.approx(1.0 - share, rel=1e-9)
    assert verified.energy.drift == pytest.approx(1.0 - share**2, rel=1e-9)
    # Dissipation is internal: it takes energy and leaves the momentum.
    body = replace(EXAMPLE, dissipation=20.0)
    verified = verify(body, Schedule())
    rates, _ = propagation.flown(body, Schedule(), body.inertial_period).motion(
        np.array([0.0, body.inertial_period])
    )
    before, after = (reference.energy(body.inertia.moments, one) for one in rates)
    assert verified.momentum.kept
    assert verified.momentum.drift < 1e-12
    assert verified.energy.kept is None
    assert verified.energy.changed == ("dissipation",)
    assert verified.energy.drift == pytest.approx(1.0 - after / before, rel=1e-9)
    assert verified.energy.drift > 1e-4


def test_a_body_at_rest_keeps_its_energy_of_nothing() -> None:
    still = replace(spinner(), inertia=replace(spinner().inertia, wheel=42.0), omega0=np.zeros(3))
    verified = verify(still, Schedule())
    assert (verified.momentum.drift, verified.energy.drift) == (0.0, 0.0)


def test_what_a_budget_row_says_is_what_that_imperfection_does(planned: Planner) -> None:
    """On a plan that is exact for ideal impulses, each row alone is the flight with that
    imperfection alone.
    """
    ideal = read_spacecraft(
        "name: X\ninertia: {A: 120, C: 80}\nstate: {spin: 3, nutation: 5 deg}\n", "x"
    )
    body = replace(ideal, disturbances=(Disturbance(0.5 + 0j),), dissipation=300.0)
    made = planned(ideal, "two-pulse").pulses
    rows, calm = left_in(verify(body, made)), left_in(verify(replace(body, dissipation=None), made))
    alone, damped, all_of_it = (
        propagation.flown(one, made).residual.nutation
        for one in (replace(body, dissipation=None), replace(body, disturbances=()), body)
    )
    # Dissipation is part of what plans include: it acts in every row but the one without.
    assert rows[IDEAL] == damped > 1e-5
    assert rows["without dissipation"] < 1e-12
    assert rows["disturbances"] == all_of_it
    assert calm[IDEAL] < 1e-12
    assert calm["disturbances"] == alone > 1e-5


@spread(
    ("changes", "scheme"),
    [
        ({"dissipation": 300.0}, "two-pulse"),
        ({"disturbances": (Disturbance(0.0j, axial=0.3),)}, "one-pulse"),
        ({"inertia": Inertia((122.0, 118.0, 80.0))}, "two-pulse"),
    ],
    quick=1,
    deep=2,
)
def test_the_budget_of_a_plan_does_not_read_backwards(changes: dict[str, Any], scheme: str) -> None:
    """What the plan includes is in the ideal flight, which leaves next to nothing; without it the
    pulses miss.
    """
    body = replace(EXAMPLE, **changes)
    left = left_in(
        verify(
            body, planning.plan(body, scheme, Options(with_disturbances=True)).pulses, expected=True
        )
    )
    (missed,) = (nutation for name, nutation in left.items() if name.startswith("without"))
    assert missed > 100.0 * max(left[IDEAL], left[AS_FLOWN])
    assert "disturbances" not in left


def states_of(body: Spacecraft, *times: float) -> tuple[ReferenceModel, np.ndarray]:
    """The reference model of a spacecraft, and its free motion at these times, (7, n)."""
    model = reference_model(body, 1_000_000)
    return model, model.fly(model.initial, 0.0, times[-1])(np.array(times))


def test_dop853_has_dissipation_as_a_torque_law() -> None:
    model, states = states_of(documented(replace(EXAMPLE, dissipation=600.0)), 0.0, 10.0)
    momentum = model.vectors(states, np.zeros(2))[2]
    assert momentum[1] == pytest.approx(momentum[0], rel=1e-12, abs=1e-10)
    slopes = np.hypot(*states[:2]) / states[2]  # tan θ, but for a factor
    assert slopes[1] / slopes[0] == pytest.approx(math.exp(10 / 600), rel=1e-11)


WHEEL = """
name: Bus
inertia: {A: 800 kg m^2, C: 150 kg m^2}
wheel: {momentum: 1800 N m s}
state: {spin: 4.656477 rad/s, nutation: 2 deg}
dissipation: {time_constant: 81.081 s, nutation: grows}
"""


def test_a_damper_of_a_body_with_a_wheel_keeps_h_and_takes_the_energy_of_its_angle() -> None:
    """|H| and h keep, so that the energy is that of the angle; growth ends at 27.606°."""
    times = np.array([0.0, 120.0, 240.0, 400.0])
    model, states = states_of(read_spacecraft(WHEEL, "f.yaml"), *times)
    angles = np.array([model.nutation(state, 0.0) for state in states.T])
    assert np.degrees(angles) == pytest.approx([2.0, 8.372, 22.237, 27.431], abs=5e-4)
    assert states[2, -1] == pytest.approx(2.793, abs=5e-4)
    rates, _, momentum = model.vectors(states, times)
    size = float(np.linalg.norm(momentum[0]))
    assert momentum == pytest.approx(np.tile(momentum[0], (4, 1)), abs=1e-11 * size)
    energy = (size * np.sin(angles)) ** 2 / 1600.0 + (size * np.cos(angles) - 1800.0) ** 2 / 300.0
    assert 0.5 * rates**2 @ [800.0, 800.0, 150.0] == pytest.approx(energy, rel=1e-11)


def test_the_command_prints_both_tables(run: Run) -> None:
    verified = run("verify", "--scheme", "two-pulse", "-v")
    assert verified.returncode == 0
    for text in ("DOP853", "agree", "Error budget", "on-time", "all: as flown"):
        assert text in verified.stdout
    assert max(len(line.rstrip()) for line in verified.stdout.splitlines()) <= 80


def test_the_command_takes_a_schedule_file(run: Run) -> None:
    run("plan", "--scheme", "one-pulse", "--csv", "pulses.csv")
    data = json.loads(run("verify", "--schedule", "pulses.csv", "--json", "-").stdout)
    assert data["agree"] is True
    assert [method["name"][:6] for method in data["methods"]] == [
        "impuls",
        "flown ",
        "DOP853",
        "Basili",
    ]
    assert data["budget"][0]["imperfection"].startswith("none")
    assert run("verify", "--scheme", "two-pulse", "--schedule", "x.csv").returncode == 2
    assert run("verify", "--schedule", "missing.csv").returncode == 1


PAIR = """
name: Pair
mass: 142 kg
inertia: {A: 142 kg m^2, C: 252 kg m^2}
state: {spin: 12 rpm, nutation: 1 deg}
thrusters:
  - {name: A1, position: [ 0.27, 0, -0.64], direction: [0, 0, 1], force: 11.18 N, isp: 180.3 s}
  - {name: A2, position: [-0.27, 0, -0.64], direction: [0, 0, 1], force: 11.18 N, isp: 180.3 s}
channels: {DV: [A1, A2]}
tank: {propellant: 2 kg, pressure: 20 bar, final_pressure: 10 bar,
  inertia_per_kg: {A: 2 m^2, C: 4 m^2}}
"""


def test_thrusters_whose_torques_cancel_use_propellant_and_leave_no_imperfection(
    run: Run, tmp_path: Path
) -> None:
    """Moments fall with it; what remains is the nutation at t = 0,
    which is no fault of the pulse.
    """
    (tmp_path / "pair.yaml").write_text(PAIR, encoding="utf-8")
    (tmp_path / "burn.csv").write_text("start_s,on_time_s,channel\n0,43.5,DV\n", encoding="utf-8")
    assert (
        json.loads(run("verify", "pair.yaml", "--schedule", "burn.csv", "--json", "-").stdout)[
            "agree"
        ]
        is True
    )
    rigid = (
        "verify",
        "pair.yaml",
        "--schedule",
        "burn.csv",
        "--set",
        "tank.inertia_per_kg={A: 0, C: 0}",
    )
    assert "imperfection" not in run(*rigid).stdout


@pytest.mark.deep
def test_with_a_target_the_budget_is_of_the_distance_from_it(run: Run) -> None:
    screen = run(
        "verify", "--scheme", "half-cone", "--target", "10deg,45deg", "--quiet", "-v"
    ).stdout
    budget = screen[screen.index("Error budget") :]
    assert re.search("^imperfection +nutation deg +axis error deg$", budget, re.MULTILINE)
    assert re.search("^all: as flown +0 +0$", budget, re.MULTILINE)


def test_a_motion_too_long_to_be_confirmed_is_not_called_confirmed(
    planned: Planner, monkeypatch: pytest.MonkeyPatch
) -> None:
    """DOP853 had no end: it ran for as long as the motion did."""

    def missing(*_: object) -> basilisk.BasiliskFlight:
        raise MissingExtra("verify", "a flight by Basilisk")

    monkeypatch.setattr("nutdamp.flight.verification.EVALUATIONS", 50)
    monkeypatch.setattr(basilisk, "fly", missing)
    verified = verify(EXAMPLE, planned(EXAMPLE, "two-pulse").pulses)
    assert verified.checks == verified.disagreeing == ()
    assert not verified.agree
    assert [bool(one.missing) for one in verified.methods] == [False, False, True, True]
    check_text("flight.not-confirmed", f"{verified.methods[2].missing}\n{verdict(verified)}")


@pytest.mark.weekly
def test_verify_of_what_cannot_be_confirmed_is_no_success(run: Run, tmp_path: Path) -> None:
    """Two thousand hours of coasting are more than DOP853 and Basilisk fly."""
    text = "name: X\ninertia: {A: 120, C: 80}\nstate: {spin: 3, nutation: 5 deg}\n"
    text += "limits: {horizon: 1e7, earliest: 8e6}\n"
    verified = run("verify", "-", "--scheme", "one-pulse", "--json", "v.json", stdin=text)
    data = json.loads((tmp_path / "v.json").read_text())
    assert data["agree"] is None
    assert all(
        one["missing"] for one in data["methods"] if one["name"].startswith(("DOP853", "Basilisk"))
    )
    assert verified.returncode == 3
    assert "not confirmed" in verified.stderr
    assert "NOT CONFIRMED" in verified.stdout


def test_what_is_conserved_is_no_number_of_noughts() -> None:
    """It read "at most 0.0e+00"."""
    said = []
    for momentum, energy, changed in (
        (0.0, 0.0, ()),
        (0.0, 2.3e-15, ()),
        (3.1e-9, 0.0, ()),
        (2e-13, 2e-4, ("dissipation",)),
    ):
        verified = Verification(
            (), Conservation("|H|", momentum), Conservation("energy", energy, changed), ()
        )
        assert verified.drifting == (("|H|",) if momentum > AGREE else ())
        said.append(words.text(conservation(verified)))
    check_text("flight.conserved", "\n".join(said))


def test_dissipation_with_a_wheel_whatever_pushes_and_falls() -> None:
    """Wide pulses of a tank that takes moments along, an axial part among them, to both sides of
    θ0.
    """
    thrusters = "[{name: P, torque: [90, 30, 3], JET}, {name: N, torque: [-90, 20, -8], JET}]"
    thrusters = thrusters.replace("JET", "isp: 220, lever_arm: 1")
    tank = (
        "{propellant: 5 kg, pressure: 20 bar, final_pressure: 8 bar, inertia_per_kg: {A: 2 m^2, "
        "C: 1 m^2}}"
    )
    text = case("wheel-growth.yaml").read_text().replace("2 deg", "14 deg")
    for sign in ("", "-"):
        turned = text.replace("{momentum: ", f"{{momentum: {sign}").replace(
            "{spin: ", f"{{spin: {sign}"
        )
        body = read_spacecraft(
            f"{turned}mass: 300 kg\nthrusters: {thrusters}\ntank: {tank}\n", "growth.yaml"
        )
        pulses = [
            channel_pulse(channel, t, 4.0)
            for channel, t in zip(body.channels, (30.0, 50.0), strict=True)
        ]
        checked = verify(body, Schedule(supplied(body, pulses)))
        assert checked.agree
        assert checked.checks
