"""What several commands share: the spacecraft argument, quantities as options, the two output streams."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import IO, TYPE_CHECKING, Any, NamedTuple, TypeAlias, TypeVar, cast

import click

from nutdamp.cli.failures import show_failures
from nutdamp.cli.parameters import FILE, Named, SchemeName
from nutdamp.cli.scheme_options import Aim, expect_read
from nutdamp.cli.screen import say, show
from nutdamp.errors import Fault, FaultyFile, NutdampError, Unsuitable
from nutdamp.schemes import NAMES, Options, SchemeOptions

if TYPE_CHECKING:
    from rich.console import RenderableType

    from nutdamp.errors import CannotWrite, Fault
    from nutdamp.files.settings import Setting
    from nutdamp.planning import Plan
    from nutdamp.spacecraft import Spacecraft

DEFAULT_FILE = "spacecraft.yaml"

FIGURES = ("overview", "motion", "sphere", "history", "timeline")
"""Pictures that ``--plot`` can draw, the default first."""

DISPERSIONS = """the spacecraft file has no dispersions: it does not say how far its values may be off. For example:

dispersions:
  A: {normal: 2 %}
  C: {normal: 2 %}
  omega0: {normal: 0.1 deg/s}
  thrust: {normal: 3 %}
  timing: {uniform: 5 ms}"""
"""What is said of a file that should have dispersions."""

LOOP = """the spacecraft file has no loop: it does not say by what to fire. For example:

loop:
  sensor: {kind: gyro, rate: 100 Hz, noise: 0.01 deg/s, delay: 20 ms}
  law: four-pulse
  start: 0.5 deg
  stop: 0.05 deg"""
"""What is said of a file that should have a loop."""

File: TypeAlias = "str | bytes | Callable[[IO[bytes]], object]"
"""What `write_whole` takes."""

Output = tuple[str | None, Callable[[], "File | dict[str, Any]"]]
"""Path of a file to write, if one is requested, and what makes its content; a dict is written as JSON."""

Command = TypeVar("Command", bound=Callable[..., Any])

quiet_option = click.option("-q", "--quiet", is_flag=True, help="No remarks on standard error.")


class Input(NamedTuple):
    """The spacecraft that a command line names: the ``path`` of a file, and what ``--set`` changes in it."""

    path: str | None
    settings: tuple[Setting, ...] = ()


def _settings(ctx: click.Context, param: click.Parameter, texts: tuple[str, ...]) -> tuple[Setting, ...]:
    if not texts:
        return ()
    from nutdamp.files.settings import parse_setting

    try:
        return tuple(parse_setting(text) for text in texts)
    except ValueError as wrong:
        raise click.BadParameter(str(wrong), ctx, param) from None


set_option = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    callback=_settings,
    help="Change a key of the file, as limits.gap=1s; repeatable.",
)


def spacecraft_argument(command: Command) -> Command:
    """The spacecraft file and ``--set``, gathered into ``spacecraft`` (`Input`) for `load`."""

    @functools.wraps(command)
    def gathered(*args: Any, spacecraft: str | None, settings: tuple[Setting, ...], **parameters: Any) -> Any:
        given = Input(spacecraft, settings)
        try:
            return command(*args, spacecraft=given, **parameters)
        except Unsuitable as wrong:
            raise placed(wrong, given) from None

    argument = click.argument("spacecraft", required=False, type=FILE, metavar="[SPACECRAFT]")
    return cast(Command, argument(set_option(gathered)))


def placed(wrong: Unsuitable, given: Input) -> NutdampError:
    """The error as a fault with the place of the value in the spacecraft file, where it comes from one."""
    if given.path == "-" or any(wrong.where[:1] == setting.path[:1] for setting in given.settings):
        return wrong
    from nutdamp.files.yaml_tree import dotted, read_tree

    text, name = source(given.path, lambda _: None)
    place = read_tree(text, name)[0].place_of(wrong.where)
    return FaultyFile([Fault(name, place.line, place.column, dotted(wrong.where), wrong.problem)])


def plot_options(names: tuple[str, ...]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """``--plot FILE`` and which of the pictures ``names`` it is to be, the default first."""
    which = click.option("--figure", type=Named(names), default=names[0], show_default=True, help="What --plot draws.")
    where = click.option("--plot", type=FILE, help="Draw it (.png, .svg, .pdf; needs extra plot).")
    return lambda command: where(which(command))


def expect_picture(path: str | None, figure: str = FIGURES[0]) -> None:
    """Say at once, not after the work, that a picture cannot be made; a usage error for a ``figure`` without file."""
    if path is None:
        if figure != FIGURES[0]:
            raise click.UsageError("--figure says what --plot draws: name a file with --plot")
        return
    from nutdamp.presentation import figures

    figures.ending(path)


def load(
    given: Input, remark: Callable[[str], None], aim: Aim | None = None, doubts: list[Fault] | None = None
) -> Spacecraft:
    """The spacecraft named, else spacecraft.yaml in the working directory, else the built-in example.

    ``aim`` takes the place of the goal in the file; warnings are added to ``doubts``.
    """
    from nutdamp.files.spacecraft_file import read_spacecraft

    def warn(doubt: Fault) -> None:
        remark(doubt.as_warning)
        if doubts is not None:
            doubts.append(doubt)

    body = read_spacecraft(*source(given.path, remark), given.settings, warn)
    return body if aim is None else aim.applied(body, remark)


def source(path: str | None, remark: Callable[[str], None]) -> tuple[str, str]:
    """The text of the spacecraft file that `load` reads, and its name."""
    from pathlib import Path

    from nutdamp.files.examples import example_text
    from nutdamp.files.yaml_tree import read_text

    if path is None and Path(DEFAULT_FILE).exists():
        remark(f"reading {DEFAULT_FILE}")
        path = DEFAULT_FILE
    if path is not None:
        return read_text(Path(path)), path
    remark("no spacecraft file named, and no spacecraft.yaml here: using the built-in example (see `nutdamp init`)")
    return example_text(), "example.yaml"


JITTER_SEED = 1
"""Of the errors of the Sun pulses from which blocks are fired: the same in every run."""


class Flown(NamedTuple):
    """What a command flies: the plan of a ``scheme``, the pulses of a ``schedule`` file, else the recommended plan."""

    scheme: str | None
    schedule: str | None


def flown_options(verb: str, scheme: str | None = None) -> Callable[[Command], Command]:
    """``--scheme`` and ``--schedule``, gathered into ``flown`` (`Flown`) for `plan_or_read`.

    ``verb`` says what the command does with the pulses, ``scheme`` is the help of ``--scheme`` where that is more.
    A usage error for both.
    """
    default = f"{verb} this scheme with default options; without it the recommended one."

    def decorate(command: Command) -> Command:
        @functools.wraps(command)
        def gathered(*args: Any, scheme: str | None, schedule: str | None, **parameters: Any) -> Any:
            if scheme is not None and schedule is not None:
                raise click.UsageError(f"name what to {verb.lower()}: either --scheme or --schedule")
            return command(*args, flown=Flown(scheme, schedule), **parameters)

        read = f"{verb} the pulses of a CSV file, as `plan --csv` writes it."
        option = click.option("--schedule", type=FILE, help=read)(gathered)
        return cast(Command, click.option("--scheme", type=SchemeName(NAMES), help=scheme or default)(option))

    return decorate


def plan_or_read(
    body: Spacecraft,
    flown: Flown,
    options: Options,
    remark: Callable[[str], None],
    *,
    quiet: bool,
) -> Plan:
    """What a command flies, as a plan; raises Infeasible where there is none."""
    scheme, schedule = flown
    from nutdamp import planning
    from nutdamp.cli.progress import working
    from nutdamp.comparison import compare, usual
    from nutdamp.errors import Infeasible
    from nutdamp.remarks import infeasibility
    from nutdamp.remarks import remarks as sentences

    expect_read(() if schedule else (scheme,) if scheme else usual(body), options, body, remark)
    if schedule is not None:
        from nutdamp.files.schedule_file import read_plan

        read, warnings = read_plan(schedule, body, options.of(SchemeOptions))
        for warning in warnings:
            remark(f"warning: {warning}")
        return read
    with working("planning", quiet=quiet):
        if scheme:
            plan: Plan | None = planning.plan(body, scheme, options)
        else:
            from nutdamp.presentation import verdicts

            compared = compare(body, usual(body), options)
            plan = compared.recommended
            show_failures(compared)
            if plan is not None:
                remark(f"no --scheme and no --schedule named: using the recommended plan, {plan.scheme}")
            for warning in verdicts.warnings(compared):
                remark(f"warning: {warning}")
    if plan is None:
        raise Infeasible("no scheme is feasible; `nutdamp plan` says why")
    if not plan.feasible:
        raise Infeasible(f"{plan.scheme} is infeasible: {infeasibility(plan)}")
    for text in sentences(plan):
        remark(text)
    return plan


def fire_blocks(path: str, body: Spacecraft, options: Options, remark: Callable[[str], None]) -> Plan:
    """The pulses that the command blocks of a file fire, as a plan; raises Infeasible where there is no Sun pulse."""
    from nutdamp.errors import printable
    from nutdamp.files.blocks_csv import read_blocks
    from nutdamp.planning import Plan
    from nutdamp.remarks import broken_limits
    from nutdamp.schemes.tools.sun_pulses import fired

    blocks, warnings = read_blocks(path, body)
    if body.sun_sensor is not None and body.sun_sensor.jitter > 0.0:
        remark(f"the Sun pulses come with a jitter of {body.sun_sensor.jitter:g} s (one sigma, seed {JITTER_SEED})")
    made = fired(body, blocks, JITTER_SEED)
    for warning in (*warnings, *broken_limits(body, made)):
        remark(f"warning: {warning}")
    return Plan(body, printable(path), made, options=options.of(SchemeOptions), from_file=True)


def require_dispersions(body: Spacecraft) -> None:
    """Raises BadRequest, which shows what to write, for a spacecraft without dispersions."""
    from nutdamp.errors import BadRequest

    if body.dispersions is None:
        raise BadRequest(DISPERSIONS)


def require_loop(body: Spacecraft) -> None:
    """Raises BadRequest, which shows what to write, for a spacecraft without a closed loop."""
    from nutdamp.errors import BadRequest

    if body.loop is None:
        raise BadRequest(LOOP)


def remarks(quiet: bool) -> Callable[[str], None]:
    """Prints remarks on standard error, unless ``quiet``."""
    return (lambda _: None) if quiet else say


def expect_places(*paths: str | None) -> None:
    """Say at once, not after the work, that a file cannot be written where it is to be."""
    from nutdamp.files.output import check_place

    for path in paths:
        if path is not None:
            check_place(path)


def deliver(
    outputs: Sequence[Output], *screens: Callable[[], RenderableType], unsaved: Sequence[CannotWrite] = ()
) -> None:
    """Write the files requested, and show results on standard output.

    A file that cannot be saved keeps back neither the others nor the results: it is said at the end, together with
    those that are ``unsaved`` already. Raises CannotWrite.
    """
    failures = list(unsaved)
    # All is made before anything is written: what cannot be made leaves nothing behind.
    contents = [(path, _file_of(make())) for path, make in outputs if path is not None]
    results = [make() for make in screens]
    if contents:
        from nutdamp.errors import CannotWrite
        from nutdamp.files.output import write_whole

        for path, content in contents:
            try:
                write_whole(path, content)
            except CannotWrite as wrong:
                failures.append(wrong)
    for result in results:
        show(result)
    for failure in failures[:-1]:
        say(f"nutdamp: {failure}")
    if failures:
        raise failures[-1]


def _file_of(content: File | dict[str, Any]) -> File:
    if not isinstance(content, dict):
        return content
    from nutdamp.files.output import json_text

    return json_text(content)
