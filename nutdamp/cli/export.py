"""``nutdamp export``: a plan in the formats that flight dynamics reads."""

from __future__ import annotations

import shlex
import sys

import click

from nutdamp.cli.boundary import REQUIREMENT_MISSED
from nutdamp.cli.common import (
    Flown,
    Input,
    deliver,
    expect_places,
    flown_options,
    load,
    plan_or_read,
    quiet_option,
    remarks,
    spacecraft_argument,
)
from nutdamp.cli.parameters import FILE, Named, Quantity
from nutdamp.cli.places import expect_outputs
from nutdamp.cli.scheme_options import Aim, PlanningCommand, goal_options
from nutdamp.files.exchange import FORMATS, MESSAGES, export_text, lacking
from nutdamp.schemes import PLANNED, Options


@click.command("export", cls=PlanningCommand, context_settings={"allow_extra_args": True})
@spacecraft_argument
@click.option(
    "--format",
    "form",
    type=Named(FORMATS),
    help="Required. apm: state and pulses (CCSDS); aem: attitude history (CCSDS) as quaternions, aem-spin: as spin, "
    "nutation and momentum; opm: velocity change of each pulse (CCSDS); stk: attitude history as .a; spin-table: CSV, "
    "one row a spin; basilisk: a script that flies the schedule; json: as `plan --json`.",
)
@click.option("--xml", is_flag=True, help="CCSDS: XML instead of keyword = value; also where FILE ends in .xml.")
@flown_options("Export")
@goal_options
@click.option(
    "--until",
    type=Quantity("time"),
    help="Histories, spin-table: end; default last pulse + one inertial period, or last pulse.",
)
@click.option("-o", "--output", type=FILE, default="-", help="Where to write it; default standard output.")
@quiet_option
@click.pass_context
def command(
    ctx: click.Context,
    spacecraft: Input,
    form: str | None,
    xml: bool,
    flown: Flown,
    options: Options,
    aim: Aim,
    until: float | None,
    output: str,
    quiet: bool,
) -> None:
    """Write a schedule in a format that other tools read.

    The CCSDS messages and stk need attitude.epoch and attitude.frame in the spacecraft file; opm also mass, and orbit
    for its state. Vectors are in the axes of that file, those of opm in attitude.frame.
    """
    from nutdamp.decision import Decision

    form = _format(form, spacecraft, ctx.args)
    if until is not None and until <= 0.0:
        raise click.BadParameter("expected a time after t = 0", param_hint="--until")
    expect_outputs(spacecraft, flown.schedule, output=output)
    remark = remarks(quiet)
    body = load(spacecraft, remark, aim)
    expect_places(output)
    plan = plan_or_read(body, flown, options, remark, quiet=quiet)
    notation = xml or (form in MESSAGES and output.lower().endswith(".xml"))
    deliver([(output, lambda: export_text(plan, form, xml=notation, until=until))])
    missing = lacking(plan, form)
    if missing is not None:
        remark(f"warning: {missing}")
    if output != "-":
        remark(f"wrote {output}: {plan.scheme}, {len(plan.pulses)} pulses")
    if Decision(plan).met is False and (flown.scheme is None or flown.scheme in PLANNED):
        remark(f"{plan.scheme} does not meet the requirement")
        sys.exit(REQUIREMENT_MISSED)


def _format(form: str | None, spacecraft: Input, more: list[str]) -> str:
    """The format named; a usage error that shows how to name it, also where it was given as if it were a file."""
    words = [word for word in (spacecraft.path, *more) if word is not None]
    meant = next((word.lower() for word in words if word.lower() in FORMATS), None)
    if more and (meant is None or form is not None):
        raise click.UsageError(f"got unexpected extra argument{'s' * (len(more) > 1)} ({' '.join(more)})")
    if form is not None:
        return form
    if meant is None:
        raise click.UsageError(f"name the format: --format {', '.join(FORMATS[:-1])} or {FORMATS[-1]}")
    named = [word for word in words if word.lower() != meant]
    raise click.UsageError(f"the format is an option: nutdamp export {shlex.join([*named, '--format', meant])}")
