"""EVT 3.0, the raw files of Prophesee's event cameras.

A text header, line by line "% keyword value", then words of 16 bits, little-endian:
four bits say what a word is, twelve hold it. A word changes the state of the decoder
(the time's upper and lower 12 bits, the row, the column that vectors begin at), or
gives events.

We encode and decode it ourselves: expelliarmus 1.1.12 loses the time of events where
4,096 us or more pass without one, and knows neither an empty file nor its size.

References:
    Prophesee, Metavision documentation: EVT 3.0 format; RAW file format.
"""
