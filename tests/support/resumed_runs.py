"""Runs that are killed, and what has to be equal to a run that nobody disturbed."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from told_as_json import bodies, results_as_json
from workspaces import Workspace, kill

from hil.evidence.package.contents import Package

__all__ = ["findings_of", "killed", "without_git"]

_Workspace = TypeVar("_Workspace", bound=Workspace)


def without_git(workspace: _Workspace) -> _Workspace:
    """Return a workspace whose runs do not look at the product's own commits, which may be made while a test runs."""
    return replace(workspace, environment={**workspace.environment, "PATH": str(Path(workspace.root, "nothing"))})


def killed(process: subprocess.Popen[str], after: float) -> bool:
    """Kill a command after some seconds; return whether it had not ended before."""
    try:
        process.wait(after)
    except subprocess.TimeoutExpired:
        kill(process)
    process.communicate()
    return process.returncode < 0


def findings_of(package: Package) -> dict[str, object]:
    """Return every recording's hash and all results, but for the journal's line numbers and what follows from them."""
    rows = {event["recording"]: (event["rows"], event["sha256"]) for event in bodies(package, "recording-end")}
    results = json.loads(json.dumps(results_as_json(package)))
    del results["content_digest"]
    for case in results["cases"]:
        for check in case["checks"]:
            del check["seq"]
    return {"recordings": rows, "results": results}
