"""A command from its spacecraft file to its results: input and output files, and what is shown.

No output file may take the place of an input, or of another output.
"""

from __future__ import annotations

import os
import shlex
import stat
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple, TypeAlias

import click

from nutdamp.cli.main import (
    QUIET,
    SPACECRAFT,
    UNITS,
    in_context,
    look_of_screen,
    say,
    show,
    working,
    wrapped,
)
from nutdamp.cli.options import (
    END,
    FILE,
    GOAL,
    NO_SUN,
    OUTPUT,
    SCHEME,
    WIDEST,
    Aim,
    Command,
    FileName,
    NameType,
    OutputName,
    options_in,
)
from nutdamp.errors import Fault, FaultyFile, Infeasible, NutdampError, Unsuitable, printable
from nutdamp.schemes.catalogue import SCHEMES, SUNLIT, Options, names_of
from nutdamp.units import SI, US

if TYPE_CHECKING:
    from collections.abc import Hashable

    from matplotlib.figure import Figure
    from rich.console import RenderableType

    from nutdamp.common.results import Note
    from nutdamp.errors import CannotWrite
    from nutdamp.files.editing import Setting
    from nutdamp.files.reader import Source
    from nutdamp.planning.plan import Plan
    from nutdamp.spacecraft.model import Spacecraft


DEFAULT_FILE = "spacecraft.yaml"
FIGURES = ("overview", "motion")  # pictures of a flight that ``--plot`` can draw, the default first


quiet_option = click.option(
    "-q",
    "--quiet",
    is_flag=True,
    callback=in_context(QUIET),
    help="Hide progress, notes and next steps.",
)


def screen_options(command: Command) -> Command:
    """``--units``, ``--verbose`` and ``--quiet``."""
    units = click.option(
        "--units",
        type=NameType((SI, US)),
        default=SI,
        expose_value=False,
        callback=in_context(UNITS),
        help="Units of the screen, default si; files are SI.",
    )
    verbose = click.option("-v", "--verbose", is_flag=True, help="Show all values and notes.")
    return units(verbose(quiet_option(command)))


class FileInput(NamedTuple):
    """The spacecraft of a command line: the ``path`` of a file, and changes of ``--set``."""

    path: str | None
    settings: tuple[Setting, ...] = ()

    @property
    def read(self) -> str | None:
        """The file that is read, if any."""
        return DEFAULT_FILE if self.path is None and Path(DEFAULT_FILE).exists() else self.path

    def source(self, remark: Callable[[str], None], doubt: Callable[[str], None]) -> Source:
        """The text of the file, else of the built-in example (a ``doubt``), and its name."""
        from nutdamp.files.reader import Source, example_text
        from nutdamp.files.yaml import read_text

        path = self.read
        if path is not None:
            if self.path is None:
                remark(f"reading {path}")
            return Source(read_text(Path(path)), path, self.settings)
        doubt("no spacecraft file given: using the built-in example (see `nutdamp init`)")
        return Source(example_text(), "example.yaml", self.settings, built_in=True)


def _settings(
    ctx: click.Context, param: click.Parameter, texts: tuple[str, ...]
) -> tuple[Setting, ...]:
    if not texts:
        return ()
    from nutdamp.files.editing import parse_setting

    try:
        return tuple(parse_setting(text) for text in texts)
    except ValueError as wrong:
        raise click.BadParameter(str(wrong), ctx, param) from None


def _keys(_ctx: click.Context, _param: click.Parameter, begun: str) -> list[str]:
    from nutdamp.views.guide import completed_keys

    return completed_keys(begun)


_CHANGE = "Change a key, e.g. limits.gap=1s; repeatable."
set_option = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    callback=_settings,
    help=_CHANGE,
    shell_complete=_keys,
)


def spacecraft_argument(command: Command) -> Command:
    """The spacecraft file and ``--set``, of a `SessionCommand`."""
    return click.argument("spacecraft", required=False, type=FILE, metavar="[SPACECRAFT]")(
        set_option(command)
    )


def placed(wrong: Unsuitable, named: FileInput) -> NutdampError:
    """The error as a fault with its place in the spacecraft file, where it comes from one."""
    if named.path == "-" or any(wrong.where[:1] == setting.path[:1] for setting in named.settings):
        return wrong
    from nutdamp.files.yaml import dotted, read_tree

    source = named.source(lambda _: None, lambda _: None)
    place = read_tree(source.text, source.name)[0].place_of(wrong.where)
    return FaultyFile(
        [Fault(source.name, place.line, place.column, dotted(wrong.where), wrong.problem)]
    )


def defaulted(
    name: str, kind: click.ParamType[Any], default: object, text: str, **more: Any
) -> Callable[..., Any]:
    """An option whose default is on the help page, where ``text`` is its line."""
    return click.option(name, type=kind, default=default, show_default=True, help=text, **more)


def carry_options(when: str) -> Callable[[Command], Command]:
    """``-o FILE --at TIME``: the spacecraft file carried on, by default to ``when``."""
    which = click.option("--at", type=END, help=f"Its t = 0; default {when}.")
    where = click.option(
        "-o", "--output", type=OUTPUT, help="Write the spacecraft file carried on."
    )
    return lambda command: where(which(command))


def plot_options(names: tuple[str, ...]) -> Callable[[Command], Command]:
    """``--plot FILE`` and the choice of the picture among ``names``, the default first."""
    drawn = ", ".join((f"{names[0]} (default)", *names[1:]))
    which = click.option(
        "--figure",
        type=NameType(names),
        default=names[0],
        metavar="NAME",
        help=f"Picture: {drawn}.",
    )
    where = click.option(
        "--plot", type=OutputName(), help="Draw it (.png, .svg, .pdf; needs extra plot)."
    )
    return lambda command: where(which(command))


STANDARD = "-"  # file name that means standard input or standard output


def expect_outputs(*read: str | None, **written: str | Sequence[str] | None) -> bool:
    """True where an output file is standard output, so that nothing else may go there.

    A usage error where an output, by its option, is a file ``read`` or another output, under
    whatever name.
    """
    outputs = [
        (f"--{option}", path)
        for option, paths in written.items()
        for path in ([paths] if isinstance(paths, str) else paths or ())
    ]
    standard = [option for option, path in outputs if path == STANDARD]
    if len(standard) > 1:
        raise click.UsageError(f"{' and '.join(standard)} cannot both go to standard output")
    taken = {} if standard else {_identity(STANDARD, 1): "standard output goes to this file"}
    taken |= {_identity(path, 0): "this command reads this file" for path in read if path}
    for option, path in outputs:
        identity = _identity(path, 1)
        if identity is not None and identity in taken:
            raise click.UsageError(f"{option} {path}: {taken[identity]}; name another")
        taken[identity] = f"{option} goes to this file"
    return bool(standard)


def _identity(path: str, standard: int) -> Hashable:
    """Identity of a file, None for a terminal or the like; ``standard``: descriptor of ``-``."""
    try:
        status = os.fstat(standard) if path == STANDARD else Path(path).stat()
    except OSError:
        return None if path == STANDARD else os.path.realpath(path)
    return (status.st_dev, status.st_ino) if stat.S_ISREG(status.st_mode) else None


Content: TypeAlias = "str | bytes | Callable[[IO[bytes]], object] | dict[str, Any] | Figure"
"""Content of a file: text or what writes it, dict for JSON, figure."""

Files = dict[str, Callable[[], Content]]
"""Content of files by their options."""

Output = tuple[str | None, Callable[[], Content]]
"""Path of a file to write, if one is requested, and the function of its content."""

KINDS = (
    ("csv", "csv"),
    ("json", "data"),
    ("plot", "figure"),
)  # options of files, and the views that they hold


class FlownChoice(NamedTuple):
    """Source of the pulses of a command: scheme, schedule, file of blocks, else what is best."""

    scheme: str | None = None
    schedule: str | None = None
    blocks: str | None = None


@dataclass
class Job:
    """Request of a command line, and once `begun` the ``spacecraft``, its ``source``, and
    ``silent``: no screens; ``planned``: notes on the plan that it flies.

    ``read``, ``written``: files; ``figure``: the picture of ``plot``, None for the only one;
    ``usual``: its default.
    """

    given: FileInput
    read: tuple[str | None, ...]
    written: dict[str, str | None]
    flown: FlownChoice
    options: Options
    aim: Aim
    figure: str | None
    usual: str | None
    quiet: bool
    spacecraft: Spacecraft = field(init=False)
    source: Source = field(init=False)
    silent: bool = field(init=False)
    begun: bool = field(init=False, default=False)
    planned: list[Note] = field(init=False, default_factory=list)

    def begin(self, folder: Iterable[str] = ()) -> Spacecraft:
        """Check the files of the command line, those that go to a ``folder`` too, and load its
        spacecraft.

        Raises as `expect_outputs` and `Source.read` do, and where the picture cannot be made.
        """
        self.silent = expect_outputs(
            self.given.read, *self.read, **self.written, schedules=[*folder]
        )
        if (plot := self.written.get("plot")) is not None:
            from nutdamp.figures import image

            image.ending(plot)
        elif self.figure != self.usual:
            raise click.UsageError("--figure says what --plot draws: name a file with --plot")
        aimed = self.aim.target is not None or self.aim.sun_angle is not None
        self.source = self.given.source(self.remark, self.doubt)._replace(aimed=aimed)
        spacecraft = self.source.read(lambda doubt: say(doubt.as_warning))
        self.spacecraft = (
            self.aim.applied(spacecraft, self.doubt)
            if any(value is not None for value in self.aim)
            else spacecraft
        )
        for path in filter(None, self.written.values()):
            from nutdamp.files.tabular import check_place

            check_place(path)
        self.begun = True
        return self.spacecraft

    def remark(self, text: str) -> None:
        """Print a remark on standard error, unless quiet."""
        if not self.quiet:
            say(text)

    def note(self, notes: Iterable[Note]) -> None:
        """Print notes on results on standard error; where quiet the warnings among them."""
        from nutdamp.views.text import is_detail, ordered, rank, screen_line

        with look_of_screen():
            for entry in sorted(ordered(notes), key=rank):
                if not is_detail(entry):
                    say(wrapped(screen_line(entry).plain))

    def doubt(self, *warnings: str) -> None:
        """Print warnings about the data on standard error, quiet or not."""
        for warning in warnings:
            say(f"warning: {warning}")

    def refuse(self, reason: Infeasible) -> None:
        """Write the JSON file, if any: nothing is feasible, and the reason."""
        path = self.written.get("json")
        if self.begun and path is not None:
            from nutdamp.views.decisions import heading

            why = {**heading(self.spacecraft), "feasible": False, "why": str(reason)}
            deliver([(path, lambda: why)])

    def working(self, what: str) -> AbstractContextManager[None]:
        """Show that ``what`` is under way."""
        return working(what, quiet=self.quiet)

    def carried(self, plan: Plan | None, at: float | None, usual: float | None = None) -> Files:
        """The file of ``-o``: the spacecraft ``at`` a time, s, else ``usual``; BadRequest."""
        path = self.written["output"]
        if path is None:
            if at is not None:
                raise click.UsageError(
                    "--at is the moment of the file that -o writes: name one with -o"
                )
            return {}
        if plan is None or not plan.feasible:
            say(f"{printable(path)} was not written: no plan is feasible")
            return {}
        from nutdamp.files.carried import carried_notes, carried_text

        time = next(value for value in (at, usual, plan._carried_at) if value is not None)
        text = carried_text(plan._reaching(time), time, self.source)
        self.note(carried_notes(self.spacecraft, time, self.source))
        return {"output": lambda: text}

    def deliver(
        self,
        result: object,
        *screens: Callable[[], RenderableType],
        more: Files | None = None,
        files: Sequence[Output] = (),
        unsaved: Sequence[CannotWrite | None] = (),
        verbose: bool | None = None,
        planned: Sequence[Note] | None = None,
        **shown: Any,
    ) -> None:
        """Write the files that are requested of a result, and show it, unless a file goes to
        standard output.

        What ``more`` and ``screens`` lack the views of the result make, with the options ``shown``,
        the screen ``verbose`` or not, and with the notes ``planned``, where it can be; see
        `deliver`.
        """
        from nutdamp.common import results

        contents = dict(more or {})
        for option, what in KINDS:
            if option not in contents and results.has(result, what):
                names = [self.figure] if what == "figure" and self.figure is not None else []
                contents[option] = partial(
                    results.view, result, what, *names, **shown if what == "data" else {}
                )
        outputs = [(self.written.get(option), make) for option, make in contents.items()]
        look = {**shown, "verbose": verbose, "planned": planned}
        look = {name: value for name, value in look.items() if value is not None}
        usual = screens or (partial(results.view, result, "screen", **look),)
        failures = [wrong for wrong in unsaved if wrong is not None]
        deliver([*outputs, *files], *usual * (not self.silent), unsaved=failures)


def job_of(command: click.Command, parameters: dict[str, Any]) -> Job:
    """The job of a command line; the ``parameters`` that belong to it are taken from them.

    A usage error where several name the pulses to fly.
    """
    types = {each.name: each.type for each in command.params if each.name in parameters}
    spacecraft = FileInput(parameters.pop("spacecraft", None), parameters.pop("settings", ()))
    if spacecraft.path is not None:
        click.get_current_context().meta[SPACECRAFT] = shlex.quote(spacecraft.path)
    written = {
        name: parameters.pop(name)
        for name, kind in types.items()
        if isinstance(kind, OutputName) and name
    }
    inputs = tuple(
        parameters[name]
        for name, kind in types.items()
        if type(kind) is FileName and name in parameters
    )
    read = tuple(
        path for paths in inputs for path in (paths if isinstance(paths, tuple) else (paths,))
    )
    flown = FlownChoice(*(parameters.pop(name, None) for name in FlownChoice._fields))
    if flown.count(None) < len(flown) - 1:
        problem = "name one of --scheme, --schedule and --blocks"
        raise click.UsageError(problem, click.get_current_context())
    options = options_in(command, parameters)
    aim = Aim(**{name: parameters.pop(name) for name in Aim._fields if name in parameters})
    usual = next((str(each.default) for each in command.params if each.name == "figure"), None)
    figure, quiet = parameters.pop("figure", None), parameters.pop("quiet", False)
    return Job(spacecraft, read, written, flown, options, aim, figure, usual, quiet)


def deliver(
    outputs: Sequence[Output],
    *screens: Callable[[], RenderableType],
    unsaved: Sequence[CannotWrite] = (),
) -> None:
    """Write the files requested, and show results on standard output.

    A file that cannot be saved keeps nothing back: CannotWrite comes at the end, also for those
    ``unsaved`` already.
    """
    failures = list(unsaved)
    # All content is made before any file is written, so that a failure leaves no file behind.
    contents: list[tuple[str, Any]] = []
    for path, make in outputs:
        if path is not None:
            content: Any = make()
            if isinstance(content, dict):
                from nutdamp.files.tabular import json_text

                content = json_text(content)
            elif not (isinstance(content, str | bytes) or callable(content)):
                from nutdamp.figures.image import rendered

                content = rendered(content, path)
            contents.append((path, content))
    with look_of_screen():
        shown = [make() for make in screens]
    if contents:
        from nutdamp.errors import CannotWrite
        from nutdamp.files.tabular import write_whole

        for path, content in contents:
            try:
                write_whole(path, content)
            except CannotWrite as wrong:
                failures.append(wrong)
    with look_of_screen():
        for result in shown:
            show(result)
    for failure in failures[:-1]:
        say(f"nutdamp: {failure}")
    if failures:
        raise failures[-1]


OPTIONS, WRITTEN, SCREEN = "Options", "Files to write", "Screen"  # headings of a help page
FIRST_PAGE = 20  # options on the first help page, at most
HELP_ALL = "nutdamp.help_all"  # key in the context of a command line
RARE = {
    "timed",
    "table",
    "certificate",
    "at",
    "figure",
    "sun",
    "title",
    "document",
    "issue",
    "author",
    "date",
    "units",
    "threads",
    "worst",
}
"""Options that few need: where there are many of them the first help page leaves these out."""
COMMON = {"free_axis", "shift", "least"}
"""Options of schemes that notes and figures propose."""


def _show_all(ctx: click.Context, _: click.Parameter, asked: bool) -> None:
    if asked and not ctx.resilient_parsing:
        ctx.meta[HELP_ALL] = True
        click.echo(ctx.get_help())
        ctx.exit()


help_all = click.Option(
    ["--help-all"],
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_show_all,
    help="Show this message with rare options too.",
)


class SessionCommand(click.Command):
    """A command whose help page has headings; shared parameters are gathered into ``job``."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; an unsuitable value of the spacecraft file is a fault there."""
        ctx.params = {"job": (job := job_of(self, ctx.params)), **ctx.params}
        try:
            return super().invoke(ctx)
        except Unsuitable as wrong:
            raise placed(wrong, job.given) from None
        except Infeasible as reason:
            job.refuse(reason)
            raise

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """The parameters, with ``--help-all`` where the first help page leaves some out."""
        params = super().get_params(ctx)
        return [*params, help_all] if self.rare() else params

    def rare(self) -> set[str]:
        """Names of options that the first help page leaves out: none where they are few."""
        options = [param for param in self.params if isinstance(param, click.Option)]
        if len(options) < FIRST_PAGE:
            return set()
        schemes = {
            param.name for param in options if getattr(param, "group", "").startswith(SCHEME)
        }
        return {str(param.name) for param in options if param.name in RARE | schemes - COMMON}

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The options under their headings, rare ones only with ``--help-all``."""
        groups: dict[str, list[tuple[str, str]]] = {OPTIONS: [], GOAL: [], WRITTEN: [], SCREEN: []}
        hidden = set() if ctx.meta.get(HELP_ALL) else self.rare()
        for option in self.get_params(ctx):
            record = option.get_help_record(ctx)
            if option.name in hidden or record is None or not isinstance(option, click.Option):
                continue
            heading = str(getattr(option, "group", OPTIONS))
            if option.is_eager or option.name in ("units", "verbose", "quiet"):
                heading = SCREEN
            elif isinstance(option.type, OutputName) or option.name == "figure":
                heading = WRITTEN
            groups.setdefault(heading, []).append(record)
        for heading, records in groups.items():
            if records:
                with formatter.section(heading):
                    formatter.write_dl(records, col_max=WIDEST)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse as click does; an option of a scheme that is not taken has its own error."""
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as wrong:
            name = wrong.option_name.removeprefix("--").replace("-", "_")
            readers = (
                SUNLIT
                if name == "sun"
                else [each for each in SCHEMES if name in names_of(SCHEMES[each].options)]
            )
            if not readers or all(parameter.name != "target" for parameter in self.params):
                raise
            if name == "sun":
                raise click.UsageError(NO_SUN, ctx) from None
            message = (
                f"{wrong.option_name} is for {' and '.join(readers)}, an option of `nutdamp plan`"
            )
            if any(parameter.name == "schedule" for parameter in self.params):
                message += (
                    ": save its pulses with --csv FILE, and name them here with --schedule FILE"
                )
            raise click.UsageError(message, ctx) from None
