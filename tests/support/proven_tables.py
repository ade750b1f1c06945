"""Tables of pages whose rows name the tests that prove them."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

from workspaces import ROOT

__all__ = ["proofs_of", "rows_of", "texts_in", "why_none"]

_PROOF = re.compile(r"`(tests/[\w/]+\.py)::(\w+)(?:\[([^\]]+)\])?`")


def rows_of(page: Path, columns: Sequence[str]) -> list[dict[str, str]]:
    """Return every row of every table of a page that has these columns, in order."""
    rows, inside = [], False
    for line in page.read_text(encoding="utf-8").splitlines():
        if not line.startswith("|"):
            inside = False
        elif _cells(line) == [*columns]:
            inside = True
        elif inside and set(line) - set("|-"):
            rows.append(dict(zip(columns, _cells(line), strict=True)))
    return rows


def proofs_of(row: dict[str, str]) -> list[str]:
    """Return what a row names in its column `proven by`."""
    return row["proven by"].split("<br>")


def why_none(proof: str) -> str:
    """Return why a proof is none, empty where it is one: a test that is in its file, with its parameter."""
    found = _PROOF.fullmatch(proof)
    if found is None:
        return f"{proof} names no test"
    path, name, parameter = found.groups()
    if not (ROOT / path).is_file():
        return f"there is no {path}"
    names, texts = _read(path)
    if name not in names:
        return f"{path} has no {name}"
    return f"{path} has no parameter '{parameter}'" if parameter and parameter not in texts else ""


def texts_in(proofs: Sequence[str]) -> Iterator[str]:
    """Give every text in the files of some proofs."""
    for path in sorted({proof.strip("`").partition("::")[0] for proof in proofs}):
        yield from _read(path)[1]


@cache
def _read(path: str) -> tuple[set[str], set[str]]:
    """Return the names of a file's tests, and every text in it, which names of parameters are among."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    names = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    texts = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    return {name for name in names if name.startswith("test_")}, texts


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]
