"""A closed membrane: spectral tools, geometry, tangential velocity, symmetry and resampling."""
