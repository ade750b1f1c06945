"""Façades: what a case holds instead of a role."""

from __future__ import annotations

import pytest
from case_parts import Case
from typed_events import event_of

from hil.executive.cases.effects import Recall
from hil.executive.cases.facade import Facade, RoleSet
from hil.executive.ending.stop import Stopped
from hil.model.bench import InstrumentSpec, Wire
from hil.model.errors import Misused, NoReply
from hil.model.figure import Figure


def test_an_unknown_operation_names_the_nearest(tmp_path):
    """A misspelt operation is told with the role instance and a way out."""
    case = Case(tmp_path)
    with pytest.raises(AttributeError, match=r"supply.coil has no operation 'voltgae', did you mean 'voltage'\?"):
        case.coil.voltgae()


def test_only_the_operations_of_the_role_are_there(tmp_path):
    """What a driver can do besides is not a case's business."""
    case = Case(tmp_path)
    with pytest.raises(AttributeError, match="no operation 'calls'"):
        case.coil.calls  # noqa: B018 - the attribute is the test


def test_a_call_is_an_effect_of_its_kind(tmp_path):
    """Driving and reading are told apart, and arguments have their names however they were given."""
    case = Case(tmp_path)
    case.coil.configure(5.0, current=0.1)
    case.coil.voltage()
    effects = [(each["name"], each["effect"], each["arguments"]) for each in case.written.of("effect")]
    assert effects == [
        ("supply.coil.configure", "drives", {"voltage": 5.0, "current": 0.1}),
        ("supply.coil.voltage", "reads", {}),
    ]
    assert case.supply.calls[0] == ("configure", (5.0, 0.1))


def test_a_call_with_wrong_arguments_drives_nothing(tmp_path):
    """The role is not reached, nothing is written, and the operation is named."""
    case = Case(tmp_path)
    with pytest.raises(TypeError, match="supply.coil.configure: missing a required argument: 'current"):
        case.coil.configure(5.0)
    assert (case.supply.calls, case.written.events) == ([], [])


@pytest.mark.parametrize(
    "voltage", ["5", True, None, Figure(value=5.0, unit="V")], ids=["text", "flag", "none", "figure"]
)
def test_what_is_no_number_drives_nothing(tmp_path, voltage):
    """A text parameter, a flag or a figure in place of a number is told with operation and argument."""
    case = Case(tmp_path)
    with pytest.raises(Misused, match=r"supply.coil.configure: voltage is a number, found "):
        case.coil.configure(voltage, 0.1)
    assert (case.supply.calls, case.written.events) == ([], [])


@pytest.mark.parametrize("channel", ["A0", 1.0, True, None])
def test_what_is_no_whole_number_is_not_asked(tmp_path, channel):
    """An input of a board has a number; its printed name never reaches the board."""
    case = Case(tmp_path)
    wire = Wire(role="obc", instrument="obc1")
    obc = Facade(wire, InstrumentSpec(name="obc1", driver="obc-link"), object(), case.run.effects, case.run)
    with pytest.raises(Misused, match="obc.analog: channel is a whole number, found "):
        obc.analog(channel)


def test_readings_carry_the_certificate_of_their_instrument(tmp_path):
    """The expanded uncertainty of the certificate is halved; where no range covers a reading it is unknown."""
    case = Case(tmp_path)
    assert case.coil.voltage().uncertainty == pytest.approx((0.002 + 0.01 * 5.0) / 2)
    assert case.coil.current().uncertainty is None


def test_every_call_is_a_scheduling_point(tmp_path):
    """A stop is found before the instrument is reached."""
    case = Case(tmp_path)
    case.flags.request("SIGINT")
    with pytest.raises(Stopped):
        case.coil.disable()
    assert case.supply.calls == []


def test_a_fault_is_noted_even_if_the_case_swallows_it(tmp_path):
    """What was silent, and whose it is, is written before the case learns of it."""
    case = Case(tmp_path)
    case.supply.fault = NoReply("psu1", "nothing came", "look at the cable")
    with pytest.raises(NoReply):
        case.coil.voltage()
    (fault,) = case.written.of("fault")
    assert (fault["device"], fault["dut"], fault["error"], fault["hint"]) == (
        "psu1", False, "NoReply", "look at the cable",
    )  # fmt: skip
    assert case.run.bench_fault.startswith("psu1: nothing came")


def test_what_a_case_uses_is_noted(tmp_path):
    """The instruments behind a case decide what its evidence is worth."""
    case = Case(tmp_path)
    assert case.run.used == {}
    case.coil.voltage()
    case.field.sample()
    assert case.run.used == {"psu1": "simulated", "mag1": "simulated"}


def test_what_a_role_reads_is_recorded(tmp_path):
    """A supply's read-backs are channels; the recording has what its certificate says, and no effect per sample."""
    case = Case(tmp_path)
    with case.run.record.during("rail", case.coil, rate=10.0) as rail:
        case.scheduler.sleep(0.95)
    assert (rail.recording["voltage"].tolist(), rail.recording.unit("current")) == ([5.0] * 10, "A")
    assert rail.recording.uncertainty("voltage") == pytest.approx((0.002 + 0.01 * 5.0) / 2)
    assert [each["name"] for each in case.written.of("effect")] == ["record.rail.begin", "record.rail.end"]


def test_what_reads_nothing_is_not_recorded(tmp_path):
    """Relays measure nothing; the message names them."""
    case = Case(tmp_path)
    wire = Wire(role="relays", instrument="relay1")
    relays = Facade(wire, InstrumentSpec(name="relay1", driver="waveshare-relay"), object(), case.run.effects, case.run)
    with pytest.raises(TypeError, match="relays has no channels"):
        case.run.record("x", relays, duration=1.0, rate=10.0)


def test_a_set_of_roles_names_the_nearest_instance(tmp_path):
    """`supply.coli` is told from `supply.coil`."""
    case = Case(tmp_path)
    roles = RoleSet("supply", {"coil": case.coil})
    assert roles.coil is case.coil
    with pytest.raises(AttributeError, match=r"no 'coli' among the bench's supply, did you mean 'coil'\?"):
        roles.coli  # noqa: B018 - the attribute is the test


def test_a_facade_cannot_be_patched(tmp_path):
    """Wiring, certificate and operations are what the bench file says, whatever a case or a fixture would like."""
    case = Case(tmp_path)
    for name, value in (("instrument", None), ("voltage", lambda: None)):
        with pytest.raises(AttributeError, match=f"supply.coil is what the bench file says, its '{name}'"):
            setattr(case.coil, name, value)
    with pytest.raises(AttributeError, match="supply is what the bench file says, its 'coil'"):
        RoleSet("supply", {"coil": case.coil}).coil = None


@pytest.mark.parametrize("answered", [frozenset(), frozenset({"reads"})])
def test_a_reading_has_the_same_origin_when_the_case_runs_again(tmp_path, answered):
    """Performed again in a replay, or answered from the journal after a resume: the journal holds no provenance."""
    first = Case(tmp_path / "1")
    before = (first.coil.voltage(), first.coil.current())
    recall = Recall([event_of(**event) for event in first.written.of("effect")], answered)
    again = Case(tmp_path / "2", recall=recall)
    after = (again.coil.voltage(), again.coil.current())
    assert after == before
    assert [each.provenance for each in after] == [each.provenance for each in before]
    assert before[0].provenance.instruments == ("psu1",)
    assert before[1].provenance.uncovered == ("the certificate of psu1 covers nothing in A",)
