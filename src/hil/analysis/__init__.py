"""Numbers from arrays: noise, magnetics and statistics, usable from any notebook."""
