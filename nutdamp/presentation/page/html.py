"""A page as one HTML file that needs nothing else: style, script and pictures inside, no network."""

from __future__ import annotations

import base64
import hashlib
import pkgutil
import re
from html import escape
from string import Template

from nutdamp.presentation.page.document import (
    Block,
    Column,
    Facts,
    Figure,
    Listing,
    Page,
    Picture,
    Prose,
    Remarks,
    Section,
    Sheet,
)
from nutdamp.presentation.text import MISSING


def page_html(page: Page) -> str:
    """The whole file. Whatever a spacecraft file says is escaped; the policy in its head allows no other script."""
    script = _part("sort.js")
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    figures = "".join(map(_figure, page.figures))
    links = "".join(f'<li><a href="#{section.name}">{escape(section.title)}</a></li>' for section in page.sections)
    return (
        Template(_part("page.html")).substitute(
            title=escape(page.title),
            verdict=escape(page.verdict),
            verdict_class="good" if page.good else "bad",
            figures=f'<dl class="figures">{figures}</dl>' if figures else "",
            links=links,
            sections="\n".join(map(_section, page.sections)),
            made_by=escape(page.made_by),
            style=_part("page.css"),
            script=script,
            script_digest=digest,
        )
        + "\n"
    )


def _part(name: str) -> str:
    data = pkgutil.get_data("nutdamp", f"presentation/page/{name}")
    if data is None:
        raise FileNotFoundError(f"nutdamp/presentation/page/{name} is not installed")
    return data.decode("utf-8").strip()


def _figure(figure: Figure) -> str:
    """A number to read first, which breaks at commas and arrows only."""
    parts = re.split(r"(?<=[→,]) ", figure.value)
    value = " ".join(f"<span>{escape(part)}</span>" for part in parts)
    return f"<div><dt>{escape(figure.name)}</dt><dd>{value}</dd></div>"


def _section(section: Section) -> str:
    blocks = "\n".join(map(block_html, section.blocks))
    return f'<section id="{section.name}">\n<h2>{escape(section.title)}</h2>\n{blocks}\n</section>'


def block_html(block: Block) -> str:
    """One block of a page, in a box of its own to scroll in where it may be wide."""
    match block:
        case Sheet():
            return _box(block.title, sheet_html(block))
        case Facts():
            return facts_html(block)
        case Prose():
            return f"<p>{escape(block.text)}</p>"
        case Remarks():
            rows = "".join(f"<li><b>{escape(name)}:</b> {escape(text)}</li>" for name, text in block.rows)
            return f'<ul class="remarks">{rows}</ul>'
        case Picture():
            picture = block.svg.replace("<svg ", f'<svg aria-label="{escape(block.described)}" ', 1)
            box = _box(block.described, picture, "wide picture")
            return f"<figure>{box}<figcaption>{escape(block.caption)}</figcaption></figure>"
        case Listing():
            return f"<h3>{escape(block.title)}</h3>\n" + _box(block.title, f"<pre>{escape(block.text)}</pre>")


def _box(title: str, content: str, kind: str = "wide") -> str:
    """Wide content scrolls in here, by keyboard too, and never the page."""
    return f'<div class="{kind}" role="region" tabindex="0" aria-label="{escape(title)}">{content}</div>'


def sheet_html(sheet: Sheet) -> str:
    """A table whose columns the script of the page lets sort; without the script it is a plain table."""
    heads = "".join(map(_head, sheet.columns))
    kind = "sheet sortable" if sheet.sortable else "sheet"
    rows = []
    for index, row in enumerate(sheet.rows):
        cells = "".join(
            _cell(text, column, first=not place)
            for place, (text, column) in enumerate(zip(row, sheet.columns, strict=True))
        )
        rows.append(f'<tr class="mark">{cells}</tr>' if index == sheet.mark else f"<tr>{cells}</tr>")
    return (
        f'<table class="{kind}"><caption><span>{escape(sheet.title)}</span></caption>'
        f"<thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    )


def _head(column: Column) -> str:
    unit = f' <span class="unit">{escape(column.unit)}</span>' if column.unit else ""
    kind = ' class="number"' if column.number else ""
    return f'<th scope="col"{kind}>{escape(column.name)}{unit}</th>'


def _cell(text: str, column: Column, *, first: bool) -> str:
    """A cell; numbers carry what they sort by."""
    value = number_in(text) if column.number else None
    sort = "" if value is None else f' data-value="{value!r}"'
    kind = ' class="number"' if column.number else ""
    return f'<th scope="row"{kind}{sort}>{escape(text)}</th>' if first else f"<td{kind}{sort}>{escape(text)}</td>"


def number_in(text: str) -> float | None:
    """The number in a cell; None where it is not known or a word."""
    if text == MISSING:
        return None
    try:
        return float(text.removeprefix("<").strip())
    except ValueError:
        return None


def facts_html(facts: Facts) -> str:
    """Names to the left, what they are to the right."""
    rows = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td>{escape(value)}</td></tr>' for name, value in facts.rows
    )
    return f'<table class="facts"><caption><span>{escape(facts.title)}</span></caption><tbody>{rows}</tbody></table>'
