"""The strip: its material, its edges, and the waves that it carries or cuts off."""
