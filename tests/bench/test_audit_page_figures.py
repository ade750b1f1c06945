"""What it costs to show an audit of 10,000 requirements with 30,000 references."""

from __future__ import annotations

from audit_documents import document

from hil.audit.pages.page import as_html


def test_a_page_of_ten_thousand_requirements(cost):
    """Every row with three references, as a stream: the whole page is never in memory."""
    found = document(10_000)
    longest = cost("page of 10,000 requirements", lambda: max(map(len, as_html(found, "../reports"))))
    assert longest < 1_000_000
