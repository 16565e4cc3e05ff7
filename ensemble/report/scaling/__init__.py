"""The scaling report: how the time of an evaluation depends on ranks and vesicles."""
