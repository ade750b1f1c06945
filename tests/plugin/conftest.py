"""Cases that are judged in one run: most of what is asked of a case needs no run of its own."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass

import pytest
import sweeps
from quick_disk import nothing_waits_for_the_disk  # noqa: F401 - a fixture
from read_once import equal_documents_are_read_once  # noqa: F401 - a fixture
from told_as_json import bodies, results_as_json
from workspaces import Ran, agreed, make, module, said_of

from hil.executive.setup import software
from hil.model.errors import ConfigurationError
from hil.model.verdict import Verdict, worst

_SOURCE = functools.cache(software._source)


@pytest.fixture(scope="module", autouse=True)
def _git_is_asked_once_about_the_source():
    """Remember what git says of this package; that it says so is proven in `tests/unit/executive`."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(software, "_source", _SOURCE)
        yield


PARAMETERS = """\
schema: hil/parameters/1
parameters:
- {name: current, value: "0.01", unit: A}
- {name: length, value: "10", unit: cm}
"""


@dataclass(frozen=True)
class Judged:
    """The cases of one test in a run, in a module of their own."""

    ran: Ran
    module: str
    alone: bool

    def agrees(self, **verdicts: str) -> None:
        """Assert that journal, results, JUnit and page say these verdicts of the cases; so does a run of their own."""
        if self.alone:
            verdict = worst(map(Verdict, verdicts.values()))
            passed = verdict in {Verdict.PASS, Verdict.RECORDED}
            agreed(self.ran, verdicts, verdict.value, 0 if passed else 1)
        said_of(self.ran, self.module, verdicts)

    def reasons(self, case: str = "test_one") -> str:
        """Return the reasons of one case, a line each."""
        (found,) = [each for each in results_as_json(self.ran.package)["cases"] if each["case"] == self._named(case)]
        return "\n".join(found["reasons"])

    def events(self, *kinds: str) -> list[Mapping[str, object]]:
        """Return the events of some kinds of these cases."""
        return [event for event in bodies(self.ran.package, *kinds) if str(event["case"]).startswith(self._named(""))]

    def _named(self, case: str) -> str:
        return f"testplans/small/{self.module}::{case}"


def _source(item):
    """Return the module of a test that is marked `together`, its parameters filled in."""
    text = item.get_closest_marker("together").args[0]
    for name, value in getattr(item, "callspec", None).params.items() if hasattr(item, "callspec") else ():
        text = text.replace("{" + name + "}", str(value))
    return text


def _run(folder, items):
    """Run the cases of these tests, each test's in a module of their own."""
    workspace = make(folder / "workspace")
    for number, item in enumerate(items):
        (workspace.plan / f"test_{number:03}.py").write_text(module(_source(item)), encoding="utf-8")
    return workspace.run()


@pytest.fixture(scope="module")
def run_together(request, tmp_path_factory):
    """The run of all cases of a test module that are judged together, and the place of each test's in it."""
    items = [item for item in request.session.items if item.path == request.path and _is_shared(item)]
    return _run(tmp_path_factory.mktemp("together"), items), [item.nodeid for item in items]


def _is_shared(item):
    return item.get_closest_marker("together") is not None


def _refused(folder, items):
    """Return every finding with which a run is refused whose plan holds these tests' modules."""
    workspace = make(folder / "workspace", parameters=PARAMETERS)
    (workspace.plan / "test_small.py").unlink()
    for number, item in enumerate(items):
        (workspace.plan / f"test_{number:03}.py").write_text(module(_source(item)), encoding="utf-8")
    with pytest.raises(ConfigurationError) as caught:
        workspace.run()
    assert workspace.folders() == []
    return caught.value.findings


@pytest.fixture(scope="module")
def refused_together(request, tmp_path_factory):
    """What is said of the modules of all tests of a test module that are refused together, and the place of each."""
    items = [item for item in request.session.items if item.path == request.path and _is_shared(item)]
    return _refused(tmp_path_factory.mktemp("refused"), items), [item.nodeid for item in items]


@pytest.fixture
def said(request, tmp_path):
    """What is said of the module of this test, `line:column: message` each; in a soak in a run of its own."""
    if sweeps.chosen(few=False, whole=True):
        findings, place = _refused(tmp_path, [request.node]), 0
    else:
        findings, nodes = request.getfixturevalue("refused_together")
        place = nodes.index(request.node.nodeid)
    path = f"testplans/small/test_{place:03}.py"
    return [f"{each.line}:{each.column}: {each.message}" for each in findings if each.path == path]


@pytest.fixture
def judged(request, tmp_path):
    """How the cases of this test ended: in one run with those of the other tests, in a soak in one of their own."""
    item = request.node
    if alone := sweeps.chosen(few=False, whole=True):
        ran, place = _run(tmp_path, [item]), 0
    else:
        ran, nodes = request.getfixturevalue("run_together")
        place = nodes.index(item.nodeid)
    return Judged(ran, f"test_{place:03}.py", alone)
