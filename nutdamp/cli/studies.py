"""``simulate``, ``animate``, ``trade``, ``loop``, ``budget``, ``fit`` and ``disperse``; and the
pulses that a command flies.
"""

from __future__ import annotations

import math
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from types import FrameType
from typing import TYPE_CHECKING, Any

import click

from nutdamp.cli.job import (
    FIGURES,
    Files,
    Job,
    Output,
    SessionCommand,
    carry_options,
    defaulted,
    deliver,
    plot_options,
    quiet_option,
    screen_options,
    spacecraft_argument,
)
from nutdamp.cli.main import Terminated, leave, say, show_failures
from nutdamp.cli.options import (
    COUNT,
    END,
    FILE,
    FOLDER,
    OUTPUT,
    Command,
    NameType,
    direction,
    expect_read,
    goal_options,
    quantity,
)
from nutdamp.cli.plan import compared_with, scheme_option
from nutdamp.common.work import SAMPLES
from nutdamp.errors import CannotWrite, Infeasible, printable
from nutdamp.schemes.catalogue import LEAST, NAMES, OPTIMAL, SchemeOptions
from nutdamp.units import LARGEST_SEED, Angles, Bare, reading, shifts, thresholds, tilt

if TYPE_CHECKING:
    from rich.console import RenderableType

    from nutdamp.control_loop.dispersion import LoopDispersion
    from nutdamp.planning.plan import Plan
    from nutdamp.planning.screening import Dispersion
    from nutdamp.planning.tradeoff import Trade


def flown_options(verb: str, scheme: str | None = None) -> Callable[[Command], Command]:
    """``--scheme`` (its help may differ), ``--schedule`` and ``--blocks``: one alone."""
    default = f"{verb} this scheme with default options; without it the recommended one."

    def decorate(command: Command) -> Command:
        read = f"{verb} the pulses of a CSV file, as `plan --csv` writes it."
        fired = f"{verb} what the command blocks of a CSV file fire, as `plan --blocks` writes it."
        command = click.option("--blocks", type=FILE, help=fired)(command)
        command = click.option("--schedule", type=FILE, help=read)(command)
        return scheme_option(type=NameType(NAMES), help=scheme or default)(command)

    return decorate


def fronts_of(
    job: Job, points: int, shifts: Sequence[float], least: str, *, nominal: bool = False
) -> Trade:
    """The fronts of time against cost."""
    from nutdamp.api import trade

    known = job.options.with_disturbances
    with job.working("searching"):
        return trade(
            job.spacecraft, points, shifts, least, with_disturbances=known, nominal=nominal
        )


def plan_or_read(job: Job, *, judged: bool = False) -> Plan:
    """The pulses that a command flies, as a plan; raises Infeasible where there is none.

    ``judged``: a screen names the plan and the cones that are broken, and its last lines are the
    notes; without a screen they are printed at once.
    """
    judged = judged and not job.silent
    from nutdamp import api
    from nutdamp.planning.causes import infeasibility
    from nutdamp.planning.notes import comparison_warnings, plan_notes, reasons
    from nutdamp.views.text import joined

    scheme, schedule, blocks = job.flown
    path = schedule if blocks is None else blocks
    if path is not None:
        from nutdamp.files.schedules import read_plan

        if schedule is not None:
            expect_read((), job.options, job.spacecraft, job.doubt)
        plain = job.options.of(SchemeOptions)
        plan, warnings = read_plan(path, job.spacecraft, plain, blocks=blocks is not None)
        job.doubt(*warnings)
        return plan
    if scheme is None:
        compared = compared_with(job, ())
        recommended = compared.recommended
        show_failures(compared)
        if recommended is not None and not judged:
            job.remark(f"using recommended plan: {recommended.scheme}")
        job.planned += comparison_warnings(compared, tabulated=judged)
        if recommended is None:
            raise Infeasible(f"{joined(reasons(compared))}; `nutdamp plan` says more")
        plan = recommended
    else:
        expect_read((scheme,), job.options, job.spacecraft, job.doubt)
        with job.working("planning"):
            plan = api.plan(job.spacecraft, scheme, job.options)
    if not plan.feasible:
        raise Infeasible(f"{plan.scheme} is infeasible: {infeasibility(plan)}")
    job.planned += plan_notes(plan, cones=scheme is not None and not judged)
    if not judged:
        job.note(job.planned)
    return plan


@click.command("animate", cls=SessionCommand)
@spacecraft_argument
@flown_options("Show")
@goal_options
@click.option(
    "-o",
    "--output",
    type=OUTPUT,
    required=True,
    help="The film: .gif, or .mp4 where ffmpeg is installed.",
)
@click.option("--until", type=END, help="End of the motion; default soon after the last pulse.")
@click.option(
    "--seconds", type=click.FloatRange(0.2, 600.0), help="Length of the film; default 6 s to 30 s."
)
@defaulted("--fps", click.IntRange(1, 50), 20, "Frames a second.")
@defaulted("--width", click.IntRange(320, 3840), 800, "Width in pixels; height 0.6 of it.")
@quiet_option
def animate_command(
    job: Job, until: float | None, seconds: float | None, fps: int, width: int
) -> None:
    """Film the body cone rolling on the space cone through the pulses, flown with their real
    on-times.

    SPACECRAFT is a YAML file; without it spacecraft.yaml in this folder, else the built-in example.
    A FILE of - is standard output, as GIF.
    """
    from nutdamp.figures import image

    output = job.written["output"] or ""
    image.film_format(output)
    spacecraft = job.begin()
    plan = plan_or_read(job)

    from nutdamp.figures.geometry import shown_until

    end = shown_until(spacecraft, plan.pulses) if until is None else until
    timed = image.timing(spacecraft, end, fps, seconds)
    if not timed.smooth:
        job.remark(
            f"only {timed.frames / timed.turns:.1f} frames show a nutation turn, "
            "which may seem to run backwards: "
            f"--seconds {timed.turns * image.SMOOTH / fps:.0f} would show it, or an earlier --until"
        )
    flight = plan._reaching(end)
    with job.working("filming"):
        deliver([(output, lambda: lambda stream: image.film(stream, flight, timed, output, width))])
    if output != "-":
        job.remark(f"wrote {printable(output)}: {timed.frames} frames, {timed.pace:.3g}× real time")


@click.command("simulate", cls=SessionCommand)
@spacecraft_argument
@flown_options(
    "Propagate",
    (
        "Plan this scheme with default options and propagate it, not the recommended one; "
        "none is free motion."
    ),
)
@goal_options
@click.option(
    "--flown",
    "real",
    is_flag=True,
    help="Propagate real on-times instead of the impulse sum (17).",
)
@click.option(
    "--until",
    type=END,
    help="End, of which the outcome is shown; default last pulse + one inertial period.",
)
@defaulted("--samples", click.IntRange(2, 10_000_000), 1000, "Rows of the track.")
@click.option("--csv", type=OUTPUT, help="Write the track.")
@click.option("--json", type=OUTPUT, help="Write pulses, how both models end, and extremes.")
@carry_options("the end")
@plot_options(FIGURES)
@screen_options
def simulate_command(
    job: Job, real: bool, until: float | None, samples: int, at: float | None, verbose: bool
) -> None:
    """Propagate a schedule; show cone angles around each pulse, how it ends by both models, and the
    axis track.

    The verdict is on the whole schedule, in dispersed cases where the file has them; of free motion
    on its end. Exit status 4 where it is not FLY or NO PULSE. SPACECRAFT is a YAML file, or - for
    standard input; without it spacecraft.yaml in this folder, else the built-in example. A FILE of
    - is standard output, for --schedule standard input.
    """
    job.begin()
    plan = plan_or_read(job, judged=True)

    from nutdamp.api import simulate
    from nutdamp.planning.simulation import model_warnings

    simulation = simulate(plan, until, flown=real, samples=samples)
    if job.silent:
        job.note(model_warnings(simulation.impulses, simulation.flown))
    job.deliver(
        simulation,
        more=job.carried(plan, at, simulation.until),
        verbose=verbose,
        planned=job.planned,
    )
    leave(simulation.verdict.status)


@click.command("trade", cls=SessionCommand)
@spacecraft_argument
@click.option(
    "--allow",
    type=quantity(
        "angle",
        lambda shift: shifts([shift]),
        "expected an angle of at least 0, or any",
        any=math.inf,
    ),
    multiple=True,
    metavar="ANGLE|any",
    help="How far from its target H may end; repeatable, a front for each. Default: 0 deg and any.",
)
@defaulted("--points", click.IntRange(1, 1000), 10, "Horizons tried per front.")
@defaulted(
    "--least",
    NameType(LEAST[:2]),
    LEAST[0],
    "What is traded against time; impulse where propellant is unknown.",
)
@partial(goal_options, several=False)
@click.option("--csv", type=OUTPUT, help="Write the points.")
@click.option("--json", type=OUTPUT, help="Write the points with their pulses.")
@click.option(
    "--plot", type=OUTPUT, help="Draw the fronts (.png, .svg, .pdf; needs the extra plot)."
)
@click.option(
    "--schedules",
    type=FOLDER,
    metavar="FOLDER",
    help="Write each schedule as FOLDER/point-N.csv, as `plan --csv` does.",
)
@screen_options
def trade_command(
    job: Job,
    allow: tuple[float, ...],
    points: int,
    least: str,
    schedules: str | None,
    verbose: bool,
) -> None:
    """Trade time against propellant: the cheapest schedules found for ends from the earliest to the
    horizon.

    Each front is of the scheme optimal (of the others where that finds none) and holds no schedule
    that another beats in both. Exit status 4 where none of the schedules may be flown, by their
    verdicts, and 3 where there is none. SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    from nutdamp.files.tabular import make_folder
    from nutdamp.planning.causes import CUT
    from nutdamp.planning.tradeoff import numbered
    from nutdamp.views.trade import schedule_files, schedule_paths

    allowed = allow or (0.0, math.inf)
    for shift in allow:
        if isinstance(shift, Bare) and shift:
            job.doubt(f"--allow: {reading(shift, 'angle', 'deg')}")
    job.begin([] if schedules is None else schedule_paths(schedules, points * len({*allowed})))
    expect_read((OPTIMAL.name,), job.options, job.spacecraft, job.doubt)
    traded = fronts_of(job, points, allowed, least)
    for index, _, point in numbered(traded.fronts):
        if point.plan._cut:
            job.doubt(f"point {index}: {CUT}")
    files: list[Output] = []
    unsaved: list[CannotWrite] = []
    if schedules is not None:
        try:
            make_folder(schedules)
            named = schedule_files(traded.fronts, schedules)
            files = [(path, partial(str, text)) for path, text in named]
        except CannotWrite as wrong:
            unsaved = [wrong]
    job.deliver(traded, files=files, unsaved=unsaved, verbose=verbose)
    judged = [point.verdict.status for _, _, point in numbered(traded.fronts)]
    best = next(
        (status for status in judged if not status.exit_status), judged[0] if judged else None
    )
    if not judged and traded.recommended is not None and traded.recommended.verdict.idle:
        best = traded.recommended.verdict.status
    leave(best, infeasible=best is None)


@click.command("loop", cls=SessionCommand)
@spacecraft_argument
@click.option("--until", type=END, help="End; default: the horizon after the nutation is at start.")
@defaulted("--seed", click.IntRange(0, LARGEST_SEED), 1, "Of the noise of the sensor.")
@click.option(
    "--case",
    type=COUNT,
    help="Fly this dispersed case, as `disperse --loop` does with that seed.",
)
@defaulted("--samples", click.IntRange(2, 10_000_000), 1000, "Rows of the track.")
@click.option("--csv", type=OUTPUT, help="Write the pulses, as `plan --csv` does.")
@click.option("--track", type=OUTPUT, help="Write the track, as `simulate --csv` does.")
@click.option("--json", type=OUTPUT, help="Write firings, dead band, margins.")
@carry_options("end of the run")
@click.option(
    "--plot",
    type=OUTPUT,
    help="Draw nutation, dead band and firings (.png, .svg, .pdf; needs extra plot).",
)
@screen_options
def loop_command(
    job: Job,
    until: float | None,
    seed: int,
    case: int | None,
    samples: int,
    at: float | None,
    verbose: bool,
) -> None:
    """Fly the closed loop of the file: fire from what its gyro or accelerometer shows, and see
    where it ends.

    A channel wired backwards, a reversed sensor and firings that come too late are found and named
    by the first firings that can be judged: exit status 3. SPACECRAFT and FILE are as for `nutdamp
    plan`.
    """
    spacecraft = job.begin()

    from nutdamp.api import loop
    from nutdamp.files.tabular import write_track
    from nutdamp.views.loop import stopped, warnings
    from nutdamp.views.text import text

    with job.working("flying"):
        plan = loop(spacecraft, until, seed=seed, case=case)
    run = plan.flown_run
    if job.silent:
        job.note(warnings(spacecraft))
    pieces = partial(run.flight.pieces, samples, run.until)
    track: Files = {"track": lambda: partial(write_track, pieces(), run.flight.spacecraft.inertia)}
    job.deliver(plan, more=track | job.carried(plan, at), verbose=verbose)
    if run.stop.fault:
        say(f"nutdamp: {text(stopped(run))}")
    leave(plan.verdict.status)


@click.command("budget", cls=SessionCommand)
@spacecraft_argument
@click.option(
    "--thresholds",
    "pairs",
    type=direction(
        thresholds, "expected START above STOP, both below 90 deg, such as 0.5deg,0.1deg"
    ),
    multiple=True,
    metavar="START,STOP",
    help=(
        "Fire from START to STOP, such as 0.5deg,0.1deg; repeatable. Default: "
        "start and stop of loop."
    ),
)
@click.option(
    "--largest",
    type=quantity("angle", tilt, "expected an angle between 0 and 90 deg"),
    help="By which damping must begin; default: requirement.nutation.",
)
@defaulted("--seed", click.IntRange(0), 1, "Of the noise of the sensor.")
@click.option("--csv", type=OUTPUT, help="Write a row for each two thresholds.")
@click.option("--json", type=OUTPUT, help="Write the same, and how the nutation grows.")
@click.option("--plot", type=OUTPUT, help="Draw it (.png, .svg, .pdf; needs extra plot).")
@screen_options
def budget_command(
    job: Job, pairs: tuple[Angles, ...], largest: float | None, seed: int, verbose: bool
) -> None:
    """Budget a mission: pulses a day and propellant a year that hold the nutation against energy
    dissipation.

    The limit cycle of the loop in the file, from event to event in closed form; and how long until
    damping must begin. A body whose nutation decays needs none. SPACECRAFT and FILE are as for
    `nutdamp plan`.
    """
    spacecraft = job.begin()
    for text in (text for pair in pairs for text in pair.readings):
        job.doubt(f"--thresholds: {text}")

    from nutdamp.api import budget

    with job.working("following cycles"):
        result = budget(spacecraft, pairs, largest=largest, seed=seed)
    job.deliver(result, verbose=verbose)
    leave(result.status)


@click.command("fit", cls=SessionCommand)
@click.argument("telemetry", type=FILE, metavar="TELEMETRY.csv")
@spacecraft_argument
@click.option(
    "--schedule",
    type=FILE,
    help="Pulses fired during the record, a CSV file as `plan --csv` writes it.",
)
@click.option(
    "--sun-pulses",
    type=FILE,
    help="Times of Sun pulses, a CSV file: t_s or utc, and any sun_aspect_deg.",
)
@click.option(
    "--at",
    type=quantity("time"),
    default=0.0,
    help="Show and write the motion at this time; default 0 s.",
)
@click.option(
    "-o", "--output", type=OUTPUT, help="Write the spacecraft file with the estimates in it."
)
@click.option(
    "--accept", is_flag=True, help="Accept an estimate that is far from the file: -o writes it."
)
@click.option("--json", type=OUTPUT, help="Write estimates, covariance and signals.")
@click.option(
    "--plot", type=OUTPUT, help="Draw residuals and changes (.png, .svg, .pdf; needs extra plot)."
)
@screen_options
def fit_command(
    job: Job, telemetry: str, sun_pulses: str | None, at: float, accept: bool, verbose: bool
) -> None:
    """Estimate motion, C/A, dissipation and sensor errors from telemetry, and thrust factors from
    pulses fired in it.

    TELEMETRY.csv has t_s or utc, and any of omega_1_rad_s, omega_2_rad_s, omega_3_rad_s (or
    _deg_s), axis_ra_deg and
    axis_dec_deg, axis_x, axis_y and axis_z, q_w to q_z, acceleration_m_s2, crossing_azimuth_deg and
    crossing_elevation_deg of crossing_ra_deg and crossing_dec_deg (of the Sun where they are
    empty), sun_aspect_deg,
    sun_pulse (0 or 1); empty cells are missing samples. It may be an attitude history instead: an
    AEM or ACM in KVN, or an attitude file of STK.
    Least squares on the closed forms of the coast; what the data do not tell stays at the
    tolerances of the file.
    -o writes the file with its comments kept: motion at --at, moments, and as dispersions how well
      all is known.

    \b
      nutdamp fit flight.csv -o now.yaml --at 90s
      nutdamp plan now.yaml

    Exit status 3 where nothing can be estimated, several nutation rates fit equally well, residuals
    are no noise, as with a pulse that --schedule does not have, or the estimate is far from the
    file: then -o needs --accept. SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    spacecraft = job.begin()

    from nutdamp.api import fit
    from nutdamp.estimation.results import carried, refused
    from nutdamp.files.carried import notes
    from nutdamp.views.fit import fit_screen

    with job.working("fitting"):
        fitted = fit(
            telemetry,
            spacecraft,
            schedule=job.flown.schedule,
            sun_pulses=sun_pulses,
            ignored=job.doubt,
        )
    job.note(notes(fitted.core, carried(fitted.core, at)))
    files: Files = {"output": partial(fitted.text, at), "json": partial(fitted.to_dict, at)}
    doubtful = bool(refused(fitted.core)) and not accept
    output = job.written["output"]
    if doubtful and output is not None:
        del files["output"]
        say(
            f"{printable(output)} was not written: the estimate is far from the file "
            "(--accept writes it)"
        )
    job.deliver(fitted, partial(fit_screen, fitted.core, at, verbose=verbose), more=files)
    leave(infeasible=doubtful)


DISPERSED_FIGURES = ("overview", "cases", "momentum")  # figures that ``--plot`` draws


class Interruption:
    """Request to stop a run, and the signal that made it."""

    number: int | None = None

    def __call__(self) -> bool:
        """True where a stop was requested."""
        return self.number is not None


@contextmanager
def stoppable() -> Iterator[Interruption]:
    """An `Interruption` by Ctrl-C or SIGTERM ends a run in order; a second Ctrl-C at once."""
    stop = Interruption()

    def ask(number: int, _: FrameType | None) -> None:
        if stop() and number == signal.SIGINT:
            raise KeyboardInterrupt
        stop.number = number

    before = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    except KeyboardInterrupt:
        raise Terminated() if stop.number == signal.SIGTERM else KeyboardInterrupt from None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@click.command("disperse", cls=SessionCommand)
@spacecraft_argument
@flown_options("Disperse")
@goal_options
@click.option(
    "--samples",
    type=COUNT,
    show_default=f"{SAMPLES}; of --loop what shows the share required, 2000 or more",
    help="Dispersed cases to fly.",
)
@defaulted("--seed", click.IntRange(0, LARGEST_SEED), 1, "Same seed, same draws, always.")
@click.option("--threads", type=click.IntRange(1, 1024), help="Default: the processors there are.")
@click.option(
    "--loop",
    "looped",
    is_flag=True,
    help="Disperse the closed loop of the file: body, valves and sensor.",
)
@click.option(
    "--until", type=END, help="End of --loop; default: the horizon after the nutation is at start."
)
@click.option("--case", type=COUNT, help="Show this one case alone, with all its inputs.")
@defaulted("--worst", click.IntRange(0, 1000), 5, "Worst cases with -v.", metavar="N")
@click.option(
    "--csv", type=OUTPUT, help="Write inputs and outcome of every case, with angles to cones."
)
@click.option(
    "--json", type=OUTPUT, help="Write percentiles, requirement, tolerance budget, worst cases."
)
@plot_options(DISPERSED_FIGURES)
@screen_options
def disperse_command(
    job: Job,
    samples: int | None,
    seed: int,
    threads: int | None,
    looped: bool,
    until: float | None,
    case: int | None,
    worst: int,
    verbose: bool,
) -> None:
    """Fly one schedule, or the closed loop, in many cases, dispersed as the spacecraft file says.

    Shows the verdict, each bound with the share of cases that keep it, percentiles of what is left,
    and which tolerance counts; with -v the tolerance budget and the worst cases. Exit status 4
    where these cases do not show that enough comply. Ctrl-C ends the run and shows what is done.
    SPACECRAFT and FILE are as for `nutdamp plan`.
    """
    if case is not None and (job.written["csv"] or job.written["plot"]):
        raise click.UsageError("--case shows a single case: --csv and --plot are for a study")
    if until is not None and not looped:
        raise click.UsageError("--until is for --loop")
    others = (
        {**job.flown._asdict(), "threads": threads, "figure": job.figure != DISPERSED_FIGURES[0]}
        if looped
        else {}
    )
    for name in (name for name, value in others.items() if value):
        raise click.UsageError(
            f"--loop flies the loop of the file, all in one way: leave --{name} out"
        )
    spacecraft = job.begin()

    from nutdamp import api
    from nutdamp.spacecraft.requirements import expect_loop
    from nutdamp.spacecraft.tolerances import expect_dispersions

    if looped:
        expect_loop(spacecraft)
        job.figure = None
    expect_dispersions(spacecraft.dispersions)
    plan = None if looped else plan_or_read(job, judged=case is None)
    if case is not None:
        deliver_case(job, plan, case - 1, seed=seed, until=until)
        return
    flown: LoopDispersion | Dispersion
    with stoppable() as stopped, job.working("flying"):
        # Rows are written as they are flown, of any number of cases, and not again as a result.
        rows = job.written.pop("csv")
        hooks: dict[str, Any] = {"seed": seed, "csv": rows, "stopped": stopped}
        if plan is None:
            flown = api.disperse_loop(spacecraft, samples, until=until, remark=job.remark, **hooks)
        else:
            flown = api.disperse(plan, samples, threads=threads, remark=job.remark, **hooks)
    job.deliver(
        flown, unsaved=[flown.unsaved], verbose=verbose, planned=job.planned or None, worst=worst
    )
    if stopped.number is not None and flown.core.done < flown.core.requested:
        say(f"interrupted: {flown.core.done} of {flown.core.requested} cases are done")
        sys.exit(128 + stopped.number)
    leave(flown.verdict.status)


def deliver_case(job: Job, plan: Plan | None, case: int, *, seed: int, until: float | None) -> None:
    """Show a single case (from 0) of a schedule, or without ``plan`` of the closed loop."""
    data: Callable[[], dict[str, Any]]
    screen: Callable[[], RenderableType]
    if plan is None:
        from nutdamp.control_loop.dispersion import loop_study
        from nutdamp.views.loop_cases import loop_case_json, loop_case_screen

        loops = loop_study(job.spacecraft, until, seed=seed)
        flown = loops.fly([loops.case(case)])
        data = partial(loop_case_json, loops, case, flown)
        screen = partial(loop_case_screen, loops, case, flown)
    else:
        from nutdamp.montecarlo.study import study_of
        from nutdamp.views.dispersion import case_json, case_screen

        study = study_of(plan.spacecraft, plan.pulses, seed=seed)
        if study.lightening_error:
            job.remark(study.lightening_error)
        draws = study.draws_of(case)
        scheme = plan.scheme
        data = lambda: {"scheme": scheme, "seed": seed, **case_json(study, case, draws)}  # noqa: E731
        screen = partial(case_screen, study, case, draws, scheme=scheme)
    job.deliver(None, screen, more={"json": data})
