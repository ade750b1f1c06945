"""The ledger beside the packages: entries about runs from outside them, in one append-only chain."""
