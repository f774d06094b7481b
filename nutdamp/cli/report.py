"""``nutdamp report``: the plan as a page to hand on."""

from __future__ import annotations

import shlex
import sys

import click

from nutdamp.cli.boundary import INFEASIBLE, REQUIREMENT_MISSED
from nutdamp.cli.common import quiet_option, remarks, scheme_options, source, spacecraft_argument, write_all
from nutdamp.cli.progress import progress
from nutdamp.schemes import CLASSIC, PLANNED, Options


@click.command("report")
@spacecraft_argument
@click.option("--scheme", "names", multiple=True, type=click.Choice(PLANNED), help="Compare this one only; repeatable.")
@scheme_options
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    default="report.html",
    show_default=True,
    help="What to write: .html (one page, pictures inside), .md (for pull requests, no pictures), .pdf (by a browser).",
)
@quiet_option
def command(
    spacecraft: str | None,
    names: tuple[str, ...],
    options: Options,
    output: str,
    quiet: bool,
) -> None:
    """Write a report: spacecraft, schemes compared, schedule, pictures, error budget, and how to repeat it.

    SPACECRAFT is a YAML file; without it spacecraft.yaml in this folder, else the built-in example. A FILE of - is
    standard output, as HTML. Pictures need the extra plot, a PDF needs Chromium, Chrome or Edge.
    """
    from nutdamp.report.page.formats import form_of

    form = form_of(output)
    remark = remarks(quiet)
    text, name = source(spacecraft, remark)

    from nutdamp.files.spacecraft_file import read_spacecraft
    from nutdamp.planning import compare
    from nutdamp.report.page.content import Repeat, report_page

    repeat = Repeat(shlex.join(["nutdamp", *sys.argv[1:]]), name, text)
    with progress("reporting", 3, quiet=quiet) as done:
        compared = compare(read_spacecraft(text, name), tuple(dict.fromkeys(names)) or CLASSIC, options)
        done(1)
        page = report_page(compared, repeat, pictured=form.pictured)
        done(2)
        content = form.write(page, output)
    write_all([(output, content)])
    if output != "-":
        remark(f"wrote {output}")
    if compared.recommended is None:
        sys.exit(INFEASIBLE)
    if compared.recommended.meets_requirement is False:
        sys.exit(REQUIREMENT_MISSED)
