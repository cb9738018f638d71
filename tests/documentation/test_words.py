"""The books stay short: words of the pages as they are written, code and tables included, generated pages left out.

A word has a letter or a digit: the bars and rules of tables are none.
"""

import re

import pytest

from tests.helpers.pages import ROOT, pages

WORD = re.compile(r"\S*\w\S*")
LIMITS = {"user": 30_000, "developers": 15_000}  # words; they only fall


def words(book: str) -> int:
    """Words of a book; the README belongs to none."""
    site = [page.relative_to(ROOT / "docs") for page in pages() if page.is_relative_to(ROOT / "docs")]
    inside = [page for page in site if (page.parts[0] == "developers") == (book == "developers")]
    return sum(len(WORD.findall((ROOT / "docs" / page).read_text(encoding="utf-8"))) for page in inside)


@pytest.mark.parametrize(("book", "limit"), LIMITS.items())
def test_a_book_stays_short(book: str, limit: int) -> None:
    assert words(book) <= limit
