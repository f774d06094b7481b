"""``nutdamp check``: validate spacecraft files and show what follows from them."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from nutdamp.cli.boundary import BAD_INPUT, UNREADABLE, tell
from nutdamp.cli.common import DEFAULT_FILE, Input, parsed, quiet_option, set_option, source
from nutdamp.cli.job import deliver, remarks
from nutdamp.cli.parameters import FILE
from nutdamp.cli.places import expect_outputs
from nutdamp.cli.screen import show

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import RenderableType

    from nutdamp.errors import Fault
    from nutdamp.files.settings import Setting


@click.command("check")
@click.argument("files", nargs=-1, type=FILE, metavar="[SPACECRAFT]...")
@set_option
@click.option("--json", type=FILE, help="Write derived quantities and faults.")
@quiet_option
def command(files: tuple[str, ...], settings: tuple[Setting, ...], json: str | None, quiet: bool) -> None:
    """Check spacecraft files: all faults of all files, derived quantities, channel torques, smallest steps."""
    from nutdamp.errors import CannotRead, CannotWrite, FaultyFile

    silent = expect_outputs(*(Input(file) for file in files or (None,)), json=json)
    reports: list[dict[str, Any]] = []
    failures: set[int] = set()
    for name in files or (None,):
        doubts: list[Fault] = []
        try:
            report, screen = _looked_into(Input(name, settings), remarks(quiet), doubts)
        except (FaultyFile, CannotRead) as wrong:
            from nutdamp.files.check_json import failed_json

            tell(wrong)
            failures.add(BAD_INPUT if isinstance(wrong, FaultyFile) else UNREADABLE)
            reports.append(failed_json(name, wrong, doubts))
            continue
        reports.append(report)
        if not silent:
            show(screen)
            if len(files) > 1:
                click.echo()
    if json is not None:
        from nutdamp.files.check_json import check_json

        try:
            deliver([(json, lambda: check_json(reports))])
        except CannotWrite as wrong:
            tell(wrong)
            failures.add(UNREADABLE)
    if failures:
        sys.exit(max(failures))


def _looked_into(
    given: Input, remark: Callable[[str], None], doubts: list[Fault]
) -> tuple[dict[str, Any], RenderableType]:
    """What follows from a file, for JSON and for the screen; warnings are added to ``doubts``.

    Raises CannotRead, and FaultyFile also for what turns out to be wrong only when consequences are worked out.
    """
    from nutdamp.errors import Fault, FaultyFile, NutdampError
    from nutdamp.files.check_json import checked_json
    from nutdamp.presentation.check_tables import check_screen

    spacecraft = parsed(source(given.path, remark), given.settings, remark, doubts=doubts)
    try:
        return checked_json(given.path, spacecraft, doubts), check_screen(spacecraft)
    except NutdampError as wrong:
        raise FaultyFile([Fault(given.path or DEFAULT_FILE, 1, 1, "", str(wrong))]) from wrong
