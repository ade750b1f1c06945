"""Asks a served bench what is true, and tells it what goes wrong."""

from __future__ import annotations

import json
import socket
from collections.abc import Mapping
from pathlib import Path

from hil.model.errors import Refused
from hil.simulation.served.folder import CONTROL

__all__ = ["ask"]

_PIECE = 65_536


def ask(
    folder: Path, document: Mapping[str, object], timeout: float = 10.0, *, bench: str = "BENCH"
) -> Mapping[str, object]:
    """Send one document to the bench that is served in a folder, and return its answer.

    Args:
        folder: what `hil simulate` was given with `--folder`.
        document: such as `{"state": "plants.coil"}`; the reference of the command line has them all.
        timeout: how long the answer may take [s].
        bench: its name, for what a person is told to do.

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
            f"start it again with: hil simulate {bench} --folder {folder}; hil status tells how far a run on it came",
        ) from error
    answer: Mapping[str, object] = json.loads(heard)
    if "error" in answer:
        raise Refused(str(answer["error"]), str(answer.get("hint") or "see what it can be asked"))
    return answer


def _why(folder: Path, error: OSError) -> str:
    """Return what is the matter; a server that ends takes its socket along, and the folder that it made."""
    match error:
        case FileNotFoundError() if not folder.exists():
            return "the folder is not there; its server has ended, or another folder was meant"
        case FileNotFoundError():
            return "its server has ended, or has not begun"
        case ConnectionRefusedError():
            return "its server was killed"
        case ConnectionResetError() | BrokenPipeError():
            return "its server has ended meanwhile"
        case TimeoutError():
            return "its server does not answer in time"
        case _:
            return error.strerror or str(error)
