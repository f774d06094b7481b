"""``nutdamp disperse``: fly one schedule with many dispersed truths."""

from __future__ import annotations

import sys
import time
from contextlib import ExitStack
from typing import TYPE_CHECKING

import click

from nutdamp.cli.boundary import INTERRUPTED, REQUIREMENT_MISSED
from nutdamp.cli.common import (
    Aim,
    Input,
    expect_picture,
    expect_places,
    load,
    one_stdout,
    plan_or_read,
    quiet_option,
    remarks,
    require_dispersions,
    scheme_options,
    show,
    spacecraft_argument,
    write_all,
)
from nutdamp.cli.parameters import FILE, Count
from nutdamp.schemes import NAMES, Options

if TYPE_CHECKING:
    from nutdamp.dispersion.study import Results, Study

SAVED_EVERY = 30.0
"""Seconds after which a run with --resume saves what is done."""


@click.command("disperse")
@spacecraft_argument
@click.option("--scheme", type=click.Choice(NAMES), help="The scheme to disperse; default the recommended one.")
@click.option("--schedule", type=FILE, help="Disperse the pulses of a CSV file, as `plan --csv` writes it.")
@scheme_options
@click.option("--samples", type=Count(), default=100_000, show_default=True, help="Dispersed truths to fly.")
@click.option(
    "--seed", type=click.IntRange(0, 2**64 - 1), default=1, show_default=True, help="Same seed, same draws, always."
)
@click.option("--threads", type=click.IntRange(1, 1024), help="Default: the processors there are.")
@click.option("--flown", is_flag=True, help="Real widths, true tensor and disturbances, not the impulse sum (17).")
@click.option("--case", type=Count(), help="Show this one case alone, with all its inputs.")
@click.option(
    "--worst", type=click.IntRange(0, 1000), default=5, show_default=True, metavar="N", help="Worst cases to show."
)
@click.option("--csv", type=FILE, help="Write inputs and outcome of every case.")
@click.option("--json", type=FILE, help="Write percentiles, requirement, tolerance budget, worst cases.")
@click.option("--plot", type=FILE, help="Draw histograms and CDFs (.png, .svg, .pdf; needs the extra plot).")
@click.option("--resume", type=FILE, help="Keep what is done in this file, and go on from it if it is there.")
@quiet_option
def command(
    spacecraft: Input,
    scheme: str | None,
    schedule: str | None,
    options: Options,
    aim: Aim,
    samples: int,
    seed: int,
    threads: int | None,
    flown: bool,
    case: int | None,
    worst: int,
    csv: str | None,
    json: str | None,
    plot: str | None,
    resume: str | None,
    quiet: bool,
) -> None:
    """Fly one schedule with many truths, dispersed as the spacecraft file says.

    Shows percentiles of what is left, how surely the requirement is met, which tolerance counts, and the worst cases.
    Ctrl-C ends the run and shows what is done. SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    if scheme is not None and schedule is not None:
        raise click.UsageError("name what to disperse: either --scheme or --schedule")
    if case is not None and (csv or plot or resume):
        raise click.UsageError("--case shows a single case: --csv, --plot and --resume are for a study")
    if resume == "-":
        raise click.UsageError("--resume keeps a study in a file; standard output cannot be read again")
    silent = one_stdout(csv=csv, json=json, plot=plot)
    expect_picture(plot)
    remark = remarks(quiet)
    body = load(spacecraft, remark, aim)
    expect_places(csv, json, plot, resume)

    require_dispersions(body)
    plan = plan_or_read(body, scheme, schedule, options, remark, quiet=quiet)

    from nutdamp.dispersion import study_of

    study = study_of(body, plan.pulses, seed=seed, flown=flown)
    for text in study.remarks:
        remark(text)
    if case is not None:
        _one_case(study, case - 1, plan.scheme, json, silent)
        return
    results = fly(study, samples, threads, csv, resume, quiet)
    outputs: list[tuple[str, str | bytes]] = []
    if json is not None:
        from nutdamp.files.dispersion_json import dispersion_json
        from nutdamp.files.output import json_text

        outputs.append((json, json_text(dispersion_json(results, scheme=plan.scheme, worst=worst))))
    if plot is not None:
        from nutdamp.report import figures

        outputs.append((plot, figures.rendered(figures.dispersion_figure(results, scheme=plan.scheme), plot)))
    write_all(outputs)
    if not silent:
        from nutdamp.report.dispersion_tables import dispersion_screen

        show(dispersion_screen(results, scheme=plan.scheme, worst=worst))
    if results.done < results.asked:
        click.echo(f"interrupted: {results.done} of {results.asked} cases are done", err=True)
        sys.exit(INTERRUPTED)
    if results.meets_requirement is False:
        sys.exit(REQUIREMENT_MISSED)


def fly(study: Study, samples: int, threads: int | None, csv: str | None, resume: str | None, quiet: bool) -> Results:
    """Fly the cases, with a bar, until they are done or somebody interrupts."""
    from nutdamp.cli.progress import progress, stoppable
    from nutdamp.dispersion.study import Results, run, threads_here

    results = Results(study, samples)
    if resume is not None:
        from nutdamp.files.study_file import load_results, save_results

        results = load_results(resume, study, samples)
    with ExitStack() as stack:
        collect = None
        if csv is not None:
            from nutdamp.files.output import whole_file
            from nutdamp.files.samples_csv import SamplesWriter, check_room

            check_room(csv, study, samples)
            collect = SamplesWriter(stack.enter_context(whole_file(csv)), study).write
        stopped = stack.enter_context(stoppable())
        told = stack.enter_context(progress("flying", samples, quiet=quiet, done=results.done))
        saved = time.monotonic()

        def watch(done: int) -> None:
            nonlocal saved
            told(done)
            if resume is not None and time.monotonic() - saved > SAVED_EVERY:
                save_results(resume, results)
                saved = time.monotonic()

        run(results, threads=threads or threads_here(), watch=watch, stopped=stopped, collect=collect)
        if not results.done:
            raise click.Abort  # so that no file is written
        if resume is not None:
            save_results(resume, results)
    return results


def _one_case(study: Study, case: int, scheme: str, json: str | None, silent: bool) -> None:
    """Show a single case, by the impulse sum and flown."""
    from nutdamp.dispersion.single import flown_outputs

    draws = study.draws_of(case)
    if json is not None:
        from nutdamp.files.dispersion_json import case_json
        from nutdamp.files.output import json_text

        write_all([(json, json_text({"scheme": scheme, "seed": study.seed, **case_json(study, case, draws)}))])
    if not silent:
        from nutdamp.report.dispersion_tables import case_screen

        show(case_screen(study, case, draws, flown_outputs(study.model, draws), scheme=scheme))
