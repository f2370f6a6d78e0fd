"""Prediction and correction of one particle."""
