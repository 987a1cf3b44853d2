"""Data sets, training, prediction and evaluation."""
