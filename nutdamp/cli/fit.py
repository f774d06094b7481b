"""``nutdamp fit``: estimate the spacecraft from telemetry."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

from nutdamp.cli.job import FileInput, Output, begin, quiet_option, spacecraft_argument, verbose_option, working
from nutdamp.cli.options import FILE, UnitType

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.estimation.fit import Fit
    from nutdamp.estimation.forecast import Outlook


@click.command("fit")
@click.argument("telemetry", type=FILE, metavar="TELEMETRY.csv")
@spacecraft_argument
@click.option("--schedule", type=FILE, help="Pulses fired during the record, a CSV file as `plan --csv` writes it.")
@click.option("--sun-pulses", type=FILE, help="Times of Sun pulses: a CSV file with a column t_s or utc.")
@click.option("--at", type=UnitType("time"), default=0.0, help="Show and write the motion at this time; default 0 s.")
@click.option("-o", "--output", type=FILE, help="Write the spacecraft file with the estimates in it.")
@click.option("--json", type=FILE, help="Write estimates, covariance and signals.")
@click.option("--plot", type=FILE, help="Draw data, fit and residuals (.png, .svg, .pdf; needs extra plot).")
@click.option("--next", "ahead", is_flag=True, help="Say whether a longer coast or a probe pulse would pay.")
@verbose_option
@quiet_option
def command(
    telemetry: str,
    spacecraft: FileInput,
    schedule: str | None,
    sun_pulses: str | None,
    at: float,
    output: str | None,
    json: str | None,
    plot: str | None,
    ahead: bool,
    verbose: bool,
    quiet: bool,
) -> None:
    """Estimate motion, C/A, dissipation and sensor errors from telemetry, and thrust factors from pulses fired in it.

    TELEMETRY.csv has t_s or utc, and any of omega_1_rad_s, omega_2_rad_s, omega_3_rad_s (or _deg_s), axis_ra_deg and
    axis_dec_deg, axis_x, axis_y and axis_z, acceleration_m_s2, sun_pulse (0 or 1); empty cells are missing samples.
    Least squares on the closed forms of the coast; what the data do not tell stays at the tolerances of the file.
    -o writes the file with its comments kept: motion at --at, moments, and as dispersions how well all is known.

    \b
      nutdamp fit flight.csv -o now.yaml --at 90s
      nutdamp plan now.yaml

    Exit status 3 where nothing can be estimated, several nutation rates fit equally well, or residuals are no noise,
    as with a pulse that --schedule does not have. SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    job = begin(spacecraft, telemetry, schedule, sun_pulses, quiet=quiet, output=output, json=json, plot=plot)

    from nutdamp.estimation.fit import fit
    from nutdamp.estimation.results import carried
    from nutdamp.files.editing import fitted_text, notes
    from nutdamp.files.schedules import read_pulses
    from nutdamp.files.telemetry import read_telemetry
    from nutdamp.views.fit import fit_json, fit_screen

    fired = None
    if schedule is not None:
        fired, warnings = read_pulses(schedule, job.spacecraft)
        job.doubt(warnings)
    record, read = read_telemetry(telemetry, job.spacecraft, sun_pulses, fired)
    job.doubt(read)
    with working("fitting", quiet=quiet):
        estimate = fit(job.spacecraft, record)
    now = carried(estimate, at)
    job.warn(notes(estimate, now))
    prospects = _outlook(estimate, at, quiet) if ahead else None
    outputs: list[Output] = [
        (output, partial(fitted_text, *job.source, spacecraft.settings, estimate, now)),
        (json, partial(fit_json, estimate, now, prospects, read)),
        (plot, partial(_picture, estimate)),
    ]
    job.deliver(outputs, partial(fit_screen, estimate, at, prospects, verbose=verbose))


def _outlook(estimate: Fit, at: float, quiet: bool) -> Outlook:
    from nutdamp.estimation.forecast import outlook

    with working("looking ahead", quiet=quiet):
        return outlook(estimate, at)


def _picture(estimate: Fit) -> Figure:
    from nutdamp.figures.fit import fit_figure

    return fit_figure(estimate)
