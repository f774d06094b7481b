"""The templates of pages; each format has its own way of escaping whatever a spacecraft file says."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import TYPE_CHECKING

from nutdamp.errors import MissingExtra

if TYPE_CHECKING:
    from jinja2 import Environment


def require() -> None:
    """Raises MissingExtra where Jinja is not installed."""
    if find_spec("jinja2") is None:
        raise MissingExtra("plot", "a page")


def templates(escape: Callable[[str], str]) -> Environment:
    """The templates beside this module, whose values are escaped by ``escape``; raises MissingExtra."""
    require()
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    made = Environment(
        loader=PackageLoader("nutdamp.presentation", "page"),
        autoescape=True,
        # Before Jinja's own escaping, which leaves Markup as it is.
        finalize=lambda value: value if isinstance(value, Markup) else Markup(escape(str(value))),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.filters["kind"] = lambda block: type(block).__name__
    return made
