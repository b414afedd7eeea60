"""Acceptance tests of an FMU: one question each, with verdict, evidence and remedy."""
