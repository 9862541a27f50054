"""The operator of a session: the display, and the operator's requests."""
