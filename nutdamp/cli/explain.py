"""``nutdamp explain``: what stands behind the numbers."""

from __future__ import annotations

import click

from nutdamp.cli.common import show


@click.command("explain")
@click.argument("topic", type=click.Choice(["equations"]), default="equations")
def command(topic: str) -> None:  # noqa: ARG001 - one topic as yet
    """Show where each numbered equation of the sources stands in the code, and which test checks it."""
    from nutdamp.report.explain_tables import equations_screen

    show(equations_screen())
