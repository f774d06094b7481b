"""``nutdamp trade``: what time costs, as a front of schedules."""

from __future__ import annotations

import math
import sys
from functools import partial
from typing import TYPE_CHECKING

import click

from nutdamp.cli.boundary import INFEASIBLE
from nutdamp.cli.common import (
    Input,
    Output,
    deliver,
    expect_picture,
    expect_places,
    load,
    quiet_option,
    remarks,
    spacecraft_argument,
)
from nutdamp.cli.parameters import FILE, FOLDER, Bare, Named, Quantity, reading_of
from nutdamp.cli.places import expect_outputs
from nutdamp.cli.scheme_options import Aim, PlanningCommand, expect_read, goal_options
from nutdamp.schemes.options import LEAST, Options
from nutdamp.schemes.registry import OPTIMAL

if TYPE_CHECKING:
    from rich.console import RenderableType

    from nutdamp.errors import CannotWrite


class Allowance(Quantity):
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
    type=Named(LEAST[:2]),
    default=LEAST[0],
    show_default=True,
    help="What is traded against time; impulse where propellant is unknown.",
)
@goal_options
@click.option("--csv", type=FILE, help="Write the points.")
@click.option("--json", type=FILE, help="Write the points with their pulses.")
@click.option("--plot", type=FILE, help="Draw the fronts (.png, .svg, .pdf; needs the extra plot).")
@click.option("--schedules", type=FOLDER, help="Write each schedule as FOLDER/point-N.csv, as `plan --csv` does.")
@quiet_option
def command(
    spacecraft: Input,
    allow: tuple[float, ...],
    points: int,
    least: str,
    options: Options,
    aim: Aim,
    csv: str | None,
    json: str | None,
    plot: str | None,
    schedules: str | None,
    quiet: bool,
) -> None:
    """Trade time against propellant: the cheapest schedules found for ends from the earliest to the horizon.

    Each front is of the scheme optimal (of the others where that finds none) and holds no schedule that another beats
    in both. SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    if any(shift < 0.0 for shift in allow):
        raise click.BadParameter("expected an angle of at least 0, or any", param_hint="--allow")
    from nutdamp.files.trade_files import schedule_files, schedule_path, trade_csv
    from nutdamp.fronts import numbered
    from nutdamp.library.studies import trade
    from nutdamp.remarks import CUT

    shifts = allow or (0.0, math.inf)
    most = points * len(set(shifts))
    written = [] if schedules is None else [schedule_path(schedules, index) for index in range(1, most + 1)]
    silent = expect_outputs(spacecraft, csv=csv, json=json, plot=plot, schedules=written)
    expect_picture(plot)
    remark = remarks(quiet)
    for shift in allow:
        if isinstance(shift, Bare) and shift:
            remark(f"--allow: warning: {reading_of(shift, 'angle', 'deg')}")
    body = load(spacecraft, remark, aim)
    expect_places(csv, json, plot)
    expect_read((OPTIMAL.name,), options, body, remark)

    from nutdamp.cli.progress import progress

    known = options.with_disturbances
    with progress("searching", most, quiet=quiet) as step:
        traded = trade(body, points, shifts, least, with_disturbances=known, progress=step)
    found = traded.fronts
    for index, _, point in numbered(found):
        if point.plan.cut:
            remark(f"point {index}: {CUT}")

    def picture() -> bytes:
        from nutdamp.presentation import figures

        assert plot is not None
        return figures.rendered(figures.trade_figure(body, found), plot)

    def screen() -> RenderableType:
        from nutdamp.presentation.trade_tables import trade_screen

        return trade_screen(body, found)

    outputs: list[Output] = [(csv, lambda: trade_csv(found)), (json, traded.to_dict), (plot, picture)]
    unsaved: list[CannotWrite] = []
    if schedules is not None:
        from nutdamp.errors import CannotWrite
        from nutdamp.files.output import make_folder

        try:
            make_folder(schedules)
            outputs += [(path, partial(str, text)) for path, text in schedule_files(found, schedules)]
        except CannotWrite as wrong:
            unsaved.append(wrong)
    deliver(outputs, *[screen] * (not silent), unsaved=unsaved)
    if not any(front.points for front in found):
        sys.exit(INFEASIBLE)
