"""Results that a study leaves behind: its signals, and the files that hold them."""
