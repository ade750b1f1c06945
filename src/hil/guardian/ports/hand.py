"""One hand per port: a thread that does one thing after the other, so that a port that blocks holds up no other."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from threading import Event

from hil.guardian.ports.exchanging import Exchanging, Patience
from hil.guardian.ports.identity import Identity, identity_of, require
from hil.guardian.ports.line import Gone, Interrupted, Line, opened
from hil.model.safing import Exchange, GuardedPort, SafeBytes

__all__ = ["Done", "Hand"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Done:
    """How it went.

    Attributes:
        ok: whether it did.
        detail: what was wrong, empty where nothing was.
        silent: whether the port is gone, or nothing at all was heard from it.
        seconds: how long it took.
    """

    ok: bool
    detail: str = ""
    silent: bool = False
    seconds: float = 0.0


class Hand:
    """Holds one port. What is asked of it is done in order, in a thread of its own.

    Args:
        port: what is known of it.
        descriptor: it, open; the hand closes it.
    """

    def __init__(self, port: GuardedPort, descriptor: int) -> None:
        self.port = port
        self._interrupt = Event()
        self._why_gone = ""
        self._identity: Identity | None = None
        self._in_step: tuple[Exchange, ...] | None = None
        self._talk: Exchanging | None = None
        self._asked: list[Future[Done]] = []
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix=port.device)
        self._thread.submit(bool)  # so that the thread is there before it is needed
        try:
            self._identity = identity_of(descriptor)
            self._talk = Exchanging(Line(descriptor, port.baud, self._interrupt))
        except OSError as error:
            self._why_gone = str(error)

    def drop_everything(self) -> None:
        """Forget what it was asked for, and end what it waits for."""
        for future in self._asked:
            future.cancel()
        self._interrupt.set()
        self._ask(self._go_on)

    def begin(self, code: SafeBytes, patience: Patience, *, anew: bool) -> Future[Done]:
        """Come in step with the far end, of which nothing is known; a port that is gone may be opened `anew`."""
        return self._ask(lambda: self._begin(code, patience, anew=anew))

    def off(self, code: SafeBytes, patience: Patience) -> Future[Done]:
        """Send the commands, all of them whatever the replies are."""
        return self._ask(lambda: self._off(code, patience))

    def prove(self, code: SafeBytes) -> Future[Done]:
        """Ask whether the output is safe."""
        return self._ask(lambda: self._prove(code))

    def _ask(self, job: Callable[[], str]) -> Future[Done]:
        try:
            future = self._thread.submit(self._do, job)
        except RuntimeError as error:  # no thread could be started
            future = Future()
            future.set_result(Done(ok=False, detail=str(error), silent=True))
        self._asked = [each for each in self._asked if not each.done()]
        self._asked.append(future)
        return future

    def _do(self, job: Callable[[], str]) -> Done:
        """Do it; whatever goes wrong in here is this port's matter and nobody else's."""
        began = time.monotonic()
        try:
            wrong = job()
        except Interrupted:
            wrong = "was interrupted"
        except Gone as gone:
            self._lose(str(gone))
            wrong = self._gone()
        except Exception as error:  # noqa: BLE001 - the other outputs must come to their turn
            self._in_step = None
            wrong = f"unexpected: {error!r}"
        silent = self._talk is None or not self._talk.heard_anything
        return Done(ok=not wrong, detail=wrong, silent=silent, seconds=time.monotonic() - began)

    def _go_on(self) -> str:
        self._interrupt.clear()
        return ""

    def _begin(self, code: SafeBytes, patience: Patience, *, anew: bool) -> str:
        self._in_step = None
        if self._talk is None and anew and self.port.url:
            try:
                if self._identity is not None:
                    require(self._identity, self.port.url)
                self._talk = Exchanging(opened(self.port, self._interrupt))
            except (OSError, ValueError) as error:
                self._why_gone = str(error)
        talk = self._there()
        talk.heard_anything = False
        self._come_in_step(talk, code, patience)
        return ""

    def _off(self, code: SafeBytes, patience: Patience) -> str:
        talk = self._there()
        self._come_in_step(talk, code, patience)
        wrong = [what for each in code.off if (what := talk.make(each, patience))]
        if wrong:
            self._in_step = None
        return "; ".join(wrong)

    def _prove(self, code: SafeBytes) -> str:
        talk = self._there()
        self._come_in_step(talk, code, Patience())
        for each in code.proof:
            if wrong := talk.make(each, Patience()):
                self._in_step = None
                return wrong
        return ""

    def _come_in_step(self, talk: Exchanging, code: SafeBytes, patience: Patience) -> None:
        if self._in_step != code.resync:
            talk.resync(code.resync, patience)
            self._in_step = code.resync

    def _there(self) -> Exchanging:
        if self._talk is None:
            raise Gone(self._why_gone)
        return self._talk

    def _lose(self, why: str) -> None:
        self._why_gone, self._in_step = why, None
        if self._talk is not None:
            with suppress(OSError):
                self._talk.line.close()
            self._talk = None

    def _gone(self) -> str:
        return f"its port is gone: {self._why_gone}"
