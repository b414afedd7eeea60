"""A stiff source behind an impedance, for a device alone: with a voltage dip and a load step at times of their own."""
