"""What every test of whole processes needs."""

from __future__ import annotations

import pytest
from workspaces import end_started


@pytest.fixture(autouse=True)
def no_process_is_left():
    """End the processes that a failed test leaves."""
    yield
    end_started()
