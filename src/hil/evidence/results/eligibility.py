"""What a run must prove before it can close a requirement: every condition is proven, or says why it is not."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from hil.evidence.results.facts import Facts, FrozenCalibration
from hil.evidence.results.outcome import CaseOutcome, Condition
from hil.evidence.state import RunState
from hil.model.identity import Source
from hil.model.verdict import Verdict

__all__ = ["of_requirement", "of_run", "reasons_in"]

_NO_RECORD = FrozenCalibration()


def reasons_in(conditions: Iterable[Condition]) -> tuple[str, ...]:
    """Return why nothing can be closed, a sentence per condition that is not proven; none means that all are."""
    return tuple(each.text for each in conditions if not each.proven)


def of_run(state: RunState) -> tuple[Condition, ...]:
    """Return the conditions that a run meets or fails for all of its requirements.

    Args:
        state: what the events before the results tell.
    """
    return (*_source(state), *_purpose(state), *_course(state), *_dut(state), *_gates(state))


def of_requirement(
    identifier: str, verdict: Verdict, cases: Sequence[CaseOutcome], state: RunState, facts: Facts
) -> tuple[Condition, ...]:
    """Return the conditions that concern one requirement.

    Args:
        identifier: the requirement.
        verdict: its verdict in this run.
        cases: the cases that carry it.
        state: what the events before the results tell.
        facts: what was frozen.
    """
    used = {name: source for case in cases for name, source in case.used.items()}
    checks = [check for case in cases for check in case.checks if check.requirement == identifier]
    names = {name for check in checks for name in check.instruments} | _recorded_by(cases, state)
    names |= {name for name in used if facts.calibration.get(name, _NO_RECORD).due}
    return (
        _condition("verdict", verdict.good, f"its verdict is {verdict}"),
        _condition("coverage", bool(cases), _told(len(cases)), "no planned case carries it"),
        _condition(
            "catalogue",
            identifier in facts.catalogue,
            "it is in the frozen catalogue",
            "it is not in the frozen catalogue",
        ),
        *_instruments(used),
        *_calibration(sorted(names), facts),
    )


def _condition(name: str, proven: bool, proof: str, reason: str = "") -> Condition:
    return Condition(name=name, proven=proven, text=proof if proven or not reason else reason)


def _told(cases: int) -> str:
    return "one planned case carries it" if cases == 1 else f"{cases} planned cases carry it"


def _recorded_by(cases: Sequence[CaseOutcome], state: RunState) -> set[str]:
    begun = [state.recordings[name] for case in cases for name in case.recordings]
    return {channel.instrument for event in begun for channel in event.channels}


def _source(state: RunState) -> Iterator[Condition]:
    source = state.run.source if state.run else None
    told = f"{(source or 'unknown').upper()}: the run's source"
    yield _condition("source", source is Source.HARDWARE, told)


def _purpose(state: RunState) -> Iterator[Condition]:
    purpose = state.run.purpose if state.run else None
    closes = purpose is not None and purpose.closes
    yield _condition(
        "purpose", closes, f"the purpose is {purpose}", f"the purpose {purpose} does not close requirements"
    )


def _course(state: RunState) -> Iterator[Condition]:
    yield from (_condition("deviations", False, f"deviation: {each}") for each in state.deviations)
    if not state.deviations:
        yield _condition("deviations", True, "nothing deviates from the plan")
    yield _condition("whole", not state.interrupted, "the run came to its own end", "the run was interrupted")
    yield _condition("envelope", state.trip is None, "the envelope did not trip", "the envelope tripped")
    safe = state.safe is True
    yield _condition("safe", safe, "the bench was proven safe at the end", "the bench was not proven safe at the end")


def _dut(state: RunState) -> Iterator[Condition]:
    serial = state.run.dut.serial if state.run else ""
    told = f"the device under test has the serial number {serial}"
    yield _condition("dut", bool(serial), told, "the device under test has no serial number")


def _gates(state: RunState) -> Iterator[Condition]:
    bad = [gate for gate in state.gates if not gate.ok]
    yield from (_condition("readiness", False, f"readiness gate {gate.name}: {gate.detail}") for gate in bad)
    if not bad:
        yield _condition("readiness", True, f"{len(state.gates)} readiness gates hold")


def _instruments(used: Mapping[str, str]) -> Iterator[Condition]:
    for each in sorted({*used.values()} - {Source.HARDWARE}):
        names = ", ".join(sorted(name for name, its in used.items() if its == each))
        yield _condition("instruments", False, f"{each.upper()}: {names}")
    if hardware := sorted(name for name, its in used.items() if its == Source.HARDWARE):
        yield _condition("instruments", True, f"HARDWARE: {', '.join(hardware)}")


def _calibration(instruments: Sequence[str], facts: Facts) -> Iterator[Condition]:
    for name in instruments:
        record = facts.calibration.get(name, _NO_RECORD)
        if record.dut:
            continue
        problems = tuple(record.problems(facts.begun or facts.date, facts.date))
        for problem in problems:
            yield _condition("calibration", False, f"{name} {problem}")
        if not problems:
            yield _condition("calibration", True, f"{name} was in calibration: due {record.due}, used {facts.date}")
