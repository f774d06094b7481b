"""Options and kinds of parameters: the goal, the options of schemes, files, quantities, directions.

Every command that plans takes the goal; `plan` alone takes the options of each scheme. Those are
made from the fields of the scheme's options, and stand under a heading per scheme on the help page.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import click

from nutdamp import units
from nutdamp.cli.main import debug_option
from nutdamp.errors import BadRequest, SenselessOption, nearest
from nutdamp.schemes.catalogue import SCHEMES, SUNLIT, OptionKind, Options, SchemeOptions, names_of
from nutdamp.units import Angles

if TYPE_CHECKING:
    from nutdamp.spacecraft.model import Spacecraft


class NameType(click.Choice):  # type: ignore[type-arg]
    """One of some names; for a misspelt one the error names the nearest."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The name; a usage error for anything else."""
        try:
            return str(super().convert(value, param, ctx))
        except click.BadParameter as wrong:
            close = nearest(str(value), self.choices)
            if close is None:
                raise
            self.fail(f"{wrong.message.rstrip('.')}; did you mean {close!r}?", param, ctx)


class FileName(click.Path):
    """A file name as it is; whether it can be read or written is seen when it is."""

    def __init__(self) -> None:
        super().__init__(readable=False)
        self.name = "file"


class OutputName(FileName):
    """The name of a file to write."""


FILE = FileName()
OUTPUT = OutputName()
FOLDER = click.Path(readable=False)


class Parsed(click.ParamType):  # type: ignore[type-arg]
    """The value that ``read`` makes of a text, and a ``check`` holds for, or that of ``words``.

    A text that is none is a usage error, by the ValueError of ``read``; one that the check refuses
    by a BadRequest has the error ``problem``.
    """

    def __init__(
        self,
        name: str,
        read: Callable[[Any], Any],
        check: Callable[[Any], object] = id,  # any value passes
        problem: str = "",
        **words: object,
    ) -> None:
        self.name, self.read, self.words = name, read, words
        self.check, self.problem = check, problem

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The value; a usage error for anything else."""
        if value in self.words:
            return self.words[value]
        try:
            parsed = self.read(value)
            self.check(parsed)
        except ValueError as wrong:
            self.fail(str(wrong), param, ctx)
        except BadRequest:
            self.fail(self.problem, param, ctx)
        return parsed


def quantity(
    kind: str, check: Callable[[float], object] = float, problem: str = "", **words: float | str
) -> Parsed:
    """A number in SI or a text with a unit, as in a spacecraft file."""
    return Parsed(kind, functools.partial(units.word, kind=kind), check, problem, **words)


def direction(
    check: Callable[[list[Angles]], object] = len, problem: str = "", kind: str = "angle"
) -> Parsed:
    """Two angles with a comma between them, the first of a ``kind``, in rad."""
    read = functools.partial(units.angles, kind=kind)
    return Parsed("angle,angle", read, lambda pair: check([pair]), problem)


def _count(text: str) -> int:
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not (1.0 <= number <= 1e12 and number.is_integer()):
        raise ValueError(f"{text} is not a number of cases: 1 or more, such as 100000 or 1e6")
    return int(number)


COUNT = Parsed("n", _count)
"""A whole number of cases above zero, which may be written as 1e6 or 1_000_000."""
END = quantity("time", units.end_of_flight, "expected a time after t = 0")
OF_RECORD = quantity(
    "time",
    lambda time: units.expect(time >= 0.0, "at", time, ""),
    "expected the time after the first record, 0 or more, such as 0s or 12.5s",
)


Command = TypeVar("Command", bound=Callable[..., Any])

GOAL = "Goal and motion"  # heading of the options of the goal
SCHEME = "Scheme"  # headings of the options of schemes begin so
WIDEST = 26  # characters of an option that its help comes beside; below a longer one
SHARED = names_of(SchemeOptions)  # options of every scheme
NO_SUN = f"--sun is for {' and '.join(SUNLIT)}, which is not planned here"


class Grouped(click.Option):
    """An option under a heading of its own on the help page."""

    def __init__(self, *args: Any, group: str, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.group = group


def goal_options(command: Command, *, several: bool = True) -> Command:
    """The goal, and the options of every scheme; with ``several`` one with a bug is passed over."""
    option = functools.partial(click.option, cls=Grouped, group=GOAL)
    angles = functools.partial(
        option, type=direction(kind="right ascension"), metavar="ANGLE,ANGLE"
    )
    command = debug_option(command) if several else command
    disturbed = "Plan on the motion with the disturbances of the file."
    command = option("--with-disturbances", is_flag=True, help=disturbed)(command)
    if several:
        command = angles("--sun", help="The Sun, as --target; rhumb-line keeps its phase.")(command)
    rate = quantity("rate", keep="keep")
    spin = "Final spin rate, such as 30rpm; optimal can set it."
    command = option("--spin", type=rate, metavar="RATE|keep", help=spin)(command)
    end = "Axis at the end: RA,DEC; no attitude: tilt,azimuth."
    from_sun = "Instead of --target: its angle from the Sun: 109deg."
    command = option("--sun-angle", type=quantity("angle"), metavar="ANGLE", help=from_sun)(command)
    return angles("--target", help=end)(command)


def scheme_options(command: Command) -> Command:
    """The options of all schemes."""
    for name, (field, schemes) in reversed(_fields().items()):
        kind: OptionKind = field.metadata["kind"]
        settings: dict[str, Any] = {"is_flag": True}
        if not kind.flag:
            value = (
                NameType(kind.names)
                if kind.names
                else quantity(kind.unit)
                if kind.unit
                else click.IntRange(1)
            )
            metavar = None if kind.names or kind.unit else "N"
            settings = {"type": value, "default": field.default, "metavar": metavar}
            settings["show_default"] = field.default is not None
        group = f"{SCHEME} {' and '.join(schemes)}"
        text = field.metadata["help"]
        option = click.option(
            f"--{name.replace('_', '-')}", cls=Grouped, group=group, help=text, **settings
        )
        command = option(command)
    return command


def options_in(command: click.Command, parameters: dict[str, Any]) -> Options:
    """Options of the schemes, taken from ``parameters``; a usage error for a senseless one."""
    names_of_options = {*SHARED, *_fields()}
    names = [
        each.name
        for each in command.params
        if isinstance(each, Grouped) and each.name in names_of_options
    ]
    taken = {name: parameters.pop(name) for name in names if name is not None}
    try:
        return Options(
            **{name: value for name, value in taken.items() if value is not False}
        )  # flags not given
    except SenselessOption as wrong:
        raise as_usage(wrong, click.get_current_context()) from None


def _fields() -> dict[str, tuple[dataclasses.Field[Any], list[str]]]:
    """Each option that not all schemes have, by name: its field, and its schemes."""
    varying: dict[str, tuple[dataclasses.Field[Any], list[str]]] = {}
    for scheme in SCHEMES.values():
        for field in dataclasses.fields(scheme.options):
            if field.name not in SHARED:
                varying.setdefault(field.name, (field, []))[1].append(scheme.name)
    return varying


class Aim(NamedTuple):
    """A goal as the command line gives it, in place of the one in the file; ``spin``: rad/s, or
    ``keep``.

    Angles are right ascension and declination where the file has an attitude, else tilt and azimuth
    in the frame N.
    """

    target: Angles | None = None
    spin: float | str | None = None
    sun: Angles | None = None
    sun_angle: float | None = None

    @property
    def words(self) -> tuple[str, ...]:
        """Options that give target and spin to any command; ``--sun`` where a scheme reads it."""
        words = []
        if self.target is not None:
            words.append(f"--target={self.target.first!r}rad,{self.target.second!r}rad")
        if self.sun_angle is not None:
            words.append(f"--sun-angle={float(self.sun_angle)!r}rad")
        if self.spin is not None:
            words.append("--spin=keep" if self.spin == "keep" else f"--spin={self.spin!r}rad/s")
        return tuple(words)

    def applied(self, spacecraft: Spacecraft, doubt: Callable[[str], None]) -> Spacecraft:
        """The spacecraft with this goal; a usage error where it has none, a doubt if unlikely."""
        from nutdamp.files.editing import aimed

        try:
            return aimed(spacecraft, lambda text: doubt(f"--{text}"), **self._asdict())
        except SenselessOption as wrong:
            raise as_usage(wrong) from None


def as_usage(wrong: SenselessOption, context: click.Context | None = None) -> click.BadParameter:
    """The usage error of an option that makes no sense."""
    hint = f"--{wrong.name.replace('_', '-')}"
    return click.BadParameter(wrong.problem, context, param_hint=hint)


def expect_read(
    names: Sequence[str], options: Options, spacecraft: Spacecraft, doubt: Callable[[str], None]
) -> None:
    """Warn of options that no scheme of ``names`` reads; a usage error for the goal itself."""
    planned = [SCHEMES[name] for name in names]
    unread = [*options.without_effect([scheme.options for scheme in planned])] if planned else []
    if len(planned) > 1 and "least" in unread:  # it chooses among them, whether they read it or not
        unread.remove("least")
    for option in unread:
        readers = [name for name, scheme in SCHEMES.items() if option in names_of(scheme.options)]
        doubt(f"--{option.replace('_', '-')} ignored: it is for {' and '.join(readers)}")
    if spacecraft.goal.sun is not None:
        without = [scheme.name for scheme in planned if not scheme.reads_sun]
        if len(without) == len(planned):
            raise click.UsageError(NO_SUN)
        if without:
            doubt(
                f"--sun is read by {' and '.join(SUNLIT)} alone: "
                f"{', '.join(without)} plan without it"
            )
    if planned and spacecraft.goal.axis is None and all(scheme.only_points for scheme in planned):
        raise click.UsageError(
            f"no target of the spin axis for {' and '.join(names)}: --target, or goal in the file"
        )
