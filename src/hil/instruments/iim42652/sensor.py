"""One IIM-42652 as a gyroscope: woken, sampled, streamed, switched off."""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import Clock
from hil.instruments.iim42652.mode import GYRO_ON, INVALID, Mode, celsius
from hil.instruments.iim42652.packets import rates
from hil.instruments.iim42652.recorder import Recorder
from hil.instruments.iim42652.registers import ITS_NAME, Register, Registers
from hil.instruments.iim42652.stillness import Stillness
from hil.instruments.marks import drives, reads
from hil.instruments.sampled import Channel, StreamReport
from hil.model.errors import DeviceFault, NoReply, Refused, Rejected, WrongIdentity
from hil.model.figure import Figure

__all__ = ["Iim42652Gyroscope"]

_SOFT_RESET = 1
_RESET_DONE = 1 << 4
_RESET_S = 0.002  # 1 ms
_START_UP_S = 0.06
_LONGEST_START_S = 0.5  # off for less than 150 ms, it needs up to that much longer
_OTHER_BANKS = range(1, 5)
_OUTPUTS = 14  # temperature, accelerometer, gyroscope, two bytes each number


class Iim42652Gyroscope:
    """One sensor; fills the role `gyroscope`.

    An axis at the converter's rail is NaN, which no check passes: the true rate is larger than the number, by an
    unknown amount. So is a number that the sensor marks invalid, as it does while its gyroscope is off. A sensor that
    gives the same numbers again and again does not measure, see `Stillness`.

    Args:
        registers: the sensor's registers.
        clock: the bench's clock.
        mode: range, rate, bandwidth and interrupt line.
    """

    def __init__(self, registers: Registers, clock: Clock, mode: Mode) -> None:
        self._registers = registers
        self._device = registers.device
        self._clock = clock
        self._mode = mode
        self._running = False
        self._stillness = Stillness(self._device, mode.noise_counts)
        self._judged = 0.0
        self._recorder: Recorder | None = None

    @drives
    def start(self) -> None:
        """Reset the sensor, set its mode, switch the gyroscope on, read all back, and wait for valid data.

        Raises:
            WrongIdentity: another device answers at this address.
            Rejected: it was not reset, or a setting reads back otherwise.
            NoReply: no acknowledge, or no valid data in time.
        """
        self._running = False
        self._abandon()
        self._identify()
        self._reset()
        self._registers.set(self._mode.registers)
        self._registers.write(Register.PWR_MGMT0, GYRO_ON)
        self._clock.sleep(_START_UP_S)
        self._registers.expect(self._mode.registers | {Register.PWR_MGMT0: GYRO_ON})
        self._await_valid()
        self._stillness = Stillness(self._device, self._mode.noise_counts)
        self._judged = 0.0
        self._running = True

    @drives
    def stop(self) -> None:
        """Switch the gyroscope off and read it back; a stream that runs is ended."""
        self._running = False
        self._abandon()
        self._registers.write(Register.PWR_MGMT0, 0)
        self._registers.expect({Register.PWR_MGMT0: 0})

    def channels(self) -> tuple[Channel, ...]:
        """Return x, y, z in deg/s and temperature in degC."""
        return (*(Channel(axis, "deg/s") for axis in "xyz"), Channel("temperature", "degC"))

    @reads
    def sample(self) -> tuple[float, ...]:
        """Return the newest sample, temperature and rates from one transfer.

        Raises:
            NoReply: no acknowledge; or sixteen samples, each at least a period after the last one, were equal.
        """
        self._require_running()
        data = self._registers.block(Register.TEMP_DATA, _OUTPUTS)
        counts = np.frombuffer(data[-6:], ">i2").astype(np.int16)
        now = self._clock.now()
        if now - self._judged >= self._mode.period:
            self._judged = now
            self._stillness.judge(counts[np.newaxis])
        x, y, z = (float(number) for number in rates(counts, self._mode.sensitivity))
        return x, y, z, celsius(data[:2])

    @reads
    def temperature(self) -> Figure:
        """Return the temperature of the sensor's die in degC; its uncertainty is not known.

        Raises:
            NoReply: no acknowledge, or a number that is marked invalid: it sleeps.
        """
        self._require_running()
        temperature = celsius(self._registers.block(Register.TEMP_DATA, 2))
        if math.isnan(temperature):
            raise NoReply(
                self._device, "its temperature is marked invalid, it sleeps", "look at its power, and start it again"
            )
        return Figure(value=temperature, unit="degC")

    def begin(self, rate: float) -> None:
        """Let the sensor sample into its FIFO; device time counts from when that begins to fill.

        Over an OBC this is up to one period of samples later than the call. See `hil.instruments.sampled.Streamed`.

        Raises:
            Refused: not started, streaming already, or another rate than the wiring's.
            Rejected: a setting reads back otherwise, or the OBC cannot run the stream.
        """
        self._require_running()
        if self._recorder:
            raise Refused(f"{self._device} streams already", "end the stream first")
        if rate != self._mode.rate:
            raise Refused(
                f"{self._device} runs at {self._mode.rate:g} Hz, not at {rate:g} Hz",
                "record at that rate, or set `rate` in the wiring",
            )
        recorder = Recorder(self._registers, self._mode, self._clock)
        recorder.begin()
        self._recorder = recorder

    def drain(self) -> NDArray[np.float64]:
        """Return the samples since the last call, shape (n, 5): device time in s, x, y, z in deg/s, degC.

        The temperature is read once a block. A sample that was lost leaves its place in time empty.

        Raises:
            NoReply: of the sensor: no acknowledge, no samples for three blocks' time, or it stands still.
            Garbled: most packets of a block are none of the gyroscope's.
            DeviceFault: of the OBC, where the link fails.
        """
        return self._streaming().drain()

    def end(self) -> StreamReport:
        """Stop the stream, and return how it went."""
        recorder = self._streaming()
        self._recorder = None
        return recorder.end()

    @property
    def longest_pause(self) -> float:
        """Seconds after which FIFO or host buffer overflow, with a margin; 0 while nothing streams."""
        return self._recorder.longest_pause if self._recorder else 0.0

    @reads
    def bandwidth(self) -> Figure:
        """Return the noise bandwidth of the filter in Hz, taken for a Butterworth filter of third order."""
        return Figure(value=self._mode.noise_bandwidth, unit="Hz")

    @reads
    def resolution(self) -> Figure:
        """Return one count of the chosen range in deg/s."""
        return Figure(value=1.0 / self._mode.sensitivity, unit="deg/s")

    @reads
    def full_scale(self) -> Figure:
        """Return the largest rate of the chosen range in deg/s."""
        return Figure(value=self._mode.full_scale, unit="deg/s")

    def _identify(self) -> None:
        name = self._registers.read(Register.WHO_AM_I)
        if name != ITS_NAME and self._registers.read(Register.REG_BANK_SEL) in _OTHER_BANKS:
            self._registers.write(Register.REG_BANK_SEL, 0)
            name = self._registers.read(Register.WHO_AM_I)
        if name != ITS_NAME:
            raise WrongIdentity(
                self._device,
                f"WHO_AM_I is {name:#04x}, an IIM-42652 says {ITS_NAME:#04x}",
                "compare the address in the bench file with the board's AD0 strap",
            )

    def _reset(self) -> None:
        self._registers.write(Register.DEVICE_CONFIG, _SOFT_RESET)
        self._clock.sleep(_RESET_S)
        if not self._registers.read(Register.INT_STATUS) & _RESET_DONE:
            raise Rejected(self._device, "it does not report that its reset is done", "look at the sensor's power")

    def _await_valid(self) -> None:
        deadline = self._clock.now() + _LONGEST_START_S
        invalid = INVALID.to_bytes(2, "big", signed=True)
        while invalid in _numbers(self._registers.block(Register.TEMP_DATA, _OUTPUTS)):
            if self._clock.now() >= deadline:
                raise NoReply(
                    self._device,
                    f"no valid data {_START_UP_S + _LONGEST_START_S:.2f} s after the gyroscope was switched on",
                    "look at the sensor's power",
                )
            self._clock.sleep(self._mode.period)

    def _abandon(self) -> None:
        """End a stream, as far as it can be ended."""
        recorder, self._recorder = self._recorder, None
        if recorder:
            with suppress(DeviceFault):
                recorder.end()

    def _require_running(self) -> None:
        if not self._running:
            raise Refused(f"{self._device} has not been started", "call start() first")

    def _streaming(self) -> Recorder:
        if self._recorder is None:
            raise Refused(f"{self._device} does not stream", "call begin() first")
        return self._recorder


def _numbers(outputs: bytes) -> tuple[bytes, ...]:
    """Return temperature and rates out of all outputs, two bytes each; the accelerometer is off."""
    return outputs[0:2], outputs[8:10], outputs[10:12], outputs[12:14]
