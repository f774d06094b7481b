"""nutdamp as a library: the names it promises, arrays in the axes of the file, errors of its own."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import shutil
import subprocess
import sys
import types
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from process import Run
from scipy.spatial.transform import Rotation

import nutdamp
from nutdamp import errors, flight, planning, spacecraft
from nutdamp.files import pulses_csv, track_csv
from nutdamp.presentation.page import html
from nutdamp.schemes.options import OptimalOptions

ROOT = Path(__file__).parent.parent
EXAMPLE = Path(__file__).with_name("library_example.py")

TILTED = """
name: Tilted
inertia: {tensor: [[120, 3, 6], [3, 118, -4], [6, -4, 80]]}
omega0: [0.2, 0.1, 3.0]
steerable: {torque: 40 N m, isp: 220 s, lever_arm: 1 m}
requirement: {nutation: 0.5 deg}
"""


@pytest.fixture
def craft() -> nutdamp.Spacecraft:
    return nutdamp.example()


def python(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False)


def test_importing_loads_nothing_that_takes_time(tmp_path: Path) -> None:
    code = "import sys, nutdamp; nutdamp.__version__; dir(nutdamp); print('numpy' in sys.modules)"
    assert python(code, tmp_path).stdout == "False\n"


def test_every_public_name_is_there_and_no_other() -> None:
    for name in nutdamp.__all__:
        assert getattr(nutdamp, name) is not None
    assert set(nutdamp.__all__) <= set(dir(nutdamp))
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = nutdamp.nonsense  # type: ignore[attr-defined]


def test_a_type_checker_knows_what_comes_back(tmp_path: Path) -> None:
    (tmp_path / "typed.py").write_text(
        "import nutdamp\n"
        'plan = nutdamp.plan(nutdamp.load("spacecraft.yaml"), "two-pulse")\n'
        "reveal_type(plan.fly().track.rates)\n"
        "plan.fly().to_csv(3)\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "typed.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "ndarray" in done.stdout
    assert "numpy.float64" in done.stdout or "floating" in done.stdout
    assert 'typed.py:4: error: Argument 1 to "to_csv" of "Tabled" has incompatible type "int"' in done.stdout
    assert "Found 1 error" in done.stdout


def test_the_example_runs(run: Run, tmp_path: Path) -> None:
    assert run("init").returncode == 0
    done = subprocess.run([sys.executable, str(EXAMPLE)], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "<Plan optimal: 10 pulses" in done.stdout
    assert (tmp_path / "track.csv").stat().st_size > 100_000


def test_the_sweep_runs(run: Run, tmp_path: Path) -> None:
    assert run("init").returncode == 0
    sweep = EXAMPLE.with_name("library_sweep.py")
    done = subprocess.run([sys.executable, str(sweep)], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    lines = []
    for angle in (1, 3, 5):
        changed = ("--set", f"state.nutation={angle} deg", "--set", "limits.horizon=300 s")
        run("plan", "--scheme", "two-pulse", *changed, "--json", "plan.json")
        (plan,) = json.loads((tmp_path / "plan.json").read_text())["plans"]
        assert plan["feasible"]
        assert plan["flown"]["nutation_deg"] < 1e-6
        lines.append(f"{angle} deg: {plan['propellant_kg']:.5f} kg of propellant")
    assert done.stdout.splitlines() == lines


KEYS: dict[str, Any] = {
    "name": "Tilted",
    "inertia": {"tensor": np.array([[120, 3, 6], [3, 118, -4], [6, -4, 80]])},
    "omega0": (0.2, np.float64(0.1), 3.0),
    "steerable": {"torque": "40 N m", "isp": "220 s", "lever_arm": "1 m"},
    "requirement": {"nutation": "0.5 deg"},
    "limits": {"horizon": "100 s", "max_pulses": np.int64(3)},
}


def test_a_dict_is_read_as_the_file_is() -> None:
    text = TILTED + "limits: {horizon: 100 s, max_pulses: 3}\n"
    assert nutdamp.load(KEYS).to_dict() == nutdamp.read(text).to_dict()
    assert nutdamp.load(KEYS, set={"limits.horizon": 50.0}).core.limits.horizon == 50.0
    assert nutdamp.load({**KEYS, "name": "1e3"}).name == "1e3"


def test_a_fault_in_a_dict_has_a_place() -> None:
    with pytest.raises(errors.FaultyFile, match=r"dict:2:\d+: nam: ") as raised:
        nutdamp.load({"nam": "X", "inertia": {"A": "120 s", "C": 80}, "omega0": [0, 0, 3]})
    assert any(fault.file == "dict" and fault.line == 4 and "inertia.A" in fault.where for fault in raised.value.faults)


def test_with_changes_the_keys_named_and_no_others(craft: nutdamp.Spacecraft, tmp_path: Path) -> None:
    first = nutdamp.load(KEYS).with_(limits={"horizon": "300 s"}, requirement={"momentum_shift": "1 deg"})
    assert (first.core.limits.horizon, first.core.limits.max_pulses) == (300.0, 3)
    assert first.core.requirement is not None
    assert first.core.requirement.nutation == pytest.approx(math.radians(0.5))
    again = first.with_(limits={"max_pulses": 2})
    assert (again.core.limits.horizon, again.core.limits.max_pulses) == (300.0, 2)
    assert first.core.limits.max_pulses == 3
    changed = craft.with_(state={"nutation": "8 deg"}, thrusters={"+M1": {"force": 12.0}})
    assert changed.nutation == pytest.approx(math.radians(8.0))
    assert changed.core.omega0[2] == craft.core.omega0[2]
    forces = {one.name: one.thrust for channel in changed.core.channels for one in channel.thrusters}
    assert (forces["+M1"], forces["-M1"]) == (12.0, 10.0)
    (tmp_path / "own.yaml").write_text(TILTED)
    held = nutdamp.load(tmp_path / "own.yaml", set={"steerable.isp": 200.0})
    for one in (held, nutdamp.plan(held, "two-pulse").spacecraft, nutdamp.plan(held, "none").fly(3.0).spacecraft):
        more = one.with_(name="Other")
        assert more.name == "Other"
        assert more.core.steerable is not None
        assert more.core.steerable.isp == 200.0
    compared = nutdamp.compare(held, ["two-pulse"])
    assert compared["two-pulse"].spacecraft.with_(mass=3).core.mass == 3.0


def test_there_is_one_type_of_each_name(craft: nutdamp.Spacecraft) -> None:
    """What the library gives is what the modules below make, not something around it."""
    compared = nutdamp.compare(craft, ["two-pulse"])
    (plan,) = compared.plans
    for made, kind in (
        (craft, spacecraft.Spacecraft),
        (plan, planning.Plan),
        (compared, planning.Comparison),
        (plan.fly(), flight.Flight),
    ):
        assert type(made) is kind is getattr(nutdamp, kind.__name__)
    assert plan.spacecraft is craft
    assert plan.fly().spacecraft is craft
    assert planning.plan(craft, "two-pulse").to_dict() == plan.to_dict()


def test_every_residual_carries_the_name_of_its_model(craft: nutdamp.Spacecraft) -> None:
    plan = nutdamp.plan(craft, "two-pulse")
    assert plan.residual is not None
    assert plan.flown is not None
    assert plan.residual.model == plan.fly(by_impulses=True).residual.model == "impulse sum (17)"
    assert plan.flown.model == plan.fly().residual.model == "real pulse widths"
    assert plan.fly(by_impulses=True).residual.nutation == pytest.approx(plan.residual.nutation, abs=1e-12)
    assert plan.fly().residual.nutation == pytest.approx(plan.flown.nutation, abs=1e-12)


def test_fields_are_replaced_in_si(craft: nutdamp.Spacecraft) -> None:
    lighter = craft.replace(mass=np.float64(200.0), omega0=[0.1, 0.0, 3])
    assert (lighter.mass, lighter.name, lighter.rates.tolist()) == (200.0, craft.name, [0.1, 0.0, 3.0])
    assert nutdamp.plan(lighter, "two-pulse").feasible
    assert craft.mass != 200.0
    # It is no longer what its file says.
    assert craft.source is not None
    assert lighter.source is None


def test_with_is_checked_as_the_file_is(craft: nutdamp.Spacecraft) -> None:
    for keys, problem in (
        ({"limits": {"horizon": "3 kg"}}, "with_ limits.horizon=3 kg: limits.horizon: "),
        ({"limit": {"horizon": 3}}, "did you mean"),
        ({"limits": "soon"}, "with_ limits=soon: limits: "),
        ({"thrusters": {"T9": {"force": 3}}}, "no entry of thrusters has the name 'T9'"),
    ):
        with pytest.raises(errors.FaultyFile, match=re.escape(problem)):
            craft.with_(**keys)


def test_files_are_those_of_the_command_line(craft: nutdamp.Spacecraft, run: Run, tmp_path: Path) -> None:
    run("plan", "--scheme", "two-pulse", "--csv", "pulses.csv", "--json", "plan.json")
    run("simulate", "--scheme", "two-pulse", "--flown", "--csv", "flown.csv")
    run("simulate", "--scheme", "two-pulse", "--csv", "impulses.csv")
    plan = nutdamp.plan(craft, "two-pulse")
    plan.to_csv(tmp_path / "own.csv")
    assert (tmp_path / "own.csv").read_bytes() == (tmp_path / "pulses.csv").read_bytes()
    for name, by_impulses in (("flown.csv", False), ("impulses.csv", True)):
        plan.fly(by_impulses=by_impulses).to_csv(tmp_path / "own.csv")
        assert (tmp_path / "own.csv").read_bytes() == (tmp_path / name).read_bytes()
    compared = nutdamp.compare(craft, ["two-pulse"])
    assert compared.to_dict() == json.loads((tmp_path / "plan.json").read_text())


def test_arrays_have_the_columns_of_the_files(tmp_path: Path) -> None:
    plan = nutdamp.plan(nutdamp.read(TILTED), "two-pulse")
    flight = plan.fly(samples=50)
    for made, header, write in (
        (plan.to_numpy(), pulses_csv.HEADER, plan.to_csv),
        (flight.to_numpy(), track_csv.HEADER, flight.to_csv),
    ):
        assert made.dtype.names == header
        write(tmp_path / "rows.csv")
        rows = list(csv.reader(io.StringIO((tmp_path / "rows.csv").read_text())))[1:]
        assert len(rows) == len(made)
        for mine, row in zip(made.tolist(), rows, strict=True):
            assert [str(cell) for cell in mine] == [cell or "nan" for cell in row]


def test_the_track_is_in_the_axes_of_the_file() -> None:
    craft = nutdamp.read(TILTED)
    tensor = np.array([[120.0, 3, 6], [3, 118, -4], [6, -4, 80]])
    flight = nutdamp.plan(craft, "none").fly(until=5.0, samples=200)
    track = flight.track
    assert track.rates[0] == pytest.approx([0.2, 0.1, 3.0], abs=1e-14)
    assert craft.rates == pytest.approx([0.2, 0.1, 3.0], abs=1e-14)
    # H = R I ω stays where it is, with the tensor as the file has it.
    turn = Rotation.from_quat(np.roll(track.quaternion, -1, axis=1)).as_matrix()
    momentum = np.einsum("nij,nj->ni", turn, track.rates @ tensor)
    assert momentum == pytest.approx(np.broadcast_to(momentum[0], momentum.shape), abs=1e-9)
    assert momentum == pytest.approx(track.momentum, abs=1e-9)
    assert flight.to_numpy()["omega_1_rad_s"] == pytest.approx(track.rates[:, 0], abs=0.0)


def test_a_flight_draws_itself(craft: nutdamp.Spacecraft) -> None:
    flight = nutdamp.plan(craft, "two-pulse").fly()
    assert len(flight.figure("motion").axes) == 2
    assert len(flight.figure("timeline").axes) == 1


def test_a_written_schedule_is_read_as_a_plan(craft: nutdamp.Spacecraft, tmp_path: Path) -> None:
    plan = nutdamp.plan(craft, "four-pulse")
    plan.to_csv(tmp_path / "pulses.csv")
    again = nutdamp.load_schedule(tmp_path / "pulses.csv", craft)
    assert again.fly().residual == plan.fly().residual
    assert again.propellant == pytest.approx(plan.propellant, rel=1e-12)
    text = (tmp_path / "pulses.csv").read_text().replace("-M1", "+M9")
    (tmp_path / "edited.csv").write_text(text)
    with pytest.warns(UserWarning, match=r"channel '\+M9' is not in the spacecraft file"):
        nutdamp.load_schedule(tmp_path / "edited.csv", craft)


def test_the_recommended_plan_is_one_of_those_compared(craft: nutdamp.Spacecraft) -> None:
    compared = nutdamp.compare(craft)
    assert [plan.scheme for plan in compared] == ["one-pulse", "two-pulse", "four-pulse", "optimal"]
    assert compared.recommended is not None
    chosen = compared[compared.recommended.scheme]
    assert chosen.meets_requirement
    assert chosen.flown == compared.recommended.flown
    assert chosen.total_impulse >= craft.least_impulse * (1 - 1e-12)
    with pytest.raises(KeyError):
        compared["half-cone"]


def test_what_cannot_be_says_so_in_an_error_of_the_package(craft: nutdamp.Spacecraft, tmp_path: Path) -> None:
    ideal = nutdamp.read("name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n")
    infeasible = nutdamp.plan(ideal, "four-pulse")
    assert not infeasible.feasible
    assert len(infeasible.to_numpy()) == len(infeasible) == 0
    plan = nutdamp.plan(craft, "two-pulse")
    for kind, call in (
        (errors.CannotRead, lambda: nutdamp.load(tmp_path / "missing.yaml")),
        (errors.FaultyFile, lambda: nutdamp.read("name: X\n")),
        (errors.BadRequest, lambda: nutdamp.plan(craft, "three-pulse")),
        (errors.BadRequest, lambda: nutdamp.compare(craft, ["three-pulse"])),
        (errors.BadRequest, lambda: nutdamp.plan(craft, "four-pulse", nutdamp.Options(on_time=-1.0))),
        (errors.BadRequest, lambda: nutdamp.plan(craft, "optimal", nutdamp.Options(least="fuel"))),
        (errors.BadRequest, lambda: plan.fly(until=-1.0)),
        (errors.BadRequest, lambda: plan.fly(samples=1)),
        (errors.BadRequest, lambda: plan.fly().figure("portrait")),
        (errors.Infeasible, infeasible.fly),
        (errors.Infeasible, lambda: infeasible.to_csv(tmp_path / "pulses.csv")),
        (errors.CannotWrite, lambda: plan.to_csv(tmp_path / "no" / "pulses.csv")),
    ):
        with pytest.raises(kind):
            call()
        assert issubclass(kind, nutdamp.NutdampError)
    assert list(tmp_path.iterdir()) == []


WRONG: dict[str, tuple[Callable[[Any, Any], object], str]] = {
    "an option of 0": (
        lambda craft, _: nutdamp.plan(craft, "rhumb-line", nutdamp.Options(per_turn=0)),
        "per_turn = 0: expected a whole number of at least 1",
    ),
    "a negative count": (
        lambda craft, _: nutdamp.plan(craft, "half-cone", nutdamp.Options(cones=-3)),
        "cones = -3: expected a whole number of at least 1",
    ),
    "a negative angle": (
        lambda craft, _: nutdamp.plan(craft, "optimal", nutdamp.Options(shift=-0.1)),
        "shift = -0.1: expected an angle of at least 0, in rad",
    ),
    "an angle beside freedom": (
        lambda craft, _: nutdamp.compare(craft, ["optimal"], nutdamp.Options(shift=0.1, free_axis=True)),
        "shift = 0.1: expected none beside a free axis",
    ),
    "a time that is no number": (
        lambda craft, _: nutdamp.plan(craft, "four-pulse", nutdamp.Options(on_time=math.nan)),
        "on_time = nan: expected a time above zero, in s",
    ),
    "a time as text": (
        lambda craft, _: nutdamp.plan(craft, "four-pulse", nutdamp.Options(on_time="3 s")),
        "on_time = '3 s': expected a time above zero, in s",
    ),
    "a flag as number": (
        lambda craft, _: nutdamp.plan(craft, "four-pulse", nutdamp.Options(coarse=1)),
        "coarse = 1: expected True or False",
    ),
    "an option of no scheme": (
        lambda craft, _: nutdamp.plan(craft, "four-pulse", nutdamp.Options(length=0.2)),
        "options: no scheme has 'length'; there are with_disturbances, on_time",
    ),
    "options of another scheme": (
        lambda craft, _: nutdamp.plan(craft, "four-pulse", OptimalOptions(least="time")),
        "options of four-pulse: expected FourPulseOptions(…), got a nutdamp.schemes.options.OptimalOptions",
    ),
    "options as mapping": (
        lambda craft, _: nutdamp.plan(craft, "four-pulse", {"on_time": 3}),  # type: ignore[arg-type]
        "options: expected nutdamp.Options(…), got a dict",
    ),
    "a file name as spacecraft": (
        lambda *_: nutdamp.plan("spacecraft.yaml", "two-pulse"),  # type: ignore[arg-type]
        "spacecraft: expected a Spacecraft, as nutdamp.load gives it, got 'spacecraft.yaml'",
    ),
    "a plan as spacecraft": (
        lambda _, plan: nutdamp.compare(plan),
        "expected a Spacecraft, as nutdamp.load gives it, got a nutdamp.planning.Plan",
    ),
    "a mapping as text": (
        lambda *_: nutdamp.read({"name": "X"}),  # type: ignore[arg-type]
        "text: expected the text of a spacecraft file (nutdamp.load reads files), got a dict",
    ),
    "a number as file": (lambda *_: nutdamp.load(3), "path: expected the name of a file or a dict of its keys, got 3"),  # type: ignore[arg-type]
    "bytes as file": (lambda *_: nutdamp.load(b"x"), "expected the name of a file or a dict of its keys, got a bytes"),  # type: ignore[arg-type]
    "a number as schedule": (
        lambda craft, _: nutdamp.load_schedule(3, craft),  # type: ignore[arg-type]
        "path: expected the name of a file, got 3",
    ),
    "an object in a dict": (
        lambda *_: nutdamp.load({"name": object()}),
        "dict: expected a number, a text, a list or a mapping, got object",
    ),
    "an object to change": (
        lambda craft, _: craft.with_(limits={"horizon": object()}),
        "expected a number, a text, a list or a mapping, got object",
    ),
    "a number as key": (lambda craft, _: craft.with_(limits={3: 4}), "with_ limits: expected the name of a key, got 3"),
    "a spacecraft without a file": (
        lambda craft, _: craft.replace(mass=3).with_(name="X"),
        "with_: expected a spacecraft from nutdamp.load, read or example",
    ),
    "a text as mass": (lambda craft, _: craft.replace(mass="3 kg"), "mass: expected a number or None, got '3 kg'"),
    "two rates": (lambda craft, _: craft.replace(omega0=(0.1, 3.0)), "omega0: expected three numbers, got a tuple"),
    "names as channels": (
        lambda craft, _: craft.replace(channels=("+M1",)),
        "channels: expected a tuple of Channel, got a tuple",
    ),
    "an unknown field": (lambda craft, _: craft.replace(weight=3), "replace: there is no 'weight'; there are name"),
    "a plan to report": (
        lambda _, plan: nutdamp.report(plan),
        "path: expected the name of a file or a dict of its keys, got a nutdamp.planning.Plan",
    ),
    "another ending": (lambda craft, _: nutdamp.report(craft, "page.txt"), "page.txt: the ending says the format"),
    "a number to change": (
        lambda *_: nutdamp.load("x", set={3: 4}),  # type: ignore[dict-item]
        "set: expected a mapping such as {'limits.horizon': '300 s'}, got a dict",
    ),
    "one name for several": (
        lambda craft, _: nutdamp.compare(craft, "two-pulse"),
        "names: expected a list of schemes, such as ['two-pulse'], got 'two-pulse'",
    ),
    "an array as scheme": (
        lambda craft, _: nutdamp.plan(craft, np.zeros(2)),  # type: ignore[arg-type]
        "there is no scheme a numpy.ndarray; there are one-pulse",
    ),
    "no points": (lambda craft, _: nutdamp.trade(craft, 0), "points = 0: expected a whole number of at least 1"),
    "one angle": (lambda craft, _: nutdamp.trade(craft, allow=0.1), "allow = 0.1: expected angles of at least 0"),  # type: ignore[arg-type]
    "a negative shift": (lambda craft, _: nutdamp.trade(craft, allow=[-0.1]), "expected angles of at least 0, in rad"),
    "least time": (
        lambda craft, _: nutdamp.trade(craft, least="time"),
        "least = 'time': expected one of propellant, impulse",
    ),
    "a scheme to verify": (
        lambda *_: nutdamp.verify("two-pulse"),  # type: ignore[arg-type]
        "plan: expected a Plan, as nutdamp.plan gives it, got 'two-pulse'",
    ),
    "no dispersions": (
        lambda *_: nutdamp.disperse(nutdamp.plan(nutdamp.read(TILTED), "none")),
        "the spacecraft has no dispersions",
    ),
    "an unknown format": (
        lambda _, plan: nutdamp.export(plan, "oem", "x"),
        "format = 'oem': expected one of apm, aem, stk, basilisk, json",
    ),
    "an end as text": (lambda _, plan: plan.fly(until="3"), "until = '3': expected a time after t = 0, in s"),
    "half a sample": (lambda _, plan: plan.fly(samples=2.5), "samples = 2.5: expected a whole number of at least 2"),
    "a number as output": (lambda _, plan: plan.to_csv(3), "path: expected the name of a file, got 3"),
    "a list as figure": (lambda _, plan: plan.fly().figure([]), "expected the name of a figure, got a list"),
}


@pytest.mark.parametrize(("call", "message"), WRONG.values(), ids=WRONG)
def test_a_wrong_argument_is_reported_with_what_was_expected(
    craft: nutdamp.Spacecraft, call: Callable[[Any, Any], object], message: str
) -> None:
    with pytest.raises(errors.BadRequest, match=re.escape(message)):
        call(craft, nutdamp.plan(craft, "none"))


def test_numbers_of_numpy_are_numbers(craft: nutdamp.Spacecraft) -> None:
    options = nutdamp.Options(on_time=np.float64(0.5), per_turn=np.int64(2))
    plan = nutdamp.plan(craft, "four-pulse", options)
    assert max(plan.to_numpy()["on_time_s"]) == 0.5
    flight = plan.fly(until=np.float64(3.0), samples=np.int64(5))  # type: ignore[arg-type]
    assert len(flight.track.t) >= 5


def test_an_unknown_scheme_is_refused_without_nutation_too() -> None:
    calm = nutdamp.read("name: X\ninertia: {A: 120, C: 80}\nomega0: [0, 0, 3]\n")
    assert nutdamp.plan(calm, "two-pulse").feasible
    with pytest.raises(errors.BadRequest, match="there is no scheme 'three-pulse'"):
        nutdamp.plan(calm, "three-pulse")
    for call in (planning.plan, planning.alternatives):
        with pytest.raises(KeyError):
            call(calm.core, "three-pulse")


@pytest.fixture
def dispersed(tmp_path: Path) -> Path:
    shutil.copy(ROOT / "configs" / "single-thruster.yaml", tmp_path / "spacecraft.yaml")
    return tmp_path


def test_studies_have_the_numbers_of_the_commands(run: Run, dispersed: Path) -> None:
    craft = nutdamp.load(dispersed / "spacecraft.yaml")
    chosen = nutdamp.compare(craft).recommended
    assert chosen is not None
    chosen.to_csv(dispersed / "pulses.csv")
    held = nutdamp.load_schedule(dispersed / "pulses.csv", craft)
    for command, made in (
        (("disperse", "--samples", "200", "--seed", "3"), nutdamp.disperse(chosen, 200, seed=3).to_dict()),
        (("verify",), nutdamp.verify(chosen).to_dict()),
        (("verify", "--schedule", "pulses.csv"), {**nutdamp.verify(held).to_dict(), "scheme": "pulses.csv"}),
    ):
        done = run(*command, "--json", "own.json")
        assert done.returncode in (0, 4), done.stderr
        assert json.loads((dispersed / "own.json").read_text()) == json.loads(json.dumps(made, allow_nan=False))


def test_a_trade_has_the_numbers_of_the_command(run: Run, tmp_path: Path, craft: nutdamp.Spacecraft) -> None:
    done = run("trade", "--points", "2", "--allow", "0", "--least", "impulse", "--json", "trade.json")
    assert done.returncode == 0, done.stderr
    found = nutdamp.trade(craft, points=2, allow=(0.0,), least="impulse")
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False)) == json.loads((tmp_path / "trade.json").read_text())
    assert len(found.plans) == len(found.fronts[0].points) > 0
    assert all(one.feasible for one in found.plans)


def test_an_export_is_that_of_the_command(run: Run, tmp_path: Path) -> None:
    timed = ("--set", "attitude={quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: EME2000}")
    craft = nutdamp.example().with_(
        attitude={"quaternion": [1, 0, 0, 0], "epoch": "2026-03-01T12:00:00Z", "frame": "EME2000"}
    )
    plan = nutdamp.plan(craft, "two-pulse")
    for form, name in (("stk", "x.a"), ("basilisk", "x.py"), ("json", "x.json"), ("aem", "x.xml"), ("apm", "x.apm")):
        run("export", "--format", form, "--scheme", "two-pulse", *timed, "-o", f"command-{name}")
        nutdamp.export(plan, form, tmp_path / name)
        texts = [(tmp_path / one).read_text() for one in (name, f"command-{name}")]
        mine, its = (re.sub(r"(CREATION_DATE|MESSAGE_ID)( *= *|>)[^<\n]*", r"\1", text) for text in texts)
        assert mine == its


def test_a_report_is_that_of_the_command(run: Run, tmp_path: Path) -> None:
    (tmp_path / "own.yaml").write_text(TILTED)
    chosen = ("--scheme", "two-pulse", "--set", "limits.horizon=100 s")
    assert run("report", "own.yaml", *chosen, "-o", "command.md").returncode == 0
    craft = nutdamp.load(tmp_path / "own.yaml", set={"limits.horizon": "100 s"})
    made = nutdamp.report(craft, tmp_path / "own.md", ["two-pulse"])
    mine, its = ((tmp_path / name).read_text() for name in ("own.md", "command.md"))
    assert made.content == mine
    assert made.good
    assert made.verdict.startswith("Recommended: two-pulse")
    assert made.comparison["two-pulse"].feasible
    mine, its = (re.sub(r"(?m)^nutdamp.*report.*|^<details><summary>Input file .*", "", text) for text in (mine, its))
    assert mine.replace("```python", "```console") == its
    again = nutdamp.report({**KEYS, "limits": {"horizon": "100 s"}}, tmp_path / "dict.html", ["two-pulse"])
    assert again.verdict == made.verdict
    assert str(again.content).startswith("<!DOCTYPE html>")


def test_a_report_of_replaced_fields_names_no_file(craft: nutdamp.Spacecraft, tmp_path: Path) -> None:
    nutdamp.report(craft.replace(name="Other"), tmp_path / "own.md", ["two-pulse"])
    text = (tmp_path / "own.md").read_text()
    assert text.startswith("# Other: damping")
    assert "Input file" not in text
    assert f"nutdamp.report(spacecraft, {str(tmp_path / 'own.md')!r}, ['two-pulse'])" in text


def test_a_report_disperses_as_disperse_does(dispersed: Path) -> None:
    craft = nutdamp.load(dispersed / "spacecraft.yaml")
    options = nutdamp.Options(on_time=0.2)
    made = nutdamp.report(craft, dispersed / "own.md", options=options, disperse=200, seed=3)
    called = ", options=nutdamp.Options(on_time=0.2), disperse=200, seed=3)"
    assert called in (dispersed / "own.md").read_text()
    assert made.dispersed is not None
    assert made.comparison.recommended is not None
    assert made.dispersed.met_fraction == nutdamp.disperse(made.comparison.recommended, 200, seed=3).met_fraction
    assert "with dispersions (200 cases)" in made.verdict


def test_tables_become_data_frames(craft: nutdamp.Spacecraft, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = nutdamp.plan(craft, "two-pulse")
    stand_in = types.ModuleType("pandas")
    stand_in.DataFrame = dict  # type: ignore[attr-defined]
    for made in (plan, plan.fly(samples=20)):
        monkeypatch.setitem(sys.modules, "pandas", stand_in)
        frame, rows = made.to_pandas(), made.to_numpy()
        assert tuple(frame) == rows.dtype.names
        for name in rows.dtype.names:
            assert np.array_equal(frame[name], rows[name])
        monkeypatch.setitem(sys.modules, "pandas", None)
        with pytest.raises(nutdamp.NutdampError, match="needs pandas: pip install pandas"):
            made.to_pandas()


class _Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:  # noqa: ARG002
        self.open.append(tag)
        self.seen.add(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_notebooks_show_small_tables() -> None:
    craft = nutdamp.read(TILTED.replace("Tilted", "'<b>&\"'"))
    compared = nutdamp.compare(craft)
    plan = compared["two-pulse"]
    for shown in (craft, compared, plan, plan.fly(), nutdamp.plan(craft, "four-pulse")):
        tags = _Tags()
        text = shown._repr_html_()
        assert text is not None
        tags.feed(text)
        assert tags.open == []
        assert "table" in tags.seen or not plan.feasible or "infeasible" in text
        assert "b" not in tags.seen
        assert repr(shown).startswith(f"<{type(shown).__name__}")


def test_notebooks_show_a_line_without_jinja(craft: nutdamp.Spacecraft, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jinja2", None)
    html._templates.cache_clear()
    assert craft._repr_html_() is None


def test_dictionaries_hold_no_number_that_json_has_not() -> None:
    """A sphere has no nutation period in the body, and an ideal torquer no torque and no propellant."""
    ball = nutdamp.read("name: Ball\ninertia: {A: 100, C: 100}\nstate: {spin: 3, nutation: 5 deg}\n")
    compared = nutdamp.compare(ball)
    assert ball.to_dict()["body_nutation_period_s"] is None
    for one in (ball, compared, *compared):
        json.dumps(one.to_dict(), allow_nan=False)


def test_the_examples_that_ship_are_loaded_by_name() -> None:
    assert nutdamp.example("ace").name == "ACE"
    with pytest.raises(nutdamp.NutdampError, match="lunar-prospector"):
        nutdamp.example("lunar-prospecter")
