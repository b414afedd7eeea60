"""The grid-following converter of the four-VSC benchmark: a transformer, and no filter capacitor."""
