"""From a face cross field to quads: seamless map, quantisation, extraction, polish."""
