"""What every request passes through, and the shape of every answer."""
