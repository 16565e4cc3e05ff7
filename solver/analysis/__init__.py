"""What is measured along a run, and when and how a run is decided."""
