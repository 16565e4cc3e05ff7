"""How the time of an evaluation depends on ranks and vesicles, and what that predicts."""
