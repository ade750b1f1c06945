"""Ugly logs: a value within its interval, or a flag, or an error; never a wrong number without a word."""

from __future__ import annotations

import pytest
import sweeps
from ugly_logs import KINDS, PAGE, WITHIN, all_said, page, said


@pytest.mark.parametrize("name", sweeps.sample(sorted(KINDS), 8))
def test_no_ugly_log_gives_a_wrong_number_without_a_word(name, tmp_path):
    """A measured value is within 4 standard uncertainties of the truth, a bound is not below it."""
    judge(name, said(KINDS[name], tmp_path))


@pytest.mark.system
@pytest.mark.timeout(600)
def test_no_kind_does_and_the_page_is_made_from_them():
    """Every kind with what the command says to it today."""
    everything = all_said()
    for name, found in everything.items():
        judge(name, found)
    assert PAGE.read_text(encoding="utf-8") == page(everything), "write it again: python tests/support/ugly_logs.py"


def judge(name, found):
    """Compare what was said to a kind with its truth."""
    truth = KINDS[name].truth
    if found.outcome != "value":
        assert found.sentence, name
        return
    assert truth is not None, f"nothing can be known of {name}, and it gave {found.figures}"
    for figure in found.figures:
        if figure["status"] == "measured":
            assert abs(figure["value"] - truth) <= WITHIN * figure["uncertainty"], name
        else:
            assert figure["value"] >= truth * 0.9, name
