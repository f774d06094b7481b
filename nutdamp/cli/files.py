"""``check``, ``init``, ``schema``, ``explain``, ``export``, ``import``, ``report``, ``verify``."""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

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
from nutdamp.cli.main import (
    BAD_INPUT,
    SPACECRAFT,
    UNREADABLE,
    console,
    leave,
    look_of_screen,
    say,
    show,
    show_failures,
    tell,
)
from nutdamp.cli.options import (
    COUNT,
    END,
    FILE,
    OF_RECORD,
    OUTPUT,
    Grouped,
    NameType,
    goal_options,
)
from nutdamp.cli.plan import compared_with, robust_of, scheme_option
from nutdamp.cli.studies import flown_options, fronts_of, plan_or_read
from nutdamp.common.work import SAMPLES
from nutdamp.errors import NutdampError, cure_of, printable
from nutdamp.schemes.catalogue import LEAST, PLANNED
from nutdamp.views.exchange import FORMATS, expect_possible, export_notes, lacking

if TYPE_CHECKING:
    from nutdamp.errors import Fault
    from nutdamp.files.editing import Setting
    from nutdamp.views.guide import Topic


@click.command("check")
@click.argument("files", nargs=-1, type=FILE, metavar="[SPACECRAFT]...")
@set_option
@click.option("--json", type=OUTPUT, help="Write derived quantities and faults.")
@screen_options
def check_command(
    files: tuple[str, ...],
    settings: tuple[Setting, ...],
    json: str | None,
    verbose: bool,
    quiet: bool,
) -> None:
    """Check spacecraft files: all faults of all files, derived quantities, channel torques,
    smallest steps.
    """
    from nutdamp.errors import CannotRead, CannotWrite, FaultyFile
    from nutdamp.views.check import check_json, check_screen, checked, failed_json

    inputs = [FileInput(file, settings) for file in files or (None,)]
    silent = expect_outputs(*(entry.read for entry in inputs), json=json)
    remark = (lambda _: None) if quiet else say
    reports: list[dict[str, Any]] = []
    failures: set[int] = set()
    for entry in inputs:
        if entry.path is not None:
            click.get_current_context().meta[SPACECRAFT] = shlex.quote(entry.path)
        doubts: list[Fault] = []
        try:
            result = checked(
                entry.source(remark, lambda text: say(f"warning: {text}")),
                entry.path,
                doubts,
                lambda doubt: say(doubt.as_warning),
            )
        except (FaultyFile, CannotRead) as wrong:
            tell(wrong)
            failures.add(BAD_INPUT if isinstance(wrong, FaultyFile) else UNREADABLE)
            reports.append(failed_json(entry.path, wrong, doubts))
            continue
        reports.append(result.to_dict())
        if not silent:
            with look_of_screen():
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
@click.option(
    "--loop",
    "looped",
    is_flag=True,
    help="Verify the closed loop of the file: each firing, by DOP853.",
)
@click.option("--json", type=OUTPUT, help="Write methods, differences and error budget.")
@screen_options
def verify_command(job: Job, looped: bool, verbose: bool) -> None:
    """Fly a schedule by impulse sum, Taylor series, DOP853 and Basilisk (where installed), side by
    side.

    Shows the largest differences and what is conserved, with -v what each imperfection alone
    leaves. Motions too long for DOP853 and Basilisk are not confirmed: exit status 3.
    """
    if looped and any(job.flown):
        raise click.UsageError(
            "name what to verify: one of --scheme, --schedule, --blocks and --loop"
        )
    job.begin()

    from nutdamp.api import verify, verify_loop

    if looped:
        with job.working("verifying"):
            comparison = verify_loop(job.spacecraft)
        job.deliver(comparison)
        if comparison.missing:
            say(
                "nutdamp: DOP853 did not fly the loop to its end, so it is not confirmed: "
                f"{comparison.missing}"
            )
            leave(infeasible=True)
        if not comparison.agree:
            say("nutdamp: the loop and the same by DOP853 do not agree; please report this")
        leave(failed=not comparison.agree)
        return
    plan = plan_or_read(job, judged=True)
    with job.working("verifying"):
        verified = verify(plan)
    core = verified.core
    job.deliver(verified, verbose=verbose, planned=job.planned)
    if core.disagreeing:
        others = " and ".join(core.disagreeing)
        say(f"nutdamp: the flown motion and {others} do not agree; please report this")
    elif not core.checks:
        say(
            "nutdamp: no independent integration was flown to the end, "
            "so the flown motion is not confirmed"
        )
    for quantity in core.drifting:
        say(
            f"nutdamp: {quantity} is not constant on coasts, where nothing changes it; "
            "please report this"
        )
    leave(failed=bool(core.disagreeing or core.drifting), infeasible=not core.checks)


@click.command("init")
@click.argument("file", type=FILE, default=DEFAULT_FILE, metavar="[FILE]")
@click.option("--from", "name", metavar="NAME", help="One of the examples of --list instead.")
@click.option(
    "--list", "listed", is_flag=True, help="List the examples that there are, and write nothing."
)
@click.option("--force", is_flag=True, help="Replace an existing file.")
@quiet_option
def init_command(file: str, name: str | None, listed: bool, force: bool, quiet: bool) -> None:
    """Write a commented spacecraft file (default spacecraft.yaml); a FILE of - is standard output.

    It is the built-in example, in which every key is described, or with --from one of the
    spacecraft that ship with nutdamp, each with the sources of its figures.
    """
    from nutdamp.errors import CannotWrite
    from nutdamp.files.reader import BUILT_IN, example_names, example_subject, example_text
    from nutdamp.files.tabular import STDOUT, check_place, write_whole

    if listed:
        from nutdamp.views.guide import examples_screen

        show(examples_screen(tuple((name, example_subject(name)) for name in example_names())))
        return
    if name and name not in example_names():
        cure = cure_of(name, example_names(), "`nutdamp init --list` lists those that there are")
        raise click.BadParameter(f"there is no example {name!r}; {cure}", param_hint="'--from'")
    text = example_text(name or BUILT_IN)
    if file != STDOUT and check_place(file).exists() and not force:
        raise CannotWrite(file, "already exists; use --force")
    write_whole(file, text)
    if file != STDOUT and not quiet:
        say(f"wrote {printable(file)}; plan it with: nutdamp plan {printable(file)}")


@click.command("schema")
@click.option(
    "-o", "--output", type=OUTPUT, default="-", help="Where to write it; default standard output."
)
def schema_command(output: str) -> None:
    """Print the JSON Schema of the spacecraft file, for editors that complete and check YAML."""
    from nutdamp.files.reader import json_schema
    from nutdamp.files.tabular import json_text, write_whole

    write_whole(output, json_text(json_schema()))


def _topics(_ctx: click.Context, _param: click.Parameter, begun: str) -> list[str]:
    from nutdamp.views.guide import completed

    return completed(begun)


# `-M1` may be a channel.
@click.command("explain", context_settings={"ignore_unknown_options": True})
@click.argument("topic", nargs=-1, metavar="[TOPIC] [SPACECRAFT]", shell_complete=_topics)
def explain_command(topic: tuple[str, ...]) -> None:
    """Explain a page of the guide, a scheme, an equation, a word of a screen, or a key of the
    spacecraft file.

    TOPIC is a page or a scheme; a number such as 17, K7 or 24.4, or `equations` for all; a word
    such as `tilt`, `H` or `on_time_s`; `file.thrusters`; a channel such as `+M2` of the file
    SPACECRAFT, else of spacecraft.yaml here or the built-in example; any other word of
    a screen. Without it the pages are listed. On a terminal long pages go through a pager.
    """
    from nutdamp.views import guide

    *words, last = topic or ("",)
    file = last if words and Path(last).is_file() else None
    requested = " ".join(words if file else topic).strip()
    shown = console()
    screen = (
        guide.topic_screen(guide.explained(requested, partial(_channel, file)))
        if requested
        else guide.topics_screen()
    )
    if shown.is_terminal and on_keyboard():
        with shown.capture() as captured:
            shown.print(screen)
        if captured.get().count("\n") >= shown.height:
            click.echo_via_pager(captured.get())
            return
    show(screen)


def _channel(file: str | None, name: str) -> Topic | None:
    """The channel of that ``name`` of a file, else of the default file, or of the built-in example
    where there is none without fault.
    """
    from nutdamp.api import example
    from nutdamp.views.check import channel_facts
    from nutdamp.views.guide import Topic, listed
    from nutdamp.views.parts import named

    try:
        spacecraft = FileInput(file).source(lambda _: None, lambda _: None).read()
    except NutdampError:
        if file is not None:
            raise
        spacecraft = example()
    rows = channel_facts(spacecraft, name)
    about = f"a channel of {named(spacecraft).plain}"
    return Topic(name, about, listed(rows)) if rows else None


def on_keyboard() -> bool:
    """True where someone can leave a pager."""
    return sys.stdin.isatty()


@click.command("export", cls=SessionCommand)
@spacecraft_argument
@click.option(
    "--format",
    "form",
    type=NameType(tuple(FORMATS)),
    required=True,
    help=f"{'; '.join(f'{row.name}: {row.summary}' for row in FORMATS.values())}.",
)
@click.option(
    "--xml",
    is_flag=True,
    help="CCSDS: XML instead of keyword = value; also where FILE ends in .xml.",
)
@flown_options("Export")
@goal_options
@click.option(
    "--until",
    type=END,
    help="Histories, spin-table: end; default last pulse + one inertial period, or last pulse.",
)
@click.option(
    "-o", "--output", type=OUTPUT, default="-", help="Where to write it; default standard output."
)
@quiet_option
def export_command(job: Job, form: str, xml: bool, until: float | None) -> None:
    """Write a schedule in a format that other tools read.

    The CCSDS messages and stk need attitude.epoch and attitude.frame in the spacecraft file; opm
    also mass, and orbit for its state. Vectors are in the axes of that file, those of opm in
    attitude.frame. A frame of the ecliptic or of date is turned into EME2000. IXY, IXZ and IYZ are
    products of inertia as in CCSDS 504.0-B-2: minus the entries of inertia.tensor.
    """
    from nutdamp.api import export
    from nutdamp.views.verdict import stated

    output = job.written["output"] or "-"
    notation = xml or (FORMATS[form].message and output.lower().endswith(".xml"))
    expect_possible(form, xml=notation, until=until)
    job.begin()
    plan = plan_or_read(job)
    export(plan, form, output, until=until, xml=notation)
    missing = lacking(plan, form)
    if missing is not None:
        job.doubt(missing)
    job.note(export_notes(plan, form))
    if output != "-":
        job.remark(f"wrote {printable(output)}: {plan.scheme}, {len(plan.pulses)} pulses")
    judged = plan.verdict
    if judged.status.exit_status:
        job.doubt(f"{plan.scheme}: {stated(judged)[0]}")
    leave(judged.status)


@click.command("import", cls=SessionCommand)
@click.argument("given", nargs=-1, required=True, type=FILE, metavar="[apm] FILE")
@click.option(
    "-o",
    "--output",
    type=OUTPUT,
    default="-",
    help="Spacecraft file to write; default standard output.",
)
@click.option("--into", type=FILE, help="Spacecraft file into which the message is merged.")
@click.option("--inertia", is_flag=True, help="Merge moments of inertia and mass too.")
@click.option(
    "--at",
    type=OF_RECORD,
    help="Take the next record of a history after so long, such as 12.5s; default 0s, the first.",
)
@click.option(
    "--schedule", type=OUTPUT, help="Write the manoeuvres as a schedule for `simulate --schedule`."
)
@quiet_option
def import_command(
    job: Job, given: tuple[str, ...], into: str | None, inertia: bool, at: float | None
) -> None:
    """Make a spacecraft file from an attitude message, or merge one into a file.

    It reads CCSDS messages of version 2 in KVN (APM, AEM, ACM) and attitude files of STK (.a). With
    --into, attitude, epoch and rates replace those of a spacecraft file; all else stays. Of a
    history the record of --at is used. Without --into the message needs inertia and the
    motion: angular velocity or spin. A message has no thrusters. If all its manoeuvres are
    transverse and of one torque, the file gets a steerable torquer of that torque. FILE may be -
    for standard input.
    """
    *form, file = given
    if form not in ([], ["apm"]):
        raise click.UsageError(f"expected one FILE, an attitude message; got {' '.join(given)}")
    output, schedule = job.written["output"], job.written["schedule"]
    expect_outputs(file, into, output=output, schedule=schedule)
    if into is None and (inertia or at is not None):
        raise click.UsageError(
            "--inertia and --at say what to merge: name the spacecraft file with --into"
        )
    if into is not None and schedule is not None:
        raise click.UsageError(
            "--schedule writes the manoeuvres of a message that makes a spacecraft file"
        )

    from nutdamp.files.ccsds.read import read_message
    from nutdamp.files.ccsds.write import contradictions, imported, merge
    from nutdamp.flight.propagation import flown
    from nutdamp.views.parts import pulse_table

    contents = read_message(file)
    if into is not None:
        source = FileInput(into).source(job.remark, job.doubt)
        text, remarks, doubts = merge(source, contents, at or 0.0, inertia=inertia)
        deliver([(output, lambda: text)])
    else:
        text, body, pulses = imported(contents, file)
        sheet = (schedule, lambda: pulse_table(flown(body, pulses)).csv())
        deliver([(output, lambda: text), sheet])
        remarks, doubts = contents.remarks, contradictions(contents, body, "this one")
        if pulses.pulses and schedule is None:
            remarks += (f"{len(pulses)} manoeuvres; --schedule FILE writes them",)
    for entry in remarks:
        job.remark(f"{file}: {entry}")
    job.note(doubts)


POINTS = 6  # horizons tried for each front where no number follows ``--trade``

CONTROL = (  # options of configuration control on a page, and their subjects
    ("title", "Title of the page."),
    ("document", "Number of the document."),
    ("issue", "Issue or revision."),
    ("author", "Author of the page."),
    ("date", "Date of issue, printed as given; default that of SOURCE_DATE_EPOCH."),
)

CONTROLLED = "Configuration control"  # their heading


def control_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options of `CONTROL`."""
    for name, what in reversed(CONTROL):
        command = click.option(
            f"--{name}", cls=Grouped, group=CONTROLLED, metavar="TEXT", help=what
        )(command)
    return command


@click.command("report", cls=SessionCommand)
@spacecraft_argument
@scheme_option(
    "names", multiple=True, type=NameType(PLANNED), help="Compare this one only; repeatable."
)
@click.option(
    "--schedule", type=FILE, help="Report the pulses of a CSV file, as `plan --csv` writes it."
)
@click.option("--blocks", type=FILE, help="Report what the command blocks of a CSV file fire.")
@click.option("--robust", is_flag=True, help="Compare the plan of `plan --robust` as well.")
@goal_options
@click.option(
    "-o",
    "--output",
    type=OUTPUT,
    default="report.html",
    show_default=True,
    help="HTML file to write, one page with its pictures inside; a browser prints it as PDF.",
)
@click.option(
    "--disperse",
    type=COUNT,
    is_flag=False,
    flag_value=SAMPLES,
    metavar="[N]",
    help=(
        f"Number of dispersed cases; {SAMPLES} where no number follows, "
        "and where something is required."
    ),
)
@click.option("--nominal", is_flag=True, help="Judge nominal values alone: fly no dispersed cases.")
@click.option(
    "--trade",
    type=click.IntRange(1, 1000),
    is_flag=False,
    flag_value=POINTS,
    metavar="[POINTS]",
    help=(
        "Show what an earlier end costs, as `nutdamp trade` does; "
        f"{POINTS} points where no number follows."
    ),
)
@control_options
@quiet_option
def report_command(
    job: Job,
    names: tuple[str, ...],
    robust: bool,
    disperse: int | None,
    nominal: bool,
    trade: int | None,
    **control: str | None,
) -> None:
    """Write a report: decision, motion, dispersion, schemes, verification, manoeuvre sheet, input.

    SPACECRAFT is a YAML file; without it spacecraft.yaml in this folder, else the built-in example.
    A FILE of - is standard output. Needs the extra plot.
    """
    from nutdamp.page.document import controlled
    from nutdamp.page.report import expect_html, made_of

    output = job.written["output"] or ""
    expect_html(output)
    job.flown = job.flown._replace(scheme=names[0] if names else None)
    read = job.flown.schedule or job.flown.blocks
    if job.flown.count(None) < 2 or (read and robust):
        raise click.UsageError(
            "a report is of the schemes compared, of --schedule, or of --blocks: name one of them"
        )
    spacecraft = job.begin()

    from nutdamp.page.report import repeated
    from nutdamp.planning.decision import compare_plans
    from nutdamp.spacecraft.tolerances import expect_dispersions

    identification = controlled(
        **{name: value for name, value in control.items() if value is not None}
    )
    if disperse is not None or robust:
        expect_dispersions(spacecraft.dispersions)
        if nominal:
            raise click.UsageError(
                "--disperse and --robust fly dispersed cases, which --nominal leaves out"
            )
    samples = 0 if nominal else disperse
    compared = (
        compare_plans((plan_or_read(job),), samples=samples)
        if read
        else compared_with(job, names, samples, robust=not robust)
    )
    if robust:
        compared = robust_of(job, compared).joined
    fronts = (
        ()
        if trade is None
        else fronts_of(job, trade, (0.0, math.inf), LEAST[0], nominal=nominal).fronts
    )
    with job.working("writing the page"):
        repeat = repeated(shlex.join(["nutdamp", *sys.argv[1:]]), job.source, job.aim.words)
        report = made_of(compared, repeat, identification, fronts)
    deliver([(output, lambda: report.content)])
    if not report.good:
        job.remark(report.summary)
    if output != "-":
        job.remark(f"wrote {printable(output)}")
    leave(compared.verdict.status, failed=show_failures(compared))
