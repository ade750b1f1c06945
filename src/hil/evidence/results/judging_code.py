"""What judges: which code gave a figure and its verdict, by its bytes."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

__all__ = ["judging_digest"]

_JUDGING = ("analysis", "requirements/decision.py", "requirements/units.py", "requirements/units.txt")
"""The code between readings and verdicts: the analyses, the decision rule, and the units."""


@cache  # a process judges by one version
def judging_digest() -> str:
    """Return the SHA-256 over the product's code between readings and verdicts: names and bytes of its files."""
    root = Path(__file__).parents[2]
    content = hashlib.sha256()
    for name in _JUDGING:
        place = root / name
        files = sorted(place.rglob("*.py")) if place.is_dir() else [place]
        for file in files:
            data = file.read_bytes()
            content.update(f"{file.relative_to(root).as_posix()} {len(data)}\n".encode() + data)
    return content.hexdigest()
