"""One run, from the request to the sealed package and the words about it."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TextIO

from hil.executive.run.session import Session
from hil.executive.setup.configuration import Request, configure
from hil.plugin.launch import launch
from hil.plugin.opening import open_simulated
from hil.plugin.progress import Progress
from hil.report.summary import closing_lines
from hil.report.write import write_reports

__all__ = ["run"]

_WITHOUT = {2: "interrupted before the first case", 5: "no cases were found in these plans"}
"""Why there is no package, by exit code."""


def run(request: Request, out: TextIO, *, verbose: bool = False) -> int:
    """Run the request's plans, seal the package, tell how it ended, and return the exit code.

    The last line of `out` is the package's path.
    """
    configuration = configure(request)
    listeners = [Progress(out, verbose=verbose)]
    launched = launch(configuration, partial(open_simulated, listeners=listeners, alone=True))
    if launched.session is None:
        out.write(f"{_WITHOUT.get(launched.code, 'nothing was run')}\n")
        return launched.code
    code = launched.session.exit_code(launched.code)
    digest = launched.session.seal(code, write_reports)
    _tell(launched.session, digest, out)
    return code


def _tell(session: Session, digest: str, out: TextIO) -> None:
    from hil.evidence.package.contents import Package  # noqa: PLC0415 - not before the run

    out.write("\n")
    out.writelines(f"{line}\n" for line in closing_lines(Package(session.folder).results()))
    out.write(f"\nevidence digest {digest}\n")
    out.write(f"report  {_shown(session.folder / 'data/report/report.html')}\n")
    out.write(f"{_shown(session.folder)}\n")


def _shown(path: Path) -> str:
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else str(path)
