"""``nutdamp loop``: fire from what a sensor shows, in a closed loop."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import click

from nutdamp.cli.boundary import INFEASIBLE, REQUIREMENT_MISSED
from nutdamp.cli.common import (
    Input,
    Output,
    deliver,
    expect_picture,
    expect_places,
    load,
    quiet_option,
    remarks,
    require_loop,
    spacecraft_argument,
)
from nutdamp.cli.parameters import FILE, Quantity
from nutdamp.cli.places import expect_outputs
from nutdamp.cli.screen import say

if TYPE_CHECKING:
    from rich.console import RenderableType


@click.command("loop")
@spacecraft_argument
@click.option("--until", type=Quantity("time"), help="End; default: the horizon after the nutation is at start.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of the noise of the sensor.")
@click.option(
    "--samples", type=click.IntRange(2, 10_000_000), default=1000, show_default=True, help="Rows of the track."
)
@click.option("--csv", type=FILE, help="Write the pulses, as `plan --csv` does.")
@click.option("--track", type=FILE, help="Write the track, as `simulate --csv` does.")
@click.option("--json", type=FILE, help="Write firings, dead band, margins.")
@click.option("--plot", type=FILE, help="Draw signal, nutation and firings (.png, .svg, .pdf; needs extra plot).")
@click.option("--map", "mapped", type=FILE, help="Where delay and C/A let it damp: .csv, or a picture.")
@quiet_option
def command(
    spacecraft: Input,
    until: float | None,
    seed: int,
    samples: int,
    csv: str | None,
    track: str | None,
    json: str | None,
    plot: str | None,
    mapped: str | None,
    quiet: bool,
) -> None:
    """Fly the closed loop of the file: fire from what its gyro or accelerometer shows, and see where it ends.

    A channel wired backwards, a reversed sensor and firings that come too late are found and named before they feed
    the nutation for more than a period: exit status 3. SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    if until is not None and until <= 0.0:
        raise click.BadParameter("expected a time after t = 0", param_hint="--until")
    silent = expect_outputs(spacecraft, csv=csv, track=track, json=json, plot=plot, map=mapped)
    expect_picture(plot)
    drawn = mapped is not None and Path(mapped).suffix.lower() not in ("", ".csv")
    if drawn:
        expect_picture(mapped)
    remark = remarks(quiet)
    body = load(spacecraft, remark)
    expect_places(csv, track, json, plot, mapped)

    from nutdamp.cli.progress import working
    from nutdamp.loop.plan import loop_of
    from nutdamp.presentation.loop_tables import loop_screen, stopped, warnings

    require_loop(body)
    with working("flying", quiet=quiet):
        plan = loop_of(body, until, seed=seed)
    run = plan.flown_run

    def pulses() -> str:
        from nutdamp.files.pulses_csv import pulses_csv

        return pulses_csv(run.flight)

    def rows() -> Callable[[IO[bytes]], None]:
        from nutdamp.files.track_csv import write_track

        return lambda stream: write_track(stream, run.flight.pieces(samples, run.until), body.inertia)

    def data() -> dict[str, Any]:
        from nutdamp.files.loop_json import loop_json

        return loop_json(plan)

    def picture() -> bytes:
        from nutdamp.presentation import figures
        from nutdamp.presentation.figures.loop import loop_figure

        assert plot is not None
        return figures.rendered(loop_figure(plan), plot)

    def regions() -> str | bytes:
        from nutdamp.files.loop_json import map_csv
        from nutdamp.loop.stability import delay_map

        assert body.loop is not None
        found = delay_map(body, body.loop)
        if not drawn:
            return map_csv(found)
        from nutdamp.presentation import figures
        from nutdamp.presentation.figures.loop import map_figure

        assert mapped is not None
        return figures.rendered(map_figure(found, body.inertia.C / body.inertia.A), mapped)

    def screen() -> RenderableType:
        return loop_screen(plan)

    if silent:
        for warning in warnings(body):
            remark(f"warning: {warning}")
    outputs: list[Output] = [(csv, pulses), (track, rows), (json, data), (plot, picture), (mapped, regions)]
    deliver(outputs, *[screen] * (not silent))
    if run.stop.fault:
        say(f"nutdamp: the loop was stopped {stopped(run)}")
        sys.exit(INFEASIBLE)
    if plan.meets_requirement is False:
        sys.exit(REQUIREMENT_MISSED)
