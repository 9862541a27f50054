"""Equipment of a session: device, clock, slots of the conditions, masking noise."""
