"""Stream of a cycler's rows, timed by the device or by their arrival."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hil.instruments.cycler.bare import BareLines
from hil.instruments.cycler.numbered import NumberedLines
from hil.instruments.cycler.session import CyclerSession, Status, drift_between
from hil.instruments.sampled import StreamReport
from hil.model.errors import DeviceFault, Garbled

__all__ = ["CHANNELS", "CyclerStream"]

CHANNELS = (
    ("voltage", "V"),
    ("current", "A"),
    ("energy", "W.h"),
    ("temperature", "degC"),
    ("phase", "1"),
    ("cycle", "1"),
)
"""Names and units of a row's columns after the time."""

_COLUMNS = 1 + len(CHANNELS)
_MS_PER_S = 1000.0


class CyclerStream:
    """One stream; it begins when it is created, and holds the rows from then on.

    Args:
        session: the session.
        attend: services the line, see `Attendance`.

    Raises:
        DeviceFault: the device is silent or talks nonsense.
    """

    def __init__(self, session: CyclerSession, attend: Callable[[], None]) -> None:
        self._session = session
        self._attend = attend
        self._fault: DeviceFault | None = None
        self._first: Status | None = None
        self._told = session.meet()
        if isinstance(self._told, NumberedLines):
            self._first = Status.ask_for_time(session)
            since_s = session.clock.now() - self._first.middle_s
            self._told.zero_ms = self._first.device_ms + since_s * _MS_PER_S
        else:
            session.poll()
            self._told.begun_s, self._told.uncertainty = session.clock.now(), None
        self._told.record()

    @property
    def uncertainty(self) -> float | None:
        """Standard uncertainty of the row times in s, None before the first row."""
        if self._first is not None:
            return self._first.uncertainty
        return self._told.uncertainty if isinstance(self._told, BareLines) else None

    def drain(self) -> NDArray[np.float64]:
        """Return the rows received since the last call, shape (n, 7).

        Raises:
            DeviceFault: the stream is over; earlier rows have been returned.
        """
        if self._fault is not None:
            raise self._fault
        try:
            self._attend()
            if self._session.fault is not None or self._session.told is not self._told:
                raise self._session.fault or self._changed()
        except DeviceFault as fault:
            if not self._told.rows:
                raise
            self._fault = fault
        rows = self._told.take_rows()
        return np.array(rows).reshape(-1, _COLUMNS) if rows else np.empty((0, _COLUMNS))

    def end(self) -> StreamReport:
        """Stop keeping rows, and return the stream's report.

        Raises:
            DeviceFault: the device is silent or talks nonsense.
        """
        drift = drift_uncertainty = None
        whole = self._told.recording and self._fault is None
        try:
            if whole and self._first is not None:
                drift, drift_uncertainty = drift_between(self._first, Status.ask_for_time(self._session))
        finally:
            self._told.recording = False
        return StreamReport(
            frames=self._told.frames,
            lost=self._told.lost,
            drift=drift,
            drift_uncertainty=drift_uncertainty,
            losses_known=self._first is not None,
            time_uncertainty=self.uncertainty,
        )

    def _changed(self) -> Garbled:
        return Garbled(
            self._session.device, "it began like a device of level 1, and speaks level 2", "start the test again"
        )
