"""SCPI for drivers: sessions that stay in step, the supply role by a table of commands, and bytes that make safe."""
