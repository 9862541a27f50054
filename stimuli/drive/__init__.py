"""What drives a load over time: bursts, samples, noise; and whether a strip is fit for it."""
