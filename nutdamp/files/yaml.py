"""YAML text -> plain values with their positions, by the core schema of YAML 1.2.

Built on the events of PyYAML, so that no tag can build an object, nothing recurses deeply and a
bomb of aliases is refused before it unfolds. JSON is read by the same path. Every problem becomes
`FaultyFile` with its place.
"""

from __future__ import annotations

import math
import re
import stat
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from yaml.parser import Parser
from yaml.reader import Reader, ReaderError
from yaml.scanner import Scanner

from nutdamp.errors import CannotRead, Fault, FaultyFile
from nutdamp.units import shown

KeyPath = tuple[str | int, ...]
"""Keys and list positions that lead from the root to a value."""

STDIN = "-"  # file name that means standard input


def read_bytes(path: str, limit: int = -1) -> bytes:
    """Contents of a file, at most ``limit`` bytes of it; ``-`` is standard input.
    Raises CannotRead.
    """
    try:
        if path == STDIN:
            if sys.stdin is None:
                raise CannotRead(path, "there is no standard input")
            return sys.stdin.buffer.read(limit)
        mode = Path(path).stat().st_mode
        problem = "it is a device; expected a file, a pipe or -"
        if stat.S_ISBLK(mode) or stat.S_ISSOCK(mode):
            raise CannotRead(path, problem)
        with Path(path).open("rb") as stream:
            if stat.S_ISCHR(mode) and not stream.isatty():  # reading may never end
                raise CannotRead(path, problem)
            return stream.read(limit)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or str(error)
        raise CannotRead(path, reason.lower()) from error


MAX_BYTES = 1 << 20  # of a spacecraft file


def read_limited(path: str, limit: int = MAX_BYTES) -> bytes:
    """Contents of a file of at most ``limit`` bytes; raises CannotRead, or FaultyFile where it is
    larger.
    """
    data = read_bytes(path, limit + 1)
    if len(data) > limit:
        raise FaultyFile([Fault(path, 0, 0, "", f"too large: more than {limit >> 20} MiB")])
    return data


MAX_NODES = 10_000  # values in a file, those that aliases repeat counted each time
MAX_DEPTH = 32


class Place(NamedTuple):
    """Line and column of a value, both from 1, 0 where there are none, and its ``offset`` in the
    text; or the name of a ``setting`` beside the file.
    """

    line: int = 0
    column: int = 0
    setting: str = ""
    offset: int = 0

    def __str__(self) -> str:
        return self.setting or f"line {self.line}, column {self.column}"

    def fault(self, name: str, where: str, problem: str) -> Fault:
        """A fault here; ``name`` is that of the file."""
        return Fault(self.setting or name, self.line, self.column, where, problem)


Scalar = str | int | float | bool | None


@dataclass(slots=True)
class Node:
    """A value and where it is, up to the offset ``end`` of the text; ``keys`` holds the places of a
    mapping's keys, ``flow`` is True of what stands in brackets or braces.
    """

    value: Scalar | dict[str, Node] | list[Node]
    place: Place
    keys: dict[str, Place] = field(default_factory=dict)
    size: int = 1
    end: int = 0
    flow: bool = False

    def get(self, *path: str | int) -> Node | None:
        """The node at ``path`` below this one; None where there is none."""
        node: Node | None = self
        for step in path:
            value = None if node is None else node.value
            node = None
            if isinstance(value, dict) and isinstance(step, str):
                node = value.get(step)
            elif isinstance(value, list) and isinstance(step, int) and step < len(value):
                node = value[step]
        return node

    def children(self) -> Iterator[tuple[str | int, Node]]:
        """Keys or positions, and their nodes; nothing for a scalar."""
        if isinstance(self.value, dict):
            yield from self.value.items()
        elif isinstance(self.value, list):
            yield from enumerate(self.value)

    def plain(self) -> object:
        """Dicts, lists, texts, numbers, booleans and None, without places."""
        if isinstance(self.value, dict):
            return {key: child.plain() for key, child in self.value.items()}
        if isinstance(self.value, list):
            return [child.plain() for child in self.value]
        return self.value

    def place_of(self, path: KeyPath, *, key: bool = False) -> Place:
        """Place of the value at ``path``, or of its ``key`` where it has one; of the innermost of
        its parents where there is none.
        """
        parent = self.get(*path[:-1]) if key and path else None
        if parent is not None and path[-1] in parent.keys:
            return parent.keys[str(path[-1])]
        for length in range(len(path), 0, -1):
            node = self.get(*path[:length])
            if node is not None:
                return node.place
        return self.place


def dotted(path: KeyPath) -> str:
    """``thrusters[1].force``; keys that are no plain words are quoted."""
    text = ""
    for step in path:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            word = step if re.fullmatch(r"[\w+-]{1,60}", step) else shown(step)
            text += f".{word}" if text else word
    return text


def read_text(path: Path) -> str:
    """Text of a file; raises `CannotRead`, or `FaultyFile` where it is too large, binary or not
    UTF-8.
    """
    return decode(read_limited(str(path)), str(path))


def decode(data: bytes, name: str) -> str:
    """Text of UTF-8 bytes, without a byte order mark; raises `FaultyFile`."""

    def fault(position: int, problem: str) -> FaultyFile:
        before = data[:position].decode(errors="replace")
        return FaultyFile([_place(before, len(before)).fault(name, "", problem)])

    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise fault(0, "the text is UTF-16; save it as UTF-8")
    if b"\0" in data:
        position = data.index(b"\0")
        raise fault(position, f"binary data (a zero byte at byte {position}); expected a text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # Python counts from behind a byte order mark here.
        position = error.start + 3 * data.startswith(b"\xef\xbb\xbf")
        raise fault(
            position, f"not UTF-8 (byte {position} is 0x{data[position]:02x}); save it as UTF-8"
        ) from None


def read_tree(text: str, name: str) -> tuple[Node, list[Fault]]:
    """The mapping in a YAML text, and faults that leave it readable; raises `FaultyFile` for other
    texts.
    """
    builder = _Builder(text.removeprefix("\ufeff"), name)
    root = builder.document(
        "a spacecraft file is a mapping with name, inertia, …", "one file holds one spacecraft"
    )
    if not isinstance(root.value, dict):
        raise builder.fatal(
            root.place, f"expected a mapping with name, inertia, …, got {shown(root.plain())}"
        )
    return root, builder.faults


def read_value(text: str, name: str) -> tuple[Node, list[Fault]]:
    """Any one value in a YAML text, and its faults; raises as `read_tree` does."""
    builder = _Builder(text, name)
    return builder.document("expected a value", "expected one value"), builder.faults


_END_OF_LINE = re.compile("[\0\r\n\x85\u2028\u2029]")


class _Events(Reader, Scanner, Parser):
    """PyYAML's event stream in pure Python, whose messages are the same on every machine."""

    def __init__(self, text: str) -> None:
        Reader.__init__(self, text)
        Scanner.__init__(self)
        Parser.__init__(self)

    def scan_to_next_token(self) -> None:
        """Skip blanks, comments and ends of lines.

        YAML allows tabs wherever they do not indent, and JSON is often indented with them; PyYAML
        allows none, and goes through comments character by character.
        """
        while True:
            while self.peek() == " " or (
                self.peek() == "\t" and (self.flow_level or not self.allow_simple_key)
            ):
                self.forward()
            if self.peek() == "#":
                end = _END_OF_LINE.search(self.buffer, self.pointer)
                assert end is not None  # the buffer ends in a zero
                self.index += end.start() - self.pointer
                self.column += end.start() - self.pointer
                self.pointer = end.start()
            if not self.scan_line_break():  # type: ignore[no-untyped-call]
                return
            if not self.flow_level:
                self.allow_simple_key = True


class _Builder:
    def __init__(self, text: str, name: str) -> None:
        self.text, self.name = text, name
        self.faults: list[Fault] = []
        self.anchors: dict[str, Node | None] = {}  # None while the anchored value is still open
        self.nodes = 0
        try:
            self.events = _Events(text)
        except ReaderError as error:
            place = _place(text, error.position)
            raise self.fatal(
                place, f"the character {chr(error.character)!r} is not allowed in a text"
            ) from None

    def fatal(self, place: Place, problem: str, path: KeyPath = ()) -> FaultyFile:
        """A fault after which reading on makes no sense, together with those found so far."""
        return FaultyFile([*self.faults, place.fault(self.name, dotted(path), problem)])

    def next(self) -> yaml.Event:
        try:
            event: yaml.Event = self.events.get_event()  # type: ignore[no-untyped-call]
        except yaml.MarkedYAMLError as error:
            # Own words for the frequent slips, PyYAML's for the rest.
            problem = " ".join(str(error.problem).split())
            slips = (slip for slip in _SYNTAX if re.search(slip[0], problem))
            _, cure, at_beginning = next(slips, ("", problem, False))
            place = _at(error.context_mark if at_beginning else error.problem_mark)
            raise self.fatal(place, f"not YAML: {cure}") from None
        except (ValueError, OverflowError):  # such as "\UFFFFFFFF", which is no character
            place = Place(self.events.line + 1, self.events.column + 1)
            raise self.fatal(place, "not YAML: a number here is out of range") from None
        return event

    def document(self, needed: str, single: str) -> Node:
        """The only document of the stream; ``needed`` and ``single`` are the cures for none and for
        several.
        """
        self.next()
        event = self.next()
        if isinstance(event, yaml.StreamEndEvent):
            what = "only comments" if self.text.strip() else "empty"
            raise self.fatal(Place(1, 1), f"{what}; {needed}")
        root = self.node(self.next(), ())
        self.next()
        event = self.next()
        if not isinstance(event, yaml.StreamEndEvent):
            raise self.fatal(_at(event.start_mark), f"a second document begins; {single}")
        return root

    def node(self, event: yaml.Event, path: KeyPath) -> Node:
        """The value that begins with an event, up to the last of its events."""
        place = _at(event.start_mark)
        repeated: Node | None = None
        if isinstance(event, yaml.AliasEvent):
            name = str(event.anchor)
            repeated = self.anchors.get(name)
            if repeated is None:
                problem = f"has no anchor &{name} above it"
                if name in self.anchors:
                    problem = "lies inside the value it repeats"
                raise self.fatal(place, f"alias {shown('*' + name)} {problem}", path)
        self.nodes += 1 if repeated is None else repeated.size
        if self.nodes > MAX_NODES:  # aliases within aliases are a bomb
            raise self.fatal(place, f"more than {MAX_NODES} values (aliases unfolded)", path[:1])
        if repeated is not None:
            return repeated
        assert isinstance(event, yaml.NodeEvent)
        if len(path) > MAX_DEPTH:
            raise self.fatal(place, f"nested more than {MAX_DEPTH} levels deep")
        if event.anchor is not None:
            self.anchors[event.anchor] = None
        if isinstance(event, yaml.ScalarEvent):
            # the text of a block ends in a line break
            end = _at(event.end_mark).offset - (event.style in ("|", ">"))
            node = Node(self.scalar(event, path), place, end=end)
        else:
            assert isinstance(event, yaml.CollectionStartEvent)
            node = self.collection(event, path)
        if event.anchor is not None:
            self.anchors[event.anchor] = node
        return node

    def collection(self, event: yaml.CollectionStartEvent, path: KeyPath) -> Node:
        """A list or mapping; a key that comes again is reported and its value dropped."""
        mapping = isinstance(event, yaml.MappingStartEvent)
        self.check_tag(event.tag, ("map" if mapping else "seq",), _at(event.start_mark), path)
        entries: list[Node] = []
        keys: dict[str, Place] = {}
        while not isinstance(begin := self.next(), yaml.CollectionEndEvent):
            step: str | int = len(entries)
            place = _at(begin.start_mark)
            if mapping:
                if not isinstance(begin, yaml.ScalarEvent):
                    raise self.fatal(place, "a key must be a plain text", path)
                step = self.characters(begin.value, place, path)
                self.check_tag(begin.tag, ("str",), place, (*path, step))
                if begin.anchor is not None:
                    self.anchors[begin.anchor] = Node(step, place)
                begin = self.next()
            entry = self.node(begin, (*path, step))
            if step in keys:
                first = keys[str(step)]
                problem = f"duplicate key; already given at {first}; remove one of them"
                self.faults.append(place.fault(self.name, dotted((*path, step)), problem))
                continue
            entries.append(entry)
            if mapping:
                keys[str(step)] = place
        flow = bool(event.flow_style) or not entries
        end = _at(begin.end_mark).offset if flow else entries[-1].end  # of a block its last entry's
        size = 1 + sum(entry.size for entry in entries)
        value = dict(zip(keys, entries, strict=True)) if mapping else entries
        return Node(value, _at(event.start_mark), keys, size, end, flow)

    def scalar(self, event: yaml.ScalarEvent, path: KeyPath) -> Scalar:
        """Text, number, boolean or None: a plain scalar by the core schema, unless a core tag
        overrides it.
        """
        place = _at(event.start_mark)
        text = self.characters(event.value, place, path)
        quoted = event.style is not None and event.tag is None
        value = text if quoted or event.tag in ("!", f"{_CORE}str") else resolve(text)
        self.check_tag(event.tag, _TAGS[type(value)], place, path)
        return float(value) if event.tag == f"{_CORE}float" and isinstance(value, int) else value

    def check_tag(
        self, tag: str | None, allowed: tuple[str, ...], place: Place, path: KeyPath
    ) -> None:
        """Check a tag; raises `FaultyFile` where it does not fit the value, above all where it
        needs an object.
        """
        if tag not in (None, "!", *(f"{_CORE}{name}" for name in allowed)):
            name = str(tag).replace(_CORE, "!!")
            raise self.fatal(place, f"the tag {shown(name)} does not fit here; leave it out", path)

    def characters(self, text: str, place: Place, path: KeyPath) -> str:
        """The text with the surrogate pairs of JSON escapes joined; a lone half is no character."""
        try:
            return text.encode("utf-16", "surrogatepass").decode("utf-16")
        except UnicodeDecodeError:
            raise self.fatal(
                place, "half a surrogate pair; write the character itself", path
            ) from None


_CORE = "tag:yaml.org,2002:"
_TAGS: dict[type, tuple[str, ...]] = {
    str: ("str",),
    int: ("int", "float"),
    float: ("float",),
    bool: ("bool",),
    type(None): ("null",),
}

_WORDS: dict[str, Scalar] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), math.nan),
    **dict.fromkeys(
        (f"{sign}{word}" for sign in ("", "+") for word in (".inf", ".Inf", ".INF")), math.inf
    ),
    **dict.fromkeys(("-.inf", "-.Inf", "-.INF"), -math.inf),
}
_NUMBER = re.compile(
    r"(?P<dec>[-+]?[0-9]+)|0o(?P<oct>[0-7]+)|0x(?P<hex>[0-9a-fA-F]+)"
    r"|(?P<float>[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?)"
)
_BASES = {"dec": 10, "oct": 8, "hex": 16}


def resolve(text: str) -> Scalar:
    """Value of a plain scalar by the core schema of YAML 1.2 (10.3.2); any other scalar is text."""
    if text in _WORDS:
        return _WORDS[text]
    match = _NUMBER.fullmatch(text)
    if match is None:
        return text
    kind = match.lastgroup or ""
    if kind not in _BASES:
        return float(text)
    # No number of a file has so many digits, and Python refuses to convert very long ones.
    return int(match[kind], _BASES[kind]) if len(text) <= 300 else math.inf


# Messages of PyYAML's scanner and parser, and their cures for a person; True where the slip lies
# where the construct began and not where reading it failed.
_SYNTAX = (
    (r"'\\t' that cannot start", "a tab indents here; use spaces", False),
    (
        r"mapping values are not",
        "a second ': ' in one line, or wrong indentation; quote texts that hold ': '",
        False,
    ),
    (r"could not find expected ':'", "no 'key: value' (a space must follow the colon)", True),
    (r"unexpected end of stream", "the quotation mark is never closed", True),
    (r"unknown escape", "unknown \\ escape; use single quotes for texts with a backslash", False),
    (r"expected <block end>", "inconsistent indentation, or text behind a closed value", False),
    (r"expected ',' or '[\]}]'", "a comma or the closing bracket is missing", False),
    (
        r"sequence entries are not",
        "'- ' where no list can begin; put it on a line of its own",
        False,
    ),
    (r"expected the node content", "a value is missing before this", False),
    (r"'<document start>'", "text behind the end of the file's mapping", False),
    (
        r"cannot start any token",
        "a text that begins with a reserved character; put it in quotes",
        False,
    ),
    (r"undefined tag handle", "an unknown tag; leave it out", False),
)


def _at(mark: Any) -> Place:
    """Place of a mark, which PyYAML counts from 0; (0, 0) where it gave none."""
    return Place() if mark is None else Place(mark.line + 1, mark.column + 1, offset=mark.index)


def _place(text: str, position: int) -> Place:
    before = text[:position]
    return Place(before.count("\n") + 1, position - (before.rfind("\n") + 1) + 1)
