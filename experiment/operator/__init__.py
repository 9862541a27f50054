"""The operator beside a session: what is shown to them, and what they ask for."""
