"""Sound cards: bursts to actuators, loops to headphones."""
