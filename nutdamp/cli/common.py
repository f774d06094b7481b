"""What several commands share: the spacecraft argument, options of pictures, what a file must have."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

import click

from nutdamp.cli.parameters import FILE, Named
from nutdamp.cli.screen import say
from nutdamp.errors import Fault, FaultyFile, NutdampError, Unsuitable

if TYPE_CHECKING:
    from nutdamp.cli.scheme_options import Aim
    from nutdamp.files.settings import Setting
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

LOOP = """the spacecraft file has no loop: it names no sensor to fire by. For example:

loop:
  sensor: {kind: gyro, rate: 100 Hz, noise: 0.01 deg/s, delay: 20 ms}
  law: four-pulse
  start: 0.5 deg
  stop: 0.05 deg"""
"""What is said of a file that should have a loop."""

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
    """The spacecraft file and ``--set``, gathered into ``spacecraft`` (`Input`) for `job.begin`."""

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


def parsed(
    text: tuple[str, str],
    settings: tuple[Setting, ...],
    remark: Callable[[str], None],
    aim: Aim | None = None,
    doubts: list[Fault] | None = None,
) -> Spacecraft:
    """The spacecraft in what `source` gives; ``aim`` replaces the goal in it, warnings are added to ``doubts``."""
    from nutdamp.files.spacecraft_file import read_spacecraft

    def warn(doubt: Fault) -> None:
        say(doubt.as_warning)
        if doubts is not None:
            doubts.append(doubt)

    body = read_spacecraft(*text, settings, warn)
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
