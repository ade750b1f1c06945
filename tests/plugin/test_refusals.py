"""What is wrong with a plan, a bench or a request is told before anything is driven, and leaves nothing behind."""

from __future__ import annotations

import io
import shutil
import sys
import textwrap

import pytest
from workspaces import HEAD, ROOT, make

from hil.model.errors import ConfigurationError, HilError, NoReply, Refused
from hil.model.identity import Source
from hil.plugin.running import run

GOOD = """
@pytest.mark.requirement("T-010")
def test_one(check):
    check("T-010", "ratio", 1.0)
"""
FIRST = len(HEAD.splitlines()) + 3  # the line of a first case after the imports


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
        ('requirement("T-060")', "requirement 'T-060' is withdrawn, remove it from the marker of test_one"),
        ('requirement(id="T-010")', "requirement of test_one takes ids and nothing else"),
        ("requirement()", "requirement of test_one takes ids and nothing else"),
        ("repeatable", "repeatable of test_one takes one reason why it may be repeated"),
        ("repeatable('  ')", "repeatable of test_one takes one reason why it may be repeated"),
        ("repeatable(why='x')", "repeatable of test_one takes one reason why it may be repeated"),
        ("max_duration('ten')", "max_duration of test_one takes one number of seconds above zero"),
        ("max_duration(0)", "max_duration of test_one takes one number of seconds above zero"),
        ("max_duration(seconds=5)", "max_duration of test_one takes one number of seconds above zero"),
        ("max_duration(float('nan'))", "max_duration of test_one takes one number of seconds above zero"),
    ],
)
@pytest.mark.together("@pytest.mark.{marker}\ndef test_one(check):\n    pass")
def test_a_marker_that_cannot_be_followed_is_refused(said, marker, message):
    """The place and the nearest id are told."""
    assert said == [f"{FIRST}:1: {message}"]


def test_a_parameter_that_the_catalogue_does_not_hold_is_refused(tmp_path):
    """A check is compared with the catalogue before its case runs."""
    said = refused(tmp_path, GOOD.replace('"ratio"', '"rati"'))
    assert said.startswith(f"testplans/small/test_small.py:{FIRST + 2}:5: ")
    assert said.endswith("T-010 has no parameter 'rati', did you mean 'ratio'?")


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
    assert said.endswith("test_one requests 'suply', which nothing provides, did you mean 'supply'?")


def test_a_role_that_the_bench_does_not_have_names_the_benches_that_have_it(tmp_path):
    """A plan on the wrong bench is told so, and not that a name is unknown."""

    def beside(workspace):
        shutil.copytree(ROOT / "fixtures/benches/battery", workspace.root / "fixtures/benches/battery")

    said = refused(tmp_path, "def test_one(cycler):\n    pass", prepare=beside)
    assert said.endswith(
        "test_one requests 'cycler', a role that no wire of the bench adcs has: this plan cannot run there;"
        " benches that have it: battery"
    )


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


def test_a_module_does_not_end_the_process(tmp_path):
    """What ends the process while cases are collected is told in one line, too."""
    said = refused(tmp_path, GOOD, "raise SystemExit(0)")
    assert said.startswith(
        "testplans/small/test_small.py: the module ends the process (sys.exit(0)): remove it, a run ends by itself"
    )


LOST = """
{before}
    @pytest.mark.requirement("T-010")
    def {name}(self, check):
        check("T-010", "ratio", 9.0)
"""


@pytest.mark.parametrize(
    ("before", "name"),
    [
        ("class TestBoard:\n    def __init__(self):\n        pass\n", "test_ratio"),
        ("class TestBoard:\n    __test__ = False\n", "test_ratio"),
        ("class Board:", "test_ratio"),
        ("class TestBoard:", "tset_ratio"),
        ("if not math:", "test_ratio"),
    ],
)
@pytest.mark.together(f"{GOOD}\n{LOST}")
def test_a_case_that_pytest_passes_by_is_refused(said, before, name):
    """Whoever takes himself out of the collection, by whatever mistake, would be missed by nobody."""
    (one,) = said
    assert f"{name}' looks like a case, and pytest does not collect it" in one


def test_a_case_in_a_misnamed_file_is_refused(tmp_path):
    """The file's name is what makes pytest look into it."""

    def prepare(workspace):
        (workspace.plan / "tests_more.py").write_text(HEAD + GOOD.replace("test_one", "test_more"))

    assert refused(tmp_path, GOOD, prepare=prepare).startswith(
        f"testplans/small/tests_more.py:{FIRST}:1: 'test_more' looks like a case"
    )


def test_cases_of_a_base_class_and_fixtures_called_like_cases_are_fine(tmp_path):
    """What a class inherits is collected there; a fixture may be called what it likes."""
    cases = """
    class Common:
        @pytest.mark.requirement("T-010")
        def test_ratio(self, check, test_ratio_value):
            check("T-010", "ratio", test_ratio_value)


    class TestBoard(Common):
        @pytest.fixture
        def test_ratio_value(self):
            return 1.0
    """
    ran = make(tmp_path / "workspace", cases).run()
    assert (ran.code, ran.verdicts()) == (0, {"test_ratio": "PASS"})


def test_cases_below_a_plan_are_refused(tmp_path):
    """What is not frozen as evidence does not run."""

    def prepare(workspace):
        (workspace.plan / "deeper").mkdir()
        (workspace.plan / "deeper/test_deep.py").write_text("def test_deep():\n    pass\n")

    said = refused(tmp_path, GOOD, prepare=prepare)
    assert said.startswith("testplans/small/deeper/test_deep.py:1:1: cases belong in the folder of their plan")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def f(:\n    pass\n", "fixtures/bad.py:1:7: SyntaxError: invalid syntax"),
        ("x = 1\nimport nosuchthing\n", "fixtures/bad.py:2:1: ModuleNotFoundError: No module named 'nosuchthing'"),
        ("import sys\nsys.exit(0)\n", "fixtures/bad.py:2:1: SystemExit: 0"),
        (
            "import pytest\npytest.importorskip('nosuchthing')\n",
            "fixtures/bad.py:2:1: Skipped: could not import 'nosuchthing': No module named 'nosuchthing'",
        ),
    ],
)
def test_a_fixture_module_that_cannot_be_loaded_is_told(tmp_path, text, message):
    """The workspace's fixtures are loaded before anything else, and their place is told."""
    workspace = make(tmp_path / "workspace", GOOD, fixtures={"bad.py": text})
    with pytest.raises(ConfigurationError) as caught:
        workspace.run()
    assert str(caught.value) == message
    assert workspace.folders() == []


@pytest.mark.parametrize("place", ["conftest.py", "testplans/conftest.py", "testplans/small/conftest.py"])
def test_a_conftest_around_the_plans_is_refused(tmp_path, place):
    """Its hooks would come between a case and its verdict, and none of it is evidence."""
    hook = """
    import pytest

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_makereport(call):
        call.excinfo = None
        return (yield)
    """

    def prepare(workspace):
        (workspace.root / place).write_text(textwrap.dedent(hook))

    said = refused(tmp_path, GOOD, prepare=prepare)
    assert said.startswith(f"{place}: a conftest.py takes part in the verdicts")
    assert said.endswith("fixtures belong in fixtures/")


HOOKS = [
    ("def pytest_generate_tests(metafunc):\n    pass", "pytest_generate_tests"),
    ("pytest_plugins = ['small']", "pytest_plugins"),
    ("collect_ignore = ['test_other.py']", "collect_ignore"),
    ("if True:\n    from os.path import join as pytest_collection_modifyitems", "pytest_collection_modifyitems"),
]


@pytest.mark.parametrize(("text", "name"), HOOKS, ids=[name for _, name in HOOKS])
def test_hooks_of_a_plan_are_refused(tmp_path, text, name):
    """A plan holds cases, not what decides how cases are counted."""
    said = refused(tmp_path, text, GOOD)
    line = FIRST + text.count("\n") if name.endswith("modifyitems") else FIRST
    assert said.startswith(f"testplans/small/test_small.py:{line}:")
    assert f"'{name}': pytest hooks and plugins would come between a case and its verdict" in said


@pytest.mark.parametrize(("text", "name"), HOOKS, ids=[name for _, name in HOOKS])
def test_hooks_of_a_fixture_module_are_refused(tmp_path, text, name):
    """The workspace's fixtures are a plugin of the run, and bring fixtures only."""
    workspace = make(tmp_path / "workspace", GOOD, fixtures={"more.py": text})
    with pytest.raises(ConfigurationError, match=f"^fixtures/more.py:[12]:[15]: '{name}': pytest hooks"):
        workspace.run()
    assert workspace.folders() == []


def test_hooks_that_a_fixture_module_takes_from_elsewhere_are_refused(tmp_path):
    """Whatever way a hook came into the module, pytest would call it."""
    text = "globals()['pytest_runtest_setup'] = lambda item: None"
    workspace = make(tmp_path / "workspace", GOOD, fixtures={"more.py": text})
    with pytest.raises(ConfigurationError, match="^fixtures/more.py: 'pytest_runtest_setup': pytest hooks"):
        workspace.run()


def test_a_plan_without_cases_has_its_own_code(tmp_path):
    """No cases are no pass, and leave no package."""
    workspace = make(tmp_path / "workspace", "def helper():\n    pass")
    out = io.StringIO()
    assert run(workspace.request(), out) == 5
    assert out.getvalue() == "no cases were found in these plans\n"
    assert workspace.folders() == []


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"plans": ("smal",)}, "there is no plan 'smal', did you mean 'small'?"),
        ({"bench": "adc"}, "adc"),
        ({"dut": "SIM-ADCS-2"}, "no device under test 'SIM-ADCS-2' in fixtures/duts.yaml, did you mean 'SIM-ADCS-1'?"),
        ({"skips": {"test_on": "why"}}, "no case 'test_on' to skip, did you mean 'test_one'?"),
        ({"overrides": {"curent": "1"}}, "the plan has no parameter 'curent', did you mean 'current'?"),
        ({"overrides": {"current": "much"}}, "'much' is not a value for parameter 'current'"),
    ],
)
def test_a_name_that_does_not_exist_is_refused_with_the_nearest(tmp_path, changes, message):
    """Plans, benches, articles, cases and parameters are all told apart before anything is opened."""
    assert message in refused(tmp_path, GOOD, kind=HilError, **changes)


def test_a_case_is_not_skipped_without_a_reason(tmp_path):
    """Why a case is left out is evidence."""
    said = refused(tmp_path, GOOD, kind=Refused, skips={"test_one": " "})
    assert said.startswith("there is no reason to skip 'test_one'")


def test_a_second_case_of_that_name_cannot_be_skipped_by_it(tmp_path):
    """A name that could be two cases skips neither."""

    def prepare(workspace):
        (workspace.plan / "test_other.py").write_text("def test_one():\n    pass\n")

    said = refused(tmp_path, GOOD, kind=Refused, prepare=prepare, skips={"test_one": "why"})
    assert said.startswith("several cases 'test_one' to skip")


TWICE = [
    ("a function", GOOD, FIRST + 6, 1),
    ("after a condition", GOOD.replace("@pytest", "if math.pi:\n    pass\n@pytest"), FIRST + 8, 1),
    ("a name", "test_one = None", FIRST + 5, 1),
    ("an import", "from os.path import join as test_one", FIRST + 5, 1),
    ("taken away", "del test_one", FIRST + 5, 1),
]


@pytest.mark.parametrize(("text", "line", "column"), [each[1:] for each in TWICE], ids=[each[0] for each in TWICE])
def test_a_case_that_another_of_its_name_replaces_is_refused(tmp_path, text, line, column):
    """Python forgets the first of two functions of one name; a requirement would have lost a failing case so."""
    said = refused(tmp_path, GOOD, text)
    assert said.startswith(f"testplans/small/test_small.py:{line}:{column}: 'test_one' replaces the one of line ")


def test_a_method_that_another_of_its_name_replaces_is_refused(tmp_path):
    """Cases in classes are cases."""
    cases = """
    class TestAll:
        def test_one(self, check):
            pass

        def test_one(self, check):
            pass
    """
    said = refused(tmp_path, cases)
    place = f"testplans/small/test_small.py:{FIRST + 4}:5: "
    assert said == f"{place}'test_one' replaces the one of line {FIRST + 1}, which would never run: rename it"


def test_two_cases_of_one_id_are_refused(tmp_path):
    """Parameters that are joined may read alike; the evidence could not tell the cases apart."""
    cases = """
    @pytest.mark.parametrize("b", ["r", "q-r"])
    @pytest.mark.parametrize("a", ["p-q", "p"])
    def test_one(a, b):
        pass
    """
    said = refused(tmp_path, cases)
    assert said.endswith("there are two cases 'test_one[p-q-r]': give their parameters ids that differ")


def test_a_case_that_returns_something_is_refused(tmp_path):
    """Who returns a comparison believes that somebody looks at it."""
    cases = """
    @pytest.mark.parametrize("bound", [1, 2])
    @pytest.mark.requirement("T-010")
    def test_one(check, bound):
        check("T-010", "ratio", 1.0)
        return 1.0 < bound
    """
    said = refused(tmp_path, cases)
    where = f"testplans/small/test_small.py:{FIRST + 4}:1: "
    assert said == f"{where}what test_one returns is ignored: give it to `check`, or return nothing"


@pytest.mark.parametrize(
    ("marker", "message"),
    [
        ("requirment('T-010')", "unknown marker 'requirment', did you mean 'requirement'?"),
        (
            "flaky(reruns=3)",
            "unknown marker 'flaky'; a case can have requirement, max_duration, repeatable, parametrize, skip, skipif",
        ),
    ],
)
def test_a_misspelt_marker_is_told_with_its_line(tmp_path, marker, message):
    """A misspelt marker would make an orphan of its case."""
    said = refused(tmp_path, f"def test_zero():\n    pass\n\n\n@pytest.mark.{marker}\ndef test_one():\n    pass")
    assert said.startswith(f"testplans/small/test_small.py:{FIRST + 4}:1: {message}")


@pytest.mark.parametrize("scope", ["class", "module", "session"])
@pytest.mark.together("""
@pytest.fixture(scope='{scope}')
def coil(supply):
    return supply.coil


def test_one(coil):
    pass
""")
def test_a_fixture_that_would_keep_a_role_for_other_cases_is_refused(said, scope):
    """What a case is handed is its own; it is told before anything is armed, and not by pytest."""
    what = f"the fixture coil requests 'supply', which exists per case: leave out scope='{scope}'"
    assert said == [f"{FIRST}:1: {what}"]


def test_two_fixtures_of_one_name_are_refused(tmp_path):
    """In one file or in two, only one of them would be there; a plan may still have its own."""
    one = "import pytest\n\n\n@pytest.fixture\ndef board():\n    return 1\n"

    def prepare(workspace):
        (workspace.root / "fixtures/a.py").write_text(one)
        (workspace.root / "fixtures/b.py").write_text(one.replace("fixture\n", "fixture(name='board')\n", 1))

    case = "@pytest.fixture\ndef board():\n    return 2\n"
    said = refused(tmp_path, case + "\n\n" + case + "\n\ndef test_one(board):\n    pass", prepare=prepare)
    already = "already: a case would get one of them, rename it"
    small = "testplans/small/test_small.py"
    assert said.splitlines() == [
        f"fixtures/b.py:5:1: there is a fixture 'board' in fixtures/a.py:5 {already}",
        f"{small}:{FIRST + 6}:1: there is a fixture 'board' in {small}:{FIRST + 1} {already}",
    ]


@pytest.mark.parametrize(
    "body",
    ["@wrapped\ndef test_one():\n    yield 1", "async def test_one():\n    pass"],
    ids=["generator", "coroutine"],
)
@pytest.mark.together("""
import functools

def wrapped(function):
    @functools.wraps(function)
    def inner(*arguments, **named):
        return function(*arguments, **named)
    return inner

{body}
""")
def test_a_case_that_would_never_run_is_refused(said, body):
    """The body of a generator or coroutine is not run by calling it."""
    (one,) = said
    assert one.endswith("test_one would be called and never run: a case neither yields nor awaits")


NAMES = [
    ("parameters.curent", "the plan has no parameter 'curent', did you mean 'current'?"),
    ("parameters.length", "parameter 'length' is in cm, say in which unit you want it"),
    ("supply.coyl.enable()", "no 'coyl' among the bench's supply, did you mean 'coil'?"),
    ("supply.coil.enabel()", "supply.coil has no operation 'enabel', did you mean 'enable'?"),
    ("magnetometer.strat()", "magnetometer has no operation 'strat', did you mean 'start'?"),
    (
        "magnetometer.wake()",
        "magnetometer has no operation 'wake'; it has bandwidth, full_scale, resolution, start, stop",
    ),
]
NAMING = "def NAME(parameters, supply, magnetometer):\n    if magnetometer:\n        {expression}"


@pytest.mark.parametrize(("expression", "message"), NAMES, ids=[each[0] for each in NAMES])
@pytest.mark.together(NAMING.replace("NAME", "test_one"))
def test_a_misspelt_name_in_a_case_costs_no_arming(said, expression, message):
    """Parameters, role instances and operations that code writes out are compared before anything runs."""
    (one,) = said
    assert one.startswith(f"{FIRST + 2}:9: {message}")


@pytest.mark.parametrize(("expression", "message"), NAMES, ids=[each[0] for each in NAMES])
@pytest.mark.together(f"@pytest.fixture\n{NAMING.replace('NAME', 'mine')}\n\ndef test_one(mine):\n    pass")
def test_a_misspelt_name_in_a_fixture_costs_no_arming(said, expression, message):
    """Those of the module's own fixtures likewise."""
    (one,) = said
    assert one.startswith(f"{FIRST + 3}:9: {message}")


def test_a_misspelt_parameter_in_a_helper_is_told(tmp_path):
    """A function that cases hand their parameters to is read, too."""
    cases = """
    def helper(text, parameters):
        return parameters.curent

    def other(parameters):
        return parameters.whatever

    def test_one(parameters):
        helper("x", parameters=parameters)
        other({})
    """
    said = refused(tmp_path, cases)
    assert said == f"testplans/small/test_small.py:{FIRST + 1}:12: {NAMES[0][1]}"


def test_names_that_mean_something_else_are_left_alone(tmp_path):
    """A name that code binds again, or that a function is handed something else as, is not the fixture."""
    cases = """
    class Own:
        anything = 1.0

    def helper(supply):
        return supply.voltage().value

    @pytest.mark.requirement("T-010")
    def test_one(parameters, supply, check):
        assert helper(supply.coil) is not None
        assert supply.coil.instrument.name == "psu1"
        parameters = Own()
        check("T-010", "ratio", parameters.anything)
    """
    assert make(tmp_path / "workspace", cases).run().verdicts() == {"test_one": "PASS"}


OWN = [
    (name, f"{given}\ndef test_one({name}):\n    pass")
    for name in ("parameters", "check", "supply")
    for given in (f"@pytest.fixture\ndef {name}():\n    return None\n\n", f"@pytest.mark.parametrize('{name}', [None])")
]


@pytest.mark.parametrize(("name", "source"), OWN)
@pytest.mark.together("{source}")
def test_nobody_takes_the_place_of_the_executives_fixtures(said, name, source):
    """A fixture of its own in place of a role or the parameters would be a deviation that nobody notes."""
    (one,) = said
    assert one.endswith(f"gets a '{name}' that is not the executive's: give that fixture another name")


def test_a_fixture_that_asks_for_what_nothing_provides_is_named(tmp_path):
    """The place is that of the fixture, not of the cases that stand on it."""
    more = "import pytest\n\n\n@pytest.fixture\ndef mine(suply):\n    return suply\n"
    workspace = make(tmp_path / "workspace", "def test_one(mine):\n    pass", fixtures={"more.py": more})
    with pytest.raises(ConfigurationError) as caught:
        workspace.run()
    message = "the fixture mine requests 'suply', which nothing provides, did you mean 'supply'?"
    assert str(caught.value) == f"fixtures/more.py:4:1: {message}"


@pytest.mark.skipif(sys.platform != "linux", reason="hardware is driven on Linux only")
def test_missing_ports_leave_no_run_behind(tmp_path):
    """Nothing was opened, so that there is nothing to seal and nothing that the ledger would miss."""
    said = refused(tmp_path, GOOD, kind=HilError, dut="ADCS-FM-1", source=Source.HARDWARE, epoch="2026-01-01T00:00:00Z")
    assert "if00-port0 is not there; " in said
    assert "; plug the boards in as the bench file says" in said
    assert not (tmp_path / "workspace/reports/.ledger").exists()


@pytest.mark.skipif(sys.platform != "linux", reason="hardware is driven on Linux only")
@pytest.mark.parametrize(
    ("port", "why"),
    [("TCPIP::127.0.0.1::1::SOCKET", "Connection refused"), ("/dev/serial/by-id/usb-x", "it does not exist")],
    ids=["network", "serial"],
)
def test_a_port_that_cannot_be_opened_leaves_no_run_behind(tmp_path, monkeypatch, port, why):
    """The boards are where they should be; one of them is in use, switched off, or does not take the connection."""
    monkeypatch.setattr("hil.bench.live._strangers", lambda _: {})
    monkeypatch.setattr("hil.bench.live._closed_buses", lambda _: ())

    def elsewhere(workspace):
        workspace.change_bench({"TCPIP::192.168.10.21::5025::SOCKET": port})

    said = refused(
        tmp_path,
        GOOD,
        kind=NoReply,
        prepare=elsewhere,
        dut="ADCS-FM-1",
        source=Source.HARDWARE,
        epoch="2026-01-01T00:00:00Z",
    )
    assert said.startswith("psu1: ")
    assert f" cannot be opened: {why}" in said
    assert not (tmp_path / "workspace/reports/.ledger").exists()
