"""The served bench: the simulated world in a separate process, for third-party clients."""
