"""Options that select a device or a responder, and what follows from them."""
