"""nutdamp as a library: load a spacecraft, plan, compare, fly, trade, disperse, verify, fit, report, export.

    import nutdamp

    spacecraft = nutdamp.load("spacecraft.yaml")
    plan = nutdamp.plan(spacecraft, "two-pulse")
    flight = plan.fly()
    flight.to_csv("track.csv")

The command line calls the same functions, so that both give the same numbers. Attributes are SI and radians, vectors in
principal axes unless stated to be in the axes of the spacecraft file; arrays with named fields carry the names and
units of the CSV files.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from nutdamp import units
from nutdamp.common.numerics import finite
from nutdamp.control_loop import budget as holding
from nutdamp.errors import BadRequest, Fault, nearest
from nutdamp.estimation import fit as estimation
from nutdamp.estimation import forecast, results
from nutdamp.estimation.results import doubts
from nutdamp.files.tabular import write_whole
from nutdamp.files.yaml import dotted
from nutdamp.flight import verification
from nutdamp.flight.propagation import Flight as Flight
from nutdamp.flight.propagation import Residual as Residual
from nutdamp.flight.track import Track as Track
from nutdamp.montecarlo import study as dispersion
from nutdamp.montecarlo.study import Results, run, threads_here
from nutdamp.page.content import Repeat, report_page
from nutdamp.page.document import UNCONTROLLED, Control, Page
from nutdamp.page.html import expect_html, page_html
from nutdamp.page.results import feasible
from nutdamp.planning import decision, tradeoff
from nutdamp.planning import plan as planning
from nutdamp.planning.decision import Comparison as Comparison
from nutdamp.planning.plan import Plan as Plan
from nutdamp.planning.tradeoff import Front
from nutdamp.schemes import catalogue
from nutdamp.schemes.catalogue import LEAST, SchemeOptions
from nutdamp.schemes.catalogue import FourPulseOptions as FourPulseOptions
from nutdamp.schemes.catalogue import HalfConeOptions as HalfConeOptions
from nutdamp.schemes.catalogue import OptimalOptions as OptimalOptions
from nutdamp.schemes.catalogue import Options as Options
from nutdamp.schemes.catalogue import RhumbLineOptions as RhumbLineOptions
from nutdamp.schemes.catalogue import TwoPulseOptions as TwoPulseOptions
from nutdamp.schemes.planner import Choice
from nutdamp.spacecraft.model import Spacecraft as Spacecraft
from nutdamp.units import as_given

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.control_loop.dispersion import LoopResults
    from nutdamp.estimation.forecast import Outlook
    from nutdamp.files.overrides import Setting


class Source(NamedTuple):
    """Origin of a spacecraft: the text of the file, its name in messages, and the keys set beside it."""

    text: str
    name: str
    settings: tuple[Setting, ...] = ()

    def changed(self, keys: Mapping[str, object]) -> Spacecraft:
        """See `Spacecraft.with_`."""
        from nutdamp.files.overrides import settings_within

        return _read(self._replace(settings=(*self.settings, *settings_within(keys))), above=4)


def load(
    path: str | PathLike[str] | Mapping[str, object],
    *,
    set: Mapping[str, object] | None = None,  # noqa: A002 - as --set
) -> Spacecraft:
    """The spacecraft in a file (YAML or JSON), or in a dict of the keys of such a file.

    ``set`` changes keys of the file as ``--set`` does: ``{"limits.horizon": "300 s", "thrusters.T1.force": 12.0}``.
    Raises CannotRead, BadRequest, or FaultyFile with everything wrong: in a dict, lines count in its JSON.
    """
    from nutdamp.files.overrides import settings_of, text_of
    from nutdamp.files.yaml import read_text

    if isinstance(path, Mapping):
        return _read(Source(text_of(path, "dict"), "dict", settings_of(units.changes(set))))
    name = units.path("path", path, "the name of a file or a dict of its keys")
    settings = settings_of(units.changes(set))
    return _read(Source(read_text(Path(name)), name, settings))


def read(text: str, name: str = "text") -> Spacecraft:
    """The spacecraft in the ``text`` of a file; raises FaultyFile, whose faults call the file ``name``."""
    units.instance("text", text, str, "the text of a spacecraft file (nutdamp.load reads files)")
    return _read(Source(text, units.instance("name", name, str, "a text")))


def example(name: str = "example") -> Spacecraft:
    """The built-in example, or the one of that ``name`` among those of ``nutdamp init --list``.

    Raises BadRequest for any other name.
    """
    from nutdamp.files.reader import example_names, example_text

    known = units.one_of("name", name, example_names())
    return _read(Source(example_text(known), f"{known}.yaml"))


def _read(source: Source, above: int = 3) -> Spacecraft:
    """The spacecraft; warns of numbers that are hardly meant, ``above`` calls up: where the library is used."""
    from nutdamp.files.reader import read_spacecraft

    doubts: list[Fault] = []
    body = read_spacecraft(source.text, source.name, source.settings, doubts.append)
    for doubt in doubts:
        warnings.warn(doubt.as_warning, stacklevel=above)
    object.__setattr__(body, "source", source)  # not a field, so that `dataclasses.replace` drops it
    return body


def expected(spacecraft: Spacecraft) -> Spacecraft:
    """A spacecraft; raises BadRequest for anything else."""
    return units.instance("spacecraft", spacecraft, Spacecraft, "a Spacecraft, as nutdamp.load gives it")


@dataclass(frozen=True, eq=False)
class Trade:
    """Time against cost: ``fronts`` of schedules of the scheme optimal, one for each momentum shift allowed."""

    spacecraft: Spacecraft
    fronts: tuple[tradeoff.Front, ...]

    @property
    def plans(self) -> tuple[Plan, ...]:
        """The plans of all points, front after front, each from its earliest end to its latest."""
        return tuple(point.plan for _, _, point in tradeoff.numbered(self.fronts))

    def to_dict(self) -> dict[str, Any]:
        """The object of ``trade --json``."""
        from nutdamp.views.trade_files import trade_json

        return finite(trade_json(self.spacecraft, self.fronts))


@dataclass(frozen=True, eq=False)
class Dispersion:
    """A schedule flown in many dispersed cases; ``core`` holds the distributions of the results."""

    core: Results
    scheme: str

    @property
    def met_fraction(self) -> float | None:
        """Share of the cases that meet the requirement; None where nothing is required."""
        return self.core.met_fraction

    @property
    def meets_requirement(self) -> bool | None:
        """True where as many cases meet it as the file requires; None where nothing is required."""
        return self.core.meets_requirement

    def to_dict(self, worst: int = 5) -> dict[str, Any]:
        """The object of ``disperse --json``, with as many ``worst`` cases."""
        from nutdamp.views.dispersion_json import dispersion_json

        return finite(dispersion_json(self.core, scheme=self.scheme, worst=worst))


@dataclass(frozen=True, eq=False)
class LoopDispersion:
    """The loop of a file flown in many dispersed cases; ``core`` holds the result of each."""

    core: LoopResults

    @property
    def settled_fraction(self) -> float:
        """Share of the cases that fall quiet, and are not stopped."""
        return self.core.settled / self.core.done

    @property
    def met_fraction(self) -> float | None:
        """Share of the cases that meet the requirement; None where nothing is required."""
        return self.core.met_fraction

    def to_dict(self, worst: int = 5) -> dict[str, Any]:
        """The object of ``disperse --loop --json``, with as many ``worst`` cases."""
        from nutdamp.views.loop_cases import loop_cases_json

        return finite(loop_cases_json(self.core, worst=worst))


@dataclass(frozen=True, eq=False)
class Verified:
    """A schedule flown by independent methods: ``core`` holds them, the conserved quantities, and the error budget."""

    core: verification.Verification
    plan: Plan

    @property
    def agree(self) -> bool:
        """True where an independent integration was flown, and all of them confirm the flown motion."""
        return self.core.agree

    def to_dict(self) -> dict[str, Any]:
        """The object of ``verify --json``."""
        from nutdamp.views.verification_json import verification_json

        return finite(verification_json(self.plan.flight, self.plan.scheme, self.core))


@dataclass(frozen=True, eq=False)
class Budget:
    """Cost of holding the nutation against energy dissipation; ``core`` holds a row for each pair of thresholds."""

    core: holding.HoldingBudget

    def to_dict(self) -> dict[str, Any]:
        """The object of ``budget --json``."""
        from nutdamp.views.budget import budget_json

        return finite(budget_json(self.core))

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the file of ``budget --csv``; raises CannotWrite."""
        from nutdamp.files.tabular import write_whole
        from nutdamp.views.budget import budget_csv

        write_whole(units.path("path", path), budget_csv(self.core))


def trade(
    spacecraft: Spacecraft,
    points: int = 10,
    allow: Iterable[float] = (0.0, math.inf),
    least: str = "propellant",
    *,
    with_disturbances: bool = False,
    progress: Callable[[int], None] = lambda _: None,
) -> Trade:
    """Time against propellant (``least="impulse"``: impulse), as ``nutdamp trade`` does; raises BadRequest.

    ``points``: horizons tried for each front; ``allow``: how far from its target H may end, rad, a front for each;
    ``progress`` is called with the number of horizons tried so far.
    """
    body = expected(spacecraft)
    count, shifts = units.count("points", points), units.shifts(allow)
    least = units.one_of("least", least, LEAST[:2])
    options = OptimalOptions(least=least, with_disturbances=with_disturbances)
    return Trade(body, tradeoff.fronts(body, options, count=count, shifts=shifts, progress=progress))


def budget(
    spacecraft: Spacecraft,
    thresholds: Iterable[tuple[float, float]] = (),
    *,
    largest: float | None = None,
    seed: int = 1,
    progress: Callable[[int], None] = lambda _: None,
) -> Budget:
    """Pulses a day and propellant a year that hold the nutation, as ``nutdamp budget`` does; raises BadRequest.

    ``thresholds``: pairs (start, stop), rad, default those of the loop in the file; ``largest``: the nutation (rad) by
    which damping must begin, default the one required.
    """
    body, pairs = expected(spacecraft), units.thresholds(thresholds)
    if largest is not None and not (units.is_number(largest) and 0.0 < largest < 0.5 * math.pi):
        raise BadRequest(f"largest = {units.as_given(largest)}: expected an angle in rad between 0 and a right angle")
    if pairs and body.loop is None:
        raise BadRequest("thresholds: expected a spacecraft with a loop")
    seed = units.instance("seed", seed, int, "a whole number")
    rows = [holding.Thresholds(*pair) for pair in pairs]
    return Budget(holding.budget(body, rows, largest, seed=seed, progress=progress))


def disperse(plan: Plan, samples: int = dispersion.SAMPLES, *, seed: int = dispersion.SEED) -> Dispersion:
    """Fly the schedule through its real widths in dispersed cases, as ``nutdamp disperse`` does.

    Raises Infeasible where there is no schedule, BadRequest for a spacecraft without dispersions.
    """
    feasible(plan)
    _expect_seed(seed)
    study = dispersion.study_of(plan.spacecraft, plan.pulses, seed=seed)
    results = Results(study, units.count("samples", samples))
    return Dispersion(run(results, threads=threads_here()), plan.scheme)


def disperse_loop(
    spacecraft: Spacecraft,
    samples: int = dispersion.SAMPLES,
    *,
    until: float | None = None,
    seed: int = dispersion.SEED,
) -> LoopDispersion:
    """Fly the closed loop of the file in dispersed cases to ``until`` s, as ``nutdamp disperse --loop`` does.

    Raises BadRequest for a spacecraft without loop or dispersions, Infeasible where its firings come too late to damp.
    """
    from nutdamp.control_loop import dispersion

    body, count = expected(spacecraft), units.count("samples", samples)
    _expect_seed(seed)
    end = None if until is None else units.end_of_flight(until)
    study = dispersion.loop_study(body, end, seed=seed)
    study.expect_affordable(count)
    return LoopDispersion(dispersion.run(dispersion.LoopResults(study, count)))


def _expect_seed(seed: int) -> None:
    if not 0 <= units.instance("seed", seed, int, "a whole number") < 2**64:
        raise BadRequest(f"seed = {seed}: expected a whole number from 0 to 2**64 - 1")


def verify(plan: Plan) -> Verified:
    """Fly the schedule by independent methods, as ``nutdamp verify`` does; raises Infeasible without a schedule."""
    body, known = feasible(plan).spacecraft, plan.options.with_disturbances
    return Verified(verification.verify(body, plan.pulses, planning.unrounded(plan), expected=known), plan)


def export(plan: Plan, format: str, path: str | PathLike[str], *, until: float | None = None) -> None:  # noqa: A002 - as --format
    """Write a plan in a format of ``nutdamp export``; CCSDS messages become XML where the name ends in .xml.

    ``until``: end of a history or spin table, s. Raises Infeasible, BadRequest or CannotWrite.
    """
    from nutdamp.files.tabular import write_whole
    from nutdamp.views.exchange import FORMATS, export_text

    feasible(plan)
    form = units.one_of("format", format, tuple(FORMATS))
    name = units.path("path", path)
    end = None if until is None else units.end_of_flight(until)
    write_whole(name, export_text(plan, form, xml=FORMATS[form].message and name.lower().endswith(".xml"), until=end))


@dataclass(frozen=True, eq=False)
class Fitted:
    """Spacecraft estimated from telemetry; ``core`` holds parameters, covariance, noise and residuals.

    ``warnings`` are those of reading the record.
    """

    core: estimation.Fit
    warnings: tuple[str, ...] = ()

    def estimates(self, at: float = 0.0) -> tuple[results.Estimate, ...]:
        """Estimates with their sigmas; the motion is that at ``at`` s."""
        return results.estimates(self.core, at)

    def outlook(self, at: float = 0.0) -> forecast.Outlook:
        """Forecast of longer coasts and probe pulses for a plan from ``at`` s, as ``fit --next`` does."""
        return forecast.outlook(self.core, at)

    def text(self, at: float = 0.0) -> str:
        """The spacecraft file with the estimates in it and t = 0 at ``at`` s, as ``fit -o`` writes it.

        Raises BadRequest for a spacecraft that was not read from a file.
        """
        from nutdamp.files.editing import fitted_text

        source = self.core.model.spacecraft.source
        if not isinstance(source, Source):
            raise BadRequest("fit: expected a spacecraft from nutdamp.load, read or example, with no field replaced")
        return fitted_text(source.text, source.name, source.settings, self.core, results.carried(self.core, at))

    def spacecraft(self, at: float = 0.0) -> Spacecraft:
        """The spacecraft of that file."""
        return read(self.text(at), "fitted")

    def write(self, path: str | PathLike[str], at: float = 0.0) -> None:
        """Write `text` to a file, as ``fit -o`` does; raises BadRequest or CannotWrite."""
        from nutdamp.files.tabular import write_whole

        write_whole(units.path("path", path), self.text(at))

    def figure(self) -> Figure:
        """Data, fit and residuals, as ``fit --plot`` draws them."""
        from nutdamp.figures.fit import fit_figure

        return fit_figure(self.core)

    def to_dict(self, at: float = 0.0, ahead: Outlook | None = None) -> dict[str, Any]:
        """The object of ``fit --json``; with the forecast ``ahead``, that of ``fit --next --json``."""
        from nutdamp.views.fit import fit_json

        return finite(fit_json(self.core, results.carried(self.core, at), ahead, self.warnings))


def fit(
    telemetry: str | PathLike[str],
    spacecraft: Spacecraft,
    *,
    schedule: Plan | None = None,
    sun_pulses: str | PathLike[str] | None = None,
) -> Fitted:
    """Estimate a spacecraft from a CSV file of telemetry, as ``nutdamp fit`` does.

    ``schedule``: pulses fired during the record (`nutdamp.load_schedule`); ``sun_pulses``: a CSV file of their times.
    Warns of columns that are ignored, and of doubts about the estimates. Raises CannotRead, FaultyFile,
    BadRequest, and Infeasible where the record tells nothing.
    """
    from nutdamp.files.telemetry import read_telemetry

    body, name = expected(spacecraft), units.path("telemetry", telemetry)
    fired = None if schedule is None else units.instance("schedule", schedule, Plan, "a Plan").pulses
    times = None if sun_pulses is None else units.path("sun_pulses", sun_pulses)
    record, remarks = read_telemetry(name, body, times, fired)
    estimate = estimation.fit(body, record)
    for remark in (*remarks, *doubts(estimate)):
        warnings.warn(remark, stacklevel=2)
    return Fitted(estimate, tuple(remarks))


def plan(spacecraft: Spacecraft, scheme: str, options: Choice = None) -> Plan:
    """Plan one scheme and judge it by flying it; an infeasible plan says why.

    Raises BadRequest for a scheme that there is not, or an option that makes no sense.
    """
    (name,) = _names([scheme])
    return planning.plan(expected(spacecraft), name, _options(options))


def compare(
    spacecraft: Spacecraft,
    names: Sequence[str] = (),
    options: Choice = None,
    *,
    samples: int | None = None,
    timed: bool = False,
) -> Comparison:
    """Plan the schemes named and recommend one, as ``nutdamp plan`` does; raises as `plan` does.

    Default: the classic three and optimal, or those that point where the file has a target axis. ``samples``: dispersed
    cases of each plan where the file has dispersions, 0 to judge nominal values alone; ``timed``: recommend pulses that
    no command block can fire, too.
    """
    body, chosen = expected(spacecraft), _names(names)
    count = samples if samples in (None, 0) else units.count("samples", samples)
    return decision.compare(body, chosen, _options(options), samples=count, timed=timed)


def load_schedule(path: str | PathLike[str], spacecraft: Spacecraft) -> Plan:
    """The pulses of a CSV file as ``plan --csv`` writes it, as a plan of that name.

    Warns where columns contradict each other or a limit is broken. Raises CannotRead, or FaultyFile.
    """
    from nutdamp.files.schedules import read_plan

    body, name = expected(spacecraft), units.path("path", path)
    schedule, remarks = read_plan(name, body)
    for remark in remarks:
        warnings.warn(remark, stacklevel=2)
    return schedule


def _names(values: Iterable[str]) -> tuple[str, ...]:
    """Names of schemes that there are; raises BadRequest."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise BadRequest(f"names: expected a list of schemes, such as ['two-pulse'], got {as_given(values)}")
    names = tuple(values)
    for name in names:
        if not isinstance(name, str) or name not in catalogue.NAMES:
            close = nearest(name, catalogue.NAMES) if isinstance(name, str) else None
            cure = f"there are {', '.join(catalogue.NAMES)}" if close is None else f"did you mean {close!r}?"
            raise BadRequest(f"there is no scheme {as_given(name)}; {cure}")
    return names


def _options(value: Choice) -> Choice:
    """The options of one scheme or several; raises BadRequest for anything else."""
    if value is None or isinstance(value, Options | SchemeOptions):
        return value
    raise BadRequest(f"options: expected nutdamp.Options(…), got {as_given(value)}")


@dataclass(frozen=True, eq=False)
class Report:
    """The report page: its comparison, its dispersed cases, the page itself, and ``content``, the text of its file."""

    comparison: Comparison
    dispersed: Results | None
    page: Page = field(repr=False)
    content: str = field(repr=False)

    @property
    def verdict(self) -> str:
        """Sentence at the top of the page."""
        return self.page.verdict

    @property
    def met(self) -> bool | None:
        """True where the requirement is met; None where nothing is required, and without a feasible plan."""
        return self.page.met

    @property
    def good(self) -> bool:
        """True where nothing is missed, whether required or not."""
        return self.page.good


def report(
    spacecraft: Spacecraft | str | PathLike[str] | Mapping[str, object],
    output: str | PathLike[str] = "report.html",
    names: Sequence[str] = (),
    options: Choice = None,
    *,
    disperse: int | None = None,
    points: int | None = None,
    **control: str,
) -> Report:
    """Compare the schemes named, as `compare` does, and write the page of ``nutdamp report``.

    ``spacecraft``: one of `load`, or an argument of `load`; ``output``: an HTML file; ``disperse``: in how many
    dispersed cases to fly the plans, as ``samples`` of `compare`; ``points``: how many horizons to try for each front
    of time against cost, none by default; ``control``: title, document, issue, author, date, as `controlled` takes
    them. Raises as `load` and `compare` do, BadRequest for another ending, MissingExtra without the extra plot,
    CannotWrite.
    """
    name, kept = units.path("output", output), controlled(**control)
    expect_html(name)
    body = spacecraft if isinstance(spacecraft, Spacecraft) else load(spacecraft)
    samples = disperse if disperse in (None, 0) else units.count("disperse", disperse)
    compared = compare(body, names, options, samples=samples)
    known = isinstance(options, Options) and options.with_disturbances
    fronts = () if points is None else trade(body, points, with_disturbances=known).fronts
    given = {"options": options and f"nutdamp.{options!r}", "disperse": disperse}
    given["points"] = points
    given |= {key: repr(value) for key, value in control.items()}
    more = "".join(f", {key}={value}" for key, value in given.items() if value is not None)
    named = f", {list(names)!r}" if names else ""
    page = made_of(compared, _repeat(body, f"{name!r}{named}{more}"), kept, fronts)
    write_whole(name, page.content)
    return page


def controlled(**given: str) -> Control:
    """Entries of configuration control on a page; the date defaults to SOURCE_DATE_EPOCH, where that is set.

    Raises BadRequest for other names, and for a SOURCE_DATE_EPOCH that is no number of seconds.
    """
    unknown = sorted(set(given) - set(Control._fields))
    if unknown:
        raise BadRequest(f"{unknown[0]}: expected one of {', '.join(Control._fields)}")
    control, epoch = Control(**given), os.environ.get("SOURCE_DATE_EPOCH", "")
    if control.date or not epoch:
        return control
    try:
        return control._replace(date=datetime.fromtimestamp(int(epoch), UTC).date().isoformat())
    except (ValueError, OverflowError, OSError):
        raise BadRequest(f"SOURCE_DATE_EPOCH = {epoch!r}: expected a number of seconds since 1970") from None


def made_of(
    compared: Comparison, repeat: Repeat, control: Control = UNCONTROLLED, traded: Sequence[Front] = ()
) -> Report:
    """The report, not yet written. Raises MissingExtra without the extra plot."""
    chosen = compared.recommended
    page = report_page(compared, repeat, traded=traded, control=control)
    return Report(compared, None if chosen is None else compared.results(chosen), page, page_html(page))


def _repeat(body: Spacecraft, how: str) -> Repeat:
    """The call that makes the page again in Python; where fields were replaced, no file stands for the spacecraft."""
    source = body.source
    if not isinstance(source, Source):
        return Repeat(f"nutdamp.report(spacecraft, {how})", "", "")
    settings = tuple((dotted(setting.path), str(setting.value)) for setting in source.settings)
    return Repeat(f"nutdamp.report({source.name!r}, {how})", source.name, source.text, settings)
