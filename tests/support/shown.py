"""What figures and pages show, as tests read it."""

import base64
from dataclasses import replace
from functools import cache

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from support.builders import aimed, cross, fan, spinner
from support.markup import Node, parsed

from nutdamp.figures import geometry, overview
from nutdamp.files.reader import read_spacecraft
from nutdamp.flight.propagation import Flight, Track
from nutdamp.montecarlo.study import Results, run, study_of
from nutdamp.page.document import Page
from nutdamp.page.report import page_html
from nutdamp.planning import plan as planning
from nutdamp.planning.decision import Comparison, compare
from nutdamp.planning.screening import Dispersion
from nutdamp.schemes.catalogue import CLASSIC
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Attitude, Limits, Requirement, Spacecraft, Vector
from nutdamp.spacecraft.schedule import Schedule, channel_pulse, steerable_pulse

WIDE = spinner(channels=cross(20.0))
BODY = spinner(channels=cross(20.0), requirement=Requirement(0.01, 0.005))


def kicks(body: Spacecraft, count: int, step: float, on_time: float) -> Schedule:
    """So many short pulses of all channels in turn, whatever they do."""
    channels = body.channels
    return Schedule(
        tuple(
            channel_pulse(channels[n % len(channels)], 0.5 + n * step, on_time)
            for n in range(count)
        )
    )


NAMES = ("overview", "motion", "history")  # the last one is the picture of the report
TORQUER = Steerable(50.0)
STEERED = spinner(steerable=TORQUER, requirement=Requirement(0.01))
SIXTEEN = spinner(degrees=8.0, channels=fan(16, 20.0))
H_MARKS = "H"

CASES: dict[str, tuple[Spacecraft, Schedule | str]] = {
    "wide pulses": (BODY, "two-pulse"),
    "three moments": (
        spinner(moments=(120, 100, 80), degrees=25.0, channels=cross(40.0)),
        "two-pulse",
    ),
    "three moments, oblate": (
        spinner(moments=(80, 90, 120), degrees=10.0, channels=cross(1.0)),
        Schedule(),
    ),
    "34 pulses": (spinner(degrees=8.0, channels=cross(20.0, max_on_time=0.05)), "four-pulse"),
    "120 pulses": (BODY, kicks(BODY, 120, 0.4, 0.01)),
    "16 channels": (SIXTEEN, kicks(SIXTEEN, 32, 0.45, 0.05)),
    "oblate": (spinner(80, 120, 3.0, 10.0, channels=cross(20.0)), kicks(WIDE, 4, 1.1, 0.2)),
    "reversed": (spinner(120, 80, -3.0, 10.0, channels=cross(20.0)), kicks(WIDE, 4, 1.1, 0.2)),
    "oblate, reversed": (spinner(80, 120, -3.0, 10.0, channels=cross(20.0)), "four-pulse"),
    "needle at 60°": (spinner(239, 6.01, 4.2, 60.0, channels=cross(40.0)), "four-pulse"),
    "ideal impulses": (spinner(80, 120, 3.0, 75.0, steerable=Steerable()), "two-pulse"),
    "0.01°": (spinner(degrees=0.01, channels=cross(1.0)), "two-pulse"),
    "sphere": (spinner(100, 100, 3.0, 10.0, steerable=TORQUER), "two-pulse"),
    "blackouts": (
        spinner(
            channels=cross(20.0),
            limits=Limits(earliest=1.0, blackout=((3.0, 4.5), (6.0, 7.0), (20.0, 25.0))),
        ),
        "four-pulse",
    ),
    "far target": (aimed(spinner(steerable=Steerable()), 110.0, 20.0), "two-pulse"),
    "celestial": (
        replace(BODY, attitude=Attitude(np.array([0.7, 0.1, 0.7, 0.1]))),
        kicks(BODY, 5, 0.9, 0.2),
    ),
    "one pulse": (BODY, kicks(BODY, 1, 1.0, 0.3)),
    "one pulse at once": (STEERED, Schedule((steerable_pulse(TORQUER, 0.2, 1.0, impulse=20.0),))),
    "steered": (
        STEERED,
        Schedule(
            tuple(steerable_pulse(TORQUER, t, t, on_time=0.01) for t in (0.005, 0.9, 1.8, 2.6))
        ),
    ),
    "no pulses": (WIDE, Schedule()),
    "no nutation": (spinner(degrees=0.0, channels=cross(20.0)), Schedule()),
    "long name": (replace(WIDE, name="$x$ of a\nprogramme_with 測 " * 5), "one-pulse"),
}


@cache
def flown(case: str) -> tuple[Flight, Track]:
    """The flight of a case, as far as its pictures reach."""
    body, pulses = CASES[case]
    pulses = planning.plan(body, pulses).pulses if isinstance(pulses, str) else pulses
    made, track = overview.shown(planning.Plan(body, "trial", pulses))
    return made, geometry.drawn(made, track)


@cache
def drawn(name: str, case: str) -> Figure:
    """A figure of a case."""
    return figure_of(name, *flown(case))


def flight_picture(name: str, body: Spacecraft, pulses: Schedule | str = "two-pulse") -> Figure:
    """A figure of a schedule, or of the one of a scheme."""
    plan = (
        planning.plan(body, pulses)
        if isinstance(pulses, str)
        else planning.Plan(body, "trial", pulses)
    )
    return figure_of(name, *overview.shown(plan))


def figure_of(name: str, flight: Flight, track: Track) -> Figure:
    """One of `NAMES`."""
    if name == "history":
        return overview.history_figure(flight, track)
    return overview.flight_figure(name, flight, track)


def studied(body: Spacecraft, count: int, scheme: str = "two-pulse") -> Dispersion:
    """Dispersed cases of the plan of a scheme, flown."""
    plan = planning.plan(body, scheme)
    return Dispersion(run(Results(study_of(body, plan.pulses), count), threads=1), plan=plan)


def points(axes: Axes, label: str) -> Vector:
    """The points of the line of that label, without the gaps."""
    (data,) = (
        np.asarray(one.get_xydata(), dtype=np.float64)
        for one in axes.lines
        if one.get_label() == label
    )
    return np.asarray(data[np.isfinite(data).all(axis=1)])


def legend_words(figure: Figure) -> set[str]:
    """What the legends of a figure and of its parts say."""
    legends = [one for part in (figure, *figure.subfigs) for one in part.legends]
    return {text.get_text() for one in legends for text in one.get_texts()}


def heading(figure: Figure) -> str:
    """The title of a figure in one line."""
    return " ".join(figure.get_suptitle().split())


def notes(axes: Axes) -> list[Annotation]:
    """Labels that are to be seen in a panel."""
    return [one for one in axes.texts if isinstance(one, Annotation) and one.get_visible()]


def check_star(axes: Axes, place: Vector, radius: float) -> None:
    """Fails where a word lies under a star at a place, whose radius is in points."""
    middle = axes.transData.transform(place)
    for note in axes.texts:
        box = note.get_window_extent()
        assert (
            np.hypot(*(np.clip(middle, box.min, box.max) - middle))
            > radius * axes.figure.dpi / 72.0
        ), note.get_text()


@cache
def compared_text(text: str, names: tuple[str, ...] = CLASSIC) -> Comparison:
    """The comparison of schemes for the text of a spacecraft file."""
    return compare(read_spacecraft(text, "craft.yaml"), names)


def tree(page: Page | str) -> Node:
    """What a page holds."""
    return parsed(
        (page if isinstance(page, str) else page_html(page)).removeprefix("<!DOCTYPE html>")
    )


def downloaded(link: Node) -> str:
    """The text of the file that a link holds."""
    head, _, content = link.attributes["href"].partition(",")
    assert head == "data:text/yaml;base64"
    return base64.b64decode(content).decode()


def section(page: Node, name: str) -> Node:
    """The section of that id."""
    (node,) = (node for node in page.all("section") if node.attributes["id"] == name)
    return node


def cells(table: Node) -> list[list[Node]]:
    """The rows of a table, its headings first."""
    return [[cell for cell in row if cell.tag in ("th", "td")] for row in table.all("tr")]


def sheet(node: Node, title: str) -> list[dict[str, str]]:
    """The rows of the table of that title, by their headings."""
    (table,) = (one for one in node.all("table") if one.all("caption")[0].text.startswith(title))
    heads, *rows = [[cell.text for cell in row] for row in cells(table)]
    return [dict(zip(heads, row, strict=True)) for row in rows]


def facts(node: Node, title: str) -> dict[str, str]:
    """The table of that title, which says one thing a row."""
    (table,) = (one for one in node.all("table") if one.all("caption")[0].text.startswith(title))
    return {name.text: value.text for name, value, *_ in cells(table)}
