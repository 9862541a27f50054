"""A study: its file, its values in SI units, and its plate as physics."""
