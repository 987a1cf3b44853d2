"""The command line. One module a command; commands hold no geometry and import late."""
