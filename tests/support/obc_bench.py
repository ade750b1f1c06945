"""The committed bench `adcs` with a board that plays the on-board computer, and sensors behind it."""

from __future__ import annotations

from dataclasses import replace

from adcs_bench import adcs

from hil.model.bench import Bus, InstrumentSpec, PeerSpec, Wire

__all__ = ["OBC_LINES", "obc_bench"]

OBC_LINES = (
    ("buses:\n", "buses:\n  adcs: {instrument: obc1, frequency: 400 kHz}\n"),
    (
        "  mag1:\n",
        (
            '  gyro1: {driver: iim42652, bus: adcs, address: "0x68"}\n'
            '  obc1: {driver: obc-link, port: /dev/serial/by-id/usb-STM_NUCLEO-if02, baud: "921600"}\n  mag1:\n'
        ),
    ),
    ("  peers:\n", "  peers:\n    gyro1: {}\n    obc1: {}\n"),
)
"""What turns the text of the bench into one with a board."""


def obc_bench(*, obc=None, faults=(), gyro=None, connects=None):
    """Return the bench with a board `obc1` and behind it a gyroscope `gyro1`, which the file names first."""
    spec = adcs()
    twin = spec.simulated
    peers = (
        *twin.peers,
        PeerSpec(device="gyro1", model="", truth=gyro or {}),
        PeerSpec(device="obc1", model="", truth=obc or {}, connects=connects or {}, faults=faults),
    )
    return replace(
        spec,
        buses=(*spec.buses, Bus(name="adcs", instrument="obc1", frequency_hz=400_000.0)),
        instruments=(
            InstrumentSpec(name="gyro1", driver="iim42652", bus="adcs", address=0x68),
            *spec.instruments,
            InstrumentSpec(name="obc1", driver="obc-link", port="/dev/ttyACM0", baud=921_600),
        ),
        wiring=(*spec.wiring, Wire(role="obc", instance="", instrument="obc1")),
        simulated=replace(twin, peers=peers),
    )
