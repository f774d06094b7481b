"""``nutdamp export``, ``import`` and ``report``: schedules and files for other tools, and the report."""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Callable
from typing import Any

import click

from nutdamp.cli.job import FileInput, Job, SessionCommand, deliver, expect_outputs, quiet_option, spacecraft_argument
from nutdamp.cli.main import leave
from nutdamp.cli.options import (
    END,
    FILE,
    OUTPUT,
    SAMPLES,
    Count,
    Grouped,
    NameType,
    SchemeName,
    goal_options,
    is_number,
)
from nutdamp.cli.plan import compared_with, flown_options, fronts_of, plan_or_read, robust_of
from nutdamp.cli.screen import say, show_failures
from nutdamp.errors import BadRequest, printable
from nutdamp.schemes.catalogue import LEAST, PLANNED
from nutdamp.views.simulation import FORMATS, expect_possible, export_notes, lacking


@click.command("export", cls=SessionCommand, context_settings={"allow_extra_args": True})
@spacecraft_argument
@click.option(
    "--format",
    "form",
    type=NameType(tuple(FORMATS)),
    help=f"Required. {'; '.join(f'{row.name}: {row.summary}' for row in FORMATS.values())}.",
)
@click.option("--xml", is_flag=True, help="CCSDS: XML instead of keyword = value; also where FILE ends in .xml.")
@flown_options("Export")
@goal_options
@click.option(
    "--until",
    type=END,
    help="Histories, spin-table: end; default last pulse + one inertial period, or last pulse.",
)
@click.option("-o", "--output", type=OUTPUT, default="-", help="Where to write it; default standard output.")
@quiet_option
@click.pass_context
def export_command(ctx: click.Context, job: Job, form: str | None, xml: bool, until: float | None) -> None:
    """Write a schedule in a format that other tools read.

    The CCSDS messages and stk need attitude.epoch and attitude.frame in the spacecraft file; opm also mass, and orbit
    for its state. Vectors are in the axes of that file, those of opm in attitude.frame.
    """
    from nutdamp.api import export
    from nutdamp.planning.decision import compare_plans, decide
    from nutdamp.views.decisions import verdict

    form, output = _format(form, job.given, ctx.args), job.written["output"] or "-"
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
    decided = decide(compare_plans((plan,)))
    if decided is not None and decided.met is False:
        job.remark(f"{plan.scheme} does not meet the requirement: {verdict(decided)}")
        leave(missed=True)


def _format(form: str | None, spacecraft: FileInput, more: list[str]) -> str:
    """The format named; a usage error that shows how to name it, also where it was given as if it were a file."""
    words = [word for word in (spacecraft.path, *more) if word is not None]
    meant = next((word.lower() for word in words if word.lower() in FORMATS), None)
    if more and (meant is None or form is not None):
        raise click.UsageError(f"got unexpected extra argument{'s' * (len(more) > 1)} ({' '.join(more)})")
    if form is not None:
        return form
    if meant is None:
        raise click.UsageError(f"name the format: --format {', '.join([*FORMATS][:-1])} or {[*FORMATS][-1]}")
    named = [word for word in words if word.lower() != meant]
    raise click.UsageError(f"the format is an option: nutdamp export {shlex.join([*named, '--format', meant])}")


@click.command("import", cls=SessionCommand)
@click.argument("given", nargs=-1, required=True, type=FILE, metavar="[apm] FILE")
@click.option("-o", "--output", type=OUTPUT, default="-", help="Spacecraft file to write; default standard output.")
@click.option("--into", type=FILE, help="Spacecraft file into which the message is merged.")
@click.option("--inertia", is_flag=True, help="Merge the moments of inertia too.")
@click.option("--at", type=END, help="Record of an AEM, after its first; default the first.")
@click.option("--schedule", type=OUTPUT, help="Write the manoeuvres as a schedule for `simulate --schedule`.")
@quiet_option
def import_command(job: Job, given: tuple[str, ...], into: str | None, inertia: bool, at: float | None) -> None:
    """Make a spacecraft file from a CCSDS attitude parameter message (APM, version 2, KVN), or merge one into a file.

    With --into the attitude, epoch and rates of an APM, or of a record of an attitude history (AEM), replace those of a
    spacecraft file; all else stays. Without it the message needs an inertia block and the motion: angular velocity or
    spin. It knows no thrusters; where all its manoeuvres are transverse and of one torque, the file gets a steerable
    torquer of that torque. FILE may be - for standard input.
    """
    *form, file = given
    if form not in ([], ["apm"]):
        raise click.UsageError(f"expected one FILE, an attitude parameter message; got {' '.join(given)}")
    output, schedule = job.written["output"], job.written["schedule"]
    expect_outputs(file, into, output=output, schedule=schedule)
    if into is None and (inertia or at is not None):
        raise click.UsageError("--inertia and --at say what to merge: name the spacecraft file with --into")

    from nutdamp.files.ccsds.read import contradictions, imported, merged_text, read_apm
    from nutdamp.files.telemetry import is_history, read_history
    from nutdamp.flight.propagation import flown
    from nutdamp.views.pulses import pulse_table

    if into is not None:
        if schedule is not None:
            raise click.UsageError("--schedule writes the manoeuvres of a message that makes a spacecraft file")
        message = read_history(file) if is_history(file) else read_apm(file)
        for entry in message.remarks:
            job.remark(f"{file}: {entry}")
        merged = merged_text(FileInput(into).source(job.remark), message, at or 0.0, inertia=inertia)
        deliver([(output, lambda: merged)])
        return
    if is_history(file):
        raise BadRequest(f"{file}: an attitude history has no inertia; --into merges it into a spacecraft file")
    contents = read_apm(file)
    text, body, pulses = imported(contents, file)
    deliver([(output, lambda: text), (schedule, lambda: pulse_table(flown(body, pulses)).csv())])
    for entry in contents.remarks:
        job.remark(f"{file}: {entry}")
    for entry in contradictions(contents, body):
        say(f"{file}: warning: {entry}")
    if pulses.pulses and schedule is None:
        job.remark(f"{file}: {len(pulses)} manoeuvres; --schedule FILE writes them")


POINTS = 6  # horizons tried for each front where no number follows ``--trade``
COUNTS = {"--disperse": SAMPLES, "--trade": POINTS}  # options that may come without a number, and their values then


class ReportCommand(SessionCommand):
    """``report``, in which the options of `COUNTS` may come without a number."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put in a number where none follows: any other word is a file or an option."""
        given: list[str] = []
        for index, word in enumerate(args):
            given.append(word)
            following = args[index + 1 : index + 2]
            if word in COUNTS and "--" not in given and not (following and is_number(following[0])):
                given[-1] = f"{word}={COUNTS[word]}"
        return super().parse_args(ctx, given)


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
        command = click.option(f"--{name}", cls=Grouped, group=CONTROLLED, metavar="TEXT", help=what)(command)
    return command


@click.command("report", cls=ReportCommand)
@spacecraft_argument
@click.option("--scheme", "names", multiple=True, type=SchemeName(PLANNED), help="Compare this one only; repeatable.")
@click.option("--schedule", type=FILE, help="Report the pulses of a CSV file, as `plan --csv` writes it.")
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
    type=Count(),
    metavar="[N]",
    help=f"Number of dispersed cases; {SAMPLES} where no number follows, and where something is required.",
)
@click.option("--nominal", is_flag=True, help="Judge nominal values alone: fly no dispersed cases.")
@click.option(
    "--trade",
    type=click.IntRange(1, 1000),
    metavar="[POINTS]",
    help=f"Show what an earlier end costs, as `nutdamp trade` does; {POINTS} points where no number follows.",
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

    SPACECRAFT is a YAML file; without it spacecraft.yaml in this folder, else the built-in example. A FILE of - is
    standard output. Needs the extra plot.
    """
    from nutdamp.page.document import controlled
    from nutdamp.page.report import expect_html, made_of

    output = job.written["output"] or ""
    expect_html(output)
    job.flown = job.flown._replace(scheme=names[0] if names else None)
    read = job.flown.schedule or job.flown.blocks
    if job.flown.count(None) < 2 or (read and robust):
        raise click.UsageError("a report is of the schemes compared, of --schedule, or of --blocks: name one of them")
    body = job.begin()

    from nutdamp.page.report import repeated
    from nutdamp.planning.decision import compare_plans
    from nutdamp.spacecraft.tolerances import expect_dispersions

    kept = controlled(**{name: value for name, value in control.items() if value is not None})
    if disperse is not None or robust:
        expect_dispersions(body.dispersions)
        if nominal:
            raise click.UsageError("--disperse and --robust fly dispersed cases, which --nominal leaves out")
    samples = 0 if nominal else disperse
    compared = compare_plans((plan_or_read(job),), samples=samples) if read else compared_with(job, names, samples)
    if robust:
        compared = robust_of(job, compared).joined
    fronts = () if trade is None else fronts_of(job, trade, (0.0, math.inf), LEAST[0]).fronts
    with job.working("writing the page"):
        report = made_of(compared, repeated(shlex.join(["nutdamp", *sys.argv[1:]]), job.source), kept, fronts)
    deliver([(output, lambda: report.content)])
    if not report.good:
        job.remark(report.verdict)
    if output != "-":
        job.remark(f"wrote {printable(output)}")
    leave(failed=show_failures(compared), infeasible=compared.recommended is None, missed=report.met is False)
