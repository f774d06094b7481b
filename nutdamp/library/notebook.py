"""Tables that notebooks show."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nutdamp.report.page.document import Block


def block(content: Block) -> str:
    """A block of a report page as HTML."""
    from nutdamp.report.page.html import block_html

    return block_html(content)
