"""Tables in CSV files that people write: rows by the names of columns, all faults at once, warnings once each."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path

from nutdamp.errors import Fault, FaultyFile, nearest
from nutdamp.files.input import read_utf8
from nutdamp.units import shown

LARGEST = 1e15
"""Larger magnitudes are nothing of a spacecraft, and would overflow later."""

MOST_BYTES = 32 << 20
"""Of a file: many times more than its most rows take."""

MOST_ROWS = 100_000
"""Rows of a file."""

MOST_FAULTS = 5
"""Faults of one column that are listed."""

Cells = dict[str, str]


class Table:
    """The rows of one file, below its first line, which names the columns.

    ``header`` (the names) and ``rows``, each the number of its line and its cells. Raises CannotRead, and FaultyFile
    for what is no table.
    """

    def __init__(self, path: str | Path, columns: Sequence[str], what: str) -> None:
        """``columns`` that are known; ``what`` a row is, for messages."""
        self.name, self.known = str(path), columns
        self.faults: list[Fault] = []
        self.warnings: dict[str, list[tuple[int, str]]] = {}
        reader = csv.reader(io.StringIO(read_utf8(self.name, MOST_BYTES), newline=""))
        try:
            rows = [(reader.line_num, row) for row in reader if row]
        except csv.Error as reason:
            raise FaultyFile([Fault(self.name, reader.line_num, 1, "", f"not CSV: {reason}")]) from reason
        if not rows:
            problem = f"empty; the first line names the columns: {','.join(columns)}"
            raise FaultyFile([Fault(self.name, 1, 1, "", problem)])
        if len(rows) > MOST_ROWS + 1:
            raise FaultyFile([Fault(self.name, rows[-1][0], 1, "", f"more than {MOST_ROWS} {what}")])
        self.header, self.rows = [entry.strip() for entry in rows[0][1]], rows[1:]
        if len(self.header) == 1 and re.search(r"[;\t]", self.header[0]):
            problem = "columns are separated by commas, not by semicolons or tabs"
            raise FaultyFile([Fault(self.name, 1, 1, "", problem)])

    def expect(self, *columns: str) -> None:
        """A fault for each of the ``columns`` that is missing, or that is given twice; raises FaultyFile with all.

        Warns of columns that are not known.
        """
        for column in columns:
            if column not in self.header:
                self.fault(1, column, f"the column is missing{self.misspelt(column)}")
        for column in dict.fromkeys(entry for entry in self.header if self.header.count(entry) > 1):
            self.fault(1, column, "the column is given twice")
        self.check()
        for column in self.header:
            if column not in self.known:
                self.warn(1, column, f"the column {shown(column)} is not known: ignored")

    def check(self) -> None:
        """Raises FaultyFile with the faults so far, if there are any; of many in one column with the first."""
        if self.faults:
            raise FaultyFile(self._first())

    def _first(self) -> list[Fault]:
        """The faults, of more than `MOST_FAULTS` in one column the first and how many more there are."""
        kept = []
        for where in dict.fromkeys(fault.where for fault in self.faults):
            every = [fault for fault in self.faults if fault.where == where]
            kept += every[:MOST_FAULTS]
            more = every[MOST_FAULTS:]
            kept += more if len(more) < 2 else [more[0]._replace(problem=f"and {len(more)} more such rows")]
        return kept

    def misspelt(self, column: str) -> str:
        """The column of the header that may be meant to be a missing one, in words."""
        found = nearest(column, [entry for entry in self.header if entry not in self.known])
        return "" if found is None else f"; rename {shown(found)} if that is meant"

    def cells(self, line: int, row: list[str]) -> Cells | None:
        """The cells of a row by the names of the columns; None for a fault."""
        if len(row) != len(self.header):
            self.fault(line, "", f"{len(row)} values under {len(self.header)} columns")
            return None
        return dict(zip(self.header, (entry.strip() for entry in row), strict=True))

    def number(self, line: int, cells: Cells, column: str) -> float | None:
        """The number in a cell that must have one; None for a fault."""
        try:
            value = float(cells[column])
        except ValueError:
            self.fault(line, column, f"{shown(cells[column])} is not a number")
            return None
        if not abs(value) <= LARGEST:
            problem = f"{shown(cells[column])} is out of range, {-LARGEST:g} to {LARGEST:g}"
            self.fault(line, column, problem)
            return None
        return value

    def fault(self, line: int, where: str, problem: str) -> None:
        """Keep a fault in the column ``where``."""
        self.faults.append(Fault(self.name, line, 1, where, problem))

    def warn(self, line: int, subject: str, text: str) -> None:
        """Keep a warning; of several on one ``subject`` the first is given, with the number of others."""
        self.warnings.setdefault(subject, []).append((line, text))

    @property
    def warned(self) -> list[str]:
        """The warnings in words, with file and line."""
        return [self._worded(found) for found in self.warnings.values()]

    def _worded(self, found: list[tuple[int, str]]) -> str:
        line, text = found[0]
        others = len(found) - 1
        more = f" (and so in {others} more row{'s' if others > 1 else ''})" if others else ""
        return f"{self.name}:{line}: {text}{more}"
