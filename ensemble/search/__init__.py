"""What to run next: the search for critical values, its certification, and studies. No MPI, no files."""
