"""Literal checks are found in a case's code before it runs."""

from __future__ import annotations

from hil.plugin.literals import written_checks


def case(check, name):
    """Hold checks of every kind."""
    for axis in "xyz":
        check("A-010", "noise", 1.0, of=axis)
    check.require("A-010", "offset", 2.0, of="x")
    check(name, "computed", 3.0)
    check("A-020", name, 4.0)


class Holder:
    """Holds a case as a method."""

    def case(self, check):
        """Hold one check."""
        check("A-030", "voltage", 5.0)


def test_literal_checks_are_found_with_their_place():
    """Requirement, parameter and `of` are read from the code; what is computed is left to the run."""
    found = list(written_checks(case))
    assert [(one.requirement, one.parameter, one.of) for one in found] == [
        ("A-010", "offset", "x"),
        ("A-010", "noise", None),
    ]
    first = case.__code__.co_firstlineno
    assert sorted((one.line - first, one.column) for one in found) == [(3, 9), (4, 5)]


def test_methods_are_read_too():
    """Indentation of a class does not shift the place."""
    (found,) = written_checks(Holder.case)
    assert (found.requirement, found.column) == ("A-030", 9)


def test_code_without_source_has_no_literal_checks():
    """What has no source is left to the run."""
    assert list(written_checks(len)) == []
