"""``nutdamp fit``: estimate the spacecraft from telemetry."""

from __future__ import annotations

from functools import partial

import click

from nutdamp.cli.job import Files, Job, quiet_option, screen_options, spacecraft_argument
from nutdamp.cli.options import FILE, OUTPUT, SessionCommand, UnitType


@click.command("fit", cls=SessionCommand)
@click.argument("telemetry", type=FILE, metavar="TELEMETRY.csv")
@spacecraft_argument
@click.option("--schedule", type=FILE, help="Pulses fired during the record, a CSV file as `plan --csv` writes it.")
@click.option("--sun-pulses", type=FILE, help="Times of Sun pulses, a CSV file: t_s or utc, and any sun_aspect_deg.")
@click.option("--at", type=UnitType("time"), default=0.0, help="Show and write the motion at this time; default 0 s.")
@click.option("-o", "--output", type=OUTPUT, help="Write the spacecraft file with the estimates in it.")
@click.option("--json", type=OUTPUT, help="Write estimates, covariance and signals.")
@click.option("--plot", type=OUTPUT, help="Draw data, fit and residuals (.png, .svg, .pdf; needs extra plot).")
@click.option("--next", "ahead", is_flag=True, help="Say whether a longer coast or a probe pulse would pay.")
@screen_options
@quiet_option
def command(job: Job, telemetry: str, sun_pulses: str | None, at: float, ahead: bool, verbose: bool) -> None:
    """Estimate motion, C/A, dissipation and sensor errors from telemetry, and thrust factors from pulses fired in it.

    TELEMETRY.csv has t_s or utc, and any of omega_1_rad_s, omega_2_rad_s, omega_3_rad_s (or _deg_s), axis_ra_deg and
    axis_dec_deg, axis_x, axis_y and axis_z, q_w to q_z, acceleration_m_s2, crossing_azimuth_deg and
    crossing_elevation_deg of crossing_ra_deg and crossing_dec_deg (of the Sun where they are empty), sun_aspect_deg,
    sun_pulse (0 or 1); empty cells are missing samples.
    Least squares on the closed forms of the coast; what the data do not tell stays at the tolerances of the file.
    -o writes the file with its comments kept: motion at --at, moments, and as dispersions how well all is known.

    \b
      nutdamp fit flight.csv -o now.yaml --at 90s
      nutdamp plan now.yaml

    Exit status 3 where nothing can be estimated, several nutation rates fit equally well, or residuals are no noise,
    as with a pulse that --schedule does not have. SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    body = job.begin()

    from nutdamp.api import fit
    from nutdamp.estimation.results import carried
    from nutdamp.files.fitted import notes
    from nutdamp.views.fit import fit_screen

    with job.working("fitting"):
        fitted = fit(telemetry, body, schedule=job.flown.schedule, sun_pulses=sun_pulses, ignored=job.doubt)
    job.warn(notes(fitted.core, carried(fitted.core, at)))
    with job.working("looking ahead"):
        prospects = fitted.outlook(at) if ahead else None
    files: Files = {"output": partial(fitted.text, at), "json": partial(fitted.to_dict, at, prospects)}
    job.deliver(fitted, partial(fit_screen, fitted.core, at, prospects, verbose=verbose), more=files)
