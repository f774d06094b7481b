"""Values of a YAML text are replaced in place: all else stays as it was."""

from __future__ import annotations

import pytest

from nutdamp.errors import BadRequest
from nutdamp.files.examples import example_text
from nutdamp.files.yaml_edit import edited
from nutdamp.files.yaml_tree import read_tree

pytestmark = pytest.mark.usefixtures("plans_shared")

TEXT = """\
# top
name: body   # who
inertia: {A: 120 kg m^2, C: 80}  # moments
state:
  spin: 30 rpm
  # between
  nutation: 5 deg  # angle

list:
  - {x: 1}
  - x: 2
    y: 3
"""


def test_values_change_and_comments_stay() -> None:
    made = edited(TEXT, {("inertia", "A"): "121 kg m^2", ("state", "nutation"): "6 deg", ("list", 1, "x"): "7"})
    assert made == TEXT.replace("120 kg", "121 kg").replace("5 deg", "6 deg").replace("x: 2", "x: 7")


def test_new_keys_go_to_the_end_of_their_mapping() -> None:
    made = edited(
        TEXT, {("inertia", "B"): "5", ("state", "phase"): "1 deg", ("new", "deep"): "2", ("list", 0, "z"): "9"}
    )
    tree = read_tree(made, "made")[0]
    assert tree.get("inertia", "B") is not None
    assert "  nutation: 5 deg  # angle\n  phase: 1 deg\n" in made
    assert "{x: 1, z: 9}" in made
    assert made.endswith("new: {deep: 2}\n")
    assert [line for line in made.splitlines() if "#" in line] == [
        line.replace("C: 80}", "C: 80, B: 5}") for line in TEXT.splitlines() if "#" in line
    ]


def test_a_whole_block_gives_way_to_a_flow_value_and_a_key_to_another_name() -> None:
    made = edited(TEXT, {("state",): "[1, 2, 3]"}, {"state": "omega0"})
    assert "omega0:\n  [1, 2, 3]  # angle\n" in made
    assert read_tree(made, "made")[0].plain() == {
        "name": "body",
        "inertia": {"A": "120 kg m^2", "C": 80},
        "omega0": [1, 2, 3],
        "list": [{"x": 1}, {"x": 2, "y": 3}],
    }


@pytest.mark.parametrize("end", ["", "\n", "\n\n# the end\n", "\n# the end"])
def test_a_text_may_end_as_it_likes(end: str) -> None:
    text = "a: 1\nb: {c: 2}" + end
    made = edited(text, {("d",): "4", ("b", "e"): "5"})
    assert read_tree(made, "made")[0].plain() == {"a": 1, "b": {"c": 2, "e": 5}, "d": 4}
    assert made.endswith(end)


def test_what_an_alias_stands_for_is_refused() -> None:
    with pytest.raises(BadRequest, match="b is an alias: write its value out"):
        edited("a: &x {k: 1}\nb: *x\n", {("b", "k"): "2"})


def test_what_has_an_alias_is_refused_and_an_anchor_without_one_is_no_hindrance() -> None:
    with pytest.raises(BadRequest, match=r"a has the alias \*x: write that out"):
        edited("a: &x 1\nb: *x\n", {("a",): "2"})
    assert edited("a: &x 1\nb: 3\n", {("a",): "2"}) == "a: 2\nb: 3\n"


def test_the_built_in_example_keeps_every_other_line() -> None:
    text = example_text()
    made = edited(text, {("inertia", "A"): "121 kg m^2"}).splitlines()
    changed = [(one, other) for one, other in zip(text.splitlines(), made, strict=True) if one != other]
    assert changed == [("inertia: {A: 120 kg m^2, C: 80 kg m^2}", "inertia: {A: 121 kg m^2, C: 80 kg m^2}")]
