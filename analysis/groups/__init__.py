"""Groups of people: their threshold, and how conditions differ."""
