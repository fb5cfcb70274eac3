"""A scene's vehicles flown through its blasts, one or many."""
