"""The page on paper: printed to a PDF by the browser of the machine, which is what the page was designed with."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from hil.model.errors import Refused

__all__ = ["BROWSERS", "print_page"]

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "microsoft-edge", "brave-browser")
"""Browsers that print headless, in the order in which they are searched for on the PATH."""

_LONGEST_S = 120.0
_OPTIONS = ("--headless=new", "--disable-gpu", "--disable-extensions", "--no-first-run", "--no-pdf-header-footer")


def print_page(page: bytes, to: Path) -> None:
    """Print a page to a PDF; a file of that name is replaced.

    Args:
        page: the HTML page; it reaches for nothing outside itself.
        to: the PDF.

    Raises:
        Refused: where no browser is found, it does not print, or the file cannot be written.
    """
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise Refused(
            "no browser found that prints headless: the PDF needs Chromium, Chrome, Edge or Brave",
            "install one (Debian: apt install chromium), or open report.html in any browser and print it",
        )
    with tempfile.TemporaryDirectory(prefix="hil-print-") as place:
        source, printed = Path(place) / "report.html", Path(place) / "report.pdf"
        source.write_bytes(page)
        told = _run(browser, source, printed, Path(place) / "profile")
        if not printed.is_file() or not printed.read_bytes().startswith(b"%PDF"):
            raise Refused(f"{browser} printed nothing: {told}", "open report.html in a browser and print it")
        try:
            shutil.copyfile(printed, to)
        except OSError as error:
            raise Refused(f"{to}: cannot be written: {error.strerror}", "choose another file") from error


def _run(browser: str, source: Path, printed: Path, profile: Path) -> str:
    """Let a browser print, and return its last message."""
    # Chromium's sandbox refuses to start as root; the page has no script, and may load nothing.
    root = ["--no-sandbox"] if os.geteuid() == 0 else []
    command = [browser, *_OPTIONS, *root, f"--user-data-dir={profile}", f"--print-to-pdf={printed}", source.as_uri()]
    try:
        done = subprocess.run(  # noqa: S603 - a browser on the path, with a page of ours
            command, capture_output=True, timeout=_LONGEST_S, check=False, stdin=subprocess.DEVNULL
        )
    except subprocess.TimeoutExpired:
        return f"it took longer than {_LONGEST_S:g} s"
    except OSError as error:
        return str(error.strerror)
    lines = done.stderr.decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else f"exit code {done.returncode}"
