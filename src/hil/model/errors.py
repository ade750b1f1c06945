"""All errors of the product, as one class hierarchy.

HilError                      anything a person can cause or must know; never a traceback
├── ConfigurationError        files that are wrong: all findings at once, exit code 4
├── Refused                   the product declines, in a plain sentence, exit code 4
├── DeviceFault               silence or nonsense from one device
│   ├── NoReply               nothing came within the timeout
│   ├── Garbled               something came that the protocol does not allow
│   ├── Rejected              the device answered with an error of its own
│   ├── Implausible           it answers as it should, and what it says cannot be
│   └── WrongIdentity         another device answered
├── ClampExceeded             a setting beyond what the bench file allows; no byte was sent
├── Tripped                   the envelope was left; the bench is being made safe
├── GuardianLost              the guardian is gone, or does not answer; the bench is being made safe
├── Diverged                  a case run again asked for something else than the record says
├── NotInTime                 what a case waited for did not come
│   └── NotTriggered          an instrument's trigger did not
│       └── NotMet            a condition that it waited for was not met
└── EvidenceError             a package or journal that is damaged, incomplete or in the way
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

__all__ = [
    "ClampExceeded",
    "ConfigurationError",
    "DeviceFault",
    "Diverged",
    "EvidenceError",
    "Finding",
    "Garbled",
    "GuardianLost",
    "HilError",
    "Implausible",
    "Misused",
    "NoReply",
    "NotInTime",
    "NotMet",
    "NotTriggered",
    "Refused",
    "Rejected",
    "Tripped",
    "WrongIdentity",
]


class HilError(Exception):
    """An error with a hint on what to do next.

    Args:
        message: location and problem, in one sentence without a full stop.
        hint: what to do next, or an empty string if the message already says it.
    """

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message}; {self.hint}" if self.hint else self.message


@dataclass(frozen=True, slots=True, order=True)
class Finding:
    """One error at one place of one file; line and column count from 1, 0 is unknown."""

    path: str
    line: int
    column: int
    message: str

    def __str__(self) -> str:
        if not self.line:
            return f"{self.path}: {self.message}"
        return f"{self.path}:{self.line}:{self.column}: {self.message}"


class ConfigurationError(HilError):
    """Invalid files, with every finding, in the order of the files."""

    def __init__(self, findings: tuple[Finding, ...]) -> None:
        self.findings = tuple(sorted(findings))
        super().__init__("\n".join(_told(self.findings)))


_UNQUOTED = ", write it in quotes: "
_MOST_UNQUOTED = 5


def _told(findings: tuple[Finding, ...]) -> Iterator[str]:
    """Yield one line per finding; many values of a file that only lack quotes share a line."""
    unquoted: dict[str, list[int]] = {}
    for finding in findings:
        lines = unquoted.setdefault(finding.path, [])
        if _UNQUOTED in finding.message:
            lines.append(finding.line)
        if _UNQUOTED not in finding.message or len(lines) <= _MOST_UNQUOTED:
            yield str(finding)
    for path, lines in unquoted.items():
        if more := lines[_MOST_UNQUOTED:]:
            places = ", ".join(map(str, dict.fromkeys(more)))
            yield f"{path}: {len(more)} more values without quotes, in lines {places}; write each in quotes"


class Refused(HilError):
    """The product declines the request; nothing was driven."""


class DeviceFault(HilError):
    """A device does not respond as its protocol requires.

    Args:
        device: the device's name in the bench file.
        message: what was expected and what was received.
        hint: what to check.
    """

    def __init__(self, device: str, message: str, hint: str = "") -> None:
        super().__init__(f"{device}: {message}", hint)
        self.device = device


class NoReply(DeviceFault):
    """No reply, or an incomplete one, within the timeout.

    Args:
        device: see `DeviceFault`.
        message: see `DeviceFault`.
        hint: see `DeviceFault`.
        gone: whether the port itself is lost: a hang-up, an I/O error, a reset connection.
    """

    def __init__(self, device: str, message: str, hint: str = "", *, gone: bool = False) -> None:
        super().__init__(device, message, hint)
        self.gone = gone


class Garbled(DeviceFault):
    """Bytes were received that the protocol does not allow."""


class Rejected(DeviceFault):
    """The device itself reported an error."""


class Implausible(DeviceFault):
    """A device's readings contradict other knowledge: a fixture's judgement of its bench."""


class WrongIdentity(DeviceFault):
    """The device that answered is not the one in the bench file."""


class ClampExceeded(HilError):
    """A setting exceeds the bench file's clamps; no byte of it was sent."""


class Tripped(HilError):
    """The envelope was violated; whatever the case does now, its verdict is ERROR."""


class GuardianLost(HilError):
    """The guardian is gone or does not respond, so nothing would make the bench safe in the executive's place."""


class Misused(HilError):
    """A case asks for something not in the catalogue, or passes a value that is not a figure or role of its own."""


class NotInTime(HilError):
    """A condition in a recording's rows that a case waited for did not occur in time."""


class Diverged(HilError):
    """A re-executed case made a request that differs from the record."""

    @property
    def first(self) -> Diverged:
        """The original disagreement, if this one follows from it."""
        found = self
        while isinstance(found.__context__, Diverged):
            found = found.__context__
        return found


class EvidenceError(HilError):
    """A package or journal is damaged, incomplete, or in the way."""


class NotTriggered(NotInTime):
    """An instrument was armed, but its trigger did not occur in time.

    Whether bench or DUT is at fault is unknown: if a case lets it through, unchecked parameters are INCONCLUSIVE.

    Args:
        device: the instrument's name in the bench file.
        message: what was waited for.
        hint: what to check.
    """

    def __init__(self, device: str, message: str, hint: str = "") -> None:
        super().__init__(message, hint)
        self.device = device


class NotMet(NotTriggered):
    """A condition that a case waited for was not met in time; treated like a missing trigger."""
