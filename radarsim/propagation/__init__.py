"""From a scene to propagation paths: scatterers, reflectors, visibility, amplitudes."""
