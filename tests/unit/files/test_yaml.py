"""YAML text -> plain values that know their places -> sections as classes; and files written whole
or not at all.
"""

import json
import math
import os
import sys
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from support.builders import within
from support.cases import spread
from support.golden import check_text

from nutdamp.errors import BadRequest, CannotRead, CannotWrite, FaultyFile
from nutdamp.files.editing import edited
from nutdamp.files.fields import (
    NAME,
    Finding,
    Key,
    ValueKind,
    Values,
    choice,
    definitions,
    either,
    flag,
    named,
    optional,
    quantity,
    required,
    row,
    rows,
    section,
    whole,
)
from nutdamp.files.reader import example_text
from nutdamp.files.tabular import json_text, make_folder, whole_file, write_whole
from nutdamp.files.yaml import (
    MAX_BYTES,
    MAX_DEPTH,
    MAX_NODES,
    decode,
    dotted,
    read_text,
    read_tree,
    resolve,
)


def plain(text: str) -> object:
    root, faults = read_tree(text, "f.yaml")
    assert faults == []
    return root.plain()


def refusal(text: str | bytes) -> str:
    with pytest.raises(FaultyFile) as caught:
        read_tree(text if isinstance(text, str) else decode(text, "f.yaml"), "f.yaml")
    return str(caught.value)


NUMBERS: dict[str, float | None] = {
    "1e-3": 0.001,
    "1E3": 1000.0,
    "+.5": 0.5,
    "5.": 5.0,
    "-7": -7,
    "010": 10,
    "0x10": 16,
    "0o17": 15,
    "1e400": math.inf,
    ".inf": math.inf,
    "-.INF": -math.inf,
    "9" * 5000: math.inf,
    "0x" + "f" * 5000: math.inf,
    "true": True,
    "FALSE": False,
    "~": None,
    "null": None,
    "": None,
}
TEXTS = [
    "yes",
    "no",
    "on",
    "off",
    "y",
    "n",
    "1_000",
    "12:30:00",
    "2026-03-01",
    "+M1",
    "0b1",
    "1e",
    "e3",
    ".",
    "tRue",
    "<<",
    "=",
    "-",
    "+.nan",
    "1.2.3",
]


def test_plain_scalars_follow_the_core_schema() -> None:
    for text, value in (NUMBERS | {text: text for text in TEXTS}).items():
        assert (resolve(text), type(resolve(text))) == (value, type(value)), text
    assert isinstance(not_a_number := resolve(".nan"), float)
    assert math.isnan(not_a_number)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (
            (
                "{a: '5', b: \"5\", c: !!str 5, d: ! 5, e: !!float 5, f: !!int 5, g: !!null ~, h: "
                "!!seq [1], i: !!map {}}"
            ),
            {
                "a": "5",
                "b": "5",
                "c": "5",
                "d": "5",
                "e": 5.0,
                "f": 5,
                "g": None,
                "h": [1],
                "i": {},
            },
        ),
        (
            "{1: 0, +M1: 0, yes: 0, 1e3: 0, '': 0, ~: 0}",
            dict.fromkeys(["1", "+M1", "yes", "1e3", "", "~"], 0),
        ),
        (
            '{\n\t"a": [1,\t2.5e-1],\t"b": {"c":"\\u00e4\\/\\ud83d\\ude00"}\n}\n',
            {"a": [1, 0.25], "b": {"c": "ä/😀"}},
        ),
        ("a:\t5\t# five\nb: 6\n", {"a": 5, "b": 6}),
        ("{a: &x [1, 2], &k b: *x, c: *k }", {"a": [1, 2], "b": [1, 2], "c": "b"}),
        ("a: " + "[" * MAX_DEPTH + "]" * MAX_DEPTH, None),
        ("a: [" + "1," * (MAX_NODES - 3) + "1]", None),
    ],
    ids=[
        "quotes and tags",
        "keys as written",
        "JSON with tabs",
        "tabs that are space",
        "aliases",
        "depth",
        "number",
    ],
)
def test_what_is_read(text: str, value: object) -> None:
    """The limits themselves are allowed."""
    read = plain(text)
    assert read if value is None else read == value


def test_places_count_from_one_and_leave_out_byte_order_marks() -> None:
    root, _ = read_tree("# c\na:\n  b: [1, {x: 2}]\n", "f.yaml")
    values = {("a", "b"): (3, 6), ("a", "b", 1, "x"): (3, 14), ("a", "nowhere", 3): (3, 3)}
    assert {path: (*root.place_of(path)[:2],) for path in values} == values
    keys = {("a",): (2, 1), ("a", "b", 1, "x"): (3, 11), ("a", "b", 0): (3, 7), (): (2, 1)}
    assert {path: (*root.key_place_of(path)[:2],) for path in keys} == keys
    marked, _ = read_tree("\ufeffa: 1\r\nb: 2\r\n", "f.yaml")
    assert (marked.plain(), marked.place_of(("b",))[:2]) == ({"a": 1, "b": 2}, (2, 4))
    assert decode(b"\xef\xbb\xbfa: 1", "f.yaml") == "a: 1"


REFUSED: list[str | bytes] = [
    "",
    "  \n\n",
    "# only\n# words\n",
    "---\n",
    "5\n",
    "- a\n- b\n",
    "a: 1\n---\nb: 2\n",
    "a:\n\tb: 1\n",
    "a: b: c\n",
    "a: 1\nb\nc: 2\n",
    "a: 'x\nb: 3\n",
    "a: [1, 2\nb: 3\n",
    "a: {b: 1]\n",
    "a: [1,,2]\n",
    "a: 1\n b: 2\n",
    "a:\n  b: 1\n c: 2\n",
    "a: 5 - 3\nb: - 4\n",
    "a: @b\n",
    'a: "\\q"\n',
    'a: "\\UFFFFFFFF"\n',
    'a: "\\ud83d"\n',
    "{a: 1} x\n",
    "%YAML 2.0\n---\na: 1\n",
    "a: !x!y z\n",
    "a: x\0y\n",
    "a: 1\nb: \x1b[0m\n",
    "? [1]\n: 2\n",
    "a: *x\n",
    "a: &x [1, *x]\n",
    "a: !!python/object/apply:os.system [id]\n",
    ("a: !!python/name:os.system ''\n"),
    "!!python/dict {a: 1}\n",
    "!thing a: 1\n",
    "a: !!binary aGk=\n",
    "a: !!int x\n",
    "a: !!str [1]\n",
    "a: 1\na: 2\nb: 'x\n",  # duplicates that were found before
    b"\xff\xfea\x00",
    b"a: 1\nb: \xe4\n",
    b"\xef\xbb\xbfa: \xc3",
    b"\x89PNG\r\n\x1a\n\0\0",
]


def test_what_is_no_plain_yaml_mapping_is_refused_in_one_line_a_fault() -> None:
    check_text(
        "files.yaml-refused", "\n".join(f"{text!r}\n    {refusal(text)}" for text in REFUSED)
    )


def test_duplicate_keys_are_all_reported_with_the_first_place() -> None:
    root, faults = read_tree("a: 1\nb: {c: 1, c: 2}\na: 3\na: 4\n", "f.yaml")
    check_text(
        "files.yaml-duplicates", "\n".join(map(str, sorted(faults, key=lambda fault: fault.line)))
    )
    assert root.plain() == {"a": 1, "b": {"c": 1}}


def bomb(levels: int) -> str:
    lines = (f"a{n}: &a{n} [" + f"*a{n - 1}, " * 9 + f"*a{n - 1}]" for n in range(1, levels))
    return "\n".join(["a0: &a0 [" + "x," * 9 + "x]", *lines])


@spread(
    ("text", "message"),
    [
        (bomb(30), f"more than {MAX_NODES} values"),
        ("a: [" + "1," * (MAX_NODES + 1) + "1]", f"more than {MAX_NODES} values"),
        ("a: " + "[" * 500_000, f"nested more than {MAX_DEPTH} levels"),
        ("{a: " * 200_000, f"nested more than {MAX_DEPTH} levels"),
        ("- " * 500_000, f"nested more than {MAX_DEPTH} levels"),
        ("? " * 500_000, "a key must be a plain text"),
        ("a: " + "&x " * 300_000, "not YAML"),
        ("a: '" + "x" * 1_000_000, "never closed"),
    ],
    quick=1,
)
def test_bombs_are_refused_at_once(text: str, message: str) -> None:
    assert plain(bomb(3))
    with within(10_000_000):
        assert message in refusal(text)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    folder = "permission denied" if sys.platform == "win32" else "is a directory"
    for path, reason in [
        (tmp_path, folder),
        (tmp_path / "none", "no such file"),
        (Path("a\0b"), "null"),
    ]:
        with pytest.raises(CannotRead, match=reason):
            read_text(path)
    (tmp_path / "large.yaml").write_bytes(b"#" * (MAX_BYTES + 10))
    with pytest.raises(FaultyFile, match="too large: more than 1 MiB"):
        read_text(tmp_path / "large.yaml")


def test_paths_as_messages_write_them() -> None:
    paths = ("thrusters", 1, "force"), ("channels", "+M1", 0), ("channels", "a b\n"), ()
    assert [dotted(path) for path in paths] == [
        "thrusters[1].force",
        "channels.+M1[0]",
        "channels.'a b\\n'",
        "",
    ]


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


def test_values_change_new_keys_go_to_the_end_of_their_mapping_and_comments_stay() -> None:
    made = edited(
        TEXT,
        {("inertia", "A"): "121 kg m^2", ("state", "nutation"): "6 deg", ("list", 1, "x"): "7"},
    )
    assert made == TEXT.replace("120 kg", "121 kg").replace("5 deg", "6 deg").replace(
        "x: 2", "x: 7"
    )
    more = edited(
        TEXT,
        {
            ("inertia", "B"): "5",
            ("state", "phase"): "1 deg",
            ("new", "deep"): "2",
            ("list", 0, "z"): "9",
        },
    )
    expected = TEXT.replace("C: 80}", "C: 80, B: 5}").replace(
        "# angle\n", "# angle\n  phase: 1 deg\n"
    )
    assert more == expected.replace("{x: 1}", "{x: 1, z: 9}") + "new: {deep: 2}\n"
    example = example_text()
    assert edited(example, {("inertia", "A"): "121 kg m^2"}) == example.replace(
        "{A: 120 kg", "{A: 121 kg"
    )


def test_a_whole_block_gives_way_to_a_flow_value_and_a_key_to_another_name() -> None:
    made = edited(TEXT, {("state",): "[1, 2, 3]"}, {"state": "omega0"})
    begin, end = TEXT.index("state"), TEXT.index("  # angle")
    assert made == f"{TEXT[:begin]}omega0:\n  [1, 2, 3]{TEXT[end:]}"
    assert read_tree(made, "made")[0].get("omega0") is not None


@pytest.mark.parametrize("end", ["", "\n", "\n\n# the end\n", "\n# the end"])
@pytest.mark.parametrize("text", ["a: 1\nb: {c: 2}", '{\n\t"a": 1,\n\t"b": {"c": 2}\n}'])
def test_a_text_may_end_as_it_likes(text: str, end: str) -> None:
    """JSON indented with tabs, too."""
    made = edited(text + end, {("d",): "4", ("b", "e"): "5"})
    assert plain(made) == {"a": 1, "b": {"c": 2, "e": 5}, "d": 4}
    assert made.endswith(end)


def test_an_alias_and_what_has_one_are_refused_and_an_anchor_without_one_is_no_hindrance() -> None:
    with pytest.raises(BadRequest, match="b is an alias: write its value out"):
        edited("a: &x {k: 1}\nb: *x\n", {("b", "k"): "2"})
    with pytest.raises(BadRequest, match=r"a has the alias \*x: write that out"):
        edited("a: &x 1\nb: *x\n", {("a",): "2"})
    assert edited("a: &x 1\nb: 3\n", {("a",): "2"}) == "a: 2\nb: 3\n"


# --- sections as classes: every type that a key may have, read and in the schema

TIME = quantity("time", minimum=0)


def key(kind: ValueKind, default: Any = None) -> Key:
    return optional(kind, "What it is.", default=default)


INNER = section("Inner", "Below.", {"t": required(TIME, "Time of it, s.", "1 s")})
OUTER = section(
    "Outer",
    "Every kind.",
    {
        "text": key(NAME),
        "whole": key(whole(1, 9)),
        "flag": key(flag(), False),
        "choice": key(choice("one", "two")),
        "times": key(rows(TIME, 2, 3)),
        "pair": key(row(TIME, whole(0, 9))),
        "named": key(named(INNER, 1)),
        "either": key(either(rows(TIME, 1), INNER)),
        "inner": key(INNER),
        "inners": key(rows(INNER), []),
    },
)


def read(contents: object) -> tuple[Any, list[Finding]]:
    """The section in a file, and what is wrong."""
    values = Values(read_tree(json.dumps(contents), "f.yaml")[0])
    return values.read(OUTER, values.root), values.findings


GOOD: dict[str, tuple[Any, object]] = {
    "text": ("a", "a"),
    "whole": (9, 9),
    "flag": (True, True),
    "choice": ("two", "two"),
    "times": (["20 ms", 1], [0.02, 1.0]),
    "pair": (["20 ms", 3], [0.02, 3]),
    "either": (["1 min"], [60.0]),
}
SECTIONS = {
    "named": {"a": {"t": 1}},
    "either": {"t": 2},
    "inner": {"t": 3},
    "inners": [{"t": 4}, {"t": "5 s"}],
}
BAD: dict[str, tuple[Any, ...]] = {
    "text": ("", 3, [3]),
    "whole": (10, 0, True, 2.0),
    "flag": ("on",),
    "choice": ("tow",),
    "times": ("1 s", [1], [1, 2, 3, 4], [1, -2], [1, 2, 3, "x"]),
    "pair": ({"a": 1}, [1], [1, "x"]),
    "named": ({}, {"a": {}}),
    "either": ({"t": "x"}, "x"),
    "inner": (3,),
    "inners": ([{"t": 1}, {"t": [1]}],),
}


def test_what_is_right_is_read_also_within_lists_and_mappings() -> None:
    for name, (value, expected) in GOOD.items():
        contents, findings = read({name: value})
        assert (getattr(contents, name), findings) == (expected, [])
    contents, findings = read(SECTIONS)
    assert contents.flag is False  # by default
    parts = [contents.named["a"], contents.either, contents.inner, *contents.inners]
    assert [part.t for part in parts] == [1, 2, 3, 4, 5]
    assert findings == []


def test_what_is_wrong_is_said_where_it_is_and_all_of_it_at_once() -> None:
    """Each is one fault: also a list too long with a wrong entry."""
    lines = []
    for name, value in ((name, value) for name, values in BAD.items() for value in values):
        ((where, problem, _),) = read({name: value})[1]
        lines.append(f"{name}: {value!r} -> {where}: {problem}")
    check_text("files.sections", "\n".join(lines))
    several = read({"whole": 0, "times": [-1, "x"], "inner": {}})[1]
    assert [finding.path for finding in several] == [
        ("whole",),
        ("times", 0),
        ("times", 1),
        ("inner", "t"),
    ]


def test_the_schema_allows_what_is_read_and_nothing_else() -> None:
    schema = {**OUTER.definition, "$defs": definitions(OUTER)}
    Draft202012Validator.check_schema(schema)
    judge = Draft202012Validator(schema)
    assert all(
        judge.is_valid(right)
        for right in ({}, SECTIONS, *({name: given} for name, (given, _) in GOOD.items()))
    )
    allowed = [
        (name, value)
        for name, values in BAD.items()
        for value in values
        if judge.is_valid({name: value})
    ]
    assert allowed == [("whole", 2.0)]  # JSON knows no other 2


# --- files are written whole or not at all


def test_what_another_run_is_writing_is_left_alone(tmp_path: Path) -> None:
    with whole_file(str(tmp_path / "slow.csv")) as stream:
        stream.write(b"slow")
        write_whole(str(tmp_path / "quick.csv"), "quick")
        assert len([path for path in tmp_path.iterdir() if path.name.startswith(".")]) == 1
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        "slow.csv": "slow",
        "quick.csv": "quick",
    }


def test_a_failure_leaves_what_was_there_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("before")

    def fill_the_disk() -> None:
        with whole_file(str(tmp_path / "x.csv")) as stream:
            stream.write(b"half")
            raise OSError(28, "no room")

    with pytest.raises(CannotWrite, match="no room"):
        fill_the_disk()
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"x.csv": "before"}
    with pytest.raises(CannotWrite):  # a zero byte is no path
        write_whole("a\0b", "1")
    with pytest.raises(CannotWrite):
        make_folder("a\0b")


def test_modes_stay_and_names_may_be_long_and_need_not_be_utf_8_in_json(tmp_path: Path) -> None:
    path = tmp_path / ("x" * 251 + ".csv")
    path.write_text("before")
    path.chmod(0o640)
    write_whole(str(path), "after")
    assert (path.read_text(), path.stat().st_mode & 0o777) == ("after", 0o640)
    content = {"file": os.fsdecode(b"d\xfcse.yaml"), "umlaut": "ü"}
    write_whole(str(tmp_path / "x.json"), json_text(content))
    assert json.loads((tmp_path / "x.json").read_text(encoding="utf-8")) == content
