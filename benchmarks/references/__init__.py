"""Independent references for physical laws: closed forms, brute-force sums and motions, for the tests and the
gallery."""
