"""The studies: what a case is asked, each in a room of its own."""
