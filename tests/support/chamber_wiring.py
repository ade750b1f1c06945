"""The temperature chamber on the adcs bench: what its bench file says more, for tests of whole runs."""

from __future__ import annotations

__all__ = ["chamber_changes", "wire_chamber"]

_INSTRUMENT = """\
  tec1:
    driver: eurotherm-3216
    port: /dev/serial/by-id/usb-FTDI_FT232R_A50285BJ-if00-port0
    baud: "9600"
    address: "1"
    identity: {model: "3216"}
    calibration:
      certificate: certificates/mag1.txt
      due: "2027-09-30"
      ranges:
      - {quantity: temperature, unit: degC, from: "-30", to: "60", absolute: "0.2"}
"""

_CONTACTS = 'contacts: {a: "1", b: "2"}'

_WIRE = """\
- {role: thermal, instrument: tec1, settings: {decimals: "1"},
   note: "Pt100 on the plate; the thermal cut-out of the cooler opens at 70 degC"}
"""

_CLAMP = '- {output: thermal, quantity: temperature, unit: degC, min: "-20", max: "45"}\n'

_LIMIT = (
    '- {id: plate-temperature, output: thermal, quantity: temperature, unit: degC, min: "-25", max: "60",'
    ' period: 5 s, max_age: 15 s, debounce: "2"}\n'
)

_SAFE = """\
- {output: thermal, state: standby, within: 6 s,
   proof: {output: thermal, quantity: output, unit: "%", min: "-0.05", max: "0.05"}}
"""

_CUT_PATH = """\
cut_paths:
- {output: thermal, hardware: thermal cut-out opens the cooler's feed at 70 degC, within: 300 s}
"""

_PLANT = "    chamber: {model: thermal-chamber, grid: 1 s}\n"

_PEER = """\
    tec1:
      truth: {sensor_offset: "0.15"}
      connects: {sensor: chamber.plate, drive: chamber.tec, ambient: chamber.ambient}
"""


def chamber_changes(*faults: str, lamp: str = "") -> dict[str, str]:
    """Return texts of the bench file, and what they become; see `wire_chamber`."""
    peer = _PEER + (f"      faults: [{', '.join(faults)}]\n" if faults else "")
    wrong = f"      truth: {lamp}\n" if lamp else ""
    return {
        "\nwiring:\n": f"{_INSTRUMENT}\nwiring:\n{_WIRE}",
        _CONTACTS: _CONTACTS.replace("}", ', lamp: "3"}'),
        "\nclamps:\n": f"\nclamps:\n{_CLAMP}",
        "\nenvelope:\n": f"\nenvelope:\n{_LIMIT}",
        "\nsafe_off:\n": f"\nsafe_off:\n{_SAFE}",
        "\nrest:\n": f"\nrest:\n{_SAFE}",
        "\nsimulated:\n": f"\n{_CUT_PATH}\nsimulated:\n",
        "grid: 10 ms": "grid: 200 ms",
        "\n  plants:\n": f"\n  plants:\n{_PLANT}",
        "\n  peers:\n": f"\n  peers:\n{peer}",
        '"2": coil.contact_b}\n': f'"2": coil.contact_b, "3": chamber.lamp}}\n{wrong}',
    }


def wire_chamber(workspace, *faults: str, lamp: str = "") -> None:
    """Add the chamber to a workspace's bench; `faults` are those of the controller, `lamp` is truth of the relay board.

    The coil, which these runs leave alone, is stepped seldom: they last for an hour of bench time.
    """
    workspace.change_bench(chamber_changes(*faults, lamp=lamp))
