"""Registry of simulated and replayed streams and buses by URL, and wrappers around their far ends."""

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
    """Placeholder for a far end that could not be opened, so that the others stay reachable.

    Args:
        error: why it could not be opened; raised by everything but opening and closing.
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
    """Switchable far end of a byte stream or bus: delegates to the end that currently answers.

    Args:
        end: the end that answers until `hand_to`.
    """

    def __init__(self, end: _End) -> None:
        self._end = end

    def hand_to(self, end: _End) -> None:
        """Switch to `end`, transparently for the host."""
        self._end = end

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the ends have
        return getattr(self._end, name)


class Brake:
    """Blocks bytes to a bench that must no longer be driven, except those that make it safe."""

    def __init__(self) -> None:
        self._asked: Callable[[], object] = lambda: False
        self._released = 0

    @contextmanager
    def applied(self, asked: Callable[[], object]) -> Iterator[None]:
        """Refuse every operation once `asked` returns a true value, until the context is left.

        Args:
            asked: returns the error for operations to raise, or any other true value where a stop was
                requested.
        """
        before, self._asked = self._asked, asked
        try:
            yield
        finally:
            self._asked = before

    @contextmanager
    def released(self) -> Iterator[None]:
        """Permit operations, for making outputs safe."""
        self._released += 1
        try:
            yield
        finally:
            self._released -= 1

    def check(self) -> None:
        """Check that operations are permitted; called before each one.

        Raises:
            OSError: if operations are blocked; InterruptedError where a stop was requested.
        """
        if not self._released and (why := self._asked()):
            raise why if isinstance(why, OSError) else InterruptedError(errno.EINTR, "somebody asked to stop")


class Braked(Generic[_End]):
    """Far end of a byte stream behind a brake; it has the interface of the wrapped end.

    Args:
        end: the wrapped end.
        brake: checked before bytes are sent or awaited.
    """

    def __init__(self, end: _End, brake: Brake) -> None:
        self._end: Any = end
        self._brake = brake

    def write(self, data: bytes) -> None:
        """Write all bytes, unless operations are blocked."""
        self._brake.check()
        self._end.write(data)

    def exchange(self, data: bytes, timeout: float) -> bytes:
        """Write all bytes and return the reply, unless operations are blocked."""
        self._brake.check()
        came: bytes = self._end.exchange(data, timeout)
        return came

    def read(self, size: int, timeout: float) -> bytes:
        """Return the bytes received, unless operations are blocked."""
        self._brake.check()
        came: bytes = self._end.read(size, timeout)
        return came

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the end has
        return getattr(self._end, name)


class FarEnd(Protocol):
    """Interface of the far end of an open byte stream, as the URL handlers need it."""

    def opened(self) -> None:
        """Note that the host opened the stream."""
        ...

    def closed(self) -> None:
        """Note that the host closed the stream."""
        ...

    def dtr_rose(self) -> None:
        """Note a rising edge of DTR while the stream is open."""
        ...

    def write(self, data: bytes) -> None:
        """Take bytes from the host."""
        ...

    def exchange(self, data: bytes, timeout: float) -> bytes:
        """Take bytes from the host, and return what has arrived once the first byte came, within `timeout` seconds."""
        ...

    def read(self, size: int, timeout: float) -> bytes:
        """Return `size` bytes, or fewer after `timeout` seconds."""
        ...

    def waiting(self) -> int:
        """Return the number of bytes that can be read without waiting."""
        ...

    def discard(self) -> None:
        """Discard received bytes."""
        ...


_streams: dict[str, FarEnd] = {}
_buses: dict[str, I2cBus] = {}


def publish_stream(url: str, stream: FarEnd) -> None:
    """Register `stream` under `url`; a second world of the same name in a process is refused."""
    if url in _streams:
        raise Refused(f"{url} is in use by another bench of this process", "end that run first")
    _streams[url] = stream


def publish_bus(url: str, bus: I2cBus) -> None:
    """Register `bus` under `url`; a second world of the same name in a process is refused."""
    if url in _buses:
        raise Refused(f"{url} is in use by another bench of this process", "end that run first")
    _buses[url] = bus


def withdraw(world: str) -> None:
    """Unregister every stream and bus whose URL starts with `world`, such as `sim://adcs/`."""
    for url in [url for url in (*_streams, *_buses) if url.startswith(world)]:
        _streams.pop(url, None)
        _buses.pop(url, None)


def find_stream(url: str) -> FarEnd | None:
    """Return the stream of that URL, or None."""
    return _streams.get(url)


def find_bus(url: str) -> I2cBus | None:
    """Return the bus of that URL, or None."""
    return _buses.get(url)
