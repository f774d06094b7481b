"""The options that choose how dispersed cases are flown: through real widths, or in closed form."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])


def impulse_options(command: Command) -> Command:
    """``--impulses`` and ``--force``, for what flies dispersed cases; `expect_impulses` checks them."""
    for option in (
        click.option("--force", is_flag=True, help="Use --impulses however much they err."),
        click.option(
            "--impulses",
            is_flag=True,
            help="Fly cases by the impulse sum (17): faster, and refused where that errs too much.",
        ),
    ):
        command = option(command)
    return command


def expect_impulses(impulses: bool, force: bool, flies: bool, option: str) -> None:
    """A usage error for ``--impulses`` where no dispersed cases are flown, which ``option`` needs."""
    if force and not impulses:
        raise click.UsageError("--force is for --impulses")
    if impulses and not flies:
        raise click.UsageError(f"--impulses says how dispersed cases are flown: it is for {option}")
