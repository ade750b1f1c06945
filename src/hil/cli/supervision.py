"""Supervision: a light process waits for the one that runs, so that no abnormal exit passes for a good one."""

from __future__ import annotations

import faulthandler
import os
import signal
import stat
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import NoReturn

from hil.clock import wall

__all__ = ["ONLOOKER", "Invocation", "Word", "supervise"]

ONLOOKER = "HIL_ONLOOKER"
"""Holds the descriptor at which somebody waits for a run's folder, and does not wait for its end."""

_VARIABLE = "HIL_SUPERVISED"
_ASKS = frozenset(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
_SI_KERNEL = 0x80  # the sender was the terminal, which signals the whole group
_PR_SET_PDEATHSIG = 1
_INTERNAL = 3
_UNSAFE = 7
_PIPE = 1 << 16
_AGAIN_S = 0.02
_STAMPS_S = 1.0
_LONGEST_S = 1e6
_STANDARD_ERROR = 2


class Word:
    """What a supervised process reports to its supervisor to prove how it ended.

    Attributes:
        folder: the run's folder, None before there is one.
    """

    def __init__(self, descriptor: int, onlooker: int | None = None) -> None:
        self._descriptor = descriptor
        self._onlooker = onlooker
        self._process = os.getpid()
        self._interrupt = _Interrupt()
        self.folder: Path | None = None

    @classmethod
    def given(cls) -> Word | None:
        """Return the word of this process if a supervisor waits for it, None where none does.

        SIGINT, SIGTERM and SIGHUP are blocked in a supervised process until `listen`, and the death of its
        supervisor is a SIGTERM.
        """
        numbers = _numbers(os.environ.pop(_VARIABLE, ""))
        if len(numbers) != 3 or not _is_pipe(numbers[1]):  # somebody else set it
            return None
        supervisor, descriptor, stamps = numbers
        for each in (descriptor, stamps):
            os.set_inheritable(each, False)
        wall.supervise(stamps)
        _end_with(supervisor)
        return cls(descriptor, _onlooker())

    def listen(self) -> None:
        """Let signals through, as KeyboardInterrupt until the run has handlers of its own."""
        sys.unraisablehook = self._interrupt.lost
        for number in _ASKS:
            if number == signal.SIGINT or signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._interrupt)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _ASKS)

    @contextmanager
    def undisturbed(self) -> Iterator[None]:
        """Ignore requests to end while a run is sealed and verified, also once its own handlers are gone."""
        self._interrupt.heeds = False
        try:
            yield
        finally:
            self._interrupt.heeds = True

    def begun(self, folder: Path) -> None:
        """Report the run's folder."""
        self.folder = folder
        self._tell("begun", 0)
        if self._onlooker is not None:
            with suppress(OSError):  # it may have gone
                os.write(self._onlooker, os.fsencode(folder))
            os.close(self._onlooker)
            self._onlooker = None

    def sealed(self, code: int) -> None:
        """Report that the package is sealed, and the exit code; from here on nothing changes them."""
        self._tell("sealed", code)

    def expect(self, seconds: float | None) -> None:
        """Let this process end, saying where it is, unless it is called again within so many seconds; None ends that.

        Nothing of Python has to run for that: it is the last resort for a case that does not return from a call into C.
        """
        if seconds is None:
            faulthandler.cancel_dump_traceback_later()
        elif os.getpid() == self._process:
            faulthandler.dump_traceback_later(min(seconds, _LONGEST_S), exit=True, file=_STANDARD_ERROR)

    def leave(self, code: int) -> NoReturn:
        """Report that the process ends by itself, and end it, whatever threads and exit handlers are left."""
        self._tell("ended", code)
        os._exit(code)

    def _tell(self, what: str, code: int) -> None:
        if os.getpid() == self._process:
            with suppress(OSError):  # without a supervisor nobody waits for it
                os.write(self._descriptor, f"{what} {code} {os.fsencode(self.folder or '').hex()}\n".encode())


@dataclass(frozen=True, slots=True)
class Invocation:
    """How this process was called.

    Attributes:
        arguments: the command line after `hil`.
        word: what it tells its supervisor, None where nobody waits for it.
        alone: whether this process ends with the command.
    """

    arguments: tuple[str, ...]
    word: Word | None
    alone: bool = False


def supervise(invocation: Invocation, environment: Mapping[str, str]) -> int:
    """Run the command in a process of its own and return its exit code once it gave its word.

    From then on a process that ends with the command ignores requests to end: the code may be that of a sealed package.

    Args:
        invocation: how this process was called.
        environment: the environment of the other one.
    """
    reader, writer = os.pipe()
    stamps = _stamps()
    for descriptor in (writer, stamps):
        os.set_inheritable(descriptor, True)
    awaited = {number for number in _ASKS if signal.getsignal(number) is not signal.SIG_IGN} | {signal.SIGINT}
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {*awaited, signal.SIGCHLD})
    try:
        # -P: modules that happen to lie in the present folder do not take part, as for the `hil` script.
        child = os.posix_spawn(
            sys.executable,
            [sys.executable, "-P", "-m", "hil.cli", *invocation.arguments],
            {**environment, _VARIABLE: f"{os.getpid()} {writer} {stamps}"},
            setsigmask=_ASKS,
            setsigdef=awaited,
        )
        os.close(writer)
        if (onlooker := _onlooker()) is not None:  # only the process that runs reports it
            os.close(onlooker)
        status = _wait(child, {*awaited, signal.SIGCHLD}, stamps)
        code = _believed(status, _heard(reader))
        for number in awaited if invocation.alone else ():
            signal.signal(number, signal.SIG_IGN)
        return code
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        os.close(reader)
        os.close(stamps)


def _stamps() -> int:
    """Return a file without a name in which this process stamps the time, for that which it supervises."""
    stamps = os.memfd_create("hil-stamps") if hasattr(os, "memfd_create") else os.open(os.devnull, os.O_RDWR)
    wall.put_stamp(stamps)
    return stamps


def _onlooker() -> int | None:
    """Return where somebody waits for the run's folder, once; what is started from here on does not have it."""
    numbers = _numbers(os.environ.pop(ONLOOKER, ""))
    if len(numbers) != 1 or not _is_pipe(numbers[0]):
        return None
    os.set_inheritable(numbers[0], False)
    return numbers[0]


def _numbers(variable: str) -> tuple[int, ...]:
    """Return the numbers that a variable of the environment holds; none where somebody else wrote it."""
    words = variable.split()
    return tuple(map(int, words)) if all(word.isascii() and word.isdigit() for word in words) else ()


def _is_pipe(descriptor: int) -> bool:
    try:
        return stat.S_ISFIFO(os.fstat(descriptor).st_mode)
    except (OSError, OverflowError):
        return False


def _wait(child: int, awaited: set[signal.Signals], stamps: int) -> int:
    """Return the child's status; what asks this process to end is passed on, and each second is stamped."""
    while True:
        number, of_terminal = _next_signal(awaited)
        with suppress(OSError):  # a full disk is no reason to end
            wall.put_stamp(stamps)
        if not number:
            continue
        if number == signal.SIGCHLD:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                return status
        elif number != signal.SIGINT or not of_terminal:
            os.kill(child, number)


def _next_signal(awaited: set[signal.Signals]) -> tuple[int, bool]:
    """Return the next signal, 0 if none came for a second, and whether the terminal sent it to the child as well."""
    if not hasattr(signal, "sigtimedwait"):
        number = signal.sigwait(awaited)
        return number, number == signal.SIGINT
    info = signal.sigtimedwait(awaited, _STAMPS_S)
    if info is None:
        return 0, False
    return info.si_signo, info.si_code == _SI_KERNEL


def _heard(reader: int) -> dict[str, tuple[int, str]]:
    """Return the reports by kind; a process that the child left behind may still hold the pipe open."""
    os.set_blocking(reader, False)
    try:
        told = os.read(reader, _PIPE).decode("ascii")
    except BlockingIOError:
        told = ""
    words = (line.split(" ") for line in told.splitlines())
    return {what: (int(code), os.fsdecode(bytes.fromhex(folder))) for what, code, folder in words}


def _believed(status: int, words: Mapping[str, tuple[int, str]]) -> int:
    """Return the exit code that the reports prove; without them the process did not end properly."""
    how = _manner(os.waitstatus_to_exitcode(status))
    if "ended" in words:
        code = words.get("sealed", words["ended"])[0]
        if code == _INTERNAL and "begun" in words and "sealed" not in words:  # it has printed itself what went wrong
            return _died(Path(words["begun"][1]), how, lambda _: None)
        return code
    _begin_line()
    if "sealed" in words:
        code, folder = words["sealed"]
        _say(f"hil: the process {how} after the run was sealed; the package is {folder}")
        return code
    if "begun" in words:
        return _died(Path(words["begun"][1]), how, _say)
    _say(f"hil: the process of the run {how} before the run was sealed")
    _say("     no case had begun and nothing was driven; hil runs shows whether it left a folder")
    return _INTERNAL


def _died(run: Path, how: str, say: Callable[[str], None]) -> int:
    """Print what a person can do next, send the notification of a run that died, and return its exit code."""
    from hil.cli.died import death_of, not_proven, tell_of_death, ways_on  # noqa: PLC0415 - only after an interruption

    say(f"hil: {death_of(run, how)}")
    left = not_proven(run)
    if left:
        _say(f"     NOT PROVEN SAFE: {', '.join(left)}; go to the bench and switch them off by hand")
    ways = list(ways_on(run))
    for line in ways:
        say(f"     {line}")
    tell_of_death(run, how, ways)
    return _UNSAFE if left else _INTERNAL


def _manner(code: int) -> str:
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"was ended by {signal.Signals(-code).name}"
    except ValueError:
        return f"was ended by signal {-code}"


def _begin_line() -> None:
    """Leave the line at the foot of a terminal, which a process that was killed has not taken away."""
    with suppress(OSError, ValueError, AttributeError):  # as below
        if sys.stdout.isatty():
            sys.stdout.write("\n")
            sys.stdout.flush()


def _say(text: str) -> None:
    with suppress(OSError, ValueError, AttributeError):  # there may be no reader left
        sys.stderr.write(f"{text}\n")
        sys.stderr.flush()


def _end_with(supervisor: int) -> None:
    """Let the end of the supervisor be a SIGTERM, also where it has ended already."""
    if sys.platform == "linux":
        import ctypes  # noqa: PLC0415 - only in the process that runs, which imports it anyway

        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != supervisor:
        os.kill(os.getpid(), signal.SIGTERM)


class _Interrupt:
    """Ends what goes on; who asks twice, such as a terminal and the process that waits, does not disturb the ending."""

    def __init__(self) -> None:
        self._asked = False
        self.heeds = True

    def __call__(self, number: int, _frame: FrameType | None) -> None:
        """Be the handler of a signal."""
        if self.heeds and (not self._asked or number == signal.SIGALRM):
            self._asked = True
            raise KeyboardInterrupt

    def lost(self, unraisable: sys.UnraisableHookArgs) -> None:
        """Ask again in a moment where it was raised during a callback of the interpreter, which nothing can leave."""
        if isinstance(unraisable.exc_value, KeyboardInterrupt) and signal.getsignal(signal.SIGINT) == self:
            signal.signal(signal.SIGALRM, self)
            signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
        else:
            sys.__unraisablehook__(unraisable)
