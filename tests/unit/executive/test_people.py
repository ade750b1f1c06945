"""The people that an armed bench needs: somebody on call, and whoever gave safety confirmations."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from case_parts import Written
from typed_events import event_of

from hil.executive.people.on_call import OnCall, People, require_unattended
from hil.executive.people.questions import Answer, Declined
from hil.model.bench import Wire
from hil.model.cutting import CutPath
from hil.model.errors import Refused

RUN = "20261121T093100Z-battery-x-cd60b0"
DEAD_MAN = "heartbeat of the tester opens its relays"


class Phone:
    """Takes notifications; what became of them is as it is told."""

    def __init__(self, became=""):
        self.sent = []
        self.became = became

    def __call__(self, event, text):
        """Take one."""
        self.sent.append((event, text))
        return lambda: self.became

    @property
    def code(self):
        """The code that was sent last."""
        return self.sent[-1][1].partition("--code ")[2].split()[0]


def called(on_call, phone, give, turns=3):
    """Return what comes of reaching somebody who gives back what `give` makes of the code."""
    left = iter(range(turns))

    def idle():
        code = give(phone.code)
        on_call(event_of(kind="reached", by="Ada", ok=on_call.knows(code)))
        return next(left, None) is not None

    return on_call.reach(idle)


def test_the_code_of_the_notification_reaches_whoever_is_on_call():
    """Upper or lower case; the text is the command that is to be typed."""
    phone = Phone()
    on_call = OnCall("Ada", RUN, 600, phone, Written())
    assert called(on_call, phone, str.lower) == ""
    ((event, text),) = phone.sent
    assert event == "test"
    assert text == f"Ada is on call. Type: hil ack {RUN} --code {phone.code} --by NAME"
    assert len(phone.code) == 6


def test_another_code_reaches_nobody(monkeypatch):
    """Nor does one that was sent before, one that comes when none is awaited, or one in letters that no code has."""
    monkeypatch.setattr("hil.executive.people.on_call.wall.pause", lambda _: None)
    phone = Phone()
    on_call = OnCall("Ada", RUN, 600, phone, Written())
    assert not on_call.knows("")
    assert called(on_call, phone, lambda code: code[:-1]) == "the run is to end"
    old = phone.code
    assert not on_call.knows(old)
    assert called(on_call, phone, lambda code: code[:-1] + "Ä") == "the run is to end"
    assert called(on_call, phone, lambda _: old) == "the run is to end"
    assert phone.code != old


def test_nobody_is_awaited_for_ever():
    """Within the time that was given, which is not long here."""
    told = OnCall("Ada", RUN, 0.0, Phone(), Written()).reach(lambda: True)
    assert told == "nobody gave the code of the notification back within 0 s"


def test_a_notification_that_was_not_sent_ends_the_wait():
    """Nobody has the code then."""
    phone = Phone("exit code 3")
    told = OnCall("Ada", RUN, 600, phone, Written()).reach(lambda: True)
    assert told == "the notification was not sent: exit code 3"


class Saying:
    """A person who says this, or declines."""

    def __init__(self, value):
        self.value = value
        self.asked = []

    def answer(self, question):
        """Answer."""
        self.asked.append(question)
        if self.value is None:
            raise Declined("nobody is there")
        return Answer(self.value, "Bob")


def confirmed(people, *, name="fuse", safety=True, value=True):
    """Let a case ask, and somebody answer."""
    question = {"kind": "question", "name": name, "form": "confirm", "text": f"Is the {name} in?"}
    people(event_of(**{**question, **({"safety": True} if safety else {})}))
    people(event_of(kind="answer", name=name, value=value, by="Ada"))


@pytest.mark.parametrize(
    ("value", "ok", "detail"),
    [
        (True, True, "Is the fuse in? yes, says Bob"),
        (False, False, "Is the fuse in? no, says Bob"),
        (None, False, "nobody is there"),
    ],
)
def test_what_was_confirmed_for_safety_is_asked_again_at_the_next_arm(value, ok, detail):
    """Once, and nothing else: not what is no matter of safety, and not what was denied."""
    written, person = Written(), Saying(value)
    people = People(None, person, written, lambda: True)
    assert list(people.gates()) == []
    confirmed(people)
    confirmed(people)
    confirmed(people, name="jig", safety=False)
    confirmed(people, name="lid", value=False)
    (gate,) = people.gates()
    assert (gate.name, gate.ok, gate.detail) == ("confirmed again: fuse", ok, detail)
    assert [question.safety for question in person.asked] == [True]
    assert [(event["name"], event["text"]) for event in written.of("asked-again")] == [("fuse", "Is the fuse in?")]
    assert [(event["value"], event["by"]) for event in written.of("confirmed")] == (
        [] if value is None else [(value, "Bob")]
    )


def test_nobody_on_call_means_not_armed():
    """The gate says why, and who was to be reached where somebody was."""
    phone = Phone("exit code 3")
    (gate,) = People(OnCall("Ada", RUN, 600, phone, Written()), Saying(True), Written(), lambda: True).gates()
    assert (gate.name, gate.ok) == ("person on call", False)
    assert gate.detail == "the notification was not sent: exit code 3"
    phone = Phone()
    people = People(OnCall("Ada", RUN, 600, phone, Written()), Saying(True), Written(), lambda: True)
    people._idle = lambda: people(event_of(kind="reached", by="Bob", ok=True)) is None
    (gate,) = people.gates()
    assert (gate.ok, gate.detail) == (True, "Ada was reached")


def configuration(*, cut_paths=(), notify=("tell",), live=True, unattended=True, on_call="Ada"):
    """Return what the rules look at: a bench with one supply."""
    paths = tuple(CutPath(output="supply.charge", within_s=10, **path) for path in cut_paths)
    wires = (Wire(role="supply", instance="charge", instrument="psu1"),)
    instrument = SimpleNamespace(name="psu1", bus="", port="/dev/psu1")
    spec = SimpleNamespace(
        name="battery",
        wiring=wires,
        cut_paths=paths,
        buses=(),
        wire=lambda _: wires[0],
        instrument=lambda _: instrument,
        instruments=(instrument,),
    )
    request = SimpleNamespace(unattended=unattended, on_call=on_call)
    workspace = SimpleNamespace(notify=notify)
    return SimpleNamespace(request=request, bench=spec, outside=live, workspace=workspace)


TWO = ({"hardware": DEAD_MAN}, {"hardware": "an overvoltage relay"})


def test_a_bench_that_is_fit_for_it_needs_nobody():
    """And an attended run passes whatever the bench has."""
    require_unattended(configuration(cut_paths=TWO))
    require_unattended(configuration(unattended=False, on_call="", notify=()))


@pytest.mark.parametrize(
    ("without", "told"),
    [
        ({"cut_paths": TWO, "on_call": " "}, "name who is on call with --on-call NAME"),
        ({"cut_paths": TWO, "notify": ()}, "notify = "),
        ({"cut_paths": TWO[:1]}, "supply.charge needs 2 cut paths in addition to its own port"),
        ({}, "no cut path that needs no host.*supply.charge needs 2 cut paths"),
        ({"cut_paths": TWO, "live": False}, "--unattended does not apply to a bench simulated in this process"),
        ({"unattended": False}, "--on-call names somebody for a run that is attended"),
    ],
)
def test_what_is_missing_is_told_before_anything_is_opened(without, told):
    """Everything at once."""
    with pytest.raises(Refused, match=told):
        require_unattended(configuration(**without))
