"""Fronts of time against propellant: no point beaten by another; certificates of the least cost of optimal."""

import csv
import io
import itertools
import json
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support import places
from support.builders import channel, cross, present, spinner
from support.cases import weekly
from support.certificate_checker import check
from support.checker import violations
from support.golden import check_text, refused
from support.process import Run

import nutdamp
from nutdamp.common import work
from nutdamp.errors import BadRequest
from nutdamp.files.tabular import json_text
from nutdamp.planning import plan as planning
from nutdamp.planning import tradeoff
from nutdamp.planning.verdict import Status
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Goal, Limits, Spacecraft
from nutdamp.spacecraft.requirements import SAME_COST
from nutdamp.spacecraft.schedule import Bounds, Pulse, Schedule
from nutdamp.views.decisions import certificate_json

BODY = spinner(channels=cross(8.0, min_on_time=0.02, max_on_time=2.0), limits=Limits(horizon=40.0))
STEERED = str(places.CONFIGS / "steerable-stage.yaml")


@dataclass(frozen=True, eq=False, repr=False)
class Given(planning.Plan):
    """A plan of optimal whose distance of H from its target is given, rad."""

    off: float = 0.0

    @property
    def flight(self) -> Any:
        return SimpleNamespace(residual=SimpleNamespace(axis_error=self.off))


def given(end: float, cost: float, degrees: float = 0.0, least: float = 0.1, within: float = 40.0) -> Given:
    pulse = Pulse(end, 0.0, "+1", np.array([1.0, 0.0, 0.0]), propellant=cost)
    return Given(
        BODY, "optimal", Schedule((pulse,), bounds=Bounds(least, None, "kg", within)), off=math.radians(degrees)
    )


def points(plans: list[Given]) -> list[tradeoff.Point]:
    return [tradeoff.Point(one, 40.0, "kg") for one in plans]


def figures(points: tuple[tradeoff.Point, ...]) -> list[tuple[float, float]]:
    return [(point.plan.pulses.end, point.cost) for point in points]


def test_each_front_has_what_any_search_found_that_keeps_its_shift_and_none_beats(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Searches: the whole horizon, the fastest, horizons evenly between their ends by ratios; from strict to free."""
    results = iter(
        [
            *(given(30.0, 1.0), given(10.0, 3.0), given(16.0, 2.0), given(25.0, 2.1)),
            *(given(28.0, 0.9, 5.0), given(8.0, 2.5), given(18.0, 1.5, 2.0), given(20.0, 1.4995, 2.0)),
        ]
    )
    asked, done = list[tuple[str, bool | None, float]](), list[int]()

    def search(body: Spacecraft, name: str, options: nutdamp.OptimalOptions) -> planning.Plan:
        assert name == "optimal"
        asked.append((options.least, options.free_axis, body.horizon))
        return next(results)

    monkeypatch.setattr(tradeoff, "plan", search)
    with work.steps(8, hook=lambda count, _: done.append(count)):
        made = tradeoff.fronts(BODY, nutdamp.OptimalOptions(), count=4, shifts=(math.inf, 0.0, math.inf))
    assert [front.shift for front in made] == [0.0, math.inf]
    # The fastest of the free front keeps H too; what saves less than a thousandth is no point.
    assert figures(made[0].points) == [(8.0, 2.5), (16.0, 2.0), (30.0, 1.0)]
    assert figures(made[1].points) == [(8.0, 2.5), (16.0, 2.0), (18.0, 1.5), (28.0, 0.9)]
    for free, first, last in ((False, 10.0, 30.0), (True, 8.0, 28.0)):
        horizons = [40.0, 40.0, first * (last / first) ** (1 / 3), first * (last / first) ** (2 / 3)]
        leasts = ["propellant", "time", "propellant", "propellant"]
        searches = asked[4 * free : 4 * free + 4]
        assert [(least, freed) for least, freed, _ in searches] == [(least, free) for least in leasts]
        assert [horizon for *_, horizon in searches] == pytest.approx(horizons)
    assert done == list(range(1, 9))
    numbers = [(number, front.shift) for number, front, _ in tradeoff.numbered(made)]
    assert numbers == [(number, 0.0 if number < 4 else math.inf) for number in range(1, 8)]


def test_the_first_order_least_of_a_front_never_rises_with_time() -> None:
    """A schedule that a stricter front found has the least of that one, which may be more than this front needs."""
    plans = [given(10.0, 3.0, 0.0, 2.0, 10.0), given(20.0, 2.0, 0.0, 2.2, 20.0), given(30.0, 1.0, 0.0, 0.7, 40.0)]
    front = tradeoff.Front(0.0, tuple(points(plans)))
    assert [front.least(point) for point in front.points] == [2.0, 2.0, 0.7]


def test_no_point_is_beaten_by_one_of_a_stricter_front() -> None:
    """Random clouds: what allows more is nowhere dearer, and no front has two points that cost the same."""
    draw = np.random.default_rng(5)
    for _ in range(50):
        strict, more = (
            points([given(*one) for one in (1.0 + draw.uniform(0.0, [10.0, 0.01], (8, 2))).tolist()]) for _ in range(2)
        )
        first = tradeoff.undominated(strict)
        second = tradeoff.undominated([*strict, *more], first)
        for one, two in (*itertools.pairwise(figures(first)), *itertools.pairwise(figures(second))):
            assert one[0] < two[0]
            assert one[1] > two[1]
        for end, cost in figures(first):
            assert min(other for ended, other in figures(second) if ended <= end) <= cost
        assert all(one.cost > two.cost * (1.0 + SAME_COST) for one, two in itertools.pairwise(first))
        assert first[-1].cost <= min(point.cost for point in strict) / (1.0 - SAME_COST)


@pytest.mark.deep
def test_a_point_is_judged_by_all_cases_as_any_schedule_is_or_by_nominal_values_on_request() -> None:
    """One of four-pulse: 90 % of cases comply."""
    made = planning.plan(nutdamp.example(), "four-pulse")
    point = tradeoff.Point(made, 40.0, "kg")
    assert point.verdict is made.verdict
    assert (point.verdict.status, point._replace(nominal=True).verdict.status) == (Status.NOT_ENOUGH, Status.FLY)


@pytest.mark.weekly
def test_fronts_that_are_searched_fly() -> None:
    half = math.radians(0.5)
    made = tradeoff.fronts(BODY, nutdamp.OptimalOptions(), count=4, shifts=(math.inf, 0.0, half))
    assert [front.shift for front in made] == [0.0, half, math.inf]
    for front in made:
        assert len(front.points) >= 2
        leasts = [front.least(point) or 0.0 for point in sorted(front.points, key=lambda one: one.bounds.within)]
        assert leasts == sorted(leasts, reverse=True)
        for point in front.points:
            assert violations(BODY, point.plan.pulses) == []
            left = point.plan.flight.residual
            assert left.nutation < math.radians(1e-6)
            assert left.momentum_shift <= front.shift + math.radians(1e-6)
            assert present(point.bounds.rigorous) <= point.cost * (1 + 1e-9)
    for strict, free in itertools.pairwise(made):
        for point in strict.points:
            sooner = [other for other in free.points if other.plan.pulses.end <= point.plan.pulses.end]
            assert min(other.cost for other in sooner) <= point.cost


@pytest.mark.weekly
def test_impulse_is_traded_in_one_unit_also_where_the_propellant_is_known() -> None:
    """The fastest schedule, looked for by time, once counted in kg beside N m s, and beat all others."""
    body = replace(BODY, channels=tuple(one.of(isp=220.0, thrust=10.0) for one in BODY.channels))
    (front,) = tradeoff.fronts(body, nutdamp.OptimalOptions(least="impulse"), count=3, shifts=(0.0,))
    (known,) = tradeoff.fronts(body, nutdamp.OptimalOptions(), count=3, shifts=(0.0,))
    assert [{point.bounds.unit for point in one.points} for one in (front, known)] == [{"N m s"}, {"kg"}]
    assert len(front.points) == len(known.points) >= 2
    for by_impulse, by_propellant in zip(front.points, known.points, strict=True):  # all thrusters are alike
        assert by_impulse.cost == pytest.approx(by_propellant.plan.pulses.total_impulse, rel=1e-6)


@pytest.mark.weekly
def test_no_front_holds_what_a_schedule_of_another_front_beats_in_everything() -> None:
    """On ticks no schedule leaves H just where it was: one that leaves it as near, as soon and as cheaply counts."""
    body = nutdamp.load(places.CONFIGS / "couples-minisat.yaml")
    made = tradeoff.fronts(body, nutdamp.OptimalOptions(), count=6, shifts=(0.0, math.inf))
    for point, other in itertools.product([point for front in made for point in front.points], repeat=2):
        same = math.isclose(point.cost, other.cost, rel_tol=SAME_COST)
        sooner = other.plan.end < 0.999 * point.plan.end
        near = other.plan.flight.residual.axis_error <= point.plan.flight.residual.axis_error
        assert not (near and sooner and (same or other.cost < point.cost))


@pytest.mark.weekly
def test_what_plan_finds_is_traded_where_the_fastest_is_not_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """120 short pulses; the search for the fastest tries thousands, and ends without any."""
    body = nutdamp.load(places.case("nothing-damps.yaml"))
    made = planning.plan(body, "optimal", nutdamp.OptimalOptions(free_axis=False))
    monkeypatch.setattr(work, "FRONTS", 4_000.0)
    (front,) = tradeoff.fronts(body, nutdamp.OptimalOptions(), count=3, shifts=(0.0,))
    assert [(point.plan.end, point.cost, point.plan.cut) for point in front.points] == [
        (made.end, made.pulses.cost_in("kg"), False)
    ]
    assert front.why is None


def test_where_optimal_cannot_fire_the_other_schemes_are_traded(run: Run, tmp_path: Path) -> None:
    run("trade", STEERED, "--points", "2", "--csv", "t.csv")
    rows = list(csv.DictReader(io.StringIO((tmp_path / "t.csv").read_text("utf-8"))))
    expected = [("two-pulse", "true"), ("one-pulse", "false"), ("two-pulse", "true")]
    assert [(row["scheme"], row["meets_requirement"]) for row in rows] == expected
    assert float(rows[0]["end_s"]) == planning.plan(nutdamp.load(STEERED), "two-pulse").end
    (front,) = tradeoff.fronts(nutdamp.load(STEERED), nutdamp.OptimalOptions(), count=2, shifts=(0.0,))
    check_text("plan.trade-others", front.why or "")


@pytest.mark.deep
def test_the_command_writes_table_csv_json_picture_and_schedules(run: Run, tmp_path: Path) -> None:
    files = ["--csv", "t.csv", "--json", "t.json", "--plot", "t.svg", "--schedules", "front"]
    assert run("trade", "--points", "2", "--allow", "0", *files).returncode == 0
    rows = list(csv.DictReader(io.StringIO((tmp_path / "t.csv").read_text())))
    written = json.loads((tmp_path / "t.json").read_text())["fronts"][0]["points"]
    assert len(rows) == len(written) == len(list((tmp_path / "front").glob("point-*.csv"))) == 2
    assert float(rows[0]["propellant_kg"]) == written[0]["propellant_kg"]
    assert (tmp_path / "t.svg").stat().st_size > 10_000
    again = run("simulate", "--schedule", "front/point-1.csv", "--flown", "--json", "-")
    assert json.loads(again.stdout)["flown"]["nutation_deg"] < 1e-6


def test_nothing_feasible_ends_with_status_3_and_a_reason(run: Run) -> None:
    text = (
        "name: x\ninertia: {A: 120, C: 80}\nstate: {spin: 3, nutation: 5 deg}\n"
        "thrusters: [{name: T, torque: [1, 0, 0], min_on_time: 1 s}]\nlimits: {horizon: 0.1}\n"
    )
    done = run("trade", "-", "--points", "1", "--allow", "any", stdin=text, columns=200, status=3)
    check_text("plan.trade-none", "\n".join(line.strip() for line in done.stdout.splitlines() if "none" in line))
    assert run("trade", "--allow", "-1deg").returncode == 2


@pytest.mark.deep
def test_the_searches_of_all_points_share_a_limit_of_work(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """But that of the whole horizon, as `plan` finds it; the others would take 490 units."""
    with work.budget("test", 1e9) as whole:
        planning.plan(nutdamp.example(), "optimal", nutdamp.OptimalOptions(free_axis=False))
    monkeypatch.setattr(work, "FRONTS", 200.0)
    with work.budget("test", 1e9) as spent:
        tradeoff.fronts(nutdamp.example(), nutdamp.OptimalOptions(), count=3, shifts=(0.0,))
    assert spent.done < whole.done + work.FRONTS + 150.0  # with bounds
    command = ("trade", "--points", "3", "--allow", "0deg")
    done = run(*command, status=0)
    check_text("plan.trade-cut", "\n".join(line for line in done.stderr.splitlines() if "point" in line))
    monkeypatch.setattr(work, "FRONTS", 5.0)
    monkeypatch.setattr(work, "SCHEME", 5.0)
    none = run(*command, "--csv", "-", status=0)
    assert {row["scheme"] for row in csv.DictReader(io.StringIO(none.stdout))} <= {"two-pulse", "four-pulse"}


# --- certificates, checked from the file alone by certificate_checker

WEAK, STRONG = cross(8.0), cross(4_000.0)
PLAIN, IMPULSE = nutdamp.OptimalOptions(), nutdamp.OptimalOptions(least="impulse")
WINDOWS = Limits(earliest=3.0, horizon=70.0, blackout=((10.0, 22.5), (40.0, 41.0)))
ONE_WAY = (channel("T1", 8.0, 0.0, 0.0), channel("T2", -3.0, 5.0, 0.0), channel("T3", 1.0, -9.0, 0.0))
BRIEF = Limits(horizon=40.0)
PROLATE = spinner(channels=WEAK, limits=Limits(horizon=60.0))
OBLATE = spinner(100.0, 150.0, channels=WEAK, limits=BRIEF)
TURNED, FASTER = Goal(axis=np.array([math.sin(0.15), 0.0, math.cos(0.15)])), Goal(spin=3.1)
ROLL = channel("R", 0.0, 0.0, 4.0)
BODIES: dict[str, tuple[Spacecraft, nutdamp.OptimalOptions]] = {
    "prolate": (PROLATE, PLAIN),
    "oblate": (OBLATE, PLAIN),
    "reversed": (spinner(spin=-3.0, channels=WEAK, limits=BRIEF), PLAIN),
    "windows": (spinner(channels=WEAK, limits=WINDOWS), PLAIN),
    "strong": (spinner(channels=STRONG, limits=Limits(horizon=30.0)), IMPULSE),
    "strong in windows": (spinner(channels=STRONG, limits=WINDOWS), IMPULSE),
    "one way only": (spinner(channels=ONE_WAY, limits=Limits(horizon=90.0)), IMPULSE),
    "free axis": (spinner(channels=ONE_WAY), nutdamp.OptimalOptions(free_axis=True)),
    "shift": (spinner(channels=STRONG, limits=Limits(horizon=5.0)), nutdamp.OptimalOptions(shift=math.radians(0.3))),
    "steerable beside": (spinner(channels=WEAK, steerable=Steerable(20.0)), PLAIN),
    "turned": (replace(PROLATE, goal=TURNED), PLAIN),
    "spun up": (replace(spinner(channels=(*WEAK, ROLL), limits=BRIEF), goal=FASTER), IMPULSE),
    "damped": (replace(OBLATE, dissipation=60.0), PLAIN),
    "I1 ≠ I2": (spinner(moments=(122.0, 118.0, 80.0), channels=WEAK, limits=BRIEF), PLAIN),
}
IN_CI = ("windows", "one way only", "shift", "damped", "I1 ≠ I2")


def raised(c: dict[str, Any]) -> None:
    """Higher prices would prove a higher bound."""
    for one in c["equations"]:
        one["price"] *= 1.01
    c["bound"] = 1.01 * (c["bound"] + c["gained"]) - c["gained"]
    for one in c["primer"]:
        one["q"] = {name: [1.01 * q for q in curve] for name, curve in one["q"].items()}


def halved(*keys: str | int) -> Callable[[dict[str, Any]], None]:
    """Halves the number at ``keys``."""

    def halve(c: Any) -> None:
        for key in keys[:-1]:
            c = c[key]
        c[keys[-1]] *= 0.5

    return halve


TAMPERED: list[Callable[[dict[str, Any]], None]] = [
    halved("circle", 0),
    halved("nutation_rad_s"),
    halved("equations", 0, "goal_Nms"),
    lambda c: c.update(bound=1.001 * c["bound"]),
    halved("channels", 0, "cost_per_s"),
    lambda c: c["channels"][0].update(torque_Nm=[1.1 * one for one in c["channels"][0]["torque_Nm"]]),
    halved("burns", 0, "on_time_s"),
    lambda c: c["burns"][0].update(t_s=c["burns"][0]["t_s"] + 0.4),
    halved("primer", 0, "q", "+1", 7),
    raised,
]


def refutes(text: str, *tampers: Callable[[dict[str, Any]], None]) -> None:
    """The file as it is proves what it says, and as any of these make it does not."""
    for tamper in tampers:
        content = json.loads(text)
        tamper(content)
        with pytest.raises(AssertionError):
            check(json.dumps(content))


@pytest.mark.deep
@pytest.mark.parametrize("name", [one if one in IN_CI else weekly(one) for one in BODIES])
def test_the_file_alone_proves_the_bound_and_a_tampered_one_does_not(name: str) -> None:
    body, options = BODIES[name]
    made = tradeoff.certificate(planning.plan(body, "optimal", options))
    text, bounds = json_text(certificate_json(made)), present(made.plan.pulses.bounds)
    assert check(text) == bounds.first_order == made.proof.bound > 0.0
    if "windows" in name:
        refutes(text, *TAMPERED)


@pytest.mark.deep
def test_firing_in_the_dark_would_be_worth_more() -> None:
    """The prices know of the windows: where they end, q goes above the price of a channel that acts at once."""
    two = channel("T", 4_000.0, 0.0, 0.0), channel("U", 0.0, -4_000.0, 0.0)
    options = nutdamp.OptimalOptions(least="impulse", free_axis=True)
    content = certificate_json(
        tradeoff.certificate(planning.plan(spinner(channels=two, limits=Limits(horizon=2.0)), "optimal", options))
    )
    check(json_text(content))
    content["windows_s"] = [[0.0, 90.0]]
    with pytest.raises(AssertionError, match="above"):
        check(json_text(content))


def test_what_has_no_certificate_says_why_and_the_command_what_to_name(run: Run, tmp_path: Path) -> None:
    """Optimal is infeasible within a millisecond, which only planning shows: the screen is shown too."""
    with refused(BadRequest, "plan.certificate-of-other"):
        tradeoff.certificate(planning.plan(PROLATE, "four-pulse"))
    for status, scheme in ((2, ("two-pulse",)), (1, ("optimal", "--set", "limits.horizon=1 ms"))):
        result = run("plan", "--scheme", *scheme, "--certificate", "proof.json", columns=300)
        assert (result.returncode, bool(result.stdout)) == (status, status == 1)
        assert not (tmp_path / "proof.json").exists()
        check_text(f"plan.certificate-{status}", "\n".join(result.stderr.strip().splitlines()[-1:]))


def test_the_command_writes_the_file_and_says_what_it_proves(run: Run, tmp_path: Path) -> None:
    limits = ("--nominal", "--set", "limits.horizon=30 s")
    result = run("plan", "-v", "--scheme", "optimal", "--certificate", "proof.json", *limits, columns=200, status=0)
    text = (tmp_path / "proof.json").read_text()
    assert json.loads(text)["unit"] == "kg"
    assert f"small-angle bound within 30 s: {1e3 * check(text):.4g} g" in result.stdout
    refutes(text, raised)


@pytest.mark.deep
def test_where_another_plan_is_recommended_the_command_says_whose_certificate_it_writes(run: Run) -> None:
    command = ("plan", "--scheme", "optimal", "--scheme", "two-pulse", "--certificate", "proof.json", "--json", "-")
    nominal, dispersed = (run(*command, *each, columns=200) for each in (["--nominal"], []))
    schemes = [json.loads(one.stdout)["decision"]["scheme"] for one in (nominal, dispersed)]
    assert schemes == ["optimal", "two-pulse"]
    whose = [line for line in dispersed.stderr.splitlines() if line not in nominal.stderr]
    check_text("plan.certificate-whose", "\n".join(whose))
