"""Builds the wheel, and writes into it from which commit it was built; everything else is in `pyproject.toml`."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

_HERE = Path(__file__).resolve().parent
_SOURCE = "src/hil"
_BUILT = "built.json"


class BuildWithCommit(build_py):
    """Copies the source, and notes its commit and whether what was copied is what that commit has."""

    def run(self) -> None:
        """Build, and write `hil/built.json` unless the source is only linked to."""
        self.force = True  # a file may be older than the copy that an earlier build left
        super().run()
        if not self.editable_mode:
            copied = Path(self.build_lib) / "hil"
            (copied / _BUILT).unlink(missing_ok=True)
            commit = _git("rev-parse", "HEAD").decode().strip() if _git("ls-files", f"{_SOURCE}/__init__.py") else ""
            facts = {"commit": commit, "changed": bool(commit) and not _is_of(commit, copied)}
            (copied / _BUILT).write_text(json.dumps(facts, sort_keys=True) + "\n", encoding="utf-8")


def _is_of(commit: str, copied: Path) -> bool:
    """Return whether every file that was copied is, byte for byte, that of a commit; an earlier build may be left."""
    files = [path for path in sorted(copied.rglob("*")) if path.is_file() and "__pycache__" not in path.parts]
    return all(
        _git("show", f"{commit}:{_SOURCE}/{path.relative_to(copied).as_posix()}", missing=None) == path.read_bytes()
        for path in files
    )


def _git(*arguments: str, missing: bytes | None = b"") -> bytes | None:
    git = shutil.which("git")
    if git is None:
        return missing
    done = subprocess.run([git, "-C", str(_HERE), *arguments], capture_output=True, check=False)
    return done.stdout if done.returncode == 0 else missing


setup(cmdclass={"build_py": BuildWithCommit})
