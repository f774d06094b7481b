"""What several commands share: the spacecraft argument, quantities as options, the two output streams."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import IO, TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

import click

from nutdamp.cli.failures import debug_option, show_failures
from nutdamp.cli.parameters import FILE, Angles, Direction, FinalSpin, Quantity
from nutdamp.cli.screen import say, show
from nutdamp.errors import Fault, FaultyFile, NutdampError, Unsuitable
from nutdamp.schemes import AIMED, LEAST, SUNLIT, Options

if TYPE_CHECKING:
    from rich.console import RenderableType

    from nutdamp.errors import CannotWrite, Fault
    from nutdamp.files.settings import Setting
    from nutdamp.planning import Plan
    from nutdamp.spacecraft import Spacecraft, Vector

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

Output = tuple[str, "str | bytes | Callable[[IO[bytes]], object]"]
"""Path of a file to write, and its content or what writes it."""

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
    help="Change a key of the spacecraft file, such as limits.horizon=300s; repeatable.",
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


class Aim(NamedTuple):
    """A goal as the command line gives it, in place of the one in the file.

    ``target`` and ``sun``: two angles in rad, right ascension and declination where the file has an attitude, else tilt
    and azimuth in the frame N. ``spin``: rad/s, or ``keep``.
    """

    target: Angles | None = None
    spin: float | str | None = None
    sun: Angles | None = None

    def applied(self, spacecraft: Spacecraft, remark: Callable[[str], None]) -> Spacecraft:
        """The spacecraft with this goal; a usage error where it cannot be one, a remark where it is hardly meant."""
        from dataclasses import replace

        goal = spacecraft.goal
        if self.target is not None:
            goal = replace(goal, axis=_direction(spacecraft, self.target, "--target"))
        if self.sun is not None:
            goal = replace(goal, sun=_direction(spacecraft, self.sun, "--sun"))
        if self.spin is not None:
            spin = spacecraft.spin if isinstance(self.spin, str) else self.spin
            if spin * spacecraft.spin <= 0.0:
                raise click.BadParameter(
                    f"a rate of the sign of the spin ({spacecraft.spin:.4g} rad/s) is wanted", param_hint="--spin"
                )
            goal = replace(goal, spin=spin)
        for option, angles in (("--target", self.target), ("--sun", self.sun)):
            for reading in () if angles is None else angles.readings:
                remark(f"{option}: warning: {reading}")
        return replace(spacecraft, goal=goal)


def _direction(spacecraft: Spacecraft, angles: Angles, option: str) -> Vector:
    """The unit vector (3,) that two angles name, inertial; a usage error where they name none."""
    from nutdamp.physics.attitude import on_sphere

    if spacecraft.attitude is not None:
        if abs(angles.second) > 0.5 * math.pi:
            raise _no_direction("a declination of -90 deg to 90 deg", angles, option)
        return on_sphere(angles.first, angles.second)
    if not 0.0 <= angles.first < math.pi:
        raise _no_direction("a tilt of at least 0 and below 180 deg", angles, option)
    return spacecraft.direction_in_n(angles.first, angles.second)


def _no_direction(expected: str, angles: Angles, option: str) -> click.BadParameter:
    return click.BadParameter("; ".join((f"{expected} is wanted", *angles.readings)), param_hint=option)


READ_BY = {
    "on_time": ("four-pulse", "rhumb-line"),
    "coarse": ("four-pulse",),
    "literal": ("two-pulse",),
    "least": ("optimal",),
    "free_axis": ("optimal",),
    "shift": ("optimal",),
    "cones": ("half-cone",),
    "per_turn": ("rhumb-line",),
}
"""Options of planning that only some schemes read; the others are for all."""


def tell_unread(names: Sequence[str], options: Options, body: Spacecraft, remark: Callable[[str], None]) -> None:
    """Say what was asked for that none of the schemes ``names`` reads; a usage error where that is the goal itself."""
    for option, readers in READ_BY.items():
        if getattr(options, option) != Options._field_defaults[option] and not set(readers) & set(names):
            remark(f"--{option.replace('_', '-')} does nothing here: it is for {' and '.join(readers)}")
    if body.goal.sun is not None:
        deaf = [name for name in names if name not in SUNLIT]
        if len(deaf) == len(names):
            raise click.UsageError(f"--sun is for {' and '.join(SUNLIT)}, which is not planned here")
        if deaf:
            remark(f"--sun is read by {' and '.join(SUNLIT)} alone: {', '.join(deaf)} plan without it")
    if names and body.goal.axis is None and set(names) <= set(AIMED):
        turns, needs = ("turns", "needs") if len(names) == 1 else ("turn", "need")
        problem = f"{turns} the spin axis to a target and {needs} one: --target, or goal in the file"
        raise click.UsageError(f"{' and '.join(names)} {problem}")


def scheme_options(command: Command) -> Command:
    """Options of planning, gathered into ``options`` for the schemes (`schemes.Options`) and the ``aim`` for `load`."""

    @functools.wraps(command)
    def gathered(*args: Any, **parameters: Any) -> Any:
        chosen = Options(**{name: parameters.pop(name) for name in Options._fields})
        for name, problem in chosen.faults():
            raise click.BadParameter(problem, param_hint=f"--{name.replace('_', '-')}")
        aim = Aim(*(parameters.pop(name) for name in Aim._fields))
        return command(*args, options=chosen, aim=aim, **parameters)

    wrapped: Any = gathered
    for option in (
        debug_option,
        click.option(
            "--spin",
            type=FinalSpin("rate"),
            metavar="RATE|keep",
            help="optimal: spin rate at the end, such as 30rpm, by channels with a torque about axis 3.",
        ),
        click.option(
            "--target",
            type=Direction(),
            metavar="ANGLE,ANGLE",
            help="Where the spin axis is to end: right ascension and declination where the file has an attitude, else "
            "tilt from H and azimuth about it, such as 10deg,45deg.",
        ),
        click.option(
            "--sun",
            type=Direction(),
            metavar="ANGLE,ANGLE",
            help="rhumb-line: the Sun, given as --target is, to which the pulses keep their phase; default: the "
            "phase of the great circle to the target.",
        ),
        click.option(
            "--per-turn",
            type=click.IntRange(1),
            default=1,
            show_default=True,
            help="rhumb-line: pulses in each spin turn.",
        ),
        click.option(
            "--cones",
            type=click.IntRange(1),
            help="half-cone: how many half cones; default: the fewest of which one more would save less than 1 %.",
        ),
        click.option("--with-disturbances", is_flag=True, help="Plan on the motion with the disturbances of the file."),
        click.option(
            "--shift",
            type=Quantity("angle"),
            help="optimal: how far from its target the angular momentum may end, such as 0.2deg.",
        ),
        click.option("--free-axis", is_flag=True, help="optimal: let the angular momentum end where it likes."),
        click.option(
            "--least",
            type=click.Choice(LEAST),
            default=LEAST[0],
            show_default=True,
            help="optimal: what to save; impulse stands in where propellant is unknown.",
        ),
        click.option("--literal", is_flag=True, help="two-pulse as printed by Magnus: equal halves, small-angle wait."),
        click.option("--coarse", is_flag=True, help="four-pulse with full pulses only, no shorter one at the end."),
        click.option(
            "--on-time", type=Quantity("time"), help="Pulse length of four-pulse and rhumb-line, such as 200ms."
        ),
    ):
        wrapped = option(wrapped)
    return cast(Command, wrapped)


def plot_options(command: Command) -> Command:
    """``--plot FILE`` and which picture it is to be."""
    for option in (
        click.option(
            "--figure", type=click.Choice(FIGURES), default=FIGURES[0], show_default=True, help="What --plot draws."
        ),
        click.option("--plot", type=FILE, help="Draw the motion (.png, .svg, .pdf; needs the extra plot)."),
    ):
        command = option(command)
    return command


def expect_picture(path: str | None, figure: str = FIGURES[0]) -> None:
    """Say at once, not after the work, that a picture cannot be made; a usage error for a ``figure`` without file."""
    if path is None:
        if figure != FIGURES[0]:
            raise click.UsageError("--figure says what --plot draws: name a file with --plot")
        return
    from nutdamp.report import figures

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

    from nutdamp.files.spacecraft_file import built_in_example_text
    from nutdamp.files.yaml_tree import read_text

    if path is None and Path(DEFAULT_FILE).exists():
        remark(f"reading {DEFAULT_FILE}")
        path = DEFAULT_FILE
    if path is not None:
        return read_text(Path(path)), path
    remark("no spacecraft file named, and no spacecraft.yaml here: using the built-in example (see `nutdamp init`)")
    return built_in_example_text(), "example.yaml"


def plan_or_read(
    body: Spacecraft,
    scheme: str | None,
    schedule: str | None,
    options: Options,
    remark: Callable[[str], None],
    *,
    quiet: bool,
) -> Plan:
    """The plan of ``scheme`` (the recommended one where it is None), or the pulses of a ``schedule`` file as a plan.

    Raises Infeasible where there is no such plan.
    """
    from nutdamp import planning
    from nutdamp.cli.progress import working
    from nutdamp.errors import Infeasible, printable

    tell_unread(() if schedule else (scheme,) if scheme else planning.usual(body), options, body, remark)
    if schedule is not None:
        from nutdamp.files.schedule_file import read_pulses
        from nutdamp.limits import broken_limits

        pulses, warnings = read_pulses(schedule, body)
        for warning in (*warnings, *broken_limits(body, pulses)):
            remark(f"warning: {warning}")
        return planning.Plan(body, printable(schedule), pulses)
    with working("planning", quiet=quiet):
        if scheme:
            plan: Plan | None = planning.plan(body, scheme, options)
        else:
            from nutdamp.report import verdicts

            compared = planning.compare(body, planning.usual(body), options)
            plan = compared.recommended
            show_failures(compared)
            for warning in verdicts.warnings(compared):
                remark(f"warning: {warning}")
    if plan is None:
        raise Infeasible("no scheme is feasible; `nutdamp plan` says why")
    if plan.why is not None:
        raise Infeasible(f"{plan.scheme} is infeasible: {plan.why}")
    for text in plan.remarks:
        remark(text)
    return plan


def require_dispersions(body: Spacecraft) -> None:
    """Raises BadRequest, which shows what to write, for a spacecraft without dispersions."""
    from nutdamp.errors import BadRequest

    if body.dispersions is None:
        raise BadRequest(DISPERSIONS)


def remarks(quiet: bool) -> Callable[[str], None]:
    """Prints remarks on standard error, unless ``quiet``."""
    return (lambda _: None) if quiet else say


def expect_places(*paths: str | None) -> None:
    """Say at once, not after the work, that a file cannot be written where it is to be."""
    from nutdamp.files.output import check_place

    for path in paths:
        if path is not None:
            check_place(path)


def deliver(outputs: Sequence[Output], *screens: RenderableType, unsaved: Sequence[CannotWrite] = ()) -> None:
    """Write the files asked for, and show results on standard output.

    A file that cannot be saved keeps back neither the others nor the results: it is said at the end, together with
    those that are ``unsaved`` already. Raises CannotWrite.
    """
    failures = list(unsaved)
    if outputs:
        from nutdamp.errors import CannotWrite
        from nutdamp.files.output import write_whole

        for path, content in outputs:
            try:
                write_whole(path, content)
            except CannotWrite as wrong:
                failures.append(wrong)
    for screen in screens:
        show(screen)
    for failure in failures[:-1]:
        say(f"nutdamp: {failure}")
    if failures:
        raise failures[-1]
