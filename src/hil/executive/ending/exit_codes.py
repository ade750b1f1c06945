"""Exit codes: how a run ended, for whoever started it."""

from __future__ import annotations

from collections.abc import Sequence

from hil.model.verdict import Verdict

__all__ = ["EXIT_INTERRUPTED", "EXIT_TRIPPED", "EXIT_UNSAFE", "code_of"]

EXIT_INTERRUPTED = 2
EXIT_TRIPPED = 6
EXIT_UNSAFE = 7


def code_of(pytest_code: int, verdicts: Sequence[Verdict], *, unsafe: bool, tripped: bool, stopped: bool) -> int:
    """Return the run's exit code: what happened to the bench outweighs what pytest says.

    Args:
        pytest_code: what pytest returned; it counts before the teardown, which may still evaluate checks.
        verdicts: those of all planned cases.
        unsafe: whether the bench could not be proven safe.
        tripped: whether the envelope tripped.
        stopped: whether somebody asked the run to stop.
    """
    if unsafe:
        return EXIT_UNSAFE
    if tripped:
        return EXIT_TRIPPED
    if stopped:
        return EXIT_INTERRUPTED
    if pytest_code in {0, 1}:
        return 0 if verdicts and all(verdict.good for verdict in verdicts) else 1
    return pytest_code
