"""Sentences of README and guide are short."""

import re

import pytest
from support import places

from nutdamp.views import guide

FIRST_READ = ("README", "tutorial", "reading", "robust", "fit", "blocks")
"""Pages that no sentence of which should need a second reading."""
REFERENCE = ("notes", "glossary", "symbols", "file", "json", "csv", "cases", "equations")
OTHERS = ("loop", "trade", "budget", "pointing", "report", "commands", "library", "campaign",
          "limits", "speed", "units", "valves", "motion", "schemes", "contributing",
          "changes")  # fmt: skip
PAGES = [
    *((name, 16, 30) for name in (*FIRST_READ, *REFERENCE)),
    *((name, 18, 34) for name in OTHERS),
]
"""With the mean and the largest number of words of a sentence."""

CODE = re.compile(r"^```.*?^```|^    .*?$", re.MULTILINE | re.DOTALL)
APART = re.compile(r"^#.*$|^\|[-|]+\|$", re.MULTILINE)  # headings, and the rules of tables
NAMED = re.compile(r"`[^`]*`|\[([^\]]*)\]\([^)]*\)|\{\w+\}")  # one word each
PARAGRAPH = re.compile(r"\n\s*\n|\n(?=[-|>] |\d+\. )(?<!>)|\s\|\s")
SOURCES = re.compile(r"^Sources?: .*?(?=\n\n)", re.MULTILINE | re.DOTALL)  # titles, not sentences
END = re.compile(r"(?<=[.!?])\s+")


def sentences(text: str) -> list[str]:
    """Those of Markdown, without code, headings and sources; a cell of a table is a paragraph."""
    for stripped in (CODE, APART, SOURCES):
        text = stripped.sub("\n", text)
    text = NAMED.sub(lambda name: (name[1] or "word").replace(" ", "-"), text).replace("\n> ", " ")
    return [
        " ".join(sentence.split())
        for paragraph in PARAGRAPH.split(text)
        for sentence in END.split(paragraph.strip())
        if count(sentence)
    ]


def count(sentence: str) -> int:
    return len(re.findall(r"\S*\w\S*", sentence))


@pytest.mark.parametrize(("name", "mean", "longest"), PAGES)
def test_sentences_of_a_page_are_short(name: str, mean: int, longest: int) -> None:
    folder = places.ROOT if name == "README" else guide.FOLDER
    found = sentences((folder / f"{name}.md").read_text(encoding="utf-8"))
    assert len(found) > 10
    assert [sentence for sentence in found if count(sentence) > longest] == []
    assert sum(map(count, found)) / len(found) < mean


def test_sentences_are_counted_without_code_and_headings() -> None:
    text = "# A head\n\nOne `two words` three.\nFour five?\n\n    code\n\n| a | b c |\n"
    assert [*map(count, sentences(f"{text}|---|---|\n- x y\n"))] == [3, 2, 1, 2, 2]
