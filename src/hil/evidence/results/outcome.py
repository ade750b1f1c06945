"""Results of a run as types, the rule for a verdict, and the strict codec of `data/results.json`."""

from collections.abc import Iterable, Mapping, Sequence

import msgspec

from hil.documents.canonical import JsonError, parse_strict
from hil.evidence.events import Check, Part, Run
from hil.evidence.events.codec import convert, decode, is_text_of, plain, quick_canonical, told
from hil.model.verdict import Verdict, worst

__all__ = [
    "ANSWERS",
    "AS_INSTALLED",
    "CHANNELS",
    "EXCEPTION",
    "EXECUTED",
    "FORMAT",
    "NO_OTHERS",
    "OTHERS",
    "AttemptOutcome",
    "CaseOutcome",
    "CaseVerdict",
    "Condition",
    "HoldOutcome",
    "Outcome",
    "RequirementOutcome",
    "StepOutcome",
    "is_outcome",
    "read_outcome",
    "rule",
    "silence",
    "without_sentences",
    "write_outcome",
]

FORMAT = 3
"""The format that is written.

Format 1 did not record when the bench was held during a case. Formats 1 and 2 list reasons against closing a
requirement; format 3 lists the conditions to be proven, and whether they are.
"""

ANSWERS = "answers"
"""A requirement with a limit on this parameter is about whether its device answers at all."""

CHANNELS = "channels"
"""The parameter of the check on every recording that a requirement asks for."""

_OVERRIDING = frozenset({Verdict.ERROR, Verdict.ABORTED, Verdict.NOT_RUN})
_CONDITION = frozenset({"name", "proven", "text"})
_OF_ATTEMPT = ("read", "reasons")
_SENTENCE = "a sentence"
_OF_EVENT = frozenset({"kind", "seq", "t"})


class AttemptOutcome(Part, frozen=True, kw_only=True):
    """The outcome of one attempt of a case.

    Attributes:
        attempt: which attempt it is; from format 3 on in the order in which they began, from 1.
        verdict: its verdict, None if it did not end.
        reasons: why, a sentence each.
        read: what an attempt had read that was interrupted and repeated; not before format 3.
    """

    attempt: int
    verdict: Verdict | None
    reasons: tuple[str, ...]
    read: tuple[str, ...] = ()


class StepOutcome(Part, frozen=True, kw_only=True):
    """The outcome of one step; outcome and duration in s are None if it did not end."""

    path: tuple[str, ...]
    number: str
    outcome: str | None
    duration: float | None


class HoldOutcome(Part, frozen=True, kw_only=True):
    """A hold of the bench during a case: when, for how long in s, by whom and why."""

    t: float
    duration: float | None
    by: str
    text: str


class CaseOutcome(Part, frozen=True, kw_only=True):
    """The outcome of one case; checks and steps are those of its last attempt.

    Attributes:
        case: its id.
        title: the first line of its docstring.
        plan: its plan.
        verdict: the worst of its attempts and requirements.
        reasons: why, a sentence each.
        requirements: the verdict on each requirement.
        duration: bench time in s, None if it did not end.
        attempts: its attempts, in order.
        used: the instruments that it used, with their source.
        checks: its checks.
        steps: its steps, in order.
        recordings: the ids of its recordings.
        holds: when the bench was held; None in format 1.
        repeatable: why an attempt without a verdict does not count, empty if it does; not before format 3.
    """

    case: str
    title: str
    plan: str
    verdict: Verdict
    reasons: tuple[str, ...]
    requirements: Mapping[str, Verdict]
    duration: float | None
    attempts: tuple[AttemptOutcome, ...]
    used: Mapping[str, str]
    checks: tuple[Check, ...]
    steps: tuple[StepOutcome, ...]
    recordings: tuple[str, ...]
    holds: tuple[HoldOutcome, ...] | None = None
    repeatable: str = ""


class CaseVerdict(Part, frozen=True, kw_only=True):
    """The verdict of one case on a requirement."""

    case: str
    verdict: Verdict


EXCEPTION = "exception"
"""The name of conditions about what is hardware by the word of the bench file alone."""


OTHERS = "others"
"""The name of conditions about drivers, roles and the like from packages other than hil."""


NO_OTHERS = "every driver and role is of hil itself"
"""The text of the condition if there are none."""


EXECUTED = "executed"
"""The name of conditions about executed code, whoever imported it."""


AS_INSTALLED = "the code that ran is as it was installed"
"""How the condition's text begins if it is proven."""


class Condition(Part, frozen=True, kw_only=True):
    """Something that must be proven before a requirement can be closed.

    Attributes:
        name: the kind of condition.
        proven: whether it is proven.
        text: what proves it, or why it is not proven.
    """

    name: str
    proven: bool
    text: str


class RequirementOutcome(Part, frozen=True, kw_only=True):
    """The outcome of one requirement.

    Attributes:
        id: the requirement.
        rev: its revision; this and the following are None if it is not in the frozen catalogue.
        text: its text.
        kind: its kind.
        method: its verification method.
        source: where it comes from.
        verdict: the worst of all planned cases that carry it.
        cases: the verdict of each of them.
        checks: how many checks it got.
        eligible: whether this run can close it.
        reasons: why not, a sentence each; those that concern the whole run come first from format 3 on.
        conditions: the conditions of this requirement in particular; None in formats 1 and 2.
    """

    id: str
    rev: int | None
    text: str | None
    kind: str | None
    method: str | None
    source: str | None
    verdict: Verdict
    cases: tuple[CaseVerdict, ...]
    checks: int
    eligible: bool
    reasons: tuple[str, ...]
    conditions: tuple[Condition, ...] | None = None


class Outcome(Part, frozen=True, kw_only=True):
    """The results of a run; all of it is derived from the journal and the frozen catalogue.

    Attributes:
        format: the number of the format.
        run: the request for the run, with the deviations of its resumptions; None if it never began.
        interrupted: whether it did not come to its own end.
        tripped: whether the envelope was left.
        safe: whether every way to the safe state proved every output safe, None if there was none.
        content_digest: SHA-256 over the journal's bodies before the results.
        cases: the cases, in the order of the plan.
        requirements: the requirements, by id.
        counts: how many cases have which verdict.
        verdict: the run's verdict.
        conditions: the conditions of the run as a whole; None in formats 1 and 2.
    """

    format: int
    run: Run | None
    interrupted: bool
    tripped: bool
    safe: bool | None
    content_digest: str
    cases: tuple[CaseOutcome, ...]
    requirements: tuple[RequirementOutcome, ...]
    counts: Mapping[Verdict, int]
    verdict: Verdict
    conditions: tuple[Condition, ...] | None = None


def write_outcome(outcome: Outcome) -> bytes:
    """Return the content of `data/results.json`."""
    run = {} if outcome.run is None else plain(outcome.run)
    asked = {name: value for name, value in run.items() if name not in _OF_EVENT}
    return quick_canonical({**told(outcome), "run": asked})


def is_outcome(data: bytes, outcome: Outcome) -> bool:
    """Return whether these bytes are what `write_outcome` returns; compared piece by piece, without writing it all."""
    try:
        parts = msgspec.json.decode(data, type=dict[str, msgspec.Raw])
        cases, requirements = (msgspec.json.decode(parts[name], type=list[msgspec.Raw]) for name in _LISTS)
    except (msgspec.MsgspecError, UnicodeError, KeyError):
        return False
    rest = msgspec.structs.replace(outcome, cases=(), requirements=())
    return (
        _object_text({**parts, **dict.fromkeys(_LISTS, b"[]")}) == write_outcome(rest)
        and _object_text({**parts, **dict(zip(_LISTS, map(_list_text, (cases, requirements)), strict=True))}) == data
        and _are(cases, outcome.cases)
        and _are(requirements, outcome.requirements, plain_numbers=all(map(_has_short_rev, outcome.requirements)))
    )


def _are(texts: Sequence[msgspec.Raw], values: Sequence[msgspec.Struct], *, plain_numbers: bool = False) -> bool:
    """Return whether texts are those of values, compared in blocks because one text per value would be slow."""
    blocks = [slice(first, first + _BLOCK) for first in range(0, len(values), _BLOCK)]
    return len(texts) == len(values) and all(
        is_text_of(_list_text(texts[block]), values[block], plain_numbers=plain_numbers) for block in blocks
    )


def _has_short_rev(requirement: RequirementOutcome) -> bool:
    return abs(requirement.rev or 0) < _SHORT  # the only other number is the count of checks


def _object_text(members: Mapping[str, bytes | msgspec.Raw]) -> bytes:
    return b"{%b}" % b",".join(b'"%b":%b' % (name.encode(), text) for name, text in members.items())


def _list_text(items: Sequence[msgspec.Raw]) -> bytes:
    return b"[%b]" % b",".join(items)


_LISTS = ("cases", "requirements")
_BLOCK = 100
_SHORT = 10**15


def read_outcome(data: bytes) -> Outcome:
    """Return the results in `data/results.json`.

    Raises:
        JsonError: for what is not strict JSON, and with every field that is missing, unknown or mistyped.
    """
    found = parse_strict(data)
    run = found.get("run") if isinstance(found, dict) else None
    if not isinstance(found, dict):
        raise JsonError("results must be an object")
    if not isinstance(run, dict):
        raise JsonError("field 'run' must be an object")
    asked = decode({**run, "kind": Run.kind(), "seq": 0, "t": 0.0}) if run else None
    outcome = convert({**found, "run": None}, Outcome, "results")
    return msgspec.structs.replace(outcome, run=asked)


def without_sentences(value: object) -> object:
    """Return results without sentences, which other versions of hil word differently.

    Of a condition, name and proof are compared, of reasons only their number. For a case with an attempt that was
    given up, the sentences about that attempt are left out; the events behind them are in the journal.
    """
    if isinstance(value, list):
        return [without_sentences(each) for each in value]
    if not isinstance(value, dict):
        return value
    kept = {key: without_sentences(each) for key, each in value.items()}
    if value.keys() == _CONDITION:
        kept["text"] = _SENTENCE if isinstance(value["text"], str) else value["text"]
    attempts = value.get("attempts")
    given_up = isinstance(attempts, list) and any(isinstance(each, dict) and each.get("read") for each in attempts)
    worded = _OF_ATTEMPT if value.get("read") else ("reasons",) if given_up or "eligible" in value else ()
    for key in worded:
        if isinstance(texts := value.get(key), list) and all(isinstance(each, str) for each in texts):
            kept[key] = [] if given_up else [_SENTENCE] * len(texts)
    return kept


def rule(
    checks: Iterable[Verdict], *, missing: bool, silent: Verdict | None, taken_out: bool, ended: Verdict | None = None
) -> Verdict:
    """Return the verdict on a requirement within a case: the worst of its checks and of how the case ended.

    It judges a case while it runs, and again when its results are derived.

    Args:
        checks: the verdicts of its checks.
        missing: whether a check that the catalogue asks for is missing.
        silent: the verdict due to silence of the device under test, which explains what is missing; None if it
            answered.
        taken_out: whether the case skipped itself; it is NOT_RUN then, and its checks until then stand.
        ended: how the case ended; ERROR, ABORTED and NOT_RUN hold for all its requirements.
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
    """Return the verdict on a requirement due to silence, by the parameters of its limits; None if there was none.

    Args:
        parameters: of its limits.
        dut: whether the device under test fell silent.
        undecided: whether something expected did not happen, and it is unknown if bench or DUT is to blame.
    """
    if dut and ANSWERS in parameters:
        return Verdict.FAIL
    return Verdict.INCONCLUSIVE if dut or undecided else None
