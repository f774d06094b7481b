"""``nutdamp simulate`` and ``animate``: propagate a scheme or a schedule file, or film its motion."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

from nutdamp.cli.flown import FlownChoice, flown_options, plan_or_read
from nutdamp.cli.job import (
    FIGURES,
    FileInput,
    Output,
    begin,
    deliver,
    plot_options,
    progress,
    quiet_option,
    spacecraft_argument,
    verbose_option,
)
from nutdamp.cli.main import leave
from nutdamp.cli.options import FILE, Aim, EndTime, PlanningCommand, goal_options
from nutdamp.errors import printable
from nutdamp.schemes.catalogue import Options

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import RenderableType

    from nutdamp.flight.track import Track
    from nutdamp.planning.decision import Simulation


@click.command("animate", cls=PlanningCommand)
@spacecraft_argument
@flown_options("Show")
@goal_options
@click.option("-o", "--output", type=FILE, required=True, help="The film: .gif, or .mp4 where ffmpeg is installed.")
@click.option("--until", type=EndTime(), help="End of the motion; default soon after the last pulse.")
@click.option("--seconds", type=click.FloatRange(0.2, 600.0), help="Length of the film; default 6 s to 30 s.")
@click.option("--fps", type=click.IntRange(1, 50), default=20, show_default=True, help="Frames a second.")
@click.option(
    "--width", type=click.IntRange(320, 3840), default=800, show_default=True, help="Width in pixels; height 0.6 of it."
)
@quiet_option
def animate_command(
    spacecraft: FileInput,
    flown: FlownChoice,
    options: Options,
    aim: Aim,
    output: str,
    until: float | None,
    seconds: float | None,
    fps: int,
    width: int,
    quiet: bool,
) -> None:
    """Film the body cone rolling on the space cone through the pulses, flown with their real widths.

    SPACECRAFT is a YAML file; without it spacecraft.yaml in this folder, else the built-in example. A FILE of - is
    standard output, as GIF.
    """
    from nutdamp.figures import animation

    animation.film_format(output)
    job = begin(spacecraft, flown.file, aim=aim, quiet=quiet, output=output)
    body, remark = job.spacecraft, job.remark
    pulses = plan_or_read(job, flown, options).pulses

    from nutdamp.figures.geometry import shown_until
    from nutdamp.flight import propagation

    end = shown_until(body, pulses) if until is None else until
    timed = animation.timing(body, end, fps, seconds)
    if not timed.smooth:
        remark(
            f"only {timed.frames / timed.turns:.1f} frames show a nutation turn, which may seem to run backwards: "
            f"--seconds {timed.turns * animation.SMOOTH / fps:.0f} would show it, or an earlier --until"
        )
    flight = propagation.flown(body, pulses, end)
    with progress("filming", timed.frames, quiet=quiet) as step:
        deliver([(output, lambda: lambda stream: animation.film(stream, flight, timed, output, width, step))])
    if output != "-":
        remark(f"wrote {printable(output)}: {timed.frames} frames, {timed.pace:.3g} s of motion in a second")


PICTURED = 100_000
"""Largest number of rows of the track of a picture."""


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
@verbose_option
@quiet_option
def command(
    spacecraft: FileInput,
    flown: FlownChoice,
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
    verbose: bool,
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

    from nutdamp.figures.geometry import shown_until
    from nutdamp.files.tabular import write_track
    from nutdamp.planning.decision import Simulation
    from nutdamp.views.decisions import verdict
    from nutdamp.views.simulation import simulation_json
    from nutdamp.views.verdicts import model_warnings

    body, pulses = plan.spacecraft, plan.pulses
    simulation = Simulation(plan, pulses.end + body.inertial_period if until is None else until, real, samples)
    if job.silent:
        job.warn(model_warnings(simulation.impulses, simulation.flown))
    track = None
    if plot is not None or drawn:
        track = simulation.track(min(samples, PICTURED), shown_until(body, pulses) if until is None else until)
    outputs: list[Output] = [
        (csv, lambda: partial(write_track, simulation.pieces(), body.inertia)),
        (json, lambda: simulation_json(simulation, verdict(simulation.decision))),
        (plot, partial(_picture, simulation, track, figure)),
    ]
    job.deliver(outputs, partial(_screen, simulation, verbose), *[partial(_drawing, simulation, track)] * drawn)
    leave(missed=simulation.decision.met is False and len(simulation.flown.schedule) == len(pulses))


def _picture(simulation: Simulation, track: Track | None, figure: str) -> Figure:
    from nutdamp.figures import overview

    assert track is not None
    return overview.flight_figure(figure, simulation.shown, track)


def _screen(simulation: Simulation, verbose: bool) -> RenderableType:
    from nutdamp.views.simulation import simulation_screen

    return simulation_screen(simulation, verbose=verbose)


def _drawing(simulation: Simulation, track: Track | None) -> RenderableType:
    from nutdamp.figures.terminal import motion_drawing

    assert track is not None
    return motion_drawing(simulation.shown, track)
