"""Literal checks are found in a case's code before it runs."""

from __future__ import annotations

from hil.plugin.plans.literals import given_to, returned_lines, written_checks, written_names


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


def names(supply, parameters, clock):
    """Take names of every kind."""
    supply.coil.configure(parameters.volts, supply.limits["a"].high)
    clock = None
    clock.sleep(1)
    other.thing()  # noqa: F821 - read, never called


def test_names_that_are_taken_from_arguments_are_found():
    """Whole paths with their place; what is bound again, or no argument, is left out."""
    found = {one.path: (one.line - names.__code__.co_firstlineno, one.column) for one in written_names(names)}
    assert found == {
        ("supply", "coil", "configure"): (2, 5),
        ("parameters", "volts"): (2, 27),
        ("supply", "limits"): (2, 45),
    }


def test_functions_that_are_given_a_name_are_found():
    """By place or by name, under that very name only."""
    source = b"one(1, parameters)\ntwo(given=parameters)\nthree(parameters.x)\nfour(other)\n"
    assert given_to(source, "parameters") == {"one", "two"}
    assert given_to(b"def (", "parameters") == set()


def returning(values):
    """Return something in one place."""

    def inner():
        return 1

    if not inner():
        return None
    with values:
        return values == [1]


def test_what_a_function_returns_is_found_in_its_own_lines():
    """Functions within it may return what they like, and nothing is nothing."""
    assert returned_lines(returning) == (returning.__code__.co_firstlineno + 9,)
    assert returned_lines(names) == ()
