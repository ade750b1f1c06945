"""A terminal at which a command runs, and somebody who answers each question once it stands there.

As a program it runs a command of a shell so, prints what the terminal showed, and exits as the command did.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterable

__all__ = ["Terminal"]

_LONGEST_S = 20.0


class Terminal:
    """A pseudo-terminal, and a person at it.

    Args:
        answers: what a question ends with as it is shown, and what is typed then, in the order of the questions.

    Attributes:
        near: the descriptor that a command has as its terminal; it is closed with `sit`.
        shown: what the terminal has shown so far, the answers included.
    """

    def __init__(self, *answers: Iterable[str]) -> None:
        self._keyboard, self.near = os.openpty()
        self._answers = [tuple(each) for each in answers]
        self._seen = 0
        self.shown = ""
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def type(self, text: str) -> None:
        """Type, whether or not anything is asked."""
        os.write(self._keyboard, text.encode())

    def sit(self) -> None:
        """Begin to answer, once the command has the terminal."""
        os.close(self.near)
        self._thread.start()

    def leave(self) -> None:
        """Close the terminal, after everything that had it has ended."""
        self._thread.join(_LONGEST_S)
        os.close(self._keyboard)

    def _serve(self) -> None:
        while data := self._read():
            self.shown += data.decode(errors="replace").replace("\r\n", "\n")
            self._answer()

    def _read(self) -> bytes:
        try:
            return os.read(self._keyboard, 4096)
        except OSError:  # so a terminal says that nobody has it open any more
            return b""

    def _answer(self) -> None:
        while self._answers:
            question, answer = self._answers[0]
            at = self.shown.find(question, self._seen)
            if at < 0:
                return
            self._seen = at + len(question)
            del self._answers[0]
            self.type(f"{answer}\n")


def _main(command: str, answers: str) -> int:
    terminal = Terminal(*json.loads(answers))
    process = subprocess.Popen(
        ["bash", "-c", command],
        stdin=terminal.near,
        stdout=terminal.near,
        stderr=terminal.near,
        env={**os.environ, "TERM": "dumb"},
        start_new_session=True,
    )
    terminal.sit()
    code = process.wait()
    terminal.leave()
    sys.stdout.write(terminal.shown)
    return code


if __name__ == "__main__":
    sys.exit(_main(*sys.argv[1:]))
