"""Where simulated and replayed streams wait to be opened by their URL."""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Generic, NoReturn, Protocol, TypeVar

from hil.model.errors import HilError, Refused

if TYPE_CHECKING:
    from hil.wire.port import I2cBus

__all__ = [
    "Brake",
    "Braked",
    "FarEnd",
    "Handed",
    "Unreachable",
    "find_bus",
    "find_stream",
    "publish_bus",
    "publish_stream",
    "withdraw",
]


class Unreachable:
    """Stands in for an end, so that the other ends can be reached; it has the interface of all of them.

    Args:
        error: why it could not be opened; everything but opening and closing raises it.
    """

    def __init__(self, error: HilError) -> None:
        self._error = error

    def opened(self) -> None:
        """Do nothing."""

    def closed(self) -> None:
        """Do nothing."""

    def __getattr__(self, name: str) -> NoReturn:
        raise self._error


_End = TypeVar("_End")


class Handed(Generic[_End]):
    """The far end of a byte stream or a bus, whichever end answers; it has the interface of both.

    Args:
        end: what answers until `hand_to`.
    """

    def __init__(self, end: _End) -> None:
        self._end = end

    def hand_to(self, end: _End) -> None:
        """Let `end` answer from now on; the host does not notice."""
        self._end = end

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the ends have
        return getattr(self._end, name)


class Brake:
    """Keeps bytes from a bench that is to be driven no more, except those that make it safe."""

    def __init__(self) -> None:
        self._asked: Callable[[], object] = lambda: False
        self._released = 0

    @contextmanager
    def applied(self, asked: Callable[[], object]) -> Iterator[None]:
        """Refuse every operation from the moment when `asked` returns something true, until the context is left.

        Args:
            asked: returns the error that operations end with, or anything else that is true where somebody asked to
                stop.
        """
        before, self._asked = self._asked, asked
        try:
            yield
        finally:
            self._asked = before

    @contextmanager
    def released(self) -> Iterator[None]:
        """Let operations pass: used while outputs are made safe."""
        self._released += 1
        try:
            yield
        finally:
            self._released -= 1

    def check(self) -> None:
        """Be asked before an operation.

        Raises:
            OSError: if there is to be none; InterruptedError where somebody asked to stop.
        """
        if not self._released and (why := self._asked()):
            raise why if isinstance(why, OSError) else InterruptedError(errno.EINTR, "somebody asked to stop")


class Braked(Generic[_End]):
    """The far end of a byte stream that a brake keeps operations from; it has the interface of what it stands before.

    Args:
        end: what answers.
        brake: is asked before bytes are sent or awaited.
    """

    def __init__(self, end: _End, brake: Brake) -> None:
        self._end: Any = end
        self._brake = brake

    def write(self, data: bytes) -> None:
        """Write all bytes, unless there is to be no operation."""
        self._brake.check()
        self._end.write(data)

    def exchange(self, data: bytes, timeout: float) -> bytes:
        """Write all bytes and give what comes, unless there is to be no operation."""
        self._brake.check()
        came: bytes = self._end.exchange(data, timeout)
        return came

    def read(self, size: int, timeout: float) -> bytes:
        """Give what comes, unless there is to be no operation."""
        self._brake.check()
        came: bytes = self._end.read(size, timeout)
        return came

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the end has
        return getattr(self._end, name)


class FarEnd(Protocol):
    """The far end of an open byte stream, as the URL handlers need it."""

    def opened(self) -> None:
        """Note that the host opened the stream."""
        ...

    def closed(self) -> None:
        """Note that the host closed the stream."""
        ...

    def dtr_rose(self) -> None:
        """Note that the host let DTR rise again, while the stream was open."""
        ...

    def write(self, data: bytes) -> None:
        """Take bytes from the host."""
        ...

    def exchange(self, data: bytes, timeout: float) -> bytes:
        """Take bytes from the host, and give what is there once a byte has come, within `timeout` seconds in all."""
        ...

    def read(self, size: int, timeout: float) -> bytes:
        """Give `size` bytes, or what came within `timeout` seconds."""
        ...

    def waiting(self) -> int:
        """Return how many bytes can be read at once."""
        ...

    def discard(self) -> None:
        """Throw received bytes away."""
        ...


_streams: dict[str, FarEnd] = {}
_buses: dict[str, I2cBus] = {}


def publish_stream(url: str, stream: FarEnd) -> None:
    """Let `stream` be found under `url`; two worlds of one name in a process are refused."""
    if url in _streams:
        raise Refused(f"{url} is in use by another bench of this process", "end that run first")
    _streams[url] = stream


def publish_bus(url: str, bus: I2cBus) -> None:
    """Let `bus` be found under `url`; two worlds of one name in a process are refused."""
    if url in _buses:
        raise Refused(f"{url} is in use by another bench of this process", "end that run first")
    _buses[url] = bus


def withdraw(world: str) -> None:
    """Forget every stream and bus whose URL starts with `world`, such as `sim://adcs/`."""
    for url in [url for url in (*_streams, *_buses) if url.startswith(world)]:
        _streams.pop(url, None)
        _buses.pop(url, None)


def find_stream(url: str) -> FarEnd | None:
    """Return the stream of that URL, or None."""
    return _streams.get(url)


def find_bus(url: str) -> I2cBus | None:
    """Return the bus of that URL, or None."""
    return _buses.get(url)
