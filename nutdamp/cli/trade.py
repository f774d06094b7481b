"""``nutdamp trade``: the cost of an earlier end, as a front of schedules."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import click

from nutdamp.cli.flown import fronts_of
from nutdamp.cli.job import Job, Output, quiet_option, screen_options, spacecraft_argument
from nutdamp.cli.main import leave
from nutdamp.cli.options import (
    FOLDER,
    OUTPUT,
    Bare,
    NameType,
    SessionCommand,
    UnitType,
    expect_read,
    goal_options,
    reading_of,
)
from nutdamp.schemes.catalogue import LEAST, OPTIMAL
from nutdamp.units import shifts

if TYPE_CHECKING:
    from nutdamp.errors import CannotWrite
    from nutdamp.planning.tradeoff import Front


@click.command("trade", cls=SessionCommand)
@spacecraft_argument
@click.option(
    "--allow",
    type=UnitType("angle", lambda shift: shifts([shift]), "expected an angle of at least 0, or any", any=math.inf),
    multiple=True,
    metavar="ANGLE|any",
    help="How far from its target H may end; repeatable, a front for each. Default: 0 deg and any.",
)
@click.option("--points", type=click.IntRange(1, 1000), default=10, show_default=True, help="Horizons tried per front.")
@click.option(
    "--least",
    type=NameType(LEAST[:2]),
    default=LEAST[0],
    show_default=True,
    help="What is traded against time; impulse where propellant is unknown.",
)
@partial(goal_options, several=False)
@click.option("--csv", type=OUTPUT, help="Write the points.")
@click.option("--json", type=OUTPUT, help="Write the points with their pulses.")
@click.option("--plot", type=OUTPUT, help="Draw the fronts (.png, .svg, .pdf; needs the extra plot).")
@click.option("--schedules", type=FOLDER, help="Write each schedule as FOLDER/point-N.csv, as `plan --csv` does.")
@screen_options
@quiet_option
def command(job: Job, allow: tuple[float, ...], points: int, least: str, schedules: str | None, verbose: bool) -> None:
    """Trade time against propellant: the cheapest schedules found for ends from the earliest to the horizon.

    Each front is of the scheme optimal (of the others where that finds none) and holds no schedule that another beats
    in both. SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    from nutdamp.planning.decision import CUT
    from nutdamp.planning.tradeoff import numbered
    from nutdamp.views.trade import schedule_paths, trade_brief

    allowed = allow or (0.0, math.inf)
    for shift in allow:
        if isinstance(shift, Bare) and shift:
            job.remark(f"--allow: warning: {reading_of(shift, 'angle', 'deg')}")
    job.begin([] if schedules is None else schedule_paths(schedules, points * len({*allowed})))
    expect_read((OPTIMAL.name,), job.options, job.spacecraft, job.remark)
    traded = fronts_of(job, points, allowed, least)
    for index, _, point in numbered(traded.fronts):
        if point.plan.cut:
            job.remark(f"point {index}: {CUT}")
    files, unsaved = ([], []) if schedules is None else _schedules(traded.fronts, schedules)
    brief = [] if verbose else [partial(trade_brief, traded.spacecraft, traded.fronts)]
    job.deliver(traded, *brief, files=files, unsaved=unsaved)
    leave(infeasible=not traded.plans)


def _schedules(fronts: Sequence[Front], folder: str) -> tuple[list[Output], list[CannotWrite]]:
    """A file of each schedule, or the error where the folder cannot be made."""
    from nutdamp.errors import CannotWrite
    from nutdamp.files.tabular import make_folder
    from nutdamp.views.trade import schedule_files

    try:
        make_folder(folder)
    except CannotWrite as wrong:
        return [], [wrong]
    return [(path, partial(str, text)) for path, text in schedule_files(fronts, folder)], []
