"""Nutation angle = body cone + space cone, everywhere and with I1 ≠ I2 too, against Euler's equations by DOP853."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import reference
from support.builders import channel, spinner
from support.cases import deep, spread
from support.golden import check_text
from support.places import case
from support.process import Run

from nutdamp import load
from nutdamp.figures.overview import title
from nutdamp.flight import propagation
from nutdamp.montecarlo.cases import DispersedModel
from nutdamp.montecarlo.propagated import ClosedForm
from nutdamp.montecarlo.statistics import measure
from nutdamp.physics.triaxial import arc_cones
from nutdamp.spacecraft.schedule import Schedule, channel_pulse
from nutdamp.views.decisions import residual_json, spacecraft_json

ROWS = 4001
"""Moments of the reference motion; between them the angle stays below its largest by 1e-6 of its swing."""


@spread(
    ("moments", "rates"),
    [
        ((100.0, 130.0, 180.0), (1.5, 0.2, 0.3)),  # about axis 1: axis 3 is turned over
        ((100.0, 130.0, 180.0), (0.4, 0.0, 2.0)),
        ((100.0, 130.0, 180.0), (-0.2, 0.3, -2.0)),
        ((120.0, 100.0, 80.0), (0.05, 0.2, 3.0)),
        ((120.0, 100.0, 80.0), (4.0, 0.0, -1.0)),  # beyond the separatrix
        ((38.2, 35.1, 22.7), (0.0, 1e-3, 0.7)),
    ],
    quick=2,
    deep=4,
)
def test_the_cones_of_an_arc_are_those_where_its_nutation_is_largest(
    moments: tuple[float, float, float], rates: tuple[float, float, float]
) -> None:
    sense = math.copysign(1.0, rates[2])
    start = reference.Motion(np.array(rates), np.eye(3))
    motion = reference.coast(moments, start, np.zeros(3), np.linspace(0.01, 40.0, ROWS))
    angles = [reference.nutation(moments, one.rates, sense) for one in motion]
    widest = int(np.argmax(angles))
    cones = arc_cones(moments, rates, sense)
    assert cones.nutation == pytest.approx(angles[widest], rel=2e-5)
    assert cones.body == pytest.approx(reference.angle(motion[widest].rates, np.array([0.0, 0.0, sense])), rel=2e-5)
    # From the other end of the axis the largest angle is π less the least.
    assert arc_cones(moments, rates, -sense).nutation == pytest.approx(math.pi - min(angles), rel=2e-5)
    left = propagation.flown(replace(spinner(moments=moments), omega0=np.array(rates)), Schedule()).residual
    assert (left.nutation, left.body_cone) == pytest.approx((cones.nutation, cones.body), rel=1e-12)


@spread("moments", [(120.0, 100.0, 80.0), (300.0, 316.0, 440.0), (100.0, 110.0, 190.0)], quick=1, deep=2)
@pytest.mark.parametrize("spin", [3.0, deep(-0.7)])
def test_a_small_nutation_turns_as_fast_as_that_of_the_reference(
    moments: tuple[float, float, float], spin: float
) -> None:
    """In the body and inertially: the mean of I1 and I2 would be off by up to 5.6 and 2 per cent."""
    body = spinner(spin=spin, degrees=0.01, moments=moments)
    times = np.linspace(0.0, 200.0 / abs(spin), 1001)
    motion = reference.coast(moments, reference.Motion(body.omega0, np.eye(3)), np.zeros(3), times)
    third = reference.momentum(moments, motion[0])
    first = np.cross([0.0, 1.0, 0.0], third)
    second = np.cross(third, first) / np.linalg.norm(third)
    seen = np.array([[one.rotation[:, 2] @ first, one.rotation[:, 2] @ second] for one in motion])
    within = np.array([one.rates[:2] for one in motion])
    for period, path in ((body.inertial_period, seen), (body.body_period, within)):
        turned = np.unwrap(np.arctan2(path[:, 1], path[:, 0]))
        assert math.tau / period == pytest.approx(abs(np.polyfit(times, turned, 1)[0]), rel=2e-4)


@pytest.mark.parametrize("name", ["state-three-moments.yaml", "tensor-microsat.yaml", "disperse-three-moments.yaml"])
def test_free_motion_is_one_thing_in_all_that_tells_it(name: str) -> None:
    """Header, both residuals, track, JSON and dispersed closed form of a body with I1 ≠ I2."""
    body = load(case(name))
    assert not body.inertia.symmetric
    until = 3.0 * body.body_period
    now = reference.nutation(body.inertia.moments, body.omega0, math.copysign(1.0, body.spin))
    assert body.tilt == pytest.approx(now, rel=1e-12)
    said = spacecraft_json(body)
    assert said["nutation_deg"] == pytest.approx(said["body_cone_deg"] + said["space_cone_deg"], rel=1e-14)
    assert said["nutation_at_start_deg"] == pytest.approx(math.degrees(now), rel=1e-12)
    for fly in (propagation.flown, propagation.by_impulses):
        flown = fly(body, Schedule(), until)
        left, track = residual_json(flown.residual), flown.sampled(2000, until)
        assert track.nutation[0] == pytest.approx(now, rel=1e-9)
        assert math.degrees(track.nutation.max()) == pytest.approx(said["nutation_deg"], rel=1e-4)
        for key in ("nutation_deg", "body_cone_deg", "space_cone_deg"):
            assert left[key] == pytest.approx(said[key], rel=1e-12)
        assert f"nutation at most {said['nutation_deg']:#.3g}°" in title(flown)
    model = DispersedModel(body, Schedule())
    out = measure(model, ClosedForm(model)(model.cases({})), 1)
    assert out[:3, 0] == pytest.approx([now, 0.0, 0.0], rel=1e-12, abs=1e-12)  # nutation, shift of H, axis error


def test_the_angles_around_the_pulses_are_those_of_what_is_left() -> None:
    """So the last line of a table of pulses says what the residual says, and the first what the header says."""
    push = channel("T", 4.0, 1.0, 0.0)
    body = spinner(moments=(100.0, 130.0, 180.0), channels=(push,))
    flown = propagation.flown(body, Schedule((channel_pulse(push, 1.0, 0.5), channel_pulse(push, 4.0, 0.7))), 20.0)
    before, after = flown.around_pulses()
    left = flown.residual
    assert (after.nutation[-1], after.body_cone[-1]) == pytest.approx((left.nutation, left.body_cone), rel=1e-12)
    assert before.nutation[0] == pytest.approx(body.nutation, rel=1e-12)
    assert before.nutation[1] == pytest.approx(after.nutation[0], rel=1e-10)
    assert before.space_cone + before.body_cone == pytest.approx(before.nutation, rel=1e-12)
    # Effective impulses turn by the rate of the true body: at small angles both models agree to their square.
    for moments in ((100.0, 130.0, 180.0), (120.0, 100.0, 80.0)):
        body = spinner(moments=moments, degrees=0.01, channels=(push,))
        wide = Schedule((channel_pulse(push, 0.9, 1.2),))
        real, sharp = (fly(body, wide).residual.nutation for fly in (propagation.flown, propagation.by_impulses))
        assert sharp == pytest.approx(real, rel=2e-4)


def test_commands_disperse_and_start_free_motion_as_it_is(run: Run, tmp_path: Path) -> None:
    cases = str(case("disperse-three-moments.yaml")), "--scheme", "none", "--samples", "100", "--json", "disperse.json"
    assert run("disperse", *cases).returncode == 4
    percentiles = json.loads((tmp_path / "disperse.json").read_text())["percentiles"]
    assert percentiles["axis_error_deg"]["max"] == pytest.approx(0.0, abs=1e-9)
    assert percentiles["nutation_deg"]["max"] == pytest.approx(math.degrees(math.atan2(130.0 * 0.4, 360.0)), abs=1.0)
    simulate = "simulate", str(case("state-three-moments.yaml")), "--scheme", "none"
    for flown in ((), ("--flown",)):
        screen = run(*simulate, "--csv", "-", "--samples", "2", *flown)
        header, first, *_ = screen.stdout.splitlines()
        row = dict(zip(header.split(","), map(float, first.split(",")), strict=True))
        axis, momentum = (
            [row[f"{name}_{part}{unit}"] for part in "xyz"] for name, unit in (("axis", ""), ("momentum", "_Nms"))
        )
        apart = math.degrees(reference.angle(np.array(axis), np.array(momentum)))
        assert (row["nutation_deg"], apart) == pytest.approx((10.0, 10.0), rel=1e-12)
    nutation = next(line for line in run(*simulate, "-v").stdout.splitlines() if line.startswith("nutation  "))
    check_text("cones.at-start", nutation)
