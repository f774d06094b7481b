"""The forms a page can take, by the ending of its file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from nutdamp.errors import BadRequest
from nutdamp.presentation.figures.style import require
from nutdamp.presentation.page import templates
from nutdamp.presentation.page.document import Page
from nutdamp.presentation.page.html import page_html
from nutdamp.presentation.page.markdown import page_markdown
from nutdamp.presentation.page.pdf import needed_browser, printed


class Form(NamedTuple):
    """How a page becomes a file: ``write(page, path)`` gives its content; ``pictured``: it holds pictures."""

    write: Callable[[Page, str], str | bytes]
    pictured: bool


FORMS = {
    ".html": Form(lambda page, _: page_html(page), pictured=True),
    ".md": Form(lambda page, _: page_markdown(page), pictured=False),
    ".pdf": Form(lambda page, path: printed(page_html(page), path), pictured=True),
}


def form_of(path: str) -> Form:
    """The form for the file ``path``; HTML for standard output.

    Raises BadRequest for an unknown ending, MissingExtra without Jinja, or without matplotlib for pictures, CannotWrite
    where a PDF lacks the browser to print it.
    """
    ending = ".html" if path == "-" else Path(path).suffix.lower()
    if ending not in FORMS:
        raise BadRequest(f"--output {path}: the ending says the format; use one of {', '.join(FORMS)}")
    form = FORMS[ending]
    templates.require()
    if form.pictured:
        require()
    if ending == ".pdf":
        needed_browser(path)
    return form
