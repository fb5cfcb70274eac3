"""What was written of a film, for a terminal."""

from jblast.report.film.answer import EventsAnswer, FilmAnswer


def film_text(answer: FilmAnswer) -> str:
    """Return how much was written, how exact it is, and where it is."""
    told = (
        f"{answer.frames:,} frames of {answer.width} x {answer.height} "
        f"pixels at {answer.fps:g} Hz from {answer.start_s:g} s"
    )
    if found := answer.found:
        told += (
            f": {found.events:,} events, {found.brighter:,} brighter and "
            f"{found.darker:,} darker; times {found.stamps}, "
            f"within {1e6 * found.stamp_error_s:g} us"
        )
        if found.stamps != "solved for":
            told += " for 99 in 100"
    files = answer.files
    where = filter(None, (files.frames, files.events, files.contact_sheet))
    return "\n".join([told, *where, ""])


def events_text(answer: EventsAnswer) -> str:
    """Return how many events there were, and where they are."""
    return (
        f"{answer.frames:,} frames of {answer.width} x {answer.height} pixels "
        f"over {answer.duration_s:g} s: {answer.events:,} events, "
        f"{answer.brighter:,} brighter and {answer.darker:,} darker\n"
        f"{answer.out}\n"
    )
