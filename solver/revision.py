"""The revision of the results: which digits a simulation gives for a scene."""

# Raised by one with every change that can change a digit of a result; runs of another revision are other
# runs.  `tests/solver/test_revision.py` notices such a change and says what to do.
RESULTS_REVISION = 4
