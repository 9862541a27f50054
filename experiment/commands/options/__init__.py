"""Options that describe a plate, a device, a responder, or a session to resume."""
