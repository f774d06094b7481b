"""What is said of schemes that have a bug."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from nutdamp.cli.screen import say

if TYPE_CHECKING:
    from nutdamp.comparison import Comparison

DEBUG = "nutdamp.debug"
"""Where the context of a command line keeps that ``--debug`` is given."""


def _debugging(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    ctx.meta[DEBUG] = value


debug_option = click.option(
    "--debug", is_flag=True, expose_value=False, callback=_debugging, help="Show the traceback of an internal error."
)


def show_failures(compared: Comparison) -> bool:
    """Say on standard error which schemes have a bug, with ``--debug`` the tracebacks too; whether there are any."""
    for plan in compared.failed:
        if click.get_current_context().meta.get(DEBUG):
            import traceback

            say("".join(traceback.format_exception(plan.failure)).rstrip("\n"))
        say(f"nutdamp: {plan.scheme}: {plan.refusal} (--debug shows the traceback)")
    return bool(compared.failed)
