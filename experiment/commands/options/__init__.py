"""What commands of a study have in common: how they reach a plate, a device, a person."""
