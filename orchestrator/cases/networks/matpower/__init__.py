"""MATPOWER's case files (.m): programs, of which the usual statements are carried out."""
