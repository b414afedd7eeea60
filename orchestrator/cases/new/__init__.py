"""A new case file from the files of a network."""
