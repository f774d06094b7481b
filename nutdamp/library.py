"""nutdamp as a library: load a spacecraft, plan a scheme, fly it, and take the numbers along.

    import nutdamp

    spacecraft = nutdamp.load("spacecraft.yaml")
    plan = nutdamp.plan(spacecraft, "two-pulse")
    flight = plan.fly()
    flight.to_csv("track.csv")

It stands beside the command line, on top of everything else: thin objects that hold the results of the floors below
(``core``) and add what knows files and screens. Attributes are SI and radians, vectors in the axes of the spacecraft
file; arrays with named fields carry the names and units of the CSV files.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nutdamp import arguments, planning
from nutdamp import flight as flights
from nutdamp import spacecraft as craft
from nutdamp.errors import BadRequest, Fault, Infeasible, printable
from nutdamp.flight import Residual
from nutdamp.limits import broken_limits
from nutdamp.outcome import seen_at
from nutdamp.remarks import remarks
from nutdamp.report.text import degrees
from nutdamp.schemes import Choice, Options
from nutdamp.schemes.options import FourPulseOptions, HalfConeOptions, OptimalOptions, RhumbLineOptions, TwoPulseOptions
from nutdamp.spacecraft import Inertia
from nutdamp.track import Track, in_file_axes, in_pieces

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.report.page.document import Block

__all__ = [
    "Comparison",
    "Flight",
    "FourPulseOptions",
    "HalfConeOptions",
    "OptimalOptions",
    "Options",
    "Plan",
    "Residual",
    "RhumbLineOptions",
    "Spacecraft",
    "Track",
    "TwoPulseOptions",
    "compare",
    "example",
    "load",
    "load_schedule",
    "plan",
    "read",
]

Table = NDArray[np.void]
"""A structured array: one row a pulse or a sample, fields named as the columns of the CSV files."""


@dataclass(frozen=True, eq=False, repr=False)
class Spacecraft:
    """A spacecraft as a file describes it; ``core`` holds it in principal axes, for the modules below."""

    core: craft.Spacecraft

    @property
    def name(self) -> str:
        """Its name."""
        return self.core.name

    @property
    def inertia(self) -> Inertia:
        """Principal moments (kg m²), the inertia ratio ``a`` and the shape."""
        return self.core.inertia

    @property
    def rates(self) -> NDArray[np.float64]:
        """Body rates at t = 0, (3,) rad/s, in the axes of the file."""
        return self.core.inertia.in_file(self.core.omega0)

    @property
    def nutation(self) -> float:
        """Nutation angle at t = 0, rad."""
        return self.core.nutation

    @property
    def body_period(self) -> float:
        """Nutation period seen in the body, s; infinite for a sphere."""
        return self.core.body_period

    @property
    def inertial_period(self) -> float:
        """Nutation period seen inertially, s."""
        return self.core.inertial_period

    @property
    def least_impulse(self) -> float:
        """A|ω0| in N m s: no schedule of a symmetric body removes the nutation with less."""
        return self.core.least_impulse

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels that can be fired."""
        return tuple(channel.name for channel in self.core.channels)

    def to_dict(self) -> dict[str, Any]:
        """What the JSON files say of a spacecraft."""
        from nutdamp.files.output import finite
        from nutdamp.files.plan_json import spacecraft_json

        return finite(spacecraft_json(self.core))

    def __repr__(self) -> str:
        inertia = self.inertia
        return f"<Spacecraft {self.name}: {inertia.shape}, a = {inertia.a:.4g}, nutation {degrees(self.nutation)}>"

    def _repr_html_(self) -> str:
        from nutdamp.report.page.sheets import spacecraft_facts

        return _html(spacecraft_facts(self.core, title=self.name))


@dataclass(frozen=True, eq=False, repr=False)
class Flight:
    """A schedule flown: ``track`` over time, ``residual`` at its end.

    ``core`` and ``sampled`` hold the flight, as it is at the end, and its track in principal axes; ``by_impulses``:
    not through the real widths.
    """

    core: flights.Flight
    sampled: Track
    by_impulses: bool = False

    @property
    def spacecraft(self) -> Spacecraft:
        """What was flown."""
        return Spacecraft(self.core.spacecraft)

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
        from nutdamp.report import figures

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
        from nutdamp.report.page.sheets import residual_sheet

        return _html(residual_sheet(f"{self.spacecraft.name}: {self._summary}", self.residual))


@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """A scheme's schedule for a spacecraft, and how it was judged; an infeasible one says ``why``."""

    core: planning.Plan

    @property
    def spacecraft(self) -> Spacecraft:
        """What it was planned for."""
        return Spacecraft(self.core.spacecraft)

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
        return self.core.why

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
        self._feasible_only()
        body, pulses = self.core.spacecraft, self.core.pulses
        end = arguments.end_of_flight(pulses.end + body.inertial_period if until is None else until)
        count = arguments.rows(samples)
        made = seen_at((flights.by_impulses if by_impulses else flights.flown)(body, pulses, end), end)
        return Flight(made, made.track(count, end), by_impulses)

    def to_numpy(self) -> Table:
        """The pulses with the columns of `to_csv` as fields; empty where infeasible."""
        from nutdamp.files.pulses_csv import pulses_array

        return pulses_array(self.core.flight)

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the pulses as ``plan --csv`` does; raises CannotWrite, and Infeasible where there is no schedule."""
        from nutdamp.files.output import write_whole
        from nutdamp.files.pulses_csv import pulses_csv

        self._feasible_only()
        write_whole(arguments.path("path", path), pulses_csv(self.core.flight))

    def to_dict(self) -> dict[str, Any]:
        """What ``plan --json`` says of it."""
        from nutdamp.files.output import finite
        from nutdamp.files.plan_json import plan_json

        return finite(plan_json(self.core))

    def _feasible_only(self) -> None:
        if not self.feasible:
            raise Infeasible(f"{self.scheme} is infeasible: {self.why}")

    def __repr__(self) -> str:
        left = self.flown
        if left is None:
            return f"<Plan {self.scheme}: infeasible, {self.why}>"
        return (
            f"<Plan {self.scheme}: {len(self)} pulses until {self.end:.4g} s, nutation left {degrees(left.nutation)}>"
        )

    def _repr_html_(self) -> str:
        from nutdamp.report.page.document import Prose
        from nutdamp.report.page.sheets import pulse_sheet

        return _html(pulse_sheet(self.core) if self.feasible else Prose(repr(self)[1:-1]))


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Several plans for one spacecraft; ``comparison["two-pulse"]`` is one of them, iterating gives all."""

    core: planning.Comparison

    @property
    def plans(self) -> tuple[Plan, ...]:
        """All plans, infeasible ones too."""
        return tuple(Plan(one) for one in self.core.plans)

    @property
    def recommended(self) -> Plan | None:
        """The plan to fly; None where no scheme is feasible."""
        return None if self.core.recommended is None else Plan(self.core.recommended)

    @property
    def reason(self) -> str:
        """Why that one."""
        from nutdamp.report import verdicts

        return verdicts.reason(self.core)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the recommended plan does not reach, and what stands in the way."""
        from nutdamp.report import verdicts

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
        from nutdamp.report import verdicts

        return finite(comparison_json(self.core, verdicts.spoken(self.core)))

    def __repr__(self) -> str:
        chosen = self.core.recommended
        verdict = self.reason if chosen is None else f"recommended {chosen.scheme}, {self.reason}"
        return f"<Comparison of {', '.join(one.scheme for one in self.core.plans)}: {verdict}>"

    def _repr_html_(self) -> str:
        from nutdamp.report.page.sheets import comparison_sheet

        return _html(comparison_sheet(self.core))


def load(path: str | PathLike[str], *, set: Mapping[str, object] | None = None) -> Spacecraft:  # noqa: A002 - as --set
    """The spacecraft in a file (YAML or JSON); raises CannotRead, or FaultyFile with everything wrong in it.

    ``set`` changes keys of the file as ``--set`` does: ``{"limits.horizon": "300 s", "thrusters.T1.force": 12.0}``.
    """
    from nutdamp.files.settings import settings_of
    from nutdamp.files.spacecraft_file import load_spacecraft

    name, changes = arguments.path("path", path), settings_of(arguments.changes(set))
    doubts: list[Fault] = []
    return _with_warnings(load_spacecraft(name, changes, doubts.append), doubts)


def read(text: str, name: str = "text") -> Spacecraft:
    """The spacecraft in the ``text`` of a file; raises FaultyFile, whose faults call the file ``name``."""
    from nutdamp.files.spacecraft_file import read_spacecraft

    doubts: list[Fault] = []
    arguments.instance("text", text, str, "the text of a spacecraft file (nutdamp.load reads files)")
    body = read_spacecraft(text, arguments.instance("name", name, str, "a text"), warn=doubts.append)
    return _with_warnings(body, doubts)


def example() -> Spacecraft:
    """The built-in example, which ``nutdamp init`` writes."""
    from nutdamp.files.spacecraft_file import built_in_example_text

    return read(built_in_example_text(), "example.yaml")


def plan(spacecraft: Spacecraft, scheme: str, options: Choice = None) -> Plan:
    """Plan one scheme and judge it by flying it; an infeasible plan says why.

    Raises BadRequest for a scheme that there is not, or an option that makes no sense.
    """
    (name,) = arguments.scheme_names([scheme])
    return Plan(planning.plan(_core(spacecraft), name, arguments.options(options)))


def compare(spacecraft: Spacecraft, names: Sequence[str] = (), options: Choice = None) -> Comparison:
    """Plan the schemes named and recommend one; raises as `plan` does.

    Default: the classic three, or those that point where the file has a target axis.
    """
    core = _core(spacecraft)
    chosen = arguments.scheme_names(names) or planning.usual(core)
    return Comparison(planning.compare(core, chosen, arguments.options(options)))


def load_schedule(path: str | PathLike[str], spacecraft: Spacecraft) -> Plan:
    """The pulses of a CSV file as ``plan --csv`` writes it, as a plan of that name.

    Warns where columns contradict each other or a limit is broken. Raises CannotRead, or FaultyFile.
    """
    from nutdamp.files.schedule_file import read_pulses

    core, name = _core(spacecraft), arguments.path("path", path)
    schedule, remarks = read_pulses(name, core)
    for remark in (*remarks, *broken_limits(core, schedule)):
        warnings.warn(remark, stacklevel=2)
    return Plan(planning.Plan(core, printable(name), schedule))


def _with_warnings(body: craft.Spacecraft, doubts: list[Fault]) -> Spacecraft:
    """The spacecraft of a file; warns of numbers that are hardly what was meant, where the library was called."""
    for doubt in doubts:
        warnings.warn(doubt.as_warning, stacklevel=3)
    return Spacecraft(body)


def _core(spacecraft: Spacecraft) -> craft.Spacecraft:
    return arguments.instance("spacecraft", spacecraft, Spacecraft, "a Spacecraft, as nutdamp.load gives it").core


def _html(block: Block) -> str:
    from nutdamp.report.page.html import block_html

    return block_html(block)
