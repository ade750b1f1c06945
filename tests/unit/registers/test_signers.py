"""The register of signers: who a name is, and who holds which role on which day."""

from __future__ import annotations

import pytest

from hil.model.errors import ConfigurationError, Refused
from hil.registers.signers import load_signers

GOOD = """schema: hil/signers/1
signers:
- principal: ada@example.org
  name: Ada Lovelace
  also: [Ada]
  roles:
  - {role: test, since: "2026-01-01"}
- principal: bo@example.org
  name: Bo
  roles:
  - {role: quality, since: "2026-01-01", until: "2026-06-30"}
"""


def loaded(tmp_path, text):
    """Return the register of a folder of fixtures with this text."""
    (tmp_path / "signers.yaml").write_text(text)
    return load_signers(tmp_path)


def test_a_person_has_several_names_and_holds_roles_for_a_time(tmp_path):
    """First and last day count."""
    signers = loaded(tmp_path, GOOD)
    ada, bo = signers.people
    assert signers.called("  ADA  lovelace ") is signers.called("ada") is signers.find("ada@example.org") is ada
    assert signers.called("") is None
    assert [bo.holds("quality", day) for day in ("2025-12-31", "2026-01-01", "2026-06-30", "2026-07-01")] == [
        False,
        True,
        True,
        False,
    ]
    assert ada.holds("test", "2099-01-01")
    assert not ada.holds("quality", "2026-01-01")
    with pytest.raises(Refused, match=r"'bo@example.com' is not in fixtures/signers.yaml, did you mean"):
        signers.find("bo@example.com")


def test_without_a_register_it_has_to_be_written_first(tmp_path):
    """Nobody is in a register that does not exist: its list of names would be empty."""
    with pytest.raises(Refused) as refused:
        load_signers(tmp_path).find("bo@example.com")
    assert refused.value.hint == "no signer is registered yet: write that file first"


def test_a_workspace_says_what_a_package_needs(tmp_path):
    """Nothing, unless it says so."""
    assert (loaded(tmp_path, GOOD).required.signature, loaded(tmp_path, GOOD).required.approvals) == (False, ())
    asked = loaded(tmp_path, f"{GOOD}required: {{signature: true, approvals: [quality]}}\n").required
    assert (asked.signature, asked.approvals) == (True, ("quality",))


def test_without_a_register_nobody_signs(tmp_path):
    """A workspace need not have one."""
    assert load_signers(tmp_path).people == ()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("name: Bo", "name: ada", "'ada' names ada@example.org already: every name belongs to one person"),
        ("2026-06-30", "2026-06-31", "the date 2026-06-31 does not exist"),
        ("role: quality", "role: Q A", "a word in small letters"),
        ("principal: bo@example.org", "principal: '*'", "a name such as ada@example.org"),
        ("also:", "alias:", "unknown key 'alias'"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(tmp_path, old, new, said):
    """All of it, at once."""
    with pytest.raises(ConfigurationError) as raised:
        loaded(tmp_path, GOOD.replace(old, new))
    assert said in str(raised.value)
    assert "signers.yaml:" in str(raised.value)
