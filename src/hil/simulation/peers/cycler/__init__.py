"""The simulated battery cycler, written from docs/reference/cycler.md."""
