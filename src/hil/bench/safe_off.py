"""Bring outputs to their safe state, in order, and prove it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from hil.clock.port import NANOSECONDS, Clock
from hil.instruments.registry import states_of
from hil.model.bench import Proof, SafeStep
from hil.model.errors import HilError
from hil.model.figure import Figure
from hil.model.prefixed import prefixed

__all__ = ["SafeResult", "left_on", "make_safe"]

_PAUSE_S = 0.05
_ATTEMPTS = 3


@dataclass(frozen=True, slots=True)
class SafeResult:
    """What became of one line of the safe-off; `seconds` of bench time."""

    output: str
    state: str
    ok: bool
    detail: str
    seconds: float


def make_safe(
    steps: Sequence[SafeStep],
    roles: Mapping[str, object],
    clock: Clock,
    tell: Callable[[SafeResult], None],
) -> bool:
    """Take every line in order, whatever became of the one before; return whether all are proven.

    A line is tried up to three times within its time limit, a third of which each try has for its
    proof. An output that cannot be reached is a result and no error, because the lines behind it matter
    as much; what `tell` raises, such as for a full disk, waits until the last line was taken.

    Args:
        steps: the lines of the bench file.
        roles: the role instances by their dotted names.
        clock: the bench's clock.
        tell: called with every result as soon as it is known.
    """
    safe = True
    trouble: Exception | None = None
    for step in steps:
        result = _take(step, roles, clock)
        safe = safe and result.ok
        try:
            tell(result)
        except Exception as error:  # noqa: BLE001 - raised again below
            trouble = trouble or error
    if trouble:
        raise trouble
    return safe


def left_on(steps: Sequence[SafeStep], roles: Mapping[str, object], clock: Clock) -> str:
    """Take lines of the safe-off and return what could not be made safe, or nothing."""
    results: list[SafeResult] = []
    make_safe(steps, roles, clock, results.append)
    return "; ".join(f"{result.output} is not {result.state}: {result.detail}" for result in results if not result.ok)


def _take(step: SafeStep, roles: Mapping[str, object], clock: Clock) -> SafeResult:
    start_ns = clock.now_ns()
    limit_ns = round(step.within_s * NANOSECONDS)
    detail, ok = "", False
    for attempt in range(_ATTEMPTS):
        if attempt and clock.now_ns() + _PAUSE_S * NANOSECONDS > start_ns + limit_ns:
            break
        if attempt:
            clock.sleep(_PAUSE_S)
        ok, detail = _try(step, roles, clock, start_ns + limit_ns * (attempt + 1) // _ATTEMPTS)
        if ok:
            break
    seconds = (clock.now_ns() - start_ns) / NANOSECONDS
    if ok and seconds > step.within_s:
        ok, detail = False, f"reached after {seconds:.3g} s, {step.within_s:g} s allowed"
    return SafeResult(step.output, step.state, ok, detail, seconds)


def _try(step: SafeStep, roles: Mapping[str, object], clock: Clock, deadline_ns: int) -> tuple[bool, str]:
    try:
        role = roles[step.output]
        getattr(role, states_of(step.output)[step.state])()
        return _proven(step.proof, roles, clock, deadline_ns) if step.proof else (True, "read back")
    except HilError as error:
        return False, str(error)
    except Exception as error:  # noqa: BLE001 - a defect of one driver must not leave the other outputs on
        return False, f"{type(error).__name__}: {error}"


def _proven(proof: Proof, roles: Mapping[str, object], clock: Clock, deadline_ns: int) -> tuple[bool, str]:
    """Read until the proof holds or time is up: a current or temperature takes a while to fall."""
    while True:
        reading: Figure = getattr(roles[proof.output], proof.quantity)()
        detail = f"{proof.output} {proof.quantity} {prefixed(reading.value, proof.unit)}"
        if proof.minimum <= reading.value <= proof.maximum:
            return True, detail
        if clock.now_ns() >= deadline_ns:
            return False, f"{detail}, {proof.minimum:g} to {proof.maximum:g} {proof.unit} is safe"
        clock.sleep(_PAUSE_S)
