"""``nutdamp simulate``: propagate a scheme or a schedule file."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

from nutdamp.cli.boundary import leave
from nutdamp.cli.common import FIGURES, Input, plot_options, quiet_option, spacecraft_argument
from nutdamp.cli.flown import Flown, flown_options, plan_or_read
from nutdamp.cli.job import Output, begin
from nutdamp.cli.parameters import FILE, EndTime
from nutdamp.cli.scheme_options import Aim, PlanningCommand, goal_options
from nutdamp.schemes import Options

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import RenderableType

    from nutdamp.simulation import Simulation
    from nutdamp.track import Track


PICTURED = 100_000
"""Rows of the track of a picture at most."""


@click.command("simulate", cls=PlanningCommand)
@spacecraft_argument
@flown_options(
    "Propagate", "Plan this scheme with default options and propagate it, not the recommended one; none is free motion."
)
@goal_options
@click.option("--flown", "real", is_flag=True, help="Propagate real pulse widths instead of the impulse sum (17).")
@click.option(
    "--until",
    type=EndTime(),
    help="End, of which the outcome is shown; default last pulse + one inertial period.",
)
@click.option(
    "--samples", type=click.IntRange(2, 10_000_000), default=1000, show_default=True, help="Rows of the track."
)
@click.option("--csv", type=FILE, help="Write the track.")
@click.option("--json", type=FILE, help="Write pulses, how both models end, and extremes.")
@plot_options(FIGURES)
@click.option("--show", "drawn", is_flag=True, help="Draw pole curve and axis track in the terminal.")
@quiet_option
def command(
    spacecraft: Input,
    flown: Flown,
    options: Options,
    aim: Aim,
    real: bool,
    until: float | None,
    samples: int,
    csv: str | None,
    json: str | None,
    plot: str | None,
    figure: str,
    drawn: bool,
    quiet: bool,
) -> None:
    """Propagate a schedule; show cone angles around each pulse, how it ends by both models, and the axis track.

    Exit status 4 where all pulses are fired, and with real widths the end does not meet the requirement, or the axis
    breaks a cone of keep; so for free motion too. SPACECRAFT is a YAML file, or - for standard
    input; without it spacecraft.yaml in this folder, else the built-in example. A FILE of - is standard output, for
    --schedule standard input.
    """
    if drawn and "-" in (csv, json, plot):
        raise click.UsageError("--show draws on standard output, where a FILE of - already goes")
    job = begin(spacecraft, flown.file, aim=aim, quiet=quiet, figure=figure, csv=csv, json=json, plot=plot)
    plan = plan_or_read(job, flown, options, jitter=True, judged=not job.silent)

    from nutdamp.files.simulation_json import simulation_json
    from nutdamp.files.track_csv import write_track
    from nutdamp.presentation.decisions import verdict
    from nutdamp.presentation.geometry import shown_until
    from nutdamp.presentation.verdicts import model_warnings
    from nutdamp.simulation import Simulation

    body, pulses = plan.spacecraft, plan.pulses
    made = Simulation(plan, pulses.end + body.inertial_period if until is None else until, real, samples)
    if job.silent:
        job.warn(model_warnings(made.impulses, made.flown))
    track = None
    if plot is not None or drawn:
        track = made.track(min(samples, PICTURED), shown_until(body, pulses) if until is None else until)
    outputs: list[Output] = [
        (csv, lambda: partial(write_track, made.pieces(), body.inertia)),
        (json, lambda: simulation_json(made, verdict(made.decision))),
        (plot, partial(_picture, made, track, figure)),
    ]
    job.deliver(outputs, partial(_screen, made), *[partial(_drawing, made, track)] * drawn)
    leave(missed=made.decision.met is False and len(made.flown.schedule) == len(pulses))


def _picture(made: Simulation, track: Track | None, figure: str) -> Figure:
    from nutdamp.presentation import figures

    assert track is not None
    return figures.flight_figure(figure, made.shown, track)


def _screen(made: Simulation) -> RenderableType:
    from nutdamp.presentation.simulate_tables import simulation_screen

    return simulation_screen(made)


def _drawing(made: Simulation, track: Track | None) -> RenderableType:
    from nutdamp.presentation.terminal import motion_drawing

    assert track is not None
    return motion_drawing(made.shown, track)
