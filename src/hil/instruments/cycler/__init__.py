"""The battery cycler of docs/reference/cycler.md, both levels of its protocol."""
