"""What a passage taught a cartridge, for itself: kept beside the reading, so that a passage is learned once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gramoscope.pickup.cartridge import Cartridge, Pickup
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.learning import Lesson
from gramoscope.pickup.texture_likelihood import TextureLikelihood, TexturePickup
from gramoscope.player.files_seen import FileSeen
from gramoscope.signal_path import FrameGroup


@dataclass(frozen=True, eq=False)
class TextureLessons:
    """What a `TexturePickup` has beside its cartridge; see there.

    Attributes
    ----------
    layout : StripeLayout
    usual_sharpness : float
    lessons : tuple of Lesson
    fold : mapping
    """

    layout: StripeLayout
    usual_sharpness: float
    lessons: tuple[Lesson, ...]
    fold: Mapping[int, int]


@dataclass(frozen=True, eq=False)
class Learned:
    """What a passage taught, and from which files.

    Attributes
    ----------
    texture : TextureLessons or None
        None for a cartridge that learns nothing.
    files : tuple of FileSeen
        Of the groups that were learned from.
    """

    texture: TextureLessons | None
    files: tuple[FileSeen, ...]


def learned_of(pickup: Pickup, files: tuple[FileSeen, ...]) -> Learned:
    """Return what a pickup has learned, from these files."""
    if not isinstance(pickup, TexturePickup):
        return Learned(None, files)
    return Learned(TextureLessons(pickup.layout, pickup.usual_sharpness, pickup.lessons, pickup.fold), files)


def pickup_of(cartridge: Cartridge, learned: Learned) -> Pickup:
    """Return the pickup that a cartridge became by learning."""
    if isinstance(cartridge, TextureLikelihood) and learned.texture is not None:
        known = learned.texture
        return TexturePickup(cartridge, known.layout, known.usual_sharpness, known.lessons, known.fold)
    # one that learns nothing is its own pickup, whatever it is given to learn from
    return cartridge.learn(_nothing, 0, map)


def _nothing(number: int) -> FrameGroup:
    raise IndexError(number)
