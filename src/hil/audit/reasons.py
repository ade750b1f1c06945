"""Why a requirement is open: a code for each condition that does not hold, and a sentence."""

from __future__ import annotations

from enum import StrEnum

import msgspec

__all__ = ["Code", "Reason"]


class Code(StrEnum):
    """Why a requirement is open, one code for each condition; declared in reporting order."""

    NO_EVIDENCE = "NO_EVIDENCE"
    WITHDRAWN = "WITHDRAWN"
    NO_VERDICT = "NO_VERDICT"
    FAILED = "FAILED"
    SUPERSEDED_BY_FAIL = "SUPERSEDED_BY_FAIL"
    OPEN_NCR = "OPEN_NCR"
    NOT_ELIGIBLE = "NOT_ELIGIBLE"
    SIM_ONLY = "SIM_ONLY"
    SUSPECT_REQ = "SUSPECT_REQ"
    INTEGRITY = "INTEGRITY"
    UNKNOWN_TO_LEDGER = "UNKNOWN_TO_LEDGER"
    MISSING_PACKAGE = "MISSING_PACKAGE"
    UNSIGNED = "UNSIGNED"
    AWAITING_APPROVAL = "AWAITING_APPROVAL"
    WRONG_DUT = "WRONG_DUT"
    STALE_DUT = "STALE_DUT"
    STALE_CAL = "STALE_CAL"
    CAL_RETRO = "CAL_RETRO"
    STALE_ANALYSIS = "STALE_ANALYSIS"
    EXPIRED = "EXPIRED"
    CHILD_OPEN = "CHILD_OPEN"
    NO_CHILDREN = "NO_CHILDREN"

    __hash__ = str.__hash__  # that of an enumeration is ten times as slow, and an audit has a reason per result

    @property
    def meaning(self) -> str:
        """What the code means, in a sentence without a full stop."""
        return _MEANINGS[self]


_MEANINGS = {
    Code.NO_EVIDENCE: "no package has evidence for it",
    Code.WITHDRAWN: "it or a link below it was removed from the catalogue without explanation",
    Code.NO_VERDICT: "there is evidence, but its verdict is neither PASS nor RECORDED",
    Code.FAILED: "a FAIL from hardware stands, with no good evidence since",
    Code.SUPERSEDED_BY_FAIL: "a FAIL from hardware came after the good evidence",
    Code.OPEN_NCR: "a nonconformance is open: a report, or an earlier FAIL without a signed disposition",
    Code.NOT_ELIGIBLE: "the run did not meet every condition for closing it",
    Code.SIM_ONLY: "the evidence is not from hardware",
    Code.SUSPECT_REQ: "the meaning of the requirement changed since the evidence was made",
    Code.INTEGRITY: "a package or a document is damaged, incomplete, or not what the ledger or the register names",
    Code.UNKNOWN_TO_LEDGER: "the ledger does not know the package",
    Code.MISSING_PACKAGE: "the ledger has the seal of a package that is missing",
    Code.UNSIGNED: "the package lacks a signature that the workspace requires",
    Code.AWAITING_APPROVAL: "a required approval is missing",
    Code.WRONG_DUT: "the device under test is not one that the register and the plan name",
    Code.STALE_DUT: "the device under test changed, or had an event, after the evidence was made",
    Code.STALE_CAL: "an instrument was out of calibration when it was used, or the register no longer has it",
    Code.CAL_RETRO: "an instrument was later found out of tolerance, and was used since its last good calibration",
    Code.STALE_ANALYSIS: "the analysis that gave the verdict changed, and no replay has confirmed the verdict",
    Code.EXPIRED: "the evidence is older than the requirement allows",
    Code.CHILD_OPEN: "a requirement below it is open",
    Code.NO_CHILDREN: "it is met by the requirements below it, and there are none",
}


class Reason(msgspec.Struct, frozen=True, kw_only=True, order=True):
    """One reason why a requirement is open.

    Attributes:
        code: which condition does not hold.
        text: the reason as a sentence without a full stop.
        package: the folder of the package that it speaks of, empty for none.
        origin: the id of the requirement from which it was inherited, empty where it is the row's own.
    """

    code: Code
    text: str
    package: str = ""
    origin: str = ""
