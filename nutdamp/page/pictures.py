"""The pictures of a page: inline SVG, their titles as text of the page."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from nutdamp.figures import dispersion, image, overview, trade
from nutdamp.figures.overview import NARROW
from nutdamp.page.document import Picture
from nutdamp.planning.decision import Comparison
from nutdamp.planning.plan import Plan
from nutdamp.planning.tradeoff import Front

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.montecarlo.study import Results


POINTS = 72.0
"""Units of an SVG in an inch."""

FLIGHT = (
    (
        "motion",
        "Pole curve: the tip of the rotation vector ω in the body. Axis track: the spin axis in space, "
        "with the places of the angular momentum H.",
        "Pole curve in the body and track of the spin axis in space, with numbered pulses",
    ),
    (
        "history",
        "Nutation on a log axis with what is required, the firings of each channel, and body rates over time.",
        "Nutation, firings and body rates over time",
    ),
)
"""Names of the pictures of a flight, their captions and descriptions."""


def flight_pictures(plan: Plan) -> tuple[Picture, ...]:
    """Motion and history of a plan, from its flight through the real widths; raises MissingExtra."""
    flown, track = overview.shown(plan)

    def figure(name: str, *, narrow: bool = False) -> Figure:
        return overview.flight_figure(name, flown, track, narrow=narrow)

    return tuple(
        _picture(figure(name), caption, described, figure(name, narrow=True) if name in NARROW else None)
        for name, caption, described in FLIGHT
    )


def trade_picture(compared: Comparison, fronts: Sequence[Front]) -> Picture:
    """Time against cost, with the recommended plan among the schedules of the fronts; raises MissingExtra."""
    wide, narrow = (
        trade.trade_figure(compared.spacecraft, fronts, compared.recommended, narrow=narrow) for narrow in (False, True)
    )
    caption = "Each mark is a schedule for one of the end times tried, numbered along each front."
    return _picture(wide, caption, "Cost of schedules over the end of the last pulse", narrow)


def dispersion_pictures(dispersed: Results, scheme: str) -> tuple[Picture, ...]:
    """Distribution of the cases of a study, and where H ends; raises MissingExtra."""
    drawn = (
        (
            "cases",
            "How many cases leave how much nutation, and how far H has moved.",
            "Distribution of nutation and of the end of H",
        ),
        (
            "momentum",
            "Where H ends in each case, with the ellipse that holds as many cases as must comply.",
            "Scatter of the final angular momentum with ellipse",
        ),
    )
    return tuple(
        _picture(dispersion.dispersion_figure(name, dispersed, scheme=scheme), caption, described)
        for name, caption, described in drawn
    )


def _picture(figure: Figure, caption: str, described: str, narrow: Figure | None = None) -> Picture:
    title = str(figure.get_label()) or figure.get_suptitle()
    return Picture(_untitled(figure), title, caption, described, "" if narrow is None else _untitled(narrow))


def _untitled(figure: Figure) -> str:
    """The SVG of a figure without the line above it, which breaks where it must as text of the page."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    title = figure._suptitle  # type: ignore[attr-defined]  # there is no other way to it
    if title is None:
        return image.svg(figure)
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
    figure.set_layout_engine("none")  # which would move the panels to where the title was
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    top = POINTS * (figure.get_figheight() - title.get_window_extent(renderer).y0 / figure.dpi)
    title.set_visible(False)
    box = f"0 {top:.1f} {POINTS * figure.get_figwidth():.1f} {POINTS * figure.get_figheight() - top:.1f}"
    return re.sub(r'(?<=\bviewBox=")[^"]*', box, image.svg(figure), count=1)
