"""The work-precision report: error against run time of every integrator in short scenes."""
