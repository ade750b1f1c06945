"""A finished recording, as a case sees it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from hil.evidence.journal.standing import Voided
from hil.evidence.recordings.hdf5 import Recorded
from hil.instruments.sampled import StreamReport

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Recording"]


class Recording:
    """A finished recording, as a case sees it.

    Attributes:
        id: its id in the run.
        rate: nominal samples per second.
        stream: how the stream went, None where the samples were taken one by one.
    """

    def __init__(
        self,
        recorded: Recorded,
        uncertainties: Mapping[str, float | None],
        stream: StreamReport | None = None,
        voids: Sequence[Voided] = (),
    ) -> None:
        self._recorded = recorded
        self._voids = voids
        self._uncertainties = uncertainties
        self.id = recorded.id
        self.rate = recorded.rate
        self.stream = stream

    @property
    def time(self) -> NDArray[np.float64]:
        """Bench time of every sample in s, shape (samples,); it cannot be written to."""
        return _read_only(self._recorded.time)

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Which samples stand, shape (samples,): not those of a part that was made again after the run was stopped."""
        import numpy as np  # noqa: PLC0415 - slow to import

        stands = np.ones(len(self), dtype=bool)
        for part in self._voids:
            stands[part.first : part.end] = False
        return stands

    def __getitem__(self, channel: str) -> NDArray[np.float64]:
        """Return one channel, shape (samples,); it cannot be written to, copy it to work on it."""
        return _read_only(self._recorded[channel])

    def __len__(self) -> int:
        return len(self._recorded)

    def part(self, first: int, end: int) -> dict[str, NDArray[np.float64]]:
        """Return `time` and every channel of the samples from `first` to before `end`, without the others in memory."""
        return self._recorded.part(first, end)

    def unit(self, channel: str) -> str:
        """Return the unit of one channel."""
        return self._recorded.unit(channel)

    def uncertainty(self, channel: str) -> float | None:
        """Return the standard uncertainty that the certificate gives this channel, None where unknown."""
        return self._uncertainties[channel]


def _read_only(array: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what was recorded, as it was: the criteria of a requirement look at the same numbers at the case's end."""
    view = array.view()
    view.flags.writeable = False
    return view
