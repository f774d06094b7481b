"""``nutdamp disperse``: fly one schedule, or the closed loop of the file, in many dispersed cases."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from nutdamp.cli.flown import FlownChoice, flown_options, plan_or_read
from nutdamp.cli.job import (
    FileInput,
    Job,
    Output,
    begin,
    plot_options,
    quiet_option,
    require_dispersions,
    require_loop,
    spacecraft_argument,
)
from nutdamp.cli.main import interruption, leave
from nutdamp.cli.options import FILE, SAMPLES, Aim, Count, EndTime, PlanningCommand, goal_options
from nutdamp.cli.screen import say
from nutdamp.schemes.catalogue import Options

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import RenderableType

    from nutdamp.control_loop.dispersion import CollectLoops, LoopResults, LoopStudy
    from nutdamp.errors import CannotWrite
    from nutdamp.montecarlo.statistics import Array
    from nutdamp.montecarlo.study import Collect, Results, Study


class Requested(NamedTuple):
    """Options of the command line."""

    samples: int
    seed: int
    until: float | None
    case: int | None
    worst: int
    csv: str | None
    json: str | None
    plot: str | None


def disperse_loop(job: Job, requested: Requested) -> None:
    """Fly the loops and show their ends, or the flight of one case."""
    require_loop(job.spacecraft)
    require_dispersions(job.spacecraft)

    from nutdamp.control_loop.dispersion import loop_study
    from nutdamp.views.loop_cases import loop_cases_json, loop_cases_screen

    study = loop_study(job.spacecraft, requested.until, seed=requested.seed)
    if requested.case is not None:
        _one(job, study, requested.case - 1, requested.json)
        return
    count = study.expect_affordable(requested.samples)
    if study.alone:
        what = f"{study.alone}: the cases fly one by one, and look at about {count:,} samples"
        job.remark(f"{what}, which takes {study.price_alone(requested.samples)}")
    results, stopped_by = _flown(study, requested, job.quiet)
    data = partial(loop_cases_json, results, worst=requested.worst)
    screen = partial(loop_cases_screen, results, worst=requested.worst)
    job.deliver([(requested.json, data), (requested.plot, partial(_loop_picture, results))], screen)
    if stopped_by is not None and results.done < results.requested:
        say(f"interrupted: {results.done} of {results.requested} cases are done")
        sys.exit(128 + stopped_by)
    leave(missed=results.meets_requirement is False)


def _loop_picture(results: LoopResults) -> Figure:
    from nutdamp.figures.loop_cases import loop_cases_figure

    return loop_cases_figure(results)


def _flown(study: LoopStudy, requested: Requested, quiet: bool) -> tuple[LoopResults, int | None]:
    """The cases, with a bar, and the signal that ended them, if any; where that is before the first, raise."""
    from nutdamp.cli.job import progress, stoppable
    from nutdamp.control_loop.dispersion import LoopResults, run
    from nutdamp.files.tabular import whole_file
    from nutdamp.views.loop_cases import LoopCasesWriter

    results = LoopResults(study, requested.samples)
    with stoppable() as stopped, progress("flying", requested.samples, quiet=quiet) as watch:

        def fly(collect: CollectLoops | None) -> None:
            run(results, watch=watch, stopped=stopped, collect=collect)
            if not results.done and stopped.number is not None:
                raise interruption(stopped.number)  # so that no file is written

        if requested.csv is None:
            fly(None)
        else:
            with whole_file(requested.csv) as stream:
                fly(LoopCasesWriter(stream, study).write)
    return results, stopped.number


def _one(job: Job, study: LoopStudy, case: int, json: str | None) -> None:
    """Show a single case."""
    from nutdamp.views.loop_cases import loop_case_json, loop_case_screen

    flown = study.fly([study.case(case)])
    job.deliver([(json, partial(loop_case_json, study, case, flown))], partial(loop_case_screen, study, case, flown))


FIGURES = ("overview", "cases", "momentum", "budget")
"""Figures that ``--plot`` draws."""


@click.command("disperse", cls=PlanningCommand)
@spacecraft_argument
@flown_options("Disperse")
@goal_options
@click.option("--samples", type=Count(), default=SAMPLES, show_default=True, help="Dispersed cases to fly.")
@click.option(
    "--seed", type=click.IntRange(0, 2**64 - 1), default=1, show_default=True, help="Same seed, same draws, always."
)
@click.option("--threads", type=click.IntRange(1, 1024), help="Default: the processors there are.")
@click.option("--loop", "looped", is_flag=True, help="Disperse the closed loop of the file: body, valves and sensor.")
@click.option("--until", type=EndTime(), help="End of --loop; default: the horizon after the nutation is at start.")
@click.option("--case", type=Count(), help="Show this one case alone, with all its inputs.")
@click.option(
    "--worst", type=click.IntRange(0, 1000), default=5, show_default=True, metavar="N", help="Worst cases to show."
)
@click.option("--csv", type=FILE, help="Write inputs and outcome of every case, with angles to cones.")
@click.option("--json", type=FILE, help="Write percentiles, requirement, tolerance budget, worst cases.")
@plot_options(FIGURES)
@quiet_option
def command(
    spacecraft: FileInput,
    flown: FlownChoice,
    options: Options,
    aim: Aim,
    samples: int,
    seed: int,
    threads: int | None,
    looped: bool,
    until: float | None,
    case: int | None,
    worst: int,
    csv: str | None,
    json: str | None,
    plot: str | None,
    figure: str,
    quiet: bool,
) -> None:
    """Fly one schedule, or the closed loop, in many cases, dispersed as the spacecraft file says.

    Shows percentiles of what is left, the share of cases that comply, which tolerance counts, and the worst cases.
    Ctrl-C ends the run and shows what is done. SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    if case is not None and (csv or plot):
        raise click.UsageError("--case shows a single case: --csv and --plot are for a study")
    if until is not None and not looped:
        raise click.UsageError("--until is for --loop")
    if looped:
        _expect_loop(flown, {"threads": threads, "figure": figure != FIGURES[0]})
    job = begin(spacecraft, flown.file, aim=aim, quiet=quiet, figure=figure, csv=csv, json=json, plot=plot)
    if looped:
        disperse_loop(job, Requested(samples, seed, until, case, worst, csv, json, plot))
        return
    require_dispersions(job.spacecraft)
    plan = plan_or_read(job, flown, options)

    from nutdamp.montecarlo.study import study_of
    from nutdamp.views.dispersion_json import dispersion_json

    study = study_of(plan.spacecraft, plan.pulses, seed=seed)
    if note := study.lightening_error:
        job.remark(note)
    if case is not None:
        _one_case(job, study, case - 1, plan.scheme, json)
        return
    results, unsaved, stopped_by = fly(study, samples, threads, csv, quiet)
    data = partial(dispersion_json, results, scheme=plan.scheme, worst=worst)
    outputs: list[Output] = [(json, data), (plot, partial(_picture, results, figure, plan.scheme))]
    job.deliver(outputs, partial(_screen, results, plan.scheme, worst), unsaved=unsaved)
    if stopped_by is not None and results.done < results.requested:
        say(f"interrupted: {results.done} of {results.requested} cases are done")
        sys.exit(128 + stopped_by)
    leave(missed=results.meets_requirement is False)


def _picture(results: Results, figure: str, scheme: str) -> Figure:
    from nutdamp.figures import dispersion

    return dispersion.dispersion_figure(figure, results, scheme=scheme)


def _screen(results: Results, scheme: str, worst: int) -> RenderableType:
    from nutdamp.views.dispersion_tables import dispersion_screen

    return dispersion_screen(results, scheme=scheme, worst=worst, nominal=results.study.nominal)


def _expect_loop(flown: FlownChoice, others: Mapping[str, object]) -> None:
    """A usage error for options that do not go with ``--loop``."""
    for name, value in {**flown._asdict(), **others}.items():
        if value:
            raise click.UsageError(f"--loop flies the loop of the file, all in one way: leave --{name} out")


class StudyRun(NamedTuple):
    """A study after its run: the results, the files that could not be saved, and the signal that ended it, if any."""

    results: Results
    unsaved: tuple[CannotWrite, ...]
    stopped_by: int | None


def fly(study: Study, samples: int, threads: int | None, csv: str | None, quiet: bool) -> StudyRun:
    """Fly the cases, with a bar, until they are done or somebody interrupts; where that is before the first, raise."""
    from nutdamp.cli.job import progress, stoppable
    from nutdamp.errors import CannotWrite
    from nutdamp.montecarlo.study import Results, run, threads_here

    results = Results(study, samples)
    unsaved: list[CannotWrite] = []
    with stoppable() as stopped, progress("flying", samples, quiet=quiet) as watch:

        def fly_all(collect: Collect | None) -> None:
            run(results, threads=threads or threads_here(), watch=watch, stopped=stopped, collect=collect)
            if not results.done and stopped.number is not None:
                raise interruption(stopped.number)  # so that no file is written

        try:
            _fly_into(csv, study, samples, fly_all)
        except CannotWrite as wrong:
            if results.done < samples and not stopped():
                raise  # it never began
            unsaved.append(wrong)
    return StudyRun(results, tuple(unsaved), stopped.number)


def _fly_into(csv: str | None, study: Study, samples: int, fly_all: Callable[[Collect | None], None]) -> None:
    """Fly the cases and write them to a file, if one is named; raises CannotWrite, after the flight if it can."""
    if csv is None:
        fly_all(None)
        return
    from nutdamp.files.samples import SamplesWriter, check_room
    from nutdamp.files.tabular import whole_file

    check_room(csv, study, samples)
    full: OSError | None = None
    with whole_file(csv) as stream:
        writer = SamplesWriter(stream, study)

        def collect(first: int, values: Array) -> None:
            nonlocal full
            try:
                if full is None:
                    writer.write(first, values)
            except BrokenPipeError:
                raise
            except OSError as reason:
                full = reason

        fly_all(collect)
        if full is not None:
            raise full


def _one_case(job: Job, study: Study, case: int, scheme: str, json: str | None) -> None:
    """Show a single case."""
    from nutdamp.views.dispersion_json import case_json
    from nutdamp.views.dispersion_tables import case_screen

    draws = study.draws_of(case)

    def data() -> dict[str, Any]:
        return {"scheme": scheme, "seed": study.seed, **case_json(study, case, draws)}

    job.deliver([(json, data)], partial(case_screen, study, case, draws, scheme=scheme))
