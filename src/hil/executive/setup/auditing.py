"""Auditing of what a workspace's code opens, writes and executes, by the interpreter's audit events."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from errno import ENOENT
from pathlib import Path
from types import CodeType, FrameType, FunctionType

from hil.executive.setup.ground import COMPILED, PRODUCT, Ground
from hil.executive.setup.inputs import CodeFromOutside, Inputs

__all__ = ["Recoded", "begin", "executed", "recoded", "watched"]

Recoded = tuple[FunctionType, tuple[object, object]]
"""A function, and its code and defaults before they were changed."""

_RECODES = frozenset({"object.__delattr__", "object.__setattr__"})
_WATCHED = ("open", "exec", "os.remove", "os.truncate", "os.rename", "os.link", "os.symlink")
_HEARD = _RECODES.union(_WATCHED, ["import"])
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


class _Watch:
    """Handles the audit events of one run.

    Args:
        inputs: is notified of what the workspace's code does with files.
        ground: the workspace, and what in it is not an input of a run.
    """

    def __init__(self, inputs: Inputs, ground: Ground) -> None:
        self._inputs = inputs
        self._ground = ground
        self._process = os.getpid()
        looks: tuple[Callable[..., None], ...] = (
            self._open,
            self._exec,
            lambda path, *_: self._write(path),
            lambda path, *_: self._write(path),
            lambda source, target, *_: self._write(source, target),
            lambda _source, target, *_: self._write(target),
            lambda _source, target, *_: self._write(target),
        )
        self._events = dict(zip(_WATCHED, looks, strict=True))

    def take(self, event: str, args: tuple[object, ...]) -> None:
        """Take an audit event."""
        look = self._events.get(event)
        if look is not None and os.getpid() == self._process:
            look(*args)

    def _open(self, path: object, _mode: object, flags: object) -> None:
        place = self._ground.place(path)
        if not place or not self._is_asked():
            return
        if COMPILED in place:  # as if missing: what it was compiled from is unknown
            raise FileNotFoundError(ENOENT, os.strerror(ENOENT), place)
        if isinstance(flags, int) and flags & _WRITES:
            self._inputs.written(Path(place))
        elif os.path.isfile(place):  # noqa: PTH113 - on every open in the workspace
            self._inputs.opened(Path(place))

    def _write(self, *paths: object) -> None:
        for path in paths:
            place = self._ground.place(path)
            if place and self._is_asked():
                self._inputs.written(Path(place))

    def _exec(self, code: object) -> None:
        """Refuse code of a file that is neither part of the package nor named by its version in `software.json`."""
        file = code.co_filename if isinstance(code, CodeType) else ""
        if not file.startswith(os.sep) or self._ground.knows(file):
            return
        if os.path.exists(file) and self._is_asked():  # noqa: PTH110 - on every exec
            named = "/".join(Path(file).parts[-2:])  # the rest is about this machine
            raise CodeFromOutside(
                f"{named} is neither in the workspace nor installed, so no package would hold it",
                "move it into the workspace, or install it",
            )

    def _is_asked(self) -> bool:
        """Return whether the caller is code of the workspace, and not the executive, or pytest for itself."""
        frame: FrameType | None = sys._getframe(1)  # noqa: SLF001 - there is no other way to the caller
        while frame is not None:
            file = frame.f_code.co_filename
            if file.startswith(PRODUCT) and file != __file__:
                return False
            if self._ground.is_own(file):
                return True
            frame = frame.f_back
        return threading.current_thread() is not threading.main_thread()


_watches: list[_Watch] = []
_hooked: list[bool] = []


_recoded: list[Recoded] = []
_executed: list[CodeType | str] = []


def _hook(event: str, args: tuple[object, ...]) -> None:
    if event not in _HEARD:  # like most of some hundred thousand
        return
    if event in _RECODES and isinstance(function := args[0], FunctionType):
        _recoded.append((function, (function.__code__, function.__defaults__)))
    elif event == "exec" and isinstance(code := args[0], CodeType):
        if code.co_name == "<module>" and code.co_filename.startswith(os.sep):
            _executed.append(code)
    elif event == "import" and isinstance(args[1], str):  # a compiled library; any other module is executed
        _executed.append(args[1])
    if _watches:
        _watches[-1].take(event, args)


def begin() -> int:
    """Listen to this process's audit events from now on; return how many functions were given other code before."""
    if not _hooked:  # a hook cannot be removed
        sys.addaudithook(_hook)
        _hooked.append(True)
    return len(_recoded)


def recoded(since: int) -> Sequence[Recoded]:
    """Return the functions that were given other code or defaults after the first `since` of them.

    Examining the code of every function would be slow: each access is an audit event of its own.
    """
    return _recoded[since:]


def executed(since: int) -> Sequence[CodeType | str]:
    """Return the code of all executed modules, and all compiled libraries, after the first `since` of them."""
    return _executed[since:]


@contextmanager
def watched(inputs: Inputs, ground: Ground) -> Iterator[None]:
    """Notify `inputs` of what the workspace's code opens, until the context is left.

    Args:
        inputs: is notified.
        ground: the workspace, and what in it is not an input of a run.
    """
    begin()
    watch = _Watch(inputs, ground)
    _watches.append(watch)
    try:
        yield
    finally:
        _watches.remove(watch)
