"""Identity, by its bytes, of the code that computes figures and their verdicts."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

__all__ = ["JUDGING", "judging_digest"]

JUDGING = (
    "analysis",
    "executive/cases/certificate.py",
    "executive/cases/checks.py",
    "model/figure.py",
    "model/provenance.py",
    "model/verdict.py",
    "requirements/decision.py",
    "requirements/unit_words.py",
    "requirements/units.py",
    "requirements/units.txt",
)
"""The code between readings and verdicts, below the product's folder: analyses, figures and their provenance,
the uncertainty of certificates, checks, the decision rule, and units. A test follows its imports."""


@cache  # a process has one version of the code
def judging_digest() -> str:
    """Return the SHA-256 over the product's code between readings and verdicts: names and bytes of its files."""
    root = Path(__file__).parents[2]
    content = hashlib.sha256()
    for name in JUDGING:
        place = root / name
        files = sorted(place.rglob("*.py")) if place.is_dir() else [place]
        for file in files:
            data = file.read_bytes()
            content.update(f"{file.relative_to(root).as_posix()} {len(data)}\n".encode() + data)
    return content.hexdigest()
