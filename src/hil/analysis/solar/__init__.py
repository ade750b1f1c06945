"""Current-voltage curves of solar cells: characteristic figures at reference conditions."""
