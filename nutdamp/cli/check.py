"""``nutdamp check``: validate spacecraft files and show what follows from them."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from nutdamp.cli.boundary import BAD_INPUT, UNREADABLE
from nutdamp.cli.common import Input, load, quiet_option, remarks, set_option, show
from nutdamp.cli.parameters import FILE
from nutdamp.cli.places import expect_outputs

if TYPE_CHECKING:
    from nutdamp.files.settings import Setting


@click.command("check")
@click.argument("files", nargs=-1, type=FILE, metavar="[SPACECRAFT]...")
@set_option
@click.option("--json", type=FILE, help="Write derived quantities and faults.")
@quiet_option
def command(files: tuple[str, ...], settings: tuple[Setting, ...], json: str | None, quiet: bool) -> None:
    """Check spacecraft files: all faults of all files, derived quantities, channel torques, smallest steps."""
    from nutdamp.errors import CannotRead, FaultyFile

    silent = expect_outputs(*(Input(file) for file in files or (None,)), json=json)
    reports: list[dict[str, Any]] = []
    failures: set[int] = set()
    for name in files or (None,):
        try:
            spacecraft = load(Input(name, settings), remarks(quiet))
        except (FaultyFile, CannotRead) as wrong:
            from nutdamp.files.check_json import failed_json

            click.echo(str(wrong), err=True)
            failures.add(BAD_INPUT if isinstance(wrong, FaultyFile) else UNREADABLE)
            reports.append(failed_json(name, wrong))
            continue
        if json is not None:
            from nutdamp.files.check_json import checked_json

            reports.append(checked_json(name, spacecraft))
        if not silent:
            from nutdamp.report.check_tables import check_screen

            show(check_screen(spacecraft))
            if len(files) > 1:
                click.echo()
    if json is not None:
        from nutdamp.files.check_json import check_json
        from nutdamp.files.output import json_text, write_whole

        write_whole(json, json_text(check_json(reports)))
    if failures:
        sys.exit(max(failures))
