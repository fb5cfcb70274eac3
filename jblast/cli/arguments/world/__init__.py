"""Worlds as `jblast world` asks for and writes them."""
