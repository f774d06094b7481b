"""``simulate`` and ``animate``; and the pulses that a command flies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import click

from nutdamp.cli.job import (
    FIGURES,
    Job,
    SessionCommand,
    carry_options,
    defaulted,
    deliver,
    plot_options,
    quiet_option,
    screen_options,
    spacecraft_argument,
)
from nutdamp.cli.main import leave, show_failures
from nutdamp.cli.options import END, FILE, OUTPUT, Command, NameType, expect_read, goal_options
from nutdamp.cli.plan import compared_with, scheme_option
from nutdamp.errors import Infeasible, printable
from nutdamp.schemes.catalogue import NAMES, SchemeOptions

if TYPE_CHECKING:
    from nutdamp.planning.plan import Plan
    from nutdamp.planning.tradeoff import Trade


def flown_options(verb: str, scheme: str | None = None) -> Callable[[Command], Command]:
    """``--scheme`` (its help may differ), ``--schedule`` and ``--blocks``: one alone."""
    default = f"{verb} this scheme with default options; without it the recommended one."

    def alone(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
        named = [
            name
            for name in ("scheme", "schedule", "blocks")
            if name != param.name and ctx.params.get(name)
        ]
        if value is not None and named:
            raise click.UsageError(
                f"name what to {verb.lower()}: one of --scheme, --schedule and --blocks"
            )
        return value

    def decorate(command: Command) -> Command:
        read = f"{verb} the pulses of a CSV file, as `plan --csv` writes it."
        fired = f"{verb} what the command blocks of a CSV file fire, as `plan --blocks` writes it."
        command = click.option("--blocks", type=FILE, callback=alone, help=fired)(command)
        command = click.option("--schedule", type=FILE, callback=alone, help=read)(command)
        return scheme_option(type=NameType(NAMES), callback=alone, help=scheme or default)(command)

    return decorate


def fronts_of(
    job: Job, points: int, shifts: Sequence[float], least: str, *, nominal: bool = False
) -> Trade:
    """The fronts of time against cost."""
    from nutdamp.api import trade

    known = job.options.with_disturbances
    with job.working("searching"):
        return trade(
            job.spacecraft, points, shifts, least, with_disturbances=known, nominal=nominal
        )


def plan_or_read(job: Job, *, judged: bool = False) -> Plan:
    """The pulses that a command flies, as a plan; raises Infeasible where there is none.

    ``judged``: a verdict names the cones that are broken.
    """
    from nutdamp import api
    from nutdamp.planning.causes import infeasibility
    from nutdamp.planning.notes import comparison_warnings, plan_notes, reasons
    from nutdamp.views.text import joined

    scheme, schedule, blocks = job.flown
    if schedule is not None:
        from nutdamp.files.schedules import read_plan

        expect_read((), job.options, job.spacecraft, job.doubt)
        plan, warnings = read_plan(schedule, job.spacecraft, job.options.of(SchemeOptions))
        job.doubt(*warnings)
        return plan
    if blocks is not None:
        return _fired(job, blocks)
    if scheme is None:
        compared = compared_with(job, ())
        recommended = compared.recommended
        show_failures(compared)
        if recommended is not None:
            job.remark(f"using recommended plan: {recommended.scheme}")
        job.note(comparison_warnings(compared, tabulated=judged))
        if recommended is None:
            raise Infeasible(f"{joined(reasons(compared))}; `nutdamp plan` says more")
        plan = recommended
    else:
        expect_read((scheme,), job.options, job.spacecraft, job.doubt)
        with job.working("planning"):
            plan = api.plan(job.spacecraft, scheme, job.options)
    if not plan.feasible:
        raise Infeasible(f"{plan.scheme} is infeasible: {infeasibility(plan)}")
    job.note(plan_notes(plan, cones=scheme is not None and not judged))
    return plan


def _fired(job: Job, path: str) -> Plan:
    """The pulses that a file of command blocks fires, as a plan; Infeasible without Sun pulses."""
    from nutdamp.files.schedules import read_blocks
    from nutdamp.planning.causes import broken_limits
    from nutdamp.planning.plan import Plan
    from nutdamp.schemes.block_model import fired

    spacecraft = job.spacecraft
    blocks, warnings = read_blocks(path, spacecraft)
    pulses = fired(spacecraft, blocks)
    job.doubt(*warnings, *broken_limits(spacecraft, pulses))
    return Plan(
        spacecraft, printable(path), pulses, options=job.options.of(SchemeOptions), from_file=True
    )


@click.command("animate", cls=SessionCommand)
@spacecraft_argument
@flown_options("Show")
@goal_options
@click.option(
    "-o",
    "--output",
    type=OUTPUT,
    required=True,
    help="The film: .gif, or .mp4 where ffmpeg is installed.",
)
@click.option("--until", type=END, help="End of the motion; default soon after the last pulse.")
@click.option(
    "--seconds", type=click.FloatRange(0.2, 600.0), help="Length of the film; default 6 s to 30 s."
)
@defaulted("--fps", click.IntRange(1, 50), 20, "Frames a second.")
@defaulted("--width", click.IntRange(320, 3840), 800, "Width in pixels; height 0.6 of it.")
@quiet_option
def animate_command(
    job: Job, until: float | None, seconds: float | None, fps: int, width: int
) -> None:
    """Film the body cone rolling on the space cone through the pulses, flown with their real
    widths.

    SPACECRAFT is a YAML file; without it spacecraft.yaml in this folder, else the built-in example.
    A FILE of - is standard output, as GIF.
    """
    from nutdamp.figures import image

    output = job.written["output"] or ""
    image.film_format(output)
    spacecraft = job.begin()
    plan = plan_or_read(job)

    from nutdamp.figures.geometry import shown_until

    end = shown_until(spacecraft, plan.pulses) if until is None else until
    timed = image.timing(spacecraft, end, fps, seconds)
    if not timed.smooth:
        job.remark(
            f"only {timed.frames / timed.turns:.1f} frames show a nutation turn, "
            "which may seem to run backwards: "
            f"--seconds {timed.turns * image.SMOOTH / fps:.0f} would show it, or an earlier --until"
        )
    flight = plan.reaching(end)
    with job.working("filming"):
        deliver([(output, lambda: lambda stream: image.film(stream, flight, timed, output, width))])
    if output != "-":
        job.remark(f"wrote {printable(output)}: {timed.frames} frames, {timed.pace:.3g}× real time")


@click.command("simulate", cls=SessionCommand)
@spacecraft_argument
@flown_options(
    "Propagate",
    (
        "Plan this scheme with default options and propagate it, not the recommended one; "
        "none is free motion."
    ),
)
@goal_options
@click.option(
    "--flown",
    "real",
    is_flag=True,
    help="Propagate real pulse widths instead of the impulse sum (17).",
)
@click.option(
    "--until",
    type=END,
    help="End, of which the outcome is shown; default last pulse + one inertial period.",
)
@defaulted("--samples", click.IntRange(2, 10_000_000), 1000, "Rows of the track.")
@click.option("--csv", type=OUTPUT, help="Write the track.")
@click.option("--json", type=OUTPUT, help="Write pulses, how both models end, and extremes.")
@carry_options("the end")
@plot_options(FIGURES)
@screen_options
def simulate_command(
    job: Job, real: bool, until: float | None, samples: int, at: float | None, verbose: bool
) -> None:
    """Propagate a schedule; show cone angles around each pulse, how it ends by both models, and the
    axis track.

    The verdict is on the whole schedule, in dispersed cases where the file has them; of free motion
    on its end. Exit status 4 where it is not FLY or NO PULSE. SPACECRAFT is a YAML file, or - for
    standard input; without it spacecraft.yaml in this folder, else the built-in example. A FILE of
    - is standard output, for --schedule standard input.
    """
    job.begin()
    plan = plan_or_read(job, judged=not job.silent)

    from nutdamp.api import simulate
    from nutdamp.planning.simulation import model_warnings
    from nutdamp.views.simulation import simulation_screen

    simulation = simulate(plan, until, flown=real, samples=samples)
    if job.silent:
        job.note(model_warnings(simulation.impulses, simulation.flown))
    screen = partial(simulation_screen, simulation, verbose=verbose)
    job.deliver(simulation, screen, more=job.carried(plan, at, simulation.until))
    leave(simulation.verdict.status)
