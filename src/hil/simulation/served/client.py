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


def ask(folder: Path, document: Mapping[str, object], timeout: float = 10.0) -> Mapping[str, object]:
    """Send one document to the bench that is served in a folder, and return its answer.

    Args:
        folder: what `hil simulate` was given with `--folder`.
        document: such as `{"state": "plants.coil"}`; the reference of the command line has them all.
        timeout: how long the answer may take [s].

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
        raise Refused(f"no served bench answers in {folder}: {error}", "start it with hil simulate --folder") from error
    answer: Mapping[str, object] = json.loads(heard)
    if "error" in answer:
        raise Refused(str(answer["error"]), str(answer.get("hint") or "see what it can be asked"))
    return answer
