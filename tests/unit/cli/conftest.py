"""What the tests of commands share."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def in_the_checkout(monkeypatch):
    """Name files as a person does who stands in the checkout: lines are as long there, wherever it lies."""
    monkeypatch.chdir(Path(__file__).parents[3])
