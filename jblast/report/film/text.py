"""What was written of a film, for a terminal."""

from jblast.report.film.answer import EventsAnswer, FilmAnswer


def film_text(answer: FilmAnswer) -> str:
    """Return how much was written, how exact it is, and where it is."""
    summary = (
        f"{answer.frames:,} frames of {answer.width} x {answer.height} "
        f"pixels at {answer.fps:g} Hz from {answer.start_s:g} s"
    )
    if found := answer.found:
        summary += (
            f": {found.events:,} events, {found.brighter:,} brighter and "
            f"{found.darker:,} darker; times {found.stamps}, "
            f"within {1e6 * found.stamp_error_s:g} us"
        )
        if found.stamps != "solved for":
            summary += " for 99 in 100"
    if answer.lifted_m is not None:
        summary += (
            ".\nThe pictures show a burst on the ground; this one is higher than half "
            f"its fireball's radius, and they hover at {answer.lifted_m:.3g} m"
        )
    files = answer.files
    where = (files.frames, files.events, _video(answer), files.contact_sheet)
    return "\n".join([summary, *filter(None, where), ""])


def _video(answer: FilmAnswer) -> str | None:
    """Return where the video is, and how fast it runs."""
    if answer.video_fps is None:
        return None
    slower = answer.fps / answer.video_fps
    if abs(slower - 1) < 5e-3:
        pace = "as fast as"
    elif slower > 1:
        pace = f"{slower:.3g} times slower than"
    else:
        pace = f"{1 / slower:.3g} times faster than"
    return f"{answer.files.video} ({answer.video_fps:g} Hz, {pace} the blast)"


def dark_film(share: float, darkest: float) -> str:
    """Return the warning of a film with pixels below the floor of the light."""
    return (
        f"{100 * share:.2g} % of the pixel values are darker than {darkest:.3g} of "
        "full scale; changes below that level give no events (--darkest sets it)"
    )


def events_text(answer: EventsAnswer) -> str:
    """Return how many events there were, and where they are."""
    return (
        f"{answer.frames:,} frames of {answer.width} x {answer.height} pixels "
        f"over {answer.duration_s:g} s: {answer.events:,} events, "
        f"{answer.brighter:,} brighter and {answer.darker:,} darker\n"
        f"{answer.out}\n"
    )
