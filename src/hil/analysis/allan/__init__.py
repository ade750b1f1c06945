"""Allan deviations of several estimators with intervals, and noise coefficients read from them."""
