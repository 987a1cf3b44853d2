"""vhquad: from a triangle mesh to an all-quad mesh whose edges flow as an artist would draw them."""
