"""What a study comes to before the first participant: bursts, displacements, devices."""
