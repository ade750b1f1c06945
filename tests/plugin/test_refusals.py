"""What is wrong with a plan, a bench or a request is told before anything is driven, and leaves nothing behind."""

from __future__ import annotations

import pytest
from workspaces import HEAD, make

from hil.model.errors import ConfigurationError, HilError, Refused

GOOD = """
@pytest.mark.requirement("T-010")
def test_one(check):
    check("T-010", "ratio", 1.0)
"""
FIRST = len(HEAD.splitlines()) + 3  # the line of a first case behind the imports


def refused(tmp_path, *cases, kind=ConfigurationError, prepare=None, **changes):
    """Return the sentence with which a run is refused; no folder of a run is left."""
    workspace = make(tmp_path / "workspace", *cases)
    if prepare:
        prepare(workspace)
    with pytest.raises(kind) as caught:
        workspace.run(**changes)
    assert workspace.folders() == []
    return str(caught.value)


@pytest.mark.parametrize(
    ("marker", "message"),
    [
        ('requirement("T-01O")', "unknown requirement 'T-01O', did you mean 'T-010'?"),
        ('requirement("T-060")', "requirement 'T-060' is withdrawn, take it from the marker of test_one"),
        ('requirement(id="T-010")', "requirement of test_one takes ids and nothing else"),
        ("requirement()", "requirement of test_one takes ids and nothing else"),
        ("max_duration('ten')", "max_duration of test_one takes one number of seconds above zero"),
        ("max_duration(0)", "max_duration of test_one takes one number of seconds above zero"),
        ("max_duration(seconds=5)", "max_duration of test_one takes one number of seconds above zero"),
        ("max_duration(float('nan'))", "max_duration of test_one takes one number of seconds above zero"),
    ],
)
def test_a_marker_that_cannot_be_followed_is_refused(tmp_path, marker, message):
    """The place and the nearest id are told."""
    said = refused(tmp_path, f"@pytest.mark.{marker}\ndef test_one(check):\n    pass")
    assert said == f"testplans/small/test_small.py:{FIRST}:1: {message}"


def test_a_parameter_that_the_catalogue_does_not_hold_is_refused(tmp_path):
    """A check is compared with the catalogue before its case runs."""
    said = refused(tmp_path, GOOD.replace('"ratio"', '"rati"'))
    assert said.startswith(f"testplans/small/test_small.py:{FIRST + 2}:5: ")
    assert said.endswith("T-010 has no parameter 'rati', did you mean 'ratio'?")


def test_an_unknown_marker_is_refused(tmp_path):
    """A misspelt marker would make an orphan of its case."""
    assert "'requirment' not found" in refused(tmp_path, GOOD.replace("mark.requirement", "mark.requirment"))


def test_what_a_requirement_wants_over_parameters_must_be_covered(tmp_path):
    """A board without a case is told before the run, not found missing after it."""
    cases = """
    @pytest.mark.requirement("T-070")
    @pytest.mark.parametrize("board", ["a"])
    def test_one(board, check):
        check("T-070", "ratio", 1.0)
    """
    assert refused(tmp_path, cases).endswith("T-070 wants every board, no case covers b")


def test_a_fixture_that_nothing_provides_is_refused(tmp_path):
    """A misspelt role costs no arming."""
    said = refused(tmp_path, "def test_one(suply):\n    pass")
    assert said.endswith("test_one asks for 'suply', which nothing provides, did you mean 'supply'?")


def test_fixtures_of_every_kind_are_found(tmp_path):
    """Roles, the executive's own, pytest's own, the workspace's and a module's fixtures are all provided."""
    cases = """
    @pytest.fixture
    def mine(request):
        return request.param

    @pytest.mark.parametrize("given", [1])
    @pytest.mark.parametrize("mine", [2], indirect=True)
    def test_one(given, mine, tmp_path, request, monkeypatch, coil, field, relays, step, clock, iterations):
        assert (given, mine) == (1, 2)
    """
    assert make(tmp_path / "workspace", cases).run().verdicts() == {"test_one[2-1]": "NOT_EVALUATED"}


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("def test_one(:\n    pass", FIRST, "SyntaxError: "),
        ("import nosuchthing", FIRST, "ModuleNotFoundError: No module named 'nosuchthing'"),
        ("def broken():\n    1 / 0\n\n\nbroken()", FIRST + 1, "ZeroDivisionError: division by zero"),
    ],
)
def test_a_module_that_cannot_be_collected_is_told_in_one_line(tmp_path, text, place, message):
    """What is wrong with a plan's module is a sentence with its place, not a traceback."""
    said = refused(tmp_path, text)
    assert said.startswith(f"testplans/small/test_small.py:{place}:1: {message}"), said
    assert "\n" not in said


def test_a_module_that_cannot_be_collected_is_told_first(tmp_path):
    """That a broken module's cases cover nothing is no news."""

    def prepare(workspace):
        (workspace.plan / "test_broken.py").write_text("import nosuchthing\n")

    cases = '@pytest.mark.requirement("T-070")\ndef test_one():\n    pass'
    said = refused(tmp_path, cases, prepare=prepare)
    assert said == "testplans/small/test_broken.py:1:1: ModuleNotFoundError: No module named 'nosuchthing'"


def test_a_module_does_not_skip_itself(tmp_path):
    """Cases that vanish before they are planned would be missed by nobody."""
    said = refused(tmp_path, "pytest.skip('not today', allow_module_level=True)", GOOD)
    assert "skip its cases one by one" in said


def test_cases_below_a_plan_are_refused(tmp_path):
    """What is not frozen as evidence does not run."""

    def prepare(workspace):
        (workspace.plan / "deeper").mkdir()
        (workspace.plan / "deeper/test_deep.py").write_text("def test_deep():\n    pass\n")

    said = refused(tmp_path, GOOD, prepare=prepare)
    assert said.startswith("testplans/small/deeper/test_deep.py:1:1: cases stand in the folder of their plan")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def f(:\n    pass\n", "fixtures/bad.py:1:7: SyntaxError: invalid syntax"),
        ("x = 1\nimport nosuchthing\n", "fixtures/bad.py:2:1: ModuleNotFoundError: No module named 'nosuchthing'"),
    ],
)
def test_a_fixture_module_that_cannot_be_loaded_is_told(tmp_path, text, message):
    """The workspace's fixtures are loaded before anything else, and their place is told."""
    workspace = make(tmp_path / "workspace", GOOD, fixtures={"bad.py": text})
    with pytest.raises(ConfigurationError) as caught:
        workspace.run()
    assert str(caught.value) == message
    assert workspace.folders() == []


def test_a_conftest_that_cannot_be_loaded_is_not_a_plan_without_cases(tmp_path, capfd):
    """Pytest names it; the run is refused."""

    def prepare(workspace):
        (workspace.plan / "conftest.py").write_text("import nosuchthing\n")

    assert "could not be collected" in refused(tmp_path, GOOD, kind=Refused, prepare=prepare)
    assert "No module named 'nosuchthing'" in capfd.readouterr().err


def test_a_conftest_above_the_plans_is_nobodys_business(tmp_path):
    """What is not frozen as evidence does not take part."""
    workspace = make(tmp_path / "workspace", GOOD)
    (workspace.root / "conftest.py").write_text("import nosuchthing\n")
    assert workspace.run().code == 0


def test_a_plan_without_cases_has_its_own_code(tmp_path):
    """No cases are no pass, and leave no package."""
    workspace = make(tmp_path / "workspace", "def helper():\n    pass")
    ended = workspace.hil("run", "small", "--bench", "adcs", "--dut", "SIM-ADCS-1", "--source", "simulated")
    assert (ended.code, ended.out, ended.err) == (5, "no cases were found in these plans\n", "")
    assert workspace.folders() == []


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"plans": ("smal",)}, "there is no plan 'smal', did you mean 'small'?"),
        ({"bench": "adc"}, "adc"),
        ({"dut": "SIM-ADCS-2"}, "no device under test 'SIM-ADCS-2' in fixtures/duts.yaml, did you mean 'SIM-ADCS-1'?"),
        ({"skips": {"test_on": "why"}}, "no case 'test_on' to skip, did you mean 'test_one'?"),
        ({"overrides": {"curent": "1"}}, "the plan has no parameter 'curent', did you mean 'current'?"),
        ({"overrides": {"current": "much"}}, "'much' is no value for parameter 'current'"),
    ],
)
def test_a_name_that_does_not_exist_is_refused_with_the_nearest(tmp_path, changes, message):
    """Plans, benches, articles, cases and parameters are all told apart before anything is opened."""
    assert message in refused(tmp_path, GOOD, kind=HilError, **changes)


def test_a_second_case_of_that_name_cannot_be_skipped_by_it(tmp_path):
    """A name that could be two cases skips neither."""

    def prepare(workspace):
        (workspace.plan / "test_other.py").write_text("def test_one():\n    pass\n")

    said = refused(tmp_path, GOOD, kind=Refused, prepare=prepare, skips={"test_one": "why"})
    assert said.startswith("several cases 'test_one' to skip")
