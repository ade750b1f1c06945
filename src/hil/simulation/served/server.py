"""Event loop of a served bench: descriptors, control socket, and the virtual clock paced by wall time."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Self

from hil.clock.port import NANOSECONDS
from hil.clock.virtual import VirtualClock
from hil.documents.suggest import did_you_mean
from hil.model.bench import InstrumentSpec
from hil.model.errors import Refused
from hil.simulation.served.bench import ServedBench, true_state
from hil.simulation.served.control import Control
from hil.simulation.served.ends import NetworkEnd, SerialEnd, Watch, look
from hil.simulation.served.folder import ServedFolder
from hil.wire.keys import announce_served
from hil.wire.opening import url_of_resource

__all__ = ["Pace", "Server"]

_STEP_NS = NANOSECONDS
_BUDGET_S = 0.1


class Pace:
    """Moves a virtual clock up to the scaled wall time, and never beyond it.

    A world that cannot keep up slips: what it could not live through within a tenth of a second of computing is not
    caught up with, so that its clients keep being served. A pause of the process is caught up with where that is
    quick.

    Args:
        wall: seconds on a clock that only goes forward.
        speed: seconds of the bench in one second of the wall.
        now_ns: where the bench's clock stands now.

    Attributes:
        slipped_s: seconds of the wall that the world could not keep up with so far.
    """

    def __init__(self, wall: Callable[[], float], speed: float, now_ns: int = 0) -> None:
        self.speed = speed
        self.slipped_s = 0.0
        self._wall = wall
        self._origin_s = wall() - now_ns / NANOSECONDS / speed

    def present_ns(self) -> int:
        """Return the bench's time that it should be now."""
        return int((self._wall() - self._origin_s) * self.speed * NANOSECONDS)

    def seconds_until(self, when_ns: int) -> float:
        """Return the seconds of the wall until an instant of the bench, 0 if it has come."""
        return max(0.0, when_ns / NANOSECONDS / self.speed - (self._wall() - self._origin_s))

    def follow(self, clock: VirtualClock) -> None:
        """Let everything happen on the bench that is due by now."""
        present_ns, enough_s = self.present_ns(), self._wall() + _BUDGET_S
        while clock.now_ns() < present_ns:
            # In steps, because a plant lives through a wait without events as a whole.
            clock.run(min(present_ns, clock.now_ns() + _STEP_NS), lambda: self._wall() > enough_s, "the served bench")
            if self._wall() > enough_s and clock.now_ns() < present_ns:
                self._slip((present_ns - clock.now_ns()) / NANOSECONDS / self.speed)
                return

    def _slip(self, seconds: float) -> None:
        self._origin_s += seconds
        self.slipped_s += seconds


_LOOK_UP_S = 0.02
_LONGEST_WAIT_S = 0.2


class Server:
    """Serves one bench in one folder. Use it as a context: at its end nothing is left in the folder.

    Time of the bench begins with `run`, and nothing happens on the bench outside of it.

    Args:
        bench: the world to serve.
        folder: where the links and the control socket are.
        wall: seconds on a clock that only goes forward.
        wait: waits for descriptors, some seconds of that clock at most.
        speed: seconds of the bench in one second of the wall.
        first_port: where the first network instrument listens, the next ones follow; 0 for any free ports.

    Raises:
        Refused: if the folder or a port cannot be had.

    Attributes:
        ends: the open ends by instrument.
    """

    def __init__(
        self,
        bench: ServedBench,
        folder: Path,
        wall: Callable[[], float],
        *,
        wait: Callable[[Sequence[Watch], float], Sequence[Watch]] = look,
        speed: float = 1.0,
        first_port: int = 0,
    ) -> None:
        self._bench = bench
        self._wall = wall
        self._wait = wait
        self._speed = speed
        self._stopped = False
        self._looked_up_s = wall()
        self.ends: dict[str, SerialEnd | NetworkEnd] = {}
        self._questions: Mapping[str, Callable[[object], object]] = {
            "connect": self._take_connect,
            "ends": self._say_ends,
            "fault": self._take_fault,
            "plug": self._take_plug,
            "state": self._say_state,
            "stop": self._take_stop,
            "time": self._say_time,
            "unplug": self._take_unplug,
        }
        streams = [item for item in bench.spec.instruments if not item.bus]
        with ExitStack() as stack:
            self._folder = ServedFolder(folder, tuple(item.name for item in streams if not _is_network(item)))
            stack.callback(self._folder.leave)
            self._control = Control(self._folder.control, self._answer)
            stack.callback(self._control.close)
            self._open(streams, stack, first_port)
            self._pace = Pace(wall, speed)
            self._closing = stack.pop_all()

    def __enter__(self) -> Self:
        """Return itself; everything is open already."""
        return self

    def __exit__(self, *_: object) -> None:
        """Hang up on everybody and remove what was put into the folder."""
        self._closing.close()

    def stop(self) -> None:
        """Let `run` return soon; may be called by a signal."""
        self._stopped = True

    def run(self) -> None:
        """Serve until stopped."""
        self._pace = Pace(self._wall, self._speed, self._bench.clock.now_ns())
        while not self._stopped:
            self.turn()

    def turn(self) -> None:
        """Wait until something is due, and do it."""
        ready = self._wait(self._watches(), self._patience())
        self._pace.follow(self._bench.clock)
        for watch in ready:
            watch.look()
        self._look_up()

    def _open(self, streams: Sequence[InstrumentSpec], stack: ExitStack, first_port: int) -> None:
        port = first_port
        for item in streams:
            line = self._bench.lines[item.name]
            if not _is_network(item):
                end: SerialEnd | NetworkEnd = SerialEnd(
                    line, self._folder.path / item.name, lambda name: announce_served(name, self._folder.path)
                )
            else:
                try:
                    end = NetworkEnd(line, port)
                except (OSError, OverflowError) as error:
                    raise Refused(f"{item.name}: port {port} is not available: {error}", "name another one") from error
                port += 1 if port else 0
                announced = announce_served(int(end.url.rpartition(":")[2]), self._folder.path)
                stack.callback(os.close, announced)
            self.ends[item.name] = end
            stack.callback(end.unplug)

    def _watches(self) -> list[Watch]:
        return [watch for end in (self._control, *self.ends.values()) for watch in end.watches()]

    def _patience(self) -> float:
        """Return how long nothing has to be done unless somebody says something."""
        due = [line.room_at_ns for line in self._bench.lines.values() if line.is_open and not line.room]
        next_ns = self._bench.clock.next_ns()
        if next_ns is not None:
            due.append(next_ns)
        longest_s = _LOOK_UP_S if any(self._closed_terminals()) else _LONGEST_WAIT_S
        return min([longest_s, *(self._pace.seconds_until(when_ns) for when_ns in due)])

    def _closed_terminals(self) -> list[SerialEnd]:
        return [end for end in self.ends.values() if isinstance(end, SerialEnd) and end.waits_for_client]

    def _look_up(self) -> None:
        now_s = self._wall()
        if now_s - self._looked_up_s >= _LOOK_UP_S:
            self._looked_up_s = now_s
            for end in self._closed_terminals():
                end.look_up()

    def _answer(self, document: Mapping[str, object]) -> Mapping[str, object]:
        """Answer one document of the control socket."""
        if len(document) != 1:
            raise Refused("a document has one key", f"it is one of {', '.join(self._questions)}")
        ((question, content),) = document.items()
        if question not in self._questions:
            hint = f"it is one of {', '.join(self._questions)}"
            raise Refused(f"unknown key '{question}'{did_you_mean(question, self._questions)}", hint)
        return {question: self._questions[question](content)}

    def _say_state(self, path: object) -> object:
        if not isinstance(path, str):
            raise Refused("the state is asked for by a path", 'write for example {"state": "plants.coil"}')
        return true_state(self._bench, path)

    def _say_time(self, _: object) -> object:
        clock = self._bench.clock
        seconds = clock.now_ns() / NANOSECONDS
        return {"bench": seconds, "utc": clock.utc(), "speed": self._speed, "slipped": self._pace.slipped_s}

    def _say_ends(self, _: object) -> object:
        return {name: end.url for name, end in self.ends.items()}

    def _take_fault(self, content: object) -> object:
        if not isinstance(content, Mapping) or not isinstance(content.get("device"), str):
            raise Refused("a fault names its device", 'write for example {"device": "psu1", "kind": "dead"}')
        self._bench.inject(content["device"], {key: value for key, value in content.items() if key != "device"})
        return True

    def _take_connect(self, content: object) -> object:
        words = [content.get(key) for key in ("name", "thing")] if isinstance(content, Mapping) else []
        name, thing = words or (None, None)
        if not isinstance(name, str) or not isinstance(thing, str):
            told = 'write for example {"name": "outer-board", "thing": "x_plus"}'
            raise Refused("what is connected has the name of its question, and what it is", told)
        self._bench.world.person.answer("connect", name, "", (thing,))
        return True

    def _take_plug(self, name: object) -> object:
        end = self._end(name)
        try:
            end.plug()
        except OSError as error:
            raise Refused(f"{name} cannot be plugged: {error}", "end the program that has its port now") from error
        return True

    def _take_unplug(self, name: object) -> object:
        self._end(name).unplug()
        return True

    def _end(self, name: object) -> SerialEnd | NetworkEnd:
        if not isinstance(name, str) or name not in self.ends:
            known = did_you_mean(str(name), self.ends) or f"; known are {', '.join(self.ends)}"
            raise Refused(f"there is no end '{name}'{known}", "name an instrument that is served")
        return self.ends[name]

    def _take_stop(self, _: object) -> object:
        self.stop()
        return True


def _is_network(instrument: InstrumentSpec) -> bool:
    return "://" in url_of_resource(instrument.port)
