"""Role of a battery cycler, which runs its test autonomously and reports on it."""

from __future__ import annotations

from typing import Annotated, Protocol

from hil.instruments.marks import begins, drives, reads
from hil.instruments.sampled import Streamed
from hil.model.figure import Figure

__all__ = ["Cycler"]


class Cycler(Streamed, Protocol):
    """A device that runs charge and discharge half-cycles of a battery autonomously, and measures meanwhile.

    Channels: voltage in V, current in A (positive into the battery), energy in W.h since the half-cycle began,
    temperature in degC, phase (1 charge, -1 discharge, 0 neither) and cycle (counted from 1, 0 before the first).
    """

    @drives
    def prepare(  # noqa: PLR0913 - one argument per setting of the device, each by its name there
        self,
        cycles: int,
        rest: Annotated[float, "s"] = 0.0,
        *,
        vfull: Annotated[float, "V"] | None = None,
        iend: Annotated[float, "A"] | None = None,
        vend: Annotated[float, "V"] | None = None,
        vmax: Annotated[float, "V"] | None = None,
        vmin: Annotated[float, "V"] | None = None,
        imax: Annotated[float, "A"] | None = None,
        tmax: Annotated[float, "degC"] | None = None,
        tmin: Annotated[float, "degC"] | None = None,
        time: Annotated[float, "s"] | None = None,
        charge: Annotated[float, "A.h"] | None = None,
    ) -> None:
        """Acknowledge the end of the last test, and configure the next one.

        Settings not given take the device's defaults. A device that cannot honour a setting refuses it, and says what
        it does instead.

        Args:
            cycles: number of cycles, a charge and a discharge each.
            rest: pause after each half-cycle but the last [s].
            vfull: voltage above which a current below `iend` ends a charge [V].
            iend: end-of-charge current [A].
            vend: end-of-discharge voltage [V].
            vmax: over-voltage limit of the device [V].
            vmin: under-voltage limit of the device [V].
            imax: over-current limit of the device, both directions [A].
            tmax: over-temperature limit of the device [degC].
            tmin: under-temperature limit of the device [degC].
            time: limit on the duration of a half-cycle [s].
            charge: limit on the charge of a half-cycle [A.h].
        """
        ...

    @begins
    def start(self) -> None:
        """Start the prepared test."""
        ...

    @drives
    def stop(self) -> None:
        """Open both relays, whatever is running; the outcome is read back."""
        ...

    @reads
    def state(self) -> str:
        """Return `idle`, `charge`, `rest`, `discharge`, `ended`, `stopped`, or `tripped` and the reason."""
        ...

    @reads
    def level(self) -> str:
        """Return the level of the device's protocol: `1` or `2.0`."""
        ...

    @reads
    def voltage(self) -> Annotated[Figure, "V"]:
        """Return the newest battery voltage in V; NoReply if there is no recent reading."""
        ...

    @reads
    def current(self) -> Annotated[Figure, "A"]:
        """Return the newest current into the battery in A; NoReply if there is no recent reading."""
        ...

    @reads
    def temperature(self) -> Annotated[Figure, "degC"]:
        """Return the newest battery temperature in degC; NoReply if there is no recent reading."""
        ...

    @reads
    def time_uncertainty(self) -> Annotated[Figure, "s"]:
        """Return the standard uncertainty in s of the row times against bench time, as at the start of the stream."""
        ...
