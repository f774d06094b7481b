"""``nutdamp animate``: the cones rolling on each other, as a film."""

from __future__ import annotations

import click

from nutdamp.cli.common import Input, quiet_option, spacecraft_argument
from nutdamp.cli.flown import Flown, flown_options, plan_or_read
from nutdamp.cli.job import begin, deliver
from nutdamp.cli.parameters import FILE, EndTime
from nutdamp.cli.progress import progress
from nutdamp.cli.scheme_options import Aim, PlanningCommand, goal_options
from nutdamp.errors import printable
from nutdamp.schemes import Options


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
def command(
    spacecraft: Input,
    flown: Flown,
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
    from nutdamp.presentation.figures import animation

    animation.film_format(output)
    job = begin(spacecraft, flown.file, aim=aim, quiet=quiet, output=output)
    body, remark = job.spacecraft, job.remark
    pulses = plan_or_read(job, flown, options).pulses

    from nutdamp import flight
    from nutdamp.presentation.geometry import shown_until

    end = shown_until(body, pulses) if until is None else until
    timed = animation.timing(body, end, fps, seconds)
    if not timed.smooth:
        remark(
            f"only {timed.frames / timed.turns:.1f} frames show a nutation turn, which may seem to run backwards: "
            f"--seconds {timed.turns * animation.SMOOTH / fps:.0f} would show it, or an earlier --until"
        )
    made = flight.flown(body, pulses, end)
    with progress("filming", timed.frames, quiet=quiet) as step:
        deliver([(output, lambda: lambda stream: animation.film(stream, made, timed, output, width, step))])
    if output != "-":
        remark(f"wrote {printable(output)}: {timed.frames} frames, {timed.pace:.3g} s of motion in a second")
