"""The revision of the results: which digits a simulation gives for a scene."""

# Raised by one with the first change after a release that can change a result by more than round-off; runs
# of another revision are other runs.  `tests/solver/test_revision.py` notices such a change and says what
# to do.
RESULTS_REVISION = 4
