"""A virtual IWR1843BOOST with a DCA1000, for software that has no radar at hand."""
