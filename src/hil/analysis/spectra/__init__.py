"""Power spectra by Welch's method, spectral lines, and noise coefficients from bands."""
