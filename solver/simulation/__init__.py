"""From a scene to a finished run: initial state, resolution and the time loop."""
