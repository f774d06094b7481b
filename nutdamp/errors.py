"""Exceptions, and faults with their place, as data; the command line makes messages of them."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Iterable, Sequence
from typing import NamedTuple


class NutdampError(Exception):
    """Root of all errors that a user can cause and cure; anything else is a bug and keeps its
    traceback.

    The arguments of the constructor are in ``args``, so that an error can be pickled and passed
    between processes.
    """


def printable(text: str) -> str:
    """A text such as the name of a file, with unprintable and control characters escaped."""
    if text.isprintable():
        return text
    return "".join(
        char if char.isprintable() else char.encode("unicode_escape").decode("ascii")
        for char in text
    )


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The name closest to a misspelt ``word``, whatever its case; None where none is close."""
    import difflib

    folded = {name.casefold(): name for name in known}
    close = difflib.get_close_matches(word.casefold(), folded, n=1)
    return folded[close[0]] if close else None


# names that a message lists, and among which it looks for the one that was meant: a search among
# thousands of thrusters would take long
MOST_NAMES = 20


def cure_of(word: object, names: Iterable[str], otherwise: str = "") -> str:
    """``did you mean 'T1'?`` for a misspelt name; else the names that there are, or
    ``otherwise``.
    """
    every = [*names]
    few = every[:MOST_NAMES]
    close = nearest(word, few) if isinstance(word, str) else None
    if close is not None:
        return f"did you mean {close!r}?"
    more = " …" if len(every) > MOST_NAMES else ""
    return otherwise or f"there are {', '.join(map(repr, few)) or 'none'}{more}"


class Fault(NamedTuple):
    """One thing wrong in an input file.

    ``line`` and ``column`` count from 1; 0 means that the fault has no place in the file.
    ``where`` is the path of keys, such as ``thrusters[1].force``; empty for the file as a whole.
    """

    file: str
    line: int
    column: int
    where: str
    problem: str

    def __str__(self) -> str:
        return (
            f"{self.place}: {self.where}: {self.problem}"
            if self.where
            else f"{self.place}: {self.problem}"
        )

    @property
    def place(self) -> str:
        """``FILE:LINE:COLUMN``; without a line a file as a whole, or a ``--set KEY=VALUE``."""
        file = printable(self.file)
        return f"{file}:{self.line}:{self.column}" if self.line else file

    @property
    def as_warning(self) -> str:
        """The text of the fault where the file is accepted all the same."""
        return str(self._replace(problem=f"warning: {self.problem}"))


def in_order(faults: Iterable[Fault]) -> list[Fault]:
    """Faults in the order of their file."""
    return sorted(faults, key=lambda fault: (fault.file, fault.line, fault.column))


MOST_SHOWN = 100
"""Faults of a file that its message names."""


class FaultyFile(NutdampError):
    """An input file with impossible contents; carries all its faults, in the order of the file."""

    def __init__(self, faults: list[Fault]) -> None:
        self.faults = in_order(faults)
        super().__init__(self.faults)

    def __str__(self) -> str:
        more = len(self.faults) - MOST_SHOWN
        cut = [f"and {more} more faults"] if more > 0 else []
        return "\n".join([*map(str, self.faults[:MOST_SHOWN]), *cut])


class BadRequest(NutdampError):
    """A call or a command line that asks for something impossible with any spacecraft."""


class Unsuitable(BadRequest):
    """A value of the spacecraft file that does not suit the request, and else is none of its
    faults.

    ``where`` is the path of keys to it, such as ``("attitude", "epoch")``.
    """

    def __init__(self, where: tuple[str, ...], problem: str) -> None:
        self.where, self.problem = where, problem
        super().__init__(where, problem)

    def __str__(self) -> str:
        return f"{'.'.join(self.where)}: {self.problem}"


class SenselessOption(BadRequest):
    """An option of a scheme that makes no sense: ``name``, value as ``shown``, and ``problem``."""

    def __init__(self, name: str, shown: str, problem: str) -> None:
        super().__init__(name, shown, problem)
        self.name, self.shown, self.problem = name, shown, problem

    def __str__(self) -> str:
        return f"{self.name} = {self.shown}: {self.problem}"


class CannotRead(NutdampError):
    """A file that could not be read."""

    def __init__(self, path: str, reason: str) -> None:
        self.path, self.reason = path, reason
        super().__init__(path, reason)

    def __str__(self) -> str:
        return f"cannot read {printable(self.path)}: {self.reason}"


class CannotWrite(NutdampError):
    """A file that could not be written; its earlier contents are kept."""

    def __init__(self, path: str, reason: str) -> None:
        self.path, self.reason = path, reason
        super().__init__(path, reason)

    def __str__(self) -> str:
        return f"cannot write {printable(self.path)}: {self.reason}"


class MissingExtra(NutdampError):
    """An optional part of the installation is needed and not there."""

    def __init__(self, extra: str, purpose: str) -> None:
        self.extra, self.purpose = extra, purpose
        super().__init__(extra, purpose)

    def __str__(self) -> str:
        return f"{self.purpose} needs the extra '{self.extra}': pip install 'nutdamp[{self.extra}]'"


class MissingPandas(NutdampError, ImportError):
    """pandas is needed and not installed."""

    def __str__(self) -> str:
        return "a DataFrame needs pandas: pip install pandas"


class Infeasible(NutdampError):
    """A scheme that cannot work with this spacecraft within its limits; the text is the reason."""


class NotFound(Infeasible):
    """A search that found no schedule, which does not prove that there is none."""


class TooShort(Infeasible):
    """A scheme that a longer horizon would make feasible: ``why``, and a ``cure`` that names it."""

    def __init__(self, why: str, cure: str = "") -> None:
        self.why, self.cure = why, cure
        super().__init__(why, cure)

    def __str__(self) -> str:
        return f"{self.why}; {self.cure}" if self.cure else self.why


def listed(words: Sequence[str], last: str = "and") -> str:
    """``a``, ``a and b``, ``a, b and c``; ``last`` takes the place of "and"."""
    return f" {last} ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def span(least: float, most: float, unit: str) -> str:
    """``0.2 s to 5 s``, or ``at least 0.2 s`` where there is no ``most``."""
    return (
        f"at least {least:.4g} {unit}"
        if math.isinf(most)
        else f"{least:.4g} {unit} to {most:.4g} {unit}"
    )


def warn(text: str) -> None:
    """Python warning at the line that called the library."""
    level = 1
    frame = sys._getframe()
    while frame.f_back is not None and str(frame.f_globals.get("__name__")).startswith("nutdamp."):
        level = level + 1
        frame = frame.f_back
    warnings.warn(text, stacklevel=level)
