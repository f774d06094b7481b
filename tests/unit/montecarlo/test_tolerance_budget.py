"""Derivatives behind the tolerance budget: those of what is flown, through real widths."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.places import case

import nutdamp
from nutdamp.files.schedules import read_plan
from nutdamp.montecarlo.statistics import first_order, vectors
from nutdamp.montecarlo.study import study_of


def test_the_budget_of_h_is_that_of_real_widths() -> None:
    """A ΔV of 45 s: by impulses each thrust error turns H by 0.003°, through the widths by a ten-thousandth of it."""
    body = nutdamp.load(case("lp71b.yaml"))
    study = study_of(body, read_plan(str(case("dv45.csv")), body)[0].pulses)
    flown, closed = study.first_order, first_order(study.model)
    assert math.degrees(closed.sigma("momentum_shift")) > 0.003
    assert math.degrees(flown.sigma("momentum_shift")) < 2e-6
    assert flown.sigma("nutation") == pytest.approx(closed.sigma("nutation"), rel=0.01)
    step = 1e-4 * flown.inputs[0].size
    draw = np.array([step, -step])
    ends = vectors(study.model, study.flies(study.model.cases({flown.inputs[0].name: draw})), 2)
    assert flown.jacobian[:8, 0] == pytest.approx((ends[:8, 0] - ends[:8, 1]) / (2.0 * step), rel=0.02, abs=1e-9)
