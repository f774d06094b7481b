"""nutdamp as a library: the names it promises, its spacecraft from files and dicts, and sweeps of them."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support import places
from support.process import Run
from support.tilted import KEYS, TILTED

import nutdamp
from nutdamp import errors, flight, planning, spacecraft
from nutdamp.comparison import Comparison

ROOT = places.ROOT
EXAMPLE = places.TESTS / "support" / "library_example.py"


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


@pytest.mark.weekly
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


@pytest.mark.deep
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


def test_a_dict_is_read_as_the_file_is() -> None:
    text = TILTED + "limits: {horizon: 100 s, max_pulses: 3}\n"
    assert nutdamp.load(KEYS).to_dict() == nutdamp.read(text).to_dict()
    assert nutdamp.load(KEYS, set={"limits.horizon": 50.0}).limits.horizon == 50.0
    assert nutdamp.load({**KEYS, "name": "1e3"}).name == "1e3"


def test_a_fault_in_a_dict_has_a_place() -> None:
    with pytest.raises(errors.FaultyFile, match=r"dict:2:\d+: nam: ") as raised:
        nutdamp.load({"nam": "X", "inertia": {"A": "120 s", "C": 80}, "omega0": [0, 0, 3]})
    assert any(fault.file == "dict" and fault.line == 4 and "inertia.A" in fault.where for fault in raised.value.faults)


def test_with_changes_the_keys_named_and_no_others(craft: nutdamp.Spacecraft, tmp_path: Path) -> None:
    first = nutdamp.load(KEYS).with_(limits={"horizon": "300 s"}, requirement={"momentum_shift": "1 deg"})
    assert (first.limits.horizon, first.limits.max_pulses) == (300.0, 3)
    assert first.requirement is not None
    assert first.requirement.nutation == pytest.approx(math.radians(0.5))
    again = first.with_(limits={"max_pulses": 2})
    assert (again.limits.horizon, again.limits.max_pulses) == (300.0, 2)
    assert first.limits.max_pulses == 3
    changed = craft.with_(state={"nutation": "8 deg"}, thrusters={"+M1": {"force": 12.0}})
    assert changed.nutation == pytest.approx(math.radians(8.0))
    assert changed.omega0[2] == craft.omega0[2]
    forces = {one.name: one.thrust for channel in changed.channels for one in channel.thrusters}
    assert (forces["+M1"], forces["-M1"]) == (12.0, 10.0)
    (tmp_path / "own.yaml").write_text(TILTED)
    held = nutdamp.load(tmp_path / "own.yaml", set={"steerable.isp": 200.0})
    for one in (held, nutdamp.plan(held, "two-pulse").spacecraft, nutdamp.plan(held, "none").fly(3.0).spacecraft):
        more = one.with_(name="Other")
        assert more.name == "Other"
        assert more.steerable is not None
        assert more.steerable.isp == 200.0
    compared = nutdamp.compare(held, ["two-pulse"])
    assert compared["two-pulse"].spacecraft.with_(mass=3).mass == 3.0


def test_there_is_one_type_of_each_name(craft: nutdamp.Spacecraft) -> None:
    """What the library gives is what the modules below make, not something around it."""
    compared = nutdamp.compare(craft, ["two-pulse"])
    (plan,) = compared.plans
    for made, kind in (
        (craft, spacecraft.Spacecraft),
        (plan, planning.Plan),
        (compared, Comparison),
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
