"""nutdamp as a library. Each command has a function here, which the command line calls, so both
give the same numbers.

    import nutdamp

    spacecraft = nutdamp.load("spacecraft.yaml")
    plan = nutdamp.plan(spacecraft, "two-pulse")
    flight = plan.fly()
    flight.to_csv("track.csv")

Attributes are in SI, angles in radians. Vectors are in principal axes, unless they are said to be
in the axes of the spacecraft file. Arrays with named fields have the names and units of the CSV
files. A wrong argument raises BadRequest, which is a NutdampError like all errors of the package.
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

    Raises CannotRead, or FaultyFile with all faults. Line numbers of a dict are those of its JSON.

    Examples
    --------
    >>> top = {"name": "Top", "inertia": {"A": 120, "C": "80 kg m^2"}, "omega0": [0.1, 0, 3]}
    >>> nutdamp.load(top)
    <Spacecraft Top: prolate, a = 0.3333, nutation 2.862 deg>
    """
    from nutdamp.files.reader import source_of

    return source_of(path, set).read()


def read(text: str, name: str = "text") -> Spacecraft:
    """Read the spacecraft in the ``text`` of a file; faults call the file ``name``.

    Raises FaultyFile with all faults.

    Examples
    --------
    >>> nutdamp.read("{name: Top, inertia: {A: 120, C: 80}, omega0: [0, 0, 3]}").nutation
    0.0
    """
    from nutdamp.files.reader import Source

    units.instance("text", text, str, "the text of a spacecraft file (nutdamp.load reads files)")
    return Source(text, units.instance("name", name, str, "a text")).read()


def example(name: str = "example") -> Spacecraft:
    """Load the built-in example, or an example of ``nutdamp init --list`` by its ``name``.

    Examples
    --------
    >>> nutdamp.example("ace").name
    'ACE'
    """
    from nutdamp.files.reader import Source, example_names, example_text

    known = units.one_of("name", name, example_names())
    return Source(example_text(known), f"{known}.yaml").read()


def check(path: PathName | Mapping[str, object]) -> CheckedFile:
    """Check a spacecraft file, as ``nutdamp check`` does.

    Raises CannotRead, or FaultyFile with all faults.

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
    """Plan one scheme, or the recommended one, and fly it to judge it.

    An infeasible plan has its reason in ``why``.

    Parameters
    ----------
    spacecraft
        Of `load`, `read` or `example`.
    scheme
        Name of a scheme. Default: the scheme that `compare` recommends; raises Infeasible if none
        is feasible.
    options, chosen
        `Options` of several schemes, or the options of one scheme. Or their fields by keyword, in
        SI: ``on_time=0.2`` (s).
    target, spin
        Goal in place of that of the file, as ``--target`` and ``--spin`` take it: ``"10deg,45deg"``
        or two numbers in rad; ``"30rpm"``, ``"keep"`` or a number in rad/s.

    Examples
    --------
    >>> nutdamp.plan(nutdamp.example(), "two-pulse")
    <Plan two-pulse: 2 pulses until 7.434 s, nutation left 0 deg>
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
        Schemes. Default: the classic three and optimal; with a target axis the schemes that point.
    options, target, spin, chosen
        As for `plan`. Each scheme takes the options that it has.
    samples
        Number of dispersed cases of each plan, if the file has dispersions. 0 judges nominal values
        only.
    timed
        Recommend also pulses that no command block can fire.
    robust
        Try a robust plan if too few cases comply with each usual scheme. Not used with ``samples``.

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
    """Find the cheapest plan with which enough dispersed cases comply, as ``nutdamp plan --robust``
    does.

    Raises BadRequest where the spacecraft file has no dispersions.

    Parameters
    ----------
    spacecraft
        Of `load`, or a comparison of `compare`, whose plans are among the candidates.
    options
        The options that the comparison was made with.
    progress
        Called with the number of attempts made and the number of all attempts.

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

    Warns if a limit is broken. Raises CannotRead or FaultyFile.

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
    """Propagate a plan by the impulse sum (17) and by real widths, as ``nutdamp simulate`` does.

    Parameters
    ----------
    plan
        A plan from `plan` or `load_schedule`. ``plan(spacecraft, "none")`` is free motion.
    until
        End, s. Default: one inertial nutation period after the last pulse.
    flown
        Show the flight through the real widths instead of the impulse sum.
    samples
        Number of rows of the track.

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
        Angles from the target within which H may end, rad. Each gives a front.
    least
        Cost to trade: ``propellant`` or ``impulse``.
    nominal
        Judge schedules by nominal values, without dispersed cases.
    progress
        Called with the number of horizons tried and the number of all.

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
    samples
        Number of cases. Default: enough to show the share required, at least 20,000.
    seed
        Seed of the draws, a whole number from 0 to 2**64 - 1.
    threads
        Number of threads. Default: the number of processors.
    csv
        File for inputs and outputs of each case, written during the flights.
    remark
        Called with notes on the model.
    progress
        Called with the number of cases flown and the number of all.
    stopped
        Called now and then; True ends the study. Before the first case that raises
        KeyboardInterrupt.

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

    ``samples``: default enough to show the share required. For the others see `disperse`. Raises
    Infeasible if the loop cannot damp.

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
        End, s. Default: the horizon after the nutation is at ``start``.
    seed
        Seed of the noise of the sensor.
    case
        Number (from 1) of a dispersed case of `disperse_loop` with that seed.

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
    thresholds
        Pairs (start, stop), rad. Default: the pair of the loop.
    largest
        Nutation at which damping must begin, rad. Default: ``requirement.nutation``.
    seed
        Seed of the noise of the sensor.
    progress
        Called with the number of pairs done and the number of all.

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
    format
        Name of the format.
    path
        Name of the file.
    until
        End of a history or spin table, s.
    xml
        Write a CCSDS message as XML. Default: if the name of the file ends in .xml.

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
    telemetry
        Name of the CSV file.
    schedule
        Pulses fired during the record: the name of their CSV file, or a plan from `load_schedule`.
    sun_pulses
        Name of a CSV file with times of Sun pulses.
    ignored
        Called with warnings on ignored columns and doubtful estimates, which are otherwise Python
        warnings.

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
    """Compare the schemes named, and write the page of ``nutdamp report``.

    Raises MissingExtra without the extra plot.

    Parameters
    ----------
    spacecraft
        A spacecraft from `load`, or an argument of `load`.
    output
        Name of the HTML file.
    names, options
        As for `compare`.
    disperse
        Number of dispersed cases, as ``samples`` of `compare`.
    points
        Number of horizons tried for each front of time against cost. Default: no fronts.
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
