"""Folder of a served bench, and requests to its control socket from other processes."""

from __future__ import annotations

import fcntl
import json
import os
import socket
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from hil.model.errors import Refused

__all__ = ["CONTROL", "ServedFolder", "ask"]

CONTROL = "control"
"""The name of the socket at which a served bench is asked."""

_LONGEST_SOCKET = 107


class ServedFolder:
    """Holds a folder until it is left, or until the process ends, however that happens.

    What a server that was killed left in it, links and the socket, is in nobody's way.

    Args:
        path: the folder; made if there is none, readable by this user only.
        names: of the links that are to be in it.

    Raises:
        Refused: if another server holds it, it is somebody else's, or something that is not a link is in the way.
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
            raise Refused(f"an instrument is named as the socket, '{CONTROL}'", "rename it in the bench file")
        for name in names:
            place = self.path / name
            if place.exists() and not place.is_symlink():
                raise Refused(f"{place} is in the way: it is no link", "name an empty folder with --folder")
        if self.control.exists() and not self.control.is_socket():
            raise Refused(f"{self.control} is in the way: it is no socket", "name an empty folder with --folder")
        self.control.unlink(missing_ok=True)


_PIECE = 65_536


def ask(
    folder: Path, document: Mapping[str, object], timeout: float = 10.0, *, bench: str = "BENCH"
) -> Mapping[str, object]:
    """Send one document to the bench that is served in a folder, and return its answer.

    Args:
        folder: what `hil simulate` was given with `--folder`.
        document: such as `{"state": "plants.coil"}`; the reference of the command line has them all.
        timeout: how long the answer may take [s].
        bench: its name, for the advice to a person.

    Raises:
        Refused: if no bench is served there, it does not answer in time, or it refuses.
    """
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
            connection.settimeout(timeout)
            connection.connect(str(folder / CONTROL))
            connection.sendall(json.dumps(document).encode() + b"\n")
            heard = b""
            while not heard.endswith(b"\n"):
                piece = connection.recv(_PIECE)
                if not piece:
                    raise ConnectionResetError("it hung up")
                heard += piece
    except OSError as error:
        raise Refused(
            f"no served bench answers in {folder}: {_why(folder, error)}",
            f"start it again with: hil simulate {bench} --folder {folder}; hil status shows how far a run on it got",
        ) from error
    answer: Mapping[str, object] = json.loads(heard)
    if "error" in answer:
        raise Refused(str(answer["error"]), str(answer.get("hint") or "see what it can be asked"))
    return answer


def _why(folder: Path, error: OSError) -> str:
    """Return what is the matter; a server that ends takes its socket along, and the folder that it made."""
    match error:
        case FileNotFoundError() if not folder.exists():
            return "the folder does not exist; its server has ended, or you meant another folder"
        case FileNotFoundError():
            return "its server has ended, or has not begun"
        case ConnectionRefusedError():
            return "its server was killed"
        case ConnectionResetError() | BrokenPipeError():
            return "its server has ended in the meantime"
        case TimeoutError():
            return "its server does not answer in time"
        case _:
            return error.strerror or str(error)
