"""The spin axis seen over long arcs with dissipation: a few turns of them show what all turns show."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nutdamp.physics.axis_watch import AxisWatch
from nutdamp.physics.rigid import Forcing
from nutdamp.physics.rigid_cases import Bodies, Stretch

COUNT = 60


def arcs(sense: float, growth: float) -> tuple[Stretch, np.ndarray, np.ndarray]:
    """Arcs of some 20 to 40 turns, directions near the axis and away from it, and what they last, s."""
    rng = np.random.default_rng(5)
    first = rng.uniform(80.0, 120.0, COUNT)
    moments = np.array([first, first, first * rng.uniform(0.5, 1.6, COUNT)])
    tilt = rng.uniform(0.02, 0.1, COUNT)
    rates = np.array([np.sin(tilt), 0.3 * np.sin(tilt), sense * np.cos(tilt)]) * rng.uniform(1.0, 2.0, COUNT)
    bodies = Bodies(moments, np.zeros(3), Forcing(growth=growth))
    upright = np.zeros((4, COUNT))
    upright[0] = 1.0
    away = np.array([rng.uniform(0.0, 0.3, COUNT), rng.uniform(math.pi - 0.3, math.pi, COUNT)])
    round_ = rng.uniform(0.0, 2.0 * math.pi, (2, COUNT))
    directions = np.stack([np.sin(away) * np.cos(round_), np.sin(away) * np.sin(round_), np.cos(away)], axis=1)
    lasts = rng.uniform(20.0, 40.0, COUNT) * 2.0 * math.pi * first / np.linalg.norm(moments * rates, axis=0)
    return Stretch(bodies, np.zeros(COUNT), rates, upright), directions, lasts


@pytest.mark.weekly
@pytest.mark.parametrize(("sense", "growth"), [(1.0, 3e-3), (-1.0, 3e-3), (1.0, -6e-3)])
def test_few_turns_show_what_all_show(sense: float, growth: float, monkeypatch: pytest.MonkeyPatch) -> None:
    here, directions, lasts = arcs(sense, growth)
    few, every = AxisWatch.of(directions, sense), AxisWatch.of(directions, sense)
    every._steps(here, lasts)
    steps: list[int] = []
    stepped = AxisWatch._steps

    def counted(self: AxisWatch, begin: Stretch, duration: np.ndarray) -> None:
        steps.append(len(duration))
        stepped(self, begin, duration)

    monkeypatch.setattr(AxisWatch, "_steps", counted)
    few.motion(here, lasts)
    assert few.angles == pytest.approx(every.angles, abs=3e-5)
    assert steps[0] < COUNT // 2  # followed all the way
    assert steps[1:] == [COUNT - steps[0]] * 2
