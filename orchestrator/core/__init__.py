"""Foundations of every floor above: errors, units, arrays, options, files."""
