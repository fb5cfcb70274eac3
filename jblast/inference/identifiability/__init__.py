"""Which directions the data leave open, and what datum would close them."""
