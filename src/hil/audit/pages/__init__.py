"""An audit's document for people: lines of a terminal, one HTML page, and a workbook."""
