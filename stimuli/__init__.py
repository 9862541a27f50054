"""What is felt: the strip, the burst and the check of one against the other."""
