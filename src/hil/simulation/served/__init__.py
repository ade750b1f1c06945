"""The served bench: the simulated world as a process of its own, for clients that are not ours."""
