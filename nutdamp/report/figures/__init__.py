"""Figures (matplotlib, the extra ``plot``) of a flight, and what becomes of them: files and inline SVG.

Every function that makes a figure raises MissingExtra without matplotlib; none needs a window. ``track`` is always a
track of ``flight``; where its rows are too few for a smooth curve, a finer one is drawn.
"""

from nutdamp.report.figures.export import ending, rendered, svg
from nutdamp.report.figures.history import history_figure, timeline_figure
from nutdamp.report.figures.motion import motion_figure
from nutdamp.report.figures.overview import overview_figure
from nutdamp.report.figures.sphere import sphere_figure

__all__ = [
    "ending",
    "history_figure",
    "motion_figure",
    "overview_figure",
    "rendered",
    "sphere_figure",
    "svg",
    "timeline_figure",
]
