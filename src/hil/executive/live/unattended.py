"""Runs that nobody attends: what a bench has to have for them, and how the person on call is reached at arm."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from hil.bench.cut_paths import cut_path_shortfall
from hil.clock import wall
from hil.executive.setup.configuration import Configuration
from hil.model.errors import Refused

__all__ = ["OnCall", "require_unattended"]

_LEAST_PATHS = 2
_LOOK_S = 0.1
_CODE_LETTERS = "ABCDEFGHJKLMNPQRSTUVWXYZ23456789"
"""None that a person takes for another one on a small display."""

_CODE_LENGTH = 6

Became = Callable[[], str | None]
"""Tells what became of a notification: None while it is under way, empty once it went out, else what kept it."""


def require_unattended(configuration: Configuration) -> None:
    """Require of a run that nobody attends all that stands in for a person; any other run passes.

    Raises:
        Refused: with everything that is missing.
    """
    request, spec = configuration.request, configuration.bench
    if not request.unattended:
        if request.on_call:
            raise Refused("--on-call names somebody for a run that is attended", "give --unattended, too")
        return
    if configuration.reach is None:
        raise Refused(
            "a bench that lives in this process needs nobody's attention", "leave --unattended out, or use --detach"
        )
    missing = list(_missing(configuration))
    if missing:
        told = "; ".join(missing)
        raise Refused(f"nobody attends this run of bench '{spec.name}', and that takes more: {told}", "or stay with it")


def _missing(configuration: Configuration) -> Iterator[str]:
    spec = configuration.bench
    if not configuration.request.on_call.strip():
        yield "name who is on call with --on-call NAME"
    if not configuration.workspace.notify:
        yield "name a command that notifies people, notify = [...] in hil.toml"
    if not any(path.hardware for path in spec.cut_paths):
        yield "the bench file names no cut path that is hardware, such as the heartbeat of a battery tester"
    yield from cut_path_shortfall(spec, _LEAST_PATHS)


class OnCall:
    """Whoever is on call for a run: sent a code when the bench is armed, and reached once somebody gives it back.

    It listens to the run's events, and compares the codes that come through its inbox.

    Args:
        name: who is on call.
        run: the run's name, for the command that the person types.
        within_s: how long an answer may take in wall time [s].
        notify: sends a notification, given its event and text; returns what tells what became of it.
        write: writes an event.
    """

    def __init__(
        self,
        name: str,
        run: str,
        within_s: float,
        notify: Callable[[str, str], Became],
        write: Callable[..., None],
    ) -> None:
        self.name = name
        self._run = run
        self._within_s = within_s
        self._notify = notify
        self._write = write
        self._code = ""
        self._by = ""

    def __call__(self, event: Mapping[str, Any]) -> None:
        """Take one event of the run."""
        if event["kind"] == "reached" and event["ok"]:
            self._by = str(event["by"])

    def knows(self, code: str) -> bool:
        """Return whether this is the code that was sent last, and nobody has given it back so far."""
        given = code.strip().upper().encode(errors="surrogatepass")  # of texts, only such in ASCII can be compared
        return bool(self._code) and not self._by and secrets.compare_digest(given, self._code.encode())

    def reach(self, idle: Callable[[], bool]) -> str:
        """Send a code and wait until somebody gives it back; return why nobody was reached, empty if somebody was.

        Args:
            idle: looks after the run while it waits; returns whether it may go on waiting.
        """
        self._by = ""
        self._code = "".join(secrets.choice(_CODE_LETTERS) for _ in range(_CODE_LENGTH))
        became = self._notify(
            "test", f"{self.name} is on call. Type: hil ack {self._run} --code {self._code} --by NAME"
        )
        wait = f"{self._within_s / 60:g} min"
        self._write("called", name=self.name, text=f"{self.name} was sent a code, and has {wait} to give it back")
        until = wall.monotonic() + self._within_s
        try:
            while not self._by:
                if not idle():
                    return "the run is to end"
                if problem := became():
                    return f"the notification was not sent: {problem}"
                if wall.monotonic() >= until:
                    return f"nobody gave the code of the notification back within {self._within_s:g} s"
                wall.pause(_LOOK_S)
            return ""
        finally:
            self._code = ""
