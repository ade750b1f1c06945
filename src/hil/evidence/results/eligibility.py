"""Eligibility: the conditions a run must prove before it can close a requirement, each proven or with why it is not.

Nothing is taken for granted. What the package does not show is not proven, and every unproven condition is a reason.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from hil.evidence.events import Answer, Check, Gate
from hil.evidence.results.facts import Facts, FrozenCalibration, FrozenRequirement
from hil.evidence.results.outcome import AS_INSTALLED, EXCEPTION, EXECUTED, CaseOutcome, Condition
from hil.evidence.results.software import TELLS_OF_EXECUTED, condition, each_of, of_software
from hil.evidence.state import RunState
from hil.model.identity import Model, Purpose, Source
from hil.model.verdict import Verdict

__all__ = [
    "MODELS",
    "Eligibility",
    "against_hardware",
    "is_asked_for",
    "of_run",
    "of_simulation",
    "reasons_in",
    "sources_of",
]

_NO_RECORD = FrozenCalibration()
_NOTHING = FrozenRequirement()
_ENVELOPE = "envelope "
MODELS = {Purpose.QUALIFICATION: Model.QM, Purpose.ACCEPTANCE: Model.FM}
"""The model of a device that a purpose, and the stage of that name, require."""
_BY_DOCUMENTS = frozenset({"analysis", "review"})
_MOST, _SHORT = 3, 12
_OF_BENCH = frozenset({"source", "instruments", "port"})
_OF_UNIT = frozenset({"model", "purpose"})
_OTHER_PURPOSE = ", but the run's purpose is "
_IN_CATALOGUE = condition("catalogue", True, "it is in the frozen catalogue")
_NOT_IN_CATALOGUE = condition("catalogue", False, "it is not in the frozen catalogue")
_IS_TEST = condition("method", True, "its method is test")
_FROM_INSTRUMENTS = condition("values", True, "every value came from instruments, recordings or people")


def reasons_in(conditions: Iterable[Condition]) -> tuple[str, ...]:
    """Return why nothing can be closed, a sentence per unproven condition; empty if all are proven."""
    return tuple(each.text for each in conditions if not each.proven)


def of_run(state: RunState, facts: Facts) -> tuple[Condition, ...]:
    """Return the conditions that a run meets or fails for all of its requirements.

    Args:
        state: the state after the events before the results.
        facts: what was frozen.
    """
    return (
        *_source(state, facts),
        *_recorded_elsewhere(state),
        *_purpose(state),
        *of_software(facts.software),
        *_executed(state, facts),
        *_course(state),
        *_dut(state),
        *_gates(state),
        *(condition("clock", False, each) for each in facts.clock),
    )


class Eligibility:
    """Evaluates the conditions of one run's requirements; those that several share are evaluated once.

    Args:
        state: the state after the events before the results.
        facts: what was frozen.
    """

    def __init__(self, state: RunState, facts: Facts) -> None:
        self._facts = facts
        self.of_run = of_run(state, facts)
        """The conditions of the whole run."""
        self._reasons = reasons_in(self.of_run)
        self._verdict = cache(lambda verdict: condition("verdict", verdict.good, f"its verdict is {verdict}"))
        self._stage = cache(lambda stage: tuple(_stage(stage, state)))
        self._calibration = cache(lambda names: tuple(_calibration(sorted(names), facts)))
        self._carried: dict[tuple[str, ...], _Carried] = {}
        self._state = state

    def of_requirement(
        self, identifier: str, verdict: Verdict, cases: Sequence[CaseOutcome], checks: Sequence[Check]
    ) -> tuple[Condition, ...]:
        """Return the conditions that concern one requirement.

        Args:
            identifier: the requirement.
            verdict: its verdict in this run.
            cases: the cases that carry it.
            checks: its checks in them.
        """
        entry = self._facts.catalogue.get(identifier)
        carried = self._carried_by(cases)
        names = carried.instruments.union(*{check.instruments for check in checks})
        open_values = dict.fromkeys(reason for check in checks for reason in check.closes_nothing)
        return (
            self._verdict(verdict),
            carried.coverage,
            _NOT_IN_CATALOGUE if entry is None else _IN_CATALOGUE,
            *_method(entry or _NOTHING, carried.answers),
            *_witness(entry or _NOTHING, carried.seen_by),
            *self._stage((entry or _NOTHING).stage),
            *(each_of("values", open_values, "") if open_values else (_FROM_INSTRUMENTS,)),
            *carried.of_used,
            *self._calibration(names),
        )

    def reasons_in(self, conditions: Iterable[Condition]) -> tuple[str, ...]:
        """Return why a requirement with these conditions cannot be closed, the run's reasons first."""
        return (*self._reasons, *reasons_in(conditions))

    def _carried_by(self, cases: Sequence[CaseOutcome]) -> _Carried:
        names = tuple(case.case for case in cases)
        if names not in self._carried:
            self._carried[names] = _carried(cases, self._state, self._facts)
        return self._carried[names]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Carried:
    """What all requirements carried by the same cases have in common.

    Attributes:
        coverage: whether there are such cases.
        answers: people's answers in them.
        seen_by: the witnesses that their questions asked for, and who they were.
        instruments: the instruments behind their recordings, and those with a certificate that they used.
        of_used: the conditions of the instruments that they used.
    """

    coverage: Condition
    answers: tuple[Answer, ...]
    seen_by: tuple[tuple[str, str], ...]
    instruments: frozenset[str]
    of_used: tuple[Condition, ...]


def _carried(cases: Sequence[CaseOutcome], state: RunState, facts: Facts) -> _Carried:
    used = {name: source for case in cases for name, source in case.used.items()}
    certified = {name for name in used if facts.calibration.get(name, _NO_RECORD).due}
    return _Carried(
        coverage=condition("coverage", bool(cases), _coverage(len(cases)), "no planned case carries it"),
        answers=tuple(answer for case in cases for answer in state.cases[case.case].answers),
        seen_by=tuple(pair for case in cases for pair in state.cases[case.case].seen_by),
        instruments=frozenset(_recorded_by(cases, state) | certified),
        of_used=(*_instruments(used), *_identities(used, state)),
    )


def of_simulation(name: str, text: str, *, unit: bool) -> bool:
    """Return whether an unproven condition cannot be met because the bench is simulated.

    A simulated device under test has no model that counts, and no run for qualification or acceptance accepts it.

    Args:
        name: the name of the condition.
        text: why it is not proven.
        unit: whether the device under test is simulated, too.
    """
    of_unit = name in _OF_UNIT or (name == "stage" and _OTHER_PURPOSE in text)
    return name in _OF_BENCH or (unit and of_unit)


def sources_of(used: Mapping[str, str], state: RunState) -> Mapping[str, str]:
    """Return the source that instruments count as: one that reports as simulated is, and so is any on the same port."""
    gates = [*state.gates, *state.host_gates]
    simulated = {gate.instrument for gate in gates if gate.instrument and gate.source is Source.SIMULATED}
    ports = {gate.instrument: gate.detail for gate in state.host_gates if gate.instrument}
    shared = {port for name, port in ports.items() if name in simulated}
    simulated |= {name for name, port in ports.items() if port in shared}
    return {
        name: Source.SIMULATED if source == Source.HARDWARE and name in simulated else source
        for name, source in used.items()
    }


def against_hardware(state: RunState, facts: Facts) -> Iterator[str]:
    """Yield what in a package contradicts a run on hardware, a sentence each."""
    live = state.run.live if state.run else None
    if live is None:
        yield "its bench was in the process of the run"
    elif live.served:
        yield "its bench was served by a simulation"
    elif live.speed != 1.0:
        yield f"its time ran {live.speed:g} times as fast"
    if facts.dut_simulated:
        yield "the register says that its device under test is simulated"


def _coverage(cases: int) -> str:
    return "one planned case carries it" if cases == 1 else f"{cases} planned cases carry it"


def _recorded_by(cases: Sequence[CaseOutcome], state: RunState) -> set[str]:
    begun = [state.recordings[name] for case in cases for name in case.recordings]
    return {channel.instrument for event in begun for channel in event.channels}


def _source(state: RunState, facts: Facts) -> Iterator[Condition]:
    source = state.run.source if state.run else None
    told = f"the run's source is {source or 'unknown'}"
    if source is not Source.HARDWARE:
        yield condition("source", False, told)
        return
    yield from each_of("source", (f"{told}, but {each}" for each in against_hardware(state, facts)), told)
    yield from (condition(EXCEPTION, True, f"EXCEPTION: {each}") for each in state.exceptions)


def _recorded_elsewhere(state: RunState) -> Iterator[Condition]:
    """Imported packages prove nothing about the bench, and close nothing."""
    if state.run and state.run.recorded_elsewhere:
        told = f"it was recorded elsewhere, without a bench file: {state.run.recorded_elsewhere}"
        yield condition("bench", False, told)


def _purpose(state: RunState) -> Iterator[Condition]:
    purpose = state.run.purpose if state.run else None
    closes = purpose is not None and purpose.closes
    proof = f"the purpose is {purpose}"
    yield condition("purpose", closes, proof, f"the purpose {purpose} does not close requirements")
    operator = state.run.operator if state.run else ""
    yield condition("operator", bool(operator), f"the operator is {operator}", "no operator is named")


def _executed(state: RunState, facts: Facts) -> Iterator[Condition]:
    """The code executed on hardware was compared with what was installed, including late imports."""
    if facts.software.format < TELLS_OF_EXECUTED or state.run is None or state.run.source is not Source.HARDWARE:
        return
    last = next((each for each in state.executed if each.last), None)
    told = [problem for each in state.executed for problem in each.problems]
    missing = [] if last else ["the code that ran was not compared with what was installed when the run ended"]
    besides = ", ".join(last.packages) if last else ""
    proof = f"{AS_INSTALLED}{f', that of {besides} included' * bool(besides)}"
    yield from each_of(EXECUTED, [*told, *missing], proof)


def _course(state: RunState) -> Iterator[Condition]:
    deviations = (f"deviation: {each}" for each in state.deviations)
    yield from each_of("deviations", deviations, "nothing deviates from the plan")
    yield condition("whole", not state.interrupted, "the run came to its own end", "the run was interrupted")
    limits = sum(gate.ok and gate.name.startswith(_ENVELOPE) for gate in state.gates)
    none = (
        "the bench has no envelope" if state.armed else "the bench was not armed, so no limit of the envelope was tried"
    )
    tried = "1 limit of the envelope was tried" if limits == 1 else f"{limits} limits of the envelope were tried"
    yield condition("envelope", limits > 0, tried, none)
    yield condition("trip", state.trip is None, "the envelope did not trip", "the envelope tripped")
    safe = state.safe is True
    yield condition("safe", safe, "the bench was proven safe at the end", "the bench was not proven safe at the end")


def _dut(state: RunState) -> Iterator[Condition]:
    dut = state.run.dut if state.run else None
    serial = dut.serial if dut else ""
    proof = f"the device under test has the serial number {serial}"
    yield condition("dut", bool(serial), proof, "the device under test has no serial number")
    model = dut.model if dut else None
    closes = model in MODELS.values()
    told = f"the device under test is {_a(model)}, which closes nothing"
    yield condition("model", closes, f"the device under test is {_a(model)}", told)


def _a(model: Model | None) -> str:
    return f"{'a' if model is Model.QM else 'an'} {model}" if model else "of no known model"


def _gates(state: RunState) -> Iterator[Condition]:
    gates = [*state.gates, *state.host_gates]
    refused = [f"readiness gate {gate.name}: {gate.detail}" for gate in gates if not gate.ok]
    left = [gate.unproven for gate in gates if gate.unproven and not gate.instrument]
    none = ["no readiness gate was passed"] if not state.gates else []
    yield from each_of("readiness", [*none, *refused, *left], f"{len(state.gates)} readiness gates hold")


def _method(entry: FrozenRequirement, answers: Sequence[Answer]) -> Iterator[Condition]:
    """A test closes by measurements, other methods by people's answers and the documents that they gave."""
    method = entry.method
    if method in _BY_DOCUMENTS:
        given = [f"{each.file.given} ({each.file.sha256[:_SHORT]}...) by {each.by}" for each in answers if each.file]
        told = f"its method is {method}, and no document was attached in its cases"
        yield condition("method", bool(given), f"its method is {method}, and documents are there: {_some(given)}", told)
    elif method == "inspection":
        told = "its method is inspection, and nobody answered a question of its cases"
        yield condition("method", bool(answers), "its method is inspection, and a person answered", told)
    elif method == "test":
        yield _IS_TEST
    else:
        told = f"its method is {method}, which no run closes" if method else "the requirement names no method"
        yield condition("method", False, told)


def _witness(entry: FrozenRequirement, seen_by: Sequence[tuple[str, str]]) -> Iterator[Condition]:
    """A witness asked for in another role, or for another question, does not count for this requirement."""
    if not (entry.witness or entry.independent):
        return
    who = entry.witness or "somebody else than who did it"
    names = sorted({name for asked, name in seen_by if is_asked_for(entry.witness, asked)})
    others = sorted({f"{name} ({asked})" for asked, name in seen_by})
    besides = f": those of its cases were witnessed by {_some(others)}" if others else ""
    told = f"it asks for a witness ({who}), and none confirmed an answer of its cases{besides}"
    yield condition("witness", bool(names), f"witnessed by {', '.join(names)} ({who})", told)


def is_asked_for(witness: str, asked: str) -> bool:
    """Return whether a question asked for the witness of a requirement, by the same role or name.

    Args:
        witness: who the requirement asks for; empty for anybody.
        asked: who the question asked for.
    """
    return not witness or witness.casefold().split() == asked.casefold().split()


def _some(names: Sequence[str]) -> str:
    more = len(names) - _MOST
    return ", ".join(names[:_MOST]) + (f" and {more} more" if more > 0 else "")


def _stage(stage: str, state: RunState) -> Iterator[Condition]:
    """A requirement of a stage is closed by a run of that purpose, on the model of that stage."""
    if state.run is None:
        return
    purpose, model = state.run.purpose, state.run.dut.model
    wanted = {str(each): its for each, its in MODELS.items()}.get(stage)
    if wanted is None:
        told = f"its stage is {stage}, which no run closes" if stage else "the requirement names no stage"
        yield condition("stage", False, told)
        return
    proof = f"its stage is {stage}, and so is the purpose"
    told = f"its stage is {stage}{_OTHER_PURPOSE}{purpose}"
    yield condition("stage", purpose == stage, proof, told)
    told = f"its stage is {stage}, which takes {_a(wanted)}, but the device under test is {_a(model)}"
    if model in MODELS.values():
        yield condition("stage", model is wanted, f"its stage takes {_a(wanted)}, and the device is one", told)


def _instruments(used: Mapping[str, str]) -> Iterator[Condition]:
    for each in sorted({*used.values()} - {Source.HARDWARE}):
        names = ", ".join(sorted(name for name, its in used.items() if its == each))
        yield condition("instruments", False, f"{each.upper()}: {names}")
    if hardware := sorted(name for name, its in used.items() if its == Source.HARDWARE):
        yield condition("instruments", True, f"HARDWARE: {', '.join(hardware)}")


def _identities(used: Mapping[str, str], state: RunState) -> Iterator[Condition]:
    """Every instrument used has identified itself, and hardware is proven to be where the bench file says."""
    for name, source in sorted(used.items()):
        seen = [gate for gate in state.gates if gate.instrument == name]
        yield _identity(name, seen)
        if source == Source.HARDWARE and not any(gate.instrument == name for gate in state.host_gates):
            yield condition("port", False, f"it is not known what is at the port of {name}")
        left = [gate.unproven for gate in state.host_gates if gate.instrument == name and gate.unproven]
        yield from (condition("bytes", False, each) for each in dict.fromkeys(left))


def _identity(name: str, seen: Sequence[Gate]) -> Condition:
    if not seen:
        return condition("identity", False, f"it was not asked who {name} is")
    left = next((gate.unproven for gate in seen if gate.unproven), "")
    return condition("identity", not left, f"{name} is {seen[-1].detail}, as the bench file says", left)


def _calibration(instruments: Sequence[str], facts: Facts) -> Iterator[Condition]:
    for name in instruments:
        record = facts.calibration.get(name, _NO_RECORD)
        if record.dut:
            continue
        problems = [f"{name} {each}" for each in record.problems(facts.begun or facts.date, facts.date)]
        if record.due and record.size is None:
            problems.append(f"{name} has a certificate whose bytes were not frozen")
        yield from each_of("calibration", problems, f"{name} was in calibration: due {record.due}, used {facts.date}")
