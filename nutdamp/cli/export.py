"""``nutdamp export`` and ``import``: plans and spacecraft files in the formats of flight dynamics."""

from __future__ import annotations

import shlex

import click

from nutdamp.cli.flown import flown_options, plan_or_read
from nutdamp.cli.job import FileInput, Job, deliver, expect_outputs, quiet_option, spacecraft_argument
from nutdamp.cli.main import leave
from nutdamp.cli.options import END, FILE, OUTPUT, NameType, SessionCommand, goal_options
from nutdamp.cli.screen import say
from nutdamp.errors import BadRequest, printable
from nutdamp.views.exchange import FORMATS, expect_possible, export_notes, lacking


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
def command(ctx: click.Context, job: Job, form: str | None, xml: bool, until: float | None) -> None:
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

    from nutdamp.files.ccsds.history import is_history, read_history
    from nutdamp.files.ccsds.read import contradictions, imported, read_apm
    from nutdamp.flight.propagation import flown
    from nutdamp.views.pulses import pulse_table

    if into is not None:
        if schedule is not None:
            raise click.UsageError("--schedule writes the manoeuvres of a message that makes a spacecraft file")
        from nutdamp.files.ccsds.merge import merged_text, motion_of

        message = read_history(file) if is_history(file) else read_apm(file)
        for entry in message.remarks:
            job.remark(f"{file}: {entry}")
        merged = merged_text(FileInput(into).source(job.remark), motion_of(message, at or 0.0), inertia=inertia)
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
