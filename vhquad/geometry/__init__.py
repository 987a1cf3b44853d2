"""Intrinsic geometry: frames, Laplacians, spectra, curvature, input features."""
