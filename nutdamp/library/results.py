"""Plans, the flights of their schedules, and comparisons of plans."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nutdamp import arguments, planning
from nutdamp import flight as flights
from nutdamp.errors import BadRequest, Infeasible
from nutdamp.flight import Residual
from nutdamp.library.craft import Source, Spacecraft
from nutdamp.library.notebook import block, data_frame
from nutdamp.outcome import seen_at
from nutdamp.presentation.text import degrees
from nutdamp.remarks import infeasibility, remarks
from nutdamp.track import Track, in_file_axes, in_pieces

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

Table = NDArray[np.void]
"""A structured array: one row a pulse or a sample, fields named as the columns of the CSV files."""


@dataclass(frozen=True, eq=False, repr=False)
class Flight:
    """A schedule flown: ``track`` over time, ``residual`` at its end.

    ``core`` and ``sampled`` hold the flight, as it is at the end, and its track in principal axes; ``by_impulses``:
    not through the real widths.
    """

    core: flights.Flight
    sampled: Track
    by_impulses: bool = False
    source: Source | None = None

    @property
    def spacecraft(self) -> Spacecraft:
        """What was flown."""
        return Spacecraft(self.core.spacecraft, self.source)

    @property
    def track(self) -> Track:
        """The motion as arrays: SI and rad, body rates and quaternion in the axes of the file."""
        return in_file_axes(self.sampled, self.core.spacecraft.inertia)

    @property
    def residual(self) -> Residual:
        """Cone angles and shift of H at the end of the track, rad."""
        return self.core.residual

    def to_numpy(self) -> Table:
        """The track with the columns of `to_csv` as fields: ``flight.to_numpy()["nutation_deg"]``."""
        from nutdamp.files.track_csv import track_array

        return track_array(self.sampled, self.core.spacecraft.inertia)

    def to_pandas(self) -> DataFrame:
        """`to_numpy` as a DataFrame; raises MissingPandas where pandas is not installed."""
        return data_frame(self.to_numpy())

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the track as ``simulate --csv`` does; raises CannotWrite."""
        from nutdamp.files.output import whole_file
        from nutdamp.files.track_csv import write_track

        with whole_file(arguments.path("path", path)) as stream:
            write_track(stream, in_pieces(self.sampled), self.core.spacecraft.inertia)

    def figure(self, name: str = "overview") -> Figure:
        """A matplotlib figure: ``overview``, ``motion``, ``sphere``, ``history`` or ``timeline``.

        Raises BadRequest for other names, MissingExtra without matplotlib.
        """
        from nutdamp.presentation import figures

        arguments.instance("name", name, str, "the name of a figure")
        try:
            return figures.named(name, self.core, self.sampled)
        except KeyError:
            raise BadRequest(f"there is no figure {name!r}") from None

    @property
    def _summary(self) -> str:
        how = "the impulse sum" if self.by_impulses else "real widths"
        return f"{len(self.core.schedule)} pulses until {float(self.sampled.t[-1]):.4g} s by {how}"

    def __repr__(self) -> str:
        left = self.residual
        return (
            f"<Flight of {self._summary}: nutation left {degrees(left.nutation)}, "
            f"shift of H {degrees(left.momentum_shift)}>"
        )

    def _repr_html_(self) -> str:
        from nutdamp.presentation.page.sheets import residual_sheet

        return block(residual_sheet(f"{self.spacecraft.name}: {self._summary}", self.residual))


@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """A scheme's schedule for a spacecraft, and how it was judged; an infeasible one says ``why``.

    ``from_file``: its pulses were read, and no scheme planned them.
    """

    core: planning.Plan
    source: Source | None = None
    from_file: bool = False

    @property
    def spacecraft(self) -> Spacecraft:
        """What it was planned for."""
        return Spacecraft(self.core.spacecraft, self.source)

    @property
    def scheme(self) -> str:
        """Name of the scheme, or of the schedule file."""
        return self.core.scheme

    @property
    def feasible(self) -> bool:
        """Whether the schedule keeps every limit and lowers the nutation."""
        return self.core.feasible

    @property
    def why(self) -> str | None:
        """Why there is no schedule; None where there is one."""
        return infeasibility(self.core) or None

    @property
    def meets_requirement(self) -> bool | None:
        """Whether the flown residual keeps the requirement of the file; None without one."""
        return self.core.meets_requirement

    @property
    def residual(self) -> Residual | None:
        """What remains by the impulse sum (17), rad; None where infeasible."""
        return self.core.residual

    @property
    def flown(self) -> Residual | None:
        """What remains when the real pulse widths are flown, rad; None where infeasible."""
        return self.core.flown

    @property
    def total_impulse(self) -> float:
        """Σ |J| in N m s."""
        return self.core.pulses.total_impulse

    @property
    def propellant(self) -> float | None:
        """kg; None where one pulse's is not known."""
        return self.core.pulses.propellant

    @property
    def end(self) -> float:
        """End of the last pulse, s."""
        return self.core.pulses.end

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader should know of it."""
        return remarks(self.core)

    def __len__(self) -> int:
        return len(self.core.pulses)

    def fly(self, until: float | None = None, *, samples: int = 1000, by_impulses: bool = False) -> Flight:
        """Fly the schedule through its real pulse widths, or by the impulse sum (17), until ``until`` s.

        Default end: one inertial nutation period after the last pulse. The track has ``samples`` even rows, and rows
        just before and after each pulse. Raises Infeasible where there is no schedule, BadRequest where no track can
        be made.
        """
        feasible_core(self)
        body, pulses = self.core.spacecraft, self.core.pulses
        end = arguments.end_of_flight(pulses.end + body.inertial_period if until is None else until)
        count = arguments.rows(samples)
        made = seen_at((flights.by_impulses if by_impulses else flights.flown)(body, pulses, end), end)
        return Flight(made, made.track(count, end), by_impulses, self.source)

    def to_numpy(self) -> Table:
        """The pulses with the columns of `to_csv` as fields; empty where infeasible."""
        from nutdamp.files.pulses_csv import pulses_array

        return pulses_array(self.core.flight)

    def to_pandas(self) -> DataFrame:
        """`to_numpy` as a DataFrame; raises MissingPandas where pandas is not installed."""
        return data_frame(self.to_numpy())

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the pulses as ``plan --csv`` does; raises CannotWrite, and Infeasible where there is no schedule."""
        from nutdamp.files.output import write_whole
        from nutdamp.files.pulses_csv import pulses_csv

        feasible_core(self)
        write_whole(arguments.path("path", path), pulses_csv(self.core.flight))

    def to_dict(self) -> dict[str, Any]:
        """What ``plan --json`` says of it."""
        from nutdamp.files.output import finite
        from nutdamp.files.plan_json import plan_json

        return finite(plan_json(self.core))

    def __repr__(self) -> str:
        left = self.flown
        if left is None:
            return f"<Plan {self.scheme}: infeasible, {self.why}>"
        return (
            f"<Plan {self.scheme}: {len(self)} pulses until {self.end:.4g} s, nutation left {degrees(left.nutation)}>"
        )

    def _repr_html_(self) -> str:
        from nutdamp.presentation.page.document import Prose
        from nutdamp.presentation.page.sheets import pulse_sheet

        return block(pulse_sheet(self.core) if self.feasible else Prose(repr(self)[1:-1]))


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Several plans for one spacecraft; ``comparison["two-pulse"]`` is one of them, iterating gives all."""

    core: planning.Comparison
    source: Source | None = None

    @property
    def plans(self) -> tuple[Plan, ...]:
        """All plans, infeasible ones too."""
        return tuple(Plan(one, self.source) for one in self.core.plans)

    @property
    def recommended(self) -> Plan | None:
        """The plan to fly; None where no scheme is feasible."""
        return None if self.core.recommended is None else Plan(self.core.recommended, self.source)

    @property
    def reason(self) -> str:
        """Why that one."""
        from nutdamp.presentation import verdicts

        return verdicts.reason(self.core)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the recommended plan does not reach, and what stands in the way."""
        from nutdamp.presentation import verdicts

        return verdicts.warnings(self.core)

    def __len__(self) -> int:
        return len(self.core.plans)

    def __iter__(self) -> Iterator[Plan]:
        return iter(self.plans)

    def __getitem__(self, scheme: str) -> Plan:
        for one in self.plans:
            if one.scheme == scheme:
                return one
        raise KeyError(scheme)

    def to_dict(self) -> dict[str, Any]:
        """What ``plan --json`` gives."""
        from nutdamp.files.output import finite
        from nutdamp.files.plan_json import comparison_json
        from nutdamp.presentation import verdicts

        return finite(comparison_json(self.core, verdicts.spoken(self.core)))

    def __repr__(self) -> str:
        chosen = self.core.recommended
        verdict = self.reason if chosen is None else f"recommended {chosen.scheme}, {self.reason}"
        return f"<Comparison of {', '.join(one.scheme for one in self.core.plans)}: {verdict}>"

    def _repr_html_(self) -> str:
        from nutdamp.presentation.page.sheets import comparison_sheet

        return block(comparison_sheet(self.core))


def feasible_core(plan: Plan) -> planning.Plan:
    """What the modules below take; raises BadRequest for what is no `Plan`, Infeasible for one without a schedule."""
    core = arguments.instance("plan", plan, Plan, "a Plan, as nutdamp.plan gives it").core
    if not core.feasible:
        raise Infeasible(f"{core.scheme} is infeasible: {infeasibility(core)}")
    return core
