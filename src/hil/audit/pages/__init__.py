"""An audit's document for people: one HTML page, and a workbook."""
