"""The chapters of a report, by what was studied."""
