"""The folder of a served bench: where clients find its ends, held by one server at a time."""

from __future__ import annotations

import fcntl
import os
from contextlib import suppress
from pathlib import Path

from hil.model.errors import Refused

__all__ = ["CONTROL", "ServedFolder"]

CONTROL = "control"
"""The name of the socket at which a served bench is asked."""

_LONGEST_SOCKET = 107


class ServedFolder:
    """Holds a folder until it is left, or until the process ends, however that happens.

    What a server that was killed left in it, links and the socket, is in nobody's way.

    Args:
        path: the folder; made where there is none, readable by this user only.
        names: of the links that are to be in it.

    Raises:
        Refused: if another server holds it, it is somebody else's, or something that is no link is in the way.
    """

    def __init__(self, path: Path, names: tuple[str, ...]) -> None:
        self.path = path.absolute()
        self._made = not self.path.exists()
        try:
            self.path.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._descriptor = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
        except OSError as error:
            raise Refused(f"{self.path} cannot be used: {error.strerror}", "name another with --folder") from error
        try:
            self._claim(names)
        except Refused:
            os.close(self._descriptor)
            raise

    @property
    def control(self) -> Path:
        """Where the socket is."""
        return self.path / CONTROL

    def leave(self) -> None:
        """Remove the folder if it was made for this and is empty, and let go of it."""
        self.control.unlink(missing_ok=True)
        if self._made:
            with suppress(OSError):
                self.path.rmdir()
        os.close(self._descriptor)

    def _claim(self, names: tuple[str, ...]) -> None:
        if os.fstat(self._descriptor).st_uid != os.geteuid():
            raise Refused(f"{self.path} belongs to another user", "name a folder of yours with --folder")
        if len(os.fsencode(self.control)) > _LONGEST_SOCKET:
            raise Refused(f"{self.path} is too long a name for a socket in it", "name a shorter one with --folder")
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise Refused(
                f"another server serves a bench in {self.path}", "end it, or name another folder with --folder"
            ) from None
        if CONTROL in names:
            raise Refused(f"an instrument is named as the socket, '{CONTROL}'", "name it otherwise in the bench file")
        for name in names:
            place = self.path / name
            if place.exists() and not place.is_symlink():
                raise Refused(f"{place} is in the way: it is no link", "name an empty folder with --folder")
        if self.control.exists() and not self.control.is_socket():
            raise Refused(f"{self.control} is in the way: it is no socket", "name an empty folder with --folder")
        self.control.unlink(missing_ok=True)
