"""``nutdamp report``: the plan as a page to hand on."""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Callable
from typing import Any

import click

from nutdamp.cli.flown import compared_with, fronts_of, plan_or_read, robust_of
from nutdamp.cli.job import Job, deliver, quiet_option, spacecraft_argument
from nutdamp.cli.main import leave
from nutdamp.cli.options import (
    FILE,
    OUTPUT,
    SAMPLES,
    Count,
    Grouped,
    SchemeName,
    SessionCommand,
    goal_options,
    is_number,
)
from nutdamp.cli.screen import show_failures
from nutdamp.errors import printable
from nutdamp.schemes.catalogue import LEAST, PLANNED

POINTS = 6
"""Horizons tried for each front where no number follows ``--trade``."""

COUNTS = {"--disperse": SAMPLES, "--trade": POINTS}
"""Options that may come without a number, and their values then."""


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


CONTROL = (
    ("title", "Title of the page."),
    ("document", "Number of the document."),
    ("issue", "Issue or revision."),
    ("author", "Author of the page."),
    ("date", "Date of issue, printed as given; default that of SOURCE_DATE_EPOCH."),
)
"""Options of configuration control on a page, and their subjects."""

CONTROLLED = "Configuration control"
"""Their heading."""


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
def command(
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
    from nutdamp.page.html import expect_html, made_of

    output = job.written["output"] or ""
    expect_html(output)
    job.flown = job.flown._replace(scheme=names[0] if names else None)
    read = job.flown.schedule or job.flown.blocks
    if job.flown.count(None) < 2 or (read and robust):
        raise click.UsageError("a report is of the schemes compared, of --schedule, or of --blocks: name one of them")
    body = job.begin()

    from nutdamp.page.content import repeated
    from nutdamp.planning.decision import compare_plans
    from nutdamp.spacecraft.requirements import expect_dispersions

    kept = controlled(**{name: value for name, value in control.items() if value is not None})
    if disperse is not None or robust:
        expect_dispersions(body)
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
