"""What a word of EVT 3.0 is: its four upper bits."""

ADDR_Y = 0x0
"""Row: 11 bits; the twelfth says which of two cameras."""

ADDR_X = 0x2
"""An event: its column in 11 bits, and its sign in the twelfth."""

VECT_BASE_X = 0x3
"""Column and sign of the vectors that follow, in the same bits."""

VECT_12, VECT_8 = 0x4, 0x5
"""Which of the next 12 or 8 columns have an event; the next vector goes on there."""

TIME_LOW = 0x6
TIME_HIGH = 0x8
"""Lower and upper 12 bits of 24 bits of microseconds; beyond, they begin again."""

WITHOUT_EVENTS = (0x7, 0xA, 0xE, 0xF)
"""Triggers of other devices, and what vendors add."""

KNOWN = (ADDR_Y, ADDR_X, VECT_BASE_X, VECT_12, VECT_8, TIME_LOW, TIME_HIGH)

LARGEST = 1 << 11
"""Columns or rows that have a number [px]."""

PERIOD = 1 << 12
"""Microseconds of one step of `TIME_HIGH`, and steps until it begins again."""
