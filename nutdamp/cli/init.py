"""``nutdamp init``: a commented spacecraft file to start from."""

from __future__ import annotations

import click

from nutdamp.cli.common import DEFAULT_FILE, quiet_option, remarks
from nutdamp.cli.parameters import FILE


@click.command("init")
@click.argument("file", type=FILE, default=DEFAULT_FILE, metavar="[FILE]")
@click.option("--force", is_flag=True, help="Replace a file that is already there.")
@quiet_option
def command(file: str, force: bool, quiet: bool) -> None:
    """Write a commented spacecraft file (default spacecraft.yaml); a FILE of - is standard output."""
    from pathlib import Path

    from nutdamp.errors import CannotWrite
    from nutdamp.files.output import STDOUT, write_whole
    from nutdamp.files.spacecraft_file import built_in_example_text

    if file != STDOUT and Path(file).exists() and not force:
        raise CannotWrite(file, "it is already there; --force replaces it")
    write_whole(file, built_in_example_text())
    if file != STDOUT:
        remarks(quiet)(f"wrote {file}; plan it with: nutdamp plan {file}")
