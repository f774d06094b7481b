"""``nutdamp schema``: the JSON Schema of the spacecraft file."""

from __future__ import annotations

import click

from nutdamp.cli.parameters import FILE


@click.command("schema")
@click.option("-o", "--output", type=FILE, default="-", help="Where to write it; default standard output.")
def command(output: str) -> None:
    """Print the JSON Schema of the spacecraft file, for editors that complete and check YAML."""
    from nutdamp.files.output import json_text, write_whole
    from nutdamp.files.schema import json_schema

    write_whole(output, json_text(json_schema()))
