from __future__ import annotations

import math
import sys
from pathlib import Path

import pytest
from support.builders import within
from support.cases import spread

from nutdamp.errors import CannotRead, FaultyFile
from nutdamp.files.yaml_tree import (
    MAX_BYTES,
    MAX_DEPTH,
    MAX_NODES,
    Place,
    decode,
    dotted,
    read_text,
    read_tree,
    resolve,
)

pytestmark = pytest.mark.usefixtures("plans_shared")


def plain(text: str) -> object:
    root, faults = read_tree(text, "f.yaml")
    assert faults == []
    return root.plain()


def refusal(text: str) -> str:
    with pytest.raises(FaultyFile) as caught:
        read_tree(text, "f.yaml")
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("1E3", 1000.0),
        ("+.5", 0.5),
        ("5.", 5.0),
        ("-7", -7),
        ("010", 10),
        ("0x10", 16),
        ("0o17", 15),
        (".inf", math.inf),
        ("-.INF", -math.inf),
        ("1e400", math.inf),
        ("9" * 5000, math.inf),
        ("0x" + "f" * 5000, math.inf),
        ("true", True),
        ("FALSE", False),
        ("~", None),
        ("null", None),
        ("", None),
        *((text, text) for text in ("yes", "no", "on", "off", "y", "n", "1_000", "12:30:00", "2026-03-01", "+M1")),
        *((text, text) for text in ("0b1", "1e", "e3", ".", "tRue", "<<", "=", "-", "+.nan", "1.2.3")),
    ],
)
def test_plain_scalars_follow_the_core_schema(text: str, value: object) -> None:
    assert resolve(text) == value
    assert type(resolve(text)) is type(value)


def test_not_a_number() -> None:
    value = resolve(".nan")
    assert isinstance(value, float)
    assert math.isnan(value)


def test_quoted_and_tagged_scalars() -> None:
    text = "{a: '5', b: \"5\", c: !!str 5, d: ! 5, e: !!float 5, f: !!int 5, g: !!null ~, h: !!seq [1], i: !!map {}}"
    assert plain(text) == {"a": "5", "b": "5", "c": "5", "d": "5", "e": 5.0, "f": 5, "g": None, "h": [1], "i": {}}


def test_keys_are_names_as_written() -> None:
    assert plain("{1: a, +M1: b, yes: c, 1e3: d, '': e, ~: f}") == {
        "1": "a", "+M1": "b", "yes": "c", "1e3": "d", "": "e", "~": "f",
    }  # fmt: skip


def test_json_with_tabs_and_escapes_is_yaml() -> None:
    text = '{\n\t"a": [1,\t2.5e-1],\t"b": {"c":"\\u00e4\\/\\ud83d\\ude00"}\n}\n'
    assert plain(text) == {"a": [1, 0.25], "b": {"c": "ä/😀"}}


def test_tabs_that_do_not_indent_are_space() -> None:
    assert plain("a:\t5\t# five\nb: 6\n") == {"a": 5, "b": 6}


def test_places_count_from_one() -> None:
    root, _ = read_tree("# c\na:\n  b: [1, {x: 2}]\n", "f.yaml")
    assert root.key_place_of(("a",)) == Place(2, 1)
    assert root.place_of(("a", "b")) == Place(3, 6)
    assert root.place_of(("a", "b", 1, "x")) == Place(3, 14)
    assert root.key_place_of(("a", "b", 1, "x")) == Place(3, 11)
    assert root.key_place_of(("a", "b", 0)) == Place(3, 7)
    assert root.place_of(("a", "nowhere", 3)) == Place(3, 3)
    assert root.key_place_of(()) == Place(2, 1)


def test_byte_order_mark_and_line_ends_leave_the_places() -> None:
    root, _ = read_tree("\ufeffa: 1\r\nb: 2\r\n", "f.yaml")
    assert root.plain() == {"a": 1, "b": 2}
    assert root.place_of(("b",)) == Place(2, 4)
    assert decode(b"\xef\xbb\xbfa: 1", "f.yaml") == "a: 1"


def test_anchors_and_aliases_in_moderation() -> None:
    assert plain("{a: &x [1, 2], &k b: *x, c: *k }") == {"a": [1, 2], "b": [1, 2], "c": "b"}


def test_duplicate_keys_are_all_reported_with_the_first_place() -> None:
    root, faults = read_tree("a: 1\nb: {c: 1, c: 2}\na: 3\na: 4\n", "f.yaml")
    assert [str(fault) for fault in sorted(faults, key=lambda fault: fault.line)] == [
        "f.yaml:2:11: b.c: duplicate key; already given at line 2, column 5; remove one of them",
        "f.yaml:3:1: a: duplicate key; already given at line 1, column 1; remove one of them",
        "f.yaml:4:1: a: duplicate key; already given at line 1, column 1; remove one of them",
    ]
    assert root.plain() == {"a": 1, "b": {"c": 1}}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "f.yaml:1:1: empty; a spacecraft file is a mapping"),
        ("  \n\n", "f.yaml:1:1: empty"),
        ("# only\n# words\n", "f.yaml:1:1: only comments; a spacecraft file is a mapping"),
        ("---\n", "f.yaml:2:1: expected a mapping with name, inertia, …, got nothing"),
        ("5\n", "f.yaml:1:1: expected a mapping with name, inertia, …, got 5"),
        ("- a\n- b\n", "f.yaml:1:1: expected a mapping with name, inertia, …, got a list"),
        ("a: 1\n---\nb: 2\n", "f.yaml:2:1: a second document begins; one file holds one spacecraft"),
        ("a:\n\tb: 1\n", "f.yaml:2:1: not YAML: a tab indents here; use spaces"),
        ("a: b: c\n", "f.yaml:1:5: not YAML: a second ': ' in one line, or wrong indentation"),
        ("a: 1\nb\nc: 2\n", "f.yaml:2:1: not YAML: no 'key: value' (a space must follow the colon)"),
        ("a: 'x\nb: 3\n", "f.yaml:1:4: not YAML: the quotation mark is never closed"),
        ("a: [1, 2\nb: 3\n", "f.yaml:2:2: not YAML: a comma or the closing bracket is missing"),
        ("a: {b: 1]\n", "f.yaml:1:9: not YAML: a comma or the closing bracket is missing"),
        ("a: [1,,2]\n", "f.yaml:1:7: not YAML: a value is missing before this"),
        ("a: 1\n b: 2\n", "f.yaml:2:3: not YAML: a second ': ' in one line, or wrong indentation"),
        ("a:\n  b: 1\n c: 2\n", "f.yaml:3:2: not YAML: indentation that fits no line above"),
        ("a: 5 - 3\nb: - 4\n", "f.yaml:2:4: not YAML: '- ' where no list can begin"),
        ("a: @b\n", "f.yaml:1:4: not YAML: a text that begins with a reserved character; put it in quotes"),
        ('a: "\\q"\n', "f.yaml:1:6: not YAML: unknown \\ escape"),
        ('a: "\\UFFFFFFFF"\n', "f.yaml:1:7: not YAML: a number here is out of range"),
        ('a: "\\ud83d"\n', "f.yaml:1:4: a: half a surrogate pair"),
        ("{a: 1} x\n", "f.yaml:1:8: not YAML: text behind the end of the file's mapping"),
        ("%YAML 2.0\n---\na: 1\n", "f.yaml:1:1: not YAML: found incompatible YAML document"),
        ("a: !x!y z\n", "f.yaml:1:4: not YAML: an unknown tag; leave it out"),
        ("a: x\0y\n", "f.yaml:1:5: the character '\\x00' is not allowed in a text"),
        ("a: 1\nb: \x1b[0m\n", "f.yaml:2:4: the character '\\x1b' is not allowed in a text"),
        ("? [1]\n: 2\n", "f.yaml:1:3: a key must be a plain text"),
        ("a: *x\n", "f.yaml:1:4: a: alias '*x' has no anchor &x above it"),
        ("a: &x [1, *x]\n", "f.yaml:1:11: a[1]: alias '*x' lies inside the value it repeats"),
        ("a: !!python/object/apply:os.system [id]\n", "f.yaml:1:4: a: the tag '!!python/object/apply:os.system'"),
        ("a: !!python/name:os.system ''\n", "the tag '!!python/name:os.system' does not fit here; leave it out"),
        ("!!python/dict {a: 1}\n", "f.yaml:1:1: the tag '!!python/dict' does not fit here"),
        ("!thing a: 1\n", "f.yaml:1:1: a: the tag '!thing' does not fit here"),
        ("a: !!binary aGk=\n", "the tag '!!binary' does not fit here"),
        ("a: !!int x\n", "the tag '!!int' does not fit here"),
        ("a: !!str [1]\n", "the tag '!!str' does not fit here"),
    ],
)
def test_what_is_no_plain_yaml_mapping_is_refused(text: str, message: str) -> None:
    assert refusal(text).startswith(message) or message in refusal(text)
    assert "\n" not in refusal(text)


def test_duplicates_found_before_a_syntax_error_are_reported_too() -> None:
    assert refusal("a: 1\na: 2\nb: 'x\n").count("f.yaml:") == 2


def bomb(levels: int) -> str:
    lines = ["a0: &a0 [" + "x," * 9 + "x]"]
    lines += [f"a{n}: &a{n} [" + f"*a{n - 1}, " * 9 + f"*a{n - 1}]" for n in range(1, levels)]
    return "\n".join(lines)


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
    with within(10_000_000):
        assert message in refusal(text)


def test_the_limits_themselves_are_allowed() -> None:
    deep = "a: " + "[" * MAX_DEPTH + "]" * MAX_DEPTH
    assert plain(deep)
    assert plain("a: [" + "1," * (MAX_NODES - 3) + "1]")
    assert plain(bomb(3))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"\xff\xfea\x00", "f.yaml:1:1: the text is UTF-16; save it as UTF-8"),
        (b"a: 1\nb: \xe4\n", "f.yaml:2:4: not UTF-8 (byte 8 is 0xe4); save it as UTF-8"),
        (b"\xef\xbb\xbfa: \xc3", "f.yaml:1:5: not UTF-8 (byte 6 is 0xc3)"),
        (b"\x89PNG\r\n\x1a\n\0\0", "f.yaml:3:1: binary data (a zero byte at byte 8)"),
        (b"#" * (MAX_BYTES + 1), "f.yaml: larger than 1 MiB; that is no spacecraft file"),
    ],
)
def test_what_is_no_text_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(FaultyFile) as caught:
        decode(data, "f.yaml")
    assert str(caught.value).startswith(message)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    for path, reason in [(tmp_path, "is a directory"), (tmp_path / "none", "no such file"), (Path("a\0b"), "null")]:
        if sys.platform == "win32" and path == tmp_path:
            reason = "permission denied"
        with pytest.raises(CannotRead, match=reason):
            read_text(path)
    large = tmp_path / "large.yaml"
    large.write_bytes(b"#" * (MAX_BYTES + 10))
    with pytest.raises(FaultyFile, match="larger than 1 MiB"):
        read_text(large)


def test_dotted() -> None:
    assert dotted(("thrusters", 1, "force")) == "thrusters[1].force"
    assert dotted(("channels", "+M1", 0)) == "channels.+M1[0]"
    assert dotted(("channels", "a b\n")) == "channels.'a b\\n'"
    assert dotted(()) == ""
