"""The rule for a verdict on one requirement within one case: for the case while it runs, and for deriving it later."""

from __future__ import annotations

from collections.abc import Iterable

from hil.model.verdict import Verdict, worst

__all__ = ["ANSWERS", "CHANNELS", "rule", "silence"]

ANSWERS = "answers"
"""A requirement with a limit on this parameter speaks of whether its device answers at all."""

CHANNELS = "channels"
"""The parameter of the check that every recording gets for which a requirement asks."""

_OVERRIDING = frozenset({Verdict.ERROR, Verdict.ABORTED, Verdict.NOT_RUN})


def rule(
    checks: Iterable[Verdict], *, missing: bool, silent: Verdict | None, taken_out: bool, ended: Verdict | None = None
) -> Verdict:
    """Return the verdict on a requirement within a case: the worst of what it found and of how it ended.

    Args:
        checks: the verdicts of its checks.
        missing: whether a check that the catalogue asks for is missing.
        silent: the verdict that silence of the device under test gives, which explains what is missing; None if it
            answered.
        taken_out: whether the case took itself out; it is NOT_RUN then, and what it found before stands.
        ended: how the case ended; ERROR, ABORTED and NOT_RUN hold for every requirement of it.
    """
    found = list(checks)
    if silent is not None:
        found.append(silent)
    elif not taken_out and (missing or not found):
        found.append(Verdict.NOT_EVALUATED)
    if taken_out:
        found.append(Verdict.NOT_RUN)
    if ended in _OVERRIDING:
        found.append(ended)
    return worst(found)


def silence(parameters: Iterable[str], *, dut: bool, undecided: bool) -> Verdict | None:
    """Return the verdict that silence gives a requirement, by the parameters of its limits; None without any.

    Args:
        parameters: of its limits.
        dut: whether the device under test fell silent.
        undecided: whether what should have happened did not, and nobody can tell if bench or DUT is to blame.
    """
    if dut and ANSWERS in parameters:
        return Verdict.FAIL
    return Verdict.INCONCLUSIVE if dut or undecided else None
