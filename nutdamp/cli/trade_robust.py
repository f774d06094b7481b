"""``nutdamp trade --robust``: what it costs that more cases comply."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

from nutdamp.cli.boundary import leave
from nutdamp.cli.common import require_dispersions
from nutdamp.cli.flown import compared_with
from nutdamp.cli.job import Job, Output
from nutdamp.errors import BadRequest
from nutdamp.schemes.options import Options

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import RenderableType

    from nutdamp.robust import RobustComparison


def trade_robust(
    job: Job, points: int, options: Options, *, csv: str | None, json: str | None, plot: str | None
) -> None:
    """Show the front of cost against the share that complies, and write it."""
    from nutdamp import compliance, robust
    from nutdamp.cli.progress import progress
    from nutdamp.files.robust_json import front_csv, front_json

    require_dispersions(job.spacecraft)
    if not compliance.required(job.spacecraft):
        raise BadRequest("the spacecraft has no requirement that cases could comply with")
    compared = compared_with(job, (), options)
    trials = robust.trials_of_front(compared, points)
    with progress("dispersing", len(trials), quiet=job.quiet) as advance:
        found = robust.compare(compared, trials, advance, whole=True)
    outputs: list[Output] = [
        (csv, partial(front_csv, found)),
        (json, partial(front_json, found)),
        (plot, partial(_picture, found)),
    ]
    job.deliver(outputs, partial(_screen, found))
    leave(infeasible=not found.candidates)


def expect_alone(robust: bool, **others: object) -> None:
    """A usage error for options of the fronts against time, where ``robust`` is asked for."""
    for option, value in others.items():
        if robust and value:
            raise click.UsageError(f"--{option} is of the front against time; leave it out with --robust")


def _picture(found: RobustComparison) -> Figure:
    from nutdamp.presentation import figures

    return figures.front_figure(found)


def _screen(found: RobustComparison) -> RenderableType:
    from nutdamp.presentation.robust_tables import front_screen

    return front_screen(found)
