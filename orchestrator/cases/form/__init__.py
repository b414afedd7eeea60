"""The form of a case file: its tables, names, values, and the places of all of them for errors."""
