"""`python -m hil.cli` is `hil`."""

from __future__ import annotations

from hil.cli.entry import main

main()
