"""Signatures of bytes: SSH's and those of a PEM key, in an envelope that other programs verify too."""
