"""The tasks that a participant can be given; one module each."""
