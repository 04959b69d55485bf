"""Tests of the law `predictive`, the package afm_predictive."""
