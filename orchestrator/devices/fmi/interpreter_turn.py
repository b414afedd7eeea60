"""Threads take turns: FMUs with Python inside share one interpreter, its modules and its search path."""

import threading

turn = threading.RLock()
"""Held by the thread that opens or closes FMUs of this process, or computes a study with them; others wait."""
