"""What other packages offer by entry point, and how it is refused."""

from __future__ import annotations

import sys

import pytest

from hil.documents import offers
from hil.documents.offers import Offers
from hil.model.errors import Refused

CODE = "class Lamp:\n    pass\n"


def problem(name, found):
    """Take classes named Lamp."""
    del name
    return "" if getattr(found, "__name__", "") == "Lamp" else "is no lamp"


@pytest.fixture
def packages(monkeypatch, tmp_path):
    """Install packages in a folder of this test: name, version, entry points and the code of their module."""
    monkeypatch.syspath_prepend(tmp_path)

    def install(name, points, code=CODE):
        info = tmp_path / f"{name}-2.1.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 2.1\n")
        (info / "entry_points.txt").write_text("[lamps]\n" + "".join(f"{key} = {value}\n" for key, value in points))
        (tmp_path / f"{name}.py").write_text(code)

    offers._installed.cache_clear()
    yield install
    offers._installed.cache_clear()
    for module in ("alpha_lamps", "beta_lamps"):
        sys.modules.pop(module, None)


@pytest.fixture
def lamps():
    """Return the offers of the group that these packages use."""
    return Offers("lamps", "lamp", problem, "a class named Lamp")


def test_an_offer_is_found_and_loaded_once(packages, lamps):
    """Its name is known without its module being imported."""
    packages("alpha_lamps", [("red", "alpha_lamps:Lamp"), ("green", "alpha_lamps:Lamp")])
    assert lamps.names == ("green", "red")
    assert "alpha_lamps" not in sys.modules
    assert lamps["red"] is lamps.find("red")
    assert lamps["red"].__name__ == "Lamp"
    assert lamps.find("blue") is None
    assert (list(lamps), len(lamps), "red" in lamps) == (["green", "red"], 2, True)


def test_an_unknown_name_is_refused_with_the_nearest(packages, lamps):
    """A slip of the keyboard gets the right word back; an empty group has another hint."""
    with pytest.raises(Refused, match="unknown lamp 'red'; no package offers any: reinstall hil"):
        lamps["red"]
    offers._installed.cache_clear()
    packages("alpha_lamps", [("red", "alpha_lamps:Lamp")])
    with pytest.raises(Refused, match="unknown lamp 'rad', did you mean 'red'.; installed are red"):
        lamps["rad"]


def test_two_packages_with_one_name_are_refused(packages, lamps):
    """Which of them would be used is chance; both are named."""
    packages("alpha_lamps", [("red", "alpha_lamps:Lamp")])
    packages("beta_lamps", [("red", "beta_lamps:Lamp")])
    both = (
        r"there are several lamps 'red': alpha_lamps:Lamp \(package alpha_lamps 2.1\),"
        r" beta_lamps:Lamp \(package beta_lamps 2.1\); uninstall the packages of all but one"
    )
    with pytest.raises(Refused, match=both):
        lamps["red"]


@pytest.mark.parametrize(
    ("code", "why"),
    [
        ("1 / 0", "ZeroDivisionError: division by zero"),
        ("def", "SyntaxError: invalid syntax"),
        ("", "module 'alpha_lamps' has no attribute 'Lamp'"),
        ("import no_such_module_at_all", "No module named 'no_such_module_at_all'"),
    ],
)
def test_what_cannot_be_imported_is_refused(packages, lamps, code, why):
    """Whatever its module raises is told in a sentence, with its package."""
    packages("alpha_lamps", [("red", "alpha_lamps:Lamp")], code)
    with pytest.raises(Refused) as caught:
        lamps["red"]
    assert str(caught.value).startswith(f"lamp 'red' (package alpha_lamps 2.1) cannot be imported: {why}")
    assert caught.value.hint == "reinstall its package, or repair it"


def test_what_is_something_else_is_refused(packages, lamps):
    """It is told what it should have been."""
    packages("alpha_lamps", [("red", "alpha_lamps:Lamp")], "Lamp = 3\n")
    with pytest.raises(Refused, match="cannot be used: alpha_lamps:Lamp is no lamp") as caught:
        lamps["red"]
    assert lamps.find("red") is None
    assert caught.value.hint == "let its entry point in lamps name a class named Lamp, or uninstall the package"
