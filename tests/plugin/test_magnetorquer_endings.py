"""Each ending of the magnetorquer plan that a fault of the simulated bench leads to, and its replay."""

from __future__ import annotations

import pytest
import sweeps
from magnetorquer_runs import others, run_here, with_faults, workspace
from told_as_json import bodies, results_as_json

from hil.plugin.rehearsing import replay

pytestmark = pytest.mark.system

BOARD = "x_plus"
TRUTH = 'x_plus: {resistance: "97.9"}'
POLARITY, LINEARITY, COMPASS = (
    f"{case}[{BOARD}]" for case in ("test_polarity", "test_linearity", "test_direction_by_compass")
)
FROM = "from: 10 s"  # after arming, in the first case


def ended(tmp_path, changes):
    """Run the cases of one board, and return the run, its verdicts, and what its replay showed."""
    ran = run_here(workspace(tmp_path / "workspace", changes), skips=others(BOARD))
    return ran, ran.verdicts(), replay(ran.package).differences


def test_a_healthy_bench_passes(tmp_path):
    """Without a fault all three cases of the board pass: what the others show comes from their faults."""
    _, verdicts, differences = ended(tmp_path, {})
    assert verdicts == {POLARITY: "PASS", LINEARITY: "PASS", COMPASS: "PASS"}
    assert differences == ()


@pytest.mark.parametrize(
    ("device", "fault", "code", "said"),
    sweeps.sample(
        [
            ("mag1", f"{{kind: dead, {FROM}}}", 1, "no acknowledge at address 0x1c"),
            ("mag1", f"{{kind: stuck, {FROM}}}", 1, "16 consecutive samples are equal"),
            ("psu1", f"{{kind: garbled, {FROM}}}", 7, "psu1: asked `*IDN?"),
            ("psu1", f"{{kind: garbled, {FROM}, until: 12 s}}", 1, "psu1: asked `*IDN?"),
            ("psu1", f"{{kind: late, {FROM}, by: 600 ms}}", 7, "nothing came within 0.5 s"),
            ("psu1", f"{{kind: chatty, {FROM}, every: 3 ms}}", 7, "arrived unsolicited"),
            ("psu1", f"{{kind: refuse-off, {FROM}}}", 7, "supply.coil was switched off and is on"),
            ("relay1", f"{{kind: dead, {FROM}}}", 7, "unit 1 gave no reply within 0.5 s"),
        ],
        3,
    ),
)
def test_silence_and_nonsense_of_the_bench_are_errors(tmp_path, device, fault, code, said):
    """The case is ERROR, those after it are NOT_RUN, and the exit code tells whether the bench could be made safe."""
    ran, verdicts, differences = ended(tmp_path, with_faults(device, fault))
    assert verdicts == {POLARITY: "ERROR", LINEARITY: "NOT_RUN", COMPASS: "NOT_RUN"}
    assert (ran.code, results_as_json(ran.package)["verdict"]) == (code, "ERROR")
    assert said in ran.reasons()
    assert differences == ()


@pytest.mark.parametrize(
    ("device", "value", "said"),
    [
        ("psu1", "ACME,E36312A,MY1,1.0", "expected manufacturer 'Keysight Technologies', found 'ACME'"),
        ("mag1", "0x3C", "expected model 'LIS3MDL', found 'WHO_AM_I 0x3c'"),
    ],
)
def test_a_wrong_identity_is_never_armed(tmp_path, device, value, said):
    """No case begins on a bench with another instrument."""
    ran, verdicts, differences = ended(tmp_path, with_faults(device, f'{{kind: identity, value: "{value}"}}'))
    assert set(verdicts.values()) == {"NOT_RUN"}
    assert ran.code == 1
    assert not bodies(ran.package, "armed", "case")
    assert said in ran.reasons()
    assert differences == ()


def test_a_saturated_magnetometer_is_inconclusive(tmp_path):
    """Readings at the rail are no numbers: nothing that depends on them passes or fails."""
    _, verdicts, differences = ended(tmp_path, with_faults("mag1", f"{{kind: saturated, {FROM}}}"))
    assert verdicts == {POLARITY: "INCONCLUSIVE", LINEARITY: "INCONCLUSIVE", COMPASS: "PASS"}
    assert differences == ()


def test_a_supply_that_measures_no_number_trips_the_bench(tmp_path):
    """A monitor that reads no number trips: the case is ERROR, and nothing further runs."""
    ran, verdicts, differences = ended(tmp_path, with_faults("psu1", f"{{kind: not-a-number, {FROM}}}"))
    assert verdicts == {POLARITY: "ERROR", LINEARITY: "NOT_RUN", COMPASS: "NOT_RUN"}
    assert "is not a number" in ran.reasons()
    assert ran.code == 7  # the proof of the safe state is a measurement, too
    assert differences == ()


def test_an_output_that_lies_about_being_off_is_unsafe(tmp_path):
    """What says off and goes on feeding is found by the proof of the safe state, whatever the cases say."""
    ran, _, differences = ended(tmp_path, with_faults("psu1", f'{{kind: refuse-off, {FROM}, says: "off"}}'))
    assert (ran.code, results_as_json(ran.package)["verdict"]) == (7, "ERROR")
    assert differences == ()


@pytest.mark.parametrize("contact", ["1", "2"])
def test_a_bench_with_a_welded_contact_is_never_armed(tmp_path, contact):
    """It reads back as released; arm sees the current that it lets through, and no case is run."""
    changes = {'      connects: {"1"': f'      truth: {{welded: ["{contact}"]}}\n      connects: {{"1"'}
    ran, verdicts, differences = ended(tmp_path, changes)
    assert verdicts == dict.fromkeys((POLARITY, LINEARITY, COMPASS), "NOT_RUN")
    assert "the bench was not armed: reduced level of supply.coil, relays " in ran.reasons()
    assert ran.code == 1
    assert differences == ()


@pytest.mark.parametrize(
    "changes",
    [
        with_faults("relay1", '{kind: welded, contact: "2", from: 10 s}'),
        {TRUTH: "x_plus: {broken: true}"},
    ],
    ids=["welded later", "broken winding"],
)
def test_a_coil_without_a_field_never_passes(tmp_path, changes):
    """A contact that sticks, or an open winding: no case passes, and no sense is reported."""
    ran, verdicts, differences = ended(tmp_path, changes)
    assert verdicts == {POLARITY: "FAIL", LINEARITY: "INCONCLUSIVE", COMPASS: "FAIL"}
    sense = next(check for check in bodies(ran.package, "check") if check["parameter"] == "sense")
    assert sense["verdict"] == "INCONCLUSIVE"
    assert differences == ()


def test_an_action_that_raised_is_written_down(tmp_path):
    """The effect during which a device fell silent says what was raised, and its replay agrees."""
    ran, _, differences = ended(tmp_path, with_faults("psu1", f'{{kind: garbled, {FROM}, share: "0.02"}}'))
    raised = [effect["raised"] for effect in bodies(ran.package, "effect") if "raised" in effect]
    assert raised
    assert all(effect["result"] is None for effect in bodies(ran.package, "effect") if "raised" in effect)
    assert differences == ()


def test_a_replay_that_diverges_is_told_of_an_error_too(tmp_path):
    """A case that was ERROR, and is ERROR in the replay for another reason, did not repeat."""
    ran, _, _ = ended(tmp_path, with_faults("mag1", f"{{kind: dead, {FROM}}}"))
    transcript = ran.package.transcript_path
    lines = transcript.read_text().splitlines(keepends=True)
    transcript.write_text("".join(lines[: len(lines) // 2]))
    differences = replay(ran.package).differences
    assert any("the record has ended" in difference for difference in differences), differences
