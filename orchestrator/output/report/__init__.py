"""Results for people and for other programs: labelled files, tables, plots."""
