"""The Vector Heat Network: layers, loss, checkpoints."""
