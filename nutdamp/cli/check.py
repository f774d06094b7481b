"""``nutdamp check``, ``verify``, ``explain``, ``init`` and ``schema``."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from nutdamp.cli.flown import FlownChoice, flown_options, plan_or_read
from nutdamp.cli.job import (
    DEFAULT_FILE,
    FileInput,
    Job,
    begin,
    deliver,
    expect_outputs,
    parsed,
    quiet_option,
    remarks,
    require_loop,
    set_option,
    source,
    spacecraft_argument,
    verbose_option,
)
from nutdamp.cli.main import BAD_INPUT, UNREADABLE, leave, tell
from nutdamp.cli.options import FILE, Aim, PlanningCommand, goal_options
from nutdamp.cli.screen import say, show
from nutdamp.errors import printable
from nutdamp.schemes.catalogue import Options

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import RenderableType

    from nutdamp.errors import Fault
    from nutdamp.files.overrides import Setting
    from nutdamp.views.guide import Topic


@click.command("check")
@click.argument("files", nargs=-1, type=FILE, metavar="[SPACECRAFT]...")
@set_option
@click.option("--json", type=FILE, help="Write derived quantities and faults.")
@verbose_option
@quiet_option
def command(
    files: tuple[str, ...], settings: tuple[Setting, ...], json: str | None, verbose: bool, quiet: bool
) -> None:
    """Check spacecraft files: all faults of all files, derived quantities, channel torques, smallest steps."""
    from nutdamp.errors import CannotRead, CannotWrite, FaultyFile

    silent = expect_outputs(*(FileInput(file) for file in files or (None,)), json=json)
    reports: list[dict[str, Any]] = []
    failures: set[int] = set()
    for name in files or (None,):
        doubts: list[Fault] = []
        try:
            report, screen = _looked_into(FileInput(name, settings), remarks(quiet), doubts, verbose)
        except (FaultyFile, CannotRead) as wrong:
            from nutdamp.views.check import failed_json

            tell(wrong)
            failures.add(BAD_INPUT if isinstance(wrong, FaultyFile) else UNREADABLE)
            reports.append(failed_json(name, wrong, doubts))
            continue
        reports.append(report)
        if not silent:
            show(screen)
            if len(files) > 1:
                click.echo()
    if json is not None:
        from nutdamp.views.check import check_json

        try:
            deliver([(json, lambda: check_json(reports))])
        except CannotWrite as wrong:
            tell(wrong)
            failures.add(UNREADABLE)
    if failures:
        sys.exit(max(failures))


def _looked_into(
    given: FileInput, remark: Callable[[str], None], doubts: list[Fault], verbose: bool
) -> tuple[dict[str, Any], RenderableType]:
    """Results of the check of a file, for JSON and for the screen; warnings are added to ``doubts``.

    Raises CannotRead, and FaultyFile, also for faults that appear only in derived quantities.
    """
    from nutdamp.errors import Fault, FaultyFile, NutdampError
    from nutdamp.views.check import check_screen, checked_json

    spacecraft = parsed(source(given.path, remark), given.settings, remark, doubts=doubts)
    try:
        return checked_json(given.path, spacecraft, doubts), check_screen(spacecraft, verbose=verbose)
    except NutdampError as wrong:
        raise FaultyFile([Fault(given.path or DEFAULT_FILE, 1, 1, "", str(wrong))]) from wrong


@click.command("verify", cls=PlanningCommand)
@spacecraft_argument
@flown_options("Verify")
@goal_options
@click.option("--loop", "looped", is_flag=True, help="Verify the closed loop of the file: each firing, by DOP853.")
@click.option("--json", type=FILE, help="Write methods, differences and error budget.")
@quiet_option
def verify_command(
    spacecraft: FileInput,
    flown: FlownChoice,
    options: Options,
    aim: Aim,
    looped: bool,
    json: str | None,
    quiet: bool,
) -> None:
    """Fly a schedule by impulse sum, Taylor series, DOP853 and Basilisk (where installed), side by side.

    Shows the largest differences, what is conserved, and what each imperfection alone costs. Motions too long for
    DOP853 and Basilisk are not confirmed: exit status 3.
    """
    if looped and flown != (None, None, None):
        raise click.UsageError("name what to verify: one of --scheme, --schedule, --blocks and --loop")
    job = begin(spacecraft, flown.file, aim=aim, quiet=quiet, json=json)
    if looped:
        _verify_loop(job, json)
        return

    from nutdamp.api import verify
    from nutdamp.cli.job import working
    from nutdamp.views.verify_tables import verification_screen

    plan = plan_or_read(job, flown, options)
    with working("verifying", quiet=quiet):
        verified = verify(plan)
    core = verified.core
    job.deliver([(json, verified.to_dict)], lambda: verification_screen(job.spacecraft, plan.scheme, core))
    if core.disagreeing:
        others = " and ".join(core.disagreeing)
        say(f"nutdamp: the flown motion and {others} do not agree; please report this")
    elif not core.checks:
        say("nutdamp: no independent integration was flown to the end, so the flown motion is not confirmed")
    for quantity in core.drifting:
        say(f"nutdamp: {quantity} is not constant on coasts, where nothing changes it; please report this")
    leave(failed=bool(core.disagreeing or core.drifting), infeasible=not core.checks)


def _verify_loop(job: Job, json: str | None) -> None:
    """The closed loop of the file against the same by DOP853."""
    from nutdamp.cli.job import working
    from nutdamp.control_loop.evaluation import verify_loop
    from nutdamp.views.loop import verification_screen, verified_json

    require_loop(job.spacecraft)
    with working("verifying", quiet=job.quiet):
        comparison = verify_loop(job.spacecraft)
    job.deliver([(json, lambda: verified_json(comparison))], lambda: verification_screen(comparison))
    if comparison.missing:
        say(f"nutdamp: DOP853 did not fly the loop to its end, so it is not confirmed: {comparison.missing}")
        leave(infeasible=True)
    if not comparison.agree:
        say("nutdamp: the loop and the same by DOP853 do not agree; please report this")
        leave(failed=True)


def _completed_examples(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG001
    from nutdamp.files.reader import example_names, example_subject

    return [CompletionItem(name, help=example_subject(name)) for name in example_names() if name.startswith(incomplete)]


@click.command("init")
@click.argument("file", type=FILE, default=DEFAULT_FILE, metavar="[FILE]")
@click.option(
    "--from", "name", metavar="NAME", shell_complete=_completed_examples, help="One of the examples of --list instead."
)
@click.option("--list", "listed", is_flag=True, help="List the examples that there are, and write nothing.")
@click.option("--force", is_flag=True, help="Replace a file that is already there.")
@quiet_option
def init_command(file: str, name: str | None, listed: bool, force: bool, quiet: bool) -> None:
    """Write a commented spacecraft file (default spacecraft.yaml); a FILE of - is standard output.

    It is the built-in example, in which every key is described, or with --from one of the spacecraft that ship with
    nutdamp, each with the sources of its figures.
    """
    from nutdamp.errors import CannotWrite
    from nutdamp.files.reader import BUILT_IN, example_text
    from nutdamp.files.tabular import STDOUT, check_place, write_whole

    if listed:
        _list()
        return
    text = example_text(_known(name) if name else BUILT_IN)
    if file != STDOUT and check_place(file).exists() and not force:
        raise CannotWrite(file, "it is already there; --force replaces it")
    write_whole(file, text)
    if file != STDOUT:
        remarks(quiet)(f"wrote {printable(file)}; plan it with: nutdamp plan {printable(file)}")


def _list() -> None:
    """Print the examples."""
    from nutdamp.cli.screen import show
    from nutdamp.files.reader import example_names, example_subject
    from nutdamp.views.explain_tables import examples_screen

    rows = tuple((name, example_subject(name)) for name in example_names())
    show(examples_screen(rows))


def _known(name: str) -> str:
    """The ``name`` if there is such an example; a usage error suggests the nearest one to a misspelt name."""
    from nutdamp.errors import nearest
    from nutdamp.files.reader import example_names

    names = example_names()
    if name in names:
        return name
    close = nearest(name, names)
    raise click.BadParameter(
        f"there is no example {name!r}; "
        + (f"did you mean {close!r}?" if close else "`nutdamp init --list` lists those that there are"),
        param_hint="'--from'",
    )


@click.command("schema")
@click.option("-o", "--output", type=FILE, default="-", help="Where to write it; default standard output.")
def schema_command(output: str) -> None:
    """Print the JSON Schema of the spacecraft file, for editors that complete and check YAML."""
    from nutdamp.files.reader import json_schema
    from nutdamp.files.tabular import json_text, write_whole

    write_whole(output, json_text(json_schema()))


def _completed_topics(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG001
    from nutdamp.views.guide import SUMMARIES

    topics = [topic for _, group in SUMMARIES for topic in group]
    return [CompletionItem(name, help=text) for name, text in topics if name.startswith(incomplete)]


@click.command("explain")
@click.argument("topic", nargs=-1, metavar="[TOPIC]", shell_complete=_completed_topics)
def explain_command(topic: tuple[str, ...]) -> None:
    """Explain a scheme, an equation of the sources, the motion, or the keys of the spacecraft file.

    TOPIC is a scheme; a number such as 17, K7 or 24.4, or `equations` for all; `nutation`, `dissipation`, `figures`;
    `file`, `file.thrusters`, `units`. Without it the topics are listed.
    """
    from nutdamp.views import explain_tables

    requested = " ".join(topic)
    if not requested.strip():
        show(explain_tables.topics_screen())
    elif requested.strip().casefold() == "equations":
        show(explain_tables.equations_screen())
    else:
        show(explain_tables.topic_screen(_topic(requested.strip())))


def _topic(requested: str) -> Topic:
    """The topic of that name; those on the spacecraft file are made from its models, which take longer to load."""
    from nutdamp.views import guide

    name, _, below = requested.partition(".")
    if name.casefold() == guide.FILE:
        from nutdamp.views.file_guide import file_topic

        return file_topic(below)
    return guide.found(requested)
