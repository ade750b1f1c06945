"""What a gate says, and what the gates must be told of the sensor."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Facts", "Gate"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gate:
    """One question to a recording that must be answered well before anything is concluded from it.

    Attributes:
        name: what is asked, such as `stuck`.
        channel: the channel that was asked, empty where it was the recording as a whole.
        ok: the answer; None where a fact is missing, so that nothing could be judged.
        reason: what was found, or which fact is missing, in a sentence.
        cycles: numbers of the battery's cycles that the answer speaks against; empty where that is the recording as a
            whole.
    """

    name: str
    channel: str
    ok: bool | None
    reason: str
    cycles: tuple[int, ...] = ()

    def __str__(self) -> str:
        return f"{self.name} of {self.channel}: {self.reason}" if self.channel else f"{self.name}: {self.reason}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """What is known of a sensor and its settings; None where it is not known. Units are those of the channels.

    Attributes:
        rate: samples per second that were asked for.
        lsb: step between two readings that differ by one count.
        full_scale: largest reading, of either sign.
        bandwidth: frequency at which the sensor's own filter is 3 dB down, in Hz.
        noise_density: of the data sheet, one-sided, per root of a hertz.
        temperature: name of the channel that holds degrees Celsius.
    """

    rate: float | None = None
    lsb: float | None = None
    full_scale: float | None = None
    bandwidth: float | None = None
    noise_density: float | None = None
    temperature: str | None = None
