"""The ledger beside the packages: what is said of runs from outside them, in one chain that only grows."""
