"""YAML text -> plain values that know their places; texts edited; and files written whole or not at
all.
"""

import json
import math
import os
import re
import sys
from pathlib import Path

import pytest
from support.builders import within
from support.cases import spread
from support.golden import check_text

from nutdamp.errors import BadRequest, CannotRead, CannotWrite, FaultyFile
from nutdamp.files.editing import edited
from nutdamp.files.tabular import json_text, make_folder, whole_file, write_whole
from nutdamp.files.yaml import (
    MAX_BYTES,
    MAX_DEPTH,
    MAX_NODES,
    KeyPath,
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
    assert {path: (*root.place_of(path, key=True)[:2],) for path in keys} == keys
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
    root, faults = read_tree("a: 1\nb: {c: 1, c: 2}\na: 3\na: 4\n", "f.yaml")
    lines = map(str, sorted(faults, key=lambda fault: fault.line))
    check_text("files.yaml-duplicates", "\n".join(lines))
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
far:
- 4
- 5
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


EDITED: dict[str, tuple[dict[KeyPath, str], tuple[tuple[str, str], ...]]] = {
    "values": (
        {("inertia", "A"): "121 kg m^2", ("state", "nutation"): "6 deg", ("list", 1, "x"): "7"},
        (("120 kg", "121 kg"), ("5 deg", "6 deg"), ("x: 2", "x: 7")),
    ),
    "new keys, at the end of their mapping": (
        {("inertia", "B"): "5", ("state", "phase"): "1 deg", ("list", 0, "z"): "9"},
        (
            ("C: 80}", "C: 80, B: 5}"),
            ("# angle\n", "# angle\n  phase: 1 deg\n"),
            ("{x: 1}", "{x: 1, z: 9}"),
        ),
    ),
    "a new section": ({("new", "deep"): "2"}, (("    y: 3\n", "    y: 3\nnew: {deep: 2}\n"),)),
    "a list as far left as its key": ({("far",): "[9]"}, (("- 4\n- 5", "  [9]"),)),
    "a whole block": (
        {("state",): "[1, 2, 3]"},
        (("\n  spin: 30 rpm\n  # between\n  nutation: 5 deg", "\n  [1, 2, 3]"),),
    ),
    "an entry of a list": ({("far", 0): "2"}, (("- 4", "- 2"),)),
}
"""Values, and what changes in `TEXT`, where comments stay."""


def test_values_of_a_text_change_and_all_else_stays() -> None:
    for name, (values, changes) in EDITED.items():
        expected = TEXT
        for change in changes:
            expected = expected.replace(*change)
        assert edited(TEXT, values) == expected, name
    for text, path, problem in (
        ("a: &x {k: 1}\nb: *x\n", ("b", "k"), "b is an alias: write its value out"),
        ("a: &x 1\nb: *x\n", ("a",), "a has the alias *x: write that out"),
    ):
        with pytest.raises(BadRequest, match=re.escape(problem)):
            edited(text, {path: "2"})
    assert edited("a: &x 1\nb: 3\n", {("a",): "2"}) == "a: 2\nb: 3\n"


@pytest.mark.parametrize("end", ["", "\n", "\n\n# the end\n", "\n# the end"])
@pytest.mark.parametrize("text", ["a: 1\nb: {c: 2}", '{\n\t"a": 1,\n\t"b": {"c": 2}\n}'])
def test_a_text_may_end_as_it_likes(text: str, end: str) -> None:
    """JSON indented with tabs, too."""
    made = edited(text + end, {("d",): "4", ("b", "e"): "5"})
    assert plain(made) == {"a": 1, "b": {"c": 2, "e": 5}, "d": 4}
    assert made.endswith(end)


# --- files are written whole or not at all


def test_a_failure_leaves_what_was_there_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("before")

    def fill_the_disk() -> None:
        with whole_file(str(tmp_path / "x.csv")) as stream:
            stream.write(b"half")
            write_whole(str(tmp_path / "quick.csv"), "quick")  # by another run
            raise OSError(28, "no room")

    with pytest.raises(CannotWrite, match="no room"):
        fill_the_disk()
    there = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert there == {"x.csv": "before", "quick.csv": "quick"}
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
