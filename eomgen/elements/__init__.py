"""What every element that a model is made of has in common: the keys of its entry, and how an entry is read."""
