"""How the equations of a strip are solved: one load at one frequency, endless or with ends."""
