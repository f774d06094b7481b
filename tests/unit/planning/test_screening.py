"""Plans that cannot be chosen fly fewer cases; what is chosen, and its figures, are as if all had flown all."""

from __future__ import annotations

import math
import threading
from dataclasses import replace

import pytest
from support.builders import judged

from nutdamp import planning, robust, screening
from nutdamp.comparison import Comparison, compare
from nutdamp.compliance import Part
from nutdamp.decision import Cases
from nutdamp.dispersion import study_of
from nutdamp.dispersion.cases import DispersedCases
from nutdamp.dispersion.kernel import Ends
from nutdamp.dispersion.study import Results, run
from nutdamp.files.examples import example_text
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.spacecraft import Requirement, Spacecraft

SAMPLES = 12_000


def example(requirement: Requirement | None) -> Spacecraft:
    return replace(read_spacecraft(example_text(), "example.yaml"), requirement=requirement)


@pytest.mark.deep
@pytest.mark.parametrize(
    "requirement",
    [
        Requirement(math.radians(0.5), math.radians(0.2), 0.997),  # with none of the plans enough cases comply
        Requirement(math.radians(1.5), None, 0.95),  # with several
        None,
    ],
)
def test_the_choice_is_that_of_all_cases_for_a_fraction_of_them(requirement: Requirement | None) -> None:
    body = example(requirement)
    compared = compare(body, ("two-pulse", "four-pulse"))
    few, every = (
        robust.compare(compared, robust.attempts(compared), samples=SAMPLES, whole=whole) for whole in (False, True)
    )
    assert few.chosen is not None
    assert every.chosen is not None
    assert [pulse.t for pulse in few.chosen.plan.pulses] == [pulse.t for pulse in every.chosen.plan.pulses]
    assert few.chosen.cases == every.chosen.cases
    assert few.usual is not None
    assert few.usual.cases.samples == SAMPLES
    assert len(few.candidates) == len(every.candidates)
    assert {one.cases.samples for one in every.candidates} == {SAMPLES}
    flown, all_of_them = (sum(one.cases.samples for one in found.candidates) for found in (few, every))
    assert flown < 0.6 * all_of_them


def candidate(impulse: float, low: float, high: float) -> screening.Candidate:
    levels = {Part.NUTATION: 0.0, Part.SHIFT: 0.0}
    plan = judged("plan", 0.0, impulse=impulse)
    made = screening.Candidate(plan, "as planned", Cases(2_048, 1, 0.5 * (low + high), 0.95, levels))
    made.low, made.high = low, high
    return made


@pytest.mark.parametrize(
    ("bounds", "hopeful"),
    [
        # Surely enough comply with the second: dearer plans are out, cheaper ones only where they cannot reach 95 %.
        ([(1.0, 0.90, 0.94), (2.0, 0.96, 0.98), (2.001, 0.9, 0.97), (3.0, 0.99, 1.0), (1.5, 0.90, 0.96)], {1, 2, 4}),
        # Perhaps enough comply with the first: none is out but what is worse than the sampling error allows.
        ([(1.0, 0.90, 0.96), (2.0, 0.80, 0.897), (2.0, 0.5, 0.6)], {0, 1}),
        # With none enough comply.
        ([(1.0, 0.60, 0.70), (2.0, 0.65, 0.75), (2.0, 0.5, 0.6)], {0, 1}),
    ],
)
def test_only_what_cannot_be_chosen_is_left_out(bounds: list[tuple[float, float, float]], hopeful: set[int]) -> None:
    given = [candidate(*one) for one in bounds]
    found = screening._hopeful(given, 20_000, 0.95)
    assert {given.index(one) for one in found} == hopeful


def test_of_plans_that_cost_the_same_the_one_recommended_for_nominal_values() -> None:
    """Both comply as often but for the sampling error; the other one ends earlier, but differs in nothing else."""
    plans = judged("usual", 0.0, end=2.0), judged("other", 0.0, end=1.0)
    body = plans[0].spacecraft
    shares = (0.895, 0.9)
    levels = {Part.NUTATION: 0.0, Part.SHIFT: 0.0}
    given = [
        screening.Candidate(replace(plan, spacecraft=body), "as planned", Cases(1_000, 1, met, 0.997, levels))
        for plan, met in zip(plans, shares, strict=True)
    ]
    for recommended in (0, 1):
        compared = Comparison(body, (given[recommended].plan,))
        found = robust.ranked(compared, given, 1_000, 0.997)
        assert found.equals == 2
        assert found.chosen is given[recommended]


def test_an_interrupt_does_not_wait_for_the_cases_that_are_in_work() -> None:
    """The flight of the first portion goes on until the interrupt has come out."""
    body = example(None)
    schedule = planning.plan(body, "two-pulse").pulses
    study, begun, over = study_of(body, schedule), threading.Event(), threading.Event()
    real = study.flies

    def fly(cases: DispersedCases) -> Ends:
        begun.set()
        over.wait(60.0)
        return real(cases)

    def interrupt(_: int) -> None:
        assert begun.wait(60.0)
        raise KeyboardInterrupt

    vars(study)["flies"] = fly
    with pytest.raises(KeyboardInterrupt):
        run(Results(study, 2_048), watch=interrupt)
    assert not over.is_set()
    over.set()
