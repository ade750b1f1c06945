"""Printing: which browser is taken, and what is said where none is there or it prints nothing."""

from __future__ import annotations

import os

import pytest

from hil.model.errors import Refused
from hil.report.printing import print_page


def browser(folder, script):
    """Put a browser of that behaviour on the path."""
    path = folder / "chromium"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


@pytest.fixture
def place(tmp_path, monkeypatch):
    """The first folder on the path."""
    monkeypatch.setenv("PATH", os.pathsep.join((str(tmp_path), os.environ["PATH"])))
    return tmp_path


def test_without_a_browser_it_says_what_to_install(tmp_path, monkeypatch):
    """The way out is a package, or any browser by hand."""
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(Refused, match="no browser") as caught:
        print_page(b"<p>", tmp_path / "a.pdf")
    assert "apt install chromium" in str(caught.value)


def test_what_a_browser_printed_is_kept(place):
    """It is given the page as a file, and the PDF is copied to where it was asked for."""
    browser(
        place, 'for each in "$@"; do case $each in --print-to-pdf=*) printf "%%PDF-1.4" > "${each#*=}";; esac; done'
    )
    print_page(b"<p>", place / "a.pdf")
    assert (place / "a.pdf").read_bytes() == b"%PDF-1.4"
    with pytest.raises(Refused, match="cannot be written"):
        print_page(b"<p>", place / "none" / "a.pdf")


def test_a_browser_that_prints_nothing_is_an_error(place):
    """Its last words are told."""
    browser(place, "echo 'no display' >&2")
    with pytest.raises(Refused, match="printed nothing: no display"):
        print_page(b"<p>", place / "a.pdf")
