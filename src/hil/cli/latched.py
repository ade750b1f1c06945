"""What a run waits for that left its bench by force."""

from __future__ import annotations

from pathlib import Path

__all__ = ["latch_word"]


def latch_word(folder: Path) -> str:
    """Return what a run waits for that left its bench by force; nothing for any other."""
    from hil.executive.live.acknowledging import waits_for_ack  # noqa: PLC0415 - heavy

    return f"latched, waits for hil ack {folder.name}" if waits_for_ack(folder) else ""
