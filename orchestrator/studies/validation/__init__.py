"""A device's model beside recordings of the plant: the recorded voltage drives it, and its P and Q are compared."""
