"""Instruments that a person reads: what stands behind the figure, and which names are refused."""

from __future__ import annotations

from dataclasses import replace

import pytest
from case_parts import CALIBRATION, Case
from typed_events import event_of
from workspaces import make

from hil.executive.cases.effects import Recall
from hil.executive.people.questions import Answer
from hil.executive.setup.configuration import configure
from hil.executive.setup.hand_instruments import HandInstrument
from hil.model.bench import InstrumentSpec
from hil.model.errors import ConfigurationError, Misused

DMM = HandInstrument(
    spec=InstrumentSpec(name="DMM-017", driver="", calibration=CALIBRATION, register="DMM-017"),
    label="DMM-017, Keysight 34465A, serial MY1",
)
BARE = HandInstrument(
    spec=replace(DMM.spec, name="DMM-018", calibration=None), label="DMM-018, Keysight 34465A, serial MY2"
)
HAND = {"DMM-017": DMM, "DMM-018": BARE}
ANSWERED = frozenset({"asks"})


class Says:
    """Answers with one number."""

    def __init__(self, value: float) -> None:
        self.value = value

    def answer(self, question):
        """Answer."""
        del question
        return Answer(self.value, "Ada")


def asked(folder, value=5.0, recall=None, **more):
    """Let somebody read a voltage; return the case and the figure."""
    case = Case(folder, "T-050", answers=Says(value), recall=recall, hand=HAND)
    return case, case.run.operator.measure("Read it", more.pop("unit", "V"), name="meter", **more)


def test_a_hand_instrument_stands_behind_its_figure(tmp_path):
    """Its name, the answer, and the uncertainty of its certificate; the person is told which one to take."""
    case, figure = asked(tmp_path, instrument="DMM-017")
    assert figure.uncertainty == pytest.approx((0.002 + 0.01 * 5) / 2)
    assert (figure.provenance.instruments, figure.provenance.sources) == (("DMM-017",), ("answer to meter",))
    assert figure.provenance.unproven == figure.provenance.uncovered == ()
    (question,) = case.written.of("question")
    assert (question["text"], question["instrument"]) == (
        "Read it (with DMM-017, Keysight 34465A, serial MY1)",
        "DMM-017",
    )
    case.run.check("T-050", "voltage", figure)
    (check,) = case.written.of("check")
    assert (check["instruments"], check.get("unproven", ())) == (("DMM-017",), ())
    assert "psu1" not in case.run.used


def test_a_certificate_is_looked_up_in_its_own_unit(tmp_path):
    """5000 mV are 5 V."""
    _, figure = asked(tmp_path, 5000.0, unit="mV", instrument="DMM-017")
    assert figure.uncertainty == pytest.approx(26.0)


@pytest.mark.parametrize(
    ("more", "field", "sentence"),
    [
        ({}, "unproven", "the answer to meter was read off an instrument that the bench does not know"),
        (
            {"instrument": "DMM-017", "uncertainty": 1e-9},
            "unproven",
            "its uncertainty was written by hand, below that of the certificate of DMM-017",
        ),
        ({"instrument": "DMM-017", "value": 50.0}, "uncovered", "no range in the certificate of DMM-017 covers 50 V"),
        ({"instrument": "DMM-017", "unit": "ohm"}, "uncovered", "the certificate of DMM-017 covers nothing in ohm"),
        ({"instrument": "DMM-018"}, "uncovered", "DMM-018 has no calibration record"),
    ],
)
def test_what_is_not_proven_of_a_reading_is_a_sentence(tmp_path, more, field, sentence):
    """No instrument named, a made-up uncertainty, and what no certificate covers: none of these closes anything."""
    _, figure = asked(tmp_path, **more)
    assert getattr(figure.provenance, field) == (sentence,)


def test_a_larger_uncertainty_is_taken_as_it_is(tmp_path):
    """Somebody who knows that the reading is worse than the certificate may say so."""
    _, figure = asked(tmp_path, instrument="DMM-017", uncertainty=0.5)
    assert (figure.uncertainty, figure.provenance.unproven) == (0.5, ())


def test_a_name_that_was_computed_is_refused_and_cannot_be_swallowed(tmp_path):
    """What no plan names was not frozen; the call says so, and the case is an ERROR even if it goes on."""
    with pytest.raises(Misused, match=r"names a hand instrument 'DMM-17', did you mean 'DMM-017'\?") as caught:
        asked(tmp_path / "1", instrument="DMM-17")
    assert "write it as a text in the call" in caught.value.hint
    case = Case(tmp_path / "2", hand=HAND)
    with pytest.raises(Misused):
        case.run.operator.measure("Read it", "V", name="meter", instrument="DMM-17")
    assert (case.run.outcome().verdict, case.written.of("question")) == ("ERROR", [])


def test_a_replayed_answer_has_the_same_origin(tmp_path):
    """The journal holds the answer only; what stands behind it comes from the register again."""
    case, before = asked(tmp_path / "1", instrument="DMM-017")
    recall = Recall([event_of(**event) for event in case.written.of("effect")], ANSWERED)
    again, after = asked(tmp_path / "2", 4.0, recall, instrument="DMM-017")
    assert (after, after.provenance) == (before, before.provenance)
    assert again.written.of("question") == []


CASE = """
METER = "PSU-O1"

@pytest.mark.requirement("T-050")
def test_asking(operator, check):
    operator.measure("Read it", "V", name="one", instrument="PSU-1")
    operator.measure("Read it", "V", name="two", instrument=METER)
"""


def test_names_that_the_register_does_not_have_end_the_command(tmp_path):
    """Before anything is opened: file, line, and the nearest name, also of a constant."""
    workspace = make(tmp_path / "workspace", CASE)
    with pytest.raises(ConfigurationError) as caught:
        configure(workspace.request())
    unknown = "there is no instrument '{}' in fixtures/instruments.yaml, did you mean 'PSU-01'?"
    assert [str(each) for each in caught.value.findings] == [
        f"testplans/small/test_small.py:12:61: {unknown.format('PSU-1')}",
        f"testplans/small/test_small.py:13:61: {unknown.format('PSU-O1')}",
    ]


def test_a_certificate_that_is_not_there_ends_the_command(tmp_path):
    """As it does for an instrument of the bench."""
    workspace = make(tmp_path / "workspace", CASE.replace("PSU-O1", "PSU-01").replace("PSU-1", "PSU-01"))
    (workspace.root / "fixtures/certificates/psu-01-2026.txt").unlink()
    with pytest.raises(ConfigurationError, match="PSU-01, fixtures/instruments.yaml: the file .* is missing"):
        configure(workspace.request())
