"""How far the impulse sum may err: against single flights, and what is made of it."""

from __future__ import annotations

import math
from dataclasses import replace

import dispersed
import numpy as np
import pytest

from nutdamp import flight
from nutdamp.compliance import Part
from nutdamp.dispersion import agreement, study_of
from nutdamp.dispersion.agreement import CASES, check_impulses, deviations
from nutdamp.dispersion.single import realised
from nutdamp.dispersion.study import Study
from nutdamp.errors import BadRequest, Infeasible
from nutdamp.outcome import ANGLE
from nutdamp.spacecraft import Disturbance, Goal, Requirement


def a_study(requirement: Requirement | None = None, **changes: object) -> Study:
    model = dispersed.with_jets(scale=0.2)
    body = replace(model.spacecraft, requirement=requirement, **changes)  # type: ignore[arg-type]
    return study_of(body, model.schedule, flown=False)


def test_each_deviation_is_that_of_single_flights() -> None:
    """The median of 60 cases by the impulse sum and by Euler's equations, each flown alone."""
    study = a_study(Requirement(0.01, 0.01, probability=0.5))
    nutation, shift = deviations(study)
    assert (nutation.part, shift.part) == (Part.NUTATION, Part.SHIFT)
    errors = []
    for case in range(60):
        true, pulses = realised(study.model, study.draws_of(case))
        summed, real = flight.by_impulses(true, pulses).residual, flight.flown(true, pulses).residual
        errors.append((abs(summed.nutation - real.nutation), abs(summed.momentum_shift - real.momentum_shift)))
    medians = np.median(errors, axis=0)
    assert nutation.error < 1e-12  # on ω a pulse is its effective impulse
    assert shift.error == pytest.approx(medians[1], rel=0.1)
    assert shift.error > 1e-4


def test_a_tenth_of_the_requirement_decides() -> None:
    _, shift = deviations(a_study())
    assert shift.most == ANGLE
    assert shift.error > ANGLE
    with pytest.raises(BadRequest, match=r"the most allowed is 0\.01 deg of shift of H"):
        check_impulses(a_study())
    with pytest.raises(BadRequest, match=f"first {CASES:,} cases; a tenth of the requirement is"):
        check_impulses(a_study(Requirement(None, 9.0 * shift.error)))
    assert "errs by up to" in check_impulses(a_study(Requirement(None, 11.0 * shift.error)))
    assert "errs by up to" in check_impulses(a_study(Requirement(None, 9.0 * shift.error)), force=True)


def test_a_part_that_nothing_bounds_may_err() -> None:
    """Where only the nutation is required, what impulses make of the shift of H does not matter."""
    _, shift = deviations(a_study(Requirement(0.01)))
    assert math.isinf(shift.most)
    assert "of shift of H" in check_impulses(a_study(Requirement(0.01)))


def test_disturbances_and_three_moments_are_seen_by_their_effect() -> None:
    requirement = Requirement(math.radians(0.1), math.radians(90.0))
    disturbed = a_study(requirement, disturbances=(Disturbance(0.5 + 0.0j),))
    with pytest.raises(BadRequest, match=r"a tenth of the requirement is 0\.01 deg of nutation\."):
        check_impulses(disturbed)
    slight = a_study(requirement, disturbances=(Disturbance(1e-6 + 0.0j),))
    assert "errs by up to" in check_impulses(slight)


def test_a_spin_of_the_goal_is_checked_too() -> None:
    study = a_study(goal=Goal(spin=3.0), disturbances=(Disturbance(0.0j, axial=2.0),))
    *_, spin = deviations(study)
    assert spin.part is Part.SPIN
    # 2 N m about axis 3 until the end of the last pulse, which the impulse sum leaves out.
    gained = 2.0 / study.model.spacecraft.inertia.C * study.model.schedule.end
    assert spin.error == pytest.approx(gained, rel=0.05)
    with pytest.raises(BadRequest, match="rad/s of spin"):
        check_impulses(study)


def test_where_real_widths_cannot_be_flown_nobody_can_tell(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: object) -> object:
        raise Infeasible("too many radians")

    monkeypatch.setattr(agreement, "RealWidths", lambda _: fail)
    with pytest.raises(BadRequest, match="cannot be flown to check it: too many radians; --force skips this check"):
        check_impulses(a_study())
    assert "too many radians" in check_impulses(a_study(), force=True)
