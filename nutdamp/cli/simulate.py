"""``nutdamp simulate``: propagate a scheme or a schedule file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from nutdamp.cli.common import (
    Input,
    Output,
    deliver,
    expect_picture,
    expect_places,
    load,
    plan_or_read,
    plot_options,
    quiet_option,
    remarks,
    spacecraft_argument,
)
from nutdamp.cli.parameters import FILE, Named, Quantity
from nutdamp.cli.places import expect_outputs
from nutdamp.cli.scheme_options import Aim, PlanningCommand, goal_options
from nutdamp.schemes import NAMES, Options

if TYPE_CHECKING:
    from rich.console import RenderableType


PICTURED = 100_000
"""Rows of the track of a picture at most."""


@click.command("simulate", cls=PlanningCommand)
@spacecraft_argument
@click.option(
    "--scheme",
    type=Named(NAMES),
    help="Plan this scheme with default options and propagate it, not the recommended one; none is free motion.",
)
@click.option("--schedule", type=FILE, help="Propagate the pulses of a CSV file, as `plan --csv` writes it.")
@goal_options
@click.option("--flown", "real", is_flag=True, help="Propagate real pulse widths instead of the impulse sum (17).")
@click.option(
    "--until",
    type=Quantity("time"),
    help="End, of which the outcome is shown; default last pulse + one inertial period.",
)
@click.option(
    "--samples", type=click.IntRange(2, 10_000_000), default=1000, show_default=True, help="Rows of the track."
)
@click.option("--csv", type=FILE, help="Write the track.")
@click.option("--json", type=FILE, help="Write pulses, how both models end, and extremes.")
@plot_options
@click.option("--show", "drawn", is_flag=True, help="Draw pole curve and axis track in the terminal.")
@quiet_option
def command(
    spacecraft: Input,
    scheme: str | None,
    schedule: str | None,
    options: Options,
    aim: Aim,
    real: bool,
    until: float | None,
    samples: int,
    csv: str | None,
    json: str | None,
    plot: str | None,
    figure: str,
    drawn: bool,
    quiet: bool,
) -> None:
    """Propagate a schedule; show cone angles around each pulse, how it ends by both models, and the axis track.

    SPACECRAFT is a YAML file, or - for standard input; without it spacecraft.yaml in this folder, else the built-in
    example. A FILE of - is standard output, for --schedule standard input.
    """
    if scheme is not None and schedule is not None:
        raise click.UsageError("name what to propagate: either --scheme or --schedule")
    if until is not None and until <= 0.0:
        raise click.BadParameter("expected a time after t = 0", param_hint="--until")
    silent = expect_outputs(spacecraft, schedule, csv=csv, json=json, plot=plot)
    if drawn and silent:
        raise click.UsageError("--show draws on standard output, where a FILE of - already goes")
    expect_picture(plot, figure)
    remark = remarks(quiet)
    body = load(spacecraft, remark, aim)
    expect_places(csv, json, plot)

    from nutdamp import flight
    from nutdamp.outcome import seen_at
    from nutdamp.track import extremes

    plan = plan_or_read(body, scheme, schedule, options, remark, quiet=quiet)
    pulses = plan.pulses
    end = pulses.end + body.inertial_period if until is None else until
    flights = flight.by_impulses(body, pulses, end), flight.flown(body, pulses, end)
    impulses, flown = ends = tuple(seen_at(one, end) for one in flights)
    moving, chosen = flights[real], ends[real]
    found = extremes(moving.pieces(samples, end))
    track = moving.sampled(min(samples, PICTURED), end) if plot is not None or drawn else None
    outputs: list[Output] = []
    if csv is not None:
        from nutdamp.files.track_csv import write_track

        outputs.append((csv, lambda stream: write_track(stream, moving.pieces(samples, end), body.inertia)))
    if json is not None:
        from nutdamp.files.output import json_text
        from nutdamp.files.simulation_json import simulation_json

        outputs.append(
            (json, json_text(simulation_json(chosen, found, impulses, flown, scheme=plan.scheme, real=real)))
        )
    if plot is not None and track is not None:
        from nutdamp.presentation import figures

        outputs.append((plot, figures.picture(figure, chosen, track, plot)))
    screens: list[RenderableType] = []
    if silent:
        from nutdamp.presentation.verdicts import model_warnings

        for warning in model_warnings(impulses, flown):
            remark(f"warning: {warning}")
    else:
        from nutdamp.presentation.simulate_tables import simulation_screen

        how = f"{plan.scheme}, propagated by the {'real pulse widths' if real else 'impulse sum (17)'}"
        screens.append(simulation_screen(chosen, found, impulses, flown, how=how, pulses=len(pulses)))
    if track is not None and drawn:
        from nutdamp.presentation.terminal import motion_drawing

        screens.append(motion_drawing(chosen, track))
    deliver(outputs, *screens)
