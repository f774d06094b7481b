"""``nutdamp loop`` and ``budget``: the closed loop of the file, and its cost against energy dissipation."""

from __future__ import annotations

from functools import partial

import click

from nutdamp.cli.job import Files, Job, carry_options, quiet_option, screen_options, spacecraft_argument
from nutdamp.cli.main import leave
from nutdamp.cli.options import END, OUTPUT, Angles, Count, Direction, SessionCommand, UnitType
from nutdamp.cli.screen import say
from nutdamp.units import LARGEST_SEED, thresholds, tilt


@click.command("loop", cls=SessionCommand)
@spacecraft_argument
@click.option("--until", type=END, help="End; default: the horizon after the nutation is at start.")
@click.option(
    "--seed", type=click.IntRange(0, LARGEST_SEED), default=1, show_default=True, help="Of the noise of the sensor."
)
@click.option("--case", type=Count(), help="Fly this dispersed case, as `disperse --loop` does with that seed.")
@click.option(
    "--samples", type=click.IntRange(2, 10_000_000), default=1000, show_default=True, help="Rows of the track."
)
@click.option("--csv", type=OUTPUT, help="Write the pulses, as `plan --csv` does.")
@click.option("--track", type=OUTPUT, help="Write the track, as `simulate --csv` does.")
@click.option("--json", type=OUTPUT, help="Write firings, dead band, margins.")
@carry_options("end of the run")
@click.option("--plot", type=OUTPUT, help="Draw signal, nutation and firings (.png, .svg, .pdf; needs extra plot).")
@screen_options
@quiet_option
def command(
    job: Job, until: float | None, seed: int, case: int | None, samples: int, at: float | None, verbose: bool
) -> None:
    """Fly the closed loop of the file: fire from what its gyro or accelerometer shows, and see where it ends.

    A channel wired backwards, a reversed sensor and firings that come too late are found and named by the first
    firings that can be judged: exit status 3. SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    body = job.begin()

    from nutdamp.api import loop
    from nutdamp.files.tabular import write_track
    from nutdamp.views.loop import loop_screen, stopped, warnings

    with job.working("flying"):
        plan = loop(body, until, seed=seed, case=case)
    run = plan.flown_run
    if job.silent:
        job.warn(warnings(body))
    pieces = partial(run.flight.pieces, samples, run.until)
    track: Files = {"track": lambda: partial(write_track, pieces(), run.flight.spacecraft.inertia)}
    job.deliver(plan, partial(loop_screen, plan, verbose=verbose), more=track | job.carried(plan, at))
    if run.stop.fault:
        say(f"nutdamp: the loop was stopped {stopped(run)}")
    leave(infeasible=run.stop.fault, missed=plan.meets_requirement is False)


@click.command("budget", cls=SessionCommand)
@spacecraft_argument
@click.option(
    "--thresholds",
    "pairs",
    type=Direction(thresholds, "expected START above STOP, both below 90 deg, such as 0.5deg,0.1deg"),
    multiple=True,
    metavar="START,STOP",
    help="Fire from START to STOP, such as 0.5deg,0.1deg; repeatable. Default: start and stop of loop.",
)
@click.option(
    "--largest",
    type=UnitType("angle", tilt, "expected an angle between 0 and 90 deg"),
    help="By which damping must begin; default: requirement.nutation.",
)
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of the noise of the sensor.")
@click.option("--csv", type=OUTPUT, help="Write a row for each two thresholds.")
@click.option("--json", type=OUTPUT, help="Write the same, and how the nutation grows.")
@click.option("--plot", type=OUTPUT, help="Draw it (.png, .svg, .pdf; needs extra plot).")
@screen_options
@quiet_option
def budget_command(job: Job, pairs: tuple[Angles, ...], largest: float | None, seed: int, verbose: bool) -> None:
    """Budget a mission: pulses a day and propellant a year that hold the nutation against energy dissipation.

    The limit cycle of the loop in the file, from event to event in closed form; and how long until damping must begin.
    A body whose nutation decays needs none. SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    body = job.begin()
    for reading in (text for pair in pairs for text in pair.readings):
        job.remark(f"--thresholds: warning: {reading}")

    from nutdamp.api import budget
    from nutdamp.views.budget import budget_screen

    with job.working("following cycles"):
        result = budget(body, pairs, largest=largest, seed=seed)
    job.deliver(result, partial(budget_screen, result, verbose=verbose))
    leave(infeasible=not result.feasible, missed=result.meets_requirement is False)
