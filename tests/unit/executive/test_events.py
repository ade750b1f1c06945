"""Who listens to the events of a run, and what becomes of whom they break."""

from __future__ import annotations

import pytest

from hil.evidence.events import Anomaly, Armed, Effect, Stop
from hil.executive.journaling.events import Events


def shown_to(error):
    """Return which of three events a listener is shown that raises this at the first of them."""
    heard = []

    def listener(event):
        heard.append(event.text)
        if len(heard) == 1:
            raise error

    events = Events(None, None)
    events.listen(listener)
    for text in ("a", "b", "c"):
        events.show(Anomaly(text=text))
    return heard


@pytest.mark.parametrize("error", [KeyError("x"), TypeError("x"), SystemExit(1)], ids=repr)
def test_one_bad_event_does_not_make_a_listener_deaf(error):
    """Who is notified, and who holds the bench, hears what comes next."""
    assert shown_to(error) == ["a", "b", "c"]


@pytest.mark.parametrize("error", [BrokenPipeError(), ValueError("I/O operation on closed file")], ids=repr)
def test_a_display_that_is_gone_is_shown_no_more(error):
    """What it is given would wait in its buffer for ever."""
    assert shown_to(error) == ["a"]


def test_who_listens_to_some_kinds_hears_no_other():
    """Those who listen to all kinds hear every event, in the order in which they began to listen."""
    heard, shown = [], Events(None, None)
    shown.listen(lambda event: heard.append(("all", event.kind())))
    shown.listen(lambda event: heard.append(("stops", event.kind())), Stop)
    for event in (Armed(), Stop(reason="x", urgent=False), Armed()):
        shown.show(event)
    assert heard == [("all", "armed"), ("all", "stop"), ("stops", "stop"), ("all", "armed")]


def test_a_listener_names_what_it_hears():
    """A reading is for nobody who waits for answers, and for nobody at all where nobody waits for anything."""

    class Waiting:
        hears = (Effect, Stop)
        effects = frozenset({"asks"})

        def __init__(self):
            self.heard = []

        def __call__(self, event):
            self.heard.append(getattr(event, "name", "stop"))

    class Idle(Waiting):
        hears = ()

    waiting, idle, shown = Waiting(), Idle(), Events(None, None)
    for each in (waiting, idle):
        shown.listen(each)
    told = {"case": "c", "step": "", "ordinal": 1, "arguments": {}, "result": None}
    for event in (
        Effect(name="supply.voltage", effect="reads", **told),
        Effect(name="operator.confirm", effect="asks", **told),
        Armed(),
        Stop(reason="x", urgent=False),
    ):
        shown.show(event)
    assert waiting.heard == ["operator.confirm", "stop"]
    assert idle.heard == []
