"""Two-channel generators that speak SCPI."""
