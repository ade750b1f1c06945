"""Latches: a bench that was left by force is driven by nobody until a named person has looked at it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from hil.clock import wall
from hil.guardian.latch import FOLDER, Latch, clear, path_of, read, write
from hil.model.errors import Refused

__all__ = ["ack_line", "clear_latches_of", "latch_bench", "latch_unsafe_end", "latches_of", "refuse_latched"]


def refuse_latched(leases: Sequence[str], folder: Path | None = None) -> None:
    """Refuse to drive what is latched; asked while the leases are held, so that no guardian is about to latch it.

    Args:
        leases: what the run or visit holds alone.
        folder: where latches are, those of this machine where None.

    Raises:
        Refused: with who latched it, when, why, and which outputs it is about.
    """
    for lease in sorted(set(leases)):
        path = path_of(lease, folder or FOLDER)
        latch = read(path)
        if latch is not None and not latch.run:
            raise Refused(f"the bench is latched: {latch.why}", f"look at the bench, then remove {path}")
        if latch is not None:
            outputs = f"; not proven safe: {', '.join(latch.outputs)}" if latch.outputs else ""
            raise Refused(
                f"bench '{latch.bench}' is latched since {latch.since} by {latch.run}: {latch.why}{outputs}",
                f"look at the bench, then: {ack_line(latch.run)}",
            )


def latch_bench(leases: Sequence[str], latch: Latch, folder: Path | None = None) -> None:
    """Latch all that a run holds, such as one that could not prove its bench safe.

    Raises:
        Refused: where the folder of latches is not as it has to be.
        OSError: where a latch cannot be written.
    """
    for lease in sorted(set(leases)):
        write(path_of(lease, folder or FOLDER), latch)


def latch_unsafe_end(leases: Sequence[str], *, bench: str, run: Path, why: str, folder: Path | None = None) -> None:
    """Latch what a run held that could not prove its bench safe; a latch that its guardian wrote stays as it is.

    Args:
        leases: what the run holds alone.
        bench: the bench's name.
        run: the run's folder.
        why: what was not safe.
        folder: where latches are, those of this machine where None.

    Raises:
        Refused, OSError: as `latch_bench`.
    """
    open_still = [lease for lease in leases if read(path_of(lease, folder or FOLDER)) is None]
    latch_bench(open_still, Latch(bench=bench, run=str(run), why=why, since=wall.utc_now(), outputs=()), folder)


def latches_of(run: str, folder: Path | None = None) -> dict[Path, Latch]:
    """Return the latches that a run, given by its path or name, has left, by their files."""
    return {path: latch for path, latch in _all(folder or FOLDER) if Path(latch.run).name == Path(run).name}


def clear_latches_of(run: str, folder: Path | None = None) -> tuple[Latch, ...]:
    """Take back every latch that a run has left, and return them.

    Raises:
        Refused: where one cannot be taken back, which is then still there.
    """
    found = latches_of(run, folder)
    for path in found:
        clear(path)
    return tuple(found.values())


def ack_line(run: str) -> str:
    """Return the command that acknowledges what happened in a run."""
    return f'hil ack {run} --by NAME --text "what was seen and done"'


def _all(folder: Path) -> Iterator[tuple[Path, Latch]]:
    for path in sorted(folder.glob("*.latch")) if folder.is_dir() else ():
        latch = read(path)
        if latch is not None and latch.run:
            yield path, latch
