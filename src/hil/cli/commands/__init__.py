"""The commands of `hil`, one module each; its object `command` is the command."""
