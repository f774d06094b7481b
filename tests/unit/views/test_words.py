"""Verdicts in words and what they go by; each code of a note has a sentence, whose values are
given.
"""

import ast
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import reference
from support.builders import (
    BOTH,
    HALF_A_DEGREE,
    POINTING,
    aimed,
    cross,
    judged,
    off_target,
    present,
    spinner,
)
from support.golden import check_text

import nutdamp
from nutdamp.common.results import Note, Value, note
from nutdamp.errors import Infeasible
from nutdamp.planning import plan as planning
from nutdamp.planning.causes import infeasibility
from nutdamp.planning.decision import TIES
from nutdamp.planning.notes import (
    LEAST_CODES,
    Gain,
    alternatives,
    comparison_warnings,
    plan_notes,
    reasons,
    verdict_notes,
)
from nutdamp.planning.verdict import WHY, Status
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Disturbance, Goal, Limits, Requirement
from nutdamp.spacecraft.tolerances import SpinTolerance
from nutdamp.views import verdict
from nutdamp.views.loop import STOPS
from nutdamp.views.parts import required
from nutdamp.views.text import (
    NAME,
    NOTE,
    REASON,
    WARNING,
    note_entries,
    note_json,
    ordered,
    screen_line,
    text,
)

FIRED = spinner(channels=cross(8.0))
WIDE = Goal(spin=3.0)


def test_no_limit_is_named_that_the_file_does_not_set() -> None:
    body = replace(FIRED, limits=Limits(horizon=0.5))
    bound = Limits(horizon=0.5, gap=0.1, blackout=((0.1, 0.2),))
    bound_body = replace(body, limits=bound, channels=cross(8.0, max_on_time=1.0))
    texts = [infeasibility(planning.plan(each, "two-pulse")) or "" for each in (body, bound_body)]
    check_text("verdicts.limits-named", "\n".join(texts))


def test_the_requirement_is_on_one_line() -> None:
    assert required(spinner()) == ""
    check_text("verdicts.required", required(replace(spinner(requirement=BOTH), goal=WIDE)))


@pytest.mark.parametrize(
    ("share", "of", "shown"),
    [
        (0.9991, 0.997, "99.9 %"),
        (0.8562, 0.997, "85.6 %"),
        (0.99696, 0.997, "99.696 %"),
        (0.99704, 0.997, "99.704 %"),
        (0.997, 0.997, "99.7 %"),
        (1.0, 0.997, "100.0 %"),
        (0.00004, 0.997, "0.004 %"),
        (0.99999, 1e-9, "99.999 %"),
        (0.99996, 0.9973, "99.996 %"),
        (0.9999999, 0.999999, "99.99999 %"),
    ],
)
def test_a_share_is_never_rounded_to_what_it_is_not(share: float, of: float, shown: str) -> None:
    assert verdict.percent(share, of) == shown


@pytest.mark.parametrize(
    ("part", "unit"),
    [(requirements.Part.NUTATION, math.radians(1.0)), (requirements.Part.SPIN, math.pi / 30.0)],
)
@pytest.mark.parametrize("size", [0.5, 0.1684, 0.003491])
def test_a_value_is_shown_on_its_side_of_its_limit(
    part: requirements.Part, unit: float, size: float
) -> None:
    bound = requirements.Bound(part, size * unit, True)
    for off in (0.1, 1e-3, 1e-5, 1e-6, -1e-6, -1e-4, -0.3):
        texts = verdict.value(bound, bound.limit * (1.0 + off)), verdict.limit(bound)
        shown, edge = (float(text.split()[-2]) for text in texts)
        assert edge == size
        assert (shown > edge) is (off > 0.0)


TILTING = (Disturbance(0.5 + 0j),)


def test_the_parts_that_are_missed_and_by_how_much() -> None:
    plan = judged("a", 0.6, shift=0.3, required=BOTH, goal=WIDE, spin=4.0)
    assert [bound.part for bound in plan._shortfalls] == [
        requirements.Part.NUTATION,
        requirements.Part.SHIFT,
        requirements.Part.SPIN,
    ]
    assert plan._severity == pytest.approx(1.0 / 0.03)
    assert planning.Plan(plan.spacecraft, "x", None, Infeasible("why"))._severity == math.inf


def test_with_a_target_the_severity_goes_by_the_distance_from_it() -> None:
    """One pulse takes the nutation out and leaves H 11.7° from its target, having shifted it by
    2.1°.
    """
    body = aimed(replace(FIRED, requirement=Requirement(None, math.radians(1.0))), 10.0, 40.0)
    plan = planning.plan(body, "one-pulse")
    assert plan._severity == pytest.approx(
        off_target(body, plan.pulses) / math.radians(1.0), rel=1e-9
    )
    assert present(plan.flown).momentum_shift < 0.9 * present(plan.flown).axis_error
    free = replace(plan, spacecraft=replace(body, requirement=None))
    assert free._severity == pytest.approx(off_target(body, plan.pulses), rel=1e-9)


def test_the_severity_of_many_is_that_of_each() -> None:
    body = replace(spinner(requirement=BOTH), goal=WIDE)
    generator = np.random.default_rng(1)
    nutation, aim = generator.uniform(0.0, 0.02, (2, 50))
    spin = 3.0 + generator.normal(size=50) * 0.03
    many = requirements.severity(body, requirements.Left(nutation, aim, spin))
    for row in range(50):
        alone = requirements.severity(body, requirements.Left(nutation[row], aim[row], spin[row]))
        assert many[row] == alone
        within = nutation[row] <= math.radians(0.5) and aim[row] <= math.radians(0.2)
        assert (alone <= 1.0) == (within and abs(spin[row] / 3.0 - 1.0) <= 1e-2)


def test_where_no_pulse_is_needed_it_says_so() -> None:
    rows: list[tuple[float, Requirement | None, Goal, bool]] = [
        (0.3, HALF_A_DEGREE, Goal(), True),
        (0.6, HALF_A_DEGREE, Goal(), False),
        (
            0.3,
            Requirement(momentum_shift=0.01),
            Goal(),
            False,
        ),  # the nutation is not bounded: it is to be damped
        (0.9e-3, None, Goal(), True),
        (1.1e-3, None, Goal(), False),
        (0.3, HALF_A_DEGREE, POINTING, False),
        (0.3, replace(HALF_A_DEGREE, momentum_shift=0.21), POINTING, True),
        (0.3, HALF_A_DEGREE, Goal(spin=3.1), False),
        (0.3, HALF_A_DEGREE, WIDE, True),
    ]
    for degrees, limit, goal, needless in rows:
        body = replace(spinner(degrees=degrees, channels=cross(8.0), requirement=limit), goal=goal)
        assert requirements.unaided(body) is needless
        assert (planning.plan(body, "none")._standing is planning.Standing.COMPLIES) is needless
        assert (
            nutdamp.compare(body, ("none", "four-pulse")).verdict.status is Status.NO_PULSE
        ) is needless


def test_with_unequal_moments_the_largest_nutation_counts() -> None:
    """By the reference integrator too: it is least at t = 0, and passes 0.3 deg within a period."""
    body = spinner(moments=(125.0, 110.0, 80.0), degrees=0.3, channels=cross(8.0))
    times = np.linspace(0.0, 2.0 * body.body_period, 400)
    start = reference.Motion(body.omega0, np.eye(3))
    path = reference.coast(body.inertia.moments, start, np.zeros(3), times[1:])
    angles = [reference.nutation(body.inertia.moments, motion.rates, 1.0) for motion in path]
    largest = max(angles)
    assert largest > min(angles) * 1.05
    for share, kept in ((1.001, True), (0.999, False)):
        needed = replace(body, requirement=Requirement(nutation=share * largest))
        assert requirements.unaided(needed) is kept
        assert (
            nutdamp.compare(needed, ("none", "four-pulse")).verdict.status is Status.NO_PULSE
        ) is kept
    easy = replace(body, requirement=Requirement(nutation=1.0))
    assert not requirements.unaided(replace(easy, dissipation=40.0))
    assert not requirements.unaided(replace(easy, goal=Goal(spin=body.spin)))


def test_what_dissipation_makes_of_it_counts() -> None:
    """0.3 deg grow e-fold in 40 s: past 0.5 deg after 20.4 s."""
    calm = spinner(
        degrees=0.3, channels=cross(8.0), requirement=HALF_A_DEGREE, limits=Limits(horizon=20.0)
    )
    growing = replace(calm, dissipation=40.0)
    assert growing.growth > 0.0
    assert requirements.unaided(growing)
    assert not requirements.unaided(replace(growing, limits=Limits(horizon=21.0)))
    assert not requirements.unaided(
        replace(calm, dissipation=0.01)
    )  # e-fold 2,000 times: beyond any float
    assert "horizon of 20 s" in verdict.idle(nutdamp.compare(growing, ("none",)).verdict)
    assert "horizon" not in verdict.idle(nutdamp.compare(calm, ("none",)).verdict)
    assert not requirements.unaided(replace(calm, disturbances=TILTING))


@pytest.mark.parametrize(
    ("A", "C", "degrees", "horizon", "kept"),
    [
        (120.0, 80.0, 2.0, 30.0, False),
        (120.0, 80.0, 2.0, 2.0, True),
        (80.0, 120.0, 20.0, 20.0, False),
    ],
)
def test_changes_of_spin_count(
    A: float, C: float, degrees: float, horizon: float, kept: bool
) -> None:
    """H stays, so the spin falls with cos θ: by the reference integrator too, for either shape."""
    limit = Requirement(nutation=math.radians(30), spin=SpinTolerance(1e-3))
    body = spinner(A, C, degrees=degrees, requirement=limit)
    body = replace(body, dissipation=30.0, goal=WIDE, limits=Limits(horizon=horizon))
    ended = reference.fly(body.inertia.moments, body.omega0, [], horizon, growth=body.growth)
    assert bool(abs(ended.rates[2] - 3.0) <= 3e-3) is kept is requirements.unaided(body)


# --- each code that the code uses has a sentence, whose values are given

SOURCE = Path(nutdamp.__file__).parent


def calls() -> list[tuple[str, str, set[str]]]:
    """Module, code and names of values of each call of `note` with the code written out."""
    result = []
    for path in sorted(SOURCE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Name)
                and node.func.id == "note"
                and node.args
            ):
                codes = [
                    part.value for part in ast.walk(node.args[0]) if isinstance(part, ast.Constant)
                ]
                names = {keyword.arg or "" for keyword in node.keywords}
                result += [(path.name, code, names) for code in codes if isinstance(code, str)]
    return result


CALLS = calls()


def test_every_code_has_a_sentence_and_every_sentence_its_values() -> None:
    """Notes on a plan get the scheme beside their own values."""
    assert len(CALLS) > 60
    for module, code, names in CALLS:
        wanted = set(NAME.findall(note_entries()[code].sentence))
        assert "" in names or wanted <= names | {"scheme"}, (module, code)  # "": values in a dict


def test_every_entry_is_used_and_says_what_it_means() -> None:
    used = {
        *(code for _, code, _ in CALLS),
        *(gain.value for gain in Gain),
        *(tie.value for tie in TIES),
        *(
            "cone-broken-at-start",
            "ideal-impulses",
            "ideal-torquer-assumed",
            "ideal-torque-missing",
        ),
        *("least-propellant", *STOPS.values(), *WHY.values(), *LEAST_CODES.values()),
    }
    assert set(note_entries()) == used
    for entry in note_entries().values():
        assert entry.severity in (WARNING, NOTE, REASON)
        assert entry.paragraph.endswith(".")


@pytest.mark.parametrize(("name", "value", "shown"), [
    ("limit_deg", 0.5, "0.5 deg"), ("at_s", 0.0123, "12.3 ms"), ("at_s", 12.5, "12.5 s"),
    ("limit_deg", 1e-12, "1e-12 deg"),
])  # fmt: skip
def test_values_are_shown_by_the_unit_in_their_names(name: str, value: float, shown: str) -> None:
    values: dict[str, Value] = {
        "angle_deg": 1.0,
        "direction": "Sun",
        "at_s": 1.0,
        "limit_deg": 1.0,
        "scheme": "x",
        name: value,
    }
    assert shown in text(Note("cone-broken", tuple(values.items())))


def test_a_note_for_people_has_severity_and_code_and_for_programs_the_values_too() -> None:
    entry = note("momentum-shift", scheme="optimal", momentum_shift_deg=0.25)
    assert screen_line(entry).plain.startswith("note[momentum-shift]: optimal ")
    rates = note("models-differ-in-spin", difference_rad_s=1.2e-5, limit_rad_s=0.0598)
    assert "1.2e-05 rad/s" in text(rates)  # a rate is no time
    data = note_json(entry)
    assert (data["code"], data["severity"]) == ("momentum-shift", "note")
    assert data["values"] == {"scheme": "optimal", "momentum_shift_deg": 0.25}


def test_warnings_come_first_and_nothing_twice() -> None:
    shift = note("momentum-shift", scheme="x", momentum_shift_deg=1.0)
    assert [entry.code for entry in ordered([shift, note("try-trade"), shift])] == [
        "try-trade",
        "momentum-shift",
    ]


def test_notes_of_the_example_are_those_of_its_decision() -> None:
    compared = nutdamp.compare(nutdamp.example(), samples=0)
    assert [entry.code for entry in reasons(compared)] == ["least-propellant"]
    assert not [*comparison_warnings(compared)]
    assert {entry.code for plan in compared.plans for entry in plan_notes(plan)} >= {
        "half-turns-apart"
    }
    assert {entry.code for entry in alternatives(compared)} <= {gain.value for gain in Gain}
    codes = [entry.code for entry in verdict_notes(compared.verdict, present(compared.recommended))]
    assert "tolerances-not-checked" in codes
