"""The role of a battery cycler: it tests by itself, and says what it does."""

from __future__ import annotations

from typing import Annotated, Protocol

from hil.instruments.marks import begins, drives, reads
from hil.instruments.sampled import Streamed
from hil.model.figure import Figure

__all__ = ["Cycler"]


class Cycler(Streamed, Protocol):
    """A device that runs charge and discharge half-cycles of a battery by itself, and measures while it does.

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
        """Acknowledge what ended the last test, and set what the next one is to be.

        What is not given has the device's default. A device that cannot honour a setting refuses it, and says what it
        does instead.

        Args:
            cycles: a charge and a discharge each.
            rest: after each half-cycle but the last [s].
            vfull: voltage from which on a small current ends a charge [V].
            iend: the current that ends a charge [A].
            vend: the voltage that ends a discharge [V].
            vmax: limit of the device's own [V].
            vmin: limit of the device's own [V].
            imax: limit of the device's own, both directions [A].
            tmax: limit of the device's own [degC].
            tmin: limit of the device's own [degC].
            time: limit of a half-cycle [s].
            charge: limit of a half-cycle [A.h].
        """
        ...

    @begins
    def start(self) -> None:
        """Begin the test that was prepared."""
        ...

    @drives
    def stop(self) -> None:
        """Open both relays, whatever runs; it is read back."""
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
        """Return the newest voltage of the battery in V; NoReply if there is none that is new."""
        ...

    @reads
    def current(self) -> Annotated[Figure, "A"]:
        """Return the newest current into the battery in A; NoReply if there is none that is new."""
        ...

    @reads
    def temperature(self) -> Annotated[Figure, "degC"]:
        """Return the newest temperature of the battery in degC; NoReply if there is none that is new."""
        ...

    @reads
    def time_uncertainty(self) -> Annotated[Figure, "s"]:
        """Return how well the times of the rows are known against the bench's clock at their beginning, in s."""
        ...
