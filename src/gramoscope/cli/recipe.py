"""`gramoscope recipe`: show how captures are read."""

from __future__ import annotations

from gramoscope.cli.terminal import FINE, Terminal


def recipe(name: str | None = None, /) -> int:
    """Show the recipes that ship with us, or print one, to be copied and changed.

    `gramoscope recipe seed-paper > mine.toml`, change what you like in `mine.toml`, and `gramoscope play CAPTURE --out DIR
    --recipe mine.toml`.

    Parameters
    ----------
    name
        Recipe to print, or a file to check and print; all names when left out.
    """
    from gramoscope.player.recipe import load_recipe, recipe_text, shipped_recipes

    if name is not None:
        load_recipe(name)
        print(recipe_text(name), end="")
        return FINE
    Terminal().table({each: load_recipe(each).about for each in shipped_recipes()})
    return FINE
