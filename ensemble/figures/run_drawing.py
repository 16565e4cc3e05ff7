"""A run as a file: its figure or its movie."""

from __future__ import annotations

from pathlib import Path

from ensemble.config.figure_options import USUAL, FigureOptions, OnPicture
from ensemble.figures.figure_files import FIGURE_SUFFIXES, save, suffix_among
from ensemble.figures.fitted import fitted_run_figure
from ensemble.figures.history import run_figure
from solver.analysis.run import Run


def draw_run(run: Run, output: Path, options: FigureOptions, on_progress: OnPicture | None = None) -> None:
    """Draw what happened in a run, or its movie.

    Parameters
    ----------
    run : Run
    output : Path
        Its suffix names the format.
    options : FigureOptions
        Of a figure.
    on_progress : callable, optional
        Takes the number of pictures of a movie that are drawn, and of all.

    Raises
    ------
    ValueError
        If there is no such format, a movie is given options of a figure, or the size is too small.
    """
    from ensemble.figures.movie import MOVIE_SUFFIXES, save_movie

    if suffix_among(output, (*FIGURE_SUFFIXES, *MOVIE_SUFFIXES)) in MOVIE_SUFFIXES:
        if options != USUAL:
            raise ValueError(f"output: a movie has no size, dpi or svg-text, got {output.name!r}")
        save_movie(run, output, on_progress)
    else:
        figure = run_figure(run) if options.size is None else fitted_run_figure(run, options.size)
        save(figure, output, options)


def refuse_movie(output: Path, answer: str) -> None:
    """Raise an error if a file is a movie, for an answer that can only be a figure.

    Parameters
    ----------
    output : Path
    answer : str
        What the answer is, for the message: such as ``critical-hamaker is a boundary``.

    Raises
    ------
    ValueError
    """
    from ensemble.figures.movie import MOVIE_SUFFIXES

    if output.suffix.lower() in MOVIE_SUFFIXES:
        raise ValueError(f"output: only a run can be a movie, {answer}, got {output.name!r}")
