"""Allan deviations by several estimators, with confidence intervals, and noise coefficients derived from them."""
