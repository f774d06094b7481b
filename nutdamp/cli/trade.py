"""``nutdamp trade``: the cost of an earlier end, as a front of schedules."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import click

from nutdamp.cli.flown import fronts_of
from nutdamp.cli.job import FileInput, Output, begin, quiet_option, remarks, spacecraft_argument
from nutdamp.cli.main import leave
from nutdamp.cli.options import (
    FILE,
    FOLDER,
    Aim,
    Bare,
    NameType,
    PlanningCommand,
    UnitType,
    expect_read,
    goal_options,
    reading_of,
)
from nutdamp.schemes.catalogue import LEAST, OPTIMAL, Options

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import RenderableType

    from nutdamp.api import Trade
    from nutdamp.errors import CannotWrite
    from nutdamp.planning.tradeoff import Front


class Allowance(UnitType):
    """An angle, or ``any``."""

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The angle in rad, infinite for ``any``."""
        return float("inf") if value == "any" else super().convert(value, param, ctx)


@click.command("trade", cls=PlanningCommand)
@spacecraft_argument
@click.option(
    "--allow",
    type=Allowance("angle"),
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
@click.option("--csv", type=FILE, help="Write the points.")
@click.option("--json", type=FILE, help="Write the points with their pulses.")
@click.option("--plot", type=FILE, help="Draw the fronts (.png, .svg, .pdf; needs the extra plot).")
@click.option("--schedules", type=FOLDER, help="Write each schedule as FOLDER/point-N.csv, as `plan --csv` does.")
@click.option("-v", "--verbose", is_flag=True, help="Show all values and remarks.")
@quiet_option
def command(
    spacecraft: FileInput,
    allow: tuple[float, ...],
    points: int,
    least: str,
    options: Options,
    aim: Aim,
    csv: str | None,
    json: str | None,
    plot: str | None,
    schedules: str | None,
    verbose: bool,
    quiet: bool,
) -> None:
    """Trade time against propellant: the cheapest schedules found for ends from the earliest to the horizon.

    Each front is of the scheme optimal (of the others where that finds none) and holds no schedule that another beats
    in both. SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    if any(shift < 0.0 for shift in allow):
        raise click.BadParameter("expected an angle of at least 0, or any", param_hint="--allow")
    from nutdamp.planning.decision import CUT
    from nutdamp.planning.tradeoff import numbered
    from nutdamp.views.trade import schedule_paths, trade_csv

    shifts = allow or (0.0, math.inf)
    most = points * len(set(shifts))
    for shift in allow:
        if isinstance(shift, Bare) and shift:
            remarks(quiet)(f"--allow: warning: {reading_of(shift, 'angle', 'deg')}")
    paths = [] if schedules is None else schedule_paths(schedules, most)
    job = begin(spacecraft, aim=aim, quiet=quiet, csv=csv, json=json, plot=plot, schedules=paths)
    expect_read((OPTIMAL.name,), options, job.spacecraft, job.remark)
    traded = fronts_of(job, points, shifts, least, options)
    fronts = traded.fronts
    for index, _, point in numbered(fronts):
        if point.plan.cut:
            job.remark(f"point {index}: {CUT}")
    outputs: list[Output] = [
        (csv, lambda: trade_csv(fronts)),
        (json, traded.to_dict),
        (plot, partial(_picture, traded)),
    ]
    files, unsaved = ([], []) if schedules is None else _schedules(fronts, schedules)
    job.deliver([*outputs, *files], partial(_screen, traded, verbose), unsaved=unsaved)
    leave(infeasible=not any(front.points for front in fronts))


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


def _picture(traded: Trade) -> Figure:
    from nutdamp.figures import trade

    return trade.trade_figure(traded.spacecraft, traded.fronts)


def _screen(traded: Trade, verbose: bool) -> RenderableType:
    from nutdamp.views.trade import trade_brief, trade_screen

    return (trade_screen if verbose else trade_brief)(traded.spacecraft, traded.fronts)
