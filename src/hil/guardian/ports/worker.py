"""Port workers: one thread per port that does one job at a time, so that a blocked port delays no other."""

from __future__ import annotations

import errno
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from threading import Event

from hil.guardian.ports.dialogue import Dialogue, Patience
from hil.guardian.ports.identity import Identity, found, identity_of, require_not_reused
from hil.guardian.ports.line import Gone, Interrupted
from hil.guardian.ports.opening import let_others_open, line_on, opened
from hil.model.safing import Exchange, GuardedPort, SafeBytes

__all__ = ["Outcome", "PortWorker"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Result of a job.

    Attributes:
        ok: whether it succeeded.
        detail: what was wrong, empty if nothing was.
        silent: whether the port is gone, or nothing at all was heard from it.
        seconds: how long it took.
    """

    ok: bool
    detail: str = ""
    silent: bool = False
    seconds: float = 0.0


class PortWorker:
    """Owns one port and does its jobs in order, in its own thread.

    Args:
        port: its description.
        descriptor: the open port; the worker closes it.
    """

    def __init__(self, port: GuardedPort, descriptor: int) -> None:
        self.port = port
        self._interrupt = Event()
        self._why_gone = ""
        self._identity: Identity | None = None
        self._who = b""
        self._talk: Dialogue | None = None
        self._asked: list[Future[Outcome]] = []
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix=port.device)
        self._thread.submit(bool)  # start the thread before it is needed
        try:
            is_device = port.apart and port.url.startswith("/")
            self._identity = identity_of(port.url if is_device else descriptor)
            self._talk = Dialogue(line_on(descriptor, port, self._interrupt))
        except OSError as error:
            self._why_gone = str(error)

    def drop_everything(self) -> None:
        """Cancel all jobs, and end the present wait."""
        for future in self._asked:
            future.cancel()
        self._interrupt.set()
        self._ask(self._go_on)

    def begin(self, code: SafeBytes, patience: Patience, *, reopen: bool) -> Future[Outcome]:
        """Resynchronise with the instrument, whose state is unknown; `reopen` opens a port that is gone."""
        return self._ask(lambda: self._begin(code, patience, reopen=reopen))

    def off(self, code: SafeBytes, patience: Patience) -> Future[Outcome]:
        """Send all commands, whatever the replies are."""
        return self._ask(lambda: self._open_dialogue().off(code, patience))

    def prove(self, code: SafeBytes) -> Future[Outcome]:
        """Query whether the output is safe."""
        return self._ask(lambda: self._open_dialogue().prove(code))

    def settle(self, code: SafeBytes) -> Future[Outcome]:
        """Wait until no reply can still be on its way, and discard what came."""
        return self._ask(lambda: self._open_dialogue().settle(code))

    def close(self) -> None:
        """End the present wait and the thread, and close the descriptor."""
        self._interrupt.set()
        self._thread.shutdown(cancel_futures=True)
        if self._talk is not None:
            self._talk.line.close()
            self._talk = None

    def recognise(self, code: SafeBytes) -> Future[Outcome]:
        """Keep the instrument's identity, once it is proven safe, so that no other one is taken for it."""
        return self._ask(lambda: self._recognise(code))

    def _recognise(self, code: SafeBytes) -> str:
        if code.who is not None and not self._who:
            self._who = self._open_dialogue().told(code.who)
        return ""

    def _ask(self, job: Callable[[], str]) -> Future[Outcome]:
        try:
            future = self._thread.submit(self._do, job)
        except RuntimeError as error:  # no thread could be started
            future = Future()
            future.set_result(Outcome(ok=False, detail=str(error), silent=True))
        self._asked = [each for each in self._asked if not each.done()]
        self._asked.append(future)
        return future

    def _do(self, job: Callable[[], str]) -> Outcome:
        """Do a job; a failure in it affects this port only."""
        began = time.monotonic()
        try:
            wrong = job()
        except Interrupted:
            wrong = "was interrupted"
        except Gone as gone:
            self._lose(str(gone))
            wrong = self._gone()
        except Exception as error:  # noqa: BLE001 - the other outputs must get their turn
            wrong = f"unexpected: {error!r}"
        silent = self._talk is None or not self._talk.heard_anything
        return Outcome(ok=not wrong, detail=wrong, silent=silent, seconds=time.monotonic() - began)

    def _go_on(self) -> str:
        self._interrupt.clear()
        return ""

    def _begin(self, code: SafeBytes, patience: Patience, *, reopen: bool) -> str:
        if self._talk is None and reopen and self.port.url:
            try:
                self._talk = self._reopened(code)
            except (OSError, ValueError) as error:
                self._why_gone = str(error)
        self._open_dialogue().begin(code, patience)
        return ""

    def _reopened(self, code: SafeBytes) -> Dialogue:
        """Reopen the port, if the instrument that it led to is still there.

        Raises:
            OSError, ValueError, Gone: if that fails, or another one is there, which is sent only the identity query.
        """
        port = self.port
        if self._identity is not None and "://" not in port.url:
            port = replace(port, url=found(self._identity, port.url))
        elif "://" not in port.url:
            require_not_reused(port.url)
        talk = Dialogue(opened(port, self._interrupt))
        try:
            if self._who and code.who is not None and "://" in port.url:
                self._require_known(talk, code.who)
        except BaseException:
            talk.line.close()
            raise
        return talk

    def _require_known(self, talk: Dialogue, who: Exchange) -> None:
        said = talk.told(who) or talk.told(who)  # a fragment of a line may garble the first one
        if said != self._who:
            raise OSError(errno.ENODEV, f"{_stranger(said)} at {self.port.url}, which was {_shown(self._who)}")

    def _open_dialogue(self) -> Dialogue:
        if self._talk is None:
            raise Gone(self._why_gone)
        return self._talk

    def _lose(self, why: str) -> None:
        self._why_gone = why
        if self._talk is not None:
            with suppress(OSError):
                let_others_open(self._talk.line.descriptor)
                self._talk.line.close()
            self._talk = None

    def _gone(self) -> str:
        return f"its port is gone: {self._why_gone}"


def _stranger(said: bytes) -> str:
    return f"another instrument answers, {_shown(said)}," if said else "nobody says who it is"


def _shown(said: bytes) -> str:
    return repr(said.strip().decode("ascii", "replace"))
