"""``nutdamp check``, ``verify``, ``explain``, ``init`` and ``schema``."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from nutdamp.cli.job import (
    DEFAULT_FILE,
    FileInput,
    Job,
    SessionCommand,
    deliver,
    expect_outputs,
    quiet_option,
    screen_options,
    set_option,
    spacecraft_argument,
)
from nutdamp.cli.main import BAD_INPUT, UNREADABLE, leave, tell
from nutdamp.cli.options import FILE, OUTPUT, goal_options
from nutdamp.cli.plan import flown_options, plan_or_read
from nutdamp.cli.screen import console, say, show, units_of_screen
from nutdamp.errors import nearest, printable

if TYPE_CHECKING:
    from rich.console import RenderableType

    from nutdamp.errors import Fault
    from nutdamp.files.editing import Setting


@click.command("check")
@click.argument("files", nargs=-1, type=FILE, metavar="[SPACECRAFT]...")
@set_option
@click.option("--json", type=OUTPUT, help="Write derived quantities and faults.")
@screen_options
def check_command(
    files: tuple[str, ...], settings: tuple[Setting, ...], json: str | None, verbose: bool, quiet: bool
) -> None:
    """Check spacecraft files: all faults of all files, derived quantities, channel torques, smallest steps."""
    from nutdamp.errors import CannotRead, CannotWrite, FaultyFile
    from nutdamp.views.check import check_json, check_screen, checked, failed_json

    inputs = [FileInput(file, settings) for file in files or (None,)]
    silent = expect_outputs(*(given.read for given in inputs), json=json)
    remark = (lambda _: None) if quiet else say
    reports: list[dict[str, Any]] = []
    failures: set[int] = set()
    for given in inputs:
        doubts: list[Fault] = []
        try:
            result = checked(given.source(remark), given.path, doubts, lambda doubt: say(doubt.as_warning))
        except (FaultyFile, CannotRead) as wrong:
            tell(wrong)
            failures.add(BAD_INPUT if isinstance(wrong, FaultyFile) else UNREADABLE)
            reports.append(failed_json(given.path, wrong, doubts))
            continue
        reports.append(result.to_dict())
        if not silent:
            with units_of_screen():
                show(check_screen(result.spacecraft, verbose=verbose))
            if len(files) > 1:
                click.echo()
    try:
        deliver([(json, lambda: check_json(reports))])
    except CannotWrite as wrong:
        tell(wrong)
        failures.add(UNREADABLE)
    if failures:
        sys.exit(max(failures))


@click.command("verify", cls=SessionCommand)
@spacecraft_argument
@flown_options("Verify")
@goal_options
@click.option("--loop", "looped", is_flag=True, help="Verify the closed loop of the file: each firing, by DOP853.")
@click.option("--json", type=OUTPUT, help="Write methods, differences and error budget.")
@screen_options
def verify_command(job: Job, looped: bool, verbose: bool) -> None:
    """Fly a schedule by impulse sum, Taylor series, DOP853 and Basilisk (where installed), side by side.

    Shows the largest differences and what is conserved, with -v what each imperfection alone leaves. Motions too long
    for DOP853 and Basilisk are not confirmed: exit status 3.
    """
    if looped and any(job.flown):
        raise click.UsageError("name what to verify: one of --scheme, --schedule, --blocks and --loop")
    job.begin()
    if looped:
        _verify_loop(job)
        return

    from nutdamp.api import verify
    from nutdamp.views.simulation import verification_brief

    plan = plan_or_read(job)
    with job.working("verifying"):
        verified = verify(plan)
    core = verified.core
    job.deliver(verified, *([] if verbose else [lambda: verification_brief(plan, core)]))
    if core.disagreeing:
        others = " and ".join(core.disagreeing)
        say(f"nutdamp: the flown motion and {others} do not agree; please report this")
    elif not core.checks:
        say("nutdamp: no independent integration was flown to the end, so the flown motion is not confirmed")
    for quantity in core.drifting:
        say(f"nutdamp: {quantity} is not constant on coasts, where nothing changes it; please report this")
    leave(failed=bool(core.disagreeing or core.drifting), infeasible=not core.checks)


def _verify_loop(job: Job) -> None:
    from nutdamp.api import verify_loop

    with job.working("verifying"):
        comparison = verify_loop(job.spacecraft)
    job.deliver(comparison)
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
@click.option("--force", is_flag=True, help="Replace an existing file.")
@quiet_option
def init_command(file: str, name: str | None, listed: bool, force: bool, quiet: bool) -> None:
    """Write a commented spacecraft file (default spacecraft.yaml); a FILE of - is standard output.

    It is the built-in example, in which every key is described, or with --from one of the spacecraft that ship with
    nutdamp, each with the sources of its figures.
    """
    from nutdamp.errors import CannotWrite
    from nutdamp.files.reader import BUILT_IN, example_names, example_subject, example_text
    from nutdamp.files.tabular import STDOUT, check_place, write_whole

    if listed:
        from nutdamp.views.explain import examples_screen

        show(examples_screen(tuple((name, example_subject(name)) for name in example_names())))
        return
    if name and name not in example_names():
        close = nearest(name, example_names())
        cure = f"did you mean {close!r}?" if close else "`nutdamp init --list` lists those that there are"
        raise click.BadParameter(f"there is no example {name!r}; {cure}", param_hint="'--from'")
    text = example_text(name or BUILT_IN)
    if file != STDOUT and check_place(file).exists() and not force:
        raise CannotWrite(file, "already exists; use --force")
    write_whole(file, text)
    if file != STDOUT and not quiet:
        say(f"wrote {printable(file)}; plan it with: nutdamp plan {printable(file)}")


@click.command("schema")
@click.option("-o", "--output", type=OUTPUT, default="-", help="Where to write it; default standard output.")
def schema_command(output: str) -> None:
    """Print the JSON Schema of the spacecraft file, for editors that complete and check YAML."""
    from nutdamp.files.reader import json_schema
    from nutdamp.files.tabular import json_text, write_whole

    write_whole(output, json_text(json_schema()))


def _completed_topics(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG001
    from nutdamp.views.guide import NAMES, page_or_topic

    return [CompletionItem(name, help=page_or_topic(name).summary) for name in NAMES if name.startswith(incomplete)]


@click.command("explain")
@click.argument("topic", nargs=-1, metavar="[TOPIC]", shell_complete=_completed_topics)
def explain_command(topic: tuple[str, ...]) -> None:
    """Explain a page of the guide, a scheme, an equation, a heading of a table, or a key of the spacecraft file.

    TOPIC is a page or a scheme; a number such as 17, K7 or 24.4, or `equations` for all; a word such as `tilt`, `H`
    or `on_time_s`; `file.thrusters`. Without it the pages are listed. On a terminal long pages go through a pager.
    """
    from nutdamp.views import explain, guide

    requested = " ".join(topic).strip()
    if not requested:
        _read(explain.topics_screen())
    elif requested.casefold() == guide.OVERVIEW:
        _read(explain.equations_screen())
    else:
        _read(explain.topic_screen(explain.explained(requested)))


def on_keyboard() -> bool:
    """True where someone can leave a pager."""
    return sys.stdin.isatty()


def _read(screen: RenderableType) -> None:
    """Show a screen; where it is longer than the terminal, in a pager."""
    shown = console()
    if not (shown.is_terminal and on_keyboard()):
        show(screen)
        return
    with shown.capture() as captured:
        shown.print(screen)
    if captured.get().count("\n") < shown.height:
        show(screen)
    else:
        click.echo_via_pager(captured.get())
