"""The displacement of a strip, over frequency, over the plate and over time."""
