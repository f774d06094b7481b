"""Fronts of time against propellant: no point beaten by another, every schedule flown and within its limits."""

from __future__ import annotations

import csv
import io
import itertools
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
import pytest
from support import places
from support.builders import cross, spinner
from support.checker import violations
from support.places import case
from support.process import Run

import nutdamp
from nutdamp import fronts, planning, work
from nutdamp.compliance import SAME_COST
from nutdamp.schemes.options import OptimalOptions
from nutdamp.spacecraft import Limits, Spacecraft

CONFIGS = places.CONFIGS

HALF_DEGREE = math.radians(0.5)


@pytest.fixture(scope="module")
def body() -> Spacecraft:
    return spinner(channels=cross(8.0, min_on_time=0.02, max_on_time=2.0), limits=Limits(horizon=40.0))


@pytest.fixture(scope="module")
def found(body: Spacecraft) -> tuple[fronts.Front, ...]:
    return fronts.fronts(body, OptimalOptions(), count=4, shifts=(math.inf, 0.0, HALF_DEGREE))


@pytest.mark.deep
def test_fronts_go_from_strict_to_free(found: tuple[fronts.Front, ...]) -> None:
    assert [front.shift for front in found] == [0.0, HALF_DEGREE, math.inf]


@pytest.mark.deep
def test_later_points_are_cheaper(found: tuple[fronts.Front, ...]) -> None:
    for front in found:
        assert len(front.points) >= 2
        for one, two in itertools.pairwise(front.points):
            assert one.plan.pulses.end < two.plan.pulses.end
            assert one.cost > two.cost


@pytest.mark.deep
def test_every_point_is_a_schedule_that_flies(body: Spacecraft, found: tuple[fronts.Front, ...]) -> None:
    for front in found:
        for point in front.points:
            assert violations(body, point.plan.pulses) == []
            left = point.plan.flight.residual
            assert left.nutation < math.radians(1e-6)
            assert left.momentum_shift <= front.shift + math.radians(1e-6)
            assert point.bounds.rigorous is not None
            assert point.bounds.rigorous <= point.cost * (1 + 1e-9)


@pytest.mark.deep
def test_impulse_is_traded_in_one_unit_also_where_the_propellant_is_known(body: Spacecraft) -> None:
    """The fastest schedule, looked for by time, once counted in kg beside N m s, and beat all others."""
    fuelled = replace(
        body,
        channels=tuple(
            replace(one, thrusters=tuple(replace(each, isp=220.0, thrust=10.0) for each in one.thrusters))
            for one in body.channels
        ),
    )
    (front,) = fronts.fronts(fuelled, OptimalOptions(least="impulse"), count=3, shifts=(0.0,))
    (known,) = fronts.fronts(fuelled, OptimalOptions(), count=3, shifts=(0.0,))
    assert {point.bounds.unit for point in front.points} == {"N m s"}
    assert {point.bounds.unit for point in known.points} == {"kg"}
    assert len(front.points) == len(known.points) >= 2
    for by_impulse, by_propellant in zip(front.points, known.points, strict=True):  # all thrusters are alike
        assert by_impulse.cost == pytest.approx(by_propellant.plan.pulses.total_impulse, rel=1e-6)


@pytest.mark.deep
def test_what_is_allowed_more_costs_no_more(found: tuple[fronts.Front, ...]) -> None:
    for strict, free in itertools.pairwise(found):
        for point in strict.points:
            sooner = [other for other in free.points if other.plan.pulses.end <= point.plan.pulses.end]
            assert min(other.cost for other in sooner) <= point.cost


class Made(NamedTuple):
    """What `fronts.undominated` looks at."""

    end: float
    cost: float

    @property
    def plan(self) -> Made:
        return self

    @property
    def pulses(self) -> Made:
        return self


def test_the_first_order_least_of_a_front_never_rises_with_time(found: tuple[fronts.Front, ...]) -> None:
    """A schedule that a stricter front found has the least of that one, which may be more than this front needs."""
    strict, free = found[0], found[-1]
    borrowed = replace(free, points=(free.points[0], *strict.points))
    for front in (*found, borrowed):
        leasts = [front.least(point) for point in sorted(front.points, key=lambda one: one.bounds.within)]
        assert leasts
        assert all(one is not None for one in leasts)
        assert leasts == sorted(leasts, key=lambda one: -(one or 0.0))
    assert all((free.least(point) or math.inf) <= (point.bounds.first_order or 0.0) for point in free.points)


def test_no_point_is_beaten_by_one_of_a_stricter_front() -> None:
    """Random clouds: what allows more is nowhere dearer, and no front has two points that cost the same."""
    draw = np.random.default_rng(5)
    for _ in range(200):
        strict = [Made(*one) for one in (1.0 + draw.uniform(0.0, [10.0, 0.01], (8, 2))).tolist()]
        free = [*strict, *(Made(*one) for one in (1.0 + draw.uniform(0.0, [10.0, 0.01], (8, 2))).tolist())]
        first = fronts.undominated(cast("list[fronts.Point]", strict))
        second = fronts.undominated(cast("list[fronts.Point]", free), first)
        for kept in (first, second):
            for one, two in itertools.pairwise(kept):
                assert one.plan.pulses.end < two.plan.pulses.end
                assert one.cost > two.cost
        for point in first:
            assert min(one.cost for one in second if one.plan.pulses.end <= point.plan.pulses.end) <= point.cost
        assert all(one.cost > two.cost * (1.0 + SAME_COST) for one, two in itertools.pairwise(first))
        least = min(made.cost for made in strict)
        assert first[-1].cost <= least / (1.0 - SAME_COST)


@pytest.mark.deep
def test_a_schedule_that_keeps_h_counts_whichever_search_found_it() -> None:
    """The example: at 9.826 s the search that lets H go anywhere finds a schedule that keeps it where it was."""
    strict, free = fronts.fronts(nutdamp.example(), OptimalOptions(), count=10, shifts=(0.0, math.inf))
    keeping = [one for one in free.points if one.plan.flight.residual.axis_error < math.radians(1e-6)]
    for point in keeping:
        sooner = [other.cost for other in strict.points if other.plan.end <= point.plan.end]
        assert min(sooner) <= point.cost * (1.0 + SAME_COST)
    assert {one.plan.end for one in strict.points} <= {one.plan.end for one in keeping}


@pytest.mark.deep
def test_what_plan_finds_is_traded_where_the_fastest_is_not_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """120 short pulses, of which the search for the fastest tries thousands, and ends without any."""
    body = nutdamp.load(case("nothing-damps.yaml"))
    made = planning.plan(body, "optimal")
    monkeypatch.setattr(work, "FRONTS", 4_000.0)
    (front,) = fronts.fronts(body, OptimalOptions(), count=3, shifts=(0.0,))
    assert [point.plan.end for point in front.points] == [made.end]
    assert front.why is None


def test_where_optimal_cannot_fire_the_other_schemes_are_traded(run: Run) -> None:
    body = nutdamp.load(CONFIGS / "steerable-stage.yaml")
    strict, free = fronts.fronts(body, OptimalOptions(), count=2, shifts=(0.0, math.inf))
    assert [point.plan.scheme for point in strict.points] == ["two-pulse"]
    assert [point.plan.scheme for point in free.points] == ["one-pulse", "two-pulse"]
    assert [point.plan.meets_requirement for point in free.points] == [False, True]
    assert strict.points[0].plan.end == planning.plan(body, "two-pulse").end
    done = run("trade", str(CONFIGS / "steerable-stage.yaml"), "--points", "2", "--csv", "-")
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    assert [(row["scheme"], row["meets_requirement"]) for row in rows] == [
        ("two-pulse", "true"),
        ("one-pulse", "false"),
        ("two-pulse", "true"),
    ]
    shown = run("trade", str(CONFIGS / "steerable-stage.yaml"), "--points", "2").stdout
    assert "no schedule of optimal: the file names no thrusters" in " ".join(shown.split())
    assert "2 ✗" in shown
    assert "✗ does not meet the requirement" in shown


def test_no_schedule_within_the_horizon_is_said_with_its_reason() -> None:
    body = spinner(channels=cross(8.0)[:1], limits=Limits(horizon=0.2))
    front = fronts.fronts(body, OptimalOptions(), count=3, shifts=(0.0,))[0]
    assert front.points == ()
    assert front.why is not None
    assert "horizon" in front.why


@pytest.mark.deep
def test_the_command_writes_table_csv_json_picture_and_schedules(run: Run, tmp_path: Path) -> None:
    files = ["--csv", "t.csv", "--json", "t.json", "--plot", "t.svg", "--schedules", "front"]
    done = run("trade", "--points", "2", "--allow", "0", *files)
    assert done.returncode == 0, done.stderr
    assert "first-order least" in done.stdout
    rows = list(csv.DictReader(io.StringIO((tmp_path / "t.csv").read_text())))
    points = json.loads((tmp_path / "t.json").read_text())["fronts"][0]["points"]
    assert len(rows) == len(points) == len(list((tmp_path / "front").glob("point-*.csv")))
    assert float(rows[0]["propellant_kg"]) == points[0]["propellant_kg"]
    assert (tmp_path / "t.svg").read_text().startswith("<?xml")
    again = run("simulate", "--schedule", "front/point-1.csv", "--flown", "--json", "-")
    assert json.loads(again.stdout)["flown"]["nutation_deg"] < 1e-6


def test_nothing_feasible_ends_with_status_3(run: Run, tmp_path: Path) -> None:
    text = "name: x\ninertia: {A: 120, C: 80}\nstate: {spin: 3, nutation: 5 deg}\n"
    text += "thrusters: [{name: T, torque: [1, 0, 0]}]\nlimits: {horizon: 0.1}\n"
    (tmp_path / "x.yaml").write_text(text)
    done = run("trade", "x.yaml", "--points", "2")
    assert done.returncode == 3
    assert "none:" in done.stdout
    assert run("trade", "--allow", "-1deg").returncode == 2


def test_the_searches_of_all_points_share_a_limit_of_work(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """The fastest point of the example is cut at 500 units, of which all three searches together would take 600."""
    monkeypatch.setattr(work, "FRONTS", 500.0)
    with work.budget("test", 1e9) as spent:
        done = run("trade", "--points", "3", "--allow", "0deg")
    assert done.returncode == 0
    assert "point 1: the search ended at its limit of work" in done.stderr
    assert "point 2: " not in done.stderr
    assert spent.done < 1.2 * work.FRONTS
    monkeypatch.setattr(work, "FRONTS", 5.0)
    none = run("trade", "--points", "3", "--allow", "0deg")
    assert none.returncode == 0
    said = " ".join(none.stdout.split())
    assert "no schedule of optimal: " in said
    assert "the search ended at its limit of work" in said
    assert "two-pulse" in said or "four-pulse" in said


@pytest.mark.deep
def test_no_front_holds_what_a_schedule_of_another_front_beats_in_everything() -> None:
    """On ticks no schedule leaves H just where it was: one that leaves it as near, as soon and as cheaply counts."""
    body = nutdamp.load(CONFIGS / "couples-minisat.yaml")
    found = fronts.fronts(body, OptimalOptions(), count=6, shifts=(0.0, math.inf))
    points = [point for front in found for point in front.points]
    for point in points:
        for other in points:
            same = math.isclose(point.cost, other.cost, rel_tol=SAME_COST)
            sooner = other.plan.end < 0.999 * point.plan.end
            near = other.plan.flight.residual.axis_error <= point.plan.flight.residual.axis_error
            assert not (near and sooner and (same or other.cost < point.cost))
