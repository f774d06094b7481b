"""``nutdamp loop``: fire from what a sensor shows, in a closed loop."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

from nutdamp.cli.boundary import leave
from nutdamp.cli.common import Input, quiet_option, require_dispersions, require_loop, spacecraft_argument
from nutdamp.cli.job import Output, begin
from nutdamp.cli.parameters import FILE, Count, EndTime
from nutdamp.cli.screen import say

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.loop.plan import LoopPlan


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
@quiet_option
def command(
    spacecraft: Input,
    until: float | None,
    seed: int,
    case: int | None,
    samples: int,
    csv: str | None,
    track: str | None,
    json: str | None,
    plot: str | None,
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

    from nutdamp.cli.progress import working
    from nutdamp.files.loop_json import loop_json
    from nutdamp.files.pulses_csv import pulses_csv
    from nutdamp.files.track_csv import write_track
    from nutdamp.loop.plan import loop_of
    from nutdamp.presentation.loop_tables import loop_screen, stopped, warnings

    with working("flying", quiet=quiet):
        plan = loop_of(body, until, seed=seed, case=None if case is None else case - 1)
    run = plan.flown_run
    if job.silent:
        job.warn(warnings(body))
    outputs: list[Output] = [
        (csv, lambda: pulses_csv(run.flight)),
        (track, lambda: partial(write_track, run.flight.pieces(samples, run.until), run.flight.spacecraft.inertia)),
        (json, lambda: loop_json(plan)),
        (plot, partial(_picture, plan)),
    ]
    job.deliver(outputs, lambda: loop_screen(plan))
    if run.stop.fault:
        say(f"nutdamp: the loop was stopped {stopped(run)}")
    leave(infeasible=run.stop.fault, missed=plan.meets_requirement is False)


def _picture(plan: LoopPlan) -> Figure:
    from nutdamp.presentation.figures.loop import loop_figure

    return loop_figure(plan)
