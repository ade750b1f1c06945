"""`hil status`: say how a run stands."""

from __future__ import annotations

import click

from hil.cli.folders import find_run

__all__ = ["command"]


@click.command(name="status", epilog="Example: hil status 20261121T093100Z")
@click.argument("run", metavar="RUN")
def command(run: str) -> int:
    """Say how a run stands: what it does, how far it is, or how it ended."""
    from hil.evidence.package.listing import shown as printable  # noqa: PLC0415 - heavy
    from hil.evidence.runs import status  # noqa: PLC0415 - heavy
    from hil.report.numbers import bench_time, duration  # noqa: PLC0415 - heavy
    from hil.report.page.happenings import attached, noted  # noqa: PLC0415 - heavy

    found = status(find_run(run))
    lines = {
        "run": found.folder.name,
        "state": str(found.state),
        "plans": ", ".join(found.plans),
        "bench": f"{found.bench} ({found.source})",
        "DUT": found.dut,
        "purpose": found.purpose,
        "cases": f"{found.ended} of {found.planned} ended",
        "case": found.case,
        "step": found.step,
        "bench time": bench_time(found.t),
        "last event": "" if found.age is None else f"{duration(found.age)} ago",
        "verdict": found.verdict,
        "problem": found.problem,
    }
    for label, value in lines.items():
        if value:
            click.echo(f"{label:<11} {printable(value)}")
    told = {"note": noted, "attachment": attached}
    for event in found.added:
        what = told[event["kind"]](event) if event["kind"] in told else str(event["text"])
        click.echo(f"{event['kind']:<11} {bench_time(event['t'])}  {printable(what)}")
    return 0
