"""``nutdamp loop`` and ``budget``: the closed loop of the file, and its cost against energy dissipation."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import click

from nutdamp.cli.job import (
    FileInput,
    Output,
    begin,
    quiet_option,
    require_dispersions,
    require_loop,
    spacecraft_argument,
    verbose_option,
)
from nutdamp.cli.main import leave
from nutdamp.cli.options import FILE, Angles, Count, Direction, EndTime, UnitType
from nutdamp.cli.screen import say

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.control_loop.budget import HoldingBudget
    from nutdamp.control_loop.evaluation import LoopPlan


@click.command("loop")
@spacecraft_argument
@click.option("--until", type=EndTime(), help="End; default: the horizon after the nutation is at start.")
@click.option(
    "--seed", type=click.IntRange(0, 2**64 - 1), default=1, show_default=True, help="Of the noise of the sensor."
)
@click.option("--case", type=Count(), help="Fly this dispersed case, as `disperse --loop` does with that seed.")
@click.option(
    "--samples", type=click.IntRange(2, 10_000_000), default=1000, show_default=True, help="Rows of the track."
)
@click.option("--csv", type=FILE, help="Write the pulses, as `plan --csv` does.")
@click.option("--track", type=FILE, help="Write the track, as `simulate --csv` does.")
@click.option("--json", type=FILE, help="Write firings, dead band, margins.")
@click.option("--plot", type=FILE, help="Draw signal, nutation and firings (.png, .svg, .pdf; needs extra plot).")
@verbose_option
@quiet_option
def command(
    spacecraft: FileInput,
    until: float | None,
    seed: int,
    case: int | None,
    samples: int,
    csv: str | None,
    track: str | None,
    json: str | None,
    plot: str | None,
    verbose: bool,
    quiet: bool,
) -> None:
    """Fly the closed loop of the file: fire from what its gyro or accelerometer shows, and see where it ends.

    A channel wired backwards, a reversed sensor and firings that come too late are found and named by the first
    firings that can be judged: exit status 3. SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    job = begin(spacecraft, quiet=quiet, csv=csv, track=track, json=json, plot=plot)
    body = job.spacecraft
    require_loop(body)
    if case is not None:
        require_dispersions(body)

    from nutdamp.cli.job import working
    from nutdamp.control_loop.evaluation import loop_of
    from nutdamp.files.tabular import write_track
    from nutdamp.views.loop import loop_json, loop_screen, stopped, warnings
    from nutdamp.views.pulses import pulse_table

    with working("flying", quiet=quiet):
        plan = loop_of(body, until, seed=seed, case=None if case is None else case - 1)
    run = plan.flown_run
    if job.silent:
        job.warn(warnings(body))
    outputs: list[Output] = [
        (csv, lambda: pulse_table(run.flight).csv()),
        (track, lambda: partial(write_track, run.flight.pieces(samples, run.until), run.flight.spacecraft.inertia)),
        (json, lambda: loop_json(plan)),
        (plot, partial(_picture, plan)),
    ]
    job.deliver(outputs, lambda: loop_screen(plan, verbose=verbose))
    if run.stop.fault:
        say(f"nutdamp: the loop was stopped {stopped(run)}")
    leave(infeasible=run.stop.fault, missed=plan.meets_requirement is False)


def _picture(plan: LoopPlan) -> Figure:
    from nutdamp.figures.loop import loop_figure

    return loop_figure(plan)


@click.command("budget")
@spacecraft_argument
@click.option(
    "--thresholds",
    type=Direction(),
    multiple=True,
    metavar="START,STOP",
    help="Fire from START to STOP, such as 0.5deg,0.1deg; repeatable. Default: start and stop of loop.",
)
@click.option("--largest", type=UnitType("angle"), help="By which damping must begin; default: requirement.nutation.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of the noise of the sensor.")
@click.option("--csv", type=FILE, help="Write a row for each two thresholds.")
@click.option("--json", type=FILE, help="Write the same, and how the nutation grows.")
@click.option("--plot", type=FILE, help="Draw it (.png, .svg, .pdf; needs extra plot).")
@verbose_option
@quiet_option
def budget_command(
    spacecraft: FileInput,
    thresholds: tuple[Angles, ...],
    largest: float | None,
    seed: int,
    csv: str | None,
    json: str | None,
    plot: str | None,
    verbose: bool,
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

    from nutdamp.api import budget
    from nutdamp.cli.job import progress
    from nutdamp.views.budget import budget_csv, budget_screen

    with progress("following cycles", max(len(thresholds), 1), quiet=quiet) as step:
        result = budget(job.spacecraft, thresholds, largest=largest, seed=seed, progress=step)
    core = result.core
    outputs: list[Output] = [
        (csv, lambda: budget_csv(core)),
        (json, result.to_dict),
        (plot, partial(_budget_picture, core)),
    ]
    job.deliver(outputs, lambda: budget_screen(core, verbose=verbose))
    leave(infeasible=not core.feasible, missed=core.meets_requirement is False)


def _budget_picture(core: HoldingBudget) -> Figure:
    from nutdamp.figures.budget import budget_figure

    return budget_figure(core)
