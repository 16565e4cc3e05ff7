"""Layer potentials of two-dimensional Stokes flow, and the quadratures and compiled kernels behind them."""
