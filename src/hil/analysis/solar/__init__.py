"""Current-voltage curves of solar cells: characteristic figures at stated conditions."""
