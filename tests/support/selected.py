"""Inputs of a selection: the tables of a published campaign, and packages that hold figures of several sensors."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from hil.selection.criteria import Criteria, load_criteria
from hil.selection.figures import Input, Taken

__all__ = ["criteria", "package", "taken"]

DIGEST = "{:064x}"


def criteria(folder: Path, text: str) -> Criteria:
    """Return what a criteria file of this text says."""
    file = folder / "criteria.yaml"
    file.write_text(f"schema: hil/selection/1\n{textwrap.dedent(text)}")
    return load_criteria(file, "criteria.yaml")


def taken(of: str, value: float, uncertainty: float | None = None, **changed: Any) -> Taken:
    """Return a figure, known to 1 % unless it is said."""
    fields: dict[str, Any] = {
        "requirement": "IMU-010",
        "parameter": "white_noise",
        "of": of,
        "case": "test_noise",
        "plan": "imu",
        "value": value,
        "unit": "deg/s/sqrt(Hz)",
        "uncertainty": abs(value) / 100 if uncertainty is None else uncertainty,
        "rev": 1,
        "fingerprint": "f",
    }
    return Taken(**{**fields, **changed})


def package(number: int, figures: Iterable[Taken] | Mapping[str, float], **changed: Any) -> Input:
    """Return a verified package of hardware with these figures."""
    held = [taken(*each) for each in figures.items()] if isinstance(figures, Mapping) else figures
    fields: dict[str, Any] = {
        "run": f"run-{number}",
        "digest": DIGEST.format(number),
        "source": "hardware",
        "purpose": "qualification",
        "bench": "imu",
        "serial": "IMU-1",
        "part": "IMU",
        "began": f"2026-11-{number:02d}T10:00:00.000000Z",
        "figures": tuple(sorted(held)),
    }
    return Input(**{**fields, **changed})
