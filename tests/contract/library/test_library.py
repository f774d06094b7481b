"""nutdamp as a library: names, spacecraft from files and dicts, what it refuses; plans, flights and
studies.
"""

import csv
import doctest
import inspect
import io
import json
import math
import re
import runpy
import shutil
import subprocess
import sys
import types
from collections.abc import Callable
from dataclasses import replace
from datetime import date, datetime, timedelta, timezone
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation
from support import places
from support.builders import present
from support.cases import spread
from support.golden import check_text, refusal, refused
from support.process import Run
from support.shown import parsed

import nutdamp
from nutdamp import errors
from nutdamp.errors import NotFound
from nutdamp.figures import style
from nutdamp.files import schedules, tabular
from nutdamp.files.reader import read_spacecraft
from nutdamp.flight import propagation
from nutdamp.montecarlo import study
from nutdamp.montecarlo.inputs import list_inputs
from nutdamp.page import report, results
from nutdamp.planning import plan as planning
from nutdamp.planning.plan import Worse, plan

TILTED = """
name: Tilted
inertia: {tensor: [[120, 3, 6], [3, 118, -4], [6, -4, 80]]}
omega0: [0.2, 0.1, 3.0]
steerable: {torque: 40 N m, isp: 220 s, lever_arm: 1 m}
requirement: {nutation: 0.5 deg}
"""

KEYS: dict[str, Any] = {
    "name": "Tilted",
    "inertia": {"tensor": np.array([[120, 3, 6], [3, 118, -4], [6, -4, 80]])},
    "omega0": (0.2, np.float64(0.1), 3.0),
    "steerable": {"torque": "40 N m", "isp": "220 s", "lever_arm": "1 m"},
    "requirement": {"nutation": "0.5 deg"},
    "limits": {"horizon": "100 s", "max_pulses": np.int64(3)},
}


IN_SKY = {"quaternion": [1, 0, 0, 0], "epoch": "2026-03-01T12:00:00Z", "frame": "EME2000"}

pytestmark = pytest.mark.usefixtures("plans_shared")

CRAFT = nutdamp.example()
Options = nutdamp.Options


def planned() -> Any:
    return nutdamp.plan(CRAFT, "two-pulse")


def python(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )


def test_importing_loads_nothing_that_takes_time(tmp_path: Path) -> None:
    code = "import sys, nutdamp; nutdamp.__version__; dir(nutdamp); print('numpy' in sys.modules)"
    assert python(tmp_path, "-c", code).stdout == "False\n"


def test_every_public_name_is_there_and_no_other() -> None:
    for name in nutdamp.__all__:
        assert getattr(nutdamp, name) is not None
    assert sorted(nutdamp.__all__) == dir(nutdamp)
    with pytest.raises(AttributeError, match="nonsense"):
        _ = nutdamp.nonsense  # type: ignore[attr-defined]


CLASSES = [
    pytest.param(value, id=name)
    for name in nutdamp.__all__
    if isinstance(value := getattr(nutdamp, name), type)
]

UNIT = re.compile(
    r"\b(rad|s|kg|m|N|Hz)\b|%|share|ratio|number|factor|unit vector|sign\b", re.IGNORECASE
)
"""Units, and words for numbers without one."""

ANGLE = re.compile(r"nutation$|cone$|shift$|axis_error|tilt$|angle$|azimuth|^largest$")
"""Names of angles: their docstrings say that they are in rad."""


@pytest.mark.parametrize("kind", CLASSES)
def test_every_public_attribute_is_documented_with_its_unit(kind: type) -> None:
    """Fields in the docstrings of their class and its bases, others in their own."""
    bases = [base for base in kind.__mro__ if base.__module__.startswith("nutdamp")]
    about = " ".join(inspect.getdoc(base) or "" for base in bases)
    fields = {name: text for base in bases for name, text in inspect.get_annotations(base).items()}
    attributes = {name for name in dir(kind) if not hasattr(Exception(), name)} | {*fields}
    for name in (name for name in sorted(attributes) if name[0] != "_"):
        member: Any = inspect.getattr_static(kind, name, None)
        getter = getattr(member, "fget", None) or getattr(member, "func", None)
        own = (getter or member).__doc__ if getter or inspect.isroutine(member) else ""
        if name in fields and getter is None:
            assert re.search(rf"\b{name}\b", about), name
            value, text = str(fields[name]), about
        else:
            assert own, name
            value, text = str(getattr(getter, "__annotations__", {}).get("return")), own
        if re.search(r"\b(float|Vector|Array)\b", value):
            assert UNIT.search(text), name
            assert not ANGLE.search(name) or "rad" in text, name


@pytest.mark.weekly
def test_a_type_checker_knows_what_comes_back(tmp_path: Path) -> None:
    lines = [
        *("import nutdamp", 'plan = nutdamp.plan(nutdamp.load("spacecraft.yaml"), "two-pulse")'),
        *("reveal_type(plan.fly().track.rates)", "plan.fly().to_csv(3)\n"),
    ]
    (tmp_path / "typed.py").write_text("\n".join(lines))
    shown = python(tmp_path, "-m", "mypy", "--strict", "typed.py").stdout
    assert "ndarray" in shown
    assert "numpy.float64" in shown or "floating" in shown
    assert (
        'typed.py:4: error: Argument 1 to "to_csv" of "Written" has incompatible type "int"'
        in shown
    )
    assert "Found 1 error" in shown


@pytest.mark.deep
def test_the_examples_of_the_readme_run(run: Run, tmp_path: Path) -> None:
    run("init")
    example, dispersion, sweep = (
        python(tmp_path, str(places.TESTS / "support" / f"library_{name}.py"))
        for name in ("example", "dispersion", "sweep")
    )
    for ran in (example, dispersion, sweep):
        assert ran.returncode == 0, ran.stderr
    assert re.match(r"\[0\.\d+ 0\.\d+\]\n0\.0\d+\n", dispersion.stdout)
    assert "<Plan two-pulse: 2 pulses until 7.434 s" in example.stdout
    assert (tmp_path / "track.csv").stat().st_size > 100_000
    lines = []
    for angle in (1, 3, 5):
        changed = ("--set", f"state.nutation={angle} deg", "--set", "limits.horizon=300 s")
        run("plan", "--nominal", "--scheme", "two-pulse", *changed, "--json", "plan.json")
        (plan,) = json.loads((tmp_path / "plan.json").read_text())["plans"]
        assert plan["flown"]["nutation_deg"] < 1e-6
        lines.append(f"{angle} deg: {plan['propellant_kg']:.5f} kg of propellant")
    assert sweep.stdout.splitlines() == lines


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
def test_every_function_has_an_example_that_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    finder = doctest.DocTestFinder()
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    for name in sorted({*nutdamp.__all__} - {"errors", "__version__"}):
        function = getattr(nutdamp, name)
        if not isinstance(function, type):
            (example,) = finder.find(function, name, globs={"nutdamp": nutdamp})
            assert example.examples, name
            assert runner.run(example).failed == 0, name


def test_every_result_shows_itself_in_one_short_line_and_as_json(tmp_path: Path) -> None:
    body = CRAFT.with_(limits={"horizon": "8 s"})
    stage = nutdamp.example("upper-stage")
    plan = planned()
    for result in (
        nutdamp.simulate(plan, 20.0),
        nutdamp.trade(body, 1, [0.0]),
        nutdamp.disperse(plan, 50, csv=tmp_path / "cases.csv"),
        nutdamp.disperse_loop(stage, 2, until=60.0),
        nutdamp.loop(stage, 60.0),
        nutdamp.verify(plan),
        nutdamp.budget(stage),
    ):
        assert re.fullmatch(r"<\w+ .{3,110}>|<\w+: .{3,80}>", repr(result))
        json.dumps(result.to_dict(), allow_nan=False)
    assert len((tmp_path / "cases.csv").read_text().splitlines()) == 51


def test_a_plan_is_of_the_scheme_named_or_the_recommended_one() -> None:
    calm = nutdamp.read("{name: X, inertia: {A: 120, C: 80}, omega0: [0.1, 0, 3]}")
    assert nutdamp.plan(calm).scheme == nutdamp.compare(calm).recommended.scheme  # type: ignore[union-attr]
    with pytest.raises(errors.Infeasible):
        nutdamp.plan(CRAFT.with_(limits={"horizon": "1 ms"}))
    by_keyword = nutdamp.plan(CRAFT, "four-pulse", on_time=0.2)
    assert by_keyword.to_dict() == nutdamp.plan(CRAFT, "four-pulse", Options(on_time=0.2)).to_dict()
    assert by_keyword.pulses[0].on_time == 0.2


@pytest.mark.parametrize(
    ("words", "goal"),
    [
        ("--target 10deg,45deg", {"target": "10deg,45deg"}),
        ("--target 10deg,45deg", {"target": ("10 deg", math.radians(45.0))}),
        ("--target 0.1745,1", {"target": np.array([0.1745, 1.0])}),
        ("--spin 31.5rpm", {"spin": "31.5 rpm"}),
        ("--spin 3.5", {"spin": np.float64(3.5)}),
        ("--spin keep --target 0.2,0", {"spin": "keep", "target": (0.2, 0)}),
    ],
)
def test_a_goal_is_given_as_on_the_command_line(run: Run, words: str, goal: dict[str, Any]) -> None:
    shown = run(*f"plan -q --nominal --scheme two-pulse {words} --json -".split(), status=None)
    compared = nutdamp.compare(CRAFT, ["two-pulse"], samples=0, **goal)
    assert written(compared.to_dict()) == json.loads(shown.stdout)
    (plan,) = compared
    assert nutdamp.plan(CRAFT, "two-pulse", **goal).to_dict() == plan.to_dict()


def test_a_goal_beside_the_file_is_doubted_and_refused_by_its_name() -> None:
    calls: list[dict[str, Any]] = [
        {"target": "10deg"},
        {"target": "10,5deg,45deg"},
        {"target": (1.0, 2.0, 3.0)},
        {"target": 0.2},
        {"target": ("200 deg", 0)},
        {"target": ("1 s", 0)},
        {"spin": "0rpm"},
        {"spin": "fast"},
        {"spin": -3},
        {"spin": [3]},
    ]
    messages = [refusal(errors.BadRequest, LIB.plan, CRAFT, "none", **goal) for goal in calls]
    check_text("library.goals-refused", "\n".join(messages))
    with pytest.warns(UserWarning, match="^spin: 30 is read as 30 rad/s"):
        nutdamp.plan(CRAFT, "none", spin="30")
    with pytest.warns(UserWarning, match=r"^target: 10 is read as 10 rad \(573 deg\)"):
        nutdamp.plan(CRAFT.with_(attitude=IN_SKY), "none", target="10,0")


def test_a_plan_to_a_goal_beside_the_file_is_carried_on() -> None:
    """With the goal of the file, as by ``-o``."""
    plan = nutdamp.plan(CRAFT, "half-cone", target="10deg,45deg")
    later = plan.carried()
    assert later.goal.axis is None
    assert nutdamp.plan(later, "none", target="10deg,45deg").spacecraft.goal.axis is not None


@pytest.mark.deep
def test_a_robust_plan_needs_no_comparison() -> None:
    body = CALM.with_(
        omega0=[0.1, 0, 3],
        steerable={"torque": "40 N m"},
        requirement={"nutation": "0.5 deg"},
        dispersions={"thrust": {"normal": "5 %"}},
    )
    own, compared = nutdamp.robust(body), nutdamp.robust(nutdamp.compare(body, robust=False))
    assert own.to_dict() == compared.to_dict()
    assert own.verdict.met


def test_there_is_one_type_of_each_name() -> None:
    """What the library gives is what the modules below make, not something around it."""
    compared = nutdamp.compare(CRAFT, ["two-pulse"], samples=0)
    (plan,) = compared.plans
    kinds = (nutdamp.Spacecraft, planning.Plan, nutdamp.Comparison, propagation.Flight)
    for made, kind in zip((CRAFT, plan, compared, plan.fly()), kinds, strict=True):
        assert type(made) is kind is getattr(nutdamp, kind.__name__)
    assert plan.spacecraft is plan.fly().spacecraft is CRAFT
    assert planning.plan(CRAFT, "two-pulse").to_dict() == plan.to_dict()


def test_every_residual_carries_the_name_of_its_model() -> None:
    plan = planned()
    models = ("impulse sum (17)", "real pulse widths")
    for residual, by_impulses, model in zip(
        (plan.residual, plan.flown), (True, False), models, strict=True
    ):
        again = plan.fly(by_impulses=by_impulses).residual
        assert residual is not None
        assert residual.model == again.model == model
        assert again.nutation == pytest.approx(residual.nutation, abs=1e-12)


def test_numbers_of_numpy_are_numbers() -> None:
    plan = nutdamp.plan(CRAFT, "four-pulse", Options(on_time=np.float64(0.5), per_turn=np.int64(2)))
    assert max(np.asarray(plan)["on_time_s"]) == 0.5
    assert len(plan.fly(until=np.float64(3.0), samples=np.int64(5)).track.t) >= 5  # type: ignore[arg-type]


def test_a_dict_is_read_as_the_file_is() -> None:
    text = TILTED + "limits: {horizon: 100 s, max_pulses: 3}\n"
    assert nutdamp.load(KEYS).to_dict() == nutdamp.read(text).to_dict()
    assert nutdamp.load(KEYS, set={"limits.horizon": 50.0}).limits.horizon == 50.0
    assert nutdamp.load({**KEYS, "name": "1e3"}).name == "1e3"
    assert nutdamp.example("ace").name == "ACE"
    with refused(errors.FaultyFile, "library.faulty-dict"):
        nutdamp.load({"nam": "X", "inertia": {"A": "120 s", "C": 80}, "omega0": [0, 0, 3]})


@spread("path", sorted(places.CONFIGS.glob("*.yaml")), quick=6, deep=13)
def test_what_yaml_makes_of_a_file_is_read_as_the_file(path: Path) -> None:
    """Moments and numbers such as 42e-3, too."""
    text = path.read_text(encoding="utf-8")
    assert nutdamp.load(yaml.safe_load(text)).to_dict() == nutdamp.read(text).to_dict()


@pytest.mark.parametrize(
    ("moment", "epoch"),
    [
        (datetime(2026, 3, 1, 12, 0), "2026-03-01T12:00:00"),
        (
            datetime(2026, 3, 1, 13, 30, 0, 500, timezone(timedelta(hours=1.5))),
            "2026-03-01T12:00:00.0005Z",
        ),
    ],
)
def test_moments_of_python_are_epochs_in_utc(moment: datetime, epoch: str) -> None:
    timed, written = (
        {"quaternion": [1, 0, 0, 0], "epoch": at, "frame": "EME2000"} for at in (moment, epoch)
    )
    expected = CRAFT.with_(attitude=written).utc(10.0)
    assert nutdamp.load({**KEYS, "attitude": timed}).utc(10.0) == expected
    assert CRAFT.with_(attitude=timed).utc(10.0) == expected
    assert nutdamp.load(KEYS, set={"attitude": timed}).utc(10.0) == expected
    assert nutdamp.load({**KEYS, "name": moment.date()}).name == "2026-03-01"


def test_each_refusal_of_a_value_names_its_key() -> None:
    nested: list[object] = []
    nested.append(nested)
    messages = [
        refusal(nutdamp.NutdampError, call)
        for call in [
            lambda: LIB.load({**KEYS, "mass": object()}),
            lambda: LIB.load({**KEYS, "thrusters": [{"name": "T1", "force": 1 + 2j}]}),
            lambda: LIB.load({**KEYS, "limits": {"blackout": nested}}),
            lambda: LIB.load({**KEYS, "attitude": {"epoch": date(2026, 3, 1)}}),
            lambda: LIB.load(KEYS, set={"mass": 1j}),
            lambda: LIB.load(KEYS, set={"limits.blackout": [[1, object()]]}),
            lambda: CRAFT.with_(limits={"blackout": [[1, ...]]}),
            lambda: LIB.load({**KEYS, "mass": "5"}),
        ]
    ]
    check_text("library.keys-named", "\n".join(messages))


def test_with_changes_the_keys_named_and_no_others(tmp_path: Path) -> None:
    first = nutdamp.load(KEYS).with_(
        limits={"horizon": "300 s"}, requirement={"momentum_shift": "1 deg"}
    )
    assert (first.limits.horizon, first.limits.max_pulses) == (300.0, 3)
    assert present(first.requirement).nutation == pytest.approx(math.radians(0.5))
    again = first.with_(limits={"max_pulses": 2})
    assert (again.limits.horizon, again.limits.max_pulses, first.limits.max_pulses) == (300.0, 2, 3)
    changed = CRAFT.with_(state={"nutation": "8 deg"}, thrusters={"+M1": {"force": 12.0}})
    assert changed.nutation == pytest.approx(math.radians(8.0))
    assert changed.omega0[2] == CRAFT.omega0[2]
    forces = {each.name: each.thrust for channel in changed.channels for each in channel.thrusters}
    assert (forces["+M1"], forces["-M1"]) == (12.0, 10.0)
    (tmp_path / "own.yaml").write_text(TILTED)
    held = nutdamp.load(tmp_path / "own.yaml", set={"steerable.isp": 200.0})
    compared = nutdamp.compare(held, ["two-pulse"])
    for body in (
        held,
        compared["two-pulse"].spacecraft,
        nutdamp.plan(held, "none").fly(3.0).spacecraft,
    ):
        named = body.with_(name="Other", mass=3)
        assert (named.name, named.mass, present(named.steerable).isp) == ("Other", 3.0, 200.0)


def test_fields_are_replaced_in_si() -> None:
    lighter = CRAFT.replace(mass=np.float64(200.0), omega0=[0.1, 0.0, 3])
    assert (lighter.mass, lighter.name, lighter.rates.tolist()) == (
        200.0,
        CRAFT.name,
        [0.1, 0.0, 3.0],
    )
    assert nutdamp.plan(lighter, "two-pulse").feasible
    assert CRAFT.mass != 200.0
    assert (CRAFT.source is None, lighter.source is None) == (
        False,
        True,
    )  # it is no longer what its file says


CALM = nutdamp.read("name: X\ninertia: {A: 120, C: 80}\nomega0: [0, 0, 3]\n")
LIB: Any = nutdamp
Call = Callable[[], object]


@pytest.mark.usefixtures("plans_shared")
def test_a_wrong_argument_is_reported_with_what_was_expected() -> None:
    messages = (
        refusal(errors.BadRequest, call).partition("; there are ")[0]
        for call in [
            lambda: LIB.plan(CRAFT, "rhumb-line", Options(per_turn=0)),
            lambda: LIB.plan(CRAFT, "half-cone", Options(cones=-3)),
            lambda: LIB.plan(CRAFT, "optimal", Options(shift=-0.1)),
            lambda: LIB.plan(CRAFT, "optimal", Options(least="fuel")),
            lambda: LIB.compare(CRAFT, ["optimal"], Options(shift=0.1, free_axis=True)),
            lambda: LIB.plan(CRAFT, "four-pulse", Options(on_time=-1.0)),
            lambda: LIB.plan(CRAFT, "four-pulse", Options(on_time=math.nan)),
            lambda: LIB.plan(CRAFT, "four-pulse", Options(on_time="3 s")),
            lambda: LIB.plan(CRAFT, "four-pulse", Options(coarse=1)),
            lambda: LIB.plan(CRAFT, "four-pulse", Options(length=0.2)),
            lambda: LIB.plan(CRAFT, "four-pulse", nutdamp.OptimalOptions(least="time")),
            lambda: LIB.plan(CRAFT, "four-pulse", {"on_time": 3}),
            lambda: LIB.plan(CRAFT, "three-pulse"),
            lambda: LIB.plan(CALM, "three-pulse"),  # where no nutation is to be damped, too
            lambda: LIB.plan(CRAFT, np.zeros(2)),
            lambda: LIB.compare(CRAFT, ["three-pulse"]),
            lambda: LIB.compare(CRAFT, "two-pulse"),
            lambda: LIB.plan("spacecraft.yaml", "two-pulse"),
            lambda: LIB.compare(planned()),
            lambda: LIB.compare(CRAFT, samples=-1),
            lambda: LIB.compare(CRAFT, samples=2.5),
            lambda: LIB.compare(CRAFT, samples="all"),
            lambda: LIB.read({"name": "X"}),
            lambda: LIB.load(3),
            lambda: LIB.load(b"x"),
            lambda: LIB.load("x", set={3: 4}),
            lambda: LIB.load({"name": object()}),
            lambda: LIB.load_schedule(3, CRAFT),
            lambda: CRAFT.with_(limits={"horizon": ...}),
            lambda: CRAFT.with_(limits={3: 4}),
            lambda: CRAFT.replace(mass=3).with_(name="X"),
            lambda: CRAFT.replace(mass="3 kg"),
            lambda: CRAFT.replace(omega0=(0.1, 3.0)),
            lambda: CRAFT.replace(channels=("+M1",)),
            lambda: CRAFT.replace(weight=3),
            lambda: CRAFT.replace(mass=-3),
            lambda: LIB.plan(CRAFT, "four-pulse", per_turn=2),
            lambda: LIB.plan(CRAFT, "four-pulse", Options(on_time=1.0), on_time=0.2),
            lambda: LIB.simulate(planned(), -1.0),
            lambda: LIB.robust(planned()),
            lambda: LIB.robust(CALM),
            lambda: LIB.loop(CRAFT),
            lambda: LIB.loop(nutdamp.example("upper-stage"), case=0),
            lambda: LIB.report(planned()),
            lambda: LIB.report(CRAFT, "page.txt"),
            lambda: LIB.report(CRAFT, "page.html", disperse=-1),
            lambda: LIB.trade(CRAFT, 0),
            lambda: LIB.trade(CRAFT, allow=0.1),
            lambda: LIB.trade(CRAFT, allow=[-0.1]),
            lambda: LIB.trade(CRAFT, least="time"),
            lambda: LIB.verify("two-pulse"),
            lambda: LIB.disperse(nutdamp.plan(nutdamp.read(TILTED), "none")),
            lambda: LIB.export(planned(), "oem", "x"),
            lambda: LIB.example("lunar-prospecter"),
            lambda: LIB.disperse_loop(CRAFT, 40, seed=-1),
            lambda: planned().fly(until=-1.0),
            lambda: planned().fly(until="3"),
            lambda: planned().fly(samples=1),
            lambda: planned().fly(samples=2.5),
            lambda: planned().to_csv(3),
            lambda: planned().fly().figure("portrait"),
            lambda: planned().fly().figure([]),
        ]
    )
    check_text("library.wrong-arguments", "\n".join(messages))
    for below in (planning.plan, planning.alternatives):
        with pytest.raises(KeyError):
            below(CRAFT, "three-pulse")


def test_what_cannot_be_says_so_in_an_error_of_the_package(tmp_path: Path) -> None:
    infeasible = nutdamp.plan(
        nutdamp.read("name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n"), "four-pulse"
    )
    assert not infeasible.feasible
    assert len(np.asarray(infeasible)) == len(infeasible) == 0
    calls: list[tuple[type[Exception], Call]] = [
        (errors.CannotRead, lambda: nutdamp.load(tmp_path / "missing.yaml")),
        (errors.FaultyFile, lambda: nutdamp.read("name: X\n")),
        (errors.Infeasible, infeasible.fly),
        (errors.Infeasible, lambda: infeasible.to_csv(tmp_path / "pulses.csv")),
        (errors.CannotWrite, lambda: planned().to_csv(tmp_path / "no" / "pulses.csv")),
    ]
    for kind, call in calls:
        with pytest.raises(kind):
            call()
        assert issubclass(kind, nutdamp.NutdampError)
    assert list(tmp_path.iterdir()) == []
    keys: list[dict[str, Any]] = [
        {"limits": {"horizon": "3 kg"}},
        {"limit": {"horizon": 3}},
        {"limits": "soon"},
    ]
    for number, each in enumerate([*keys, {"thrusters": {"T9": {"force": 3}}}]):
        with refused(errors.FaultyFile, f"library.with-{number}"):
            CRAFT.with_(**each)


FOLDER = places.TESTS / "benchmarks"
CLOCKS = re.compile(
    r"\btimeout *=|\bperf_counter\b|\bmonotonic\b|\btime\.time\b|\bprocess_time\b|\bsetitimer\b"
)
MEASURING = {"benchmarks", Path(__file__).name}


@pytest.fixture(scope="module")
def run_py() -> dict[str, Any]:
    return runpy.run_path(str(FOLDER / "run.py"))


def test_their_files_are_sound(run_py: dict[str, Any]) -> None:
    body = read_spacecraft(run_py["DISPERSED"], "dispersed.yaml")
    inputs = list_inputs(body, plan(body, "two-pulse").pulses)
    assert (len(inputs.drawn), inputs.unused) == (11, ())
    for channels, periods in ((4, 40.0), (16, 100.0)):
        body = read_spacecraft(run_py["fan"](channels, periods), "fan.yaml")
        assert len(body.channels) == channels
        assert body.horizon / body.body_period == pytest.approx(periods)
    names = {*run_py["BASES"], *(process.name for process in run_py["PROCESSES"])}
    for process in run_py["PROCESSES"]:
        assert process.against in names
    for process in (*run_py["PROCESSES"], *run_py["JOBS"]):
        files = {part for part in process.arguments if part.endswith(".yaml")}
        assert all(
            Path(part).is_file() for part in files - {"four.yaml", "sixteen.yaml", "dispersed.yaml"}
        )


def test_peers_fly_the_same_cases(
    run_py: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "dispersed.yaml").write_text(run_py["DISPERSED"], encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    works = runpy.run_path(str(FOLDER / "inside.py"))[
        "works"
    ]()  # compares solve_ivp with the flight on the way
    assert works["one flight"]() == works["solve_ivp"]() > 10


def test_the_table_of_the_readme_and_missed_limits(run_py: dict[str, Any]) -> None:
    row, line = run_py["Row"], run_py["line"]
    rows = [row("plan", 0.25, 3.04, "import numpy"), row("a case", 3e-7, 5432.1, "faster than it")]
    assert run_py["markdown"](rows).splitlines()[2:] == [
        "| plan | 250 ms | 3.0 × import numpy |",
        "| a case | 300 ns | 5,432 × faster than it |",
    ]
    for ratio, memory, missed in ((1.4, 200.0, False), (1.6, 200.0, True), (1.4, 260.0, True)):
        text = line(row("name", 0.1, ratio, "import numpy", 1.5, memory=memory, memory_limit=250.0))
        assert ("MISSED" in text) is missed
    for ratio, missed in ((4000.0, True), (6000.0, False)):
        assert (
            "MISSED" in line(row("name", 1e-7, ratio, "faster than it", 5000.0, at_least=True))
        ) is missed


def test_no_test_looks_at_a_clock() -> None:
    sources = [
        path
        for path in places.TESTS.rglob("*.py")
        if not MEASURING & {*path.relative_to(places.TESTS).parts}
    ]
    lines = [
        f"{path}:{number}: {line.strip()}"
        for path in sources
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if CLOCKS.search(line)
    ]
    assert len(sources) > 50
    assert lines == []


# --- plans, flights and studies: arrays in the axes of the file, and what the commands write


def written(data: object) -> object:
    """As JSON has it."""
    return json.loads(json.dumps(data, allow_nan=False))


def test_files_are_those_of_the_command_line(run: Run, tmp_path: Path) -> None:
    run("plan", "--nominal", "--scheme", "two-pulse", "--csv", "pulses.csv", "--json", "plan.json")
    run("simulate", "--scheme", "two-pulse", "--flown", "--csv", "flown.csv")
    run("simulate", "--scheme", "two-pulse", "--csv", "impulses.csv")
    plan = nutdamp.plan(CRAFT, "two-pulse")
    made = {"pulses": plan, "flown": plan.fly(), "impulses": plan.fly(by_impulses=True)}
    for name, each in made.items():
        each.to_csv(tmp_path / "own.csv")
        assert (tmp_path / "own.csv").read_bytes() == (tmp_path / f"{name}.csv").read_bytes()
    assert nutdamp.compare(CRAFT, ["two-pulse"], samples=0).to_dict() == json.loads(
        (tmp_path / "plan.json").read_text()
    )


@pytest.mark.deep
def test_a_comparison_has_the_numbers_of_the_command(run: Run) -> None:
    """With dispersed cases, too."""
    schemes = ("two-pulse", "four-pulse")
    shown = json.loads(
        run(
            "plan", *(part for each in schemes for part in ("--scheme", each)), "--json", "-"
        ).stdout
    )
    assert written(nutdamp.compare(CRAFT, schemes).to_dict()) == shown
    assert [plan["meets_requirement"] for plan in shown["plans"]] == [True, False]
    assert shown["decision"]["cases"]["samples"] == 20_000


def test_arrays_and_data_frames_have_the_columns_of_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = nutdamp.plan(nutdamp.read(TILTED), "two-pulse")
    made: Any
    for made, header in ((plan, schedules.PULSES_HEADER), (plan.fly(samples=50), tabular.HEADER)):
        array = np.asarray(made)
        assert array.dtype.names == header
        made.to_csv(tmp_path / "rows.csv")
        rows = list(csv.reader(io.StringIO((tmp_path / "rows.csv").read_text())))[1:]
        for mine, row in zip(array.tolist(), rows, strict=True):
            assert [str(cell) for cell in mine] == [cell or "nan" for cell in row]
    pandas = types.ModuleType("pandas")
    pandas.DataFrame = dict  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "pandas", pandas)
    flight = plan.fly(samples=50)
    array, frame = flight.to_numpy(), flight.to_pandas()
    assert tuple(frame) == array.dtype.names
    assert all(np.array_equal(frame[name], array[name]) for name in frame)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with refused(nutdamp.NutdampError, "library.no-pandas"):
        flight.to_pandas()
    with pytest.raises(ImportError):
        flight.to_pandas()


PUBLIC = """
spacecraft scheme schedule pulses options feasible why verdict notes meets_requirement propellant
total_impulse end residual flown fly simulate carried to_dict to_csv figure
"""


REASONS = ("refusal", "breach", "astray", "worse", "worse_at", "found_none")


def test_a_plan_has_few_names_and_the_former_ones_warn(monkeypatch: pytest.MonkeyPatch) -> None:
    pandas = types.ModuleType("pandas")
    pandas.DataFrame = dict  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "pandas", pandas)
    plan = planned()
    assert [name for name in dir(plan) if name[0] != "_"] == sorted(PUBLIC.split())
    for name, cure in results.FORMER.items():
        with pytest.warns(DeprecationWarning, match=f"^{name} of a plan goes .*{re.escape(cure)}"):
            former = getattr(plan, name)
        if name not in REASONS:
            own = getattr(plan, "notes" if name == "remarks" else f"_{name}")
            assert former is own or repr(former) == repr(own), name
    for why, expected in (
        (None, (None, None, None, None, 0.0, False)),
        (NotFound("because"), ("because", None, None, None, 0.0, True)),
        (Worse(0.1, 2.0), (None, None, None, 0.1, 2.0, False)),
    ):
        without = replace(plan, schedule=None, _why=why)
        with pytest.warns(DeprecationWarning, match="of a plan goes"):
            assert tuple(getattr(without, name) for name in REASONS) == expected
    with pytest.warns(DeprecationWarning, match="to_numpy") as warned:
        assert np.array_equal(plan.to_numpy(), np.asarray(plan))
    assert warned[0].filename == __file__
    with pytest.warns(DeprecationWarning, match="to_pandas"):
        assert tuple(plan.to_pandas()) == np.asarray(plan).dtype.names
    with pytest.raises(AttributeError, match="'Plan' object has no attribute 'flights'"):
        _ = plan.flights
    assert (
        plan.simulate(20.0, flown=True).to_dict()
        == nutdamp.simulate(plan, 20.0, flown=True).to_dict()
    )


SCATTERED: dict[str, Any] = {
    "dispersions": {"omega0": {"normal": "0.05 deg/s"}, "thrust": {"normal": "5 %"}},
    "attitude": IN_SKY,
    "sun": [0.0, 0.0],
    "keep": [{"name": "Sun", "direction": "sun", "min": "1 deg"}],
}


@pytest.mark.parametrize("spin", [None, "keep"])
def test_dispersed_cases_are_rows_of_their_file(
    spin: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = nutdamp.plan(CRAFT.with_(**SCATTERED), "two-pulse", spin=spin)
    flown = nutdamp.disperse(plan, 50, seed=3, csv=tmp_path / "own.csv")
    cases = flown.to_numpy()
    header, *rows = csv.reader(io.StringIO((tmp_path / "own.csv").read_text()))
    assert cases.dtype.names == tuple(header)
    assert cases["case"].tolist() == [*range(1, 51)]
    assert [[str(cell) for cell in case] for case in cases.tolist()] == rows
    assert ("spin_error_rad_s" in header, "Sun_least_deg" in header) == (spin is not None, True)
    flown.to_csv(tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "own.csv").read_bytes()
    pandas = types.ModuleType("pandas")
    pandas.DataFrame = dict  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "pandas", pandas)
    assert tuple(flown.to_pandas()) == tuple(header)


def test_percentiles_are_those_of_the_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = nutdamp.plan(CRAFT.with_(**SCATTERED), "two-pulse")
    flown = nutdamp.disperse(plan, 3_000)
    cases = flown.to_numpy()
    levels = flown.percentiles([0, 2.5, 50, 100])
    names = present(cases.dtype.names)
    assert levels.dtype.names == ("percent", *names[names.index("nutation_deg") :])
    for name in names[names.index("nutation_deg") :]:
        assert levels[name] == pytest.approx(np.percentile(cases[name], levels["percent"]))
    usual, shown = flown.percentiles(), flown.to_dict()["percentiles"]["propellant_kg"]
    assert usual["propellant_kg"].tolist() == [shown[f"{level:g}"] for level in usual["percent"]]
    assert flown.percentiles(50).tolist() == flown.percentiles([50]).tolist()
    refusals = [
        refusal(errors.BadRequest, flown.percentiles, wrong)
        for wrong in (101, [-1], "50", [None], math.nan)
    ]
    check_text("library.levels", "\n".join(refusals))
    monkeypatch.setattr(study, "EXACT_CASES", 2_000)  # beyond it cases are counted
    counted = nutdamp.disperse(plan, 3_000)
    for name in present(levels.dtype.names):
        assert counted.percentiles(levels["percent"])[name] == pytest.approx(levels[name], rel=3e-3)
    for refusing in (counted.to_numpy, partial(counted.to_csv, "cases.csv")):
        with refused(errors.BadRequest, "library.cases-counted"):
            refusing()


def test_percentiles_of_what_is_not_known_are_none() -> None:
    """An ideal torquer has no propellant."""
    body = CALM.with_(omega0=[0.1, 0, 3], dispersions={"omega0": {"normal": "0.05 deg/s"}})
    flown = nutdamp.disperse(nutdamp.plan(body, "two-pulse"), 50)
    assert np.isnan(flown.percentiles()["propellant_kg"]).all()
    assert np.isfinite(flown.percentiles()["nutation_deg"]).all()


def test_the_track_is_in_the_axes_of_the_file() -> None:
    craft = nutdamp.read(TILTED)
    tensor = np.array([[120.0, 3, 6], [3, 118, -4], [6, -4, 80]])
    made = nutdamp.plan(craft, "none").fly(until=5.0, samples=200)
    track = made.track
    assert track.rates[0] == pytest.approx([0.2, 0.1, 3.0], abs=1e-14)
    assert craft.rates == pytest.approx([0.2, 0.1, 3.0], abs=1e-14)
    # H = R I ω stays where it is, with the tensor as the file has it.
    turn = Rotation.from_quat(np.roll(track.quaternion, -1, axis=1)).as_matrix()
    momentum = np.einsum("nij,nj->ni", turn, track.rates @ tensor)
    assert momentum == pytest.approx(np.broadcast_to(momentum[0], momentum.shape), abs=1e-9)
    assert momentum == pytest.approx(track.momentum, abs=1e-9)
    assert made.to_numpy()["omega_1_rad_s"] == pytest.approx(track.rates[:, 0], abs=0.0)


def test_a_written_schedule_is_read_as_a_plan(tmp_path: Path) -> None:
    plan = nutdamp.plan(CRAFT, "four-pulse")
    plan.to_csv(tmp_path / "pulses.csv")
    again = nutdamp.load_schedule(tmp_path / "pulses.csv", CRAFT)
    assert again.fly().residual == plan.fly().residual
    assert again.propellant == pytest.approx(plan.propellant, rel=1e-12)
    (tmp_path / "edited.csv").write_text(
        (tmp_path / "pulses.csv").read_text().replace("-M1", "+M9")
    )
    with pytest.warns(UserWarning, match=r"\+M9"):
        nutdamp.load_schedule(tmp_path / "edited.csv", CRAFT)


def test_the_recommended_plan_is_one_of_those_compared() -> None:
    compared = nutdamp.compare(CRAFT, samples=0)
    assert [plan.scheme for plan in compared] == ["one-pulse", "two-pulse", "four-pulse", "optimal"]
    assert compared.recommended is not None
    chosen = compared[compared.recommended.scheme]
    assert chosen.meets_requirement
    assert chosen.flown == compared.recommended.flown
    assert chosen.total_impulse >= CRAFT.least_impulse * (1 - 1e-12)
    with pytest.raises(KeyError):
        compared["half-cone"]


def test_so_many_dispersed_cases_as_are_requested_decide() -> None:
    """Those of `disperse`; with the plans that it is not about so few of them as it takes."""
    nominal, compared = (
        nutdamp.compare(CRAFT, ["four-pulse", "two-pulse"], samples=count) for count in (0, 2_100)
    )
    assert nominal.recommended is nominal["four-pulse"]
    assert (nominal.flown, nominal.cases, nominal.verdict.cases, nominal.verdict.results) == (
        None,
        {},
        None,
        None,
    )
    assert [nominal.verdicts[plan].met for plan in nominal] == [True, True]
    chosen, other = compared["two-pulse"], compared["four-pulse"]
    assert compared.recommended is chosen
    assert [plan.meets_requirement for plan in compared] == [True, True]
    assert [compared.verdicts[plan].status.value for plan in (chosen, other)] == [
        "fly",
        "not-enough",
    ]
    cases, few = compared.cases[chosen], compared.cases[other]
    assert (cases.samples, cases.final, cases.enough) == (2_100, True, True)
    assert cases.complying == nutdamp.disperse(chosen, 2_100).met_fraction == 1.0
    assert 0.997 < cases.low < cases.high == 1.0
    assert (few.samples, few.final, few.enough) == (2_048, False, False)
    assert few.high < 0.997


def test_dictionaries_hold_no_number_that_json_has_not() -> None:
    """A sphere has no nutation period in the body, and an ideal torquer no torque and no
    propellant.
    """
    ball = nutdamp.read(
        "name: Ball\ninertia: {A: 100, C: 100}\nstate: {spin: 3, nutation: 5 deg}\n"
    )
    compared = nutdamp.compare(ball)
    assert ball.to_dict()["body_nutation_period_s"] is None
    for each in (ball, compared, *compared):
        written(each.to_dict())


@pytest.fixture
def dispersed(tmp_path: Path) -> Path:
    shutil.copy(places.CONFIGS / "single-thruster.yaml", tmp_path / "spacecraft.yaml")
    return tmp_path


@pytest.mark.weekly
def test_studies_have_the_numbers_of_the_commands(run: Run, dispersed: Path) -> None:
    craft = nutdamp.load(dispersed / "spacecraft.yaml")
    chosen = present(nutdamp.compare(craft).recommended)
    chosen.to_csv(dispersed / "pulses.csv")
    held = nutdamp.load_schedule(dispersed / "pulses.csv", craft)
    for command, made in (
        (
            ("disperse", "--samples", "200", "--seed", "3"),
            nutdamp.disperse(chosen, 200, seed=3).to_dict(),
        ),
        (("verify",), nutdamp.verify(chosen).to_dict()),
        (
            ("verify", "--schedule", "pulses.csv"),
            {**nutdamp.verify(held).to_dict(), "scheme": "pulses.csv"},
        ),
    ):
        run(*command, "--json", "own.json", status=(0, 4))
        assert json.loads((dispersed / "own.json").read_text()) == written(made)


def test_a_trade_has_the_numbers_of_the_command(run: Run) -> None:
    changed = {"limits": {"horizon": "8 s"}}
    options = (
        "--points",
        "2",
        "--allow",
        "0",
        "--least",
        "impulse",
        "--set",
        "limits.horizon=8 s",
        "--json",
        "-",
    )
    found = nutdamp.trade(CRAFT.with_(**changed), points=2, allow=(0.0,), least="impulse")
    assert written(found.to_dict()) == json.loads(run("trade", *options).stdout)
    assert len(found.plans) == len(found.fronts[0].points) > 0
    assert all(plan.feasible for plan in found.plans)


def test_an_export_is_that_of_the_command(run: Run, tmp_path: Path) -> None:
    attitude = {"quaternion": [1, 0, 0, 0], "epoch": "2026-03-01T12:00:00Z", "frame": "EME2000"}
    timed = "attitude={quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: EME2000}"
    plan = nutdamp.plan(CRAFT.with_(attitude=attitude), "two-pulse")
    for form, name in (
        ("stk", "x.a"),
        ("basilisk", "x.py"),
        ("json", "x.json"),
        ("aem", "x.xml"),
        ("apm", "x.apm"),
    ):
        run(
            "export",
            "--format",
            form,
            "--scheme",
            "two-pulse",
            "--set",
            timed,
            "-o",
            f"command-{name}",
        )
        nutdamp.export(plan, form, tmp_path / name)
        texts = [(tmp_path / file).read_text() for file in (name, f"command-{name}")]
        mine, its = (
            re.sub(r"(CREATION_DATE|MESSAGE_ID)( *= *|>)[^<\n]*", r"\1", text) for text in texts
        )
        assert mine == its


@pytest.mark.weekly
def test_a_report_is_that_of_the_command(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.yaml").write_text(TILTED)
    chosen = ("--scheme", "two-pulse", "--set", "limits.horizon=100 s")
    assert run("report", "own.yaml", *chosen, "-o", "command.html").returncode == 0
    craft = nutdamp.load("own.yaml", set={"limits.horizon": "100 s"})
    made = nutdamp.report(craft, tmp_path / "own.html", ["two-pulse"])
    texts = [(tmp_path / name).read_text() for name in ("own.html", "command.html")]
    assert (made.content, made.good) == (texts[0], True)
    assert made.verdict.status.value == "fly"
    assert re.match(r"FLY two-pulse: .*\. Met with nominal values\.", made.summary)
    assert made.comparison["two-pulse"].feasible
    mine, its = (re.sub(r"<pre>nutdamp.*report.*</pre>", "", text) for text in texts)
    assert mine == its
    again = nutdamp.report(
        {**KEYS, "limits": {"horizon": "100 s"}}, tmp_path / "dict.html", ["two-pulse"]
    )
    assert again.summary == made.summary
    assert str(again.content).startswith("<!DOCTYPE html>")


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
def test_a_report_of_replaced_fields_names_no_file(tmp_path: Path) -> None:
    nutdamp.report(CRAFT.replace(name="Other"), tmp_path / "own.html", ["two-pulse"])
    text = (tmp_path / "own.html").read_text()
    assert "<h1>Other · damp" in text
    assert not parsed(text).all("a")
    assert (
        f"nutdamp.report(spacecraft, {str(tmp_path / 'own.html')!r}, ['two-pulse'])"
        in parsed(text).text
    )


@pytest.mark.weekly
def test_a_report_disperses_as_disperse_does(dispersed: Path) -> None:
    craft = nutdamp.load(dispersed / "spacecraft.yaml")
    options = nutdamp.Options(on_time=0.2)
    made = nutdamp.report(craft, dispersed / "own.html", options=options, disperse=200)
    text = (dispersed / "own.html").read_text()
    assert ", options=nutdamp.Options(on_time=0.2), disperse=200)" in text
    share = nutdamp.disperse(present(made.comparison.recommended), 200).met_fraction
    assert present(made.verdict.cases).complying == share
    assert "cases: 200, seed 1" in text


@pytest.mark.deep
def test_flights_comparisons_and_plans_draw_themselves() -> None:
    compared = nutdamp.compare(CRAFT, ["two-pulse", "four-pulse"], samples=500)
    plan = compared["two-pulse"]
    assert [len(plan.fly().figure(name).axes) for name in ("motion", "overview")] == [2, 5]
    assert len(plan.figure("motion").axes) >= 2
    assert present(compared.recommended).scheme in compared.figure("motion").get_suptitle()
    for name in ("history", "schemes"):
        with refused(errors.BadRequest, f"library.no-figure-{name}"):
            compared.figure(name)
    with refused(errors.Infeasible, "library.no-figure-infeasible"):
        nutdamp.plan(CRAFT.with_(limits={"horizon": "1 ms"}), "two-pulse").figure()


@pytest.mark.deep
def test_studies_draw_themselves_and_write_their_rows(tmp_path: Path) -> None:
    stage = nutdamp.example("upper-stage")
    plan = nutdamp.plan(CRAFT, "two-pulse")
    budget = nutdamp.budget(stage)
    simulated = nutdamp.simulate(plan, 20.0, samples=50)
    for result in (budget, simulated, nutdamp.loop(stage, 60.0), nutdamp.disperse(plan, 50)):
        assert result.figure().axes
    for rows in (budget, simulated):
        rows.to_csv(tmp_path / "rows.csv")
        assert (tmp_path / "rows.csv").read_text().count("\n") > 1
    assert len(simulated.to_numpy()) == (tmp_path / "rows.csv").read_text().count("\n") - 1


class Tags(HTMLParser):
    """Those that are open, and all that were seen."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:  # noqa: ARG002
        self.open.append(tag)
        self.seen.add(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.mark.deep
def test_notebooks_show_a_headline_bounds_a_table_and_a_picture() -> None:
    craft = nutdamp.read(TILTED.replace("Tilted", "'<b>&\"'"))
    scattered = CALM.with_(
        omega0=[0.1, 0, 3],
        steerable={"torque": "40 N m"},
        requirement={"nutation": "0.5 deg"},
        dispersions={"thrust": {"normal": "1 %"}},
    )
    compared = nutdamp.compare(craft)
    plan = compared["two-pulse"]
    dispersed = nutdamp.disperse(nutdamp.plan(scattered, "two-pulse"), 2_100)
    rows: list[tuple[Any, str, int, bool]] = [
        (craft, "", 1, False),
        (plan.fly(), "", 1, True),
        (plan.simulate(9.0), "", 1, True),
        (plan, "FLY two-pulse: pulses 2", 2, True),
        (compared, "FLY", 2, True),
        (nutdamp.plan(craft, "four-pulse"), "NO PLAN: ", 0, False),
        (nutdamp.loop(nutdamp.example("upper-stage"), 60.0), "ENOUGH: met", 2, True),
        (dispersed, "FLY two-pulse: pulses 2", 2, True),
        (nutdamp.robust(scattered), "FLY", 2, True),
    ]
    for shown, headline, tables, drawn in rows:
        tags = Tags()
        text = present(shown._repr_html_())
        tags.feed(text)
        assert tags.open == []
        assert headline in text, shown
        assert (text.count("<table"), "svg" in tags.seen) == (tables, drawn), shown
        assert "b" not in tags.seen
        assert re.fullmatch(r"<\w+ .*>|<\w+: .*>", repr(shown))


def test_notebooks_show_less_without_matplotlib_and_jinja(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(style, "find_spec", lambda _: None)
    text = present(nutdamp.plan(CRAFT, "two-pulse")._repr_html_())
    assert ("<table" in text, "<svg" in text) == (True, False)
    monkeypatch.setitem(sys.modules, "jinja2", None)
    report._templates.cache_clear()
    assert CRAFT._repr_html_() is None
