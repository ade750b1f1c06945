"""How a run ends: who stops it, its exit code, and what a named person acknowledges afterwards."""
