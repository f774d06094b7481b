"""The loop against the same loop by DOP853, its events found on interpolants; and that a difference is seen."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.builders import channel, spinner
from support.process import Run as Process

from nutdamp.dop853 import Equations
from nutdamp.loop.verify import verify_loop
from nutdamp.loop_settings import ACCELEROMETER, Loop, Sensor
from nutdamp.spacecraft import Disturbance, Inertia, Spacecraft

FOUR = tuple(
    channel(name, *torque, min_on_time=0.002, max_on_time=0.3)
    for name, torque in {"+M1": (6, 0.2, 0.1), "-M1": (-6, 0, 0), "+M2": (0, 6, 0), "-M2": (0, -6, 0)}.items()
)


def looped(sensor: Sensor, **changes: object) -> Spacecraft:
    craft = spinner(degrees=1.5, channels=FOUR)
    return replace(craft, loop=Loop(sensor, start=math.radians(0.4), stop=math.radians(0.05)), **changes)  # type: ignore[arg-type]


CASES = {
    "continuous": looped(Sensor(bias=2e-4, delay=0.05)),
    "sampled": looped(Sensor(rate=20.0, noise=3e-4, delay=0.05, low_pass=0.1)),
    "accelerometer": looped(Sensor(ACCELEROMETER, 20.0, noise=1e-4, position=np.array([1.0, 0.2, 0.0]))),
    "growing": looped(Sensor(rate=20.0), dissipation=40.0),
    "disturbed": looped(Sensor(rate=20.0), disturbances=(Disturbance(0.02 + 0.01j, 0.03),)),
    "three moments": replace(looped(Sensor()), inertia=spinner(moments=(120.0, 100.0, 80.0)).inertia),
}


@pytest.mark.weekly
@pytest.mark.parametrize("name", CASES)
def test_dop853_fires_alike(name: str) -> None:
    found = verify_loop(CASES[name], 40.0)
    assert len(found.pairs) >= 3
    assert found.agree
    assert found.worst < 1e-7


@pytest.mark.weekly
def test_a_firing_after_a_long_wait_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nutdamp.dop853.EVALUATIONS", 1000)  # of schedules, which loops need not keep
    sensor = Sensor(ACCELEROMETER, 20.0, noise=1e-4, position=np.array([1.0, 0.2, 0.0]))
    strong = tuple(replace(one, thrusters=(replace(one.thrusters[0], max_on_time=2.0),)) for one in FOUR)
    found = verify_loop(replace(looped(sensor, dissipation=20.0), channels=strong), 100.0)
    starts = [one.pulse.start for one in found.run.fired]
    assert max(np.diff(starts)) > 20.0  # the spin falls meanwhile
    assert found.agree
    assert found.worst < 1e-7


def test_another_body_is_seen_to_differ(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nutdamp.loop.verify.Equations", Heavier)
    found = verify_loop(CASES["continuous"], 15.0)
    assert found.same
    assert not found.agree
    assert found.worst > 1e-6


class Heavier(Equations):
    """The body of the file with other moments."""

    def __init__(self, spacecraft: Spacecraft, most: int) -> None:
        super().__init__(replace(spacecraft, inertia=Inertia((120.0, 120.0, 80.002))), most)


def test_a_loop_too_long_for_dop853_is_not_confirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nutdamp.loop.verify.EVALUATIONS", 500)
    found = verify_loop(CASES["continuous"], 15.0)
    assert found.other is None
    assert "500 evaluations" in found.missing
    assert not found.agree


def test_the_command(run: Process, tmp_path: Path) -> None:
    run("init", "--from", "magnus-a03", "craft.yaml")
    craft = tmp_path / "craft.yaml"
    craft.write_text(craft.read_text() + "loop: {sensor: {kind: gyro}, start: 0.5 deg, stop: 0.05 deg}\n")
    done = run("verify", "craft.yaml", "--loop", "--json", "v.json", "--set", "limits.horizon=12 s")
    assert done.returncode == 0, done.stderr
    assert "fires alike: 6 firings" in " ".join(done.stdout.split())
    found = json.loads((tmp_path / "v.json").read_text())
    assert found["agree"] is True
    assert len(found["firings"]) == 6
    assert run("verify", "craft.yaml", "--loop", "--scheme", "none").returncode == 2
    assert run("verify", "--loop").returncode == 2
