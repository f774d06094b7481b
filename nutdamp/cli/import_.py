"""``nutdamp import``: a spacecraft file from a message of flight dynamics."""

from __future__ import annotations

import click

from nutdamp.cli.common import quiet_option
from nutdamp.cli.job import deliver, remarks
from nutdamp.cli.parameters import FILE
from nutdamp.cli.places import expect_outputs
from nutdamp.cli.screen import say


@click.command("import")
@click.argument("given", nargs=-1, required=True, type=FILE, metavar="[apm] FILE")
@click.option("-o", "--output", type=FILE, default="-", help="Spacecraft file to write; default standard output.")
@click.option("--schedule", type=FILE, help="Write the manoeuvres as a schedule for `simulate --schedule`.")
@quiet_option
def command(given: tuple[str, ...], output: str, schedule: str | None, quiet: bool) -> None:
    """Make a spacecraft file from a CCSDS attitude parameter message (APM, version 2, in KVN).

    The message needs an inertia block and the motion: angular velocity or spin. It knows no thrusters; where all its
    manoeuvres are transverse and of one torque, the file gets a steerable torquer of that torque. FILE may be - for
    standard input.
    """
    *form, file = given
    if form not in ([], ["apm"]):
        raise click.UsageError(f"expected one FILE, an attitude parameter message; got {' '.join(given)}")
    expect_outputs(file, output=output, schedule=schedule)

    from nutdamp.files.apm_import import contradictions, imported
    from nutdamp.files.ccsds.apm_reader import read_apm
    from nutdamp.files.pulses_csv import pulses_csv
    from nutdamp.flight import flown

    contents = read_apm(file)
    text, body, pulses = imported(contents, file)
    deliver([(output, lambda: text), (schedule, lambda: pulses_csv(flown(body, pulses)))])
    remark = remarks(quiet)
    for entry in contents.remarks:
        remark(f"{file}: {entry}")
    for entry in contradictions(contents, body):
        say(f"{file}: warning: {entry}")
    if pulses.pulses and schedule is None:
        remark(f"{file}: {len(pulses)} manoeuvres; --schedule FILE writes them")
