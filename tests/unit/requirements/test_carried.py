"""Which cases carry which requirements, by the sources of the plans."""

from __future__ import annotations

from hil.requirements.carried import carrying_cases

PLAN = """
import pytest

MANY = ("LOAD-020", "LOAD-021")
BY_AXIS = {"x": "LOAD-050", "y": "LOAD-051"}
pytestmark = pytest.mark.requirement("LOAD-001")
raise RuntimeError("nothing of it may run")


@pytest.mark.requirement("LOAD-010", "LOAD-011")
@pytest.mark.max_duration(10)
def test_written_out(load):
    ...


@pytest.mark.requirement(*MANY)
async def test_by_name():
    ...


@pytest.mark.requirement(*BY_AXIS.values())
@pytest.mark.requirement(*(f"LOAD-{number}" for number in ("060", "061")), *[f"{name}" for name in MANY])
def test_made_of_texts():
    ...


@pytest.mark.parametrize("axis", ["x", pytest.param("y", marks=pytest.mark.requirement("LOAD-030"))])
def test_in_a_parameter(axis):
    def test_within():
        ...


@pytest.mark.requirement("LOAD-040")
class TestLoad:
    pytestmark = [pytest.mark.requirement("LOAD-041")]

    def test_in_a_class(self):
        ...


@pytest.mark.requirement("LOAD-099")
def helper():
    ...
"""


def test_every_way_to_mark_a_case_is_read_and_nothing_runs(tmp_path):
    """Decorators, names, parameters, classes and `pytestmark` count; what is not a case does not."""
    plan = _plan(tmp_path, PLAN)
    found = {case.case.partition("::")[2]: case.requirements for case in carrying_cases(tmp_path, [plan])}
    assert found == {
        "test_written_out": ("LOAD-001", "LOAD-010", "LOAD-011"),
        "test_by_name": ("LOAD-001", "LOAD-020", "LOAD-021"),
        "test_made_of_texts": ("LOAD-001", "LOAD-050", "LOAD-051", "LOAD-060", "LOAD-061", "LOAD-020", "LOAD-021"),
        "test_in_a_parameter": ("LOAD-001", "LOAD-030"),
        "TestLoad::test_in_a_class": ("LOAD-001", "LOAD-040", "LOAD-041"),
    }


def test_a_case_has_its_id_and_its_place(tmp_path):
    """Ids are those of packages, without parameters."""
    (case,) = carrying_cases(tmp_path, [_plan(tmp_path, "\ndef test_one(): ...\n")])
    assert (case.case, case.place, case.marked) == (
        "testplans/load/test_load.py::test_one",
        "testplans/load/test_load.py:2",
        False,
    )


def test_a_marker_that_computes_its_ids_is_a_marker_all_the_same(tmp_path):
    """What is not written out is not known, and the case is no orphan."""
    for argument in (
        "*found()",
        "*(f'LOAD-{n:03}' for n in MANY)",
        "*(n for n in MANY if n)",
        "*MANY.values(1)",
        "*SELF",
    ):
        text = f"SELF = (*SELF,)\nMANY = ('010',)\n@pytest.mark.requirement({argument})\ndef test_one(): ...\n"
        (case,) = carrying_cases(tmp_path, [_plan(tmp_path, text)])
        assert (case.requirements, case.marked) == ((), True), argument


def test_what_python_cannot_read_has_no_cases(tmp_path):
    """A file that cannot be collected covers nothing, and the audit goes on."""
    assert carrying_cases(tmp_path, [_plan(tmp_path, "def test_one(:\n")]) == ()
    assert carrying_cases(tmp_path, [_plan(tmp_path, "x = " + "(" * 500 + ")" * 500)]) == ()


def _plan(folder, text):
    plan = folder / "testplans/load"
    plan.mkdir(parents=True, exist_ok=True)
    (plan / "test_load.py").write_text(text, encoding="utf-8")
    return plan
