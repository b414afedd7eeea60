"""Many operating points times outages, each with its critical modes, followed from one to the next."""
