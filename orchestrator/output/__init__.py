"""Recordings, tables and reports."""
