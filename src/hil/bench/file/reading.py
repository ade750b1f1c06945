"""Reads and checks a bench file; reports everything that is wrong at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from hil.bench.file.checks import check_bench
from hil.bench.file.complaints import named
from hil.documents.declared import Document, read_document
from hil.documents.findings import Findings
from hil.documents.suggest import did_you_mean
from hil.model.bench import BenchSpec, InstrumentSpec
from hil.model.errors import ConfigurationError, Refused
from hil.registers.instruments import INSTRUMENTS, RegisteredInstrument, file_problem, load_instruments

__all__ = ["Twin", "bench_names", "load_bench"]

_BENCH = "hil/bench/1"


def bench_names(benches: Path) -> tuple[str, ...]:
    """Return the names of the benches in a folder, sorted."""
    return tuple(sorted(path.parent.name for path in benches.glob("*/bench.yaml")))


Twin = Callable[[Document[BenchSpec], Findings, bool], None]
"""Checks the simulated twin of a bench file; the flag says whether everything else is correct."""


def load_bench(benches: Path, name: str, root: Path, *, driven: bool = True, twin: Twin = lambda *_: None) -> BenchSpec:
    """Read and check `<benches>/<name>/bench.yaml`.

    Args:
        benches: the folder that holds the benches.
        name: the bench.
        root: the workspace; findings show paths relative to it.
        driven: whether it is going to be driven; for a replay its record answers, which may be older.
        twin: checks the simulated twin, where that is used.

    Raises:
        Refused: if there is no such bench.
        ConfigurationError: with all errors in the file.
    """
    known = bench_names(benches)
    if name not in known:
        raise Refused(
            f"there is no bench '{name}' in {benches.relative_to(root)}{did_you_mean(name, known)}",
            f"benches are: {', '.join(known) or 'none'}",
        )
    findings = Findings()
    path = benches / name / "bench.yaml"
    document = read_document(path, str(path.relative_to(root)), findings, BenchSpec, schema=_BENCH)
    if document is not None:
        found = len(findings)
        document = _with_register(document, benches.parent, root, findings)
        _check_name(document, path, findings)
        document = check_bench(document, findings, driven=driven)
        _check_certificates(document, path.parent, findings)
        twin(
            document, findings, all(wrong[:1] == ("simulated",) for wrong in document.wrong) and found == len(findings)
        )
    if document is None or len(findings):
        raise ConfigurationError(tuple(findings))
    return document.model


def _check_name(document: Document[BenchSpec], path: Path, findings: Findings) -> None:
    name = document.model.name
    if name and path.parent.name != name:
        findings.add(
            document.place(("bench", "name")), f"the bench is named '{name}', but its folder is '{path.parent.name}'"
        )


def _with_register(
    document: Document[BenchSpec], fixtures: Path, root: Path, findings: Findings
) -> Document[BenchSpec]:
    """Return the bench file with the calibrations of the instruments' register entries."""
    naming = [(at, item) for at, item in named(document.model.instruments, "instruments") if item.register]
    if not naming:
        return document
    shown = str((fixtures / INSTRUMENTS).relative_to(root))
    known = load_instruments(fixtures / INSTRUMENTS, shown, findings)
    calibrations = {}
    for at, item in naming:
        entry = known.get(item.register)
        if entry is not None:
            calibrations[item.name] = entry.calibration
        for key, problem in _of_register(item, entry, known, shown, fixtures):
            findings.add(document.place((*at, key)), f"{item.name}: {problem}")
    instruments = tuple(
        replace(item, calibration=calibrations.get(item.name, item.calibration)) for item in document.model.instruments
    )
    return replace(document, model=replace(document.model, instruments=instruments))


def _of_register(
    item: InstrumentSpec,
    entry: RegisteredInstrument | None,
    known: Mapping[str, RegisteredInstrument],
    shown: str,
    fixtures: Path,
) -> Iterator[tuple[str, str]]:
    """Yield every mismatch between an instrument and its register entry: a key and a sentence."""
    if item.calibration is not None:
        yield "calibration", "an instrument of the register has no calibration in the bench file; leave one of them out"
    if entry is None:
        yield "register", f"there is no instrument '{item.register}' in {shown}{did_you_mean(item.register, known)}"
    elif item.identity.serial and item.identity.serial != entry.serial:
        yield "identity", f"its serial number is '{item.identity.serial}' here, and '{entry.serial}' in {shown}"
    if entry is not None and entry.latest and (problem := file_problem(fixtures, entry.latest)):
        yield "register", f"{entry.id}, {shown}: {problem}"


def _check_certificates(document: Document[BenchSpec], folder: Path, findings: Findings) -> None:
    """Check that every certificate is in the bench's folder, so that packages contain it."""
    for at, item in named(document.model.instruments, "instruments"):
        certificate = item.calibration.certificate if item.calibration and not item.register else ""
        if certificate and (problem := _certificate_problem(folder, certificate)):
            findings.add(document.place((*at, "calibration", "certificate")), problem)


def _certificate_problem(folder: Path, certificate: str) -> str:
    """Return what is wrong with a certificate's file, which may be of any format; empty if nothing is."""
    try:
        file = (folder / certificate).resolve()
        if not file.is_relative_to(folder.resolve()) or not file.exists():
            return f"there is no certificate '{certificate}' in the bench's folder"
        if not file.is_file():
            return f"the certificate '{certificate}' is no file"
        with file.open("rb") as stream:
            stream.read(1)
    except (OSError, RuntimeError, ValueError) as error:  # some Python versions raise RuntimeError for a loop of links
        reason = getattr(error, "strerror", None) or "its path leads nowhere"
        return f"the certificate '{certificate}' cannot be read: {reason}"
    return ""
