"""What is read behind the last safe-off: watched, recorded, and written down."""

from __future__ import annotations

from collections.abc import Callable

from hil.bench.bound import BoundBench
from hil.bench.safe_off import SafeResult
from hil.bench.watch_after import EVERY_S, watch_after
from hil.executive.run.row_store import RecordedChannel, RecordingFacts, RowStore
from hil.model.cutting import WatchAfter

__all__ = ["watch_afterwards"]


def watch_afterwards(
    bench: BoundBench, store: RowStore, tell: Callable[[SafeResult], None], tick: Callable[[], None]
) -> bool:
    """Watch what the bench file says, with a recording of each line, and return whether all of it holds.

    Args:
        bench: the bench, whose safe-off has been taken.
        store: opens the recordings.
        tell: called with every result.
        tick: called at every reading.
    """
    recordings = {watch: store.begin(_facts(bench, watch)) for watch in bench.spec.watch_after}

    def reading(watch: WatchAfter, t: float, value: float) -> None:
        recordings[watch].append((t, value))
        tick()

    try:
        return watch_after(bench.spec.watch_after, bench.roles, bench.clock, reading, tell)
    finally:
        for recording in recordings.values():
            recording.finish(complete=True)


def _facts(bench: BoundBench, watch: WatchAfter) -> RecordingFacts:
    instrument = bench.spec.instrument(bench.spec.wire(watch.output).instrument)
    calibration = instrument.calibration.certificate if instrument.calibration else ""
    name = f"{watch.output} {watch.quantity} afterwards"
    return RecordingFacts(
        id=f"after-{watch.output.replace('.', '-')}-{watch.quantity}",
        name=name,
        case=None,
        step=None,
        channels=(
            RecordedChannel(name=watch.quantity, unit=watch.unit, instrument=instrument.name, calibration=calibration),
        ),
        rate=1 / EVERY_S,
        duration=None,
        source=bench.source.value,
    )
