"""``nutdamp budget``: what it takes to hold the nutation against energy dissipation."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import click

from nutdamp.cli.boundary import leave
from nutdamp.cli.common import Input, quiet_option, require_loop, spacecraft_argument
from nutdamp.cli.job import Output, begin
from nutdamp.cli.parameters import FILE, Angles, Direction, Quantity

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.loop.budget import Budget


@click.command("budget")
@spacecraft_argument
@click.option(
    "--thresholds",
    type=Direction(),
    multiple=True,
    metavar="START,STOP",
    help="Fire from START to STOP, such as 0.5deg,0.1deg; repeatable. Default: start and stop of loop.",
)
@click.option("--largest", type=Quantity("angle"), help="By which damping must begin; default: requirement.nutation.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of the noise of the sensor.")
@click.option("--csv", type=FILE, help="Write a row for each two thresholds.")
@click.option("--json", type=FILE, help="Write the same, and how the nutation grows.")
@click.option("--plot", type=FILE, help="Draw it (.png, .svg, .pdf; needs extra plot).")
@quiet_option
def command(
    spacecraft: Input,
    thresholds: tuple[Angles, ...],
    largest: float | None,
    seed: int,
    csv: str | None,
    json: str | None,
    plot: str | None,
    quiet: bool,
) -> None:
    """Budget a mission: pulses a day and propellant a year that hold the nutation against energy dissipation.

    The limit cycle of the loop in the file, from event to event in closed form; and how long until damping must begin.
    A body whose nutation decays needs none. SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    for pair in thresholds:
        if not 0.0 <= pair.second < pair.first < 0.5 * math.pi:
            raise click.BadParameter(
                "expected START above STOP, both below 90 deg, such as 0.5deg,0.1deg", param_hint="--thresholds"
            )
    if largest is not None and not 0.0 < largest < 0.5 * math.pi:
        raise click.BadParameter("expected an angle between 0 and 90 deg", param_hint="--largest")
    job = begin(spacecraft, quiet=quiet, csv=csv, json=json, plot=plot)
    if thresholds:
        require_loop(job.spacecraft)
    for reading in (text for pair in thresholds for text in pair.readings):
        job.remark(f"--thresholds: warning: {reading}")

    from nutdamp.cli.progress import progress
    from nutdamp.files.budget_files import budget_csv
    from nutdamp.library.studies import budget
    from nutdamp.presentation.budget_tables import budget_screen

    with progress("following cycles", max(len(thresholds), 1), quiet=quiet) as step:
        made = budget(job.spacecraft, thresholds, largest=largest, seed=seed, progress=step)
    found = made.core
    outputs: list[Output] = [(csv, lambda: budget_csv(found)), (json, made.to_dict), (plot, partial(_picture, found))]
    job.deliver(outputs, lambda: budget_screen(found))
    leave(infeasible=not found.feasible, missed=found.meets_requirement is False)


def _picture(found: Budget) -> Figure:
    from nutdamp.presentation.figures.budget import budget_figure

    return budget_figure(found)
