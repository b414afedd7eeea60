"""Where a converter helps: how far support at each bus moves the poorly damped modes, and the best places confirmed."""
