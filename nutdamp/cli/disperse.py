"""``nutdamp disperse``: fly one schedule, or the closed loop of the file, in many dispersed cases."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from nutdamp.cli.flown import flown_options, plan_or_read
from nutdamp.cli.job import Job, plot_options, quiet_option, screen_options, spacecraft_argument
from nutdamp.cli.main import leave, stoppable
from nutdamp.cli.options import END, OUTPUT, SAMPLES, Count, SessionCommand, goal_options
from nutdamp.cli.screen import say
from nutdamp.units import LARGEST_SEED

if TYPE_CHECKING:
    from rich.console import RenderableType

    from nutdamp.montecarlo.study import Dispersed
    from nutdamp.planning.plan import Plan

FIGURES = ("overview", "cases", "momentum")
"""Figures that ``--plot`` draws."""


@click.command("disperse", cls=SessionCommand)
@spacecraft_argument
@flown_options("Disperse")
@goal_options
@click.option(
    "--samples",
    type=Count(),
    show_default=f"{SAMPLES}; of --loop what shows the share required, 2000 or more",
    help="Dispersed cases to fly.",
)
@click.option(
    "--seed", type=click.IntRange(0, LARGEST_SEED), default=1, show_default=True, help="Same seed, same draws, always."
)
@click.option("--threads", type=click.IntRange(1, 1024), help="Default: the processors there are.")
@click.option("--loop", "looped", is_flag=True, help="Disperse the closed loop of the file: body, valves and sensor.")
@click.option("--until", type=END, help="End of --loop; default: the horizon after the nutation is at start.")
@click.option("--case", type=Count(), help="Show this one case alone, with all its inputs.")
@click.option(
    "--worst", type=click.IntRange(0, 1000), default=5, show_default=True, metavar="N", help="Worst cases with -v."
)
@click.option("--csv", type=OUTPUT, help="Write inputs and outcome of every case, with angles to cones.")
@click.option("--json", type=OUTPUT, help="Write percentiles, requirement, tolerance budget, worst cases.")
@plot_options(FIGURES)
@screen_options
@quiet_option
def command(
    job: Job,
    samples: int | None,
    seed: int,
    threads: int | None,
    looped: bool,
    until: float | None,
    case: int | None,
    worst: int,
    verbose: bool,
) -> None:
    """Fly one schedule, or the closed loop, in many cases, dispersed as the spacecraft file says.

    Shows percentiles of what is left, the share of cases that comply, and which tolerance counts; with -v the tolerance
    budget and the worst cases. Ctrl-C ends the run and shows what is done. SPACECRAFT and FILE are as for `nutdamp
    plan`.
    """
    if case is not None and (job.written["csv"] or job.written["plot"]):
        raise click.UsageError("--case shows a single case: --csv and --plot are for a study")
    if until is not None and not looped:
        raise click.UsageError("--until is for --loop")
    others = {**job.flown._asdict(), "threads": threads, "figure": job.figure != FIGURES[0]} if looped else {}
    for name in (name for name, value in others.items() if value):
        raise click.UsageError(f"--loop flies the loop of the file, all in one way: leave --{name} out")
    body = job.begin()

    from nutdamp import api
    from nutdamp.spacecraft.requirements import expect_dispersions, expect_loop
    from nutdamp.views.dispersion import dispersion_brief

    if looped:
        expect_loop(body)
        job.figure = None
    expect_dispersions(body)
    plan = None if looped else plan_or_read(job)
    if case is not None:
        deliver_case(job, plan, case - 1, seed=seed, until=until)
        return
    brief: list[Callable[[], RenderableType]] = []
    with stoppable() as stopped, job.working("flying"):
        hooks: dict[str, Any] = {"seed": seed, "csv": job.written["csv"], "stopped": stopped}
        if plan is None:
            flown: Dispersed = api.disperse_loop(body, samples, until=until, remark=job.remark, **hooks)
        else:
            flown = study = api.disperse(plan, samples or SAMPLES, threads=threads, remark=job.remark, **hooks)
            brief += [partial(dispersion_brief, study.core, scheme=plan.scheme)] * (not verbose)
    job.deliver(flown, *brief, unsaved=[flown.unsaved], worst=worst)
    if stopped.number is not None and flown.core.done < flown.core.requested:
        say(f"interrupted: {flown.core.done} of {flown.core.requested} cases are done")
        sys.exit(128 + stopped.number)
    leave(missed=flown.meets_requirement is False)


def deliver_case(job: Job, plan: Plan | None, case: int, *, seed: int, until: float | None) -> None:
    """Show a single case (from 0) of a schedule, or without ``plan`` of the closed loop."""
    data: Callable[[], dict[str, Any]]
    screen: Callable[[], RenderableType]
    if plan is None:
        from nutdamp.control_loop.dispersion import loop_study
        from nutdamp.views.loop_cases import loop_case_json, loop_case_screen

        loops = loop_study(job.spacecraft, until, seed=seed)
        flown = loops.fly([loops.case(case)])
        data = partial(loop_case_json, loops, case, flown)
        screen = partial(loop_case_screen, loops, case, flown)
    else:
        from nutdamp.montecarlo.study import study_of
        from nutdamp.views.dispersion import case_json, case_screen

        study = study_of(plan.spacecraft, plan.pulses, seed=seed)
        if study.lightening_error:
            job.remark(study.lightening_error)
        draws, scheme = study.draws_of(case), plan.scheme
        data = lambda: {"scheme": scheme, "seed": seed, **case_json(study, case, draws)}  # noqa: E731
        screen = partial(case_screen, study, case, draws, scheme=scheme)
    job.deliver(None, screen, more={"json": data})
