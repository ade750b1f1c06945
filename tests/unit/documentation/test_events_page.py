"""The reference of the evidence package says of every kind of event what its type says."""

from __future__ import annotations

import events_page
import msgspec
import pytest

from hil.evidence.events.codec import KINDS


def test_kinds_and_fields_are_made_from_the_types():
    """A kind or field that is added, renamed or described otherwise is so on the page."""
    page = events_page.PAGE.read_text(encoding="utf-8")
    assert events_page.with_reference(page) == page, "write it again: python tests/support/events_page.py"


@pytest.fixture(scope="module")
def rows():
    """Return the rows of the tables."""
    return events_page.reference().splitlines()


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kind_is_on_the_page_with_all_its_fields(rows, kind):
    """Each in a row of its own, with its type in JSON."""
    begin = next(place for place, row in enumerate(rows) if row.startswith(f"| **`{kind}`** |"))
    fields = [each for each in msgspec.structs.fields(KINDS[kind]) if each.name not in {"seq", "t"}]
    for row, field in zip(rows[begin + 1 :], fields, strict=False):
        assert row.startswith(f"| `{field.name}` | ")
        assert (", optional |" in row) is not field.required
