"""Telemetry fitted, and the spacecraft that it makes."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

from nutdamp import arguments
from nutdamp.errors import BadRequest
from nutdamp.estimation import fit as fits
from nutdamp.estimation import outlook, results
from nutdamp.estimation.doubts import doubts
from nutdamp.library.craft import Source, expected, read
from nutdamp.planning import Plan
from nutdamp.rounding import finite
from nutdamp.spacecraft import Spacecraft

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.estimation.outlook import Outlook


@dataclass(frozen=True, eq=False)
class Fitted:
    """What telemetry tells of a spacecraft; ``core`` holds parameters, covariance, noise and residuals.

    ``warnings`` are those of reading the record.
    """

    core: fits.Fit
    warnings: tuple[str, ...] = ()

    def estimates(self, at: float = 0.0) -> tuple[results.Estimate, ...]:
        """Estimates with their sigmas; the motion is that at ``at`` s."""
        return results.estimates(self.core, at)

    def outlook(self, at: float = 0.0) -> outlook.Outlook:
        """What longer coasts and probe pulses would leave of a plan from ``at`` s, as ``fit --next`` does."""
        return outlook.outlook(self.core, at)

    def text(self, at: float = 0.0) -> str:
        """The spacecraft file with the estimates in it and t = 0 at ``at`` s, as ``fit -o`` writes it.

        Raises BadRequest for a spacecraft that was not read from a file.
        """
        from nutdamp.files.fitted_file import fitted_text

        source = self.core.model.spacecraft.source
        if not isinstance(source, Source):
            raise BadRequest("fit: expected a spacecraft from nutdamp.load, read or example, with no field replaced")
        return fitted_text(source.text, source.name, source.settings, self.core, results.carried(self.core, at))

    def spacecraft(self, at: float = 0.0) -> Spacecraft:
        """The spacecraft of that file."""
        return read(self.text(at), "fitted")

    def write(self, path: str | PathLike[str], at: float = 0.0) -> None:
        """Write `text` to a file, as ``fit -o`` does; raises BadRequest or CannotWrite."""
        from nutdamp.files.output import write_whole

        write_whole(arguments.path("path", path), self.text(at))

    def figure(self) -> Figure:
        """Data, fit and residuals, as ``fit --plot`` draws them."""
        from nutdamp.presentation.figures.fit import fit_figure

        return fit_figure(self.core)

    def to_dict(self, at: float = 0.0, ahead: Outlook | None = None) -> dict[str, Any]:
        """What ``fit --json`` gives; with an `outlook`, what ``fit --next --json`` gives."""
        from nutdamp.files.fit_json import fit_json

        return finite(fit_json(self.core, results.carried(self.core, at), ahead, self.warnings))


def fit(
    telemetry: str | PathLike[str],
    spacecraft: Spacecraft,
    *,
    schedule: Plan | None = None,
    sun_pulses: str | PathLike[str] | None = None,
) -> Fitted:
    """Estimate a spacecraft from a CSV file of telemetry, as ``nutdamp fit`` does.

    ``schedule``: what was fired during the record (`nutdamp.load_schedule`); ``sun_pulses``: a CSV file of their times.
    Warns of columns that are ignored, and of what makes the estimates doubtful. Raises CannotRead, FaultyFile,
    BadRequest, and Infeasible where the record tells nothing.
    """
    from nutdamp.files.telemetry_csv import read_telemetry

    body, name = expected(spacecraft), arguments.path("telemetry", telemetry)
    fired = None if schedule is None else arguments.instance("schedule", schedule, Plan, "a Plan").pulses
    times = None if sun_pulses is None else arguments.path("sun_pulses", sun_pulses)
    record, remarks = read_telemetry(name, body, times, fired)
    found = fits.fit(body, record)
    for remark in (*remarks, *doubts(found)):
        warnings.warn(remark, stacklevel=2)
    return Fitted(found, tuple(remarks))
