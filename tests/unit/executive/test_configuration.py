"""Configurations: everything that a run is made of is read, and everything that is wrong is told at once."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import pytest
from workspaces import ROOT, Workspace, make

from hil.executive.setup.configuration import Request, configure, reach_of
from hil.model.errors import ConfigurationError, Refused
from hil.model.identity import Purpose, Source

CASES = "def test_one():\n    pass"


def test_a_request_becomes_a_configuration(tmp_path):
    """Plans, catalogue, parameters, bench and article are all there; the reports are the workspace's."""
    workspace = make(tmp_path / "workspace", CASES)
    found = configure(workspace.request())
    assert found.plans == (workspace.plan,)
    assert "T-010" in found.catalogue.ids
    assert found.parameters["small"].current == 0.01
    assert (found.bench.name, found.dut.serial, found.reports) == ("adcs", "SIM-ADCS-1", workspace.reports)
    assert found.deviations == ()


def test_everything_that_is_wrong_is_told_at_once(tmp_path):
    """Catalogue, parameters, bench and register: one run of the command finds all of it."""
    workspace = make(tmp_path / "workspace", CASES)
    workspace.change("testplans/small/requirements.yaml", {'max: "1.5", decision': 'max: "0.1", decision'})
    workspace.change("testplans/small/parameters.yaml", {"unit: A": "unit: Amps"})
    workspace.change_bench({"epoch:": "epcoh:"})
    settings = workspace.root / "hil.toml"
    settings.write_text(settings.read_text(encoding="utf-8") + '\nreport = "out"\n', encoding="utf-8")
    workspace.change("fixtures/duts.yaml", {'model: EM, hardware: "B"': 'model: XM, hardware: "B"'})
    with pytest.raises(ConfigurationError) as caught:
        configure(workspace.request())
    files = {finding.path for finding in caught.value.findings}
    assert files == {
        "fixtures/benches/adcs/bench.yaml",
        "fixtures/duts.yaml",
        "hil.toml",
        "testplans/small/parameters.yaml",
        "testplans/small/requirements.yaml",
    }
    assert all(finding.line > 0 for finding in caught.value.findings)


@pytest.mark.parametrize("purpose", [Purpose.ACCEPTANCE, Purpose.QUALIFICATION])
def test_evidence_that_counts_is_not_put_where_no_audit_finds_it(tmp_path, purpose):
    """Runs on hardware go elsewhere until one passes: no ledger of the workspace would know of the FAIL."""
    workspace = make(tmp_path / "workspace", CASES)
    request = replace(workspace.request(), source=Source.HARDWARE, purpose=purpose, output=tmp_path / "elsewhere")
    with pytest.raises(Refused, match=f"--output: a run on hardware for {purpose} goes to reports, whose ledger"):
        configure(request)
    for other in ({"source": Source.SIMULATED, "purpose": Purpose.DEVELOPMENT}, {"output": workspace.reports}):
        with (
            pytest.raises((Refused, ConfigurationError), match=r"^(?!--output)") if "output" in other else nullcontext()
        ):
            configure(replace(request, **other))


def test_a_file_of_the_bench_is_not_overwritten_in_the_package(tmp_path):
    """A bench folder with a calibration.json or a duts.yaml of its own; in a folder below they are no trouble."""
    workspace = make(tmp_path / "workspace", CASES)
    bench = workspace.root / "fixtures/benches/adcs"
    (bench / "notes").mkdir()
    for name in ("calibration.json", "duts.yaml", "notes/duts.yaml"):
        (bench / name).write_text("mine", encoding="utf-8")
    with pytest.raises(ConfigurationError) as caught:
        configure(workspace.request())
    assert [finding.path for finding in caught.value.findings] == [
        "fixtures/benches/adcs/calibration.json",
        "fixtures/benches/adcs/duts.yaml",
    ]
    assert "the package keeps a file of its own by this name" in str(caught.value)


def test_settings_are_told_before_a_name_that_only_they_hide(tmp_path):
    """A plan is not where the misspelt key says it is; which mistake that is has to be told, not its consequence."""
    workspace = make(tmp_path / "workspace", CASES)
    workspace.plan.parent.rename(workspace.root / "plans")
    (workspace.root / "hil.toml").write_text('testplan = "plans"\n', encoding="utf-8")
    with pytest.raises(ConfigurationError) as caught:
        configure(workspace.request())
    assert str(caught.value) == "hil.toml:1:1: unknown key 'testplan', did you mean 'testplans'?"


def test_hardware_is_refused_where_nothing_can_guard_it(tmp_path, monkeypatch):
    """What cannot be made safe after a kill is not driven: a guardian needs Linux."""
    bench = configure(make(tmp_path / "workspace", CASES).request()).bench
    monkeypatch.setattr("sys.platform", "darwin")
    with pytest.raises(Refused, match="hardware is driven on Linux only: .*; use --source simulated here"):
        reach_of(bench, Source.HARDWARE, None)


def test_what_is_served_is_no_hardware(tmp_path):
    """A served bench can never close a requirement."""
    bench = configure(make(tmp_path / "workspace", CASES).request()).bench
    with pytest.raises(Refused, match="a served bench is not hardware; use --source simulated with --served"):
        reach_of(bench, Source.HARDWARE, tmp_path)


def test_hardware_is_where_the_bench_file_says(tmp_path):
    """Ports and buses come from the file, and only one run may hold them."""
    bench = configure(make(tmp_path / "workspace", CASES).request()).bench
    reach = reach_of(bench, Source.HARDWARE, None)
    assert reach.ports == {item.name: item.port for item in bench.instruments if not item.bus}
    assert {*reach.ports.values(), *reach.buses.values()} < set(reach.leases)
    assert "socket://192.168.10.21:5025" in reach.leases
    assert reach.speed == 1.0


def test_an_article_that_is_simulated_only_names_the_option_that_is_missing(tmp_path):
    """Hardware is what a run is on where nobody says otherwise."""
    workspace = make(tmp_path / "workspace", CASES)
    with pytest.raises(Refused, match="SIM-ADCS-1 exists on .* on hardware; is --source simulated missing?"):
        configure(workspace.request(source=Source.HARDWARE))


@pytest.mark.parametrize("purpose", [Purpose.QUALIFICATION, Purpose.ACCEPTANCE])
def test_an_article_that_is_simulated_only_is_never_qualified_or_accepted(tmp_path, purpose):
    """What the register calls simulated has nothing that could be; a real article may be rehearsed with."""
    workspace = make(tmp_path / "workspace", CASES)
    with pytest.raises(Refused, match=f"SIM-ADCS-1 exists on simulated benches only, so there is no {purpose} of it"):
        configure(workspace.request(purpose=purpose))
    assert configure(workspace.request(purpose=Purpose.COMMISSIONING)).dut.simulated
    register = workspace.root / "fixtures/duts.yaml"
    register.write_text(register.read_text().replace("simulated: true,", ""))
    assert not configure(workspace.request(purpose=purpose)).dut.simulated


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"plans": ("smal",)}, r"no plan 'smal', did you mean 'small'\?"),
        ({"bench": "acds"}, r"did you mean 'adcs'\?"),
        (
            {"dut": "SIM-ADCS-2"},
            r"'SIM-ADCS-2' in fixtures/duts.yaml, did you mean 'SIM-ADCS-1'\?",
        ),
    ],
)
def test_a_name_that_does_not_exist_has_a_nearest(tmp_path, changes, message):
    """The nearest name that exists is told."""
    workspace = make(tmp_path / "workspace", CASES)
    with pytest.raises(Refused, match=message):
        configure(workspace.request(**changes))


def test_deviations_are_sentences(tmp_path):
    """A changed parameter and a skipped case are both told."""
    workspace = make(tmp_path / "workspace", CASES)
    found = configure(workspace.request(overrides={"current": "0.02"}, skips={"test_one": "no jig"}))
    assert found.deviations == (
        "parameter current is 0.02 A instead of 0.01 A",
        "case test_one is skipped: no jig",
    )


ANOTHER = '- {serial: SN-1, part: FIT-1, model: QM, hardware: "A"}\n'
SIMULATED = '- {serial: SIM-1, part: FIT-2, model: EM, hardware: "A", simulated: true}\n'


@pytest.mark.parametrize(
    ("register", "source", "hint"),
    [
        (ANOTHER + SIMULATED, Source.SIMULATED, "name one that fits with --dut: SN-1, SIM-1"),
        (ANOTHER + SIMULATED, Source.HARDWARE, "name one that fits with --dut: SN-1"),
        ("", Source.SIMULATED, "no article in fixtures/duts.yaml fits; register it there"),
    ],
    ids=["simulated", "hardware", "none"],
)
def test_an_article_that_a_plan_is_not_for_is_refused(tmp_path, register, source, hint):
    """Those that fit are named; on hardware none that exists on simulated benches only."""
    workspace = make(tmp_path / "workspace", CASES)
    workspace.change(
        "testplans/small/requirements.yaml", {"requirements:\n": "part_numbers: [FIT-1, FIT-2]\nrequirements:\n"}
    )
    duts = workspace.root / "fixtures/duts.yaml"
    duts.write_text(duts.read_text(encoding="utf-8") + register, encoding="utf-8")
    with pytest.raises(Refused) as refused:
        configure(workspace.request(source=source))
    assert refused.value.message == "SIM-ADCS-1 has the part number ADCS-2, but small is for FIT-1 or FIT-2"
    assert refused.value.hint == hint
    if register:
        assert configure(workspace.request(dut="SN-1")).dut.part == "FIT-1"


def test_plans_for_different_articles_are_not_run_together(tmp_path):
    """One article fits one of them at most."""
    workspace = make(tmp_path / "workspace", CASES)
    workspace.change(
        "testplans/small/requirements.yaml", {"requirements:\n": "part_numbers: [ADCS-2]\nrequirements:\n"}
    )
    other = workspace.root / "testplans/other"
    other.mkdir()
    text = (workspace.plan / "requirements.yaml").read_text(encoding="utf-8")
    text = text.replace("ADCS-2", "BAT-1").replace("T-0", "U-0").replace("id: T,", "id: U,")
    (other / "requirements.yaml").write_text(text, encoding="utf-8")
    Workspace(workspace.root, other).lock()
    with pytest.raises(Refused, match="but other is for BAT-1; no article fits all of these plans; run each by itself"):
        configure(workspace.request(plans=("small", "other")))


@pytest.mark.parametrize(
    ("plan", "bench", "dut"),
    [
        ("battery_charge", "battery", "SIM-BAT-1"),
        ("battery_degradation", "battery", "SIM-BAT-1"),
        ("gyroscope", "adcs", "SIM-ADCS-1"),
        ("jig", "adcs", "SIM-ADCS-1"),
        ("magnetorquer", "adcs", "SIM-ADCS-1"),
    ],
)
def test_no_plan_of_this_repository_takes_another_article(plan, bench, dut):
    """A battery's report is about a battery."""
    request = Request(start=ROOT, plans=(plan,), bench=bench, dut=dut, source=Source.SIMULATED)
    assert configure(request).dut.serial == dut
    (other,) = {"SIM-BAT-1", "SIM-ADCS-1"} - {dut}
    with pytest.raises(Refused, match=rf"{other} has the part number .*, but {plan} is for .*; name one .*: {dut}"):
        configure(replace(request, dut=other))
