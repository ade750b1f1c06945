"""The guardian's ports: bytes and replies, one thread per port, all outputs in order."""
