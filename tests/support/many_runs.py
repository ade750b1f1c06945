"""Many sealed packages in one folder of reports, with their ledger; nothing waits for the disk."""

from __future__ import annotations

import os
from pathlib import Path
from unittest.mock import patch

from evidence_runs import sealed_run, stamps

__all__ = ["make_runs"]


def make_runs(reports: Path, count: int) -> list[Path]:
    """Return the folders of so many sealed packages of one case each, the oldest first."""
    made = []
    with patch.object(os, "fsync", lambda _: None):
        for number in range(count):
            day = f"2026-{1 + number // 28 % 12:02d}-{1 + number % 28:02d}"
            folder = reports / f"{day.replace('-', '')}T100000Z-flight-SN1-{number:06x}"
            sealed_run(folder, stamp=stamps(day))
            made.append(folder)
    return made
