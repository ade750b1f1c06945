"""A requirement as data, and the fingerprint of its meaning."""

import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import lru_cache
from typing import Annotated, NamedTuple

from hil.documents.canonical import digest
from hil.documents.node import Place
from hil.documents.text import name_problem
from hil.model.notation import (
    UNWRITTEN,
    AnyText,
    Complaint,
    DecimalText,
    Flag,
    Hertz,
    Notation,
    Seconds,
    Text,
    matching,
    one_of,
    whole,
)

__all__ = ["Decision", "Document", "Kind", "Limit", "Method", "PlannedRequirement", "Records", "Requirement"]

_KEPT = 1 << 14
"""How many fingerprints are remembered."""

_ID = matching(
    "(?=.{1,64}$)[A-Z][A-Z0-9]*(-[A-Z0-9]+)*-[0-9]{2,5}",
    "an id such as ADCS-GYR-010: capitals, and a number at its end, at most 64 characters",
)
_NAME = matching("[A-Za-z_][A-Za-z0-9_]*", "letters, digits and '_', beginning with a letter or '_'")


def _recording(value: object) -> str:
    """Return the name of a recording, which is one that `record` takes."""
    if not isinstance(value, str):
        raise Complaint("must be text", quote=isinstance(value, bool | int))
    if problem := name_problem(value):
        raise Complaint(f"names no recording: {problem}")
    return value


_RECORDING = Notation(_recording, "")
_LEVEL = one_of("part", "equipment", "subsystem", "element", "segment", "system")
_STAGE = one_of("qualification", "acceptance", "pre-launch", "in-orbit", "post-landing")


class Kind(StrEnum):
    """What a requirement demands."""

    LIMIT = "limit"
    RECORD = "record"
    CHARACTERISE = "characterise"
    PARENT = "parent"
    """Met by the requirements below it; in `testplans/requirements.yaml` only."""


class Method(StrEnum):
    """How a requirement is verified."""

    TEST = "test"
    ANALYSIS = "analysis"
    INSPECTION = "inspection"
    REVIEW = "review"


class Decision(StrEnum):
    """How a figure is judged against a limit; see `hil.requirements.decision`."""

    SIMPLE = "simple"
    GUARDED = "guarded"


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """The document that one `requirements.yaml` stands for."""

    id: Text
    issue: AnyText = ""
    title: AnyText = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """What one parameter of a requirement must be.

    Attributes:
        parameter: its name in checks.
        of: what it is evaluated for (axes, channels): the denominator; empty if it is evaluated once.
        unit: unit of the limits, empty if a word is expected.
        minimum: lowest allowed value as a decimal string, or None.
        maximum: highest allowed value as a decimal string, or None.
        equals: the word that must have been found (a direction, a mode), or None.
        decision: how uncertainty is taken into account.
        min_tur: lowest test uncertainty ratio that can pass, as a decimal string, or None.
    """

    parameter: Annotated[str, _NAME]
    of: tuple[Text, ...] = ()
    unit: AnyText = ""
    minimum: DecimalText | None = field(default=None, metadata={"alias": "min"})
    maximum: DecimalText | None = field(default=None, metadata={"alias": "max"})
    equals: AnyText | None = None
    decision: Annotated[Decision, one_of(*Decision, blank=Decision.GUARDED)] = Decision.GUARDED
    min_tur: DecimalText | None = None

    @property
    def bounded(self) -> bool:
        """Whether it has a bound; otherwise a value is only recorded."""
        return self.minimum is not None or self.maximum is not None or self.equals is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class Records:
    """The recording that a requirement demands.

    Attributes:
        recording: its name in the case.
        channels: the channels that must be in it.
        rate_hz: lowest rate, or None.
        duration_s: shortest duration, or None.
        max_gap_s: longest time without a row, or None.
    """

    recording: Annotated[str, _RECORDING]
    channels: tuple[Text, ...]
    rate_hz: Hertz | None = field(default=None, metadata={"alias": "rate"})
    duration_s: Seconds | None = field(default=None, metadata={"alias": "duration"})
    max_gap_s: Seconds | None = field(default=None, metadata={"alias": "max_gap"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Requirement:
    """One entry of a catalogue.

    Attributes:
        id: its name, unique in the workspace.
        rev: its revision, from 1.
        plan: the plan it belongs to; empty for those of `testplans/requirements.yaml`.
        parents: ids of the requirements that this one serves.
        over: case parameters to the values that planned cases must cover between them.
        max_age_s: how old its evidence may get, or None.
        witness: who has to be present when it is verified, by role or name; empty if no one has to.
        independent: whether someone other than its author has to confirm its verification.
        withdrawn: no longer in force; its id is never reused.
        anomaly: what is wrong with the text at its source.
        place: where it is written.
    """

    id: Annotated[str, _ID]
    rev: Annotated[int, whole(1)]
    text: Text
    kind: Annotated[Kind, one_of(*Kind, blank=Kind.PARENT)] = Kind.PARENT
    method: Annotated[Method, one_of(*Method, blank=Method.TEST)] = Method.TEST
    plan: str = field(default="", metadata=UNWRITTEN)
    source: AnyText = ""
    parents: tuple[Text, ...] = ()
    level: Annotated[str, _LEVEL] = ""
    stage: Annotated[str, _STAGE] = ""
    limits: tuple[Limit, ...] = ()
    records: Records | None = None
    over: Mapping[str, tuple[Text, ...]] = field(default_factory=dict)
    max_age_s: Seconds | None = field(default=None, metadata={"alias": "max_age"})
    witness: AnyText = ""
    independent: Flag = False
    withdrawn: Flag = False
    anomaly: AnyText = ""
    rationale: AnyText = ""
    place: Place = field(default_factory=lambda: Place(path=""), compare=False, metadata=UNWRITTEN)

    @property
    def meaning(self) -> dict[str, object]:
        """What must be shown, as JSON: it changes with a new revision only."""
        return self._meant.as_json()

    @property
    def _meant(self) -> "_Meant":
        named = (self.id, self.text, self.kind, self.method, self.level, self.stage)
        people = self.witness, self.independent
        return _Meant(*named, self.limits, self.records, tuple(self.over.items()), self.max_age_s, *people)

    @property
    def explanation(self) -> dict[str, object]:
        """The explanations, as JSON: they may change without a new revision."""
        return {
            "source": self.source,
            "parents": list(self.parents),
            "withdrawn": self.withdrawn,
            "anomaly": self.anomaly,
            "rationale": self.rationale,
        }

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the canonical JSON of the meaning: what must be shown, not how it is explained."""
        return _fingerprint(self._meant)

    @property
    def wording(self) -> str:
        """SHA-256 of what may change without a new revision: explanations, and the spacing of the text."""
        return digest({"text": self.text, **self.explanation})


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedRequirement(Requirement):
    """An entry of a plan's catalogue, which says its kind and method; only the workspace's own may be parents."""

    kind: Annotated[Kind, one_of(Kind.LIMIT, Kind.RECORD, Kind.CHARACTERISE, blank=Kind.PARENT)]
    method: Annotated[Method, one_of(*Method, blank=Method.TEST)]


class _Meant(NamedTuple):
    """The fields of a requirement that its meaning consists of."""

    id: str
    text: str
    kind: Kind
    method: Method
    level: str
    stage: str
    limits: tuple[Limit, ...]
    records: Records | None
    over: tuple[tuple[str, tuple[str, ...]], ...]
    max_age_s: float | None
    witness: str
    independent: bool

    def as_json(self) -> dict[str, object]:
        """Return the meaning."""
        return {
            "id": self.id,
            "text": _collapsed(self.text),
            "kind": self.kind,
            "method": self.method,
            "level": self.level,
            "stage": self.stage,
            "limits": [_limit(limit) for limit in sorted(self.limits, key=lambda limit: limit.parameter)],
            "records": _records(self.records),
            "over": {name: sorted(values) for name, values in self.over},
            # Left out where it is not given, so that the requirements from before it keep their fingerprints.
            **({} if self.max_age_s is None else {"max_age_s": self.max_age_s}),
            **({"witness": self.witness} if self.witness else {}),
            **({"independent": True} if self.independent else {}),
        }


@lru_cache(maxsize=_KEPT)
def _fingerprint(meant: _Meant) -> str:
    """Return the digest of a meaning; a command asks for that of every requirement several times."""
    return digest(meant.as_json(), finite=True)


def _collapsed(text: str) -> str:
    return " ".join(unicodedata.normalize("NFC", text).split())


def _limit(limit: Limit) -> dict[str, object]:
    return {
        "parameter": limit.parameter,
        "of": sorted(limit.of),
        "unit": limit.unit,
        "min": limit.minimum,
        "max": limit.maximum,
        "equals": limit.equals,
        "decision": limit.decision,
        "min_tur": limit.min_tur,
    }


def _records(records: Records | None) -> dict[str, object] | None:
    if records is None:
        return None
    return {
        "recording": records.recording,
        "channels": sorted(records.channels),
        "rate_hz": records.rate_hz,
        "duration_s": records.duration_s,
        "max_gap_s": records.max_gap_s,
    }
