"""Random blasts: what a scene may say of them."""
