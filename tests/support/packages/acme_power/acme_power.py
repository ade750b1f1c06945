"""The driver of a vendor: a supply whose state lies in a file, which stands for the instrument and its secret link."""

from __future__ import annotations

import json
from pathlib import Path

__all__ = ["PowerSupply"]


class PowerSupply:
    """One supply.

    Args:
        place: where it is.
    """

    model = "P30"
    serial_number = "A1"

    def __init__(self, place):
        self._file = Path("/", place)
        if not self._file.exists():
            raise RuntimeError(f"no ACME at {place}\nis it on?")

    def _ask(self, **changed):
        state = json.loads(self._file.read_text(encoding="utf-8"))
        if state.get("broken"):
            raise TimeoutError("no answer")
        if changed:
            state |= changed
            self._file.write_text(json.dumps(state), encoding="utf-8")
        return state

    def set_voltage(self, volts):
        """Set it [V]; this firmware has a range."""
        self._ask(voltage=min(volts, 30.0))

    def set_limit(self, amperes):
        """Set it [A]."""
        self._ask(limit=amperes)

    def get(self, name):
        """Return a setting."""
        return self._ask()[name]

    def output(self, on):
        """Switch."""
        self._ask(on=on)

    def is_on(self):
        """Return whether it is on."""
        return self._ask()["on"]

    def measure(self, unit):
        """Return volts or amperes into 10 ohm, or what the file says."""
        state = self._ask()
        volts = state["voltage"] if state["on"] else 0.0
        return volts if unit == "V" else volts / state.get("ohms", 10.0)
