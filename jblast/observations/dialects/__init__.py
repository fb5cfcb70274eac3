"""How logs of other programs are written: text of many kinds, spreadsheets, frames."""
