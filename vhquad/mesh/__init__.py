"""Triangle and quad meshes: reading, repair, topology, quality."""
