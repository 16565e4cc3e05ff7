"""The stability report: how far runs of stiff and extreme scenes can be trusted."""
