"""What an ERROR reply of a level 2 device means, in a sentence, and what to do about it."""

from __future__ import annotations

from hil.model.errors import Rejected

__all__ = ["refusal"]

_FIRMWARE = "compare its firmware with version 2.0 of the protocol"
_MEANINGS = {
    "COMMAND": ("it does not know the command {word}", _FIRMWARE),
    "FIELD": ("it does not understand the field {word}", _FIRMWARE),
    "RANGE": ("that is lower or higher than {word} may be", "choose a value from the table of its settings"),
    "BUSY": ("the test {word} runs", "wait for its end, or stop() it"),
    "STATE": ("its state is {word}", "call prepare() before start(); it acknowledges what ended the last test"),
    "RUN": ("its last test is {word}", "look who else starts tests on it, and prepare the test anew"),
    "SETTINGS": ("its settings are not those that were set, their CRC is {word}", "prepare the test anew"),
    "ORDER": ("its settings contradict each other, the first is {word}", "see the order of settings on its page"),
    "LIMIT": ("what it measures is beyond {word} already", "look at the battery, its wires, and its limits"),
}


def refusal(device: str, command: str, words: str) -> Rejected:
    """Return the fault of an ERROR reply; `words` are the error's name and its word."""
    name, _, word = words.partition(" ")
    meaning, hint = _MEANINGS.get(name, (f"it answers ERROR {words}", _FIRMWARE))
    return Rejected(device, f"it refuses {command}: {meaning.format(word=word)}", hint)
