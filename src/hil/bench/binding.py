"""Composition root: turns a bench file into drivers on ports, whatever the ports lead to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from hil.bench.bound import BoundBench, build, publish_recorded, url_of
from hil.clock.virtual import VirtualClock
from hil.documents.declared import Document
from hil.documents.findings import Findings
from hil.documents.node import Place, place_at
from hil.instruments.settings import WrongSettings
from hil.model.bench import BenchSpec, SimulatedBench
from hil.model.errors import Refused
from hil.model.identity import Source
from hil.simulation.world import simulated_ends, truth_errors
from hil.wire.checkpoint import Checkpoint
from hil.wire.exchange import publish_bus, publish_stream
from hil.wire.replay import Handover, Playback
from hil.wire.transcript import HEADER, Transcript

__all__ = ["bind_replayed", "bind_resumed", "bind_simulated", "check_twin", "simulated_twin"]


def bind_simulated(spec: BenchSpec, transcript: Transcript) -> BoundBench:
    """Build the simulated twin: plants, peers and a virtual clock behind `sim://` ports.

    Raises:
        Refused: if the bench file has no simulated twin.
        TruthError: if a truth of a plant or peer is wrong; `check_twin` finds all of them, with their places.
    """
    twin = simulated_twin(spec)
    clock = VirtualClock(twin.epoch)
    ends = simulated_ends(spec, twin, clock)
    for name, line in ends.lines.items():
        publish_stream(url_of(Source.SIMULATED, spec, name), line)
    for name, bus in ends.buses.items():
        publish_bus(url_of(Source.SIMULATED, spec, name), bus)
    return build(spec, Source.SIMULATED, clock, transcript, world=ends.world, lines=ends.lines)


def bind_resumed(
    spec: BenchSpec,
    transcript: Transcript,
    record: Path,
    checkpoint: Checkpoint,
    where: Callable[[], str],
    *,
    asked: bool = False,
) -> BoundBench:
    """Build the simulated twin on the record of a run so far; its world continues from the checkpoint.

    Args:
        spec: the bench file.
        transcript: where every operation is noted.
        record: the transcript of the run so far.
        checkpoint: what `BoundBench.checkpoint` returned then.
        where: returns the current step, for messages.
        asked: whether it continues when `go_on` is called rather than when its record reaches the checkpoint.
    """
    twin = simulated_twin(spec)
    clock = VirtualClock(twin.epoch)

    def go_on() -> None:
        clock.wait_until(checkpoint.at_ns)
        simulated = simulated_ends(spec, twin, clock)
        try:
            simulated.restore(checkpoint.state)
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            playback.diverge(
                f"the simulated bench cannot continue from its checkpoint: {type(error).__name__}: {error}"
            )
        bench.world, bench.lines, bench.playback = simulated.world, simulated.lines, None
        for name, end in ends.items():
            end.hand_to(simulated.of(spec.instrument(name)))

    handover = None if asked else Handover(checkpoint.operations, checkpoint.at_ns, go_on)
    playback = Playback(record, clock, where, handover)
    ends = publish_recorded(spec, Source.SIMULATED, playback)
    bench = build(spec, Source.SIMULATED, clock, transcript, playback=playback)
    if asked:
        bench.go_on = go_on
    return bench


def bind_replayed(
    spec: BenchSpec,
    transcript: Transcript,
    record: Path,
    where: Callable[[], str],
    *,
    outside: bool = False,
    speed: float = 1.0,
) -> BoundBench:
    """Build the bench on a recorded transcript behind `replay://` ports.

    Args:
        spec: the bench file.
        transcript: where every operation is noted.
        record: the transcript of the run.
        where: returns the current step, for messages.
        outside: whether the recorded bench was outside its process.
        speed: of the recorded bench, see `BoundBench`.
    """
    clock = VirtualClock(spec.simulated.epoch if spec.simulated else "1970-01-01T00:00:00Z")
    playback = Playback(record, clock, where)
    publish_recorded(spec, Source.REPLAYED, playback)
    bench = build(spec, Source.REPLAYED, clock, transcript, playback=playback)
    bench.outside, bench.speed = outside, speed
    return bench


def simulated_twin(spec: BenchSpec) -> SimulatedBench:
    """Return the twin of a bench file, or refuse."""
    if spec.simulated is None:
        raise Refused(f"bench '{spec.name}' has no simulated twin", "add a 'simulated' section to its bench.yaml")
    return spec.simulated


def check_twin(document: Document[BenchSpec], findings: Findings, fits: bool) -> None:
    """Check what only plants, peers and drivers can check: truths, and the settings of wires.

    Args:
        document: the bench file.
        findings: collects everything that is wrong.
        fits: whether nothing outside the simulated part is wrong, so that drivers can be made.
    """
    spec = document.model
    if spec.simulated is not None:
        sound = tuple(peer for peer in spec.simulated.peers if document.is_sound(("instruments", peer.device)))
        twin = replace(spec.simulated, peers=sound)
        for error in truth_errors(twin, spec.instruments, spec.buses):
            path = ("simulated", *error.path)
            if not document.follows(path):
                findings.add(place_at(document.root, path), error.message)
    if fits:
        _check_settings(spec, document.root, findings)


def _check_settings(spec: BenchSpec, root: Place, findings: Findings) -> None:
    """Let drivers check the settings of their wires; no byte is sent: an empty record stands in for the instruments."""
    with TemporaryDirectory(prefix="hil-") as folder:
        record = Path(folder) / "record"
        record.write_text(HEADER, encoding="ascii")
        bench = bind_replayed(replace(spec, simulated=None), Transcript(None), record, lambda: "")
    try:
        for index, wire in enumerate(spec.wiring):
            try:
                bench.drivers[wire.instrument].role(wire)
            except WrongSettings as error:
                for problem in error.problems:
                    at = place_at(root, ("wiring", index, *problem.path), of_key=problem.of_key)
                    findings.add(at, problem.message)
            except Refused as error:
                findings.add(place_at(root, ("wiring", index)), str(error))
    finally:
        bench.close()
