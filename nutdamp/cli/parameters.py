"""Kinds of parameters that several commands take: files, quantities, directions."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import click
from click.shell_completion import CompletionItem

from nutdamp.errors import nearest

if TYPE_CHECKING:
    ParamType = click.ParamType
    Choice = click.Choice
else:

    class ParamType(click.ParamType):
        """`click.ParamType`, which takes the type of its values in brackets from click 8.4 on only."""

        def __class_getitem__(cls, _: object) -> type[ParamType]:
            return cls

    class Choice(click.Choice):
        """`click.Choice`, likewise from click 8.2 on only."""

        def __class_getitem__(cls, _: object) -> type[Choice]:
            return cls


class Named(Choice[str]):
    """One of some names; for a misspelt one the error names the nearest."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The name; a usage error for anything else."""
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter as wrong:
            close = nearest(str(value), self.choices)
            if close is None:
                raise
            self.fail(f"{wrong.message.rstrip('.')}; did you mean {close!r}?", param, ctx)


class SchemeName(Named):
    """The name of a scheme; there are more of them than a line of the help page holds."""

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:  # noqa: ARG002 - click's
        """Shown in the help page."""
        return "SCHEME"


class Bare(float):
    """A number that was written without a unit."""


def is_number(word: str) -> bool:
    """Whether a word of the command line is a number without a unit."""
    try:
        float(word)
    except ValueError:
        return False
    return True


class FileName(ParamType[str]):
    """A file name as it is, which shells complete; whether it can be read or written is seen when it is."""

    name = "file"
    completed_as = "file"

    def shell_complete(
        self,
        ctx: click.Context,  # noqa: ARG002 - signature of click
        param: click.Parameter,  # noqa: ARG002
        incomplete: str,
    ) -> list[CompletionItem]:
        """Leaves it to the shell to complete the name."""
        return [CompletionItem(incomplete, type=self.completed_as)]


class FolderName(FileName):
    """The same for a folder."""

    name = "folder"
    completed_as = "dir"


FILE = FileName()
FOLDER = FolderName()


class Quantity(ParamType[float]):
    """A number in SI or a text with a unit, as in a spacecraft file."""

    name = "quantity"

    def __init__(self, kind: str) -> None:
        self.kind = kind

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The SI value; a usage error for anything else."""
        from nutdamp.units import parse

        try:
            number = parse(value, self.kind, bare=True)
        except ValueError as wrong:
            self.fail(str(wrong), param, ctx)
        return Bare(number) if isinstance(value, str) and is_number(value) else number

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:  # noqa: ARG002 - click's
        """Shown in the help page; click gives a context from 8.2 on."""
        return self.kind.upper()


class EndTime(Quantity):
    """A time after t = 0."""

    def __init__(self) -> None:
        super().__init__("time")

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The time in s; a usage error for anything else."""
        time = super().convert(value, param, ctx)
        if time <= 0.0:
            self.fail("expected a time after t = 0", param, ctx)
        return time


class FinalSpin(Quantity):
    """A rate, or ``keep``."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The rate in rad/s, or ``keep`` as it is."""
        return value if value == "keep" else super().convert(value, param, ctx)


def reading_of(value: float, kind: str, meant: str) -> str:
    """How a number without unit is read, and what to write if another unit is ``meant``."""
    from nutdamp.files.plausibility import reading

    return reading(int(value) if value.is_integer() else float(value), kind, meant)


class Angles(NamedTuple):
    """Two angles in rad that name a direction."""

    first: float
    second: float

    @property
    def readings(self) -> tuple[str, ...]:
        """How the numbers without unit are read that are more likely degrees: whole ones, and more than a turn."""
        bare = [one for one in self if isinstance(one, Bare)]
        doubtful = [one for one in bare if one and (one.is_integer() or abs(one) > 2.0 * math.pi)]
        return tuple(reading_of(one, "angle", "deg") for one in doubtful)


class Direction(ParamType[Angles]):
    """Two angles with a comma between them."""

    name = "angle,angle"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Angles:
        """Both in rad; a usage error for anything else."""
        if isinstance(value, Angles):
            return value
        parts = [part.strip() for part in str(value).split(",")]
        if len(parts) != 2:
            self.fail(f"{value!r} is not two angles, such as 10deg,45deg", param, ctx)
        first, second = (Quantity("angle").convert(part, param, ctx) for part in parts)
        return Angles(first, second)


class Count(ParamType[int]):
    """A whole number of cases above zero, which may be written as 1e6 or 1_000_000."""

    name = "count"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """The number; a usage error for anything else."""
        try:
            number = float(value)
        except ValueError:
            number = 0.0
        if not (1.0 <= number <= 1e12 and number.is_integer()):
            self.fail(f"{value} is not a number of cases: 1 or more, such as 100000 or 1e6", param, ctx)
        return int(number)

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:  # noqa: ARG002 - click's
        """Shown in the help page."""
        return "N"
