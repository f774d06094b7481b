"""A page as GitHub Markdown, for pull requests: the same text and tables.

Without pictures: a comment on a pull request takes no inline SVG and no data URL, and links to files of the machine
that made it lead nowhere.
"""

from __future__ import annotations

import re

from nutdamp.presentation.page.document import Page
from nutdamp.presentation.page.templates import templates


def page_markdown(page: Page) -> str:
    """The whole page; whatever a spacecraft file says is escaped."""
    made = templates(text)
    made.filters["fence"] = _fence
    return made.get_template("page.md").render(page=page)


def _fence(listing: str) -> str:
    """Ticks that no line of a listing ends."""
    return "`" * max(3, 1 + max((len(ticks) for ticks in re.findall(r"`+", listing)), default=0))


def text(words: str) -> str:
    """Words that Markdown and HTML must leave as they are, on one line."""
    escaped = re.sub(r"([\\`*_\[\]|~#$])", r"\\\1", " ".join(words.split()))
    return escaped.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
