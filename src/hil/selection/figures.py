"""The figures of packages for a selection, each with any objection to it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec

from hil.evidence.durable import read_plain
from hil.evidence.events.cases import Check, Effect
from hil.evidence.events.recordings import Recording
from hil.evidence.folder import CATALOGUE, RESULTS, is_sealed
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.evidence.results.outcome import CaseOutcome
from hil.model.errors import EvidenceError, HilError
from hil.model.figure import FigureStatus
from hil.model.verdict import Verdict

__all__ = ["CALCULATED", "Input", "Taken", "gives", "read_input"]

_RUINED = frozenset({Verdict.ERROR, Verdict.ABORTED})
_STATUS: Mapping[str, str] = {
    FigureStatus.UPPER_LIMIT: "it is an upper limit, not a measurement",
    FigureStatus.NOT_OBSERVABLE: "it is not observable in its record",
    FigureStatus.MODEL_REJECTED: "its model does not describe the record",
}
_RECORDING, _ANSWER, _PARAMETER = "recording ", "answer to ", "parameter "
CALCULATED = "calculated"
"""The mark of a figure that comes from parameters of its plan alone, without a reading or an answer."""


class Taken(msgspec.Struct, frozen=True, kw_only=True, order=True):
    """One figure as a package has it.

    Attributes:
        requirement: the requirement of its check.
        parameter: the parameter.
        of: the axis, such as `gyroscope.lsm.x`; empty without one.
        case: the case.
        plan: its plan.
        value: in `unit`; 0 for one that is no number, which has a problem.
        unit: its unit.
        uncertainty: standard uncertainty; 0 if it is not known, which is a problem.
        dof: degrees of freedom, None if infinite.
        unproven: why it proves nothing, sentences of its check or `CALCULATED`; empty if it comes from a reading.
        problem: why it does not count, a sentence without its full stop; empty if nothing speaks against it.
        rate: samples per second of its recordings, the least of them; None if not recorded.
        bandwidth: noise bandwidth of the sensor's filter in Hz; None if not recorded.
        rev: revision of the requirement.
        fingerprint: SHA-256 of the requirement's meaning.
    """

    requirement: str
    parameter: str
    of: str
    case: str
    plan: str
    value: float
    unit: str
    uncertainty: float
    dof: float | None = None
    unproven: tuple[str, ...] = ()
    problem: str = ""
    rate: float | None = None
    bandwidth: float | None = None
    rev: int = 0
    fingerprint: str = ""


class Input(msgspec.Struct, frozen=True, kw_only=True):
    """One package, and the wanted figures in it.

    Attributes:
        run: the name that the run had at its seal, or that of its folder.
        digest: its evidence digest; empty where it is not verified.
        problem: why nothing of it counts, a sentence without its full stop; empty if it is verified.
        source: where its bytes came from.
        purpose: why the run was made.
        bench: the bench's name.
        serial: the unit under test.
        part: its part number.
        began: when it began, ISO 8601.
        deviates: whether the run differs from its plan.
        figures: its figures, sorted.
        superseded: earlier attempts of the cases that gave them, a sentence each.
        asked: parameter and axis of the wanted figures that its requirements ask for.
    """

    run: str
    digest: str = ""
    problem: str = ""
    source: str = ""
    purpose: str = ""
    bench: str = ""
    serial: str = ""
    part: str = ""
    began: str = ""
    deviates: bool = False
    figures: tuple[Taken, ...] = ()
    superseded: tuple[str, ...] = ()
    asked: frozenset[tuple[str, str]] = frozenset()


def read_input(folder: Path, wanted: Collection[tuple[str, str]]) -> Input:
    """Return the figures of a package for a selection, after verifying it, with whatever is wrong with it.

    Args:
        folder: the package.
        wanted: parameter and axis of the figures.
    """
    try:
        found = verify(folder)
        if not found.ok:
            problem = found.problem or (found.ledger if found.complete else "the run was interrupted")
            return Input(run=found.run or folder.name, problem=f"it does not verify: {problem}")
        told = _told(Package(folder), wanted)
    except (HilError, OSError) as error:
        message = error.message if isinstance(error, HilError) else str(error)
        return Input(run=folder.name, problem=f"it cannot be read: {message.replace(f'{folder}/', '')}")
    return msgspec.structs.replace(told, run=found.run, digest=found.evidence_digest, deviates=found.deviates)


def gives(folder: Path, wanted: Collection[tuple[str, str]]) -> bool:
    """Return whether a package claims a wanted figure, or is sealed but unreadable; nothing is verified."""
    try:
        said = msgspec.json.decode(read_plain(folder / RESULTS), type=_Said)
    except (OSError, msgspec.MsgspecError):
        return is_sealed(folder)
    return any((each.parameter, each.of or "") in wanted for case in said.cases for each in case.checks)


class _Checked(msgspec.Struct, frozen=True):
    parameter: str
    of: str | None


class _Case(msgspec.Struct, frozen=True):
    checks: tuple[_Checked, ...] = ()


class _Said(msgspec.Struct, frozen=True):
    cases: tuple[_Case, ...]


def _told(package: Package, wanted: Collection[tuple[str, str]]) -> Input:
    outcome = package.outcome()
    run = outcome.run
    if run is None:
        raise EvidenceError("it never began", "see hil verify")
    conditions = _Conditions(package)
    catalogue = package.json(CATALOGUE)["requirements"]
    figures, superseded = [], []
    for case in outcome.cases:
        its = [check for check in case.checks if (check.parameter, check.of or "") in wanted]
        superseded += list(_superseded(case)) if its else []
        for check in its:
            meant = catalogue.get(check.requirement, {})
            facts = {name: meant[name] for name in ("rev", "fingerprint") if meant.get(name) is not None}
            figures.append(_taken(case, check, {**conditions.of(case.case, check), **facts}))
    return Input(
        run=package.name,
        source=run.source,
        purpose=run.purpose,
        bench=run.bench,
        serial=run.dut.serial,
        part=run.dut.part,
        began=str(package.lines()[0].wall.get("utc", "")),
        figures=tuple(sorted(figures)),
        superseded=tuple(superseded),
        asked=frozenset(_asked(catalogue.values())) & frozenset(wanted),
    )


def _asked(requirements: Iterable[Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
    for requirement in requirements:
        for limit in requirement.get("limits") or ():
            for axis in limit.get("of") or ("",):
                yield limit["parameter"], axis


def _superseded(case: CaseOutcome) -> Iterator[str]:
    for each in case.attempts[:-1]:
        yield f"attempt {each.attempt} of {case.case} is superseded by attempt {case.attempts[-1].attempt}"


def _taken(case: CaseOutcome, check: Check, facts: Mapping[str, object]) -> Taken:
    number = check.value if isinstance(check.value, float | int) else None
    return Taken(
        requirement=check.requirement,
        parameter=check.parameter,
        of=check.of or "",
        case=case.case,
        plan=case.plan,
        value=float(number or 0.0),
        unit=check.unit,
        uncertainty=check.uncertainty or 0.0,
        dof=check.dof,
        unproven=_unproven(check),
        problem=_problem(case, check, number),
        **facts,  # type: ignore[arg-type]  # of the fields that they name
    )


def _problem(case: CaseOutcome, check: Check, number: float | None) -> str:
    """Return why a figure does not count, else an empty text; whether it met its limit plays no part."""
    near = check.margin is not None and check.expanded is not None and not check.uncovered  # only too near its limit
    reasons = (
        (case.verdict in _RUINED, f"its case ended in {case.verdict}: {_told_of(case.reasons)}"),
        (bool(check.doubts), f"its data are in DOUBT: {_told_of(check.doubts)}"),
        (check.status in _STATUS, _STATUS.get(str(check.status), "")),
        (number is None, "it is not a number"),
        (check.verdict == Verdict.INCONCLUSIVE and not near, f"its check is INCONCLUSIVE: {_told_of([check.reason])}"),
        (check.uncertainty is None, "its uncertainty is unknown, so it cannot be told apart from others"),
    )
    return next((text for holds, text in reasons if holds), "")


def _unproven(check: Check) -> tuple[str, ...]:
    sources = check.provenance or ()
    read = check.instruments or any(each.startswith(_ANSWER) for each in sources)
    # Of what nobody read the first sentence says that; a second one says what else was done to it.
    if not read and len(check.unproven or ()) == 1 and any(each.startswith(_PARAMETER) for each in sources):
        return (CALCULATED,)
    return tuple(check.unproven or ())


def _told_of(reasons: Iterable[str]) -> str:
    return "; ".join(each for each in reasons if each) or "no reason is given"


class _Conditions:
    """The rate and the filter with which figures of a package were recorded, from its journal."""

    def __init__(self, package: Package) -> None:
        self._rates: dict[tuple[str, str, str], list[float]] = {}
        for each in package.of(Recording):
            for instrument in {channel.instrument for channel in each.channels}:
                self._rates.setdefault((each.case or "", each.name, instrument), []).append(each.rate)
        self._filters = {
            (each.case, each.name.rpartition(".")[0]): each.result
            for each in package.of(Effect)
            if each.name.endswith(".bandwidth")
        }

    def of(self, case: str, check: Check) -> dict[str, object]:
        """Return rate and bandwidth of a check, each if it is recorded."""
        named = [told.removeprefix(_RECORDING) for told in check.provenance or () if told.startswith(_RECORDING)]
        recordings = {(case, name.partition(", ")[0], its) for name in named for its in check.instruments}
        rates = [rate for key in recordings for rate in self._rates.get(key, ())]
        asked = self._filters.get((case, (check.of or "").rpartition(".")[0]))
        bandwidth = asked.get("value") if isinstance(asked, dict) and asked.get("unit") == "Hz" else None
        return {"rate": min(rates, default=None), "bandwidth": None if bandwidth is None else float(bandwidth)}
