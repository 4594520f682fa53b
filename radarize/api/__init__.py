"""What `import radarize as rz` offers, and the commands call: a function a command, plain results."""
