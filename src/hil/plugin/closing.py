"""The end of a run: its package sealed and verified, or the run left open; then the closing report."""

from __future__ import annotations

import shutil
import sys
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Protocol, TextIO

from hil.documents.text import fitting
from hil.evidence.folder import JOURNAL, RESULTS, is_sealed
from hil.executive.people.notifying import Notifier
from hil.executive.session import Session
from hil.model.errors import EvidenceError
from hil.plugin.left_open import left_open_lines, lost_lines
from hil.report.sentences import uncovered
from hil.report.summary import closing_lines
from hil.report.write import copy_junit, write_reports

__all__ = ["Word", "close", "complain"]

_FAILED, _INTERNAL = 1, 3
_SMALL = 1_000_000  # bytes of a journal from which everything is derived again in less than half a second


class Word(Protocol):
    """What is reported of the end to a process that waits for it."""

    def sealed(self, code: int) -> None:
        """Report that the package is sealed, and the exit code."""
        ...

    def undisturbed(self) -> AbstractContextManager[None]:
        """Ignore requests to end that the run does not handle itself."""
        ...


def close(session: Session, notifier: Notifier | None, pytest_code: int, out: TextIO, word: Word) -> int:
    """Seal the package, or leave the run open; report that, and return the exit code.

    What cannot be reported changes nothing.

    Args:
        session: the run, whose cases have ended and whose bench is safe.
        notifier: is notified of the end, if there is one.
        pytest_code: the exit code of pytest.
        out: where the end is shown.
        word: reaches the process that waits.
    """
    code = session.exit_code(pytest_code)
    if code == 0 and session.configuration.request.strict and _leaves_uncovered(session.folder):
        code = _FAILED
    if session.left_open:
        return _leave_open(session, notifier, code, out, word)
    if notifier is not None:
        notifier.finish(code)
    with word.undisturbed():
        digest, code = _seal(session, code)
        if digest:
            word.sealed(code)
    if digest:
        if problem := copy_junit(session.folder, session.configuration.request.junit):
            complain(f"hil: {problem}")
        try:
            _report(session, digest, out)
        except (OSError, ValueError, KeyboardInterrupt, MemoryError):
            complain(f"hil: standard output could not be written; the package is {session.folder}")
    return code


def _seal(session: Session, code: int) -> tuple[str, int]:
    """Seal the package and verify it; return its evidence digest, empty if it is not sealed, and the exit code."""
    try:
        digest = session.seal(code, write_reports)
    except EvidenceError as error:
        complain(f"hil: {error.message}", f"     {error.hint}")
        return "", max(code, _INTERNAL)
    except Exception:
        state = "sealed, but not every report was written" if is_sealed(session.folder) else "not sealed"
        complain(f"hil: the run is {state}: {session.folder}")
        raise
    if code == 0 and (findings := _verified(session.folder, digest)):
        complain(*findings)
        code = _INTERNAL
    return digest, code


def _leaves_uncovered(folder: Path) -> bool:
    """Return whether a run about to be sealed leaves a requirement of its plans uncovered."""
    from hil.evidence.journal.reader import read_journal  # noqa: PLC0415 - only where it is asked for
    from hil.evidence.results.derived import results_of  # noqa: PLC0415 - only where it is asked for

    return bool(uncovered(results_of(folder, read_journal(folder / JOURNAL))))


def _leave_open(session: Session, notifier: Notifier | None, code: int, out: TextIO, word: Word) -> int:
    """Leave a run that was stopped to be resumed unsealed, report how to resume it, and return the exit code."""
    lost = session.keeper.scheduler.lost
    if lost and lost.reason == session.flags.reason:
        lines = lost_lines(session.folder, lost.reason, unsafe=session.keeper.unsafe)
    else:
        lines = left_open_lines(session.folder, session.flags.reason)
    if notifier is not None:
        notifier.finish(code, "; ".join(lines))
    with word.undisturbed():
        session.leave_open()
        with suppress(OSError, ValueError):
            out.writelines(["\n", *(f"{line}\n" for line in (*lines, _shown(session.folder)))])
            out.flush()
    return code


def _verified(folder: Path, digest: str) -> tuple[str, ...]:
    """Verify the sealed package, and return why its run does not pass, empty if it does."""
    try:
        findings = _findings(folder, digest)
    except MemoryError:
        return ("hil: out of memory: the package is sealed but was not verified, so the run does not pass",)
    return (*findings, "hil: the package does not verify, so the run does not pass") if findings else ()


def _findings(folder: Path, digest: str) -> tuple[str, ...]:
    """Return what is wrong with a package just sealed: a full check of a small one, otherwise only its bytes."""
    from hil.evidence.package.bag import digest_of_manifest, hash_payload, manifest_text  # noqa: PLC0415 - heavy
    from hil.evidence.package.verification import verify  # noqa: PLC0415 - heavy

    if (folder / JOURNAL).stat().st_size <= _SMALL:
        return tuple(str(finding) for finding in verify(folder).findings)
    intact = digest_of_manifest(manifest_text(hash_payload(folder))) == digest
    return () if intact else ("data: the files are not those that were sealed",)


def _report(session: Session, digest: str, out: TextIO) -> None:
    from hil.evidence.results.outcome import read_outcome  # noqa: PLC0415 - not before the run

    lines = closing_lines(read_outcome((session.folder / RESULTS).read_bytes()))
    columns = shutil.get_terminal_size().columns if out.isatty() else 0
    out.writelines(f"{line}\n" for line in ("", *fitting(lines, columns)))
    package = _shown(session.folder)
    out.write(f"\nevidence digest {digest}\nreport  {package}/data/report/report.html\n{package}\n")
    out.flush()


def complain(*lines: str) -> None:
    """Write lines to standard error, if it takes them."""
    with suppress(OSError, ValueError, AttributeError):
        sys.stderr.writelines(f"{line}\n" for line in lines)
        sys.stderr.flush()


def _shown(path: Path) -> str:
    with suppress(OSError, ValueError):  # the folder that the run was started in was removed, or does not contain it
        return str(path.relative_to(Path.cwd()))
    return str(path)
