"""The digest of what judges: nothing between readings and verdicts is left out of it."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import hil
from hil.evidence.results import judging_code
from hil.evidence.results.judging_code import JUDGING, judging_digest

ROOT = Path(hil.__file__).parent
APART = {
    "documents/canonical.py": "writes files",
    "documents/suggest.py": "words of messages",
    "documents/text.py": "words of messages",
    "evidence/__init__.py": "empty",
    "evidence/events/__init__.py": "what is written down",
    "executive/cases/escapes.py": "refuses calls from other processes",
    "executive/cases/facade.py": "which role was read",
    "executive/cases/steps.py": "which step it is",
    "model/bench.py": "what bench files hold; a package has its own",
    "model/errors.py": "messages",
    "requirements/requirement.py": "what catalogues hold; a package has its own",
}
"""What the judging imports and is no part of it, and why."""


def _judging():
    """Give every module that judges."""
    for name in JUDGING:
        place = ROOT / name
        yield from place.rglob("*.py") if place.is_dir() else [place] if place.suffix == ".py" else []


def _imported(module):
    """Give the product's own modules that a module imports, as paths below the product's folder."""
    for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hil."):
            base = Path(*node.module.split(".")[1:])
            for name in (base, *(base / each.name for each in node.names)):
                for file in (name.with_suffix(".py"), name / "__init__.py"):
                    if (ROOT / file).exists():
                        yield file.as_posix()


def test_all_that_judging_imports_is_in_the_digest_or_named_as_apart():
    """A module that comes between readings and verdicts cannot be forgotten."""
    judging = {each.relative_to(ROOT).as_posix() for each in _judging()}
    imported = {each for module in _judging() for each in _imported(module)}
    assert imported - judging == set(APART)


@pytest.mark.parametrize("name", JUDGING)
def test_a_changed_file_gives_another_digest(tmp_path, monkeypatch, name):
    """Any of them, one byte."""
    for each in (*_judging(), ROOT / "requirements/units.txt"):
        place = tmp_path / each.relative_to(ROOT)
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(each.read_bytes())
    monkeypatch.setattr(judging_code, "__file__", str(tmp_path / "evidence/results/judging_code.py"))
    assert judging_digest.__wrapped__() == judging_digest()
    changed = next((tmp_path / name).rglob("*.py")) if (tmp_path / name).is_dir() else tmp_path / name
    changed.write_bytes(changed.read_bytes() + b"\n")
    assert judging_digest.__wrapped__() != judging_digest()
