"""The cases that come with gfor."""
