"""Independent references of physical laws: closed forms, brute-force sums and rigs, for the tests and the gallery."""
