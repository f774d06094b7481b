"""The note_entries of notes: each code that the code uses has a sentence, whose values are given."""

from __future__ import annotations

import ast
import json
import math
from pathlib import Path

import pytest
from support.process import Run

import nutdamp
from nutdamp.common.results import Note, Value, note
from nutdamp.planning.decision import TIES, WHY, Gain
from nutdamp.planning.notes import (
    LEAST_CODES,
    alternatives,
    comparison_warnings,
    plan_notes,
    reasons,
    verdict_notes,
)
from nutdamp.views.guide import note_entries
from nutdamp.views.loop import STOPS
from nutdamp.views.text import NAME, NOTE, REASON, WARNING, note_json, ordered, screen_line, text

SOURCE = Path(nutdamp.__file__).parent


def calls() -> list[tuple[str, str, set[str]]]:
    """Module, code and names of values of each call of `note` with the code written out."""
    result = []
    for path in sorted(SOURCE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "note" and node.args:
                codes = [part.value for part in ast.walk(node.args[0]) if isinstance(part, ast.Constant)]
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
    used = {code for _, code, _ in CALLS} | {*(gain.value for gain in Gain), *(tie.value for tie in TIES)}
    used |= {
        "cone-broken-at-start",
        "least-propellant",
        "ideal-impulses",
        "ideal-torquer-assumed",
        "ideal-torque-missing",
    }
    used |= {"least-propellant", *STOPS.values(), *WHY.values(), *LEAST_CODES.values()}
    assert set(note_entries()) == used
    for entry in note_entries().values():
        assert entry.severity in (WARNING, NOTE, REASON)
        assert entry.paragraph.endswith(".")


@pytest.mark.parametrize(("name", "value", "shown"), [
    ("limit_deg", 0.5, "0.5 deg"), ("at_s", 0.0123, "12.3 ms"), ("at_s", 12.5, "12.5 s"),
    ("limit_deg", 1e-12, "< 1e-9 deg"),
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


def test_a_rate_is_no_time() -> None:
    shown = text(note("models-differ-in-spin", difference_rad_s=1.2e-5, limit_rad_s=0.0598))
    assert "1.2e-05 rad/s" in shown
    assert "0.0598 rad/s" in shown


def test_a_note_for_people_has_severity_and_code_and_for_programs_the_values_too() -> None:
    entry = note("momentum-shift", scheme="optimal", momentum_shift_deg=0.25)
    assert screen_line(entry).plain.startswith("note[momentum-shift]: optimal ")
    data = note_json(entry)
    assert (data["code"], data["severity"]) == ("momentum-shift", "note")
    assert data["values"] == {"scheme": "optimal", "momentum_shift_deg": 0.25}


def test_warnings_come_first_and_nothing_twice() -> None:
    shift = note("momentum-shift", scheme="x", momentum_shift_deg=1.0)
    assert [entry.code for entry in ordered([shift, note("try-trade"), shift])] == ["try-trade", "momentum-shift"]


def test_the_json_of_a_plan_has_notes_as_data(run: Run) -> None:
    content = json.loads(run("plan", "--nominal", "--set", "requirement={nutation: 1e-9 deg}", "--json", "-").stdout)
    for entry in (*content["notes"], *(entry for plan in content["plans"] for entry in plan["notes"])):
        assert set(entry) == {"code", "severity", "values", "text"}
        assert entry["code"] in note_entries()
        numbers = [value for value in entry["values"].values() if isinstance(value, float)]
        assert all(map(math.isfinite, numbers))


def test_notes_of_the_example_are_those_of_its_decision() -> None:
    compared = nutdamp.compare(nutdamp.example(), samples=0)
    assert [entry.code for entry in reasons(compared)] == ["least-propellant"]
    assert not [*comparison_warnings(compared)]
    assert {entry.code for plan in compared.plans for entry in plan_notes(plan)} >= {"half-turns-apart"}
    assert {entry.code for entry in alternatives(compared)} <= {gain.value for gain in Gain}
    assert compared.recommended is not None
    codes = [entry.code for entry in verdict_notes(compared.verdict, compared.recommended)]
    assert "tolerances-not-checked" in codes
