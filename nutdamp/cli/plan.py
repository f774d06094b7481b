"""``nutdamp plan``: plan the schemes, compare them, recommend one."""

from __future__ import annotations

import sys

import click

from nutdamp.cli.boundary import INFEASIBLE, REQUIREMENT_MISSED
from nutdamp.cli.common import (
    Aim,
    load,
    one_stdout,
    quiet_option,
    remarks,
    scheme_options,
    show,
    spacecraft_argument,
    write_all,
)
from nutdamp.schemes import PLANNED, Options


@click.command("plan")
@spacecraft_argument
@click.option("--scheme", "names", multiple=True, type=click.Choice(PLANNED), help="Plan this one only; repeatable.")
@scheme_options
@click.option("--csv", metavar="FILE", help="Write the pulses of the recommended plan, or the one named.")
@click.option("--json", metavar="FILE", help="Write all plans with their residuals.")
@quiet_option
def command(
    spacecraft: str | None,
    names: tuple[str, ...],
    options: Options,
    aim: Aim,
    csv: str | None,
    json: str | None,
    quiet: bool,
) -> None:
    """Plan pulse schedules that damp the nutation, and compare them.

    SPACECRAFT is a YAML file; without it spacecraft.yaml in this folder, else the built-in example. A FILE of - is
    standard output.
    """
    if options.on_time is not None and options.on_time <= 0.0:
        raise click.BadParameter("a time above zero is wanted", param_hint="--on-time")
    names = tuple(dict.fromkeys(names))
    if csv is not None and len(names) > 1:
        raise click.UsageError("--csv writes one schedule: name one --scheme, or none for the recommended one")
    silent = one_stdout(csv=csv, json=json)
    remark = remarks(quiet)
    body = load(spacecraft, remark, aim)

    from nutdamp.planning import compare, usual

    compared = compare(body, names or usual(body), options)
    chosen = compared.recommended
    outputs: list[tuple[str, str | bytes]] = []
    if json is not None:
        from nutdamp.files.output import json_text
        from nutdamp.files.plan_json import comparison_json

        outputs.append((json, json_text(comparison_json(compared))))
    if csv is not None and chosen is not None:
        from nutdamp.files.pulses_csv import pulses_csv

        outputs.append((csv, pulses_csv(chosen.flight)))
    elif csv is not None:
        click.echo(f"{csv} was not written: no plan is feasible", err=True)
    write_all(outputs)
    if not silent:
        from nutdamp.report.plan_tables import comparison_screen

        show(comparison_screen(compared))
    if chosen is None:
        sys.exit(INFEASIBLE)
    if chosen.meets_requirement is False:
        sys.exit(REQUIREMENT_MISSED)
