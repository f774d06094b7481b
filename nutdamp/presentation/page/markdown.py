"""A page as GitHub Markdown, for pull requests: the same text and tables.

Without pictures: a comment on a pull request takes no inline SVG and no data URL, and links to files of the machine
that made it lead nowhere.
"""

from __future__ import annotations

import re

from nutdamp.presentation.page.document import Block, Column, Facts, Listing, Page, Picture, Prose, Remarks, Sheet


def page_markdown(page: Page) -> str:
    """The whole page; whatever a spacecraft file says is escaped."""
    mark = "✅" if page.good else "⚠️"
    parts = [f"# {text(page.title)}", f"{mark} **{text(page.verdict)}**"]
    if page.figures:
        parts.append(" · ".join(f"{text(figure.name)}: **{text(figure.value)}**" for figure in page.figures))
    for section in page.sections:
        blocks = [block_markdown(block) for block in section.blocks]
        parts += [f"## {text(section.title)}", *filter(None, blocks)]
    parts.append(f"<sub>{text(page.made_by)}</sub>")
    return "\n\n".join(parts) + "\n"


def block_markdown(block: Block) -> str:
    """One block; empty for a picture."""
    match block:
        case Sheet():
            rows = [
                ["**" + cell + "**" if index == block.mark and cell else cell for cell in map(text, row)]
                for index, row in enumerate(block.rows)
            ]
            return f"{text(block.title)}:\n\n" + _table(block.columns, rows)
        case Facts():
            columns = (Column("quantity", number=False), Column("value", number=False))
            return f"{text(block.title)}:\n\n" + _table(columns, [list(map(text, row)) for row in block.rows])
        case Prose():
            return text(block.text)
        case Remarks():
            return "\n".join(f"- **{text(name)}**: {text(remark)}" for name, remark in block.rows)
        case Picture():
            return ""
        case Listing():
            longest = max((len(ticks) for ticks in re.findall(r"`+", block.text)), default=0)
            fence = "`" * max(3, longest + 1)
            listing = f"{fence}{block.language}\n{block.text}\n{fence}"
            summary = f"<details><summary>{text(block.title)}</summary>"
            return f"{summary}\n\n{listing}\n\n</details>" if "\n" in block.text else listing


def _table(columns: tuple[Column, ...], rows: list[list[str]]) -> str:
    heads = [text(f"{column.name}, {column.unit}" if column.unit else column.name) for column in columns]
    rules = ["---:" if column.number else ":---" for column in columns]
    return "\n".join(f"| {' | '.join(row)} |" for row in (heads, rules, *rows))


def text(words: str) -> str:
    """Words that Markdown and HTML must leave as they are, on one line."""
    escaped = re.sub(r"([\\`*_\[\]|~#$])", r"\\\1", " ".join(words.split()))
    return escaped.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
