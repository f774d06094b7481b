"""Cones that the spin axis keeps, in dispersed cases: the angles of each are those of its own flight."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import dispersed
from support.cases import spread
from support.flights import axis_path, by_blocks
from support.process import Run
from support.single_case import realised

from nutdamp import load
from nutdamp.flight import propagation
from nutdamp.flight.end_state import aspects
from nutdamp.flight.propagation import Flight
from nutdamp.montecarlo.cases import DispersedModel
from nutdamp.montecarlo.propagated import RealWidths
from nutdamp.montecarlo.study import Results, Study, study_of
from nutdamp.montecarlo.study import run as fly_all
from nutdamp.physics import attitude
from nutdamp.planning import decision, robust
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.model import Disturbance, Keep, Requirement, Spacecraft


def with_directions(model: DispersedModel, **fields: object) -> DispersedModel:
    """The model with directions all over the sky, and one on the spin axis, where angles are near zero."""
    body = replace(model.spacecraft, **fields)  # type: ignore[arg-type]
    sky = np.random.default_rng(1).normal(size=(3, 3))
    ways = (*(way / np.linalg.norm(way) for way in sky), body.axis, None)  # the last: H, wherever it points
    return DispersedModel(replace(body, keep=tuple(Keep(str(k), way) for k, way in enumerate(ways))), model.schedule)


JETS = dispersed.with_jets()
LEAKS = (Disturbance(0.02 + 0.01j, 0.05), Disturbance(0.03 + 0.0j, rate=-3.0))
MODELS = {
    "prolate": with_directions(JETS),
    "oblate, spin reversed": with_directions(dispersed.steered(moments=(70.0, 70.0, 110.0), spin=-3.0)),
    "dissipation": with_directions(dispersed.sinking(JETS)),
    "three moments": with_directions(dispersed.with_jets(moments=(120.0, 105.0, 80.0))),
    "disturbances": with_directions(JETS, disturbances=LEAKS, dissipation=400.0),
    "blocks": with_directions(by_blocks()),
}


def end_of(made: Flight) -> float:
    """When the axis has gone round H once more after the last pulse."""
    size = float(np.linalg.norm(made.settled.rates * np.asarray(made.moments)))
    return made.schedule.end + math.pi * (made.moments[0] + made.moments[1]) / size


def seen_in(model: DispersedModel, draws: dict[str, np.ndarray]) -> np.ndarray:
    """Least and largest angles (m, 2, n) of the cases."""
    angles = RealWidths(model)(model.cases(draws)).aspects
    assert angles is not None
    return angles


@spread("name", MODELS, quick=1, deep=5)
def test_angles_of_each_case_are_those_of_its_own_flight(name: str) -> None:
    model = MODELS[name]
    draws = dispersed.first_cases(Study(model), 16)
    angles = seen_in(model, draws)
    for case in range(0, 16, 5):
        true, made = realised(model, dispersed.one_of(draws, case))
        alone = propagation.flown(true, made)
        for one, ends in zip(aspects(alone, end_of(alone)), angles[:, :, case], strict=False):  # a Sun besides
            within = 2e-8  # near the direction of the axis itself
            assert ends == pytest.approx((one.least, one.largest), abs=within)


def test_the_reference_integrator_sees_the_same_angles() -> None:
    model = MODELS["three moments"]
    draws = dispersed.first_cases(Study(model), 6)
    angles = seen_in(model, draws)
    true, made = realised(model, dispersed.one_of(draws, 5))
    path = axis_path(true, made, end_of(propagation.flown(true, made)), 400)
    for keep, ends in zip(model.spacecraft.keep[:3], angles[:3, :, 5], strict=True):
        apart = attitude.angle_between(path, np.asarray(keep.direction))
        assert ends == pytest.approx((apart.min(), apart.max()), abs=1e-5)


COUNT = 100


def kept(least: float, **fields: object) -> Results:
    """A study of pulses that leave a nutation, with a cone of ``least`` rad; all cases meet the loose requirement."""
    axis = JETS.spacecraft.direction_in_n(math.radians(20.0), 0.4)
    loose = Requirement(math.radians(60.0), math.radians(60.0), 0.9)
    given = {"keep": (Keep("beacon", axis, least),), "requirement": loose, **fields}
    body = replace(JETS.spacecraft, **given)  # type: ignore[arg-type]
    return fly_all(Results(study_of(body, JETS.schedule), COUNT))


def test_cases_in_which_the_axis_breaks_a_cone_do_not_comply() -> None:
    free = kept(0.0)
    assert (free.met_fraction, free.broken.tolist(), free.shown()) == (1.0, [0], True)
    angles = seen_in(free.study.model, dispersed.first_cases(free.study, COUNT))[0, 0]
    assert free.aspects[0, 0] == angles.min()
    middle = float(np.median(angles))
    half = kept(middle)
    assert (half.met_fraction, half.broken.tolist(), half.shown()) == (0.5, [50], False)
    assert half.aspects == pytest.approx(free.aspects)
    assert (angles[half.worst.cases[:50]] < middle).all()  # these are the worst cases
    # Without a requirement cones alone make cases comply or not.
    least = float(angles.min())
    for limit, share in ((least - 1e-3, 1.0), (least + 1e-6, 99 / 100)):
        assert kept(limit, requirement=None).met_fraction == share


FILE = """
name: Keeper
mass: 250 kg
inertia: {A: 120 kg m^2, C: 80 kg m^2}
state: {spin: 30 rpm, nutation: 0 deg}
attitude: {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [1, 0, 0, 0]}
steerable: {torque: 60 N m, isp: 220 s, lever_arm: 1 m}
sun: [20 deg, 80 deg]
goal: {right_ascension: 10 deg, declination: 70 deg}
keep: [{name: Sun, direction: sun, min: 5 deg}]
limits: {earliest: 1 s}
requirement: {nutation: 2 deg, momentum_shift: 3 deg, probability: 60 %}
dispersions: {A: {normal: 1 %}, C: {normal: 1 %}, omega0: {normal: 0.1 deg/s}, thrust: {normal: 3 %}}
"""
"""A rhumb line passes the cone by 0.05 deg with nominal values, half-cones by 1.3 deg."""


@pytest.mark.weekly
def test_disperse_says_how_many_cases_break_the_cone(run: Run) -> None:
    options = ("disperse", "-", "--scheme", "rhumb-line")
    counted = run(*options, "--samples", "2000", "--json", "-", stdin=FILE)
    study = json.loads(counted.stdout)
    (cone,) = study["aspects"]
    assert counted.returncode == 4
    assert 0.3 < cone["broken_fraction"] < 0.6
    assert study["requirement"]["met_fraction"] == pytest.approx(1.0 - cone["broken_fraction"], abs=0.02)
    assert cone["least_deg"] < 5.0 < cone["nominal_least_deg"] < 5.1
    assert all(one["aspects"][0]["least_deg"] < 5.0 for one in study["worst"])
    screen = run(*options, "--samples", "2000", "-v", stdin=FILE).stdout
    assert f"broken in {100 * cone['broken_fraction']:.1f} % of cases" in " ".join(screen.split())
    worst = study["worst"][0]
    row = next(line.split() for line in screen.splitlines() if line.split()[:1] == [str(worst["case"])])
    assert row[4] == f"{worst['aspects'][0]['least_deg']:.4g}"
    assert "least from Sun, deg" in run(*options, "--case", "1", stdin=FILE).stdout


@pytest.mark.deep
def test_the_csv_has_the_angles_of_each_case(run: Run, tmp_path: Path) -> None:
    def csv_of(keep: str) -> tuple[dict[str, Any], str]:
        text = FILE.replace("keep: [{name: Sun, direction: sun, min: 5 deg}]", keep)
        options = ("--scheme", "half-cone", "--samples", "300", "--csv", "cases.csv", "--json", "-")
        study = json.loads(run("disperse", "-", *options, stdin=text).stdout)
        return study, (tmp_path / "cases.csv").read_text()

    study, content = csv_of("keep: [{name: Sun, direction: sun, min: 5 deg}]")
    rows = list(csv.DictReader(content.splitlines()))
    assert list(rows[0])[-3:] == ["propellant_kg", "Sun_least_deg", "Sun_largest_deg"]
    least, largest = np.array([[float(row[f"Sun_{end}_deg"]) for row in rows] for end in ("least", "largest")])
    (cone,) = study["aspects"]
    assert (len(rows), least.min(), largest.max()) == (300, cone["least_deg"], cone["largest_deg"])
    assert np.mean(least < 5.0) == cone["broken_fraction"]
    for worst in study["worst"]:
        (angles,), at = worst["aspects"], worst["case"] - 1
        assert (least[at], largest[at]) == pytest.approx((angles["least_deg"], angles["largest_deg"]), abs=1e-9)
    # A cone so far away that nothing is routed changes nothing else.
    (_, kept_csv), (_, free_csv) = csv_of("keep: [{name: Sun, direction: sun, min: 1 deg}]"), csv_of("")
    assert free_csv.splitlines() == [line.rsplit(",", 2)[0] for line in kept_csv.splitlines()]


@pytest.mark.weekly
def test_a_robust_plan_keeps_the_cone_in_most_cases(tmp_path: Path) -> None:
    (tmp_path / "keeper.yaml").write_text(FILE)
    body: Spacecraft = load(tmp_path / "keeper.yaml")
    names = "rhumb-line", "half-cone"
    compared, counted = (decision.compare(body, names, samples=samples) for samples in (0, 1000))
    assert [one.recommended and one.recommended.scheme for one in (compared, counted)] == list(names)
    trials = robust.variations_of(compared)
    judged = robust.compare(compared, trials[:1] + trials[-2:])
    shares = {one.plan.scheme: one.cases.complying for one in judged.candidates}
    assert planning.plan(body, "rhumb-line").meets_requirement
    assert (shares["rhumb-line"] or 1.0) < 0.7
    assert judged.chosen is not None
    assert judged.chosen.plan.scheme == "half-cone"
