"""Cross fields: representation, files, alignment, singularities."""
