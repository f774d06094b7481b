"""``nutdamp explain``: the guide."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem

from nutdamp.cli.screen import show

if TYPE_CHECKING:
    from nutdamp.guide.topic import Topic


def _completed(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG001
    from nutdamp.guide import SUMMARIES

    topics = [topic for _, group in SUMMARIES for topic in group]
    return [CompletionItem(name, help=text) for name, text in topics if name.startswith(incomplete)]


@click.command("explain")
@click.argument("topic", nargs=-1, metavar="[TOPIC]", shell_complete=_completed)
def command(topic: tuple[str, ...]) -> None:
    """Explain a scheme, an equation of the sources, the motion, or the keys of the spacecraft file.

    TOPIC is a scheme; a number such as 17, K7 or 24.4, or `equations` for all; `nutation`, `dissipation`, `figures`;
    `file`, `file.thrusters`, `units`. Without it the topics are listed.
    """
    from nutdamp.presentation import explain_tables

    requested = " ".join(topic)
    if not requested.strip():
        show(explain_tables.topics_screen())
    elif requested.strip().casefold() == "equations":
        show(explain_tables.equations_screen())
    else:
        show(explain_tables.topic_screen(_topic(requested.strip())))


def _topic(requested: str) -> Topic:
    """The topic of that name; those on the spacecraft file are made from its models, which take longer to load."""
    from nutdamp import guide

    name, _, below = requested.partition(".")
    if name.casefold() == guide.FILE:
        from nutdamp.files.file_guide import file_topic

        return file_topic(below)
    return guide.found(requested)
