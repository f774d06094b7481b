"""``nutdamp simulate``: propagate a scheme or a schedule file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import IO, TYPE_CHECKING, Any

import click

from nutdamp.cli.common import (
    FIGURES,
    Flown,
    Input,
    deliver,
    expect_picture,
    expect_places,
    fire_blocks,
    flown_options,
    load,
    plan_or_read,
    plot_options,
    quiet_option,
    remarks,
    spacecraft_argument,
)
from nutdamp.cli.parameters import FILE, Quantity
from nutdamp.cli.places import expect_outputs
from nutdamp.cli.scheme_options import Aim, PlanningCommand, goal_options
from nutdamp.schemes import Options

if TYPE_CHECKING:
    from rich.console import RenderableType


PICTURED = 100_000
"""Rows of the track of a picture at most."""


@click.command("simulate", cls=PlanningCommand)
@spacecraft_argument
@flown_options(
    "Propagate", "Plan this scheme with default options and propagate it, not the recommended one; none is free motion."
)
@goal_options
@click.option("--blocks", type=FILE, help="Fire the command blocks of a CSV file, as `plan --blocks` writes it.")
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
@plot_options(FIGURES)
@click.option("--show", "drawn", is_flag=True, help="Draw pole curve and axis track in the terminal.")
@quiet_option
def command(
    spacecraft: Input,
    flown: Flown,
    options: Options,
    aim: Aim,
    blocks: str | None,
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
    if until is not None and until <= 0.0:
        raise click.BadParameter("expected a time after t = 0", param_hint="--until")
    if blocks is not None and flown != (None, None):
        raise click.UsageError("name what to propagate: one of --scheme, --schedule and --blocks")
    silent = expect_outputs(spacecraft, flown.schedule, blocks, csv=csv, json=json, plot=plot)
    if drawn and silent:
        raise click.UsageError("--show draws on standard output, where a FILE of - already goes")
    expect_picture(plot, figure)
    remark = remarks(quiet)
    body = load(spacecraft, remark, aim)
    expect_places(csv, json, plot)

    from nutdamp import flight
    from nutdamp.decision import Decision
    from nutdamp.outcome import seen_at
    from nutdamp.presentation.geometry import shown_until
    from nutdamp.track import extremes

    if blocks is None:
        plan = plan_or_read(body, flown, options, remark, quiet=quiet)
    else:
        plan = fire_blocks(blocks, body, options, remark)
    pulses = plan.pulses
    end = pulses.end + body.inertial_period if until is None else until
    flights = flight.by_impulses(body, pulses, end), flight.flown(body, pulses, end)
    ends = tuple(seen_at(one, end) for one in flights)
    moving, chosen = flights[real], replace(ends[real], scheme=plan.scheme)
    pictured = shown_until(body, pulses) if until is None else until
    found, decided = extremes(moving.pieces(samples, end)), Decision(plan, seen=ends[1])
    track = moving.sampled(min(samples, PICTURED), pictured) if plot is not None or drawn else None

    def rows() -> Callable[[IO[bytes]], None]:
        from nutdamp.files.track_csv import write_track

        return lambda stream: write_track(stream, moving.pieces(samples, end), body.inertia)

    def data() -> dict[str, Any]:
        from nutdamp.files.simulation_json import simulation_json
        from nutdamp.presentation.decisions import verdict

        return simulation_json(chosen, found, ends[0], decided, verdict(decided), real=real)

    def picture() -> bytes:
        from nutdamp.presentation import figures

        assert plot is not None
        assert track is not None
        return figures.picture(figure, chosen, track, plot)

    def screen() -> RenderableType:
        from nutdamp.presentation.simulate_tables import simulation_screen

        how = f"{plan.scheme}, propagated by the {chosen.model}"
        return simulation_screen(chosen, found, ends[0], decided, how=how)

    def drawing() -> RenderableType:
        from nutdamp.presentation.terminal import motion_drawing

        assert track is not None
        return motion_drawing(chosen, track)

    if silent:
        from nutdamp.presentation.verdicts import model_warnings

        for warning in model_warnings(*ends):
            remark(f"warning: {warning}")
    screens = [*[screen] * (not silent), *[drawing] * drawn]
    deliver([(csv, rows), (json, data), (plot, picture)], *screens)
