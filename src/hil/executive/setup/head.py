"""Head of a run: everything by which it is judged, frozen before the first step."""

from __future__ import annotations

import getpass
import hashlib
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from hil.clock import wall
from hil.documents.canonical import canonical
from hil.evidence import events
from hil.evidence.events import EventSink
from hil.evidence.folder import REGISTERS, TRANSCRIPT
from hil.evidence.package.bag import inventory
from hil.evidence.package.listing import shown
from hil.evidence.results.facts import (
    FrozenCalibration,
    entries_of,
    freeze_calibration,
    freeze_catalogue,
    frozen_calibration,
)
from hil.executive.setup.configuration import Configuration
from hil.executive.setup.other_code import other_packages
from hil.executive.setup.software import software_identity, version
from hil.model.bench import InstrumentSpec
from hil.model.errors import EvidenceError
from hil.registers.instruments import INSTRUMENTS

__all__ = ["DESELECTED", "ENDED_BEFORE", "LEFT_OUT", "Frozen", "PlannedCase", "freeze", "write_head"]

DESELECTED = "deselected"
"""Reason for a case that plain pytest was not asked to run."""

LEFT_OUT = "left out by --only"
"""Reason for a case that is not among the only ones."""

ENDED_BEFORE = "the run ended before this case"
"""Reason for a case that pytest did not reach."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedCase:
    """One case as collected.

    Attributes:
        id: the pytest node id, relative to the workspace.
        title: the first line of its docstring.
        plan: its plan's name.
        requirements: the ids in its marker.
        max_duration_s: bench time that it may take.
        repeatable: why an attempt that ended without a verdict may be repeated, empty if it counts.
        fixtures: the names of all fixtures that it needs, roles among them.
        item: what pytest collected, for checks of its code.
    """

    id: str
    title: str
    plan: str
    requirements: tuple[str, ...]
    max_duration_s: float
    repeatable: str = ""
    fixtures: frozenset[str] = frozenset()
    item: object = field(default=None, repr=False, compare=False)


def write_head(configuration: Configuration, planned: Sequence[PlannedCase], folder: Path, journal: EventSink) -> None:
    """Freeze everything into the run's folder and write its first events.

    Args:
        configuration: what the run is made of.
        planned: every case, before anything is deselected.
        folder: the run's folder.
        journal: where events are written.
    """
    frozen = freeze(configuration, folder)
    journal.write(_run(configuration, frozen))
    journal.write(events.Frozen(files=frozen.files), beside={"files": frozen.beside})
    cases = tuple(
        events.PlannedCase(
            case=case.id,
            title=case.title,
            plan=case.plan,
            requirements=case.requirements,
            max_duration=case.max_duration_s,
            repeatable=case.repeatable,
        )
        for case in planned
    )
    journal.write(events.Planned(cases=cases))
    if orphans := tuple(case.id for case in planned if not case.requirements):
        journal.write(events.Orphan(cases=orphans))
    for name in configuration.catalogue.ids:
        requirement = configuration.catalogue.requirement(name)
        if requirement.anomaly:
            text = f"{requirement.id}, source {requirement.source}: {requirement.anomaly}"
            journal.write(events.Anomaly(text=text))
    for text in configuration.inputs.sleeps:
        journal.write(events.Anomaly(text=text))


def _run(configuration: Configuration, frozen: Frozen) -> events.Run:
    """Return the request for the run."""
    dut, twin, request = configuration.dut, configuration.bench.simulated, configuration.request
    return events.Run(
        format=1,
        bench=configuration.bench.name,
        bench_files=frozen.bench,
        source=request.source,
        purpose=request.purpose,
        dut=events.DutFacts(
            serial=dut.serial,
            part=dut.part,
            model=dut.model,
            hardware=dut.hardware,
            firmware=dut.firmware,
            title=dut.title,
        ),
        operator=request.operator,
        plans=tuple(plan.name for plan in configuration.plans),
        seed=str(twin.seed) if twin else "",
        epoch=configuration.epoch,
        catalogue=frozen.catalogue,
        parameters=frozen.parameters,
        sources=frozen.sources,
        calibration=frozen.calibration,
        version=version(),
        deviations=tuple(configuration.deviations),
        overrides=dict(request.overrides),
        skips=dict(request.skips),
        only=request.only,
        live=_live(configuration),
        unattended=request.unattended,
        on_call=request.on_call if request.unattended else None,
    )


def _live(configuration: Configuration) -> events.Live | None:
    """Return the facts about a bench outside the run's process, None for any other."""
    reach = configuration.reach()
    return events.Live(speed=reach.speed, served=reach.served is not None) if reach else None


_OF_THIS_PLACE = frozenset({"data/software.json", "data/place.json"})
_READABLE = "every file of plans, fixtures and bench must be readable"


@dataclass(frozen=True, slots=True, kw_only=True)
class Frozen:
    """Hashes of the frozen files, for the journal's first lines.

    Attributes:
        files: path in the package and SHA-256 of every file that is the same in equal runs.
        beside: the same for files with facts of this place and moment.
    """

    catalogue: str
    parameters: str
    sources: str
    bench: str
    calibration: str
    files: Mapping[str, str]
    beside: Mapping[str, str]


def freeze(configuration: Configuration, folder: Path) -> Frozen:
    """Write catalogue, parameters, sources, bench file and registers into the package, from the bytes that were read.

    Raises:
        EvidenceError: if one of them cannot be read or written, or has a name that is not valid text.
    """
    try:
        return _freeze(configuration, folder)
    except OSError as error:
        where = shown(str(error.filename or folder))  # a write to a full disk does not name its file
        raise EvidenceError(f"{where}: cannot be frozen: {error.strerror}", _READABLE) from error
    except UnicodeEncodeError as error:
        raise EvidenceError(f"{shown(error.object)}: this name is not text", "rename the file") from error


def _freeze(configuration: Configuration, folder: Path) -> Frozen:
    workspace, inputs = configuration.workspace, configuration.inputs
    entries = entries_of(configuration.catalogue.requirement(id_) for id_ in configuration.catalogue.ids)
    catalogue = freeze_catalogue(folder, entries)
    parameters = _parameters(configuration, folder)
    sources = hashlib.sha256()
    for path in inputs.frozen:
        data = inputs.snapshot.take(path)
        _put(folder / inputs.name_of(path), data)
        sources.update(f"{hashlib.sha256(data).hexdigest()}  {path.relative_to(workspace.root).as_posix()}\n".encode())
    bench = _bench(configuration, folder)
    _registers(configuration, folder)
    calibration = freeze_calibration(folder, _calibrations(configuration, folder))
    _put(folder / "data/dut.json", canonical({**asdict(configuration.dut), "format": 1}))
    for each in other_packages():
        for name, data in each.sources():
            _put(folder / name, data)
    _put(folder / "data/software.json", canonical(software_identity(workspace.root)))
    _put(folder / "data/place.json", canonical(_place(configuration)))
    named = inventory(folder)
    return Frozen(
        catalogue=catalogue,
        parameters=parameters,
        sources=sources.hexdigest(),
        bench=bench,
        calibration=calibration,
        files={path: digest for path, digest in named.items() if path not in _OF_THIS_PLACE | {TRANSCRIPT}},
        beside={path: digest for path, digest in named.items() if path in _OF_THIS_PLACE},
    )


def _bench(configuration: Configuration, folder: Path) -> str:
    inputs, whole = configuration.inputs, hashlib.sha256()
    bench_folder = configuration.workspace.benches / configuration.bench.name
    for path in inputs.bench_files:
        data = inputs.snapshot.take(path)
        shown = path.relative_to(bench_folder).as_posix()
        _put(folder / "data/bench" / shown, data)
        whole.update(f"{hashlib.sha256(data).hexdigest()}  {shown}\n".encode())
    _put(folder / "data/bench/duts.yaml", inputs.snapshot.take(configuration.workspace.duts))
    return whole.hexdigest()


def _registers(configuration: Configuration, folder: Path) -> None:
    """Freeze the register of instruments with the certificates of those in use, if any of it is used."""
    fixtures, snapshot = configuration.workspace.fixtures, configuration.inputs.snapshot
    records = [item.calibration for item in _instruments(configuration)]
    used = {record.certificate for record in records if record and record.registered}
    for name in (INSTRUMENTS, *sorted(used)) if used or configuration.hand else ():
        _put(folder / REGISTERS / name, snapshot.take(fixtures / name))


def _instruments(configuration: Configuration) -> tuple[InstrumentSpec, ...]:
    """Return the instruments of the bench, and those that a person reads."""
    return (*configuration.bench.instruments, *(each.spec for each in configuration.hand.values()))


def _calibrations(configuration: Configuration, folder: Path) -> dict[str, FrozenCalibration]:
    return {
        item.name: frozen_calibration(folder, item.calibration, dut=item.dut, register=item.register)
        for item in _instruments(configuration)
    }


def _parameters(configuration: Configuration, folder: Path) -> str:
    rows = {plan: parameters.facts() for plan, parameters in configuration.parameters.items()}
    data = canonical({"format": 1, "plans": rows})
    _put(folder / "data/catalogue/parameters.json", data)
    return hashlib.sha256(data).hexdigest()


def _place(configuration: Configuration) -> dict[str, object]:
    """Return the facts of this place and moment only, which belong in no journal body."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):
        user = ""
    return {
        "format": 1,
        "bench_place": configuration.bench.head.place,
        "host": platform.node(),
        "user": user,
        "workspace": {
            "name": configuration.workspace.name,
            "testplans": configuration.workspace.shown(configuration.workspace.testplans),
            "fixtures": configuration.workspace.shown(configuration.workspace.fixtures),
        },
        "started": wall.utc_now(),
    }


def _put(path: Path, data: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
