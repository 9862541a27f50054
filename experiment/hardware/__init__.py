"""What stands beside the participant: device, clock, slots of the conditions, masking noise."""
