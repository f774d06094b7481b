"""nutdamp as a library: a function a command, which the command line calls too, so that both give
the same numbers.

    import nutdamp

    spacecraft = nutdamp.load("spacecraft.yaml")
    plan = nutdamp.plan(spacecraft, "two-pulse")
    flight = plan.fly()
    flight.to_csv("track.csv")

Attributes are SI and radians, vectors in principal axes unless stated to be in the axes of the
spacecraft file; arrays with named fields carry the names and units of the CSV files. A wrong
argument raises BadRequest, as all errors of the package a NutdampError.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

from nutdamp import units
from nutdamp.common import work
from nutdamp.errors import Infeasible, warn
from nutdamp.schemes.catalogue import (
    LEAST,
    OptimalOptions,
    Options,
    expect_names,
    expect_options,
)

if TYPE_CHECKING:
    from nutdamp.control_loop.budget import Budget
    from nutdamp.control_loop.dispersion import LoopDispersion
    from nutdamp.control_loop.evaluation import LoopPlan, LoopVerification
    from nutdamp.estimation.results import Fitted
    from nutdamp.montecarlo.study import Results
    from nutdamp.page.report import Report
    from nutdamp.planning.decision import Comparison
    from nutdamp.planning.plan import Plan
    from nutdamp.planning.robust import RobustComparison
    from nutdamp.planning.screening import Dispersion
    from nutdamp.planning.simulation import Simulation, Verified
    from nutdamp.planning.tradeoff import Trade
    from nutdamp.schemes.planner import Choice
    from nutdamp.spacecraft.model import Spacecraft
    from nutdamp.views.check import CheckedFile

PathName = str | PathLike[str]

Target = str | Iterable[float | str]

Progress = Callable[[int, int], None]  # of steps done, and of all


def load(
    path: PathName | Mapping[str, object],
    *,
    set: Mapping[str, object] | None = None,  # noqa: A002 - as --set
) -> Spacecraft:
    """Load the spacecraft in a file (YAML or JSON), or in a dict of the keys of such a file.

    Parameters
    ----------
    path
        Name of the file, or a dict: numbers in SI, texts with a unit.
    set
        Keys of the file to change, as ``--set`` does: ``{"limits.horizon": "300 s",
        "thrusters.T1.force": 12.0}``.

    Raises CannotRead, or FaultyFile with everything wrong: in a dict, lines count in its JSON.

    Examples
    --------
    >>> top = {"name": "Top", "inertia": {"A": 120, "C": "80 kg m^2"}, "omega0": [0.1, 0, 3]}
    >>> nutdamp.load(top)
    <Spacecraft Top: prolate, a = 0.3333, nutation 2.862 deg>
    """
    from nutdamp.files.reader import source_of

    return source_of(path, set).read()


def read(text: str, name: str = "text") -> Spacecraft:
    """Read the spacecraft in the ``text`` of a file; raises FaultyFile, whose faults call the file
    ``name``.

    Examples
    --------
    >>> nutdamp.read("{name: Top, inertia: {A: 120, C: 80}, omega0: [0, 0, 3]}").nutation
    0.0
    """
    from nutdamp.files.reader import Source

    units.instance("text", text, str, "the text of a spacecraft file (nutdamp.load reads files)")
    return Source(text, units.instance("name", name, str, "a text")).read()


def example(name: str = "example") -> Spacecraft:
    """Load the built-in example, or the one of that ``name`` among those of ``nutdamp init
    --list``.

    Examples
    --------
    >>> nutdamp.example("ace").name
    'ACE'
    """
    from nutdamp.files.reader import Source, example_names, example_text

    known = units.one_of("name", name, example_names())
    return Source(example_text(known), f"{known}.yaml").read()


def check(path: PathName | Mapping[str, object]) -> CheckedFile:
    """Check a spacecraft file, as ``nutdamp check`` does; raises CannotRead, and FaultyFile with
    everything wrong.

    Examples
    --------
    >>> top = {"name": "Top", "inertia": {"A": 120, "C": 80}, "omega0": [0, 0, 3]}
    >>> nutdamp.check(top).to_dict()["valid"]
    True
    """
    from nutdamp.files.reader import source_of
    from nutdamp.views.check import checked

    return checked(source := source_of(path), source.name, [])


def _expected(spacecraft: Spacecraft) -> Spacecraft:
    from nutdamp.spacecraft.model import Spacecraft

    return units.instance(
        "spacecraft", spacecraft, Spacecraft, "a Spacecraft, as nutdamp.load gives it"
    )


def _aimed(spacecraft: Spacecraft, target: Target | None, spin: float | str | None) -> Spacecraft:
    """Spacecraft with a goal beside its file; raises BadRequest, and warns as the command line."""
    _expected(spacecraft)
    if target is None and spin is None:
        return spacecraft
    from nutdamp.files.editing import aimed

    return aimed(spacecraft, warn, target=target, spin=spin)


def plan(
    spacecraft: Spacecraft,
    scheme: str | None = None,
    options: Choice = None,
    *,
    target: Target | None = None,
    spin: float | str | None = None,
    **chosen: Any,
) -> Plan:
    """Plan one scheme, or the recommended one, and judge it by flying it; an infeasible plan says
    why.

    Parameters
    ----------
    spacecraft
        Of `load`, `read` or `example`.
    scheme
        Name of a scheme; without it that which `compare` recommends. Raises Infeasible where there
        is none.
    options, chosen
        `Options` of several schemes or those of one, or their fields by keyword, in SI:
        ``on_time=0.2`` (s).
    target, spin
        Goal in place of that of the file, as ``--target`` and ``--spin`` take it: ``"10deg,45deg"``
        or two numbers in rad; ``"30rpm"``, ``"keep"`` or a number in rad/s.

    Examples
    --------
    >>> nutdamp.plan(nutdamp.example(), "two-pulse")
    <Plan two-pulse: 2 pulses until 7.434 s, nutation left < 1e-9 deg>
    >>> nutdamp.plan(nutdamp.example(), "four-pulse", on_time=0.2).pulses[0].on_time
    0.2
    """
    from nutdamp.planning import plan as planning

    spacecraft = _aimed(spacecraft, target, spin)
    named = None if scheme is None else expect_names([scheme])[0]
    settled = expect_options(options, chosen, named)
    if named is not None:
        return planning.plan(spacecraft, named, settled)
    compared = compare(spacecraft, options=settled)
    if compared.recommended is None:
        raise Infeasible(compared.reason)
    return compared.recommended


def compare(
    spacecraft: Spacecraft,
    names: Sequence[str] = (),
    options: Choice = None,
    *,
    samples: int | None = None,
    timed: bool = False,
    robust: bool = True,
    target: Target | None = None,
    spin: float | str | None = None,
    **chosen: Any,
) -> Comparison:
    """Plan schemes, compare them and recommend one, as ``nutdamp plan`` does.

    Parameters
    ----------
    names
        Schemes, default the classic three and optimal, or those that point where the file has a
        target axis.
    options, target, spin, chosen
        As of `plan`; each scheme takes the options that it has.
    samples, timed
        Dispersed cases of each plan where the file has dispersions, 0 to judge nominal values
        alone; recommend pulses that no command block can fire, too.
    robust
        Try a robust plan where too few cases comply with each of the usual schemes; not with
        ``samples``.

    Examples
    --------
    >>> compared = nutdamp.compare(nutdamp.example(), ["two-pulse", "four-pulse"], samples=0)
    >>> compared.recommended.scheme
    'four-pulse'
    """
    from nutdamp.planning import decision

    spacecraft = _aimed(spacecraft, target, spin)
    schemes = expect_names(names)
    count = samples if samples in (None, 0) else units.count("samples", samples)
    chosen_options = expect_options(options, chosen)
    compared = decision.compare(spacecraft, schemes, chosen_options, samples=count, timed=timed)
    if not robust or count is not None or not compared.too_few_comply:
        return compared
    from nutdamp.planning.robust import with_robust
    from nutdamp.schemes.catalogue import Options

    several = chosen_options if isinstance(chosen_options, Options) else None
    return with_robust(compared, several)


def robust(
    spacecraft: Spacecraft | Comparison,
    options: Options | None = None,
    *,
    progress: Progress = lambda _done, _all: None,
) -> RobustComparison:
    """Search the cheapest plan with which enough dispersed cases comply, as ``nutdamp plan
    --robust`` does.

    Raises BadRequest where the spacecraft file has no dispersions.

    Parameters
    ----------
    spacecraft, options
        Of `load`, or a comparison of `compare`, whose plans are among the candidates, with the
        options that it was made with.
    progress
        Called with the number of attempts made, and that of all.

    Examples
    --------
    >>> nutdamp.robust(nutdamp.compare(nutdamp.example(), ["two-pulse"])).verdict.met
    True
    """
    from nutdamp.planning import robust as search
    from nutdamp.planning.decision import Comparison
    from nutdamp.spacecraft.tolerances import expect_dispersions

    if isinstance(spacecraft, Comparison):
        compared = spacecraft
    else:
        expect_dispersions(_expected(spacecraft).dispersions)
        compared = compare(spacecraft, options=options, robust=False)
    expect_dispersions(compared.spacecraft.dispersions)
    return search.compare(compared, options, progress=progress)


def load_schedule(path: PathName, spacecraft: Spacecraft) -> Plan:
    """Load the pulses of a CSV file as ``plan --csv`` writes it, as a plan of that name.

    Warns where a limit is broken. Raises CannotRead, or FaultyFile.

    Examples
    --------
    >>> nutdamp.plan(nutdamp.example(), "two-pulse").to_csv("pulses.csv")
    >>> len(nutdamp.load_schedule("pulses.csv", nutdamp.example()))
    2
    """
    from nutdamp.files.schedules import read_plan

    schedule, remarks = read_plan(units.path("path", path), _expected(spacecraft))
    for remark in remarks:
        warn(remark)
    return schedule


def simulate(
    plan: Plan, until: float | None = None, *, flown: bool = False, samples: int = 1000
) -> Simulation:
    """Propagate a plan by the impulse sum (17) and through its real widths, as ``nutdamp simulate``
    does.

    Parameters
    ----------
    plan
        Of `plan` or `load_schedule`; ``plan(spacecraft, "none")`` is free motion.
    until, samples
        End, s, default one inertial nutation period after the last pulse; rows of the track.
    flown
        Show the flight through the real widths, not the impulse sum.

    Examples
    --------
    >>> nutdamp.simulate(nutdamp.plan(nutdamp.example(), "two-pulse"), 20.0, flown=True).verdict.met
    True
    """
    from nutdamp.figures.geometry import shown_until
    from nutdamp.planning.plan import feasible
    from nutdamp.planning.simulation import Simulation

    spacecraft, pulses = feasible(plan).spacecraft, plan.pulses
    end = units.end_of_flight(spacecraft.watched_until(pulses.end) if until is None else until)
    drawn_to = shown_until(spacecraft, pulses) if until is None else end
    return Simulation(plan, end, flown, units.count("samples", samples, 2), drawn_to)


def trade(
    spacecraft: Spacecraft,
    points: int = 10,
    allow: Iterable[float] = (0.0, math.inf),
    least: str = "propellant",
    *,
    with_disturbances: bool = False,
    nominal: bool = False,
    progress: Progress = lambda _done, _all: None,
) -> Trade:
    """Trade time against cost, as ``nutdamp trade`` does.

    Parameters
    ----------
    points
        Horizons tried for each front.
    allow
        How far from its target H may end, rad; a front for each.
    least, progress
        ``propellant`` or ``impulse``; called with the number of horizons tried, and that of all.
    nominal
        Judge schedules by nominal values, without dispersed cases.

    Examples
    --------
    >>> nutdamp.trade(nutdamp.example().with_(limits={"horizon": "8 s"}), 1, [0.0])
    <Trade of Sounder-1, fronts: 1, schedules: 1>
    """
    from nutdamp.planning import tradeoff

    spacecraft = _expected(spacecraft)
    count = units.count("points", points)
    shifts = units.shifts(allow)
    options = OptimalOptions(
        least=units.one_of("least", least, LEAST[:2]), with_disturbances=with_disturbances
    )
    with work.steps(count * len({*shifts}), hook=progress):
        return tradeoff.trade(spacecraft, options, count=count, shifts=shifts, nominal=nominal)


def disperse(
    plan: Plan,
    samples: int | None = None,
    *,
    seed: int = 1,
    threads: int | None = None,
    csv: PathName | None = None,
    remark: Callable[[str], object] = lambda _: None,
    progress: Progress = lambda _done, _all: None,
    stopped: Callable[[], bool] = lambda: False,
) -> Dispersion:
    """Fly the schedule of a plan through its real widths in dispersed cases, as ``nutdamp
    disperse`` does.

    Parameters
    ----------
    samples, seed
        Number of cases, default as many as show the share required, 20,000 or more; and the seed of
        their draws: a whole number from 0 to 2**64 - 1.
    threads
        Default: the processors there are.
    csv
        File of the inputs and outputs of each case, written as they are flown.
    remark, progress, stopped
        Called with notes on the model; with the number of cases flown, and that of all; to end
        early. A stop before the first case raises KeyboardInterrupt.

    Examples
    --------
    >>> nutdamp.disperse(nutdamp.plan(nutdamp.example(), "two-pulse"), 100)
    <Dispersion: 100 of 100 cases comply>
    """
    from nutdamp.files.export import SamplesWriter, streamed
    from nutdamp.montecarlo import study as dispersion
    from nutdamp.planning.plan import feasible
    from nutdamp.planning.screening import Dispersion

    study = dispersion.study_of(feasible(plan).spacecraft, plan.pulses, seed=units.seed(seed))
    count = None if samples is None else units.count("samples", samples)
    if study.lightening_error:
        remark(study.lightening_error)

    def fly(collect: Callable[..., None] | None) -> Results:
        run = functools.partial(
            dispersion.run, threads=threads or dispersion.threads_here(), stopped=stopped
        )
        with work.steps(count or work.SAMPLES, hook=progress) as task:
            stage = functools.partial(run, watch=task.reach, collect=collect)
            return dispersion.flown_in_stages(study, count, fly=stage, stopped=stopped)

    return Dispersion(*streamed(csv, study, SamplesWriter, fly), plan=plan)


def disperse_loop(
    spacecraft: Spacecraft,
    samples: int | None = None,
    *,
    until: float | None = None,
    seed: int = 1,
    csv: PathName | None = None,
    remark: Callable[[str], object] = lambda _: None,
    progress: Progress = lambda _done, _all: None,
    stopped: Callable[[], bool] = lambda: False,
) -> LoopDispersion:
    """Fly the closed loop of the file in dispersed cases to ``until`` s, as ``nutdamp disperse
    --loop`` does.

    ``samples``: default what shows the share required. Others: see `disperse`. Raises Infeasible
    where it cannot damp.

    >>> nutdamp.disperse_loop(nutdamp.example("upper-stage"), 20, until=60.0)
    <LoopDispersion: 20 of 20 cases comply>
    """
    from nutdamp.control_loop import dispersion
    from nutdamp.files.export import streamed
    from nutdamp.views.loop_cases import LoopCasesWriter

    end = None if until is None else units.end_of_flight(until)
    study = dispersion.loop_study(_expected(spacecraft), end, seed=units.seed(seed))
    count = study.enough if samples is None else units.count("samples", samples)
    looks = study.expect_affordable(count)
    if study.alone:
        what = f"{study.alone}: the cases fly one by one, and look at about {looks:,} samples"
        remark(f"{what}, which takes {study.price_alone(count)}")
    cases = dispersion.LoopResults(study, count)

    def fly(collect: Callable[..., None] | None) -> dispersion.LoopResults:
        with work.steps(count, hook=progress) as task:
            return dispersion.run(cases, watch=task.reach, stopped=stopped, collect=collect)

    return dispersion.LoopDispersion(*streamed(csv, study, LoopCasesWriter, fly))


def loop(
    spacecraft: Spacecraft, until: float | None = None, *, seed: int = 1, case: int | None = None
) -> LoopPlan:
    """Fly the closed loop of the file, as ``nutdamp loop`` does.

    Parameters
    ----------
    until
        End, s, default the horizon after the nutation is at ``start``.
    seed, case
        Of the noise of the sensor; number (from 1) of a dispersed case of `disperse_loop` with that
        seed.

    Examples
    --------
    >>> nutdamp.loop(nutdamp.example("upper-stage"), 60.0).flown_run.stop.name
    'END'
    """
    from nutdamp.control_loop.evaluation import loop_of

    end = None if until is None else units.end_of_flight(until)
    number = None if case is None else units.count("case", case) - 1
    return loop_of(_expected(spacecraft), end, seed=units.seed(seed), case=number)


def verify(plan: Plan) -> Verified:
    """Fly the schedule of a plan by independent methods, as ``nutdamp verify`` does.

    Examples
    --------
    >>> nutdamp.verify(nutdamp.plan(nutdamp.example(), "two-pulse")).agree
    True
    """
    from nutdamp.flight import verification
    from nutdamp.planning.plan import feasible
    from nutdamp.planning.simulation import Verified, unrounded

    spacecraft, expected = feasible(plan).spacecraft, plan.options.with_disturbances
    return Verified(
        verification.verify(spacecraft, plan.pulses, unrounded(plan), expected=expected), plan
    )


def verify_loop(spacecraft: Spacecraft, until: float | None = None) -> LoopVerification:
    """Fly the closed loop of the file in closed form and by DOP853 to ``until`` s, as ``nutdamp
    verify --loop`` does.

    Examples
    --------
    >>> nutdamp.verify_loop(nutdamp.example("upper-stage"), 10.0).agree
    True
    """
    from nutdamp.control_loop import evaluation

    return evaluation.verify_loop(
        _expected(spacecraft), None if until is None else units.end_of_flight(until)
    )


def budget(
    spacecraft: Spacecraft,
    thresholds: Iterable[tuple[float, float]] = (),
    *,
    largest: float | None = None,
    seed: int = 1,
    progress: Progress = lambda _done, _all: None,
) -> Budget:
    """Budget pulses a day and propellant a year that hold the nutation, as ``nutdamp budget`` does.

    Parameters
    ----------
    thresholds, largest
        Pairs (start, stop), rad, default those of the loop; nutation by which damping must begin,
        default as required.
    seed, progress
        Of the noise of the sensor; called with the number of pairs done, and that of all.

    Examples
    --------
    >>> nutdamp.budget(nutdamp.example("upper-stage"))
    <Budget of Upper stage, pairs of thresholds: 1>
    """
    from nutdamp.control_loop import budget as holding
    from nutdamp.spacecraft.requirements import expect_loop

    spacecraft = _expected(spacecraft)
    rows = [holding.Thresholds(*pair) for pair in units.thresholds(thresholds)]
    if largest is not None:
        units.tilt(largest)
    if rows:
        expect_loop(spacecraft)
    with work.steps(max(len(rows), 1), hook=progress):
        return holding.budget(spacecraft, rows, largest, seed=units.seed(seed))


def export(
    plan: Plan,
    format: str,  # noqa: A002 - as --format
    path: PathName,
    *,
    until: float | None = None,
    xml: bool | None = None,
) -> None:
    """Write a plan in a format of ``nutdamp export``.

    Parameters
    ----------
    format, path
        Name of the format and of the file.
    until, xml
        End of a history or spin table, s; CCSDS messages as XML, default where the name ends in
        .xml.

    Examples
    --------
    >>> nutdamp.export(nutdamp.plan(nutdamp.example(), "two-pulse"), "json", "plan.json")
    """
    from nutdamp.files.tabular import write_whole
    from nutdamp.planning.plan import feasible
    from nutdamp.views.exchange import FORMATS, export_text

    form = units.one_of("format", format, tuple(FORMATS))
    name = units.path("path", path)
    end = None if until is None else units.end_of_flight(until)
    notation = FORMATS[form].message and name.lower().endswith(".xml") if xml is None else xml
    write_whole(name, export_text(feasible(plan), form, xml=notation, until=end))


def fit(
    telemetry: PathName,
    spacecraft: Spacecraft,
    *,
    schedule: Plan | PathName | None = None,
    sun_pulses: PathName | None = None,
    ignored: Callable[[str], object] | None = None,
) -> Fitted:
    """Estimate a spacecraft from a CSV file of telemetry, as ``nutdamp fit`` does.

    Parameters
    ----------
    telemetry, sun_pulses, schedule
        Names of the CSV files, and of that of the pulses fired during the record, or a plan of
        `load_schedule`.
    ignored
        Called with columns that are ignored, in place of Python warnings of them and of doubts
        about the estimates.

    Examples
    --------
    >>> body = nutdamp.example()
    >>> nutdamp.plan(body, "none").fly(20.0, samples=50).to_csv("flight.csv")
    >>> nutdamp.fit("flight.csv", body, ignored=print).spacecraft().name
    'Sounder-1'
    """
    from nutdamp.estimation.results import Fitted, compared, doubts
    from nutdamp.files.schedules import read_pulses
    from nutdamp.files.telemetry import read_telemetry
    from nutdamp.planning.plan import Plan
    from nutdamp.views.text import text

    spacecraft = _expected(spacecraft)
    name = units.path("telemetry", telemetry)
    odd = list[str]()
    if schedule is None or isinstance(schedule, Plan):
        fired = None if schedule is None else schedule.pulses
    else:
        fired, odd = read_pulses(
            units.path("schedule", schedule, "a Plan or the name of a file"), spacecraft
        )
    record, remarks = read_telemetry(
        name,
        spacecraft,
        None if sun_pulses is None else units.path("sun_pulses", sun_pulses),
        fired,
    )
    for remark in (*odd, *remarks):
        (ignored or warn)(remark)
    estimate = compared(spacecraft, record)
    for entry in doubts(estimate) if ignored is None else ():
        warn(text(entry))
    return Fitted(estimate, tuple(remarks))


def report(
    spacecraft: Spacecraft | PathName | Mapping[str, object],
    output: PathName = "report.html",
    names: Sequence[str] = (),
    options: Choice = None,
    *,
    disperse: int | None = None,
    points: int | None = None,
    **control: str,
) -> Report:
    """Compare the schemes named, and write the page of ``nutdamp report``; raises MissingExtra
    without the extra plot.

    Parameters
    ----------
    spacecraft, output
        One of `load`, or an argument of `load`; HTML file.
    names, options, disperse
        As of `compare`, with ``disperse`` for its ``samples``.
    points
        Horizons tried for each front of time against cost, none by default.
    control
        Texts of title, document, issue, author, date; see ``report --help``.

    Examples
    --------
    >>> nutdamp.report(nutdamp.example(), "report.html", ["two-pulse"], disperse=0).verdict.met
    True
    """
    from nutdamp.files.tabular import write_whole
    from nutdamp.page.document import controlled
    from nutdamp.page.report import called, expect_html, made_of
    from nutdamp.spacecraft.model import Spacecraft

    name = units.path("output", output)
    kept = controlled(**control)
    expect_html(name)
    read = spacecraft if isinstance(spacecraft, Spacecraft) else load(spacecraft)
    samples = disperse if disperse in (None, 0) else units.count("disperse", disperse)
    compared = compare(read, names, options, samples=samples)
    known = isinstance(options, Options) and options.with_disturbances
    fronts = () if points is None else trade(read, points, with_disturbances=known).fronts
    given = {
        **{"options": options and f"nutdamp.{options!r}", "disperse": disperse, "points": points},
        **{key: repr(value) for key, value in control.items()},
    }
    keyed = (f"{key}={value}" for key, value in given.items() if value is not None)
    how = ", ".join([repr(name), *[repr(list(names))] * bool(names), *keyed])
    page = made_of(compared, called(read, how), kept, fronts)
    write_whole(name, page.content)
    return page
