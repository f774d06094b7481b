"""Whole files written or none, tables in CSV files read, and the track of a flight as a table.

Numbers are written so that they read back as they were. Rows are read by the names of columns, with
all faults at once and each warning once.
"""

from __future__ import annotations

import csv
import io
import json
import math
import os
import re
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.numerics import cleaned, finite
from nutdamp.errors import CannotWrite, Fault, FaultyFile, nearest
from nutdamp.files.yaml import decode, read_limited
from nutdamp.flight.propagation import Track, in_file_axes
from nutdamp.spacecraft.model import Inertia
from nutdamp.units import shown

STDOUT = "-"  # file name that means standard output


def write_whole(path: str, content: str | bytes | Callable[[IO[bytes]], object]) -> None:
    """Write ``content`` to ``path``, or leave it as it was; ``-`` is standard output. Raises
    CannotWrite.

    Long content is a function that writes to the stream. Text becomes UTF-8, what has no place
    there \\udcff.
    """
    with whole_file(path) as stream:
        if callable(content):
            content(stream)
        else:
            stream.write(
                content.encode(errors="backslashreplace") if isinstance(content, str) else content
            )


@contextmanager
def whole_file(path: str) -> Iterator[IO[bytes]]:
    """A file to write piece by piece, temporary until the block ends well; raises CannotWrite.

    What is no plain file (a pipe, /dev/null, standard output as ``-``) is written to directly.
    """
    try:
        if path == STDOUT:
            sys.stdout.flush()
            yield sys.stdout.buffer
            sys.stdout.buffer.flush()
            return
        target = check_place(path)
        if target.exists() and not target.is_file():
            with target.open("wb") as stream:
                yield stream
            return
        temporary = target.with_name(f".nutdamp-{os.urandom(8).hex()}.part")
        try:
            with temporary.open("xb") as stream:
                yield stream
                stream.flush()
                os.fsync(stream.fileno())
            if target.exists():
                shutil.copymode(target, temporary)
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except BrokenPipeError:
        raise
    except OSError as reason:
        raise CannotWrite(path, reason.strerror or str(reason)) from reason


def check_place(path: str) -> Path:
    """Place of a file, behind links; checked before long work: raises CannotWrite where it cannot
    be written to.
    """
    if path == STDOUT:
        return Path(path)
    try:
        target = Path(os.path.realpath(path))
        if target.is_dir():
            raise CannotWrite(path, "it is a directory")
        with suppress(FileNotFoundError, NotADirectoryError):
            # raises OSError for links in a circle and for names too long, where exists() is only
            # false
            target.stat()
        if not target.parent.is_dir():
            raise CannotWrite(path, f"{target.parent} is no directory")
        if not os.access(target if target.exists() else target.parent, os.W_OK):
            raise CannotWrite(path, "permission denied")
    except (OSError, ValueError) as reason:  # ValueError: a zero byte
        raise CannotWrite(path, _reason(reason)) from reason
    return target


def _reason(reason: Exception) -> str:
    return getattr(reason, "strerror", None) or str(reason).partition(" from ")[0]


def make_folder(path: str) -> None:
    """Make the folder ``path`` unless it is there. Raises CannotWrite."""
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as reason:
        if isinstance(reason, FileExistsError):
            raise CannotWrite(path, "it is there, and no directory") from reason
        raise CannotWrite(path, _reason(reason)) from reason


def number(value: float | None) -> str:
    """A number with 17 significant digits at most, the shortest text that reads back the same; None
    is empty.
    """
    return "" if value is None or not math.isfinite(value) else repr(float(value))


def csv_text(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table as RFC 4180 CSV."""
    stream = io.StringIO()
    writer = csv.writer(stream)
    writer.writerow(header)
    writer.writerows(rows)
    return stream.getvalue()


def json_text(data: dict[str, Any]) -> str:
    """JSON with numbers that are not finite as null, characters that control a terminal escaped,
    newline at the end.
    """
    text = json.dumps(finite(data), indent=2, ensure_ascii=False, allow_nan=False)
    # Those below a blank are escaped already.
    return re.sub("[\x7f-\x9f\u2028\u2029]", lambda match: f"\\u{ord(match[0]):04x}", text) + "\n"


HEADER = (
    "t_s",
    *("omega_1_rad_s", "omega_2_rad_s", "omega_3_rad_s"),
    *("q_w", "q_x", "q_y", "q_z"),
    *("axis_x", "axis_y", "axis_z"),
    *("momentum_x_Nms", "momentum_y_Nms", "momentum_z_Nms"),
    *("nutation_deg", "body_cone_deg", "space_cone_deg"),
    "pulse",
)


def structured(names: Sequence[str], columns: Sequence[NDArray[Any]]) -> NDArray[np.void]:
    """Structured array of columns (n,) of these names."""
    kinds = [(name, column.dtype) for name, column in zip(names, columns, strict=True)]
    rows = np.empty(len(columns[0]), dtype=kinds)
    for name, column in zip(names, columns, strict=True):
        rows[name] = column
    return rows


def track_array(track: Track, inertia: Inertia) -> NDArray[np.void]:
    """One row a sample, fields as in `HEADER`; rates and quaternion (scalar first) in the axes of
    the file.
    """
    turned = in_file_axes(track, inertia)
    cones = np.degrees(np.column_stack([track.nutation, track.body_cone, track.space_cone]))
    vectors = map(cleaned, (turned.rates, turned.quaternion, track.axis, track.momentum))
    table = np.column_stack([track.t, *vectors, cones])
    return structured(HEADER, [*table.T, track.pulse])


def number_rows(columns: Iterable[NDArray[Any]]) -> bytes:
    """Rows of CSV of columns (n,) of numbers, which read back as they were; a column of NaN is
    empty.
    """
    texts = (
        [""] * len(column) if math.isnan(column[0]) else map(repr, column.tolist())
        for column in columns
    )
    return "".join(f"{','.join(row)}\r\n" for row in zip(*texts, strict=True)).encode()


def write_track(pieces: Iterable[Track], inertia: Inertia, stream: IO[bytes]) -> None:
    """The rows of `track_array` of all ``pieces`` as CSV, written as they come."""
    stream.write(f"{','.join(HEADER)}\r\n".encode())
    for piece in pieces:
        if len(piece.t):
            rows = track_array(piece, inertia)
            stream.write(number_rows(rows[name] for name in HEADER))


Value = TypeVar("Value")

LARGEST = 1e15  # larger magnitudes are nothing of a spacecraft, and would overflow later
MOST_BYTES = 32 << 20  # size of a file, many times more than its most rows take
MOST_ROWS = 100_000  # rows of a file
MOST_FAULTS = 5  # faults of one column that are listed


class Row(dict[str, str]):
    """The cells of a ``line`` of a table by the names of the columns."""

    def __init__(self, table: Table, line: int, cells: list[str]) -> None:
        super().__init__(zip(table.header, (entry.strip() for entry in cells), strict=True))
        self.table, self.line = table, line

    def number(self, column: str) -> float | None:
        """The number in a cell that must have one; None for a fault."""
        text = self.get(column, "")
        try:
            if abs(value := float(text)) <= LARGEST:
                return value
            self.fault(column, f"{shown(text)} is out of range, {-LARGEST:g} to {LARGEST:g}")
        except ValueError:
            self.fault(column, f"{shown(text)} is not a number")
        return None

    def fault(self, column: str, problem: str) -> None:
        """Keep a fault in a cell."""
        self.table.fault(self.line, column, problem)

    def warn(self, subject: str, text: str) -> None:
        """Keep a warning; of several on one ``subject`` the first is given, with the number of
        others.
        """
        self.table.warnings.setdefault(subject, []).append((self.line, text))


class CellFault(Exception):
    """A fault in a column of a row, in words, after which the row tells no more."""


class Table:
    """The ``header`` of a file (names of columns) and, from `expect` on, ``rows``; raises
    CannotRead, FaultyFile.
    """

    def __init__(self, path: str | Path, columns: Sequence[str], what: str) -> None:
        """Table with ``columns`` that are known; ``what`` is the word for a row, for messages."""
        self.name = str(path)
        self.columns = columns
        self.faults: list[Fault] = []
        self.warnings: dict[str, list[tuple[int, str]]] = {}
        text = decode(read_limited(self.name, MOST_BYTES), self.name)
        reader = csv.reader(io.StringIO(text, newline=""))
        try:
            rows = [(reader.line_num, row) for row in reader if row]
        except csv.Error as reason:
            self.fault(reader.line_num, "", f"not CSV: {reason}")
        self.check()
        if not rows:
            self.fault(1, "", f"empty; the first line names the columns: {','.join(columns)}")
        elif len(rows) > MOST_ROWS + 1:
            self.fault(rows[-1][0], "", f"more than {MOST_ROWS} {what}")
        elif len(rows[0][1]) == 1 and re.search(r"[;\t]", rows[0][1][0].strip()):
            self.fault(1, "", "columns are separated by commas, not by semicolons or tabs")
        self.check()
        self.header = [entry.strip() for entry in rows[0][1]]
        self._lines = rows[1:]
        self.rows: list[Row] = []

    def expect(self, *columns: str) -> None:
        """Read the rows; warns of unknown columns, FaultyFile for ``columns`` missing or given
        twice.
        """
        for column in columns:
            if column not in self.header:
                self.fault(1, column, f"the column is missing{self.misspelt(column)}")
        for column in dict.fromkeys(entry for entry in self.header if self.header.count(entry) > 1):
            self.fault(1, column, "the column is given twice")
        self.check()
        for column in self.header:
            if column not in self.columns:
                self.warnings[column] = [(1, f"the column {shown(column)} is not known: ignored")]
        for line, cells in self._lines:
            if len(cells) == len(self.header):
                self.rows.append(Row(self, line, cells))
            else:
                self.fault(line, "", f"{len(cells)} values under {len(self.header)} columns")

    def read(self, read_row: Callable[[Row], Value | None]) -> list[tuple[Row, Value]]:
        """The rows without faults and what is read of each; the faults of the others are kept."""
        pairs = []
        for row in self.rows:
            faults = len(self.faults)
            try:
                value = read_row(row)
            except CellFault as wrong:
                if len(self.faults) == faults:  # else it follows from those
                    row.fault(*wrong.args)
                continue
            if value is not None and len(self.faults) == faults:
                pairs.append((row, value))
        return pairs

    def check(self) -> None:
        """Raise FaultyFile with the faults so far: of a column the first `MOST_FAULTS`, and how
        many more.
        """
        faults = []
        for where in dict.fromkeys(fault.where for fault in self.faults):
            every = [fault for fault in self.faults if fault.where == where]
            faults += every[:MOST_FAULTS]
            more = every[MOST_FAULTS:]
            faults += (
                more
                if len(more) < 2
                else [more[0]._replace(problem=f"and {len(more)} more such rows")]
            )
        if faults:
            raise FaultyFile(faults)

    def misspelt(self, column: str) -> str:
        """The column of the header that may be meant to be a missing one, in words."""
        close = nearest(column, [entry for entry in self.header if entry not in self.columns])
        return "" if close is None else f"; rename {shown(close)} if that is meant"

    def fault(self, line: int, where: str, problem: str) -> None:
        """Keep a fault in the column ``where``."""
        self.faults.append(Fault(self.name, line, 1, where, problem))

    @property
    def warned(self) -> list[str]:
        """The warnings in words, with file and line."""
        words = []
        for (line, text), *others in self.warnings.values():
            more = f" (further rows alike: {len(others)})" if others else ""
            words.append(f"{self.name}:{line}: {text}{more}")
        return words
