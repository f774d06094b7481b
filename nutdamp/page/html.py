"""A page as one HTML file that needs nothing else: style, script and pictures inside, no network."""

from __future__ import annotations

import base64
import hashlib
import pkgutil
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from html import escape
from importlib.util import find_spec
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING

from nutdamp.errors import BadRequest, MissingExtra
from nutdamp.figures.style import require
from nutdamp.page.document import Block, Control, Page

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

    from nutdamp.montecarlo.study import Results
    from nutdamp.page.content import Repeat
    from nutdamp.planning.decision import Comparison
    from nutdamp.planning.tradeoff import Front


ENDINGS = (".html", ".htm")
"""Endings of the files that a page is written to."""


def expect_html(path: str) -> None:
    """Refuse a page that cannot be made, or not in this form, before the work; ``-`` is standard output.

    Raises BadRequest for an ending other than `ENDINGS`, MissingExtra without Jinja or matplotlib.
    """
    if path != "-" and Path(path).suffix.lower() not in ENDINGS:
        raise BadRequest(f"--output {path}: a report is written as HTML (.html); a browser prints that as PDF")
    _require_jinja()
    require()


def _require_jinja() -> None:
    if find_spec("jinja2") is None:
        raise MissingExtra("plot", "a page")


def page_html(page: Page) -> str:
    """The whole file. All text of a spacecraft file is escaped; the policy in its head allows no other script."""
    moves = any(block.kind == "moving" for block in page.motion)
    style, script = (
        "\n".join(map(_part, (name, *views * moves)))
        for name, views in (("page.css", ["view.css"]), ("page.js", ["motion.js", "bench.js", "view.js"]))
    )
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return _templates().get_template("page.html").render(page=page, style=style, script=script, digest=digest)


def block_html(block: Block) -> str:
    """One block of a page, in a box of its own to scroll in where it may be wide."""
    return _templates().from_string('{% from "blocks.html" import block %}{{ block(made) }}').render(made=block)


@cache
def _templates() -> Environment:
    _require_jinja()
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("nutdamp", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters.update(labelled=_labelled, css=_css, whole=_whole)
    return environment


def _part(name: str) -> str:
    data = pkgutil.get_data("nutdamp", f"page/{name}")
    if data is None:
        raise FileNotFoundError(f"nutdamp/page/{name} is not installed")
    return data.decode("utf-8").strip()


WHOLE = re.compile(r"((?<!\S)--?[a-z][\w-]*|[<≤≥] \d\S*(?: deg)?)")
"""Text in which no line may break: an option of a command, a relation with its number and unit."""


def _whole(text: str) -> Markup:
    """Text in which options of commands and relations stay in one line."""
    from markupsafe import Markup

    parts = (escape(part) for part in WHOLE.split(text))
    spans = (f'<span class="whole-word">{part}</span>' if odd else part for odd, part in zip(cycle((0, 1)), parts))
    return Markup("".join(spans))


def _css(text: str) -> str:
    """Text within a string of a style sheet: all but letters and digits by their numbers."""
    return "".join(char if char.isascii() and char.isalnum() else f"\\{ord(char):x} " for char in text)


def _labelled(svg: str, described: str) -> Markup:
    """A picture with its description for those who do not see it."""
    from markupsafe import Markup

    return Markup(svg.replace("<svg ", f'<svg aria-label="{escape(described)}" ', 1))


@dataclass(frozen=True, eq=False)
class Report:
    """The report page: its comparison, its dispersed cases, the page itself, and ``content``, the text of its file."""

    comparison: Comparison
    dispersed: Results | None
    page: Page = field(repr=False)
    content: str = field(repr=False)

    @property
    def verdict(self) -> str:
        """Headline, verdict and warnings at the top of the page."""
        return self.page.summary

    @property
    def met(self) -> bool | None:
        """True where the requirement is met; None where nothing is required, and without a feasible plan."""
        return self.page.met

    @property
    def good(self) -> bool:
        """True where nothing is missed, whether required or not."""
        return self.page.good


def made_of(compared: Comparison, repeat: Repeat, control: Control, traded: Sequence[Front] = ()) -> Report:
    """The report, not yet written. Raises MissingExtra without the extra plot."""
    from nutdamp.page.content import report_page

    chosen = compared.recommended
    page = report_page(compared, repeat, traded=traded, control=control)
    return Report(compared, None if chosen is None else compared.results(chosen), page, page_html(page))
