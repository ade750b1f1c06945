"""Coverage by the guardian: every output that can do harm, by its own bytes or by what cuts it off."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from hil.bench.bound import BoundBench
from hil.bench.connections import can_harm
from hil.guardian.latch import path_of
from hil.instruments.registry import ROLES
from hil.instruments.roles import SafeByBytes
from hil.instruments.wrapped import hosted_port, is_wrapped
from hil.model.bench import BenchSpec, InstrumentSpec, SafeStep, Wire
from hil.model.errors import Refused
from hil.model.identity import Source
from hil.model.safing import CutOutput, GuardedOutput, GuardedPort, GuardPlan
from hil.wire.line_stream import port_of
from hil.wire.visa import why_not_shared

__all__ = ["harmless", "plan_of"]

_JOURNAL = "data/guardian.jsonl"


def plan_of(bench: BoundBench, folder: Path, leases: Sequence[str]) -> GuardPlan:
    """Return the plan of the guardian of a run on this bench.

    It contains every output that can do harm by its role, and every line of the safe-off: with the bytes from its
    driver, or as cut off by another output. A line for a harmless role, such as a sensor that is put to sleep, is left
    to the run alone if the driver provides no bytes.

    Raises:
        Refused: if the guardian could not make an output safe; all of them are named.
    """
    spec = bench.spec
    steps = {step.output: step for step in spec.safe_off}
    outputs: list[GuardedOutput] = []
    without: dict[str, str] = {}
    for name in dict.fromkeys((*steps, *(wire.name for wire in spec.wiring if can_harm(wire)))):
        found = _guarded(bench, steps[name]) if name in steps else "is missing from safe_off"
        if not isinstance(found, str):
            outputs.append(found)
        elif not _does_no_harm(spec.wire(name)):
            without[name] = found
    by_bytes = {each.output for each in outputs}
    cut = tuple(
        CutOutput(output=name, cut_by=tuple(by for by in _cut_by(spec, name) if by in by_bytes), why=why)
        for name, why in without.items()
    )
    _require_covered(bench, cut)
    devices = {output.device for output in outputs}
    return GuardPlan(
        bench=spec.name,
        run=str(folder),
        ports=tuple(_port(bench, item) for item in spec.instruments if item.name in devices),
        outputs=tuple(outputs),
        cut=cut,
        latches=tuple(str(path_of(lease)) for lease in leases),
        journal=str(folder / _JOURNAL),
    )


def harmless(spec: BenchSpec, guarded: Collection[str]) -> tuple[str, ...]:
    """Return the driven outputs that are not guarded because their role is harmless, such as sensors.

    Args:
        spec: the bench.
        guarded: the outputs that the guardian makes safe.
    """
    return tuple(
        wire.name for wire in spec.wiring if wire.name not in guarded and not can_harm(wire) and _drives(wire.role)
    )


def _does_no_harm(wire: Wire) -> bool:
    """Return whether the role is known to be harmless; an unknown one is not."""
    return ROLES.find(wire.role) is not None and not can_harm(wire)


def _drives(name: str) -> bool:
    role = ROLES.find(name)
    return role is None or any(operation.drives for operation in role.operations.values())


def _guarded(bench: BoundBench, step: SafeStep) -> GuardedOutput | str:
    """Return a guarded output with its bytes, or why there are none."""
    role, device = bench.roles[step.output], bench.spec.wire(step.output).instrument
    if not isinstance(role, SafeByBytes):
        return "gives no safe_bytes"
    if not is_wrapped(bench.spec.instrument(device)) and (why := why_not_shared(bench.where.get(device, ""))):
        return why
    if device not in bench.descriptors:
        return "has no port that the guardian could use"
    try:
        code = role.safe_bytes(step.state, step.proof)
    except Refused as error:
        return f"gives no safe_bytes: {error}"
    if not code.off or not any(each.expect for each in code.proof):
        return "gives safe_bytes without a command or a proof"
    return GuardedOutput(
        output=step.output,
        state=step.state,
        device=device,
        within_s=step.within_s,
        code=code,
        cut_by=_cut_by(bench.spec, step.output),
    )


def _cut_by(spec: BenchSpec, output: str) -> tuple[str, ...]:
    return tuple(path.by for path in spec.cut_paths if path.output == output and path.by)


def _require_covered(bench: BoundBench, cut: Sequence[CutOutput]) -> None:
    problems = list(_uncovered(bench, cut))
    if problems:
        raise Refused(
            "; ".join(problems),
            "let the driver give `safe_bytes` with a proof, or name a cut path `by` an output that the guardian proves",
        )


def _uncovered(bench: BoundBench, cut: Sequence[CutOutput]) -> Iterator[str]:
    for each in cut:
        if not each.cut_by:
            instrument = bench.spec.instrument(bench.spec.wire(each.output).instrument)
            yield (
                f"the guardian cannot make {each.output} safe: it {each.why} (driver {instrument.driver} of"
                f" {instrument.name}), and no cut path leads through an output that is guarded"
            )


def _port(bench: BoundBench, instrument: InstrumentSpec) -> GuardedPort:
    """Return how the guardian may reopen a port: not one that resets its device."""
    if bench.source is Source.HARDWARE and is_wrapped(instrument):
        return hosted_port(instrument, bench.where[instrument.name])
    resets = getattr(bench.drivers[instrument.name], "resets_on_open", False)
    line = instrument.serial_line if bench.source is Source.HARDWARE else None
    port = port_of(instrument.name, bench.where[instrument.name], instrument.baud, line)
    return replace(port, url="") if resets else port
