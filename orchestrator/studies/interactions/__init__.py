"""Converters of several vendors in one network: which modes they share, and which of them do not agree."""
