"""What ``nutdamp disperse --loop`` does: fly the closed loop of the file in many dispersed cases."""

from __future__ import annotations

import sys
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from nutdamp.cli.boundary import interruption, leave
from nutdamp.cli.common import require_dispersions, require_loop
from nutdamp.cli.screen import say

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.cli.job import Job
    from nutdamp.loop.study import Collect, LoopResults, LoopStudy


class Requested(NamedTuple):
    """What the command line says."""

    samples: int
    seed: int
    until: float | None
    case: int | None
    worst: int
    csv: str | None
    json: str | None
    plot: str | None


def disperse_loop(job: Job, requested: Requested) -> None:
    """Fly the loops and show what becomes of them, or of one case."""
    require_loop(job.spacecraft)
    require_dispersions(job.spacecraft)

    from nutdamp.files.loop_cases import loop_cases_json
    from nutdamp.loop.study import loop_study
    from nutdamp.presentation.loop_cases_tables import loop_cases_screen

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
    job.deliver([(requested.json, data), (requested.plot, partial(_picture, results))], screen)
    if stopped_by is not None and results.done < results.requested:
        say(f"interrupted: {results.done} of {results.requested} cases are done")
        sys.exit(128 + stopped_by)
    leave(missed=results.meets_requirement is False)


def _picture(results: LoopResults) -> Figure:
    from nutdamp.presentation.figures.loop_cases import loop_cases_figure

    return loop_cases_figure(results)


def _flown(study: LoopStudy, requested: Requested, quiet: bool) -> tuple[LoopResults, int | None]:
    """The cases, with a bar, and the signal that ended them, if any; where that is before the first, raise."""
    from nutdamp.cli.progress import progress, stoppable
    from nutdamp.files.loop_cases import LoopCasesWriter
    from nutdamp.files.output import whole_file
    from nutdamp.loop.study import LoopResults, run

    results = LoopResults(study, requested.samples)
    with stoppable() as stopped, progress("flying", requested.samples, quiet=quiet) as watch:

        def fly(collect: Collect | None) -> None:
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
    from nutdamp.files.loop_cases import loop_case_json
    from nutdamp.presentation.loop_cases_tables import loop_case_screen

    flown = study.fly([study.case(case)])
    job.deliver([(json, partial(loop_case_json, study, case, flown))], partial(loop_case_screen, study, case, flown))
