"""The head of a run: everything it is judged by, fixed before the first step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from hil.executive.case.case_run import PlannedCase
from hil.executive.setup.configuration import Configuration
from hil.executive.setup.freeze import freeze
from hil.executive.setup.software import version

__all__ = ["write_head"]

_OF_REGISTER_ONLY = frozenset({"recognised", "simulated"})


def write_head(
    configuration: Configuration, planned: Sequence[PlannedCase], folder: Path, write: Callable[..., None]
) -> None:
    """Freeze everything into the run's folder and write its first events.

    Args:
        configuration: what the run is made of.
        planned: every case, before anything is deselected.
        folder: the run's folder.
        write: writes an event.
    """
    frozen = freeze(configuration, folder)
    dut = {key: value for key, value in asdict(configuration.dut).items() if key not in _OF_REGISTER_ONLY}
    twin = configuration.bench.simulated
    write(
        "run",
        format=1,
        bench=configuration.bench.name,
        bench_files=frozen.bench,
        source=configuration.request.source.value,
        purpose=configuration.request.purpose.value,
        dut=dut,
        operator=configuration.request.operator,
        plans=[plan.name for plan in configuration.plans],
        seed=str(twin.seed) if twin else "",
        epoch=configuration.epoch,
        catalogue=frozen.catalogue,
        parameters=frozen.parameters,
        sources=frozen.sources,
        calibration=frozen.calibration,
        version=version(),
        deviations=list(configuration.deviations),
        overrides=dict(configuration.request.overrides),
        skips=dict(configuration.request.skips),
        **_live(configuration),
        **({"unattended": True, "on_call": configuration.request.on_call} if configuration.request.unattended else {}),
    )
    write("frozen", files=frozen.files, beside={"files": frozen.beside})
    cases = [
        {
            "case": case.id,
            "title": case.title,
            "plan": case.plan,
            "requirements": list(case.requirements),
            "max_duration": case.max_duration_s,
        }
        for case in planned
    ]
    write("planned", cases=cases)
    if orphans := [case.id for case in planned if not case.requirements]:
        write("orphan", cases=orphans)
    for name in configuration.catalogue.ids:
        requirement = configuration.catalogue.requirement(name)
        if requirement.anomaly:
            write("anomaly", text=f"{requirement.id}, source {requirement.source}: {requirement.anomaly}")


def _live(configuration: Configuration) -> dict[str, object]:
    """Return what is told of a bench outside of the run's process, and nothing of another."""
    reach = configuration.reach
    return {"live": {"speed": reach.speed, "served": reach.served is not None}} if reach else {}
