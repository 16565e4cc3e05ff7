"""The equation of motion: how tangent angles and centers change."""
