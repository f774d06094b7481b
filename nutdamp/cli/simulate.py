"""``nutdamp simulate`` and ``animate``: propagate a scheme or a schedule file, or film its motion."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import click

from nutdamp.cli.flown import flown_options, plan_or_read
from nutdamp.cli.job import (
    FIGURES,
    Job,
    SessionCommand,
    carry_options,
    deliver,
    plot_options,
    quiet_option,
    screen_options,
    spacecraft_argument,
)
from nutdamp.cli.main import leave
from nutdamp.cli.options import END, OUTPUT, goal_options
from nutdamp.errors import printable

if TYPE_CHECKING:
    from rich.console import RenderableType


@click.command("animate", cls=SessionCommand)
@spacecraft_argument
@flown_options("Show")
@goal_options
@click.option("-o", "--output", type=OUTPUT, required=True, help="The film: .gif, or .mp4 where ffmpeg is installed.")
@click.option("--until", type=END, help="End of the motion; default soon after the last pulse.")
@click.option("--seconds", type=click.FloatRange(0.2, 600.0), help="Length of the film; default 6 s to 30 s.")
@click.option("--fps", type=click.IntRange(1, 50), default=20, show_default=True, help="Frames a second.")
@click.option(
    "--width", type=click.IntRange(320, 3840), default=800, show_default=True, help="Width in pixels; height 0.6 of it."
)
@quiet_option
def animate_command(job: Job, until: float | None, seconds: float | None, fps: int, width: int) -> None:
    """Film the body cone rolling on the space cone through the pulses, flown with their real widths.

    SPACECRAFT is a YAML file; without it spacecraft.yaml in this folder, else the built-in example. A FILE of - is
    standard output, as GIF.
    """
    from nutdamp.figures import animation

    output = job.written["output"] or ""
    animation.film_format(output)
    body = job.begin()
    pulses = plan_or_read(job).pulses

    from nutdamp.figures.geometry import shown_until
    from nutdamp.flight import propagation

    end = shown_until(body, pulses) if until is None else until
    timed = animation.timing(body, end, fps, seconds)
    if not timed.smooth:
        job.remark(
            f"only {timed.frames / timed.turns:.1f} frames show a nutation turn, which may seem to run backwards: "
            f"--seconds {timed.turns * animation.SMOOTH / fps:.0f} would show it, or an earlier --until"
        )
    flight = propagation.flown(body, pulses, end)
    with job.working("filming"):
        deliver([(output, lambda: lambda stream: animation.film(stream, flight, timed, output, width))])
    if output != "-":
        job.remark(f"wrote {printable(output)}: {timed.frames} frames, {timed.pace:.3g}× real time")


@click.command("simulate", cls=SessionCommand)
@spacecraft_argument
@flown_options(
    "Propagate", "Plan this scheme with default options and propagate it, not the recommended one; none is free motion."
)
@goal_options
@click.option("--flown", "real", is_flag=True, help="Propagate real pulse widths instead of the impulse sum (17).")
@click.option(
    "--until",
    type=END,
    help="End, of which the outcome is shown; default last pulse + one inertial period.",
)
@click.option(
    "--samples", type=click.IntRange(2, 10_000_000), default=1000, show_default=True, help="Rows of the track."
)
@click.option("--csv", type=OUTPUT, help="Write the track.")
@click.option("--json", type=OUTPUT, help="Write pulses, how both models end, and extremes.")
@carry_options("the end")
@plot_options(FIGURES)
@click.option("--show", "drawn", is_flag=True, help="Draw pole curve and axis track in the terminal.")
@screen_options
@quiet_option
def simulate_command(
    job: Job, real: bool, until: float | None, samples: int, at: float | None, drawn: bool, verbose: bool
) -> None:
    """Propagate a schedule; show cone angles around each pulse, how it ends by both models, and the axis track.

    Exit status 4 where all pulses are fired, and with real widths the end does not meet the requirement, or the axis
    breaks a cone of keep; so for free motion too. SPACECRAFT is a YAML file, or - for standard
    input; without it spacecraft.yaml in this folder, else the built-in example. A FILE of - is standard output, for
    --schedule standard input.
    """
    if drawn and "-" in job.written.values():
        raise click.UsageError("--show draws on standard output, where a FILE of - already goes")
    job.begin()
    plan = plan_or_read(job, jitter=True, judged=not job.silent)

    from nutdamp.api import simulate
    from nutdamp.planning.notes import model_warnings
    from nutdamp.views.simulation import simulation_screen

    simulation = simulate(plan, until, flown=real, samples=samples)
    if job.silent:
        job.note(model_warnings(simulation.impulses, simulation.flown))
    screens: list[Callable[[], RenderableType]] = [partial(simulation_screen, simulation, verbose=verbose)]
    if drawn:
        from nutdamp.figures.terminal import motion_drawing

        screens.append(partial(motion_drawing, simulation.shown, simulation.pictured))
    job.deliver(simulation, *screens, more=job.carried(plan, at, simulation.until))
    leave(missed=simulation.decision.met is False and len(simulation.flown.schedule) == len(plan.pulses))
