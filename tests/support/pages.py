"""Pages of `report` for tests of their texts, without the pictures, which take most of the time."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

from nutdamp.page import report
from nutdamp.page.document import Page, Prose
from nutdamp.planning.decision import Comparison


@contextmanager
def unpictured() -> Iterator[None]:
    """Pages are made without pictures."""
    one, several = (lambda *_: Prose("")), (lambda *_: ())
    with patch.multiple(
        report,
        moving_of=one,
        flight_pictures=several,
        trade_picture=one,
        dispersion_pictures=several,
    ):
        yield


def plain_page(compared: Comparison, repeat: report.Repeat | None = None, **more: Any) -> Page:
    """The page of a comparison without pictures."""
    with unpictured():
        return report.report_page(compared, repeat or report.Repeat("", "", ""), **more)
