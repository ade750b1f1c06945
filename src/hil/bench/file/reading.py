"""Read a bench file: every section, every finding at once."""

from __future__ import annotations

from pathlib import Path

from hil.bench.file.checks import check_bench
from hil.bench.file.complaints import Located
from hil.bench.file.cutting_sections import read_cut_paths, read_watch_after
from hil.bench.file.envelope_sections import read_envelope_limit
from hil.bench.file.sections import (
    read_buses,
    read_clamp,
    read_instruments,
    read_safe_step,
    read_twin,
    read_wire,
)
from hil.documents.findings import Findings
from hil.documents.node import Place
from hil.documents.reader import MappingReader, read_document
from hil.documents.suggest import did_you_mean
from hil.model.bench import BenchSpec, SafeStep
from hil.model.errors import ConfigurationError, Refused

__all__ = ["SCHEMA", "bench_names", "load_bench", "read_bench"]

SCHEMA = "hil/bench/1"


def bench_names(benches: Path) -> tuple[str, ...]:
    """Return the names of the benches in a folder, sorted."""
    return tuple(sorted(path.parent.name for path in benches.glob("*/bench.yaml")))


def load_bench(benches: Path, name: str, root: Path, *, driven: bool = True) -> BenchSpec:
    """Read and check `<benches>/<name>/bench.yaml`.

    Args:
        benches: the folder that holds the benches.
        name: the bench.
        root: the workspace; findings show paths relative to it.
        driven: whether it is going to be driven; its record answers for one that is replayed, and an older one too.

    Raises:
        Refused: if there is no such bench.
        ConfigurationError: with everything that is wrong with the file.
    """
    known = bench_names(benches)
    if name not in known:
        raise Refused(
            f"there is no bench '{name}' in {benches.relative_to(root)}{did_you_mean(name, known)}",
            f"benches are: {', '.join(known) or 'none'}",
        )
    findings = Findings()
    path = benches / name / "bench.yaml"
    spec = read_bench(path, str(path.relative_to(root)), findings, driven=driven)
    if spec is None or len(findings):
        raise ConfigurationError(tuple(findings))
    return spec


def read_bench(path: Path, shown: str, findings: Findings, *, driven: bool = True) -> BenchSpec | None:
    """Read one bench file and add what is wrong to the findings; None where nothing could be read."""
    document = read_document(path, shown, findings, schema=SCHEMA)
    if document is None:
        return None
    places = Located()
    head = document.child("bench", required=True)
    spec = BenchSpec(
        name=head.text("name", pattern="[a-z][a-z0-9-]*") if head else "",
        title=head.text("title") if head else "",
        place=head.text("place", "") if head else "",
        dew_point=head.number("dew_point", None) if head else None,
        buses=read_buses(document, places),
        instruments=read_instruments(document, places),
        wiring=tuple(places.keep(read_wire(item), item.place()) for item in document.children("wiring", required=True)),
        clamps=tuple(places.keep(read_clamp(item), item.place()) for item in document.children("clamps")),
        envelope=tuple(places.keep(read_envelope_limit(item), item.place()) for item in document.children("envelope")),
        safe_off=_steps(document, "safe_off", places),
        rest=_steps(document, "rest", places),
        hold=_steps(document, "hold", places, required=False),
        cut_paths=read_cut_paths(document, places),
        watch_after=read_watch_after(document, places),
        simulated=read_twin(document, places),
    )
    if head:
        head.done()
        _check_name(spec.name, path, head.place("name"), findings)
    document.done()
    check_bench(spec, places, findings, driven=driven)
    _check_certificates(spec, path.parent, places, findings)
    return spec


def _steps(document: MappingReader, key: str, places: Located, *, required: bool = True) -> tuple[SafeStep, ...]:
    return tuple(places.keep(read_safe_step(item), item.place()) for item in document.children(key, required=required))


def _check_name(name: str, path: Path, place: Place, findings: Findings) -> None:
    if name and path.parent.name != name:
        findings.add(place, f"the bench is called '{name}', but its folder '{path.parent.name}'")


def _check_certificates(spec: BenchSpec, folder: Path, places: Located, findings: Findings) -> None:
    """A certificate lies in the bench's folder, so that packages hold it."""
    for calibration in (item.calibration for item in spec.instruments if item.calibration):
        if calibration.certificate and (problem := _certificate_problem(folder, calibration.certificate)):
            findings.add(places.of(calibration), problem)


def _certificate_problem(folder: Path, certificate: str) -> str:
    """Return what is wrong with the file of a certificate, which may be of any kind, or nothing."""
    try:
        file = (folder / certificate).resolve()
        if not file.is_relative_to(folder.resolve()) or not file.exists():
            return f"there is no certificate '{certificate}' in the bench's folder"
        if not file.is_file():
            return f"the certificate '{certificate}' is no file"
        with file.open("rb") as stream:
            stream.read(1)
    except (OSError, RuntimeError, ValueError) as error:  # a loop of links is a RuntimeError to some versions of Python
        reason = getattr(error, "strerror", None) or "its path leads nowhere"
        return f"the certificate '{certificate}' cannot be read: {reason}"
    return ""
